"""Time of a walk by part, each task, contact, limit and hook by name: `python benchmarks/walk_profile.py`.

Methods are replaced on the objects of one walk while it is profiled, and put back; a walk that is not profiled runs
the code as it stands.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.task import Task
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.lipm.walk import LipmWalk

HOOKS = {"Recorder": "recording", "MeshcatView": "live view"}
"""Names of hooks that the commands use; another one is called after its class."""

Timed = tuple[str, object, tuple[str, ...]]
"""Part, owner and methods that count to it; one without an owner has its place in the order alone."""


@dataclass(frozen=True)
class ProfileRow:
    """One part of a walk's time.

    Attributes:
        what: The part, see `parts_of`, or task, contact, limit or hook by name.
        us: Its time of a control period, mean, µs; without that of the parts inside it.
        share: Its share of the whole.
        calls: Number of calls in the walk.
    """

    what: str
    us: float
    share: float
    calls: int


def parts_of(trial: WalkTrial, hooks: Sequence[TrialHook] = ()) -> list[Timed]:
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
        ("plausibility", control.plausibility, ("check",)),
        ("observer", control.observer, ("update", "commanded")),
        ("monitor", control.monitor, ("update",)),
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
        ("fall test", control.falls, ("update",)),
        ("scheduling", walking.stiffness, ("update",)),
        ("rest of the tick", walking, ("command",)),
        ("figures", trial.meter, ("tick", "after")),
        ("figures", trial.sole_meter, ("tick",)),
        *((HOOKS.get(name := type(h).__name__, f"hook {name}"), h, ("start", "tick", "end")) for h in hooks),
        ("rest", None, ()),
    ]


def profile_walk(
    trial: WalkTrial, hooks: Sequence[TrialHook] = ()
) -> tuple[WalkResult, tuple[ProfileRow, ...]]:
    """Walk, look on with hooks, and divide the wall time into `parts_of`, whose times add up to the whole.

    The walk is bit for bit the one that is not profiled. The clocks make it about 5 % longer.
    """
    parts = parts_of(trial, hooks)
    spent: dict[str, list[float]] = {part: [0.0, 0] for part, _, _ in parts}  # time (s) and calls
    inside = [0.0]  # time of the calls inside each call under way
    with ExitStack() as clocks:
        for part, owner, methods in parts:
            for method in methods if owner is not None else ():
                _time(clocks, owner, method, [spent[part]], inside)
        solution = [spent[f"QP: {part}"] for part in ("assembly", "solve", "decode")]
        _time(clocks, trial.control.controller, "solve", solution, inside)
        start = time.perf_counter()
        result = trial.run(hooks)
        whole = time.perf_counter() - start
    spent["rest"] = [whole - sum(seconds for seconds, _ in spent.values()), 1]
    periods = max(1.0, spent["sensors"][1])
    rows = tuple(
        ProfileRow(part, 1e6 * seconds / periods, seconds / whole, int(calls))
        for part, (seconds, calls) in spent.items()
        if calls
    )
    return result, rows


def profile_text(rows: Sequence[ProfileRow]) -> str:
    """Return a profile as a table in Markdown, with the whole in its last row."""
    lines = ["| µs of a control period | µs | share | calls |", "|---|---:|---:|---:|"]
    lines += [f"| {row.what} | {row.us:.1f} | {row.share:.1%} | {row.calls} |" for row in rows]
    return "\n".join([*lines, f"| all | {sum(row.us for row in rows):.1f} | 100 % | |"])


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


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(profile_text(profile_walk(WalkTrial(WalkSpec()))[1]))
