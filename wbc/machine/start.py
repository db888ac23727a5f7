"""Way of a machine from any posture to its feet: on servos to the touch of the ground, then balanced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.drive.control import Control
from wbc.core.drive.torque import TorqueControl
from wbc.core.frames import yaw_rotation
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.signals import Command, Measurement
from wbc.core.trajectories import minimum_jerk
from wbc.machine.loads import SoleLoads
from wbc.robots import RobotDescription
from wbc.tasks.balance import BalanceGains, balance_controller

MEAN = 0.5
"""Time constant of the lean of a robot that hangs, s."""

SPEED = 0.3
"""Largest speed of the legs that follow the lean, rad/s."""

TOUCH = 0.05
"""Share of the weight on the soles from which the legs no longer follow the lean."""

MARGIN = 0.1
"""Distance that the legs keep from the ends of their range, rad."""

LONGEST = 0.02
"""Longest time over which a reference moves on in one tick, s."""

SETTLE = 1.5
"""Time in which trunk and pelvis turn from where the robot was caught to upright, s."""

STEP = 0.05
"""Distance of the centre of mass's target from where it is, at most, m."""

GAINS = BalanceGains(
    orientation_weight=20.0, orientation_stiffness=60.0, posture_weight=0.1, posture_stiffness=60.0
)
"""Stiff trunk and posture: feet with little load cannot move the CoM, and a body that bends for it swings."""


class SafeStart:
    """Ramp from the measured posture to half-sitting, and from there on the legs of a robot that hangs.

    The servos hold the measured posture while their stiffness rises, then the joints go to half-sitting along a
    quintic. Feed-forward torques carry the limbs as they hang, less what the soles carry; they rise with the
    stiffness.

    Attributes:
        duration: Time until the joints have arrived, s.
    """

    def __init__(
        self,
        robot: Robot,
        first: Measurement,
        loads: SoleLoads,
        *,
        fade: float,
        speed: float,
        gains: tuple[Array, Array],
    ) -> None:
        """Plan the motion from the posture of the first measurement.

        Stiffness and torques rise in `fade` seconds, 0 for servos that hold already; `speed` is the largest mean speed
        of a joint on the way, rad/s; `gains` are kp and kd of the machine, each of shape (na,).
        """
        self._robot, self._loads = robot, loads
        self._kp, self._kd = gains
        self._from = np.array(first.joint_position)
        self._to = np.array(robot.half_sitting[7:])
        self._fade = fade
        self._way = max(0.5, float(np.abs(self._to - self._from).max()) / speed)
        self.duration = fade + self._way
        self._zero = np.zeros(robot.na)
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._landing = Landing(robot, loads)

    def command(self, measurement: Measurement, elapsed: float) -> Command:
        """Return the command at a measurement, `elapsed` seconds after the start."""
        part = self.part(elapsed)
        torque = part * self.carry(measurement)
        if elapsed >= self.duration:
            return Command(torque, self._landing.reference(measurement), self._zero, kp=self._kp, kd=self._kd)
        s = min(1.0, max(0.0, (elapsed - self._fade) / self._way))
        (shape, slope), way = minimum_jerk(s), self._to - self._from
        rate = slope / self._way
        return Command(torque, self._from + shape * way, rate * way, kp=part * self._kp, kd=self._kd)

    def part(self, elapsed: float) -> float:
        """Return the share of stiffness and torques that has risen, `elapsed` seconds after the start."""
        return min(1.0, elapsed / self._fade) if self._fade > 0.0 else 1.0

    def carry(self, measurement: Measurement) -> Array:
        """Return the torques that hold the limbs against gravity and the load of the soles, shape (na,), Nm."""
        robot = self._robot
        self._loads.wrenches(measurement)
        q = self._loads.posture(measurement)
        torque = np.array(pin.computeGeneralizedGravity(robot.model, robot.data, q)[BASE_DOF:])
        torque += robot.spring_torques(q)
        # The normal forces alone: moments fed forward would be the servos' own, added to themselves.
        for frame, normal in zip(self._soles, self._loads.normal.tolist(), strict=True):
            jacobian = pin.computeFrameJacobian(robot.model, robot.data, q, frame, pin.LOCAL)
            torque -= normal * jacobian[2, BASE_DOF:]
        limit: Array = np.clip(torque, robot.torque_lower, robot.torque_upper)
        return limit


