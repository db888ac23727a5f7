"""The DCM bias estimator on a pendulum in closed loop, and against a textbook Kalman filter."""

from __future__ import annotations

import numpy as np

from wbc.tasks.stabilizer.bias import DCM_STD, INITIAL_STD, ZMP_STD, BiasEstimator, BiasSettings

OMEGA = 3.4


def closed_loop(
    settings: BiasSettings, bias: np.ndarray, *, seconds: float, dt: float = 0.005, yaw: float = 0.0
) -> np.ndarray:
    """Stand with DCM feedback on a measured DCM that is off by a bias fixed to the robot; return the local biases."""
    estimator, dcm = BiasEstimator(settings), np.zeros(2)
    result = []
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s], [s, c]])
    for _ in range(round(seconds / dt)):
        measured = dcm + rotation @ bias
        zmp = 2.5 * measured
        estimator.update(measured, zmp, yaw, OMEGA, dt)
        result.append(estimator.bias @ rotation)
        dcm = zmp + np.exp(OMEGA * dt) * (dcm - zmp)
    return np.array(result)


def time_to(history: np.ndarray, target: float, dt: float = 0.005) -> float:
    return float(np.argmax(history >= target)) * dt


def test_a_constant_bias_is_found_to_90_percent_within_1_5_s_with_the_defaults() -> None:
    history = closed_loop(BiasSettings(), np.array([0.01, -0.01]), seconds=4.0)
    assert 0.2 < time_to(history[:, 0], 0.009) < 1.5
    assert 0.2 < time_to(-history[:, 1], 0.009) < 1.5
    np.testing.assert_allclose(history[-1], [0.01, -0.01], atol=5e-4)


def test_it_never_believes_more_than_its_limit_and_recovers_at_once() -> None:
    settings = BiasSettings(limit=(0.02, 0.01))
    yaw = 0.7
    history = closed_loop(settings, np.array([0.05, -0.05]), seconds=4.0, yaw=yaw)
    assert np.abs(history[:, 0]).max() <= 0.02 + 1e-12 and np.abs(history[:, 1]).max() <= 0.01 + 1e-12
    np.testing.assert_allclose(history[-1], [0.02, -0.01], atol=1e-9)


def test_the_limit_moves_what_it_cuts_off_the_bias_to_the_dcm() -> None:
    """Both together explain the measurement as well as without a limit."""
    bounded, free = (BiasEstimator(BiasSettings(limit=(limit, limit))) for limit in (0.004, np.inf))
    for _ in range(200):
        for estimator in (bounded, free):
            estimator.update(np.array([0.01, -0.02]), np.array([0.012, -0.025]), 0.0, OMEGA, 0.005)
        if np.abs(free.bias).max() > 0.004:
            break
        np.testing.assert_allclose(bounded.bias, free.bias, atol=1e-12)
    assert np.abs(bounded.bias - free.bias).max() > 1e-6
    np.testing.assert_allclose(bounded.dcm + bounded.bias, free.dcm + free.bias, atol=1e-12)


def test_every_step_is_the_textbooks_kalman_filter() -> None:
    """With full matrices, a robot that turns, and noises that are given for samples of 5 ms, here of 20 ms."""
    settings, dt, rng = BiasSettings(drift_std=1.0, limit=(np.inf, np.inf)), 0.02, np.random.default_rng(4)
    estimator, scale, two = BiasEstimator(settings), 0.005 / dt, np.eye(2)
    grow = np.exp(OMEGA * dt)
    R, H = scale * DCM_STD**2 * two, np.hstack([two, two])
    Q = scale * np.diag([((grow - 1.0) * ZMP_STD) ** 2] * 2 + [(settings.drift_std * dt) ** 2] * 2)
    x = P = zmp = yaw = None
    for _ in range(20):
        measured, before, heading = rng.normal(scale=0.2, size=2), zmp, rng.uniform(-3.0, 3.0)
        zmp = rng.normal(scale=0.1, size=2)
        found = estimator.update(measured, zmp, heading, OMEGA, dt)
        if x is None:
            x, P0 = np.array([*measured, 0.0, 0.0]), INITIAL_STD**2 * two
            P = np.block([[P0 + R, -P0], [-P0, P0]])
        else:
            c, s = np.cos(heading - yaw), np.sin(heading - yaw)
            F = np.block([[grow * two, 0.0 * two], [0.0 * two, np.array([[c, -s], [s, c]])]])
            x = F @ x + np.concatenate([(1.0 - grow) * before, np.zeros(2)])
            P = F @ P @ F.T + Q
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ (measured - H @ x), (np.eye(4) - K @ H) @ P
        np.testing.assert_allclose(np.concatenate([estimator.dcm, found]), x, atol=1e-9)
        yaw = heading


def test_a_pause_keeps_the_bias_wherever_the_dcm_goes_meanwhile_and_however_the_robot_turns() -> None:
    estimator, bias, zmp = BiasEstimator(BiasSettings(drift_std=0.002)), np.array([0.01, -0.006]), np.zeros(2)
    for _ in range(2000):  # the DCM rests over the ZMP
        estimator.update(bias, zmp, 0.0, OMEGA, 0.005)
    known = estimator.bias
    np.testing.assert_allclose(known, bias, atol=1e-3)
    estimator.pause()
    there, quarter = np.array([0.2, -0.1]), np.array([[0.0, -1.0], [1.0, 0.0]])
    for _ in range(20):
        found = estimator.update(there + quarter @ bias, there, 0.5 * np.pi, OMEGA, 0.005)
        np.testing.assert_allclose(found, quarter @ known, atol=2e-4)
    np.testing.assert_allclose(estimator.dcm, there, atol=1e-3)
