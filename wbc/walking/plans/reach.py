"""Reach of a robot's legs, the gait for its size, and the check of a plan against its reach."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_scalar
from wbc.base.settings import Positive, in_units, settings
from wbc.core.model import joints_to
from wbc.core.robot import BASE_DOF, GRAVITY, SIDES, Robot
from wbc.walking.plans.effort import SwingLeg, swing_effort
from wbc.walking.plans.footsteps import LEAST_STAIR, Footstep, FootstepPlan, Index, SoleSizes, moved
from wbc.walking.plans.gait import Gait, StepGait

MAX_SLOPE = 0.5
"""Steepest landing that a plan may ask for, rad: tan 0.5 = 0.55, near the friction at which a sole slips."""

QUICKEST = 0.9
"""Least time on one foot in planned steps, 1/ω: at 0.95/ω three robots of three sizes walk, at 0.7/ω they fall."""

FAR = 1e4
"""Size from which a number is written in powers of ten in a message, m or rad."""


STRETCHED = 0.98
"""Ratio of its length to which a leg may stretch in a step: further, the knee hardly moves the foot."""

SPANS = 1.6
"""Greatest length of a step over the distance that a leg spans either way: both legs span it, with room."""

STANDING = 0.979
"""Ratio of its length to which a standing leg may stretch: a straight leg can take no step."""

CARRIED = 0.8
"""Share of the knee's torque limit that carries a robot on one leg; the rest is for its steps."""

ROOM = 0.12
"""Distance that an ankle keeps to the end of its range on a standing leg, rad: the foot behind bends it further."""

STRAIGHT = 0.95
"""Ratio of its length from which a leg in half-sitting is too straight for long steps."""


class OutOfReachError(InputError):
    """A step that the legs do not reach in the time of its swing, or a velocity of such steps."""


Extent = tuple[float, float, float, float]
"""Least and greatest x, least and greatest y of the ground, m."""

CLEARING = 0.01
"""Distance by which a step goes outwards, again and again, whose sole would overlap the one that stands, m."""

STEP = 0.99
"""Share of the legs' reach that a default step may take."""

BACK = 0.8
"""Share of the greatest length that a step has which would be longer: the rest is for the balance."""


