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

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.robot import BASE_DOF, GRAVITY, Robot
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.motion.clip import LONGEST, MotionClip
from wbc.motion.contacts import find_contacts
from wbc.motion.footsteps import footsteps
from wbc.motion.inverse_kinematics import InverseKinematics
from wbc.motion.kinematics import BodyMotion
from wbc.motion.measures import MotionMeasures, by_joint, measure, supports_of

DRAWING = 10
"""Most passes that draw in an arm until its joints can hold it."""

HELD = 0.01
"""Excess of these torques that is left."""

STRAIGHTENING = 5
"""Most passes that turn the trunk up until the waist can hold it."""

BLEND, SHIFT, SMOOTHING = 0.1, 0.6, 0.03
"""Times, s: in which a foot leaves and reaches its frozen place, from a step in which the load may leave a sole that
stands, and the standard deviation of the last smoothing of all joints."""

JOINT_MARGIN, SOLE_SHARE = 0.05, 0.6
"""Distance to the joint limits, rad; ratio of length and width of each sole, about its centre, on which the ZMP stays:
the rest is for feedback."""

EASE, DOUBLE_SUPPORT = 0.4, 0.15
"""Time in which the motion starts from rest and comes to rest; least time on both feet when one takes over, s: the foot
that leaves stays longer."""

PASSES, STRETCHES, STRETCH = 8, 3, 1.2
"""Passes of inverse kinematics and ZMP; passes, and factor, of time that is stretched around infeasible frames."""


@settings
class FilterSettings:
    """Settings of the filter.

    Attributes:
        rate: Frames per second of the result, Hz.
        cutoff: Low pass of all joints and of the base, zero phase, Hz.
        share: Greatest share of the limits of joint speeds, and of the torques of joints outside the legs.
        hold: Time at rest at both ends, s.
        least_load: Least share of the load of each sole, for a ZMP between their centres, where both stand and none is
            about to leave.
        friction: Greatest coefficient of friction that forces and yaw moments of the soles may need; the rest is
            for feedback.
    """

    rate: Annotated[Positive, "Hz"] = 100.0
    cutoff: Annotated[Positive, "Hz"] = 6.0
    share: Annotated[Share, Positive] = 0.8
    hold: Annotated[NonNegative, "s"] = 0.5
    least_load: Annotated[Share, Field(lt=0.5)] = 0.15
    friction: Positive = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class FeasibleMotion:
    """Result of the filter.

    Attributes:
        clip: The clip for tracking: all joints of the robot, its ground at z = 0, at rest at both ends.
        source_times: Time in the given clip of each frame, shape (T,), s.
        before: Measures of the given clip at the rate of the result.
        after: Measures of the result.
        changes: Joint → root mean square of the change, rad, for joints that changed; compared at the same frames.
        largest: Joint → largest change, rad.
        com_shift: Largest horizontal shift of the centre of mass for the sake of the ZMP, m.
        shortened: Greatest distance by which a step was brought within reach, m.
        stretched: Duration of the result without its rests over that of the given clip.
    """

    clip: MotionClip
    source_times: Array
    before: MotionMeasures
    after: MotionMeasures
    changes: dict[str, float]
    largest: dict[str, float]
    com_shift: float
    shortened: float
    stretched: float


