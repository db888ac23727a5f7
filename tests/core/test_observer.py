"""The kinematic–inertial observer against exact motions of a small biped, without a simulator."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from measured_biped import UP, biped, errors, measurements, noisy

from wbc.core.estimation.inertial import InertialFilter
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.robots import load


def close_legs(robot: Robot, q: np.ndarray, feet: dict[str, pin.SE3]) -> np.ndarray:
    """Leg joints that put the soles where they should be, base and chest as they are (Newton)."""
    q = np.array(q)
    for _ in range(20):
        pin.computeJointJacobians(robot.model, robot.data, q)
        pin.updateFramePlacements(robot.model, robot.data)
        worst = 0.0
        for side, target in feet.items():
            cols = [6 + robot.joint_index(n) for n in robot.joint_names if n.startswith(side)]
            frame = robot.frame_id(f"{side}_sole")
            error = pin.log6(robot.data.oMf[frame].actInv(target)).vector
            jacobian = pin.getFrameJacobian(robot.model, robot.data, frame, pin.LOCAL)[:, cols]
            q[np.array(cols) + 1] += np.linalg.solve(jacobian, error)
            worst = max(worst, float(np.abs(error).max()))
        if worst < 1e-12:
            return q
    raise AssertionError("leg kinematics did not converge")


@cache
def sway(dt: float = 0.005, seconds: float = 3.0) -> tuple[list[Measurement], np.ndarray, np.ndarray]:
    """Standing on two feet and swaying: base shifts, turns and dips, weight moves from foot to foot."""
    robot = biped()
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    feet = {s: pin.SE3(robot.placement(f"{s}_sole")) for s in ("left", "right")}
    times = dt * np.arange(round(seconds / dt) + 2)
    qs = np.zeros((len(times), robot.nq))
    q = np.array(robot.half_sitting)
    for k, t in enumerate(times):
        ramp = min(1.0, t) ** 2 * (3 - 2 * min(1.0, t))
        move = ramp * np.array([0.02 * np.sin(2.1 * t), 0.05 * np.sin(2.9 * t), 0.01 * (np.cos(4 * t) - 1)])
        turn = ramp * np.array([0.05 * np.sin(3.1 * t), 0.06 * np.sin(1.7 * t), 0.08 * np.sin(1.3 * t)])
        base = pin.SE3(pin.rpy.rpyToMatrix(*turn), robot.half_sitting[:3] + move)
        q[:7] = pin.SE3ToXYZQUAT(base)
        q[7 + robot.joint_index("chest")] = ramp * 0.1 * np.sin(3.7 * t)
        q = close_legs(robot, q, feet)
        qs[k] = q
    zero = np.zeros((len(times), 2))
    left = 0.5 + 0.4 * np.sin(2.9 * times)
    sensors, vs = measurements(robot, qs, dt, {"left": zero, "right": zero}, left)
    return sensors, qs[1:-1], vs


def test_exact_sensors_give_the_exact_state() -> None:
    """Under a base that turns by more than 0.1 rad/s, whose feet stand."""
    (sensors, qs, vs), observer = sway(), Observer(biped())
    worst = errors(observer, sensors, qs, vs).max(axis=0)
    assert (worst < 5e-5).all()  # what finite differences of the motion leave
    assert np.linalg.norm(sensors[-1].angular_velocity) > 0.1 and np.abs(observer.foot_rotations).max() < 2e-3


@pytest.mark.slow
def test_a_wrong_initial_tilt_and_a_gyro_bias_fade() -> None:
    sensors, qs, vs = sway(dt=0.01, seconds=20.0)
    robot = biped()
    observer = Observer(robot, ObserverSettings())
    q = np.array(qs[0])
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.03, -0.04, 0.0)).coeffs()
    observer.reset(q)
    biased = [replace(s, angular_velocity=s.angular_velocity + [0.004, -0.003, 0.002]) for s in sensors]
    for k, sensor in enumerate(biased):
        estimate = observer.update(sensor)
        if k == 0:
            assert abs(pin.rpy.matrixToRpy(estimate.placement("base").rotation)[1]) > 0.03
    tilt = (estimate.placement("base").rotation.T @ UP) - (
        pin.Quaternion(*qs[-1][[6, 3, 4, 5]]).toRotationMatrix().T @ UP
    )
    # A double pole at 1/(2 · 2 s): (1 + 5) e⁻⁵ = 4 % of the tilt and of the bias are left after 20 s.
    assert np.linalg.norm(tilt) < 0.05 * 0.05
    assert np.abs(observer.inertial.gyro_bias - [0.004, -0.003, 0.002]).max() < 3e-4
    assert np.linalg.norm(estimate.v[:3] - vs[-1, :3]) < 2e-3


def test_the_accelerometer_quiets_the_velocity() -> None:
    sensors, qs, vs = sway()
    noise = noisy(sensors, seed=5)
    defaults = ObserverSettings()
    legs_only = replace(defaults, inertial=replace(defaults.inertial, velocity_time_constant=1e-4))
    fused = errors(Observer(biped(), defaults), noise, qs, vs)[200:, 2]
    legs = errors(Observer(biped(), legs_only), noise, qs, vs)[200:, 2]
    assert np.sqrt((fused**2).mean()) < 0.6 * np.sqrt((legs**2).mean())


def test_moving_the_world_moves_the_estimate_along() -> None:
    sensors, qs, vs = (part[:400] for part in sway())
    place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.5), np.array([100.0, -60.0, 0.0]))
    start, *far = (
        np.concatenate([pin.SE3ToXYZQUAT(place * pin.XYZQUATToSE3(q[:7])), q[7:]])
        for q in (biped().half_sitting, *qs)
    )
    here = errors(Observer(biped()), noisy(sensors, 7), qs, vs)
    observer = Observer(biped())
    observer.reset(start)
    there = errors(observer, noisy(sensors, 7), np.array(far), vs)
    np.testing.assert_allclose(here, there, atol=1e-6)


def test_a_foot_that_steps_ahead_carries_from_where_it_lands() -> None:
    """The right foot goes 0.1 m ahead without load and is loaded 20 ms after it has landed: the base stays."""
    robot, dt = biped(), 0.005
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    feet = {s: pin.SE3(robot.placement(f"{s}_sole")) for s in ("left", "right")}
    times = dt * np.arange(102)
    qs = np.zeros((len(times), robot.nq))
    for k, t in enumerate(times):
        share = min(1.0, t / 0.3)
        ahead = np.array([0.1 * share**2 * (3 - 2 * share), 0.0, 0.0])
        there = pin.SE3(feet["right"].rotation, feet["right"].translation + ahead)
        qs[k] = close_legs(robot, robot.half_sitting, {"left": feet["left"], "right": there})
    cop = np.zeros((len(times), 2))
    left = np.where(times < 0.32, 1.0, 0.4)
    sensors, vs = measurements(robot, qs, dt, {"left": cop, "right": cop}, left)
    assert errors(Observer(biped()), sensors, qs[1:-1], vs)[:, 0].max() < 5e-4


def test_loaded_feet_are_drawn_to_the_controllers_soles() -> None:
    sensors, _, _ = sway()
    robot = biped()
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    shift = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.05), np.array([0.03, -0.02, 0.01]))
    targets = [shift * pin.SE3(robot.placement(s.frame)) for s in robot.soles]
    observer = Observer(robot)
    for sensor in sensors:
        estimate = observer.update(sensor, soles=targets)
    for sole, target in zip(robot.soles, targets, strict=True):
        np.testing.assert_allclose(estimate.placement(sole.frame).translation, target.translation, atol=1e-3)
        # The gyro bias, integral of the correction, makes the heading overshoot by a tenth for a while.
        turned = estimate.placement(sole.frame).rotation.T @ target.rotation
        assert np.abs(pin.log3(turned)).max() < 0.005


def test_net_wrench_is_the_weight_and_flight_is_noticed() -> None:
    sensors, _, _ = sway(seconds=2.0)
    robot = biped()
    observer = Observer(robot)
    estimate = observer.update(sensors[0])
    np.testing.assert_allclose(observer.net_wrench[2], robot.mass * GRAVITY, rtol=1e-6)
    assert any(observer.rest.shares) and sum(observer.rest.shares) == pytest.approx(1.0)
    height = estimate.q[2]
    falling = replace(sensors[0], sole_wrench=np.zeros((2, 6)), specific_force=np.zeros(3))
    for k in range(1, 41):
        estimate = observer.update(replace(falling, time=sensors[0].time + 0.005 * k))
    assert not any(observer.rest.shares)
    # The load's low-pass and the velocity's drag cost a little of g t²/2 = 0.196 m.
    assert 0.10 < height - estimate.q[2] < 0.197
    observer.update(replace(sensors[0], time=sensors[0].time + 1.0))
    assert observer.net_wrench[2] > 0.0
    observer.reset()
    assert not observer.net_wrench.any()


@pytest.mark.parametrize("lost", [1.0])
def test_a_velocity_that_was_lost_comes_back_from_the_feet(lost: float) -> None:
    """Feet that seem to move faster than `slip` are no reference at first, but in the end they are right."""
    sensors, _, _ = sway(seconds=2.0)
    observer = Observer(biped())
    for sensor in sensors[:40]:
        observer.update(sensor)
    observer.inertial.velocity = observer.inertial.velocity + np.array([lost, 0.0, 0.0])
    off = []
    for sensor, expected in zip(sensors[40:], undisturbed(sensors)[40:], strict=True):
        observer.update(sensor)
        off.append(float(np.linalg.norm(observer.inertial.velocity - expected)))
    dt = sensors[1].time - sensors[0].time
    assert off[0] > 0.9 * lost, "a foot may be hit: nothing is believed at once"
    assert off[round((lost / 3.0 + 0.02) / dt)] < 0.1 * lost


@pytest.mark.parametrize("lost", [2.0])
def test_a_velocity_that_an_impact_has_taken_is_that_of_the_feet_at_once(lost: float) -> None:
    """An impact between two samples of the accelerometer: loaded feet that seem to sink are at rest on the ground."""
    sensors, _, _ = sway(seconds=2.0)
    observer = Observer(biped())
    for sensor in sensors[:40]:
        observer.update(sensor)
    observer.inertial.velocity = observer.inertial.velocity - np.array([0.3 * lost, 0.0, lost])
    height, off = observer.robot.q[2], []
    for sensor, expected in zip(sensors[40:], undisturbed(sensors)[40:], strict=True):
        observer.update(sensor)
        off.append(float(np.linalg.norm(observer.inertial.velocity - expected)))
    dt = sensors[1].time - sensors[0].time
    after = round(0.05 / dt)
    assert off[after] < 0.1 * lost and abs(observer.robot.q[2] - height) < 0.1 * lost


def test_a_foot_that_lands_on_an_edge_does_not_hand_the_estimate_to_the_other_one() -> None:
    """It seems to sink for 20 ms, while a foot that has just been unloaded swings fast."""
    robot, dt = biped().clone(), 0.002
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    weight, observer = robot.mass * GRAVITY, Observer(robot)
    observer.reset(robot.half_sitting)
    q, soles = np.array(robot.half_sitting), [robot.frame_id(sole.frame) for sole in robot.soles]
    still = np.array(robot.placement("imu").rotation.T @ [0.0, 0.0, GRAVITY])
    swing = np.array([[0.0, 0.0, -0.5, 0.0, 0.0, 0.0], [0.6, 0.0, 0.2, 0.0, 0.0, 0.0]]).reshape(-1)
    for tick in range(200):
        lands = 100 <= tick < 110
        pin.computeJointJacobians(robot.model, robot.data, q)
        pin.updateFramePlacements(robot.model, robot.data)
        jacobians = [pin.getFrameJacobian(robot.model, robot.data, f, pin.LOCAL_WORLD_ALIGNED) for f in soles]
        rates = np.linalg.pinv(np.vstack(jacobians)[:, 6:]) @ (swing if lands else np.zeros(12))
        wrench = np.zeros((2, 6))
        wrench[:, 2] = (0.5 * weight, 0.5 * weight) if tick < 100 else (weight, 0.0)
        q[7:] += rates * dt
        observer.update(Measurement(dt * tick, q[7:].copy(), rates, np.zeros(3), still, wrench))
        assert np.linalg.norm(observer.robot.v[:3]) < 0.05


def test_the_velocity_of_a_robot_that_bounces_on_springs_is_exact_once_their_compliance_is_known() -> None:
    """Feet on springs sink at up to 0.6 m/s: one that knows their compliance does not take them for fixed."""
    robot, dt, depth = biped(), 0.002, 0.04  # m, at rest
    rate, mass = float(np.sqrt(GRAVITY / depth)), robot.mass
    times = dt * np.arange(602)
    sunk = depth * (1.0 - np.cos(rate * times))  # let go from where the springs bear nothing
    qs = np.tile(robot.half_sitting, (len(times), 1))
    qs[:, 2] -= sunk
    zero = np.zeros((len(times), 2))
    sensors, vs = measurements(robot, qs, dt, {"left": zero, "right": zero}, np.full(len(times), 0.5))
    loads = 0.5 * mass * GRAVITY * sunk / depth
    for k, sensor in enumerate(sensors):
        sensor.wrenches[:, 2] = loads[k + 1]
    worst = []
    for compliance in (0.0, depth / (0.5 * mass * GRAVITY)):
        observer = Observer(robot, ObserverSettings(load_time_constant=0.0))
        observer.sinking.compliance = observer.sinking.steady = compliance
        off = errors(observer, sensors, qs[1:-1], vs)
        worst.append(off.max(axis=0))
    assert np.abs(vs[:, 2]).max() > 0.6, "m/s"
    assert worst[0][2] > 0.3, "feet that are taken for fixed"
    late = 1.5 * GRAVITY * dt  # m/s: the rate of a load is that of the middle of the last period
    assert worst[1][0] < 2e-3 and worst[1][2] < late


def test_a_centre_of_pressure_that_moves_over_a_sloping_sole_is_no_ground_that_gives() -> None:
    """The load goes to a foot on a slope while its centre of pressure comes down by 12 mm, and nothing moves."""
    robot, dt = biped(), 0.005
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    feet = {s: pin.SE3(robot.placement(f"{s}_sole")) for s in ("left", "right")}
    feet["left"].rotation = pin.rpy.rpyToMatrix(0.0, 0.15, 0.0) @ feet["left"].rotation
    q, times = close_legs(robot, robot.half_sitting, feet), dt * np.arange(202)
    left = 0.5 - 0.45 * np.cos(np.pi * times)
    cops = {"left": np.column_stack([0.04 * (2.0 * left - 1.0), 0.0 * left]), "right": np.zeros((202, 2))}
    sensors, _ = measurements(robot, np.tile(q, (202, 1)), dt, cops, left)
    observer = Observer(robot)
    observer.reset(q)
    for sensor in sensors:
        observer.update(sensor)
    sensors[-1].wrenches[0, 2] = 0.0  # it lifts off: a change of the load has ended
    observer.update(replace(sensors[-1], time=sensors[-1].time + dt))
    assert observer.sinking.compliance == 0.0


def undisturbed(sensors: list[Measurement]) -> list[np.ndarray]:
    """Velocity of the inertial filter after each measurement."""
    observer, found = Observer(biped()), []
    for sensor in sensors:
        observer.update(sensor)
        found.append(np.array(observer.inertial.velocity))
    return found


def test_wrenches_from_torques_count_springs_and_damping_of_the_robot() -> None:
    """Torques that hold a robot still show the wrenches on its soles; with springs and damping they are greater."""
    description = load("hrp4_class")
    robot = description.robot()
    wrenches = np.array([[10.0, -5.0, 250.0, 1.0, 2.0, 0.5], [-10.0, 5.0, 0.0, -1.0, 1.0, 0.0]])
    wrenches[1, 2] = robot.mass * GRAVITY - 250.0
    torque = np.array(robot.bias[6:])
    for sole, wrench in zip(robot.soles, wrenches, strict=True):
        jacobian = pin.computeFrameJacobian(
            robot.model, robot.model.createData(), robot.q, robot.frame_id(sole.frame), pin.LOCAL
        )
        torque -= jacobian[:, 6:].T @ wrench
    knee, hip = (robot.joint_index(name) for name in ("left_knee_pitch", "right_hip_roll"))
    passive = replace(
        description,
        springs={"left_knee_pitch": (100.0, 0.0), "right_hip_roll": (60.0, -0.4)},
        damping={"left_knee_pitch": 30.0, "right_hip_roll": 20.0},
    )
    plain, sprung = WrenchEstimator(robot, 0.005), WrenchEstimator(passive.robot(), 0.005)
    v = np.zeros(robot.nv)
    for tick in range(400):
        v[6 + knee], v[6 + hip] = 0.2 * np.sin(0.1 * tick), 0.1 * np.cos(0.1 * tick)
        q = pin.integrate(robot.model, robot.q, np.sin(0.05 * tick) * v)
        more = np.zeros(robot.na)
        more[knee] = 100.0 * q[7 + knee] + 30.0 * v[6 + knee]
        more[hip] = 60.0 * (q[7 + hip] + 0.4) + 20.0 * v[6 + hip]
        np.testing.assert_allclose(
            sprung.update(q, v, torque + more, np.nan),
            plain.update(q, v, torque, np.nan),
            rtol=1e-6,
            atol=1e-6,
        )
    plain.reset()
    for _ in range(400):
        found = plain.update(robot.q, np.zeros(robot.nv), torque, np.nan)
    np.testing.assert_allclose(found[:, 2], wrenches[:, 2], rtol=0.1)
    assert plain.contact == [True, True]


def test_what_legs_do_and_the_accelerometer_does_not_show_is_unexplained() -> None:
    """Change of the legs' velocity less the integral of the specific force, by trapezes."""
    rng, dt, inertial = np.random.default_rng(6), 0.004, InertialFilter()
    legs = force = None
    for _ in range(30):
        before, last = legs, force
        legs, force = rng.normal(size=3), GRAVITY * UP + rng.normal(size=3)
        upright = np.array(inertial.rotation)
        inertial.predict(np.zeros(3), force, dt)
        inertial.gyro_bias[:] = 0.0
        shown = None if last is None else dt * (upright @ (0.5 * (force + last)) - GRAVITY * UP)
        inertial.correct(legs, 0.0, dt)
        if before is not None and shown is not None:
            change = legs - before - shown
            assert inertial.correction.unexplained == pytest.approx(complex(change[0], change[1]), abs=1e-3)
    inertial.correct(None, 0.0, dt)
    assert inertial.correction.unexplained == 0j and inertial.correction.legs is None


