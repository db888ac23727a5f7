"""Wall time of a simulated walk by part, and by each task, contact and limit.

    python benchmarks/costs/walk_cost.py --repeats 3      # five walks, a line of JSON each
    python benchmarks/costs/walk_cost.py --table          # the first of them as a table

Methods are replaced on the objects of a walk while it is profiled, and put back; a walk that is not profiled runs the
code as it stands.
"""

from __future__ import annotations

import argparse
import functools
import json
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

from wbc.base.settings import to_json
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.task import Task
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk
from wbc.walking.lipm.walk import LipmWalk

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


Timed = tuple[str, object, tuple[str, ...]]
"""Part, owner and methods that count to it; one without an owner has its place in the order alone."""


@dataclass(frozen=True)
class ProfileRow:
    """One part of a walk's time.

    Attributes:
        what: The part, see `parts_of`, or task, contact or limit by name.
        us: Its time of a control period, mean, µs; without that of the parts inside it.
        share: Its share of the whole.
        calls: Number of calls in the walk.
    """

    what: str
    us: float
    share: float
    calls: int


def parts_of(trial: WalkTrial) -> list[Timed]:
    """Return the parts of a walk in the order of a control period; none counts what another one does inside it.

    Sensors are the plant's. Of the tick: plausibility checks the readings, the monitor compares sensors with each
    other; footsteps and references are the walk's, targets those of its tasks; model, assembly, solution and decoding
    are the QP's, with each task, contact and limit beside the assembly by name; the gate clips the command; scheduling
    is that of the soles' stiffness. Figures are the result's. The rest is the loop around, the fall test on the true
    state and the making of the result.
    """
    plant, walking = trial.plant, trial.control
    control, controller, source = walking.drives, walking.controller, walking.source
    observing = [task for task in controller.tasks if type(task).observe is not Task.observe]
    return [
        ("physics", plant, ("step",)),
        ("sensors", plant, ("measure",)),
        ("plausibility", control.sensing.plausibility, ("check",)),
        ("observer", control.observer, ("update", "commanded")),
        ("monitor", control.sensing.monitor, ("update",)),
        ("footsteps", source if isinstance(source, LipmWalk) else None, ("plan_steps",)),
        ("references", source, ("update",)),
        ("stabilizer", walking.stabilizer, ("update",)),
        ("targets", walking.tasks, ("follow",)),
        ("QP: model", controller.robot, ("update",)),
        ("QP: assembly", None, ()),
        *((f"task '{task.name}'", task, ("evaluate",)) for task in controller.tasks),
        *((f"task '{task.name}'", task, ("observe",)) for task in observing),
        *((f"contact '{contact.name}'", contact, ("evaluate",)) for contact in controller.contacts),
        *((limit.name, limit, ("write",)) for limit in controller.limits),
        ("QP: solve", None, ()),
        ("QP: decode", None, ()),
        ("gate", control.gate, ("pass_on", "pass_on_with_gains")),
        ("fall test", control.sensing.falls, ("update",)),
        ("scheduling", walking.stiffness, ("update",)),
        ("rest of the tick", walking, ("command",)),
        ("figures", trial.meter, ("tick", "after")),
        ("figures", trial.sole_meter, ("tick",)),
        ("rest", None, ()),
    ]


def profile_walk(trial: WalkTrial) -> tuple[ProfileRow, ...]:
    """Walk, and divide the wall time into `parts_of`, whose times add up to the whole.

    The walk is bit for bit the one that is not profiled. The clocks make it about 5 % longer.
    """
    parts = parts_of(trial)
    spent: dict[str, list[float]] = {part: [0.0, 0] for part, _, _ in parts}  # time (s) and calls
    inside = [0.0]  # time of the calls inside each call under way
    with ExitStack() as clocks:
        for part, owner, methods in parts:
            for method in methods if owner is not None else ():
                _time(clocks, owner, method, [spent[part]], inside)
        solution = [spent[f"QP: {part}"] for part in ("assembly", "solve", "decode")]
        _time(clocks, trial.control.controller, "solve", solution, inside)
        start = time.perf_counter()
        trial.run()
        whole = time.perf_counter() - start
    spent["rest"] = [whole - sum(seconds for seconds, _ in spent.values()), 1]
    periods = max(1.0, spent["sensors"][1])
    return tuple(
        ProfileRow(part, 1e6 * seconds / periods, seconds / whole, int(calls))
        for part, (seconds, calls) in spent.items()
        if calls
    )


