"""Conformance: a good loop passes, and every deliberate fault of a bad one is named."""
# ruff: noqa: E501 - one fault a line

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from foreign import foreign_model

import wbc
from wbc import Command, Measurement
from wbc.app.cli import main
from wbc.core.errors import InputError, MeasurementError
from wbc.feet import foot
from wbc.machine import conformance
from wbc.machine.conformance import ConformanceReport
from wbc.sim import Machine, MujocoLoop, Plant, with_feet

DESCRIPTION = wbc.load_robot("g1")
PERIOD = 0.005


class Wrapped:
    """A loop with a fault in what goes out or comes in."""

    def __init__(self, loop: Any, out: Callable[[Command], Command] | None = None) -> None:
        self._loop, self._out = loop, out
        self.description, self.control_period = loop.description, loop.control_period

    def measure(self) -> Measurement:
        return self._loop.measure()  # type: ignore[no-any-return]

    def step(self, command: Command) -> None:
        self._loop.step(command if self._out is None else self._out(command))


class Recorded:
    """A loop that measures what another one has measured, under the same commands, with a fault."""

    def __init__(self, rows: list[Measurement], fault: Callable[[Measurement, int], Measurement]) -> None:
        self._rows, self._fault, self._tick = rows, fault, 0
        self.description, self.control_period = DESCRIPTION, PERIOD

    def measure(self) -> Measurement:
        return self._fault(self._rows[min(self._tick, len(self._rows) - 1)], self._tick)

    def step(self, command: Command) -> None:
        self._tick += 1


def plant() -> wbc.Plant:
    return wbc.Plant(DESCRIPTION, control_period=PERIOD)


@functools.cache
def healthy() -> tuple[list[Measurement], ConformanceReport]:
    """Measurements of a good loop during all checks, with torques, and their result."""
    loop, rows = plant(), []

    class Listening(Wrapped):
        def measure(self) -> Measurement:
            measurement = replace(loop.measure(), joint_torque=loop.joint_torque.copy())
            if not rows or rows[-1].time != measurement.time:
                rows.append(measurement)
            return measurement

    report = conformance(Listening(loop))
    return rows, report


def test_a_good_loop_passes_all_checks() -> None:
    _, report = healthy()
    assert report.ok, str(report)
    assert 18 <= len(report.checks) <= 22 and all(check.state == "ok" for check in report.checks)


def test_a_robot_on_softer_ankles_passes() -> None:
    """A body that follows its ankles late, and ankles that the rest of the leg holds, are no faults of a loop."""
    report = conformance(wbc.Plant(DESCRIPTION.with_servos(["*ankle*=500,20"]), control_period=PERIOD))
    assert report.ok, str(report)
    assert {"joint unit", "sides", "wrench frame"} <= {c.name for c in report.checks if c.state == "ok"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["soft", "long_arch"])
def test_a_robot_that_leans_on_soft_soles_passes(name: str) -> None:
    report = conformance(wbc.Plant(with_feet(DESCRIPTION, foot(name)), foot=name, control_period=PERIOD))
    assert report.ok, str(report)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
def test_plants_with_noise_pass(robot: str) -> None:
    report = conformance(wbc.Plant(wbc.load_robot(robot), control_period=0.002, noise="realistic"))
    assert report.ok, str(report)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["motor", "position", "none"])
def test_loops_of_somebody_else_pass(kind: str) -> None:
    hrp4 = wbc.load_robot("hrp4_class")
    report = conformance(MujocoLoop(hrp4, foreign_model(hrp4, kind), prefix="mine/"))
    assert report.ok, str(report)
    assert all(check.state == "ok" for check in report.checks)


NA = DESCRIPTION.robot().na
SWAP = np.arange(NA)
SWAP[[3, 20]] = SWAP[[20, 3]]
YAW = pin.rpy.rpyToMatrix(0.0, 0.0, np.pi / 2)
MIRROR = np.diag([1.0, -1.0, 1.0])
ONE = np.where(np.arange(NA) == 4, -1.0, 1.0)


def turned(m: Measurement, rotation: np.ndarray) -> Measurement:
    return replace(
        m, angular_velocity=rotation @ m.angular_velocity, specific_force=rotation @ m.specific_force
    )


