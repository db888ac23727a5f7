"""Time of a walk by part: `wbc walk --profile` and `wbc bench walk`.

Methods are replaced on the objects of one walk while it is profiled, and put back; a walk that is not profiled runs
the code as it stands.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from wbc.core.qp.controller import Controller
from wbc.core.qp.task import Task
from wbc.sim.walks import WalkHook, WalkResult, WalkTrial
from wbc.walking.lipm import LipmWalk

MODEL, ASSEMBLY, SOLVE, DECODE = "QP: model", "QP: assembly", "QP: solve", "QP: decode"

TICK, REST = "rest of the tick", "rest"

PARTS = (
    "physics",
    "sensors",
    "plausibility",
    "observer",
    "monitor",
    "footsteps",
    "references",
    "stabilizer",
    "targets",
    MODEL,
    ASSEMBLY,
    SOLVE,
    DECODE,
    "gate",
    "fall test",
    "scheduling",
    TICK,
    "figures",
    "recording",
    "live view",
    REST,
)
"""Parts of a walk's time, in the order of a control period; none counts what another one does inside it.

Sensors are the plant's. Of the tick: plausibility checks the readings, the monitor compares sensors with each other;
footsteps and references are the walk's, targets those of its tasks; model, assembly, solution and decoding are the
QP's, with each task, contact and limit beside the assembly by name; the gate clips the command; scheduling is that of
the soles' stiffness. Figures are the result's. The rest is the loop around, the fall test on the true state and the
making of the result.
"""

HOOKS = {"Recorder": "recording", "WatchWalk": "live view"}
"""Names of hooks that the commands use; another one is called after its class."""


@dataclass(frozen=True)
class ProfileRow:
    """One part of a walk's time.

    Attributes:
        what: The part, one of `PARTS`, or task, contact, limit or hook by name.
        us: Its time of a control period, mean, µs; without that of the parts inside it.
        share: Its share of the whole.
        calls: Number of calls in the walk.
    """

    what: str
    us: float
    share: float
    calls: int


class _Clocks:
    """Time by part, of calls inside each other: what an inner one takes is not counted to the outer one."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = {}  # part → time (s) and calls
        self._inside = [0.0]
        self._replaced: list[tuple[Any, str, Any]] = []

    def entry(self, part: str) -> list[float]:
        """Return time and calls of a part, to add to."""
        return self.spent.setdefault(part, [0.0, 0])

    def time(self, owner: object, method: str, part: str) -> None:
        """Count a method of one object to a part."""
        entry, inside, clock = self.entry(part), self._inside, time.perf_counter
        call = getattr(owner, method)

        @functools.wraps(call)
        def timed(*args: Any, **kwargs: Any) -> Any:
            inside.append(0.0)
            start = clock()
            try:
                return call(*args, **kwargs)
            finally:
                spent = clock() - start
                entry[0] += spent - inside.pop()
                entry[1] += 1
                inside[-1] += spent

        self._replace(owner, method, timed)

    def time_solution(self, controller: Controller) -> None:
        """Count the solution of the QP to its parts, which the controller times itself."""
        assembly, solve, decode = (self.entry(part) for part in (ASSEMBLY, SOLVE, DECODE))
        inside, clock, call = self._inside, time.perf_counter, controller.solve

        @functools.wraps(call)
        def timed(*args: Any, **kwargs: Any) -> Any:
            inside.append(0.0)
            start = clock()
            assembled = solved = 0.0
            try:
                solution = call(*args, **kwargs)
                assembled, solved = solution.timings.assembly, solution.timings.solve
                return solution
            finally:
                spent = clock() - start
                assembled = assembled or spent  # a task that raises does so in the assembly
                assembly[0] += assembled - inside.pop()
                solve[0] += solved
                decode[0] += spent - assembled - solved
                for entry in (assembly, solve, decode):
                    entry[1] += 1
                inside[-1] += spent

        self._replace(controller, "solve", timed)

    def _replace(self, owner: object, method: str, timed: Callable[..., Any]) -> None:
        self._replaced.append((owner, method, vars(owner).get(method)))
        setattr(owner, method, timed)

    def restore(self) -> None:
        """Take all clocks off again."""
        while self._replaced:
            owner, method, before = self._replaced.pop()
            if before is None:
                delattr(owner, method)
            else:
                setattr(owner, method, before)


def profile_walk(
    trial: WalkTrial, hooks: Sequence[WalkHook] = ()
) -> tuple[WalkResult, tuple[ProfileRow, ...]]:
    """Walk, and divide the wall time.

    The walk is bit for bit the one that is not profiled. The clocks make it about 5 % longer.

    Args:
        trial: The walk, not yet begun.
        hooks: Look on, and are timed.

    Returns:
        The result, and the parts that took time, in the order of `PARTS`; their times add up to the whole.
    """
    with _clocks_on(trial, hooks) as clocks:
        start = time.perf_counter()
        result = trial.run(hooks)
        whole = time.perf_counter() - start
    spent = clocks.spent
    spent[REST] = [whole - sum(seconds for seconds, _ in spent.values()), 1]
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


@contextmanager
def _clocks_on(trial: WalkTrial, hooks: Sequence[WalkHook]) -> Iterator[_Clocks]:
    """Put clocks around the methods of a walk, and take them off again."""
    clocks = _Clocks()
    plant, walking = trial.plant, trial.walking
    control, controller = walking.control, walking.controller
    hook_names = [HOOKS.get(type(hook).__name__, f"hook {type(hook).__name__}") for hook in hooks]
    named = [
        *((task, "evaluate", f"task '{task.name}'") for task in controller.tasks),
        *((contact, "evaluate", f"contact '{contact.name}'") for contact in controller.contacts),
        *((limit, "write", limit.name) for limit in controller.limits),
    ]
    for part in PARTS:  # their order
        clocks.entry(part)
        if part == ASSEMBLY:
            for _, _, name in named:
                clocks.entry(name)
        if part == "figures":
            for name in hook_names:
                clocks.entry(name)
    timed: list[tuple[object, str, str]] = [
        (plant, "step", "physics"),
        (plant, "measure", "sensors"),
        (control.plausibility, "check", "plausibility"),
        (control.observer, "update", "observer"),
        (control.observer, "commanded", "observer"),
        (control.monitor, "update", "monitor"),
        (walking.source, "update", "references"),
        (walking.tasks, "follow", "targets"),
        (walking.falls, "update", "fall test"),
        (controller.robot, "update", MODEL),
        (control.gate, "pass_on", "gate"),
        (control.gate, "pass_on_with_gains", "gate"),
        (walking, "command", TICK),
        (trial.meter, "tick", "figures"),
        (trial.meter, "after", "figures"),
        *named,
    ]
    if isinstance(walking.source, LipmWalk):
        timed.append((walking.source, "plan_steps", "footsteps"))
    if walking.stabilizer is not None:
        timed.append((walking.stabilizer, "update", "stabilizer"))
    if walking.stiffness is not None:
        timed.append((walking.stiffness, "update", "scheduling"))
    if trial.sole_meter is not None:
        timed.append((trial.sole_meter, "tick", "figures"))
    for task in controller.tasks:
        if type(task).observe is not Task.observe:
            timed.append((task, "observe", f"task '{task.name}'"))
    for hook, name in zip(hooks, hook_names, strict=True):
        timed += [(hook, method, name) for method in ("start", "tick", "end")]
    try:
        for owner, method, part in timed:
            clocks.time(owner, method, part)
        clocks.time_solution(controller)
        yield clocks
    finally:
        clocks.restore()
