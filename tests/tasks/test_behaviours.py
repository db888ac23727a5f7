"""Behaviours: states, their conditions and what they add, machines with transitions by outcome, and programs."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from task_factory import left_hand, standing

from wbc.base.errors import InputError, UnknownNameError
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.falls import FallReason
from wbc.core.limits.joint import TorqueLimits
from wbc.tasks import (
    Behaviour,
    CoMTask,
    PositionTask,
    Program,
    StateMachine,
    after,
    reached,
)
from wbc.tasks.behaviours import Scope

DT = 0.005


def step(program: Program) -> None:
    """One tick of a program and of the controller of its control, and the motion that follows."""
    program.tick()
    robot, solution = program.controller.robot, program.controller.solve()
    if solution.ok:
        v = robot.v + DT * solution.accelerations
        robot.update(pin.integrate(robot.model, robot.q, 0.5 * DT * (robot.v + v)), v)


def run(program: Program, seconds: float = 10.0) -> str | None:
    while not program.ended and program.time < seconds:
        step(program)
    return program.outcome


def drives() -> PositionControl:
    return PositionControl(standing("hrp4_class", dt=DT))


class Falling(PositionControl):
    """Control of a robot that has fallen once its test says so."""

    down = False

    @property
    def fallen(self) -> FallReason | None:  # type: ignore[override]
        return FallReason.TILT if self.down else None


def steps(*names: str, **options: Any) -> list[Behaviour]:
    return [Behaviour(name, done=after(0.02), **options) for name in names]


def test_states_follow_each_other_and_say_so(caplog: pytest.LogCaptureFixture) -> None:
    seen: list[str] = []
    states = [
        Behaviour(
            name,
            lambda now: seen.append(f"start {now.path}"),
            tick=lambda now: seen.append("tick"),
            end=lambda now: seen.append("end"),
            done=after(2 * DT),
        )
        for name in ("one", "two")
    ]
    program = Program(StateMachine("both", states), drives())
    assert program.path == "both"
    with caplog.at_level(logging.INFO):
        assert run(program) == "done"
    assert seen == [*("start both/one", "tick", "tick", "end"), *("start both/two", "tick", "tick", "end")]
    assert program.history == [
        (pytest.approx(2 * DT), "both/one", "done"),
        (pytest.approx(4 * DT), "both/two", "done"),
        (pytest.approx(4 * DT), "both", "done"),
    ]
    assert "both/two begins at 0.010 s" in caplog.text
    step(program)  # nothing more happens
    assert len(seen) == 8


def test_what_a_state_adds_lives_as_long_as_the_state() -> None:
    control = drives()
    controller = control.controller
    place = controller.robot.placement(left_hand(controller.robot)).translation + [0.05, 0.0, 0.1]

    class Reach(Behaviour):
        def start(self, now: Scope) -> None:
            self.task = now.add(PositionTask(left_hand(now.controller.robot), name="hand", weight=100.0))
            now.add(TorqueLimits())
            self.task.move_to(place, speed=0.3)
            self.outcomes["done"] = lambda now: self.task.reached and self.task.speed < 0.01

    reach = Reach("reach", timeout=3.0)
    program = Program(StateMachine("demo", [reach, Behaviour("rest", timeout=0.05)]), control)
    step(program)
    assert program.path == "demo/reach" and [t.name for t in controller.tasks] == ["posture", "hand"]
    assert len(controller.limits) == 1
    assert run(program) == "timeout"  # of the last state: no transition is for it
    assert [outcome for _, _, outcome in program.history] == ["done", "timeout", "timeout"]
    assert [t.name for t in controller.tasks] == ["posture"] and not controller.limits
    np.testing.assert_allclose(
        controller.robot.placement(left_hand(controller.robot)).translation, place, atol=0.02
    )


def test_outcomes_lead_where_the_transitions_say() -> None:
    tries: list[float] = []
    states = [
        Behaviour(
            "try",
            lambda now: tries.append(now.time),
            outcomes={"enough": lambda now: len(tries) == 3},
            timeout=0.1,
        ),
        Behaviour("give up", done=after(0.01)),
        Behaviour("cheer", done=after(0.01)),
    ]
    transitions = {
        "try": {"timeout": "try", "enough": "cheer"},
        "cheer": {"done": "give up"},
        "give up": {"done": "end: well"},
    }
    program = Program(StateMachine("m", states, transitions), drives())
    assert run(program) == "well"
    assert tries == pytest.approx([0.0, 0.1, 0.2])
    assert [path for _, path, _ in program.history] == [
        "m/try",
        "m/try",
        "m/try",
        "m/cheer",
        "m/give up",
        "m",
    ]


def test_machines_nest_and_their_outcome_leads_on() -> None:
    inner = StateMachine(
        "inner", [*steps("a"), Behaviour("b", timeout=0.02)], {"b": {"timeout": "end: late"}}
    )
    outer = StateMachine("outer", [inner, *steps("c")], {"inner": {"late": "c"}})
    assert inner.possible == {"late"} and outer.possible == {"done"}
    program = Program(outer, drives())
    paths = []
    while not program.ended:
        step(program)
        paths.append(program.path)
    assert list(dict.fromkeys(paths)) == ["outer/inner/a", "outer/inner/b", "outer/c", "outer"]
    assert program.outcome == "done"


def test_falls_and_ticks_without_a_solution_are_outcomes() -> None:
    control = Falling(standing("hrp4_class", dt=DT))
    lie = Behaviour("lie", done=after(0.05))
    machine = StateMachine("m", [Behaviour("stand"), lie], {"stand": {"fall": "lie"}})
    program = Program(machine, control)
    for _ in range(10):
        step(program)
    control.down = True
    assert run(program) == "done" and program.history[0][1:] == ("m/stand", "fall")

    def contradict(now: Scope) -> None:
        for height in (0.5, 0.6):
            now.add(CoMTask([0.0, 0.0, height], name=f"at {height}", hard=True, stiffness=30.0))

    states = [Behaviour("stand", timeout=0.02), Behaviour("torn", contradict, timeout=1.0)]
    program = Program(StateMachine("m", states, {"stand": {"timeout": "torn"}}), drives())
    assert run(program) == "infeasible" and program.history[1][1:] == ("m/torn", "infeasible")
    step(program)
    assert program.controller.solve().ok  # what the state added is gone


def failing(now: Scope) -> None:
    raise ValueError("here")


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("where", ["start", "tick", "end", "done"])
def test_an_exception_in_any_function_of_a_state_ends_the_program_and_names_the_state(
    where: str, nested: bool
) -> None:
    state = Behaviour("a", **{"done": after(2 * DT), where: failing})  # type: ignore[arg-type]
    outer = StateMachine("m", [StateMachine("b", [state]) if nested else state, Behaviour("rest")])
    program = Program(outer, drives())
    with pytest.raises(ValueError, match="here") as caught:
        run(program)
    assert caught.value.__notes__[0] in ("in state 'm/b/a'" if nested else "in state 'm/a'", "in state 'm/b'")
    step(program)  # nothing goes on
    assert program.outcome == "error"


def test_a_machine_that_is_late_ends_even_if_the_end_of_its_state_fails() -> None:
    machine = StateMachine("m", [Behaviour("a", end=failing)], timeout=2 * DT)
    program = Program(machine, drives())
    with pytest.raises(ValueError, match="here"):
        run(program)
    assert program.outcome == "timeout" and program.history[-1][1:] == ("m", "timeout")


@pytest.mark.parametrize("kind", [PositionControl, TorqueControl])
def test_a_control_that_stops_ends_a_program_as_stopped_or_leads_on(
    kind: type[PositionControl | TorqueControl],
) -> None:
    """Encoders fail after 50 ms; the control stops after 0.1 s more."""
    for transitions, outcome in (({}, "stopped"), ({"one": {"stopped": "end: given up"}}, "given up")):
        control = kind(standing("hrp4_class", dt=DT))
        robot = control.controller.robot
        program = Program(
            StateMachine(
                "m", [Behaviour("one", done=after(0.4)), Behaviour("two", done=after(0.4))], transitions
            ),
            control,
        )
        for tick in range(200):
            measurement = at_rest(robot, DT * tick)
            if tick > round(0.05 / DT):
                measurement = replace(measurement, joint_position=np.full(robot.na, np.nan))
            program.command(measurement)
            if program.ended:
                break
        assert control.stopped and program.outcome == outcome
        assert program.history[0][1:] == ("m/one", "stopped") and program.time < 0.4


class Still:
    """A robot at rest for `Program.run`, whatever it is told."""

    def __init__(self, control: PositionControl) -> None:
        self.robot, self.ticks, self.told = control.controller.robot, 0, list[Any]()

    def measure(self) -> Any:
        return at_rest(self.robot, DT * self.ticks)

    def step(self, command: Any) -> None:
        self.told.append(command)
        self.ticks += 1


def test_a_run_lasts_until_the_machine_ends_or_its_seconds_are_over() -> None:
    """A machine without an end needs a number of seconds; each tick is recorded, sent and followed by what is due."""
    endless, ends = StateMachine("m", [Behaviour("stand")]), StateMachine("m", steps("a", "b"))
    for machine, seconds, outcome, lasted in (
        (endless, 0.05, None, 0.05),
        (ends, None, "done", 0.04),
        (ends, 1.0, "done", 0.04),
        (ends, 0.03, None, 0.03),
    ):
        control = PositionControl(standing("hrp4_class", dt=DT))
        program, plant, seen = Program(machine, control), Still(control), list[Any]()
        recorded: list[Any] = []
        found = program.run(
            plant,
            seconds=seconds,
            record=lambda *tick, to=recorded: to.append(tick[3]),
            after_tick=lambda to=seen: to.append(1),
        )
        assert found == program.outcome == outcome and program.time == pytest.approx(lasted)
        assert len(seen) == plant.ticks and recorded == plant.told
    control = PositionControl(standing("hrp4_class", dt=DT))
    with pytest.raises(InputError, match="end"):
        Program(endless, control).run(Still(control))


@pytest.mark.parametrize("name", ["endpoint", "end of the press", "the end"])
def test_a_state_has_any_name_but_that_of_an_end(name: str) -> None:
    machine = StateMachine("m", steps("a", name), {"a": {"done": name}})
    assert list(machine.states) == ["a", name]
    for reserved in ("end", "end: blocked", "end:"):
        with pytest.raises(InputError, match="name of a state"):
            Behaviour(reserved)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: StateMachine("m", steps("a"), {"b": {"done": "a"}}), "'b'"),
        (lambda: StateMachine("m", steps("a", "b"), {"a": {"done": "bb"}}), "'bb'"),
        (lambda: StateMachine("m", steps("a"), {"a": {"tiemout": "a"}}), "'tiemout'"),
        (lambda: StateMachine("m", steps("a", "a")), "name"),
        (lambda: StateMachine("m", []), "at least one state"),
        (reached, "at least one task"),
        (lambda: Behaviour("a/b"), "/"),
        (lambda: Behaviour("a", timeout=0.0), "timeout"),
        (lambda: Program(StateMachine("m", steps("a")), 3.0), "control"),
    ],
)
def test_what_cannot_run_is_refused_before_it_runs(make: Any, named: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=named):
        make()


def test_a_program_that_is_reset_runs_again_as_it_ran_first() -> None:
    """Reset after its end, and in the middle of a state, whose `end` is called and whose items go."""
    ended: list[float] = []
    task = CoMTask(name="of the state")
    states = [
        Behaviour("one", lambda now: now.add(task), end=lambda now: ended.append(now.time), done=after(0.03)),
        *steps("two"),
    ]
    program = Program(StateMachine("m", states), drives())
    assert run(program) == "done"
    time, history = program.time, list(program.history)
    program.reset()
    assert program.time == 0.0 and program.outcome is None and not program.ended and not program.history
    for _ in range(3):
        step(program)
    assert program.path == "m/one" and task in program.controller.tasks
    program.reset()
    assert program.path == "m" and len(ended) == 2 and task not in program.controller.tasks
    assert run(program) == "done" and program.time == time and program.history == history


def test_a_machine_runs_in_one_program_at_a_time() -> None:
    machine = StateMachine("m", steps("one", "two"))
    first, second = (Program(machine, drives()) for _ in range(2))
    first.tick()
    with pytest.raises(InputError, match="in 'm/one' already"):
        second.tick()
    first.reset()
    assert run(second) == "done"


def test_a_control_that_refuses_a_reset_leaves_its_program_as_it_is() -> None:
    class Once(PositionControl):
        def reset(self, q: Any = None) -> None:
            raise InputError("it has begun")

    program = Program(StateMachine("m", steps("one", "two")), Once(standing("hrp4_class", dt=DT)))
    for _ in range(3):
        program.tick()
    before = program.time, program.path
    with pytest.raises(InputError, match="it has begun"):
        program.reset()
    assert (program.time, program.path) == before


@pytest.mark.parametrize("late", [0, 1, 5], ids=["together", "after a tick", "later"])
def test_a_fall_is_told_after_the_stop_of_the_drives_that_came_with_it(late: int) -> None:
    """A state that goes on after a stop hears of the fall, and of no fall where the robot only stopped."""
    control = Falling(standing("hrp4_class", dt=DT))
    robot = control.controller.robot
    states = [Behaviour("walk"), Behaviour("wait", done=after(0.2)), Behaviour("lie", done=after(0.01))]
    machine = StateMachine("m", states, {"walk": {"stopped": "wait"}, "wait": {"fall": "lie", "done": "end"}})
    for falls in (True, False):
        control.reset()
        control.down = False
        program = Program(machine, control)
        stopped = 0
        for tick in range(200):
            measurement = at_rest(robot, DT * tick)
            if tick > 10:
                measurement = replace(measurement, joint_position=np.full(robot.na, np.nan))
            stopped += control.stopped
            if falls and stopped > late:
                control.down = True
            program.command(measurement)
            if program.ended:
                break
        told = [outcome for _, _, outcome in program.history]
        assert told == (["stopped", "fall", "done", "done"] if falls else ["stopped", "done", "done"])
