"""A robot in somebody else's MuJoCo model, driven and measured like the plant of this library."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import mujoco
import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Seed
from wbc.core.signals import Command
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description
from wbc.sim.foreign.actuators import JointActuators
from wbc.sim.foreign.notes import drive_notes, floor_of, model_notes, sensor_notes
from wbc.sim.plant.grips import check_clear
from wbc.sim.plant.mujoco_robot import BAD_STATE, MujocoRobot
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.signals import Imu
from wbc.sim.simulation.machine import Machine, Step
from wbc.sim.simulation.sensors import NO_NOISE, SensorNoise

logger = logging.getLogger(__name__)


class MujocoLoop(MujocoRobot):
    """Loop of a robot in a MuJoCo model of your own, which may contain other things.

    The model is not changed. Actuators act as in the file; `wbc.sim.foreign.actuators` says how they are commanded.
    Objects, further robots and their controls are left as they are. The parts of the robot that collide in the file
    collide here as well. Joints of the model and of the description are matched by their names. A joint with another
    position or axis than in the description is refused.
    A joint that the description locks, such as a spring, moves as in the model. It is not measured, and it begins at
    the position at which it is locked.

    The wrench of a sole is the sum of all contacts of the foot. Sensors have no errors and no delay, unless `noise` or
    `machine` give them some, as for a `wbc.Plant`.

    Attributes:
        actuators: Actuators of the joints, from the file.
        notes: Doubtful points of model and description, one line each.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        model: mujoco.MjModel,
        data: mujoco.MjData | None = None,
        *,
        control_period: Step = 0.002,
        joints: Mapping[str, str] | None = None,
        prefix: str = "",
        gyroscope: str | None = None,
        accelerometer: str | None = None,
        noise: str | SensorNoise = NO_NOISE,
        seed: Seed = 0,
        machine: Machine | None = None,
    ) -> None:
        """Find the robot in the model.

        Args:
            description: The robot, or the name of one.
            model: The model.
            data: State of the model, used as it is, with a warning if the robot is inside another object. When None, a
                new state is made, with the robot at half-sitting on the floor below its feet.
            control_period: Time between two commands, s; a whole multiple of the physics step.
            joints: Joint of the robot → joint of the model, for joints with different names.
            prefix: Prefix of all names of the robot in the model, such as "robot/".
            gyroscope: Name of the gyroscope in the model. When None, it is the one on the body of the IMU; if there is
                none, its readings are computed.
            accelerometer: Name of the accelerometer in the model, chosen in the same way when None.
            noise: Sensor errors, or the name of a preset: "none", "realistic".
            seed: Seed of every random draw.
            machine: Delays, and which sensors exist; when None, torques are measured. Friction and payload are those of
                the model.
        """
        machine = machine or Machine(torque_sensors=True)
        machine.check_loop("a MujocoLoop")
        sizes = model.nq, model.nv, model.nu
        if data is not None and (data.qpos.size, data.qvel.size, data.ctrl.size) != sizes:
            raise InputError(
                f"data must be of the model (nq {model.nq}, nv {model.nv}, nu {model.nu}), got one of nq "
                f"{data.qpos.size}, nv {data.qvel.size}, nu {data.ctrl.size}"
            )
        description = as_description(description)
        description.needs_feet("a loop with sensors of a humanoid")
        robot = description.robot()
        places = RobotPlaces(model, robot, joints, prefix, locked=description.locked)
        self.actuators = JointActuators(places, description)
        imu = Imu(places, gyroscope, accelerometer)
        super().__init__(
            description,
            robot,
            places,
            control_period=control_period,
            noise=noise,
            seed=seed,
            machine=machine,
            imu=imu,
        )
        of_imu = [sensor[0] for sensor in (imu.gyroscope, imu.accelerometer) if sensor is not None]
        self._late_sensors = np.flatnonzero(
            np.isin(model.sensor_adr, of_imu) & (model.sensor_history[:, 0] > 0)
        )
        self._zero_time = 0.0
        self._ground, floor_notes = floor_of(places, robot)
        self.notes = (
            *drive_notes(description, robot, self.actuators),
            *model_notes(description, robot, places),
            *sensor_notes(places.model, imu),
            *floor_notes,
        )
        if data is None:
            self.reset()
            self._note_contacts("half-sitting begins so")
            return
        self.data = data
        self._posture = self.joint_position
        self._begin()
        self._note_contacts("the data begin so (reset() puts the robot into half-sitting)")

    def _note_contacts(self, when: str) -> None:
        """Note where the robot is inside a thing, which throws it."""
        try:
            check_clear(self.model, self.data, self._contacts.geom_robot)
        except InputError as error:
            self.notes += (f"{when}: {error}",)
            logger.warning("%s", self.notes[-1])

    def _place(self, q: Array, v: Array | None) -> None:
        """See `Simulation`: all other objects stay as they are, and so does MuJoCo's own time in the `data`."""
        data = self.data
        self._set_state(q, v)
        self.actuators.switch_off(data)
        data.qacc_warmstart[:] = 0.0
        mujoco.mj_forward(self.model, data)
        self._zero_time = float(data.time)
        zero = np.zeros(self.robot.na)
        self.actuators.apply(data, Command(zero, q[7:], zero))
        self.actuators.settle(data)
        for number in self._late_sensors:  # they read zero until their delay is over, as in new data
            step = max(self.timestep, float(self.model.sensor_interval[number, 0]))
            times = data.time + step * np.arange(-self.model.sensor_history[number, 0], 0.0)[:, None]
            mujoco.mj_initSensorHistory(
                self.model, data, number, times, np.zeros((len(times), 3)), times[-1, 0]
            )

    def _begin(self) -> None:
        self.data.warning.number[[*BAD_STATE]] = 0
        super()._begin()
        self.actuators.begin(self.data)
        self._at_work = self.hold()

    @property
    def time(self) -> float:
        """Simulated time since the last reset, s, to the nanosecond; that of the data where they were not reset.

        The time of the data goes on through a reset. Without the rounding, each run would have its own last bits of it.
        """
        return round(float(self.data.time) - self._zero_time, 9)

    @property
    def joint_torque(self) -> Array:
        """Torques of the drives in the last physics step, a new array of shape (na,), Nm."""
        return self.actuators.torque(self.data)

    def _follow(self, order: Command) -> None:
        self._at_work = order

    def _act(self) -> None:
        self.actuators.apply(self.data, self._at_work)
        super()._act()

    def _integrate(self) -> None:
        mujoco.mj_step(self.model, self.data)

    def _refresh(self) -> None:
        # After a step MuJoCo's frames and sensors are those of its begin; its contacts stay so, as their forces are.
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        mujoco.mj_flex(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_sensorVel(model, data)

    def _end_period(self) -> None:
        self._find_divergence(BAD_STATE)
        if (
            self.diverged is not None
        ):  # MuJoCo resets the data then, with all forces, unless the model forbids it
            self._pushed.clear()
            self.data.xfrc_applied[self.places.of_robot] = 0.0
