"""Simulated tracking of a clip: the controller of `wbc.motion` against the plant."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from wbc.base.checked import checked
from wbc.base.files import file_of, stamped_file
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, settings
from wbc.core.conventions import rotation_of
from wbc.core.drive.control import Mode
from wbc.core.estimation.falls import FallReason
from wbc.core.robot import GRAVITY
from wbc.motion import MotionClip, MotionSource, read_motion, tracking_settings
from wbc.robots import load
from wbc.sim.trial.falls import FallSettings, TrueFallDetector
from wbc.sim.trial.spec import RobotName, TrialResult, TrialSpec
from wbc.sim.trial.trial import Trial, TrialHook, TrialTick
from wbc.walking.control import WalkingControl

LOADED = 0.05
"""Load of a sole that stands, over the weight: with less it may move, and is about to lift."""


@settings(kw_only=True, eq=False)
class TrackSpec(TrialSpec):
    """Specification of a trial that tracks a clip: robot, sensors, simulation, and the time after the clip.

    Attributes:
        after: Time for which the robot stands after the clip, s.
    """

    robot: RobotName = "g1"
    noise: str = "realistic"
    after: Annotated[NonNegative, "s"] = 1.0


@settings(kw_only=True, eq=False)
class MotionSpec(TrackSpec):
    """One tracked clip as a trial of a study: the fields of `TrackSpec`, and the file of the clip.

    Attributes:
        motion: File of a feasible clip, which `wbc motion filter` writes; in a written spec with "#" and the hash of
            its content behind it. A file that has changed since is refused.
    """

    kind: ClassVar[str] = "track"

    motion: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "motion", stamped_file(self.motion, "motion"))
        super().__post_init__()
        self.clip().configurations(load(self.robot).robot())  # refuses a clip of another robot

    def clip(self) -> MotionClip:
        """Return the clip."""
        return read_motion(file_of(stamped_file(self.motion, "motion")))


@dataclass(frozen=True, kw_only=True)
class TrackResult(TrialResult):
    """Result of a tracked clip; all but `clock` follows from clip and spec.

    Attributes:
        motion: Name of the clip.
        mode: Command of the drives.
        completed: True if the clip was tracked to its end and the robot stands.
        clip_seconds: Duration of the clip, s.
        fall: Reason of the fall; None if there was none.
        joint_rms: Root mean square over time and joints of true minus given joint position, rad.
        worst_joint: Joint with the greatest root mean square.
        worst_joint_rms: Its value, rad.
        joint_error_max: Greatest error of a joint at any time, rad.
        com_rms: Root mean square of the horizontal error of the true centre of mass, m.
        foot_slide: Greatest distance of a sole from where it was first loaded, while it bore 5 % of the weight, m.
        landings: Feet that have landed.
    """

    motion: str
    mode: Mode
    completed: bool
    clip_seconds: Annotated[float, "s"]
    fall: str | None
    joint_rms: Annotated[float, "rad"]
    worst_joint: str
    worst_joint_rms: Annotated[float, "rad"]
    joint_error_max: Annotated[float, "rad"]
    com_rms: Annotated[float, "m"]
    foot_slide: Annotated[float, "m"]
    landings: int

    RENAMED = {
        "joint_rms_deg": "joint_rms (rad)",
        "worst_joint_rms_deg": "worst_joint_rms (rad)",
        "largest_deg": "joint_error_max (rad)",
        "com_rms_mm": "com_rms (m)",
        "foot_slide_mm": "foot_slide (m)",
        "tick_us": "clock.tick_us",
    }


class TrackTrial(Trial[WalkingControl, TrackResult]):
    """One clip about to be tracked: plant and controller with its references (`source`), connected."""

    @checked
    def __init__(self, clip: MotionClip, spec: TrackSpec | None = None, *, visuals: bool = True) -> None:
        """Build robot, plant (see it for `visuals`) and controller; the robot stands as the feasible clip begins."""
        self._made = time.perf_counter()
        self.spec = spec = spec or TrackSpec()
        robot, plant, observer = spec.build(visuals=visuals)
        q = clip.configurations(robot)[0]
        robot.update(q, np.zeros(robot.nv))
        q[2] -= min(robot.placement(sole.frame).translation[2] for sole in robot.soles)
        plant.reset(plant.on_ground(q))
        observer.reset(q)
        robot.update(q, np.zeros(robot.nv))
        settings = replace(tracking_settings(), mode=spec.chosen)
        self.source = MotionSource(robot, clip, spec.period)
        control = WalkingControl(robot, self.source, spec.period, settings, observer=observer)
        super().__init__(plant, control)
        limits = FallSettings()
        self.falls = TrueFallDetector(plant.robot, -limits.drop * robot.length_scale, limits.tilt)
        self._errors = _TrackMeter(robot.mass * GRAVITY)
        self.meters.append(self._errors)

    @property
    def given(self) -> int:
        """Number of the frame of the clip that the robot should be at."""
        return min(self.source.tick + 1, len(self.source.motion) - 1)

    def true_fall(self) -> FallReason | None:
        """Return why the robot is not where the clip has it; None if it is. Heights are those over the clip's."""
        q = self.source.configurations[self.given]
        height = self.plant.com_height - float(self.source.motion[self.given].pendulum.com[2])
        return self.falls.reason(self.plant.truth().q[3:7], height, rotation_of(q[3:7])[2])

    def simulate(self) -> None:
        """See `Trial`."""
        self.advance((len(self.source.motion) - 1) * self.spec.period + self.spec.after)

    def result(self) -> TrackResult:
        """Return how well the clip was tracked."""
        control, spec, errors = self.control, self.spec, self._errors
        joints = np.array(errors.joints)
        each = np.sqrt((joints**2).mean(axis=0))
        worst = int(each.argmax())
        return TrackResult(
            motion=self.source.clip.name,
            robot=spec.robot,
            seed=spec.seed,
            mode=control.settings.mode,
            completed=not self.fallen and control.finished,
            seconds=self.plant.time,
            clip_seconds=self.source.clip.duration,
            fall=None if self.fall is None else self.fall.value,
            joint_rms=float(np.sqrt((joints**2).mean())),
            worst_joint=self.plant.robot.joint_names[worst],
            worst_joint_rms=float(each[worst]),
            joint_error_max=float(abs(joints).max()),
            com_rms=float(np.sqrt((np.array(errors.com) ** 2).sum(axis=1).mean())),
            foot_slide=errors.slide,
            landings=self.source.landings,
            failures=self.drives.failures,
            clock=self.clock(),
        )


