"""Control of a robot that stands and walks: a measurement in, a command out.

    state = drives.estimate(measurement)                plausibility, observer               `wbc.core.drive.control`
    state = balance.correct(state, last)                bias of the DCM                      `wbc.walking.balance`
    reference = source.update(state)                    pendulum, feet, record of the step   `wbc.walking.source`
    outside = hands.update(measurement, reference)      wrench on the hands                  `wbc.walking.hands`
    output = balance.update(reference, last, state, …)  desired wrenches, admittances, lean  `wbc.walking.balance`
    tasks.follow(reference, lean, twist, output)        targets of tasks and contacts        `wbc.walking.tasks`
    command = drives.act(state, balance.wrenches)       QP, drive, gate                      `wbc.core.drive.control`

What one step is, phase, contacts, heading, landing and times, is one record (`Progress`), made by the source alone; all
others read it in the references of the tick. `last` are the references of the tick before.

The drives decide how the robot walks. In position control it takes *planned* steps, whose places and times are fixed
ahead, and a stabilizer balances it on its way. In torque and hybrid control it takes *free* steps: their places and
times are decided as the robot goes, and they balance it. References of a source of one's own are balanced by the
stabilizer in every mode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, names_in, shown
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import Angle, Number, Period
from wbc.core.drive.control import State
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.observer import Observer
from wbc.core.frames import heading
from wbc.core.limits.base import Limit
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.robot import Robot
from wbc.core.signals import Command
from wbc.ground import KnownGround
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.lean import UPRIGHT
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.assembly import drive_of, height_of, source_of, tasks_of, tune
from wbc.walking.balance import Balance
from wbc.walking.body import STEPPING_TURN, UNTWISTED, Body
from wbc.walking.contact import GaitPhase
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.load import HeldLoad
from wbc.walking.plans.check import Extent
from wbc.walking.plans.footsteps import FootstepPlan, Place, check_start
from wbc.walking.plans.sources import (
    AT_REST,
    FootstepSource,
    PlanSource,
    Velocity,
    VelocityLimits,
    checked_velocity,
)
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steered import SteeredControl
from wbc.walking.stepping.gait import SteppingWalk

START_ROOM = (0.1, 0.1, 0.4)
"""Distance (m), height (m) and turn (rad) of the feet from their references up to which a walk begins: `g1` and
`hrp4_class` in position control kept standing 0.1 m or 0.4 rad beside them, and fell 0.15 m beside them."""

LONG_AGO = 9.0
"""Time since a landing that no step counts any more, s."""


class WalkingControl(SteeredControl):
    """Control of a robot that stands and walks, along a plan or as it is steered.

        walking = WalkingControl(robot, None, plant.control_period)
        walking.velocity = (0.2, 0.0, 0.1)  # at any tick; None for a stand

    Attributes:
        settings: Its `WalkingControlSettings`.
        source: Present source of the references.
        dt: Control period, s.
        controller: Whole-body controller with all tasks and contacts.
        drives: Position, torque or hybrid control, with the observer.
        tasks: Tasks and contacts.
        arms: Arms with hands, whose targets can be set at any tick.
        body: Set-points of the body: height of the CoM, lean and turn of the trunk, and gaze; set them at any tick.
        balance: Stabilizer; None where free steps balance the robot.
        load: Estimator of the load in the hands; None if no load is expected.
        stiffness: Scheduler that sets the stiffness of the swinging sole; None leaves the stiffness as it is.
        ground: Known ground, to which clouds of points can be added at any time; None if the robot walks blind.
        reference: References of the last tick with a valid measurement; None before the first one.
        stopped: True after `stop`, until the next order to walk.
    """

    __slots__ = (
        "settings", "_dt", "source", "controller", "drives", "tasks", "arms", "_hands", "body", "balance", "load",
        "stiffness", "ground", "reference", "stopped", "_asked",
    )  # fmt: skip

    drives: PositionControl | TorqueControl
    dt: float = result("_dt", "make another control, with a robot that stands")

    @checked
    def __init__(
        self,
        robot: Robot,
        source: FootstepPlan | ReferenceSource | None,
        dt: Period,
        settings: WalkingControlSettings | None = None,
        *,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
        extent: Extent | None = None,
        ground: KnownGround | None = None,
        limits: Sequence[Limit] = (),
    ) -> None:
        """Make all parts for a robot that stands; the walk begins with the first tick.

        Args:
            robot: The standing robot. It becomes the commanded robot in position control, and the estimated robot in
                torque and hybrid control.
            source: Footstep plan, whose timings are rounded to the control period, or a source of references that was
                made with the same robot and period, and that no other control has had. With None the robot stands until
                it is steered.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            observer: Observer of the robot's state; a new one when None. Free steps replace those of its time constants
                that are the defaults of `InertialSettings`; others stay.
            stiffness: Scheduler of the soles' stiffness, for feet of variable stiffness.
            extent: Smallest and largest x, smallest and largest y of the ground, m; endless when None. Not for a source
                of references of your own. Footsteps and goals beyond it are refused, and a robot that a velocity would
                lead beyond it comes to a stand.
            ground: Known ground, made with a robot of the same description that stands at the start; None for a robot
                that walks blind.
            limits: Further limits of the QP, such as a `CollisionLimit`. Limits on positions, velocities, accelerations
                and torques of joints are there already.
        """
        robot.needs_feet("a walk")
        self.settings = s = settings or WalkingControlSettings()
        self.controller = controller = Controller(robot, dt, settings=s.solver)
        observer = observer or Observer(robot, adopt=s.mode != "position")
        self.drives, self._dt = drive_of(controller, observer, s), dt
        for limit in limits:
            controller.add(limit)
        self.source = walk = source_of(robot, source, dt, s, extent)
        tune(self.drives, walk)
        self.tasks = tasks_of(controller, walk, s)
        self.arms = Arms(controller, s.arms, self.tasks)
        height, estimate = height_of(robot, walk), observer.robot
        self._hands: Hands | None = None
        if robot.frames:
            box = walk.standing_box if isinstance(walk, SteppingWalk) else None
            self._hands = Hands(controller, estimate, s.hands, height, self.arms, box)
        self.load = None if s.load is None else HeldLoad(estimate, observer.observe_outside(), s.load)
        self.balance: Balance | None = None
        table = self.tasks.table
        if table.stabilized is not None:
            self.balance = Balance(self.drives, table.stabilized, self._hands, self.load, s, height)
        self.body = Body(
            controller,
            walk,
            height,
            most_turn=STEPPING_TURN if self.balance is None else math.inf,
            reaching=table.reaching,
        )
        self.stiffness, self.ground = stiffness, ground
        if stiffness is not None:
            stiffness.begin(robot)
        if ground is not None:
            ground.check_robot(robot)
            if walk.ground is None:
                raise InputError(f"{type(walk).__name__} does not place feet by a known ground")
            walk.ground.sight = ground
        self.reference: Reference | None = None
        self.stopped = False
        self._asked: object = None  # last order to walk
        if isinstance(source, FootstepPlan) and source.steps:
            if self.balance is None:
                self.follow(source)
            self._asked = source
        walk.used = True

    def __repr__(self) -> str:
        robot, source, now = self.controller.robot, type(self.source).__name__, self.progress
        return f"WalkingControl({robot!r}, {source}, {now.phase.value}, {now.steps_done} steps)"

    # ---- the tick -----------------------------------------------------------------------------------------------

    def act(self, state: State) -> Command:
        """End a tick whose state has been estimated, by these drives or by others on the same observer.

        No error is raised: in a tick that fails, the failure policy of the drives decides.
        """
        drives = self.drives
        if state.ok and not drives.damped:
            try:
                self._follow(state)
            except Exception as error:  # of a source, or of hands, of the user's own
                state = drives.refuse(state, error)
        command = drives.act(state, None if self.balance is None else self.balance.wrenches)
        return command if self.stiffness is None else self._with_stiffness(command, self.stiffness)

    def check_begin(self) -> tuple[SteppingWalk, TorqueControl]:
        """Return free steps and drives; an `InputError` if `begin` is not for them."""
        source, drives = self.source, self.drives
        if not isinstance(source, SteppingWalk) or not isinstance(drives, TorqueControl):
            raise InputError("a gait begins on its way in free steps, in torque or hybrid control")
        return source, drives

    def begin(
        self, state: State, air: Sequence[float] = (0.0, 0.0), landed: Sequence[float] = (LONG_AGO, LONG_AGO)
    ) -> None:
        """Begin anew from the state of the robot, on its way: to take over from a control on the same observer.

        The gait begins in the phase that the contacts say, with free steps (`SteppingWalk.begin`); all orders to walk
        are forgotten, so that the robot comes to a stand. Set-points of the body, arms and hands stay.

        Args:
            state: State of this tick.
            air: Time for which the left and the right foot have been in the air, s; 0 for one on the ground.
            landed: Time since each of them has landed, s; 0 for one in the air.

        Raises:
            InputError: A robot in position control; times that are not two numbers, or negative.
        """
        source, drives = self.check_begin()
        times = finite_array("times of the feet in the air and on the ground (s)", (air, landed), (2, 2))
        if times.min() < 0.0:
            raise InputError(
                f"times of the feet in the air and on the ground must not be negative, got {air}, {landed}"
            )
        self.tasks.begin()
        self.body.begin()
        drives.resume()
        source.begin(heading(state.robot.placement(state.robot.base_frame).rotation), times.tolist())
        self.reference, self.stopped, self._asked = None, False, None

    def reset(self, q: Array | None = None) -> None:
        """Begin from a configuration at rest, shape (nq,), before the first tick; half-sitting when None.

        Free steps begin wherever the feet are then; other references stay where the robot stood when they were made.

        Raises:
            InputError: The robot has stood or walked already, or its feet would stand beside their references.
        """
        if self.reference is not None:
            raise InputError("a walk cannot begin anew: make another control, with a robot that stands")
        robot, made, source = self.controller.robot.clone(), self.controller.robot, self.source
        q = robot.half_sitting if q is None else robot.check_configuration("configuration", q)
        robot.update(q, np.zeros(robot.nv))
        if isinstance(source, SteppingWalk):
            source.steering.turn_to(heading(robot.placement(robot.base_frame).rotation))
        else:
            check_start(robot, FootstepPlan.standing(made), "the walk", START_ROOM)
        self.drives.reset(q)

    def _follow(self, state: State) -> None:
        """Set the targets of all tasks and contacts of this tick."""
        if self.ground is not None:
            self.ground.update(state.robot, state.measurement.time)
        balance, body, hands, load = self.balance, self.body, self._hands, self.load
        pressing = hands is not None and hands.active
        if load is not None and not pressing:  # what they press on is no load
            load.update(self._dt)
        if balance is not None:
            state = balance.correct(state, self.reference)
        if pressing or body.active:
            wrench = hands.outside if hands is not None and pressing else None
            state = state._replace(hip_turn=body.hip_turn, hand_wrench=wrench)
        reference = self.source.update(state)
        progress = reference.progress
        if progress.phase is GaitPhase.STANDING:
            self.drives.observer.inertial.learn_bias()
        if body.active:
            body.update(progress.heading)
            reference = reference._replace(pendulum=body.raised(reference.pendulum))
        lean, twist, output = UPRIGHT, UNTWISTED, None
        outside = None if hands is None else hands.update(state.measurement, reference)
        # Free steps begin from the CoM that hands have shifted.
        shifts = outside is not None and not (balance is None and progress.phase is GaitPhase.SINGLE)
        if hands is not None and shifts:
            reference = reference._replace(pendulum=hands.shifted(reference.pendulum))
        if balance is not None:
            output = balance.update(reference, self.reference, state, outside)
            lean = balance.leaning
        self.reference = reference
        self.arms.update(reference.feet, progress.heading, progress.fast_share, self.source.remaining)
        if body.active:
            lean, twist = body.leaned(lean, progress.heading), body.twist
        self.tasks.follow(reference, lean, twist, output)

    def _with_stiffness(self, command: Command, scheduler: StiffnessScheduler) -> Command:
        """Return a command with the stiffness of both soles from the state of the swing."""
        drives, now = self.drives, self.drives.measurement
        if drives.failing or drives.damped or now is None:
            return replace(command, sole_stiffness=scheduler.command)
        progress = self.progress
        landing = progress.landing
        soles = scheduler.update(
            progress.swing_side,
            min(progress.elapsed / max(progress.duration, self._dt), 1.0),
            max(progress.duration - progress.elapsed, 0.0),
            drives.observer.robot,
            now,
            None if landing is None else landing.position,
            drives.observer.sinking.compliance,
        )
        return replace(command, sole_stiffness=soles)

    # ---- what can be asked between ticks ------------------------------------------------------------------------

    @property
    def stands(self) -> bool:
        """True if the robot stands and no hand presses."""
        reference, hands = self.reference, self._hands
        pressing = hands is not None and hands.active
        return reference is None or (reference.progress.phase is GaitPhase.STANDING and not pressing)

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self.drives.time

    @property
    def progress(self) -> Progress:
        """Record of the step in the last tick."""
        return self.source.progress if self.reference is None else self.reference.progress

    @property
    def finished(self) -> bool:
        """True when all orders are done and the robot stands; False if an order was dropped.

        `source.reason` says why an order was dropped.
        """
        return self.source.finished and not self.source.reason

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, dropped, or ended by a fall."""
        return self.source.finished or self.fallen is not None

    @property
    def hands(self) -> Hands:
        """Hands that press on objects or grip them; it is an `InputError` for a robot without hands."""
        if self._hands is None:
            raise InputError(f"'{self.controller.robot.name}' has no hands in its description")
        return self._hands

    @property
    def stabilizer(self) -> Stabilizer | None:
        """Feedback and admittances; None where free steps balance the robot."""
        return None if self.balance is None else self.balance.stabilizer

    @property
    def output(self) -> StabilizerOutput | None:
        """Output of the stabilizer in the tick of `reference`; None without a stabilizer and before the first tick."""
        return None if self.balance is None else self.balance.output

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave exactly these joints to another controller, from the next tick on; an empty list takes all back.

            arms = walking.release(robot.joint_names[15:])  # a teleoperator or a policy moves them
            arms.tell(position, velocity)  # once a tick, if the other controller states them; else they are measured

        The walk takes their motion into account, and does not command them (`Command.released`).

        Args:
            joints: Names of joints that are not in a leg.

        Returns:
            The released joints, whose targets can be told to the walk; None for an empty list.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A joint is in a leg or given twice, or all joints of an arm are given whose hand is at work.
        """
        robot, names = self.controller.robot, names_in("joints to release", joints)
        gone = {robot.joint_index(joint) for joint in names}
        for arm in self.arms.all.values():
            if arm.joints and gone.issuperset(arm.joints) and arm.active:
                raise InputError(f"'{arm.name}' must be let go before its arm is released: it is at work")
        return self.drives.release(names)

    # ---- what is asked of the robot -----------------------------------------------------------------------------

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity of the robot: forward (m/s), to the left (m/s) and turn (rad/s).

        Set it at any tick. None or zero brings the robot to a stand. It is also None while a goal or a plan gives the
        steps. A velocity that the robot cannot reach is limited (`granted_velocity`). It is an `InputError` if the
        velocity is not three finite numbers up to 10, or if the body is set too low to lift a foot.

        This order and the others to walk (`go_to`, `follow`) may be given in every tick: the same order once more
        changes nothing. After `stop` it counts anew, also one that is done or was dropped (`source.reason`).
        """
        return None if self.source.steering is None else self.source.steering.target

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        wanted = checked_velocity(velocity)
        self._order(wanted)

    @property
    def granted_velocity(self) -> Velocity:
        """Velocity of the present steps: forward (m/s), to the left (m/s) and turn (rad/s)."""
        return self.source.granted

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Largest velocities that the walk accepts without limiting them."""
        steering = self.source.steering
        return VelocityLimits(0.0, 0.0, 0.0, 0.0) if steering is None else steering.limits

    @property
    def steered(self) -> bool:
        """True if the robot can be steered, which ends a plan that it follows."""
        return self.source.steering is not None

    @checked
    def go_to(self, x: Annotated[Number, "m"], y: Annotated[Number, "m"], yaw: Angle) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the robot in the world, m.
            y: Place of the robot in the world, m.
            yaw: Heading there, rad; at most a full turn.
        """
        self._order(goal=(x, y, yaw))

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a plan, or from a planner of your own, from the next step on.

        Args:
            source: Footsteps in the world, or a planner. If a plan cannot be walked from the present place, the robot
                comes to a stand, and `source.reason` says why.
        """
        if not isinstance(source, (FootstepPlan, FootstepSource)):
            raise InputError(f"footsteps come from a FootstepPlan or a FootstepSource, got {shown(source)}")
        self._order(footsteps=source)

    def stop(self) -> None:
        """Come to a stand safely; a source that cannot be steered goes on with the references that it gives."""
        if self.source.steering is not None:
            self._order()
        self.stopped = True

    def _order(
        self,
        velocity: Velocity = AT_REST,
        goal: Place | None = None,
        footsteps: FootstepPlan | FootstepSource | None = None,
    ) -> None:
        """Walk to a goal, by footsteps, or with a velocity."""
        source, steering = self.source, self.source.steering
        if steering is None:
            raise InputError(source.unsteered)
        order: object = (velocity, goal) if footsteps is None else footsteps
        if order is self._asked or (not isinstance(order, FootstepSource) and order == self._asked):
            self.stopped = False
            return
        if any(velocity) or goal is not None or footsteps is not None:
            self.body.check_steps()
        if goal is not None:
            steering.go_to(*goal)
        else:
            steering.command(velocity)
        source.take(PlanSource(footsteps) if isinstance(footsteps, FootstepPlan) else footsteps)
        self.stopped, self._asked = False, order