def test_a_filter_that_is_reset_has_turned_by_nothing() -> None:
    inertial, still = InertialFilter(), np.zeros(3)

    def tick(yaw_error: float, dt: float) -> None:
        inertial.predict(still, GRAVITY * UP, dt)
        inertial.correct(still, yaw_error, dt)

    for _ in range(5):
        tick(0.2, 0.005)
    assert inertial.correction.turned != 0.0
    inertial.reset(np.eye(3))
    assert inertial.correction.turned == 0.0
    tick(0.0, 0.0)  # in no time the gyro bias, which is kept, turns nothing
    assert inertial.correction.turned == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.7, 0.3, 0.6), (-0.3, -0.6, 0.6)])
def test_a_leg_that_is_hit_does_not_move_the_estimate_though_its_force_looks_like_ground(
    direction: tuple[float, float, float],
) -> None:
    """Its foot moves by the gyroscope and the accelerometer, which a foot that carries does not."""
    robot, dt = biped(), 0.002
    frame = robot.frame_id("left_sole")
    columns = [6 + robot.joint_index(n) for n in robot.joint_names if n.startswith("left")]
    wrench = np.array([[0.0, 0.0, robot.mass * GRAVITY, 0.0, 0.0, 0.0], np.zeros(6)])
    observer = Observer(robot)
    observer.reset(robot.half_sitting)
    q, start = np.array(robot.half_sitting), np.array(robot.half_sitting[:3])
    still = np.array(robot.placement("imu").rotation.T @ [0.0, 0.0, GRAVITY])
    for tick in range(75):  # the leg stands for 0.1 s, then its foot is thrown off at 10 g for 40 ms
        speed = max(tick - 50, 0) * dt * 10.0 * GRAVITY * min(1.0, 20.0 / max(tick - 50, 1))
        pin.computeJointJacobians(robot.model, robot.data, q)
        pin.updateFramePlacements(robot.model, robot.data)
        jacobian = pin.getFrameJacobian(robot.model, robot.data, frame, pin.LOCAL_WORLD_ALIGNED)[:, columns]
        rates = np.zeros(robot.na)
        rates[np.array(columns) - 6] = np.linalg.solve(jacobian, speed * np.array([*direction, 0, 0, 0]))
        q[7:] += rates * dt
        observer.update(Measurement(dt * tick, q[7:].copy(), rates, np.zeros(3), still, wrench))
        if tick > 60:
            assert observer.rest.lifts[0] and not observer.rest.lifts[1]
    np.testing.assert_allclose(observer.robot.q[:3], start, atol=0.02)
    assert np.linalg.norm(observer.robot.v[:3]) < 0.2


