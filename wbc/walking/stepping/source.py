"""The stepping walk as a source of references: place and time of every step are decided at every tick."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.base.checked import checked
from wbc.core.drive.control import State
from wbc.core.robot import Robot
from wbc.walking.plans.footsteps import Footstep, heading
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import (
    FootstepSource,
    Standing,
    Velocity,
    dropped,
    next_steps,
)
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import PathSteering
from wbc.walking.stepping.gait import BodyState, SteppingGait
from wbc.walking.stepping.settings import RobotSize, SteppingSettings


class SteppingWalk(ReferenceSource):
    """Walk that balances by its steps: it stands, walks where it is steered, and stands.

    Attributes:
        gait: Law of the steps.
        com_height: Height of the CoM over the soles while walking, m.
    """

    com_height: float
    steering: PathSteering
    by_steps = True

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: float,
        settings: SteppingSettings | None = None,
        com_height: float | None = None,
    ) -> None:
        """Stand; the CoM is at a height over the soles, m, or as far down as the settings' `bend`."""
        self._settings, self._height, self._dt = settings or SteppingSettings(), com_height, dt
        self._made_for = robot
        self.begin(heading(robot.placement(robot.base_frame).rotation))
        self._reach = Reach.of(robot, self.com_height)

    def begin(self, towards: float) -> None:
        """Stand where the robot stands now, with a heading, rad; all steps and orders before are forgotten."""
        scale = RobotSize.of(self._made_for, self._settings.bend, self._height)
        sight = None if self.ground is None else self.ground.sight
        self.com_height = scale.height
        self.gait = SteppingGait(self._settings, scale, towards, self._dt)
        self.planner, self.reason = None, ""
        self.steering, self.ground = self.gait.steering, self.gait.ground
        self.gait.ground.sight = sight
        self._robot: Robot | None = None  # that of the state

    def update(self, state: State) -> Reference:
        """Decide the step, and return where it leaves the robot."""
        return self.gait.update(self._body(state), self._frames)

    def leaves(self, state: State, share: float) -> bool:
        """Return True if the DCM of a robot that stands has left the soles' boxes, scaled by `share`."""
        return self.gait.leaves(self._body(state), share)

    def _body(self, state: State) -> BodyState:
        robot = state.robot
        if robot is not self._robot:  # in the first tick
            self._robot, (left, right) = robot, robot.soles
            self._frames = robot.placement(left.frame), robot.placement(right.frame)
            self._places = self._frames[0].translation, self._frames[1].translation  # views, as the next ones
            self._turns = self._frames[0].rotation, self._frames[1].rotation
        return BodyState(
            robot.com.tolist(),
            robot.com_velocity.tolist(),
            robot.data.hg.angular.tolist(),
            (self._places[0].tolist(), self._places[1].tolist()),
            (self._turns[0].tolist(), self._turns[1].tolist()),
            state.measurement.wrenches.tolist(),
        )

    def progress(self, last: Reference | None) -> Progress:
        """Return the present phase and the number of steps."""
        swing = self.gait.swing
        return self.gait.progress(() if swing is None else (swing.landing,), self.gait.settings.step_time)

    @property
    def finished(self) -> bool:
        """True when nothing asks for steps and the robot has stood for as long as a step takes."""
        return self.gait.stands and self.planner is None and not self.steering.pending

    @property
    def granted(self) -> Velocity:
        """Velocity of the steps now: forward (m/s), left (m/s) and turn (rad/s)."""
        return (*self.steering.velocity, self.steering.turn)

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next step on; None for those of the steering."""
        super().take(planner)
        self.gait.plan = None if planner is None else self._footsteps

    def _footsteps(self, now: Standing) -> Sequence[Footstep]:
        """Return the planner's steps; none from one that has done, raises, or asks for a step out of reach."""
        assert self.planner is not None
        try:
            plan = next_steps(self.planner, now, self._made_for, self._reach)
        except Exception as error:  # of a planner of the user's own, too
            reason = dropped(error)
            self.take(None)
            self.reason = reason
            return ()
        if not plan.steps:
            self.take(None)
        return plan.steps
