"""Estimator of a constant bias between the measured DCM and the one that the ZMP drives.

A CoM that the model puts in the wrong place shows as a DCM that does not run away from the ZMP as it should. A
Kalman filter tells the two apart: state [ξ; b], both horizontal, with b constant in the yaw frame of the robot,

    ξ' = (1 + ω dt) ξ − ω dt z,   b' = ΔR b,   measured = ξ + b,

process noise ((ω dt σ_zmp)² on ξ, (σ_drift dt)² on b) and measurement noise σ_dcm². Everything is absolute
and in the world: measured = true + b, so that the controller's DCM error is target − (measured − b). The noise
levels are those of samples at 200 Hz; at another rate their variances are scaled so that the same time of
measuring tells the same, whatever the control period.

Source: the LIPM-DCM estimator of jrl-umi3218/state-observation; unlike there all settings are live and the
clamp is applied in the yaw frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wbc.core.errors import Array, non_negative, positive, two_of


@dataclass(frozen=True)
class BiasSettings:
    """Noise levels and limits. Defaults are mc_rtc's, which find 90 % of a bias within about 1.3 s.

    Attributes:
        dcm_std: Measured DCM, m.
        zmp_std: ZMP that drives the pendulum, m.
        drift_std: Bias, m/s.
        initial_std: Bias after a reset, m.
        limit: Greatest bias believed, forward and sideways, m; infinity for none.
    """

    dcm_std: float = 0.01
    zmp_std: float = 0.05
    drift_std: float = 0.02
    initial_std: float = 0.01
    limit: tuple[float, float] = (0.02, 0.02)

    def __post_init__(self) -> None:
        positive("dcm_std (m)", self.dcm_std)
        for name in ("zmp_std (m)", "drift_std (m/s)", "initial_std (m)"):
            non_negative(name, getattr(self, name.split()[0]))
        two_of("limit of the DCM bias (m)", self.limit)
        for axis, value in zip(("forward", "sideways"), self.limit, strict=True):
            if not value >= 0.0:
                non_negative(f"{axis} limit of the DCM bias (m)", value)


REFERENCE_PERIOD = 0.005
"""Period of the samples whose noise the settings give, s."""


class BiasEstimator:
    """Four-state Kalman filter.

    Attributes:
        settings: Noise levels and limits.
    """

    def __init__(self, settings: BiasSettings | None = None) -> None:
        self.settings = settings or BiasSettings()
        self._state = np.zeros(4)
        self._covariance: Array = np.zeros((4, 4))
        self._zmp = np.zeros(2)
        self._yaw = 0.0
        self._fresh = True

    @property
    def dcm(self) -> Array:
        """True DCM, in the world, shape (2,), m."""
        return self._state[:2].copy()

    @property
    def bias(self) -> Array:
        """What the measured DCM has too much, in the world, shape (2,), m."""
        return self._state[2:].copy()

    @property
    def local_bias(self) -> Array:
        """The bias in the yaw frame of the robot, forward and sideways, shape (2,), m."""
        return _rotation(self._yaw).T @ self._state[2:]

    def reset(self) -> None:
        """Forget DCM and bias; the next update starts from its measurement and a bias of zero."""
        self._state = np.zeros(4)
        self._fresh = True

    def update(self, dcm: Array, zmp: Array, yaw: float, omega: float, dt: float) -> Array:
        """Take in one measurement.

        Args:
            dcm: Measured DCM in the world, shape (2,) or longer, m.
            zmp: Measured ZMP in the world, shape (2,) or longer, m.
            yaw: Heading of the robot, rad.
            omega: Natural frequency, 1/s.
            dt: Time since the last update, s, above zero.

        Returns:
            The bias in the world, shape (2,), m.
        """
        s = self.settings
        noise = s.dcm_std**2 * (REFERENCE_PERIOD / dt)
        if self._fresh:
            known = s.initial_std**2
            self._state = np.array([dcm[0], dcm[1], 0.0, 0.0])
            self._covariance[:] = np.kron([[known + noise, -known], [-known, known]], np.eye(2))
            self._fresh = False
        else:
            self._predict(_rotation(yaw - self._yaw), omega, dt)
            # Both axes are measured alike: gain = P Hᵀ (H P Hᵀ + R)⁻¹ with H = [I I].
            cross = self._covariance[:, :2] + self._covariance[:, 2:]
            innovation_covariance = cross[:2] + cross[2:] + noise * np.eye(2)
            gain = np.linalg.solve(innovation_covariance, cross.T).T
            self._state += gain @ (np.asarray(dcm[:2]) - self._state[:2] - self._state[2:])
            covariance: Array = self._covariance - gain @ cross.T
            self._covariance = 0.5 * (covariance + covariance.T)
        self._yaw = yaw
        self._zmp[:] = zmp[:2]
        self._clamp()
        return self.bias

    def _predict(self, turn: Array, omega: float, dt: float) -> None:
        s = self.settings
        grow = math.expm1(omega * dt)  # exact over a held ZMP; ω dt to first order
        transition = np.zeros((4, 4))
        transition[:2, :2] = (1.0 + grow) * np.eye(2)
        transition[2:, 2:] = turn
        self._state = transition @ self._state
        self._state[:2] -= grow * self._zmp
        self._covariance = transition @ self._covariance @ transition.T
        scale = REFERENCE_PERIOD / dt
        self._covariance[:2, :2] += scale * (grow * s.zmp_std) ** 2 * np.eye(2)
        self._covariance[2:, 2:] += scale * (s.drift_std * dt) ** 2 * np.eye(2)

    def _clamp(self) -> None:
        """Cut the bias off at its limits in the yaw frame; what is cut off belongs to the DCM."""
        rotation, limit = _rotation(self._yaw), np.array(self.settings.limit)
        local = rotation.T @ self._state[2:]
        cut = rotation @ (np.clip(local, -limit, limit) - local)
        self._state[2:] += cut
        self._state[:2] -= cut


def _rotation(yaw: float) -> Array:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])
