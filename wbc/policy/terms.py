"""Terms of observations: parts of what a policy sees, each from the estimate and from what was asked for.

Their names and values are those of IsaacLab's managers, along the axes of the base where they have any. A new term is a
function of `Observed` in `TERMS`, which returns an array; its length may depend on the policy, and never changes.

Attributes:
    linear_velocity: Velocity of the base by the observer, because no robot measures it, m/s.
    angular_velocity: Angular velocity of the base, rad/s.
    gravity: Unit vector along gravity.
    command: Velocity that is asked for: ahead, aside, m/s, and turn, rad/s.
    command_linear: The first two values of `command`, m/s.
    command_turn: The last value of `command`, rad/s.
    joint_position: Joint positions minus those of the default posture, rad.
    joint_velocity: Joint velocities, rad/s.
    last_action: Last action.
    phase_sine: Sine of the phases of the left and the right foot.
    phase_cosine: Cosine of these phases.
    motion_joints: Joint positions, rad, and then velocities, rad/s, of the present frame of the motion.
    motion_orientation: Orientation of the motion's anchor in the robot's anchor: first two columns, row by row.
    motion_position: Position of the motion's anchor in the robot's anchor, by the observer, m.
    height_scan: Height of a frame of the robot over each point of a grid, less `scan.offset`, m.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.policy.references import ScannedGround, Tracked


@dataclass
class Observed:
    """State of a policy's run that its terms read.

    Attributes:
        robot: The estimated robot.
        position: Joint positions minus those of the default posture, in the policy's order, shape (joints,), rad.
        velocity: Joint velocities in the policy's order, shape (joints,), rad/s.
        action: Last action, shape (joints,).
        command: Velocity that is asked for: ahead, aside, m/s, and turn, rad/s, shape (3,).
        phase: Phases of the left and the right foot, from −π to π, shape (2,), rad.
        motion: Motion that the policy tracks; None without one.
        ground: Ground about the robot; None for a blind policy.
    """

    robot: Robot
    position: Array
    velocity: Array
    action: Array
    command: Array
    phase: Array
    motion: Tracked | None = None
    ground: ScannedGround | None = None


def _gravity(observed: Observed) -> Array:
    x, y, z, w = observed.robot.q[3:7].tolist()
    return np.array([-2.0 * (x * z - w * y), -2.0 * (y * z + w * x), -(1.0 - 2.0 * (x * x + y * y))])


def _motion(observed: Observed) -> Tracked:
    if observed.motion is None:
        raise InputError("a policy that observes a motion needs one: clip=…, or a network that holds it")
    return observed.motion


def _scan(observed: Observed) -> Array:
    if observed.ground is None:
        raise InputError("a policy that observes the ground needs ground=KnownGround(robot)")
    return observed.ground()


def _motion_joints(observed: Observed) -> Array:
    frame = _motion(observed).frame
    return np.concatenate((frame.position, frame.velocity))


TERMS: dict[str, Callable[[Observed], Array]] = {
    "linear_velocity": lambda o: o.robot.v[:3],
    "angular_velocity": lambda o: o.robot.v[3:6],
    "gravity": _gravity,
    "command": lambda o: o.command,
    "command_linear": lambda o: o.command[:2],
    "command_turn": lambda o: o.command[2:],
    "joint_position": lambda o: o.position,
    "joint_velocity": lambda o: o.velocity,
    "last_action": lambda o: o.action,
    "phase_sine": lambda o: np.sin(o.phase),
    "phase_cosine": lambda o: np.cos(o.phase),
    "motion_joints": _motion_joints,
    "motion_orientation": lambda o: _motion(o).relative.rotation[:, :2].ravel(),
    "motion_position": lambda o: _motion(o).relative.translation,
    "height_scan": _scan,
}
"""Name → function that returns the values of the term."""
