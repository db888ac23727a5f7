"""Contact of one hand: approach, touch, press with a measured force, release, and detection of a lost contact.

    free → reach → approach → hold → free            `press`, arrived, touch, `release`
             ↓                  ↓
           grip → free         lost                  `grip`, arrived; no force any more

A hand that holds is a point contact of the QP, and one that grips a fixed one: the QP chooses its force, within the
friction cone and the torque limits of the arm, near the one that is asked for. That is the planned force of a hand that
presses, and the low-passed measured wrench of one that grips: with the whole of it as feed-forward the servos would
cancel each change of it, and the hand would not yield.

A hand that grips keeps its pose relative to the walking robot, and yields where the force on it exceeds its limit. A
hand that presses yields at a speed proportional to its force error, so that the force follows the one that the QP chose
while robot and surface move. The admittance is 1 / (4 T K), with the stiffness K of the arm's servos at the hand, along
the force, and the delay T of sensor and servo.
"""

from __future__ import annotations

import enum
import logging
import math
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.lag import lag_gain
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.frames import pose_of
from wbc.core.qp.contact import ContactOptions, FixedContact, PointContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.items import Item
from wbc.core.qp.move import Move, PoseCoordinates, least_turn
from wbc.core.trajectories import Ramp
from wbc.tasks.force.admittance import AdmittanceTask
from wbc.tasks.force.wrench import WrenchTask
from wbc.walking.hands.arm import HandArm
from wbc.walking.hands.motion import MovingFrame
from wbc.walking.swing import REST

logger = logging.getLogger(__name__)

GAP, CLEARANCE, SEARCH, BEHIND = 0.01, 0.05, 0.5, 0.03
"""Distance of the tip of a hand from a handle that it grips, and from a surface at the start of its approach; greatest
length of an approach; error of a searching hand above which its arm counts as stretched, and the contact as lost, m."""

WEIGHT, TURN_WEIGHT, HOLD_WEIGHT = 50.0, 5.0, 0.3
"""Cost of the position of a hand, per (m/s²)²; of its orientation while it approaches and while it presses, per
(rad/s²)²: an arm that folds turns the hand."""

LOSS, LOSS_TIME, LOSS_RAMP, SILENCE = 0.3, 0.02, 0.15, 0.05
"""Ratio of measured to planned force below which, and time after which, a contact is lost; time over which a lost force
is faded out of the balance; time without a reading after which a pressing hand has lost its contact, s."""

STIFFNESS, COMPLIANCE = 100.0, 3e-4
"""Stiffness of position and orientation of a hand, 1/s²; compliance at the hand of servos without gains, m/N."""

SMOOTHING = 0.04
"""Time constant of the low-pass on the force error to which a hand yields, s: with half of it the acceleration that is
fed forward, times the mass of the hand, answers a force by more than that force, and a hand on a table chatters."""

FILTER_TIME, SLOW_TIME = 0.05, 1.0
"""Time constants of two low-passes on measured forces, s: mc_rtc's. The quick one is what feet do not have to give; the
slow one shifts the CoM for hands that grip, and is the feed-forward of their arms. The rest shifts the ZMP."""

LEAST_WAY = 0.01
"""Length of the part of a way along a surface, or towards it, below which the hand goes straight, m."""

WRENCH_WEIGHT, BOUNDED = 1.0, 1.0
"""Cost of a force other than the asked one, per N² and (Nm)², beside 10⁻³ per (Nm)² of a sole; lack of force from
which on an arm counts as too weak, N."""

ZERO = np.zeros(3)
"""No moment, or no turning."""


class HandState(enum.Enum):
    """State of a hand."""

    FREE = "free"
    REACH = "reach"
    APPROACH = "approach"
    HOLD = "hold"
    GRIP = "grip"
    LOST = "lost"


