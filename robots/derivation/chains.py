"""Closed chains of a robot in half-sitting."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import Array
from wbc.core.model import Closure, driven_joints, driven_names, joints_to
from wbc.robots.derivation.legs import joint_limits

CLOSED = 1e-5
"""Greatest gap of a closed chain in half-sitting, m and rad."""


def close(
    model: pin.Model,
    soles: tuple[str, ...],
    joints: Mapping[str, float],
    given: Mapping[str, float],
    closures: Sequence[Closure],
) -> dict[str, float]:
    """Return a posture in which closed chains close: their joints that are in no leg and not given are solved for."""
    names, ends = driven_names(model), [_ends(model, closure) for closure in closures]
    legs = {joint for frame in soles for joint in joints_to(model, frame)}
    moving = set().union(*(_between(model, *pair) for pair in ends))
    free = [
        i
        for i, (joint, name) in enumerate(zip(driven_joints(model), names, strict=True))
        if joint in moving - legs and name not in given
    ]
    q, data = pin.neutral(model), model.createData()
    place = q[-len(names) :]  # a view
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
        lower, upper = joint_limits(model)
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


def _ends(model: pin.Model, closure: Closure) -> tuple[int, int]:
    """Return the numbers of the two frames that a closure ties; a `ModelError` where no joint lies between them."""
    if closure.frame == closure.other:
        raise InputError(f"closure '{closure.name}' ties two frames, got '{closure.frame}' twice")
    known = [str(frame.name) for frame in model.frames]
    one, two = (
        model.getFrameId(choose("frame of a closure", end, known)) for end in (closure.frame, closure.other)
    )
    if not _between(model, one, two):
        raise ModelError(
            f"closure '{closure.name}' ties '{closure.frame}' to '{closure.other}', which are parts of one rigid "
            "body: no joint moves them against each other; leave it out"
        )
    return one, two


def _between(model: pin.Model, one: int, two: int) -> set[int]:
    """Return the joints that move two frames against each other."""
    return {*model.supports[model.frames[one].parentJoint]} ^ {*model.supports[model.frames[two].parentJoint]}
