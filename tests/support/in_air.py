"""A robot in an engine of the tests: Pinocchio's forward dynamics, without any contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.sim import EngineContacts, EngineLoop, EnginePush


class InAir(EngineLoop):
    """A robot on which nothing acts but drives, pushes and gravity: Pinocchio's forward dynamics."""

    def __init__(self, description: Any, **options: Any) -> None:
        super().__init__(description, **options)
        self._other = self.robot.model.createData()
        self.reset()

    def place(self, q: np.ndarray) -> None:
        self._state = q, np.zeros(self.robot.nv)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self._state

    def advance(self, torque: np.ndarray, pushes: Sequence[EnginePush]) -> None:
        (q, v), model = self._state, self.robot.model
        tau = np.concatenate([np.zeros(6), torque])
        for link, force, point in pushes:
            pin.computeJointJacobians(model, self._other, q)
            frame = model.getFrameId(link)
            place = pin.updateFramePlacement(model, self._other, frame)
            jacobian = pin.getFrameJacobian(model, self._other, frame, pin.LOCAL_WORLD_ALIGNED)
            lever = place.rotation @ point
            tau += jacobian[:3].T @ force + jacobian[3:].T @ np.cross(lever, force)
        acceleration = pin.aba(model, self._other, q, v, tau)
        v = v + self.timestep * acceleration
        self._state = pin.integrate(model, q, self.timestep * v), v

    def contacts(self) -> EngineContacts:
        return EngineContacts([], [], [])
