"""The tick of every robot that follows a source of references: a measurement in, a command out.

    state = control.estimate(measurement)              plausibility, observer                  `wbc.core.drive.control`
    state = balance.correct(state)                     bias of the DCM, load in the hands      `wbc.walking.balance`
    reference = source.update(state)                   pendulum, feet, contacts                `wbc.walking.source`
    reference = balance.update(reference, state)       desired wrenches, admittances, lean     `wbc.walking.balance`
    tasks.follow(reference, lean)                      targets of tasks and contacts           `wbc.walking.tasks`
    command = control.act(state, balance.wrenches)     QP, drive, gate                         `wbc.core.drive.control`

Source, tasks and balance are a law's (`Law`): the tick asks for no kind of walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError, names_in
from wbc.base.settings import Angle, Number
from wbc.core.drive.control import Mode, SafetySettings, State
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.falls import FallReason
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.signals import Command, Measurement
from wbc.ground import KnownGround, PointCloud
from wbc.ground.cloud import ElevationMap
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.bias import BiasEstimator
from wbc.tasks.stabilizer.lean import Lean
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.balance import Balance
from wbc.walking.body import Body
from wbc.walking.contact import GaitPhase
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.load import HeldLoad
from wbc.walking.plans.footsteps import FootstepPlan
from wbc.walking.plans.sources import FootstepSource, Velocity
from wbc.walking.source import Progress, Reference, ReferenceSource, VelocityLimits
from wbc.walking.tasks import WalkTasks


class Law(NamedTuple):
    """Law of a walk: decides where and when the next foot lands, and balances the robot."""

    source: ReferenceSource  # where the references come from
    tasks: WalkTasks  # tasks and contacts, with the weights, gains and boxes of the law
    balance: Balance  # feedback beside the steps
    estimate: InertialSettings | None = None  # time constants of the estimate; None leaves them as they are


class ReferenceControl:
    """Control that follows a source of references, with the parts that all robots have.

    Attributes:
        source: Source of the references.
        dt: Control period, s.
        controller: Whole-body controller with all tasks and contacts.
        control: Position, torque or hybrid control, with the observer.
        tasks: The tasks and contacts.
        arms: Hands, which can be given targets at any tick.
        body: Height of the CoM, lean and turn of the trunk, and gaze, which can be set at any tick.
        balance: Stabilizer, lean, bias, load and hands that press; of a robot that balances by its steps none of them.
        stiffness: Scheduler that sets the soles while they swing; None leaves them alone.
        ground: What is known of the ground, to which clouds of points are added at any time; None walks blind.
        reference: References of the last tick with a good measurement; None before the first one.
        stopped: True after `stop`, until it is told to walk on.
    """

    def __init__(
        self,
        law: Law,
        control: PositionControl | TorqueControl,
        arms: Arms,
        body: Body,
        stiffness: StiffnessScheduler | None,
        ground: KnownGround | None = None,
    ) -> None:
        """Put the parts together; see the attributes."""
        self.source, self.tasks, self.balance, _ = law
        self.control, self.controller, self.dt = control, control.controller, control.controller.dt
        self.arms, self.body = arms, body
        control.dcm_limit = self.balance.dcm_limit
        self.stiffness, self.ground = stiffness, ground
        if ground is not None:
            self.source.see(ground)
        self.reference: Reference | None = None
        self.stopped = False

    def __repr__(self) -> str:
        kind, source, progress = type(self).__name__, type(self.source).__name__, self.progress
        return f"{kind}({self.controller.robot!r}, {source}, {progress.phase.value}, {progress.steps_done} steps)"

    @property
    def hands(self) -> Hands:
        """Hands that press on things and hold on to them.

        An `InputError` for a robot without hands, and for one that balances by its steps, which do not count forces.
        """
        return self.balance.hands

    @property
    def lean(self) -> Lean | None:
        """Lean of the trunk; None keeps it upright."""
        return self.balance.lean

    @property
    def bias(self) -> BiasEstimator | None:
        """Estimator of the error of the measured DCM; None takes it as measured."""
        return self.balance.bias

    @property
    def load(self) -> HeldLoad | None:
        """Load in the hands as estimated; None where none is expected."""
        return self.balance.load

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Measurement of all sensors now.

        Returns:
            Command of the drives until the next tick. Nothing is raised: a tick that fails follows the policy of the
            control.
        """
        control = self.control
        state = control.estimate(measurement)
        if state.ok and not control.damped:
            try:
                self._follow(state)
            except Exception as error:  # of a source, or of hands, of the user's own
                state = control.refuse(state, error)
        command = control.act(state, self.balance.wrenches)
        return command if self.stiffness is None else self._with_stiffness(command, self.stiffness)

    def see(self, seen: PointCloud | ElevationMap) -> None:
        """Take a cloud of points, or a map, of the ground; a walk that is blind leaves it.

        Args:
            seen: Cloud or map.
        """
        if self.ground is not None:
            self.ground.add(seen)

    def _follow(self, state: State) -> None:
        """Set the targets of all tasks and contacts of this tick."""
        balance, body = self.balance, self.body
        if self.ground is not None:
            self.ground.update(state.robot, state.measurement.time)
        state = balance.correct(state)
        self.reference = reference = self.source.update(state)
        if reference.phase is GaitPhase.STANDING:
            self.control.observer.inertial.rest()
        if body.active:
            body.update(reference.heading)
            pendulum = body.raised(reference.pendulum)
            self.reference = reference = reference._replace(pendulum=pendulum)
            balance.sink(pendulum.omega)
        self.reference = reference = balance.update(reference, state)
        lean, twist = balance.leaning, None
        self.arms.update(reference.feet, reference.heading)
        if body.active:
            lean, twist = body.leaned(lean, reference.heading), body.twist
        self.tasks.follow(reference, lean, twist)

    def _with_stiffness(self, command: Command, scheduler: StiffnessScheduler) -> Command:
        """Return a command with the stiffness of both soles from the state of the swing."""
        control, now = self.control, self.control.measurement
        if control.failing or control.damped or now is None:
            return replace(command, sole_stiffness=scheduler.command)
        progress = self.progress
        landing = progress.landing
        soles = scheduler.update(
            progress.swing_side,
            min(progress.elapsed / max(progress.duration, self.dt), 1.0),
            max(progress.duration - progress.elapsed, 0.0),
            control.observer.robot,
            now,
            None if landing is None else landing.position,
        )
        return replace(command, sole_stiffness=soles)

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave joints to somebody else from the next tick on, those and no others; none takes all back.

            arms = walking.release(robot.joint_names[15:])  # a teleoperator, a policy, a hand controller has them
            arms.tell(position, velocity)  # once a tick, if the other one says where they go; else they are measured

        The walk counts with their motion and commands nothing of them (`Command.released`).

        Args:
            joints: Names; not of a leg.

        Returns:
            The joints, which can be told their targets; None where all are taken back.

        Raises:
            UnknownNameError: No joint of the robot.
            InputError: A joint of a leg, one twice, or all joints of an arm whose hand has a target, presses or grips.
        """
        robot, names = self.controller.robot, names_in("joints to release", joints)
        gone = {robot.joint_index(joint) for joint in names}
        for arm in self.arms.hands:
            if arm.joints and gone.issuperset(arm.joints) and arm.busy:
                raise InputError(f"'{arm.name}' must be let go before its arm is released: it is at work")
        return self.control.release(names)

    # ---- what can be asked between ticks ----------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self.control.time

    @property
    def progress(self) -> Progress:
        """Phase and steps now."""
        return self.source.progress(self.reference)

    @property
    def steps_done(self) -> int:
        """Steps that have ended; a foot that found no ground is taken to stand where it is."""
        return self.progress.steps_done

    @property
    def finished(self) -> bool:
        """True when all that was asked for is done and the robot stands; False for an order that was dropped.

        The source says why it has dropped an order: `source.reason`.
        """
        return self.source.finished and not self.source.reason

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall; None while it has not fallen."""
        return self.control.fallen

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, dropped, or ended by a fall."""
        return self.source.finished or self.fallen is not None

    @property
    def output(self) -> StabilizerOutput | None:
        """Output of the stabilizer in the tick of `reference`; None before the first one."""
        return self.balance.output

    @property
    def stabilizer(self) -> Stabilizer | None:
        """Feedback and admittances."""
        return self.balance.stabilizer

    # ---- steering, which is the source's ----------------------------------------------------------------------------

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity of the robot's middle: forward (m/s), left (m/s) and turn (rad/s).

        Set it at any tick: steps are planned as the robot goes. None, or zero, brings it to a stand. None as well while
        something else gives the steps. A velocity that is not three finite numbers up to 10 is an `InputError`, as any
        while the body is set too low to lift a foot; one that cannot be had is limited (`granted_velocity`).
        """
        return self.source.velocity

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        if velocity is not None and np.count_nonzero(velocity):
            self.body.check_steps(self.source.swing_height)
        self.source.velocity, self.stopped = velocity, False

    @property
    def granted_velocity(self) -> Velocity:
        """Velocity that the present steps give: forward (m/s), left (m/s) and turn (rad/s)."""
        return self.source.granted

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Greatest velocities that are granted."""
        return self.source.limits

    @property
    def steered(self) -> bool:
        """True if the robot is steered, or stands without a plan and may be."""
        return self.source.steered

    @checked
    def go_to(self, x: Annotated[Number, "m"], y: Annotated[Number, "m"], yaw: Angle) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the robot in the world, m.
            y: Place of the robot in the world, m.
            yaw: Heading there, rad; a full turn at most.
        """
        self.body.check_steps(self.source.swing_height)
        self.source.go_to(x, y, yaw)
        self.stopped = False

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a plan, or from a planner of one's own, from the next tick on.

        Args:
            source: Footsteps in the world, or a planner. A plan that cannot be walked from where the robot is brings it
                to a stand (`source.reason`).
        """
        self.body.check_steps(self.source.swing_height)
        self.source.follow(source)
        self.stopped = False

    def stop(self) -> None:
        """Come to a stand safely."""
        self.source.stop()
        self.source.reason, self.stopped = "", True


def drive_control(
    mode: Mode, controller: Controller, observer: Observer, safety: SafetySettings, **position: Any
) -> PositionControl | TorqueControl:
    """Return the control of a mode, with the options of position control."""
    if mode == "position":
        return PositionControl(controller, observer, safety=safety, **position)
    kind = HybridControl if mode == "hybrid" else TorqueControl
    return kind(controller, observer, safety=safety)