@checked
def make_feasible(robot: Robot, clip: MotionClip, settings: FilterSettings | None = None) -> FeasibleMotion:
    """Make a clip feasible; one that is feasible already changes hardly at all.

    Args:
        robot: The robot; its state is not changed.
        clip: Clip of its joints; joints that the clip lacks stay half-sitting.
        settings: Settings; the defaults when None.

    Returns:
        The feasible motion; `after` measures it, whether or not it is feasible everywhere.

    Raises:
        UnknownNameError: The clip is of another robot.
        InputError: The robot leaves the ground; the time at which it does is named. A clip that is too long.
    """
    s = settings or FilterSettings()
    if clip.duration * s.rate > LONGEST:
        raise InputError(
            f"a motion must last at most {LONGEST / s.rate:g} s at {s.rate:g} Hz, got {clip.duration:g} s"
        )
    raw = clip.configurations(robot)
    full = MotionClip.of(robot, raw, clip.rate, clip.name, clip.standing)
    times = np.linspace(0.0, clip.duration, max(2, round(clip.duration * s.rate) + 1))
    resampled = full.sampled(times, s.rate)
    motion = BodyMotion.of(robot, resampled.configurations(robot), s.rate)
    contacts = find_contacts(motion, resampled.standing)
    before = measure(robot, motion, *contacts, s.share, s.friction)

    smooth = _drawn_in(robot, _smooth(resampled, robot, s), s.share)
    speed = abs(np.gradient(smooth.joints, 1.0 / s.rate, axis=0))
    ratio = (speed / (s.share * robot.velocity_limit)).max(axis=1)
    pace = np.maximum(1.0, _envelope(np.maximum(ratio, 1.0), 0.3, 0.05, s.rate))
    for attempt in range(STRETCHES + 1):
        eased, source = _retime(smooth, pace, s)
        motion, standing, com_shift, shortened = _balanced(robot, eased, s)
        after = measure(robot, motion, 0.0, standing, s.share, s.friction)
        slow = after.infeasible_frames
        if attempt == STRETCHES or not slow.any():
            break
        bad = np.zeros(len(pace))
        frames = np.clip(np.round(source[slow] * s.rate).astype(int), 0, len(bad) - 1)
        bad[frames] = 1.0
        pace = pace * np.where(maximum_filter1d(bad, max(1, round(s.rate))) > 0.0, STRETCH, 1.0)
    # The resampled clip lasts a whole number of frames, the given one a little more or less.
    source = np.minimum(source * (clip.duration / resampled.times[-1]), clip.duration)
    changed = motion.q[:, 7:] - full.sampled(source, s.rate).joints
    return FeasibleMotion(
        MotionClip.of(robot, motion.q, s.rate, clip.name, standing),
        source,
        before,
        after,
        by_joint(robot, np.sqrt((changed**2).mean(axis=0))),
        by_joint(robot, abs(changed).max(axis=0)),
        com_shift,
        shortened,
        (len(motion.q) / s.rate - 2.0 * s.hold) / clip.duration,
    )


def _smooth(clip: MotionClip, robot: Robot, s: FilterSettings) -> MotionClip:
    """Clamp the joints to their limits and take out what is faster than the cut-off."""
    lower, upper = robot.position_lower, robot.position_upper
    room = np.minimum(JOINT_MARGIN, 0.5 * (upper - lower))
    joints = np.clip(clip.joints, lower + room, upper - room)
    columns = np.hstack([clip.base, joints])
    if s.cutoff < 0.45 * clip.rate and len(clip) > 30:
        from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415 - slow to import

        sections = butter(2, s.cutoff, fs=clip.rate, output="sos")
        columns = sosfiltfilt(sections, columns, axis=0, padlen=min(len(clip) - 1, round(clip.rate)))
    columns[:, 3:7] /= np.linalg.norm(columns[:, 3:7], axis=1, keepdims=True)
    return MotionClip(
        clip.joint_names,
        clip.rate,
        columns[:, :7],
        np.clip(columns[:, 7:], lower, upper),
        clip.name,
        clip.standing,
    )


def _drawn_in(robot: Robot, clip: MotionClip, share: float) -> MotionClip:
    """Return a clip whose arms are no further from half-sitting than a share of their torque limits holds at rest.

    No slowing down helps against gravity. All joints of an arm come nearer to half-sitting by the same ratio.
    """
    data, q, rest = robot.model.createData(), clip.configurations(robot), robot.half_sitting[7:]
    arms = [robot.joints_between(hand, robot.torso_frame) for hand in robot.frames.values()]
    for _ in range(DRAWING):
        gravity = np.array([pin.computeGeneralizedGravity(robot.model, data, each)[BASE_DOF:] for each in q])
        excess = abs(gravity) / (share * robot.torque_limit)
        heavy = [arm for arm in arms if (excess[:, arm] > 1.0 + HELD).any()]
        if not heavy:
            break
        for arm in heavy:
            part = 1.0 / _envelope(np.maximum(excess[:, arm].max(axis=1), 1.0), 0.3, 0.1, clip.rate)[:, None]
            columns = [7 + joint for joint in arm]
            q[:, columns] = rest[arm] + part * (q[:, columns] - rest[arm])
        clip = MotionClip.of(robot, q, clip.rate, clip.name, clip.standing)
    return clip


