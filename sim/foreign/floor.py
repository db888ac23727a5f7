"""The floor of a MuJoCo model of somebody else, under the soles of a robot that is put into it."""

from __future__ import annotations

import mujoco
import numpy as np

from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.sim.plant.places import RobotPlaces

SKY = 1e3
"""Height from which a floor is looked for where there is none below the base, m."""

AWAY = 1e4
"""Distance at which the robot waits meanwhile, m."""

UNEVEN = 2e-3
"""Difference of heights under the soles from which on the floor is uneven, m."""

UPWARD = 0.5
"""Least upward part of the normal of a floor, cos 60°."""

PRESSED = 1e-3
"""Depth by which the soles are pressed into the floor to find their contacts, m."""

MOST_SURFACES = 64
"""Most surfaces above each other that are looked at."""


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
        for x, y in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            points.append(place.act(np.array([0.5 * x * sole.length, 0.5 * y * sole.width, 0.0])))
    hip = float(robot.placement(robot.base_frame).translation[2])
    q = robot.half_sitting.copy()
    q[:2] += AWAY
    places.set_configuration(q, data.qpos)
    mujoco.mj_kinematics(model, data)
    feet = _feet(places)
    heights = []
    for point in points:
        found = _first_below(model, data, point, hip, feet)
        found = _first_below(model, data, point, SKY, feet) if found is None else found
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
    feet, _ = _feet(places)
    mine = np.isin(data.contact.geom, feet).sum(axis=1) == 1
    if not mine.any():
        return None
    friction = np.where(data.contact.dim > 1, data.contact.friction[:, 0], 0.0)
    return float(friction[mine].min())


def _feet(places: RobotPlaces) -> tuple[list[int], set[int]]:
    """Return the geoms of the feet, and the geoms of the world that are paired with them."""
    model = places.model
    below = set(places.feet)
    for body in range(model.nbody):
        if int(model.body_parentid[body]) in below:
            below.add(body)
    geoms = [geom for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) in below]
    paired = {
        other
        for one, two in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
        for foot, other in ((one, two), (two, one))
        if foot in geoms
    }
    return geoms, paired


def _first_below(
    model: mujoco.MjModel, data: mujoco.MjData, point: Array, start: float, feet: tuple[list[int], set[int]]
) -> float | None:
    """Return the height of the first floor below a height over a point, m."""
    geoms, paired = feet
    origin, down = np.array([point[0], point[1], start]), np.array([0.0, 0.0, -1.0])
    geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
    for _ in range(MOST_SURFACES):
        distance = mujoco.mj_ray(model, data, origin, down, None, True, -1, geom, normal)
        if distance < 0.0:
            return None
        hit = int(geom[0])
        origin[2] -= distance
        touches = hit in paired or any(
            model.geom_contype[hit] & model.geom_conaffinity[foot]
            or model.geom_contype[foot] & model.geom_conaffinity[hit]
            for foot in geoms
        )
        still = int(model.body_weldid[model.geom_bodyid[hit]]) == 0
        if touches and still and normal[2] > UPWARD:
            return float(origin[2])
        origin[2] -= 1e-6
    return None
