"""A robot in somebody else's MuJoCo model, driven and measured like the plant of this library.

    loop = MujocoLoop(description, model, data)
    while loop.time < 10.0:
        loop.step(control.command(loop.measure()))

Command and measurement are those of a real robot.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from wbc.core.arguments import checked
from wbc.core.conventions import configuration_from_mujoco, velocity_from_mujoco
from wbc.core.errors import InputError, MeasurementError, whole_number
from wbc.core.robot import Robot, checked_configuration
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.sim.loop.actuators import JointActuators
from wbc.sim.loop.contacts import SoleContacts
from wbc.sim.loop.places import ImuSensors, find_imu, find_places
from wbc.sim.loop.signals import LoopSignals
from wbc.sim.plant.drives import DelayLine
from wbc.sim.plant.hands import check_clear
from wbc.sim.plant.model import body_frame
from wbc.sim.plant.pushes import Push, Pushes
from wbc.sim.plant.sensors import NO_NOISE, NOISE_PRESETS, SensorChain, SensorNoise
from wbc.sim.plant.settings import Machine, steps_per_tick, whole_steps
from wbc.sim.plant.truth import GroundTruth

logger = logging.getLogger(__name__)

OTHER_MASS = 0.01
"""Share of the mass by which model and description may differ without a note."""

REACHED = 0.99
"""Share of the torque limits that the ranges of the controls have to reach, or there is a note."""

DIVERGED = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}")) for what in ("QPOS", "QVEL", "QACC")]
"""Warnings after which MuJoCo has reset the simulation by itself, unless the model forbids it."""

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
    All are perfect and of the instant unless `noise` and `machine` say otherwise, as for `wbc.Plant`.

    Attributes:
        description: The robot as data.
        robot: The robot as a model, for names and sizes; its state is not kept up to date.
        model: MuJoCo's model.
        data: MuJoCo's state.
        control_period: Time that `step` advances, s.
        steps: Physics steps in it.
        noise: Sensor errors.
        machine: Delays, and which sensors there are.
        seed: Seed of the sensor errors.
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
        noise: str | SensorNoise = NO_NOISE,
        seed: int = 0,
        machine: Machine | None = None,
    ) -> None:
        """Find the robot in the model.

        Args:
            description: The robot.
            model: The model.
            data: Its state, taken as it is, with a warning if the robot is inside a thing; a new one with the robot at
                half-sitting on z = 0 when None.
            control_period: Time between two commands, s; a whole multiple of the physics step.
            joints: Joint of the robot → joint of the model, where the names differ.
            prefix: What the model puts before all names of the robot, such as "robot/".
            gyroscope: Sensor of the model; the one on the IMU's body when None, and computed if there is none.
            accelerometer: Likewise.
            stepper: Function that advances model and data by one physics step; `mujoco.mj_step` when None.
            noise: Sensor errors, or the name of a preset: "none", "realistic".
            seed: Seed of every random draw.
            machine: Delays and which sensors there are; torques are measured when None. Friction and payload are
                those of the model.

        Raises:
            UnknownNameError: A joint or sensor that the model has not, no such noise preset.
            ModelError: A model that does not hold this robot, or an actuator that cannot be commanded.
            InputError: A control period that is no multiple of the physics step, data of another model, a machine
                with friction, payload or hand sensors.
        """
        self.machine = machine or Machine(torque_sensors=True)
        if self.machine.friction > 0.0 or self.machine.payload > 0.0 or self.machine.hand_sensors:
            raise InputError(
                "a MuJoCo model of one's own has friction and payload in itself, and its hands are not measured: put "
                "them into the model, and leave friction, payload and hand_sensors of the machine alone"
            )
        description.needs_feet("a loop with sensors of a humanoid")
        self.noise = NOISE_PRESETS[noise] if isinstance(noise, str) else noise
        self.seed = whole_number("seed", seed, low=0)
        self.description, self.model = description, model
        self.robot: Robot = description.robot()
        self.control_period = float(control_period)
        self.steps = steps_per_tick(control_period, float(model.opt.timestep))
        self.places = find_places(model, description, joints or {}, prefix)
        self.actuators = JointActuators(model, description, self.places.joints, self.places.root)
        imu = find_imu(model, self.places, gyroscope, accelerometer)
        self._contacts = SoleContacts(model, self.places.root, self.places.feet, self.places.soles)
        self._signals = LoopSignals(model, self.places, imu, self._contacts, self.actuators, self.steps)
        timestep = float(model.opt.timestep)
        self._chain = SensorChain(
            self.noise,
            self.robot.na,
            len(self.places.feet),
            timestep,
            self.steps,
            delay=self.machine.measurement_delay,
            torques=True,
        )
        self._age = whole_steps(self.machine.measurement_delay, timestep) * timestep  # of measurements, s
        delay = whole_steps(self.machine.command_delay, timestep)
        self._late: DelayLine | None = DelayLine(delay) if delay > 0 else None
        self._pushes = Pushes()
        self._stepper: Stepper = mujoco.mj_step if stepper is None else stepper
        self.notes = tuple(self._notes(imu))
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
        try:
            check_clear(model, data, self._contacts.geom_robot)
        except InputError as error:
            self.notes += (f"the data begin so (reset() puts the robot into half-sitting): {error}",)
            logger.warning("%s", self.notes[-1])

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return float(self.data.time)

    def reset(self, configuration: ArrayLike | None = None, seed: int | None = None) -> None:
        """Put the robot, at rest and held by its drives, into a configuration; everything else stays where it is.

        Args:
            configuration: Shape (nq,); half-sitting on z = 0 when None.
            seed: New seed of the sensor errors; the same as before when None.

        Raises:
            InputError: A configuration of the wrong shape or not finite.
        """
        q = self.robot.half_sitting
        if seed is not None:
            self.seed = whole_number("seed", seed, low=0)
        if configuration is not None:
            q = checked_configuration("configuration", configuration, self.robot.nq)
        places = self.places
        places.set_configuration(q, self.data.qpos)
        self.data.qvel[places.base_dof : places.base_dof + 6] = 0.0
        self.data.qvel[places.joint_dof] = 0.0
        self.data.qacc_warmstart[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.actuators.apply(self.data, self.hold())
        self.actuators.settle(self.data)
        self._begin()

    def _begin(self) -> None:
        mujoco.mj_forward(self.model, self.data)
        self.actuators.begin(self.data)
        self._touching = self._contacts.of_robot(self.data)
        self._signals.begin(self.data)
        self._chain.reset(self._signals.values, self.seed)
        self._pushes.clear(self.data)
        self.data.warning.number[DIVERGED] = 0
        self._at_work = self.hold()
        if self._late is not None:
            self._late.clear()
        self._measurement: Measurement | None = None

    def hold(self) -> Command:
        """Return a command that holds the present joint positions with the servos."""
        zero = np.zeros(self.robot.na)
        return Command(zero, np.array(self.data.qpos[self.places.joint_qpos]), zero)

    def measure(self) -> Measurement:
        """Return the readings of the sensors now; the same object until the next step.

        Raises:
            MeasurementError: The simulation has diverged: the state is not finite, or MuJoCo has reset it.
        """
        if self._measurement is not None:
            return self._measurement
        reading, machine = self._chain.read(self._signals.values), self.machine
        if self.data.warning.number[DIVERGED].any() or not math.isfinite(reading.dot(reading)):
            raise MeasurementError(f"no measurement at {self.time:.4f} s: the simulation has diverged")
        reading.setflags(write=False)
        self._measurement = self._signals.measurement(
            reading,
            self.time - self._age,
            forces=machine.force_sensors,
            torques=machine.torque_sensors,
        )
        return self._measurement

    def step(self, command: Command) -> None:
        """Advance by one control period under a command.

        Args:
            command: References of the servos and feed-forward torque, or torque alone.

        Raises:
            InputError: A command of the wrong shape or not finite, or negative gains; the simulation has not moved.
        """
        step_together((self,), (command,))

    def push(self, body: str, force: ArrayLike, duration: float, at: ArrayLike | None = None) -> None:
        """Begin to push a body of the robot; pushes add up.

        Args:
            body: Link or frame of the robot; "torso" and "base" are its torso and base frames.
            force: In the world, shape (3,), N; constant.
            duration: s.
            at: Point of attack in the frame of that body, shape (3,), m; the centre of mass of its link when None.

        Raises:
            UnknownNameError: No such body; the nearest names are given.
            InputError: A force or point that is not three finite numbers, a duration that is not above zero.
        """
        index, place = self.places.carrier(self.model, self.robot, body_frame(body, self.robot))
        self._pushes.add(Push.at(index, place, force, duration, at))

    def truth(self) -> GroundTruth:
        """Return the true state now; for logs, tests and pictures, never for a controller."""
        data, places = self.data, self.places
        q = configuration_from_mujoco(data.qpos[places.base_qpos :], places.joint_qpos - places.base_qpos)
        v = velocity_from_mujoco(q, data.qvel[places.base_dof :], places.joint_dof - places.base_dof)
        mujoco.mj_subtreeVel(self.model, data)
        position, force, sole = self._touching
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
            sole_wrench=self._signals.wrenches(),
        )

    def _notes(self, imu: ImuSensors) -> list[str]:
        model, notes = self.model, []
        names = self.description.joint_names
        bare = [name for name, kind in zip(names, self.actuators.kinds, strict=True) if kind == "none"]
        if bare:
            some = ", ".join(bare[:3]) + (", …" if len(bare) > 3 else "")
            notes.append(f"{len(bare)} joints without an actuator get their torque directly: {some}")
        least, most = self.actuators.reach(self.robot.half_sitting[7:])
        reach, limit = np.minimum(-least, most), self.description.torque_limit
        if (short := reach < REACHED * limit).any():
            worst = int(np.argmin(np.where(short, reach / limit, np.inf)))
            notes.append(
                f"at half-sitting the controls of {np.count_nonzero(short)} joints end (ctrlrange) before their torque "
                f"limits, first {names[worst]}: {least[worst]:.4g} to {most[worst]:.4g} of ±{limit[worst]:.4g} Nm"
            )
        mass = float(model.body_subtreemass[self.places.root])
        if abs(mass - self.robot.mass) > OTHER_MASS * self.robot.mass:
            notes.append(
                f"the robot has {mass:.2f} kg in the model and {self.robot.mass:.2f} kg in the description"
            )
        displaced = self.places.displaced_mass(model, self.robot)
        if displaced is not None:
            notes.append(
                f"at half-sitting the centre of mass of the link of '{displaced[0]}' is {1e3 * displaced[1]:.0f} mm "
                "off in the model: the joint counts from another zero, or the mass is elsewhere"
            )
        weightless = int(np.count_nonzero(model.body_gravcomp[model.body_rootid == self.places.root]))
        if weightless:
            notes.append(
                f"gravity of {weightless} bodies is compensated in the model (gravcomp), not in the description"
            )
        for what, sensor in (("gyroscope", imu.gyroscope), ("accelerometer", imu.accelerometer)):
            if sensor is None:
                notes.append(f"no {what} on the IMU's body: computed from the motion")
        gravity = float(np.linalg.norm(model.opt.gravity))
        if abs(gravity - float(np.linalg.norm(self.robot.model.gravity.linear))) > 0.02:
            notes.append(f"gravity is {gravity:.3f} m/s² in the model")
        return notes


def step_together(loops: Sequence[MujocoLoop], commands: Sequence[Command]) -> None:
    """Advance robots in one simulation by one control period, each under its command.

    Args:
        loops: Loops of one model and data, with one control period.
        commands: A command each.

    Raises:
        InputError: A command of the wrong shape or not finite, or negative gains; the simulation has not moved.
    """
    for loop, command in zip(loops, commands, strict=True):
        loop.actuators.check(command)
    for loop, command in zip(loops, commands, strict=True):
        loop._measurement = None
        if loop._late is None:
            loop._at_work = command
        else:
            loop._late.push(command)
    model, data = loops[0].model, loops[0].data
    for left in range(loops[0].steps - 1, -1, -1):
        for loop in loops:
            if loop._late is not None:
                loop._at_work = loop._late.advance() or loop._at_work
            loop.actuators.apply(data, loop._at_work)
            if loop._pushes:
                loop._pushes.apply(data, model.opt.timestep)
        loops[0]._stepper(model, data)
        for loop in loops:
            if left == 0:  # what follows finds contacts anew, and leaves their forces as they were
                loop._touching = loop._contacts.of_robot(data)
            loop._signals.record(data)
        reading = [
            loop
            for loop in loops
            if loop._chain.oldest > 0 and loop._chain.newest <= left <= loop._chain.oldest
        ]
        if reading or left == 0:
            # After a step MuJoCo's frames and sensors are those of its begin.
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_sensorVel(model, data)
            for loop in loops if left == 0 else reading:
                loop._signals.sample(data)
        for loop in reading:
            loop._chain.push(loop._signals.values)
