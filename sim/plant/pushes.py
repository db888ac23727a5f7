"""Pushes and loads: external forces on the robot's bodies, and masses that they carry for a while."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.numbers import Array, finite_array, positive

_OVER = 1e-12
"""Remaining time at which a push is over, s."""


@dataclass
class Push:
    """A constant force on a body for a limited time."""

    body: int
    force: Array  # in the world, N
    point: Array | None  # of attack in the body, m; None for its centre of mass
    remaining: float  # s

    @staticmethod
    def at(body: int, frame: pin.SE3, force: ArrayLike, duration: float, point: ArrayLike | None) -> Push:
        """Return a push at a point of a frame of a body, m; at the centre of mass of the body when None."""
        attack = None if point is None else finite_array("point of attack (m)", point, (3,))
        return Push(
            body,
            finite_array("force of the push (N)", force, (3,)),
            None if attack is None else frame.act(attack),
            positive("duration of the push (s)", duration),
        )


class Pushes:
    """All pushes that act now; any number at a time, also on one body."""

    def __init__(self) -> None:
        self._active: list[Push] = []
        self._applied: dict[int, Array] = {}  # body → its part of the forces in MuJoCo's data, shape (6,)

    def __bool__(self) -> bool:
        """True while `apply` is needed: to set forces, or to remove the last ones."""
        return bool(self._applied) or bool(self._active)

    def add(self, push: Push) -> None:
        """Begin a push with the next physics step."""
        self._active.append(push)

    def clear(self, data: mujoco.MjData) -> None:
        """Stop all pushes."""
        self._active.clear()
        self._release(data)

    def apply(self, data: mujoco.MjData, timestep: float) -> None:
        """Set the forces of the coming physics step, s; positions are up to date.

        A push that ends within the step acts with the share of its force that gives the same impulse.
        """
        self._release(data)
        for push in self._active:
            wrench = self._applied.setdefault(push.body, np.zeros(6))
            force = min(1.0, push.remaining / timestep) * push.force
            wrench[:3] += force
            if push.point is not None:
                rotation = data.xmat[push.body].reshape(3, 3)
                arm = data.xpos[push.body] + rotation @ push.point - data.xipos[push.body]
                wrench[3:] += np.cross(arm, force)
            push.remaining -= timestep
        for body, wrench in self._applied.items():
            data.xfrc_applied[body] += wrench
        self._active = [push for push in self._active if push.remaining > _OVER]

    def _release(self, data: mujoco.MjData) -> None:
        """Remove the forces of the last step; those that others set stay."""
        for body, wrench in self._applied.items():
            data.xfrc_applied[body] -= wrench
        self._applied.clear()


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
