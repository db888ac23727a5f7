"""The loop of a machine: start, rate, failures and stop; in simulated time, and with processes that are killed."""
# ruff: noqa: E501 - one failure a line

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hanging import SimulatedTime
from own_control import OwnControl
from simulated_machine import (
    DESCRIPTION,
    NA,
    PERIOD,
    Ideal,
    SimulatedMachine,
    bent,
    commands_by_phase,
    make,
)

from wbc import Command, Measurement
from wbc.ground import PointCloud
from wbc.machine.commands import Parking
from wbc.machine.loads import SoleLoads
from wbc.machine.report import Phase
from wbc.machine.start import SafeStart
from wbc.sim import Machine, Plant


@pytest.mark.slow
def test_a_robot_goes_from_any_posture_to_the_stand_and_sinks_at_the_end() -> None:
    machine = SimulatedMachine(SimulatedTime(), bent())
    runner = make(machine)
    sent, speeds, heights = commands_by_phase(machine, runner), [], []

    def watch() -> bool:
        speeds.append(np.abs(machine.loop.measure().joint_velocity).max())
        heights.append(machine.loop.truth().com[2])
        return machine.clock.time > 102.5

    report = runner.run(watch)
    assert [phase.name for phase, _ in report.phases] == ["START", "STAND", "RUN", "STOP", "DAMPED"]
    assert report.reason == "stopped" and report.missed == 0 and report.ticks == machine.commands
    first = sent[Phase.START][0]
    assert first.kp is not None and first.kp.max() < 0.05 * DESCRIPTION.kp.max()  # faded in
    assert np.abs(first.joint_torque).max() < 1.0
    assert max(speeds) < 3.0
    com = DESCRIPTION.robot().com
    assert heights[-1] == pytest.approx(com[2], abs=5e-3)  # stands
    assert machine.damped >= 50


def test_joints_of_somebody_else_are_held_where_they_were_let_go_and_never_limp() -> None:
    gains = np.full(NA, 40.0), np.full(NA, 2.0)
    parking, released = Parking(gains), np.arange(NA) > 14
    first, later = np.linspace(0.0, 1.0, NA), np.full(NA, 5.0)
    own = Command(np.full(NA, 3.0), released=released, period=0.004)
    for position in (first, later):
        sent = parking.hold(own, position)
        assert sent.joint_position is not None and sent.kp is not None and sent.kd is not None
        assert (sent.joint_position[released] == first[released]).all() and sent.released is None
        assert sent.period == 0.004
        assert (sent.kp[released] == 40.0).all() and not sent.joint_torque[released].any()
        assert (sent.kp[~released] == 0.0).all() and (sent.joint_torque[~released] == 3.0).all()
    assert parking.hold(Command(np.zeros(NA)), later).joint_position is None  # all are taken back
    sent = parking.hold(own, later)
    assert sent.joint_position is not None and (sent.joint_position[released] == 5.0).all()


@pytest.mark.parametrize("until", [0.0, 0.1, 0.3])
def test_a_stop_holds_the_joints_where_they_are_while_stiffness_and_torques_fall(until: float) -> None:
    """On the way to half-sitting; while stiffness and torques still rise, they rise no further."""
    machine = Ideal(bent())
    runner = make(machine)
    sent = commands_by_phase(machine, runner)
    assert runner.run(until).reason == "stopped"
    stop, kp, risen = sent[Phase.STOP], machine.description.kp, min((until + PERIOD) / 0.2, 1.0)
    assert len(stop) >= 45 and not sent[Phase.HANG] and not sent[Phase.RUN]
    held = stop[0].joint_position
    assert held is not None and np.abs(held - bent()[7:]).max() < 0.1
    assert np.abs(held - DESCRIPTION.robot().half_sitting[7:]).max() > 0.2
    assert all((c.joint_position == held).all() and not np.any(c.joint_velocity) for c in stop)
    assert all((c.kd == machine.description.kd).all() for c in stop)
    shares = np.array([command.kp / kp for command in stop])
    np.testing.assert_allclose(shares, shares[:, :1] * np.ones(NA))
    assert shares[0, 0] == pytest.approx(risen, abs=0.05) and shares[0, 0] <= risen + 1e-9
    assert shares[-1, 0] < 0.05 and (np.diff(shares[:, 0]) < 0.0).all()
    assert all(np.abs(c.joint_torque).max() <= 100.0 * risen for c in stop)
    assert np.abs(stop[-1].joint_torque).max() <= 0.1 * np.abs(stop[0].joint_torque).max()