FAULTS: dict[str, tuple[Callable[[Measurement, int], Measurement], str, str]] = {
    "two joints swapped": (lambda m, _: replace(m, joint_position=m.joint_position[SWAP], joint_velocity=m.joint_velocity[SWAP]), "joint order", "another order"),
    "one joint reversed": (lambda m, _: replace(m, joint_position=m.joint_position * ONE, joint_velocity=m.joint_velocity * ONE), "joint sign", "other way round"),
    "degrees": (lambda m, _: replace(m, joint_position=np.degrees(m.joint_position), joint_velocity=np.degrees(m.joint_velocity)), "joint unit", "degrees"),
    "motor side": (lambda m, _: replace(m, joint_position=20.0 * m.joint_position, joint_velocity=20.0 * m.joint_velocity), "joint unit", "motor's side"),
    "velocity reversed": (lambda m, _: replace(m, joint_velocity=-m.joint_velocity), "joint velocity", "reversed"),
    "velocity in degrees": (lambda m, _: replace(m, joint_velocity=np.degrees(m.joint_velocity)), "joint velocity", "degrees per second"),
    "no velocity": (lambda m, _: replace(m, joint_velocity=0.0 * m.joint_velocity), "joint velocity", "frozen"),
    "zero of an encoder": (lambda m, _: replace(m, joint_position=m.joint_position + 0.1 * (ONE < 0)), "joint zero", "zero of an encoder"),
    "torque reversed": (lambda m, _: replace(m, joint_torque=-m.joint_torque), "measured torque", "reversed"),  # type: ignore[operator]
    "torque of the motor": (lambda m, _: replace(m, joint_torque=m.joint_torque / 20.0), "measured torque", "another unit"),  # type: ignore[operator]
    "accelerometer in g": (lambda m, _: replace(m, specific_force=m.specific_force / 9.81), "accelerometer", "units of g"),
    "without gravity": (lambda m, _: replace(m, specific_force=m.specific_force - [0.0, 0.0, 9.80665]), "accelerometer", "gravity has been removed"),
    "accelerometer reversed": (lambda m, _: replace(m, specific_force=-m.specific_force), "accelerometer", "reversed"),
    "gyroscope in degrees": (lambda m, _: replace(m, angular_velocity=np.degrees(m.angular_velocity)), "gyroscope", "degrees per second"),
    "gyroscope dead": (lambda m, _: replace(m, angular_velocity=np.zeros(3)), "gyroscope", "does not turn"),
    "gyroscope reversed": (lambda m, _: replace(m, angular_velocity=-m.angular_velocity), "IMU frame", "gyroscope has the reversed sign"),
    "gyroscope in another frame": (lambda m, _: replace(m, angular_velocity=YAW @ m.angular_velocity), "IMU frame", "gyroscope is in another frame"),
    "IMU turned": (lambda m, _: turned(m, YAW), "IMU frame", "turned by 90°"),
    "wrench on the ground": (lambda m, _: replace(m, sole_wrench=-m.sole_wrench), "weight", "foot on the ground"),
    "wrench in kp": (lambda m, _: replace(m, sole_wrench=m.sole_wrench / 9.81), "weight", "another unit"),
    "feet swapped": (lambda m, _: replace(m, sole_wrench=m.sole_wrench[::-1]), "sides", "swapped"),
    "moments reversed": (lambda m, _: replace(m, sole_wrench=m.sole_wrench * [1, 1, 1, -1, -1, -1]), "wrench frame", "reversed sign"),
    "moments elsewhere": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer(m.sole_wrench[:, 2], [0, 0, 0, 0, 0.05, 0])), "wrench frame", "another point"),
    "moments beside it": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer(m.sole_wrench[:, 2], [0, 0, 0, 0.02, 0, 0])), "wrench frame", "another point"),
    "moments outside of it": (lambda m, _: replace(m, sole_wrench=m.sole_wrench + np.outer([0.1, -0.1] * m.sole_wrench[:, 2], [0, 0, 0, 1, 0, 0])), "wrench frame", "another point"),
    "clock in milliseconds": (lambda m, _: replace(m, time=1e3 * m.time), "clock", "milliseconds"),
    "clock of 100 Hz": (lambda m, _: replace(m, time=2.0 * m.time), "clock", "100 Hz"),
    "clock stands still": (lambda m, _: replace(m, time=1.0), "clock", "stands still"),
    "jitter": (lambda m, tick: replace(m, time=m.time + 0.003 * (tick % 2)), "clock", "jitter"),
    "shape": (lambda m, _: replace(m, joint_position=m.joint_position[:-1]), "shapes", "has not"),
    "shape of the torques": (lambda m, _: replace(m, joint_torque=m.joint_torque[:-1]), "shapes", "has not"),  # type: ignore[index]
    "hands": (lambda m, _: replace(m, hand_wrenches=np.zeros((5, 6))), "shapes", "has not"),
    "time": (lambda m, _: replace(m, time=np.nan), "shapes", "first tick fails"),
    "torque is no number": (lambda m, _: replace(m, joint_torque=np.nan * m.joint_position), "shapes", "first tick fails"),
    "not a number": (lambda m, _: replace(m, specific_force=np.full(3, np.nan)), "shapes", "first tick fails"),
}  # fmt: skip
"""Name → fault of a measurement, the check that names it and words of the cause."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_measurement_is_named(fault: str) -> None:
    make, name, words = FAULTS[fault]
    report = conformance(Recorded(healthy()[0], make))
    wrong = {check.name: check for check in report.wrong}
    assert name in wrong, f"{fault}: {report}"
    assert words in wrong[name].cause, f"{fault}: {wrong[name].cause}"
    beside = set(wrong) - {name, "hold", "joint zero", "soles"}  # what follows from encoders that are off
    assert not beside, f"{fault}: {report}"


def test_measurements_that_come_every_other_tick_are_named() -> None:
    rows, _ = healthy()
    stale = [rows[2 * (i // 2)] for i in range(len(rows))]
    report = conformance(
        Recorded([replace(m, time=r.time) for m, r in zip(stale, rows, strict=True)], lambda m, _: m)
    )
    assert [check.name for check in report.wrong] == ["fresh"], str(report)


class Late(Wrapped):
    """A loop that obeys some periods late."""

    def __init__(self, loop: Any, periods: int) -> None:
        super().__init__(loop)
        self._waiting: list[Command] = []
        self._periods = periods

    def step(self, command: Command) -> None:
        self._waiting.append(command)
        self._loop.step(self._waiting.pop(0) if len(self._waiting) > self._periods else self._waiting[0])


ZERO = np.zeros(NA)
ELBOWS = np.arange(NA)
_left, _right = (DESCRIPTION.joint_names.index(f"{side}_elbow_joint") for side in ("left", "right"))
ELBOWS[[_left, _right]] = [_right, _left]
COMMANDS: dict[str, tuple[Callable[[Any], Any], str, str]] = {
    "torque reversed": (lambda loop: Wrapped(loop, lambda c: replace(c, joint_torque=-c.joint_torque)), "torque", "doubles the sag"),
    "torque ignored": (lambda loop: Wrapped(loop, lambda c: replace(c, joint_torque=ZERO)), "torque", "ignored"),
    "torque of the motor": (lambda loop: Wrapped(loop, lambda c: replace(c, joint_torque=5.0 * c.joint_torque)), "gains", "another unit"),
    "velocity ignored": (lambda loop: Wrapped(loop, lambda c: replace(c, joint_velocity=ZERO)), "velocity reference", "ignored"),
    "commands to other joints": (lambda loop: Wrapped(loop, lambda c: Command(c.joint_torque[ELBOWS], c.joint_position[ELBOWS], c.joint_velocity[ELBOWS])), "joint order", "another order"),  # type: ignore[index]
    "gains ignored": (lambda loop: Wrapped(loop, lambda c: replace(c, kp=None, kd=None)), "commanded gains", "kp and kd of a command"),
    "damping ignored": (lambda loop: Wrapped(loop, lambda c: replace(c, kd=None)), "commanded gains", "kd of a command"),
    "gains a degree": (lambda loop: Wrapped(loop, lambda c: c if c.kp is None else replace(c, kp=c.kp / 57.3, kd=c.kd / 57.3)), "commanded gains", "another unit"),  # type: ignore[operator]
    "torque alone": (lambda loop: Wrapped(loop, lambda c: Command(c.joint_torque)), "joint order", "drives of torque alone"),
    "drives off": (lambda loop: Wrapped(loop, lambda c: Command(ZERO)), "joint order", "does not reach"),
    "nothing follows": (lambda loop: Wrapped(loop, lambda c: loop.hold()), "joint order", "does not reach"),
    "10 ms late": (lambda loop: Late(loop, 2), "delay", "10 ms"),
    "20 ms late": (lambda loop: Late(loop, 4), "delay", "20 ms"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("fault", COMMANDS)
def test_a_fault_of_the_command_is_named(fault: str) -> None:
    make, name, words = COMMANDS[fault]
    report = conformance(make(plant()))
    wrong = {check.name: check for check in report.wrong}
    assert name in wrong and words in wrong[name].cause, f"{fault}: {report}"
    if "gains" in name or "alone" in words:
        assert set(wrong) <= {name, "velocity reference"}, f"{fault}: {report}"


@pytest.mark.slow
def test_all_joints_in_another_order_are_no_drives_of_torque_alone() -> None:
    """References move other joints, on a robot that has fallen over them."""
    order = np.roll(np.arange(NA), 7)
    report = conformance(
        Wrapped(plant(), lambda c: Command(c.joint_torque[order], c.joint_position[order]))  # type: ignore[index]
    )
    cause = {check.name: check.cause for check in report.wrong}["joint order"]
    assert "another order" in cause, str(report)


@pytest.mark.slow
def test_a_loop_that_refuses_gains_is_not_judged_by_them() -> None:
    def refuse(command: Command) -> Command:
        if command.kp is not None:
            raise InputError("this machine has gains of its own")
        return command

    report = conformance(Wrapped(plant(), refuse))
    last = {check.name: check for check in report.checks}["commanded gains"]
    assert report.ok and last.state == "unknown" and "gains of its own" in last.found, str(report)


@pytest.mark.slow
def test_a_stated_delay_is_no_fault() -> None:
    assert conformance(Late(plant(), 2), delay=0.01).ok
    with pytest.raises(InputError, match="delay of the loop"):
        conformance(plant(), delay=-0.01)


def test_the_command_takes_a_loop_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = tmp_path / "mine.py"
    program.write_text(
        "from dataclasses import replace\nimport wbc\n"
        "class Mine(wbc.Plant):\n"
        "    def measure(self):\n"
        "        m = super().measure()\n"
        "        return replace(m, joint_position=m.joint_position[1:])\n"
        "def make():\n    return Mine(wbc.load_robot('g1'))\n",
        encoding="utf-8",
    )
    assert main(["check-plant", f"{program}:make"]) == 1
    text = capsys.readouterr()
    assert "joint_position has shape (28,), not (29,)" in text.out and "wrong: shapes" in text.err
    for bad in ("mine", f"{program}:made", "nowhere.module:make"):
        assert main(["check-plant", bad]) == 2, bad
    capsys.readouterr()
    for text, words in (
        ("def make(:", "SyntaxError"),
        ("def make():\n    return {}['x']\n", "returns no loop: KeyError"),
    ):
        program.write_text(text, encoding="utf-8")
        assert main(["check-plant", f"{program}:make"]) == 2
        assert words in capsys.readouterr().err


def test_a_hand_without_a_reading_is_no_fault() -> None:
    rows, _ = healthy()
    none = np.full((len(DESCRIPTION.robot().frames), 6), np.nan)
    report = conformance(Recorded(rows, lambda m, _: replace(m, hand_wrenches=none)))  # type: ignore[arg-type]
    assert report.checks[0].name == "shapes" and report.checks[0].state == "ok", str(report)


def test_something_else_than_a_loop_is_refused() -> None:
    half = type("Half", (), {"description": DESCRIPTION, "control_period": 0.01})
    with pytest.raises(InputError, match="'measure' is missing"):
        conformance(half())
    with pytest.raises(InputError, match=r"must be an object, got the class .*Half"):
        conformance(half)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("part", "value", "words"),
    [
        ("description", "g1", "must be a RobotDescription, got 'g1'"),
        ("control_period", 2, r"control period .* must lie in \(0, 0.025\], got 2"),
        ("control_period", 0.0, r"must lie in \(0, 0.025\], got 0"),
        ("control_period", None, "must be a number, got None"),
    ],
)
def test_a_loop_of_another_kind_is_refused_before_anything_is_sent(
    part: str, value: object, words: str
) -> None:
    loop = Recorded([], lambda m, _: m)
    setattr(loop, part, value)
    with pytest.raises(InputError, match=words):
        conformance(loop)


def test_a_delay_in_milliseconds_is_refused() -> None:
    with pytest.raises(InputError, match=r"delay of the loop \(s\) must lie in \[0, 0.2\], got 5"):
        conformance(Recorded([], lambda m, _: m), delay=5)


@pytest.mark.parametrize("tick", [0, 30])
def test_a_loop_that_measures_nothing_is_refused(tick: int) -> None:
    loop = Recorded(healthy()[0], lambda m, now: None if now == tick else m)  # type: ignore[arg-type, return-value]
    with pytest.raises(MeasurementError, match=r"measure\(\) .* must return a Measurement, got None"):
        conformance(loop)


@pytest.mark.slow
def test_a_loop_without_force_sensors_is_checked_by_what_its_joints_feel() -> None:
    model, sensors = Plant(DESCRIPTION).model, Machine(force_sensors=False, torque_sensors=True)
    report = conformance(MujocoLoop(DESCRIPTION, model, control_period=PERIOD, machine=sensors))
    assert not report.wrong
    unknown = {check.name for check in report.checks if check.state == "unknown"}
    assert unknown == {"weight", "sides", "wrench frame"}
