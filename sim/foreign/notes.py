"""Notes on a robot in somebody else's MuJoCo model: where model and description differ, what is doubtful, its floor."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import Robot
from wbc.robots import RobotDescription
from wbc.robots.notes import UNMODELLED, listed
from wbc.robots.readers.actuators_mjcf import damping, dry_friction, rotor_inertia, stiffness
from wbc.robots.readers.forces_mjcf import unmodelled
from wbc.sim.foreign.actuators import JointActuators
from wbc.sim.plant.places import RobotPlaces, hanging
from wbc.sim.plant.signals import Imu

logger = logging.getLogger(__name__)

OTHER_MASS = 0.01
"""Share of the mass by which model and description may differ without a note."""

OTHER_COM = 1e-3
"""Distance between the centres of mass of model and description at half-sitting that is noted, m."""

REACHED = 0.99
"""Share of the torque limits that the ranges of the controls have to reach, or there is a note."""

SKY = 1e3
"""Height from which a floor is looked for where there is none below the base, m."""

USUAL_FRICTION = 0.7
"""Friction on which the contacts of a controller count by default."""

UPWARD = 0.5
"""Least upward part of the normal of a floor, cos 60°."""

PRESSED = 1e-3
"""Depth by which the soles are pressed into the floor to find their contacts, m."""

MOST_SURFACES = 1000
"""Most surfaces above each other that are looked at, with those of the robot: meshes of one leg may have dozens."""

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
        odd = (
            (model.sensor_delay[number], "a delay of {:g} ms", 1e3),
            (model.sensor_interval[number, 0], "a reading every {:g} ms", 1e3),
            (model.sensor_cutoff[number], "readings up to {:g} alone (cutoff)", 1.0),
        )
        if found := " and ".join(text.format(unit * value) for value, text, unit in odd if value):
            yield f"{what} '{model.sensor(number).name}' of the file has {found}"


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


def floor_of(places: RobotPlaces, robot: Robot) -> tuple[float, list[str]]:
    """Return the height of the floor on which half-sitting stands, m, and notes on what is odd about it.

    The floor is the first thing below the base that faces up, stands still and can touch the feet; where nothing is
    below the base, the highest one. It is looked for under centre and corners of the soles.
    """
    data, heights = mujoco.MjData(places.model), list[float]()
    mujoco.mj_kinematics(places.model, data)
    floor = _floor_geoms(places)  # rays pass through all else, the robot too
    robot.update_kinematics(robot.half_sitting, np.zeros(robot.nv))
    hip = float(robot.placement(robot.base_frame).translation[2])
    for sole in robot.soles:
        place = robot.placement(sole.frame)
        for point in (np.array(place.translation), *sole.corners(place)):
            found = _first_below(places.model, data, point, hip, floor)
            found = _first_below(places.model, data, point, SKY, floor) if found is None else found
            if found is None:
                return 0.0, ["no ground under the soles at half-sitting: put there, the robot falls"]
            heights.append(found)
    ground = max(heights) if abs(max(heights)) > ROUNDING else 0.0
    friction = friction_under(places, robot, data, ground)
    if friction is None or friction >= USUAL_FRICTION:
        return ground, []
    return ground, [
        f"friction of the soles on the ground is {friction:g}, contacts count on {USUAL_FRICTION:g} unless they are "
        "given another (SoleContact(…, friction=…))"
    ]


def friction_under(places: RobotPlaces, robot: Robot, data: mujoco.MjData, ground: float) -> float | None:
    """Return the least friction of the contacts of the feet at half-sitting on a floor at a height, m.

    None where nothing touches; 0 for contacts without friction. The state of `data` is lost.
    """
    q = robot.half_sitting.copy()
    q[2] += ground - PRESSED
    places.set_configuration(q, data.qpos)
    mujoco.mj_fwdPosition(places.model, data)
    mine = _foot_geoms(places)[data.contact.geom].sum(axis=1) == 1
    if not mine.any():
        return None
    friction = np.where(data.contact.dim > 1, data.contact.friction[:, 0], 0.0)
    return float(friction[mine].min())


def _foot_geoms(places: RobotPlaces) -> NDArray[np.bool_]:
    """Return True for geoms of the feet, shape (ngeom,)."""
    model = places.model
    return np.asarray(hanging(model, places.feet)[model.geom_bodyid] >= 0)


def _floor_geoms(places: RobotPlaces) -> NDArray[np.bool_]:
    """Return True for geoms that stand still and can touch the feet, shape (ngeom,)."""
    model, foot = places.model, _foot_geoms(places)
    types, affinities = model.geom_contype[:, None], model.geom_conaffinity[:, None]
    touch = (types & model.geom_conaffinity[foot] | affinities & model.geom_contype[foot]).any(axis=1)
    one, two = model.pair_geom1, model.pair_geom2
    touch[two[foot[one]]] = touch[one[foot[two]]] = True
    return np.asarray(touch & (model.body_weldid[model.geom_bodyid] == 0))


def _first_below(
    model: mujoco.MjModel, data: mujoco.MjData, point: Array, start: float, floor: NDArray[np.bool_]
) -> float | None:
    """Return the height of the first floor that faces up below a height over a point, m."""
    origin, down = np.array([point[0], point[1], start]), np.array([0.0, 0.0, -1.0])
    geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
    for _ in range(MOST_SURFACES):
        distance = mujoco.mj_ray(model, data, origin, down, None, True, -1, geom, normal)
        if distance < 0.0:
            return None
        origin[2] -= distance
        if floor[geom[0]] and normal[2] > UPWARD:
            return float(origin[2])
        origin[2] -= 1e-6
    return None
