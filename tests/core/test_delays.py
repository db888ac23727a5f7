"""Delays that are stated are predicted over, and feet without force sensors are felt through the joints' torques."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from task_factory import standing

from wbc import Command, CoMTask, walk
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.observer import DelayPredictor, Observer, ObserverSettings
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.robots import load
from wbc.sim import WalkSpec
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.simulation.machine import Machine

DT = 0.002
G1 = load("g1")
SOFT = ("*=40,1", "*hip*=60,1", "*knee*=100,2")


@pytest.mark.parametrize("delay", [0.002, 0.005, 0.008])
def test_a_state_is_carried_ahead_over_the_commands_that_act_meanwhile(delay: float) -> None:
    """Exact for constant accelerations between commands; older commands do not count."""
    model, rng = G1.robot().model, np.random.default_rng(0)
    predictor = DelayPredictor(model, delay)
    accelerations = rng.normal(size=(10, model.nv))
    for acceleration in accelerations:
        predictor.commanded(acceleration, DT)
    q, v = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)), rng.normal(size=model.nv)
    step, velocity, left = np.zeros(model.nv), v.copy(), delay
    pieces = []
    for acceleration in accelerations[::-1]:
        pieces.append((min(DT, left), acceleration))
        left -= pieces[-1][0]
    for time, acceleration in pieces[::-1]:
        step += time * velocity + 0.5 * time**2 * acceleration
        velocity += time * acceleration
    ahead_q, ahead_v = predictor.ahead(q, v)
    np.testing.assert_allclose(ahead_v, velocity, atol=1e-12)
    np.testing.assert_allclose(ahead_q, pin.integrate(model, q, step), atol=1e-12)
    predictor.reset()
    ahead_q, ahead_v = predictor.ahead(q, v)
    np.testing.assert_allclose(ahead_v, v)
    np.testing.assert_allclose(ahead_q, pin.integrate(model, q, delay * v), atol=1e-12)
    predictor.commanded(accelerations[0], DT)
    acts = min(DT, delay)
    step = delay * v + 0.5 * acts**2 * accelerations[0]  # at the end of the delay
    np.testing.assert_allclose(predictor.ahead(q, v)[0], pin.integrate(model, q, step), atol=1e-12)


@pytest.mark.parametrize("which", ["measurement_delay", "command_delay"])
def test_a_delay_below_rounding_is_none(which: str) -> None:
    robot = G1.robot()
    observers = [Observer(robot.clone(), ObserverSettings(**{which: delay})) for delay in (0.0, 1e-12)]
    for tick in range(3):
        for observer in observers:
            observer.update(at_rest(robot, tick * DT))
            observer.commanded(np.ones(robot.nv), DT)
    np.testing.assert_array_equal(observers[0].robot.v, observers[1].robot.v)


def test_commands_that_no_solution_made_ask_for_no_acceleration() -> None:
    """A robot at rest, whose QP moved the CoM before another law took over, is predicted to stay at rest."""
    controller = standing("g1", DT)
    robot = controller.robot
    observer = Observer(robot, ObserverSettings(command_delay=0.02), adopt=True)
    control = TorqueControl(controller, observer)
    controller.add(CoMTask(weight=100.0)).target = robot.com + [0.03, 0.0, 0.0]
    still = Command(np.zeros(robot.na))
    for tick in range(30):
        control.command(at_rest(robot, tick * DT))
    assert np.abs(observer.robot.v).max() > 1e-3
    for tick in range(30, 60):
        control.relay(control.estimate(at_rest(robot, tick * DT)), lambda _: still)
    assert control.failures == 0 and np.abs(observer.robot.v).max() < 1e-4


@pytest.mark.parametrize("mode", ["position", "torque", "hybrid"])
def test_wrenches_are_estimated_where_there_are_no_sensors(mode: str) -> None:
    """Noisy sensors, 1 kg at the torso that the model lacks; the error is bounded in shares of the weight.

    The torques of stiff servos cannot be computed from an encoder that is off by a milliradian: they are measured.
    """
    stiff = mode == "position"
    machine = Machine(force_sensors=False, torque_sensors=stiff, payload=1.0)
    trial = StandTrial(
        StandSpec(robot="g1", mode=mode, seconds=1.0, noise="realistic", machine=machine), visuals=False
    )  # type: ignore[arg-type]
    weight = 9.80665 * trial.plant.robot.mass
    for _ in range(100):
        trial.step()
    plant, control = trial.plant, trial.control
    assert plant.measure().sole_wrench is None
    used = control.measurement
    assert used is not None and used.wrench_source == ("measured torques" if stiff else "commanded torques")
    error = used.wrenches - plant.truth().sole_wrench
    assert np.abs(error[:, 2]).max() < 0.1 * weight
    assert not trial.fallen and control.failures == 0


@pytest.mark.slow
def test_a_foot_that_lifts_is_in_the_air_and_one_that_lands_on_the_ground() -> None:
    """Contacts are wrong for less than 30 ms at each lift-off and landing, with fewer than four changes a step."""
    from wbc.sim.trial.trial import TrialHook  # noqa: PLC0415 - the simulator is needed here alone
    from wbc.sim.walks.plan import WalkPlan  # noqa: PLC0415
    from wbc.sim.walks.trial import WalkTrial  # noqa: PLC0415

    class Contacts(TrialHook):
        seen: list[tuple[bool, bool]] = []  # noqa: RUF012
        true: list[tuple[bool, bool]] = []  # noqa: RUF012

        def tick(self, tick) -> None:  # type: ignore[no-untyped-def]
            wrenches = tick.control.drives.sensing.wrenches
            self.seen.append(tuple(wrenches.contact))
            self.true.append(tuple(tick.plant.truth().sole_wrench[:, 2] > 5.0))

    contacts = Contacts()
    spec = WalkSpec(
        robot="g1",
        servo=SOFT,
        machine=Machine(force_sensors=False),
        plan=WalkPlan(distance=0.2),
        noise="realistic",
    )
    trial = WalkTrial(spec, visuals=False)
    result = trial.run([contacts])
    assert result.fall is None and spec.chosen == "hybrid"
    seen, true = np.array(contacts.seen), np.array(contacts.true)
    assert (seen != true).sum() * spec.period < 0.03 * 2 * result.steps_done
    assert not seen.all(axis=0).any()
    assert np.abs(np.diff(seen.astype(int), axis=0)).sum() < 4 * result.steps_done


@pytest.mark.slow
@pytest.mark.parametrize("blind", [False, True])
def test_a_g1_on_its_makers_gains_walks_with_delays(blind: bool) -> None:
    machine = Machine(
        measurement_delay=0.002, command_delay=0.002, force_sensors=not blind, payload=1.0 if blind else 0.0
    )
    result = walk(robot="g1", servo=SOFT, machine=machine, distance=0.6)
    assert result.fall is None and result.failures == 0


def test_the_torque_that_acted_is_that_of_the_commands_of_the_period_before() -> None:
    """With a delay of one and a half periods: half of the last command but one, half of the one before that."""
    robot, rng = G1.robot(), np.random.default_rng(0)
    kp, kd, tau, to, rate, own_kp, own_kd, place, pace = rng.uniform(0.1, 1.0, size=(9, robot.na))
    estimator = WrenchEstimator(robot, DT, gains=(kp, kd), delay=1.5 * DT)
    seen = Measurement(0.0, place, pace, np.zeros(3), np.zeros(3), None)
    told = [
        (Command(tau), tau),
        (Command(tau, to), tau + kp * (to - place) - kd * pace),
        (Command(tau, to, rate), tau + kp * (to - place) + kd * (rate - pace)),
        (Command(tau, to, rate, kp=own_kp, kd=own_kd), tau + own_kp * (to - place) + own_kd * (rate - pace)),
        (Command(-200.0 * tau, None, rate), -200.0 * tau),
    ]
    assert estimator.torque(seen) is None
    torques = [np.clip(torque, robot.torque_lower, robot.torque_upper) for _, torque in told]
    for i, (command, _) in enumerate(told):
        estimator.sent(command)
        acted = torques[0] if i < 2 else 0.5 * (torques[i - 1] + torques[i - 2])
        np.testing.assert_allclose(estimator.torque(seen), acted, atol=1e-12)
    assert (torques[-1] != told[-1][1]).any()
    estimator.reset()
    assert estimator.torque(seen) is None


def carried(right: float, rise: float = 0.0) -> tuple[Robot, np.ndarray, np.ndarray]:
    """Return the robot, the normal forces of its soles and the joint torques under which it rises at an acceleration.

    Args:
        right: Share of the weight on the right sole.
        rise: Acceleration upwards, m/s².
    """
    robot = G1.robot()
    model, data, q = robot.model, robot.model.createData(), robot.half_sitting
    effort = pin.rnea(model, data, q, np.zeros(model.nv), np.eye(model.nv)[2] * rise)
    left, other = (
        pin.computeFrameJacobian(model, data, q, robot.frame_id(sole.frame), pin.LOCAL)
        for sole in robot.soles
    )
    there = np.array([0.0, 0.0, right * robot.mass * GRAVITY, 0.0, 0.0, 0.0])
    here = np.linalg.solve(left[:, :6].T, effort[:6] - other[:, :6].T @ there)
    torque = effort[6:] - left[:, 6:].T @ here - other[:, 6:].T @ there
    return robot, np.array([here[2], there[2]]), torque


def test_a_robot_that_rises_is_felt_to_be_heavier() -> None:
    robot, normal, torque = carried(0.5, rise=2.0)
    estimator, v = WrenchEstimator(robot, DT), np.zeros(robot.nv)
    for _ in range(100):
        v[2] += 2.0 * DT
        wrenches = estimator.update(robot.half_sitting, v, torque, np.nan)
    np.testing.assert_allclose(wrenches[:, 2], normal, rtol=0.02)
    assert normal.sum() == pytest.approx(robot.mass * (GRAVITY + 2.0))


def test_the_time_that_has_passed_counts_between_a_quarter_and_four_periods() -> None:
    """One that is off by less than a hundredth of the period is one period."""
    robot, _, before = carried(0.5)
    later = carried(0.2)[2]

    def after(passed: float) -> np.ndarray:
        estimator, v = WrenchEstimator(robot, DT), np.zeros(robot.nv)
        estimator.update(robot.half_sitting, v, before, np.nan)
        return estimator.update(robot.half_sitting, v, later, passed).copy()

    period = after(np.nan)
    for share, counts in ((1.0, 1.0), (1.009, 1.0), (0.991, 1.0), (0.1, 0.25), (9.0, 4.0)):
        np.testing.assert_array_equal(after(share * DT), period if counts == 1.0 else after(counts * DT))
    normal = [after(share * DT)[1, 2] for share in (0.25, 0.9, 1.0, 1.1, 1.5, 4.0)]
    assert (np.diff(normal) < -0.1).all(), "the foot gives up its load with time"


def test_a_foot_meets_the_ground_at_a_greater_force_than_it_leaves_it() -> None:
    found = []
    robot = G1.robot()
    estimator = WrenchEstimator(robot, DT)
    for share in (0.06, 0.0, 0.06, 0.1, 0.06):
        torque = carried(share)[2]
        for _ in range(50):
            estimator.update(robot.half_sitting, np.zeros(robot.nv), torque, np.nan)
        found.append(estimator.contact[1])
    assert found == [True, False, False, True, True] and estimator.contact[0]


@pytest.mark.parametrize("right", [0.0, 0.02, 0.3])
def test_what_holds_a_robot_beside_the_ground_is_what_its_legs_do_not_explain(right: float) -> None:
    """It hangs by its base, and one leg presses on the ground; a foot below the lift-off force is in the air."""
    robot = G1.robot()
    model, data, q, v = robot.model, robot.model.createData(), robot.half_sitting, np.zeros(robot.nv)
    jacobians = [
        pin.computeFrameJacobian(model, data, q, robot.frame_id(sole.frame), pin.LOCAL)
        for sole in robot.soles
    ]
    pressed = np.array([0.0, 0.0, right * robot.mass * GRAVITY, 0.0, 0.0, 0.0])
    effort = pin.computeGeneralizedGravity(model, data, q) - jacobians[1].T @ pressed
    estimator = WrenchEstimator(robot, DT)
    for _ in range(200):
        wrenches = estimator.update(q, v, effort[6:], np.nan, held=True)
    assert estimator.contact == [False, right > 0.04] and not wrenches[0].any()
    np.testing.assert_allclose(
        wrenches[1], pressed if right > 0.04 else 0.0, atol=0.01 * robot.mass * GRAVITY
    )
    whole = estimator.outside + jacobians[1].T @ wrenches[1]
    np.testing.assert_allclose(
        whole, [*(effort + jacobians[1].T @ pressed)[:6], *jacobians[1].T[6:] @ pressed], atol=1e-6
    )
    estimator.reset()
    assert estimator.contact == [True, True] and not estimator.outside.any()
    np.testing.assert_allclose(estimator.wrench, np.outer([0.5, 0.5], [0, 0, robot.mass * GRAVITY, 0, 0, 0]))
