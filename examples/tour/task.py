"""The task: waypoints, punches and arms of a run, as the public benchmark draws them from the run's number.

Facts of the task: rhoyn/teleop-walking-benchmark (MIT), README at 0b2ea7ac, main.cpp at 019d9c15.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from generator import Generator
from model import ARMATURE, ARMS, JOINTS

import wbc
from wbc.sim.walks.meter import vibration

SECONDS, POINTS, SEGMENT = 90.0, 18, 5.0
"""Time of a run, s; number of waypoints, and the time for each of them, s."""

COMMANDS = 0.02
"""Period of the harness, s: commands of velocity and targets of the arms."""

FLOOR = 0.20
"""Height of the pelvis below which the robot has fallen, m."""

FORCE, LEAST, RAMP, FIRST, DELAY, DURATION = 500.0, 0.5, 60.0, 1.0 / 3.0, 0.1, 0.08
"""Greatest force of a punch, N; least share of the ceiling; time until the ceiling is the greatest force, s; its share
at the begin; time from the begin of a segment to the punch, s; its duration, s."""

GAIN, NEAR, LEFT, TURNED, TURNED_AWAY = 1.5, 0.10, 0.20, 0.05, 0.12
"""Velocity over the error, 1/s; distance at which a place is reached, m, and from which it is lost again; the same of
the heading, rad."""

STANCE = (*(-0.312, 0.0, 0.0, 0.669, -0.363, 0.0) * 2, 0.0, 0.0, 0.0)
HANGING = (0.2, 0.2, 0.0, 0.6, 0.0, 0.0, 0.0)
"""Joints of legs and waist at the begin, and of the left arm, rad."""

MIRROR = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Sign of each joint of the right arm, of that of the left one."""

FREQUENCY, RATIO = 20.0 * math.pi, 2.0
"""Natural frequency, rad/s, and damping ratio of the servos of the arms, for the inertia of the rotor alone."""

WINDOW, DRAWS, LONGEST, TRIES = 0.5, 25, 0.06, 8
"""Random walk of the arms: time of a window, s; draws in it, and the greatest change of each, rad; windows that are
tried until the hands are free."""

HAND, HEAD = np.array([0.09, 0.0, 0.0]), 0.42
"""Centre of a hand in its wrist, m; height over the torso's frame below which hands stay, m."""


class Punch(NamedTuple):
    """Punch on a joint."""

    time: float  # s
    joint: str
    force: np.ndarray  # in the world, shape (3,), N


def waypoints(run: int) -> list[tuple[float, float, float]]:
    """Return the places (m) and headings (rad) of a run, from those at the begin."""
    draws, points = Generator(run, 2), []
    for _ in range(POINTS):
        radius, bearing = math.sqrt(draws.unit()), draws.between(0.0, math.tau)
        heading = math.remainder(draws.between(0.0, math.tau), math.tau)
        points.append((0.3 + radius * math.cos(bearing), radius * math.sin(bearing), heading))
    return points


def punches(run: int) -> list[Punch]:
    """Return the punches of a run."""
    draws, found = Generator(run, 3), []
    for k in range(POINTS):
        joint = JOINTS[draws.below(len(JOINTS))]
        up, around = draws.between(-1.0, 1.0), draws.between(0.0, math.tau)
        flat = math.sqrt(max(0.0, 1.0 - up * up))
        direction = np.array([flat * math.cos(around), flat * math.sin(around), up])
        ceiling = FORCE * (FIRST + (1.0 - FIRST) * min(SEGMENT * k / RAMP, 1.0))
        found.append(Punch(DELAY + SEGMENT * k, joint, ceiling * draws.between(LEAST, 1.0) * direction))
    return found


