"""Signals of the true state: of a plant, of any other loop, and of the furniture.

A plant is copied from MuJoCo's state; of another loop the truth is what it says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

import mujoco
import numpy as np
import pinocchio as pin

from wbc.app.log.signals import (
    XY,
    XYZ,
    Signals,
    Tick,
    TickPart,
    add_motion,
    cached,
    foot_names,
    joint_units,
    position_signal,
    torque_units,
)
from wbc.base.numbers import Array
from wbc.core.conventions import configuration_from_mujoco, velocity_from_mujoco
from wbc.core.robot import Robot
from wbc.sim.plant.grips import SCENE_PREFIX
from wbc.sim.plant.plant import Plant
from wbc.tasks.stabilizer.pendulum import dcm


def add_plant(signals: Signals, tick: Tick) -> None:
    """Describe base, joints, soles, centre of mass and pushes of a plant, copied from MuJoCo's state."""
    plant = cast(Plant, tick.plant)
    model, data = plant.model, plant.data
    own = [i for i in range(1, model.njnt) if plant.of_robot[model.jnt_bodyid[i]]]
    joints = [model.joint(i) for i in own]
    units = ["m" if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE else "rad" for joint in joints]
    end, base = 7 + len(joints), int(model.jnt_bodyid[0])  # furniture comes after the robot
    sites = [model.site(foot.wrench_site).id for foot in plant.feet]
    still = np.array([math.nan] * 3 + [0.0] * 3)

    def state(_: Tick) -> TrueState:
        mujoco.mj_subtreeVel(model, data)
        q = configuration_from_mujoco(data.qpos[:end])
        v = velocity_from_mujoco(q, data.qvel[:6])
        com, velocity, feet = data.subtree_com[base], data.subtree_linvel[base], data.site_xpos[sites]
        return TrueState(q, v, plant.joint_torque, com, velocity, feet.ravel())

    def push(_: Tick) -> Array:
        forces = data.xfrc_applied[:, :3]
        if not forces.any():
            return still
        body = int(np.argmax(np.square(forces).sum(axis=1)))
        return np.concatenate([data.xipos[body], forces[body]])

    _add_true_state(signals, tick, state, [joint.name for joint in joints], units)
    parts = [f"truth/push/{kind}/{axis}" for kind in ("point", "force") for axis in XYZ]
    about = "point of attack of the largest push, and its force, world"
    signals.each(parts, ["m"] * 3 + ["N"] * 3, about, push)
    if furniture := furniture_signals(plant):
        names, units, found = (list(each) for each in zip(*furniture, strict=True))
        places = np.array(found, dtype=np.intp)
        signals.each(
            names, units, "of the furniture, as MuJoCo counts it, world", lambda _: data.qpos[places]
        )


def add_truth(signals: Signals, tick: Tick) -> None:
    """Describe the true state of a loop that is no plant, under the names of a plant's."""
    robot = tick.robot.clone()

    def state(tick: Tick) -> TrueState | None:
        truth = tick.truth
        if truth is None:
            return None
        pin.framesForwardKinematics(robot.model, robot.data, truth.q)
        feet = np.ravel([robot.placement(sole.frame).translation for sole in robot.soles])
        return TrueState(truth.q, truth.v, truth.joint_torque, truth.com, truth.com_velocity, feet)

    names, units = robot.joint_names, joint_units(robot)
    _add_true_state(signals, tick, state, names, units)


class TrueState(NamedTuple):
    """True state of a robot: configuration with the joints of soft soles, velocity, torques, CoM and sole centres."""

    q: Array
    v: Array
    joint_torque: Array
    com: Array
    com_velocity: Array
    feet: Array


def _add_true_state(
    signals: Signals,
    tick: Tick,
    state: Callable[[Tick], TrueState | None],
    joints: Sequence[str],
    units: Sequence[str],
) -> None:
    robot, group, found = tick.robot, signals.group, cached(state)
    true = TickPart(found)

    nq = robot.base_nq
    if nq:
        pose, velocity = true(lambda s: s.q[:7]), true(lambda s: s.v[:6])
        add_motion(signals, "truth/base", "base", "base frame", pose, velocity)
    names = [position_signal(joint, robot) for joint in joints]
    signals.each(names, units, "without sensor errors", true(lambda s: s.q[nq:]))
    about = "last applied by the drives"
    group("truth/joint/torque", robot.joint_names, torque_units(robot), about, true(lambda s: s.joint_torque))
    group("truth/com", XYZ, "m", "of everything, feet included, world", true(lambda s: s.com))
    group("truth/com_velocity", XYZ, "m/s", "world", true(lambda s: s.com_velocity))
    soles = [f"truth/foot/{foot}/position/{axis}" for foot in foot_names(robot) for axis in XYZ]
    signals.each(soles, "m", "sole centre, world", true(lambda s: s.feet))
    about = "torque over its limit in the direction in which it acts"

    def ratio(state: TrueState) -> Array:
        return np.copysign(robot.torque_share(state.joint_torque), state.joint_torque)

    group("truth/joint/torque_ratio", robot.joint_names, "1", about, true(ratio))
    if tick.walking is not None:
        group("truth/dcm", XY, "m", "world", lambda t: dcm_of(t, found(t)))


def dcm_of(tick: Tick, state: Robot | TrueState | None) -> Array | None:
    """Return the DCM of an estimated or true state; None without a reference."""
    if tick.reference is None or state is None:
        return None
    return dcm(state.com[:2], state.com_velocity[:2], tick.reference.pendulum.omega)


def furniture_signals(plant: Plant) -> list[tuple[str, str, int]]:
    """Return name, unit and place in MuJoCo's positions of each coordinate of the furniture that moves."""
    model, kinds, found = plant.model, mujoco.mjtJoint, dict[str, tuple[str, int]]()
    place = [(f"position/{axis}", "m") for axis in XYZ]
    turn = [(f"orientation/{axis}", "1") for axis in "wxyz"]
    parts = {
        kinds.mjJNT_FREE: place + turn,
        kinds.mjJNT_BALL: turn,
        kinds.mjJNT_SLIDE: [("position", "m")],
        kinds.mjJNT_HINGE: [("angle", "rad")],
    }
    for i in np.flatnonzero(~plant.of_robot[model.jnt_bodyid]).tolist():
        joint = model.joint(i)
        name = (joint.name or model.body(model.jnt_bodyid[i]).name).removeprefix(SCENE_PREFIX)
        for k, (part, unit) in enumerate(parts[kinds(int(joint.type[0]))]):
            whole = f"truth/scene/{name}/{part}"  # two joints of one body may have no names
            found[whole if whole not in found else f"{whole} {i}"] = unit, int(joint.qposadr[0]) + k
    return [(name, *where) for name, where in found.items()]
