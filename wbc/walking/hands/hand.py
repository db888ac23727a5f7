"""Contact of one hand: approach, touch, press with a measured force, release, and detection of a lost contact.

    free → reach → approach → hold → free            `press`, arrived, touch, `release`
             ↓                  ↓
           grip → free         lost                  `grip`, arrived; no force any more

A hand that holds is a point contact of the QP, and one that grips a fixed one: the QP chooses its force, within the
friction cone and the torque limits of the arm, near the one that is asked for. That is the planned force of a hand that
presses, and the low-passed measured wrench of one that grips: with the whole of it as feed-forward the servos would
cancel each change of it, and the hand would not yield.

The hand leads its arm (`wbc.walking.hands.arm`): in the world until it is there, and relative to the feet once it
grips, or has lost its contact. A hand that grips yields where the force on it exceeds its limit. A hand that presses
yields at a speed proportional to its force error, so that the force follows the one that the QP chose
while robot and surface move. The admittance is 1 / (4 T K), with the stiffness K of the arm's servos at the hand, along
the force, and the delay T of sensor and servo.
"""

from __future__ import annotations

import enum
import math
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array, lag_gain
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.qp.closure import FixedContact
from wbc.core.qp.contact import PointContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.move import least_turn
from wbc.core.qp.options import ContactOptions
from wbc.core.qp.solving.solution import Solution
from wbc.core.robot import Robot
from wbc.core.trajectories import Ramp
from wbc.tasks.force.wrench import WrenchTask
from wbc.walking.hands.arm import Arm, Route
from wbc.walking.hands.force import PressForce, WristSensor
from wbc.walking.hands.frames import FEET, WORLD
from wbc.walking.plans.swing import REST

GAP, CLEARANCE = 0.01, 0.05
"""Distance of the tip of a hand from a handle that it grips, and from a surface at the start of its approach, m."""

SEARCH, BEHIND = 0.5, 0.03
"""Greatest length of an approach; error on it above which the arm counts as stretched, and the contact as lost, m."""

TURN = 0.003
"""Ratio of the cost of the orientation of a hand to that of its place: an arm that folds turns the hand, and one that
cannot point where the hand is to press still goes there."""

LOSS_RAMP = 0.15
"""Time in which a lost force is faded out of the balance, s."""

FILTER_TIME, SLOW_TIME = 0.05, 1.0
"""Time constants of two low-passes on measured forces, s: mc_rtc's. The quick one is what feet do not have to give; the
slow one shifts the CoM for hands that grip, and is the feed-forward of their arms. The rest shifts the ZMP."""

LEAST_WAY = 0.01
"""Length of the part of a way along a surface, or towards it, below which the hand goes straight, m."""

LEAVING = (0.5, 0.2)
"""Time, s, and mean speed beside it, m/s, in which a hand that lets go leaves a surface."""

SAME_WAY = (0.02, 0.1)
"""Change of a place, m, and of a direction, rad, up to which a hand that is on its way goes on as it does: orders by a
camera change in every tick. Once it is there, it goes on to the last order."""

THERE = (0.005, 0.02)
"""The same from which on a hand at the end of its way goes on to the last order: a camera is as noisy as this."""

PRESS_WEIGHT, GRIP_WEIGHT = 1.0, 100.0
"""Costs of a force other than the asked one of hands that press and that grip, per N² and (Nm)², beside 10⁻³ per (Nm)²
of a sole. What is gripped may roll: with a cost of 1 the QP takes 100 N from a cart that gives 17 N as soon as a step
asks for it, and the arms throw themselves about."""

ZERO = np.zeros(3)
"""No moment, or no turning."""


class HandState(enum.Enum):
    """State of a hand."""

    FREE = "free"
    """It has no order."""
    REACH = "reach"
    """It goes to the start of its approach, and learns the tare of its sensor."""
    APPROACH = "approach"
    """It goes towards the surface until it touches it."""
    HOLD = "hold"
    """It presses with the ordered force."""
    GRIP = "grip"
    """It holds a handle, and yields to the force on it."""
    LOST = "lost"
    """It has lost its contact or its sensor, and stays where it is; its force goes to zero."""


