"""Tracking of a clip: a source of references for the stabilizer of a walk.

    clip  →  pendulum, feet, contacts  →  stabilizer  →  tasks  →  command
          →  joints and trunk, with velocities and accelerations  ↗

Feet that stand are contacts and yield to the measured wrenches as in a walk; a foot in the air follows the clip from
where it was lifted, and stands where it has landed. Early ground ends a swing.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.control import State
from wbc.core.errors import Array, InputError, as_period
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY, Robot
from wbc.motion.clip import MotionClip
from wbc.motion.contacts import find_contacts
from wbc.motion.kinematics import BodyMotion, leg_joints
from wbc.motion.reference import clip_references, placed
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.walking.control import WalkingControl
from wbc.walking.pattern.swing import FootMotion
from wbc.walking.planning.phases import Event, Phase
from wbc.walking.planning.reach import bent_height
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Reference, ReferenceSource
from wbc.walking.tasks import TaskGains

START = 0.1
"""Greatest distance of a joint from the first frame of a clip at which tracking may begin, rad."""


FADE = 0.2
"""Time in which a foot that is lifted goes over to the path of the clip, s."""

TOUCH_DOWN, EARLY = 0.08, 0.1
"""Load, as a share of the weight, at which a foot has met the ground before its time, and from how long before, s."""

POSTURE, LEGS, STIFFNESS = 1.0, 0.01, 100.0
"""Costs per (rad/s²)² of the joints outside the legs, and of the legs: small, for soles, centre of mass and pelvis
decide on them. Stiffness of both, 1/s²."""


def tracking_settings() -> WalkingControlSettings:
    """Return the settings of a walk's controller that tracks a clip: feet cost by their load, soles press evenly."""
    return WalkingControlSettings(
        distribution=DistributionSettings(torque_by_load=True),
        tasks=TaskGains(moment_by_load=True, even_soles=True),
    )


class ClipSource(ReferenceSource):
    """References of a clip, then a stand in its last frame.

    Attributes:
        clip: The clip, where the robot is.
        configurations: Configurations of the clip at the ticks, shape (T, nq).
        motion: References of the ticks, as the clip has them.
        tick: Index of the present tick in `motion`.
        landings: Number of landings so far.
        com_height: Height of the CoM over the soles at the start, m.
    """

    unsteered = (
        "a robot that tracks a clip cannot be steered, nor stopped before: it stands when the clip is over"
    )

    def __init__(
        self,
        robot: Robot,
        clip: MotionClip,
        dt: float,
        settings: WalkingControlSettings | None = None,
    ) -> None:
        """Put the clip where the robot stands; the motion begins with the first tick.

        Args:
            robot: The robot, in the first frame of the clip, anywhere on level ground.
            clip: Clip of its joints.
            dt: Control period, s.
            settings: Mode, gains and weights; `tracking_settings` when None.

        Raises:
            UnknownNameError: The clip is of another robot.
            InputError: The robot leaves the ground in the clip; the time at which it does is named. A robot that does
                not stand as the clip begins.
        """
        s = settings or tracking_settings()
        q = clip.configurations(robot)
        _, standing = find_contacts(BodyMotion.of(robot, q, clip.rate), clip.standing)
        _check_start(robot, q[0])
        self._soles = [robot.placement(sole.frame) for sole in robot.soles[:2]]
        left, right = (place.copy() for place in self._soles)
        ground = 0.5 * float(left.translation[2] + right.translation[2])
        self.com_height = s.com_height
        if self.com_height is None:
            self.com_height = min(float(robot.com[2]) - ground, bent_height(robot, s.drive.stretch))
        self.clip = placed(robot, clip, q[0], (left, right))
        self.configurations, self.motion = clip_references(robot, self.clip, standing, ground, dt)
        self.tick = 0
        self.landings = 0
        self._dt = dt
        self._places: list[pin.SE3] = [left, right]  # of feet that stand
        # Tick of lift-off, and offset from the clip there.
        self._swings: list[tuple[int, Array] | None] = [None, None]
        self._early = [False, False]  # feet that stand before their time
        self._load, self._ahead = TOUCH_DOWN * robot.mass * GRAVITY, round(EARLY / dt)

    @property
    def finished(self) -> bool:
        """True when the clip is over and the robot stands in its last frame."""
        return self.tick >= len(self.motion) - 1

    def update(self, state: State) -> Reference:
        """Return the references of this tick, and land or lift the feet."""
        self.tick = i = min(round(state.time / self._dt), len(self.motion) - 1)
        loads = state.load.tolist()
        events = tuple(event for side in (0, 1) for event in self._switch(side, i, loads[side]))
        contact = (self._swings[0] is None, self._swings[1] is None)
        phase = Phase.STANDING if self.finished else (Phase.DOUBLE if all(contact) else Phase.SINGLE)
        feet = (self._foot(0, i), self._foot(1, i))
        return self.motion[i]._replace(
            feet=feet, contact=contact, phase=phase, step=self.landings, events=events
        )

    def _switch(self, side: int, i: int, load: float) -> tuple[Event, ...]:
        """Lift or land a foot when the clip says so, or when it meets the ground a little before."""
        planned = self.motion[i].contact[side]
        if self._swings[side] is None:
            if planned or self._early[side]:
                self._early[side] = self._early[side] and not planned
                return ()
            place, given = self._soles[side], self.motion[i].feet[side].placement
            turn = np.asarray(pin.log3(place.rotation @ given.rotation.T))
            self._swings[side] = i, np.concatenate([place.translation - given.translation, turn])
            return (Event.LIFT_OFF,)
        soon = self.motion[min(i + self._ahead, len(self.motion) - 1)].contact[side]
        if not (planned or (soon and load > self._load)):
            return ()
        self._swings[side], self._early[side] = None, not planned
        self._places[side] = pin.SE3(self._soles[side])
        self.landings += 1
        return (Event.TOUCH_DOWN if planned else Event.EARLY_TOUCH_DOWN,)

    def _foot(self, side: int, i: int) -> FootMotion:
        """Motion of a sole: at rest where it stands; in the air that of the clip, from where it was lifted."""
        swing, given = self._swings[side], self.motion[i].feet[side]
        if swing is None:
            return FootMotion.at_rest(self._places[side])
        begin, offset = swing
        x = (i - begin) * self._dt / FADE
        if x >= 1.0:
            return given
        share, rate = 1.0 - x * x * (3.0 - 2.0 * x), -6.0 * x * (1.0 - x) / FADE
        placement, turn = given.placement, pin.exp3(share * offset[3:])
        placement = pin.SE3(turn @ placement.rotation, placement.translation + share * offset[:3])
        return FootMotion(placement, given.velocity + rate * offset, given.acceleration)


