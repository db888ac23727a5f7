"""Joints of the legs in half-sitting, found by least squares, and the knees of the legs."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from wbc.base.errors import ModelError
from wbc.base.numbers import ROUNDING, Array
from wbc.core.frames import Sole
from wbc.core.model import driven_joints, joints_to

KNEE_BEND = math.radians(40.0)
"""Knee bend of a derived half-sitting, rad; others: Talos 49°, HRP-2 40°."""

FULL_LEG = 6
"""Joints of a leg that can put its sole anywhere, in any direction."""

SOLVED = 1e-6
"""Greatest error of half-sitting that was solved for, m and rad."""

NEXT = 0.02
"""Least distance between the sides of the soles in half-sitting, m."""

SPREAD = math.radians(30.0)
"""Distance of a second start of the search from the first, towards the middle of the joints' ranges, rad."""

AHEAD = 0.01
"""Distance of the soles' centres in front of the ankles from which on it says where a robot looks, m."""

PITCHES = 0.7
"""Least part of a knee's axis along y of the root."""


def joint_limits(model: pin.Model) -> tuple[Array, Array]:
    """Return lower and upper limits of the joints with a coordinate, rad or m, each of shape (na,)."""
    na = len(driven_joints(model))
    return np.array(model.lowerPositionLimit[-na:]), np.array(model.upperPositionLimit[-na:])


def place_of(model: pin.Model, joint: int) -> int:
    """Return the place of a joint, by its number in the model, or that of its leader, among those with a coordinate."""
    return int(model.joints[joint].idx_v - model.nv + len(driven_joints(model)))


def bent_legs(model: pin.Model, soles: tuple[Sole, ...], start: Array, free: list[int]) -> Array:
    """Return the positions of all joints with a coordinate, rad or m, or raise a `ModelError`.

    Soles are flat, side by side, knees bent, and the centre of mass is over the middle of the soles. The search begins
    at a configuration, shape (nq,), and moves some joints, by their places among those with a coordinate. The feet are
    as far apart as there. Where no such posture is found, the search goes on with feet under the hips, and as near as
    they may be, and from other positions of the legs: at zero they may be spread.

    The residual vanishes for legs of six joints. Legs without an ankle roll cannot shift the centre of mass sideways on
    flat soles: it stays where it is.
    """
    q, data, moved = np.array(start), model.createData(), 7 + np.array(free)
    legs, ids = [joints_to(model, sole.frame) for sole in soles], [model.getFrameId(s.frame) for s in soles]
    knees = [_knee(model, data, leg, frame) for leg, frame in zip(legs, ids, strict=True)]
    bends = [(7 + place_of(model, joint), sign) for joint, sign in knees]
    sideways = 1.0 if all(len(leg) >= FULL_LEG for leg in legs) else 0.0

    def residual(x: Array, width: float) -> Array:
        """Return turns of the soles, the place of the centre of mass, that of the soles, and the bend of the knees."""
        q[moved] = x
        com = pin.centerOfMass(model, data, q)
        pin.updateFramePlacements(model, data)
        left, right = (data.oMf[frame] for frame in ids)
        middle = 0.5 * (left.translation + right.translation)
        return np.concatenate(
            [
                pin.log3(left.rotation),
                pin.log3(right.rotation),
                (com[:2] - middle[:2]) * [1.0, sideways],
                left.translation - right.translation - [0.0, width, 0.0],
                [0.5 * sum(sign * q[i] for i, sign in bends) - KNEE_BEND],
            ]
        )

    pin.framesForwardKinematics(model, data, q)
    apart, hips = (
        at[one].translation[1] - at[two].translation[1]
        for at, (one, two) in ((data.oMf, ids), (data.oMi, [leg[0] for leg in legs]))
    )
    narrowest = NEXT + max(sole.width for sole in soles)
    widths = dict.fromkeys(max(narrowest, float(each)) for each in (apart, hips, 0.0))
    lower, upper = joint_limits(model)
    low, high, first = lower[free], upper[free], q[moved]
    with np.errstate(invalid="ignore"):  # of joints that turn without end
        middle = np.clip(np.nan_to_num(0.5 * (low + high)), first - SPREAD, first + SPREAD)
    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 200}
    for width, x0 in itertools.product(widths, (first, middle)):
        solution = least_squares(residual, x0, bounds=(low, high), args=(width,), **exact)
        if np.abs(residual(solution.x, width)[:11]).max() <= SOLVED:  # without the bend of the knees
            return np.array(q[7:])
    raise ModelError(
        "no half-sitting within the joint limits was found, soles flat, level and side by side under the centre of "
        "mass; pass half_sitting with the leg joints, or correct their limits: they turn by "
        f"{float((high - low).max()):.3g} rad at most, and an MJCF in radians must say "
        '<compiler angle="radian"/>'
    )