@pytest.mark.parametrize(
    ("left", "right", "share"), [(0.0, 0.0, 1.0), (0.9, 2.4, 1.0), (2.4, 0.3, 0.5), (3.0, 0.0, 0.5)]
)
def test_feet_that_slip_do_not_take_the_estimate_along(left: float, right: float, share: float) -> None:
    """Feet slip by 0.2 m under a robot that stays where it is; then they rest, and are references again.

    The estimate follows them only while they are slower than its thresholds, at the begin and at the end.
    """
    robot, dt, rise = biped(), 0.002, 2.0  # m/s²
    wrench = np.zeros((2, 6))
    wrench[:, 2] = np.array([share, 1.0 - share]) * robot.mass * GRAVITY
    observer = Observer(robot)
    observer.reset(robot.half_sitting)
    q, start = np.array(robot.half_sitting), np.array(robot.half_sitting[:3])
    still = np.array(robot.placement("imu").rotation.T @ [0.0, 0.0, GRAVITY])
    ways = np.array([[np.cos(angle), np.sin(angle), 0.0, 0.0, 0.0, 0.0] for angle in (left, right)])
    speed, slid, named = 0.0, 0.0, []
    for tick in range(500):
        time = tick * dt
        speed = max(speed + dt * rise * ((0.2 <= time < 0.52) - (0.52 <= time < 0.84)), 0.0)
        slid += dt * speed
        pin.computeJointJacobians(robot.model, robot.data, q)
        pin.updateFramePlacements(robot.model, robot.data)
        frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        jacobians = [
            pin.getFrameJacobian(robot.model, robot.data, f, pin.LOCAL_WORLD_ALIGNED) for f in frames
        ]
        rates = np.linalg.pinv(np.vstack(jacobians)[:, 6:]) @ (speed * ways.reshape(-1))
        q[7:] += rates * dt
        observer.update(Measurement(time, q[7:].copy(), rates, np.zeros(3), still, wrench))
        named += [time] if any(observer.rest.slides) else []
    assert slid > 0.18 and 0.25 < named[0] < 0.35 and named[-1] < 0.95
    assert np.linalg.norm(observer.robot.q[:3] - start) < 0.2 * slid
    assert sum(observer.rest.shares) == pytest.approx(1.0) and not any(observer.rest.slides)


