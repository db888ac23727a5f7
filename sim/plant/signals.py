"""True signals of all sensors of a robot in MuJoCo, before the sensor errors."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from wbc.base.numbers import Array, scalar
from wbc.sim.plant.contacts import Contacts
from wbc.sim.plant.places import RobotPlaces, hanging
from wbc.sim.simulation.machine import Machine
from wbc.sim.simulation.sensors import SensorVector


class Imu:
    """Gyroscope and accelerometer of a model, in the IMU frame of the robot; computed where the model has none.

    Sensors are those named, else the nearest on the IMU's body; see `RobotPlaces.sensor`.
    """

    def __init__(self, places: RobotPlaces, gyroscope: str | None, accelerometer: str | None) -> None:
        self._places = places
        kinds = mujoco.mjtSensor
        self.gyroscope = places.sensor("gyroscope", kinds.mjSENS_GYRO, gyroscope)
        self.accelerometer = places.sensor("accelerometer", kinds.mjSENS_ACCELEROMETER, accelerometer)

    def rates(self, data: mujoco.MjData) -> Array:
        """Return the angular velocity, shape (3,), rad/s."""
        if self.gyroscope is not None:
            return _reading(data, self.gyroscope)
        places, velocity = self._places, np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(places.model, data, kind, places.imu_body, velocity, 1)
        turned: Array = places.imu.rotation.T @ velocity[:3]
        return turned

    def specific_force(self, data: mujoco.MjData) -> Array:
        """Return the specific force in the physics step that has just ended, shape (3,), m/s²."""
        if self.accelerometer is not None:
            return _reading(data, self.accelerometer)
        places, motion = self._places, np.zeros((2, 6))
        mujoco.mj_rnePostConstraint(places.model, data)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectAcceleration(places.model, data, kind, places.imu_body, motion[0], 1)
        mujoco.mj_objectVelocity(places.model, data, kind, places.imu_body, motion[1], 1)
        lever, omega = places.imu.translation, motion[1, :3]
        at_imu = motion[0, 3:] + np.cross(motion[0, :3], lever) + np.cross(omega, np.cross(omega, lever))
        turned: Array = places.imu.rotation.T @ at_imu
        return turned


def _reading(data: mujoco.MjData, sensor: tuple[int, Array | None]) -> Array:
    place, turn = sensor
    reading: Array = data.sensordata[place : place + 3]
    return reading if turn is None else turn @ reading


class MujocoSignals(SensorVector):
    """Signals of a robot in MuJoCo.

    Accelerometer and wrenches measure forces that exist only during a physics step; they are the mean over the rows of
    `window`, one for each step of a control period. Torques are those of the drives at the beginning of the last step:
    under an implicit integrator a joint gets less while it accelerates.

    Attributes:
        window: Specific force, and reactions to the wrenches on soles and hands as MuJoCo's force sensors have them, in
            the last physics steps, shape (steps of a control period, 3 + 6 × number of soles and hands); its `rows`.
        of_contacts: True if wrenches are sums of contacts, which must be captured in each step. Without force sensors
            nobody reads these sums, and they stay zero.
    """

    def __init__(
        self,
        places: RobotPlaces,
        imu: Imu,
        contacts: Contacts,
        steps: int,
        machine: Machine,
        *,
        soles: Sequence[str] = (),
        hands: Sequence[str] = (),
    ) -> None:
        """Find the sensors; `soles` are force and torque sensor of each sole, when empty contacts are summed.

        `hands` are the roles of hands with the sensors of `add_hand_sensors`; all that hangs on the body of such a
        sensor is the hand.
        """
        super().__init__(len(places.joints), len(places.feet), machine, len(hands))
        self._places, self._imu, self._contacts, model = places, imu, contacts, places.model
        sensors: list[int] = []
        if soles:
            assert imu.accelerometer is not None and imu.accelerometer[1] is None, "not in the IMU frame"
            names = [*soles, *(f"{role} {what}" for role in hands for what in ("force", "torque"))]
            firsts = [imu.accelerometer[0], *(int(model.sensor(name).adr[0]) for name in names)]
            sensors = [place for first in firsts for place in range(first, first + 3)]
        self._sensors = np.array(sensors, dtype=np.intp) if sensors else None
        self.of_contacts = self._sensors is None and machine.force_sensors
        self._forces = self.values[self._ends[2] : self._ends[4]]  # specific force and wrenches of soles
        self.window = np.zeros((steps, self._forces.size + 6 * len(hands)))
        self.rows = list(self.window)
        self._samples = scalar(steps)
        self._mean = np.empty(self.window.shape[1]) if hands else self._forces
        sites = [int(model.site(f"{role} site").id) for role in hands]
        hung = [np.flatnonzero(hanging(model, [int(model.site_bodyid[site])]) == 0) for site in sites]
        self._hands = [  # site, bodies of the hand, their masses (kg) and centres of mass in their own frames (m)
            (site, bodies, model.body_mass[bodies].copy(), model.body_ipos[bodies].copy())
            for site, bodies in zip(sites, hung, strict=True)
        ]

    def begin(self, data: mujoco.MjData) -> None:
        """Take the forces of a state at which a run begins, after `mj_forward`, as those of a whole period."""
        self._contacts.capture(data)
        self.record(data, self.window[0])
        self.window[:] = self.window[0]

    def record(self, data: mujoco.MjData, row: Array) -> None:
        """Store the forces of the physics step that has just ended in a row of `window`; contacts are captured."""
        if self._sensors is not None:
            data.sensordata.take(self._sensors, out=row, mode="clip")
            return
        row[:3] = self._imu.specific_force(data)
        if self.of_contacts:
            np.negative(self._contacts.wrenches().ravel(), out=row[3:])

    def sample(self, data: mujoco.MjData) -> None:
        """Write the present signals, without torques, into `values`; positions and velocities are up to date."""
        # With the default mode NumPy writes into a buffer first.
        data.qpos.take(self._places.joint_qpos, out=self.joint_position, mode="clip")
        data.qvel.take(self._places.joint_dof, out=self.joint_velocity, mode="clip")
        self.angular_velocity[:] = self._imu.rates(data)
        mean = self._mean
        np.add.reduce(self.window, axis=0, out=mean)  # the mean, without the overhead of np.mean
        np.divide(mean, self._samples, out=mean)
        if self._hands:
            self._forces[:] = mean[: self._forces.size]
            self._sample_hands(data, mean[self._forces.size :].reshape(-1, 6))
        # MuJoCo's force sensor is that of the child on the parent in site axes, with the sign of the reaction.
        np.negative(self.sole_wrench, out=self.sole_wrench)

    def _sample_hands(self, data: mujoco.MjData, reactions: Array) -> None:
        """Write the wrenches on the hands: what the wrists feel, less the weight of the hands without their loads."""
        gravity = self._places.model.opt.gravity
        np.negative(reactions, out=self.hand_wrenches)
        for (site, bodies, masses, centres), wrench in zip(self._hands, self.hand_wrenches, strict=True):
            rotation, mass = data.site_xmat[site].reshape(3, 3), masses.sum()
            frames = data.xmat[bodies].reshape(-1, 3, 3)
            places = data.xpos[bodies] + np.einsum("bij,bj->bi", frames, centres)
            weight = (mass * gravity) @ rotation
            lever = (masses @ places / mass - data.site_xpos[site]) @ rotation
            wrench[:3] -= weight
            wrench[3:] -= np.cross(lever, weight)
