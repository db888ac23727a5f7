"""A machine is taken over from an elastic band: it stands by itself whatever its clock, its servos and its mass do.

`python tests/machine/test_takeover.py [SEEDS]` prints the table of docs/measured.md.
"""

from __future__ import annotations

import itertools
import logging
import resource
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hanging import HOOK, HangingMachine

import wbc
from wbc import Command, HybridControl, Measurement, TorqueControl
from wbc.machine import Runner, RunSettings
from wbc.machine.inlet import Inlet
from wbc.machine.report import Phase, RunReport
from wbc.machine.run import mixed
from wbc.walking import WalkingControlSettings

MODES: dict[str, Any] = {"torque": TorqueControl, "hybrid": HybridControl}

SPEEDS = (0.12, 0.3, 0.5)
"""Speeds with which the band is let out, m/s."""


@dataclass
class Outcome:
    """Outcome of a run."""

    report: RunReport
    stood: bool  # without the band, for the time asked for
    wild: int  # commands with something that is not finite or beyond a torque limit
    machine: HangingMachine

    @property
    def phases(self) -> list[str]:
        """Names of the phases in their order."""
        return [phase.name for phase, _ in self.report.phases]


Script = Callable[[HangingMachine, Runner, float], None]
"""Called in every tick with the time since the band is off (s), negative before."""


def take_over(
    mode: str = "torque",
    rate: float = 250.0,
    speed: float = 0.5,
    *,
    seconds: float = 30.0,
    hang: float = 3.0,
    script: Script | None = None,
    control: Any = None,
    kind: type[HangingMachine] = HangingMachine,
    **machine: Any,
) -> Outcome:
    """Let a robot down from its band, take the band off once it stands, and look at it some time later.

    The band is let out after `hang` seconds with a speed, m/s; the robot has to stand `seconds` without it. The control
    is a balance when None; `machine` are options of `HangingMachine`.
    """
    robot = kind(**machine)
    if control is None:
        control = MODES[mode](wbc.balance_controller(robot.description.robot(), 1.0 / rate))
    settings = RunSettings(robot_timeout=0.05, control_timeout=0.05, stop=0.7)
    runner = Runner(robot, control, rate, settings=settings, guard=False, clock=robot.clock)
    free: float | None = None
    stood = False

    def until() -> bool:
        nonlocal free, stood
        now = robot.time
        if free is None:
            robot.speed = speed if now > hang and (robot.length or 0.0) < 3.0 else 0.0
            if runner.phase is Phase.RUN and robot.pull < 1.0:
                robot.length, free = None, now
        if script is not None:
            script(robot, runner, -1.0 if free is None else now - free)
        over = free is not None and now - free > seconds
        stood = over and robot.height > 0.5
        return over or robot.height < 0.4 or now > 40.0 + seconds

    report = runner.run(until)
    limit = robot.description.robot().torque_limit * (1.0 + 1e-6)
    wild = sum(not (np.abs(command.joint_torque) <= limit).all() for command in robot.sent)  # or NaN
    return Outcome(report, stood, wild, robot)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pace", "stamped", "leaves"),
    [
        (0.6, False, False),
        pytest.param(0.5, False, False, marks=pytest.mark.slow),
        pytest.param(0.6, True, True, marks=pytest.mark.slow),
        pytest.param(1.0, False, True, marks=pytest.mark.slow),
    ],
)
def test_a_machine_whose_time_runs_slower_than_its_stamps_is_named_and_hangs(
    pace: float, stamped: bool, leaves: bool
) -> None:
    def script(robot: HangingMachine, runner: Runner, free: float) -> None:
        if robot.time > 5.0:
            runner.stop()

    got = take_over(speed=0.5, hang=1.0, script=script, pace=pace, stamped=stamped)
    assert ("STAND" in got.phases) == leaves
    assert (f"runs at {pace:.1f} of real time" in got.report.reason) == (not leaves)
    assert got.wild == 0


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_robot_that_is_lifted_hangs_again_and_runs_when_it_is_let_down(mode: str) -> None:
    """Two seconds after it stands alone the band is back, and reeled in at 0.5 m/s; from 10 s on it is let out."""

    def lift(robot: HangingMachine, runner: Runner, free: float) -> None:
        if free < 2.0:
            return
        if robot.length is None and free < 2.5:
            rope = np.array([0.0, 0.0, HOOK]) - robot.loop.data.xipos[robot.torso]
            robot.length = float(np.linalg.norm(rope))
        length = robot.length or 0.0
        if free < 10.0:
            robot.speed = -0.5 if length > -1.2 else 0.0
        else:
            robot.speed = 0.5 if length < 3.0 else 0.0

    got = take_over(mode, 250.0, 0.5, seconds=20.0, script=lift)
    assert got.stood and got.wild == 0
    assert got.phases == ["START", "HANG", "STAND", "RUN", "HANG", "STAND", "RUN", "STOP", "DAMPED"]
    assert got.report.phases[2][1] > 3.5 and got.report.reason == "stopped"  # it hangs until it is let down