@settings
class HandSettings:
    """Settings of hands that press on objects.

    Attributes:
        reach_time: Time in which a hand moves to the start of its approach, s.
        length: Distance from the frame of a hand to its tip, m.
        approach: Speed towards a surface, m/s.
        touch: Force at which the hand has touched the surface, N; smaller for a light robot (`Robot.force_scale`).
        ramp: Duration of the increase, decrease or change of a force, s.
        lag: Delay T of force sensor and servos together, s; the admittance is 1 / (4 T K).
        edge: Share of the distance to the edge of the soles by which the ZMP moves for planned forces before the CoM
            moves. A larger share needs less shift of the CoM, and leaves less margin against disturbances.
        help: Share of the missing moment of the feet that pressing hands supply; with 0 the trunk supplies it.
        share: Share of an arm's torque limits that a force may use, in addition to the weight of the arm.
        margin: Distance that the DCM must keep from the edge of the soles if a force is lost suddenly, m.
    """

    reach_time: Annotated[Positive, "s"] = 3.0
    length: Annotated[NonNegative, "m"] = 0.14
    approach: Annotated[Positive, "m/s"] = 0.05
    touch: Annotated[Positive, "N"] = 4.0
    ramp: Annotated[Positive, "s"] = 2.0
    lag: Annotated[Positive, "s"] = 0.02
    edge: Share = 0.0
    help: Share = 0.0
    share: Share = 0.9
    margin: Annotated[NonNegative, "m"] = 0.01