def test_a_controller_takes_over_by_and_by() -> None:
    """From the stand to the controller's own command, here no torque at all."""
    machine = Ideal()
    own = OwnControl(lambda measurement: Command(np.zeros(NA)))
    runner = make(machine, own, load=0.0, fade=0.02, stop=0.0)
    sent = commands_by_phase(machine, runner)
    report = runner.run(lambda: len(sent[Phase.RUN]) == 60)
    assert report.reason == "stopped" and machine.damped == 50
    taken = sent[Phase.RUN]
    blended = [command for command in taken if command.kp is not None]
    assert len(blended) == 50 and all(command.kp is None for command in taken[50:])  # 0.2 s
    damping = [float(command.kd[0]) for command in blended if command.kd is not None]
    np.testing.assert_allclose(np.array(damping) / damping[0], 1.0 - np.arange(50) / 50.0, atol=0.03)


@pytest.mark.parametrize("on_fall", ["damp", "go on"])
def test_a_robot_that_tips_over_under_a_control_of_ones_own_is_damped_unless_it_is_to_go_on(
    on_fall: str,
) -> None:
    machine, zero = Ideal(), np.zeros(NA)
    hold = Command(zero, machine.q.copy(), zero)
    runner = make(machine, OwnControl(lambda _: hold), load=0.0, fade=0.02, stop=0.0, on_fall=on_fall)
    ran = [0]

    def until() -> bool:
        ran[0] += runner.phase is Phase.RUN
        machine.rate = 2.0 if ran[0] > 10 and machine.pitch < 1.2 else 0.0
        return ran[0] > 400

    report = runner.run(until)
    assert report.reason.startswith("the robot has fallen: ") == (on_fall == "damp")
    assert (machine.pitch > 0.5) and (report.reason == "stopped") == (on_fall == "go on")


@pytest.mark.slow
def test_clouds_of_a_driver_reach_a_controller_that_sees_and_trouble_no_other() -> None:
    for sees in (True, False):
        machine, sent, seen = SimulatedMachine(SimulatedTime()), [], []

        def clouds(sent: list[PointCloud] = sent, machine: SimulatedMachine = machine) -> list[PointCloud]:
            sent.append(PointCloud(np.zeros((5, 3)), machine.clock.time, "pelvis"))
            return sent[-1:]

        machine.clouds = clouds  # type: ignore[method-assign]
        control = OwnControl(lambda measurement: Command(np.zeros(NA)), seen.append if sees else None)
        make(machine, control, load=0.0).run(0.2)
        assert len(sent) > 20
        assert [cloud.time for cloud in seen] == ([cloud.time for cloud in sent] if sees else [])