def _envelope(values: Array, window: float, smoothing: float, rate: float) -> Array:
    """Return a smooth bound of values in time: the greatest within a window, s, then smoothed, s; shape (T,)."""
    widest = maximum_filter1d(values, max(1, round(window * rate)))
    return np.asarray(gaussian_filter1d(widest, smoothing * rate, mode="nearest"))


def _retime(clip: MotionClip, pace: Array, s: FilterSettings) -> tuple[MotionClip, Array]:
    """Slow down where the pace asks for it, ease in and out of rest, and rest at both ends."""
    pace = gaussian_filter1d(pace, 0.1 * clip.rate, mode="nearest")
    own = clip.times
    slowed = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) / clip.rate)])
    # An eased start takes twice the time for the same way: x of a ramp is t²/(2 ease), so the total grows by ease.
    total = slowed[-1] + EASE
    t = np.arange(round(total * s.rate) + 1) / s.rate
    t *= total / t[-1]
    way = _eased(t, total)
    inside = np.interp(way, slowed, own)
    rest = round(s.hold * s.rate)
    source = np.clip(np.concatenate([np.zeros(rest), inside, np.full(rest, own[-1])]), 0.0, own[-1])
    return clip.sampled(source, s.rate), source


def _eased(t: Array, total: float) -> Array:
    """Return the way at unit speed with smooth starts and ends of `EASE` each; from 0 to total − `EASE`."""
    rise = np.clip(t / EASE, 0.0, 1.0)
    fall = np.clip((total - t) / EASE, 0.0, 1.0)
    speed = (3.0 * rise**2 - 2.0 * rise**3) * (3.0 * fall**2 - 2.0 * fall**3)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    return np.asarray(way * ((total - EASE) / way[-1]))


def _balanced(robot: Robot, clip: MotionClip, s: FilterSettings) -> tuple[BodyMotion, Array, float, float]:
    """Freeze the feet, and move the centre of mass until the ZMP is inside the support.

    Return the motion, where soles stand, and by how much the centre of mass was shifted and a step shortened, m.
    """
    q = clip.configurations(robot)
    motion = BodyMotion.of(robot, q, clip.rate)
    ground, standing = find_contacts(motion, clip.standing, DOUBLE_SUPPORT)
    q[:, 2] -= ground
    motion = BodyMotion.of(robot, q, clip.rate)
    soles, body, shortened = footsteps(robot, motion, standing, BLEND)
    if body is not None:
        q[:, :7] = [
            pin.SE3ToXYZQUAT(move * pin.XYZQUATToSE3(base)) for move, base in zip(body, q[:, :7], strict=True)
        ]
        motion = BodyMotion.of(robot, q, clip.rate)
    solver = InverseKinematics(robot, JOINT_MARGIN)
    supports = supports_of(robot, soles, standing, SOLE_SHARE, _least_load(standing, s))
    q[:, 3:7] = _straightened(robot, q, clip.rate, s.share)
    # The ZMP is that of the centre of mass as it is asked for: what inverse kinematics makes of it has kinks, of
    # which second differences make metres.
    given = motion.com.copy()
    given[:, 2] = BodyMotion.of(robot, q, clip.rate).com[:, 2]
    stands = gaussian_filter1d(standing.astype(float), 0.25 * BLEND * clip.rate, axis=0, mode="nearest")
    com = gaussian_filter1d(given, 0.02 * clip.rate, axis=0, mode="nearest")
    result = q
    for _ in range(PASSES):
        result = solver.solve(q, soles, stands, com, result)
        motion = BodyMotion.of(robot, result, clip.rate)
        momentum = gaussian_filter1d(motion.momentum, 0.02 * clip.rate, axis=0)
        zmp = replace(motion, com=com, momentum=momentum).zmp()
        needed = (
            np.array([support.project(point) for support, point in zip(supports, zmp, strict=True)]) - zmp
        )
        low = np.maximum(com[:, 2] - motion.com[:, 2], 0.0)  # legs that are too short for the height
        if abs(needed).max() < 1e-4 and low.max() < 1e-3:
            break
        com[:, :2] += centre_of_mass_shift(needed, float(np.median(com[:, 2])), clip.rate)
        com[:, 2] -= 2.0 * _envelope(np.where(low > 5e-4, low, 0.0), 0.6, 0.15, clip.rate)
    result = solver.solve(q, soles, stands, com, result)
    # Where a joint meets its limit there is a kink: a hundredth of a second of smoothing takes metres off the ZMP.
    result = gaussian_filter1d(result, SMOOTHING * clip.rate, axis=0, mode="nearest")
    result[:, 3:7] /= np.linalg.norm(result[:, 3:7], axis=1, keepdims=True)
    motion = BodyMotion.of(robot, result, clip.rate)
    shift = float(np.linalg.norm((com - given)[:, :2], axis=1).max())
    return motion, standing, shift, shortened


