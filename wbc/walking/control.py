"""A walk as whole-body control: a measurement in, a command out.

    walk        references of pendulum and feet, and which feet stand    `wbc.walking.walk`
    stabilizer  desired foot wrenches, and corrections of the feet       `wbc.tasks.stabilizer.stabilizer`
    tasks       both as targets of tasks and contacts                    `wbc.walking.tasks`
    controller  all tasks and contacts as one QP                         `wbc.core.qp.controller`

In position control the feet yield to the measured wrenches, the QP moves the commanded robot, and the servos get the
torques of the desired wrenches on top. In torque control the desired acceleration of the CoM and the desired wrenches
are tasks of the QP itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.core.arguments import checked
from wbc.core.control import FEET_STEP, State
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import Array, InputError, as_period, scalar
from wbc.core.estimation.observer import Observer
from wbc.core.estimation.outside import OutsideWrench
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.core.signals import Command, Measurement
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.bias import BiasEstimator
from wbc.tasks.stabilizer.lean import UPRIGHT, Lean, LeanMotion
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput
from wbc.walking.body import Body
from wbc.walking.driver import Driver
from wbc.walking.falls import FallDetector, FallReason
from wbc.walking.hands.hand import HandSettings
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.load import HeldLoad
from wbc.walking.planning.footsteps import Footstep, FootstepPlan, check_start
from wbc.walking.planning.reach import Reach, bent_height
from wbc.walking.planning.schedule import SoleSizes, support_area
from wbc.walking.planning.sources import FootstepSource, Velocity
from wbc.walking.progress import Progress, VelocityLimits, with_sole_stiffness
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.tasks import WalkTasks
from wbc.walking.walk import Walk, WalkReference


class WalkingControl:
    """Controller of a robot that stands, walks along a plan or where it is steered, and stands for ever.

        walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
        walking.velocity = (0.2, 0.0, 0.1)  # at any tick; None for a stand

    Attributes:
        settings: Settings.
        dt: Control period, s.
        walk: Phases and references.
        driver: Source of the footsteps of a robot that is steered.
        stabilizer: Feedback and admittances.
        lean: Lean of the trunk; None keeps it upright.
        bias: Estimator of the error of the measured DCM; None takes it as measured.
        hands: Hands that press on things; None without.
        load: Load in the hands as estimated; None where none is expected.
        falls: Fall detector.
        stiffness: Scheduler that sets the soles while they swing; None leaves them alone.
        controller: Whole-body controller with all tasks and contacts of the walk.
        tasks: The tasks and contacts.
        arms: Hands, which can be given targets at any tick.
        body: Height of the CoM, lean and turn of the trunk, and gaze, which can be set at any tick.
        control: Position or torque control, with the observer.
        reference: References of the last tick with a good measurement; None before the first one.
        output: Output of the stabilizer in that tick; None before the first one.
        time: Time since the start, s.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        dt: float,
        settings: WalkingControlSettings | None = None,
        *,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
        extent: tuple[float, float, float, float] | None = None,
    ) -> None:
        """Make all parts for a robot that stands at the start of a plan; the walk begins with the first tick.

        Args:
            robot: The robot, standing; becomes the commanded one (position control) or the estimated one (torque).
            plan: Footstep plan; its timings are rounded to the control period.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            observer: Estimates the robot's state; a new one when None.
            stiffness: Sets the soles while they swing; needs feet of variable stiffness.
            extent: Least and greatest x, least and greatest y of the ground, m; endless when None.

        Raises:
            InputError: A robot without exactly two soles, a plan that cannot be walked or begins elsewhere, bad
                settings.
        """
        if len(robot.soles) != 2:
            raise InputError(f"a walk needs a robot with a left and a right sole, got {len(robot.soles)}")
        check_start(robot, plan)
        self.settings = s = settings or WalkingControlSettings()
        self.dt = as_period(dt)
        self._robot = robot
        ground = 0.5 * (plan.left.z + plan.right.z)
        height = float(robot.com[2]) - ground if s.com_height is None else s.com_height
        reach = None
        if not len(plan):
            if s.com_height is None:
                height = min(height, bent_height(robot, s.drive.stretch))
            # Bent knees reach further ahead; to the side ankles must roll by what the robot sways, less in quick steps.
            reach = Reach.of(robot, height)
            narrow = Reach.of(robot).max_spacing
            reach = replace(reach, max_spacing=narrow, quick_spacing=reach.max_spacing)
        self.walk = Walk(robot, plan, height, dt, s.walk, reach=reach, extent=extent, com=np.array(robot.com))
        self.driver = Driver(self.walk, robot, s.drive, extent)
        self._omega = scalar(self.walk.omega)
        self._sizes: SoleSizes = self.walk.sole_sizes
        self.lean = None if s.lean is None else Lean(robot.mass, height, s.lean)
        self.bias = None if s.bias is None else BiasEstimator(s.bias)
        self.falls = FallDetector(s.falls)
        self.stiffness = stiffness

        self._torque = torque = s.mode != "position"
        self.controller = Controller(robot, dt, settings=s.solver)
        observer = observer or Observer(robot, adopt=torque)
        self.tasks = WalkTasks(
            self.controller, s.tasks, s.gains, s.distribution, observer.robot, torque=torque
        )
        self.stabilizer = self.tasks.com.stabilizer
        self.hands: Hands | None = None
        self.arms = Arms(self.controller, self.tasks.com, self.tasks.posture, self.dt, s.arms)
        self.body = Body(self.controller, height, self.dt, waist=True)
        self.control: PositionControl | TorqueControl
        if s.mode == "hybrid":
            self.control = HybridControl(self.controller, observer, safety=s.safety)
        elif torque:
            self.control = TorqueControl(self.controller, observer, safety=s.safety)
        else:
            self.control = PositionControl(
                self.controller, observer, feedforward=s.feedforward, safety=s.safety
            )
        self.control.reach = FEET_STEP
        if s.hands is not None:
            self.hands = self._make_hands(s.hands, height)
        self.load: HeldLoad | None = None
        if s.load is not None:
            observing = self.control.observer
            self.load = HeldLoad(observing.robot, s.load)
            if observing.outside is None:
                observing.outside = OutsideWrench(observing.robot)
        self.reference: WalkReference | None = None
        self.output: StabilizerOutput | None = None
        self.time = 0.0
        self._in_contact = (True, True)
        self._wrench_targets = np.zeros((2, 6))
        self._dcm = np.zeros(3)  # as measured, with its bias

        # Views of the soles of the robot that the QP moves (commanded, or estimated in torque control) and of the
        # estimated torso: they move on with their models.
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        estimate = self.control.observer.robot
        self._torso = estimate.placement(estimate.torso_frame)
        self._area = self._support_area()
        if len(plan):
            self.walk.start()

    def _make_hands(self, settings: HandSettings, height: float) -> Hands:
        """Return the hands; a loss is survived within a sole: while the robot walks it has no more."""
        (length, width), _ = self._sizes
        return Hands(
            self.controller,
            self.control.observer.robot,
            settings,
            (0.5 * length, 0.5 * width),
            height,
            self.arms,
        )

    @property
    def finished(self) -> bool:
        """True when the plan, or what a source has asked for, is walked and the robot stands."""
        return self.walk.finished and not self.driver.pending

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall; None while it has not fallen."""
        return self.falls.reason

    @property
    def steps_done(self) -> int:
        """Single supports that have ended; a foot that found no ground is taken to stand where it is."""
        return self.walk.steps_done

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, or ended by a fall."""
        return self.finished or self.fallen is not None

    @property
    def progress(self) -> Progress:
        """Phase and steps now."""
        phases = self.walk.phases
        steps, gait, swing = phases.plan.steps, phases.plan.gait, phases.swing
        return Progress(
            phases.phase,
            None if swing is None else SIDES.index(swing),
            1 - SIDES.index(steps[min(phases.step, len(steps) - 1)].side) if steps else 0,
            phases.completed,
            phases.elapsed,
            phases.duration,
            steps[phases.step :],
            gait.single_support + gait.double_support,
        )

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Greatest velocities that are granted."""
        (forward, aside, turn), back = self.settings.drive.fastest, self.settings.drive.fastest_back
        return VelocityLimits(forward, back, aside, turn)

    def stop(self) -> None:
        """Come to a stand safely."""
        self.driver.stop()

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity of the robot's middle: forward (m/s), left (m/s) and turn (rad/s).

        Set it at any tick: footsteps are planned as the robot goes. None, or zero, brings it to a stand within two
        steps. None as well while another source gives the footsteps. A velocity that is not three finite numbers up to
        10 is an `InputError`; one that cannot be had is limited (`granted_velocity`).
        """
        return self.driver.velocity

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        self.driver.velocity = velocity

    @property
    def steered(self) -> bool:
        """True if the robot is steered, or stands without a plan and may be."""
        return self.driver.steered

    @property
    def granted_velocity(self) -> Velocity:
        """Velocity that the present footsteps give: forward (m/s), left (m/s) and turn (rad/s)."""
        return self.driver.granted

    @checked
    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the middle between the feet in the world, m.
            y: The same, m.
            yaw: Heading there, rad.

        Raises:
            InputError: A place beyond the ground.
        """
        self.driver.go_to(x, y, yaw)

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a plan, or from a planner of one's own, from the next tick on.

        Args:
            source: Footsteps in the world, or an object with the method of `FootstepSource`. A plan that cannot be
                walked from where the robot is brings it to a stand (`driver.reason`).

        Raises:
            InputError: Neither a plan nor an object with that method.
        """
        self.driver.follow(source)

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Measurement of all sensors now.

        Returns:
            Command of the drives until the next tick. Nothing is raised: a tick that fails follows the policy of the
            control.
        """
        self.time += self.dt
        state = self.control.estimate(measurement)
        if state.ok:
            try:
                self._set_targets(state)
            except Exception as error:  # of a source of footsteps, or of hands, of the user's own
                state = self.control.refuse(state, error)
        command = self.control.act(state, None if self._torque else self._wrench_targets)
        self._detect_fall()
        return with_sole_stiffness(command, self)

    # Steps of a tick

    def _set_targets(self, state: State) -> None:
        """Set the targets of all tasks and contacts of this tick."""
        estimate, measurement = state.robot, state.measurement
        if self.load is not None:
            self._hold(self.load)
        com, velocity = estimate.com, estimate.com_velocity
        self._dcm = com + velocity / self._omega
        bias = None if self.bias is None else self._estimate_bias(self.bias)
        self.reference = reference = self._update_walk(bias)
        body = self.body
        if body.active:
            body.update(reference.heading)
            self.reference = reference = reference._replace(pendulum=body.raised(reference.pendulum))
        if reference.contact != self._in_contact:
            self._switch_contacts(reference.contact)
        outside = None
        if self.hands is not None:
            self.controller.outside = None
            outside = self.hands.update(measurement, reference, self.dt)
            if outside is not None:
                self.reference = reference = reference._replace(
                    pendulum=self.hands.shifted(reference.pendulum)
                )
                self.controller.outside = self.hands.forces()
        self.output = output = self.tasks.com.update(
            reference.pendulum,
            measurement.wrenches,
            reference.contact,
            reference.heading,
            self.dt,
            bias=bias,
            outside=outside,
        )
        self._wrench_targets = output.feet.wrenches
        if outside is not None and self.hands is not None and not output.in_air:
            self.hands.help(output.feet.shortfall[3:5], output.zmp, self.dt)
        self._move(reference, output)

    def _move(self, reference: WalkReference, output: StabilizerOutput) -> None:
        """Hand targets to the tasks."""
        self.arms.update(reference.feet, reference.heading)
        self.tasks.move_feet(reference)
        places = [foot.placement for foot in reference.feet]
        self.tasks.com.apply(reference.pendulum, reference.contact, places, reference.push)
        lean, body = self._lean(output), self.body
        if body.active:
            self.tasks.turn_trunk(
                reference.heading, body.leaned(lean, reference.heading), body.twist, by_waist=body.by_waist
            )
        else:
            self.tasks.turn_trunk(reference.heading, lean)

    def _hold(self, load: HeldLoad) -> None:
        """Follow the estimate of the load; the models have it from the next tick on."""
        outside = self.control.observer.outside
        assert outside is not None
        if self.hands is None or not self.hands.active:  # what they press on is no load
            load.update(outside, self.dt)
        mass = self._robot.mass
        if mass != self.stabilizer.mass:  # taken over, given back or let go of
            self.stabilizer.mass = mass
            self.walk.phases.weight = mass * GRAVITY
            if self.lean is not None:
                self.lean.bear(mass)

    def _estimate_bias(self, estimator: BiasEstimator) -> Array:
        """Bias of the measured DCM, shape (2,), m; the ZMP is that of the last tick, which has driven the DCM."""
        output, reference = self.output, self.reference
        if output is None or reference is None or output.in_air or not math.isfinite(output.measured_zmp[0]):
            return estimator.bias
        if self.load is not None and self.load.changing:
            estimator.pause()
            return estimator.bias
        return estimator.update(self._dcm, output.measured_zmp, reference.heading, self.walk.omega, self.dt)

    def _update_walk(self, bias: Array | None) -> WalkReference:
        dcm = self._dcm
        if bias is not None:
            dcm = dcm.copy()
            dcm[:2] -= bias
        if self.hands is not None and self.hands.active:  # the plan is that without hands
            dcm = dcm.copy()
            dcm[:2] -= self.hands.shift
        self.driver.update(self.time)
        # What hands hold pulls at the DCM and holds it as well: landings stay as planned.
        held = self.hands is not None and self.hands.gripping
        # Filtered loads: a foot that has just met the ground presses in jerks.
        load, told = self.control.observer.load.tolist(), None if held else dcm
        return self.walk.update(load, self._soles, told)

    def _switch_contacts(self, contact: tuple[bool, bool]) -> None:
        for side, stands in enumerate(contact):
            if stands != self._in_contact[side]:
                self.tasks.switch(side, stands)
                self.stabilizer.feet.reset(side)
        self._in_contact = contact
        self._area = self._support_area()

    def _lean(self, output: StabilizerOutput) -> LeanMotion:
        """Lean of the trunk that gives the moment which the feet cannot give."""
        if self.lean is None:
            return UPRIGHT
        x, y = (0.0, 0.0) if output.in_air else output.feet.shortfall[3:5].tolist()
        return self.lean.update((x, y), self.dt)

    def _support_area(self) -> tuple[Array, Array]:
        """Half-planes of the hull of both soles as they are now, for the fall test."""
        feet = tuple(
            replace(Footstep.of(side, sole), roll=0.0, pitch=0.0)
            for side, sole in zip(SIDES, self._soles, strict=True)
        )
        return support_area(feet, self._sizes)

    def _detect_fall(self) -> None:
        if self.reference is None:
            return
        estimate, pendulum = self.control.observer.robot, self.reference.pendulum
        normals, offsets = self._area
        dcm = self._dcm[:2]
        if self.hands is not None:
            dcm = dcm - self.hands.shift
        beyond = normals.dot(dcm)
        beyond -= offsets
        solution = self.control.solution
        self.falls.update(
            self.time,
            self.dt,
            q=estimate.q,
            v=estimate.v,
            drop=float(pendulum.com[2] - estimate.com[2]),
            torso_up=self._torso_up(),
            dcm_distance=float(beyond[beyond.argmax()]),
            solved=(solution is None or solution.ok) and not self.control.stopped,
        )

    def _torso_up(self) -> Array:
        """Vertical axis of the estimated torso in the world, shape (3,), for the fall test."""
        up: Array = self._torso.rotation[:, 2]
        return up
