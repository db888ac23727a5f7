"""Unitree's topics: checksums and layouts against known ones, and a G1 in another process over the loopback."""

from __future__ import annotations

import functools
import importlib.util
import itertools
import pickle
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import unitree_robot as robot
from machine_process import Process
from unitree_robot import UnitreeRobot

import wbc
from wbc import Command, Measurement
from wbc.base.errors import InputError
from wbc.machine import Runner, RunSettings, UnitreeDriver
from wbc.machine.report import Phase
from wbc.machine.unitree import DdsError, driver
from wbc.machine.unitree.dds import Topics
from wbc.machine.unitree.wire import (
    ENABLED,
    G1_MOTORS,
    LOW_CMD,
    LOW_STATE,
    checksum,
    from_cdr,
    intact,
    sealed,
    to_cdr,
)

DESCRIPTION = wbc.load_robot("g1")
dds = pytest.mark.skipif(
    importlib.util.find_spec("cyclonedds") is None,
    reason="cyclonedds is not installed: it comes with the extra 'unitree'",
)


def test_checksums_are_those_of_the_sdk() -> None:
    """Values computed with the bit loop of unitree_sdk2_python."""
    message = np.zeros((), LOW_CMD)
    assert int(sealed(message)["crc"]) == 0xFE172F9F
    message["mode_machine"] = 5
    motors = message["motor_cmd"]
    motors["mode"][:29], motors["kp"][:29], motors["kd"][:29] = 1, 40.0, 1.0
    motors["q"][:29] = 0.1 * np.arange(29)
    assert int(sealed(message)["crc"]) == 0x2D82BC79 and intact(message)
    assert checksum(bytes(2088)) == 0xD64BB04A
    motors["q"][3] += 1.0
    assert not intact(message)


def state(seal: bool = True, **motors: object) -> np.ndarray:
    """Return a state of a machine whose motors are on; some fields of its motors are others."""
    record = np.zeros((), LOW_STATE)
    record["tick"], record["mode_machine"] = 5, 5
    record["motor_state"]["mode"] = 1
    for name, value in motors.items():
        record["motor_state"][name][3] = value
    return sealed(record) if seal else record


def machine(
    *states: np.ndarray, description: wbc.RobotDescription = DESCRIPTION, **how: Any
) -> UnitreeDriver:
    """Return a driver of a machine that sends these states, and keeps the commands that it gets."""
    made, left, sent = UnitreeDriver(description, **how), [*states], []

    def read(layout: np.dtype, timeout: float) -> np.ndarray | None:
        return left.pop(0) if left else None

    def write(record: np.ndarray) -> None:
        sent.append(record["motor_cmd"][:29].copy())

    made._topics = SimpleNamespace(read=read, write=write, sent=sent)  # type: ignore[assignment]
    return made


def test_states_whose_checksum_is_wrong_or_missing_are_passed_over(caplog: pytest.LogCaptureFixture) -> None:
    """Unitree's simulators send none: on loopback, in their domain."""
    damaged = state()
    damaged["crc"] ^= 1
    driver = machine(damaged, state())
    assert driver.read(1.0) is not None and driver.refused == 1
    assert machine(state(seal=False)).read(0.0) is not None
    for how in ({"domain": 0}, {"interface": "eth0"}, {"domain": 0, "interface": "eth0"}):
        driver = machine(state(seal=False), **how)
        assert driver.read(0.0) is None and driver.refused == 1
        assert f"domain {how.get('domain', 1)} are refused" in caplog.text