@settings
class Reach:
    """Limits of a step, measured from the stance sole to the landing sole in the stance frame.

    Attributes:
        max_length: Greatest distance forward or back, m.
        min_spacing: Least lateral distance between the soles' centres, m.
        max_spacing: Greatest lateral distance between the soles' centres, m.
        max_yaw: Greatest turn outwards, rad; half of it inwards.
        max_height: Greatest difference in height, m.
        max_swing_height: Greatest swing height, m.
        min_single_support: Least time on one foot, s.
        soles: (length, width) of the left and of the right sole, m.
        leg: Leg that swings.
    """

    max_length: Annotated[Positive, "m"]
    min_spacing: Annotated[Positive, "m"]
    max_spacing: Annotated[Positive, "m"]
    max_yaw: Annotated[Positive, "rad"]
    max_height: Annotated[Positive, "m"]
    max_swing_height: Annotated[Positive, "m"]
    min_single_support: Annotated[Positive, "s"]
    soles: Annotated[SoleSizes, "m"]
    leg: SwingLeg

    def __post_init__(self) -> None:
        if self.min_spacing >= self.max_spacing:
            raise InputError(
                f"min_spacing must be below max_spacing, got {self.min_spacing:g} and {self.max_spacing:g} m"
            )

    @staticmethod
    @checked
    def of(robot: Robot, com_height: Annotated[Positive, "m"] | None = None) -> Reach:
        """Return the reach of a robot, by its legs, for a CoM height over the soles, m; half-sitting when None.

        A leg of length L whose hip, half way between the feet, is h over its ankle spans √((0.98 L)² − h²) either way.
        Raises `InputError` with the range for a height that the legs cannot reach.
        """
        leg = Leg(robot)
        span, spacing = leg.span(com_height), leg.spacing
        left, right = robot.soles[:2]
        yaw = _hip_yaw_range(robot)
        return Reach(
            max_length=SPANS * span,
            min_spacing=min(max(left.width, right.width) + 0.01, 0.95 * spacing),
            max_spacing=spacing + 1.2 * span,
            max_yaw=min(0.5, 0.8 * yaw) if yaw > 0.0 else 0.1,
            max_height=leg.length / 3.0,
            max_swing_height=leg.length / 2.0,
            min_single_support=QUICKEST * math.sqrt(leg.com_height / GRAVITY),
            soles=((left.length, left.width), (right.length, right.width)),
            leg=leg.swing(com_height),
        )

    def allows(self, stance: Footstep, step: Footstep) -> bool:
        """Return True if a step is within reach over the ground, seen from the foot that stands."""
        forward, spacing, _, _ = step.outwards_of(stance)
        aside = self.min_spacing - ROUNDING <= spacing <= self.max_spacing + ROUNDING
        return aside and abs(forward) <= self.max_length + ROUNDING

    def nearest(self, stance: Footstep, step: Footstep) -> Footstep:
        """Return a step within reach of the foot that stands, clear of it: the same one, or the nearest on its way."""
        forward, beside, _, out = step.outwards_of(stance)
        side, long = 1.0 if step.side == "left" else -1.0, self.max_length
        turned = -0.5 * self.max_yaw - ROUNDING <= out <= self.max_yaw + ROUNDING
        if turned and self.allows(stance, step) and not self.overlap(stance, step):
            return step
        x = forward if abs(forward) <= long + ROUNDING else math.copysign(BACK * long, forward)
        yaw = stance.yaw + side * min(max(out, -0.5 * self.max_yaw), self.max_yaw)
        beside = min(max(beside, self.min_spacing), self.max_spacing)
        while True:
            u, v, _ = moved((stance.x, stance.y, stance.yaw), x, side * beside, 0.0)
            near = replace(step, x=u, y=v, yaw=yaw)
            if beside >= self.max_spacing or not self.overlap(stance, near):
                return near
            beside = min(beside + CLEARING, self.max_spacing)

    def effort(self, gait: StepGait, begin: float, end: float, aside: float) -> float:
        """Return what a step on level ground asks of hip and knee over what they give; see `swing_effort`."""
        share = max(abs(end) / self.max_length, gait.swing_height / self.max_swing_height)
        return share * swing_effort(self.leg, gait, round(begin, 3), round(end, 3), round(aside, 3))

    def corners(self, foot: Footstep) -> Array:
        """Return the corners of a sole in the world, seen from above, shape (4, 2), m."""
        half = 0.5 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * self.soles[SIDES.index(foot.side)]
        c, s = math.cos(foot.yaw), math.sin(foot.yaw)
        corners: Array = half @ np.array([[c, s], [-s, c]]) + (foot.x, foot.y)
        return corners

    def overlap(self, a: Footstep, b: Footstep) -> bool:
        """Return True if two soles overlap, by the separating axes of two rectangles."""
        p, q = self.corners(a), self.corners(b)
        for yaw in (a.yaw, a.yaw + math.pi / 2, b.yaw, b.yaw + math.pi / 2):
            axis = np.array([math.cos(yaw), math.sin(yaw)])
            s, t = p @ axis, q @ axis
            if s.max() <= t.min() or t.max() <= s.min():
                return False
        return True


