"""Measurements that a controller cannot use: refused, predicted over, and forgotten when good ones come again."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from at_rest import at_rest

import wbc
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.checks.stamps import Stamps
from wbc.core.qp.solving.solver import Status
from wbc.core.signals import SIGNALS
from wbc.sim import TrueFallDetector
from wbc.tasks import AdmittanceTask, PositionTask
from wbc.tasks.balance import balance_controller
from wbc.walking import WalkingControl, WalkingControlSettings

NAN, INF = float("nan"), float("inf")
DT = 0.002


@cache
def shared_robot() -> wbc.Robot:
    return wbc.load_robot("hrp4_class").robot()


def controller(period: float = DT) -> wbc.Controller:
    return balance_controller(shared_robot().clone(), period)


def test_contradictory_hard_constraints_are_named() -> None:
    broken = controller()
    torso = shared_robot().torso_frame
    place = broken.robot.placement(torso).translation
    for name, way in (("up", 0.3), ("down", -0.3)):
        task = PositionTask(torso, place + [0.0, 0.0, way], name=name, hard=True)
        broken.add(task)
    assert broken.solve().status is Status.INFEASIBLE
    named = broken.diagnose()
    assert {"hard task 'up'", "hard task 'down'"} & set(named), named
    assert all(size > 0.0 for size in named.values())
    # What has nothing to do with it is not accused, and without one of the two all is well.
    assert "joint limits" not in named
    broken.remove(broken.task("down"))
    broken.task("up").stiffness = 0.0
    broken.task("up").damping = 0.0
    assert broken.solve().ok
    assert broken.diagnose() == {}


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize(("kind", "bad"), [(PositionControl, NAN), (TorqueControl, INF)])
def test_a_measurement_that_is_not_finite_is_refused_and_leaves_no_trace(
    kind: type[PositionControl | TorqueControl], signal: str, bad: float, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL)  # refusals are logged; here they are expected
    struck, spared = (kind(controller()) for _ in range(2))
    for control in (struck, spared):
        for tick in range(3):
            control.command(at_rest(shared_robot(), tick * DT))
    good = at_rest(shared_robot(), 3 * DT)
    broken = np.array(getattr(good, signal))
    broken.flat[1] = bad
    command = struck.command(replace(good, **{signal: broken}))
    # One signal is refused and predicted over: the tick itself goes on.
    assert "refused" in struck.status()
    assert struck.failures == 0 and not struck.stopped
    for part in (command.joint_torque, command.joint_position, command.joint_velocity):
        assert part is None or np.isfinite(part).all()
    # The robot rests, so holding the last command is what a good tick would have commanded, too.
    np.testing.assert_allclose(command.joint_torque, spared.command(good).joint_torque, atol=1e-2)
    after = [control.command(at_rest(shared_robot(), 4 * DT)) for control in (struck, spared)]
    assert struck.failures == 0 and struck.status() == "ok"
    np.testing.assert_allclose(after[0].joint_torque, after[1].joint_torque, atol=1e-2)
    assert np.isfinite(struck.observer.robot.q).all()


UNNEEDED = {
    "sole_wrench": ([[1.0, 2.0], [3.0]], "all", np.zeros((1, 6)), np.full((2, 6), NAN), np.full((2, 6), 1e6)),
    "hand_wrenches": (np.zeros((1, 6)), np.zeros(12), "none", np.full((2, 6), INF)),
    "joint_torque": (np.zeros(35), np.zeros((34, 1)), 0.0, np.full(34, NAN)),
    "sole_range": (None, 0.1, np.zeros(1), np.zeros((2, 2)), "far"),
    "sole_stiffness": (None, 5.0, np.zeros(3), [[1.0]]),
}
"""Signals that a robot balances without, and values that none of them can have."""


@pytest.mark.parametrize("from_the_start", [True, False])
def test_a_robot_stands_on_without_signals_that_it_does_not_need(
    from_the_start: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """Of whatever shape or value; each is named, and forgotten when it is good again: then the next value comes."""
    caplog.set_level(logging.CRITICAL)
    plant = wbc.Plant("hrp4_class", control_period=0.004, noise="realistic", visuals=False)
    control, begin = TorqueControl(controller(plant.control_period)), plant.truth().com
    for _ in range(0 if from_the_start else 50):  # 0.2 s
        plant.step(control.command(plant.measure()))
    wrong: list[dict[str, object]] = [{name: bad} for name, values in UNNEEDED.items() for bad in values]
    for parts in [{name: values[1] for name, values in UNNEEDED.items()}] if from_the_start else wrong:
        for _ in range(75 if from_the_start else 20):  # 0.3 s, or 0.08 s
            plant.step(control.command(replace(plant.measure(), **parts)))  # type: ignore[arg-type]
        assert control.failures == 0 and np.abs(plant.truth().com - begin).max() < 0.02, parts
        measured, faults = control.measurement, control.sensing.plausibility.faults
        assert faults and measured is not None
        assert (measured.wrench_source == "sensor") is ("sole_wrench" not in parts)
        for _ in range(5):
            plant.step(control.command(plant.measure()))
        assert control.status() == "ok" and control.measurement.wrench_source == "sensor"  # type: ignore[union-attr]


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_bad_measurements_that_go_on_stop_the_robot(mode: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)
    policy = FailurePolicy(stop_after=5 * DT)
    control: PositionControl | TorqueControl
    control = (TorqueControl if mode == "torque" else PositionControl)(controller(), failure_policy=policy)
    control.command(at_rest(shared_robot(), 0.0))
    held = round(control.sensing.plausibility.settings.hold / DT)  # ticks that predictions bridge
    for tick in range(1, held + 8):
        good = at_rest(shared_robot(), tick * DT)
        command = control.command(replace(good, joint_position=np.full_like(good.joint_position, NAN)))
        assert np.isfinite(command.joint_torque).all()
    assert control.stopped
    command = control.command(at_rest(shared_robot(), 8 * DT))
    if mode == "torque":
        assert not command.joint_torque.any()  # at rest, damping alone is nothing
    else:
        assert command.joint_velocity is not None and np.abs(command.joint_velocity).max() < 1e-9
    control.reset()
    control.command(at_rest(shared_robot(), 9 * DT))
    assert not control.stopped and control.solution is not None and control.solution.ok


@pytest.mark.parametrize("kind", [PositionControl, TorqueControl])
def test_a_reset_forgets_what_was_sent_and_what_has_yielded(
    kind: type[PositionControl | TorqueControl], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.ERROR)
    whole = controller()
    task = AdmittanceTask("left_sole", admittance=(1e-4, 1e-2), weight=1e-3)
    whole.add(task)
    control = kind(whole)
    for tick in range(20):
        control.command(at_rest(shared_robot(), tick * DT))
    assert np.abs(task.offset_vector()).max() > 1e-4
    control.reset()
    assert not task.offset_vector().any() and control.solution is None
    bad = at_rest(shared_robot(), 21 * DT)
    command = control.command(replace(bad, joint_position=np.full_like(bad.joint_position, NAN)))
    assert not command.joint_torque.any() and "measurement refused" in caplog.text


@pytest.mark.parametrize("kind", [PositionControl, TorqueControl])
def test_a_control_starts_where_the_robot_is(kind: type[PositionControl | TorqueControl]) -> None:
    away = controller()
    q = np.array(away.robot.q)
    q[0] += 1.0
    away.robot.update(q, np.zeros(away.robot.nv))
    control = kind(away)
    control.command(at_rest(shared_robot(), 0.0))
    assert control.observer.robot.q[0] == pytest.approx(q[0], abs=1e-3)
    assert control.controller.robot.q[0] == pytest.approx(q[0], abs=1e-3)


def test_a_state_with_nan_is_refused_by_the_solver_and_recovered_from() -> None:
    struck = controller()
    q = np.array(struck.robot.q)
    assert struck.solve().ok
    good = struck.solve().variables.copy()
    struck.update(np.where(np.arange(q.size) == 9, NAN, q), np.zeros(struck.robot.nv))
    refused = struck.solve()
    assert refused.status is Status.REFUSED
    assert np.isfinite(refused.variables).all() and np.isfinite(refused.torques).all()
    struck.update(q, np.zeros(struck.robot.nv))
    np.testing.assert_allclose(struck.solve().variables, good, atol=1e-6)


def moving(tick: int, *, noise: float = 1e-3) -> wbc.Measurement:
    """A robot near its rest whose sensors all have noise."""
    rest, random = at_rest(shared_robot(), tick * DT), np.random.default_rng(tick)
    noisy = {
        name: getattr(rest, name) + noise * random.normal(size=getattr(rest, name).shape) for name in SIGNALS
    }
    return replace(rest, **noisy)


@pytest.mark.parametrize("stands_at", [0.02, 0.0, -7.0])
def test_a_stamp_that_stands_while_signals_change_is_named_and_periods_are_counted(stands_at: float) -> None:
    """At the last one, or anywhere else; where it moves on again, it counts again."""
    control = TorqueControl(controller())
    for tick in range(11):
        control.command(moving(tick))
    times = []
    for tick in range(11, 60):
        control.command(replace(moving(tick), time=stands_at))
        assert control.measurement is not None
        times.append(control.measurement.time)
    assert "time stamps stand still" in control.status() and not control.failing and not control.stopped
    np.testing.assert_allclose(np.diff(times[25:]), DT)
    for tick in range(60, 70):
        control.command(replace(moving(tick), time=100.0 + tick * DT))
    assert control.status() == "ok" and control.measurement.time == pytest.approx(100.0 + 69 * DT)


@pytest.mark.parametrize(("rate", "odd"), [(0.5, True), (1.21, True), (1.19, False)])
def test_a_clock_whose_rate_changes_is_named_until_it_runs_as_before(rate: float, odd: bool) -> None:
    """By a fifth, in the mean of 50 steps."""
    stamps, time, said = Stamps(DT, 20, 0.03), 0.0, []
    for tick in range(600):
        time += DT * (rate if 150 <= tick < 400 else 1.0)
        stamps.take(time, first=tick == 0, same=True)
        said.append("the controller is made for" in stamps.pace)
    assert not any(said[:150]) and all(said[300:400]) is odd and any(said[150:400]) is odd
    assert not any(said[500:])


@pytest.mark.parametrize("stamp", [np.float32, np.float64, np.int64, int])
def test_stamps_may_be_numbers_of_any_kind(stamp: type) -> None:
    control = TorqueControl(controller())
    for tick in range(5):
        control.command(replace(moving(tick), time=stamp(0) if "int" in stamp.__name__ else stamp(tick * DT)))
    assert not control.failures and control.measurement is not None
    assert type(control.measurement.time) is float


@pytest.mark.parametrize("stamp", [True, np.True_, "0.5", None, 1j, [0.0], 10**400, NAN, np.float32(INF)])
def test_what_is_no_number_is_no_stamp(stamp: object) -> None:
    control = TorqueControl(controller())
    control.command(moving(0))
    control.command(replace(moving(1), time=stamp))  # type: ignore[arg-type]
    assert control.failures == 1 and "must be a finite number, got " in control.reason


@pytest.mark.parametrize("bad", [[NAN] * 6, [INF] * 6, [0.0] * 5, 5.0])
def test_wrenches_that_are_none_fail_the_tick_which_holds_the_last_torques(bad: object) -> None:
    control = TorqueControl(controller())
    for tick in range(3):
        last = control.command(moving(tick))
    failed = control.act(control.estimate(moving(3)), {"left_foot": np.array(bad)})
    assert control.failures == 1 and "wrench" in control.reason
    still = replace(moving(3), joint_velocity=np.zeros(shared_robot().na))
    assert np.abs(last.joint_torque).max() > 5.0  # the damping of a failed tick is small
    np.testing.assert_allclose(failed.joint_torque, last.joint_torque, atol=1.0)
    assert control.command(still).joint_torque is not None and control.failures == 1


@pytest.mark.parametrize("part", ["joint_torque", "joint_velocity"])
def test_a_law_that_returns_no_numbers_fails_the_tick_which_holds_the_last_command(part: str) -> None:
    control, na = TorqueControl(controller()), shared_robot().na
    rest = shared_robot().half_sitting[7:].copy()

    def law(_: object) -> wbc.Command:
        parts = {"joint_torque": np.ones(na), "joint_position": rest, "joint_velocity": np.zeros(na)}
        if control.time > 2.5 * DT:
            parts[part] = np.full(na, NAN)
        return wbc.Command(**parts)

    for tick in range(3):
        command = control.relay(control.estimate(moving(tick)), law)
    assert control.failures == 1 and "finite" in control.reason
    np.testing.assert_array_equal(command.joint_torque, np.ones(na))


@pytest.mark.parametrize("kind", ["rounded", "exact rest"])
def test_a_robot_at_rest_may_repeat_its_measurements(kind: str) -> None:
    """Rounded readings of a motion that decays, and physics that put a robot to sleep."""
    plausibility, rest = Plausibility(shared_robot(), DT), at_rest(shared_robot(), 0.0)
    for tick in range(400):
        decay = np.exp(-0.04 * tick) if kind == "rounded" or tick < 60 else 0.0
        parts = {"joint_position": 0.05 * decay, "joint_velocity": decay, "angular_velocity": 0.1 * decay}
        step = 1e-3 if kind == "rounded" else 0.0
        shape = np.sin(np.arange(1.0, shared_robot().na + 1.0))
        moved = {
            name: getattr(rest, name) + size * shape[: getattr(rest, name).size]
            for name, size in parts.items()
        }
        rounded = {name: np.round(value / step) * step if step else value for name, value in moved.items()}
        plausibility.check(replace(rest, time=tick * DT, **rounded))
        assert not plausibility.faults


def test_measurements_that_all_changed_and_stand_at_once_are_frozen() -> None:
    control = TorqueControl(controller())
    for tick in range(60):
        control.command(replace(moving(min(tick, 10)), time=tick * DT))
        assert control.failing is (tick >= 30)
    assert "the same measurement" in control.status()


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["left_knee_joint", "left_elbow_joint"])
def test_a_robot_stands_on_an_encoder_that_jumps_within_its_range_and_names_it(joint: str) -> None:
    """It is used once its joint could have come there; a tick that went on without it would stop the robot."""
    plant = wbc.Plant("g1", control_period=0.004, noise="realistic", seed=1, visuals=False)
    walking = WalkingControl(plant.description.robot(), None, 0.004, WalkingControlSettings(mode="torque"))
    walking.drives.watch()
    off, said = np.zeros(plant.robot.na), set()
    while plant.time < 1.5:
        off[plant.robot.joint_index(joint)] = 0.3 if plant.time > 0.5 else 0.0
        m = plant.measure()
        plant.step(walking.command(replace(m, joint_position=m.joint_position + off)))
        said.add(walking.status())
    assert walking.drives.failures == 0 and not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    assert any(f"{joint} contradicts" in status for status in said)
