"""Feet of a plant: the soles that they replace, descriptions with other feet, stiffness actuators and range sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError, ModelError
from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import Robot
from wbc.feet import Foot, FootParts, RangeSensor, SoftFoot
from wbc.feet.soles.foot import AnkleSole
from wbc.feet.soles.runtime_mjcf import RangeFinder, SoleStiffness
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.robots.description import RobotDescription
from wbc.robots.frames import carrier
from wbc.robots.registry import as_description
from wbc.sim.terrain.render import TERRAIN_GROUP


def ankle_soles(robot: Robot) -> tuple[AnkleSole, ...]:
    """Return the robot's own soles as input for fitting feet, left first; `ModelError` for one on the floating base."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    places = [data.oMf[robot.frame_id(sole.frame)] for sole in robot.soles]
    spacing = float(abs((places[0].actInv(places[-1])).translation[1])) if len(places) > 1 else None
    soles = []
    for sole in robot.soles:
        frame = robot.model.frames[robot.frame_id(sole.frame)]
        if frame.parentJoint < 2:
            raise ModelError(
                f"sole '{sole.name}' must be on a leg, its frame '{sole.frame}' is on the floating base"
            )
        link, place = carrier(robot.model, sole.frame)
        soles.append(
            AnkleSole(
                link,
                tuple(place.translation.tolist()),
                tuple(pin.Quaternion(place.rotation).normalized().coeffs().tolist()),
                sole.length,
                sole.width,
                spacing=spacing,
            )
        )
    return tuple(soles)


@checked
def with_feet(description: RobotDescription | str, foot: Foot, *, mass: bool = False) -> RobotDescription:
    """Return the description of a robot with other feet, for its controller.

    Contacts, observer and force sensors then use the same place and size of each sole.

    Args:
        description: The robot with its own soles, or its name.
        foot: Foot under both ankles.
        mass: Add mass and inertia of the feet in their rest shape. Otherwise the controller does not know them, as in
            the paper. The plant needs a description without them, since it builds the feet itself.
    """
    description = as_description(description)
    robot = description.robot()
    soles, inertias = [], dict(description.foot_inertia)
    for sole, geometry in zip(description.soles, ankle_soles(robot), strict=True):
        fit = foot.fit(geometry)
        if mass and fit.added_inertia.mass > 0.0:
            own = tuple(fit.added_inertia.toDynamicParameters().tolist())
            has = inertias.setdefault(sole.name, own)
            if not np.allclose(has, own, rtol=0.0, atol=ROUNDING):
                raise InputError(
                    f"the description wears other feet already: '{sole.name}' has a foot of {has[0]:g} kg in place of "
                    f"one of {own[0]:g} kg, or of another shape; give the description of the robot with its own soles"
                )
        fitted = fit.sole
        place: dict[str, Any] = {}
        if not fitted.placement.isApprox(geometry.placement, ROUNDING):
            place = {
                "frame": f"{sole.name}_fitted",
                "link": description.attachment(sole.frame)[0],
                "translation": fitted.translation,
                "rpy": tuple(pin.rpy.matrixToRpy(fitted.rotation_matrix).tolist()),
            }
        soles.append(replace(sole, length=fitted.length, width=fitted.width, **place))
    if tuple(soles) == description.soles and inertias == description.foot_inertia:
        return description
    return replace(description, soles=(soles[0], soles[1]), foot_inertia=inertias)


class FootDevices:
    """Stiffness actuator and range sensor of every sole, left first."""

    def __init__(
        self, model: mujoco.MjModel, feet: Sequence[FootParts], foot: Foot, range_sensor: RangeSensor | None
    ) -> None:

        self._model, self._feet, self._range_sensor = model, feet, range_sensor
        actuator = foot.actuator if isinstance(foot, VariableStiffnessFoot) else None
        damping = foot.damping_at if isinstance(foot, SoftFoot) and foot.damping_ratio is not None else None
        self._variable = actuator is not None
        self._soles = [
            SoleStiffness(model, built, actuator, damping) for built in feet if built.variable_joints
        ]
        self._none = np.full(len(feet), np.nan)
        self._none.setflags(write=False)
        self._ranges: list[RangeFinder] = []

    def reset(self, seeds: list[int]) -> None:
        """Restore the stiffness at the start and restart the range sensors, each with the seed of its errors."""
        for sole in self._soles:
            sole.reset()
        if self._range_sensor is not None:
            sensor = self._range_sensor
            self._ranges = [
                RangeFinder(self._model, foot, ground_group=TERRAIN_GROUP, sensor=sensor, seed=seed)
                for foot, seed in zip(self._feet, seeds, strict=True)
            ]

    def check(self, command: Array | None) -> None:
        """Check a stiffness command, shape (number of soles,), Nm/rad; nothing changes."""
        if command is None:
            return
        if not self._variable:
            raise InputError(
                "command: the soles of this plant have a fixed stiffness; choose foot='variable' to command it"
            )
        if np.shape(command) != self._none.shape:
            raise InputError(
                f"command: sole_stiffness must have shape {self._none.shape}, got {np.shape(command)}"
            )
        for sole, stiffness in zip(self._soles, command, strict=True):
            sole.actuator.check(stiffness)

    def advance(self, command: Array | None, duration: float) -> bool:
        """Advance the stiffness actuators by a time, s, under a checked command, or the last; True for a change."""
        changed = False
        for i, sole in enumerate(self._soles if self._variable else ()):
            before = sole.actual
            commanded = sole.state.commanded if command is None else float(command[i])
            changed |= sole.step(commanded, duration) != before
        return changed

    def stiffness(self) -> Array:
        """Return the actual stiffness of each sole, shape (number of soles,), Nm/rad; NaN for a rigid one."""
        return np.array([sole.actual for sole in self._soles]) if self._soles else self._none

    def ranges(self, data: mujoco.MjData) -> Array:
        """Return the reading of each range sensor, shape (number of soles,), m; NaN without a sensor or an echo."""
        if not self._ranges:
            return self._none
        return np.array([finder.read(self._model, data) for finder in self._ranges])
