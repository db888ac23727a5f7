"""A sole on ground of unknown shape: it holds a place and carries a force there, as far as the ground lets it."""

from __future__ import annotations

import math
from typing import Annotated, Unpack

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.errors import Array, finite_array, finite_scalar
from wbc.core.qp.contact import Contact, ContactOptions, friction_pyramid
from wbc.core.robot import Robot
from wbc.core.settings import Positive
from wbc.core.vectors import add_cross

HOLD = (1000.0, 1000.0, 1000.0, 3.0, 3.0, 3.0)
"""Default cost of a foothold's motion: its centre stays, while the sole may turn about it, as on a stone."""

UPRIGHT = 1e-3
"""Length of the level part of a sole's x axis below which it has no heading: the sole stands on end."""


class Foothold(Contact):
    """A sole that stands on a point, a line or an area that nobody knows.

    Its motion is a cost, so that it can make no QP infeasible. The centre of pressure stays within a small box around
    the centre of the foothold, and a yaw moment within a torsional friction.

    Wrench and motion are those of the foothold's centre. Forces are in level axes, x along the sole: how a sole tilts
    on a stone does not tell the normal of the ground. Moments are in the axes of the sole, whose edges bound them.

    Cost 10⁻⁵ per N² of shear, 10⁻⁶ per N² of normal force and 10⁻³ per (Nm)² by default, damping 12 1/s, no stiffness.
    """

    dim = 6

    @checked
    def __init__(
        self,
        sole: str,
        *,
        friction: Positive = 0.5,
        torsion: Annotated[Positive, "m"] = 0.03,
        **options: Unpack[ContactOptions],
    ) -> None:
        """Describe the contact: the whole sole, until `set_box` says otherwise.

        Args:
            sole: Name of one of the robot's soles, or its frame.
            friction: Coulomb coefficient of the friction pyramid.
            torsion: Greatest yaw moment over the normal force, m.
            **options: See `ContactOptions`; `motion_weight` is `HOLD` unless given.

        Raises:
            UnknownNameError: An unknown option.
            InputError: A value out of range.
        """
        self._friction, self._torsion = friction, torsion
        self._half = (0.0, 0.0)  # of the box
        self._centre = np.zeros(3)
        self._change = np.eye(6)  # from the sole's origin in world axes to the centre in its axes
        weight = (1e-5, 1e-5, 1e-6, 1e-3, 1e-3, 1e-3)
        chosen: ContactOptions = {
            "wrench_weight": weight,
            "motion_weight": HOLD,
            "stiffness": 0.0,
            "damping": 12.0,
            "ramp": 0.0,
            **options,
        }
        super().__init__(sole, sole, np.zeros((10, 6)), **chosen)

    def bind(self, robot: Robot) -> None:
        """Take frame and size from the robot's sole.

        Raises:
            UnknownNameError: The robot has no such sole.
        """
        sole = robot.sole(self.name)
        self.name, self.frame = sole.name, sole.frame
        if not any(self._half):
            self._half = (0.5 * sole.length, 0.5 * sole.width)
        self._make_cone()
        super().bind(robot)

    @property
    def centre(self) -> Array:
        """Centre of the foothold in the sole frame, shape (3,), m."""
        return self._centre.copy()

    def set_box(self, length: float, width: float, centre: tuple[float, float] = (0.0, 0.0)) -> None:
        """Bound the centre of pressure to a box, m.

        Args:
            length: Extent along the sole, m.
            width: Extent across it, m.
            centre: Centre of the box in the sole frame, m; wrench and motion are those of this point.

        Raises:
            InputError: A size that is not above zero, a centre that is not finite.
        """
        self._half = (
            0.5 * finite_scalar(f"length of contact '{self.name}' (m)", length, low=0.0, open_low=True),
            0.5 * finite_scalar(f"width of contact '{self.name}' (m)", width, low=0.0, open_low=True),
        )
        self._centre[:2] = finite_array(f"centre of contact '{self.name}' (m)", centre, (2,))
        self._make_cone()

    def _make_cone(self) -> None:
        length, width = self._half
        self.cone[:4, :3] = friction_pyramid(self._friction)
        self.cone[4:, 2] = [-width, -width, -length, -length, -self._torsion, -self._torsion]
        for i, axis in enumerate(
            (3, 4, 5)
        ):  # |m_x| ≤ half width · f_z, |m_y| ≤ half length · f_z, |m_z| ≤ torsion · f_z
            self.cone[4 + 2 * i : 6 + 2 * i, axis] = [1.0, -1.0]
        self.revision += 1

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the motion rows of the centre: linear in the level axes, angular in those of the sole."""
        model, data, world = self._model, self._data, pin.LOCAL_WORLD_ALIGNED
        rotation, change = self._placement.rotation, self._change
        (a, b, _), (c, d, _), (e, f, _) = rotation.tolist()
        x, y, _ = self._centre.tolist()
        arm = px, py, pz = a * x + b * y, c * x + d * y, e * x + f * y
        level = math.hypot(a, c)
        cos, sin = (a / level, c / level) if level > UPRIGHT else (1.0, 0.0)
        change[0, 0] = change[1, 1] = cos
        change[0, 1], change[1, 0] = sin, -sin
        # Rows of [level axes] · (linear + angular × arm).
        change[:3, 3:] = (
            (-sin * pz, cos * pz, sin * px - cos * py),
            (-cos * pz, -sin * pz, sin * py + cos * px),
            (py, -px, 0.0),
        )
        change[3:, 3:] = rotation.T
        jacobian[:] = change.dot(pin.getFrameJacobian(model, data, self._id, world))
        spin = pin.getFrameVelocity(model, data, self._id, world).angular.tolist()
        bend = add_cross((0.0, 0.0, 0.0), spin, add_cross((0.0, 0.0, 0.0), spin, arm))
        acceleration = pin.getFrameClassicalAcceleration(model, data, self._id, world).vector
        acceleration[:3] += bend
        np.dot(change, acceleration, out=drift)
        error[:] = 0.0
        if self.stiffness > 0.0:
            target = self._target
            error[:3] = change[:3, :3].dot(target.act(self._centre) - self._placement.act(self._centre))
            error[3:] = pin.log3(rotation.T.dot(target.rotation))
