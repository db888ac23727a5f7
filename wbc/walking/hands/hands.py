"""Hands of a robot that stands or walks: contact forces on them, which the stabilizer counts.

A wrench of the surroundings on the hands moves the point about which the pendulum turns away from the ZMP z of the
feet,

    z_e = z − δ,   δ = (M_y, −M_x) / ζ,

with the moment M of that wrench about z and the vertical force ζ of the pendulum. With the planned forces of the hands
the centre of mass goes where the feet keep their ZMP, by s = −δ; the feet's desired wrench is that of the whole robot
less what the hands measure.

Source: M. Murooka et al., "Humanoid loco-manipulations pattern generation and stabilization control", IEEE RA-L 6(3),
2021, with moments about the ZMP instead of the origin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import ROUNDING, Array, finite_array, finite_scalar, lag_gain, read_only
from wbc.base.settings import Number
from wbc.base.vectors import along
from wbc.core.frames import heading, unit_vector
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum, zmp_offset
from wbc.walking.contact import GaitPhase
from wbc.walking.hands.force import HELP_TIME
from wbc.walking.hands.hand import FILTER_TIME, SLOW_TIME, ZERO, Hand, HandSettings, HandState
from wbc.walking.hands.reaching import Arms
from wbc.walking.source import Reference

SHIFT_TIME = 0.15
"""Time constant with which the CoM follows the planned forces, s, twice: its acceleration is bounded. It follows those
that are planned for after twice this time, so that it does not lag behind a force that grows."""

RELAX = 0.1
"""Ratio of the forces on them to which hands that grip yield while the robot stands: forces that remain when a walk
ends decay within about a second, as slowly as the CoM follows them, so that the next walk begins upright."""

STILL, NO_FORCE = 1e-5, 0.1
"""Shift of the CoM and its speed together, m and m/s, and force, N, below which hands without an order are done: at a
height of 1 m 0.1 N moves the ZMP of a robot of 40 kg by a quarter of a millimetre."""

LEAST_REST = 0.5
"""Time at rest from which a mean counts as the bias of the gyroscope, s."""

HELP_FROM = 1.0
"""Moment that the feet cannot give from which hands help, Nm; of a light robot, its share: their distribution leaves a
little at any time."""


class GyroSlip:
    """Slip of the feet by the gyroscope: turn of a link by the gyroscope on it, less that by the estimate.

    The estimate of the attitude (`wbc.core.estimation.inertial`) takes the heading from the feet, which hold it without
    drift while they do not slip. A robot that turns something heavy slips by degrees in each step. Over a minute the
    integrated gyroscope is better, once its bias has been averaged at rest.

    Attributes:
        angle: Turn of the feet about the vertical that the estimate lacks, rad.
        bias: Bias of the gyroscope about the vertical, rad/s; zero before the robot has been at rest for 0.5 s.
    """

    def __init__(self) -> None:
        self.angle = self.bias = self._sum = self._rest = 0.0

    def update(self, gyro: Array, vertical: Array, turned: float, rests: bool, dt: float) -> None:
        """Advance by one period, s, with the gyroscope, rad/s, and the vertical in its frame, each of shape (3,).

        The estimate has `turned` the link about the vertical in this period, rad. `rests` is True while the feet do not
        turn: the mean of the difference then is the bias.
        """
        off = float(gyro.dot(vertical)) * dt - turned
        if not rests:
            self._sum = self._rest = 0.0
            self.angle += off - self.bias * dt
            return
        self._sum, self._rest = self._sum + off, self._rest + dt
        if self._rest >= LEAST_REST:
            self.bias = self._sum / self._rest


class Hands:
    """Hands of one robot.

    Attributes:
        all: Role → hand.
        outside: Wrench of the surroundings on all hands, measured and smoothed, [force; moment] at the world origin,
            shape (6,), N and Nm.
        active: True while the balance counts the hands: one is at work, a lost force is still being faded out, or the
            CoM comes back from its shift.
    """

    def __init__(
        self,
        controller: Controller,
        estimate: Robot,
        settings: HandSettings,
        height: float,
        arms: Arms,
        box: tuple[float, float] | None = None,
    ) -> None:
        """Leave the hands free, for a CoM at a height over the soles, m.

        The ZMP of a robot that stands stays within a `box` about the middle of a sole, to the toes and to the side, m;
        within the sole when it is None.
        """
        self._controller, self._robot, self._estimate = controller, controller.robot, estimate
        self.settings, self._dt = settings, controller.dt
        # A loss is survived within one sole: while the robot walks it has no more.
        self._edges = 0.5 * controller.robot.soles[0].length, 0.5 * controller.robot.soles[0].width
        self._box, self._height = self._edges if box is None else box, height
        self.all: Mapping[str, Hand] = MappingProxyType(
            {
                arm.name: Hand(controller, estimate, arm, index, settings)
                for index, arm in enumerate(arms.all.values())
            }
        )
        self.outside = read_only(np.zeros(6))
        self._slow = np.zeros(6)  # of hands that grip, filtered once more
        self._missing = np.zeros(2)
        self._excess: dict[str, Array] = {}  # hand that grips → force to which it yields in the next tick, N
        self._measurement: Measurement | None = None  # the last one
        self.active = False
        self._ordered = False  # since an order, until all hands are idle again
        # Views, which move on with the estimate.
        self._pelvis = estimate.placement(estimate.base_frame).rotation
        self._imu = estimate.placement(estimate.imu_frame).rotation
        self._slip, self._before = GyroSlip(), self._imu.T.copy()
        self._shift = Follower(SHIFT_TIME, np.zeros(2))

    @property
    def _weight(self) -> float:
        """Weight of the robot with the load that it holds, N."""
        return self._robot.mass * GRAVITY

    @property
    def shift(self) -> Array:
        """Shift of the CoM for the planned forces, shape (2,), m."""
        return read_only(self._shift.value)

    @property
    def slip(self) -> float:
        """Angle by which feet have slipped in walks with hands at work, by gyroscope less estimate, rad."""
        return self._slip.angle

    @property
    def wanted(self) -> bool:
        """True while a hand presses or grips, or goes to where it is to; a hand that has lost its contact waits."""
        return any(hand.at_work for hand in self.all.values())

    @property
    def gripping(self) -> bool:
        """True while a hand grips."""
        return any(hand.state is HandState.GRIP for hand in self.all.values())

    @property
    def lost(self) -> tuple[str, ...]:
        """Hands that have lost their contact."""
        return tuple(name for name, hand in self.all.items() if hand.state is HandState.LOST)

    @property
    def there(self) -> bool:
        """True while all hands that are to press or grip do so."""
        busy = [hand.state for hand in self.all.values() if hand.state is not HandState.FREE]
        return bool(busy) and all(state in (HandState.HOLD, HandState.GRIP) for state in busy)

    @property
    def heading(self) -> float:
        """Heading of the line between both hands, in a world in which feet do not slip, rad: that of a cart they hold.

        Zero looks along x, with the left hand to the left. An `InputError` of a robot without one of these roles.
        """
        hands = (self.all[choose("hand", hand, self.all)] for hand in ("left_hand", "right_hand"))
        left, right = (hand.measured.translation for hand in hands)
        return math.atan2(right[0] - left[0], left[1] - right[1]) + self.slip

    @checked
    def point(self, hand: str, ahead: Number, below: Number, outward: Number = 0.09) -> Array:
        """Return a place for the tip of a hand in the world, shape (3,), m, by its way from the shoulder.

        Args:
            hand: Role of the hand.
            ahead: Ratio of that way forward to the length of the stretched arm with its hand.
            below: Ratio of the way downwards to that length.
            outward: Ratio of the way from the trunk outwards to that length.
        """
        each, robot = self.all[choose("hand", hand, self.all)], self._robot
        trunk, shoulder = robot.placement(robot.base_frame), each.arm.shoulder
        yaw = heading(trunk.rotation)
        c, s, left = math.cos(yaw), math.sin(yaw), math.copysign(outward, trunk.actInv(shoulder)[1])
        place: Array = shoulder + each.span * np.array([c * ahead - s * left, s * ahead + c * left, -below])
        return place

    @checked
    def press(
        self,
        hand: str,
        force: float,
        direction: ArrayLike,
        *,
        at: ArrayLike | None = None,
        firm: bool = False,
    ) -> None:
        """Approach a surface with a hand and press on it with a force that is measured; or change force and direction.

        Force and direction of a hand that presses change within `HandSettings.ramp`. The same order once more changes
        nothing, also where the hand has lost its contact, until the hand is released. A place that changes by up to
        20 mm while the hand is on its way is gone to at the end of that way.

        Args:
            hand: Role of the hand.
            force: Force, N.
            direction: Direction in which the hand presses, in the world, shape (3,): (0, 0, −1) on a table.
            at: Point of the surface, in the world of the robot's estimate, shape (3,), m: the hand goes before it
                first, and learns the tare of its sensor. When None it approaches from where it is, with the tare of its
                last way to a point. A hand that presses already stays on its surface.
            firm: True for what cannot give way alone, such as a wall or a rail, or a box against which the other hand
                presses from the other side; else a force whose sudden loss the robot would not survive is refused.

        Raises:
            InputError: A force that is negative, too much for the arm, or not survivable; a direction of no length; a
                point out of reach; a hand that grips, has a target (`arms`), or whose force is not measured (yet).
        """
        self._order(hand, HandState.HOLD, force, direction, at, firm=firm)

    def grip(self, hand: str, at: ArrayLike, direction: ArrayLike, limit: float) -> None:
        """Go with a hand to a handle, and keep it before the robot from then on, wherever it walks.

        Orders in a stream act as those of `press`. The hand is there when its state is `HandState.GRIP`; whoever drives
        its fingers closes them then. From then on another order to grip changes the limit alone, until the hand is
        released.

        Args:
            hand: Role of the hand.
            at: The handle, in the world of the robot's estimate, shape (3,), m.
            direction: Direction in which the hand points there, in the world, shape (3,).
            limit: Greatest force with which it pushes or pulls, N; where all hands that grip feel more than their
                limits together, they yield.

        Raises:
            InputError: A force whose sudden loss the robot would not survive; a handle out of reach; a hand that has a
                target (`arms`), presses on something, or whose force is not measured (yet).
        """
        self._order(hand, HandState.GRIP, limit, direction, () if at is None else at)

    def _order(
        self,
        hand: str,
        then: HandState,
        force: float,
        direction: ArrayLike,
        at: ArrayLike | None,
        *,
        firm: bool = False,
    ) -> None:
        """Let a hand press, or grip, after a check; see `press` and `grip`."""
        each, there = self.all[choose("hand", hand, self.all)], None
        force = finite_scalar(f"force of {hand} (N)", force, low=0.0)
        along = unit_vector(f"direction of {hand}", direction)
        if at is not None:
            there = finite_array(f"point for {hand} (m)", at, (3,))
        order = (then, force, *along.tolist(), firm, *(() if there is None else there.tolist()))
        if order == each.order:
            return
        each.arm.check_idle()
        self._check_sensor(hand)
        holds = each.state in (HandState.HOLD, HandState.GRIP)
        if holds and each.state is not then:
            raise InputError(
                f"{hand} must let go of what it holds before another order: release('{hand}') and wait until it is free"
            )
        if holds:
            there = None
        elif there is not None and (far := math.dist(there, each.arm.shoulder)) > each.span:
            raise InputError(
                f"point for {hand} must be within {each.span:.2f} m of its shoulder, it is {far:.2f} m away"
            )
        if there is None and then is HandState.HOLD:
            most, joint = each.arm.strength(along, self.settings.share, each.tip)
            if force > most:
                raise InputError(
                    f"{hand} can press with {most:.0f} N there ({joint} has no more torque), got {force:g} N"
                )
        if not firm:
            self._check_loss(hand, along, force, there)
        each.take(then, along, force, there)
        each.order, self._ordered = order, True

    def _check_sensor(self, hand: str) -> None:
        """Check that the force on a hand is measured."""
        if self._measurement is None:
            raise InputError(
                f"{hand} presses and grips by the force at its wrist, and nothing has been measured yet: give the "
                "order after the first tick"
            )
        wrenches, sensed = self._measurement.hand_wrenches, []
        if wrenches is not None:
            sensed = [name for name, each in self.all.items() if np.isfinite(wrenches[each.index]).all()]
        if hand not in sensed:
            raise InputError(
                f"{hand} must have a force sensor at its wrist to press or grip: the last measurement has "
                f"{'no hand_wrenches' if wrenches is None else 'NaN for it'}; hands with a reading: "
                f"{', '.join(sensed) or 'none'}"
            )

    def release(self, hand: str) -> None:
        """Take a force back and let go."""
        choose("hand", hand, self.all)
        self.all[hand].release()

    def _check_loss(self, hand: str, along: Array, force: float, at: Array | None) -> None:
        """Check that the robot survives if what it presses on, at a point or where it is now, gives way.

        It survives the loss of this hand alone, and of all hands at once. A force that another hand opposes is no room:
        the CoM does not shift for both, and a loss of one leaves the other. Only where both press on one loose thing
        from two sides do they end together, which the forces do not say: such a thing is firm for each of them.
        """
        each = self.all[hand]
        place = each.destination if at is None else at
        own = self._zmp_moved(along, place)  # by 1 N of this hand
        held = np.zeros(2)  # by the other hands
        for other in self.all.values():
            if other is not each and other.state is not HandState.FREE:
                held += self._zmp_moved(other.ordered * other.direction, other.destination)
        room = np.subtract(self._edges, self.settings.margin)  # to toes and side
        lost, moved = np.maximum(np.sign(own) * held, 0.0), np.abs(own)  # with it, on its side; by 1 N of it
        most = float(np.min((room - lost) / np.maximum(moved, ROUNDING)))
        if force > most:
            off = 1e3 * math.hypot(*(lost + force * moved))
            raise InputError(
                f"{hand} may press with at most {max(most, 0.0):.0f} N there, as the surface may give way: a sudden "
                f"loss of {force:g} N would move the ZMP by {off:.0f} mm, beyond the edge of the soles; give "
                "firm=True for a surface that cannot give way"
            )

    def _zmp_moved(self, push: Array, place: Array) -> Array:
        """Return how far a push at a place moves the ZMP, to the toes and to the side, shape (2,), m."""
        (x, y, z), yaw = self._estimate.com, heading(self._pelvis)
        under = np.array((x, y, z - self._height))
        offset = zmp_offset(np.concatenate((-push, np.cross(place, -push))), under, self._weight)
        return np.array(along((math.cos(yaw), math.sin(yaw)), *offset.tolist()))

    # ---- in a tick ------------------------------------------------------------------------------------------------

    def update(self, measurement: Measurement, reference: Reference) -> Array | None:
        """Advance all hands by a tick; return the filtered wrench on them at the world origin, shape (6,), or None."""
        self._measurement = measurement
        self._ordered = self._ordered and self.wanted
        if not (self._ordered or self.active):
            return None
        rests = reference.progress.phase is GaitPhase.STANDING
        self._watch_slip(measurement, rests)
        # Wrenches on hands that press, on those that grip, and that which is planned, at the world origin.
        felt, pulled, planned = np.zeros(6), np.zeros(6), np.zeros(6)
        readings, solution = measurement.hand_wrenches, self._controller.solution
        for hand in self.all.values():
            if hand.at_work:
                reading = None if readings is None else readings[hand.index]
                wrench = hand.update(reading, solution, self._excess.get(hand.name, ZERO))
                if wrench is None:
                    continue
                if hand.state is HandState.GRIP:
                    pulled += wrench
                else:
                    felt += wrench
                    planned += hand.planned_wrench(2.0 * SHIFT_TIME)
        self._excess = self._yielded(rests)
        outside, dt = self.outside, self._dt
        self.outside = read_only(outside + lag_gain(dt, FILTER_TIME) * (felt + pulled - outside))
        self._slow += lag_gain(dt, SLOW_TIME) * (pulled - self._slow)
        offset = zmp_offset(planned + self._slow, reference.pendulum.zmp, self._weight)
        self._shift.follow(self._beyond_zmp(-offset, reference.progress.heading) - self._shift.value, dt)
        moves = float(np.abs(self._shift.value).max() + np.abs(self._shift.velocity).max()) >= STILL
        self.active = self.wanted or moves or float(np.abs(self.outside[:3]).max()) > NO_FORCE
        if not self.active:
            self.outside, self._slow = read_only(np.zeros(6)), np.zeros(6)
            self._shift = Follower(SHIFT_TIME, np.zeros(2))
        return self.outside

    def _watch_slip(self, measurement: Measurement, rests: bool) -> None:
        """Compare the turn by the gyroscope with that of its link in the estimate."""
        before, self._before = self._before, self._imu.T.copy()
        turned = heading(self._imu @ before) if self.active else 0.0
        self._slip.update(measurement.angular_velocity, self._imu[2], turned, rests, self._dt)

    def _yielded(self, rests: bool) -> dict[str, Array]:
        """Return the forces to which hands that grip yield, shape (3,) each, N.

        They are vertical forces, a squeeze, a sum beyond the limits, and of a robot at rest a tenth of the others.
        """
        gripping = [hand for hand in self.all.values() if hand.state is HandState.GRIP]
        if not gripping:
            return {}
        forces = np.array([hand.felt for hand in gripping])
        mean = forces.sum(axis=0) / len(gripping)
        size, limit = len(gripping) * float(np.linalg.norm(mean)), sum(hand.ordered for hand in gripping)
        excess = np.tile((max(0.0, size - limit) / max(size, ROUNDING)) * mean, (len(gripping), 1))
        if len(gripping) == 2:
            first, second = (hand.measured.translation for hand in gripping)
            line = (second - first) / max(float(np.linalg.norm(second - first)), 1e-6)
            excess += np.outer((forces - mean) @ line, line)
        if rests:
            excess += RELAX * (forces - excess)
        excess[:, 2] = forces[:, 2]
        return {hand.name: force for hand, force in zip(gripping, excess, strict=True)}

    def _beyond_zmp(self, goal: Array, yaw: float) -> Array:
        """Return the shift of the CoM that remains once the ZMP of the feet has moved by `edge` of the distance."""
        parts = along((math.cos(yaw), math.sin(yaw)), *goal.tolist())  # towards the toes, and to the side
        to_edge = min(edge / max(abs(part), ROUNDING) for edge, part in zip(self._box, parts, strict=True))
        return np.asarray(goal * max(0.0, 1.0 - self.settings.edge * to_edge))

    def shifted(self, pendulum: Pendulum) -> Pendulum:
        """Return a reference of the pendulum without hands, moved for their forces."""
        shift = self._shift
        return pendulum.moved(*(np.append(x, 0.0) for x in (shift.value, shift.velocity, shift.acceleration)))

    def help(self, missing: Array, zmp: Array) -> None:
        """Share a moment that the feet lack, about the x and y axes through the ZMP, Nm, among the hands that press."""
        pressing = [hand for hand in self.all.values() if hand.helps]
        if not pressing or self.settings.help == 0.0:
            self._missing[:] = 0.0
            return
        arms = [hand.measured.act(hand.tip) - zmp for hand in pressing]
        levers = np.array(
            [np.cross(arm, -hand.direction)[:2] for arm, hand in zip(arms, pressing, strict=True)]
        ).T
        # The measured forces of the hands contain their help: `missing` is the moment that lacks beside it.
        size = math.hypot(missing[0], missing[1])
        least = HELP_FROM * self._robot.force_scale
        lacks = missing * (max(0.0, 1.0 - least / size) if size > 0.0 else 0.0)
        self._missing += lag_gain(self._dt, HELP_TIME) * (lacks - self._missing)
        square = levers @ levers.T + 1e-3 * np.eye(2)
        wanted = self.settings.help * levers.T @ np.linalg.solve(square, self._missing)
        for hand, force in zip(pressing, wanted.tolist(), strict=True):
            hand.force.help(force, self._dt)
