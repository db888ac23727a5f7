"""A walk whose law changes while the robot stands: steps as they go, and planned steps for hands and high steps.

    planned steps ── calm for a while; a push that the soles cannot hold; a velocity, a goal ──▶ steps as they go
          ◀── hands that press; footsteps on stairs ──

Both laws share robot, controller, drives, estimate, arms and body; source, tasks and balance are exchanged between two
ticks. In the middle of a step they are not: docs/walking.md has what was tried.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated, Literal

from wbc.core.control import Mode, State
from wbc.core.errors import InputError, as_period
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.core.settings import NonNegative, settings
from wbc.ground import KnownGround
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.walking.balance import Balance, Stabilized
from wbc.walking.body import Body
from wbc.walking.contact import GaitPhase
from wbc.walking.control import Law, ReferenceControl, drive_control
from wbc.walking.falls import FallSettings
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.lipm.source import LipmWalk
from wbc.walking.plans.footsteps import FootstepPlan, heading
from wbc.walking.plans.sources import FootstepSource, Velocity, checked_velocity
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress
from wbc.walking.stepping.control import OBSERVER, SteppingControlSettings
from wbc.walking.stepping.source import SteppingWalk
from wbc.walking.stepping.tasks import stepping_tasks
from wbc.walking.tasks import stabilized_tasks

logger = logging.getLogger(__name__)

HOLDS = 1.0
"""Distance of the DCM of a robot that stands, in standing boxes of the stepping walk, from which on it steps: the soles
end at 1.5, but a step that begins there comes too late."""


@settings
class AutoControlSettings:
    """Settings of a walk whose law changes.

    Attributes:
        mode: "torque" or "hybrid": a stepping walk on stiff servos has another period and other references.
        lipm: Settings of the law that plans; its falls, arms, safety and solver count for both.
        stepping: Settings of the law that decides steps as they go.
        calm: Time of a stand after planned steps from which on the robot is ready to step out of pushes, s.
    """

    mode: Mode = "torque"
    lipm: WalkingControlSettings = field(default_factory=WalkingControlSettings)
    stepping: SteppingControlSettings = field(default_factory=SteppingControlSettings)
    calm: Annotated[NonNegative, "s"] = 1.0

    def __post_init__(self) -> None:
        if self.mode == "position":
            raise InputError("a walk whose law changes is in torque or hybrid control, got mode 'position'")

    @property
    def falls(self) -> FallSettings:
        """Limits beyond which the robot has fallen."""
        return self.lipm.falls


class AutoControl(ReferenceControl):
    """Control of a robot that walks by the law that suits what is asked for, and changes it while it stands.

        walking = AutoControl(robot, plant.control_period)
        walking.velocity = (0.3, 0.0, 0.0)
        walking.follow(plan)  # comes to a stand first

    Attributes:
        law: Name of the law now, "lipm" or "stepping".
        laws: Both laws.
    """

    def __init__(
        self,
        robot: Robot,
        dt: float,
        settings: AutoControlSettings | None = None,
        *,
        plan: FootstepPlan | None = None,
        observer: Observer | None = None,
        stiffness: StiffnessScheduler | None = None,
        extent: tuple[float, float, float, float] | None = None,
        ground: KnownGround | None = None,
    ) -> None:
        """Make all parts for a robot that stands.

        Args:
            robot: The robot, standing.
            dt: Control period, s.
            settings: Settings; the defaults when None.
            plan: Footsteps to begin with; a stand when None.
            observer: This and the others: see `WalkingControl`.
            stiffness: See there.
            extent: See there.
            ground: See there.
        """
        self.settings = s = settings or AutoControlSettings()
        dt, lipm = as_period(dt), replace(s.lipm, mode=s.mode)
        controller = Controller(robot, dt, settings=lipm.solver)
        observer = observer or Observer(robot, adopt=True)
        given = plan or FootstepPlan.standing(robot)
        planned = LipmWalk(robot, given, dt, lipm, extent)
        stepping = SteppingWalk(robot, dt, s.stepping.gait, s.stepping.com_height)
        tasks = stabilized_tasks(
            controller, lipm.tasks, lipm.gains, lipm.distribution, observer.robot, torque=True
        )
        height = planned.com_height
        arms = Arms(controller, tasks.com, tasks.posture, dt, lipm.arms)
        body = Body(controller, height, dt, waist=False, lift=self._lift)
        control = drive_control(s.mode, controller, observer, lipm.safety)
        first = Law(
            planned, tasks, Stabilized(control, tasks, arms, lipm, height), observer.inertial.settings
        )
        tasks.leave()
        others = stepping_tasks(controller, stepping.gait)
        others.leave()
        tasks.enter(others)
        first.balance.begin()
        self.laws = {"lipm": first, "stepping": Law(stepping, others, Balance(), OBSERVER.inertial)}
        self.law = "lipm"
        self._stood = 0.0  # time of a stand by the law that plans, s
        self._handy = False  # hands have been asked for: the law that counts their forces stays
        self._before = 0  # steps done by laws before
        self._waiting: FootstepPlan | None = None  # until the robot stands
        super().__init__(first, control, arms, body, lipm.falls, stiffness, ground)
        if ground is not None:
            stepping.see(ground)
        if plan is None or not plan.climbs:
            self.change("stepping")
            if plan is not None:
                self.follow(plan)

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
        balance = self.laws["lipm"].balance
        return bool(self.controller.robot.frames) and self.law == "lipm" and balance.hands.active

    def change(self, law: Literal["lipm", "stepping"]) -> None:
        """Change the law of a robot that stands; all orders before are forgotten."""
        if law == self.law:
            return
        if not self.stands:
            raise InputError(f"the law changes while the robot stands; it is in {self.progress.phase.value}")
        logger.info("law of the walk: %s", law)
        self._before = self.progress.steps_done
        towards = heading(self.controller.robot.placement(self.controller.robot.base_frame).rotation)
        if self.reference is not None:
            towards = self.reference.heading
        old, self.law = self.laws[self.law], law
        new = self.laws[law]
        old.tasks.leave()
        new.tasks.enter(old.tasks)
        new.source.begin(towards)
        self.source, self.tasks, self.balance, estimate = new
        self.balance.begin()
        if estimate is not None:
            self.control.observer.retune(estimate)
        self.arms.follow(self.tasks.com, self.tasks.posture)
        self._stood = 0.0

    def _follow(self, state: State) -> None:
        """Change the law if the stand asks for it, and set the targets of this tick."""
        stepping = self.laws["stepping"].source
        assert isinstance(stepping, SteppingWalk)
        if self.stands and self.source.finished:
            if self.law == "lipm" and stepping.leaves(state, HOLDS):
                self.change("stepping")  # which steps out in this tick
            elif self._waiting is not None:
                plan, self._waiting = self._waiting, None
                self.follow(plan)
            elif self.law == "lipm" and not self._handy:
                self._stood += self.dt
                if self._stood > self.settings.calm:
                    self.change("stepping")
        else:
            self._stood = 0.0
        super()._follow(state)

    @property
    def progress(self) -> Progress:
        """Phase and steps now, those by laws before with them."""
        progress = super().progress
        return progress._replace(steps_done=progress.steps_done + self._before)

    @property
    def finished(self) -> bool:
        """True when all that was asked for is done and the robot stands."""
        return super().finished and self._waiting is None

    @property
    def hands(self) -> Hands:
        """Hands that press on things and hold on to them; a robot that stands changes its law for them.

        An `InputError` for a robot without hands, and for one that steps as it goes.
        """
        if self.law != "lipm" and self._idle:
            self.change("lipm")
        self._handy = self.law == "lipm"
        return self.balance.hands

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity; a robot that stands steps as it goes."""
        return self.source.velocity

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        self._waiting, self._handy = None, False
        if self._idle and any(checked_velocity(velocity)):
            self.change("stepping")
        ReferenceControl.velocity.__set__(self, velocity)  # type: ignore[attr-defined]

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place (m) and heading (rad), and stand there; see `ReferenceControl.go_to`."""
        self._waiting, self._handy = None, False
        if self._idle:
            self.change("stepping")
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
