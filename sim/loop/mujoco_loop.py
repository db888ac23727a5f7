"""A robot in somebody else's MuJoCo model, driven and measured like the plant of this library.

loop = MujocoLoop(description, model, data)
while loop.time < 10.0:
loop.step(control.command(loop.measure()))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from wbc.core.arguments import checked
from wbc.core.conventions import configuration_from_mujoco, velocity_from_mujoco
from wbc.core.errors import Array, InputError, MeasurementError, finite_array
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.sim.loop.actuators import JointActuators
from wbc.sim.loop.contacts import SoleContacts
from wbc.sim.loop.places import find_imu, find_places
from wbc.sim.plant.settings import steps_per_tick
from wbc.sim.plant.truth import GroundTruth

OTHER_MASS = 0.01
"""Share of the mass by which model and description may differ without a note."""

Stepper = Callable[[mujoco.MjModel, mujoco.MjData], object]
"""Function that advances a simulation by one physics step, such as `mujoco.mj_step`."""


class MujocoLoop:
    """A robot among other things in a MuJoCo model of one's own.

    The model is not changed: actuators act as the file has them (`wbc.sim.loop.actuators` says how they are
    commanded), objects, further robots and their controls are left alone, and whatever parts of the robot collide in
    the file collide here. Names join the model to the description of the robot; a joint that is elsewhere or turns
    the other way is refused.

    Encoders, joint velocities and gyroscope are those of the present instant; accelerometer and sole wrenches are the
    mean over the physics steps of the control period that ended now. Wrenches are the sums of all contacts of a foot.

    Attributes:
        description: The robot as data.
        robot: The robot as a model, for names and sizes; its state is not kept up to date.
        model: MuJoCo's model.
        data: MuJoCo's state.
        control_period: Time that `step` advances, s.
        steps: Physics steps in it.
        actuators: Drives of the joints, as the file has them.
        notes: What is doubtful about model and description, one line each.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription,
        model: mujoco.MjModel,
        data: mujoco.MjData | None = None,
        *,
        control_period: float = 0.002,
        joints: Mapping[str, str] | None = None,
        prefix: str = "",
        gyroscope: str | None = None,
        accelerometer: str | None = None,
        stepper: Callable[..., object] | None = None,
    ) -> None:
        """Find the robot in the model.

        Args:
            description: The robot.
            model: The model.
            data: Its state, taken as it is; a new one with the robot at half-sitting on z = 0 when None.
            control_period: Time between two commands, s; a whole multiple of the physics step.
            joints: Joint of the robot → joint of the model, where the names differ.
            prefix: What the model puts before all names of the robot, such as "robot/".
            gyroscope: Sensor of the model; the one on the IMU's body when None, and computed if there is none.
            accelerometer: Likewise.
            stepper: Function that advances model and data by one physics step; `mujoco.mj_step` when None.

        Raises:
            UnknownNameError: A joint or sensor that the model has not.
            ModelError: A model that does not hold this robot, or an actuator that cannot be commanded.
            InputError: A control period that is no multiple of the physics step, data of another model.
        """
        self.description, self.model = description, model
        self.robot: Robot = description.robot()
        self.control_period = float(control_period)
        self.steps = steps_per_tick(control_period, float(model.opt.timestep))
        self.places = find_places(model, description, joints or {}, prefix)
        self.actuators = JointActuators(model, description, self.places.joints, self.places.root)
        self._imu = find_imu(model, self.places, gyroscope, accelerometer)
        self._contacts = SoleContacts(model, self.places.root, self.places.feet, self.places.soles)
        self._stepper: Stepper = mujoco.mj_step if stepper is None else stepper
        self.notes = tuple(self._notes())
        if data is None:
            self.data = mujoco.MjData(model)
            self.reset()
            return
        if (data.qpos.size, data.qvel.size, data.ctrl.size) != (model.nq, model.nv, model.nu):
            raise InputError(
                f"data must be of the model (nq {model.nq}, nv {model.nv}, nu {model.nu}), got one of nq "
                f"{data.qpos.size}, nv {data.qvel.size}, nu {data.ctrl.size}"
            )
        self.data = data
        self._begin()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return float(self.data.time)

    def reset(self, configuration: ArrayLike | None = None) -> None:
        """Put the robot, at rest, into a configuration; everything else stays where it is.

        Args:
            configuration: Shape (nq,); half-sitting on z = 0 when None.

        Raises:
            InputError: A configuration of the wrong shape or not finite.
        """
        q = self.robot.half_sitting
        if configuration is not None:
            q = finite_array("configuration", configuration, (self.robot.nq,))
        places = self.places
        places.set_configuration(q, self.data.qpos)
        self.data.qvel[places.base_dof : places.base_dof + 6] = 0.0
        self.data.qvel[places.joint_dof] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.actuators.apply(self.data, self.hold())
        self._begin()

    def _begin(self) -> None:
        mujoco.mj_forward(self.model, self.data)
        self._specific_force = self._accelerometer()
        self._wrench = self._contacts.wrenches(self.data)
        self._measurement: Measurement | None = None

    def hold(self) -> Command:
        """Return a command that holds the present joint positions with the servos."""
        zero = np.zeros(self.robot.na)
        return Command(zero, np.array(self.data.qpos[self.places.joint_qpos]), zero)

    def measure(self) -> Measurement:
        """Return the readings of the sensors now; the same object until the next step.

        Raises:
            MeasurementError: The state is not finite: the simulation has diverged.
        """
        if self._measurement is not None:
            return self._measurement
        data, places = self.data, self.places
        q, v = data.qpos[places.joint_qpos], data.qvel[places.joint_dof]
        if not math.isfinite(q.dot(q) + v.dot(v) + self._specific_force.sum() + self._wrench.sum()):
            raise MeasurementError(f"no measurement at {self.time:.4f} s: the simulation has diverged")
        self._measurement = Measurement(
            self.time,
            q,
            v,
            self._gyroscope(),
            self._specific_force,
            self._wrench,
            np.full(len(places.feet), np.nan),
            np.full(len(places.feet), np.nan),
            self.actuators.torque(data),
        )
        return self._measurement

    def step(self, command: Command) -> None:
        """Advance by one control period under a command.

        Args:
            command: References of the servos and feed-forward torque, or torque alone.

        Raises:
            InputError: A command of the wrong shape or not finite; the simulation has not moved.
        """
        self.actuators.check(command)
        force, wrench = np.zeros(3), np.zeros_like(self._wrench)
        for _ in range(self.steps):
            self.actuators.apply(self.data, command)
            self._stepper(self.model, self.data)
            force += self._accelerometer()
            wrench += self._contacts.wrenches(self.data)
        self._specific_force, self._wrench = force / self.steps, wrench / self.steps
        # After a step MuJoCo's frames and sensors are those of its begin.
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        mujoco.mj_sensorVel(self.model, self.data)
        self._measurement = None

    def truth(self) -> GroundTruth:
        """Return the true state now; for logs, tests and pictures, never for a controller."""
        data, places = self.data, self.places
        q = configuration_from_mujoco(data.qpos[places.base_qpos :], places.joint_qpos - places.base_qpos)
        v = velocity_from_mujoco(q, data.qvel[places.base_dof :], places.joint_dof - places.base_dof)
        mujoco.mj_subtreeVel(self.model, data)
        position, force, sole = self._contacts.of_robot(data)
        return GroundTruth(
            time=self.time,
            q=q,
            v=v,
            com=data.subtree_com[places.root].copy(),
            com_velocity=data.subtree_linvel[places.root].copy(),
            joint_torque=self.actuators.torque(data),
            contact_position=position,
            contact_force=force,
            contact_sole=sole,
            sole_wrench=self._wrench.copy(),
        )

    def _gyroscope(self) -> Array:
        if self._imu.gyroscope is not None:
            place, turn = self._imu.gyroscope
            reading: Array = turn @ self.data.sensordata[place : place + 3]
            return reading
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(
            self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, self.places.imu_body, velocity, 1
        )
        turned: Array = self.places.imu.rotation.T @ velocity[:3]
        return turned

    def _accelerometer(self) -> Array:
        if self._imu.accelerometer is not None:
            place, turn = self._imu.accelerometer
            reading: Array = turn @ self.data.sensordata[place : place + 3]
            return reading
        model, data, body = self.model, self.data, self.places.imu_body
        mujoco.mj_rnePostConstraint(model, data)
        motion, kind = np.zeros((2, 6)), mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectAcceleration(model, data, kind, body, motion[0], 1)
        mujoco.mj_objectVelocity(model, data, kind, body, motion[1], 1)
        lever, omega = self.places.imu.translation, motion[1, :3]
        at_imu = motion[0, 3:] + np.cross(motion[0, :3], lever) + np.cross(omega, np.cross(omega, lever))
        turned: Array = self.places.imu.rotation.T @ at_imu
        return turned

    def _notes(self) -> list[str]:
        model, notes = self.model, []
        names = self.description.joint_names
        bare = [name for name, kind in zip(names, self.actuators.kinds, strict=True) if kind == "none"]
        if bare:
            some = ", ".join(bare[:3]) + (", …" if len(bare) > 3 else "")
            notes.append(f"{len(bare)} joints without an actuator get their torque directly: {some}")
        mass = float(model.body_subtreemass[self.places.root])
        if abs(mass - self.robot.mass) > OTHER_MASS * self.robot.mass:
            notes.append(
                f"the robot has {mass:.2f} kg in the model and {self.robot.mass:.2f} kg in the description"
            )
        for what, sensor in (("gyroscope", self._imu.gyroscope), ("accelerometer", self._imu.accelerometer)):
            if sensor is None:
                notes.append(f"no {what} on the IMU's body: computed from the motion")
        gravity = float(np.linalg.norm(model.opt.gravity))
        if abs(gravity - float(np.linalg.norm(self.robot.model.gravity.linear))) > 0.02:
            notes.append(f"gravity is {gravity:.3f} m/s² in the model")
        return notes
