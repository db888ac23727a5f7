"""Loads: masses that bodies of a robot carry for a while."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.robots.mechanism import placed, placement_of, principal

CHANGED = ("mass", "ipos", "iquat", "inertia", "subtreemass", "sameframe")
"""Arrays of the bodies of a model that loads change."""


@dataclass
class _Load:
    mass: float = 0.0  # now, kg
    target: float = 0.0  # at the end of the ramp, kg
    over: float = 0.0  # time of the ramp, s
    rate: float = 0.0  # kg/s


class Loads:
    """All loads of a plant; added mass has the velocity of its body from the first instant."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._loads: dict[tuple[int, tuple[float, ...]], _Load] = {}  # body, and point in it, m
        self._compiled: list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]] = []  # arrays, and copies

    @property
    def mass(self) -> float:
        """Mass of all loads now, kg."""
        return sum(load.mass for load in self._loads.values())

    def put(self, body: int, point: Array, mass: float, over: float) -> None:
        """Ramp the mass of a load, kg, at a point of a body, m, from what it is now over a time, s; 0 is at once.

        The same order again changes nothing.
        """
        load = self._loads.setdefault((body, tuple(point.tolist())), _Load())
        if (mass, over) != (load.target, load.over):
            load.target, load.over, load.rate = (
                mass,
                over,
                abs(mass - load.mass) / over if over > 0.0 else math.inf,
            )

    def clear(self) -> None:
        """Take all loads off; the model is then as it was compiled, bit for bit."""
        self._loads.clear()
        for values, copy in self._compiled:
            values[:] = copy

    def advance(self, time: float) -> None:
        """Change masses for the coming time, s."""
        if all(load.mass == load.target for load in self._loads.values()):
            return
        for load in self._loads.values():
            step = load.rate * time if load.mass != load.target else 0.0
            load.mass = min(max(load.target, load.mass - step), load.mass + step)
        model = self._model
        if not self._compiled:
            arrays = [getattr(model, f"body_{name}") for name in CHANGED]
            arrays += [model.geom_sameframe, model.site_sameframe]
            self._compiled = [(values, values.copy()) for values in arrays]
        for values, copy in self._compiled:
            values[:] = copy
        for body in {body for (body, _), load in self._loads.items() if load.mass > 0.0}:
            self._add(body)

    def _add(self, body: int) -> None:
        """Add the loads of a body to its inertia in the model."""
        model, kind = self._model, mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        axes = placement_of(model.body_ipos[body], model.body_iquat[body]).rotation
        about = axes @ np.diag(model.body_inertia[body]) @ axes.T
        total = pin.Inertia(float(model.body_mass[body]), model.body_ipos[body], about)
        for (carrier, point), load in self._loads.items():
            if carrier == body and load.mass > 0.0:
                total = total + pin.Inertia(load.mass, np.array(point), np.zeros((3, 3)))
        model.body_inertia[body], axes = principal(total.inertia)
        model.body_mass[body] = total.mass
        model.body_ipos[body], model.body_iquat[body] = placed(pin.SE3(axes, total.lever)).values()
        model.body_sameframe[body] = kind
        model.geom_sameframe[model.geom_bodyid == body] = kind
        model.site_sameframe[model.site_bodyid == body] = kind
        while body:  # sums of masses, for the centres of mass of subtrees
            below = model.body_parentid == body
            model.body_subtreemass[body] = model.body_mass[body] + model.body_subtreemass[below].sum()
            body = int(model.body_parentid[body])
        below = model.body_parentid == 0
        model.body_subtreemass[0] = model.body_subtreemass[below][1:].sum()
