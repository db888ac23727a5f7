"""Contacts: motion constraints of a frame, and the wrenches that it may transmit.

Each contact has as many force variables as motion rows: "this frame does not accelerate" while it holds its frame, and
"this force is zero" while it is inactive. Switching a contact therefore never changes the size of the QP.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, choose, shown
from wbc.base.numbers import ROUNDING, Array, finite_array, one_or_each, read_only
from wbc.base.settings import NonNegative, Positive
from wbc.base.vectors import add_cross, largest
from wbc.core.frames import FixedPose, frame_jacobian, pose, unit_vector
from wbc.core.friction import box_wrench_cone, friction_pyramid, rectangle_wrench_cone
from wbc.core.qp.motion import OPTIONS, RATE, Motion
from wbc.core.qp.options import ContactOptions
from wbc.core.robot import GRAVITY, Reads, Robot

LEAST_FORCE = 10.0
"""Normal force that a sole in contact carries at least by default, N: without load its CoP means nothing."""

FIRMEST = 1e6
"""Greatest motion weight: the motion is 1e-5 m/s² off a constraint's there; at ten times as much it is m/s² off."""

USUAL_WEIGHTS = 4.0
"""Greatest normal force of a contact that is given none, over the weight of the robot."""

LEAST_CARRIED = 0.01
"""Force from which a contact unloads at least, over the weight of the robot."""

NORMAL = 2
"""Place of the normal force among the force variables."""

UPRIGHT = 1e-3
"""Length of the level part of a sole's x axis below which it has no heading: the sole stands on end."""


USUAL: ContactOptions = {
    "min_force": 0.0,
    "max_force": None,
    "ramp": 0.1,
    "stiffness": 100.0,
    "damping": None,
    "rate": RATE,
    "wrench_weight": 1e-5,
    "active": True,
    "motion_weight": None,
}
"""Options of contacts where neither the user nor the class has others."""


