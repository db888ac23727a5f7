"""Contacts that hold any wrench: of a frame with the world, and of two frames of a robot that close a chain.

The two frames are one place, as the ends of a rod and of the lever that it moves.
A robot's model is a tree; a chain that closes is opened at one joint, and the closure holds what that joint held.
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError
from wbc.base.numbers import Array, read_only
from wbc.core.frames import relative_drift, relative_jacobian
from wbc.core.qp.contact import NORMAL, USUAL_WEIGHTS, Contact, HeldFrame
from wbc.core.qp.motion import OPTIONS, RowNumbers
from wbc.core.qp.options import ContactOptions
from wbc.core.robot import GRAVITY, Robot

LEVER = 1.0
"""Length by which the moments of a frame that is gripped are bounded while its forces grow, m."""

SAMPLES = 12
"""Number of postures around the present one in which the directions are looked for that the chain leaves free."""

SPREAD = 0.3
"""Largest change of a joint in these postures, rad or m."""

FREE = 1e-6
"""Share of the greatest motion of the two ends against each other below which there is none in a direction."""


class FixedContact(HeldFrame):
    """Contact of a frame that is fixed to the world and holds any wrench: a bolted base, a gantry, a gripped rail.

    Its wrench is along the axes of the frame, and no friction cone bounds it. Its cost is 10⁻⁸ per N² and (Nm)² by
    default. `max_force` bounds the force along the z axis in both directions, 10⁶ N by default. All six components have
    bounds while the contact is being switched on or off.
    """

    ranged = (0, 1, 2, 3, 4, 5)
    usual = {"max_force": 1e6, "wrench_weight": 1e-8}

    @checked
    def __init__(self, frame: str, **options: Unpack[ContactOptions]) -> None:
        """Describe the contact of a frame, which stays where it is when the contact is added."""
        super().__init__(frame, frame, np.zeros((0, 6)), **options)

    def force_ranges(self) -> tuple[Array, Array]:
        """Return the smallest and largest values of the force variables allowed now, each of shape (6,), N and Nm."""
        if self._active and self._load == 1.0:
            high = np.full(self.dim, np.inf)
            high[NORMAL] = self.max_force
        else:
            high = self._load * self._greatest()
        return -high, high

    def _greatest(self) -> Array:
        """Forces of which the load is a share, shape (6,), N and Nm; see `Contact`."""
        if self._carried is not None:
            return self._carried
        assert self.max_force is not None
        most = min(self.max_force, USUAL_WEIGHTS * self.robot.mass * GRAVITY)
        return most * np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])


class LoopClosure(Contact):
    """Closure of a kinematic chain: two frames of the robot stay at one point, and in one orientation if asked for.

    It is a contact between two parts of the robot. Its wrench is that of the second frame on the first one, along the
    axes of the first frame; the opposite wrench acts on the second frame. It costs 10⁻⁸ per N² and (Nm)².

    In some directions the chain cannot open, for example out of the plane of a four-bar linkage. There the force is
    undetermined, so the closure has no row. `directions` are the directions of the rows, and `dim` their number, once
    the closure is bound.

    Attributes:
        directions: Directions of the rows, [linear; angular] in the axes of the first frame, shape (dim, 3 or 6).
    """

    other: str = fixed(OPTIONS)
    rotation: bool = fixed(OPTIONS)
    ranged = ()
    usual = {"wrench_weight": 1e-8, "stiffness": 400.0, "rate": 20.0}
    dim = 6
    _with_world = False

    @checked
    def __init__(
        self,
        frame: str,
        other: str,
        *,
        rotation: bool = True,
        name: str | None = None,
        **options: Unpack[ContactOptions],
    ) -> None:
        """Describe the closure.

        Args:
            frame: Frame on one side of the place where the chain closes.
            other: Another frame, on the other side, at the same place, and with the same axes if `rotation`.
            rotation: False if only the points stay together, as in a ball joint or at the end of a rod.
            name: Name; the names of the two frames when None.
            **options: See `ContactOptions`; those of the normal force have no effect.
        """
        if frame == other:
            raise InputError(f"a closure ties two frames, got '{frame}' twice")
        self.other, self.rotation = other, rotation
        self.dim = 6 if rotation else 3
        self.directions = read_only(np.eye(self.dim))
        # What takes a linear and an angular vector of the world to the rows, each of shape (dim, 3).
        self._turn, self._turn_spin = np.zeros((0, 3)), np.zeros((0, 3)) if rotation else None
        super().__init__(name or f"{frame} to {other}", frame, np.zeros((0, self.dim)), **options)

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the frames, and find the directions in which the chain could open."""
        self._other_id = robot.frame_id(self.other)
        self._resize(_directions(robot, robot.frame_id(self.frame), self._other_id, self.rotation))
        if not self.dim:
            raise InputError(
                f"closure '{self.name}': no joint moves '{self.frame}' against '{self.other}', which are one body"
            )
        super().bind(robot)
        self._there = robot.data.oMf[self._other_id]

    def _resize(self, directions: Array) -> None:
        """Take other directions over, with the gains and weights that were given for them."""
        numbers = np.vstack([self._numbers.values, self._wrench_weight])
        same = np.abs(directions.dot(self.directions.T)) > 1.0 - FREE  # rows along rows that were there
        if (numbers == numbers[:, :1]).all():
            kept = np.zeros(len(directions), dtype=np.intp)
        elif same.any(axis=1).all():
            kept = same.argmax(axis=1)
        else:
            raise InputError(
                f"gains and weights of closure '{self.name}' must be scalars: its chain opens in directions that are "
                f"not along the axes of '{self.frame}'"
            )
        self.dim, self.directions = len(directions), read_only(directions)
        self._lines, self._spins = (np.ascontiguousarray(part) for part in np.hsplit(directions, [3]))
        self._numbers, self._wrench_weight = RowNumbers(numbers[:-1, kept]), numbers[-1, kept]
        self.cone = np.zeros((0, self.dim))
        self.revision += 1

    def force_ranges(self) -> tuple[float, float]:
        """Return minus and plus infinity: no force of a closure has a range."""
        return -np.inf, np.inf

    def gap(self) -> tuple[float, float]:
        """Return the distance of the two frames, m, and their angle, rad, which is 0 without `rotation`."""
        _ = self.robot
        apart = self._placement.actInv(self._there)
        return float(np.linalg.norm(apart.translation)), float(
            np.linalg.norm(pin.log3(apart.rotation)) if self.rotation else 0.0
        )

    def sizes(self, rows: Array) -> list[tuple[str, Any, float]]:
        """Return units, places, and distance and angle of the two frames now, whatever the rows are."""
        distance, angle = self.gap()
        return [("m", ..., distance), ("rad", ..., angle)]

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the motion rows; see `Motion.measure`.

        With r from the first frame to the second and R the axes of the first, the error is Rᵀ r, whose change is
        Rᵀ (v₂ − v₁ − ω₁ × r): the velocity of the second point against the first body, so that the two forces are
        opposite at one point and give the robot no momentum, closed or not.
        """
        back = self._placement.rotation.T
        self._turn = turn = self._lines.dot(back)
        rows = relative_jacobian(self._model, self._data, self._other_id, self._id)
        error[:] = turn.dot(self._there.translation - self._placement.translation)
        np.negative(turn.dot(rows[:3]), out=jacobian)
        if self.rotation:
            self._turn_spin = turn_spin = self._spins.dot(back)
            error += self._spins.dot(pin.log3(back.dot(self._there.rotation)))
            jacobian -= turn_spin.dot(rows[3:])

    def drift(self) -> Array:
        """Return the acceleration of the first end against the second, shape (dim,); see `Motion.drift`."""
        linear, angular = relative_drift(self._model, self._data, self._other_id, self._id)
        drift: Array = -self._turn.dot(linear)
        if self._turn_spin is not None:
            drift -= self._turn_spin.dot(angular)
        return drift


def _directions(robot: Robot, frame: int, other: int, rotation: bool) -> Array:
    """Return the directions in the axes of a frame in which joints move it against another one, shape (dim, 3 or 6)."""
    model, data = robot.model, robot.model.createData()
    random, size = np.random.default_rng(0), 6 if rotation else 3
    total = np.zeros((size, size))
    for _ in range(SAMPLES):
        q = np.array(robot.q)
        q[robot.base_nq :] += random.uniform(-SPREAD, SPREAD, robot.na)
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        rows = relative_jacobian(model, data, other, frame).reshape(2, 3, -1)[: 2 if rotation else 1]
        rows = (data.oMf[frame].rotation.T @ rows).reshape(size, -1)
        total += rows @ rows.T
    sizes, axes = np.linalg.eigh(total)
    kept = sizes > FREE**2 * max(float(sizes[-1]), np.finfo(float).tiny)
    if kept.all():
        return np.eye(size)
    found = axes[:, kept].T
    # Along the axes of the frame where they can be: easier to read.
    aligned = np.abs(found.T @ found - np.diag(np.diag(found.T @ found))).max() < FREE
    if aligned:
        return np.asarray(np.eye(size)[np.diag(found.T @ found) > 0.5])
    return np.asarray(found)
