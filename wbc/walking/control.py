"""A walk as whole-body control: references and stabilizer become targets of tasks and contacts, tick by tick.

    walk        where pendulum and feet should be, and which feet stand     `wbc.walking.walk`
    stabilizer  what the feet should press, and how they yield              `wbc.walking.stabilizer.stabilizer`
    controller  all of it as one quadratic program                          `wbc.core.qp.controller`

In position control the feet yield to the wrenches that they feel, the program moves the commanded robot, and the servos
get the torques of the desired wrenches on top. In torque control the desired acceleration of the CoM and the desired
wrenches are tasks of the program itself.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin

from wbc.core.control import PositionControl, TorqueControl
from wbc.core.errors import Array, InputError, positive, scalar
from wbc.core.estimation.observer import Observer
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solution import Solution
from wbc.core.qp.solver import SolverSettings
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.settings import Positive, settings
from wbc.core.signals import Command, Measurement
from wbc.tasks.force.wrench import WrenchTask
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.walking.falls import FallDetector, FallReason, FallSettings
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan, heading
from wbc.walking.planning.schedule import support_area
from wbc.walking.stabilizer.bias import BiasEstimator, BiasSettings
from wbc.walking.stabilizer.distribution import DistributionSettings, WrenchDistribution
from wbc.walking.stabilizer.gains import StabilizerGains
from wbc.walking.stabilizer.lean import UPRIGHT, Lean, LeanSettings
from wbc.walking.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.walk import Walk, WalkReference, WalkSettings

Mode = Literal["position", "torque"]


@settings
class TaskGains:
    """Weights and gains of the tasks of a walk; damping is critical.

    Attributes:
        com_weight: Cost per (m/s²)².
        com_stiffness: 1/s².
        swing_weight: Pose of the foot in the air, cost per (m/s²)² and (rad/s²)².
        swing_stiffness: 1/s².
        orientation_weight: Pelvis and torso, cost per (rad/s²)².
        orientation_stiffness: 1/s².
        posture_weight: All joints, cost per (rad/s²)².
        posture_stiffness: 1/s².
        contact_stiffness: How fast a standing foot follows its corrections in position control, 1/s².
        contact_return: How fast a standing foot is drawn back in torque control, 1/s².
        wrench_weight: Desired foot wrenches in torque control, cost per N² and (Nm)².
    """

    com_weight: Positive = 100.0
    com_stiffness: Annotated[Positive, "1/s²"] = 100.0
    swing_weight: Positive = 1000.0
    swing_stiffness: Annotated[Positive, "1/s²"] = 400.0
    orientation_weight: Positive = 10.0
    orientation_stiffness: Annotated[Positive, "1/s²"] = 100.0
    posture_weight: Positive = 0.1
    posture_stiffness: Annotated[Positive, "1/s²"] = 20.0
    contact_stiffness: Annotated[Positive, "1/s²"] = 1000.0
    contact_return: Annotated[Positive, "1/s²"] = 100.0
    wrench_weight: Positive = 1e-3


@settings
class WalkingControlSettings:
    """Everything about a walk but its footsteps.

    Attributes:
        mode: "position": servos follow an integrated motion; "torque": torques are sent.
        com_height: Height of the CoM over the support while walking, m, reached in the first double support; that of
            the robot as it stands when None.
        feedforward: In position control, add the torques of the desired wrenches to the servos.
        walk: Phases, pattern, step adjustment.
        gains: Of the stabilizer.
        distribution: Of the desired wrench over the feet; a CoP asked for at the very edge tips the foot.
        tasks: Of the tasks.
        falls: When the robot counts as fallen.
        lean: Lean of the trunk where the feet cannot give the moment that is wanted; None keeps it upright.
        bias: Estimate a constant error of the measured CoM and DCM from how the ZMP drives them, and take it off:
            sensors and models are off by millimetres. None believes them.
    """

    mode: Mode = "position"
    com_height: Annotated[Positive, "m"] | None = None
    feedforward: bool = True
    walk: WalkSettings = field(default_factory=WalkSettings)
    gains: StabilizerGains = field(default_factory=StabilizerGains)
    distribution: DistributionSettings = field(default_factory=lambda: DistributionSettings(margin=0.008))
    tasks: TaskGains = field(default_factory=TaskGains)
    falls: FallSettings = field(default_factory=FallSettings)
    lean: LeanSettings | None = field(default_factory=LeanSettings)
    bias: BiasSettings | None = field(default_factory=lambda: BiasSettings(drift_std=0.002))


class WalkingControl:
    """Walks a robot along a footstep plan: measurement in, command out.

    Attributes:
        controller: The whole-body controller, with all tasks and contacts of the walk.
        control: Position or torque control, with the observer.
        walk: Phases and references.
        stabilizer: Feedback and admittances.
        settings: Settings.
        reference: References of the last tick with a good measurement; None before the first one.
        output: What the stabilizer said in that tick; None before the first one.
        stiffness: Sets the soles while they swing; None leaves them alone.
        lean: Lean of the trunk; None keeps it upright.
        bias: Estimator of the error of the measured DCM; None believes it.
        falls: Tells whether the robot has fallen, and why.
        time: Since the start, s.
    """

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
        """Make everything ready for a robot that stands at the start of a plan; the walk begins with the first tick.

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
        _check_start(robot, plan)
        self.settings = s = settings or WalkingControlSettings()
        self.dt = positive("control period (s)", dt)
        self._robot, self._torque = robot, s.mode == "torque"
        # Of the robot that the program moves: the commanded one, or the estimated one in torque control.
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        ground = 0.5 * (plan.left.z + plan.right.z)
        height = float(robot.com[2]) - ground if s.com_height is None else s.com_height
        self.walk = Walk(robot, plan, height, dt, s.walk, extent=extent, com=np.array(robot.com))
        self._omega = scalar(self.walk.omega)
        self._sizes = tuple((sole.length, sole.width) for sole in robot.soles)
        self.stabilizer = Stabilizer(robot.mass, WrenchDistribution(self._sizes, s.distribution), s.gains)
        # On steep ground a leg may be too short for where its foot should be: do what can be done.
        self.controller = Controller(robot, dt, settings=SolverSettings(relaxation=1e4))
        self.lean = None if s.lean is None else Lean(robot.mass, height, s.lean)
        self.bias = None if s.bias is None else BiasEstimator(s.bias)
        self._add_tasks(s.tasks)
        self.control: PositionControl | TorqueControl
        if self._torque:
            self.control = TorqueControl(self.controller, observer, prepare=self._prepare)
        else:
            feedforward = self._feedforward if s.feedforward else False
            self.control = PositionControl(
                self.controller, observer, prepare=self._prepare, feedforward=feedforward
            )
        self.stiffness = stiffness
        self.falls = FallDetector(s.falls)
        self.reference: WalkReference | None = None
        self.output: StabilizerOutput | None = None
        self.time = 0.0
        self._in_contact = (True, True)
        self._wrench_targets = np.zeros((2, 6))
        self._dcm = np.zeros(3)  # as measured, with its bias
        estimate = self.control.observer.robot
        self._torso = estimate.placement(estimate.torso_frame)
        self._estimated_soles = [estimate.placement(sole.frame) for sole in estimate.soles]
        if len(plan):
            self.walk.start()
        self._update_area()

    def _add_tasks(self, gains: TaskGains) -> None:
        c, robot = self.controller, self._robot
        self._com = c.add(CoMTask(weight=gains.com_weight, stiffness=gains.com_stiffness))
        if self._torque:  # horizontally the stabilizer says what to do; the task holds the height
            vertical = 2.0 * math.sqrt(gains.com_stiffness)
            self._com.stiffness, self._com.damping = (0.0, 0.0, gains.com_stiffness), (0.0, 0.0, vertical)
        self._swings = [
            c.add(
                PoseTask(sole.frame, name=f"{sole.name} swing", weight=0.0, stiffness=gains.swing_stiffness)
            )
            for sole in robot.soles
        ]
        upright = {"pelvis": robot.base_frame, "torso": robot.torso_frame}
        if robot.torso_frame == robot.base_frame:
            del upright["torso"]
        self._upright = [
            c.add(
                OrientationTask(
                    frame, name=name, weight=gains.orientation_weight, stiffness=gains.orientation_stiffness
                )
            )
            for name, frame in upright.items()
        ]
        back = _turn(-heading(robot.placement(robot.base_frame).rotation))
        self._tilts = [back @ task.target for task in self._upright]
        self._heading: float | None = None  # that the targets of these tasks are for
        self._leaning = UPRIGHT  # and the lean
        c.add(PostureTask(weight=gains.posture_weight, stiffness=gains.posture_stiffness), JointLimits())
        self._contacts = [
            c.add(
                SoleContact(
                    sole.name,
                    min_force=0.0,
                    margin=0.0,
                    ramp=0.0,
                    stiffness=gains.contact_return if self._torque else gains.contact_stiffness,
                    # The program's own wrenches play no part in position control: they must not bind.
                    friction=self.settings.distribution.friction if self._torque else 2.0,
                )
            )
            for sole in robot.soles
        ]
        self._wrenches: list[WrenchTask] = []
        if self._torque:
            c.add(TorqueLimits())
            self._wrenches = [
                c.add(WrenchTask(contact, weight=gains.wrench_weight)) for contact in self._contacts
            ]

    # What one asks for

    @property
    def finished(self) -> bool:
        """True when the plan is walked and the robot stands."""
        return self.walk.finished

    @property
    def fallen(self) -> FallReason | None:
        """Why the robot has fallen; None while it has not."""
        return self.falls.reason

    @property
    def steps_done(self) -> int:
        """Single supports that have ended; a foot that found no ground is taken to stand where it is."""
        return self.walk.steps_done

    def stop(self) -> None:
        """Come to a stand safely."""
        self.walk.stop()

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: What the sensors say now.

        Returns:
            What the drives should do until the next tick. Nothing is raised: a tick that fails follows the policy of
            the control.
        """
        self.time += self.dt
        command = self.control.command(measurement)
        self._watch()
        if self.stiffness is None:
            return command
        phases = self.walk.phases
        progress = min(phases.elapsed / max(phases.duration, self.dt), 1.0)
        left = max(phases.duration - phases.elapsed, 0.0)
        swing, estimate = phases.swing, self.control.observer.robot
        landing = None if swing is None else phases.plan.steps[phases.step].position
        soles = self.stiffness.update(swing, progress, left, estimate, measurement, landing)
        return replace(command, sole_stiffness=soles)

    # The tick

    def _prepare(self, estimate: Robot, measurement: Measurement) -> None:
        """Set all targets of this tick."""
        com, velocity = np.array(estimate.com), np.array(estimate.com_velocity)
        self._dcm = dcm = com + velocity / self._omega
        wrenches = measurement.sole_wrench
        # Filtered loads: a foot that has just met the ground presses in jerks.
        loads = self.control.observer.load.tolist()
        bias = None if self.bias is None else self._estimate_bias(dcm)
        if bias is not None:
            dcm = dcm.copy()
            dcm[:2] -= bias
        self.reference = reference = self.walk.update(loads, self._soles, dcm)
        if reference.contact != self._in_contact:
            self._switch_contacts(reference)
        self.output = output = self.stabilizer.update(
            reference.pendulum,
            com,
            velocity,
            wrenches,
            self._estimated_soles,
            reference.contact,
            reference.heading,
            self.dt,
            bias=bias,
        )
        self._wrench_targets = output.feet.wrenches
        self._move_feet(reference, output)
        self._move_body(reference, output)

    def _estimate_bias(self, dcm: Array) -> Array:
        """What the measured DCM has too much, shape (2,), m; the ZMP is that of the last tick, which has driven it."""
        assert self.bias is not None
        output, reference = self.output, self.reference
        if output is None or reference is None or output.in_air or not np.isfinite(output.measured_zmp[0]):
            return self.bias.bias
        return self.bias.update(dcm, output.measured_zmp, reference.heading, self.walk.omega, self.dt)

    def _switch_contacts(self, reference: WalkReference) -> None:
        for side, contact in enumerate(self._contacts):
            if contact.active != reference.contact[side]:
                contact.active = reference.contact[side]
                self._swings[side].weight = 0.0 if contact.active else self.settings.tasks.swing_weight
                self.stabilizer.feet.reset(side)
        self._in_contact = reference.contact
        self._update_area()

    def _move_feet(self, reference: WalkReference, output: StabilizerOutput) -> None:
        for side, contact in enumerate(self._contacts):
            motion = reference.feet[side]
            if not reference.contact[side]:
                self._swings[side].follow(motion.placement, motion.velocity, motion.acceleration)
            elif self._torque:
                self._wrenches[side].target = output.feet.wrenches[side]
            else:
                motion = output.corrections[side].apply(motion)
                to_sole = motion.placement.rotation.T
                velocity = to_sole.dot(motion.velocity.reshape(2, 3).T).T.reshape(6)
                contact.follow(motion.placement, velocity)

    def _move_body(self, reference: WalkReference, output: StabilizerOutput) -> None:
        pendulum = reference.pendulum
        com, velocity, acceleration = pendulum.com, pendulum.com_velocity, pendulum.com_acceleration
        if self._torque:
            acceleration = acceleration.copy()
            acceleration[:2] = output.com_acceleration[:2]
        elif not self.stabilizer.com_still:
            com, velocity, acceleration = com.copy(), velocity.copy(), acceleration.copy()
            com[:2] += output.com_offset
            velocity[:2] += output.com_velocity_offset
            acceleration[:2] += output.com_acceleration_offset
        self._com.follow(com, velocity, acceleration)
        lean = UPRIGHT
        if self.lean is not None:
            x, y = (0.0, 0.0) if output.in_air else output.feet.shortfall[3:5].tolist()
            lean = self.lean.update((x, y), self.dt)
        if reference.heading != self._heading or lean is not self._leaning:
            self._heading, self._leaning = reference.heading, lean
            turn = lean.rotation.dot(_turn(reference.heading))
            for task, tilt in zip(self._upright, self._tilts, strict=True):
                task.follow(turn.dot(tilt), lean.velocity, lean.acceleration)

    def _feedforward(self, solution: Solution) -> Array:
        """Joint torques of the commanded motion with the desired foot wrenches in place of the program's own."""
        x = solution.variables.copy()
        x[solution.layout.nv :] = self._wrench_targets.reshape(-1)
        torques: Array = np.dot(self.controller.problem.torque_matrix, x)
        torques += self._robot.bias[BASE_DOF:]
        return torques

    def _update_area(self) -> None:
        """Hull of the feet, for the fall test."""
        feet = tuple(
            replace(Footstep.of(side, X), roll=0.0, pitch=0.0)
            for side, X in zip(SIDES, self._soles, strict=True)
        )
        self._area = support_area(feet, self._sizes)

    def _watch(self) -> None:
        """Notice a fall."""
        if self.reference is None:
            return
        estimate, pendulum = self.control.observer.robot, self.reference.pendulum
        normals, offsets = self._area
        beyond = normals.dot(self._dcm[:2])
        beyond -= offsets
        solution = self.control.solution
        self.falls.update(
            self.time,
            self.dt,
            q=estimate.q,
            v=estimate.v,
            drop=float(pendulum.com[2] - estimate.com[2]),
            torso_up=self._torso.rotation[:, 2],
            dcm_distance=float(beyond[beyond.argmax()]),
            solved=(solution is None or solution.ok) and not self.control.stopped,
        )


def _check_start(robot: Robot, plan: FootstepPlan) -> None:
    """Refuse a plan that begins elsewhere than where the robot stands.

    Raises:
        InputError: A sole is further from its place in the plan than a step could hide.
    """
    for sole, foot in zip(robot.soles, (plan.left, plan.right), strict=True):
        stands = Footstep.of(foot.side, robot.placement(sole.frame))
        forward, left, up, turn = stands.seen_from(foot)
        if math.hypot(forward, left) > 0.02 or abs(up) > 0.05 or abs(turn) > 0.05:
            planned, real = (
                f"({X.x:.3f}, {X.y:.3f}, {X.z:.3f}) m and {X.yaw:.3f} rad" for X in (foot, stands)
            )
            raise InputError(
                f"the plan must begin where the robot stands, within 0.02 m (0.05 m in height) and 0.05 rad; its "
                f"{foot.side} foot is at {planned}, that of the robot at {real}"
            )


def _turn(yaw: float) -> Array:
    """Rotation about the vertical."""
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, yaw))