def test_motors_in_trouble_are_named_and_one_that_goes_off_is_a_fault() -> None:
    """Errors with their codes, either temperature above 90 °C; another mode of the machine is a fault, too."""
    joint = DESCRIPTION.joint_names[3]
    for more, warned in (
        ({}, ()),
        ({"motorstate": 0x2F}, (f"motor error 0x2f: {joint}",)),
        ({"temperature": (90, 90)}, ()),
        ({"temperature": (91, 20)}, (f"motor above 90 °C: {joint}",)),
        ({"temperature": (20, 120)}, (f"motor above 90 °C: {joint}",)),
    ):
        driver = machine(state(**more))
        driver.read(0.0)
        assert (driver.fault, driver.warnings) == ("", warned)
    other = state()
    other["mode_machine"] = 6
    driver = machine(state(), state(mode=0), state(), sealed(other))
    faults = []
    for _ in range(4):
        driver.read(0.0)
        faults.append(driver.fault)
    assert faults == ["", f"motor off: {joint}", "", "mode_machine changed from 5 to 6"]


@pytest.mark.parametrize(
    ("seal", "after", "fault"), [(True, 0.49, False), (True, 0.51, True), (False, 9.0, False)]
)
def test_a_motor_that_was_never_on_is_a_fault_half_a_second_after_the_first_command(
    monkeypatch: pytest.MonkeyPatch, seal: bool, after: float, fault: bool
) -> None:
    """Not in a simulator, which leaves the checksum out and need not switch its motors."""
    now = [100.0]
    monkeypatch.setattr(driver, "time", SimpleNamespace(monotonic=lambda: now[0]))
    made = machine(*(state(seal, mode=0) for _ in range(2)))
    made.read(0.0)
    made.write(Command(np.zeros(29), *np.zeros((2, 29))))
    now[0] += after
    made.read(0.0)
    assert bool(made.fault) == fault


def ticking(first: int, count: int) -> list[np.ndarray]:
    """Return states 2 ms apart, whose tick has 32 bits."""
    states = [state() for _ in range(count)]
    for k, each in enumerate(states):
        each["tick"] = (first + 2 * k) % 2**32
        sealed(each)
    return states


@pytest.mark.parametrize("first", [0, 2, 2**31 - 6, 2**32 - 6, 2**32 - 5])
def test_the_time_of_states_goes_on_where_their_tick_begins_anew(first: int) -> None:
    driver = machine(*ticking(first, 8))
    times = [driver.read(0.0).time for _ in range(8)]
    np.testing.assert_allclose(np.diff(times), 0.002, atol=1e-6)
    assert times[0] == pytest.approx(1e-3 * first)


def test_states_that_come_late_and_machines_that_start_anew_are_seen_as_that() -> None:
    states = ticking(2**32 - 4, 4)
    driver = machine(*(states[i] for i in (0, 3, 1, 2)), *ticking(7, 1))
    times = [driver.read(0.0).time for _ in range(5)]
    np.testing.assert_allclose(np.diff(times), [0.006, -0.004, 0.002, 0.007], atol=1e-6)
    driver = machine(*ticking(900_000, 1), *ticking(7, 1))
    assert driver.read(0.0).time > driver.read(0.0).time


@pytest.mark.parametrize("found", [0.0, np.nan, 1e30])
def test_no_wild_command_reaches_the_motors(found: float) -> None:
    """Neither what is not finite nor a torque beyond the limit with what the servos add, whatever the state says."""
    driver = machine(state(q=found, dq=found))
    driver.read(0.0)
    parts = ("joint_torque", "joint_position", "joint_velocity", "kp", "kd")
    for part, wild in itertools.product(parts, (np.nan, np.inf, -1e30, 1e39, 1e5, -300.0)):
        values = dict.fromkeys(parts, np.zeros(29)) | {part: np.full(29, wild)}
        driver.write(Command(**values))
        driver.write(Command(values["joint_torque"]))
    driver.damp()
    limit = 1.001 * DESCRIPTION.robot().torque_limit
    sent = driver._topics.sent  # type: ignore[union-attr, attr-defined]
    assert len(sent) == 61
    for motors in sent:
        q, dq, tau, kp, kd = (motors[name].astype(float) for name in ("q", "dq", "tau", "kp", "kd"))
        assert np.isfinite([q, dq, tau, kp, kd]).all() and min(kp.min(), kd.min()) >= 0.0
        total = tau + kp * (q - driver._position) + kd * (dq - driver._velocity)
        assert (np.abs(tau) <= limit).all() and (~(np.abs(total) > limit) | (np.arange(29) == 3)).all()