class Leg:
    """Left leg of a robot, measured in half-sitting; its two longest bars are thigh and shank.

    Attributes:
        length: Thigh and shank together, m.
        shank: Knee to ankle, m.
        knee: Index of the knee in arrays of joints, shape (na,).
        shortest: Hip to ankle with the knee bent by 120°, m.
        ankle_height: Ankle over the sole, m.
        hip_height: Height of the hip over the ankle, m.
        com_height: Height of the CoM over the sole, m.
        spacing: Lateral distance between the centres of both soles, m.
    """

    def __init__(self, robot: Robot) -> None:
        """Measure a robot; an `InputError` for a sole that does not hang on a leg with a knee."""
        self._robot, model = robot, robot.model
        self._data = data = model.createData()
        pin.centerOfMass(model, data, robot.half_sitting)
        pin.computeJointJacobians(model, data, robot.half_sitting)
        pin.updateFramePlacements(model, data)
        chain = joints_to(model, robot.frame_id(robot.soles[0].frame))
        places = [data.oMi[joint].translation for joint in chain]
        bars = [float(np.linalg.norm(b - a)) for a, b in zip(places, places[1:], strict=False)]
        if len(bars) < 2:
            raise InputError(f"sole '{robot.soles[0].name}' of {robot!r} does not hang on a leg with a knee")
        first, second = sorted(sorted(range(len(bars)), key=lambda i: bars[i])[-2:])
        hip, ankle = places[first], places[second + 1]
        left, right = (data.oMf[robot.frame_id(sole.frame)].translation for sole in robot.soles[:2])
        thigh, self.shank = bars[first], bars[second]
        self.length, bend = thigh + self.shank, math.radians(120.0)
        self.shortest = math.sqrt(thigh**2 + self.shank**2 + 2.0 * thigh * self.shank * math.cos(bend))
        self.knee = model.joints[chain[second]].idx_v - BASE_DOF
        self._above = chain[:second]  # joints from the base to the knee, without it
        self._ankle = max(chain[second + 1 :], key=lambda joint: abs(self._pitch(joint)))
        self.ankle_height, self.hip_height = float(ankle[2]) - float(left[2]), float(hip[2] - ankle[2])
        self.com_height = float(data.com[0][2]) - float(left[2])
        # Height of the hip over the ankle less that of the CoM over the sole, for an upright trunk.
        self._offset = float(hip[2]) - float(data.com[0][2]) - self.ankle_height
        self.spacing = float(np.linalg.norm(left[:2] - right[:2]))

    def _pitch(self, joint: int) -> float:
        """Return the part of the axis of a joint that is to the left."""
        return float(self._data.J[4, self._robot.model.joints[joint].idx_v])

    def hips(self, com_height: float | None) -> float:
        """Return the height of the hips over the ankles, m, for a CoM height over the soles; half-sitting when None."""
        robot = self._robot
        low, high = self.shortest - self._offset, STANDING * self.length - self._offset
        if com_height is None:
            if self.hip_height > STANDING * self.length:
                raise InputError(
                    f"the legs of '{robot.name}' are too straight in half-sitting to take a step; give a CoM height "
                    f"from {low:.3f} to {high:.3f} m"
                )
            return self.hip_height
        what = f"CoM height (m) of '{robot.name}' (half-sitting: {self.com_height:.3f} m)"
        return finite_scalar(what, com_height, low=low, high=high) + self._offset

    def span(self, com_height: float | None) -> float:
        """Return how far an ankle gets from below its hip, m, for a CoM height over the soles; see `hips`."""
        return math.sqrt((STRETCHED * self.length) ** 2 - self.hips(com_height) ** 2)

    def carried_height(self) -> float:
        """Return the least CoM height over the soles, m, at which one leg carries a robot that steps.

        With the hip above the ankle the shank tilts by α, and the knee, whose torque is m g b sin α for a shank of
        length b, may take `CARRIED` of its limit; the ankle must keep `ROOM` to the end of its range. Half-sitting is
        carried.
        """
        robot, shank, thigh = self._robot, self.shank, self.length - self.shank
        knee = CARRIED * float(robot.torque_limit[self.knee]) / (robot.mass * GRAVITY * shank)
        ankle = robot.model.joints[self._ankle].idx_v - BASE_DOF
        bent = float(robot.half_sitting[7 + ankle])
        # A foot that turns forward lets the shank stand up.
        end = float((robot.position_lower if self._pitch(self._ankle) > 0.0 else robot.position_upper)[ankle])
        now = (self.hip_height**2 + shank**2 - thigh**2) / (2.0 * self.hip_height * shank)
        tilt = math.acos(min(1.0, now)) + max(0.0, abs(end - bent) - ROOM)
        tilt = min(tilt, math.asin(min(1.0, knee)), math.asin(min(1.0, thigh / shank)))
        hip = shank * math.cos(tilt) + math.sqrt(thigh**2 - (shank * math.sin(tilt)) ** 2)
        return min(hip, self.hip_height) - self._offset

    def bent_height(self, stretch: float) -> float:
        """Return the CoM height over the soles of a driven robot, m: straight legs bend to a ratio of their length."""
        if self.hip_height <= STRAIGHT * self.length:
            return self.com_height
        return self.com_height - max(0.0, self.hip_height - max(stretch * self.length, self.shortest))

    @property
    def _hip(self) -> int:
        """Index of the hip's pitch in velocities."""
        return int(
            self._robot.model.joints[max(self._above, key=lambda joint: abs(self._pitch(joint)))].idx_v
        )

    def hip_acceleration(self) -> float:
        """Return the angular acceleration of the leg by the whole torque of its hip, rad/s²."""
        robot, hip = self._robot, self._hip
        inertia = pin.crba(robot.model, robot.model.createData(), robot.half_sitting)
        return float(robot.torque_limit[hip - BASE_DOF]) / float(inertia[hip, hip])

    def swing(self, com_height: float | None) -> SwingLeg:
        """Return the leg that swings below the hips of a CoM height over the soles, m; see `hips`."""
        hip, knee = (float(self._robot.velocity_limit[joint]) for joint in (self._hip - BASE_DOF, self.knee))
        push = self.length * self.hip_acceleration()
        return SwingLeg(self.length - self.shank, self.shank, self.hips(com_height), hip, knee, push)


