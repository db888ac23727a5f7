"""A machine is taken over from an elastic band: it stands by itself whatever its clock, its servos and its mass do.

`python tests/machine/test_takeover.py [SEEDS]` prints the table of docs/measured_controller.md.
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
import pinocchio as pin
import pytest
from at_rest import at_rest
from hanging import HOOK, HangingMachine

import wbc
from wbc import Command, HybridControl, Measurement, TorqueControl
from wbc.core.robot import GRAVITY
from wbc.machine import Runner, RunSettings
from wbc.machine.commands import mixed
from wbc.machine.inlet import Inlet
from wbc.machine.loads import SoleLoads
from wbc.machine.report import Phase, RunReport
from wbc.machine.start import Landing, SafeStart, Stand, standing
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
    walking = wbc.WalkingControl(robot, stance, 0.004, WalkingControlSettings(mode="torque"))
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
    walking = wbc.WalkingControl(robot, stance, 1.0 / rate, WalkingControlSettings(mode=mode))  # type: ignore[arg-type]
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
    told = {"released": np.ones(5, dtype=bool), "sole_stiffness": np.ones(2), "period": 0.002}
    half = mixed(first, replace(second, **told), 0.5)
    assert all(getattr(half, name) is value for name, value in told.items())


def leaning(robot: wbc.Robot, time: float, roll: float, pitch: float, load: float = 0.0) -> Measurement:
    """Measurement of a robot at rest whose base leans, with a share of its weight on the soles."""
    up = pin.rpy.rpyToMatrix(roll, pitch, 0.0).T @ [0.0, 0.0, GRAVITY]
    wrench = np.zeros((2, 6))
    wrench[:, 2] = 0.5 * load * robot.mass * GRAVITY
    imu = robot.placement(robot.imu_frame).rotation.T @ robot.placement(robot.base_frame).rotation
    return at_rest(robot, time, specific_force=imu @ up, sole_wrench=wrench)


G1 = wbc.load_robot("g1")


def test_a_caught_robot_is_put_with_its_soles_where_those_of_half_sitting_are() -> None:
    """The middle of the soles and their heading; posture, roll and pitch stay."""
    robot, rng = G1.robot(), np.random.default_rng(1)

    def middle(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        robot.update(q, np.zeros(robot.nv))
        soles = [robot.placement(sole.frame) for sole in robot.soles]
        ahead = sum(sole.rotation[:2, 0] for sole in soles)
        return np.mean([sole.translation for sole in soles], axis=0), ahead / np.linalg.norm(ahead)

    home = middle(np.array(robot.half_sitting))
    for _ in range(10):
        q = np.array(robot.half_sitting)
        q[:3] = rng.normal(size=3)
        q[7:] += 0.1 * rng.normal(size=robot.na)
        roll, pitch = rng.uniform(-0.4, 0.4, 2)
        q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(roll, pitch, rng.uniform(-3.0, 3.0))).coeffs()
        given = q.copy()
        placed = standing(robot, q)
        np.testing.assert_array_equal(q, given)
        np.testing.assert_array_equal(placed[7:], q[7:])
        angles = pin.rpy.matrixToRpy(pin.Quaternion(placed[3:7]).matrix())
        np.testing.assert_allclose(angles[:2], (roll, pitch), atol=1e-9)
        for found, expected in zip(middle(placed), home, strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_robot_that_was_caught_leaning_is_turned_upright_within_a_second_and_a_half() -> None:
    """Along a minimum-jerk curve, half of the way after half of the time, under the damping of its motors."""
    robot, dt, lean = G1.robot(), 0.02, 0.2
    gains = G1.kp, G1.kd
    stand = Stand(G1, dt, SoleLoads(G1, dt, gains), G1.kd)
    task = stand.control.controller.task("torso")
    upright = np.array(task.target)
    stand._loads.wrenches(leaning(robot, 0.0, 0.0, lean, 0.5))
    stand.begin(leaning(robot, 0.0, 0.0, lean, 0.5))
    for tick in range(1, 80):
        measured = leaning(robot, tick * dt, 0.0, lean, 0.5)
        command = stand.command(measured)
        share = min(tick * dt / 1.5, 1.0)
        way = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        left = np.linalg.norm(pin.log3(upright.T @ np.array(task.target)))
        assert left == pytest.approx((1.0 - way) * lean, abs=2e-3)
        np.testing.assert_array_equal(command.kp, 0.0)
        np.testing.assert_array_equal(command.kd, G1.kd)
        np.testing.assert_array_equal(command.joint_position, measured.joint_position)


@pytest.mark.parametrize("lean", [(0.1, -0.15), (0.0, 1.2)])
def test_legs_of_a_robot_that_hangs_bring_its_soles_level_below_the_centre_of_mass(
    lean: tuple[float, float],
) -> None:
    """At 0.3 rad/s at most, never nearer than 0.1 rad to the end of a range; they stay once the soles carry 5 %."""
    robot, held, dt = G1.robot(), G1.robot(), 0.02
    legs = [robot.joint_index(name) for leg in G1.legs for name in leg]
    loads = SoleLoads(G1, dt, (G1.kp, G1.kd))
    landing, before = Landing(robot, loads), np.array(robot.half_sitting[7:])

    def soles(q: np.ndarray) -> list[pin.SE3]:
        """Soles from the centre of mass."""
        robot.update(q, np.zeros(robot.nv))
        places = [robot.placement(sole.frame) for sole in robot.soles]
        return [pin.SE3(place.rotation, place.translation - robot.com) for place in places]

    home = soles(np.array(robot.half_sitting))
    middle = robot.half_sitting[7:]
    low, high = (
        np.minimum(robot.position_lower + 0.1, middle),
        np.maximum(robot.position_upper - 0.1, middle),
    )
    for tick in range(300):
        measured = leaning(held, tick * dt, *lean)
        loads.wrenches(measured)
        joints = landing.reference(replace(measured, joint_position=before))
        assert np.abs(joints - before).max() <= 0.3 * dt + 1e-12
        others = np.setdiff1d(np.arange(robot.na), legs)
        np.testing.assert_array_equal(joints[others], middle[others])
        assert ((low - 1e-12 <= joints) & (joints <= high + 1e-12))[legs].all()
        before = joints
    if max(map(abs, lean)) < 1.0:
        q = np.array(robot.half_sitting)
        q[3:7], q[7:] = pin.Quaternion(pin.rpy.rpyToMatrix(*lean, 0.0)).coeffs(), before
        for found, expected in zip(soles(q), home, strict=True):
            np.testing.assert_allclose(found.translation, expected.translation, atol=2e-3)
            np.testing.assert_allclose(found.rotation, expected.rotation, atol=5e-3)
    for tick in range(300, 310):
        measured = leaning(G1.robot(), tick * dt, 0.0, 0.0, load=0.1)
        loads.wrenches(measured)
        joints = landing.reference(replace(measured, joint_position=before))
    assert np.abs(joints - before).max() < 0.3 * 5 * dt  # it takes some ticks to see the load


def test_a_start_is_a_minimum_jerk_motion_after_the_stiffness_has_risen() -> None:
    robot, fade, speed = G1.robot(), 0.4, 0.5
    away = np.zeros(robot.na)
    away[[0, 3]] = 0.6, -0.3
    first = replace(at_rest(robot, 0.0), joint_position=robot.half_sitting[7:] + away)
    start = SafeStart(
        robot,
        first,
        SoleLoads(G1, 0.004, (G1.kp, G1.kd)),
        fade=fade,
        speed=speed,
        gains=(G1.kp, G1.kd),
    )
    assert start.duration == pytest.approx(fade + 0.6 / speed)
    carried = start.carry(first)
    assert np.abs(carried).max() > 1.0
    for elapsed in (0.1, 0.3, 0.4, 1.0, 1.5):
        command, share = start.command(first, elapsed), min(1.0, elapsed / fade)
        u = max(0.0, (elapsed - fade) / 1.2)
        way, rate = u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 30.0 * u**2 * (1.0 - u) ** 2 / 1.2
        np.testing.assert_allclose(
            command.joint_position, first.joint_position - way * away, rtol=0.0, atol=1e-9
        )
        np.testing.assert_allclose(command.joint_velocity, -rate * away, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(command.joint_torque, share * carried, rtol=1e-9)
        np.testing.assert_allclose(command.kp, share * G1.kp)
        np.testing.assert_array_equal(command.kd, G1.kd)


def test_a_start_carries_the_pull_of_springs_beside_the_drives() -> None:
    """A spring of k about q₀ pulls with k (q₀ − q)."""
    joint, stiffness, rest = "left_elbow_joint", 8.0, 0.3
    sprung = replace(G1, springs={joint: (stiffness, rest)})
    carried = []
    for description in (G1, sprung):
        robot = description.robot()
        loads = SoleLoads(description, 0.004, (G1.kp, G1.kd))
        start = SafeStart(robot, at_rest(robot, 0.0), loads, fade=0.1, speed=1.0, gains=(G1.kp, G1.kd))
        carried.append(start.carry(at_rest(robot, 0.0)))
    index = G1.robot().joint_index(joint)
    expected = np.zeros(len(carried[0]))
    expected[index] = stiffness * (G1.robot().half_sitting[7 + index] - rest)
    assert abs(expected[index]) > 1.0
    np.testing.assert_allclose(carried[1] - carried[0], expected, atol=1e-9)


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
