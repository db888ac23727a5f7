"""FootTest: a foot, a ground and a load, and how long the foot is held."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Annotated, Any

from pydantic import Field

from wbc.core.errors import InputError
from wbc.core.settings import NonNegative, Positive, settings, to_json
from wbc.feet import Foot, FootFit, foot
from wbc.feet.soles.catalog import foot_name
from wbc.feet.soles.sole import SoleGeometry
from wbc.sim.plant.settings import PhysicsSettings
from wbc.sim.terrain.spec import Terrain, terrain

HRP4C_SOLE = SoleGeometry.under_ankle(0.093, 0.160, 0.076)
"""Sole and ankle height of HRP-4C, whose contact rectangle HRP-4J shares (hrp4c_description, BSD-3)."""


@settings
class FootTest:
    """One foot under a loaded ankle, over the middle of a ground.

    The ankle slides up and down freely, carries a mass and is held level by a servo about roll and pitch.

    Attributes:
        foot: The foot.
        ground: The ground under it.
        load: Weight of the mass on the ankle, without the foot's own, N.
        x: Position of the sole centre ahead of the middle of the rough part, m.
        y: Position of the sole centre left of the track's middle, m.
        yaw: Heading of the foot, rad.
        ankle_stiffness: Stiffness of the servo that holds the ankle level, Nm/rad; 0 leaves roll and pitch free.
        robot_sole: Ankle and sole of the robot that the foot is fitted to.
        drop: Height of the sole over the highest point under it at the start, m.
        settle: Time from the start until the hold is measured, s.
        hold: Time over which the hold is measured, s.
        physics: Integrator settings.

    Source: 200 N and the drop of 10 mm from the foot's own stability measurements; 2000 Nm/rad is the ankle
    servo of the walking sketch.
    """

    foot: Foot = field(default_factory=lambda: foot("soft"))
    ground: Terrain = field(default_factory=lambda: terrain("flat"))
    load: Annotated[Positive, "N"] = 200.0
    x: Annotated[float, "m"] = 0.0
    y: Annotated[float, "m"] = 0.0
    yaw: Annotated[float, "rad"] = 0.0
    ankle_stiffness: Annotated[NonNegative, "Nm/rad"] = 2000.0
    robot_sole: SoleGeometry = HRP4C_SOLE
    drop: Annotated[NonNegative, Field(le=1.0), "m"] = 0.01
    settle: Annotated[Positive, "s"] = 1.4
    hold: Annotated[Positive, "s"] = 0.5
    physics: PhysicsSettings = field(default_factory=PhysicsSettings)

    def __post_init__(self) -> None:
        if self.hold < self.physics.timestep or self.settle < self.physics.timestep:
            raise InputError(
                f"settling and hold times must be at least one physics step of {self.physics.timestep:g} s, "
                f"got {self.settle:g} s and {self.hold:g} s"
            )
        if self.physics.gravity == 0.0:
            raise InputError("gravity (m/s²) must be above 0 for a foot test, whose load is a weight; got 0")
        self.foot.fit(self.robot_sole)
        # A height field has to be as fine as this sole's spheres; a coarser one is refused here.
        if self.ground.sole_radius != self.foot.contact.radius:
            object.__setattr__(self, "ground", replace(self.ground, sole_radius=self.foot.contact.radius))

    def describe(self) -> dict[str, Any]:
        """Return foot with its fit, ground, load and place as JSON values; names carry the units."""
        return {
            "foot": foot_name(self.foot),
            "foot_parameters": to_json(self.foot),
            **fit_facts(self.foot.fit(self.robot_sole)),
            "terrain": self.ground.name,
            "amplitude_m": self.ground.amplitude,
            "seed": self.ground.seed,
            "load_n": self.load,
            "place_m": [self.x, self.y],
            "yaw_rad": self.yaw,
            "ankle_stiffness_nm_per_rad": self.ankle_stiffness,
            "drop_m": self.drop,
            "settle_s": self.settle,
            "hold_s": self.hold,
            "timestep_s": self.physics.timestep,
        }


def fit_facts(fit: FootFit) -> dict[str, Any]:
    """Return footprint, ankle, added mass and height change as JSON values; names carry the units."""
    return {
        "footprint_m": [fit.sole.length, fit.sole.width],
        "ankle_in_sole_m": fit.sole.ankle.tolist(),
        "added_mass_kg": fit.mass,
        "height_change_m": fit.height_change,
    }
