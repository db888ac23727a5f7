"""Where the time of a simulated walk goes."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import mujoco

from wbc.core.errors import positive, whole_number
from wbc.sim.walks import WalkPlan, WalkSpec, WalkTrial, walk

PARTS = ("physics", "sensors", "observer", "walk", "stabilizer", "program", "rest of the tick", "figures")
"""What the time of a control period is divided into.

Of the tick: the observer, the walk (phases, pattern, step adjustment), the stabilizer with its distribution, the
whole-body program from assembly to solution, and the rest: targets, servo references, fall test. Figures are what the
result and the fall test on the true state take. The whole is timed in walks of their own: the clocks around the parts
cost about a hundredth of it, and the parts are scaled down by that.
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
"""Walks that are timed: light and heavy contacts, on bodies and on a height field; and the fast mode."""


@dataclass(frozen=True, kw_only=True)
class WalkCostOptions:
    """What is timed.

    Attributes:
        distance: Of the walks, m.
        seed: Of ground and noise.
        repeats: Times that each is walked; the fastest counts, as other work only slows down.
    """

    distance: float = 3.0
    seed: int = 0
    repeats: int = 3

    def __post_init__(self) -> None:
        positive("distance (m)", self.distance)
        whole_number("repeats", self.repeats, low=1)

    def cases(self) -> dict[str, WalkSpec]:
        """The walks."""
        plan = WalkPlan(distance=self.distance)
        return {name: WalkSpec(plan=plan, seed=self.seed, **values) for name, values in CASES.items()}


@dataclass(frozen=True)
class WalkCost:
    """Where the time of one walk went; times are means over all control periods, on one core.

    Attributes:
        name: The case.
        timestep: Physics step, s.
        control_period: s.
        steps_done: Steps of the walk; one that falls early is no measure.
        steps_planned: Steps it should have.
        real_time_factor: Simulated time over wall time.
        period_us: Wall time of a control period.
        parts_us: The same by `PARTS`.
        collision_share: Part of the physics that looks for contacts.
        constraint_share: Part of the physics that finds their forces.
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

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def walk_costs(options: WalkCostOptions) -> Iterator[WalkCost]:
    """Time every case."""
    for name, spec in options.cases().items():
        shares = _physics_shares(spec)
        parts = min((_parted(spec) for _ in range(options.repeats)), key=lambda parts: sum(parts.values()))
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


def _parted(spec: WalkSpec) -> dict[str, float]:
    """Time of one walk by `PARTS`, s."""
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
        ("program", walking.controller, "solve"),
    ):
        spent[part] = 0.0
        setattr(owner, method, _stopped(getattr(owner, method), part, spent))
    result = trial.run()
    assert result.clock is not None, "a walk that has just been run has been timed"
    whole = plant.time / result.clock.real_time_factor
    tick = spent.pop("tick")
    spent["rest of the tick"] = tick - sum(spent[part] for part in PARTS[2:6])
    spent["figures"] = whole - spent["physics"] - spent["sensors"] - tick
    return {part: spent[part] for part in PARTS}


def _stopped(method: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    """A method that adds up how long it took."""
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
    """Parts of MuJoCo's time in collision and in constraints, by its own timers, which make it slower by themselves."""
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
