"""Sensors: the vector of all signals, and their errors: latency, bias, white noise and resolution.

Errors act in the physical order: a reading is the true signal a latency ago, plus bias, plus noise, rounded to the
resolution. All are zero by default, and a seed fixes every draw.
"""

from __future__ import annotations

import math
from dataclasses import field
from itertools import groupby
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.numbers import Array, scalar
from wbc.base.registry import Registry
from wbc.base.settings import NonNegative, settings
from wbc.core.estimation.observer import LONGEST_DELAY
from wbc.core.signals import Measurement
from wbc.sim.simulation.machine import Machine, whole_steps


@settings
class SignalNoise:
    """Errors of one signal, drawn independently for each of its channels.

    Attributes:
        std: Standard deviation of white noise, in the unit of the signal; it is drawn at every reading.
        bias_std: Standard deviation of a constant bias, in the unit of the signal; it is drawn once at each reset.
        quantum: Resolution, in the unit of the signal: readings are multiples of it; 0 for no quantisation.
        latency: Age of a reading, s, rounded up to whole physics steps; at most 0.1 s.
    """

    std: NonNegative = 0.0
    bias_std: NonNegative = 0.0
    quantum: NonNegative = 0.0
    latency: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0


@settings
class SensorNoise:
    """Errors of every sensor of the robot; all off by default.

    Attributes:
        joint_position: Encoders, rad (or m).
        joint_velocity: Velocities of the drives, rad/s (or m/s).
        angular_velocity: Gyroscope, rad/s.
        specific_force: Accelerometer, m/s².
        sole_force: Forces under the ankles, N.
        sole_moment: Moments about the sole centres, Nm.
        joint_torque: Torques of the drives, for a plant whose drives report them, Nm (or N).
        hand_force: Forces at the wrists, for a plant with force sensors there, N.
        hand_moment: Moments at the wrists, for a plant with force sensors there, Nm.
    """

    joint_position: SignalNoise = field(default_factory=SignalNoise)
    joint_velocity: SignalNoise = field(default_factory=SignalNoise)
    angular_velocity: SignalNoise = field(default_factory=SignalNoise)
    specific_force: SignalNoise = field(default_factory=SignalNoise)
    sole_force: SignalNoise = field(default_factory=SignalNoise)
    sole_moment: SignalNoise = field(default_factory=SignalNoise)
    joint_torque: SignalNoise = field(default_factory=SignalNoise)
    hand_force: SignalNoise = field(default_factory=SignalNoise)
    hand_moment: SignalNoise = field(default_factory=SignalNoise)


NO_NOISE = SensorNoise()
"""Perfect sensors."""

REALISTIC = SensorNoise(
    joint_position=SignalNoise(std=2e-4, bias_std=1e-3, quantum=math.tau / 2**18, latency=0.001),
    joint_velocity=SignalNoise(std=0.0125, latency=0.001),
    angular_velocity=SignalNoise(std=0.002, bias_std=5e-4, latency=0.001),
    specific_force=SignalNoise(std=0.04, bias_std=0.05, latency=0.001),
    sole_force=SignalNoise(std=1.0, bias_std=2.0, latency=0.001),
    sole_moment=SignalNoise(std=0.05, bias_std=0.1, latency=0.001),
    joint_torque=SignalNoise(std=0.2, bias_std=0.2, latency=0.001),
    hand_force=SignalNoise(std=0.3, bias_std=0.5, latency=0.001),
    hand_moment=SignalNoise(std=0.01, bias_std=0.02, latency=0.001),
)
"""Sensors of a good research humanoid.

- Encoders: 18 bits and 2e-4 rad of noise, the joint encoders of Cassie (model by its maker, mujoco_menagerie). Zeroing
  error 1e-3 rad: chosen.
- Joint velocities: difference over 1 ms of a 13-bit motor encoder behind a gear of 25 (Cassie's hips), whose rounding
  alone has a standard deviation of 2π / 2¹³ / 25 / 1 ms / √6 = 0.0125 rad/s.
- Gyroscope: 0.002 rad/s, as the Cassie state estimator of the University of Michigan assumes for its IMU; the data
  sheet of the Xsens MTi-1 gives the same, 0.007 °/s/√Hz over 255 Hz. Bias left after calibration at rest: ten times
  the 10 °/h in-run stability of that data sheet, chosen.
- Accelerometer: 0.04 m/s² (same estimator; 0.02 m/s² in that data sheet). Bias 0.05 m/s²: 5 mg, the accuracy at 1 g
  that the manual of the x-IMU3 gives.
- Forces and moments: 1 N and 0.05 Nm of noise, 2 N and 0.1 Nm of offset: chosen, about 1 and 2 parts in a thousand of
  a sensor for 1 kN. With half of 39 kg on a foot, its centre of pressure has 0.3 mm of noise and is 0.5 mm off.
- Torques of drives: from currents, 0.2 Nm of noise and 0.2 Nm of offset: chosen.
- Forces and moments at the wrists: 0.3 N and 0.01 Nm of noise, 0.5 N and 0.02 Nm of offset: chosen, about 2 parts in a
  thousand of a sensor for 200 N.
- Latency: 1 ms, one cycle of a 1 kHz field bus: chosen.

Servos do not see any of it: they close their loops on their own encoders inside the drive.
"""

NOISE_PRESETS: Registry[SensorNoise] = Registry("sensor noise", {"none": NO_NOISE, "realistic": REALISTIC})
"""Sensor errors by name; a new preset is an entry here."""


