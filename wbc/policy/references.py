"""References of a policy beside the state of the robot: motion that it tracks, ground about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Number, Positive, settings
from wbc.core.frames import heading, pose_of, yaw_rotation
from wbc.core.robot import Robot
from wbc.ground import KnownGround
from wbc.motion import MotionClip

MOST_POINTS = 100_000
"""Most points of a height scan: the scans of walking policies have some hundreds."""


class ClipFrame(NamedTuple):
    """One frame of a motion.

    Attributes:
        position: Joint positions in the order of a policy, rad.
        velocity: Joint velocities, rad/s.
        anchor: Placement of the anchor, a frame of the robot, in the world of the motion.
    """

    position: Array
    velocity: Array
    anchor: pin.SE3


Frames = Callable[[int], ClipFrame]
"""Function that returns the frames of a motion by number, one for each period of a policy; the last one stays."""


class Tracked:
    """Motion that a policy tracks, turned and shifted to where the robot is when it begins.

    Attributes:
        frame: Present frame.
        step: Number of the next frame.
        playing: False to let the motion wait in its present frame.
        relative: Placement of the frame's anchor in that of the estimated robot.
    """

    def __init__(self, robot: Robot, anchor: str, frames: Frames) -> None:
        self._robot, self._anchor, self._frames, self.playing = robot, anchor, frames, True
        robot.frame_id(anchor)
        self.begin()

    def begin(self) -> None:
        """Begin anew, with the first frame."""
        self.step = 0
        self._world: pin.SE3 | None = None
        self.frame, self.relative = self._frames(0), pin.SE3.Identity()

    def tick(self) -> None:
        """Take the frame of this period of the policy."""
        robot, self.frame = self._robot.placement(self._anchor), self._frames(self.step)
        anchor = self.frame.anchor
        if self._world is None:
            turn = heading(robot.rotation) - heading(anchor.rotation)
            rotation = yaw_rotation(turn)
            shift = robot.translation - rotation @ anchor.translation
            self._world = pose_of(rotation, np.array([shift[0], shift[1], 0.0]))
        self.relative = robot.actInv(self._world * anchor)
        self.step += self.playing


def clip_frames(
    robot: Robot, clip: MotionClip, columns: NDArray[np.intp], anchor: str, period: float
) -> Frames:
    """Return the frames of a clip of the robot, for joints by their columns and for a policy with a period, s."""
    times = np.arange(0.0, clip.duration + 0.5 * period, period).clip(max=clip.duration)
    q = clip.sampled(times, 1.0 / period).configurations(robot)
    joints = q[:, 7:][:, columns]
    velocities, last = np.gradient(joints, period, axis=0), len(q) - 1
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(anchor)

    def frames(step: int) -> ClipFrame:
        k = min(step, last)
        pin.framesForwardKinematics(model, data, q[k])
        return ClipFrame(joints[k], velocities[k], data.oMf[frame].copy())

    return frames


@settings
class HeightScan:
    """Heights of the ground that a policy sees, as the height scan of IsaacLab.

    Attributes:
        frame: Frame of the robot about which the points lie, with its heading; the base when None.
        length: Length of the grid of points ahead and behind together, m.
        width: Width of the grid, m.
        resolution: Distance of neighbouring points, m; those ahead follow each other first, from behind and from right.
        offset: Height of the frame over the ground that is seen as zero, m.
    """

    frame: str | None = None
    length: Annotated[Positive, "m"] = 1.6
    width: Annotated[Positive, "m"] = 1.0
    resolution: Annotated[Positive, "m"] = 0.1
    offset: Annotated[Number, "m"] = 0.5

    def __post_init__(self) -> None:
        points = math.prod(size / self.resolution + 1.0 for size in (self.length, self.width))
        if points > MOST_POINTS:
            raise InputError(f"a height scan must have at most {MOST_POINTS} points, got {points:.3g}")


class ScannedGround:
    """Known ground about a robot, as a height scan sees it; where nothing is known it is as high as the lower sole."""

    def __init__(self, robot: Robot, scan: HeightScan, ground: KnownGround) -> None:
        self._robot, self._ground, self._offset = robot, ground, scan.offset
        self._frame = robot.base_frame if scan.frame is None else scan.frame
        robot.frame_id(self._frame)
        ahead, aside = (
            np.arange(-0.5 * size, 0.5 * size + 1e-9, scan.resolution) for size in (scan.length, scan.width)
        )
        self._grid = (ahead[None, :] + 1j * aside[:, None]).ravel()

    def __call__(self) -> Array:
        """Return height of the frame over each point less the offset, shape (number of points,), m."""
        placement = self._robot.placement(self._frame)
        x, y, z = placement.translation.tolist()
        heights, _ = self._ground.at(self._grid * np.exp(1j * heading(placement.rotation)) + complex(x, y))
        under = min(float(self._robot.placement(sole.frame).translation[2]) for sole in self._robot.soles)
        return np.asarray(z - np.where(np.isnan(heights), under, heights) - self._offset)