def test_no_robot_is_made_in_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, made = machine(state()), []
    monkeypatch.setattr(wbc.RobotDescription, "robot", made.append)
    driver.read(0.0)
    driver.write(Command(np.zeros(29)))
    assert len(driver._topics.sent) == 1 and not made  # type: ignore[union-attr, attr-defined]


@pytest.mark.parametrize("found", [np.nan, 7.0, -1e30])
def test_a_motor_that_is_nowhere_has_no_stiffness_and_torques_reach_all_others(found: float) -> None:
    """The control goes by a prediction of it for a while, and then fails by itself."""
    driver, none, gains, torques = (
        machine(state(q=found)),
        np.zeros(29),
        np.full(29, 80.0),
        np.linspace(-3.0, 3.0, 29),
    )
    driver.read(0.0)
    driver.write(Command(none, none, none, kp=gains, kd=0.01 * gains))
    driver.write(Command(torques))
    stiff, pushed = driver._topics.sent  # type: ignore[union-attr, attr-defined]
    assert stiff["kp"][3] == stiff["tau"][3] == 0.0 and (np.delete(stiff["kp"], 3) == 80.0).all()
    np.testing.assert_allclose(pushed["tau"], torques, atol=1e-6)
    assert not pushed["kp"].any() and not pushed["kd"].any() and np.isfinite(pushed["q"]).all()


@functools.cache
def locked() -> tuple[wbc.RobotDescription, list[str]]:
    """Return a G1 without joints at waist and wrists, and the motors there."""
    lock = {n: 0.0 for n in DESCRIPTION.joint_names if n.startswith("waist_") or "wrist" in n}
    left, right = DESCRIPTION.soles
    return wbc.RobotDescription.from_urdf(
        DESCRIPTION.urdf, left_sole=left, right_sole=right, lock=lock, name="locked"
    ), list(lock)


@pytest.mark.parametrize("found", [0.3, np.nan])
def test_motors_that_are_locked_in_the_description_are_held_where_they_are(
    found: float, caplog: pytest.LogCaptureFixture
) -> None:
    """And damped with the others; one whose encoder says nothing is damped alone."""
    described, lock = locked()
    states = [state(), state()]
    for each, at in zip(states, (found, 0.1), strict=True):
        each["motor_state"]["q"][G1_MOTORS.index("waist_roll_joint")] = at
        sealed(each)
    driver = machine(*states, description=described)
    assert set(driver.held) == set(lock)
    driver.read(0.0)
    driver.read(0.0)
    assert all(f"{name} at" in caplog.text for name in lock)
    count = len(described.joint_names)
    driver.write(Command(np.zeros(count), *np.zeros((2, count))))
    driver.damp()
    hold, damp = driver._topics.sent  # type: ignore[union-attr, attr-defined]
    others = [G1_MOTORS.index(name) for name in lock]
    roll = G1_MOTORS.index("waist_roll_joint")
    for motors in (hold, damp):
        assert (motors["mode"] == ENABLED).all() and (motors["kd"][others] > 0.0).all()
        assert np.isfinite(motors["q"]).all() and not motors["tau"][others].any()
    stiff = [i for i in others if i != roll or np.isfinite(found)]
    assert (hold["kp"][stiff] >= 40.0).all() and not damp["kp"].any()
    assert hold["q"][roll] == (np.float32(0.3) if np.isfinite(found) else 0.0)
    assert (hold["kp"][roll] > 0.0) == np.isfinite(found)