class _TrackMeter(TrialHook):
    """Errors of joints, rad, and centre of mass, m, and how far loaded feet slide, m."""

    def __init__(self, weight: float) -> None:
        self.joints: list[Array] = []
        self.com: list[Array] = []
        self.slide = 0.0
        self._weight = weight
        self._felt: Array | None = None  # wrenches on the soles, measured
        self._anchors: list[Array | None] = [None, None]

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        self._felt = tick.measurement.sole_wrench

    def after(self, trial: TrackTrial) -> None:
        """See `TrialHook`."""
        plant, source, i = trial.plant, trial.source, trial.given
        truth = plant.truth()
        felt = truth.sole_wrench if self._felt is None else self._felt
        self.joints.append(truth.q[7:] - source.configurations[i, 7:])
        self.com.append(truth.com[:2] - source.motion[i].pendulum.com[:2])
        for side in range(len(self._anchors)):
            place = plant.sole_poses[side][0]
            if felt[side, 2] < LOADED * self._weight:
                self._anchors[side] = None
                continue
            anchor = self._anchors[side]
            if anchor is None:
                self._anchors[side] = anchor = place.copy()
            self.slide = max(self.slide, float(np.linalg.norm((place - anchor)[:2])))


def track_motion(
    clip: MotionClip, spec: TrackSpec | None = None, *, hooks: Sequence[TrialHook] = ()
) -> TrackResult:
    """Track a feasible clip in the simulator; see `TrackTrial`. Hooks observe every tick.

    result = track_motion(make_feasible(robot, clip).clip, TrackSpec(robot="talos"))
    """
    result: TrackResult = TrackTrial(clip, spec).run(hooks)
    return result
