"""The robot's own body in a cloud: points on its links and feet are no ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.numbers import ROUNDING, Array
from wbc.core.limits.obstacles import CollisionSphere, RoundShape
from wbc.core.robot import Robot

ANKLE = 0.12
"""Height over a sole up to which its foot reaches, m."""


class OwnBody:
    """Spheres and capsules of a robot's links, and boxes over its soles."""

    def __init__(self, robot: Robot, shapes: Mapping[str, Sequence[RoundShape]], margin: float) -> None:
        """Take link → shapes, which grow by a margin, m; `UnknownNameError` for a link that the robot has not."""
        flat = [(robot.frame_id(link), shape) for link, own in shapes.items() for shape in own]
        self._frames = list(dict.fromkeys(frame for frame, _ in flat))
        self._of = np.array([self._frames.index(frame) for frame, _ in flat], dtype=np.int64)
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
            places = np.array([data.oMf[frame].homogeneous for frame in self._frames])[self._of]
            ends = ends @ places[:, :3, :3].transpose(0, 2, 1) + places[:, None, :3, 3]
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
            place = data.oMf[sole]
            x, y, z = np.abs(place.rotation.T @ (points - place.translation).T)
            off &= (x > half[0]) | (y > half[1]) | (z > half[2])
        if len(ends):
            # The square of a point's distance from a capsule's line, less that of the radius, shape (m, n), is computed
            # in place and in single precision, which is off by some 0.01 mm.
            at = (points - points[0]).T.astype(np.float32)
            start, way = ends[:, 0] - points[0], ends[:, 1] - ends[:, 0]
            length = np.maximum((way * way).sum(axis=1), ROUNDING**2)[:, None]
            past = (way / length).astype(np.float32) @ at
            past -= ((start * way).sum(axis=1, keepdims=True) / length).astype(np.float32)
            share = np.clip(past, 0.0, 1.0)
            past *= -2.0
            past += share
            past *= share
            past *= length.astype(np.float32)
            gap = (-2.0 * start).astype(np.float32) @ at
            gap += ((start * start).sum(axis=1) - radii * radii)[:, None].astype(np.float32)
            gap += past
            gap += (at * at).sum(axis=0)
            off &= gap.min(axis=0) > 0.0
        return off
