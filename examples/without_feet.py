"""A robot without soles: a quadruped stands on four points and sways.

The QP is that of a humanoid: the foot of a quadruped is a `PointContact`, an arm is described with `base="fixed"`.
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from _common import parse, report

import wbc
from wbc.core.conventions import (
    configuration_from_mujoco,
    configuration_to_mujoco,
    velocity_from_mujoco,
)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example: MuJoCo's own loop, with the true state."""
    options = parse(__doc__, arguments, seconds=4.0)
    description = wbc.load_robot("go1")
    robot, feet = description.robot(), ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    spec = mujoco.MjSpec.from_string(description.urdf_without_geometry())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], pos=[0, 0, -0.02])
    spec.worldbody.first_body().add_freejoint()
    for joint in robot.joint_names:
        spec.joint(joint).armature = description.armature[joint]
        spec.add_actuator(target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    for link, place in map(description.attachment, feet):
        spec.body(link).add_geom(size=[0.02] * 3, pos=place.translation)
    model = spec.compile()
    data, joints = mujoco.MjData(model), [model.joint(joint) for joint in robot.joint_names]
    places, dofs = np.array([(joint.qposadr[0], joint.dofadr[0]) for joint in joints]).T
    q = robot.configuration()
    q[2] = -min(robot.placement(foot).translation[2] for foot in feet)
    configuration_to_mujoco(q, places, data.qpos)
    robot.update(q, robot.v)
    controller = wbc.Controller(robot, model.opt.timestep)
    moved = controller.add(wbc.CoMTask())
    controller.add(wbc.OrientationTask(robot.base_frame, weight=10.0), wbc.PostureTask())
    controller.add(wbc.JointLimits(), wbc.TorqueLimits(), *map(wbc.PointContact, feet))
    start, radius = moved.target, 0.03
    with options.watch(description) as view:
        while data.time < options.seconds:
            turn = np.array([0.0, np.sin(np.pi * data.time), np.cos(np.pi * data.time)])
            moved.target, moved.feedforward_acceleration = start + radius * turn, -(np.pi**2) * radius * turn
            moved.feedforward_velocity = np.pi * radius * np.array([0.0, turn[2], -turn[1]])
            q = configuration_from_mujoco(data.qpos, places)
            controller.update(q, velocity_from_mujoco(q, data.qvel, dofs))
            data.ctrl = controller.solve().torques
            mujoco.mj_step(model, data)
            view.update(robot)
    return report(error_mm=1e3 * float(np.linalg.norm(moved.error)), solved=controller.solution.ok)


if __name__ == "__main__":
    main()
