"""Commands of joints to the actuators of any MuJoCo model: motors, servos of position and velocity, general ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.core.conventions import Index
from wbc.core.signals import Command
from wbc.robots import RobotDescription
from wbc.robots.readers.actuators_mjcf import JointActuator, actuators, switched_off
from wbc.sim.plant.places import RobotPlaces

DISCRETE = int(mujoco.mjtIntegrator.mjINT_DISCRETE)
"""Integrator under which servos of the file act on velocity and position at the end of a step."""

IMPLICIT = (DISCRETE, int(mujoco.mjtIntegrator.mjINT_IMPLICIT), int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST))
"""Integrators under which they act on the velocity at its end."""

DRIVES = ("motor", "position", "velocity")
"""Names of the kinds of actuators; the first one of a joint takes its feed-forward."""

MOTOR, POSITION, VELOCITY = range(3)
"""Their numbers."""


class ActuatorTable(NamedTuple):
    """Actuators of the robot's joints that act, one entry each; a joint may have several.

    An actuator's force on its joint is gear (g u + b₀ + b₁ gear q + b₂ gear q̇): a motor has no b, a position servo
    b₁ = −kp and b₂ = −kv, a velocity servo b₂ alone, a general actuator any of these.

    Attributes:
        number: Number of the actuator in the model, shape (n,).
        control: Number of its control in the model, shape (n,).
        joint: Number of the joint in the robot's order, shape (n,).
        gear: Force on the joint over that of the actuator, shape (n,).
        gain: Force of the actuator over its control, g, shape (n,).
        bias: b₀, b₁ and b₂, shape (n, 3).
        kind: Kind of the actuator, a number in `DRIVES`, shape (n,).
    """

    number: Index
    control: Index
    joint: Index
    gear: Array
    gain: Array
    bias: Array
    kind: Index

    @staticmethod
    def of(found: Sequence[tuple[JointActuator, int]]) -> ActuatorTable:
        """Return the table of actuators, each with the number of its joint."""
        bias = np.array([each.bias for each, _ in found]).reshape(-1, 3)
        _, position, velocity = bias.T != 0.0
        return ActuatorTable(
            number=np.array([each.number for each, _ in found], dtype=np.intp),
            control=np.array([each.control for each, _ in found], dtype=np.intp),
            joint=np.array([joint for _, joint in found], dtype=np.intp),
            gear=np.array([each.gear for each, _ in found]),
            gain=np.array([each.gain for each, _ in found], dtype=np.float64),
            bias=bias,
            kind=np.where(position, POSITION, np.where(velocity, VELOCITY, MOTOR)),
        )

    def own(self, position: Array, velocity: Array) -> Array:
        """Return the force of each actuator at a control of zero, by position and velocity of the joints."""
        own: Array = self.bias[:, 0] + self.gear * (
            self.bias[:, 1] * position[self.joint] + self.bias[:, 2] * velocity[self.joint]
        )
        return own


class JointActuators:
    """Actuators of the robot's joints, as the file has them; `ActuatorTable` has their law.

    Of a pid the control u is the position, its other controls are zero. Several actuators of one joint add up. Those of
    a group that the file switches off are left alone. A joint without an actuator that acts gets its torque directly.

    - References without gains go to the servos that there are: they act with the gains of the file, and the
      feed-forward is added.
    - Everything else is a torque, computed anew in every physics step: torque control, gains that come with the
      command, and joints that have no position servo (`_computed`), for which the gains are the description's. What
      a servo of the file adds to it (`_of_file`) is subtracted.

    Attributes:
        servo: True for joints with a position servo in the file, shape (na,).
        kinds: Name of each joint's drive: "motor", "position", "velocity", "none" or a sum of these.
        bare: Numbers of the joints without an actuator, but for passive ones.
        applied: Torques that were put on joints without an actuator in the last step, shape (na,), Nm.
        taken: Difference of the torques of the file's servos between the end and the beginning of the last step,
            shape (na,), Nm: MuJoCo reports those at the beginning.
    """

    def __init__(self, places: RobotPlaces, description: RobotDescription) -> None:
        """Find the actuators of the robot's joints, or raise a `ModelError`."""
        self._model = model = places.model
        self._qpos, self._dof = places.joint_qpos, places.joint_dof
        na, names, robot = len(places.joints), description.joint_names, description.robot()
        self._limits = robot.torque_lower, robot.torque_upper
        self._gains = np.array(description.kp), np.array(description.kd)
        found = _acting(places, names)
        self._table = table = ActuatorTable.of(found)
        self._controls = [list(each.controls) for each, _ in found]
        spare = [control for each, _ in found for control in each.controls if control != each.control]
        self._spare = np.array(spare, dtype=np.intp)  # further controls of an actuator, which stay zero
        in_order = np.lexsort((table.kind, table.joint))
        _, first = np.unique(table.joint[in_order], return_index=True)  # a motor, if the joint has one
        self._main = np.isin(np.arange(len(found)), in_order[first])  # takes the feed-forward
        self.servo = np.isin(np.arange(na), table.joint[table.kind == POSITION])
        self._no_servo = np.zeros_like(self.servo)
        kinds = [[DRIVES[drive] for drive in table.kind[table.joint == joint]] for joint in range(na)]
        self.kinds = tuple(" + ".join(kind) or "none" for kind in kinds)
        idle = set(description.passive)  # what moves them is not a drive
        bare = [i for i, name in enumerate(names) if not kinds[i] and name not in idle]
        self.bare = np.array(bare, dtype=np.intp)
        self.applied, self.taken = np.zeros(na), np.zeros(na)
        self._robot = np.flatnonzero(places.of_robot[model.dof_bodyid])
        self._joints = np.searchsorted(self._robot, self._dof)
        self._mass = np.zeros((model.nv, model.nv))
        self._sprung = bool(table.bias[:, 1:].any())
        self._speed = np.zeros(na)  # of the joints before the last step, rad/s

    def reach(self, position: Array) -> tuple[Array, Array]:
        """Return least and greatest torque at rest that the controls' ranges leave, shape (na,), Nm; inf without."""
        least, most = np.full(position.size, -np.inf), np.full(position.size, np.inf)
        model, table, chosen = self._model, self._table, np.flatnonzero(self._main)
        if switched_off(model, mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL):
            return least, most
        for i in chosen[model.actuator_ctrllimited[table.control[chosen]].astype(bool)]:
            joint, gear, bias = table.joint[i], table.gear[i], table.bias[i]
            own = bias[0] + bias[1] * gear * position[joint]
            ends = gear * (table.gain[i] * model.actuator_ctrlrange[table.control[i]] + own)
            least[joint], most[joint] = ends.min(), ends.max()
        return least, most

    def apply(self, data: mujoco.MjData, command: Command) -> None:
        """Write the controls of the coming physics step for a checked command; the state is up to date."""
        table, position, velocity = self._table, command.joint_position, command.joint_velocity
        follows = position is not None and command.kp is None and command.kd is None
        at_servo = self.servo if follows else self._no_servo
        torque = command.joint_torque  # of motors; beside a servo of the file that follows the feed-forward
        if position is not None and not at_servo.all():
            torque = np.where(at_servo, torque, self._computed(data, command, position, at_servo))
        own = self._of_file(data, at_servo[table.joint])
        if position is not None and follows:
            there = table.own(position, np.zeros_like(position) if velocity is None else velocity)
            own = np.where(at_servo[table.joint], there, own)
        force = np.where(self._main, torque[table.joint] / table.gear, 0.0)
        data.ctrl[table.control] = (force - own) / table.gain
        if self._spare.size:
            data.ctrl[self._spare] = 0.0
        if self.bare.size:
            clipped = np.clip(torque, *self._limits)[self.bare]
            self.applied[self.bare] = clipped
            data.qfrc_applied[self._dof[self.bare]] = clipped

    def switch_off(self, data: mujoco.MjData) -> None:
        """Take the controls and torques of the last command away, and what actuators keep of it."""
        data.ctrl[self._table.control] = 0.0
        data.qfrc_applied[self._dof[self.bare]] = 0.0
        self.settle(data)
        self.begin(data)

    def begin(self, data: mujoco.MjData) -> None:
        """Take the present speeds for those before the first step."""
        self._speed = data.qvel[self._dof]
        self.taken.fill(0.0)

    def settle(self, data: mujoco.MjData) -> None:
        """Put actuators with a lag or a delay where their controls are, as after a long time at them."""
        model, table = self._model, self._table
        states = model.actuator_actadr[table.number]
        data.act[states[states >= 0]] = data.ctrl[table.control[states >= 0]]
        for number, controls in zip(table.number, self._controls, strict=True):
            if n := int(model.actuator_history[number, 0]):
                times = data.time + model.opt.timestep * np.arange(-n, 0.0)[:, None]
                mujoco.mj_initCtrlHistory(model, data, number, times, np.tile(data.ctrl[controls], (n, 1)))

    def torque(self, data: mujoco.MjData) -> Array:
        """Return the torques of all drives in the last physics step, shape (na,), Nm."""
        torque: Array = data.qfrc_actuator[self._dof] + self.applied + self.taken
        return torque

    def _computed(
        self, data: mujoco.MjData, command: Command, position: Array, at_servo: NDArray[np.bool_]
    ) -> Array:
        """Return feed-forward and computed servo, shape (na,), Nm; joints at a servo of the file get none here.

        It acts on the position and velocity at the end of the step, as far as the robot's mass matrix and the forces of
        the last step foretell them, so that stiff gains are stable at a physics step of a millisecond or two ("stable
        PD": Tan, Liu & Turk, IEEE CG&A 31(4), 2011).
        """
        q, v = data.qpos[self._qpos], data.qvel[self._dof]
        kp, kd = command.gains(self._gains)
        kp, kd = np.where(at_servo, 0.0, kp), np.where(at_servo, 0.0, kd)
        velocity = np.zeros_like(v) if command.joint_velocity is None else command.joint_velocity
        dt = self._model.opt.timestep
        pull: Array = command.joint_torque + kp * (position - q - dt * v) + kd * (velocity - v)
        damping = kd + dt * kp
        if not damping.any():
            return pull
        mujoco.mj_fullM(self._model, data, self._mass)
        mass = self._mass[np.ix_(self._robot, self._robot)]
        force = data.qfrc_passive + data.qfrc_constraint - data.qfrc_bias
        force = force[self._robot]
        force[self._joints] += pull
        mass[self._joints, self._joints] += dt * damping
        acceleration = np.linalg.solve(mass, force)[self._joints]
        servo: Array = pull - dt * damping * acceleration
        return servo

    def _of_file(self, data: mujoco.MjData, held: NDArray[np.bool_]) -> Array:
        """Return the force of each actuator at a control of zero in the coming step, shape (n,).

        Under an implicit integrator it is the force at the end of the step, foretold by the acceleration of the last
        step. What that changes of the torque that MuJoCo reports is `taken`, but for actuators `held` at a reference.
        """
        table, option = self._table, self._model.opt
        if not self._sprung:
            constant: Array = table.bias[:, 0]
            return constant
        q, v = data.qpos[self._qpos], data.qvel[self._dof]
        own = table.own(q, v)
        if option.integrator not in IMPLICIT:
            return own
        v_end = v + (v - self._speed)  # at the acceleration of the last step
        self._speed = v
        at_end = table.own(q + option.timestep * v_end if option.integrator == DISCRETE else q, v_end)
        self.taken.fill(0.0)
        np.add.at(self.taken, table.joint, np.where(held, 0.0, table.gear * (at_end - own)))
        return at_end


def _acting(places: RobotPlaces, names: Sequence[str]) -> list[tuple[JointActuator, int]]:
    """Return the actuators that act on joints of the robot, each with the number of its joint, or refuse one."""
    found, of_joint = [], {joint: i for i, joint in enumerate(places.joints)}
    for each in actuators(places.model):
        if (joint := of_joint.get(each.joint)) is None or not each.on:
            continue
        what = f"actuator '{each.name}' of joint '{names[joint]}'"
        if each.gain is None:
            raise ModelError(
                f"{what} must be a motor, a servo of position or velocity, a general one with a fixed gain, or a pid "
                f"without an integral term and without a bound of its speed; got {each.kind}"
            )
        if each.gain == 0.0 or each.gear == 0.0:
            raise ModelError(f"{what} has a gain or a gear of zero")
        found.append((each, joint))
    return found