def test_a_second_run_of_a_driver_begins_as_a_first_one() -> None:
    """The machine was switched off and on in between, in another mode, and its locked joints hang elsewhere."""
    described, lock = locked()
    zero = np.zeros((3, len(described.joint_names)))
    states = []
    for mode, on, at in ((5, 1, 0.3), (6, 0, -0.4), (6, 1, -0.4), (7, 1, -0.4)):
        states.append(record := state())
        record["mode_machine"], record["motor_state"]["mode"], record["motor_state"]["q"] = mode, on, at
        sealed(record)
    driver = machine(*states, description=described)
    waist = [G1_MOTORS.index(name) for name in lock]
    for at in (0.3, -0.4):
        assert driver.read(0.0) is not None and driver.fault == ""
        driver.write(Command(*zero))
        np.testing.assert_allclose(driver._topics.sent[-1]["q"][waist], at, rtol=1e-6)  # type: ignore[union-attr, attr-defined]
        for _ in range(3):
            driver.damp()
        damped = driver._topics.sent[-1]  # type: ignore[union-attr, attr-defined]
        assert (damped["mode"] == ENABLED).all() and (damped["kd"] > 0.0).all() and not damped["kp"].any()
    assert driver.read(0.0) is not None and driver.fault == ""
    driver.write(Command(*zero))
    driver.read(0.0)
    assert "mode_machine changed from 6 to 7" in driver.fault


@pytest.mark.parametrize("layout", [LOW_CMD, LOW_STATE])
def test_structs_and_cdr_hold_the_same(layout: np.dtype) -> None:
    assert layout.itemsize == {LOW_CMD: 1004, LOW_STATE: 2092}[layout]
    rng = np.random.default_rng(0)
    record = np.frombuffer(rng.bytes(layout.itemsize), layout)[0].copy()
    data = to_cdr(record)
    assert len(data) == 4 + layout.itemsize - 4
    again = from_cdr(data, layout)
    for name in ("mode_machine", "reserve", "crc"):
        np.testing.assert_array_equal(again[name], record[name])
    motor = "motor_cmd" if layout is LOW_CMD else "motor_state"
    for name in set(layout[motor].base.names or ()) - {"pad"}:
        assert again[motor][name].tobytes() == record[motor][name].tobytes(), name
    assert from_cdr(data[:-9], layout) is None


@dds
def test_packed_messages_are_those_that_cyclonedds_would_pack() -> None:
    from wbc.machine.unitree.dds import COMMAND_TOPIC, messages  # noqa: PLC0415 - needs the extra

    kind = messages()[COMMAND_TOPIC]
    record = np.zeros((), LOW_CMD)
    record["mode_machine"], record["crc"] = 5, 77
    record["motor_cmd"]["q"], record["motor_cmd"]["mode"] = np.arange(35), np.arange(35)
    read = kind.__idl__.deserialize(to_cdr(record))
    assert read.mode_machine == 5 and read.crc == 77
    assert [motor.q for motor in read.motor_cmd] == list(range(35))
    assert [motor.mode for motor in read.motor_cmd] == list(range(35))
    assert kind.__idl__.serialize(read, use_version_2=False) == to_cdr(record)


def test_joints_are_found_by_name() -> None:
    assert set(G1_MOTORS) == set(DESCRIPTION.joint_names)
    with pytest.raises(InputError, match="joints"):
        UnitreeDriver(wbc.load_robot("hrp4_class"))
    pickle.loads(pickle.dumps(UnitreeDriver(DESCRIPTION)))


def test_gains_of_the_machine_are_those_of_the_example_of_its_maker() -> None:
    """60 and 1 at hips and waist, 100 and 2 at knees, 40 and 1 elsewhere, Nm/rad and Nms/rad."""
    kp, kd = UnitreeDriver(DESCRIPTION).gains
    for name, *found in zip(DESCRIPTION.joint_names, kp, kd, strict=True):
        part = next((part for part in ("hip", "waist", "knee") if part in name), "")
        assert found == {"hip": [60.0, 1.0], "waist": [60.0, 1.0], "knee": [100.0, 2.0]}.get(
            part, [40.0, 1.0]
        )


