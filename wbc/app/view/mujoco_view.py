"""Pictures by MuJoCo itself: marks as geoms of its scenes, for films too, and the live view in its viewer's window."""

from __future__ import annotations

import copy
import operator
import os
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from wbc.app.view.base import View, ViewError
from wbc.app.view.marks import Mark, Picture, mark_mesh
from wbc.base.numbers import Array
from wbc.robots.mechanism import Colour
from wbc.sim.plant.model import aim

MOST_MARKS = 10_000
"""Geoms of marks in a picture."""

LEVEL, ONES = np.eye(3), np.ones(3)
"""Axes of a mark that is level; size of a triangle, whose axes are its sides."""

PATIENCE = 10.0
"""Longest time that a window may take for its last frame, s."""


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


class MujocoView(View):
    """Window of MuJoCo's viewer; it shows what a `View` shows, without the legend."""

    _window: Any = None

    def _open(self, port: int) -> None:
        del port
        if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & {*os.environ}:
            raise ViewError(
                "MuJoCo's viewer needs a screen, and neither DISPLAY nor WAYLAND_DISPLAY is set: "
                "choose the view meshcat, workbench or rerun, which are pages in a browser"
            )

    def _build(self) -> None:
        import mujoco.viewer  # noqa: PLC0415 - films are made without a screen

        self._end()
        self._model = copy.copy(self.run.stage.model)
        self._data = mujoco.MjData(self._model)
        before = {*threading.enumerate()}
        try:
            self._window = mujoco.viewer.launch_passive(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
        except RuntimeError as error:  # macOS asks for mjpython
            raise ViewError(f"MuJoCo's viewer cannot be opened: {error}") from error
        height = self.run.stage.scale.height
        aim(self._window.cam, height, (0.0, 0.0, self.run.stage.floor + 0.85 * height))
        self._marks = MujocoMarks(self._window.user_scn)
        self._telling = threading.Thread()
        self._threads = {*threading.enumerate()} - before  # that draws

    def _send(self, picture: Picture) -> None:
        with self._window.lock():
            mujoco.mj_copyData(self._data, self._model, self.run.stage.data)
            self._model.geom_rgba[:] = self.run.stage.model.geom_rgba
            paint_bodies(self._model, picture.colours)
            self._window.user_scn.ngeom = 0
            self._marks.add(picture.marks)
            self._window.cam.lookat[:2] = picture.target[:2]
        self._window.sync()
        if not self._telling.is_alive():  # a text waits for the next frame of the window; the run does not
            lines = "\n".join(picture.lines).replace("°", " deg")
            text = (None, mujoco.mjtGridPos.mjGRID_TOPLEFT, lines, "")
            self._telling = threading.Thread(target=self._window.set_texts, args=(text,), daemon=True)
            self._telling.start()

    def _count(self) -> int:
        return int(self._window.is_running())

    def _end(self) -> None:
        if self._window is not None:
            self._window.close()
            for thread in {*self._threads, self._telling} & {*threading.enumerate()}:
                thread.join(PATIENCE)  # to the last frame: no program may end in the middle of it
