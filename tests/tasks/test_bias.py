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


def test_one_step_is_the_kalman_filters() -> None:
    settings = BiasSettings(limit=(np.inf, np.inf))
    estimator = BiasEstimator(settings)
    dt, z0 = 0.005, np.array([0.02, 0.01])
    estimator.update(np.array([0.1, 0.2]), z0, 0.3, OMEGA, dt)
    estimator.update(np.array([0.11, 0.19]), np.zeros(2), 0.4, OMEGA, dt)
    # Textbook form with full matrices.
    R, P0 = DCM_STD**2 * np.eye(2), INITIAL_STD**2 * np.eye(2)
    P = np.block([[P0 + R, -P0], [-P0, P0]])
    c, s = np.cos(0.1), np.sin(0.1)
    a = np.exp(OMEGA * dt)
    F = np.block([[a * np.eye(2), np.zeros((2, 2))], [np.zeros((2, 2)), np.array([[c, -s], [s, c]])]])
    x = F @ np.array([0.1, 0.2, 0.0, 0.0]) + np.concatenate([(1 - a) * z0, np.zeros(2)])
    Q = np.diag([((a - 1) * ZMP_STD) ** 2] * 2 + [(settings.drift_std * dt) ** 2] * 2)
    P = F @ P @ F.T + Q
    H = np.hstack([np.eye(2), np.eye(2)])
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    x = x + K @ (np.array([0.11, 0.19]) - H @ x)
    np.testing.assert_allclose(np.concatenate([estimator.dcm, estimator.bias]), x, atol=1e-12)


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