def profile_text(rows: Sequence[ProfileRow]) -> str:
    """Return a profile as a table in Markdown, with the whole in its last row."""
    lines = ["| µs of a control period | µs | share | calls |", "|---|---:|---:|---:|"]
    lines += [f"| {row.what} | {row.us:.1f} | {row.share:.1%} | {row.calls} |" for row in rows]
    return "\n".join([*lines, f"| all | {sum(row.us for row in rows):.1f} | 100 % | |"])


def time_case(name: str, spec: WalkSpec, repeats: int) -> dict[str, Any]:
    """Return the times of a walk on one core as plain values.

    Steps done and planned: a walk that falls early is no measure. `period_us` is the wall time of a control period, µs,
    without clocks around its parts; the profile is that of walks of their own, scaled down to it.
    """
    profile = min(
        (profile_walk(WalkTrial(spec)) for _ in range(repeats)),
        key=lambda rows: sum(row.us for row in rows),
    )
    results = [walk(spec) for _ in range(repeats)]
    factor = max(result.clock.real_time_factor for result in results if result.clock is not None)
    period = 1e6 * spec.period / factor
    return {
        "name": name,
        "timestep": spec.timestep,
        "control_period": spec.period,
        "steps_done": results[0].steps_done,
        "steps_planned": results[0].steps_planned,
        "real_time_factor": factor,
        "period_us": period,
        "profile": [replace(row, us=period * row.share) for row in profile],
    }


def _time(
    clocks: ExitStack, owner: object, method: str, entries: Sequence[list[float]], inside: list[float]
) -> None:
    """Count a method of one object to its part, or a solution of the QP to its three, until the stack closes."""
    kind: Any = owner if hasattr(owner, "__dict__") else type(owner)  # an object with slots takes no method
    call, clock, before = getattr(kind, method), time.perf_counter, vars(kind).get(method)

    @functools.wraps(call)
    def timed(*args: Any, **kwargs: Any) -> Any:
        if kind is not owner and args[0] is not owner:
            return call(*args, **kwargs)
        inside.append(0.0)
        result, start = None, clock()
        try:
            result = call(*args, **kwargs)
            return result
        finally:
            spent = clock() - start
            inner = inside.pop()
            inside[-1] += spent
            for entry, seconds in zip(entries, _divided(result, spent, inner), strict=False):
                entry[0] += seconds
                entry[1] += 1

    setattr(kind, method, timed)
    if before is None:
        clocks.callback(delattr, kind, method)
    else:
        clocks.callback(setattr, kind, method, before)


def _divided(result: object, spent: float, inner: float) -> Iterable[float]:
    """Return a call's own time, s: of a solution that of assembly, solver and decoding, which the controller takes."""
    if not isinstance(result, Solution):
        return (spent - inner,)  # a task that raises does so in the assembly
    assembled, solved = result.timings.assembly, result.timings.solve
    return assembled - inner, solved, spent - assembled - solved


def main() -> None:
    """Walk, and print a line of JSON for each case, or the table of one."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--distance", type=float, default=3.0, help="length of the walks (m), default %(default)s"
    )
    parser.add_argument("--seed", type=int, default=0, help="of ground and noise, default %(default)s")
    parser.add_argument("--repeats", type=int, default=3, help="walks of a case: the fastest counts")
    parser.add_argument("--table", action="store_true", help="print the first case alone, as a table")
    given = parser.parse_args()
    for name, values in CASES.items():
        spec = WalkSpec(plan=WalkPlan(distance=given.distance), seed=given.seed, **values)
        if given.table:
            print(profile_text(profile_walk(WalkTrial(spec))))
            return
        print(json.dumps(to_json(time_case(name, spec, given.repeats))), flush=True)


if __name__ == "__main__":
    main()
