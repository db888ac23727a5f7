"""Behaviours: what a robot does one thing after another, as states with conditions and transitions by outcome.

    reach = Behaviour("reach", lambda now: hand.move_to(point, speed=0.3), done=reached(hand), timeout=5.0)
    squat = Behaviour("squat", lambda now: com.move_to(low, duration=2.0), done=reached(com))
    program = Program(StateMachine("demo", [reach, squat], {"reach": {"timeout": "squat"}}), control)
    program.run(plant)                       # or program.command(measurement), or wbc.run(driver, program)

Every condition is looked at once a tick, before the tick of the controller, on what the tick before has left. A state
begins in the tick after the one before it has ended. A machine is a state as well, so that machines nest.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, check_parts, choose, shown
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive
from wbc.core.drive.control import Control, DriveControl
from wbc.core.estimation.falls import FallReason
from wbc.core.qp.items import Item, ItemT
from wbc.core.signals import Command, Measurement

logger = logging.getLogger(__name__)

PATIENCE = 10
"""Ticks in a row without a solution from which the QP counts as infeasible."""

FAULTS = ("infeasible", "stopped", "fall")
"""Outcomes of any state, whatever it waits for: no solution, a control that has stopped, a fall."""

END = "end"
"""Target of a transition that ends its machine with the outcome "done"; "end: NAME" ends it with that outcome."""


class Scope:
    """Argument of the functions of a state: the parts of the program, the time, and what lives as long as the state.

    Attributes:
        program: The program.
        controller: Controller with all tasks, contacts and limits.
        path: Names of the machines around the state and of the state itself, with slashes between.
        began: Time at which the state began, s.
    """

    def __init__(self, program: Program, path: str) -> None:
        self.program, self.controller = program, program.controller
        self.path, self.began = path, program.time
        self._items: list[Item] = []

    @property
    def time(self) -> float:
        """Time since the start of the program, s."""
        return self.program.time

    @property
    def elapsed(self) -> float:
        """Time since the start of the state, s."""
        return self.program.time - self.began

    def add(self, item: ItemT) -> ItemT:
        """Add a task, contact or limit to the controller until the state ends; see `Controller.add`."""
        self.controller.add(item)
        self._items.append(item)
        return item

    def close(self) -> None:
        """Remove what was added, but for what has been removed already."""
        controller = self.controller
        there = {id(each) for each in (*controller.tasks, *controller.contacts, *controller.limits)}
        controller.remove(*(item for item in reversed(self._items) if id(item) in there))


Condition = Callable[[Scope], bool]
"""Condition of a state: a function of its scope, called once a tick."""


@checked
def after(seconds: Annotated[NonNegative, "s"]) -> Condition:
    """Return a condition that is True once a time, s, has passed since the start of the state."""
    return lambda now: now.elapsed >= seconds - ROUNDING


def reached(*things: Any) -> Condition:
    """Return a condition that is True once all targets are reached, of tasks, hands or `walking.body`."""
    if not things:
        raise InputError("reached needs at least one task, hand or walking.body")
    for thing in things:
        check_parts("what a condition waits for", thing, "reached")
    return lambda now: all(thing.reached for thing in things)


class Behaviour:
    """State of a `StateMachine`: one activity of a robot, such as a squat or a walk.

    Pass functions to it, or derive a class of your own that overrides `start`, `tick` and `end`. All arguments except
    the functions are attributes. The first of the `outcomes` is "done".
    """

    @checked
    def __init__(
        self,
        name: str,
        start: Callable[[Scope], object] | None = None,
        *,
        tick: Callable[[Scope], object] | None = None,
        end: Callable[[Scope], object] | None = None,
        done: Condition | None = None,
        outcomes: Mapping[str, Condition] | None = None,
        timeout: Annotated[Positive, "s"] | None = None,
    ) -> None:
        """Describe the state.

        Args:
            name: Name in paths, logs and messages, unique within its machine, without a slash.
            start: Function that is called once when the state begins, with its scope.
            tick: Function that is called at every tick of the state.
            end: Function that is called once when the state ends, with any outcome. The items that the state has added
                are removed after it.
            done: Condition of the outcome "done"; None for a state that ends by another outcome, by its timeout, or
                never.
            outcomes: Further outcomes and their conditions, which are checked in this order.
            timeout: Time after which the state ends with the outcome "timeout", s.
        """
        if not name or "/" in name or name.partition(":")[0] == END:
            raise InputError(
                f"the name of a state must be text without '/', and not '{END}' or '{END}: …', got {shown(name)}"
            )
        self.name = name
        self.timeout = timeout
        self.outcomes = dict(outcomes or {}) if done is None else {"done": done, **(outcomes or {})}
        self._start, self._tick, self._end = (each or (lambda now: None) for each in (start, tick, end))

    def start(self, now: Scope) -> None:
        """Act once, when the state begins, in its `Scope`."""
        self._start(now)

    def tick(self, now: Scope) -> None:
        """Act in every tick of the state, in its `Scope`."""
        self._tick(now)

    def end(self, now: Scope) -> None:
        """Act once, when the state ends, in its `Scope`."""
        self._end(now)

    def outcome(self, now: Scope) -> str | None:
        """Return the outcome, or None while the state goes on."""
        if now.program.fault is not None:
            return now.program.fault
        met = (name for name, condition in self.outcomes.items() if condition(now))
        return next(met, "timeout" if self._late(now) else None)

    def _late(self, now: Scope) -> bool:
        return self.timeout is not None and now.elapsed >= self.timeout - ROUNDING

    @property
    def possible(self) -> frozenset[str]:
        """Outcomes that the state may have, without faults; a state without outcomes never ends."""
        return frozenset(self.outcomes) | ({"timeout"} if self.timeout is not None else set())


class StateMachine(Behaviour):
    """Machine of states: which state follows which, for each outcome.

    The outcome "done" leads to the next state in the list, and after the last state it ends the machine. Any other
    outcome without a transition ends the machine with that outcome. `states` and `transitions` are dictionaries by the
    names of the states.
    """

    @checked
    def __init__(
        self,
        name: str,
        states: Sequence[Behaviour],
        transitions: Mapping[str, Mapping[str, str]] | None = None,
        *,
        timeout: Annotated[Positive, "s"] | None = None,
    ) -> None:
        """Describe the machine.

        Args:
            name: Name in paths, logs and messages.
            states: The states, with distinct names; the machine begins with the first one.
            transitions: State → outcome → what follows: the name of a state, "end", or "end: OUTCOME".
            timeout: Time after which the machine ends with the outcome "timeout", s.
        """
        super().__init__(name, timeout=timeout)
        self.states = {state.name: state for state in states}
        names = [state.name for state in states]
        if not states:
            raise InputError(f"machine '{name}' needs at least one state")
        if len(self.states) != len(states):
            raise InputError(f"machine '{name}' needs states of different names, got {names}")
        following = zip(names, [*names[1:], END], strict=True)
        self.transitions: dict[str, dict[str, str]] = {state: {"done": goal} for state, goal in following}
        for state, follows in (transitions or {}).items():
            choose(f"state of machine '{name}'", state, names)
            for outcome, goal in follows.items():
                choose(f"outcome of state '{state}'", outcome, {*self.states[state].possible, *FAULTS})
                if goal.partition(":")[0] != END:
                    choose(f"state of machine '{name}'", goal, [*names, END])
                self.transitions[state][outcome] = goal
        self._name = ""  # of the present state
        self._scope: Scope | None = None  # of the present state
        self._ended: str | None = None  # outcome of the machine

    def _goal(self, state: str, outcome: str) -> str:
        """Return the state that follows one, or "end: " and the outcome with which the machine ends."""
        goal = self.transitions[state].get(outcome, f"{END}: {outcome}")
        return goal if goal in self.states else f"{END}: {goal.partition(':')[2].strip() or 'done'}"

    @property
    def possible(self) -> frozenset[str]:
        """Outcomes that the machine may have, without faults; a machine without outcomes never ends."""
        goals = {self._goal(name, each) for name, state in self.states.items() for each in state.possible}
        return super().possible | {goal.partition(": ")[2] for goal in goals - self.states.keys()}

    @property
    def path(self) -> str:
        """Path from this machine to the innermost active state; only the machine's name before and after the run."""
        if self._scope is None:
            return self.name
        inner = self.states[self._name]
        return f"{self.name}/{inner.path if isinstance(inner, StateMachine) else inner.name}"

    def start(self, now: Scope) -> None:
        """Begin the first state."""
        self._ended = None
        self._enter(next(iter(self.states)), now)

    def tick(self, now: Scope) -> None:
        """Run the present state."""
        if self._scope is not None:
            self.states[self._name].tick(self._scope)

    def end(self, now: Scope) -> None:
        """End the present state."""
        scope, self._scope = self._scope, None
        if scope is not None:
            try:
                self.states[self._name].end(scope)
            finally:
                scope.close()

    def outcome(self, now: Scope) -> str | None:
        """Return the outcome of the machine, or None while it runs; change the state if the present one has ended."""
        if self._late(now):
            return "timeout"
        if self._scope is not None:
            result = self.states[self._name].outcome(self._scope)
            if result is not None:
                now.program.note(self._scope.path, result)
                self.end(now)
                goal = self._goal(self._name, result)
                if goal in self.states:
                    self._enter(goal, now)
                else:
                    self._ended = goal.partition(": ")[2]
        return self._ended

    def _enter(self, name: str, now: Scope) -> None:
        self._name, self._scope = name, Scope(now.program, f"{now.path}/{name}")
        logger.info("%s begins at %.3f s", self._scope.path, now.time)
        self.states[name].start(self._scope)


