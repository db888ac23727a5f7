"""Estimator of a constant bias between the measured DCM and the one that the ZMP drives.

A CoM that the model puts in the wrong place shows as a DCM that does not diverge from the ZMP as the pendulum does. A
Kalman filter separates the two: state [ξ; b], both horizontal, with b constant in the yaw frame of the robot,

    ξ' = (1 + ω dt) ξ − ω dt z,   b' = ΔR b,   measured = ξ + b,

process noise ((ω dt σ_zmp)² on ξ, (σ_drift dt)² on b) and measurement noise σ_dcm². All points are absolute and in the
world: measured = true + b, so that the controller's DCM error is target − (measured − b). The noise levels are those of
samples at 200 Hz; at another rate their variances are scaled, so that the control period does not matter.

Source: the LIPM-DCM estimator of jrl-umi3218/state-observation; unlike there all settings are live and the
clamp is applied in the yaw frame.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, settings
from wbc.base.vectors import Vector

Bound = Annotated[float, Field(ge=0.0, allow_inf_nan=True)]  # or infinity

DCM_STD, ZMP_STD, INITIAL_STD = 0.01, 0.05, 0.01
"""Noise of the measured DCM and of the ZMP that drives the pendulum; of the bias after a reset, m."""


@settings
class BiasSettings:
    """Drift and limits of the estimated bias of the DCM.

    Defaults are mc_rtc's, as the other noise levels, and find 90 % of a bias within about 1.3 s.

    Attributes:
        drift_std: Standard deviation of the drift of the bias, m/s.
        limit: Greatest bias, forward and sideways, m; infinity for none.
    """

    drift_std: Annotated[NonNegative, "m/s"] = 0.02
    limit: Annotated[tuple[Bound, Bound], "m"] = (0.02, 0.02)

    def sized(self, scale: float) -> BiasSettings:
        """Return the settings with their limit times a factor, for a small robot (`Robot.length_scale`).

        Noise stays: it is that of sensors.
        """
        forward, aside = self.limit
        return replace(self, limit=(scale * forward, scale * aside))


REFERENCE_PERIOD = 0.005
"""Period of the samples of that noise, s."""


class BiasEstimator:
    """Kalman filter with four states.

    Both axes are alike, so that points of the plane are complex numbers, x + i y: the covariance matrix of four rows is
    then two variances and one complex covariance.

    Attributes:
        settings: Drift and limits.
    """

    def __init__(self, settings: BiasSettings | None = None) -> None:
        self.settings = settings or BiasSettings()
        self._zmp = 0j
        self._heading = 1 + 0j  # cos yaw + i sin yaw
        self._dcm_variance = 0.0
        self._covariance = 0j  # E[ξ b*], of DCM and bias
        self.reset()

    @property
    def dcm(self) -> Array:
        """True DCM, in the world, shape (2,), m."""
        return _array(self._dcm)

    @property
    def bias(self) -> Array:
        """Bias of the measured DCM in the world, shape (2,), m."""
        return _array(self._bias)

    def reset(self) -> None:
        """Forget DCM and bias; the next update starts from its measurement and a bias of zero."""
        self._dcm = self._bias = 0j
        self._bias_variance = INITIAL_STD**2
        self._begins = True

    def pause(self) -> None:
        """Keep the bias over a time without updates, in which the DCM goes elsewhere: the next one measures it anew."""
        self._begins = True

    def update(self, dcm: Vector, zmp: Vector, yaw: float, omega: float, dt: float) -> Array:
        """Take in a measurement, `dt` seconds after the last, and return the bias in the world, shape (2,), m.

        Measured DCM and ZMP are in the world, x and y first, m; `omega` is the natural frequency, 1/s.
        """
        noise = DCM_STD**2 * (REFERENCE_PERIOD / dt)
        heading = complex(math.cos(yaw), math.sin(yaw))
        measured = complex(dcm[0], dcm[1])
        if self._begins:
            self._bias *= heading * self._heading.conjugate()
            self._dcm = measured - self._bias
            self._dcm_variance = self._bias_variance + noise
            self._covariance = -self._bias_variance + 0j
            self._begins = False
        else:
            self._predict(heading * self._heading.conjugate(), omega, dt)
            # The measurement is the sum of DCM and bias.
            with_dcm = self._dcm_variance + self._covariance
            with_bias = self._bias_variance + self._covariance.conjugate()
            variance = (with_dcm + with_bias).real + noise
            innovation = (measured - self._dcm - self._bias) / variance
            self._dcm += with_dcm * innovation
            self._bias += with_bias * innovation
            self._dcm_variance -= abs(with_dcm) ** 2 / variance
            self._bias_variance -= abs(with_bias) ** 2 / variance
            self._covariance -= with_dcm * with_bias.conjugate() / variance
        self._heading = heading
        self._zmp = complex(zmp[0], zmp[1])
        self._clamp()
        return self.bias

    def _predict(self, turn: complex, omega: float, dt: float) -> None:
        grow = math.expm1(omega * dt)  # exact over a held ZMP; ω dt to first order
        self._dcm += grow * (self._dcm - self._zmp)
        self._bias *= turn
        scale = REFERENCE_PERIOD / dt
        self._dcm_variance = (1.0 + grow) ** 2 * self._dcm_variance + scale * (grow * ZMP_STD) ** 2
        self._bias_variance += scale * (self.settings.drift_std * dt) ** 2
        self._covariance *= (1.0 + grow) * turn.conjugate()

    def _clamp(self) -> None:
        """Clamp the bias in the yaw frame; the rest goes to the DCM."""
        forward, sideways = self.settings.limit
        local = self._bias * self._heading.conjugate()
        within = complex(min(max(local.real, -forward), forward), min(max(local.imag, -sideways), sideways))
        if within != local:
            cut = self._heading * (within - local)
            self._bias += cut
            self._dcm -= cut


def _array(point: complex) -> Array:
    return np.array((point.real, point.imag))
