"""Bounds on the distances of pairs of shapes that are not measured, and on the speeds at which these shrink.

A pair was measured some ticks ago. Since then its distance has shrunk by no more than its shapes have moved against
each other: the change of the vector between their origins, and for each shape the turn of its core. The core of a
sphere or a capsule is its centre or its axis; that of another shape is the shape itself. A core within a radius k of
its origin whose rotation has changed by ΔR has points that moved by k ‖ΔR‖ at most, and ‖ΔR‖ is ‖ΔR‖_F / √2.

Source of the idea: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, UC Berkeley, 1996.
"""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.numbers import Array

UNBOUNDED = 1e6
"""Radius from which on a shape has no end, m."""

SMALLEST = 1e-9
"""Smallest distance of two origins that is divided by, m."""

YZX, ZXY = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Axes of the factors of a cross product."""

ORIGIN = np.array([9, 10, 11])
"""Places of the origin in a placement."""

TURNED = 3 + np.concatenate((YZX, ZXY))
"""Places of the factors of the angular velocity in a twist."""


class Separation:
    """Lower bounds on distances, and upper bounds on closing speeds, of pairs of shapes.

    The pairs are the last axis of all arrays, on which NumPy is quick.

    Attributes:
        spread: Largest distance of points in which two shapes face each other, of each pair, m.
    """

    def __init__(self, geometry: pin.GeometryModel, data: pin.GeometryData, corners: Array) -> None:
        """Follow the placements in the data of the pairs of a geometry, whose shapes have known boxes.

        The speeds are those of corners, too, for each pair for which `corners` is true.
        """
        pairs = np.array([(p.first, p.second) for p in geometry.collisionPairs], dtype=np.intp).T
        cores = np.array([_core(item.geometry) for item in geometry.geometryObjects])[pairs]
        n = pairs.shape[1]
        self._turning = cores / np.sqrt(2.0)
        self._least_core, self._both_cores = cores.min(axis=0), np.sqrt(2.0) * cores.sum(axis=0)
        sizes = [_core(i.geometry) or float(i.geometry.radius) for i in geometry.geometryObjects]
        self.spread = 2.0 * np.array(sizes)[pairs].min(axis=0)
        self._least_core = np.where(corners, 3.0, 1.0) * self._least_core
        pivots = pairs[cores.argmin(axis=0), np.arange(n)]
        self._coordinates = following([place.rotation for place in data.oMg], 12).reshape(-1)
        # Places among the coordinates: rotations of both shapes, origins of both, and factors of a cross product.
        turns, origins = (12 * pairs[:, None, :] + places[:, None] for places in (np.arange(9), ORIGIN))
        self._places = np.concatenate((turns.reshape(18, n), origins.reshape(6, n)))
        self._centres = 12 * pivots + 9 + np.concatenate((ZXY, YZX))[:, None]
        self._now, self._change = np.zeros((24, n)), np.zeros((24, n))
        self._then, self._measured = np.zeros((24, n)), np.full(n, -np.inf)
        self._vectors = np.zeros((3, 3, n))
        self._apart, self._velocity, self._spin = self._vectors

    def measured(self, rows: NDArray[np.intp], distances: Array) -> None:
        """Take over distances of some pairs at the placements that `distances` has last seen, m."""
        self._then[:, rows] = self._now.take(rows, axis=1)
        self._measured[rows] = distances

    def distances(self) -> Array:
        """Return lower bounds on all distances at the present placements, shape (number of pairs,), m; a new array."""
        now = self._coordinates.take(self._places, out=self._now, mode="clip")
        np.subtract(now[21:], now[18:21], out=self._apart)
        change = np.subtract(now, self._then, out=self._change)
        moved, turns = change[21:] - change[18:21], change[:18]
        moved *= moved
        turns *= turns
        turned = np.sqrt(np.add.reduce(turns.reshape(2, 9, -1), axis=1))
        turned *= self._turning
        nearer = np.sqrt(np.add.reduce(moved, axis=0))
        nearer += turned[0]
        nearer += turned[1]
        return np.asarray(np.subtract(self._measured, nearer, out=nearer))

    def speeds(self, twists: Array) -> Array:
        """Return upper bounds on the speeds at which distances shrink, shape (number of pairs,), m/s; a new array.

        A distance shrinks at −n·u, where n is the common normal and u the velocity of the second body against the first
        one at any point of the line along n through the nearest points. Such a point lies in the core of either shape.
        The normal differs from the direction between the origins by no more than both cores allow. The placements are
        those that `distances` has last seen.

        Args:
            twists: Velocities of the second bodies against the first ones at the origin of the world,
                [linear; angular], shape (6, number of pairs).
        """
        turned, vectors, velocity = twists.take(TURNED, axis=0), self._vectors, self._velocity
        turned *= self._coordinates.take(self._centres)
        np.subtract(turned[:3], turned[3:], out=velocity)
        velocity += twists[:3]
        self._spin[:] = twists[3:]
        lengths = np.sqrt(np.add.reduce(vectors * vectors, axis=1))
        far, speed, turn = np.maximum(lengths, SMALLEST, out=lengths)
        # |n − direction| ≤ √2 (both cores) / distance, and never above 2.
        along = np.minimum(self._both_cores, 2.0 * far)
        along *= speed
        along -= np.add.reduce(self._apart * velocity, axis=0)
        along /= far
        np.minimum(along, speed, out=along)
        turn *= self._least_core
        along += turn
        return np.asarray(along)


def round_radius(shape: coal.CollisionGeometry) -> float:
    """Return the radius about its centre or its axis of a sphere or a capsule, m; zero of other shapes."""
    return float(shape.radius) if isinstance(shape, coal.Sphere | coal.Capsule) else 0.0


def _core(shape: coal.CollisionGeometry) -> float:
    """Return the radius about its origin of the core of a shape whose box is known, m."""
    if isinstance(shape, coal.Sphere):
        return 0.0
    if isinstance(shape, coal.Capsule):
        return float(shape.halfLength)
    radius = float(shape.aabb_radius)
    return radius + float(np.linalg.norm(shape.aabb_center)) if radius < UNBOUNDED else UNBOUNDED


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of columns, shape (…, 3, n)."""
    return a.take(YZX, axis=-2) * b.take(ZXY, axis=-2) - a.take(ZXY, axis=-2) * b.take(YZX, axis=-2)


def following(parts: Sequence[Array], count: int) -> Array:
    """Return a view of items of a list of a library that follows their values, shape (number of items, count).

    The parts are the beginnings of the items, which lie one behind the other.
    """
    arrays = [np.asarray(part) for part in parts]
    starts = [array.__array_interface__["data"][0] for array in arrays]
    if np.diff(starts).tolist() != [8 * count] * (len(arrays) - 1):
        raise RuntimeError("pinocchio does not keep the items of a list one behind the other")
    return np.lib.stride_tricks.as_strided(arrays[0], (len(arrays), count), (8 * count, 8), writeable=False)
