"""Scene: parameters of a thing that stands before the robot, how it is built, and the registry of all scenes.

A new scene is one class::

    @scene_kind("post")
    class Post(Scene):
        \"\"\"A post to hold on to.\"\"\"

        distance: Annotated[float, "m"] = param(0.5, "Middle of the post before the robot")

        def build(self, spec: mujoco.MjSpec) -> None:
            body = spec.worldbody.add_body(name="post", pos=[self.distance, 0.0, 0.6])
            self.solid(body, "capsule", (0.03, 0.6))

After that `make_scene("post", distance=0.4)`, `Plant(scene="post")` and `wbc walk --scene post` work.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar, TypeVar

import mujoco
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.registry import Registry, call_checked
from wbc.base.settings import NonNegative, settings
from wbc.sim.terrain.families.base import param

Place = Annotated[float, Field(ge=-100.0, le=100.0)]
"""A coordinate, m."""

Size = Annotated[float, Field(ge=0.005, le=20.0)]
"""Extent of a thing, m."""

WOOD = (0.72, 0.58, 0.42, 1.0)
METAL = (0.55, 0.58, 0.62, 1.0)
"""Colours."""

GEOMS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}
"""Kinds of solids."""


ALONG_Y = [math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0]
"""Quaternion, w first, that turns the axis of a capsule from z to y."""

ALONG_X = [math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]
"""The same to x."""


@settings
class Scene(ABC):
    """Base of scenes: furniture around the robot, with parameters.

    The robot stands at the origin and looks along x. The ground is at z = 0.

    Attributes:
        name: Name of the kind.
        seen: True for a scene to walk on, which cameras and range sensors see as ground.
    """

    name: ClassVar[str] = ""
    seen: ClassVar[bool] = False

    friction: NonNegative = param(0.7, "Coulomb coefficient of its surface")

    @abstractmethod
    def build(self, spec: mujoco.MjSpec) -> None:
        """Add the bodies of the scene to an empty model; names of sites at handles must end with "handle"."""

    def spec(self) -> mujoco.MjSpec:
        """Return the scene as a separate model."""
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        self.build(spec)
        return spec

    def solid(
        self,
        body: mujoco.MjsBody,
        kind: str,
        size: Sequence[float],
        pos: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        mass: float = 0.0,
        colour: Sequence[float] = WOOD,
    ) -> mujoco.MjsGeom:
        """Add a solid with the surface of this scene to a body.

        Args:
            body: The body.
            kind: "box", "sphere", "cylinder", "capsule" or "ellipsoid".
            size: Half sizes, m, in MuJoCo's order.
            pos: Centre in the frame of the body, m.
            quat: Orientation in the frame of the body, a quaternion w, x, y, z.
            mass: Mass, kg.
            colour: Red, green, blue, opacity.
        """
        return body.add_geom(
            type=GEOMS[kind],
            size=[*size, *[0.0] * (3 - len(size))],
            pos=pos,
            quat=quat,
            mass=mass,
            rgba=colour,
            friction=[self.friction, 0.005, 0.0001],
            priority=1,  # over the robot's surface, so that its friction is the scene's
            solref=[0.005, 1.0],
            condim=4,
        )


_S = TypeVar("_S", bound=Scene)


def _check(kind: object) -> None:
    if not (isinstance(kind, type) and issubclass(kind, Scene)):
        raise InputError(f"@scene_kind must be above a class derived from Scene, got {shown(kind)}")


_SCENES: Registry[type[Scene]] = Registry("scene", check=_check)


def scene_kind(name: str) -> Callable[[type[_S]], type[_S]]:
    """Register a class as a scene and make it settings (`wbc.base.settings`).

    Args:
        name: Name for `make_scene(name, …)` and the command line.
    """

    def register(cls: type[_S]) -> type[_S]:
        _SCENES.add(name, cls)
        cls.name = name
        return settings(cls)

    return register


def scene_kinds() -> dict[str, type[Scene]]:
    """Return all scenes by name, in alphabetical order."""
    return dict(sorted(_SCENES.items()))


@checked
def make_scene(name: str, **parameters: Any) -> Scene:
    """Return a scene by its name.

    Args:
        name: One of `scene_kinds()`.
        **parameters: Parameters that differ from their defaults.
    """
    return call_checked(f"scene '{name}'", _SCENES[name], parameters)
