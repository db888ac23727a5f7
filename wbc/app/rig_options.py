"""Options of the commands that test feet: a foot under an ankle, and a ground under the foot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

from cyclopts import Parameter

from wbc.core.changes import changed, read_changes
from wbc.core.errors import InputError
from wbc.core.settings import Count, settings
from wbc.feet import Foot, SoftFoot
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.feet.soles.sole import SoleGeometry
from wbc.robots import load
from wbc.sim.plant.model import sole_geometries
from wbc.sim.plant.settings import PhysicsSettings
from wbc.sim.rig import HRP4C_SOLE, STIFFNESSES, FootTest
from wbc.sim.terrain import Rendering, Terrain
from wbc.sim.terrain import terrain as make_terrain
from wbc.sim.terrain.families.base import make_family

Several = Parameter(consume_multiple=True)
"""An option that takes all the values that follow it."""


def read_foot(name: str, stiffness: float | None, changes: Iterable[str]) -> Foot:
    """Return a foot by name with some of its parameters changed.

    Args:
        name: One of `wbc.feet.foot_names()`.
        stiffness: Stiffness of the sole hinges, Nm/rad; the foot's default when None.
        changes: Further parameters as name=value; those of its parts as part.name=value.

    Raises:
        UnknownNameError: No such foot or parameter.
        InputError: A value out of range, or a stiffness for a foot that has none.
    """
    design = foot_by_name(name)
    values = read_changes(changes)
    if stiffness is not None:
        if not isinstance(design, SoftFoot):
            raise InputError(f"a {name} foot has no stiffness; leave --stiffness out, or take a soft foot")
        if "stiffness" in values:
            raise InputError("the stiffness is given twice, as --stiffness and as --foot-param")
        values["stiffness"] = stiffness
    return changed(design, values)


def robot_sole(robot: str | None) -> SoleGeometry:
    """Return the ankle and sole that a foot is fitted to: those of a robot, or of HRP-4C.

    Raises:
        UnknownNameError: No such robot.
    """
    return HRP4C_SOLE if robot is None else sole_geometries(load(robot).robot())[0]


@settings(kw_only=True)
class FootOptions:
    """Options of the foot, the ankle over it and the load.

    Attributes:
        foot: Foot, one of those that `wbc feet` lists.
        foot_param: Parameters of the foot, each as name=value, such as phalanges=8 or contact.radius=0.005.
        robot: Robot whose ankle the foot is fitted to; when not given, an ankle 93 mm over a sole of 160 x 76 mm.
        load: Weight on the ankle, N.
        ankle_stiffness: Of the servo that holds the ankle level, Nm/rad; 0 leaves roll and pitch free.
    """

    foot: str = "soft"
    foot_param: tuple[str, ...] = ()
    robot: str | None = None
    load: float = FootTest.load
    ankle_stiffness: float = FootTest.ankle_stiffness


@settings(kw_only=True)
class RigOptions(FootOptions):
    """Options of one foot on one ground.

    Attributes:
        stiffness: Of the sole hinges of a soft or variable foot, Nm/rad; the foot's own when not given.
        terrain: Family of grounds, one of those that `wbc terrains` lists.
        amplitude: Highest minus lowest point of the ground, m; the family's own when not given.
        seed: Fixes every random draw of the ground.
        param: Parameters of the ground, each as name=value.
        rendering: Solids (geoms), height_field, or auto: solids wherever the family is made of them.
        resolution: Greatest cell of a height field, m; fine enough for ground and sole when not given.
        x: Place of the sole centre ahead of the middle of the rough part, m.
        y: Place of the sole centre left of the track's middle, m.
        yaw: Heading of the foot, degrees.
        timestep: Physics step, s.
    """

    stiffness: float | None = None
    terrain: str = "flat"
    amplitude: float | None = None
    seed: int = 0
    param: tuple[str, ...] = ()
    rendering: Rendering = "auto"
    resolution: float | None = None
    x: float = FootTest.x
    y: float = FootTest.y
    yaw: float = math.degrees(FootTest.yaw)
    timestep: float = PhysicsSettings.timestep

    def test(self, drop: float = FootTest.drop) -> FootTest:
        """Return the foot test.

        Args:
            drop: Height over the ground from which the foot is let fall, m.

        Raises:
            UnknownNameError: No such foot, robot, ground or parameter.
            InputError: A value out of range, a stiffness for a foot that has none, or a foot that does not fit.
        """
        design = read_foot(self.foot, self.stiffness, self.foot_param)
        return FootTest(
            foot=design,
            ground=make_terrain(
                make_family(self.terrain, read_changes(self.param)),
                self.amplitude,
                self.seed,
                rendering=self.rendering,
                resolution=self.resolution,
                sole_radius=design.contact.radius,
            ),
            load=self.load,
            x=self.x,
            y=self.y,
            yaw=math.radians(self.yaw),
            drop=drop,
            ankle_stiffness=self.ankle_stiffness,
            robot_sole=robot_sole(self.robot),
            physics=PhysicsSettings(timestep=self.timestep),
        )


@settings(kw_only=True)
class StudyOptions(FootOptions):
    """Options of one foot over several stiffnesses and grounds.

    Attributes:
        stiffness: Stiffnesses of the sole hinges, Nm/rad.
        terrain: Families of grounds, those that `wbc terrains` lists.
        amplitude: Highest minus lowest point of the grounds, m.
        seeds: Number of grounds of each family.
    """

    stiffness: Annotated[tuple[float, ...], Several] = STIFFNESSES
    terrain: Annotated[tuple[str, ...], Several] = ("random", "stones")
    amplitude: float = 0.03
    seeds: Count = 5

    def __post_init__(self) -> None:
        if not self.terrain:
            raise InputError("at least one terrain is needed")

    def test(self) -> FootTest:
        """Return the foot test that all runs share.

        Raises:
            UnknownNameError: No such foot, robot or parameter.
            InputError: A value out of range, or a foot that does not fit.
        """
        return FootTest(
            foot=read_foot(self.foot, None, self.foot_param),
            load=self.load,
            ankle_stiffness=self.ankle_stiffness,
            robot_sole=robot_sole(self.robot),
        )

    def grounds(self) -> tuple[Terrain, ...]:
        """Return the grounds, all families for one seed after the other.

        Raises:
            UnknownNameError: No such family.
            InputError: An amplitude out of range.
        """
        return tuple(
            make_terrain(name, 0.0 if name == "flat" else self.amplitude, seed)
            for seed in range(self.seeds)
            for name in self.terrain
        )