@pytest.mark.slow
def test_a_torque_walk_does_not_jump_when_an_ankle_in_the_air_meets_its_limit() -> None:
    """Over 0.6 m the steps widen until the ankle of the swing foot rolls to its limit."""
    robot = wbc.load_robot("g1").robot()
    stance = wbc.FootstepPlan.standing(robot)
    walking = wbc.WalkingControl(
        robot, stance, 0.004, WalkingControlSettings(mode="torque", step_kind="planned")
    )
    forces: list[float] = []
    saturated = 0

    def walk(robot: HangingMachine, runner: Runner, free: float) -> None:
        nonlocal saturated
        if free > 1.0 and not forces:
            walking.follow(wbc.walk_distance(stance, 0.6))
        if free > 1.0:
            forces.append(float(robot.loop.data.qfrc_constraint[2]) / robot.weight)
            limit = robot.description.robot().torque_limit
            saturated += bool((np.abs(robot.sent[-1].joint_torque) > 0.999 * limit).any())

    got = take_over(seconds=10.0, control=walking, script=walk, heavier=True, seed=9600)
    assert got.stood and walking.finished and walking.fallen is None
    assert saturated == 0 and max(forces) < 1.6


def walks(mode: str, rate: float, speed: float, *, heavier: bool, seed: int) -> bool:
    """Let it down, and walk 2 m along a plan."""
    robot = wbc.load_robot("g1").robot()
    stance = wbc.FootstepPlan.standing(robot)
    walking = wbc.WalkingControl(
        robot, stance, 1.0 / rate, WalkingControlSettings(mode=mode, step_kind="planned")
    )  # type: ignore[arg-type]
    starts: list[np.ndarray] = []

    def walk(robot: HangingMachine, runner: Runner, free: float) -> None:
        if free > 1.0 and not starts:
            starts.append(robot.loop.truth().com)
            walking.follow(wbc.walk_distance(stance, 2.0))

    got = take_over(mode, rate, speed, seconds=32.0, control=walking, script=walk, heavier=heavier, seed=seed)
    way = got.machine.loop.truth().com - starts[0]
    return got.stood and got.wild == 0 and walking.finished and abs(way[0] - 2.0) < 0.1 and abs(way[1]) < 0.1


def stands_pushes(mode: str, rate: float, force: float, first: int, *, heavier: bool, seed: int) -> bool:
    """Push it to the front, left, back and right, for 0.1 s every 3 s, beginning with one of the four (0 to 3)."""
    pushed = 0

    def push(robot: HangingMachine, runner: Runner, free: float) -> None:
        nonlocal pushed
        if pushed < 4 and free > 2.0 + 3.0 * pushed:
            x, y = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[(first + pushed) % 4]
            robot.push((force * x, force * y))
            pushed += 1

    got = take_over(mode, rate, 0.5, seconds=15.0, script=push, heavier=heavier, seed=seed)
    return got.stood and got.wild == 0 and pushed == 4


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_robot_that_was_let_down_walks_two_metres_and_stands_pushes(mode: str) -> None:
    assert walks(mode, 250.0, 0.5, heavier=True, seed=102)
    assert stands_pushes(mode, 250.0, 100.0, 0, heavier=False, seed=5)


@pytest.mark.long
@pytest.mark.slow
def test_a_run_does_not_grow() -> None:
    """A minute of standing, with the garbage collector off as in every run."""
    resident: list[int] = []

    def look(robot: HangingMachine, runner: Runner, free: float) -> None:
        robot.sent.clear()
        if free > 5.0 + 20.0 * len(resident):
            pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
            resident.append(int(pages) * resource.getpagesize())

    assert take_over("hybrid", 250.0, 0.5, seconds=66.0, script=look).stood
    assert len(resident) == 4 and resident[-1] - resident[0] < 300_000  # 20 bytes a tick


BAD: dict[str, Callable[[np.ndarray], Any]] = {
    "nan": lambda a: np.full_like(a, np.nan),
    "short": lambda a: a[:-1],
    "none": lambda a: None,
    "objects": lambda a: a.astype(object),
    "masked": lambda a: np.ma.masked_array(a, mask=True),
}

SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "joint_torque")


