"""Unitree's topics: checksums and layouts against known ones, and a G1 in another process over the loopback."""

from __future__ import annotations

import importlib.util
import itertools
import pickle
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from machine_process import Process

import wbc
from wbc import Command, Measurement
from wbc.core.errors import InputError
from wbc.machine import MotionSwitcher, Runner, RunSettings, UnitreeDriver, UnitreeRobot
from wbc.machine.report import Phase
from wbc.machine.unitree import DdsError
from wbc.machine.unitree.wire import G1_MOTORS, LOW_CMD, LOW_STATE, checksum, from_cdr, intact, sealed, to_cdr

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


class Topics:
    """Topics of a machine: its states are written here, its commands read."""

    def __init__(self) -> None:
        self.states: list[np.ndarray] = []
        self.sent: list[np.ndarray] = []

    def read(self, layout: np.dtype, timeout: float) -> np.ndarray | None:
        return self.states.pop(0) if self.states else None

    def write(self, record: np.ndarray) -> None:
        self.sent.append(record["motor_cmd"][:29].copy())


def state(seal: bool = True, **motors: object) -> np.ndarray:
    """Return a state of a machine whose motors are on; some fields of its motors are others."""
    record = np.zeros((), LOW_STATE)
    record["tick"], record["mode_machine"] = 5, 5
    record["motor_state"]["mode"] = 1
    for name, value in motors.items():
        record["motor_state"][name][3] = value
    return sealed(record) if seal else record


def machine(*states: np.ndarray, **how: Any) -> UnitreeDriver:
    driver = UnitreeDriver(DESCRIPTION, **how)
    driver._topics = Topics()  # type: ignore[assignment]
    driver._topics.states.extend(states)  # type: ignore[union-attr, attr-defined]
    return driver


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


def test_motors_that_are_off_hot_or_in_error_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    knee = DESCRIPTION.joint_names[3]
    other = state()
    other["mode_machine"] = 6
    for last, fault, warnings in (
        (state(mode=0), f"motor off: {knee}", ()),
        (sealed(other), "mode_machine changed from 5 to 6", ()),
        (state(motorstate=3), "", (f"motor error 0x3: {knee}",)),
        (state(temperature=(20, 91)), "", (f"motor above 90 °C: {knee}",)),
        (state(), "", ()),
    ):
        driver = machine(state(), last)
        driver.read(0.0)
        assert (driver.fault, driver.warnings) == ("", ())
        driver.read(0.0)
        assert (driver.fault, driver.warnings) == (fault, warnings)
    # Off from the beginning: a machine switches its motors on with the first commands, a simulator says nothing.
    for seal in (True, False):
        driver = machine(*(state(seal, mode=0) for _ in range(2)))
        driver.read(0.0)
        driver.write(Command(np.zeros(29)))
        assert driver.fault == ""
        monkeypatch.setattr(driver, "_begun", -1.0)
        driver.read(0.0)
        assert driver.fault == (f"motor off: {knee}" if seal else "")


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
    with pytest.raises(InputError, match="joints without a motor"):
        UnitreeDriver(wbc.load_robot("hrp4_class"))
    pickle.loads(pickle.dumps(UnitreeDriver(DESCRIPTION)))


@dds
def test_requests_of_the_motion_switcher_are_laid_out_as_its_idl_says() -> None:
    from wbc.machine.unitree.dds import REQUEST_TOPIC, message  # noqa: PLC0415 - needs the extra

    packed = message(REQUEST_TOPIC, ((5, 1002), (0,), (0, False)), '{"name": "ai"}', []).serialize()
    identity_lease_policy = struct.pack("<qqqi?3x", 5, 1002, 0, 0, False)
    text = b'{"name": "ai"}\0'
    assert packed[:4] == b"\x00\x01\x00\x00"
    assert packed[4 : 4 + 32] == identity_lease_policy
    assert packed[36 : 40 + len(text)] == struct.pack("<I", len(text)) + text
    assert not any(packed[40 + len(text) :])  # an empty sequence


@dds
def test_the_motion_switcher_releases_the_motors_and_gives_them_back() -> None:
    """A robot whose built-in controller is on ignores commands; the switcher is asked over the loopback."""
    robot = UnitreeRobot(DESCRIPTION, domain=8, mode="ai")
    driver, switcher = UnitreeDriver(DESCRIPTION, domain=8), MotionSwitcher(domain=8, timeout=20.0)
    q = DESCRIPTION.robot().half_sitting[7:]
    measurement = Measurement(1.0, q, np.zeros(29), np.zeros(3), np.array([0.0, 0.0, 9.81]), None)
    done = threading.Event()
    commands: list[Command] = []

    def serve() -> None:
        while not done.is_set():
            robot.send(measurement)
            command = robot.receive()[1]
            if command is not None:
                commands.append(command)
            time.sleep(0.002)

    def until(condition: Callable[[], bool]) -> None:
        """Send commands until something has happened."""
        end = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < end
            driver.read(0.01)
            driver.write(Command(np.ones(29)))

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        assert switcher.mode() == "ai"
        until(lambda: robot.refused > 0)
        assert not commands
        assert switcher.release() == "ai" and switcher.mode() == ""
        until(lambda: len(commands) > 0)
        switcher.select("ai")
        assert switcher.mode() == robot.mode == "ai"
        with pytest.raises(DdsError, match="refused request 1004: code 1"):
            switcher._call(1004, {})
        with pytest.raises(InputError, match="must not be empty"):
            switcher.select("")
    finally:
        done.set()
        serving.join()
    with pytest.raises(DdsError, match="no answer from a motion switcher within 0.1 s"):
        MotionSwitcher(domain=9, timeout=0.1).mode()


@dds
def test_an_interface_that_there_is_not_is_refused() -> None:
    """DDS itself would take another one, and commands would go to whatever robot is there."""
    with pytest.raises(DdsError, match="cannot use the network interface 'nosuch0'"):
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