class MotionControl(WalkingControl):
    """Control that tracks a clip, then stands in its last frame. It cannot be steered: that is an `InputError`.

    result = make_feasible(robot, clip)
    robot.update(first_configuration(robot, result.clip), np.zeros(robot.nv))
    control = MotionControl(robot, result.clip, plant.control_period)
    """

    source: ClipSource

    @checked
    def __init__(
        self,
        robot: Robot,
        clip: MotionClip,
        dt: float,
        settings: WalkingControlSettings | None = None,
        *,
        observer: Observer | None = None,
    ) -> None:
        """Make all parts for a robot that stands as the clip begins; see `ClipSource`.

        Args:
            robot: The robot, in the first frame of the clip, anywhere on level ground.
            clip: Clip of its joints.
            dt: Control period, s.
            settings: Mode, gains and weights; `tracking_settings` when None.
            observer: Estimates the robot's state; a new one when None.
        """
        s = settings or tracking_settings()
        source = ClipSource(robot, clip, as_period(dt), s)
        super().__init__(robot, source, dt, s, observer=observer)
        posture = self.tasks.posture
        weight = np.full(robot.na, POSTURE)
        weight[leg_joints(robot)] = LEGS
        posture.stiffness, posture.weight = STIFFNESS, weight


@checked
def first_configuration(robot: Robot, clip: MotionClip) -> Array:
    """Return the first configuration of a clip with its soles on z = 0, shape (nq,).

    Args:
        robot: The robot; its state is not changed.
        clip: Clip of its joints.

    Raises:
        UnknownNameError: The clip is of another robot.
    """
    q: Array = clip.configurations(robot)[0]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    q[2] -= min(data.oMf[robot.frame_id(sole.frame)].translation[2] for sole in robot.soles[:2])
    return q


def _check_start(robot: Robot, q: Array) -> None:
    """Refuse a robot that does not stand as a clip begins."""
    off = abs(robot.q[7:] - q[7:])
    worst = int(off.argmax())
    if not off[worst] <= START:
        raise InputError(
            f"the robot must stand as the clip begins, every joint within {START:g} rad; joint "
            f"'{robot.joint_names[worst]}' is at {robot.q[7 + worst]:.3f} rad, in the clip at {q[7 + worst]:.3f} rad"
        )
