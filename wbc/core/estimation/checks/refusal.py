"""Readings that are refused: the reason of one, signals as numbers of the right shape, and signals of some robots.

Impossible ones of the last are left out, since a robot balances without them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wbc.base.errors import MeasurementError, shown
from wbc.base.numbers import FLOAT64, Array, unmasked
from wbc.core.robot import Robot
from wbc.core.signals import Measurement

TOLD = 4
"""Number of sensors that a message names."""

WRENCH = ("N", "N", "N", "Nm", "Nm", "Nm")
"""Units of a wrench."""


class Refusal(NamedTuple):
    """Reading that was refused.

    Attributes:
        sensor: Name of the sensor, such as "encoder of left_knee".
        value: The reading; NaN for one that is no number.
        low: Least reading that is accepted in this tick.
        high: Greatest reading that is accepted in this tick.
        unit: Unit of the three.
        jump: True for a reading that is in its range, but too far from the last one.
        why: What else is wrong, such as the shape of a signal.
    """

    sensor: str
    value: float = math.nan
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    jump: bool = False
    why: str = ""

    def __str__(self) -> str:
        if self.why:
            return f"{self.sensor} ({self.why})"
        said = f"{self.value:.5g} {self.unit}" if math.isfinite(self.value) else "no number"
        when = " so soon after the last reading" if self.jump else ""
        return f"{self.sensor} ({said}, must lie in [{self.low:.4g}, {self.high:.4g}] {self.unit}{when})"


def few(texts: Sequence[object]) -> str:
    """Return some texts as one, the first `TOLD` and the number of the others."""
    more = [f"{len(texts) - TOLD} more"] if len(texts) > TOLD else []
    return ", ".join([*map(str, texts[:TOLD]), *more])


def numbers_of(m: Measurement, name: str, shape: tuple[int, ...]) -> Array:
    """Return a signal of a measurement as numbers of a shape."""
    value = getattr(m, name)
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
        return value
    try:
        array = np.asarray(unmasked(value))  # a reading that is masked is none
    except Exception:  # lists of lists of different lengths, objects that fail
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "iuf":
        raise MeasurementError(f"{name} must be numbers of shape {shape}, got {shown(value)}")
    if array.shape != shape:
        raise MeasurementError(f"{name} must have shape {shape}, got {array.shape}")
    return array.astype(np.float64, copy=False)


class OptionalSignals:
    """Check of torques of joints, wrenches of hands, and ranges and stiffness of soles."""

    def __init__(self, robot: Robot, force: float, torque_margin: float) -> None:
        """Take the ranges from a robot, with the largest force of a hand, N, and of a torque over its limit."""
        n, hands = len(robot.soles), (len(robot.frames), 6)
        unread = np.full(n, np.nan)
        # Name → name in messages, shape, and what stands for a signal that is left out.
        self._signals: dict[str, tuple[str, tuple[int, ...], Array | None]] = {
            "joint_torque": ("joint torques", (robot.na,), None),
            "hand_wrenches": ("force sensors of hands", hands, None),
            "sole_range": ("range sensors of soles", (n,), unread),
            "sole_stiffness": ("stiffness of soles", (n,), unread),
        }
        self._soles = {(n,), (2,)}  # shapes of signals of the soles: these, or their default
        self._hands = tuple(robot.frames)
        longest = max(sole.length for sole in robot.soles)
        self._wrist = np.repeat([force, force * longest], 3)  # largest wrench of a hand
        self._torque = torque_margin * robot.torque_limit

    def check(self, m: Measurement) -> tuple[Measurement, Sequence[Refusal]]:
        """Return a measurement without impossible torques, and with NaN for impossible wrenches of hands; and why.

        A signal of the wrong shape is left out.
        """
        soles = self._is_of_soles(m.sole_range) and self._is_of_soles(m.sole_stiffness)
        if soles and m.joint_torque is None and m.hand_wrenches is None:
            return m, ()
        faults: list[Refusal] = []
        formed = self._formed(m, faults)
        torque, hands = formed["joint_torque"], formed["hand_wrenches"]
        if torque is not None and not (np.abs(torque) <= self._torque).all():
            faults.append(_beyond("joint torques", torque, self._torque, ("Nm",) * len(torque)))
            formed["joint_torque"] = None
        if hands is not None:
            wrong = np.any(np.abs(hands) > self._wrist, axis=1)  # a hand without a reading has NaN
            if wrong.any():
                for i in np.flatnonzero(wrong).tolist():
                    hand = np.where(np.isnan(hands[i]), 0.0, hands[i])
                    faults.append(_beyond(f"force sensor of {self._hands[i]}", hand, self._wrist, WRENCH))
                formed["hand_wrenches"] = hands = np.array(hands)
                hands[wrong] = np.nan
        if all(value is getattr(m, name) for name, value in formed.items()):
            return m, faults
        return replace(m, **formed), faults

    def _formed(self, m: Measurement, faults: list[Refusal]) -> dict[str, Any]:
        """Return the signals as arrays of the right type and shape; add to `faults` which are not."""
        formed: dict[str, Any] = {}
        for name, (sensor, shape, unread) in self._signals.items():
            value = formed[name] = getattr(m, name)
            if value is None if unread is None else self._is_of_soles(value):
                continue
            try:
                formed[name] = numbers_of(m, name, shape)
            except MeasurementError as error:
                formed[name] = None if unread is None else unread.copy()
                faults.append(Refusal(sensor, why=str(error)))
        return formed

    def _is_of_soles(self, value: Any) -> bool:
        return type(value) is np.ndarray and value.dtype is FLOAT64 and value.shape in self._soles


def _beyond(sensor: str, values: Array, most: Array, units: Sequence[str]) -> Refusal:
    """Return why a sensor is refused: by the number that is farthest beyond its bound, or is none."""
    worst = int(np.argmax(np.nan_to_num(np.abs(values) / most, nan=np.inf)))
    bound = float(most[worst])
    return Refusal(sensor, float(values[worst]), -bound, bound, units[worst])