class Contact(Motion):
    """Base of contacts.

    Attributes:
        frame: Frame of the robot that is in contact, read-only.
        dim: Number of motion rows and of force variables.
        ranged: Places of the force variables that have a range: the normal force alone, or all.
        usual: Options of the contacts of a class where none are given.
        reads: State of the robot that the rows need in inverse kinematics; see `Task`.
        revision: Number that changes with the cone, the range of the normal force, gains and weights.

    The options of `ContactOptions` and the friction are attributes, too; assign them at any time, `motion_weight` where
    the contact was made with one.

    A contact of one's own has `dim`, calls this constructor with its cone, and fills its motion rows in `evaluate`,
    from `robot`, `frame_id`, `placement` and `target`; `wbc.tasks.check_rows` compares them with finite differences.
    """

    _kind = "contact"
    frame: str = result("_frame", OPTIONS)
    reads: ClassVar[Reads] = "kinematics"
    ranged: ClassVar[tuple[int, ...]] = (NORMAL,)
    usual: ClassVar[ContactOptions] = {}
    _with_world: ClassVar[bool] = True
    _cone: Array

    @checked
    def __init__(self, name: str, frame: str, cone: Array, **options: Unpack[ContactOptions]) -> None:
        """Describe the contact by the attributes above; a cone of shape (0, dim) lets it transmit any force."""
        for option in options:
            choose(f"option of contact '{name}'", option, ContactOptions.__annotations__)
        given: ContactOptions = {**USUAL, **self.usual, **options}
        super().__init__(name, given["stiffness"], given["damping"])
        self._frame, self.cone = frame, cone
        self.rate, self.wrench_weight, self._ramp = given["rate"], given["wrench_weight"], given["ramp"]
        self.bear(options.get("min_force"), options.get("max_force"))
        self._yields = given["motion_weight"] is not None
        self.motion_weight = given["motion_weight"]
        self._active = bool(given["active"])
        self._load = 1.0 if self._active else 0.0  # share of the greatest forces that is allowed now
        self._carried: Array | None = None  # greatest forces of one that unloads, shape (dim,), N and Nm

    @property
    def cone(self) -> Array:
        """Matrix F with F f ≤ 0, shape (rows, dim), read-only; a controller fixes the number of rows of another one."""
        return read_only(self._cone)

    @cone.setter
    def cone(self, value: ArrayLike) -> None:
        what = f"cone of contact '{self.name}'"
        cone = finite_array(what, value)
        rows = "rows" if self.owner is None else len(self._cone)
        if cone.ndim != 2 or cone.shape[1] != self.dim or rows not in ("rows", len(cone)):
            raise InputError(f"{what} must have shape ({rows}, {self.dim}), got {cone.shape}")
        self._cone = cone
        self.revision += 1

    @property
    def friction(self) -> float:
        """Coulomb coefficient; a contact without a friction cone has none, and refuses one."""
        return self._friction

    @friction.setter
    @checked
    def friction(self, value: Positive) -> None:
        if not hasattr(self, "_friction"):
            raise InputError(f"contact '{self.name}' of class {type(self).__name__} has no friction")
        self._friction = value
        self.update_cone()

    @property
    def min_force(self) -> float | None:
        """Smallest normal force while active, N; assign None for the usual one, which is None before it is added."""
        return self._given_least if self._robot is None else self._min_force

    @min_force.setter
    @checked
    def min_force(self, value: Annotated[NonNegative, "N"] | None) -> None:
        usual = self._given_least is None and value == self.min_force
        self.bear(None if usual else value, self._max_force)

    @property
    def max_force(self) -> float | None:
        """Greatest normal force, N; assign None for the usual one, which is None before the contact is added."""
        return self._usual_greatest() if self._max_force is None else self._max_force

    @max_force.setter
    @checked
    def max_force(self, value: Annotated[Positive, "N"] | None) -> None:
        usual = self._max_force is None and value == self.max_force
        self.bear(self._given_least, None if usual else value)

    @property
    def ramp(self) -> float:
        """Time in which the force grows or decays when the contact is switched, s."""
        return self._ramp

    @ramp.setter
    @checked
    def ramp(self, value: Annotated[NonNegative, "s"]) -> None:
        self._ramp = value

    @property
    def wrench_weight(self) -> Array:
        """Cost per N² and (Nm)² of the force variables, shape (dim,), read-only; assign a scalar or an array."""
        return read_only(self._wrench_weight)

    @wrench_weight.setter
    def wrench_weight(self, value: ArrayLike) -> None:
        self._wrench_weight = self._checked_gain("wrench weight", value, above=0.0)
        self.revision += 1

    @property
    def motion_weight(self) -> Array | None:
        """Cost of the contact's motion, shape (dim,), read-only; None where its motion is a constraint."""
        return read_only(self._numbers.weight) if self._yields else None

    @motion_weight.setter
    def motion_weight(self, value: ArrayLike | None) -> None:
        if (value is not None) != self._yields:
            raise InputError(
                f"whether the motion of contact '{self.name}' is a constraint or a cost is fixed: give motion_weight "
                "when the contact is made"
            )
        if value is not None:
            self._numbers.weight[:] = self._checked_gain("motion weight", value, high=FIRMEST)
            self.revision += 1

    @property
    def active(self) -> bool:
        """True while the contact is switched on. Assigning it starts the force ramp."""
        return self._active

    @active.setter
    def active(self, value: bool) -> None:
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"active of contact '{self.name}' must be true or false, got {shown(value)}")
        if value == self._active:
            return
        self._active = bool(value)
        if not value:
            self._carried = self._carried_now()
            self._set_load(0.0 if self.ramp == 0.0 else self._load)
        elif self._load == 0.0:
            self._set_load(0.0 if self.ramp > 0.0 else 1.0)
            if self._robot is not None:
                self.hold()
        elif self._carried is not None:  # loaded again: from the forces that are allowed now
            allowed, self._carried = self._load * self._carried, None
            self._set_load(min(1.0, float((allowed / self._greatest()).max())))

    @property
    def engaged(self) -> bool:
        """True while the contact holds its frame: active, or still unloading."""
        return self._active or self._load > 0.0

    def bind(self, robot: Robot) -> None:
        """Resolve the frame, and take its present placement as that of the contact."""
        super().bind(robot)
        self._model, self._data = robot.model, robot.data
        self._id = robot.frame_id(self._frame)
        if self._with_world and robot.model.frames[self._id].parentJoint == 0:
            raise InputError(
                f"contact '{self.name}': frame '{self.frame}' is bolted to the world, and needs no contact"
            )
        self._placement = robot.data.oMf[self._id]
        self.bear(self._given_least, self._max_force)
        self.hold()

    @property
    def frame_id(self) -> int:
        """Number of the frame in the robot's model."""
        _ = self.robot
        return self._id

    @property
    def placement(self) -> pin.SE3:
        """Placement of the frame in the world, a view that changes with the robot."""
        _ = self.robot
        return self._placement

    def reset(self) -> None:
        """Take the present placement of the frame as the place of the contact, and end the force ramp."""
        _ = self.robot
        self._set_load(1.0 if self._active else 0.0)
        self.hold()

    def hold(self) -> None:
        """Take the present placement of the frame as the place of the contact, at rest."""
        self._target = pin.SE3(self._placement)
        self._numbers.velocity[:] = 0.0

    @property
    def target(self) -> pin.SE3:
        """Placement of the held frame in the world, read-only; assign it, with `velocity`, to move a loaded foot."""
        _ = self.robot
        return FixedPose(self._target)

    @target.setter
    def target(self, value: pin.SE3) -> None:
        _ = self.robot
        self._target = pose(f"target of contact '{self.name}'", value)

    @property
    def velocity(self) -> Array:
        """Velocity at which the held frame should move, in the contact frame, shape (dim,), m/s, rad/s; read-only."""
        return read_only(self._numbers.velocity)

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._numbers.velocity[:] = finite_array(f"velocity of contact '{self.name}'", value, (self.dim,))
        self._fed = True

    def follow(self, target: pin.SE3, velocity: Array) -> None:
        """Set `target`, not copied, and `velocity`, shape (dim,), for one tick; without a check, for the tick."""
        self._target, self._fed = target, True
        self._numbers.velocity[:] = velocity

    def advance(self, dt: float) -> None:
        """Advance the force ramp by one control period, s."""
        goal = 1.0 if self._active else 0.0
        if self._load != goal:
            step = dt / self.ramp if self.ramp > 0.0 else 1.0
            self._set_load(min(goal, self._load + step) if self._active else max(goal, self._load - step))

    def force_ranges(self) -> tuple[Array | float, Array | float]:
        """Return the least and the greatest values of the `ranged` force variables that are allowed now, N and Nm.

        They are numbers, those of the normal force, or arrays of shape (n,).
        """
        high = self._load * float(self._greatest()[NORMAL])
        return min(self._min_force, 0.5 * high), high

    def _greatest(self) -> Array:
        """Forces of which the load is a share, shape (dim,), N and Nm: the greatest ones, or those carried before."""
        assert self.max_force is not None
        if self._carried is None:
            return np.full(self.dim, self.max_force)
        return np.minimum(self._carried, self.max_force)

    def _carried_now(self) -> Array | None:
        """Return the forces from which a contact that is switched off unloads, shape (dim,); None where unknown."""
        wrenches: dict[str, Array] = getattr(getattr(self.owner, "solution", None), "wrenches", {})
        force = wrenches.get(self.name)
        if force is None or force.shape != (self.dim,) or self._load == 0.0:
            return None
        # Zero would make every row of the cone active at once.
        least = max(self._min_force, LEAST_CARRIED * self.robot.mass * GRAVITY)
        return np.asarray(np.maximum(abs(force), least) / self._load)

    def update_cone(self) -> None:  # noqa: B027 (optional)
        """Write `cone` anew and raise `revision`, as after a change of friction; that of the constructor stays here."""

    def bear(self, least: float | None, most: float | None) -> None:
        """Set `min_force` and `max_force` together, N, in a tick too; None for the usual ones.

        Their types and signs are not checked. Raises `InputError` if the greatest does not exceed the least.
        """
        low, high = least, self.usual.get("max_force") if most is None else most
        if low is None:  # that of a sole is less on a light robot
            low = self.usual.get("min_force", 0.0) * (1.0 if self._robot is None else self._robot.force_scale)
        greatest = self._usual_greatest() if high is None else high
        if greatest is not None and greatest <= low:
            raise InputError(
                f"greatest force of contact '{self.name}' must exceed the smallest: {greatest} ≤ {low} N"
            )
        self._given_least, self._min_force, self._max_force = least, low, high
        self.revision += 1

    def _usual_greatest(self) -> float | None:
        """Return the greatest normal force where none is given, N; None before the robot is known."""
        return None if self._robot is None else USUAL_WEIGHTS * self._robot.mass * GRAVITY

    def _set_load(self, load: float) -> None:
        self._load = load
        if load == 0.0:
            self._numbers.velocity[:] = 0.0
        if self._active or load == 0.0:
            self._carried = None
        self.revision += 1

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', frame='{self.frame}', active={self.active})"


