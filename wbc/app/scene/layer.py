"""Base class of layers, what a picture shows beside the robot, and the annotations of a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.app.scene.shapes import ROOT, Colour, Legend, SceneObject, Shape
from wbc.core.errors import Array

if TYPE_CHECKING:
    from wbc.core.signals import Measurement


@dataclass(eq=False)
class Annotations:
    """Data of a frame beside its matrices.

    Attributes:
        text: Lines of text for the page.
        target: Point in the world that the camera follows, m.
        colours: New colours of all objects under a path.
        shapes: Vertices of deformable objects by their paths, shape (n, 3), m.
    """

    text: list[str] = field(default_factory=list)
    target: tuple[float, float, float] | None = None
    colours: dict[str, Colour] = field(default_factory=dict)
    shapes: dict[str, Array] = field(default_factory=dict)

    def plain(self) -> dict[str, Any]:
        """Return the annotations as plain values; positions to 0.1 mm, vertices in one list of numbers."""
        data: dict[str, Any] = {"text": "\n".join(self.text), "colours": self.colours}
        if self.target is not None:
            data["target"] = [round(value, 4) for value in self.target]
        data["shapes"] = {path: np.round(shape, 4).ravel().tolist() for path, shape in self.shapes.items()}
        return data


class Layer:
    """Objects shown beside the robot, such as footsteps.

    A layer is made once with its objects. For each picture it fills the matrices of those that move, and adds text,
    colours and deformed shapes to the annotations. It reads plant and controller and never writes to them.

    Attributes:
        moving: Paths that it moves.
        legend: Meaning of its colours.
        measurement: The latest measurement; None without one.
    """

    measurement: Measurement | None = None

    def __init__(self) -> None:
        """Make a layer without objects."""
        self.objects: list[SceneObject] = []
        self.moving: list[str] = []
        self.legend: Legend = ()

    def add(
        self,
        path: str,
        shape: Shape,
        colour: Colour,
        *,
        on_top: bool = False,
        deformable: bool = False,
        fixed: bool = False,
    ) -> int:
        """Add an object and return the index of its matrix, unless it is deformable or fixed."""
        path = f"{ROOT}/{path}"
        name = path if deformable else f"{path}/shape"
        self.objects.append(
            SceneObject(name, shape, colour, np.eye(4), on_top=on_top, shaded=False, deformable=deformable)
        )
        if not (deformable or fixed):
            self.moving.append(path)
        return len(self.moving) - 1

    def fill(self, matrices: Array, annotations: Annotations) -> None:
        """Show the present state.

        Matrices are one for each moving path, all hidden, shape (len(moving), 4, 4); annotations take text, colours and
        shapes.
        """
