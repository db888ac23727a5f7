"""Hands of the plant: force sensors at the wrists, and grips that hold a handle of a scene."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.core.robot import Robot
from wbc.robots.frames import carrier
from wbc.robots.mechanism import placed

SCENE_PREFIX = "scene/"
"""Beginning of all names of the furniture."""

REACH = 0.25
"""Greatest distance between the frame of a hand and a handle that it grips, m: the length of a hand."""

DEEPEST = 0.005
"""Depth of a link in a thing from which the thing goes through the robot, m."""


def add_hand_sensors(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add a site and a force sensor at the frame of each hand to a model under construction."""
    kinds = {"force": mujoco.mjtSensor.mjSENS_FORCE, "torque": mujoco.mjtSensor.mjSENS_TORQUE}
    for role, frame in robot.frames.items():
        link, place = (frame, pin.SE3.Identity()) if spec.body(frame) else carrier(robot.model, frame)
        name, body = f"{role} site", spec.body(link)
        body.add_site(name=name, size=[0.005] * 3, **placed(place))
        for what, kind in kinds.items():
            spec.add_sensor(name=f"{role} {what}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name)


def add_grips(spec: mujoco.MjSpec, robot: Robot, owner: str = "") -> None:
    """Add a grip for each hand and each handle, open at the start.

    A handle is a site of the scene whose name ends with "handle". A closed grip holds the handle where it was in the
    hand, and leaves the hand free to turn about it. Names of the robot begin with the owner.
    """
    handles = [
        site for site in spec.sites if site.name.startswith(SCENE_PREFIX) and site.name.endswith("handle")
    ]
    for role in robot.frames:
        for handle in handles:
            spec.add_equality(
                name=f"{owner}{role} on {handle.name.removeprefix(SCENE_PREFIX)}",
                type=mujoco.mjtEq.mjEQ_CONNECT,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=spec.site(f"{owner}{role} site").parent.name,
                name2=handle.parent.name,
                active=False,
            )


def handles_of(model: mujoco.MjModel) -> dict[str, int]:
    """Return the handles of the scene in a model: name → site."""
    sites = {model.site(i).name: i for i in range(model.nsite)}
    return {
        name.removeprefix(SCENE_PREFIX): i
        for name, i in sites.items()
        if name.startswith(SCENE_PREFIX) and name.endswith("handle")
    }


def check_clear(model: mujoco.MjModel, data: mujoco.MjData, of_robot: np.ndarray[Any, Any]) -> None:
    """Raise an `InputError` if a link of the robot, or a thing that moves, is inside something; contacts are known."""
    deepest, where = DEEPEST, None
    for contact in data.contact:
        first, second = contact.geom.tolist()
        if -contact.dist > deepest and not (of_robot[first] and of_robot[second]):
            deepest, where = -float(contact.dist), (first, second)
    if where is None:
        return
    names = [model.body(int(model.geom_bodyid[geom])).name for geom in where]
    ground = [name == "world" or name.startswith("terrain_body") for name in names]
    if of_robot[where[1]] or (ground[0] and not of_robot[where[0]]):
        names, ground = names[::-1], ground[::-1]
    inner, outer = (name.removeprefix(SCENE_PREFIX) for name in names)
    other = "the ground" if ground[1] else f"'{outer}'"
    rule = (
        "the robot must stand clear of its surroundings"
        if of_robot[list(where)].any()
        else "things must begin apart"
    )
    raise InputError(f"{rule}; '{inner}' is {1e3 * deepest:.0f} mm inside {other}: place the scene elsewhere")
