"""Marks as geoms of MuJoCo's scenes: of films, and of the window of its viewer."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from wbc.app.view.marks import Mark, mark_mesh
from wbc.base.numbers import Array
from wbc.robots.mechanism import Colour

MOST_MARKS = 10_000
"""Geoms of marks in a picture."""

LEVEL, ONES = np.eye(3), np.ones(3)
"""Axes of a mark that is level; size of a triangle, whose axes are its sides."""


def paint_bodies(model: mujoco.MjModel, colours: Mapping[int, Colour]) -> None:
    """Give bodies of a model their colours."""
    for body, colour in colours.items():
        model.geom_rgba[model.geom_bodyid == body] = colour


class MujocoMarks:
    """Geoms of marks in a scene of MuJoCo.

    A cloud has thousands of points. Its geoms come first behind those of the model, which every picture makes anew, and
    stay from picture to picture while the cloud is the same.
    """

    def __init__(self, scene: mujoco.MjvScene) -> None:
        self._scene, self._geoms = scene, scene.geoms
        self._kept: list[Mark] = []
        self._places = (0, 0)  # first of the geoms that are kept, and the one after the last

    def add(self, marks: Sequence[Mark]) -> None:
        """Add the marks of a picture behind the geoms of the model; those beyond the room are left out."""
        scene, clouds = self._scene, [mark for mark in marks if mark.kind == "cloud"]
        first, same = scene.ngeom, len(clouds) == len(self._kept)
        if same and first == self._places[0] and all(map(operator.is_, clouds, self._kept)):
            scene.ngeom = self._places[1]
        else:
            for mark in clouds:
                self._draw(mark)
            self._kept, self._places = clouds, (first, scene.ngeom)
        for mark in marks:
            if mark.kind != "cloud":
                self._draw(mark)

    def _draw(self, mark: Mark) -> None:
        kinds, size, points = mujoco.mjtGeom, np.full(3, mark.size), np.asarray(mark.points, dtype=np.float64)
        if mark.kind == "ball":
            self._add(kinds.mjGEOM_SPHERE, mark, size, points[0])
        elif mark.kind == "arrow":
            geom = self._add(kinds.mjGEOM_ARROW, mark, size, points[0])
            if geom is not None:
                mujoco.mjv_connector(geom, kinds.mjGEOM_ARROW, mark.size, points[0], points[1])
                geom.size[2] *= 2.0  # it is drawn half as long as the connector says
        else:
            vertices, faces = mark_mesh(mark)
            corner, one, other = np.asarray(vertices, dtype=np.float64)[faces].swapaxes(0, 1)
            sides = np.stack([one - corner, other - corner, np.cross(one - corner, other - corner)], axis=-1)
            for place, axes in zip(corner, sides, strict=True):
                self._add(kinds.mjGEOM_TRIANGLE, mark, ONES, place, axes)

    def _add(self, kind: mujoco.mjtGeom, mark: Mark, size: Array, place: Array, axes: Array = LEVEL) -> Any:
        """Add a geom and return it; None where there is no room."""
        scene = self._scene
        if scene.ngeom >= scene.maxgeom:
            return None
        geom = self._geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, size, place, axes.ravel(), np.array(mark.colour, dtype=np.float32))
        scene.ngeom += 1
        return geom
