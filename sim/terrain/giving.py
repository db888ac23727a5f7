"""Floors that give, are slippery or move in places, by the parameters of MuJoCo's own contacts: those of the soles.

On a floor that gives, each point of a sole rests on a spring and a damper of the floor. A contact of a constant
impedance d whose `solref` is (−s, −b) has the force

    f = (s r − b v − d a) / ((1 − d) Â),

with the depth r, its rate v, the acceleration a of the gap without contact, and the inverse inertia Â of the sole's
body at the contact (`body_invweight0`). A spring K and a damper C follow from s = K (1 − d) Â and b = C (1 − d) Â; the
smaller d is, the smaller is the virtual mass d/((1 − d) Â) of the contact. For a floor of stiffness k per area and a
point that stands for the area A of its sole, K = k A.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.feet import FootParts
from wbc.sim.terrain.areas import at_places
from wbc.sim.terrain.spec import DAMPING_TIME, Terrain

IMPEDANCE = 1e-3
"""Impedance d of a contact with a floor that gives."""

FRICTION_IMPEDANCE = 1000.0
"""Ratio of the impedances of friction and normal force (`impratio`): friction would creep by the softness of the floor,
at half of its limit by 13 mm/s with a ratio of 10, by 0.13 mm/s with this one."""


def surfaces(
    model: mujoco.MjModel, feet: Sequence[FootParts], ground: Terrain
) -> list[SlidingFloor | GivingFloor]:
    """Return what a ground changes at the soles of a compiled model; nothing for a rigid one of one friction."""
    found: list[SlidingFloor | GivingFloor] = []
    if ground.gives:
        found.append(GivingFloor(model, feet, ground))
    if any(area.name in {"friction", "speed"} for area in ground.surface_areas):
        found.append(SlidingFloor(model, feet, ground))
    return found


class SlidingFloor:
    """Areas of a ground on which the soles have another friction than elsewhere, or that move: walkways."""

    def __init__(self, model: mujoco.MjModel, feet: Iterable[FootParts], ground: Terrain) -> None:
        """Look up the points of the soles, and their friction elsewhere."""
        self._geoms = np.array([model.geom(name).id for foot in feet for name in foot.contact_geoms])
        self._usual = model.geom_friction[self._geoms, 0].copy()
        self._areas = ground.surface_areas
        self._moves = any(area.name == "speed" for area in self._areas)
        model.flg_surfacevel |= self._moves

    def reset(self, model: mujoco.MjModel) -> None:
        """Write the parameters that a new model has."""
        model.geom_friction[self._geoms, 0] = self._usual
        if self._moves:
            model.geom_surfacevel[self._geoms, :3] = 0.0

    def adapt(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Give each point the friction and the speed of the areas that it is on, once a control period."""
        places = data.geom_xpos[self._geoms]
        model.geom_friction[self._geoms, 0] = at_places(self._areas, "friction", places, self._usual)
        if self._moves:  # over a walkway a sole slides as one does whose own surface runs backwards
            speed = at_places(self._areas, "speed", places, 0.0)
            forward = data.geom_xmat[self._geoms, :3]  # the world's x in the frames of the points
            model.geom_surfacevel[self._geoms, :3] = -speed[:, None] * forward


