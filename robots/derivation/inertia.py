"""Inertias that no body can have: check and repair.

An inertia J about the centre of mass belongs to some mass distribution if and only if the second moments of mass
S = tr(J)/2 I − J have no negative eigenvalue, that is if J ≥ 0 and its principal moments satisfy the triangle
inequality A + B ≥ C. MuJoCo refuses anything else, Pinocchio computes nonsense with it.

Source: S. Traversaro, S. Brossette, A. Escande, F. Nori, "Identification of fully physical consistent inertial
parameters using optimization on manifolds", IROS 2016.
"""

from __future__ import annotations

from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from wbc.base.errors import ModelError, shown
from wbc.base.numbers import Array
from wbc.robots import urdf
from wbc.robots.source import Element

MARGIN = 1e-9
"""Smallest second moment relative to the largest: rounding makes MuJoCo refuse a body without thickness."""

REPAIRED_RATIO = 1e-3
"""Smallest second moment of a repaired body, relative to its largest one."""

REPAIRED_RADIUS = 1e-3
"""Smallest radius of gyration of a repaired body, m."""

REPAIRED_MASS = 1e-3
"""Mass given to a massless moving link, kg."""


HEAVIEST = 1e6
"""Largest mass, kg, and largest moment of inertia, kg m², of a link."""

ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Entries of an inertia, row by row."""


class Inertial(NamedTuple):
    """Mass of a link, kg, and inertia about its centre of mass, in axes of its own, shape (3, 3), kg m²."""

    mass: float
    inertia: Array


def second_moments(inertia: Array) -> Array:
    """Return S = tr(J)/2 I − J of an inertia J about the centre of mass, shape (3, 3), kg m²."""
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)


def settle(root: Element, fixed: bool, repair: bool) -> list[str]:
    """Repair inertias of a tidied `<robot>` that no body can have, in place, and return the changes, one line each.

    Second moments of mass are clamped from below; a massless moving link gets a mass of 1 g. With `fixed` the root does
    not move. Without `repair` a `ModelError` names all of them.
    """
    notes, links = [], {str(link.get("name")): link for link in root.findall("link")}
    for name, inertial in inertials(root).items():
        if not (defect := _defect(*inertial)):
            continue
        notes.append(f"link '{name}': {defect}")
        if not repair:
            continue
        if inertial.mass <= 0.0:
            links[name].remove(links[name].findall("inertial")[0])
            notes[-1] += "; its inertial element was removed"
            continue
        values, axes = np.linalg.eigh(second_moments(inertial.inertia))
        floor = max(REPAIRED_RATIO * float(values.max()), inertial.mass * REPAIRED_RADIUS**2)
        moments = axes @ np.diag(np.maximum(values, floor)) @ axes.T
        _write(links[name], Inertial(inertial.mass, np.trace(moments) * np.eye(3) - moments))
        notes[-1] += "; repaired"
    for name, (defect, own) in _massless(root, fixed).items():
        notes.append(f"link '{name}': {defect}")
        if repair:
            mass = max(REPAIRED_MASS, own)
            _write(links[name], Inertial(mass, 2.0 * mass * REPAIRED_RADIUS**2 * np.eye(3)))
            notes[-1] += f"; repaired with {mass:g} kg"
    if notes and not repair:
        raise ModelError(
            f"the model cannot be simulated: {'; '.join(notes)}. Correct the file, or pass repair=True (--repair) to "
            "clamp these inertias to the nearest physical ones"
        )
    return notes


def _defect(mass: float, inertia: Array) -> str:
    """Return why no body can have an inertia; empty where one can."""
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


def _massless(root: Element, fixed: bool) -> dict[str, tuple[str, float]]:
    """Return link → defect, and its own mass, of moving links without mass or inertia, with what is fixed to them."""
    known, carriers, found = inertials(root), _carriers(root, fixed), {}
    for link in dict.fromkeys(carriers.values()):
        parts = [known[part] for part, carrier in carriers.items() if carrier == link and part in known]
        own = known[link].mass if link in known else 0.0
        if not any(part.mass > 0.0 for part in parts):
            found[link] = "moves but has no mass", own
        elif not any(part.mass > 0.0 and part.inertia.any() for part in parts):
            found[link] = "moves but has no rotational inertia", own
    return found


def inertials(root: Element) -> dict[str, Inertial]:
    """Return the mass and the inertia of the links that have one."""
    found = {}
    for link in root.findall("link"):
        if (inertial := link.find("inertial")) is not None:
            name = str(link.get("name"))
            found[name] = _inertial(name, inertial)
    return found


def _inertial(link: str, inertial: Element) -> Inertial:
    mass, inertia, origin = (inertial.find(tag) for tag in ("mass", "inertia", "origin"))
    if mass is None or inertia is None:
        raise ModelError(f"link '{link}': <inertial> must have <mass> and <inertia>")
    try:
        kilograms = float(mass.get("value", "nan"))
        ixx, ixy, ixz, iyy, iyz, izz = (float(inertia.get(entry, "0")) for entry in ENTRIES)
    except ValueError as error:
        given = {"mass": mass.get("value"), **inertia.attrib}
        raise ModelError(f"link '{link}': mass and inertia must be numbers, got {shown(given)}") from error
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if not (np.isfinite(kilograms) and np.isfinite(matrix).all()):
        raise ModelError(f"link '{link}': mass and inertia must be finite")
    if abs(kilograms) > HEAVIEST or np.abs(matrix).max() > HEAVIEST:
        raise ModelError(
            f"link '{link}': mass (kg) and inertia (kg m²) must be at most {HEAVIEST:g}, got {kilograms:g} and "
            f"{np.abs(matrix).max():g}"
        )
    # The URDF parser drops the whole inertia if it cannot read the origin.
    placement = {} if origin is None else origin.attrib
    for key in ("xyz", "rpy"):
        urdf.triple(f"link '{link}': {key} of the inertial origin", placement.get(key, "0 0 0"))
    return Inertial(kilograms, matrix)


def _write(link: Element, inertial: Inertial) -> None:
    """Give a link another mass and inertia; the place of its centre of mass and its axes stay."""
    old = link.find("inertial")
    new = ElementTree.SubElement(link, "inertial") if old is None else old
    for part in [*new.findall("mass"), *new.findall("inertia")]:
        new.remove(part)
    ElementTree.SubElement(new, "mass", value=repr(float(inertial.mass)))
    values = inertial.inertia[np.triu_indices(3)].tolist()
    ElementTree.SubElement(new, "inertia", dict(zip(ENTRIES, map(repr, values), strict=True)))


def _carriers(root: Element, fixed: bool) -> dict[str, str]:
    """Return link → the link with a joint, or the root, that it is fixed to; with `fixed` without those at rest."""
    children = {child for _, child in map(urdf.parent_and_child, urdf.joints(root).values())}
    ends = map(urdf.parent_and_child, urdf.joints(root, ("fixed",)).values())
    fixed_to = {child: parent for parent, child in ends}
    found = {}
    for link in root.findall("link"):
        carrier = name = str(link.get("name"))
        while carrier in fixed_to:
            carrier = fixed_to[carrier]
        if not fixed or carrier in children:
            found[name] = carrier
    return found
