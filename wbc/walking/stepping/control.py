"""A stepping walk as whole-body control: a measurement in, a command out.

gait        place and time of the next step, swing foot, height of the CoM   `wbc.walking.stepping.gait`
tasks       these as targets of tasks and contacts                           `wbc.walking.stepping.tasks`
controller  all tasks and contacts as one QP                                 `wbc.core.qp.controller`
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Annotated

import numpy as np

from wbc.core.arguments import checked
from wbc.core.control import FEET_STEP, Mode, SafetySettings, State
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import as_period
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.qp.controller import Controller
from wbc.core.qp.solver import SolverSettings
from wbc.core.robot import Robot
from wbc.core.settings import Positive, settings
from wbc.core.signals import Command, Measurement
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.lean import UPRIGHT
from wbc.walking.body import Body
from wbc.walking.falls import FallDetector, FallReason, FallSettings
from wbc.walking.hands.reaching import Arms, ArmSettings
from wbc.walking.planning.footsteps import heading
from wbc.walking.planning.phases import Phase
from wbc.walking.planning.sources import Velocity
from wbc.walking.progress import Progress, VelocityLimits, with_sole_stiffness
from wbc.walking.stepping.gait import BodyState, SteppingGait, StepReference
from wbc.walking.stepping.settings import Scale, SteppingSettings
from wbc.walking.stepping.tasks import SteppingGains, SteppingTasks

OBSERVER = ObserverSettings(inertial=InertialSettings(velocity_time_constant=0.2, yaw_time_constant=1000.0))
"""Estimate of a robot on points: feet that turn on a stone say little about velocity and nothing about heading."""


@settings
class SteppingControlSettings:
    """Settings of a stepping walk.

    Attributes:
        mode: "torque": torques are sent; "hybrid": torques, with the machine's soft servos around the motion that they
            make; "position": stiff servos follow that motion.
        com_height: Height of the CoM over the soles while walking, m; from `gait.bend` when None.
        gait: Law of the steps.
        tasks: Weights and gains of the tasks.
        falls: Limits beyond which the robot has fallen.
        arms: Hands with targets, and arms that swing.
        safety: Ranges of measurements and commands.
        solver: Solver of the QP.
    """

    mode: Mode = "torque"
    com_height: Annotated[Positive, "m"] | None = None
    gait: SteppingSettings = field(default_factory=SteppingSettings)
    tasks: SteppingGains = field(default_factory=SteppingGains)
    falls: FallSettings = field(default_factory=FallSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    solver: SolverSettings = field(default_factory=SolverSettings)


class SteppingControl:
    """Controller of a robot that balances by its steps: it stands, walks where it is steered, and stands.

        walking = SteppingControl(robot, plant.control_period)
        walking.velocity = (0.4, 0.0, 0.0)  # at any tick; None for a stand

    Attributes:
        settings: Settings.
        dt: Control period, s.
        gait: Law of the steps.
        falls: Fall detector.
        controller: Whole-body controller with all tasks and contacts of the walk.
        tasks: The tasks and contacts.
        arms: Hands, which can be given targets at any tick.
        body: Height of the CoM, lean and turn of the trunk, and gaze, which can be set at any tick.
        control: Position, torque or hybrid control, with the observer.
        stiffness: Scheduler that sets the soles while they swing; None leaves them alone.
        output: None: no stabilizer runs; so are `stabilizer`, `lean`, `bias`, `hands` and `load`.
        reference: References of the last tick with a good measurement; None before the first one.
        time: Time since the start, s.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: float,
        settings: SteppingControlSettings | None = None,
        *,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
    ) -> None:
        """Make all parts for a robot that stands.

        Args:
            robot: The robot, standing.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            observer: Estimates the robot's state; a new one when None.
            stiffness: Sets the soles while they swing; needs feet of variable stiffness.

        Raises:
            InputError: A robot without two feet, or steps that cannot be walked.
        """
        self.settings = s = settings or SteppingControlSettings()
        self.dt = as_period(dt)
        scale = Scale.of(robot, s.gait.bend, s.com_height)
        yaw = heading(robot.placement(robot.base_frame).rotation)
        self.gait = SteppingGait(s.gait, scale, yaw, self.dt)
        self.falls = FallDetector(s.falls)
        self.controller = Controller(robot, dt, settings=s.solver)
        self.tasks = SteppingTasks(self.controller, self.gait.settings, s.tasks, scale)
        self.arms = Arms(self.controller, self.tasks.com, self.tasks.posture, self.dt, s.arms)
        self.body = Body(self.controller, scale.height, self.dt, waist=False)
        self.control: PositionControl | TorqueControl
        if s.mode == "position":
            observer = observer or Observer(robot, OBSERVER)
            self.control = PositionControl(self.controller, observer, feedback="closed", safety=s.safety)
        else:
            observer = observer or Observer(robot, OBSERVER, adopt=True)
            kind = HybridControl if s.mode == "hybrid" else TorqueControl
            self.control = kind(self.controller, observer, safety=s.safety)
        self.control.reach = FEET_STEP
        self.stiffness = stiffness
        self.reference: StepReference | None = None
        self.time = 0.0
        estimate = self.control.observer.robot
        self._frames = tuple(estimate.placement(sole.frame) for sole in estimate.soles)
        self._torso = estimate.placement(estimate.torso_frame)

    output = stabilizer = lean = bias = hands = load = None

    @property
    def finished(self) -> bool:
        """True when nothing asks for steps and the robot has stood for as long as a step takes."""
        return self.gait.stands and not self.gait.steering.pending

    @property
    def steered(self) -> bool:
        """True: no footsteps are planned."""
        return True

    @property
    def progress(self) -> Progress:
        """Phase and steps now."""
        gait, reference = self.gait, self.reference
        if reference is None:
            return Progress(Phase.STANDING, None, gait.stance, 0, 0.0, 0.0, (), gait.settings.step_time)
        return Progress(
            reference.phase,
            1 - reference.stance if reference.phase is Phase.SINGLE else None,
            reference.stance,
            reference.step,
            reference.elapsed,
            reference.duration,
            () if reference.landing is None else (reference.landing,),
            gait.settings.step_time,
        )

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall; None while it has not fallen."""
        return self.falls.reason

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, or ended by a fall."""
        return self.finished or self.fallen is not None

    @property
    def steps_done(self) -> int:
        """Steps that have ended."""
        return self.gait.steps_done

    def stop(self) -> None:
        """Come to a stand."""
        self.gait.steering.command(None)

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity: forward (m/s), left (m/s) and turn (rad/s); None for a stand, or with a goal.

        Set it at any tick. A velocity that is not three finite numbers up to 10 is an `InputError`; one that cannot be
        had is limited (`granted_velocity`).
        """
        return self.gait.steering.target

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        self.gait.steering.command(velocity)

    @property
    def granted_velocity(self) -> Velocity:
        """Velocity of the steps now: forward (m/s), left (m/s) and turn (rad/s)."""
        steering = self.gait.steering
        turn = 0.0 if steering.target is None else steering.limited(steering.target)[2]
        return (*steering.velocity, turn)

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Greatest velocities that are granted."""
        return self.gait.steering.limits

    @checked
    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the robot in the world, m.
            y: Place of the robot in the world, m.
            yaw: Heading there, rad.
        """
        self.gait.steering.go_to(x, y, yaw)

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
            except Exception as error:  # of hands, or of steering, of the user's own
                state = self.control.refuse(state, error)
        command = self.control.act(state)
        self._detect_fall()
        return with_sole_stiffness(command, self)

    def _set_targets(self, state: State) -> None:
        """Set the targets of all tasks and contacts of this tick."""
        estimate, (left, right) = state.robot, self._frames
        body = BodyState(
            estimate.com.tolist(),
            estimate.com_velocity.tolist(),
            estimate.data.hg.angular.tolist(),
            (left.translation.tolist(), right.translation.tolist()),
            (left.rotation.tolist(), right.rotation.tolist()),
            state.measurement.wrenches.tolist(),
        )
        self.reference = reference = self.gait.update(body, (left, right))
        self.arms.update(reference.feet, reference.heading)
        points = self.body
        if points.active:
            points.update(reference.heading)
            self.reference = reference = reference._replace(pendulum=points.raised(reference.pendulum))
            self.tasks.follow(reference, points.leaned(UPRIGHT, reference.heading), points.twist)
        else:
            self.tasks.follow(reference)

    def _detect_fall(self) -> None:
        if self.reference is None:
            return
        estimate, pendulum = self.control.observer.robot, self.reference.pendulum
        solution = self.control.solution
        self.falls.update(
            self.time,
            self.dt,
            q=estimate.q,
            v=estimate.v,
            drop=float(pendulum.com[2] - estimate.com[2]),
            torso_up=np.array(self._torso.rotation[:, 2]),
            solved=(solution is None or solution.ok) and not self.control.stopped,
        )
