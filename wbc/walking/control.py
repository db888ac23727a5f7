"""Control of a robot that stands and walks: a measurement in, a command out.

    state = control.estimate(measurement)              plausibility, observer              `wbc.core.drive.control`
    state = balance.correct(state)                     bias of the DCM, load in the hands      `wbc.walking.balance`
    reference = source.update(state)                   pendulum, feet, contacts                `wbc.walking.source`
    reference = balance.update(reference, state)       desired wrenches, admittances, lean     `wbc.walking.balance`
    tasks.follow(reference, lean)                      targets of tasks and contacts           `wbc.walking.tasks`
    command = control.act(state, balance.wrenches)     QP, drive, gate                     `wbc.core.drive.control`

Steps are of two kinds. Places and times of *planned* steps are fixed ahead, and the stabilizer balances the robot on
its way. Places and times of *free* steps are decided as the robot goes, and they balance it. The kind follows from the
drives and from what is asked for:

    position control              planned steps
    torque and hybrid control     free steps; planned ones on stairs, for hands that press or grip, and for loads

It changes between two ticks while the robot stands. Both kinds share robot, controller, drives, estimate, arms and
body; source, tasks and balance are exchanged. docs/measured_pushes.md says what was tried in the middle of a step.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, names_in, shown
from wbc.base.numbers import finite_array
from wbc.base.settings import Angle, Number, Period
from wbc.core.drive.control import State
from wbc.core.drive.torque import TorqueControl
from wbc.core.estimation.falls import FallReason
from wbc.core.estimation.observer import Observer
from wbc.core.limits.base import Limit
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.ground import KnownGround, PointCloud
from wbc.ground.cloud import ElevationMap
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.lean import UPRIGHT
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.balance import Balance
from wbc.walking.body import STEPPING_TURN, UNTWISTED, Body
from wbc.walking.contact import GaitPhase
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.load import HeldLoad
from wbc.walking.plans.footsteps import FootstepPlan, heading
from wbc.walking.plans.sources import (
    FootstepSource,
    PlanSource,
    Velocity,
    VelocityLimits,
    checked_velocity,
)
from wbc.walking.settings import Kind, WalkingControlSettings
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import SteeredSteps, Steering
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.steps import Steps, com_height, drive_of, steps_of

logger = logging.getLogger(__name__)

HOLDS = 1.0
"""Distance of the DCM of a robot that stands, in standing boxes of free steps, from which on it steps: the soles end at
1.5, but a step that begins there comes too late."""

STEPS = "the robot steps, and free steps count no forces on hands: stop it, and press once it stands"
"""Reason for which hands of a robot that takes free steps may not begin to press."""


class WalkingControl:
    """Control of a robot that stands and walks, along a plan or as it is steered.

        walking = WalkingControl(robot, None, plant.control_period)
        walking.velocity = (0.2, 0.0, 0.1)  # at any tick; None for a stand

    Attributes:
        settings: Settings.
        source: Present source of the references.
        dt: Control period, s.
        controller: Whole-body controller with all tasks and contacts.
        control: Position, torque or hybrid control, with the observer.
        tasks: Tasks and contacts of the present kind of steps.
        arms: Arms with hands, whose targets can be set at any tick.
        body: Set-points of the body: height of the CoM, lean and turn of the trunk, and gaze; set them at any tick.
        balance: Stabilizer of planned steps; None while free steps balance the robot.
        stiffness: Scheduler that sets the stiffness of the swinging sole; None leaves the stiffness as it is.
        ground: Known ground, to which clouds of points can be added at any time; None if the robot walks blind.
        reference: References of the last tick with a valid measurement; None before the first one.
        stopped: True after `stop`, until the next order to walk.
    """

    __slots__ = (
        "_before", "_dt", "_kind", "_kinds", "arms", "balance", "body", "control",
        "controller", "ground", "reference", "settings", "source", "stiffness", "stopped", "tasks",
    )  # fmt: skip

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
        extent: tuple[float, float, float, float] | None = None,
        ground: KnownGround | None = None,
        limits: Sequence[Limit] = (),
    ) -> None:
        """Make all parts for a robot that stands; the walk begins with the first tick.

        Args:
            robot: The standing robot. It becomes the commanded robot in position control, and the estimated robot in
                torque and hybrid control.
            source: Footstep plan, whose timings are rounded to the control period, or any source of references that was
                made with the same robot. With None the robot stands until it is steered.
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
            limits: Further limits of the QP, such as a `CollisionLimit`. They hold in both kinds of steps. Limits on
                positions, velocities, accelerations and torques of joints are there already.
        """
        if len(robot.soles) != 2:
            raise InputError(f"a walk needs a robot with a left and a right sole, got {len(robot.soles)}")
        self.settings = s = settings or WalkingControlSettings()
        self.controller = controller = Controller(robot, dt, settings=s.solver)
        observer = observer or Observer(robot, adopt=s.mode != "position")
        self.control, self._dt = drive_of(controller, observer, s), dt
        for limit in limits:
            controller.add(limit)
        self.arms = Arms(controller, dt, s.arms)
        self._kinds = steps_of(self.control, self.arms, source, s, extent)
        plan = source if isinstance(source, FootstepPlan) and source.steps else None
        first = self._kind_for(plan)
        steps = self._kinds[first]
        self.body = Body(
            controller,
            com_height(robot, steps.source),
            dt,
            most_turn=STEPPING_TURN if "free" in self._kinds else math.inf,
            lift=self._lift,
            reaching=steps.tasks.reaching,
        )
        self._take(first, None)
        self.stiffness, self.ground = stiffness, ground
        if ground is not None:
            for steps in self._kinds.values():
                steps.source.see(ground)
        self.reference: Reference | None = None
        self.stopped = False
        self._before = 0  # steps done by steps of the other kind before
        if first == "free" and plan is not None:
            self.follow(plan)

    def __repr__(self) -> str:
        robot, source, now = self.controller.robot, type(self.source).__name__, self.progress
        return f"WalkingControl({robot!r}, {source}, {now.phase.value}, {now.steps_done} steps)"

    # ---- the tick -----------------------------------------------------------------------------------------------

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Present measurement of all sensors.

        Returns:
            Command of the drives until the next tick. No error is raised: in a tick that fails, the policy of the
            control decides.
        """
        return self.act(self.control.estimate(measurement))

    def act(self, state: State) -> Command:
        """End a tick whose state has been estimated, by this control or by another one on the same observer."""
        control = self.control
        if state.ok and not control.damped:
            try:
                self._follow(state)
            except Exception as error:  # of a source, or of hands, of the user's own
                state = control.refuse(state, error)
        command = control.act(state, None if self.balance is None else self.balance.wrenches)
        return command if self.stiffness is None else self._with_stiffness(command, self.stiffness)

    def check_begin(self) -> tuple[SteppingWalk, TorqueControl]:
        """Return free steps and drives; an `InputError` if `begin` is not for them."""
        source = self._kinds["free"].source if "free" in self._kinds else None
        if not isinstance(source, SteppingWalk) or not isinstance(self.control, TorqueControl):
            raise InputError("a gait begins on its way in free steps, in torque or hybrid control")
        return source, self.control

    def begin(
        self, state: State, air: Sequence[float] = (0.0, 0.0), landed: Sequence[float] = (9.0, 9.0)
    ) -> None:
        """Begin anew from the state of the robot, on its way: to take over from a control on the same observer.

        The gait begins in the phase that the contacts say, with free steps (`SteppingWalk.join`); all orders before are
        forgotten, so that the robot comes to a stand.

        Args:
            state: State of this tick.
            air: Time for which the left and the right foot have been in the air, s; 0 for one on the ground.
            landed: Time since each of them has landed, s; 0 for one in the air.

        Raises:
            InputError: A robot in position control, or one that takes planned steps alone; times that are not two
                numbers, or negative.
        """
        source, control = self.check_begin()
        times = finite_array("times of the feet in the air and on the ground (s)", (air, landed), (2, 2))
        if times.min() < 0.0:
            raise InputError(
                f"times of the feet in the air and on the ground must not be negative, got {air}, {landed}"
            )
        if self.reference is not None or self._kind != "free":
            self._take("free", self._kinds[self._kind])
            self.body.follow(source.com_height, self.tasks.reaching)
        control.resume()
        source.begin(heading(state.robot.placement(state.robot.base_frame).rotation))
        source.join(*times.tolist())
        self.reference, self.stopped, self._before = None, False, 0

    def _follow(self, state: State) -> None:
        """Set the targets of all tasks and contacts of this tick."""
        if self.ground is not None:
            self.ground.update(state.robot, state.measurement.time)
        if len(self._kinds) > 1:
            self._choose(state)
        balance, body = self.balance, self.body
        if balance is not None:
            state = balance.correct(state)
        self.source.hip_turn = body.hip_turn
        reference = self.source.update(state)
        if reference.phase is GaitPhase.STANDING:
            self.control.observer.inertial.rest()
        if body.active:
            body.update(reference.heading)
            reference = reference._replace(pendulum=body.raised(reference.pendulum))
        lean, twist = UPRIGHT, UNTWISTED
        if balance is not None:
            reference = balance.update(reference, state)
            lean = balance.leaning
        self.reference = reference
        self.arms.update(reference.feet, reference.heading, self.source.haste)
        if body.active:
            lean, twist = body.leaned(lean, reference.heading), body.twist
        self.tasks.follow(reference, lean, twist)

    def _with_stiffness(self, command: Command, scheduler: StiffnessScheduler) -> Command:
        """Return a command with the stiffness of both soles from the state of the swing."""
        control, now = self.control, self.control.measurement
        if control.failing or control.damped or now is None:
            return replace(command, sole_stiffness=scheduler.command)
        progress = self.source.progress(self.reference)
        landing = progress.landing
        soles = scheduler.update(
            progress.swing_side,
            min(progress.elapsed / max(progress.duration, self._dt), 1.0),
            max(progress.duration - progress.elapsed, 0.0),
            control.observer.robot,
            now,
            None if landing is None else landing.position,
        )
        return replace(command, sole_stiffness=soles)

    # ---- kind of the steps --------------------------------------------------------------------------------------

    @property
    def step_kind(self) -> Kind:
        """Present kind of steps, "planned" or "free"."""
        return self._kind

    @property
    def stands(self) -> bool:
        """True if the robot stands and no hand presses, so that the kind of steps may change."""
        reference = self.reference
        return reference is None or (reference.phase is GaitPhase.STANDING and not self._pressing)

    @property
    def _idle(self) -> bool:
        """True if the robot stands and has no step to take."""
        return self.stands and (self._kind == "free" or self.source.finished)

    @property
    def _pressing(self) -> bool:
        hands = None if self.balance is None else self.balance.hands
        return hands is not None and hands.active

    def _choose(self, state: State) -> None:
        """Change the steps of a robot that stands for hands, for a push, and once no hand is at work."""
        hands, at_hand = None if self._planned is None else self._planned.hands, self._at_hand
        if self._kind == "free":
            if at_hand and self.stands:
                self._change("planned")
        elif self._idle and (not at_hand or self._kinds["free"].source.leaves(state, HOLDS)):
            self._change("free")  # which steps out of a push in this tick
        if hands is not None:
            hands.measurement = state.measurement
            hands.barred = "" if self._kind == "planned" or self.stands else STEPS

    @property
    def _at_hand(self) -> bool:
        """True while a hand presses or grips, or is to: planned steps alone count its force."""
        hands = None if self._planned is None else self._planned.hands
        return hands is not None and (hands.wanted or self._pressing)

    @property
    def _own_planner(self) -> FootstepSource | None:
        """Planner that may ask for steps again: the user's own, or a plan that is not walked yet; else None."""
        planner = self.source.planner
        walked = isinstance(planner, PlanSource) and self.source.finished
        return None if walked or isinstance(planner, SteeredSteps) else planner

    def _kind_for(self, plan: FootstepPlan | None) -> Kind:
        """Return the kind of steps for an order: planned ones for stairs, on which no landing may move."""
        if "free" not in self._kinds or (plan is not None and plan.climbs and "planned" in self._kinds):
            return "planned"
        return "free"

    def _make_ready(self, plan: FootstepPlan | None = None) -> None:
        """Make ready for an order: a robot that stands takes the kind of steps for it, if no hand is at work.

        Raises:
            InputError: A body that is set too low to lift a foot.
        """
        kind = self._kind_for(plan) if self._idle and not self._at_hand else self._kind
        self._check_body(kind)
        self._change(kind)

    def _check_body(self, kind: Kind) -> None:
        """Raise an `InputError` if the body is set too low to lift a foot in steps of a kind."""
        source = self._kinds[kind].source
        self.body.check_steps(source.lift_room, source.com_height)

    def _change(self, kind: Kind) -> None:
        """Change the kind of the steps of a robot that stands; of the orders before a planner's alone goes on."""
        if kind == self._kind:
            return
        logger.info("steps of the walk: %s", kind)
        self._before = self.progress.steps_done
        robot, reason, planner = self.controller.robot, self.source.reason, self._own_planner
        towards = heading(robot.placement(robot.base_frame).rotation) - self.body.hip_turn
        if self.reference is not None:
            towards = self.reference.heading
        self._take(kind, self._kinds[self._kind])
        self.source.begin(towards)
        if planner is not None:
            self.source.take(planner)
        self.source.reason = reason  # of the last order, until the next one
        if self.balance is not None:
            self.balance.begin()
        if self.source.com_height is not None:
            self.body.follow(self.source.com_height, self.tasks.reaching)

    def _take(self, kind: Kind, before: Steps | None) -> None:
        """Put the parts of one kind of steps in place of those before, if there are any."""
        steps = self._kinds[kind]
        self._kind, self.source, self.tasks, self.balance = kind, steps.source, steps.tasks, steps.balance
        self.arms.follow(steps.tasks)
        if before is not None:
            before.tasks.leave()
        steps.tasks.enter(None if before is None else before.tasks)
        self.control.dcm_limit = steps.dcm_limit
        self.control.observer.retune(steps.estimate)

    def _lift(self) -> float:
        """Return the room that the legs need to lift a foot now, m; zero once all orders are done."""
        return 0.0 if self.source.finished else self.source.lift_room

    # ---- what can be asked between ticks ------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self.control.time

    @property
    def progress(self) -> Progress:
        """Present phase, and the number of steps of both kinds."""
        progress = self.source.progress(self.reference)
        return progress._replace(steps_done=progress.steps_done + self._before)

    @property
    def steps_done(self) -> int:
        """Number of steps that have ended; a foot that finds no ground counts as standing at its place."""
        return self.progress.steps_done

    @property
    def finished(self) -> bool:
        """True when all orders are done and the robot stands; False if an order was dropped.

        `source.reason` says why an order was dropped.
        """
        return self.source.finished and not self.source.reason

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the fall; None while the robot has not fallen."""
        return self.control.fallen

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, dropped, or ended by a fall."""
        return self.source.finished or self.fallen is not None

    @property
    def walk(self) -> LipmWalk:
        """Phases, pattern and footsteps of planned steps."""
        if not isinstance(self.source, LipmWalk):
            raise InputError(f"only planned steps have phases and a pattern, got {shown(self.source)}")
        return self.source

    @property
    def _planned(self) -> Balance | None:
        """Balance of planned steps, whichever steps the robot takes now."""
        return self._kinds["planned"].balance if "planned" in self._kinds else None

    @property
    def hands(self) -> Hands:
        """Hands that press on objects or grip them; a standing robot changes to planned steps for that.

        It is an `InputError` for a robot without hands, and for one that takes only free steps, which do not take
        account of hand forces.
        """
        if self._planned is None:
            raise InputError(
                "free steps alone count no forces on hands: leave the setting 'step_kind' out to press or grip"
            )
        if self._planned.hands is None:
            raise InputError(f"'{self.controller.robot.name}' has no hands in its description")
        return self._planned.hands

    @property
    def stabilizer(self) -> Stabilizer | None:
        """Feedback and admittances of planned steps; new gains are used in all later planned steps."""
        return None if self._planned is None else self._planned.stabilizer

    @property
    def load(self) -> HeldLoad | None:
        """Estimator of the load in the hands in planned steps; None if no load is expected."""
        return None if self._planned is None else self._planned.load

    @property
    def output(self) -> StabilizerOutput | None:
        """Output of the stabilizer in the tick of `reference`; None without a stabilizer and before the first tick."""
        return None if self.balance is None else self.balance.output

    def see(self, seen: PointCloud | ElevationMap) -> None:
        """Take a cloud of points or a map of the ground; a blind walk ignores it.

        Args:
            seen: Cloud or map.
        """
        if self.ground is not None:
            self.ground.add(seen)

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
        for arm in self.arms.hands:
            if arm.joints and gone.issuperset(arm.joints) and arm.active:
                raise InputError(f"'{arm.name}' must be let go before its arm is released: it is at work")
        return self.control.release(names)

    # ---- what is asked of the robot -----------------------------------------------------------------------------

    def _steering(self) -> Steering:
        """Return what steers the source; an `InputError` for a source that cannot be steered."""
        if self.source.steering is None:
            raise InputError(self.source.unsteered)
        return self.source.steering

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity of the robot: forward (m/s), to the left (m/s) and turn (rad/s).

        Set it at any tick. None or zero brings the robot to a stand. It is also None while a goal or a plan gives the
        steps. A velocity that the robot cannot reach is limited (`granted_velocity`). It is an `InputError` if the
        velocity is not three finite numbers up to 10, or if the body is set too low to lift a foot.
        """
        return None if self.source.steering is None else self.source.steering.target

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        wanted = checked_velocity(velocity)
        if any(wanted):
            self._make_ready()
        self._order(velocity)

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
        """True if the robot is steered, or stands without a plan and can be steered."""
        return self.source.steered

    @checked
    def go_to(self, x: Annotated[Number, "m"], y: Annotated[Number, "m"], yaw: Angle) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the robot in the world, m.
            y: Place of the robot in the world, m.
            yaw: Heading there, rad; at most a full turn.
        """
        self._make_ready()
        self._steering().go_to(x, y, yaw)
        self.source.take(None)
        self.stopped = False

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a plan, or from a planner of your own, from the next step on.

        Args:
            source: Footsteps in the world, or a planner. If a plan cannot be walked from the present place, the robot
                comes to a stand, and `source.reason` says why.
        """
        if not isinstance(source, (FootstepPlan, FootstepSource)):
            raise InputError(f"footsteps come from a FootstepPlan or a FootstepSource, got {shown(source)}")
        self._make_ready(source if isinstance(source, FootstepPlan) else None)
        self._order(planner=PlanSource(source) if isinstance(source, FootstepPlan) else source)

    def stop(self) -> None:
        """Come to a stand safely."""
        self._order()
        self.stopped = True

    def _order(self, velocity: Sequence[float] | None = None, planner: FootstepSource | None = None) -> None:
        """Walk with a velocity, or by a planner; come to a stand without either."""
        self._steering().command(velocity)
        self.source.take(planner)
        self.stopped = False