def test_feet_that_rest_beside_each_other_do_not_slip_though_the_accelerometer_errs() -> None:
    """By 6 m/s² for 50 ms: its velocity is soon that of the feet again."""
    robot, dt = biped(), 0.002
    wrench = np.zeros((2, 6))
    wrench[:, 2] = 0.5 * robot.mass * GRAVITY
    observer, q = Observer(robot), robot.half_sitting
    observer.reset(q)
    turned = robot.placement("imu").rotation.T
    for tick in range(250):
        force = [6.0 if 100 <= tick < 125 else 0.0, 0.0, GRAVITY]
        still = np.zeros(robot.na)
        observer.update(Measurement(dt * tick, q[7:], still, np.zeros(3), np.array(turned @ force), wrench))
        assert not any(observer.rest.slides)
    assert np.linalg.norm(observer.robot.v[:3]) < 0.02


def test_a_foot_that_lifts_has_no_wrench_and_the_other_one_carries() -> None:
    robot = load("hrp4_class").robot()
    estimator = WrenchEstimator(robot, 0.005)
    torque = np.array(robot.bias[6:])
    weight = robot.mass * GRAVITY
    for sole in robot.soles:
        frame = robot.frame_id(sole.frame)
        jacobian = pin.computeFrameJacobian(robot.model, robot.model.createData(), robot.q, frame, pin.LOCAL)
        torque -= jacobian[:, 6:].T @ [0.0, 0.0, 0.5 * weight, 0.0, 0.0, 0.0]
    for _ in range(100):
        found = estimator.update(robot.q, np.zeros(robot.nv), torque, np.nan, lifts=(True, False))
    assert estimator.contact == [False, True] and not found[0].any() and found[1, 2] > 0.4 * weight