def test_no_bad_signal_gets_past_the_inlet() -> None:
    """It is refused with its reason, or made good: the phases see finite numbers of the right shape."""
    robot, rng = wbc.load_robot("g1").robot(), np.random.default_rng(0)

    def measurement(tick: int) -> Measurement:
        joints = robot.half_sitting[7:], 1e-3 * rng.normal(size=robot.na), 1e-3 * rng.normal(size=3)
        torque = rng.normal(size=robot.na)
        return Measurement(0.004 * tick, *joints, np.array([0.0, 0.0, 9.81]), None, joint_torque=torque)

    inlet = Inlet(robot, 0.004)
    for tick, (name, bad) in enumerate(itertools.product(SIGNALS, BAD.values())):
        assert inlet.take(measurement(2 * tick), 0.0) and not inlet.refused and inlet.since == np.inf
        before, good = inlet.good, measurement(2 * tick + 1)
        assert inlet.take(replace(good, **{name: bad(getattr(good, name))}), 1.0) and inlet.good is not None
        assert (inlet.good is before) == bool(inlet.refused) == (inlet.since == 1.0), name
        for signal in SIGNALS[:-1]:
            assert np.isfinite(getattr(inlet.good, signal)).all(), (name, signal)


@pytest.mark.slow
def test_measurements_that_stay_bad_end_in_damping() -> None:
    class Dead(HangingMachine):
        def read(self, timeout: float) -> Any:
            measurement = super().read(timeout)
            if measurement is None or self.time < 1.0:
                return measurement
            return replace(measurement, joint_position=None)

    got = take_over("torque", 250.0, kind=Dead)
    assert got.phases == ["START", "DAMPED"] and 1.0 < got.report.phases[-1][1] < 1.2
    assert got.wild == 0 and "joint_position" in got.report.reason
    assert got.report.reason.startswith("measurements refused for 1")


def test_a_mixed_command_does_to_the_joints_what_is_between_both() -> None:
    """So that a hand-over has no step, whatever gains and references the two have."""
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(2, 5))

    def effect(c: Command) -> np.ndarray:
        assert c.joint_position is not None and c.joint_velocity is not None
        return c.joint_torque + c.kp * (c.joint_position - q) + c.kd * (c.joint_velocity - v)

    first = Command(*rng.normal(size=(3, 5)), kp=np.array([0.0, 1.0, 2.0, 0.0, 5.0]), kd=rng.uniform(size=5))
    second = Command(*rng.normal(size=(3, 5)), kp=np.array([1.0, 0.0, 3.0, 0.0, 4.0]), kd=rng.uniform(size=5))
    for part in (0.0, 0.01, 0.3, 1.0):
        expected = (1.0 - part) * effect(first) + part * effect(second)
        np.testing.assert_allclose(effect(mixed(first, second, part)), expected, atol=1e-12)


def test_a_stamp_that_stands_still_is_no_clock_and_a_repeat_is_no_measurement() -> None:
    robot = wbc.load_robot("g1").robot()
    zero = np.zeros(robot.na)

    def measurement(i: int, time: float) -> Measurement:
        return Measurement(
            time, robot.half_sitting[7:] + 1e-4 * i, zero, np.zeros(3), np.array([0.0, 0.0, 9.81]), None
        )

    inlet = Inlet(robot, 0.004)
    taken = [inlet.take(measurement(i, 0.0), 0.004 * i) for i in range(6)]
    assert taken == [True, False, False, True, True, True]
    assert not inlet.stamped and inlet.good is not None and inlet.good.time == pytest.approx(0.02)
    stamped = Inlet(robot, 0.004)
    again = measurement(1, 7.004)
    taken = [stamped.take(m, 0.0) for m in (measurement(0, 7.0), again, again, replace(again))]
    assert taken == [True, True, False, False]
    assert stamped.stamped and stamped.good is not None and stamped.good.time == 7.004


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("rate", [250.0, 500.0])
@pytest.mark.parametrize("mode", MODES)
def test_every_start_ends_in_a_stand(mode: str, rate: float, speed: float) -> None:
    """Each mode at each rate meets a heavier robot at one of the speeds and rarer messages at another."""
    variants = ((False, 0.001), (True, 0.001), (False, 0.005))
    heavier, period = variants[(SPEEDS.index(speed) + (rate == 500.0) + (mode == "hybrid")) % 3]
    got = take_over(mode, rate, speed, heavier=heavier, message_period=period, seed=int(1000 * speed))
    assert got.stood and got.wild == 0, (heavier, period, got.phases)


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    for mode, rate, heavier in itertools.product(MODES, (250.0, 500.0), (False, True)):
        starts = [
            take_over(mode, rate, speed, heavier=heavier, seed=seed)
            for speed, seed in itertools.product(SPEEDS, range(seeds))
        ]
        walked = [walks(mode, rate, SPEEDS[seed % 3], heavier=heavier, seed=seed) for seed in range(seeds)]
        pushed = [
            stands_pushes(mode, rate, force, first, heavier=heavier, seed=first)
            for force, first in ((60.0, 0), (60.0, 2), (100.0, 1), (100.0, 3))
        ]
        stood = sum(got.stood and got.wild == 0 for got in starts)
        print(
            f"{mode}, {rate:g} Hz{', heavier' if heavier else ''}: stood {stood} of {len(starts)}, walked "
            f"{sum(walked)} of {len(walked)}, stood pushes {sum(pushed)} of {len(pushed)}",
            flush=True,
        )
