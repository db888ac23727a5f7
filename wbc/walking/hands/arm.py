"""Arm of one hand: its joints and their strength, the task of the hand, and the orders where it is to go.

    target  →  reference on its way there in the frame of the target           `HandWay`
            →  the same in the world, where that frame moves  →  task of the hand

Every hand is moved in this way: one that reaches, one on its way to a surface or a handle, one that presses, and one
that holds on to something. The error of the task is bounded, and the reference waits for a hand that cannot follow. The
task moves the arm alone, and takes the motion of all other joints into account.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.frames import FixedPose, pose
from wbc.core.model import joints_to
from wbc.core.qp.controller import Controller
from wbc.core.qp.move import Move, PoseCoordinates
from wbc.core.qp.task import NEAR, SLOW
from wbc.core.robot import BASE_DOF
from wbc.core.trajectories import Ramp, approach
from wbc.tasks.force.compliance import AdmittanceTask
from wbc.walking.hands.frames import PELVIS, WORLD, TargetFrames, carried
from wbc.walking.plans.swing import REST

STIFFNESS, BLEND = 100.0, 0.3
"""Stiffness of the task of a hand, 1/s²; time over which its weight rises and falls, s."""

ERROR_BOUND = (0.05, 0.3)
"""Greatest error of the hand that acts, m, and of its rotation, rad."""

COMPLIANCE = 3e-4
"""Compliance at the hand of servos without gains, or of an arm without joints, m/N."""

LEAD = 0.1
"""Error of the hand at which its reference waits, m (of the rotation, rad)."""

SMOOTHING = 0.04
"""Time constant of the low-pass on the force error to which a hand yields, s: with half of it the acceleration that is
fed forward, times the mass of the hand, answers a force by more than that force, and a hand on a table chatters."""

ARRIVED = 1e-3
"""Distance of the reference from a target, m and rad, from which it counts as there."""

TURN_SPEED, TURN_ACCELERATION = 1.5, 6.0
"""Greatest angular speed, rad/s, and acceleration, rad/s², of the reference."""

LINEAR = np.repeat((1.0, 0.0), 3)
"""Part of a velocity or acceleration, shape (6,), that is not of a rotation."""


@settings
class ArmSettings:
    """Settings of the arms in a walk.

    Attributes:
        weight: Cost of the acceleration of a hand with a target, per (m/s²)² and (rad/s²)². It is half of the cost of
            the centre of mass. With the full cost, an arm that has no torque left would move the trunk.
        speed: Greatest speed of the reference of a hand, m/s.
        acceleration: Greatest acceleration of the reference of a hand, m/s².
        waist: Hands with targets move the joints of the waist as well.
        fast_swing: Swing of arms without targets in a fast walk with free steps, where the arms hold against the turn
            of the legs, m/m: displacement of a hand forward for each metre that the other side's foot is ahead of its
            own. 0 holds them still.
    """

    weight: Positive = 50.0
    speed: Annotated[Positive, "m/s"] = 0.5
    acceleration: Annotated[Positive, "m/s²"] = 2.0
    waist: bool = False
    fast_swing: Annotated[NonNegative, "m/m"] = 0.4


class Route(NamedTuple):
    """Order of a hand to go to a target, or through other poses to it.

    Attributes:
        poses: Poses in the frame, that of the target last.
        frame: Name of the frame.
        turn: Ratio of the cost of the hand's rotation to that of its place; the hand turns as it likes at 0.
        durations: Times of a minimum jerk trajectory to each pose, s; without any the hand goes at its speed.
        speed: Greatest speed without trajectories, m/s; that of the settings when None.
    """

    poses: Sequence[pin.SE3]
    frame: str
    turn: float
    durations: Sequence[float] = ()
    speed: float | None = None


class HandWay:
    """Reference of one hand on its way to a target, with bounded speed, or on minimum jerk trajectories.

    All places are in the frame of the target, which the reference does not know.

    Attributes:
        goal: Target; None without one.
        turn: That of its `Route`.
        place: Reference.
        velocity: Its velocity, [linear; angular], shape (6,), m/s and rad/s.
        acceleration: Derivative of the velocity, shape (6,), m/s² and rad/s².
        moves: Trajectories to come, where times were given.
    """

    def __init__(self, speed: float, acceleration: float, dt: float) -> None:
        """Begin without a target; with a usual speed, m/s, and the greatest acceleration, m/s², in ticks of dt, s."""
        self._usual, self._acceleration, self._dt = speed, acceleration, dt
        self.goal: pin.SE3 | None = None
        self.turn, self._fastest = 0.0, speed  # and greatest speed without trajectories, m/s
        self.place, self.velocity, self.acceleration = pin.SE3.Identity(), np.zeros(6), np.zeros(6)
        self.moves: list[Move] = []

    @property
    def moving(self) -> bool:
        """True while the reference is on its way to the target."""
        left = self.left(self.place)  # zero without a target
        far = np.linalg.norm(left[:3]) > ARRIVED or np.linalg.norm(left[3:]) > ARRIVED
        return bool(self.moves or far)

    def left(self, here: pin.SE3) -> Array:
        """Return displacement and rotation from a pose to the target, shape (6,), m and rad; zero without a target."""
        if self.goal is None:
            return np.zeros(6)
        turn = np.zeros(3) if self.turn == 0.0 else pin.log3(self.goal.rotation @ here.rotation.T)
        return np.concatenate([self.goal.translation - here.translation, turn])

    def send(self, route: Route, here: pin.SE3, *, fresh: bool) -> None:
        """Go on along a route.

        A `fresh` reference begins at rest where the hand is, `here`; another one takes the rotation of a hand that has
        turned as it liked.
        """
        reference, rates, turns = self.place, (self.velocity, self.acceleration), route.turn > 0.0
        if fresh:
            reference, rates = here, (np.zeros(6), np.zeros(6))
        elif turns and self.turn == 0.0:
            reference = pin.SE3(here.rotation, reference.translation)
            rates = self.velocity * LINEAR, self.acceleration * LINEAR
        goals = [
            pin.SE3(pose.rotation if turns else reference.rotation, pose.translation) for pose in route.poses
        ]
        starts, begins = (reference, *goals), (rates, *([(None, None)] * len(goals)))
        self.moves = [
            Move(PoseCoordinates(start, pin.SE3), [goal], begin, duration=duration)
            for start, goal, begin, duration in zip(starts, goals, begins, route.durations, strict=False)
        ]
        self.goal, self.turn = goals[-1], route.turn
        self._fastest = self._usual if route.speed is None else route.speed
        self.place, (self.velocity, self.acceleration) = reference, rates

    def halt(self) -> None:
        """Come to rest at once."""
        self.velocity, self.acceleration = np.zeros(6), np.zeros(6)

    def end(self) -> None:
        """Have no target any more."""
        self.goal, self.moves = None, []

    def advance(self, pace: Sequence[float]) -> None:
        """Move the reference on by a tick.

        It goes more slowly where the hand stays behind in its place, or in its rotation: each `pace` is 0 to 1.
        """
        if not self.moves:
            self._approach(pace)
            return
        # A rotation holds the trajectory up if it matters as much as the place.
        slower, move = min(pace) if self.turn == 1.0 else pace[0], self.moves[0]
        move.advance(slower * self._dt)
        self.place, velocity, push = move.now()
        self.velocity, self.acceleration = slower * velocity, slower * slower * push
        if move.arrived:
            self.moves.pop(0)

    def _approach(self, pace: Sequence[float]) -> None:
        """Move towards the target at bounded speeds."""
        dt, before, place = self._dt, self.velocity, self.place
        left = self.left(place)
        linear = approach(left[:3], before[:3], self._fastest * pace[0], self._acceleration, dt)
        angular = approach(left[3:], before[3:], TURN_SPEED * pace[1], TURN_ACCELERATION, dt)
        self.velocity = np.concatenate((linear, angular))
        self.acceleration = (self.velocity - before) / dt
        place.translation = place.translation + dt * linear
        place.rotation = pin.exp3(dt * angular) @ place.rotation


class Arm:
    """Arm of one hand, which goes to a target.

    Attributes:
        name: Role, such as "left_hand".
        frame: Frame of the robot.
        joints: Joints of the arm, as indices in arrays of shape (na,).
        length: Length of the stretched arm, from its first joint to the frame of the hand, m.
        task: Motion of the hand; it is added to the controller with the first target.
        within: Name of the frame of the target.
        place: Placement of the hand as it is commanded, in the world; a view.
    """

    def __init__(
        self, controller: Controller, name: str, settings: ArmSettings, frames: TargetFrames
    ) -> None:
        self._controller, self._robot, self._dt = controller, controller.robot, controller.dt
        robot, self._frames = controller.robot, frames
        self.name, self.frame = name, robot.frames[choose("hand", name, robot.frames)]
        self.joints = robot.joints_between(
            self.frame, robot.base_frame if settings.waist else robot.torso_frame
        )
        self._id, self.place = robot.frame_id(self.frame), robot.placement(self.frame)
        model, chain = robot.model, joints_to(robot.model, self._id, robot.frame_id(robot.torso_frame))
        links = [model.jointPlacements[joint].translation for joint in chain[1:]]
        links.append(model.frames[self._id].placement.translation)
        self.length = sum(float(np.linalg.norm(link)) for link in links)
        self._shoulder = chain[0] if chain else 1
        self.task = AdmittanceTask(
            self.frame,
            name=name,
            admittance=(0.0, 0.0),  # a hand that reaches yields to nothing
            weight=settings.weight,
            stiffness=STIFFNESS,
            error_bound=np.repeat(ERROR_BOUND, 3),
            time_constant=SMOOTHING,
        )
        self.task.spared = np.setdiff1d(np.arange(robot.nv), [BASE_DOF + joint for joint in self.joints])
        self.task.scale = 0.0
        self.task.held_by = f"walking.arms['{name}'].reach(…)"
        self._added = self._led = False  # to the controller; by a hand that presses, grips, or is on its way
        self._leaves = False  # goes back to its posture at the end of its way
        self.within = WORLD
        self._way = HandWay(settings.speed, settings.acceleration, self._dt)  # in the frame of the target
        self._there = pin.SE3(self.place)  # its reference in the world
        self._blend = Ramp(0.0)  # of the weight: its goal is 1 with a target, 0 without

    # ---- the arm itself -----------------------------------------------------------------------------------------

    @property
    def shoulder(self) -> Array:
        """Place of the first joint in the world, shape (3,), m."""
        place: Array = self._robot.data.oMi[self._shoulder].translation
        return place

    def compliance(self) -> float:
        """Return the compliance of the hand on its servos in the softest direction, m/N."""
        robot, arm = self._robot, self.joints
        if (servos := robot.servos) is None:
            return COMPLIANCE
        at = robot.model, robot.data, robot.q, self._id, pin.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(*at)[:3, BASE_DOF:][:, arm]
        return float(np.linalg.norm((jacobian / servos.kp[arm]) @ jacobian.T, 2)) or COMPLIANCE

    def axis(self) -> Array:
        """Return the direction from the frame of the hand to its mass, in that frame, shape (3,)."""
        model = self._robot.model
        mass, moment = 0.0, np.zeros(3)
        data = model.createData()
        pin.framesForwardKinematics(model, data, self._robot.half_sitting)
        for joint in model.subtrees[model.frames[self._id].parentJoint]:
            inertia = model.inertias[joint]
            mass += inertia.mass
            moment += inertia.mass * data.oMi[joint].act(inertia.lever)
        arm = data.oMf[self._id].actInv(moment / mass)
        return np.asarray(arm / max(float(np.linalg.norm(arm)), 1e-6))

    def strength(self, direction: Array, share: float, point: Array) -> tuple[float, str]:
        """Return the greatest force along a direction, N, by a ratio of the torque limits, and its joint.

        The force acts at a point in the frame of the hand, shape (3,), m.
        """
        robot, arm = self._robot, self.joints
        jacobian = pin.getFrameJacobian(robot.model, robot.data, self._id, pin.LOCAL_WORLD_ALIGNED)
        moment = np.cross(self.place.rotation @ point, direction)
        lever = np.concatenate((direction, moment)) @ jacobian[:, BASE_DOF:][:, arm]
        # A hand at rest: what carries the arm is left out of what may press, or helps.
        held = (robot.data.g[BASE_DOF:] + robot.spring_torques(robot.q))[arm]
        limit = np.where(lever > 0.0, robot.torque_upper[arm], -robot.torque_lower[arm])
        spare = np.maximum(share * limit - np.sign(lever) * held, 0.0)  # torque
        most = spare / np.maximum(np.abs(lever), 1e-6)
        least = int(np.argmin(most))
        return float(most[least]), robot.joint_names[arm[least]]

    def check_idle(self) -> None:
        """Raise an `InputError` for an arm that no hand may lead: it has a target of its own, or is released."""
        self._check_own()
        if self._way.goal is not None and not (self._led or self._leaves):
            raise InputError(
                f"{self.name} must have no target when it presses or grips: arms['{self.name}'].release() takes the "
                "one it has"
            )

    def _check_own(self) -> None:
        """Raise an `InputError` for an arm that somebody else moves."""
        released = self._controller.released
        if released is not None and self.joints and released.mask[self.joints].all():
            raise InputError(
                f"the arm of '{self.name}' is moved by somebody else; walking.release takes it back"
            )

    def _check_not_led(self, order: str) -> None:
        """Raise an `InputError` for an order to an arm that a hand leads."""
        if self._led:
            raise InputError(
                f"{order} must wait until the hand neither presses nor grips: hands.release('{self.name}') lets go"
            )

    # ---- where the hand goes, and is ----------------------------------------------------------------------------

    @property
    def target(self) -> pin.SE3 | None:
        """Target in its frame, read-only; None without one. Of a target that is a point, the rotation means nothing."""
        return None if self._way.goal is None else FixedPose(self._way.goal)

    @property
    def active(self) -> bool:
        """True while the hand has a task: from its first target on until it has been let go."""
        return self._way.goal is not None or self._blend.value > 0.0

    @property
    def error(self) -> Array:
        """Target minus hand as it is commanded, position (m) and rotation (rad), shape (6,), in the target's frame.

        The rotation is zero where the target is a point. Without a target all is NaN.
        """
        if self._way.goal is None:
            return np.full(6, np.nan)
        return self._way.left(self.seen(self.within))

    @property
    def behind(self) -> float:
        """Distance of the hand from its reference, m."""
        return float(np.linalg.norm(self._there.translation - self.place.translation))

    @property
    def moving(self) -> bool:
        """True while the reference of the hand is on its way to the target."""
        return self._way.moving

    @property
    def stops(self) -> int:
        """Number of poses on its way that the reference has not reached yet, where it goes in a time."""
        return len(self._way.moves)

    @property
    def speed(self) -> float:
        """Speed of the hand as it is commanded, m/s, in the frame of its target; 0 without one."""
        if self._way.goal is None:
            return 0.0
        robot, (at, moving, _) = self._robot, self._frames.now(self.within)
        velocity = pin.getFrameVelocity(robot.model, robot.data, self._id, pin.LOCAL_WORLD_ALIGNED).linear
        arm = self.place.translation - at.translation
        return float(np.linalg.norm(velocity - moving[:3] - np.cross(moving[3:], arm)))

    @property
    def reached(self) -> bool:
        """True once the hand is at its target: within 10 mm, of a pose 0.05 rad, and below 0.05 m/s."""
        if self._way.goal is None or self.moving or self.speed > SLOW["m"]:
            return False
        error = self.error
        return bool(np.linalg.norm(error[:3]) < NEAR["m"] and np.linalg.norm(error[3:]) < NEAR["rad"])

    def seen(self, frame: str, place: pin.SE3 | None = None) -> pin.SE3:
        """Return a place in the world, or that of the hand as it is commanded, in a frame."""
        return self._frames.now(frame)[0].actInv(self.place if place is None else place)

    # ---- orders -------------------------------------------------------------------------------------------------

    def reach(self, target: ArrayLike | pin.SE3, frame: str = WORLD, *, speed: float | None = None) -> None:
        """Go to a target and stay there, from the next tick on.

        Args:
            target: Point, shape (3,), m, or pose of the hand.
            frame: "world", "pelvis", "feet" (the middle of both planned feet, at the lower one, smoothed), or the name
                of an object that `Arms.place` knows.
            speed: Greatest speed, m/s; that of the settings when None.

        Raises:
            InputError: Not a point or a pose, or one that is not finite; a hand that presses or grips; a speed that is
                not above zero.
        """
        self._check_own()
        choose("frame of a hand's target", frame, self._frames.names)
        what, turn = f"target of '{self.name}'", 1.0
        if isinstance(target, pin.SE3):
            goal = pose(what, target)
        else:
            goal, turn = pin.SE3(np.eye(3), finite_array(f"{what} (m)", target, (3,))), 0.0
        self._check_not_led(f"{what}, {np.round(goal.translation, 3).tolist()},")
        if speed is not None:
            speed = finite_scalar(f"speed of '{self.name}' (m/s)", speed, above=0.0)
        self.send(Route([goal], frame, turn, speed=speed), led=False)

    def release(self) -> None:
        """Let the arm go back to its posture; an `InputError` while the hand presses or grips."""
        self._check_not_led(f"release of '{self.name}'")
        self._fade()

    def leave(self, back: Route | None = None) -> None:
        """Let the arm go back to its posture, by a route if there is one: no hand leads it any more."""
        if back is not None:
            self.send(back, led=False)
            self._leaves = True
            return
        self.stop(PELVIS)
        self._led = False
        self._fade()

    def stop(self, frame: str) -> None:
        """Stop and stay where the reference is; in a new frame where the hand is."""
        place = self._way.place if frame == self.within else self.seen(frame)
        self._way.halt()
        self.send(Route([place], frame, self._way.turn), led=self._led)

    def send(self, route: Route, *, led: bool = True) -> None:
        """Go along a route; `led` by a hand that presses or grips, the arm takes no targets from `reach` until `leave`.

        The reference goes on as it moves. In a new frame, and for the first target, it begins where the hand is.
        """
        fresh = route.frame != self.within or not self.active
        self._way.send(route, self.seen(route.frame), fresh=fresh)
        self._frames.begin(route.frame)  # of a route that is not refused
        if fresh:
            self._there = pin.SE3(self.place)
            self.yield_to(REST, REST)
            self.task.reset()
        self.within, self._led, self._leaves = route.frame, led, False
        if self._blend.goal == 0.0:
            self._blend.to(1.0, BLEND)
        self._weigh()
        if not self._added:
            self._added = True
            self._controller.add(self.task)

    def _fade(self) -> None:
        """Blend the task out, if there is a target."""
        if self._way.goal is not None:
            self._way.end()
            self._blend.to(0.0, BLEND)

    def yield_by(self, lag: float, speed: float) -> None:
        """Let the hand yield by 1 / (4 T K), with the delay T of sensor and servos, s, at most with a speed, m/s.

        K is the stiffness of the servos at the hand.
        """
        self.task.admittance = (self.compliance() / (4.0 * lag), 0.0)
        self.task.velocity_bound = (speed, 0.1)

    def yield_to(self, measured: Array, target: Array) -> None:
        """Yield to the difference of two wrenches on the hand, in its frame, shape (6,), N and Nm."""
        self.task.measured_wrench, self.task.target_wrench = measured, target

    def _weigh(self) -> None:
        """Give the task its weight, in part while it is blended in or out."""
        share = self._blend.value
        self.task.scale = (*[share] * 3, *[self._way.turn * share] * 3)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, accelerations: Array | None) -> None:
        """Move the reference of an active hand on and hand it to the task.

        The QP has had the accelerations in the last tick, shape (nv,); None in the first one.
        """
        if self._blend.value != self._blend.goal:
            self._blend.advance(self._dt)
            self._weigh()
        if accelerations is not None:
            self.task.spared_acceleration = accelerations[self.task.spared]
        turned = float(np.linalg.norm(pin.log3(self._there.rotation @ self.place.rotation.T)))
        pace = [min(1.0, max(0.0, 2.0 - 2.0 * off / LEAD)) for off in (self.behind, turned)]
        self._way.advance(pace)
        if self._leaves and not self.moving:
            self._leaves = False
            self._fade()
        there, velocity, rate = self._way.place.copy(), self._way.velocity, self._way.acceleration
        if self.within != WORLD:
            there, velocity, rate = carried(self._frames.now(self.within), there, velocity, rate)
        self._there, turn = there, self.place.rotation  # the rates of the task are along the axes of the hand
        self.task.follow(there, (velocity.reshape(2, 3) @ turn).ravel(), (rate.reshape(2, 3) @ turn).ravel())
