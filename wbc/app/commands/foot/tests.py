"""`wbc foot press`, `drop`, `slide` and `pitch`: one foot on a test rig."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from wbc.app.files import check_picture
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.app.rig_options import RigOptions
from wbc.core.settings import settings, to_json
from wbc.sim import rig as bench
from wbc.sim.rig import FootTest, PitchResult, PressResult, SlideResult

Result = TypeVar("Result", PressResult, SlideResult, PitchResult)


@settings(kw_only=True)
class PressOptions:
    """Options of `wbc foot press`.

    Attributes:
        drop: Height over the ground from which the foot is let fall, m.
        plot: Picture to write.
    """

    drop: float = FootTest.drop
    plot: Path | None = None


@settings(kw_only=True)
class DropOptions:
    """Options of `wbc foot drop`.

    Attributes:
        height: Of the sole over the highest point under it, m.
        plot: Picture to write of the foot at rest.
    """

    height: float = 0.05
    plot: Path | None = None


@settings(kw_only=True)
class SlideOptions:
    """Options of `wbc foot slide`.

    Attributes:
        shear_share: Shear over weight while creep is measured.
        ramp: Growth of shear over weight per second afterwards, 1/s.
    """

    shear_share: float = 0.3
    ramp: float = 1.0


@settings(kw_only=True)
class PitchOptions:
    """Options of `wbc foot pitch`.

    Attributes:
        angle: Largest pitch that the ankle is asked for, degrees.
        rate: Speed, degrees/s.
        plot: Picture to write.
    """

    angle: float = 5.0
    rate: float = 10.0
    plot: Path | None = None


@reports
def press(
    rig: Flat[RigOptions] = RigOptions(),
    *,
    options: Flat[PressOptions] = PressOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Drop one foot onto a ground, let it settle under a load and look at it: forces, contacts, support, sole."""
    test, target = rig.test(options.drop), check_picture(options.plot, rig.param)
    return _report(output, test, bench.press(test), _press_lines, bench.plot_press, target)


@reports
def drop(
    rig: Flat[RigOptions] = RigOptions(),
    *,
    options: Flat[DropOptions] = DropOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Drop one foot from higher up: what its sole takes of a hard landing."""
    test, target = rig.test(), check_picture(options.plot, rig.param)
    result = bench.drop(test, height=options.height)
    return _report(output, test, result, _press_lines, bench.plot_press, target)


@reports
def slide(
    rig: Flat[RigOptions] = RigOptions(),
    *,
    options: Flat[SlideOptions] = SlideOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Push one loaded foot forward: how it creeps under a shear, and at which shear it slides."""
    test = rig.test()
    result = bench.slide(test, shear_share=options.shear_share, ramp=options.ramp)
    return _report(output, test, result, _slide_lines)


@reports
def pitch(
    rig: Flat[RigOptions] = RigOptions(),
    *,
    options: Flat[PitchOptions] = PitchOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Pitch the ankle of one loaded foot toe down, toe up and back: how the centre of pressure follows."""
    test, target = rig.test(), check_picture(options.plot, rig.param)
    result = bench.pitch(test, amplitude=math.radians(options.angle), rate=math.radians(options.rate))
    return _report(output, test, result, _pitch_lines, bench.plot_pitch, target)


def _report(
    output: Output,
    test: FootTest,
    result: Result,
    lines: Callable[[Result], list[str]],
    plot: Callable[[FootTest, Result, Path], None] | None = None,
    target: Path | None = None,
) -> Report:
    """Draw a result if asked to, and report test and result."""
    data = {**test.describe(), **to_json(result)}
    if plot is not None and target is not None and not result.diverged:
        plot(test, result, target)
        data["plot"] = str(target)
    return output.report(data, "\n".join([_headline(test), *lines(result)]))


def _headline(test: FootTest) -> str:
    """Return foot, ground and load as text for people."""
    description, ground = test.describe(), test.ground
    on = (
        f"{ground.name}, {1e3 * ground.amplitude:.0f} mm, seed {ground.seed}"
        if ground.amplitude
        else "flat ground"
    )
    length, width = (1e3 * size for size in description["footprint_m"])
    stiffness = f" of {test.foot.stiffness:g} Nm/rad" if hasattr(test.foot, "stiffness") else ""
    return (
        f"{description['foot']} foot{stiffness} on {on}, {test.load:g} N on the ankle\n"
        f"  foot      {length:.0f} x {width:.0f} mm, {description['added_mass_kg']:.2f} kg more and "
        f"{1e3 * description['height_change_m']:.0f} mm higher than the ankle's own sole"
    )


def _press_lines(result: PressResult) -> list[str]:
    if result.hold is None or result.impact is None:
        return [_DIVERGED]
    hold, impact, support = result.hold, result.impact, result.support
    lines = [
        f"  landing   {impact.speed:.2f} m/s, peak {impact.peak_force:.0f} N, {100 * impact.absorbed:.1f} % of "
        f"{impact.drop_energy:.2f} J absorbed, {impact.sole_energy:.2f} J of it in the sole and "
        f"{impact.arch_energy:.2f} J in the arch",
        f"  force     {hold.force_mean:.1f} N, {100 * hold.balance_error:+.3f} % off the weight, "
        f"± {hold.force_std:.2g} N",
        f"  contacts  {hold.contacts} points around {1e4 * hold.contact_area:.1f} cm², "
        f"centre of pressure ({1e3 * hold.centre_of_pressure[0]:.1f}, {1e3 * hold.centre_of_pressure[1]:.1f}) mm",
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
    return lines


def _slide_lines(result: SlideResult) -> list[str]:
    if result.diverged:
        return [_DIVERGED]
    slips = "does not slide" if math.isnan(result.slip_share) else f"slides at {result.slip_share:.2f} of it"
    return [
        f"  creep     {1e6 * result.creep:.1f} µm/s under a shear of {result.shear_share:g} of the weight",
        f"  friction  {slips}",
    ]


def _pitch_lines(result: PitchResult) -> list[str]:
    if result.diverged:
        return [_DIVERGED]
    lines = []
    for name, pick in (("toe down", max), ("toe up", min)):
        i = result.pitch.index(pick(result.pitch))
        lines.append(
            f"  {name:<9} {math.degrees(result.pitch[i]):+.1f}°: centre of pressure at "
            f"{1e3 * result.centre_of_pressure[i]:.0f} mm, moment {result.moment[i]:.1f} Nm, ankle "
            f"{1e3 * result.ankle_height[i]:.1f} mm high"
        )
    return lines


_DIVERGED = "  the simulation DIVERGED"
