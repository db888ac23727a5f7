"""Pairs of links for limits on collisions, and the shapes that files of robots give to links."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.files import parse_xml, read_xml
from wbc.base.numbers import Array
from wbc.core.robot import Robot

POSTURES = 1000
"""Random postures in which pairs are looked for that can touch."""

SAMPLES = 200
"""Postures in which a pair is looked at that is closer than its margin in half-sitting."""


def srdf_pairs(srdf: str | Path, links: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of some links for `CollisionLimit`, but for the `disable_collisions` of an SRDF.

    The SRDF is a path or the XML itself; the links are such as those of `RobotDescription.collision_shapes`.
    """
    root = _xml(srdf, "SRDF")
    left_out = {frozenset((each.get("link1"), each.get("link2"))) for each in root.iter("disable_collisions")}
    return [pair for pair in itertools.combinations(links, 2) if frozenset(pair) not in left_out]


def _xml(source: str | Path, what: str) -> ET.Element:
    text = str(source)
    try:
        return parse_xml(text if text.lstrip().startswith("<") else read_xml(Path(text), what))
    except (ET.ParseError, InputError) as error:
        raise InputError(f"cannot read the {what} of a collision limit: {error}") from error


def urdf_primitives(robot: Robot, urdf: str | Path) -> dict[str, list[pin.GeometryObject]]:
    """Return the primitive collision geometry of a URDF, by link; that of another robot is an `InputError`."""
    root = _xml(urdf, "URDF")
    for link in root.iter("link"):
        for item in (*link.findall("visual"), *link.findall("collision")):
            if item.tag == "visual" or item.find("geometry/mesh") is not None:
                link.remove(item)
    try:
        geometry = pin.buildGeomFromUrdfString(
            robot.model, ET.tostring(root, encoding="unicode"), pin.COLLISION
        )
    except (ValueError, RuntimeError) as error:
        raise InputError(f"the URDF of a collision limit does not fit {robot!r}: {error}") from error
    found: dict[str, list[pin.GeometryObject]] = {}
    for item in geometry.geometryObjects:
        found.setdefault(str(robot.model.frames[item.parentFrame].name), []).append(pin.GeometryObject(item))
    return found


def pairs_that_touch(
    robot: Robot, geometry: pin.GeometryModel, objects: Mapping[str, list[int]], margin: float
) -> list[tuple[str, str]]:
    """Return the pairs of links that can come within a margin, m, and do not in half-sitting, but for neighbours.

    Args:
        robot: The robot.
        geometry: Shapes; its pairs do not matter.
        objects: Numbers of the shapes of each link.
        margin: The margin, m.
    """
    model = robot.model
    joints = {link: model.frames[robot.frame_id(link)].parentJoint for link in objects}
    trial, pairs = geometry.copy(), list[tuple[str, str]]()
    trial.removeAllCollisionPairs()
    for first, second in itertools.combinations(objects, 2):
        a, b = joints[first], joints[second]
        if a == b or model.parents[a] == b or model.parents[b] == a:
            continue
        for i in objects[first]:
            for k in objects[second]:
                trial.addCollisionPair(pin.CollisionPair(i, k))
                pairs.append((first, second))
    state, data = model.createData(), trial.createData()

    def close(q: Array) -> set[tuple[str, str]]:
        pin.computeCollisions(model, state, trial, data, q, False)
        hits = [result.isCollision() for result in data.collisionResults]
        return {pair for pair, hit in zip(pairs, hits, strict=True) if hit}

    for request in data.collisionRequests:
        request.security_margin = margin
    q, random = np.array(robot.half_sitting), np.random.default_rng(0)
    touching = close(q)
    low, high = (
        np.nan_to_num(x, neginf=-np.pi, posinf=np.pi) for x in (robot.position_lower, robot.position_upper)
    )
    found: set[tuple[str, str]] = set()
    for _ in range(POSTURES):
        q[robot.nq - robot.na :] = random.uniform(low, high)
        found |= close(q)
    return [pair for pair in dict.fromkeys(pairs) if pair in found and pair not in touching]


def check_separable(
    robot: Robot,
    geometry: pin.GeometryModel,
    pairs: Sequence[tuple[tuple[int, int], tuple[str, str]]],
    margin: float,
    limit: str,
) -> None:
    """Refuse a pair that is in collision in half-sitting, or closer than the margin wherever its joints are.

    Args:
        robot: The robot.
        geometry: Shapes and pairs.
        pairs: Joints and names of both shapes of each pair.
        margin: The margin, m.
        limit: Name of the limit, for messages.
    """
    model = robot.model
    state, data = model.createData(), geometry.createData()
    random = np.random.default_rng(0)
    low, high = (
        np.nan_to_num(x, neginf=-np.pi, posinf=np.pi) for x in (robot.position_lower, robot.position_upper)
    )
    for row, ((first, second), (one, other)) in enumerate(pairs):
        between = sorted({*model.supports[first]} ^ {*model.supports[second]})
        first_joint = robot.nq - robot.na
        joints = [
            model.joints[j].idx_q - first_joint
            for j in between
            if model.joints[j].idx_q >= first_joint and j > 0
        ]
        q, furthest = np.array(robot.half_sitting), -np.inf
        for _ in range(SAMPLES):
            pin.updateGeometryPlacements(model, state, geometry, data, q)
            distance = pin.computeDistance(geometry, data, row).min_distance
            if furthest == -np.inf and distance <= 0.0:
                raise InputError(
                    f"'{one}' and '{other}' of limit '{limit}' are {-distance:.3f} m inside each other in "
                    "half-sitting; leave the pair out or give smaller shapes"
                )
            furthest = max(furthest, distance)
            if furthest > margin:
                break
            q[first_joint:][joints] = random.uniform(low, high)[joints]
        else:
            raise InputError(
                f"no joint brings '{one}' and '{other}' of limit '{limit}' further apart than "
                f"{furthest:.4f} m, its margin is {margin:g} m; leave the pair out, or lower the margin"
            )
