"""Wall time of a simulated walk, divided into parts.

python benchmarks/walk_cost.py --repeats 3
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import mujoco
from walk_profile import profile_walk

from wbc.base.settings import Count, Positive, Seed, settings, to_json
from wbc.sim.walks.plan import WalkPlan
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


def bench_walk(options: BenchWalkOptions) -> Iterator[dict[str, Any]]:
    """Time every case on one core, and yield plain values.

    Steps done and planned: a walk that falls early is no measure. `period_us` is the wall time of a control period, µs,
    without clocks around its parts; the profile is that of walks of their own, scaled down to it. `collision_share` and
    `constraint_share` are those of collision detection and contact forces in the physics.
    """
    for name, values in CASES.items():
        spec = WalkSpec(plan=WalkPlan(distance=options.distance), seed=options.seed, **values)
        shares = _physics_shares(spec)
        profile = min(
            (profile_walk(WalkTrial(spec))[1] for _ in range(options.repeats)),
            key=lambda rows: sum(row.us for row in rows),
        )
        results = [walk(spec) for _ in range(options.repeats)]
        factor = max(result.clock.real_time_factor for result in results if result.clock is not None)
        period = 1e6 * spec.period / factor
        yield {
            "name": name,
            "timestep": spec.timestep,
            "control_period": spec.period,
            "steps_done": results[0].steps_done,
            "steps_planned": results[0].steps_planned,
            "real_time_factor": factor,
            "period_us": period,
            "profile": [replace(row, us=period * row.share) for row in profile],
            "collision_share": shares[0],
            "constraint_share": shares[1],
        }


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


def main() -> None:
    """Run the benchmark and print a row of JSON for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("distance", "seed", "repeats"):
        default = getattr(BenchWalkOptions, name)
        parser.add_argument(f"--{name}", type=type(default), default=default, help="default %(default)s")
    for row in bench_walk(BenchWalkOptions(**vars(parser.parse_args()))):
        print(json.dumps(to_json(row)), flush=True)


if __name__ == "__main__":
    main()
