"""Wall time of a simulated walk, divided into parts."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import mujoco

from wbc.core.settings import Count, Positive, Seed, settings
from wbc.sim.walks import WalkPlan, WalkSpec, WalkTrial, walk

PARTS = ("physics", "sensors", "observer", "walk", "stabilizer", "QP", "rest of the tick", "figures")
"""Parts of a control period.

Of the tick: the observer, the walk (phases, pattern, step adjustment), the stabilizer with its distribution, the
whole-body QP from assembly to solution, and the rest: targets, servo references, fall test. Figures are the
result and the fall test on the true state. The whole is timed in separate walks: the clocks around the parts cost about
a hundredth of it, and the parts are scaled down by that.
"""

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
        period_us: Wall time of a control period, µs.
        parts_us: Wall time of a control period by `PARTS`, µs.
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
    parts_us: dict[str, float]
    collision_share: float
    constraint_share: float


def bench_walk(options: BenchWalkOptions) -> Iterator[WalkCost]:
    """Time every case."""
    for name, spec in options.cases().items():
        shares = _physics_shares(spec)
        parts = min(
            (_time_by_part(spec) for _ in range(options.repeats)), key=lambda parts: sum(parts.values())
        )
        whole = sum(parts.values())
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
            parts_us={part: period * spent / whole for part, spent in parts.items()},
            collision_share=shares[0],
            constraint_share=shares[1],
        )


def _time_by_part(spec: WalkSpec) -> dict[str, float]:
    """Walk once, and return the time by `PARTS`, s."""
    trial = WalkTrial(spec)
    plant, walking = trial.plant, trial.walking
    spent: dict[str, float] = {}
    for part, owner, method in (
        ("physics", plant, "step"),
        ("sensors", plant, "measure"),
        ("tick", walking, "command"),
        ("observer", walking.control.observer, "update"),
        ("walk", walking.walk, "update"),
        ("stabilizer", walking.stabilizer, "update"),
        ("QP", walking.controller, "solve"),
    ):
        spent[part] = 0.0
        setattr(owner, method, _timed(getattr(owner, method), part, spent))
    result = trial.run()
    assert result.clock is not None, "a walk that has just been run has been timed"
    whole = plant.time / result.clock.real_time_factor
    tick = spent.pop("tick")
    spent["rest of the tick"] = tick - sum(spent[part] for part in PARTS[2:6])
    spent["figures"] = whole - spent["physics"] - spent["sensors"] - tick
    return {part: spent[part] for part in PARTS}


def _timed(method: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    """Return a method that adds its time to that of a part."""
    clock = time.perf_counter

    @functools.wraps(method)
    def timed(*args: Any, **kwargs: Any) -> Any:
        start = clock()
        try:
            return method(*args, **kwargs)
        finally:
            spent[part] += clock() - start

    return timed


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
