"""Decision of a step: where and when it lands, and where the foot that stands presses until then.

The program (`wbc.walking.stepping.program`) weighs the steps of a velocity or footsteps against the DCM; on seen ground
the landing is then held to a nearby place that tilts the foot less, at the cost that the program says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from wbc.base.numbers import Array, lag_gain
from wbc.base.vectors import Point, Vector
from wbc.ground.height_map import Places
from wbc.walking.ground import LAST_LOOK, GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.swing import RISE
from wbc.walking.stepping.felt import HeldArea
from wbc.walking.stepping.law import LEAST_OFFSET, Divergent, Orbit, StanceAxes
from wbc.walking.stepping.program import Bounds, Now, Step, StepProgram, Wish
from wbc.walking.stepping.settings import GaitValues

MISSED, LATER = 0.02, 8
"""Distance by which a foot may miss its place, m; number of later times that are tried where it misses more."""

KEPT = 0.05
"""Greatest distance by which the foot may miss more at the time that was chosen before, and this time stays, m."""

TOLERANCE = 0.003
"""Distance by which a landing that is held may move, m."""

STAIR_TIME = 0.85
"""Shortest time of a step on stairs, over T: legs lift a foot over two stairs no sooner."""


class StepState(NamedTuple):
    """State that a step is decided by."""

    axes: StanceAxes  # axes about the carrying point of the foot that stands
    cop_command: Vector  # commanded centre of pressure on it, with the low-pass of the measured one, m
    contact: Vector  # measured centre of pressure, low-passed, m
    dcm: Divergent  # divergent component of motion about it
    orbit: Orbit  # orbit of the steps that are asked for
    nominal: float  # time T of a step, s
    longest: float  # longest time of this step, s
    elapsed: float  # time since lift-off, s
    swing: tuple[float, float, float, float]  # place of the swing foot's centre, m, and its velocity, m/s
    down: float  # time that the swing foot needs to come straight down, s
    climbs: bool = False  # true for a landing on a stair, which moves aside alone: ahead and behind are edges


class SwingWay(NamedTuple):
    """Way that a swing foot can go, seen from the foot that stands.

    The way of a quintic that comes to rest after t is v t/2 + a t² √3/10, with its greatest acceleration a.
    """

    place: Point  # carrying point of the swing foot, ahead and outwards of that of the foot that stands, m
    velocity: Point  # of the swing foot, m/s
    push: float  # greatest acceleration a, m/s²

    def reached(self, time: float, places: tuple[Point, Point]) -> tuple[Point, Point]:
        """Return the least and the greatest of these places, m, that the foot reaches from rest within a time, s."""
        (low, high), (ahead, outwards), way = places, self.place, time * time * self.push / RISE
        least = _within(ahead - way, low[0], high[0]), _within(outwards - way, low[1], high[1])
        return least, (_within(ahead + way, least[0], high[0]), _within(outwards + way, least[1], high[1]))

    def missed(self, time: float, place: Point, bounds: Bounds) -> float:
        """Return by how much the foot misses a place within a time, s, as far as it is within bounds, m."""
        goal = [_within(p, least, most) for p, least, most in zip(place, *bounds.places, strict=True)]
        dx, dy = goal[0] - self.place[0], goal[1] - self.place[1]
        way = math.hypot(dx, dy)
        speed = (dx * self.velocity[0] + dy * self.velocity[1]) / max(way, LEAST_OFFSET)
        short = max(way - (0.5 * speed + self.push / RISE * time) * time, 0.0)
        return short + math.hypot(place[0] - goal[0], place[1] - goal[1])


class PutDown(NamedTuple):
    """A swing foot that is put down beside where it is, at once."""

    end: float  # time of the step, s
    places: tuple[Point, Point]  # least and greatest place ahead and outwards, m


class StepDecision:
    """Decision of the step that swings: a few hundred times a second from its lift-off on.

    Attributes:
        area: Supported area of the foot that stands.
        place: Centre of the swing foot when it lands, m.
        end: Time of the step, s.
        cop: Shift of the centre of pressure from the carrying point, along and across the sole, m: that of this tick.
        lagged: The same with the low-pass of the measured one, which is compared with it, m.
        urgency: Share from 0 to 1 by which the swing foot goes before the trunk.
        displaced: Distance by which balance moves the landing from the one that was asked for, m; where the ground is
            seen, the landing may then be moved on to a better place.
    """

    def __init__(self, values: GaitValues, ground: GroundEstimate) -> None:
        """Make the program."""
        settings, constants, scale, dt = values
        self._settings, self._law, self._scale, self._ground = settings, constants, scale, ground
        self.area, self._program = HeldArea(scale.sole, constants.area, dt), StepProgram(scale.height)
        self._places = (-settings.reach, settings.gap), (settings.reach, settings.widest)
        self._most = constants.area.cop_speed * dt  # change of the centre of pressure in a tick, m
        self._gain = lag_gain(dt, constants.area.cop_lag)
        self.place: Point = (0.0, 0.0)
        self.end = settings.step_time
        self.begin()

    def begin(self) -> None:
        """Begin a step, on a foot whose supported area is a point."""
        self.area.forget()
        self.cop = self.lagged = self._wanted = 0.0, 0.0
        self.urgency = self.displaced = 0.0
        self._decided = False
        self._delayed_end: float | None = None  # end of a step for which legs need longer, s
        self._put_down: PutDown | None = None  # None for a foot that swings on
        self._chosen_about: Point | None = None  # landing of the program about which a place was chosen, m
        self._chosen: Point | None = None  # that place, m

    def press(self) -> None:
        """Move the centre of pressure on by a tick."""
        (a, b), (u, v), most = self.cop, self._wanted, self._most
        self.cop = a, b = a + min(max(u - a, -most), most), b + min(max(v - b, -most), most)
        (p, q), gain = self.lagged, self._gain
        self.lagged = p + gain * (a - p), q + gain * (b - q)

    def decide(self, state: StepState, wish: Wish, look: float | None) -> None:
        """Decide anew; what was decided stays if the program fails.

        Args:
            state: State of the step.
            wish: Steps that are asked for.
            look: Time left in which a landing may be moved on seen ground, s; None for one that stays.
        """
        now, down = self._pendulum(state), None
        bounds = self._bounds(state, now.run)
        (_, far_edge), _ = bounds.area
        if (
            now.run[1] < far_edge - self._law.time.outer_cop
        ):  # ξ runs away from the swing foot: no pressure stops it
            down = self._put_down or self._puts_down(state, now.run)
            bounds = bounds.ending() if down is None else bounds.ending(down.end - state.elapsed, down.places)
        self._put_down = down
        step, bounds = self._solve(state, now, wish, bounds, swings_on=down is None)
        if step is None:
            if self._decided:
                return
            step = Step((wish.places[0], wish.places[1]), (0.0, 0.0), state.nominal)
        self._decided = True
        near, far = self._law.swing.urgent
        self.displaced = off = math.dist(step.place, wish.places[:2])
        self.urgency = min(max((off - near) / (far - near), 0.0), 1.0)
        self.place = free = self._centre(state, step.place)
        chosen = None if look is None else self._choose(state, bounds.area, free, look)
        if chosen is not None:
            x, y = state.axes.offset(*chosen)
            there = x + self._law.area.carrying, y
            step = self._program.solve(now, wish, bounds, (there, there)) or step
            self.place = self._centre(state, step.place)
        self.end, self._wanted = state.elapsed + step.left, (step.shift[0], state.axes.side * step.shift[1])

    def _pendulum(self, state: StepState) -> Now:
        """Return the pendulum about the foot that stands, and the time that is left of the step."""
        axes, most = state.axes, self._law.area.cop_error
        (x, y, _), (p, q, _) = state.contact, state.cop_command
        ahead, outwards = axes.outwards(x - p, y - q)
        left = max(state.nominal - state.elapsed, 0.0)
        return Now(
            dcm=axes.offset(state.dcm.x, state.dcm.y),
            contact=(min(max(ahead, -most), most), min(max(outwards, -most), most)),
            omega=state.dcm.omega,
            left=left,
            last=max(self.end - state.elapsed, 0.0) if self._decided else left,
            shift=(self._wanted[0], axes.side * self._wanted[1]),
        )

    def _solve(
        self, state: StepState, now: Now, wish: Wish, bounds: Bounds, *, swings_on: bool
    ) -> tuple[Step | None, Bounds]:
        """Return the step with its bounds; None if the program fails.

        One whose foot `swings_on` keeps a promised landing, and comes later where legs need the time.
        """
        solve: Callable[[Now, Wish, Bounds], Step | None] = self._program.solve
        if wish.promised and swings_on:
            bounds, solve = bounds.containing(wish.places), partial(self._keep_landing, climbs=state.climbs)
        step = solve(now, wish, bounds)
        if step is not None:
            later = self._time_for_legs(state, step, now, wish, bounds)
            self._delayed_end = None if later is None else state.elapsed + later
            if swings_on and later is not None and later > step.left:  # ξ goes on until then
                bounds = bounds.after(later)
                step = solve(now._replace(last=later, shift=step.shift), wish, bounds) or step
        return step, bounds

    def _keep_landing(self, now: Now, wish: Wish, bounds: Bounds, *, climbs: bool) -> Step | None:
        """Solve with the landing where it is asked for, or moved by the offset of ξ that the next sole cannot catch.

        What an offset is off the plan's grows by E within the next step. The centre of pressure, moved by as much,
        holds it; beyond the supported area it does not, and to move this landing costs less than to move the next one.
        """
        place, program = (wish.places[0], wish.places[1]), self._program
        box = _box(place, bounds)
        step = program.solve(now, wish, bounds, box)
        if step is None:
            return program.solve(now, wish, bounds)
        (ahead, aside), (b, d, *_) = step.offset, wish.offsets
        (least_x, most_x), (least_y, most_y) = self.area.caught(self._law.area.caught)
        x = 0.0 if climbs else _beyond(ahead - b, least_x, most_x)
        y = _beyond(aside - d, least_y, most_y)
        if math.hypot(x, y) < TOLERANCE:
            return step
        box = _box((place[0] + x, place[1] + y), bounds)
        return program.solve(now, wish, bounds, box) or step

    def _bounds(self, state: StepState, run: Point) -> Bounds:
        """Return the limits of a step, with the offset of ξ from the contact ahead and outwards, m."""
        law, (half_length, half_width) = self._law, self._scale.sole
        # A step that would wait for ξ aside ends where ξ has run ahead.
        most = max(abs(state.orbit.forward) + law.time.stretch, LEAST_OFFSET) / max(abs(run[0]), LEAST_OFFSET)
        stretched = max(math.log(most), 0.0) / state.dcm.omega
        shortest, (behind, ahead) = self._shortest(state), self.area.ahead
        far_edge, near_edge = self.area.across(state.axes.side)
        return Bounds(
            places=self._places,
            area=((behind, far_edge), (ahead, near_edge)),
            next_area=(law.area.next_area * half_length, law.area.next_area * half_width),
            times=(shortest, max(min(max(state.longest - state.elapsed, 0.0), stretched), shortest)),
        )

    def _shortest(self, state: StepState) -> float:
        """Return the shortest time that is left of a step, s."""
        least = self._settings.shortest
        if state.climbs:
            least = max(least, STAIR_TIME * state.nominal)
        return max(least - state.elapsed, 0.0)

    @property
    def closes(self) -> bool:
        """True while the swing foot is put down beside where it is, at once."""
        return self._put_down is not None

    def _puts_down(self, state: StepState, run: Point) -> PutDown | None:
        """Return when and where the swing foot is put down at once, with ξ past the outer bound; None if it closes up.

        It is put down where the step after this one has less far to go then. ξ is so far ahead and outwards of the
        contact, m.
        """
        if state.climbs or state.elapsed <= 0.0:
            return None
        settings, omega, ahead, way = self._settings, state.dcm.omega, run[0], self._way(state)
        closing = self._shortest(state)
        time = min(closing, state.down)
        (near, _), (far, _) = way.reached(closing, self._places)
        closed = _within(ahead * math.exp(omega * closing), near, far), settings.gap
        if self._way_on(way.place, run, omega, time) < self._way_on(closed, run, omega, closing):
            return PutDown(state.elapsed + time, way.reached(time, self._places))
        return None

    def _way_on(self, place: Point, run: Point, omega: float, time: float) -> float:
        """Return the way of the step after one that lands at a place (x, d) after a time t₁, m.

        The foot that stands now steps out in the shortest time t of a step: by (ξ e^{ω t₁} − x) e^{ω t} + x ahead, and
        by (d + ξ e^{ω t₁}) e^{ω t} − d aside.
        """
        (x, d), (ahead, outwards) = place, run
        grown, growth = math.exp(omega * time), math.exp(omega * self._settings.shortest)
        return math.hypot((ahead * grown - x) * growth + x, (d - outwards * grown) * growth - d)

    def _way(self, state: StepState) -> SwingWay:
        """Return the way that the swing foot can go."""
        (x, y, u, v), axes = state.swing, state.axes
        ahead, outwards = axes.offset(x, y)
        place, law = (ahead + self._law.area.carrying, outwards), self._law
        return SwingWay(place, axes.outwards(u, v), law.swing.swing_push)

    def _time_for_legs(
        self, state: StepState, step: Step, now: Now, wish: Wish, bounds: Bounds
    ) -> float | None:
        """Return the time left after which the swing foot comes nearest to where it is to land, s.

        None if legs can make the step within its own time. Else the place is looked for at later times: it moves away
        with ξ, and the way that the foot can go grows.
        """
        way, shortest, longest = self._way(state), step.left, max(state.longest - state.elapsed, 0.0)
        best, least = shortest, way.missed(shortest, step.place, bounds)
        if least < MISSED:
            return None
        for k in range(1, LATER + 1):
            time = shortest + (longest - shortest) * k / LATER
            off = way.missed(time, now.landing(time, wish), bounds)
            if off < least - MISSED / LATER:
                best, least = time, off
            if least < MISSED:
                break
        if self._delayed_end is not None:  # a place that jumps to and fro is reached least of all
            time = _within(self._delayed_end - state.elapsed, shortest, longest)
            if way.missed(time, now.landing(time, wish), bounds) < least + KEPT:
                best = time
        return best

    def _centre(self, state: StepState, place: Point) -> Point:
        """Return the centre of a landing whose carrying point is ahead and outwards of that of the stance foot."""
        return state.axes.point(place[0] - self._law.area.carrying, place[1])

    def _choose(self, state: StepState, area: tuple[Point, Point], free: Point, look: float) -> Point | None:
        """Return the place near the program's landing where the sole is to rest; None where none is chosen.

        The area is that of the shift of the centre of pressure.
        """
        settings, law = self._settings, self._law
        moved = self._chosen_about is None or math.dist(free, self._chosen_about) > law.swing.again
        early = state.elapsed < law.swing.choice * (state.elapsed + look) / law.swing.touch
        if early or look <= LAST_LOOK or not moved:
            return self._chosen
        k = self._program.stiffness(area) * (law.swing.balance_cost / self._scale.height**2)
        aside = state.axes.side * k[0, 1]

        def cost(moves: Places) -> Array:
            u, v = moves.real, moves.imag
            return np.asarray(0.5 * (k[0, 0] * u * u + 2.0 * aside * u * v + k[1, 1] * v * v))

        def allowed(x: float, y: float) -> bool:
            ahead, outwards = state.axes.offset(x, y)
            beside = settings.gap <= outwards <= settings.widest
            return beside and abs(ahead + law.area.carrying) <= settings.reach

        (cos, sin), left = state.axes.direction, state.axes.side > 0.0
        place = Footstep("left" if left else "right", *free, self._ground.height, math.atan2(sin, cos))
        chosen = self._ground.choose(place, allowed, cost)
        self._chosen_about = free
        self._chosen = None if (chosen.x, chosen.y) == free else (chosen.x, chosen.y)
        return self._chosen


def _within(value: float, low: float, high: float) -> float:
    """Return a value cut to limits; the upper one counts where they cross."""
    return min(max(value, low), high)


def _beyond(off: float, low: float, high: float) -> float:
    """Return the part of an offset that a landing makes good: none within bounds, all from twice the bounds on, m."""
    most = high if off > 0.0 else -low
    return math.copysign(min(max(2.0 * (abs(off) - most), 0.0), abs(off)), off)


def _box(place: Point, bounds: Bounds) -> tuple[Point, Point]:
    """Return the least and the greatest landing about a place, m, within bounds."""
    x, y = (_within(at, low, high) for at, low, high in zip(place, *bounds.places, strict=True))
    return (x - TOLERANCE, y - TOLERANCE), (x + TOLERANCE, y + TOLERANCE)
