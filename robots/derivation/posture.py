"""Half-sitting: knees bent, soles flat on the ground, centre of mass above the middle of the soles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from wbc.base.errors import InputError, ModelError, choose, shown
from wbc.base.numbers import Array, finite_scalar
from wbc.core.frames import Sole
from wbc.core.model import Closure, driven_joints, driven_names, joints_to

INSIDE = 0.05
"""Distance from joint limits at half-sitting, share of the range: a posture on a limit would keep it active."""

KNEE_BEND = math.radians(40.0)
"""Knee bend of a derived half-sitting, rad; others: Talos 49°, HRP-2 40°."""

BENT = (math.radians(25.0), math.radians(70.0))
"""Range of the knee bend of a posture that a file offers as half-sitting, rad."""

FULL_LEG = 6
"""Joints of a leg that can put its sole anywhere, in any direction."""

SOLVED = 1e-6
"""Greatest error of half-sitting that was solved for, m and rad."""

NEXT = 0.02
"""Least distance between the sides of the soles in half-sitting, m."""

SPREAD = math.radians(30.0)
"""Distance of a second start of the search from the first, towards the middle of the joints' ranges, rad."""

CLOSED = 1e-5
"""Greatest gap of a closed chain in half-sitting, m and rad."""

FLATNESS = 5e-3
"""Largest tilt of a sole in half-sitting, rad; a sole 0.2 m long is then off the ground by 1 mm at most."""


def half_sitting(
    model: pin.Model,
    soles: tuple[Sole, ...],
    given: Mapping[str, float],
    notes: list[str],
    postures: Sequence[tuple[str, Mapping[str, float]]] = (),
) -> dict[str, float]:
    """Return the half-sitting position of every joint, rad or m, in the order of the model.

    `given` has those of some joints or none. Of the postures of the file (name, joint → position) the first in which
    the robot stands is taken; without one the first gives the joints that are not in the legs. Leg joints that are not
    given are solved for; the others are zero, or as near to it as `INSIDE` allows. `notes` gets a line for each rule
    that was used.
    """
    names = driven_names(model)
    for name in given:
        choose("joint", name, names)
    for title, joints in postures if soles else ():
        taken = {**joints, **given}
        if stands(model, soles, taken):
            notes.append(f"half-sitting: keyframe '{title}'")
            return {name: float(taken[name]) for name in names}
    legs = [joints_to(model, sole.frame) for sole in soles]
    of_legs = dict.fromkeys(_index(model, joint) for leg in legs for joint in leg)
    if postures:
        title, joints = postures[0]
        inside = _inside(model, np.array([joints[name] for name in names])).tolist()
        upper_body = {name: inside[i] for i, name in enumerate(names) if i not in of_legs}
        if any(upper_body.values()):
            given = {**upper_body, **given}
            notes.append(f"half-sitting of {len(upper_body)} joints above the legs: keyframe '{title}'")
    lower, upper = _limits(model)
    q = pin.neutral(model)
    values = q[-len(names) :]  # a view
    values[:] = _inside(model, np.zeros(len(names)))
    for name, value in given.items():
        i = names.index(name)
        values[i] = finite_scalar(f"half-sitting of joint '{name}'", value, low=lower[i], high=upper[i])
    if free := [i for i in of_legs if names[i] not in given]:
        values[:] = _solve(model, soles, legs, q, sorted(free))
        solved = [f"{names[i]} {round(math.degrees(values[i]), 2) + 0.0}" for i in free]
        notes.append("half-sitting of the legs solved for (deg): " + ", ".join(solved))
    if rest := [name for i, name in enumerate(names) if name not in given and i not in of_legs]:
        notes.append(
            f"half-sitting of {len(rest)} other joints: zero, or a twentieth of the range inside a limit"
        )
    return dict(zip(names, values.tolist(), strict=True))


def _index(model: pin.Model, joint: int) -> int:
    """Return the place of a joint, by its number in the model, or that of its leader, among those with a coordinate."""
    return int(model.joints[joint].idx_v - model.nv + len(driven_joints(model)))


