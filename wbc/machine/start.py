"""The way of a machine from any posture to the touch of the ground: references, gains and torques of servos."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.signals import Command, Measurement
from wbc.core.trajectories import minimum_jerk
from wbc.machine.loads import SoleLoads

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