def _hip_yaw_range(robot: Robot) -> float:
    """Return the smaller of the outward ranges of the hips' yaw, rad; 0 if no leg joint turns about the vertical."""
    ranges = []
    for sole, outward in zip(robot.soles[:2], (1.0, -1.0), strict=True):
        found = vertical_joint(robot, sole.frame, pin.neutral(robot.model))
        if found is None:
            return 0.0
        joint, up = found
        ends = robot.position_upper if up * outward > 0.0 else -robot.position_lower
        ranges.append(float(ends[joint]))
    return min(ranges)


def vertical_joint(robot: Robot, frame: str, configuration: Array) -> tuple[int, float] | None:
    """Return the first joint from the base to a frame that turns about the vertical, and its axis upwards, if any.

    The joint is an index in arrays of shape (na,), the axis is between −1 and 1.
    """
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, configuration)
    for joint in robot.joints_between(frame, robot.base_frame):
        up = float(data.J[5, BASE_DOF + joint])
        if abs(up) > 0.9:
            return joint, up
    return None


def sized(gait: Gait, robot: Robot) -> Gait:
    """Return a gait whose values that are not given fit a robot's size (`Robot.length_scale`) and its legs.

    A pendulum of half the height falls in √½ of the time: times and speeds go with the root of lengths.
    """
    root = math.sqrt(robot.length_scale)
    usual = StepGait()
    own = in_units(usual, {"m": root**2, "s": root, "m/s": root})
    changes = {
        field.name: round(value, 4)
        for field in fields(gait)
        if getattr(gait, field.name) is None
        and (value := getattr(own, field.name)) != getattr(usual, field.name)
    }
    if gait.step_length is None:
        reach = STEP * Reach.of(robot).max_length
        if reach < changes.get("step_length", usual.step_length):
            changes["step_length"] = reach
    return replace(gait, **changes)


@checked
def check_plan(
    plan: FootstepPlan,
    reach: Reach | None,
    extent: Extent | None = None,
    *,
    effort: bool = True,
    first: Index = 0,
) -> None:
    """Raise an `InputError` unless legs of a reach walk a plan on a ground of an extent, m; None is endless.

    Of legs whose reach is unknown, None, the ground alone is checked, under the centres of the soles. Without `effort`
    the speeds and torques that its swings need are not checked: those of a plan that was accepted are the same from a
    place beside it. The `first` steps, and with them the feet at the start, may be left out.
    """
    if reach is not None:
        _check_legs(plan, reach, first, effort=effort)
    if extent is not None:
        check_extent(plan, reach, extent, first)


def _check_legs(plan: FootstepPlan, reach: Reach, first: int, *, effort: bool) -> None:
    gait = plan.gait.full.for_stairs() if plan.climbs else plan.gait.full
    height = gait.swing_height
    if height > reach.max_swing_height + ROUNDING:
        raise InputError(
            f"swing_height of {height:g} m is out of reach: the legs lift a foot by up to "
            f"{reach.max_swing_height:.3f} m"
        )
    if gait.single_support < reach.min_single_support - ROUNDING:
        raise InputError(
            f"single_support of {gait.single_support:g} s is too quick: the robot needs "
            f"{reach.min_single_support:.3f} s at least, {QUICKEST:g}/ω"
        )
    if first == 0:
        _check_overlap("the feet at the start", plan.left, plan.right, reach)
    for i, step in enumerate(plan.steps[first:], first):
        _check_step(f"step {i + 1} of {len(plan)} ({step.side})", plan.stance(i), step, reach)
        _check_overlap(f"step {i + 1} of {len(plan)}", step, plan.stance(i), reach)
        if effort:
            _check_effort(plan, i, gait, reach)


