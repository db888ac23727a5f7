"""The floor of a MuJoCo model of somebody else, under the soles of a robot that is put into it."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import Robot
from wbc.sim.plant.places import RobotPlaces, hanging

SKY = 1e3
"""Height from which a floor is looked for where there is none below the base, m."""

USUAL_FRICTION = 0.7
"""Friction on which the contacts of a controller count by default."""

UPWARD = 0.5
"""Least upward part of the normal of a floor, cos 60°."""

PRESSED = 1e-3
"""Depth by which the soles are pressed into the floor to find their contacts, m."""

MOST_SURFACES = 64
"""Most surfaces above each other that are looked at."""


def floor_of(places: RobotPlaces, robot: Robot) -> tuple[float, list[str]]:
    """Return the height of the floor on which half-sitting stands, m, and notes on what is odd about it."""
    data = mujoco.MjData(places.model)
    heights = floor_under(places, robot, data)
    if heights is None:
        return 0.0, ["no ground under the soles at half-sitting: put there, the robot falls"]
    ground = float(heights.max())
    ground = ground if abs(ground) > ROUNDING else 0.0
    friction = friction_under(places, robot, data, ground)
    if friction is None or friction >= USUAL_FRICTION:
        return ground, []
    return ground, [
        f"friction of the soles on the ground is {friction:g}, contacts count on {USUAL_FRICTION:g} unless they are "
        "given another (SoleContact(…, friction=…))"
    ]


def floor_under(places: RobotPlaces, robot: Robot, data: mujoco.MjData) -> Array | None:
    """Return the heights of the floor under centre and corners of the soles at half-sitting, shape (n,), m.

    The floor is the first thing below the base that faces up, stands still and can touch the feet; where nothing is
    below the base, the highest one. None where there is none under some point. The state of `data` is lost.
    """
    model = places.model
    points = []
    robot.update_kinematics(robot.half_sitting, np.zeros(robot.nv))
    for sole in robot.soles:
        place = robot.placement(sole.frame)
        points += [np.array(place.translation), *sole.corners(place)]
    hip = float(robot.placement(robot.base_frame).translation[2])
    mujoco.mj_kinematics(model, data)
    floor = _floor_geoms(places)  # rays pass through all else, the robot too
    heights = []
    for point in points:
        found = _first_below(model, data, point, hip, floor)
        found = _first_below(model, data, point, SKY, floor) if found is None else found
        if found is None:
            return None
        heights.append(found)
    return np.array(heights)


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
