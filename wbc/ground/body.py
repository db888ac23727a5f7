"""The robot's own body in a cloud: points on its links and feet are no ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.numbers import ROUNDING, Array
from wbc.core.limits.shapes import CollisionSphere, RoundShape
from wbc.core.robot import Robot

ANKLE = 0.12
"""Height over a sole up to which its foot reaches, m."""


class OwnBody:
    """Spheres and capsules of a robot's links, and boxes over its soles."""

    def __init__(self, robot: Robot, shapes: Mapping[str, Sequence[RoundShape]], margin: float) -> None:
        """Take link → shapes, which grow by a margin, m; `UnknownNameError` for a link that the robot has not."""
        flat = [(robot.frame_id(link), shape) for link, own in shapes.items() for shape in own]
        self._frames = [frame for frame, _ in flat]
        ends = [
            (shape.centre, shape.centre) if isinstance(shape, CollisionSphere) else (shape.start, shape.end)
            for _, shape in flat
        ]
        self._ends = np.array(ends, dtype=np.float64).reshape(-1, 2, 3)
        self._radii = np.array([shape.radius + margin for _, shape in flat])
        self._soles = [
            (
                robot.frame_id(sole.frame),
                np.array([0.5 * sole.length + margin, 0.5 * sole.width + margin, ANKLE]),
            )
            for sole in robot.soles
        ]

    def off(self, data: pin.Data, points: Array) -> NDArray[np.bool_]:
        """Return which points in the world, shape (n, 3), m, are off the body whose frames `data` has placed."""
        off = np.ones(len(points), np.bool_)
        x, y, z = points.T
        ends, radii = self._ends, self._radii
        if self._frames:
            places = [data.oMf[frame] for frame in self._frames]
            turns = np.array([place.rotation for place in places])
            moves = np.array([place.translation for place in places])
            ends = ends @ turns.transpose(0, 2, 1) + moves[:, None]
            # Shapes whose boxes reach those of the points: of ground, the feet and shanks alone.
            least, most = np.array([[each.min(), each.max()] for each in (x, y, z)]).T
            reach = (ends.min(axis=1) - radii[:, None] <= most).all(axis=1)
            reach &= (ends.max(axis=1) + radii[:, None] >= least).all(axis=1)
            ends, radii = ends[reach], radii[reach]
        soles = [data.oMf[sole].translation for sole, _ in self._soles]
        middles = np.concatenate([ends.reshape(-1, 3), np.array(soles).reshape(-1, 3)])
        reaches = np.concatenate([radii.repeat(2), [float(np.linalg.norm(half)) for _, half in self._soles]])
        if not len(middles):
            return off
        low, high = (middles - reaches[:, None]).min(axis=0), (middles + reaches[:, None]).max(axis=0)
        inside = (
            (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])
        )
        near = np.flatnonzero(inside)
        if near.size:
            off[near] = self._apart(data, points[near], ends, radii)
        return off

    def _apart(self, data: pin.Data, points: Array, ends: Array, radii: Array) -> NDArray[np.bool_]:
        """Return which points, shape (n, 3), are off the soles' boxes and off capsules, ends (m, 2, 3), radii (m,)."""
        off = np.ones(len(points), np.bool_)
        for sole, half in self._soles:
            at = np.abs((points - data.oMf[sole].translation) @ data.oMf[sole].rotation)
            off &= (at > half).any(axis=1)
        if len(ends):
            start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
            along = points @ way.T - (start * way).sum(axis=1)
            length = (way * way).sum(axis=1)
            share = np.clip(along / np.maximum(length, ROUNDING**2), 0.0, 1.0)
            distance = (
                (points * points).sum(axis=1)[:, None] - 2.0 * points @ start.T + (start * start).sum(axis=1)
            )
            distance += share * (share * length - 2.0 * along)
            off &= (distance > radii**2).all(axis=1)
        return off