def test_cameras_that_fail_leave_a_control_blind_and_the_report_says_so(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A time-out, something else than clouds, and a control that refuses what it sees: the run goes on."""
    for wrong in (lambda: 1 / 0, lambda: [PointCloud(np.zeros((5, 3)), 0.0, "pelvis")]):
        caplog.clear()
        machine, asked = Ideal(), []

        def clouds(asked: list[int] = asked, wrong: Callable[[], Any] = wrong) -> Any:
            asked.append(1)
            return wrong() if 20 <= len(asked) < 40 else ()

        machine.clouds = clouds  # type: ignore[method-assign]
        control = OwnControl(command=lambda measurement: Command(np.zeros(NA)), see=lambda _: 1 / 0)
        report = make(machine, control, load=0.0, stop=0.0).run(0.2)
        assert report.reason == "stopped" and len(asked) > 45
        assert report.blind and f"no clouds of points: {report.blind}" in str(report)
        said = [text for text in caplog.messages if "clouds of points" in text]
        assert len(said) == 1 and report.blind in said[0]


@pytest.mark.slow
@pytest.mark.parametrize("own", [True, False])
def test_a_robot_that_falls_in_a_run_is_damped(own: bool) -> None:
    """Under the library's control, and under one of the user's own that knows nothing of falls."""
    machine = SimulatedMachine(SimulatedTime())
    zero = np.zeros(NA)
    hold = Command(zero, np.array(DESCRIPTION.robot().half_sitting[7:]), zero)
    control = OwnControl(lambda measurement: hold) if own else None
    runner, heights, damp = make(machine, control, load=0.0), [], machine.damp

    def until() -> bool:
        if runner.phase is Phase.RUN and not machine.pushed:  # type: ignore[attr-defined]
            machine.pushed = True  # type: ignore[attr-defined]
            machine.loop.push("torso_link", (150.0, 0.0, 0.0), 0.2)
        return machine.clock.time > 106.0

    def damped() -> None:
        heights.append(float(machine.loop.truth().com[2]))
        damp()

    machine.damp, machine.pushed = damped, False  # type: ignore[method-assign, attr-defined]
    report = runner.run(until)
    assert report.reason.startswith(("the robot has fallen: ", "the controller has stopped")), report.reason
    assert report.phases[-2][0] is Phase.RUN and heights[0] > 0.15


# ---- start and guard ------------------------------------------------------------------------------------------------


@cache
def standing() -> Measurement:
    """Measurement of a robot that stands on its servos, with the torques of its drives."""
    plant = Plant(DESCRIPTION, control_period=PERIOD, machine=Machine(torque_sensors=True), visuals=False)
    for _ in range(150):
        plant.step(plant.hold())
    return plant.measure()


def test_torques_of_the_start_carry_the_limbs_less_what_the_soles_press() -> None:
    """Those of a robot that stands, but for what its soles do besides pressing."""
    measurement, gains, robot = standing(), (DESCRIPTION.kp, DESCRIPTION.kd), DESCRIPTION.robot()
    loads = SoleLoads(DESCRIPTION, PERIOD, gains)
    for i in range(500):
        loads.wrenches(replace(measurement, time=PERIOD * i))
    assert measurement.joint_torque is not None and np.abs(measurement.joint_torque).max() > 10.0
    wanted = np.array(measurement.joint_torque)
    q = loads.posture(measurement)
    for sole, wrench in zip(robot.soles, measurement.wrenches, strict=True):
        jacobian = pin.computeFrameJacobian(robot.model, robot.data, q, robot.frame_id(sole.frame), pin.LOCAL)
        wanted += (wrench * [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]) @ jacobian[:, 6:]
    start = SafeStart(robot, measurement, loads, fade=0.2, speed=1.0, gains=gains)
    np.testing.assert_allclose(start.carry(replace(measurement, time=2.0)), wanted, atol=2.0)


def test_a_stop_starts_from_loads_and_attitude_of_its_own_time() -> None:
    """After a long run on both feet the right one is in the air and the trunk leans: by measurements, and by an observer."""
    gains, robot = (DESCRIPTION.kp, DESCRIPTION.kd), DESCRIPTION.robot()
    weight, still = robot.mass * 9.80665, np.zeros(NA)

    def measured(time: float, left: float, pitch: float) -> Measurement:
        wrench = np.zeros((2, 6))
        wrench[:, 2] = left * weight, (1.0 - left) * weight
        up = 9.80665 * np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
        return Measurement(time, robot.half_sitting[7:].copy(), still, np.zeros(3), up, wrench)

    for observed in (False, True):
        loads = SoleLoads(DESCRIPTION, PERIOD, gains)
        for i in range(300):
            loads.wrenches(measured(PERIOD * i, 0.5, 0.0))
        stop = measured(9.0, 1.0, 0.2)
        if observed:
            q = np.array(robot.half_sitting)
            q[3:7] = [0.0, np.sin(0.1), 0.0, np.cos(0.1)]
            loads.adopt(stop.time, q, np.zeros(robot.nv), np.array([weight, 0.0]))
        for i in range(3):
            loads.wrenches(replace(stop, time=9.0 + PERIOD * i))
        np.testing.assert_allclose(loads.normal, [weight, 0.0], atol=1.0)
        np.testing.assert_allclose(loads.posture(stop)[3:7], [0.0, np.sin(0.1), 0.0, np.cos(0.1)], atol=1e-3)