def heading(model: pin.Model, soles: tuple[Sole, ...], feet_found: bool) -> float:
    """Return the direction in which the feet point in the axes of the root, a multiple of a right angle, rad.

    Two signs must agree before a root is turned: the left foot lies to the left, and the toes are in front of the
    ankles; where toes say nothing, knees bend forward. With one sign alone the soles are more likely to be swapped.
    With `feet_found` the left foot is only the one with the larger y.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    ids = [model.getFrameId(sole.frame) for sole in soles]
    if any(not joints_to(model, sole.frame) for sole in soles):
        return 0.0
    places = [np.array(data.oMf[i].translation) for i in ids]
    ankles = [np.array(data.oMi[model.frames[i].parentJoint].translation) for i in ids]
    toes = 0.5 * sum(place - ankle for place, ankle in zip(places, ankles, strict=True))
    left = places[0] - places[1]
    ahead = np.array([left[1], -left[0], 0.0]) / max(ROUNDING, float(np.hypot(left[0], left[1])))
    angle = float(np.arctan2(ahead[1], ahead[0]))
    turns = round(angle / (0.5 * math.pi))
    pointing = float(toes @ ahead)
    if turns and abs(pointing) < AHEAD:
        pointing = float(sum(knee_direction(model, sole.frame) for sole in soles) @ ahead)
    if feet_found and turns == 0 and pointing < -AHEAD:  # sides say nothing: left is the larger y
        return math.pi
    if turns == 0 or pointing < AHEAD:
        return 0.0
    return turns * 0.5 * math.pi


def knee_direction(model: pin.Model, sole: str) -> Array:
    """Return the velocity of the knee of a sole's leg by its bend, in root axes, shape (3,), m/rad.

    The root may look anywhere, so that the knee, unlike in `_knee`, may turn about any axis. It bends to where its
    range is wider; one with the same range to both sides, or without end, says nothing: zero.
    """
    data, leg = model.createData(), joints_to(model, sole)
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    foot = data.oMf[model.getFrameId(sole)].translation
    middle = _farthest(data, leg, leg[0], foot)
    knee = model.joints[middle]
    ends = model.lowerPositionLimit[knee.idx_q], model.upperPositionLimit[knee.idx_q]
    bent = np.sign(sum(ends)) if np.isfinite(ends).all() else 0.0
    return np.asarray(np.cross(foot - data.oMi[middle].translation, bent * data.J[3:, knee.idx_v]))


def knee_bend(model: pin.Model, sole: str, q: Array) -> float:
    """Return the angle between the lines from hip to knee and from knee to ankle, rad."""
    data, leg = model.createData(), joints_to(model, sole)
    knee, _ = _knee(model, data, leg, model.getFrameId(sole))
    pin.forwardKinematics(model, data, q)
    hip = max((joint for joint in leg if joint < knee), default=knee)
    thigh = data.oMi[knee].translation - data.oMi[hip].translation
    shin = data.oMi[leg[-1]].translation - data.oMi[knee].translation
    lengths = float(np.linalg.norm(thigh) * np.linalg.norm(shin))
    return math.acos(min(1.0, float(thigh @ shin) / lengths)) if lengths > 0.0 else 0.0


def _knee(model: pin.Model, data: pin.Data, leg: list[int], frame: int) -> tuple[int, float]:
    """Return the pitch joint farthest from both ends of the leg, and the sign that bends it forward."""
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)

    def pitch(joint: int) -> float:
        return float(data.J[4, model.joints[joint].idx_v])

    pitching = [joint for joint in leg if abs(pitch(joint)) > PITCHES]
    if not pitching:
        raise ModelError("no knee: a leg has no joint that turns about y; pass half_sitting")
    knee = _farthest(data, pitching, leg[0], data.oMf[frame].translation)
    # A turn about +y moves the shin backwards, that is the knee forward.
    forward = math.copysign(1.0, pitch(knee))
    i = model.joints[knee].idx_q
    room = model.upperPositionLimit[i] if forward > 0.0 else -model.lowerPositionLimit[i]
    return knee, forward if room >= KNEE_BEND else -forward


def _farthest(data: pin.Data, joints: list[int], hip: int, foot: Array) -> int:
    """Return the joint that is farthest from both ends of its leg."""

    def reach(joint: int) -> float:
        origin = data.oMi[joint].translation
        return float(min(np.linalg.norm(origin - data.oMi[hip].translation), np.linalg.norm(origin - foot)))

    return max(joints, key=reach)
