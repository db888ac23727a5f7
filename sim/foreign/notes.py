"""Notes on a robot in somebody else's MuJoCo model: where model and description differ, and what is doubtful."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import mujoco
import numpy as np

from wbc.core.robot import Robot
from wbc.robots import RobotDescription
from wbc.robots.notes import UNMODELLED, listed
from wbc.robots.readers.actuators_mjcf import damping, dry_friction, rotor_inertia, stiffness
from wbc.robots.readers.forces_mjcf import unmodelled
from wbc.sim.foreign.actuators import JointActuators
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.signals import Imu

logger = logging.getLogger(__name__)

OTHER_MASS = 0.01
"""Share of the mass by which model and description may differ without a note."""

OTHER_COM = 1e-3
"""Distance between the centres of mass of model and description at half-sitting that is noted, m."""

REACHED = 0.99
"""Share of the torque limits that the ranges of the controls have to reach, or there is a note."""

ON_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Transmissions of actuators that act on a joint."""


def drive_notes(description: RobotDescription, robot: Robot, actuators: JointActuators) -> Iterator[str]:
    """Yield notes on joints without an actuator, and on controls that end before the torque limits."""
    names = description.joint_names
    if bare := [names[i] for i in actuators.bare]:
        some = ", ".join(bare[:3]) + (", …" if len(bare) > 3 else "")
        yield f"{len(bare)} joints without an actuator get their torque directly: {some}"
    least, most = actuators.reach(robot.half_sitting[7:])
    low, high = robot.torque_lower, robot.torque_upper
    if (short := np.maximum(least - REACHED * low, REACHED * high - most)).max() > 0.0:
        worst = int(np.argmax(short / robot.torque_limit))
        yield (
            f"at half-sitting the controls of {np.count_nonzero(short > 0.0)} joints end (ctrlrange) before their "
            f"torque limits, first {names[worst]}: {least[worst]:.4g} to {most[worst]:.4g} of {low[worst]:.4g} to "
            f"{high[worst]:.4g} Nm"
        )


def model_notes(description: RobotDescription, robot: Robot, places: RobotPlaces) -> Iterator[str]:
    """Yield notes on masses, forces, couplings and joints that the model has otherwise than the description.

    Joints that nothing holds are also a warning in the log, because the robot falls.
    """
    model = places.model
    mass = float(model.body_subtreemass[places.root])
    if abs(mass - robot.mass) > OTHER_MASS * robot.mass:
        yield f"the robot has {mass:.2f} kg in the model and {robot.mass:.2f} kg in the description"
    if (off := places.off_centre()) > OTHER_COM:
        yield (
            f"at half-sitting the centre of mass is {1e3 * off:.1f} mm off in the model: a joint counts from another "
            "zero, or masses are elsewhere"
        )
    ties, joints = places.ties(), dict(zip(places.joints, description.joint_names, strict=True))
    yield from unmodelled(model, np.flatnonzero(places.of_robot).tolist(), joints, ties)
    if len(ties) < len(robot.couplings) + len(robot.closures):
        yield f"{UNMODELLED}joints or chains that the description couples or closes and the model not"
    if limp := _limp_joints(places):
        note = (
            f"{len(limp)} joints of the robot are not in the description, and nothing holds them: {listed(limp)}; "
            "give them a servo in the model, or their controls in data.ctrl"
        )
        logger.warning("%s", note)
        yield note
    springs = {name: spring for name, (spring, _) in description.springs.items()}
    stiff = np.zeros(model.nv)
    stiff[model.jnt_dofadr] = stiffness(model)
    for what, own, theirs in (
        ("springs", places.reflected(stiff, 2), springs),
        ("damping", places.reflected(damping(model), 2), description.damping),
        ("dry friction", places.reflected(dry_friction(model), 1), description.frictionloss),
        ("rotor inertia", places.reflected(rotor_inertia(model), 2), description.armature),
    ):
        other = [
            f"{name} {mine:g}"
            for name, mine in zip(description.joint_names, own.tolist(), strict=True)
            if not math.isclose(mine, theirs.get(name, 0.0), rel_tol=0.01, abs_tol=1e-9)
        ]
        if other:
            yield f"{UNMODELLED}{what} of {len(other)} joints, other than described: {listed(other)}"


def sensor_notes(model: mujoco.MjModel, imu: Imu) -> Iterator[str]:
    """Yield notes on sensors of the IMU that are missing, or read late."""
    for what, sensor in (("gyroscope", imu.gyroscope), ("accelerometer", imu.accelerometer)):
        if sensor is None:
            yield f"no {what} on the IMU's body that reads: computed from the motion"
            continue
        number = int(np.flatnonzero(model.sensor_adr == sensor[0])[0])
        if odd := _reads_late(model, number):
            yield f"{what} '{model.sensor(number).name}' of the file has {odd}"


def _limp_joints(places: RobotPlaces) -> list[str]:
    """Return the robot's joints without spring and servo that the description locks or leaves out."""
    model = places.model
    held = set(places.joints) | set(np.flatnonzero(model.jnt_stiffness > 0.0).tolist())
    servos = np.isin(model.actuator_trntype, ON_JOINTS) & (model.actuator_biasprm[:, 1] != 0.0)
    held |= set(model.actuator_trnid[servos, 0].tolist())
    tied = model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)
    held |= {*model.eq_obj1id[tied].tolist(), *model.eq_obj2id[tied].tolist()}
    moving = places.of_robot[model.jnt_bodyid] & (model.jnt_type != int(mujoco.mjtJoint.mjJNT_FREE))
    return [model.joint(i).name or f"joint {i}" for i in np.flatnonzero(moving).tolist() if i not in held]


def _reads_late(model: mujoco.MjModel, sensor: int) -> str:
    """Return how a sensor reads late, seldom or up to a bound; empty for one that does not."""
    odd = (
        (model.sensor_delay[sensor], "a delay of {:g} ms", 1e3),
        (model.sensor_interval[sensor, 0], "a reading every {:g} ms", 1e3),
        (model.sensor_cutoff[sensor], "readings up to {:g} alone (cutoff)", 1.0),
    )
    return " and ".join(text.format(unit * value) for value, text, unit in odd if value)