class Landing:
    """Legs of a robot that hangs: soles level and under the centre of mass, however the body hangs.

    A body that hangs by its torso leans until its centre of mass is below the hook. Legs at half-sitting would touch
    the ground with their toes, far behind the centre of mass, and the robot would tip over whatever the soles carry.
    The legs turn until the feet are where the weight will be, by damped least squares a little in every tick; the lean
    changes with them, and settles.
    """

    def __init__(self, robot: Robot, loads: SoleLoads) -> None:
        """Start at half-sitting; the robot's model is used."""
        self._robot, self._loads = robot, loads
        model, data = robot.model, robot.model.createData()
        self._data, self._q = data, np.array(robot.half_sitting)
        self._frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        pin.framesForwardKinematics(model, data, self._q)
        com = pin.centerOfMass(model, data, self._q)
        self._places = [data.oMf[frame].translation - com for frame in self._frames]
        self._turns = [np.array(data.oMf[frame].rotation) for frame in self._frames]
        joints = {j for f in self._frames for j in model.supports[model.frames[f].parentJoint] if j > 1}
        self._columns = np.array(sorted(model.joints[j].idx_v for j in joints))
        legs = self._columns - BASE_DOF
        lower, upper = robot.position_lower[legs], robot.position_upper[legs]
        middle = self._q[7 + legs]
        self._lower, self._upper = np.minimum(lower + MARGIN, middle), np.maximum(upper - MARGIN, middle)
        self._attitude: Array = np.eye(3)
        self._time = -np.inf

    def reference(self, measurement: Measurement) -> Array:
        """Return the joint positions to hold, shape (na,), rad; from the first touch on they stay as they are."""
        q, model, data = self._q, self._robot.model, self._data
        passed = min(max(measurement.time - self._time, 0.0), LONGEST)
        self._time = measurement.time
        if self._loads.share > TOUCH:
            return np.array(q[7:])
        hangs = pin.Quaternion(self._loads.posture(measurement)[3:7]).matrix()
        roll, pitch, _ = pin.rpy.matrixToRpy(hangs)
        turn = pin.log3(self._attitude.T @ pin.rpy.rpyToMatrix(roll, pitch, 0.0))
        self._attitude = self._attitude @ pin.exp3(passed / MEAN * turn)
        q[3:7] = pin.Quaternion(self._attitude).coeffs()
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        com_jacobian = pin.jacobianCenterOfMass(model, data, q)
        rows, errors = [], []
        for frame, place, turned in zip(self._frames, self._places, self._turns, strict=True):
            jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            rows += [jacobian[:3] - com_jacobian, jacobian[3:]]
            errors += [place - (data.oMf[frame].translation - data.com[0])]
            errors += [pin.log3(turned @ data.oMf[frame].rotation.T)]
        matrix, error = np.concatenate(rows)[:, self._columns], np.concatenate(errors)
        step = matrix.T @ np.linalg.solve(matrix @ matrix.T + 1e-4 * np.eye(len(error)), error)
        at = self._columns + 1
        q[at] = np.clip(q[at] + np.clip(step, -passed * SPEED, passed * SPEED), self._lower, self._upper)
        return np.array(q[7:])


