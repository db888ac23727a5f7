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
from wbc.ground import KnownGround
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.sources import AT_REST, FootstepSource, Velocity
from wbc.walking.steering import Steering
from wbc.walking.swing import FootMotion


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


class Reference(NamedTuple):
    """References of one tick.

    Attributes:
        pendulum: Planned CoM and ZMP with their derivatives; the measured ones are in `State`.
        feet: Motions of left and right sole.
        contact: True for each foot on the ground, left and right.
        heading: Heading of pelvis and torso, rad.
        phase: Phase of the feet.
        step: Index of the present or next step, which is the number of steps that have ended.
        events: Events of this tick.
        landing: Planned landing of the foot in the air; None if no landing is planned.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
        stance: Stance foot of the present or next step: 0 left, 1 right.
        swing: Foot that follows its motion although it may still carry a part of its load: 0 left, 1 right. None: the
            feet without contact follow theirs.
        most_force: Largest normal force of each foot in free steps, N.
        cop: Shift of the centre of pressure of the stance foot in free steps, along and across its sole, m.
        urgency: Share from 0 to 1 by which the swing foot goes before the trunk in free steps; −1 where it goes
            after it.
        body: Motion of all joints and of the trunk; None for the constant posture and an upright trunk.
    """

    pendulum: Pendulum
    feet: tuple[FootMotion, FootMotion]
    contact: tuple[bool, bool] = (True, True)
    heading: float = 0.0
    phase: GaitPhase = GaitPhase.STANDING
    step: int = 0
    events: tuple[Event, ...] = ()
    landing: Footstep | None = None
    elapsed: float = 0.0
    duration: float = 0.0
    stance: int = 0
    swing: int | None = None
    most_force: tuple[float, float] = (math.inf, math.inf)
    cop: tuple[float, float] = (0.0, 0.0)
    urgency: float = 0.0
    body: WholeBody | None = None


class Progress(NamedTuple):
    """Phase and steps of a walk at one instant.

    Attributes:
        phase: Phase of the feet.
        swing: Foot in the air, 0 left and 1 right; None on both feet.
        stance: Foot that stands while the present or next step swings; after the last step, the one that stood in it.
        steps_done: Single supports that have ended.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
        upcoming: Planned landings from now on, that of the foot in the air first; empty where none is planned.
        cycle: Planned time of one step, single and double support, s.
    """

    phase: GaitPhase
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


class ReferenceSource(ABC):
    """Base of all sources of references; a source of your own overrides `update`, and other methods as needed.

    The law of a walk has two methods: `update` decides where and when the next foot lands and how the pendulum moves
    until then, and `progress` returns phase and steps.

    Attributes:
        unsteered: Message of the error when a source that cannot be steered is steered.
        com_height: Height of the CoM over the soles, m; None for the height of the robot at the start.
        lift_room: Height over its lowest one that a lowered CoM must keep, so that the legs can lift a foot, m: the
            height of the swing in planned steps, and zero in free steps, which lift their feet from the lowest CoM.
        reason: Reason why the source has dropped the last order; empty if it has not.
        ground: Known ground for landings; None for a source that decides no landings.
        steering: Velocity or goal that is asked for; None for a source that cannot be steered.
        planner: Planner of the footsteps; None without one.
        hip_turn: Turn of the pelvis against the heading that is asked for at present, rad; the control sets it.
        hand_wrench: Wrench of the surroundings on the hands, [force; moment] at the world origin, shape (6,), N and Nm;
            None without. The control sets it.
    """

    unsteered = "references that do not come from footsteps cannot be steered"
    com_height: float | None = None
    lift_room = 0.0
    reason = ""
    ground: GroundEstimate | None = None
    steering: Steering | None = None
    planner: FootstepSource | None = None
    hip_turn = 0.0
    hand_wrench: Array | None = None

    @abstractmethod
    def update(self, state: State) -> Reference:
        """Return the references of this tick.

        Args:
            state: State of the robot. If `update` raises an error, the tick fails, and the control sends a command by
                its policy.
        """

    def progress(self, last: Reference | None) -> Progress:
        """Return the present phase and the number of steps.

        Args:
            last: References of the last tick; None before the first one.
        """
        if last is None:
            return Progress(GaitPhase.STANDING, None, 0, 0, 0.0, 0.0, (), 1.0)
        swing = None if all(last.contact) else last.contact.index(False)
        upcoming = () if last.landing is None else (last.landing,)
        stance = 0 if swing is None else 1 - swing
        cycle = last.duration or 1.0
        return Progress(last.phase, swing, stance, last.step, last.elapsed, last.duration, upcoming, cycle)

    @property
    def haste(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one, in which arms swing."""
        return 0.0

    @property
    def finished(self) -> bool:
        """True when all orders are done and the robot stands."""
        return False

    # ---- what is asked for ------------------------------------------------------------------------------------------

    @property
    def steered(self) -> bool:
        """True if the robot is steered or can be steered."""
        return self.steering is not None

    @property
    def granted(self) -> Velocity:
        """Velocity of the present steps: forward (m/s), to the left (m/s) and turn (rad/s)."""
        return AT_REST

    def take(self, planner: FootstepSource | None) -> None:
        """Take the footsteps of a planner from now on; None takes those of the steering."""
        self.planner, self.reason = planner, ""

    def see(self, ground: KnownGround) -> None:
        """Place the feet by the known ground, from the next swing on.

        Args:
            ground: Known ground; the control keeps it up to date.
        """
        if self.ground is None:
            raise InputError(f"{type(self).__name__} does not place feet by a known ground")
        self.ground.sight = ground


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
        self.com, self.heading = robot.com.copy(), heading(robot.placement(robot.base_frame).rotation)
        self.places = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]

    def pendulum(self) -> Pendulum:
        """Return the pendulum that rests at `com`, over the ground between the soles."""
        return Pendulum.at_rest(self.com, 0.5 * sum(float(place.translation[2]) for place in self.places))

    def update(self, state: State) -> Reference:
        """Return the references of the stand."""
        left, right = (FootMotion.at_rest(place) for place in self.places)
        return Reference(self.pendulum(), (left, right), heading=self.heading)
