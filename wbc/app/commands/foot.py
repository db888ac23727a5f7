"""`wbc foot press`: one foot pressed onto a ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError
from wbc.feet.catalog import foot as foot_by_name
from wbc.sim.rig import FootTest, PressResult, plot_press, to_json
from wbc.sim.rig import press as run_press
from wbc.sim.settings import PhysicsSettings
from wbc.sim.terrain import terrain as make_terrain
from wbc.sim.terrain.drawing import checked_path
from wbc.sim.terrain.report import read_params


@dataclass(frozen=True, kw_only=True)
class FootPressOptions:
    """Which foot is pressed onto what.

    Attributes:
        foot: Foot: flat, rigid, soft or variable.
        stiffness: Of the sole hinges of a soft or variable foot, Nm/rad; the foot's own when not given.
        terrain: Family of grounds, one of those that `wbc terrains` lists.
        amplitude: Highest minus lowest point of the ground, m; the family's own when not given.
        seed: Fixes every random draw of the ground.
        param: Parameters of the ground, each as name=value.
        load: Weight on the ankle, N.
        x: Place of the sole centre ahead of the middle of the rough part, m.
        y: Place of the sole centre left of the track's middle, m.
        yaw: Heading of the foot, degrees.
        drop: Height over the ground from which the foot is let fall, m.
        ankle_stiffness: Of the servo that holds the ankle level, Nm/rad; 0 leaves roll and pitch free.
        timestep: Physics step, s.
        plot: Picture to write.
    """

    foot: str = "soft"
    stiffness: float | None = None
    terrain: str = "flat"
    amplitude: float | None = None
    seed: int = 0
    param: tuple[str, ...] = ()
    load: float = FootTest.load
    x: float = FootTest.x
    y: float = FootTest.y
    yaw: float = math.degrees(FootTest.yaw)
    drop: float = FootTest.drop
    ankle_stiffness: float = FootTest.ankle_stiffness
    timestep: float = PhysicsSettings.timestep
    plot: Path | None = None

    def test(self) -> FootTest:
        """The test that is asked for.

        Raises:
            UnknownNameError: No such foot, ground or parameter.
            InputError: A value out of range, or a stiffness for a foot that has none.
        """
        if self.stiffness is not None and self.foot in ("flat", "rigid"):
            raise InputError(f"a {self.foot} foot has no stiffness; leave --stiffness out")
        parameters = {} if self.stiffness is None else {"stiffness": self.stiffness}
        return FootTest(
            foot=foot_by_name(self.foot, **parameters),
            ground=make_terrain(
                self.terrain, self.amplitude, self.seed, **read_params(self.terrain, self.param)
            ),
            load=self.load,
            x=self.x,
            y=self.y,
            yaw=math.radians(self.yaw),
            drop=self.drop,
            ankle_stiffness=self.ankle_stiffness,
            physics=PhysicsSettings(timestep=self.timestep),
        )


@reports
def press(
    options: Flat[FootPressOptions] = FootPressOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Drop one foot onto a ground, let it settle under a load and look at it: forces, contacts, support, sole."""
    test = options.test()
    target = None if options.plot is None else checked_path(options.plot)
    result = run_press(test)
    facts = {
        "foot": options.foot,
        "terrain": test.ground.name,
        "amplitude": test.ground.amplitude,
        "seed": test.ground.seed,
        "load": test.load,
        **to_json(result),
    }
    if target is not None and not result.diverged:
        plot_press(test, result, target)
        facts["plot"] = str(target)
    return output.report(facts, _text(options, test, result))


def _text(options: FootPressOptions, test: FootTest, result: PressResult) -> str:
    ground = f"{test.ground.name}, {1e3 * test.ground.amplitude:.0f} mm, seed {test.ground.seed}"
    lines = [f"{options.foot} foot on {ground}, load {test.load:g} N"]
    if result.hold is None or result.impact is None:
        return f"{lines[0]}: the simulation DIVERGED"
    hold, impact, support = result.hold, result.impact, result.support
    lines += [
        f"  landing   {impact.speed:.2f} m/s, peak {impact.peak_force:.0f} N, {100 * impact.absorbed:.0f} % absorbed",
        f"  force     {hold.force_mean:.1f} N, {100 * hold.balance_error:+.3f} % off the weight, "
        f"± {hold.force_std:.2g} N",
        f"  contacts  {hold.contacts} points around {1e4 * hold.contact_area:.1f} cm², "
        f"centre of pressure ({1e3 * hold.center_of_pressure[0]:.1f}, {1e3 * hold.center_of_pressure[1]:.1f}) mm",
    ]
    if support is not None:
        lines.append(
            f"  support   {1e4 * support.area:.1f} cm², {1e3 * support.backward:.0f} to {1e3 * support.forward:.0f} mm "
            f"along, {1e3 * support.right:.0f} to {1e3 * support.left:.0f} mm across"
        )
    lines.append(
        f"  ankle     {1e3 * hold.ankle_height:.1f} mm high, tilted by {math.degrees(hold.ankle_tilt[0]):.2f}° roll, "
        f"{math.degrees(hold.ankle_tilt[1]):.2f}° pitch"
    )
    if hold.sole_angles:
        degrees = " ".join(f"{math.degrees(angle):.1f}" for angle in hold.sole_angles)
        lines.append(f"  sole      {degrees} degrees from toe to heel, loop gap {1e3 * hold.loop_gap:.3f} mm")
    lines.append(
        f"  depth     {1e3 * hold.penetration:.3f} mm penetration, {1e3 * hold.penetration_peak:.3f} mm at landing"
    )
    return "\n".join(lines)