class Hand:
    """One hand.

    Attributes:
        index: Its place in `Measurement.hand_wrenches`.
        task: The hand's motion; without weight while the hand is free.
        contact: What it presses on; active while it holds.
        grasp: What it grips; active while it does.
        direction: Direction in which the hand presses, in the world, shape (3,).
        pressed: Force with which it presses, as measured, along that direction, N.
        force: Force that is asked for now, N.
        reading: Last reading of its sensor, [force; moment] in its frame, shape (6,), N and Nm.
        tare: Reading of its sensor without a contact, [force; moment] in its frame, shape (6,), N and Nm: the mean on
            its last approach; zero before the first.
        extra: Force for the balance on top of the one that is asked for, N.
        felt: Force on it while it grips, smoothed, in the world, shape (3,), N.
        excess: Part of the force on it to which it yields while it grips, in the world, shape (3,), N.
        bounded: True while the QP gives less force than is asked for: the arm has no more torque.
    """

    def __init__(self, controller: Controller, name: str, index: int, settings: HandSettings) -> None:
        """Begin free: the controller gets task and contacts of the hand with its first order."""
        self.name, self.index, self._settings = name, index, settings
        self._controller, self._robot = controller, controller.robot
        self._touch = settings.touch * self._robot.force_scale
        frame = self._robot.frames[name]
        self.arm = HandArm(self._robot, frame)
        compliance = self.arm.compliance() or COMPLIANCE
        self.task = AdmittanceTask(
            frame,
            name=f"{name} force",
            admittance=(compliance / (4.0 * settings.lag), 0.0),
            weight=0.0,
            stiffness=STIFFNESS,
            velocity_bound=(2.0 * settings.approach, 0.1),
            time_constant=SMOOTHING,
        )
        options: ContactOptions = {  # the motion is the task's
            "active": False,
            "ramp": 0.0,
            "stiffness": 0.0,
            "motion_weight": 0.0,
            "wrench_weight": 1e-8,
        }
        self.contact, self.grasp = PointContact(frame, **options), FixedContact(frame, **options)
        self.contact.name, self.grasp.name = f"{name} press", f"{name} grip"
        self._force = WrenchTask(self.contact, weight=WRENCH_WEIGHT)
        self._wrench = WrenchTask(self.grasp, weight=WRENCH_WEIGHT)
        self._axis, self._frame = self.arm.axis(), frame
        self.direction = np.zeros(3)
        self.reading, self.tare = np.zeros(6), np.zeros(6)
        self._start = pin.SE3.Identity()  # of the approach; of a grip, its place
        # The same in the frame that goes with the robot; of a contact that was lost, from the next tick on.
        self._held: pin.SE3 | None = None
        self._way: list[Move] = []  # to there, one after the other
        self._then = HandState.APPROACH  # state after that way
        self._enter(HandState.FREE)

    def _enter(self, state: HandState) -> None:
        """Begin without a force, at the start of a way."""
        self.state, self.force = state, Ramp()
        self.pressed = self.extra = 0.0
        self.felt, self.excess, self.bounded = np.zeros(3), np.zeros(3), False
        self._borne = np.zeros(6)  # slow part of the wrench on it while it grips, in world axes, N and Nm
        self._most = math.inf  # force that the arm has, N
        self.contact.active = self.grasp.active = False
        self._travelled = self._elapsed = 0.0
        # Time since the last reading, and for which a touch, or a lack of force, has lasted, s.
        self._silent = self._touching = self._short = 0.0
        self.task.reset()

    @property
    def planned(self) -> float:
        """Planned force, N: the force asked for, limited to what the QP gives."""
        return min(self.force.value, self._most)

    @property
    def target(self) -> float:
        """Planned force plus the one for the balance, N."""
        return self.planned + self.extra

    @property
    def helps(self) -> bool:
        """True while the balance may ask the hand for more force: from its contact until its release."""
        return self.state is HandState.HOLD and self.force.goal > 0.0

    @property
    def active(self) -> bool:
        """True while the hand is not free."""
        return self.state is not HandState.FREE

    @property
    def destination(self) -> Array:
        """Where its frame goes, or is once it is there, in the world, shape (3,), m."""
        if self.state is HandState.REACH:
            return np.asarray(self._start.translation)
        return np.asarray(self._robot.placement(self._frame).translation)

    def press(self, direction: Array, force: float, at: Array | None = None) -> None:
        """Approach a surface and press on it, or press on it with another force, N; see `Hands.press`."""
        if self.state is HandState.HOLD:
            self.direction = direction
            self.contact.normal = -direction
            self.force.to(force, self._settings.ramp)
            return
        self._add(self.task, self.contact, self._force)
        self._begin(direction, force)
        if at is not None:
            self._go(at - (CLEARANCE + self._settings.length) * direction, HandState.APPROACH)

    def grip(self, direction: Array, limit: float, at: Array) -> None:
        """Go to a handle, and keep it before the robot from then on; see `Hands.grip`."""
        self._add(self.task, self.grasp, self._wrench)
        self._begin(direction, limit)
        self._go(at - (GAP + self._settings.length) * direction, HandState.GRIP)

    def _add(self, *items: Item) -> None:
        """Add to the controller what it does not have yet of a hand."""
        present = (*self._controller.tasks, *self._controller.contacts)
        for item in items:
            if not any(item is other for other in present):
                self._controller.add(item)

    def _begin(self, direction: Array, force: float) -> None:
        """Begin an approach from where the hand is."""
        self._enter(HandState.APPROACH)
        self.direction, self.force.goal = direction, force
        self._start = self.task.target = pin.SE3(self._robot.placement(self._frame))
        self.task.weight = (*[WEIGHT] * 3, *[TURN_WEIGHT] * 3)

    def _go(self, point: Array, then: HandState) -> None:
        """Go to a point first: away from the surface, along it, and towards it last, so that nothing is brushed."""
        self.state, self._then, self.tare = HandState.REACH, then, np.zeros(6)
        start, way = self._start, point - self._start.translation
        turn = least_turn(self._axis, start.rotation.T @ self.direction)
        towards = float(way @ self.direction) * self.direction
        first = towards if towards @ self.direction < 0.0 else way - towards
        lengths = float(np.linalg.norm(first)), float(np.linalg.norm(way - first))
        share = lengths[0] / max(sum(lengths), ROUNDING)
        corner = pin.SE3(start.rotation @ pin.exp3(share * turn), start.translation + first)
        self._start = end = pin.SE3(start.rotation @ pin.exp3(turn), point)
        stops = [(share, corner), (1.0 - share, end)] if min(lengths) > LEAST_WAY else [(1.0, end)]
        self._way = []
        for part, place in stops:
            duration = part * self._settings.reach_time
            self._way.append(Move(PoseCoordinates(start, pin.SE3), [place], (None, None), duration=duration))
            start = place

    def release(self) -> None:
        """Take the force back and let go."""
        if self.state is HandState.HOLD:
            self._fade(self._settings.ramp)
        elif self.state is not HandState.FREE:
            self._free()

    def sense(self, wrench: Array | None, dt: float) -> None:
        """Take a reading, [force; moment] in the frame of the hand, shape (6,), N and Nm; None or NaN is none.

        The last reading holds until `SILENCE` has passed. After that a hand that presses or approaches has lost its
        contact, and the force on one that grips is zero.
        """
        if wrench is not None and np.isfinite(wrench).all():
            self.reading[:], self._silent = wrench, 0.0
            return
        before, self._silent = self._silent, self._silent + dt
        if self._silent <= SILENCE:
            return
        self.reading[:] = self.tare
        if before <= SILENCE:
            logger.error("%s: no reading of its force sensor for %.3f s", self.name, self._silent)
        if self.state in (HandState.REACH, HandState.APPROACH, HandState.HOLD):
            self._lose()

    def update(
        self, wrench: Array, rotation: Array, chosen: Array | None, middle: MovingFrame, dt: float
    ) -> None:
        """Advance by one tick with the measured wrench on the hand, less its tare, and its orientation.

        The wrench is [force; moment] in its frame, shape (6,), N and Nm. The QP has chosen a force in the last tick, in
        the frame of the contact, shape (3,), N, the one that it was asked for when None; `middle` goes with the robot.
        """
        task, state = self.task, self.state
        if state is HandState.FREE:
            return
        self.pressed = -float(np.dot(rotation @ wrench[:3], self.direction))
        if state is HandState.HOLD:
            self._press(wrench, rotation, chosen, dt)
            return
        if state is HandState.GRIP:
            self._carry(rotation, middle)
            return
        if state is HandState.REACH:
            self._reach(wrench, middle, dt)
        elif state is HandState.APPROACH:
            self._approach(dt)
        else:
            self.force.advance(dt)
            self._keep(middle)
        task.measured_wrench = task.target_wrench  # the hand yields to nothing

    def bear(self, wrench: Array, rotation: Array, dt: float) -> None:
        """Ask the QP for the slow part of the wrench on a hand that grips; see `update`."""
        force, moment = rotation @ wrench[:3], rotation @ wrench[3:]
        self.felt += lag_gain(dt, FILTER_TIME) * (force - self.felt)
        self._borne += lag_gain(dt, SLOW_TIME) * (np.concatenate((force, moment)) - self._borne)
        turn = self._robot.placement(self._frame).rotation
        self._wrench.follow(np.concatenate((self._borne[:3] @ turn, self._borne[3:] @ turn)))

    def _reach(self, wrench: Array, middle: MovingFrame, dt: float) -> None:
        """Learn the tare on the way, and begin what comes after it."""
        first = self._elapsed == 0.0  # an offset may be more than a touch
        if first or float(np.linalg.norm(wrench[:3])) < self._touch:
            self.tare += dt / (self._elapsed + dt) * wrench
        self._elapsed += dt
        move = self._way[0]
        move.advance(dt)
        self._move(*move.now())
        if move.arrived:
            self._way.pop(0)
        if not self._way:
            self.state = self._then
            self.grasp.active = self.state is HandState.GRIP
            self._held = middle.placement.actInv(self._start)

    def _carry(self, rotation: Array, middle: MovingFrame) -> None:
        """Keep the pose relative to the feet; yield to the excess of the force on all hands."""
        task = self.task
        self._keep(middle)
        task.target_wrench = REST
        task.measured_wrench = np.concatenate((self.excess @ rotation, ZERO))
        self.bounded = bool(np.abs(self.excess[:2]).max() > self._touch)

    def _keep(self, middle: MovingFrame) -> None:
        """Keep the pose relative to the feet, so that a hand goes along when they step."""
        if self._held is None:
            self._held = middle.placement.actInv(self._start)
        place = middle.placement * self._held
        self._move(place, np.concatenate((middle.velocity(place.translation), ZERO)), REST)

    def _move(self, place: pin.SE3, velocity: Array, acceleration: Array) -> None:
        """Set a target with its velocity and acceleration in world axes, shape (6,)."""
        turn = place.rotation
        own = [np.concatenate((rate[:3] @ turn, rate[3:] @ turn)) for rate in (velocity, acceleration)]
        self.task.follow(place, *own)

    def _press(self, wrench: Array, rotation: Array, chosen: Array | None, dt: float) -> None:
        """Ask the QP for the force that is planned, and yield to what is measured beside the one it chose."""
        before, asked = self.force.value, float(self._force.target[2])
        given = self._force.target if chosen is None else chosen
        self.bounded = float(given[2]) < asked - BOUNDED
        self._most = float(given[2]) if self.bounded else math.inf
        self.force.advance(dt)
        if self.force.goal == 0.0:  # the force for the balance fades with it
            self.extra *= self.force.value / max(before, ROUNDING)
        self._watch(dt)
        if self.force.goal == 0.0 and self.force.value == 0.0:
            self._free()
            return
        self.extra = min(max(self.extra, min(0.0, self._touch - self.planned)), self._most - self.planned)
        self._force.follow(np.array((0.0, 0.0, self.force.value + self.extra)))
        self.task.target_wrench = np.concatenate((rotation.T @ self.contact.rotation @ given, ZERO))
        self.task.measured_wrench = np.concatenate((wrench[:3], ZERO))

    def _approach(self, dt: float) -> None:
        settings, task = self._settings, self.task
        self._touching = self._touching + dt if self.pressed > self._touch else 0.0
        if self._touching >= 2.0 * dt - ROUNDING:
            self.state, self._short = HandState.HOLD, 0.0
            self.contact.normal, self.contact.active = -self.direction, True
            task.weight = (*[WEIGHT] * 3, *[HOLD_WEIGHT] * 3)
            task.feedforward_velocity = REST
            goal = self.force.goal
            self.force = Ramp(min(self._touch, goal))
            self._force.follow(np.array((0.0, 0.0, self.force.value)))
            self.force.to(goal, settings.ramp)
            return
        behind = task.target.translation - self._robot.placement(task.frame).translation
        if self._travelled >= SEARCH or float(np.linalg.norm(behind)) > BEHIND:
            self._lose()
            return
        self._travelled += settings.approach * dt
        point = self._start.translation + self._travelled * self.direction
        velocity = np.concatenate((settings.approach * self.direction, ZERO))
        self._move(pose_of(self._start.rotation, point), velocity, REST)

    def _watch(self, dt: float) -> None:
        """Detect the loss of the contact from a force that stays too small."""
        least = min(self.planned, self.target)
        short = self.pressed < LOSS * least and least > 2.0 * self._touch
        self._short = self._short + dt if short else 0.0
        if self._short > LOSS_TIME + ROUNDING:
            self._lose()

    def _fade(self, duration: float) -> None:
        """Reduce the force to zero within a time, s."""
        self.force = Ramp(self.planned)
        self.force.to(0.0, duration)

    def _lose(self) -> None:
        """Stop: where the hand is on its way, or at the place where it pressed, as seen from the feet."""
        here = self.task.target if self.state is HandState.HOLD else self._robot.placement(self._frame)
        self._start, self._held = pin.SE3(here), None
        self.task.follow(self._start, REST, REST)
        self.task.target_wrench = REST
        self.state, self.contact.active, self.extra = HandState.LOST, False, 0.0
        self._fade(LOSS_RAMP)

    def _free(self) -> None:
        self._enter(HandState.FREE)
        self.task.weight = 0.0