@settings
class HandSettings:
    """Settings of hands that press on objects.

    Attributes:
        reach_time: Time in which a hand moves to the start of its approach, s.
        length: Distance from the frame of a hand to its tip, m.
        approach: Speed towards a surface, m/s.
        touch: Force at which the hand has touched the surface, N; smaller for a light robot (`Robot.force_scale`).
        ramp: Duration of the increase, decrease or change of a force, s.
        lag: Delay T of force sensor and servos together, s. The admittance is 1 / (4 T K), with the stiffness K of the
            arm's servos at the hand.
        edge: Share of the distance to the edge of the soles by which the ZMP moves for planned forces before the CoM
            moves. A larger share needs less shift of the CoM, and leaves less margin against disturbances.
        help: Share of the missing moment of the feet that pressing hands supply where a stabilizer balances the robot,
            as in position control; with 0 the trunk supplies it.
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
        state: Stage of its work, a `HandState`.
        index: Its place in `Measurement.hand_wrenches`.
        arm: Its arm, which it leads while it is not free.
        tip: Place of its tip in its frame, shape (3,), m: the point at which it presses.
        contact: What it presses on; active while it holds.
        grasp: What it grips; active while it does.
        measured: Placement of its frame as it is estimated, in the world; a view.
        direction: Direction in which the hand presses, in the world, shape (3,).
        order: Last order of `Hands`; empty without one, and once it is released.
        pressed: Force with which it presses, as measured, along `direction`, N.
        ordered: Force of its order, with which it is to press, or its limit while it grips, N; zero without an order.
        force: Planned force of a hand that presses.
        sensor: Force sensor at its wrist.
        felt: Force on it while it grips, smoothed, in the world, shape (3,), N.
        bounded: True while the QP gives less force than is asked for: the arm has no more torque.
    """

    def __init__(
        self, controller: Controller, estimate: Robot, arm: Arm, index: int, settings: HandSettings
    ) -> None:
        """Begin free: the controller gets task and contacts of the hand with its first order."""
        self.measured = estimate.placement(arm.frame)
        self.name, self.arm, self.index, self._settings = arm.name, arm, index, settings
        self._controller, self._dt, name, frame = controller, controller.dt, arm.name, arm.frame
        self._touch = settings.touch * controller.robot.force_scale
        arm.yield_by(settings.lag, 2.0 * settings.approach)
        options: ContactOptions = {  # the motion is the task's
            "active": False,
            "ramp": 0.0,
            "stiffness": 0.0,
            "motion_weight": 0.0,
            "wrench_weight": 1e-8,
        }
        self._axis = arm.axis()
        self.tip = settings.length * self._axis
        # At the tip: the force on a hand that turns aside is beside its frame, and would turn it further.
        self.contact = PointContact(frame, point=self.tip, **options)
        self.grasp = FixedContact(frame, **options)
        self.contact.name, self.grasp.name = f"{name} press", f"{name} grip"
        self._force = WrenchTask(self.contact, weight=PRESS_WEIGHT)
        self._wrench = WrenchTask(self.grasp, weight=GRIP_WEIGHT)
        self.direction = self._came = np.zeros(3)
        self.order: tuple[object, ...] = ()
        self.sensor = WristSensor(name, controller.dt)
        self._then = HandState.HOLD  # what it is to do once it is there
        self._at: Array | None = None  # place of the order, m
        self._to: Array | None = None  # the same of its way, which has the direction `_came`
        # Places back to where it came from, as seen from the feet, and times from each to the next, s.
        self._back: tuple[list[pin.SE3], list[float]] = [], []
        self._begin(HandState.FREE)

    def _begin(self, state: HandState) -> None:
        """Begin in a state without a force."""
        self.force, self.ordered, self.pressed = PressForce(), 0.0, 0.0
        self._turn = Ramp(np.zeros(3))  # from the direction in which it came, as a rotation vector, rad
        self.felt, self.bounded = np.zeros(3), False
        self._borne = np.zeros(6)  # slow part of the wrench on it while it grips, in world axes, N and Nm
        self.sensor.listen()
        self._enter(state)

    def _enter(self, state: HandState) -> None:
        """Change to a state, which has its contact."""
        self.state = state
        self.contact.active, self.grasp.active = state is HandState.HOLD, state is HandState.GRIP
        self._touched = 0.0  # time for which it has felt a touch, s

    @property
    def span(self) -> float:
        """Length of the stretched arm to the tip, m."""
        return self.arm.length + self._settings.length

    def chosen(self, solution: Solution | None) -> Array | None:
        """Return the force that the QP has chosen for its contact, in the frame of that, shape (3,), N, if any."""
        if solution is None or not self.contact.active:
            return None
        at = solution.layout.contacts.get(self.contact.name)
        return None if at is None else solution.variables[at]

    def planned_wrench(self, time: float) -> Array:
        """Return the planned wrench on it after a time, s, at the world origin, shape (6,), N and Nm."""
        push = -self.force.planned_after(time) * self.direction
        return np.concatenate((push, np.cross(self.measured.act(self.tip), push)))

    @property
    def helps(self) -> bool:
        """True while the balance may ask the hand for more force: from its contact until its release."""
        return self.state is HandState.HOLD and self.ordered > 0.0

    @property
    def at_work(self) -> bool:
        """True while the hand presses, grips, or goes to where it is to, or a lost force is being faded out."""
        return self.state not in (HandState.FREE, HandState.LOST) or self.force.ramp.value > 0.0

    @property
    def destination(self) -> Array:
        """Place to which its tip goes, or at which it is once it is there, in the world, shape (3,), m."""
        target = self.arm.target if self.state is HandState.REACH else None
        return np.asarray((self.arm.place if target is None else target).act(self.tip))

    def take(self, then: HandState, direction: Array, force: float, at: Array | None) -> None:
        """Take an order to press, `HandState.HOLD`, or to grip, `GRIP`, with a force or its limit, N.

        A hand that does so already stays where it is; see `Hands.press` and `Hands.grip`. One on its way there goes on,
        and then to the new place, unless place or direction differ from those of its way by more than `SAME_WAY`.
        Without a place it approaches the surface from where it is.
        """
        if self.state is then:
            self.ordered = force
            if then is HandState.HOLD:
                self.force.ramp.to(force, self._settings.ramp)
                self._turn.to(least_turn(self._came, direction), self._settings.ramp)
            return
        comes = self.state in (HandState.REACH, HandState.APPROACH) and then is self._then
        if comes and self._on_way(at, direction, SAME_WAY):
            self.ordered, self.direction, self._at = force, direction, at
            return
        items = (self.grasp, self._wrench) if then is HandState.GRIP else (self.contact, self._force)
        present = (*self._controller.tasks, *self._controller.contacts)
        for item in items:  # the controller gets what it does not have yet of a hand
            if not any(item is other for other in present):
                self._controller.add(item)
        if not (comes or at is None):
            self.sensor.forget()
        self._begin(HandState.REACH)
        self.direction, self._came, self.ordered, self._then = direction, direction, force, then
        self._at = self._to = at
        self._back = [], []
        if at is None:
            self._search(pin.SE3(self.arm.place))
        else:
            self._go(at)

    def _on_way(self, at: Array | None, direction: Array, most: tuple[float, float]) -> bool:
        """Return True if place and direction are those of its way, but for a distance, m, and an angle, rad."""
        to = self._to
        near = at is to if at is None or to is None else math.dist(at, to) < most[0]
        return near and math.dist(direction, self._came) < most[1]

    def _before(self, at: Array) -> tuple[pin.SE3, Array]:
        """Return the pose of the hand before a place, and its rotation vector from where the hand is."""
        rotation, gap = self.arm.place.rotation, GAP if self._then is HandState.GRIP else CLEARANCE
        turn = least_turn(self._axis, rotation.T @ self.direction)
        return pin.SE3(rotation @ pin.exp3(turn), at - (gap + self._settings.length) * self.direction), turn

    def _go(self, at: Array) -> None:
        """Go before a place: away from the surface, along it, and towards it last, so that nothing is brushed."""
        start, (end, turn) = self.arm.place, self._before(at)
        way = end.translation - start.translation
        towards = float(way @ self.direction) * self.direction
        first = towards if towards @ self.direction < 0.0 else way - towards
        lengths = float(np.linalg.norm(first)), float(np.linalg.norm(way - first))
        share = lengths[0] / max(sum(lengths), ROUNDING)
        stops = [(1.0, end)]
        if min(lengths) > LEAST_WAY:
            corner = pin.SE3(start.rotation @ pin.exp3(share * turn), start.translation + first)
            stops = [(share, corner), (1.0 - share, end)]
        durations = [part * self._settings.reach_time for part, _ in stops]
        self.arm.send(Route([place for _, place in stops], WORLD, TURN, durations))
        back = [place for _, place in stops[::-1]]
        self._back = [self.arm.seen(FEET, place) for place in (*back, start)], [0.0, *durations[::-1]]

    def _search(self, start: pin.SE3) -> None:
        """Approach the surface from a place in the world."""
        self._enter(HandState.APPROACH)
        end = start.translation + SEARCH * self.direction
        self.arm.send(Route([pin.SE3(start.rotation, end)], WORLD, TURN, speed=self._settings.approach))

    def release(self) -> None:
        """Take the force back and let go."""
        self.order = ()
        if self.state is HandState.HOLD:
            if self.ordered > 0.0:  # else it is being taken back already
                self._fade(self._settings.ramp)
        elif self.state is not HandState.FREE:
            self._free()

    def update(self, reading: Array | None, solution: Solution | None, excess: Array = ZERO) -> Array | None:
        """Advance by one tick, and return the wrench on the hand, None while it touches nothing.

        Args:
            reading: Reading of its sensor, [force; moment] in its frame, shape (6,), N and Nm; None or NaN is none.
            solution: Solution of the QP in the last tick; None in the first one.
            excess: Part of the force on all hands to which this one yields while it grips, in the world, shape (3,), N.

        Returns:
            Wrench on a hand that presses, grips, or has lost its contact, [force; moment] at the world origin, shape
            (6,), less the tare.
        """
        if self.state is HandState.FREE:
            return None
        self.sensor.take(reading)
        if self.sensor.silent and self.state not in (HandState.GRIP, HandState.LOST):
            self._lose()
        wrench, rotation = self.sensor.wrench, self.measured.rotation
        self.pressed = -float(np.dot(rotation @ wrench[:3], self.direction))
        match self.state:
            case HandState.REACH:
                self._go_on()
            case HandState.APPROACH:
                self._feel_for_touch()
            case HandState.HOLD:
                self._press(wrench, rotation, self.chosen(solution))
            case HandState.GRIP:
                self._carry(wrench, rotation, excess)
            case HandState.LOST:
                self.force.ramp.advance(self._dt)
        if self.state not in (HandState.HOLD, HandState.GRIP, HandState.LOST):
            return None
        return np.asarray(self.measured.act(pin.Force(wrench)).vector)

    def _carry(self, wrench: Array, rotation: Array, excess: Array) -> None:
        """Yield to the excess of the force on all hands, and ask the QP for the slow part of the wrench on this one."""
        self.arm.yield_to(np.concatenate((excess @ rotation, ZERO)), REST)
        self.bounded = bool(np.abs(excess[:2]).max() > self._touch)
        force, moment = rotation @ wrench[:3], rotation @ wrench[3:]
        self.felt += lag_gain(self._dt, FILTER_TIME) * (force - self.felt)
        self._borne += lag_gain(self._dt, SLOW_TIME) * (np.concatenate((force, moment)) - self._borne)
        self._wrench.follow((self._borne.reshape(2, 3) @ self.arm.place.rotation).ravel())

    def _go_on(self) -> None:
        """Learn the tare on the way, go on to the last order, and begin what comes after it."""
        arm = self.arm
        self.sensor.learn(self._touch)
        if arm.moving or (target := arm.target) is None:
            return
        if self._at is not None and not self._on_way(self._at, self.direction, THERE):
            self._to, self._came = self._at, self.direction
            arm.send(Route([self._before(self._at)[0]], WORLD, TURN, speed=self._settings.approach))
        elif self._then is HandState.HOLD:
            self._search(target)
        else:
            self._enter(HandState.GRIP)
            arm.send(Route([arm.seen(FEET, target)], FEET, TURN))

    def _press(self, wrench: Array, rotation: Array, chosen: Array | None) -> None:
        """Ask the QP for the force that is planned, and yield to what is measured beside the one it chose."""
        if (self._turn.value != self._turn.goal).any():
            self._turn.advance(self._dt)
            self.direction = pin.exp3(self._turn.value) @ self._came
            self.contact.normal = -self.direction
        force, asked, ends = self.force, self._force.target, self.ordered == 0.0
        given = asked if chosen is None else chosen
        self.bounded = force.advance(float(given[2]), float(asked[2]), self._dt, ends=ends)
        if force.is_lost(self.pressed, self._touch, self._dt):
            self._lose()
        elif ends and force.ramp.value == 0.0:
            self._free()
        else:
            self._force.follow(np.array((0.0, 0.0, force.asked(self._touch))))
            target = np.concatenate((rotation.T @ self.contact.rotation @ given, ZERO))
            self.arm.yield_to(np.concatenate((wrench[:3], ZERO)), target)

    def _feel_for_touch(self) -> None:
        """Begin to press at a touch; stop after a search without one, and where the hand cannot go on."""
        arm = self.arm
        self._touched = self._touched + self._dt if self.pressed > self._touch else 0.0
        if self._touched >= 2.0 * self._dt - ROUNDING:
            self.contact.normal = -self.direction
            self._enter(HandState.HOLD)
            self._came = self.direction
            arm.stop(WORLD)
            self.force = PressForce(min(self._touch, self.ordered))
            self._force.follow(np.array((0.0, 0.0, self.force.ramp.value)))
            self.force.ramp.to(self.ordered, self._settings.ramp)
        elif not arm.moving or arm.behind > BEHIND:
            self._lose()

    def _fade(self, duration: float) -> None:
        """Reduce the force to zero within a time, s."""
        self.ordered = 0.0
        self.force.fade(duration)

    def _lose(self) -> None:
        """Stop where the hand is, as seen from the feet."""
        self._turn_back()
        self.arm.stop(FEET)
        self._enter(HandState.LOST)
        self.force.extra = 0.0
        self._fade(LOSS_RAMP)

    def _free(self) -> None:
        """Let the arm go back to its posture: by the way it came to a surface, so that it does not go through it."""
        self._turn_back()
        route, arm, (places, times) = None, self.arm, self._back
        if self._then is HandState.HOLD and places:
            if self.state is not HandState.REACH:
                way = places[0].translation - arm.seen(FEET).translation
                times[0] = LEAVING[0] + float(np.linalg.norm(way)) / LEAVING[1]
            route = Route(places, FEET, TURN, times)
        self._back = [], []
        self._begin(HandState.FREE)
        arm.leave(route)

    def _turn_back(self) -> None:
        """Leave out of the way back what a hand that is still on its way has not reached."""
        if self.state is HandState.REACH:
            first = max(1, self.arm.stops)
            self._back = self._back[0][first:], self._back[1][first:]
