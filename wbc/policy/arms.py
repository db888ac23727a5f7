"""Arms by the QP while a policy moves legs and waist: the pelvis is carried by whatever carries it.

Legs and feet act on the arms by the motion of the pelvis alone. With this motion measured by its IMU, they drop out of
the arms' equations of motion, and no force sensors are needed:

    M a + h = Sᵀ τ + J_imuᵀ f,    J_imu a + J̇ v = (s + Rᵀ g, ω̇),    a_policy as measured

with the specific force s and the angular rate ω of the IMU, its rotation R, any wrench f, and the joints of the policy.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.errors import NoSolutionError
from wbc.base.numbers import Array, lag_gain
from wbc.core.frames import frame_jacobian
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import Contact
from wbc.core.qp.controller import Controller
from wbc.core.qp.options import ContactOptions
from wbc.core.qp.released import ReleasedJoints
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.tasks import PostureTask

logger = logging.getLogger(__name__)

FORCE_LAG, RATE_LAG = 0.005, 0.01
"""Time constants of the low-passes of the specific force and of the differentiated angular rate, s. With less of them
the impacts of the feet reach the arms, with more the hands lag behind the trunk."""


class Carried(Contact):
    """Frame of the IMU, held by any wrench, with the acceleration that the IMU measures.

    Attributes:
        acceleration: Acceleration of the frame, [linear; angular] along its axes, shape (6,), m/s² and rad/s².
    """

    dim = 6
    ranged: ClassVar[tuple[int, ...]] = ()
    usual: ClassVar[ContactOptions] = {"stiffness": 0.0, "damping": 0.0, "wrench_weight": 1e-9}

    def __init__(self, robot: Robot, dt: float) -> None:
        super().__init__("carried by the policy", robot.imu_frame, np.zeros((0, 6)))
        self.acceleration = np.zeros(6)
        self._dt = dt
        self._gains = lag_gain(dt, FORCE_LAG), lag_gain(dt, RATE_LAG)
        self._rate: Array | None = None  # in the tick before, rad/s

    def reset(self) -> None:
        """Forget the motion so far."""
        super().reset()
        self.acceleration[:] = 0.0
        self.forget_rate()

    def measured(self, measurement: Measurement) -> None:
        """Take the readings of a tick, in which the robot has been updated; none where one of them is not finite."""
        rate, force, (linear, angular) = measurement.angular_velocity, measurement.specific_force, self._gains
        if not np.isfinite((rate, force)).all():
            self.forget_rate()
            return
        up = self._placement.rotation[2]
        now = self.acceleration
        now[:3] += linear * (force - GRAVITY * up - now[:3])
        if self._rate is not None:
            now[3:] += angular * ((rate - self._rate) / self._dt - now[3:])
        self._rate = rate.copy()

    def forget_rate(self) -> None:
        """Differentiate nothing in the next tick, because the rate is not that of the tick before."""
        self._rate = None

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Contact`."""
        model, data = self._model, self._data
        jacobian[:] = frame_jacobian(model, data, self._id, pin.LOCAL)
        error[:] = 0.0
        drift[:] = pin.getFrameClassicalAcceleration(model, data, self._id, pin.LOCAL).vector
        drift -= self.acceleration


class PolicyArms(ABC):
    """Arms that a controller shares with a policy, on a robot whose other joints and whose base the policy moves.

    Attributes:
        controller: The controller, with the base carried, no contacts, and all other joints released.
        index: Columns of their joints in arrays of the robot's joints, shape (number of joints,).
        failure: Reason for which the last tick had no torques; empty if it had them.
        remark: Words about its torques for the status; empty for none.
        changed: Torques of the joints that a filter has changed in the last tick, shape (na,), Nm.
        otherwise: What the arms are in a tick without torques.
    """

    otherwise: ClassVar[str]

    def __init__(self, controller: Controller, joints: Sequence[str]) -> None:
        """Carry the base of a controller without contacts, and release all other joints.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A joint of a leg, or one twice.
        """
        robot = controller.robot
        self.index: NDArray[np.intp] = ReleasedJoints(robot, joints).index  # refuses legs
        self.controller = controller
        self._carried = controller.add(Carried(robot, controller.dt))
        others = [name for name in robot.joint_names if name not in set(joints)]
        self._others = controller.add(ReleasedJoints(robot, others, commanded=True))
        self.reset()

    def reset(self) -> None:
        """Forget what the last tick said of the arms."""
        self.failure = self.remark = ""
        self.changed = np.zeros(self.controller.robot.na)

    @abstractmethod
    def servos(self, measurement: Measurement, target: Array, asked: Array) -> tuple[Array, Array, Array]:
        """Return feed-forward torques, Nm, and references of the servos, rad and rad/s, shape (na,) each.

        Args:
            measurement: Measurement of this tick.
            target: Positions that the policy wants, shape (na,), rad.
            asked: Torques that the servos of the policy make now, shape (na,), Nm.
        """

    def forget_rate(self) -> None:
        """See `Carried.forget_rate`; after ticks without torques."""
        self._carried.forget_rate()

    def _tried(self, solve: Callable[..., Array], *arguments: object) -> Array | None:
        """Return the torques that a QP makes of arguments, shape (number of joints,), Nm; None without a solution."""
        try:
            torques, failure = solve(*arguments), ""
        except NoSolutionError as error:
            torques, failure = None, str(error)
        except Exception as error:  # of tasks and limits of the user
            torques, failure = None, f"{type(error).__name__}: {error}"
        if failure and not self.failure:
            logger.error("no torques for the arms (%s)", failure)
        self.failure = failure
        return torques


class MovedArms(PolicyArms):
    """Arms that the tasks of the controller move.

    Attributes:
        posture: Task on the posture of the arms.
    """

    otherwise = "damped"

    def __init__(self, controller: Controller, joints: Sequence[str], default: Array, damping: Array) -> None:
        """Hold a posture, rad, within the limits of the joints; without a solution they are damped, Nms/rad.

        Posture and damping are of all joints of the robot, shape (na,).
        """
        super().__init__(controller, joints)
        self._damping = damping[self.index]
        self.posture = controller.add(PostureTask(default[self.index], joints=list(joints)))
        controller.add(JointLimits(), TorqueLimits())
        self._feed, self._rest = np.zeros((2, controller.robot.na))

    def servos(self, measurement: Measurement, target: Array, asked: Array) -> tuple[Array, Array, Array]:
        """See `PolicyArms.servos`; the servos of the arms hold what is measured."""
        torque, target, index = self._feed, target.copy(), self.index
        made, velocity = self.torques(measurement), measurement.joint_velocity[index]
        torque[index] = -self._damping * velocity if made is None else made
        target[index] = measurement.joint_position[index]
        return torque, target, self._rest

    def torques(self, measurement: Measurement) -> Array | None:
        """Return the torques of the arms, shape (number of joints,), Nm; None where the QP has no solution."""
        return self._tried(self._solve, measurement)

    def _solve(self, measurement: Measurement) -> Array:
        self._carried.measured(measurement)
        solution = self.controller.solve(measurement)
        if not solution.ok:
            raise NoSolutionError(solution.status.value)
        return np.asarray(solution.torques[self.index])
