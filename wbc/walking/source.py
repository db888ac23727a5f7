"""Sources of references: what a walk, a stand, a clip or a user's own hands to the controller in every tick.

    reference = source.update(state)

A source knows neither the QP nor the drives. Walks are in `wbc.walking.lipm.walk` and
`wbc.walking.stepping.gait`, a clip in `wbc.motion.source`; `StandSource` is the smallest one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.drive.control import State
from wbc.core.frames import heading
from wbc.core.robot import SIDES, Robot
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.sources import AT_REST, FootstepSource, Velocity
from wbc.walking.plans.swing import FootMotion
from wbc.walking.steering import Steering


class WholeBody(NamedTuple):
    """Motion of all joints and of the trunk, from a source that gives more than pendulum and feet.

    Attributes:
        com_acceleration: Acceleration of the CoM, of which the pendulum has what its ZMP makes, shape (3,), m/s².
        trunk: Rotation, angular velocity and acceleration of pelvis and torso (of one if they are the same), in the
            world.
        position: Joint positions, shape (na,), rad.
        velocity: Joint velocities, shape (na,), rad/s.
        acceleration: Joint accelerations, shape (na,), rad/s².
    """

    com_acceleration: Array
    trunk: Sequence[tuple[Array, Array, Array]]
    position: Array
    velocity: Array
    acceleration: Array


class Progress(NamedTuple):
    """Record of the step in one tick: its source alone makes it; tasks, contacts, hands and observers read it.

    Attributes:
        phase: Phase of the feet.
        stance: Foot that stands while the present or next step swings, 0 left and 1 right; after the last step, the one
            that stood in it.
        swing: Foot that swings in this step; None on both feet.
        contact: True for each foot on the ground, left and right. A foot that swings may still, or already, carry a
            part of its load.
        heading: Heading of pelvis and torso, rad.
        steps_done: Single supports that have ended.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
        upcoming: Planned landings from now on, that of the swing foot first; empty where none is planned.
        cycle: Planned time of one step, single and double support, s.
        events: Events of this tick.
        landed: True while a swing foot that has met the ground waits there, and follows its motion no further.
        fast_share: Share from 0 to 1 by which the walk is a fast one, in which arms swing.
    """

    phase: GaitPhase = GaitPhase.STANDING
    stance: int = 0
    swing: int | None = None
    contact: tuple[bool, bool] = (True, True)
    heading: float = 0.0
    steps_done: int = 0
    elapsed: float = 0.0
    duration: float = 0.0
    upcoming: tuple[Footstep, ...] = ()
    cycle: float = 1.0
    events: tuple[Event, ...] = ()
    landed: bool = False
    fast_share: float = 0.0

    @property
    def air(self) -> int | None:
        """Foot that follows its motion, although it may still carry a part of its load; None without one."""
        return None if self.landed else self.swing

    @property
    def swing_side(self) -> str | None:
        """Side of the swing foot, "left" or "right"; None on both feet."""
        return None if self.swing is None else SIDES[self.swing]

    @property
    def landing(self) -> Footstep | None:
        """Planned landing of the swing foot; None without one."""
        return self.upcoming[0] if self.swing is not None and self.upcoming else None


class Reference(NamedTuple):
    """References of one tick.

    Attributes:
        pendulum: Planned CoM and ZMP with their derivatives; the measured ones are in `State`.
        feet: Motions of left and right sole; those of feet without contact are followed, and that of `progress.air`.
        progress: Record of the step; a stand by default.
        most_force: Largest normal force of each foot in free steps, N.
        cop: Shift of the centre of pressure of the stance foot in free steps, along and across its sole, m.
        urgency: Priority of the swing foot over the trunk in free steps, 0 to 1; −1 where the trunk has priority.
        body: Motion of all joints and of the trunk; None for the constant posture and an upright trunk.
    """

    pendulum: Pendulum
    feet: tuple[FootMotion, FootMotion]
    progress: Progress = Progress()
    most_force: tuple[float, float] = (math.inf, math.inf)
    cop: tuple[float, float] = (0.0, 0.0)
    urgency: float = 0.0
    body: WholeBody | None = None


class ReferenceSource(ABC):
    """Base of all sources of references; a source of your own overrides `update`, and other methods as needed.

    Attributes:
        progress: Record of the step before the first tick; a walk keeps it up to date.
        unsteered: Message of the error when a source that cannot be steered is steered.
        com_height: Height of the CoM over the soles, m; None for the height of the robot at the start.
        lift_room: Height over its lowest one that a lowered CoM must keep, so that the legs can lift a foot, m: the
            height of the swing in planned steps, and zero in free steps, which lift their feet from the lowest CoM.
        reason: Reason why the source has dropped the last order; empty if it has not.
        ground: What is known of the ground for landings; None for a source that decides no landings.
        steering: Velocity or goal that is asked for; None for a source that cannot be steered.
        planner: Planner of the footsteps; None without one.
        made_for: Robot and control period, s, for which the references are made; None for any.
        used: True once the source has a control.
    """

    progress = Progress()
    unsteered = "references that do not come from footsteps cannot be steered"
    com_height: float | None = None
    lift_room = 0.0
    reason = ""
    ground: GroundEstimate | None = None
    steering: Steering | None = None
    planner: FootstepSource | None = None
    made_for: tuple[Robot | None, float | None] | None = None
    used = False

    @abstractmethod
    def update(self, state: State) -> Reference:
        """Return the references of this tick.

        Args:
            state: State of the robot. If `update` raises an error, the tick fails, and the control sends a command by
                its policy.
        """

    def check_use(self, robot: Robot, dt: float) -> None:
        """Raise an `InputError` unless the source is new, and made for a control of this robot with a period, s."""
        own, period = self.made_for or (None, None)
        if self.used:
            had = "has had a control"
        elif own is not None and own is not robot:
            had = f"is made for another robot, {own!r}"
        elif period is not None and period != dt:
            had = f"is made for a period of {period:g} s, and that of the control is {dt:g} s"
        else:
            return
        raise InputError(
            f"a source is for one control, of the robot and with the period that it is made for; this "
            f"{type(self).__name__} {had}: make another one with the robot and the period of this control"
        )

    @property
    def finished(self) -> bool:
        """True when all orders are done and the robot stands."""
        return False

    # ---- what is asked for ------------------------------------------------------------------------------------------

    @property
    def remaining(self) -> Sequence[Footstep] | None:
        """Footsteps from the one that swings on, after which the robot stands; None where it walks on, or unknown."""
        return None

    @property
    def granted(self) -> Velocity:
        """Velocity of the present steps: forward (m/s), to the left (m/s) and turn (rad/s)."""
        return AT_REST

    def take(self, planner: FootstepSource | None) -> None:
        """Take the footsteps of a planner from now on; None takes those of the steering."""
        self.planner, self.reason = planner, ""


class StandSource(ReferenceSource):
    """Source of references for a stand on both feet; a base for sources of your own.

    Attributes:
        com: CoM position, shape (3,), m; assign other positions in small steps.
        places: Placements of the left and the right sole.
        heading: Heading of the robot, rad.
    """

    unsteered = "a robot that stands cannot be steered"

    @checked
    def __init__(self, robot: Robot) -> None:
        """Stand in the present posture of the robot.

        Args:
            robot: Robot with two soles.
        """
        self.made_for = robot, None
        self.com, self.heading = robot.com.copy(), heading(robot.placement(robot.base_frame).rotation)
        self.places = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]

    def pendulum(self) -> Pendulum:
        """Return the pendulum that rests at `com`, over the ground between the soles."""
        return Pendulum.at_rest(self.com, 0.5 * sum(float(place.translation[2]) for place in self.places))

    def update(self, state: State) -> Reference:
        """Return the references of the stand."""
        left, right = (FootMotion.at_rest(place) for place in self.places)
        return Reference(self.pendulum(), (left, right), Progress(heading=self.heading))
