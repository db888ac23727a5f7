"""Set-points of the body of a robot that walks: height of the CoM, lean and turn of the trunk, and gaze, at any tick.

Each goes to what it is set to with bounded speed and acceleration, so that a walk goes on meanwhile; what the robot
cannot reach is refused by name. Nothing is computed until a set-point is assigned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.core.frames import yaw_rotation
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.limits.joint import JointLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY, Robot
from wbc.core.trajectories import approach
from wbc.tasks.motion.frame import LookAtTask, PoseTask, PositionTask
from wbc.tasks.stabilizer.lean import LeanMotion
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.plans.leg import Leg, vertical_joint
from wbc.walking.source import ReferenceSource

SPEED, ACCELERATION = 0.1, 0.5
"""Greatest speed (m/s) and acceleration (m/s²) of the height: a twentieth of gravity hardly changes the pendulum."""

TURN_SPEED, TURN_ACCELERATION = 0.5, 2.0
"""Greatest speed (rad/s) and acceleration (rad/s²) of the trunk."""

MOST_LEAN = 0.35
"""Greatest lean of the trunk, rad: about half of the tilt that counts as a fall."""

HIP_TURN = 0.3
"""Greatest turn of a trunk without a joint of the waist about the vertical, rad: the hips turn then."""

STEPPING_TURN = 0.6
"""Greatest turn of the torso of a robot that balances by its steps, rad.

