"""Filter that makes a clip feasible for a robot: limits, speeds, feet on the ground, ZMP inside the supports.

    clip  →  limits and low pass  →  arms drawn in  →  time (speeds, rest at both ends)  →  contacts  →  footsteps
          →  trunk straightened  →  inverse kinematics ⇄ centre of mass moved until the ZMP is inside the support
          →  feasible clip

With Δp the change of the ZMP that is needed, the centre of mass moves by Δc, the solution over the whole clip of

    Δc − (h/g) Δc̈ = Δp,

which looks ahead as preview control does. Sources: S. Kajita et al., ICRA 2003 (second pass of preview control);
S. Nakaoka et al., IROS 2005 (leg tasks); K. Yamane, Y. Nakamura, T-RA 19(3), 2003 (dynamics filter).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field
from scipy.linalg import solve_banded
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive, Ratio, settings
from wbc.core.robot import BASE_DOF, GRAVITY, Robot
from wbc.motion.clip import LONGEST, MotionClip
from wbc.motion.contacts import on_ground
from wbc.motion.footsteps import BLEND, footsteps, smoothstep
from wbc.motion.inverse_kinematics import inverse_kinematics, planted
from wbc.motion.kinematics import FORCE_SMOOTHING, BodyMotion, arm_joints, coms_of, corners_of
from wbc.motion.measures import MotionMeasures, by_joint, check_motion, measure, nearest_inside, supports_of

# Numbers without a source are judged by the table of tracked motions in docs/measured_hands.md: the clips of that table
# come through with them, which does not say that they are the best ones.

RATE = 100.0
"""Frames per second of the result, Hz."""

JOINT_MARGIN = 0.05
"""Distance to the joint limits, rad."""

DRAWING = 10
"""Most passes that draw in an arm until its joints can hold it."""

STRAIGHTENING = 5
"""Most passes that turn the trunk up until the waist can hold it."""

HELD = 0.01
"""Excess of the torques of arms that is left, over what is allowed."""

GIVING = 0.3
"""Time about an excess in which arms, trunk or pace give way, s."""

FADING = 0.1
"""Standard deviation with which they fade, s."""

SINKING = 0.6
"""Time about a frame with legs that are too short in which the centre of mass sinks, s."""

SINKING_FADE = 0.15
"""Standard deviation with which it does, s."""

LEAST_LOAD = 0.15
"""Least share of the load of each of two soles that stand, for a ZMP between their centres."""

SHIFT = 0.6
"""Time to a step in which this least share goes, s."""

SMOOTHING = 0.03
"""Standard deviation of the last smoothing of all joints, s."""

PASSES = 9
"""Most passes of inverse kinematics and ZMP."""

RETIMINGS = 3
"""Most passes in which time is stretched around infeasible frames."""

STRETCH = 1.2
"""Factor by which it is stretched in each."""

OUTSIDE = 1e-4
"""Distance of the ZMP from its support at which the passes end, m."""

LOW = 1e-3
"""Distance of the centre of mass below its height at which they do, m."""

LEAST_TILT = 1e-3
"""Share, and sine, of the tilt of a trunk below which it is not turned up."""


@settings
class FeasibleSettings:
    """Settings of the filter.

    Attributes:
        cutoff: Cut-off of the low pass of all joints and of the base, zero phase, Hz; 6 Hz is the usual one of gait
            (D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, ch. 3).
        hold: Time at rest at both ends, s.
        ease: Time in which the motion starts from rest and comes to rest, s.
        double_support: Least time on both feet when one takes over, s: the foot that leaves stays longer.
        sole_share: Share of length and width of each sole, about its centre, on which the ZMP stays: the rest is for
            feedback.
    """

    cutoff: Annotated[float, Field(gt=0.0, lt=0.5 * RATE), "Hz"] = 6.0
    hold: Annotated[NonNegative, "s"] = 0.5
    ease: Annotated[Positive, "s"] = 0.4
    double_support: Annotated[NonNegative, "s"] = 0.15
    sole_share: Ratio = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class FeasibleMotion:
    """Result of the filter.

    Attributes:
        clip: The clip for tracking: all joints of the robot at 100 Hz, its ground at z = 0, at rest at both ends.
        source_times: Time in the given clip of each frame, shape (T,), s.
        before: Measures of the given clip at the rate of the result.
        after: Measures of the result.
        changes: Joint → greatest change, rad, for joints that changed; compared at the same frames.
        shortened: Greatest distance by which a step was brought within reach, m.
        stretched: Duration of the result without its rests over that of the given clip.
        unfinished: Stages whose passes did not suffice: "arms" or "trunk" that need more torque than is allowed, and
            "ZMP" for one that is not inside the support, or a centre of mass that is too high for the legs.
    """

    clip: MotionClip
    source_times: Array
    before: MotionMeasures
    after: MotionMeasures
    changes: dict[str, float]
    shortened: float
    stretched: float
    unfinished: tuple[str, ...] = ()


@checked
def make_feasible(
    robot: Robot,
    clip: MotionClip,
    *,
    share: Ratio = 0.8,
    friction: Positive = 0.5,
    settings: FeasibleSettings | None = None,
) -> FeasibleMotion:
    """Make a clip feasible; a clip that is already feasible hardly changes.

    Args:
        robot: The robot; its state is not changed.
        clip: Clip of its joints; joints that the clip does not have stay at half-sitting.
        share: Greatest share of the limits of joint speeds, and of the torques of joints outside the legs.
        friction: Largest coefficient of friction that forces and yaw moments of the soles may need. The friction that
            the ground has in addition is left for feedback.
        settings: Settings of the filter; the default ones when None.

    Returns:
        The motion; its field `after` measures the motion, and tells whether it is feasible everywhere.

    Raises:
        InputError: The robot leaves the ground (the message has the time), or the clip is too long.
    """
    if clip.duration * RATE > LONGEST:
        raise InputError(
            f"a motion must last at most {LONGEST / RATE:g} s at {RATE:g} Hz, got {clip.duration:g} s"
        )
    chosen, unfinished = settings or FeasibleSettings(), set[str]()
    full = MotionClip.of(robot, clip.configurations(robot), clip.rate, clip.name, clip.standing)
    times = np.linspace(0.0, clip.duration, max(2, round(clip.duration * RATE) + 1))
    resampled = full.sampled(times, RATE)
    before = check_motion(robot, resampled, share=share, friction=friction)
    smooth = _drawn_in(robot, _smooth(robot, resampled, chosen.cutoff), share, set())
    speed = abs(np.gradient(smooth.joints, 1.0 / RATE, axis=0))
    pace = _envelope((speed / (share * robot.velocity_limit)).max(axis=1), 1.0, GIVING, 0.5 * FADING)
    for attempt in range(RETIMINGS + 1):
        eased, source = _retimed(smooth, pace, chosen)
        unfinished.clear()
        motion, standing, shortened = _balanced(robot, eased, share, chosen, unfinished)
        after = measure(robot, motion, standing, share=share, friction=friction)
        slow = after.infeasible_frames
        if attempt == RETIMINGS or not slow.any():
            break
        pace = _slowed(pace, source[slow])
    # The resampled clip lasts a whole number of frames, the given one a little more or less.
    source = np.minimum(source * (clip.duration / resampled.duration), clip.duration)
    changed = abs(motion.q[:, 7:] - full.sampled(source, RATE).joints)
    return FeasibleMotion(
        clip=MotionClip.of(robot, motion.q, RATE, clip.name, standing),
        source_times=source,
        before=before,
        after=after,
        changes=by_joint(robot, changed.max(axis=0)),
        shortened=shortened,
        stretched=(len(motion.q) / RATE - 2.0 * chosen.hold) / clip.duration,
        unfinished=tuple(sorted(unfinished)),
    )


def _smooth(robot: Robot, clip: MotionClip, cutoff: float) -> MotionClip:
    """Clamp the joints to their limits and take out what is faster than the cut-off, Hz."""
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415 - slow to import

    lower, upper = robot.position_lower, robot.position_upper
    room = np.minimum(JOINT_MARGIN, 0.5 * (upper - lower))
    columns = np.hstack([clip.base, np.clip(clip.joints, lower + room, upper - room)])
    sections = butter(2, cutoff, fs=RATE, output="sos")
    columns = sosfiltfilt(sections, columns, axis=0, padlen=min(len(clip) - 1, round(RATE)))
    columns[:, 3:7] /= np.linalg.norm(columns[:, 3:7], axis=1, keepdims=True)
    return replace(clip, base=columns[:, :7], joints=np.clip(columns[:, 7:], lower, upper))


def _drawn_in(robot: Robot, clip: MotionClip, share: float, unfinished: set[str]) -> MotionClip:
    """Return a clip whose arms are no further from half-sitting than a share of their torque limits holds at rest.

    No slowing down helps against gravity. All joints of an arm come nearer to half-sitting by the same ratio. Arms that
    are too heavy after all passes are added to the stages that are unfinished.
    """
    data, q, rest = robot.model.createData(), clip.configurations(robot), robot.half_sitting[7:]
    arms = list(arm_joints(robot).values())
    for _ in range(DRAWING):
        gravity = np.array([pin.computeGeneralizedGravity(robot.model, data, each)[BASE_DOF:] for each in q])
        excess = robot.torque_share(gravity + robot.spring_torques(q)) / share
        heavy = [arm for arm in arms if (excess[:, arm] > 1.0 + HELD).any()]
        if not heavy:
            break
        for arm in heavy:
            part = 1.0 / _envelope(excess[:, arm].max(axis=1), 1.0, GIVING, FADING)[:, None]
            columns = [7 + joint for joint in arm]
            q[:, columns] = rest[arm] + part * (q[:, columns] - rest[arm])
    else:
        unfinished.add("arms")
    return replace(clip, joints=q[:, 7:])


def _envelope(values: Array, least: float, window: float, smoothing: float) -> Array:
    """Return a smooth bound of values in time: the greatest within a window, s, then smoothed, s; shape (T,)."""
    widest = maximum_filter1d(np.maximum(values, least), round(window * RATE))
    return np.asarray(gaussian_filter1d(widest, smoothing * RATE, mode="nearest"))


def _slowed(pace: Array, times: Array) -> Array:
    """Return a pace that is slower by `STRETCH` within half a second of times in the clip, s."""
    bad = np.zeros(len(pace), dtype=bool)
    bad[np.round(times * RATE).astype(int)] = True
    return pace * np.where(maximum_filter1d(bad, round(RATE)), STRETCH, 1.0)


def _retimed(clip: MotionClip, pace: Array, settings: FeasibleSettings) -> tuple[MotionClip, Array]:
    """Slow down where the pace asks for it, ease in and out of rest, and rest at both ends."""
    ease = settings.ease
    slowed = _integral(gaussian_filter1d(pace, FADING * RATE, mode="nearest")) / RATE
    # An eased start takes twice the time for the same way: x of a ramp is t²/(2 ease), so the total grows by ease.
    t = np.linspace(0.0, slowed[-1] + ease, round((slowed[-1] + ease) * RATE) + 1)
    way = _integral(smoothstep(t / ease) * smoothstep((t[-1] - t) / ease))
    inside = np.interp(way * (slowed[-1] / way[-1]), slowed, clip.times)
    source = np.pad(inside, round(settings.hold * RATE), mode="edge")
    return clip.sampled(source, RATE), source


def _integral(values: Array) -> Array:
    """Return the integral from the first frame on by the trapezoidal rule, in frames, shape (T,)."""
    return np.asarray(np.cumsum(values) - 0.5 * (values + values[0]))


def _balanced(
    robot: Robot, clip: MotionClip, share: float, settings: FeasibleSettings, unfinished: set[str]
) -> tuple[BodyMotion, Array, float]:
    """Freeze the feet, and move the centre of mass until the ZMP is inside the support."""
    given, standing = on_ground(robot, clip, settings.double_support)
    soles, moves, shortened = footsteps(robot, given.soles, given.com[:, 2], RATE, standing)
    over = given.q.copy()  # the base over the feet
    over[:, :7] = [
        pin.SE3ToXYZQUAT(move * pin.XYZQUATToSE3(base)) for move, base in zip(moves, over[:, :7], strict=True)
    ]
    q = over.copy()
    q[:, 3:7] = _straightened(robot, q, share, unfinished)
    # An arm that hung down from a trunk that was bent is further from hanging below one that is upright.
    q[:, 7:] = _drawn_in(robot, MotionClip.of(robot, q, RATE), share, unfinished).joints
    # The ZMP is that of the centre of mass as it is asked for: what inverse kinematics makes of it has kinks, of
    # which second differences make metres.
    ways = coms_of(robot, over)[:, :2], coms_of(robot, q)[:, 2:]
    com = gaussian_filter1d(np.hstack(ways), FORCE_SMOOTHING * RATE, axis=0, mode="nearest")
    supports = supports_on(robot, soles, standing, settings.sole_share)
    result = _zmp_inside(robot, q, com, soles, standing, supports, unfinished)
    # Where a joint meets its limit there is a kink: a hundredth of a second of smoothing takes metres off the ZMP. It
    # takes soles off their places by half a millimetre, too: the legs bring them back.
    result = gaussian_filter1d(result, SMOOTHING * RATE, axis=0, mode="nearest")
    result[:, 3:7] /= np.linalg.norm(result[:, 3:7], axis=1, keepdims=True)
    result = planted(robot, result, soles, standing, round(2.0 * BLEND * RATE))
    return BodyMotion.of(robot, result, RATE), standing, shortened


def _zmp_inside(
    robot: Robot,
    q: Array,
    com: Array,
    soles: list[tuple[pin.SE3, pin.SE3]],
    standing: Array,
    supports: list[Array],
    unfinished: set[str],
) -> Array:
    """Return configurations near given ones, shape (T, nq), with the ZMP inside the support.

    The centre of mass begins on a way, shape (T, 3), m; the soles and where they stand, shape (T, 2), stay.
    """
    com = com.copy()
    stands = gaussian_filter1d(standing.astype(float), 0.25 * BLEND * RATE, axis=0, mode="nearest")
    result = q
    for _ in range(PASSES):
        result = inverse_kinematics(robot, JOINT_MARGIN, q, soles, stands, com, result)
        motion = BodyMotion.of(robot, result, RATE)
        momentum = gaussian_filter1d(motion.momentum, FORCE_SMOOTHING * RATE, axis=0)
        zmp = replace(motion, com=com, momentum=momentum).zmp()
        needed = nearest_inside(supports, zmp) - zmp
        low = np.maximum(com[:, 2] - motion.com[:, 2], 0.0)  # legs that are too short for the height
        if abs(needed).max() < OUTSIDE and low.max() < LOW:
            return result
        com[:, :2] += centre_of_mass_shift(needed, float(np.median(com[:, 2])), RATE)
        com[:, 2] -= 2.0 * _envelope(np.where(low > 0.5 * LOW, low, 0.0), 0.0, SINKING, SINKING_FADE)
    unfinished.add("ZMP")
    return result


def supports_on(
    robot: Robot, soles: list[tuple[pin.SE3, pin.SE3]], standing: Array, share: float
) -> list[Array]:
    """Return the areas on which the ZMP is to stay, each of shape (n, 2), m, for a share of each sole."""
    corners = corners_of(robot, soles)
    centres = corners.mean(axis=2, keepdims=True)
    corners = centres + share * (corners - centres)
    near = maximum_filter1d((~standing.all(axis=1)).astype(float), round(SHIFT * RATE))
    load = (
        LEAST_LOAD * gaussian_filter1d(1.0 - near, SHIFT / 6.0 * RATE, mode="nearest") * standing.all(axis=1)
    )
    inward = load[:, None, None] * np.diff(centres[:, :, 0], axis=1)
    corners += np.stack([inward, -inward], axis=1)
    return supports_of(corners, standing)


def _straightened(robot: Robot, q: Array, share: float, unfinished: set[str]) -> Array:
    """Return orientations of the base, shape (T, 4), that bend the trunk no further than the waist can hold it.

    Torques of the joints above the legs are those of gravity on a trunk that is bent: turning all of it up by a share
    of its tilt lessens them by as much.
    """
    data, q, torso = robot.model.createData(), q.copy(), robot.frame_id(robot.torso_frame)
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    up = data.oMf[torso].rotation[2].copy()  # axis of the torso that is vertical at half-sitting
    for _ in range(STRAIGHTENING):
        excess = BodyMotion.of(robot, q, RATE).torque_share(robot).max(axis=1) / share
        if (excess <= 1.0).all():
            break
        turns = 1.0 / _envelope(excess, 1.0, GIVING, FADING) - 1.0
        for i in np.flatnonzero(turns < -LEAST_TILT):
            pin.framesForwardKinematics(robot.model, data, q[i])
            x, y, z = data.oMf[torso].rotation @ up
            sine = float(np.hypot(x, y))
            if sine > LEAST_TILT:
                back = turns[i] * np.arctan2(sine, z) / sine * np.array([-y, x, 0.0])
                q[i, 3:7] = (Rotation.from_rotvec(back) * Rotation.from_quat(q[i, 3:7])).as_quat()
    else:
        unfinished.add("trunk")
    return MotionClip.of(robot, q, RATE).base[:, 3:]


def centre_of_mass_shift(zmp_shift: Array, height: float, rate: float) -> Array:
    """Return the shift of the centre of mass that shifts the ZMP: Δc − (h/g) Δc̈ = Δp, at rest at both ends.

    Shifts have shape (T, 2), m; h is the height over the ground, m, `rate` that of the frames, Hz.
    """
    k = height / GRAVITY * rate**2
    bands = np.full((3, len(zmp_shift)), -k)
    bands[1] = 1.0 + 2.0 * k
    bands[1, 0] = bands[1, -1] = 1.0 + k
    return np.asarray(solve_banded((1, 1), bands, zmp_shift))
