"""Studies of one foot over stiffness, ground and time step: stability table, stiffness and force–deflection curves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace

from wbc.core.errors import InputError, positive
from wbc.feet import Foot, SoftFoot
from wbc.sim.rig.actions import land, press
from wbc.sim.rig.fixture import Rig
from wbc.sim.rig.spec import FootTest
from wbc.sim.terrain import Terrain, terrain

STIFFNESSES = (0.0, 0.5, 5.0, 20.0, 42.0, 80.0)
"""Stiffnesses over the paper's range 0–80 Nm/rad (Table I); 42 is the one of its Fig. 4."""

BAR_PLACE = -0.028
"""Place of a bar under the foot, m ahead of the sole centre: midway between the heel hinge and the loop point of the
soft foot, where its sole can bend most."""

LOADS = (25.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0, 600.0)
"""Loads of a force–deflection curve, N: up to 1.5 times the weight of a robot of 40 kg."""


def bumps(seeds: Iterable[int] = range(5), amplitude: float = 0.03) -> tuple[Terrain, ...]:
    """Return grounds that vary along the track alone (random) and both ways (stones), one of each per seed.

    Args:
        seeds: Seeds of the grounds.
        amplitude: Highest minus lowest point, m.
    """
    return tuple(terrain(name, amplitude, seed) for seed in seeds for name in ("random", "stones"))


def over_bar(test: FootTest, height: float = 0.03) -> FootTest:
    """Return the test over a round-topped bar across the track, under the middle of the soft foot's arch.

    Args:
        test: Foot, load and place.
        height: Height of the bar, m.
    """
    ground = terrain("cylinder_obstacles", height, yaw=0.0, ramp=0.0)
    if not ground.shapes:
        raise InputError("height of the bar (m) must be above zero")
    peak = max((shape.peak for shape in ground.shapes), key=lambda peak: float(peak[2]))
    place = float(peak[0]) - (ground.start + ground.stop) / 2.0 - BAR_PLACE
    return replace(test, ground=ground, x=place, y=0.0, yaw=0.0)


def with_stiffness(foot: Foot, stiffness: float) -> Foot:
    """Return a soft foot with another stiffness (Nm/rad).

    Raises:
        InputError: The foot is rigid, or the stiffness out of range.
    """
    if not isinstance(foot, SoftFoot):
        raise InputError(f"a {type(foot).__name__} has no stiffness to vary; use a soft foot")
    return replace(foot, stiffness=stiffness)


def stiffness_of(foot: Foot) -> float:
    """Return the stiffness of a foot's sole, Nm/rad; infinite for a rigid one."""
    return foot.stiffness if isinstance(foot, SoftFoot) else math.inf


@dataclass(frozen=True)
class StabilityRow:
    """One cell of the stability table.

    Attributes:
        ground: Family of the ground.
        seed: Seed of the ground.
        stiffness: Stiffness of the sole, Nm/rad.
        timestep: Physics step, s.
        diverged: True if the landing, the hold or the tilting in eight directions diverged.
        balance_error: Mean vertical force over weight − 1.
        force_std: Standard deviation of the force in the hold, N.
        loop_gap: Largest loop gap in the hold, m.
        loop_gap_peak: Largest loop gap from the landing on, m.
        penetration: Largest penetration in the hold, m.
        penetration_peak: Largest penetration from the landing on, m.
        jitter: Rms of the sole hinge rates in the hold, rad/s.
    """

    ground: str
    seed: int
    stiffness: float
    timestep: float
    diverged: bool
    balance_error: float = math.nan
    force_std: float = math.nan
    loop_gap: float = math.nan
    loop_gap_peak: float = math.nan
    penetration: float = math.nan
    penetration_peak: float = math.nan
    jitter: float = math.nan


def stability(
    test: FootTest,
    *,
    stiffnesses: Sequence[float] = STIFFNESSES,
    grounds: Sequence[Terrain] | None = None,
    timesteps: Sequence[float] = (0.001, 0.002),
) -> Iterator[StabilityRow]:
    """Press a soft foot for every stiffness, ground and physics step, and tilt it in eight directions.

    Args:
        test: Load, ankle and everything else that the rows share.
        stiffnesses: Stiffnesses of the sole, Nm/rad.
        grounds: Grounds; `bumps()` when None.
        timesteps: Physics steps, s.

    Raises:
        InputError: A rigid foot, or a value out of range; before anything is pressed.
    """
    designs = [with_stiffness(test.foot, stiffness) for stiffness in stiffnesses]
    physics = [replace(test.physics, timestep=timestep) for timestep in timesteps]
    chosen = bumps() if grounds is None else tuple(grounds)
    tests = [
        replace(test, foot=design, ground=ground, physics=each)
        for each in physics
        for ground in chosen
        for design in designs
    ]
    return map(_stability_row, tests)


