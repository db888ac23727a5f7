"""The DCM stabilizer as one task of any controller, as walks use it and as a controller of one's own adds it.

    left, right = controller.add(SoleContact("left_foot"), SoleContact("right_foot"))
    controller.add(StabilizerTask((left, right)), PostureTask(weight=0.1))

What is in the QP depends on how the drives are commanded. On torques the feedback's horizontal acceleration of the CoM
is the reference of three rows, whose vertical one holds the height, and the desired foot wrenches are a cost on the
wrenches of the contacts. On positions the QP moves the commanded robot: the CoM follows the pendulum, and standing
feet follow their admittances, while the desired wrenches make the feed-forward torques (`DriveControl.act`). In a tick
in which nothing hands out a pendulum, the robot is to stand with its CoM at `target`; after a walk, that is where the
last pendulum was.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, read_only
from wbc.base.settings import NonNegative
from wbc.core.frames import heading
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.options import MotionOptions
from wbc.core.qp.task import Drives
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.tasks.force.wrench import WrenchTask
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.stabilizer.distribution import LEAST_SHARE, DistributionSettings, WrenchDistribution
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput

STIFFNESS = 100.0
"""Default stiffness of the CoM, 1/s²."""


class StabilizerTask(CoMTask):
    """Task that balances a robot on two feet: feedback of the DCM, desired foot wrenches and foot admittances.

    Error and residual are those of the CoM, in m and m/s²; the weight is a cost per (m/s²)². With torque drives only
    the vertical row has stiffness and damping, since the feedback of the DCM gives the horizontal acceleration.

    Attributes:
        parts: Tasks on the wrenches of the contacts, which a controller adds and removes together with this task.
        output: Output of the stabilizer in the last tick; None before the first one.
    """

    __slots__ = (
        "_aim", "_applied", "_away", "_contacts", "_gains", "_given", "_places", "_seen", "_settings", "_sole_ids",
        "_soles", "_stabilizer", "_torque", "_yaw", "output", "parts",
    )  # fmt: skip

    @checked
    def __init__(
        self,
        contacts: Sequence[SoleContact],
        target: ArrayLike | None = None,
        *,
        drives: Drives = "torque",
        gains: StabilizerGains | None = None,
        distribution: DistributionSettings | None = None,
        estimate: Robot | None = None,
        wrench_weight: NonNegative = 1e-3,
        **options: Unpack[MotionOptions],
    ) -> None:
        """Describe the task.

        Args:
            contacts: Contacts of the left and of the right sole, in any order. Add both contacts before the task or
                together with it, and remove them after the task or together with it.
            target: CoM position at which the robot stands, shape (3,), m; the present position when None.
            drives: Kind of drive commands: "position", or "torque" for torque and hybrid control.
            gains: Gains of feedback and admittances; the defaults when None.
            distribution: Settings of the wrench distribution; the defaults when None.
            estimate: Robot whose state is the estimate from the sensors (`State.robot`). When None, it is the estimated
                robot of the control that runs the controller (`PositionControl` and others), or, without a control, the
                robot of the controller.
            wrench_weight: Cost of deviations from the desired foot wrenches with torque drives, per N² and (Nm)².
            **options: See `MotionOptions`.
        """
        if len(contacts) != 2 or contacts[0] is contacts[1]:
            raise InputError(
                f"a stabilizer needs two feet: contacts of the left and the right sole, got {contacts!r}"
            )
        defaults: MotionOptions = {"weight": 100.0, "stiffness": STIFFNESS}
        self._aim: tuple[Array, Array, Array] | None = None  # CoM, velocity, acceleration of a stand
        super().__init__(target, **(defaults | options))
        self._torque = drives == "torque"
        if self._torque:  # horizontally the feedback gives the acceleration
            height = float(self.stiffness[2])
            self.stiffness = (0.0, 0.0, height)
            self.damping = (0.0, 0.0, 2.0 * math.sqrt(height))
        self._contacts = tuple(contacts)
        self.parts: tuple[WrenchTask, ...] = ()
        if self._torque:
            self.parts = tuple(WrenchTask(contact, weight=wrench_weight) for contact in contacts)
        self._gains, self._settings, self._given = gains, distribution or DistributionSettings(), estimate
        self.output: StabilizerOutput | None = None
        self._stabilizer: Stabilizer | None = None
        self._applied = False  # a walk has set references in this tick
        self._away = [False, False]  # feet that have left their places

    @property
    def drives(self) -> Drives:  # type: ignore[override]
        """Kind of drives for which the task is made: "position", or "torque" for torque and hybrid control."""
        return "torque" if self._torque else "position"

    @property
    def target(self) -> Array:
        """CoM position at which the robot stands, shape (3,), m, read-only; assign a new one, or call `move_to`."""
        target: Array = super().target if self._aim is None else read_only(self._aim[0])
        return target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        CoMTask.target.fset(self, value)  # type: ignore[attr-defined]
        self._aim = np.array(self._target), np.zeros(3), np.zeros(3)

    @property
    def stabilizer(self) -> Stabilizer:
        """Feedback, distribution and admittances."""
        if self._stabilizer is None:
            raise InputError(f"task '{self.name}' belongs to no controller yet; add it first")
        return self._stabilizer

    @property
    def wrenches(self) -> dict[str, Array]:
        """Contact → its desired wrench, shape (6,), N and Nm, for `DriveControl.act`; empty before the first tick."""
        if self.output is None:
            return {}
        left, right = self._contacts
        return {left.name: self.output.feet.wrenches[0], right.name: self.output.feet.wrenches[1]}

    def bind(self, robot: Robot) -> None:
        """Take the robot's soles and mass, and the present CoM as the target if none was given."""
        super().bind(robot)
        soles = [robot.sole(contact.name) for contact in self._contacts]
        if soles[0] is soles[1]:
            raise InputError(
                f"a stabilizer needs contacts of two different soles, got two of '{soles[0].name}'"
            )
        if robot.soles.index(soles[0]) > robot.soles.index(soles[1]):
            self._contacts, soles, self.parts = self._contacts[::-1], soles[::-1], self.parts[::-1]
        sizes = ((soles[0].length, soles[0].width), (soles[1].length, soles[1].width))
        settings = replace(self._settings, min_force=self._settings.min_force * robot.force_scale)
        wrenches = WrenchDistribution(sizes, settings)
        if self._stabilizer is None:
            self._stabilizer = Stabilizer(robot.mass, wrenches, self._gains, yields=not self._torque)
        else:  # the same one, with the gains that were set since
            self._stabilizer.mass, self._stabilizer.distribution = robot.mass, wrenches
            self._stabilizer.reset()
        self._sole_ids = [robot.frame_id(sole.frame) for sole in soles]
        self._seen: Robot | None = None  # the estimated robot whose soles are these
        self._soles: list[pin.SE3] = []
        self._stand()

    def keeps(self) -> Sequence[object]:
        """Return the contacts, which the task needs to balance."""
        return self._contacts

    def let_go(self) -> None:
        """Set the targets of the feet to their present places, at rest."""
        if not self._torque:
            for contact in self._contacts:
                if contact.engaged:
                    contact.hold()

    def reset(self) -> None:
        """Reset errors, corrections and filtered wrenches, and take the present places of the feet."""
        super().reset()
        if self._stabilizer is not None:
            self._stabilizer.reset()
            self._stand()
        self.output, self._applied = None, False

    def _stand(self) -> None:
        """Take the present places of the soles, and the present heading, as those of a robot that stands."""
        self._places = [pin.SE3(self.robot.placement(sole)) for sole in self._sole_ids]
        self._away = [False, False]
        self._yaw = heading(self.robot.placement(self.robot.base_frame).rotation)

    def _set_down(self) -> None:
        """Stand where feet have been set down that had left their places."""
        for side, contact in enumerate(self._contacts):
            if not contact.engaged:
                self._away[side] = True
            elif contact.active and self._away[side]:
                self._away[side] = False
                self._places[side] = pin.SE3(self.robot.placement(self._sole_ids[side]))
                self._yaw = heading(self.robot.placement(self.robot.base_frame).rotation)
                self.stabilizer.feet.reset(side)

    def observe(self, measurement: Measurement, dt: float) -> None:
        """Run `update` and `apply` with the CoM target, unless a walk has set a pendulum reference in this tick.

        Args:
            measurement: Measurement with the wrenches on the soles.
            dt: Control period, s.
        """
        self._set_down()
        if self._applied:
            self._applied = False
            return
        if self._aim is None:  # at first, and after a walk
            self._aim = np.array(self._target), np.zeros(3), np.zeros(3)
            self._places = [pin.SE3(place) for place in self._places]
        aim = target, velocity, acceleration = self._aim
        ground = 0.5 * float(self._places[0].translation[2] + self._places[1].translation[2])
        rest = Pendulum.at_rest(target, ground)
        zmp = rest.zmp - (*(acceleration[:2] / rest.omega**2), 0.0)
        pendulum = rest._replace(com_velocity=velocity, com_acceleration=acceleration, zmp=zmp)
        contact = (self._contacts[0].active, self._contacts[1].active)
        output = self.update(pendulum, measurement.wrenches, contact, self._yaw, dt)
        self.apply(output, pendulum, contact, self._places)
        self._aim, self._applied = aim, False

    def unobserved(self, dt: float) -> None:
        """Go on in a tick in which a walk has set a pendulum reference; see `Task.unobserved`."""
        if not self._applied:
            super().unobserved(dt)
        self._applied = False

    def update(
        self,
        target: Pendulum,
        wrenches: Array,
        contact: tuple[bool, bool],
        yaw: float,
        dt: float,
        *,
        bias: Array | None = None,
        outside: Array | None = None,
    ) -> StabilizerOutput:
        """Run feedback, distribution and admittances for one tick; nothing in the QP changes.

        Args:
            target: Reference of the pendulum.
            wrenches: Measured wrenches on the soles, shape (2, 6), N and Nm.
            contact: True for each foot that should carry load.
            yaw: Heading of the robot, rad.
            dt: Control period, s.
            bias: Bias of the measured DCM, shape (2,), m.
            outside: Wrench of the surroundings on the robot except its feet; see `Stabilizer.update`.

        Returns:
            The output, to be passed to `apply` in the same tick.
        """
        owner, stabilizer = self.owner, self.stabilizer
        estimate: Robot = self._given or (self.robot if owner is None else owner.measured)
        if estimate is not self._seen:
            self._seen, self._soles = estimate, [estimate.placement(sole) for sole in self._sole_ids]
        if stabilizer.mass != estimate.mass:  # a load was taken over or given back
            stabilizer.mass = estimate.mass
        self._yaw = yaw
        self.output = output = stabilizer.update(
            target,
            estimate.com,
            estimate.com_velocity,
            wrenches,
            self._soles,
            contact,
            yaw,
            dt,
            bias=bias,
            outside=outside,
        )
        return output

    def apply(
        self,
        output: StabilizerOutput,
        target: Pendulum,
        contact: tuple[bool, bool],
        places: Sequence[pin.SE3],
        beyond: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Set the references of this task, of the standing feet and of their wrenches, without checks.

        Args:
            output: What `update` has returned for these references in this tick.
            target: Reference of the pendulum.
            contact: True for each foot that should carry load.
            places: Placements of the left and the right sole as planned.
            beyond: Acceleration of the CoM in addition to that of the pendulum, x and y, m/s².
        """
        self._aim, self._places, self._applied = None, list(places), True
        for side, stands in enumerate(contact):
            if not stands:
                continue
            if self._torque:
                self.parts[side].follow(output.feet.wrenches[side])
                if self._settings.by_load:
                    self._weigh_moments(side, contact, output)
            else:
                self._contacts[side].follow(*output.corrections[side].apply(places[side]))
        com, velocity, acceleration = target.com, target.com_velocity, target.com_acceleration
        if self._torque:
            acceleration = acceleration.copy()
            acceleration[:2] = output.com_acceleration[:2]
        if beyond != (0.0, 0.0):
            acceleration = acceleration.copy()
            acceleration[:2] += beyond
        self.follow(com, velocity, acceleration)

    def _weigh_moments(self, side: int, contact: tuple[bool, bool], output: StabilizerOutput) -> None:
        """Weigh the moments of a desired wrench by the inverse square of the foot's load over the sum."""
        scale, (left, right) = np.ones(6), output.feet.wrenches[:, 2].tolist()
        if all(contact):
            share = max((left, right)[side] / max(left + right, 1.0), LEAST_SHARE)
            scale[3:] = (0.5 / share) ** 2
        self.parts[side].scale = scale

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._aim = np.array(target), np.array(velocity), np.array(acceleration)