class GivingFloor:
    """Springs and dampers of a floor under the points of all soles of a compiled model.

    MuJoCo's `discrete` integrator takes the inverse inertia Â in its own metric, in which the servos of the joints and
    the hinges of a sole count, too. `adapt` reads it from the rows of the contacts and corrects their parameters.
    """

    def __init__(self, model: mujoco.MjModel, feet: Iterable[FootParts], ground: Terrain) -> None:
        """Write the parameters into the model, by the inverse inertia that it has at rest.

        Raises an `InputError` for a floor that is too stiff for the step of the physics, with the step that could.
        """
        data, area = mujoco.MjData(model), np.zeros(model.ngeom)
        mujoco.mj_kinematics(model, data)
        for foot in feet:
            geoms = np.array([model.geom(name).id for name in foot.contact_geoms])
            sole = data.site(foot.wrench_site)
            points = (data.geom_xpos[geoms] - sole.xpos) @ sole.xmat.reshape(3, 3)
            area[geoms] = point_areas(points[:, :2], foot.fit.sole.length * foot.fit.sole.width)
        self._sole = area > 0.0
        self._own = np.flatnonzero(self._sole)
        self._area = area[self._own]
        self._floor = ground.floor_stiffness or 0.0, ground.own_damping
        self._areas, self._height = ground.surface_areas, ground.height
        self._rigid = model.geom_solref[self._own].copy(), model.geom_solimp[self._own, :2].copy()
        self._inverse = model.body_invweight0[model.geom_bodyid, 0]
        stiffness = max([self._floor[0], *(area.value for area in self._areas if area.name == "stiffness")])
        longest = 1.0 / math.sqrt(stiffness * float((area * self._inverse).max()))
        if model.opt.timestep > longest:
            raise InputError(
                f"a floor of {stiffness:.3g} N/m³ under these soles needs a physics step of {longest:.3g} s at most, "
                f"got {model.opt.timestep:g} s: shorten the step, or leave floor_stiffness out for a rigid floor"
            )
        model.opt.impratio = FRICTION_IMPEDANCE
        self._write(model, data.geom_xpos[self._own])
        self._new = self._inverse, model.geom_solref[self._own], model.geom_solimp[self._own, :2]

    def reset(self, model: mujoco.MjModel) -> None:
        """Write the parameters that a new model has."""
        self._inverse, model.geom_solref[self._own], model.geom_solimp[self._own, :2] = self._new

    def adapt(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Correct the parameters of the points that touch, by the rows of the step that has just been made.

        It is called once a control period. A row has the regularisation
        R = (1 − d)/d Â / (1 + h (b + h s)/d) with the step h.
        """
        contact, step = data.contact, model.opt.timestep
        one, other = contact.geom.T
        geoms, rows = np.where(self._sole[one], one, other), contact.efc_address
        touching = (rows >= 0) & (model.geom_solimp[geoms, 0] == IMPEDANCE)
        geoms, rows = geoms[touching], rows[touching]
        s, b = -model.geom_solref[geoms].T
        found = data.efc_R[rows] * (1.0 + step * (b + step * s) / IMPEDANCE) * (IMPEDANCE / (1.0 - IMPEDANCE))
        self._inverse = self._inverse.copy()  # a copy of the floor keeps its own
        self._inverse[geoms] = found
        self._write(model, data.geom_xpos[self._own])

    def depth(self, model: mujoco.MjModel, data: mujoco.MjData, weight: float) -> float:
        """Return how far soles that are where the data say must sink to bear a weight, N, at rest, m.

        A point that the sole has over the gap g to the floor bears K (depth − g), K = k A. The sum over the points that
        touch is the weight; among all sets of the nearest points these need the least depth. A sole with hinges sinks
        as one without, and stops where a point meets a rigid floor.
        """
        places = data.geom_xpos[self._own]
        gaps = places[:, 2] - model.geom_size[self._own, 0] - self._height(places[:, 0], places[:, 1])
        springs = self._area * at_places(self._areas, "stiffness", places, self._floor[0])
        gives = springs > 0.0
        order = np.flatnonzero(gives)[np.argsort(gaps[gives])]
        needed = (weight + np.cumsum(springs[order] * gaps[order])) / np.cumsum(springs[order])
        return float(np.concatenate([needed, gaps[~gives]]).min())

    def _write(self, model: mujoco.MjModel, places: Array) -> None:
        """Write the parameters of all points, which are at some places, shape (n, 3), m, into the model."""
        own, damping = self._floor
        k = at_places(self._areas, "stiffness", places, own)
        c = at_places(self._areas, "damping", places, np.where(k == own, damping, DAMPING_TIME * k))
        floor = -np.column_stack([k, c])
        # The integrator, which is implicit, damps a spring by its stiffness times the step.
        floor[:, 1] = np.minimum(floor[:, 1] - model.opt.timestep * floor[:, 0], 0.0)
        springs = (self._area * self._inverse[self._own])[:, None] * floor * (1.0 - IMPEDANCE)
        gives, (solref, solimp) = floor[:, :1] < 0.0, self._rigid
        model.geom_solref[self._own] = np.where(gives, springs, solref)
        model.geom_solimp[self._own, :2] = np.where(gives, IMPEDANCE, solimp)


def point_areas(points: Array, area: float) -> Array:
    """Return the area that each point of a sole stands for, shape (n,), m²: their sum is that of the sole.

    Points on a grid, shape (n, 2), m, are weighed by the trapezoidal rule, three equal columns by Simpson's rule, under
    which a sole also has the right stiffness about its axes; other points have equal shares.
    """
    (rows, row), (columns, column) = (_levels(points[:, axis]) for axis in range(2))
    if len(rows) * len(columns) != len(points):
        return np.full(len(points), area / len(points))
    weights = _rule(rows)[row] * _rule(columns)[column]
    return np.asarray(area * weights)


def _levels(values: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the different values, to a hundredth of a millimetre, and the number of each one."""
    places, which = np.unique(np.round(values, 5), return_inverse=True)
    return places, which.astype(np.intp)


def _rule(places: Array) -> Array:
    """Return weights of places by which a mean over their span is taken."""
    if len(places) == 1:
        return np.ones(1)
    gaps = np.diff(places)
    if len(places) == 3 and abs(gaps[0] - gaps[1]) < 1e-4:
        return np.array([1.0, 4.0, 1.0]) / 6.0
    weights = 0.5 * (np.append(gaps, 0.0) + np.insert(gaps, 0, 0.0))
    return np.asarray(weights / weights.sum())
