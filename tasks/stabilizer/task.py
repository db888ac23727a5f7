"""The DCM stabilizer as one task of any controller, for a robot that stands on two feet.

    left, right = controller.add(SoleContact("left_foot"), SoleContact("right_foot"))
    controller.add(StabilizerTask((left, right)), PostureTask(weight=0.1))

Walks have the same parts without this task: the `Stabilizer`, and the `StabilizedFeet` that carry out what it says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative
from wbc.core.frames import heading
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.options import MotionOptions
from wbc.core.qp.task import Drives
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.tasks.force.wrench import WrenchTask
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.stabilizer.distribution import DistributionSettings, WrenchDistribution
from wbc.tasks.stabilizer.feet import StabilizedFeet
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput

STIFFNESS = 100.0
"""Default stiffness of the CoM, 1/s²."""

VERTICAL = np.array([0.0, 0.0, 1.0])
"""Axes along which the CoM has gains with torque drives."""


class StabilizerTask(CoMTask):
    """Task that balances a robot on two feet: feedback of the DCM, desired foot wrenches and foot admittances.

    Error and residual are those of the CoM, in m and m/s²; the weight is a cost per (m/s²)². With torque drives only
    the vertical row has stiffness and damping, since the feedback of the DCM gives the horizontal acceleration.

    Attributes:
        output: Output of the stabilizer in the last tick; None before the first one, and while both contacts are off.
    """

    __slots__ = (
        "_away", "_feet", "_gains", "_places", "_rates", "_seen", "_settings", "_sole_ids", "_soles",
        "_stabilizer", "_yaw", "output",
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
            wrench_weight: Cost of deviations from the desired foot wrenches with torque drives, per N² and (Nm)².
            **options: See `MotionOptions`; all axes are controlled.
        """
        if len(contacts) != 2 or contacts[0] is contacts[1]:
            raise InputError(
                f"a stabilizer needs two feet: contacts of the left and the right sole, got {contacts!r}"
            )
        if "axes" in options:
            raise InputError(f"a stabilizer balances the CoM along all axes, got axes={options['axes']!r}")
        defaults: MotionOptions = {"weight": 100.0, "stiffness": STIFFNESS}
        self._rates = np.zeros(3), np.zeros(3)  # velocity and acceleration of the target
        super().__init__(target, **(defaults | options))
        self._gains, self._settings = gains, distribution or DistributionSettings()
        self._feet = StabilizedFeet(
            contacts, torque=drives == "torque", weight=wrench_weight, by_load=self._settings.by_load
        )
        if self._feet.torque:  # horizontally the feedback gives the acceleration
            self.stiffness = VERTICAL * self.stiffness
            self.damping = VERTICAL * self.damping
        self.output: StabilizerOutput | None = None
        self._stabilizer: Stabilizer | None = None
        self._away = [False, False]  # feet that have left their places

    @property
    def drives(self) -> Drives:  # type: ignore[override]
        """Kind of drives for which the task is made: "position", or "torque" for torque and hybrid control."""
        return "torque" if self._feet.torque else "position"

    @property
    def parts(self) -> tuple[WrenchTask, ...]:
        """Tasks on the wrenches of the contacts, which a controller adds and removes together with this task."""
        return self._feet.parts

    @property
    def stabilizer(self) -> Stabilizer:
        """Feedback, distribution and admittances."""
        if self._stabilizer is None:
            raise InputError(f"task '{self.name}' belongs to no controller yet; add it first")
        return self._stabilizer

    @property
    def wrenches(self) -> dict[str, Array]:
        """Contact → its desired wrench, shape (6,), N and Nm, for `DriveControl.act`; empty before the first tick."""
        return {} if self.output is None else self._feet.wrenches(self.output)

    def bind(self, robot: Robot) -> None:
        """Take the robot's soles and mass, and the present CoM as the target if none was given."""
        super().bind(robot)
        soles = [robot.sole(contact.name) for contact in self._feet.contacts]
        if soles[0] is soles[1]:
            raise InputError(
                f"a stabilizer needs contacts of two different soles, got two of '{soles[0].name}'"
            )
        if robot.soles.index(soles[0]) > robot.soles.index(soles[1]):
            self._feet.swap()
            soles = soles[::-1]
        wrenches = WrenchDistribution.of(robot, soles, self._settings)
        if self._stabilizer is None:
            self._stabilizer = Stabilizer(robot.mass, wrenches, self._gains, yields=not self._feet.torque)
        else:  # the same one, with the gains that were set since
            self._stabilizer.mass, self._stabilizer.distribution = robot.mass, wrenches
            self._stabilizer.reset()
        self._sole_ids = [robot.frame_id(sole.frame) for sole in soles]
        self._seen: Robot | None = None  # the estimated robot whose soles are these
        self._soles: list[pin.SE3] = []
        self._stand()

    def keeps(self) -> Sequence[object]:
        """Return the contacts, which the task needs to balance."""
        return self._feet.contacts

    def let_go(self) -> None:
        """Set the targets of the feet to their present places, at rest."""
        if not self._feet.torque:
            for contact in self._feet.contacts:
                if contact.engaged:
                    contact.hold()

    def reset(self) -> None:
        """Reset errors, corrections and filtered wrenches, and take the present places of the feet."""
        super().reset()
        if self._stabilizer is not None:
            self._stabilizer.reset()
            self._stand()
        self.output = None

    def _stand(self) -> None:
        """Take the present places of the soles, and the present heading, as those of a robot that stands."""
        self._places = [pin.SE3(self.robot.placement(sole)) for sole in self._sole_ids]
        self._away = [False, False]
        self._yaw = heading(self.robot.placement(self.robot.base_frame).rotation)

    def _set_down(self) -> None:
        """Stand where feet have been set down that had left their places."""
        for side, contact in enumerate(self._feet.contacts):
            if not contact.engaged:
                self._away[side] = True
            elif contact.active and self._away[side]:
                self._away[side] = False
                self._places[side] = pin.SE3(self.robot.placement(self._sole_ids[side]))
                self._yaw = heading(self.robot.placement(self.robot.base_frame).rotation)
                self.stabilizer.feet.reset(side)

    def observe(self, measurement: Measurement, dt: float) -> None:
        """Run the stabilizer with the CoM target for one tick, and set the references of this task and of the feet.

        The state is that of `Controller.measured`: the estimate of the control that runs the controller, or, without a
        control, the robot of the controller itself.

        Args:
            measurement: Measurement with the wrenches on the soles.
            dt: Control period, s.
        """
        self._set_down()
        owner, stabilizer, feet = self.owner, self.stabilizer, self._feet
        estimate: Robot = self.robot if owner is None else owner.measured
        if estimate is not self._seen:
            self._seen, self._soles = estimate, [estimate.placement(sole) for sole in self._sole_ids]
        stabilizer.mass = estimate.mass  # with what it carries
        pendulum, contact = self._pendulum(), (feet.contacts[0].active, feet.contacts[1].active)
        com, velocity, wrenches = estimate.com, estimate.com_velocity, measurement.wrenches
        self.output, acceleration = None, pendulum.com_acceleration
        if any(contact):  # otherwise no foot carries a wrench: the CoM follows its target without feedback
            output = stabilizer.update(pendulum, com, velocity, wrenches, self._soles, contact, self._yaw, dt)
            self.output = output
            feet.follow(output, contact, self._places)
            acceleration = feet.com_acceleration(output, pendulum)
        self.follow(pendulum.com, pendulum.com_velocity, acceleration)

    def _pendulum(self) -> Pendulum:
        """Return the pendulum of a CoM at the target, over the ZMP that makes the acceleration of the target."""
        velocity, acceleration = self._rates
        ground = 0.5 * float(self._places[0].translation[2] + self._places[1].translation[2])
        rest = Pendulum.at_rest(self._target, ground)
        zmp = rest.zmp - (*(acceleration[:2] / rest.omega**2), 0.0)
        return rest._replace(com_velocity=velocity, com_acceleration=acceleration, zmp=zmp)

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target, self._rates = np.array(target), (np.array(velocity), np.array(acceleration))
