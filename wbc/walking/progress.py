"""Progress of a walk, and the interface of the controllers that walk.

Simulation, log and live view use nothing else of a controller: whether it follows a plan with a stabilizer
(`wbc.walking.control`) or decides each step as it goes makes no difference to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import Array
from wbc.core.qp.controller import Controller
from wbc.core.robot import SIDES, Robot
from wbc.core.signals import Command, Measurement
from wbc.tasks.scheduling.stiffness import StiffnessScheduler
from wbc.tasks.stabilizer.bias import BiasEstimator
from wbc.tasks.stabilizer.lean import Lean
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.body import Body
from wbc.walking.falls import FallReason
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arms
from wbc.walking.load import HeldLoad
from wbc.walking.pattern.swing import FootMotion
from wbc.walking.planning.footsteps import Footstep
from wbc.walking.planning.phases import Event, Phase
from wbc.walking.planning.sources import Velocity


class Progress(NamedTuple):
    """Phase and steps of a walk at one instant.

    Attributes:
        phase: Phase of the feet.
        swing: Foot in the air, 0 left and 1 right; None on both feet.
        stance: Foot that stands while the present or next step swings; after the last step, the one that stood in it.
        steps_done: Single supports that have ended.
        elapsed: Time in this phase, s.
        duration: Planned length of this phase, s.
        upcoming: Planned landings from now on, that of the foot in the air first; empty where none is planned.
        cycle: Planned time of one step, single and double support, s.
    """

    phase: Phase
    swing: int | None
    stance: int
    steps_done: int
    elapsed: float
    duration: float
    upcoming: tuple[Footstep, ...]
    cycle: float

    @property
    def swing_side(self) -> str | None:
        """Side of the foot in the air, "left" or "right"; None on both feet."""
        return None if self.swing is None else SIDES[self.swing]

    @property
    def landing(self) -> Footstep | None:
        """Planned landing of the foot in the air; None without one."""
        return self.upcoming[0] if self.swing is not None and self.upcoming else None


class VelocityLimits(NamedTuple):
    """Greatest velocities that are granted.

    Attributes:
        forward: m/s.
        back: m/s.
        aside: m/s.
        turn: rad/s.
    """

    forward: float
    back: float
    aside: float
    turn: float


class ReferenceLike(Protocol):
    """References of one tick of any walk; `wbc.walking.walk.WalkReference` describes the fields."""

    @property
    def pendulum(self) -> Pendulum:
        """CoM, contact point and their derivatives."""

    @property
    def feet(self) -> tuple[FootMotion, FootMotion]:
        """Motions of left and right sole."""

    @property
    def contact(self) -> tuple[bool, bool]:
        """True for each foot on the ground, left and right."""

    @property
    def heading(self) -> float:
        """Heading of pelvis and torso, rad."""

    @property
    def phase(self) -> Phase:
        """Phase of the feet."""

    @property
    def step(self) -> int:
        """Index of the step that swings, or that swings next."""

    @property
    def events(self) -> tuple[Event, ...]:
        """Events of this tick."""


class WalkingLike(Protocol):
    """Any controller that walks: a measurement in, a command out, and what can be asked of it between ticks.

    `output` and the parts after it are None in a controller without them.
    """

    stiffness: StiffnessScheduler | None
    """Scheduler that sets the soles while they swing; None leaves them alone."""

    def command(self, measurement: Measurement) -> Command:
        """Run one tick."""

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity: forward (m/s), left (m/s) and turn (rad/s); None while none is commanded."""

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None: ...

    @property
    def granted_velocity(self) -> Velocity:
        """Velocity that the present footsteps give: forward (m/s), left (m/s) and turn (rad/s)."""

    @property
    def steered(self) -> bool:
        """True if the robot is steered, or stands without a plan and may be."""

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place (m) and heading (rad), and stand there."""

    def stop(self) -> None:
        """Come to a stand safely."""

    @property
    def finished(self) -> bool:
        """True when all that was asked for is walked and the robot stands."""

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall; None while it has not fallen."""

    @property
    def done(self) -> bool:
        """True when the walk is over: finished, or ended by a fall."""

    @property
    def steps_done(self) -> int:
        """Single supports that have ended."""

    @property
    def time(self) -> float:
        """Time since the start, s."""

    @property
    def dt(self) -> float:
        """Control period, s."""

    @property
    def velocity_limits(self) -> VelocityLimits:
        """Greatest velocities that are granted."""

    @property
    def progress(self) -> Progress:
        """Phase and steps now."""

    @property
    def reference(self) -> ReferenceLike | None:
        """References of the last tick with a good measurement; None before the first one."""

    @property
    def controller(self) -> Controller:
        """Whole-body controller with all tasks and contacts."""

    @property
    def control(self) -> PositionControl | TorqueControl:
        """Position or torque control, with the observer."""

    @property
    def arms(self) -> Arms:
        """Hands, which can be given targets at any tick."""

    @property
    def body(self) -> Body:
        """Height of the CoM, lean and turn of the trunk, and gaze, which can be set at any tick."""

    @property
    def output(self) -> StabilizerOutput | None:
        """Output of the stabilizer in the tick of `reference`."""

    @property
    def stabilizer(self) -> Stabilizer | None:
        """Feedback and admittances."""

    @property
    def lean(self) -> Lean | None:
        """Lean of the trunk."""

    @property
    def bias(self) -> BiasEstimator | None:
        """Estimator of the error of the measured DCM."""

    @property
    def hands(self) -> Hands | None:
        """Hands that press on things."""

    @property
    def load(self) -> HeldLoad | None:
        """Load in the hands as estimated."""


def with_sole_stiffness(command: Command, walking: WalkingLike) -> Command:
    """Return a command with the stiffness of the soles that the scheduler of a walk sets; as it is without one.

    Args:
        command: Command of the drives in this tick.
        walking: The walk, after its tick.
    """
    scheduler, control = walking.stiffness, walking.control
    if scheduler is None:
        return command
    now = control.measurement
    if control.failing or now is None:
        return replace(command, sole_stiffness=scheduler.command)
    soles = schedule_stiffness(scheduler, walking.progress, walking.dt, control.observer.robot, now)
    return replace(command, sole_stiffness=soles)


def schedule_stiffness(
    scheduler: StiffnessScheduler, progress: Progress, dt: float, estimate: Robot, measurement: Measurement
) -> Array:
    """Return the stiffness of both soles from the state of the swing, shape (2,), Nm/rad.

    Args:
        scheduler: Decides on the stiffness; runs one tick.
        progress: Progress of the walk.
        dt: Control period, s.
        estimate: Estimated robot, up to date.
        measurement: Range and stiffness of the soles.
    """
    share = min(progress.elapsed / max(progress.duration, dt), 1.0)
    remaining = max(progress.duration - progress.elapsed, 0.0)
    landing = progress.landing
    return scheduler.update(
        progress.swing_side,
        share,
        remaining,
        estimate,
        measurement,
        None if landing is None else landing.position,
    )
