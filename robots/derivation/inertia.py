"""Which inertias can belong to a body, and how to mend those that cannot.

An inertia J about the centre of mass belongs to some mass distribution if and only if the second moments of mass
S = tr(J)/2 I − J have no negative eigenvalue; that is the triangle inequality A + B ≥ C of the principal moments
together with J ≥ 0. MuJoCo refuses anything else, Pinocchio computes nonsense with it.

Source: S. Traversaro, S. Brossette, A. Escande, F. Nori, "Identification of fully physical consistent inertial
parameters using optimization on manifolds", IROS 2016.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from wbc.core.errors import Array, ModelError
from wbc.robots import urdf
from wbc.robots.urdf import Element

MARGIN = 1e-9
"""Least second moment relative to the largest: a body of no thickness at all fails in MuJoCo by rounding."""

REPAIRED_RATIO = 1e-3
"""A repaired body has no second moment below this share of its largest one."""

REPAIRED_RADIUS = 1e-3
"""Nor one below that of its mass at this distance from the centre of mass, m."""

REPAIRED_MASS = 1e-3
"""Mass given to a massless moving link, kg."""

_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def second_moments(inertia: Array) -> Array:
    """Second moments of mass S = tr(J)/2 I − J of an inertia about the centre of mass, shape (3, 3), kg m²."""
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)


def check(root: Element) -> None:
    """Refuse a URDF with massless moving links or with inertias that no body can have.

    Args:
        root: The `<robot>` element, tidied.

    Raises:
        ModelError: Names every such link and says what is wrong with it.
    """
    problems = [f"link '{name}': {problem}" for name, problem in _problems(root).items()]
    problems += [f"link '{name}': {problem}" for name, problem in _massless(root).items()]
    if problems:
        raise ModelError(
            "the model cannot be simulated: "
            + "; ".join(problems)
            + ". Mend the URDF, or pass repair=True to clamp these inertias to the nearest physical ones"
        )


def repair(root: Element) -> list[str]:
    """Mend in place what `check` refuses.

    Second moments of mass are clamped from below; a massless moving link gets a mass of 1 g.

    Args:
        root: The `<robot>` element, tidied; changed.

    Returns:
        What was changed, one line each.

    Raises:
        ModelError: A mass or inertia that is not a number.
    """
    notes = []
    links = {str(link.get("name")): link for link in root.findall("link")}
    for name, problem in _problems(root).items():
        inertial = links[name].find("inertial")
        assert inertial is not None
        mass, inertia = _mass_and_inertia(name, inertial)
        if mass <= 0.0:
            links[name].remove(inertial)
            notes.append(f"link '{name}': {problem}; its inertial element was removed")
            continue
        values, axes = np.linalg.eigh(second_moments(inertia))
        floor = max(REPAIRED_RATIO * float(values.max()), mass * REPAIRED_RADIUS**2)
        moments = axes @ np.diag(np.maximum(values, floor)) @ axes.T
        _write(inertial, mass, np.trace(moments) * np.eye(3) - moments)
        notes.append(f"link '{name}': {problem}; repaired")
    for name, problem in _massless(root).items():
        inertial = links[name].find("inertial")
        mass = REPAIRED_MASS
        if inertial is None:
            inertial = ElementTree.SubElement(links[name], "inertial")
        else:
            mass = max(mass, _mass_and_inertia(name, inertial)[0])
        _write(inertial, mass, 2.0 * mass * REPAIRED_RADIUS**2 * np.eye(3))
        notes.append(f"link '{name}': {problem}; repaired with {mass:g} kg")
    return notes


def _problems(root: Element) -> dict[str, str]:
    """Links with an inertial element that no body can have."""
    found = {}
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        name = str(link.get("name"))
        mass, inertia = _mass_and_inertia(name, inertial)
        if mass < 0.0:
            found[name] = f"negative mass {mass:g} kg"
        elif mass == 0.0:
            if inertia.any():
                found[name] = "inertia without mass"
        elif inertia.any():  # a point mass is a body as long as it is fixed to others
            moments = np.linalg.eigvalsh(second_moments(inertia))
            principal = np.linalg.eigvalsh(inertia)
            if not moments[0] > MARGIN * moments[2]:
                listed = ", ".join(f"{value:.4g}" for value in principal)
                rule = "must be positive" if principal[0] <= 0.0 else "violate A + B > C"
                found[name] = f"principal moments of inertia {listed} kg m² {rule}"
    return found


def _massless(root: Element) -> dict[str, str]:
    """Moving links that carry no mass or no inertia, not even through the links fixed to them."""
    owner = urdf.moving_link_of(root)
    masses = dict.fromkeys(owner.values(), 0.0)
    extended = dict.fromkeys(owner.values(), False)
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None:
            name = str(link.get("name"))
            mass, inertia = _mass_and_inertia(name, inertial)
            masses[owner[name]] += max(0.0, mass)
            extended[owner[name]] |= bool(mass > 0.0 and inertia.any())
    found = {name: "moves but has no mass" for name, mass in masses.items() if mass == 0.0}
    return found | {
        name: "moves but has no rotational inertia"
        for name, mass in masses.items()
        if mass > 0.0 and not extended[name]
    }


def _mass_and_inertia(link: str, inertial: Element) -> tuple[float, Array]:
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise ModelError(f"link '{link}': <inertial> must have <mass> and <inertia>")
    try:
        kilograms = float(mass.get("value", "nan"))
        ixx, ixy, ixz, iyy, iyz, izz = (float(inertia.get(entry, "0")) for entry in _ENTRIES)
    except ValueError as error:
        raise ModelError(f"link '{link}': mass or inertia is not a number") from error
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if not (np.isfinite(kilograms) and np.isfinite(matrix).all()):
        raise ModelError(f"link '{link}': mass and inertia must be finite")
    return kilograms, matrix


def _write(inertial: Element, mass: float, inertia: Array) -> None:
    """Set mass and inertia; the centre of mass stays where it is and the axes stay those of `<origin>`."""
    for tag in ("mass", "inertia"):
        for old in inertial.findall(tag):
            inertial.remove(old)
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    upper = inertia[np.triu_indices(3)]
    values = {entry: repr(float(value)) for entry, value in zip(_ENTRIES, upper, strict=True)}
    ElementTree.SubElement(inertial, "inertia", values)