class Bus:
    """Topics in memory, by name."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sent: dict[str, list[Any]] = {}
        for module in (robot, driver):
            monkeypatch.setattr(module, "Topics", self.topics)

    def topics(self, domain: int, interface: str, reads: str, writes: str) -> Any:
        self.sent |= {name: self.sent.get(name, []) for name in (reads, writes)}

        def read(layout: np.dtype, timeout: float) -> Any:
            found, self.sent[reads] = self.sent[reads], []
            return next(reversed(found), None)

        def write(record: np.ndarray) -> None:
            self.sent[writes].append(record.copy())

        return SimpleNamespace(read=read, write=write)


def test_states_and_commands_come_through_as_they_were_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the precision of the wire; what a machine would ignore is ignored and counted."""
    bus, rng, parts = (
        Bus(monkeypatch),
        np.random.default_rng(0),
        ("joint_torque", "joint_position", "kp", "kd"),
    )
    end, mine = UnitreeRobot(DESCRIPTION), UnitreeDriver(DESCRIPTION)
    drawn = rng.normal(size=(3, 29)), rng.normal(size=(2, 3))
    sent = Measurement(2**32 * 1e-3 + 1.002, *drawn[0][:2], *drawn[1], None, joint_torque=drawn[0][2])
    mine.write(Command(np.zeros(29)))
    assert not bus.sent["rt/lowcmd"], "nothing is sent before a state has come"
    end.send(sent)
    (record,) = bus.sent["rt/lowstate"]
    assert (record["mode_machine"], record["tick"]) == (5, 1002)
    assert record["imu_state"]["quaternion"].tolist() == [1, 0, 0, 0]
    assert record["motor_state"]["mode"].tolist() == [1] * 29 + [0] * 6
    got = mine.read(0.0)
    assert got is not None and got.time == 1.002 and got.sole_wrench is None
    for name in ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "joint_torque"):
        np.testing.assert_allclose(getattr(got, name), getattr(sent, name), rtol=1e-6, err_msg=name)
    torque, to, rate, kp, kd = 0.01 * rng.uniform(1.0, 2.0, (5, 29))
    command = Command(torque, got.joint_position + to, rate, kp=100.0 * kp, kd=100.0 * kd)

    def received(change: Callable[[Any], object] = lambda _: None, seal: bool = True) -> Command | None:
        mine.write(command)
        change(bus.sent["rt/lowcmd"][0])
        if seal:
            sealed(bus.sent["rt/lowcmd"][0])
        damping, found = end.receive()
        assert damping is False
        return found

    found = received()
    for name in (*parts, "joint_velocity"):
        np.testing.assert_allclose(getattr(found, name), getattr(command, name), rtol=1e-6, err_msg=name)
    off = received(
        lambda r: r["motor_cmd"]["mode"].__setitem__(G1_MOTORS.index(DESCRIPTION.joint_names[3]), 0)
    )
    for name in ("joint_torque", "kp", "kd"):
        assert getattr(off, name)[3] == 0.0 and np.count_nonzero(getattr(off, name)) == 28, name
    mine.damp()
    _, damped = end.receive()
    assert damped is not None and (damped.kd == 3.0).all()
    assert not (damped.kp.any() or damped.joint_torque.any())
    np.testing.assert_allclose(damped.joint_position, got.joint_position, rtol=1e-6)
    assert end.receive() == (False, None) and end.refused == 0
    assert received(lambda r: r.__setitem__("crc", 1), seal=False) is None
    assert received(lambda r: r.__setitem__("mode_machine", 6)) is None
    assert end.refused == 2


@dds
def test_an_interface_that_there_is_not_is_refused() -> None:
    """DDS itself would take another one, and commands would go to whatever robot is there."""
    with pytest.raises(DdsError, match="'nosuch0'"):
        UnitreeDriver(DESCRIPTION, "nosuch0", domain=10).read(0.0)


