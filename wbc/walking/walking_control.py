"""Control of a walk: planned steps and a stabilizer, in torque or hybrid control steps as they go as well.

Under torques the law changes while the robot stands:

    planned steps ── calm for a while; a push that the soles cannot hold; a velocity, a goal ──▶ steps as they go
          ◀── hands that press; footsteps on stairs ──

Both laws share robot, controller, drives, estimate, arms and body; source, tasks and balance are exchanged between two
ticks. In the middle of a step they are not: docs/measured.md has what was tried.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Annotated, Literal

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, shown
from wbc.base.settings import Angle, NonNegative, Number, Period
from wbc.core.drive.control import State
from wbc.core.estimation.inertial import InertialSettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.ground import KnownGround
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.bias import BiasEstimator
from wbc.tasks.stabilizer.lean import Lean
from wbc.tasks.stabilizer.stabilizer import Stabilizer
from wbc.walking.balance import Balance, Stabilized
from wbc.walking.body import Body
from wbc.walking.contact import GaitPhase
from wbc.walking.control import Law, ReferenceControl, drive_control
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.lipm.source import LipmWalk
from wbc.walking.lipm.walk import Walk
from wbc.walking.load import HeldLoad
from wbc.walking.plans.footsteps import FootstepPlan, heading
from wbc.walking.plans.sources import FootstepSource, Velocity, checked_velocity
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress, ReferenceSource
from wbc.walking.stepping.control import OBSERVER, SteppingControlSettings
from wbc.walking.stepping.source import SteppingWalk
from wbc.walking.stepping.tasks import stepping_tasks
from wbc.walking.tasks import stabilized_tasks

logger = logging.getLogger(__name__)

HOLDS = 1.0
"""Distance of the DCM of a robot that stands, in standing boxes of the stepping walk, from which on it steps: the soles
end at 1.5, but a step that begins there comes too late."""


STEPS = "the robot steps, and steps count no forces on hands: stop it, and press once it stands"
"""Reason for which hands of a robot that steps may not begin to press."""

CALM = 1.0
"""Default of `WalkingControl.calm`, s."""


class WalkingControl(ReferenceControl):
    """Control of a robot that stands, walks along a plan or where it is steered, and stands for ever.

        walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
        walking.velocity = (0.2, 0.0, 0.1)  # at any tick; None for a stand

    In torque and hybrid control it has both laws, unless it is told to have one, and changes between them while the
    robot stands. Stiff servos need planned steps.

    Attributes:
        settings: Settings.
        law: Name of the law now, "lipm" or "stepping".
        laws: The laws that it has.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        source: FootstepPlan | ReferenceSource,
        dt: Period,
        settings: WalkingControlSettings | None = None,
        *,
        law: Literal["auto", "lipm"] = "auto",
        stepping: SteppingControlSettings | None = None,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
        extent: tuple[float, float, float, float] | None = None,
        ground: KnownGround | None = None,
    ) -> None:
        """Make all parts for a robot that stands at the start; the walk begins with the first tick.

        Args:
            robot: The robot, standing; becomes the commanded one (position control) or the estimated one (torque).
            source: Footstep plan, of which timings are rounded to the control period; or any source of references,
                made with the same robot, which the stabilizer holds.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            law: "lipm" plans all steps, "auto" leaves them to the law that suits what is asked for.
            stepping: Settings of steps as they go; mode, falls, arms, safety and solver are those of `settings`.
            observer: Estimates the robot's state; a new one when None. Each law has time constants of its own for those
                that are the defaults of `InertialSettings`; others stay.
            stiffness: Sets the soles while they swing; needs feet of variable stiffness.
            extent: Least and greatest x, least and greatest y of the ground, m; endless when None. For a plan alone.
            ground: What is known of the ground, made with a robot of the same description that stands at the start;
                None walks blind.
        """
        if len(robot.soles) != 2:
            raise InputError(f"a walk needs a robot with a left and a right sole, got {len(robot.soles)}")
        self.settings = s = settings or WalkingControlSettings()
        torque, plan = s.mode != "position", None
        if isinstance(source, FootstepPlan):
            plan, source = source, LipmWalk(robot, source, dt, s, extent)
        elif source.by_steps:
            raise InputError(f"steps balance the robot in {shown(source)}: use its own control")
        steps = None
        if torque and plan is not None and law == "auto":
            by_steps = stepping or SteppingControlSettings()
            steps = SteppingWalk(robot, dt, by_steps.gait, by_steps.com_height)
        height = source.com_height
        if height is None:
            soles = [float(robot.placement(sole.frame).translation[2]) for sole in robot.soles]
            height = float(robot.com[2]) - 0.5 * (soles[0] + soles[1])
        controller = Controller(robot, dt, settings=s.solver)
        observer = observer or Observer(robot, adopt=torque)
        tasks = stabilized_tasks(controller, s.tasks, s.gains, s.distribution, observer.robot, torque=torque)
        arms = Arms(controller, tasks, dt, s.arms)
        body = Body(controller, height, dt, waist=steps is None, lift=self._lift)
        control = drive_control(s.mode, controller, observer, s.safety, feedforward=s.feedforward)
        given = observer.inertial.settings
        self._stabilized = Stabilized(control, tasks, arms, s, height)
        planned = Law(source, tasks, self._stabilized, given)
        self.laws = {"lipm": planned}
        self.law = "lipm"
        self._calm, self._stood = CALM, 0.0  # time of a stand by the law that plans, s
        self._before = 0  # steps done by laws before
        self._waiting: FootstepPlan | None = None  # until the robot stands
        super().__init__(planned, control, arms, body, stiffness, ground)
        self._steps = steps
        if steps is None or plan is None:
            return
        tasks.leave()
        others = stepping_tasks(controller, steps.gait)
        others.leave()
        tasks.enter(others)
        planned.balance.begin()
        self.laws["stepping"] = Law(steps, others, Balance(), _tuned(OBSERVER.inertial, given))
        if ground is not None:
            steps.see(ground)
        if not plan.climbs:
            self.change("stepping")
            if plan.steps:
                self.follow(plan)

    @property
    def calm(self) -> float:
        """Time of a stand after planned steps from which on the robot is ready to step out of pushes, s; assign it."""
        return self._calm

    @calm.setter
    @checked
    def calm(self, value: Annotated[NonNegative, "s"]) -> None:
        self._calm = value

    @property
    def walk(self) -> Walk:
        """Phases, pattern and planned steps of a LIPM walk."""
        if not isinstance(self.source, LipmWalk):
            raise InputError(f"only a LIPM walk has phases and a pattern, got {shown(self.source)}")
        return self.source.walk

    def _lift(self) -> float:
        """Return the height by which the law now lifts feet, m."""
        return self.source.lift()

    @property
    def stands(self) -> bool:
        """True if the robot stands, and may change its law."""
        reference = self.reference
        return reference is None or (reference.phase is GaitPhase.STANDING and not self._pressing)

    @property
    def _idle(self) -> bool:
        """True if the robot stands and has no step to take."""
        return self.stands and (self.law == "stepping" or self.source.finished)

    @property
    def _pressing(self) -> bool:
        return bool(self.controller.robot.frames) and self.law == "lipm" and self.hands.active

    def change(self, law: Literal["lipm", "stepping"]) -> None:
        """Change the law of a robot that stands; all orders before are forgotten."""
        if choose("law", law, self.laws) == self.law:
            return
        if not self.stands:
            raise InputError(f"the law changes while the robot stands; it is in {self.progress.phase.value}")
        logger.info("law of the walk: %s", law)
        self._before = self.progress.steps_done
        towards = heading(self.controller.robot.placement(self.controller.robot.base_frame).rotation)
        if self.reference is not None:
            towards = self.reference.heading
        old, self.law = self.laws[self.law], law
        new, reason = self.laws[law], self.source.reason
        self.arms.follow(new.tasks)
        old.tasks.leave()
        new.tasks.enter(old.tasks)
        new.source.begin(towards)
        new.source.reason = reason  # of the last order, until the next one
        self.source, self.tasks, self.balance, estimate = new
        self.balance.begin()
        self.control.dcm_limit = self.balance.dcm_limit
        if estimate is not None:
            self.control.observer.retune(estimate)
        if self.source.com_height is not None:
            self.body.follow(self.source.com_height, self.tasks.reaching)
        self._stood = 0.0

    def _prefer(self, law: Literal["lipm", "stepping"]) -> None:
        """Change the law of a robot that stands and has no step to take, if it has another one."""
        if law != self.law and law in self.laws and self._idle:
            self.change(law)

    def _follow(self, state: State) -> None:
        """Change the law if the stand asks for it, and set the targets of this tick."""
        if self._steps is not None:
            self._choose_law(state, self._steps)
        super()._follow(state)

    def _choose_law(self, state: State, steps: SteppingWalk) -> None:
        """Change the law of a robot that stands for hands, for a push, for a plan that waits, and once it is calm."""
        at_hand = self._at_hand()
        calm = self.stands and self.source.finished
        if self.law == "stepping" and at_hand and self.stands:
            self.change("lipm")
        elif calm and self.law == "lipm" and steps.leaves(state, HOLDS):
            self.change("stepping")  # which steps out in this tick
        elif calm and self._waiting is not None:
            plan, self._waiting = self._waiting, None
            self.follow(plan)
        elif calm and self.law == "lipm" and not at_hand:
            self._stood += self.dt
            if self._stood > self._calm:
                self.change("stepping")
        elif not calm:
            self._stood = 0.0
        if self.controller.robot.frames:
            self.hands.barred = "" if self.law == "lipm" or self.stands else STEPS

    def _at_hand(self) -> bool:
        """Return True while hands press, grip, or go to where they are to: the law counts their forces."""
        return bool(self.controller.robot.frames) and (self.hands.wanted or self._pressing)

    @property
    def progress(self) -> Progress:
        """Phase and steps now, those by laws before with them."""
        progress = super().progress
        return progress._replace(steps_done=progress.steps_done + self._before)

    @property
    def finished(self) -> bool:
        """True when all that was asked for is done and the robot stands; False for an order that was dropped."""
        return super().finished and self._waiting is None

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, dropped, or ended by a fall."""
        return (super().done and self._waiting is None) or self.fallen is not None

    @property
    def hands(self) -> Hands:
        """Hands that press on things and hold on to them; a robot that stands changes its law once they are to.

        An `InputError` for a robot without hands.
        """
        return self._stabilized.hands

    @property
    def stabilizer(self) -> Stabilizer | None:
        """Feedback and admittances of planned steps; gains that are set count whenever that law balances the robot."""
        return self._stabilized.stabilizer

    @property
    def lean(self) -> Lean | None:
        """Lean of the trunk in planned steps; None keeps it upright."""
        return self._stabilized.lean

    @property
    def bias(self) -> BiasEstimator | None:
        """Estimator of the error of the DCM in planned steps; None takes it as measured."""
        return self._stabilized.bias

    @property
    def load(self) -> HeldLoad | None:
        """Load in the hands as estimated in planned steps; None where none is expected."""
        return self._stabilized.load

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity; a robot that stands steps as it goes."""
        return self.source.velocity

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        self._waiting = None
        if any(checked_velocity(velocity)):
            self._prefer("stepping")
        ReferenceControl.velocity.__set__(self, velocity)  # type: ignore[attr-defined]

    @checked
    def go_to(self, x: Annotated[Number, "m"], y: Annotated[Number, "m"], yaw: Angle) -> None:
        """Walk to a place (m) and heading (rad), and stand there; see `ReferenceControl.go_to`."""
        self._waiting = None
        self._prefer("stepping")
        super().go_to(x, y, yaw)

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a planner at once, from a plan when the robot stands."""
        self._waiting, plan = None, source if isinstance(source, FootstepPlan) else None
        if self.law == "stepping" and plan is not None and not self._idle:
            self.source.stop()
            self._waiting, self.stopped = plan, False
            return
        if self.law == "stepping" and plan is not None and plan.climbs:
            self.change("lipm")
        super().follow(source)

    def stop(self) -> None:
        """Come to a stand safely."""
        self._waiting = None
        super().stop()


def _tuned(law: InertialSettings, given: InertialSettings) -> InertialSettings:
    """Return the time constants of a law, but those that are given and not the defaults."""
    usual = InertialSettings()
    set_ = {
        f.name: value for f in fields(given) if (value := getattr(given, f.name)) != getattr(usual, f.name)
    }
    return replace(law, **set_)
