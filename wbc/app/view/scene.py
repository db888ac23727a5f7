"""Scene of a page, a stream or a file: bodies of a stage and marks, of which changes alone are sent."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from wbc.app.view.marks import Mark, Picture, legend
from wbc.app.view.meshes import body_meshes
from wbc.app.view.stage import Stage
from wbc.robots.mechanism import Colour

EYE, LOOK_AT = np.array([2.6, -2.0, 1.7]), np.array([0.0, 0.0, 0.8])
"""Place of the camera and point that it looks at, in heights of the centre of mass."""


class DrawnScene(ABC):
    """Bodies and marks as one kind of page, stream or file shows them; `draw` shows a picture.

    Attributes:
        stage: Stage whose bodies are shown.
        meshes: Triangles of the bodies, each of one colour; a mesh is named by its number in this list.
        moving: Bodies that move.
        meanings: Legend of all pictures so far: texts and their colours.
    """

    def __init__(self, stage: Stage) -> None:
        """Begin without marks; the first picture paints all meshes."""
        self.stage, self.meshes = stage, body_meshes(stage.model)
        self.moving = sorted({mesh.body for mesh in self.meshes} - {0})
        self.meanings: dict[str, Colour] = {}
        self._colours: dict[int, Colour] = {}  # of the meshes as they are shown
        self._marks: dict[str, Mark] = {}  # as they are shown

    def draw(self, picture: Picture) -> None:
        """Show a picture: bodies at their places, and the colours and marks that look other than those shown."""
        for body in self.moving:
            self._move(body)
        for number, (body, own, _) in enumerate(self.meshes):
            if self._colours.get(number) != (colour := picture.colours.get(body, own)):
                self._colours[number] = colour
                self._paint(number, colour)
        for name in self._marks.keys() - {mark.name for mark in picture.marks}:
            self._erase(self._marks.pop(name))
        for mark in picture.marks:
            shown = self._marks.get(mark.name)
            if shown is None or not mark.looks_like(shown):
                if shown is not None and shown.kind != mark.kind:
                    self._erase(shown)
                self._marks[mark.name] = mark
                self._show(mark)
        self.meanings |= legend(picture)

    @abstractmethod
    def _move(self, body: int) -> None:
        """Move a body to its place in the stage's data."""

    @abstractmethod
    def _paint(self, number: int, colour: Colour) -> None:
        """Give a mesh a colour."""

    @abstractmethod
    def _show(self, mark: Mark) -> None:
        """Show a mark, in the place of the one of its name, which is of its kind."""

    @abstractmethod
    def _erase(self, mark: Mark) -> None:
        """Take a mark away."""
