"""Loads: masses that bodies of a robot carry for a while."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array


@dataclass
class _Load:
    """A point mass on a body."""

    body: int
    point: Array  # in the body, m
    mass: float  # now, kg
    target: float  # at the end of the ramp, kg
    rate: float  # kg/s


class Loads:
    """All loads of a plant; added mass has the velocity of its body from the first instant."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._loads: dict[tuple[int, tuple[float, ...]], _Load] = {}
        self._own: dict[int, tuple[pin.Inertia, Array, Array, Array]] = {}
        # What loads change in the model, and a copy of it.
        self._compiled: list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]] = []

    @property
    def changing(self) -> bool:
        """True while a mass changes."""
        return any(load.mass != load.target for load in self._loads.values())

    @property
    def mass(self) -> float:
        """Mass of all loads now, kg."""
        return sum(load.mass for load in self._loads.values())

    def put(self, body: int, point: Array, mass: float, over: float) -> None:
        """Ramp the mass of a load, kg, at a point of a body, m, from what it is now over a time, s; 0 is at once."""
        key = body, tuple(point.tolist())
        load = self._loads.setdefault(key, _Load(body, np.array(point), 0.0, 0.0, 0.0))
        load.target = mass
        load.rate = abs(mass - load.mass) / over if over > 0.0 else float("inf")

    def clear(self) -> None:
        """Take all loads off; the model is then as it was compiled, bit for bit."""
        self._loads.clear()
        self._own.clear()
        for values, copy in self._compiled:
            values[:] = copy

    def advance(self, time: float) -> None:
        """Change masses for the coming time, s."""
        bodies = set()
        for load in self._loads.values():
            if load.mass != load.target:
                step = load.rate * time
                load.mass = min(max(load.target, load.mass - step), load.mass + step)
                bodies.add(load.body)
        for body in bodies:
            self._write(body)

    def _write(self, body: int) -> None:
        """Write the inertia of a body and of its loads into the model."""
        model = self._model
        if not self._compiled:
            changed = [getattr(model, f"body_{name}") for name in ("mass", "ipos", "iquat", "inertia")]
            changed += [
                model.body_subtreemass,
                model.body_sameframe,
                model.geom_sameframe,
                model.site_sameframe,
            ]
            self._compiled = [(values, values.copy()) for values in changed]
        if body not in self._own:
            inertial = model.body_ipos, model.body_iquat, model.body_inertia
            place, turn, sizes = (values[body].copy() for values in inertial)
            w, x, y, z = turn
            rotation = pin.Quaternion(w, x, y, z).matrix()
            about = rotation @ np.diag(sizes) @ rotation.T
            self._own[body] = pin.Inertia(float(model.body_mass[body]), place, about), place, turn, sizes
        total, *written = self._own[body]
        mine = [each for each in self._loads.values() if each.body == body and each.mass > 0.0]
        if mine:
            for each in mine:
                total = total + pin.Inertia(each.mass, each.point, np.zeros((3, 3)))
            sizes, axes = np.linalg.eigh(total.inertia)
            if np.linalg.det(axes) < 0.0:
                axes[:, 0] *= -1.0
            x, y, z, w = pin.Quaternion(axes).coeffs()
            written = [total.lever, np.array((w, x, y, z)), sizes]
        model.body_mass[body] = total.mass
        model.body_ipos[body], model.body_iquat[body], model.body_inertia[body] = written
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.geom_sameframe[model.geom_bodyid == body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.site_sameframe[model.site_bodyid == body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE

        while True:  # sums of masses, for the centres of mass of subtrees
            below = model.body_parentid == body
            below[0] = False
            model.body_subtreemass[body] = model.body_mass[body] + model.body_subtreemass[below].sum()
            if body == 0:
                return
            body = int(model.body_parentid[body])
