"""Wall time of a simulated walk, divided into parts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import mujoco

from wbc.app.bench.profile import ProfileRow, profile_walk
from wbc.core.settings import Count, Positive, Seed, settings
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk

SOFT: dict[str, Any] = {"foot": "soft", "stiffness": 5.0, "amplitude": 0.02}

FAST: dict[str, Any] = {"timestep": 0.002, "control_period": 0.01}
"""The fast mode: physics steps and control periods of twice the usual length."""

CASES: dict[str, dict[str, Any]] = {
    "flat floor, flat soles": {},
    "stones of 20 mm, soft soles": {"terrain": "stones", **SOFT},
    "random ground of 20 mm along x, soft soles": {
        "terrain": "random",
        "terrain_params": {"cutoff": 0.1},
        **SOFT,
    },
    "flat floor, flat soles, fast mode": FAST,
    "stones of 20 mm, soft soles, fast mode": {"terrain": "stones", **SOFT, **FAST},
}
"""Walks that are timed: light and heavy contacts, on solids and on a height field; and the fast mode."""


@settings(kw_only=True)
class BenchWalkOptions:
    """Length, seed and number of the walks that are timed.

    Attributes:
        distance: Length of the walks, m.
        seed: Seed of ground and noise.
        repeats: Times that each is walked; the fastest counts, as other work only slows down.
    """

    distance: Annotated[Positive, "m"] = 3.0
    seed: Seed = 0
    repeats: Count = 3

    def cases(self) -> dict[str, WalkSpec]:
        """Return the walks: name → spec."""
        plan = WalkPlan(distance=self.distance)
        return {name: WalkSpec(plan=plan, seed=self.seed, **values) for name, values in CASES.items()}


@dataclass(frozen=True)
class WalkCost:
    """Wall time of one walk; times are means over all control periods, on one core.

    Attributes:
        name: Name of the case.
        timestep: Physics step, s.
        control_period: Time between two commands, s.
        steps_done: Steps of the walk; one that falls early is no measure.
        steps_planned: Steps of its plan.
        real_time_factor: Simulated time over wall time.
        period_us: Wall time of a control period, µs, without clocks around its parts.
        profile: Parts of the period in walks of their own, scaled down to it by what the clocks cost.
        collision_share: Share of the physics spent on collision detection.
        constraint_share: Share of the physics spent on contact forces.
    """

    name: str
    timestep: float
    control_period: float
    steps_done: int
    steps_planned: int
    real_time_factor: float
    period_us: float
    profile: tuple[ProfileRow, ...]
    collision_share: float
    constraint_share: float


def bench_walk(options: BenchWalkOptions) -> Iterator[WalkCost]:
    """Time every case."""
    for name, spec in options.cases().items():
        shares = _physics_shares(spec)
        profile = min(
            (profile_walk(WalkTrial(spec))[1] for _ in range(options.repeats)),
            key=lambda rows: sum(row.us for row in rows),
        )
        results = [walk(spec) for _ in range(options.repeats)]
        factor = max(result.clock.real_time_factor for result in results if result.clock is not None)
        period = 1e6 * spec.period / factor
        yield WalkCost(
            name=name,
            timestep=spec.timestep,
            control_period=spec.period,
            steps_done=results[0].steps_done,
            steps_planned=results[0].steps_planned,
            real_time_factor=factor,
            period_us=period,
            profile=tuple(replace(row, us=period * row.share) for row in profile),
            collision_share=shares[0],
            constraint_share=shares[1],
        )


def _physics_shares(spec: WalkSpec) -> tuple[float, float]:
    """Return the shares of collision and constraints in MuJoCo's time, by its own timers, which slow it down."""
    mujoco.set_mjcb_time(time.perf_counter)
    try:
        trial = WalkTrial(spec)
        trial.run()
    finally:
        mujoco.set_mjcb_time(None)
    timer, kinds = trial.plant.data.timer, mujoco.mjtTimer
    whole = timer[kinds.mjTIMER_STEP].duration
    return (
        timer[kinds.mjTIMER_POS_COLLISION].duration / whole,
        timer[kinds.mjTIMER_CONSTRAINT].duration / whole,
    )