def _check_step(what: str, stance: Footstep, step: Footstep, reach: Reach) -> None:
    forward, spacing, up, open_turn = step.outwards_of(stance)
    limits = (
        ("goes forward by", forward, -reach.max_length, reach.max_length, "m"),
        ("stands beside the stance foot by", spacing, reach.min_spacing, reach.max_spacing, "m"),
        ("rises by", up, -reach.max_height, reach.max_height, "m"),
        ("turns outwards by", open_turn, -0.5 * reach.max_yaw, reach.max_yaw, "rad"),
        ("pitches by", step.pitch, -MAX_SLOPE, MAX_SLOPE, "rad"),
        ("rolls by", step.roll, -MAX_SLOPE, MAX_SLOPE, "rad"),
    )
    for verb, value, low, high, unit in limits:
        if not low - ROUNDING <= value <= high + ROUNDING:
            size = f"{value:.3f}" if abs(value) < FAR else f"{value:.3g}"
            raise OutOfReachError(
                f"{what} {verb} {size} {unit}; within reach is {low:.3f} to {high:.3f} {unit}"
                + (": a smaller step_length or velocity fits" if verb.startswith("goes") else "")
            )


def _check_effort(plan: FootstepPlan, index: int, gait: StepGait, reach: Reach) -> None:
    """Raise an `InputError` for a step on level ground that is long, quick and high at once; stairs take their time."""
    step, stance = plan.steps[index], plan.stance(index)
    before = plan.feet(index)[SIDES.index(step.side)]
    (begin, from_side, down, _), (end, to_side, up, _) = (foot.seen_from(stance) for foot in (before, step))
    if max(abs(down), abs(up)) >= LEAST_STAIR:
        return
    effort = reach.effort(gait, begin, end, to_side - from_side)
    if effort > 1.0:
        way, height = math.hypot(end - begin, to_side - from_side), 1e3 * gait.swing_height
        raise OutOfReachError(
            f"step {index + 1} of {len(plan)} ({step.side}) moves a foot by {way:.3f} m, {height:.0f} mm high, in "
            f"{gait.single_support:g} s: that takes {effort:.2f} times what hip and knee give in that time; a longer "
            "single_support, shorter steps or a lower swing_height fit"
        )


def _check_overlap(what: str, a: Footstep, b: Footstep, reach: Reach) -> None:
    if reach.overlap(a, b):
        raise InputError(
            f"the soles overlap at {what}: {a.side} at ({a.x:.3f}, {a.y:.3f}), {b.side} at ({b.x:.3f}, {b.y:.3f}) m"
        )


def check_extent(plan: FootstepPlan, reach: Reach | None, extent: Extent, first: int = 0) -> None:
    """Raise an `InputError` for a sole of a plan, or, without a reach, its centre, beyond a ground of an extent, m."""
    low_x, high_x, low_y, high_y = extent
    soles = ((0.0, 0.0), (0.0, 0.0)) if reach is None else reach.soles
    start = () if first else ((-1, plan.left), (-1, plan.right))
    for i, step in (*start, *enumerate(plan.steps[first:], first)):
        length, width = soles[SIDES.index(step.side)]
        c, s = abs(math.cos(step.yaw)), abs(math.sin(step.yaw))
        x, y = 0.5 * (c * length + s * width) - ROUNDING, 0.5 * (s * length + c * width) - ROUNDING
        if not (low_x + x <= step.x <= high_x - x and low_y + y <= step.y <= high_y - y):
            which = f"the {step.side} foot at the start" if i < 0 else f"step {i + 1}"
            raise InputError(
                f"{which} leaves the ground at x = {step.x:.3f}, y = {step.y:.3f} m; it {over(extent)}"
            )


def over(extent: Extent) -> str:
    """Return the extent of a ground, m, as a text."""
    low_x, high_x, low_y, high_y = extent
    return f"extends over x from {low_x:g} to {high_x:g} and y from {low_y:g} to {high_y:g} m"