def _stability_row(test: FootTest) -> StabilityRow:
    assert isinstance(test.foot, SoftFoot)
    result = press(test)
    row = StabilityRow(
        test.ground.name, test.ground.seed, test.foot.stiffness, test.physics.timestep, result.diverged
    )
    if result.hold is None:
        return row
    values = {f.name: getattr(result.hold, f.name) for f in fields(row) if hasattr(result.hold, f.name)}
    return replace(row, **values)


@dataclass(frozen=True)
class StiffnessRow:
    """Stance of a foot on one ground at one stiffness.

    Attributes:
        ground: Family of the ground.
        seed: Seed of the ground.
        stiffness: Stiffness of the sole, Nm/rad; infinite for a rigid foot.
        ankle_height: Height of the ankle over the level z = 0, m.
        contacts: Contact points that carry load.
        contact_area: Area of the convex hull of these points, m².
        support_area: Area of the equivalent support polygon, m².
        absorbed: Share of the drop energy that did not come back.
        peak_force: Largest vertical force at landing, N.
    """

    ground: str
    seed: int
    stiffness: float
    ankle_height: float
    contacts: int
    contact_area: float
    support_area: float
    absorbed: float
    peak_force: float


def stiffness_curves(
    test: FootTest, *, stiffnesses: Sequence[float] = STIFFNESSES, grounds: Sequence[Terrain] | None = None
) -> Iterator[StiffnessRow]:
    """Press a soft foot over stiffnesses and grounds; a rigid foot gives one row per ground.

    Runs that diverge are left out.

    Args:
        test: Load, ankle (with a servo) and everything else that the rows share.
        stiffnesses: Stiffnesses of the sole, Nm/rad; ignored for a rigid foot.
        grounds: Grounds; `bumps()` when None.

    Raises:
        InputError: A value out of range; before anything is pressed.
    """
    designs = [test.foot]
    if isinstance(test.foot, SoftFoot):
        designs = [with_stiffness(test.foot, stiffness) for stiffness in stiffnesses]
    chosen = bumps() if grounds is None else tuple(grounds)
    tests = [replace(test, foot=design, ground=ground) for ground in chosen for design in designs]
    return (row for row in map(_stiffness_row, tests) if row is not None)


def _stiffness_row(test: FootTest) -> StiffnessRow | None:
    result = press(test)
    if result.impact is None or result.hold is None or result.support is None:
        return None
    return StiffnessRow(
        ground=test.ground.name,
        seed=test.ground.seed,
        stiffness=stiffness_of(test.foot),
        ankle_height=result.hold.ankle_height,
        contacts=result.hold.contacts,
        contact_area=result.hold.contact_area,
        support_area=result.support.area,
        absorbed=result.impact.absorbed,
        peak_force=result.impact.peak_force,
    )


@dataclass(frozen=True)
class Deflection:
    """Force–deflection curve of a foot.

    Attributes:
        stiffness: Stiffness of the sole, Nm/rad; infinite for a rigid foot.
        load: Weight of load and foot, N.
        deflection: Depth of the ankle below the height at which the undeformed, level foot would touch, m.
        contact_area: Area of the convex hull of the contact points, m².
        diverged: True if the simulation diverged; the curve ends early then.
    """

    stiffness: float
    load: tuple[float, ...]
    deflection: tuple[float, ...]
    contact_area: tuple[float, ...]
    diverged: bool


def rising_loads(loads: Sequence[float]) -> tuple[float, ...]:
    """Return the loads of a force–deflection curve as floats, N.

    Raises:
        InputError: None at all, or they do not rise.
    """
    steps = tuple(positive("load (N)", load) for load in loads)
    if not steps or any(b <= a for a, b in zip(steps, steps[1:], strict=False)):
        raise InputError(f"loads of a force–deflection curve must rise, got {[f'{x:g}' for x in steps]}")
    return steps


def force_deflection(
    test: FootTest, *, loads: Sequence[float] = LOADS[1:], settle: float = 1.0
) -> Deflection:
    """Load a foot step by step and follow the ankle down.

    On bumps the ankle tilts as well, so part of the way down is rocking: a rigid foot shows how much.

    Args:
        test: Foot and ground; its load is the first one.
        loads: Further loads, rising, N.
        settle: Time at each load, s. With k = 5 Nm/rad and b = 2 Nms/rad a hinge settles in 0.4 s; below that
            stiffness the curve is that of a foot still creeping.

    Raises:
        InputError: The loads do not rise.
    """
    steps = rising_loads((test.load, *loads))
    positive("settling time (s)", settle)
    stiffness = stiffness_of(test.foot)
    rig = Rig(test)
    if land(rig) is None:
        return Deflection(stiffness, (), (), (), True)
    rows: list[tuple[float, float, float]] = []
    for load in steps:
        rig.set_extra_load(load - test.load)
        rig.step(rig.steps(settle))
        if rig.diverged:
            break
        weight = rig.mass * test.physics.gravity + load - test.load
        rows.append((weight, rig.touch_height - rig.ankle_height, rig.contact_area()))
    columns = [tuple(column) for column in zip(*rows, strict=True)] or [(), (), ()]
    return Deflection(stiffness, columns[0], columns[1], columns[2], rig.diverged)