class SensorVector:
    """True signals of all sensors of a robot in one vector, whose layout stands here alone.

    Attributes:
        values: The signals as last sampled, shape (n,): the parts that follow, one behind the other.
        joint_position: Shape (na,), rad; a part of `values`, as all that follow.
        joint_velocity: Shape (na,), rad/s.
        angular_velocity: Gyroscope, shape (3,), rad/s.
        specific_force: Accelerometer, shape (3,), m/s².
        sole_wrench: Wrench on each sole, shape (soles, 6), N and Nm.
        joint_torque: Torques of the drives, shape (na,), Nm; empty where drives do not report them.
        hand_wrenches: Wrench on each hand, shape (hands, 6), N and Nm; empty where wrists have no sensors.
    """

    def __init__(self, joints: int, soles: int, machine: Machine, hands: int = 0) -> None:
        """Lay out the vector."""
        torques = joints if machine.torque_sensors else 0
        self._ends = np.cumsum([joints, joints, 3, 3, 6 * soles, torques, 6 * hands])[:-1].tolist()
        self._has_soles, self._has_torques, self._has_hands = machine.force_sensors, torques > 0, hands > 0
        self.values = np.zeros(self._ends[-1] + 6 * hands)
        parts = np.split(self.values, self._ends)
        self.joint_position, self.joint_velocity, self.angular_velocity, self.specific_force = parts[:4]
        self.sole_wrench, self.hand_wrenches = parts[4].reshape(-1, 6), parts[6].reshape(-1, 6)
        self.joint_torque = parts[5]

    def errors(self, noise: SensorNoise) -> list[SignalNoise]:
        """Return the errors of each signal of the vector."""
        return (
            [noise.joint_position] * self.joint_position.size
            + [noise.joint_velocity] * self.joint_velocity.size
            + [noise.angular_velocity] * 3
            + [noise.specific_force] * 3
            + ([noise.sole_force] * 3 + [noise.sole_moment] * 3) * len(self.sole_wrench)
            + [noise.joint_torque] * self.joint_torque.size
            + ([noise.hand_force] * 3 + [noise.hand_moment] * 3) * len(self.hand_wrenches)
        )

    def measurement(self, reading: Array, time: float, ranges: Array, stiffness: Array) -> Measurement:
        """Return a reading, shape of `values`, with ranges (m) and stiffness (Nm/rad) of soles, as a measurement."""
        q, v, gyro, accelerometer, soles, torques = self._ends
        return Measurement(
            time,
            reading[:q],
            reading[q:v],
            reading[v:gyro],
            reading[gyro:accelerometer],
            reading[accelerometer:soles].reshape(-1, 6) if self._has_soles else None,
            ranges,
            stiffness,
            reading[soles:torques] if self._has_torques else None,
            hand_wrenches=reading[torques:].reshape(-1, 6) if self._has_hands else None,
        )


class SensorChain:
    """The errors of `SensorNoise`, applied to the vector of all `SensorVector`.

    Attributes:
        kept: Numbers of physics steps before a reading at which signals are pushed: from the latency of the fastest to
            that of the slowest of them.
    """

    def __init__(
        self,
        noise: SensorNoise,
        signals: SensorVector,
        timestep: float,
        steps: int = 1,
        *,
        delay: float = 0.0,
    ) -> None:
        """Lay the errors out over the vector; `steps` is from one reading to the next, `delay` on top of latency, s."""
        channels = signals.errors(noise)
        self.size = len(channels)
        self._std = np.array([c.std for c in channels])
        self._bias_std = np.array([c.bias_std for c in channels])
        late = whole_steps(delay, timestep)
        self._delay = np.array([late + whole_steps(c.latency, timestep) for c in channels], dtype=np.intp)
        self._rounded: list[tuple[slice, Array]] = []  # channels in a row with the same resolution
        start = 0
        for quantum, run in groupby(c.quantum for c in channels):
            stop = start + len(list(run))
            if quantum > 0.0:
                self._rounded.append((slice(start, stop), scalar(quantum)))
            start = stop
        self._noisy = bool(self._std.any())
        oldest = int(self._delay.max())
        # Where a signal may be read one reading later, all of them are kept.
        newest = int(self._delay.min()) if oldest < steps else 0
        self.kept, self._late = range(newest, oldest + 1), oldest > 0
        depth = len(self.kept)
        self._history = np.zeros((depth, self.size))
        # Where in the flattened history each channel is read, for each place of the newest signals.
        rows = (np.arange(depth)[:, None] - (self._delay - newest)) % depth
        self._places = rows * self.size + np.arange(self.size)
        self._head = 0
        self._draw = np.empty(self.size)
        self._bias = np.zeros(self.size)
        self._biased = bool(self._bias_std.any())
        self._rng = np.random.default_rng(0)

    def reset(self, truth: Array, seed: int) -> None:
        """Draw new biases and fill the history with the present signals, shape (size,); the seed fixes all draws."""
        self._rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
        self._bias = self._bias_std * self._rng.standard_normal(self.size)
        self._history[:] = truth
        self._head = 0

    def push(self, truth: Array) -> None:
        """Store the true signals, shape (size,), of a physics step; none where no signal has a latency."""
        if not self._late:
            return
        self._head = (self._head + 1) % len(self._history)
        self._history[self._head] = truth

    def read(self, truth: Array) -> Array:
        """Return the readings, a new array of shape (size,), of the signals now; with a latency of those pushed."""
        out: Array = self._history.take(self._places[self._head]) if self._late else truth.copy()
        if self._biased:
            out += self._bias
        if self._noisy:
            self._rng.standard_normal(out=self._draw)
            out += np.multiply(self._std, self._draw, out=self._draw)
        for part, quantum in self._rounded:
            values = out[part]
            values /= quantum
            np.rint(values, out=values)
            values *= quantum
        return out
