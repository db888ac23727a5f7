"""True signals of all sensors of a plant, in one vector, before the sensor errors."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbc.core.errors import Array, scalar
from wbc.core.signals import Measurement
from wbc.sim.plant.model import PlantModel


class TrueSignals:
    """Joint positions and velocities, gyroscope, accelerometer, wrenches of soles, torques, wrenches of hands.

    All but encoders and gyroscope measure forces that exist only during a physics step; they are the mean over the
    rows of `window`, one a step. Torques are those that MuJoCo's actuators had at the beginning of the last step:
    under an implicit integrator a joint gets less while it accelerates.

    Attributes:
        values: The signals as last sampled, shape (2 na + 6 + 6 × number of soles,), na more with torques, and 6 more
            for each hand with a sensor.
        window: Forces in the last physics steps, shape (steps of a control period, 3 + 6 × number of soles and hands).
        force_places: Places of these forces in `sensordata`.
    """

    def __init__(self, plant: PlantModel, steps: int, *, forces: bool = True, torques: bool = False) -> None:
        """Look up the place of each signal; forces are averaged over the physics steps of a control period."""
        self._plant = plant
        na, model = len(plant.joint_qpos), plant.model
        gyro, accelerometer = plant.imu
        hands = len(plant.hands)
        places = [*range(accelerometer, accelerometer + 3)]
        for foot in plant.feet:
            for name in (foot.force_sensor, foot.torque_sensor):
                first = int(model.sensor_adr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)])
                places += range(first, first + 3)
        for hand in plant.hands:
            places += [*range(hand.force, hand.force + 3), *range(hand.torque, hand.torque + 3)]
        self._gyro_places = np.arange(gyro, gyro + 3, dtype=np.intp)
        self.force_places = np.array(places, dtype=np.intp)
        self.window = np.zeros((steps, len(places)))
        self._samples = scalar(steps)
        self._na = na
        soles = 2 * na + 3 + len(places) - 6 * hands
        self.values = np.empty(soles + (na if torques else 0) + 6 * hands)
        self._positions, self._velocities = self.values[:na], self.values[na : 2 * na]
        self._rates = self.values[2 * na : 2 * na + 3]
        self._forces = self.values[2 * na + 3 : soles]
        self._wrenches = self.values[2 * na + 6 : soles]
        self._torque_part = slice(soles, soles + na) if torques else None
        self._torques = None if self._torque_part is None else self.values[self._torque_part]
        self._soles = slice(2 * na + 6, soles) if forces else None
        self._hand_part = slice(self.values.size - 6 * hands, self.values.size) if hands else None
        self._mean = np.empty(len(places)) if hands else self._forces
        self._hands = [(hand.site, *_subtree(model, hand.body)) for hand in plant.hands]

    def sample(self, data: mujoco.MjData) -> None:
        """Write the present signals into `values`; positions and velocities are up to date."""
        # With the default mode NumPy writes into a buffer first.
        data.qpos.take(self._plant.joint_qpos, out=self._positions, mode="clip")
        data.qvel.take(self._plant.joint_dof, out=self._velocities, mode="clip")
        data.sensordata.take(self._gyro_places, out=self._rates, mode="clip")
        mean = self._mean
        np.add.reduce(self.window, axis=0, out=mean)  # the mean, without the overhead of np.mean
        np.divide(mean, self._samples, out=mean)
        if self._hand_part is not None:
            self._forces[:] = mean[: self._forces.size]
            self._sample_hands(data, mean[self._forces.size :].reshape(-1, 6))
        # MuJoCo's force sensor is that of the child on the parent in site axes, with the sign of the reaction.
        np.negative(self._wrenches, out=self._wrenches)
        if self._torques is not None:
            data.qfrc_actuator.take(self._plant.joint_dof, out=self._torques, mode="clip")

    def _sample_hands(self, data: mujoco.MjData, reactions: Array) -> None:
        """Write the wrenches on the hands: what the wrists feel, less the weight of the hands without their loads."""
        gravity = self._plant.model.opt.gravity
        wrenches = self.values[self._hand_part].reshape(-1, 6)
        np.negative(reactions, out=wrenches)
        for (site, bodies, masses, centres), wrench in zip(self._hands, wrenches, strict=True):
            rotation, mass = data.site_xmat[site].reshape(3, 3), masses.sum()
            frames = data.xmat[bodies].reshape(-1, 3, 3)
            places = data.xpos[bodies] + np.einsum("bij,bj->bi", frames, centres)
            weight = (mass * gravity) @ rotation
            lever = (masses @ places / mass - data.site_xpos[site]) @ rotation
            wrench[:3] -= weight
            wrench[3:] -= np.cross(lever, weight)

    def measurement(self, reading: Array, time: float, ranges: Array, stiffness: Array) -> Measurement:
        """Return a reading, shape of `values`, with ranges (m) and stiffness (Nm/rad) of soles, as a measurement."""
        na = self._na
        return Measurement(
            time,
            reading[:na],
            reading[na : 2 * na],
            reading[2 * na : 2 * na + 3],
            reading[2 * na + 3 : 2 * na + 6],
            None if self._soles is None else reading[self._soles].reshape(-1, 6),
            ranges,
            stiffness,
            None if self._torque_part is None else reading[self._torque_part],
            hand_wrenches=None if self._hand_part is None else reading[self._hand_part].reshape(-1, 6),
        )


def _subtree(model: mujoco.MjModel, root: int) -> tuple[NDArray[np.intp], Array, Array]:
    """Return a body with all that hangs on it, their masses (kg) and their centres of mass in their own frames (m)."""
    bodies = [root]
    for body in range(root + 1, model.nbody):
        if model.body_parentid[body] in bodies:
            bodies.append(body)
    return np.array(bodies, dtype=np.intp), model.body_mass[bodies].copy(), model.body_ipos[bodies].copy()