def _limits(model: pin.Model) -> tuple[Array, Array]:
    """Return lower and upper limits of the joints with a coordinate, rad or m."""
    na = len(driven_joints(model))
    return np.array(model.lowerPositionLimit[-na:]), np.array(model.upperPositionLimit[-na:])


def _inside(model: pin.Model, values: Array) -> Array:
    """Return the values, rad or m, moved inside the limits by a share of the range, `INSIDE`."""
    lower, upper = _limits(model)
    inside = INSIDE * np.nan_to_num(upper - lower, posinf=0.0)
    return np.asarray(np.clip(values, lower + inside, upper - inside))


def close(
    model: pin.Model,
    soles: tuple[str, ...],
    joints: Mapping[str, float],
    given: Mapping[str, float],
    closures: Sequence[Closure],
) -> dict[str, float]:
    """Return a posture in which closed chains close: their joints that are in no leg and not given are solved for."""
    names, numbers = driven_names(model), driven_joints(model)
    legs = {joint for frame in soles for joint in joints_to(model, frame)}
    known = [str(frame.name) for frame in model.frames]
    ends, moving = list[tuple[int, int]](), set[int]()
    for closure in closures:
        if not isinstance(closure, Closure):
            raise InputError(f"closures must be of class Closure, got {shown(closure)}")
        if closure.frame == closure.other:
            raise InputError(f"closure '{closure.name}' ties two frames, got '{closure.frame}' twice")
        one, two = (
            model.getFrameId(choose("frame of a closure", end, known))
            for end in (closure.frame, closure.other)
        )
        sides = [{*model.supports[model.frames[end].parentJoint]} for end in (one, two)]
        if sides[0] == sides[1]:
            raise ModelError(
                f"closure '{closure.name}' ties '{closure.frame}' to '{closure.other}', which are parts of one rigid "
                "body: no joint moves them against each other; leave it out"
            )
        ends.append((one, two))
        moving |= sides[0] ^ sides[1]
    free = [
        i
        for i, (joint, name) in enumerate(zip(numbers, names, strict=True))
        if joint in moving - legs and name not in given
    ]
    lower, upper = _limits(model)
    q, data = pin.neutral(model), model.createData()
    place = q[-len(names) :]
    place[:] = [joints[name] for name in names]

    def gaps(values: Array) -> Array:
        place[free] = values
        pin.framesForwardKinematics(model, data, q)
        found = np.zeros((len(closures), 2, 3))
        for gap, (one, two), closure in zip(found, ends, closures, strict=True):
            apart = data.oMf[one].actInv(data.oMf[two])
            gap[0], gap[1] = apart.translation, pin.log3(apart.rotation) if closure.rotation else 0.0
        return found.ravel()

    if free:
        bounds = (lower[free], upper[free])
        place[free] = least_squares(gaps, place[free], bounds=bounds, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    sizes = np.linalg.norm(gaps(place[free]).reshape(-1, 2, 3), axis=2)
    for closure, (apart, turned) in zip(closures, sizes.tolist(), strict=True):
        if max(apart, turned) > CLOSED:
            raise ModelError(
                f"the chain of closure '{closure.name}' does not close in half-sitting: '{closure.frame}' and "
                f"'{closure.other}' stay {1e3 * apart:.1f} mm and {math.degrees(turned):.1f}° apart; correct the "
                "frames or the limits of the joints, or pass half_sitting with joints in which it closes"
            )
    return dict(zip(names, place.tolist(), strict=True))


def stands(model: pin.Model, soles: tuple[Sole, ...], joints: Mapping[str, float]) -> bool:
    """Return True if a posture can serve as half-sitting: inside all limits, soles flat, knees bent, balanced."""
    names = driven_names(model)
    values = np.array([joints[name] for name in names])
    lower, upper = _limits(model)
    if not ((values >= lower) & (values <= upper)).all():
        return False
    frame_names = (soles[0].frame, soles[1].frame)
    q = standing_configuration(model, frame_names, joints)
    try:
        check_standing(model, soles, q)
    except InputError:
        return False
    return all(BENT[0] <= _bend(model, frame, q) <= BENT[1] for frame in frame_names)


def standing_configuration(model: pin.Model, soles: tuple[str, ...], joints: Mapping[str, float]) -> Array:
    """Return the configuration, shape (nq,), with an upright base and the origin midway between the soles.

    The lower sole is on z = 0. The base of a robot without feet is at the origin.
    """
    q = pin.neutral(model)
    names = driven_names(model)
    q[-len(names) :] = [joints[name] for name in names]
    if not soles:
        return np.asarray(q)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    left, right = (data.oMf[model.getFrameId(sole)].translation for sole in soles)
    q[:2] = -0.5 * (left + right)[:2]
    q[2] = -min(left[2], right[2])
    return np.asarray(q)


def check_standing(model: pin.Model, soles: tuple[Sole, ...], q: Array) -> None:
    """Refuse a posture in which a sole is tilted or lies above the other, or the robot would tip over at once.

    It tips over with its centre of mass outside the rectangle around both soles.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    com = pin.centerOfMass(model, data, q)
    places = [data.oMf[model.getFrameId(sole.frame)] for sole in soles]
    for sole, place in zip(soles, places, strict=True):
        tilt = math.acos(min(1.0, float(place.rotation[2, 2])))
        if tilt > FLATNESS:
            raise InputError(
                f"half-sitting tilts sole '{sole.frame}' by {math.degrees(tilt):.2f}° with an upright base; "
                f"at most {math.degrees(FLATNESS):.2f}° is allowed"
            )
    step = abs(float(places[0].translation[2] - places[1].translation[2]))
    if step > 1e-3:
        raise InputError(
            f"half-sitting puts one sole {step * 1e3:.1f} mm above the other; at most 1 mm is allowed"
        )
    corners = np.concatenate([sole.corners(place) for sole, place in zip(soles, places, strict=True)])[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0)
    if (com[:2] < low).any() or (com[:2] > high).any():
        raise InputError(
            f"half-sitting puts the centre of mass at ({com[0]:.3f}, {com[1]:.3f}) m, outside the soles, "
            f"x {low[0]:.3f} to {high[0]:.3f} m and y {low[1]:.3f} to {high[1]:.3f} m from their middle"
        )


def knee_direction(model: pin.Model, sole: str) -> Array:
    """Return where the knee of the leg of a sole goes when it bends, in root axes, shape (3,), m/rad."""
    data, leg = model.createData(), joints_to(model, sole)
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    places = [np.array(data.oMi[joint].translation) for joint in leg]
    foot = np.array(data.oMf[model.getFrameId(sole)].translation)
    reach = [min(np.linalg.norm(place - places[0]), np.linalg.norm(place - foot)) for place in places]
    middle = int(np.argmax(reach))
    knee = model.joints[leg[middle]]
    bent = math.copysign(1.0, model.upperPositionLimit[knee.idx_q] + model.lowerPositionLimit[knee.idx_q])
    return np.asarray(np.cross(foot - places[middle], bent * data.J[3:, knee.idx_v]))


def _solve(
    model: pin.Model, soles: tuple[Sole, ...], legs: list[list[int]], start: Array, free: list[int]
) -> Array:
    """Solve for the free joints by least squares; the residual vanishes for legs of six joints.

    The feet are as far apart as at zero positions. Where no such posture is found, the search goes on with the feet
    under the hips, and as near as they may be, and from other positions of the legs: at zero they may be spread.
    """
    data = model.createData()
    frames = [model.getFrameId(sole.frame) for sole in soles]
    lower, upper = _limits(model)
    knees = [_knee(model, data, leg, frame) for leg, frame in zip(legs, frames, strict=True)]
    q = np.array(start)
    pin.framesForwardKinematics(model, data, q)
    apart_at = [data.oMf[frames[0]].translation[1] - data.oMf[frames[1]].translation[1]]
    apart_at.append(data.oMi[legs[0][0]].translation[1] - data.oMi[legs[1][0]].translation[1])
    narrowest = NEXT + max(sole.width for sole in soles)
    widths = [max(narrowest, float(width)) for width in (*apart_at, 0.0)]
    bent = [(7 + _index(model, joint), sign) for joint, sign in knees]
    solved_for = 7 + np.array(free)

    # Legs without an ankle roll cannot shift the centre of mass sideways on flat soles: it stays where it is.
    sideways = 1.0 if all(len(leg) >= FULL_LEG for leg in legs) else 0.0

    def residual(x: Array, width: float) -> Array:
        q[solved_for] = x
        com = pin.centerOfMass(model, data, q)
        pin.updateFramePlacements(model, data)
        left, right = (data.oMf[frame] for frame in frames)
        middle = 0.5 * (left.translation + right.translation)
        apart = left.translation - right.translation
        bend = 0.5 * sum(sign * q[i] for i, sign in bent) - KNEE_BEND
        return np.concatenate(
            [
                pin.log3(left.rotation),
                pin.log3(right.rotation),
                (com[:2] - middle[:2]) * [1.0, sideways],
                apart - [0.0, width, 0.0],
                [bend],
            ]
        )

    low, high = lower[free], upper[free]
    first = q[solved_for]
    with np.errstate(invalid="ignore"):  # of joints that turn without end
        middle = np.clip(np.nan_to_num(0.5 * (low + high)), first - SPREAD, first + SPREAD)
    best: tuple[float, Array] | None = None
    for width, x0 in itertools.product(dict.fromkeys(widths), (first, middle)):
        solution = least_squares(
            residual, x0, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200, args=(width,)
        )
        error = residual(solution.x, width)[:11]
        largest = float(np.abs(error).max())
        if largest <= SOLVED:
            return np.array(q[7:])
        if best is None or largest < best[0]:
            best = largest, error
    assert best is not None
    turn = float((high - low).max())
    raise ModelError(
        f"no half-sitting within the joint limits was found: {_left(best[1], soles)}; pass half_sitting with the leg "
        f"joints, or correct their limits: they turn by {turn:.3g} rad at most, and an MJCF in radians must say "
        '<compiler angle="radian"/>'
    )


def _left(error: Array, soles: tuple[Sole, ...]) -> str:
    """Return what is wrong with the best posture that a search has found, the largest part first."""
    tilts = [float(np.linalg.norm(error[i : i + 3])) for i in (0, 3)]
    away, apart = float(np.linalg.norm(error[6:8])), float(np.linalg.norm(error[8:11]))
    parts = [
        *(
            (tilt, f"sole '{sole.frame}' is turned by {math.degrees(tilt):.2g}°")
            for tilt, sole in zip(tilts, soles, strict=True)
        ),
        (away, f"the centre of mass is {1e3 * away:.2g} mm beside the middle of the soles"),
        (apart, f"the soles are {1e3 * apart:.2g} mm from level and side by side"),
    ]
    return " and ".join(text for size, text in sorted(parts, reverse=True)[:2] if size > SOLVED)


def _bend(model: pin.Model, sole: str, q: Array) -> float:
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
    hip, foot = data.oMi[leg[0]].translation, data.oMf[frame].translation

    def pitch(joint: int) -> float:
        return float(data.J[4, model.joints[joint].idx_v])

    pitching = [joint for joint in leg if abs(pitch(joint)) > 0.7]
    if not pitching:
        raise ModelError("no knee: a leg has no joint that turns about y; pass half_sitting")

    def reach(joint: int) -> float:
        origin = data.oMi[joint].translation
        return float(min(np.linalg.norm(origin - hip), np.linalg.norm(origin - foot)))

    knee = max(pitching, key=reach)
    # A turn about +y moves the shin backwards, that is the knee forward.
    forward = math.copysign(1.0, pitch(knee))
    i = model.joints[knee].idx_q
    room = model.upperPositionLimit[i] if forward > 0.0 else -model.lowerPositionLimit[i]
    return knee, forward if room >= KNEE_BEND else -forward
