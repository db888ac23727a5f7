"""Inertias that no body can have: check and repair.

An inertia J about the centre of mass belongs to some mass distribution if and only if the second moments of mass
S = tr(J)/2 I − J have no negative eigenvalue, that is if J ≥ 0 and its principal moments satisfy the triangle
inequality A + B ≥ C. MuJoCo refuses anything else, Pinocchio computes nonsense with it.

Source: S. Traversaro, S. Brossette, A. Escande, F. Nori, "Identification of fully physical consistent inertial
parameters using optimization on manifolds", IROS 2016.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from wbc.base.errors import ModelError, shown
from wbc.base.numbers import Array
from wbc.robots import urdf
from wbc.robots.urdf import Element

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

_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def second_moments(inertia: Array) -> Array:
    """Return S = tr(J)/2 I − J of an inertia J about the centre of mass, shape (3, 3), kg m²."""
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)


def check(root: Element, fixed: bool = False) -> None:
    """Raise a `ModelError` that names moving links without mass and inertias of no body in a tidied `<robot>`.

    With `fixed` the root does not move.
    """
    problems = [f"link '{name}': {problem}" for name, problem in _problems(root).items()]
    problems += [f"link '{name}': {problem}" for name, problem in _massless(root, fixed).items()]
    if problems:
        raise ModelError(
            "the model cannot be simulated: "
            + "; ".join(problems)
            + ". Correct the URDF, or pass repair=True (--repair) to clamp these inertias to the nearest physical ones"
        )


def repair(root: Element, fixed: bool = False) -> list[str]:
    """Repair in place what `check` refuses in a tidied `<robot>`, and return the changes, one line each.

    Second moments of mass are clamped from below; a massless moving link gets a mass of 1 g. A mass or inertia that is
    not a number is a `ModelError`.
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
    for name, problem in _massless(root, fixed).items():
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
    """Return link → defect for inertial elements that no body can have."""
    problems = {}
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        name = str(link.get("name"))
        mass, inertia = _mass_and_inertia(name, inertial)
        if mass < 0.0:
            problems[name] = f"negative mass {mass:g} kg"
        elif mass == 0.0:
            if inertia.any():
                problems[name] = "inertia without mass"
        elif inertia.any():  # a point mass may be fixed to other bodies
            moments = np.linalg.eigvalsh(second_moments(inertia))
            principal = np.linalg.eigvalsh(inertia)
            if not moments[0] > MARGIN * moments[2]:
                listed = ", ".join(f"{value:.4g}" for value in principal)
                rule = "must be positive" if principal[0] <= 0.0 else "violate A + B > C"
                problems[name] = f"principal moments of inertia {listed} kg m² {rule}"
    return problems


def _massless(root: Element, fixed: bool) -> dict[str, str]:
    """Return link → defect for moving links without mass or inertia, links fixed to them included."""
    owner = urdf.moving_link_of(root)
    masses = dict.fromkeys(owner.values(), 0.0)
    if fixed:
        still = {parent for parent, _ in map(urdf.parent_and_child, urdf.joints(root).values())}
        still -= {child for _, child in map(urdf.parent_and_child, urdf.joints(root).values())}
        owner = {link: moving for link, moving in owner.items() if moving not in still}
        masses = dict.fromkeys(owner.values(), 0.0)
    extended = dict.fromkeys(owner.values(), False)
    for link in root.findall("link"):
        inertial = link.find("inertial")
        name = str(link.get("name"))
        if inertial is not None and name in owner:
            mass, inertia = _mass_and_inertia(name, inertial)
            masses[owner[name]] += max(0.0, mass)
            extended[owner[name]] |= bool(mass > 0.0 and inertia.any())
    return {name: "moves but has no mass" for name, mass in masses.items() if mass == 0.0} | {
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
    origin = inertial.find("origin")
    placement = {} if origin is None else origin.attrib
    for name in ("xyz", "rpy"):
        urdf.triple(f"link '{link}': {name} of the inertial origin", placement.get(name, "0 0 0"))
    return kilograms, matrix


def _write(inertial: Element, mass: float, inertia: Array) -> None:
    """Set mass and inertia; centre of mass and axes stay those of `<origin>`."""
    for tag in ("mass", "inertia"):
        for old in inertial.findall(tag):
            inertial.remove(old)
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    upper = inertia[np.triu_indices(3)]
    values = {entry: repr(float(value)) for entry, value in zip(_ENTRIES, upper, strict=True)}
    ElementTree.SubElement(inertial, "inertia", values)
