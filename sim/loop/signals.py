"""True signals of all sensors of a robot in any MuJoCo model, in one vector, before the sensor errors."""

from __future__ import annotations

import mujoco
import numpy as np

from wbc.core.errors import Array
from wbc.core.signals import Measurement
from wbc.sim.loop.actuators import JointActuators
from wbc.sim.loop.contacts import SoleContacts
from wbc.sim.loop.places import ImuSensors, RobotPlaces


class LoopSignals:
    """Joint positions, joint velocities, gyroscope, accelerometer, force and moment of each sole, torques of drives.

    The order is that of `wbc.sim.plant.sensors.SensorChain`. Accelerometer and wrenches are the mean over the physics
    steps of a control period; the rest belongs to the instant.

    Attributes:
        values: The signals as last sampled, shape (3 na + 6 + 6 × number of soles,).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        places: RobotPlaces,
        imu: ImuSensors,
        contacts: SoleContacts,
        actuators: JointActuators,
        steps: int,
    ) -> None:
        """Lay out the vector; `steps` is the number of physics steps in a control period."""
        self._model, self._places, self._imu = model, places, imu
        self._contacts, self._actuators = contacts, actuators
        na, n = len(places.joints), len(places.feet)
        self._na, self._soles = na, slice(2 * na + 6, 2 * na + 6 + 6 * n)
        self.values = np.empty(3 * na + 6 + 6 * n)
        self._window = np.zeros((steps, 3 + 6 * n))
        self._row = 0

    def begin(self, data: mujoco.MjData) -> None:
        """Take the forces of a state at which a run begins, after `mj_forward`, as those of a whole period."""
        self._window[:] = self._forces(data)
        self._row = 0
        self.sample(data)

    def record(self, data: mujoco.MjData) -> None:
        """Store the forces of the physics step that has just ended."""
        self._window[self._row] = self._forces(data)
        self._row = (self._row + 1) % len(self._window)

    def sample(self, data: mujoco.MjData) -> None:
        """Write the present signals into `values`; positions, velocities and their sensors are up to date."""
        na, values = self._na, self.values
        values[:na] = data.qpos[self._places.joint_qpos]
        values[na : 2 * na] = data.qvel[self._places.joint_dof]
        values[2 * na : 2 * na + 3] = self._gyroscope(data)
        values[2 * na + 3 : self._soles.stop] = np.add.reduce(self._window, axis=0) / len(self._window)
        values[self._soles.stop :] = self._actuators.torque(data)

    def wrenches(self) -> Array:
        """Return the true wrenches on the soles as last sampled, shape (number of soles, 6), N and Nm."""
        return self.values[self._soles].reshape(-1, 6).copy()

    def measurement(self, reading: Array, time: float, *, forces: bool, torques: bool) -> Measurement:
        """Return a reading of the sensors, shape of `values`, as a measurement, with or without forces and torques."""
        na, none = self._na, np.full(len(self._places.feet), np.nan)
        return Measurement(
            time,
            reading[:na],
            reading[na : 2 * na],
            reading[2 * na : 2 * na + 3],
            reading[2 * na + 3 : 2 * na + 6],
            reading[self._soles].reshape(-1, 6) if forces else None,
            none,
            none.copy(),
            reading[self._soles.stop :] if torques else None,
        )

    def _forces(self, data: mujoco.MjData) -> Array:
        return np.concatenate([self._accelerometer(data), self._contacts.wrenches(data).ravel()])

    def _gyroscope(self, data: mujoco.MjData) -> Array:
        if self._imu.gyroscope is not None:
            place, turn = self._imu.gyroscope
            reading: Array = turn @ data.sensordata[place : place + 3]
            return reading
        velocity, kind = np.zeros(6), mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(self._model, data, kind, self._places.imu_body, velocity, 1)
        turned: Array = self._places.imu.rotation.T @ velocity[:3]
        return turned

    def _accelerometer(self, data: mujoco.MjData) -> Array:
        if self._imu.accelerometer is not None:
            place, turn = self._imu.accelerometer
            reading: Array = turn @ data.sensordata[place : place + 3]
            return reading
        model, places = self._model, self._places
        mujoco.mj_rnePostConstraint(model, data)
        motion, kind = np.zeros((2, 6)), mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectAcceleration(model, data, kind, places.imu_body, motion[0], 1)
        mujoco.mj_objectVelocity(model, data, kind, places.imu_body, motion[1], 1)
        lever, omega = places.imu.translation, motion[1, :3]
        at_imu = motion[0, 3:] + np.cross(motion[0, :3], lever) + np.cross(omega, np.cross(omega, lever))
        turned: Array = places.imu.rotation.T @ at_imu
        return turned