@dds
@pytest.mark.slow
def test_a_g1_in_another_process_is_driven_over_loopback() -> None:
    """It ramps to the stand, feels its weight through its joints, balances in torque control and is damped."""
    with Process("unitree") as robot:
        robot.line("ready")
        driver = UnitreeDriver(DESCRIPTION, domain=7)
        end = time.monotonic() + 20.0
        while (first := driver.read(0.5)) is None and time.monotonic() < end:
            pass
        assert first is not None
        np.testing.assert_allclose(first.joint_position, DESCRIPTION.robot().half_sitting[7:], atol=0.05)
        assert first.sole_wrench is None and first.joint_torque is not None
        control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), 0.004))
        settings = RunSettings(fade=0.2, blend=0.2, stop=0.2, robot_timeout=5.0, control_timeout=5.0)
        runner = Runner(driver, control, 250.0, settings=settings, guard=False)
        balanced, end = 0, time.monotonic() + 50.0

        def until() -> bool:
            nonlocal balanced
            balanced += runner.phase is Phase.RUN
            return balanced == 100 or time.monotonic() > end

        report = runner.run(until)
        assert report.reason == "stopped", str(report)
        assert Phase.RUN in [phase for phase, _ in report.phases]
        driver.write(Command(np.zeros(29)))


@pytest.mark.parametrize("timeout", [0.0, 0.25])
def test_a_topic_is_waited_for_up_to_its_time_and_its_newest_message_counts(timeout: float) -> None:
    """Messages that cannot be read, and notes without one, are left out; nothing is waited for if one is there."""
    topics, waited = object.__new__(Topics), []
    record = np.zeros((), LOW_STATE)
    good = []
    for tick in (3, 4):
        record["tick"] = tick
        good.append(SimpleNamespace(payload=to_cdr(record)))
    note, torn = SimpleNamespace(), SimpleNamespace(payload=good[0].payload[:20])
    for now, later, tick in (
        ([*good, torn, note], None, 4),
        ([good[1], good[0]], None, 3),
        ([], [good[0], torn], 3 if timeout else None),
        ([], [], None),
        ([torn], [good[0]], None),
    ):
        left = [now, later]
        topics._reader = SimpleNamespace(take=lambda count, left=left: left.pop(0))
        topics._waiting = SimpleNamespace(wait=waited.append)
        waited.clear()
        found = topics.read(LOW_STATE, timeout)
        assert (None if found is None else int(found["tick"])) == tick
        assert waited == ([] if now or not timeout else [250_000_000])  # ns


def test_a_motor_that_is_beyond_a_turn_is_nowhere() -> None:
    """One without a joint in the description is held within 2π of its zero, and damped otherwise."""
    made = UnitreeDriver(DESCRIPTION)
    made._hold(np.array([6.28, -6.28, 6.29, -6.29, np.nan, 0.0]))
    assert made._held_at is not None
    np.testing.assert_array_equal(made._held_at, [6.28, -6.28, np.nan, np.nan, np.nan, 0.0])


def test_after_a_damaged_state_the_rest_of_the_time_is_waited(monkeypatch: pytest.MonkeyPatch) -> None:
    now, waited = [100.0], []
    monkeypatch.setattr(driver, "time", SimpleNamespace(monotonic=lambda: now[0]))
    damaged = state()
    damaged["crc"] ^= 1
    made, left = UnitreeDriver(DESCRIPTION), [damaged, damaged, damaged, None]

    def read(layout: np.dtype, timeout: float) -> np.ndarray | None:
        waited.append(timeout)
        now[0] += 0.004
        return left.pop(0)

    made._topics = SimpleNamespace(read=read)  # type: ignore[assignment]
    assert made.read(0.01) is None and made.refused == 3
    assert waited == pytest.approx([0.01, 0.006, 0.002, 0.0], abs=1e-9)