def _least_load(standing: Array, s: FilterSettings) -> Array:
    """Return the least share of the load of each of two soles that stand; zero next to a step, shape (T,)."""
    alone = standing.sum(axis=1) < 2
    near = maximum_filter1d(alone.astype(float), max(1, round(SHIFT * s.rate)))
    return np.asarray(s.least_load * gaussian_filter1d(1.0 - near, SHIFT / 6.0 * s.rate, mode="nearest"))


def _straightened(robot: Robot, q: Array, rate: float, share: float) -> Array:
    """Return orientations of the base, shape (T, 4), that bend the trunk no further than the waist can hold it.

    Torques of the joints above the legs are those of gravity on a trunk that is bent: turning all of it up by a share
    of its tilt lessens them by as much.
    """
    data, q, torso = robot.model.createData(), q.copy(), robot.frame_id(robot.torso_frame)
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    up = data.oMf[torso].rotation[2].copy()  # axis of the torso that is vertical at half-sitting
    for _ in range(STRAIGHTENING):
        excess = BodyMotion.of(robot, q, rate).torque_share(robot).max(axis=1) / share
        if (excess <= 1.0).all():
            break
        turns = 1.0 / _envelope(np.maximum(excess, 1.0), 0.3, 0.1, rate) - 1.0
        for i in np.flatnonzero(turns < -1e-3):
            pin.framesForwardKinematics(robot.model, data, q[i])
            x, y, z = data.oMf[torso].rotation @ up
            sine = float(np.hypot(x, y))
            if sine > 1e-3:
                back = turns[i] * np.arctan2(sine, z) / sine * np.array([-y, x, 0.0])
                q[i, 3:7] = (Rotation.from_rotvec(back) * Rotation.from_quat(q[i, 3:7])).as_quat()
    return MotionClip.of(robot, q, rate).base[:, 3:]


def centre_of_mass_shift(zmp_shift: Array, height: float, rate: float) -> Array:
    """Return the shift of the centre of mass that shifts the ZMP: Δc − (h/g) Δc̈ = Δp, at rest at both ends.

    Shifts have shape (T, 2), m; h is the height over the ground, m, `rate` that of the frames, Hz.
    """
    k = height / GRAVITY * rate**2
    count = len(zmp_shift)
    bands = np.empty((3, count))
    bands[0], bands[2] = -k, -k
    bands[1] = 1.0 + 2.0 * k
    bands[1, 0] = bands[1, -1] = 1.0 + k
    return np.asarray(solve_banded((1, 1), bands, zmp_shift))