class MovingArms:
    """Arms that somebody else moves: a random walk of their targets, and the servos that follow it."""

    def __init__(self, run: int, robot: wbc.Robot, begin: Sequence[float] = HANGING) -> None:
        """Begin with targets of the left arm, shape (7,), rad; with hanging arms by default."""
        self._draws = Generator(run, 4)
        self._model, self._data = robot.model, robot.model.createData()
        names = list(robot.joint_names)
        self.columns = np.array([names.index(joint) for joint in ARMS])  # in arrays of the robot's joints
        self._q = standing(robot)
        left = 7 + self.columns[:7]
        self._least, self._most = (
            limit[left] for limit in (robot.model.lowerPositionLimit, robot.model.upperPositionLimit)
        )
        self._hands = [robot.frame_id(f"{side}_wrist_yaw_link") for side in ("left", "right")]
        self._torso = robot.frame_id("torso_link")
        self._left = self._from = self._to = np.array(begin)
        self._window = -1
        self._front = min(float(place[0]) for place in self._places(np.array(HANGING)))
        rotors = np.array([ARMATURE[joint] for joint in ARMS])
        self._stiffness, self._damping = rotors * FREQUENCY**2, 2.0 * RATIO * rotors * FREQUENCY
        self._limit = robot.torque_limit[self.columns]

    @property
    def target(self) -> np.ndarray:
        """Targets of both arms now, shape (14,), rad."""
        return np.concatenate([self._left, MIRROR * self._left])

    def _places(self, left: np.ndarray) -> list[np.ndarray]:
        """Return the places of both hands in the torso, m."""
        self._q[7 + self.columns] = np.concatenate([left, MIRROR * left])
        pin.framesForwardKinematics(self._model, self._data, self._q)
        torso = self._data.oMf[self._torso]
        return [torso.actInv(self._data.oMf[hand].act(HAND)) for hand in self._hands]

    def _are_free(self, left: np.ndarray) -> bool:
        """Return True if both hands are before the torso and below the head."""
        return all(place[0] >= self._front - 1e-9 and place[2] <= HEAD for place in self._places(left))

    def move(self, time: float) -> None:
        """Move the targets on to a time, s, once a period of the harness."""
        window = int(time / WINDOW)
        if window != self._window:
            self._window, self._from, self._to = window, self._left, self._left
            for _ in range(TRIES):
                drawn = self._from.copy()
                for _ in range(DRAWS):
                    for joint in range(drawn.size):
                        moved = drawn[joint] + LONGEST * self._draws.between(-1.0, 1.0)
                        drawn[joint] = min(max(moved, self._least[joint]), self._most[joint])
                if self._are_free(drawn):
                    self._to = drawn
                    break
        part = min(max((time - window * WINDOW + COMMANDS) / WINDOW, 0.0), 1.0)
        self._left = self._from + part * (self._to - self._from)

    def torque(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the torques of the servos, shape (14,), Nm, of joint positions, rad, and velocities, rad/s."""
        wanted = self._stiffness * (self.target - position) - self._damping * velocity
        return np.clip(wanted, -self._limit, self._limit)


GROUPS = {
    "legs": ("hip", "knee"),
    "ankles": ("ankle",),
    "waist": ("waist",),
    "arms": ("shoulder", "elbow", "wrist"),
}
"""Groups of joints whose energy and vibration are summed → parts of the joints' names."""


class Effort:
    """Energy and vibration of a run, sampled once a period of the harness.

    A sample of T = 0.02 s adds |τ q̇| T of each joint to the energy, J, and |a − a of the last sample| to the vibration,
    rad/s², where a is the difference of the joint's velocities in the last two samples over T.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Sort the joints into their groups."""
        self._groups = {
            group: [k for k, name in enumerate(joint_names) if any(part in name for part in parts)]
            for group, parts in GROUPS.items()
        }
        self.energy = np.zeros(len(joint_names))
        self._velocities: list[np.ndarray] = []

    def add(self, torque: np.ndarray, velocity: np.ndarray) -> None:
        """Add a sample: torques, shape (na,), Nm, and velocities, shape (na,), rad/s, of the joints."""
        self.energy += np.abs(torque * velocity) * COMMANDS
        self._velocities.append(velocity.copy())

    def by_group(self) -> dict[str, dict[str, float]]:
        """Return energy, J, and vibration, rad/s², of each group of joints."""
        rattle = vibration(np.reshape(self._velocities, (-1, len(self.energy))), COMMANDS)
        return {
            name: {group: round(float(values[columns].sum()), 3) for group, columns in self._groups.items()}
            for name, values in (("energy", self.energy), ("vibration", rattle))
        }


def standing(robot: wbc.Robot) -> np.ndarray:
    """Return the configuration at the begin, shape (nq,), with the soles on the ground."""
    q, names = np.array(robot.half_sitting), list(robot.joint_names)
    arms = np.concatenate([HANGING, MIRROR * HANGING])
    for joint, angle in zip(JOINTS, (*STANCE, *arms), strict=True):
        q[7 + names.index(joint)] = angle
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    q[2] -= min(float(data.oMf[robot.frame_id(sole.frame)].translation[2]) for sole in robot.soles)
    return q


class Teleoperator:
    """The harness's command: towards a waypoint, in the robot's axes, by what it truly is at."""

    def __init__(self, run: int, limits: tuple[float, float, float]) -> None:
        """Take the waypoints of a run; limits are those of the walker, m/s and rad/s."""
        self._points, self._limits = waypoints(run), limits
        self._anchor: tuple[float, float, float] | None = None
        self._segment = -1
        self._there = self._faces = False
        self._last: tuple[float, float] | None = None
        self.errors: list[
            tuple[float, float]
        ] = []  # of the place, m, and of the heading, rad, of each segment

    def command(self, time: float, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return the velocity for a robot that is at a place, m, with a heading, rad."""
        if self._anchor is None:
            self._anchor = x, y, yaw
        segment = min(int(time / SEGMENT), POINTS - 1)
        if segment != self._segment:
            self.finish()
            self._segment, self._there, self._faces = segment, False, False
        from_x, from_y, from_yaw = self._anchor
        ahead, left, turn = self._points[segment]
        dx = from_x + ahead * math.cos(from_yaw) - left * math.sin(from_yaw) - x
        dy = from_y + ahead * math.sin(from_yaw) + left * math.cos(from_yaw) - y
        off, turned = math.hypot(dx, dy), math.remainder(from_yaw + turn - yaw, math.tau)
        self._last = off, abs(turned)
        self._there = off <= LEFT if self._there else off < NEAR
        self._faces = abs(turned) <= TURNED_AWAY if self._faces else abs(turned) < TURNED
        wanted = [0.0, 0.0, 0.0]
        if not self._there:
            wanted[0] = GAIN * (math.cos(yaw) * dx + math.sin(yaw) * dy)
            wanted[1] = GAIN * (math.cos(yaw) * dy - math.sin(yaw) * dx)
        if not self._faces:
            wanted[2] = GAIN * turned
        forward, aside, turning = (
            min(max(v, -most), most) for v, most in zip(wanted, self._limits, strict=True)
        )
        return forward, aside, turning

    def finish(self) -> None:
        """End a segment: its errors count as they are."""
        if self._last is not None:
            self.errors.append(self._last)
            self._last = None