`g1` looked behind itself at up to 0.4 m/s and 0.5 rad/s: to 1.1 rad it fell in 3 of 10 walks, to 0.8 rad in
none of 9.
"""

MARGIN = 0.05
"""Distance of a joint to its limit that is left at an extreme set-point, rad."""

GAZE_WEIGHT, GAZE_STIFFNESS, GAZE_BOUND = 1.0, 30.0, 0.3
"""Gaze of a neck: cost per (rad/s²)², a tenth of that of the trunk; 1/s²; greatest error that acts, rad: it turns at
0.8 rad/s."""

NEAREST = 0.3
"""Horizontal distance of a point from the CoM from which on a trunk turns to it, m: below, its direction whirls."""

BEHIND = 0.75 * math.pi
"""Direction from which on a point counts as behind the robot, rad: the trunk keeps its side there, where the direction
changes its sign."""

ARRIVED = 1e-3
"""Distance from a set-point, m and rad, below which it counts as reached."""

ENDED, LOOKS = (1e-7, 1e-6), (0.05, 0.2)
"""Distance from all set-points, m and rad, and speed below which the motion to them ends: less than is seen; the same
between a trunk and the direction of a point, rad and rad/s, below which it looks there."""


class Twist(NamedTuple):
    """Turn of the trunk against the heading."""

    angle: float  # rad
    rate: float  # its speed, rad/s
    acceleration: float  # its acceleration, rad/s²
    by_waist: bool  # true if the waist turns the torso against the pelvis; otherwise both turn on the hips

    @property
    def links(self) -> tuple[Twist, Twist]:
        """Twists of pelvis and torso."""
        return UNTWISTED if self.by_waist else self, self


UNTWISTED = Twist(0.0, 0.0, 0.0, by_waist=False)
"""No turn."""


class Body:
    """Set-points of the body.

        walking.body.com_height = 0.70       # m over the soles
        walking.body.lean = (0.0, 0.2)       # roll and pitch of the trunk, rad
        walking.body.turn = 0.3              # of the trunk against the heading, rad
        walking.body.look_at([2.0, 0.5, 1.2])

    Joints of arms and neck go where `walking.tasks.posture.move_to({joint: angle})` sends them.

    Attributes:
        active: False while nothing is set, and nothing has to be done.
    """

    __slots__ = (
        "_controller", "_robot", "_source", "_dt", "_nominal", "_reaching", "_most_turn", "_waist", "_neck", "_lowest",
        "_goal", "_now", "_rate", "_acceleration", "_gaze", "_point", "_heading", "active",
    )  # fmt: skip

    def __init__(
        self,
        controller: Controller,
        source: ReferenceSource,
        com_height: float,
        *,
        most_turn: float = math.inf,
        reaching: float = 1.0,
    ) -> None:
        """Leave all to a source of references: height of its CoM (m), greatest turn (rad).

        Its posture holds the neck 1 / `reaching` times as firmly as that of planned steps.
        """
        self._controller, self._robot, self._dt = controller, controller.robot, controller.dt
        self._source, self._nominal, self._reaching = source, com_height, reaching
        self._goal = np.zeros(4)  # height − nominal, roll, pitch, turn
        self._now, self._rate, self._acceleration = np.zeros(4), np.zeros(4), np.zeros(4)
        turning = _waist_turn(self._robot)
        self._waist = turning is not None
        self._most_turn = min(most_turn, HIP_TURN if turning is None else turning)
        self._neck = bool(_neck_joints(self._robot))
        self._lowest: float | None = None
        self._gaze: LookAtTask | None = None  # of a neck
        self._point: Array | None = None  # that the trunk of a robot without a neck turns to
        self._heading = math.nan  # of the walk in the last tick in which it was active, rad
        self.active = False

    def begin(self) -> None:
        """Begin anew from the height that the CoM has now; a height that is set stays."""
        self._now[0] = self._rate[0] = 0.0

    # ---- set-points -------------------------------------------------------------------------------------------------

    @property
    def com_height(self) -> float:
        """Height of the CoM over the soles, m; assign it."""
        return self._nominal + float(self._goal[0])

    @com_height.setter
    def com_height(self, value: float) -> None:
        height = finite_scalar(f"com_height (m) of '{self._robot.name}'", value)
        if height > self._nominal:
            Leg(self._robot).hips(height)
        else:  # once all orders are done, no foot has to be lifted
            self._check_low(height, 0.0 if self._source.finished else self._source.lift_room)
        self._set(0, height - self._nominal)

    def check_steps(self) -> None:
        """Refuse steps that a lowered body leaves the legs no travel for."""
        if self._goal[0] < 0.0:
            self._check_low(self.com_height, self._source.lift_room)

    def _check_low(self, height: float, lift: float) -> None:
        if self._lowest is None:
            self._lowest = lowest_com(self._robot)
        walks = f" and lift a foot by {1e3 * lift:.0f} mm in a walk" if lift > 0.0 else ""
        low, what = min(self._lowest + lift, self._nominal), f"com_height (m) of '{self._robot.name}'"
        finite_scalar(f"{what}, as far as its legs bend{walks},", height, low=low, high=self._nominal)

    @property
    def lean(self) -> tuple[float, float]:
        """Roll and pitch of the trunk in the heading, rad: positive to the right and forward; assign both."""
        return float(self._goal[1]), float(self._goal[2])

    @lean.setter
    def lean(self, value: Sequence[float]) -> None:
        angles = finite_array("lean (roll and pitch of the trunk, rad)", value, (2,))
        if float(np.linalg.norm(angles)) > MOST_LEAN:
            raise InputError(f"lean must be at most {MOST_LEAN:g} rad in all, got {angles}")
        self._set(1, angles[0])
        self._set(2, angles[1])

    @property
    def turn(self) -> float:
        """Turn of the trunk against the heading of the feet, rad, positive to the left; assign it.

        The waist turns the torso, or the hips the whole trunk where no joint of the waist does.
        """
        return float(self._goal[3])

    @turn.setter
    def turn(self, value: float) -> None:
        most, what = self._most_turn, f"turn of the trunk (rad) of '{self._robot.name}'"
        self._set(3, finite_scalar(what, value, low=-most, high=most))
        self._point = None

    def look_at(self, point: ArrayLike | None) -> None:
        """Look at a point with the neck, and a little with the waist where the neck does not reach.

        A robot without a neck turns its trunk to the point: that is its `turn`, as far as it goes; assigning `turn`
        ends it.

        Args:
            point: In the world, shape (3,), m; None to look ahead with the posture again.

        Raises:
            InputError: Not three finite numbers.
        """
        if point is None:
            if self._gaze is not None:
                self._gaze.scale = 0.0
            elif self._point is not None:
                self.turn = 0.0
            return
        place = finite_array("point to look at (m)", point, (3,))
        if not self._neck:
            self._heading = self._heading if self.active else math.nan
            self._point, self.active = place, True
            return
        if self._gaze is None:
            self._gaze = self._controller.add(_gaze_task(self._robot, place))
        self._gaze.target, self._gaze.scale = place, 1.0 / self._reaching

    @property
    def reached(self) -> bool:
        """True once height and trunk are where they were set to."""
        return bool(np.abs(self._goal - self._now).max() <= ARRIVED)

    @property
    def looking(self) -> bool:
        """True while the gaze is within 0.05 rad of the point that it was given, and turns by less than 0.2 rad/s."""
        if self._point is not None:
            off = self._direction(self._point) - float(self._now[3])
            return abs(off) < LOOKS[0] and abs(float(self._rate[3])) < LOOKS[1]
        gaze = self._gaze
        return gaze is not None and not gaze.idle and gaze.reached

    def _set(self, index: int, value: float) -> None:
        self._goal[index] = value
        self.active = True

    # ---- the tick -----------------------------------------------------------------------------------------------

    @property
    def hip_turn(self) -> float:
        """Turn of the pelvis against the heading now, rad: zero of a robot whose waist turns its torso."""
        return 0.0 if self._waist else float(self._now[3])

    def update(self, heading: float) -> None:
        """Move on by one tick, while `active`, with the heading of the walk, rad."""
        self._heading = heading
        if self._point is not None and math.dist(self._point[:2], self._robot.com[:2]) >= NEAREST:
            self._turn_to(self._direction(self._point))
        before, displacement = self._rate, self._goal - self._now
        if not (displacement.any() or before.any()):
            self._acceleration = np.zeros(4)
            self.active = bool(self._now.any()) or self._point is not None
            return
        height = approach(displacement[:1], before[:1], SPEED, ACCELERATION, self._dt)
        trunk = approach(displacement[1:], before[1:], TURN_SPEED, TURN_ACCELERATION, self._dt)
        self._rate = rate = np.concatenate((height, trunk))
        self._acceleration = (rate - before) / self._dt
        self._now = self._now + self._dt * rate
        if np.abs(displacement).max() < ENDED[0] and np.abs(rate).max() < ENDED[1]:
            self._now, self._rate = self._goal.copy(), np.zeros(4)

    def _direction(self, point: Array) -> float:
        """Return the direction of a point against the heading, rad."""
        x, y, _ = point - self._robot.com
        return math.remainder(math.atan2(y, x) - self._heading, math.tau)

    def _turn_to(self, angle: float) -> None:
        """Turn to a direction, or to the end of the range on its side; for one behind it the trunk stays at an end."""
        most, goal = self._most_turn, float(self._goal[3])
        stays = abs(goal) >= most and abs(angle) > BEHIND
        self._goal[3] = angle if abs(angle) <= most else math.copysign(most, goal if stays else angle)

    def raised(self, pendulum: Pendulum) -> Pendulum:
        """Return a reference of the pendulum at the height that is set, with the ω of that height.

        The CoM moves horizontally as before, its ZMP is nearer to it the lower it is.
        """
        raised = pendulum.moved(
            *(np.array([0.0, 0.0, part[0]]) for part in (self._now, self._rate, self._acceleration))
        )
        nominal = GRAVITY / pendulum.omega**2
        ratio = (nominal + float(self._now[0])) / nominal
        zmp, velocity = raised.zmp.copy(), raised.zmp_velocity.copy()
        arm = pendulum.com[:2] - pendulum.zmp[:2]
        zmp[:2] += (1.0 - ratio) * arm
        velocity[:2] += (1.0 - ratio) * (pendulum.com_velocity[:2] - velocity[:2])
        velocity[:2] -= float(self._rate[0]) / nominal * arm
        return raised._replace(zmp=zmp, zmp_velocity=velocity, omega=pendulum.omega / math.sqrt(ratio))

    def leaned(self, lean: LeanMotion, heading: float) -> LeanMotion:
        """Return a lean of the trunk in the world with the one that is set, at a heading, rad."""
        ahead = yaw_rotation(heading)
        set_here = ahead @ pin.exp3(np.array([*self._now[1:3], 0.0])) @ ahead.T
        rates = [ahead @ np.array([*values[1:3], 0.0]) for values in (self._rate, self._acceleration)]
        return LeanMotion(lean.rotation @ set_here, lean.velocity + rates[0], lean.acceleration + rates[1])

    @property
    def twist(self) -> Twist:
        """Turn of the trunk against the heading now."""
        return Twist(float(self._now[3]), float(self._rate[3]), float(self._acceleration[3]), self._waist)


def lowest_com(robot: Robot) -> float:
    """Return the least height of the CoM over the soles with an upright trunk and flat soles, m.

    The hips sink over the feet until joints of the legs come near their limits.
    """
    ik = InverseKinematics(robot.clone(), 0.01)
    robot = ik.robot
    ik.update(robot.half_sitting)
    ik.add(*(SoleContact(sole.name) for sole in robot.soles[:2]), JointLimits(margin=MARGIN))
    ik.add(PoseTask(robot.base_frame, axes=("x", "y", "roll", "pitch", "yaw"), hard=True))
    hips = ik.add(PositionTask(robot.base_frame, axes=("z",)))
    ground = float(robot.placement(robot.soles[0].frame).translation[2])
    hips.target = hips.target - [0.0, 0.0, robot.com[2] - ground]
    ik.update(ik.reach().configuration)
    return float(robot.com[2]) - ground


def _waist_turn(robot: Robot) -> float | None:
    """Return how far the waist turns the torso either way about the vertical, rad; None if no joint of it does."""
    found = vertical_joint(robot, robot.torso_frame, robot.half_sitting)
    if found is None:
        return None
    either_way = min(-float(robot.position_lower[found[0]]), float(robot.position_upper[found[0]]))
    return max(0.0, either_way - MARGIN)


def _neck_joints(robot: Robot) -> list[str]:
    return [joint for joint in robot.joint_names if "neck" in joint.lower() or "head" in joint.lower()]


def _gaze_task(robot: Robot, place: Array) -> LookAtTask:
    """Return the task of the last link of the neck, with its axis that points forward in a stand."""
    last = max(robot.model.getJointId(joint) for joint in _neck_joints(robot))
    frame = next(f.name for f in robot.model.frames if f.parentJoint == last and f.type == pin.BODY)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    turn = data.oMf[robot.frame_id(frame)].rotation.T @ data.oMf[robot.frame_id(robot.base_frame)].rotation
    return LookAtTask(
        frame,
        place,
        name="gaze",
        axis=turn[:, 0],
        weight=GAZE_WEIGHT,
        stiffness=GAZE_STIFFNESS,
        error_bound=GAZE_BOUND,
    )
