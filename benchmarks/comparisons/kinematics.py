"""One step of inverse kinematics of a library, for `compare.py`: `python kinematics.py wbc|Pink|mink|PlaCo SCENE.json`.

Timed: writing the target, solving for velocities with limits of positions and velocities, integrating them, and the
kinematics of the next configuration. Each class has the scene in the terms of its library.
"""

from __future__ import annotations

import json
import math
import sys
import xml.etree.ElementTree as ET
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
from balance import Scene, timings

with suppress(ImportError):  # each environment has some of them
    import placo
with suppress(ImportError):
    import wbc
with suppress(ImportError):
    import pink
    import pinocchio as pin
with suppress(ImportError):
    import mink
    import mujoco


@dataclass(frozen=True, kw_only=True)
class KinematicScene(Scene):
    """A hand on a circle: an arm that is bolted, or a humanoid on two feet with a task of its centre of mass.

    Attributes:
        hand: Frame of the hand.
        radius: Radius of the circle, in the plane of y and z, m.
        frequency: Turns per second, Hz.
        posture_cost: Cost per rad of the posture; the other tasks cost 1 per m and rad.
        gain: Share of the error that a step takes away.
        period: Period of a step, s.
        warm_up: Steps before the measured ones.
        steps: Steps measured.
    """

    hand: str
    radius: float = 0.05
    frequency: float = 0.5
    posture_cost: float = 1e-2
    gain: float = 0.1
    period: float = 0.01
    warm_up: int = 300
    steps: int = 3000

    def offset(self, step: int) -> tuple[float, float, float]:
        """Return the offset of the hand's target from its start, m."""
        angle = 2.0 * math.pi * self.frequency * self.period * step
        return 0.0, self.radius * math.sin(angle), self.radius * (math.cos(angle) - 1.0)


class Wbc:
    """This library."""

    def __init__(self, scene: KinematicScene) -> None:
        if scene.soles:
            robot = wbc.load_robot(scene.robot).robot()
        else:
            robot = wbc.RobotDescription.from_urdf(scene.urdf, base="fixed").robot()
        q = robot.q.copy()
        if scene.soles:
            q[2] = scene.base_height
        for joint, value in scene.posture.items():
            q[robot.base_nq + robot.joint_index(joint)] = value
        robot.update(q, robot.v)
        rate = scene.gain / scene.period
        ik = self.ik = wbc.InverseKinematics(robot, scene.period)
        if scene.soles:
            ik.add(
                *(wbc.SoleContact(sole) for sole in ("left_foot", "right_foot")),
                wbc.CoMTask(weight=1.0, rate=rate),
            )
        ik.add(wbc.PostureTask(weight=scene.posture_cost**2, rate=rate), wbc.JointLimits())
        self.hand = ik.add(wbc.PoseTask(scene.hand, rate=rate))
        self.target, self.version = self.hand.target.copy(), version("wbc")
        self.start = self.target.translation.copy()

    def step(self, place: Any) -> None:
        self.target.translation = place
        self.hand.target = self.target
        self.ik.step()

    def place(self) -> Any:
        return self.ik.robot.placement(self.hand.frame).translation


class Configured:
    """Step of Pink and of mink, which have it in common: tasks, limits and feet as constraints, solved by DAQP."""

    configuration: Any
    solve: Any
    tasks: list[Any]
    limits: list[Any]
    feet: list[Any]
    period: float

    def advance(self, **options: Any) -> None:
        """Solve for velocities and integrate them."""
        velocity = self.solve(
            self.configuration,
            self.tasks,
            self.period,
            solver="daqp",
            limits=self.limits,
            constraints=self.feet or None,
            **options,
        )
        self.configuration.integrate_inplace(velocity, self.period)


class Pink(Configured):
    """Pink, with DAQP."""

    def __init__(self, scene: KinematicScene) -> None:
        root = (pin.JointModelFreeFlyer(),) if scene.soles else ()
        model = pin.buildModelFromXML(scene.urdf, *root)
        q = pin.neutral(model)
        for joint, value in scene.posture.items():
            q[model.joints[model.getJointId(joint)].idx_q] = value
        if scene.soles:
            q[2] = scene.base_height
        self.configuration = pink.Configuration(model, model.createData(), q)
        self.hand = pink.FrameTask(scene.hand, 1.0, 1.0, gain=scene.gain)
        posture = pink.PostureTask(scene.posture_cost, gain=scene.gain)
        self.tasks, self.feet = [self.hand, posture], []
        if scene.soles:
            self.tasks.append(pink.tasks.ComTask(1.0, gain=scene.gain))
            self.feet = [pink.FrameTask(sole, 1.0, 1.0, gain=scene.gain) for sole in scene.soles]
        for task in (*self.tasks, *self.feet):
            task.set_target_from_configuration(self.configuration)
        self.limits = [pink.limits.ConfigurationLimit(model, 1.0), pink.limits.VelocityLimit(model)]
        self.solve, self.period, self.frame = pink.solve_ik, scene.period, scene.hand
        self.target, self.version = self.hand.transform_target_to_world, version("pin-pink")
        self.start = self.target.translation.copy()

    def step(self, place: Any) -> None:
        self.target.translation = place
        self.hand.set_target(self.target)
        self.advance(safety_break=False)

    def place(self) -> Any:
        return self.configuration.get_transform_frame_to_world(self.frame).translation