class Stand:
    """Balance of a robot that a crane, a band or a hand still holds in part.

    Torques of the balance controller, under the damping of the motors. What holds the robot besides the ground
    (`SoleLoads.outside`) enters the dynamics of the QP, so that the feet press with what is theirs.

    Attributes:
        control: The balance, by torques.
    """

    def __init__(
        self, description: RobotDescription, period: float, loads: SoleLoads, damping: Array
    ) -> None:
        """Make the balance controller, and run it on a robot at rest, so that no later tick loads code.

        `period` is that of the control, s; `damping` is kd of the motors, shape (na,), Nms/rad.
        """
        robot = description.robot()
        self._loads, self._damping, self._zero = loads, damping, np.zeros(robot.na)
        self.control = TorqueControl(balance_controller(robot, period, GAINS))
        task: Callable[[str], Any] = self.control.controller.task
        self._com = task("com")
        self._com_goal = np.array(self._com.target)
        self._upright = [task(name) for name in ("base", "torso")[: len(robot.trunk_frames)]]
        self._turns: list[tuple[Array, Array]] = []
        self._ends = [np.array(task.target) for task in self._upright]
        self._elapsed = 0.0
        warm_up(self.control, robot, period, forces=True)

    def begin(self, measurement: Measurement) -> None:
        """Start from a measurement that the loads have seen, its soles where those of half-sitting are."""
        robot = self.control.controller.robot
        self.control.reset(standing(robot, self._loads.posture(measurement)))
        self._elapsed = 0.0
        caught = [np.array(robot.placement(task.frame).rotation) for task in self._upright]
        self._turns = [
            (first, pin.log3(first.T @ last)) for first, last in zip(caught, self._ends, strict=True)
        ]

    def command(self, measurement: Measurement) -> Command:
        """Return the command of a tick."""
        wrench = np.array(self._loads.wrenches(measurement, self.control.observer.measured_state))
        state = self.control.estimate(replace(measurement, sole_wrench=wrench))
        self._aim(state.robot)
        torque = self.control.act(state).joint_torque
        return Command(torque, measurement.joint_position, self._zero, kp=self._zero, kd=self._damping)

    def _aim(self, robot: Robot) -> None:
        """Set the targets: the centre of mass goes home, trunk and pelvis turn upright."""
        controller = self.control.controller
        controller.outside = self._loads.outside
        com = np.array(robot.com)
        self._com.target = com + np.clip(self._com_goal - com, -STEP, STEP)
        self._elapsed += controller.dt
        s = min(1.0, self._elapsed / SETTLE)
        part, _ = minimum_jerk(s)
        for task, (first, turn) in zip(self._upright, self._turns, strict=False):
            task.target = first @ pin.exp3(part * turn)


def standing(robot: Robot, q: Array) -> Array:
    """Return a configuration with its soles, in the mean, where those of half-sitting are, shape (nq,)."""
    data = robot.model.createData()

    def middle(q: Array) -> tuple[Array, float]:
        pin.framesForwardKinematics(robot.model, data, q)
        soles = [data.oMf[robot.frame_id(sole.frame)] for sole in robot.soles]
        ahead = sum(sole.rotation[:2, 0] for sole in soles)
        return sum(sole.translation for sole in soles) / len(soles), float(np.arctan2(ahead[1], ahead[0]))

    place, heading = middle(np.array(robot.half_sitting))
    q = np.array(q)
    turn = pin.Quaternion(yaw_rotation(heading - middle(q)[1]))
    q[3:7] = (turn * pin.Quaternion(q[3:7])).coeffs()
    q[:3] += place - middle(q)[0]
    return q


def warm_up(control: Control, robot: Robot, period: float, *, forces: bool) -> None:
    """Run some ticks on a robot at rest where it is, so that the first real ones do not load code and memory.

    A control that cannot be reset afterwards is left alone; `forces` tells whether the robot has force sensors.
    """
    if not control.restarts:
        return
    control.reset()  # it may have run before
    resting = Measurement.resting(robot)
    for i in range(20):
        wrench = resting.sole_wrench if forces else None
        control.command(replace(resting, time=i * period, sole_wrench=wrench))
    control.reset()
