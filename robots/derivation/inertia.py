"""Inertias that no body can have: check and repair.

An inertia J about the centre of mass belongs to some mass distribution if and only if the second moments of mass
S = tr(J)/2 I − J have no negative eigenvalue, that is if J ≥ 0 and its principal moments satisfy the triangle
inequality A + B ≥ C. MuJoCo refuses anything else, Pinocchio computes nonsense with it.

Source: S. Traversaro, S. Brossette, A. Escande, F. Nori, "Identification of fully physical consistent inertial
parameters using optimization on manifolds", IROS 2016.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.robots.urdf import Inertial, Urdf

MARGIN = 1e-9
"""Smallest second moment relative to the largest: rounding makes MuJoCo refuse a body without thickness."""

REPAIRED_RATIO = 1e-3
"""Smallest second moment of a repaired body, relative to its largest one."""

REPAIRED_RADIUS = 1e-3
"""Smallest radius of gyration of a repaired body, m."""

REPAIRED_MASS = 1e-3
"""Mass given to a massless moving link, kg."""


def second_moments(inertia: Array) -> Array:
    """Return S = tr(J)/2 I − J of an inertia J about the centre of mass, shape (3, 3), kg m²."""
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)


def repair_inertias(robot: Urdf, fixed: bool, repair: bool) -> list[str]:
    """Repair inertias of a tidy URDF that no body can have, in place, and return the changes, one line each.

    Second moments of mass are clamped from below; a massless moving link gets a mass of 1 g. With `fixed` the root does
    not move. Without `repair` a `ModelError` names all of them.
    """
    notes = []
    for name, inertial in robot.links.items():
        if inertial is None or not (why := defect(inertial.mass, inertial.inertia)):
            continue
        done = ""
        if repair:
            robot.links[name] = None if inertial.mass <= 0.0 else _clamped(inertial)
            done = "; its inertial element was removed" if inertial.mass <= 0.0 else "; repaired"
        notes.append(f"link '{name}': {why}{done}")
    for name, (why, own) in _massless(robot, fixed).items():
        done = ""
        if repair:
            mass, old = max(REPAIRED_MASS, own), robot.links[name]
            place = pin.SE3.Identity() if old is None else old.place
            robot.links[name] = Inertial(mass, 2.0 * mass * REPAIRED_RADIUS**2 * np.eye(3), place)
            done = f"; repaired with {mass:g} kg"
        notes.append(f"link '{name}': {why}{done}")
    if notes and not repair:
        raise ModelError(
            f"the model cannot be simulated: {'; '.join(notes)}. Correct the file, or pass repair=True (--repair) to "
            "clamp these inertias to the nearest physical ones"
        )
    return notes


def _clamped(inertial: Inertial) -> Inertial:
    """Return the nearest inertia that a body can have, its second moments of mass clamped from below."""
    values, axes = np.linalg.eigh(second_moments(inertial.inertia))
    floor = max(REPAIRED_RATIO * float(values.max()), inertial.mass * REPAIRED_RADIUS**2)
    moments = axes @ np.diag(np.maximum(values, floor)) @ axes.T
    return inertial._replace(inertia=np.trace(moments) * np.eye(3) - moments)


def defect(mass: float, inertia: Array) -> str:
    """Return why no body can have a mass, kg, and an inertia about its centre, kg m²; empty where one can."""
    if mass < 0.0:
        return f"negative mass {mass:g} kg"
    if mass == 0.0:
        return "inertia without mass" if inertia.any() else ""
    moments, principal = np.linalg.eigvalsh(second_moments(inertia)), np.linalg.eigvalsh(inertia)
    if not inertia.any() or moments[0] > MARGIN * moments[2]:  # a point mass may be fixed to other bodies
        return ""
    listed = ", ".join(f"{value:.4g}" for value in principal)
    rule = "must be positive" if principal[0] <= 0.0 else "violate A + B > C"
    return f"principal moments of inertia {listed} kg m² {rule}"


def _massless(robot: Urdf, fixed: bool) -> dict[str, tuple[str, float]]:
    """Return link → defect, and its own mass, of moving links without mass or inertia, with what is fixed to them."""
    carriers, found = _carriers(robot, fixed), {}
    for link in dict.fromkeys(carriers.values()):
        on = [robot.links[part] for part, carrier in carriers.items() if carrier == link]
        parts, inertial = [part for part in on if part is not None], robot.links[link]
        own = 0.0 if inertial is None else inertial.mass
        if not any(part.mass > 0.0 for part in parts):
            found[link] = "moves but has no mass", own
        elif not any(part.mass > 0.0 and part.inertia.any() for part in parts):
            found[link] = "moves but has no rotational inertia", own
    return found


def _carriers(robot: Urdf, fixed: bool) -> dict[str, str]:
    """Return link → the link with a joint, or the root, that it is fixed to; with `fixed` without those at rest."""
    fixed_to = {joint.child: joint.parent for joint in robot.joints.values() if not joint.moves}
    found = {}
    for name in robot.links:
        carrier = name
        while carrier in fixed_to:
            carrier = fixed_to[carrier]
        if not fixed or carrier != robot.root:
            found[name] = carrier
    return found