class HeldFrame(Contact):
    """Base of contacts that hold position and orientation of a frame; force and moment are in its axes."""

    dim = 6

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the motion rows in the axes of the frame; see `Motion.measure`."""
        jacobian[:] = frame_jacobian(self._model, self._data, self._id, pin.LOCAL)
        error[:] = pin.log6(self._placement.actInv(self._target)).vector

    def drift(self) -> Array:
        """Return the acceleration of the frame, shape (6,); see `Motion.drift`."""
        drift: Array = pin.getFrameAcceleration(self._model, self._data, self._id, pin.LOCAL).vector
        return drift


class SoleContact(HeldFrame):
    """Contact of a sole with the ground: its motion is a constraint or a cost, its centre of pressure stays in a box.

    Without a `torsion` the ground is taken as flat. Wrench and motion are then those of the sole centre along the axes
    of the sole, and friction acts at the corners of the box.

    With a `torsion` the shape of the ground is unknown: a stone, an edge or the whole sole may carry the robot. Wrench
    and motion are then those of the centre of the box. Forces are along level axes, with x along the sole, because the
    tilt of a sole on a stone is not the slope of the ground. Moments are along the axes of the sole, since its edges
    bound them.

    By default its normal force is at least 10 N, and less for a light robot (`Robot.force_scale`). Its default costs
    are 10⁻⁵ per N² of shear force, 10⁻⁶ per N² of normal force and 10⁻³ per (Nm)² of moment.

    The arguments are attributes, too. `sole`, the name of the sole, `margin`, `even` and `torsion` are read-only.
    """

    sole: str = result("name", OPTIONS)
    margin: float = result("_margin", OPTIONS)
    even: bool = result("_even", OPTIONS)
    torsion: float | None = result("_torsion", OPTIONS)
    # With these weights 100 N of shear, 300 N of weight and 10 Nm of ankle torque cost about the same.
    usual = {"min_force": LEAST_FORCE, "wrench_weight": (1e-5, 1e-5, 1e-6, 1e-3, 1e-3, 1e-3)}

    @checked
    def __init__(
        self,
        sole: str,
        *,
        friction: Positive = 0.7,
        margin: Annotated[NonNegative, "m"] = 0.005,
        even: bool = False,
        torsion: Annotated[Positive, "m"] | None = None,
        **options: Unpack[ContactOptions],
    ) -> None:
        """Describe the contact; the box is the robot's sole until `set_box` says otherwise.

        Args:
            sole: Name of one of the robot's soles, or its frame.
            friction: Coulomb coefficient; 0.7 as in the soft-foot experiments of Frizza et al., 2022.
            margin: Distance that the CoP keeps from the edges of the box, m; it is for soles with round edges.
            even: Bound the yaw moment by that of a sole with uniform pressure (`rectangle_wrench_cone`).
            torsion: Largest yaw moment divided by the normal force on ground of unknown shape, m; None for flat ground.
            **options: See `ContactOptions`.
        """
        self._friction, self._margin, self._even, self._torsion = friction, margin, even, torsion
        self._box: tuple[float, float] | None = None  # as given
        self._size: tuple[float, float] | None = None  # of the robot's sole
        self._centre = np.zeros(3)
        # From the sole's origin in world axes to the centre of the box in the contact's axes, and the arm between them.
        self._change, self._arm = np.eye(6), (0.0, 0.0, 0.0)
        super().__init__(sole, sole, np.zeros((16 if torsion is None else 10, 6)), **options)

    @checked
    def bind(self, robot: Robot) -> None:
        """Take frame and rectangle from the robot's sole."""
        sole = robot.sole(self.name)
        self.name, self._frame = sole.name, sole.frame
        self._size = sole.length, sole.width
        if self._box is not None:
            self._check_box(self._box, self._centre[:2])
        self.update_cone()
        super().bind(robot)

    @property
    def centre(self) -> Array:
        """Centre of the box in the sole frame, shape (3,), m."""
        return self._centre.copy()

    def set_box(self, length: float, width: float, centre: tuple[float, float] = (0.0, 0.0)) -> None:
        """Bound the CoP to a box of the given size, less the margin on each side.

        Args:
            length: Extent along the sole, m.
            width: Extent across it, m.
            centre: Centre of the box in the sole frame, m; only on ground of unknown shape may it differ from the sole
                centre.
        """
        what = f"length and width of contact '{self.name}' (m)"
        length, width = one_or_each(what, (length, width), 2, above=2.0 * self._margin).tolist()
        place = finite_array(f"centre of contact '{self.name}' (m)", centre, (2,))
        if self._torsion is None and place.any():
            raise InputError(
                f"the box of contact '{self.name}' on flat ground is centred, got centre {centre}"
            )
        self._check_box((length, width), place)
        self._box = length, width
        self.centre_box(place)
        self.update_cone()

    def _check_box(self, box: tuple[float, float], centre: Array) -> None:
        """Refuse a box that is larger than the robot's sole or about a point beside it, where the sole is known."""
        if self._size and (np.maximum(box, 2.0 * np.abs(centre)) > np.add(self._size, ROUNDING)).any():
            raise InputError(
                f"the box of contact '{self.name}' must be no larger than its sole, {self._size[0]} × {self._size[1]} "
                f"m, about a point of it; got {box[0]} × {box[1]} m about {centre.tolist()}"
            )

    def centre_box(self, centre: Sequence[float] | Array) -> None:
        """Move the box of the CoP to a centre in the sole frame, shape (2,), m; without a check, for code in the tick.

        The cone is that of a wrench at the centre of the box, and does not change.
        """
        self._centre[:2] = centre

    def update_cone(self) -> None:
        """Write the cone; see `Contact.update_cone`."""
        size = self._box or self._size
        if size is None:
            return  # the box is that of a robot's sole
        if 2.0 * self._margin >= min(size):
            raise InputError(
                f"CoP margin of contact '{self.name}' must be below half of its sole, {size[0]} × {size[1]} m; got "
                f"{self._margin} m"
            )
        length, width = size[0] / 2 - self._margin, size[1] / 2 - self._margin
        if self._torsion is None:
            self._cone[:] = rectangle_wrench_cone(length, width, self._friction, even=self._even)
        else:
            self._cone[:] = box_wrench_cone(length, width, self._friction, self._torsion)
        self.revision += 1

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the motion rows in the axes of the contact; see `Motion.measure`."""
        if self._torsion is None:
            super().measure(jacobian, error)
            return
        rotation, change = self._placement.rotation, self._change
        (a, b, _), (c, d, _), (e, f, _) = rotation.tolist()
        x, y, _ = self._centre.tolist()
        self._arm = px, py, pz = a * x + b * y, c * x + d * y, e * x + f * y
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
        jacobian[:] = change.dot(frame_jacobian(self._model, self._data, self._id, pin.LOCAL_WORLD_ALIGNED))
        error[:] = 0.0
        if largest(self._numbers.stiffness) > 0.0:
            target = self._target
            error[:3] = change[:3, :3].dot(target.act(self._centre) - self._placement.act(self._centre))
            error[3:] = pin.log3(rotation.T.dot(target.rotation))

    def drift(self) -> Array:
        """Return the acceleration of the centre of the box, shape (6,); see `Motion.drift`."""
        if self._torsion is None:
            return super().drift()
        model, data, world, still = self._model, self._data, pin.LOCAL_WORLD_ALIGNED, (0.0, 0.0, 0.0)
        spin = pin.getFrameVelocity(model, data, self._id, world).angular.tolist()
        acceleration = pin.getFrameClassicalAcceleration(model, data, self._id, world).vector
        acceleration[:3] += add_cross(still, spin, add_cross(still, spin, self._arm))
        return np.asarray(self._change.dot(acceleration))


class PointContact(Contact):
    """Contact at a point, such as a hand on a wall; its force is in a frame whose z axis is the normal of the surface.

    Its cost is 10⁻⁵ per N² by default. The arguments are attributes, too; `point` is read-only.
    """

    dim = 3
    point: Array = result("_point", OPTIONS)

    @checked
    def __init__(
        self,
        frame: str,
        *,
        point: ArrayLike = (0.0, 0.0, 0.0),
        normal: ArrayLike = (0.0, 0.0, 1.0),
        friction: Positive = 0.7,
        **options: Unpack[ContactOptions],
    ) -> None:
        """Describe the contact.

        Args:
            frame: Frame of the robot.
            point: Place of the contact in the frame, shape (3,), m.
            normal: Direction from the surface to the robot, in the world, shape (3,), of any length.
            friction: Coulomb coefficient.
            **options: See `ContactOptions`.
        """
        self._friction = friction
        super().__init__(frame, frame, friction_pyramid(friction), **options)
        self._point = finite_array(f"point of contact '{self.name}' (m)", point, (3,))
        self.normal = normal

    @property
    def normal(self) -> Array:
        """Direction from the surface to the robot, in the world, of length 1, shape (3,), read-only; assign another."""
        return read_only(self._world_to_contact[2])

    @normal.setter
    def normal(self, value: ArrayLike) -> None:
        axis = unit_vector(f"normal of contact '{self.name}'", value)
        turn = pin.Quaternion.FromTwoVectors(axis, np.array([0.0, 0.0, 1.0])).matrix()
        self._world_to_contact = np.ascontiguousarray(turn)

    def bind(self, robot: Robot) -> None:
        """Find the point; see `Contact.bind`."""
        super().bind(robot)
        frame = self._model.frames[self._id]
        point = frame.placement * pin.SE3(np.eye(3), self._point)
        self._at = frame.parentJoint, point, pin.LOCAL_WORLD_ALIGNED

    @property
    def rotation(self) -> Array:
        """Rotation from the contact frame, in which forces and velocities are given, to the world, shape (3, 3)."""
        return np.array(self._world_to_contact.T)

    def update_cone(self) -> None:
        """Write the cone; see `Contact.update_cone`."""
        self._cone[:] = friction_pyramid(self._friction)
        self.revision += 1

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the motion rows in the contact frame; see `Motion.measure`."""
        rows, turn = pin.getFrameJacobian(self._model, self._data, *self._at), self._world_to_contact
        jacobian[:] = turn.dot(rows.reshape(6, -1)[:3])  # of a robot with one joint it is a vector
        np.dot(turn, self._target.act(self._point) - self._placement.act(self._point), out=error)

    def drift(self) -> Array:
        """Return the acceleration of the point, shape (3,); see `Motion.drift`."""
        motion = pin.getFrameClassicalAcceleration(self._model, self._data, *self._at)
        return np.asarray(self._world_to_contact.dot(motion.linear))