class Program(Control):
    """Execution of a state machine: one tick of the machine before each tick of a control.

    An exception in a function of a state ends the program with the outcome "error", and is raised with a note that has
    the path of the state.

    Attributes:
        machine: The state machine.
        control: Control whose ticks follow those of the machine.
        controller: Controller of that control, to which states add tasks, contacts and limits.
        time: Time since the start, s.
        outcome: Outcome of the machine; None before its end. The control goes on unchanged after the end.
        fault: Fault of this tick, "infeasible", "stopped" or "fall"; None without one.
        history: Time of the end (s), path and outcome of every state that has ended.
    """

    @checked
    def __init__(self, machine: StateMachine, control: Control) -> None:
        """Begin with the first tick of a control with drives: a `wbc.PositionControl`, a `wbc.WalkingControl`, …."""
        if control.drives is None:
            raise InputError(f"a program drives a control with drives, got {shown(control)}")
        self.machine, self.control, self.controller = machine, control, control.drives.controller
        self._begin()

    def _begin(self) -> None:
        self.time = 0.0
        self.outcome: str | None = None
        self.fault: str | None = None
        self.history: list[tuple[float, str, str]] = []
        self._scope: Scope | None = None  # of the machine, from its first tick on
        self._failed, self._down, self._stopped = 0, False, False

    @property
    def path(self) -> str:
        """Path of the active state, such as "demo/squat"."""
        return self.machine.path

    @property
    def ended(self) -> bool:
        """True once the machine has ended."""
        return self.outcome is not None

    def command(self, measurement: Measurement) -> Command:
        """Run one tick of the machine, then one of the control, and return its command."""
        self.tick()
        return self.control.command(measurement)

    @property
    def drives(self) -> DriveControl:  # type: ignore[override]  # nobody assigns them
        """Drives of the control."""
        assert self.control.drives is not None
        return self.control.drives

    @property
    def acting(self) -> Control:
        """Control that makes the commands now; see `Control.acting`."""
        return self.control.acting

    def status(self) -> str:
        """Return in one line how the control is; see `Control.status`."""
        return self.control.status()

    def see(self, seen: Any) -> None:
        """Hand a cloud of points or a map of the ground on to the control."""
        self.control.see(seen)

    def reset(self, q: Array | None = None) -> None:
        """Begin anew, once the control has begun from a configuration at rest; the present state ends then.

        The configuration has shape (nq,); half-sitting when None. A control that refuses it, such as a walk that has
        begun, leaves the program as it is.
        """
        self.control.reset(q)
        try:
            if self._scope is not None:
                self.machine.end(self._scope)
        finally:
            self._begin()

    def tick(self) -> None:
        """Run one tick of the machine alone; `command` calls it.

        A machine that another program runs is an `InputError`.
        """
        if self.ended:
            return
        path = self.path
        if self._scope is None and path != self.machine.name:
            raise InputError(f"a program is in '{path}' already: reset that one, or make another machine")
        try:
            if self._scope is None:
                self._scope = Scope(self, self.machine.name)
                self.machine.start(self._scope)
            else:
                self.time += self.controller.dt
                self.fault = self._fault()
                self.outcome = self.machine.outcome(self._scope)
                self.fault = None
            if self.outcome is None:
                self.machine.tick(self._scope)
            else:
                self.note(self.machine.name, self.outcome)
                self.machine.end(self._scope)
        except Exception as failure:
            self.outcome = self.outcome or "error"
            failure.add_note(f"in state '{path if self.path == self.machine.name else self.path}'")
            raise

    @checked
    def run(
        self,
        plant: Any,
        *,
        seconds: Annotated[NonNegative, "s"] | None = None,
        after_tick: Callable[[], object] | None = None,
        record: Callable[[Any, Program, Measurement, Command], object] | None = None,
    ) -> str | None:
        """Run in a simulation until the machine ends, and return its outcome; None before its end.

        The run ends when the time of the program is `seconds`. A machine that has ended does not run again before
        `reset`.

        `plant` is an object with `measure()` and `step(command)`, such as a `wbc.Plant`. `after_tick` is called after
        each tick, for example to update a view. `record` is called in each tick with plant, program, measurement and
        command, for example a `wbc.app.Recorder`.
        """
        check_parts("a plant", plant, "measure", "step")
        if seconds is None and not self.machine.possible:
            raise InputError(f"machine '{self.machine.name}' has no end: run it for a number of seconds")
        while self.outcome is None and (seconds is None or self.time < seconds - ROUNDING):
            measurement = plant.measure()
            command = self.command(measurement)
            if record is not None:
                record(plant, self, measurement, command)
            plant.step(command)
            if after_tick is not None:
                after_tick()
        return self.outcome

    def note(self, path: str, outcome: str) -> None:
        """Record the end of a state."""
        logger.info("%s: %s after %.3f s", path, outcome, self.time)
        self.history.append((self.time, path, outcome))

    def _fault(self) -> str | None:
        """Return a fault that begins in this tick; another one that begins with it is told in the next tick."""
        solution = self.controller.solution
        self._failed = 0 if solution is None or solution.ok else self._failed + 1
        if self._failed == PATIENCE:
            return "infeasible"
        before, self._stopped = self._stopped, self.drives.stopped
        if self._stopped and not before:
            return "stopped"
        before, self._down = self._down, self.fallen not in (None, FallReason.SOLVER)
        return "fall" if self._down and not before else None
