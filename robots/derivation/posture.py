"""Half-sitting: knees bent, soles flat on the ground, centre of mass above the middle of the soles."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array, finite_scalar
from wbc.core.frames import Sole
from wbc.core.model import driven_names, joints_to
from wbc.robots.derivation.legs import bent_legs, joint_limits, knee_bend, place_of

INSIDE = 0.05
"""Distance from joint limits at half-sitting, share of the range: a posture on a limit would keep it active."""

BENT = (math.radians(25.0), math.radians(70.0))
"""Range of the knee bend of a posture that a file offers as half-sitting, rad."""

LEVEL_STEP = 1e-3
"""Largest height of a sole over the other one in half-sitting, m."""

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
    of_legs = dict.fromkeys(
        place_of(model, joint) for sole in soles for joint in joints_to(model, sole.frame)
    )
    if postures and any((above := _above_legs(model, postures[0][1], of_legs)).values()):
        given = {**above, **given}
        notes.append(f"half-sitting of {len(above)} joints above the legs: keyframe '{postures[0][0]}'")
    lower, upper = joint_limits(model)
    q = pin.neutral(model)
    values = q[-len(names) :]  # a view
    values[:] = _inside(model, np.zeros(len(names)))
    for name, value in given.items():
        i = names.index(name)
        values[i] = finite_scalar(f"half-sitting of joint '{name}'", value, low=lower[i], high=upper[i])
    if free := [i for i in of_legs if names[i] not in given]:
        values[:] = bent_legs(model, soles, q, sorted(free))
        solved = [f"{names[i]} {round(math.degrees(values[i]), 2) + 0.0}" for i in free]
        notes.append("half-sitting of the legs solved for (deg): " + ", ".join(solved))
    if rest := [name for i, name in enumerate(names) if name not in given and i not in of_legs]:
        notes.append(
            f"half-sitting of {len(rest)} other joints: zero, or a twentieth of the range inside a limit"
        )
    return dict(zip(names, values.tolist(), strict=True))


def _above_legs(model: pin.Model, joints: Mapping[str, float], of_legs: Collection[int]) -> dict[str, float]:
    """Return the positions of a keyframe, rad or m, of the joints that are not in the legs, inside their limits."""
    names = driven_names(model)
    inside = _inside(model, np.array([joints[name] for name in names])).tolist()
    return {name: inside[i] for i, name in enumerate(names) if i not in of_legs}


def _inside(model: pin.Model, values: Array) -> Array:
    """Return the values, rad or m, moved inside the limits by a share of the range, `INSIDE`."""
    lower, upper = joint_limits(model)
    inside = INSIDE * np.nan_to_num(upper - lower, posinf=0.0)
    return np.asarray(np.clip(values, lower + inside, upper - inside))


def stands(model: pin.Model, soles: tuple[Sole, ...], joints: Mapping[str, float]) -> bool:
    """Return True if a posture can serve as half-sitting: inside all limits, soles flat, knees bent, balanced."""
    names = driven_names(model)
    values = np.array([joints[name] for name in names])
    lower, upper = joint_limits(model)
    if not ((values >= lower) & (values <= upper)).all():
        return False
    frame_names = (soles[0].frame, soles[1].frame)
    q = standing_configuration(model, frame_names, joints)
    try:
        check_standing(model, soles, q)
    except InputError:
        return False
    return all(BENT[0] <= knee_bend(model, frame, q) <= BENT[1] for frame in frame_names)


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
    if step > LEVEL_STEP:
        raise InputError(
            f"half-sitting puts one sole {step * 1e3:.1f} mm above the other; at most {1e3 * LEVEL_STEP:g} mm is "
            "allowed"
        )
    corners = np.concatenate([sole.corners(place) for sole, place in zip(soles, places, strict=True)])[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0)
    if (com[:2] < low).any() or (com[:2] > high).any():
        raise InputError(
            f"half-sitting puts the centre of mass at ({com[0]:.3f}, {com[1]:.3f}) m, outside the soles, "
            f"x {low[0]:.3f} to {high[0]:.3f} m and y {low[1]:.3f} to {high[1]:.3f} m from their middle"
        )
