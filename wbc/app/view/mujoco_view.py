"""Live view in the window of MuJoCo's viewer, for who has a screen: it shows a copy of the run, and changes nothing."""

from __future__ import annotations

import copy
import os
import sys
import threading
from typing import Any

import mujoco
import mujoco.viewer

from wbc.app.view.base import View, ViewError
from wbc.app.view.marks import Picture
from wbc.app.view.mujoco_marks import MujocoMarks, paint_bodies
from wbc.sim.plant.model import aim

PATIENCE = 10.0
"""Longest time that a window may take for its last frame, s."""

TOP = mujoco.mjtGridPos.mjGRID_TOPLEFT
"""Place of the texts."""


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
            paint_bodies(self._model, picture.colours)
            self._window.user_scn.ngeom = 0
            self._marks.add(picture.marks)
            self._window.cam.lookat[:2] = picture.target[:2]
        self._window.sync()
        if not self._telling.is_alive():  # a text waits for the next frame of the window; the run does not
            text = (None, TOP, "\n".join([f"{picture.time:.2f} s", *picture.text]).replace("°", " deg"), "")
            self._telling = threading.Thread(target=self._window.set_texts, args=(text,), daemon=True)
            self._telling.start()

    @property
    def pages(self) -> int:
        """1 while the window is open, 0 otherwise."""
        return int(not self.closed and self._window.is_running())

    def _end(self) -> None:
        if self._window is not None:
            self._window.close()
            for thread in {*self._threads, self._telling} & {*threading.enumerate()}:
                thread.join(PATIENCE)  # to the last frame: no program may end in the middle of it