class Mink(Configured):
    """mink, with DAQP."""

    def __init__(self, scene: KinematicScene) -> None:
        spec = mujoco.MjSpec.from_string(scene.urdf)
        spec.compiler.fusestatic = False
        if scene.soles:
            spec.worldbody.first_body().add_freejoint()
        model = spec.compile()
        data = mujoco.MjData(model)
        for joint, value in scene.posture.items():
            data.qpos[model.joint(joint).qposadr[0]] = value
        if scene.soles:
            data.qpos[2] = scene.base_height
        self.configuration = mink.Configuration(model, data.qpos)
        self.hand = mink.FrameTask(scene.hand, "body", 1.0, 1.0, gain=scene.gain)
        self.tasks = [self.hand, mink.PostureTask(model, scene.posture_cost, gain=scene.gain)]
        self.feet = [mink.FrameTask(sole, "body", 1.0, 1.0, gain=scene.gain) for sole in scene.soles]
        if scene.soles:
            self.tasks.append(mink.ComTask(1.0, gain=scene.gain))
        for task in (*self.tasks, *self.feet):
            task.set_target_from_configuration(self.configuration)
        speeds = {joint: speed for joint, speed in speed_limits(scene.urdf).items() if joint in scene.posture}
        self.limits = [mink.ConfigurationLimit(model, 1.0), mink.VelocityLimit(model, speeds)]
        self.solve, self.period, self.frame, self.transform = (
            mink.solve_ik,
            scene.period,
            scene.hand,
            mink.SE3,
        )
        pose = self.configuration.get_transform_frame_to_world(scene.hand, "body")
        self.rotation, self.start, self.version = pose.rotation(), pose.translation().copy(), version("mink")

    def step(self, place: Any) -> None:
        self.hand.set_target(self.transform.from_rotation_and_translation(self.rotation, place))
        self.advance()

    def place(self) -> Any:
        return self.configuration.get_transform_frame_to_world(self.frame, "body").translation()


class PlaCo:
    """PlaCo, with its own solver."""

    def __init__(self, scene: KinematicScene) -> None:
        robot = self.robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, scene.urdf)
        base = np.eye(4)
        base[2, 3] = scene.base_height
        robot.set_T_world_fbase(base)
        for joint, value in scene.posture.items():
            robot.set_joint(joint, value)
        robot.update_kinematics()
        solver = self.solver = placo.KinematicsSolver(robot)
        solver.dt = scene.period
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        self.pose = robot.get_T_world_frame(scene.hand)
        self.hand = solver.add_frame_task(scene.hand, self.pose)
        self.hand.configure("hand", "soft", 1.0, 1.0)
        posture = solver.add_joints_task()
        posture.set_joints(scene.posture)
        posture.configure("posture", "soft", scene.posture_cost**2)
        if scene.soles:
            for sole in scene.soles:
                solver.add_frame_task(sole, robot.get_T_world_frame(sole)).configure(sole, "hard", 1.0, 1.0)
            com = solver.add_com_task(robot.com_world())
            com.configure("com", "soft", 1.0)
        else:
            solver.mask_fbase(True)
        self.frame, self.start, self.version = scene.hand, self.pose[:3, 3].copy(), version("placo")

    def step(self, place: Any) -> None:
        self.pose[:3, 3] = place
        self.hand.T_world_frame = self.pose
        self.solver.solve(True)
        self.robot.update_kinematics()

    def place(self) -> Any:
        return self.robot.get_T_world_frame(self.frame)[:3, 3]


def speed_limits(urdf: str) -> dict[str, float]:
    """Joint → greatest speed, rad/s, of a URDF."""
    joints = ET.fromstring(urdf).findall("joint")
    return {
        str(joint.get("name")): float(limit.get("velocity", "inf"))
        for joint in joints
        if (limit := joint.find("limit")) is not None
    }


LIBRARIES = {"wbc": Wbc, "Pink": Pink, "mink": Mink, "PlaCo": PlaCo}


def run(library: str, scene: KinematicScene) -> str:
    """Run a scene with a library and return the record."""
    solver = LIBRARIES[library](scene)
    durations, off = [], 0.0
    for number in range(scene.warm_up + scene.steps):
        place = solver.start + scene.offset(number)
        start = perf_counter_ns()
        solver.step(place)
        stop = perf_counter_ns()
        if number >= scene.warm_up:
            durations.append(stop - start)
            off = max(off, float(np.linalg.norm(solver.place() - place)))
    return json.dumps({"version": solver.version, **timings(durations), "error_mm": round(1e3 * off, 3)})


if __name__ == "__main__":
    print(run(sys.argv[1], KinematicScene.load(Path(sys.argv[2]))))
