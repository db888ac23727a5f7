"""Simulated tracking of a clip: the controller of `wbc.motion` against the plant."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from wbc.core.arguments import checked
from wbc.core.control import Mode
from wbc.core.errors import Array
from wbc.core.robot import GRAVITY
from wbc.core.settings import NonNegative, settings
from wbc.motion import MotionClip, MotionControl, TrackSettings, first_configuration
from wbc.sim.balance.setup import BalanceSpec
from wbc.sim.plant.falls import PelvisLimits, TrueFallDetector
from wbc.walking.settings import WalkingControlSettings

LOADED = 0.05
"""Load of a sole that stands, as a share of the weight: with less it may move, and is about to leave."""


@settings(kw_only=True)
class TrackSpec(BalanceSpec):
    """The simulation in which a clip is tracked: the fields of `BalanceSpec`, and the time after the clip.

    Attributes:
        after: Time of standing after the clip, s.
    """

    robot: str = "g1"
    noise: str = "realistic"
    after: Annotated[NonNegative, "s"] = 1.0


@dataclass(frozen=True, slots=True)
class TrackResult:
    """Result of a tracked clip; all but `tick_us` follows from clip and spec.

    Attributes:
        motion: Name of the clip.
        robot: Name of the robot.
        mode: Command of the drives.
        completed: True if the clip was tracked to its end and the robot stands.
        seconds: Simulated time, s.
        clip_seconds: Duration of the clip, s.
        fall: Reason of the fall; None if there was none.
        joint_rms_deg: Root mean square over time and joints of true minus given joint position, degrees.
        worst_joint: Joint with the greatest root mean square.
        worst_joint_rms_deg: Its value, degrees.
        largest_deg: Greatest error of a joint at any time, degrees.
        com_rms_mm: Horizontal error of the true centre of mass, mm.
        foot_slide_mm: Greatest distance of a sole from where it was first loaded, while it bore 5 % of the weight, mm.
        landings: Feet that have landed.
        failures: Ticks without a solution, or with a measurement that could not be used.
        tick_us: Wall time from measurement to command, median and 99th percentile.
    """

    motion: str
    robot: str
    mode: Mode
    completed: bool
    seconds: float
    clip_seconds: float
    fall: str | None
    joint_rms_deg: float
    worst_joint: str
    worst_joint_rms_deg: float
    largest_deg: float
    com_rms_mm: float
    foot_slide_mm: float
    landings: int
    failures: int
    tick_us: dict[str, float]


class TrackTrial:
    """One clip about to be tracked: plant and controller, connected.

    Attributes:
        spec: The simulation.
        plant: The plant.
        control: The controller.
    """

    @checked
    def __init__(
        self, clip: MotionClip, spec: TrackSpec | None = None, track: TrackSettings | None = None
    ) -> None:
        """Build robot, plant and controller; the robot stands as the clip begins.

        Args:
            clip: Feasible clip (`wbc.motion.make_feasible`).
            spec: The simulation; the defaults when None.
            track: Settings of the controller; the mode is that of the spec.

        Raises:
            UnknownNameError: The clip is of another robot.
            InputError: The robot leaves the ground in the clip, a foot that does not fit.
        """
        self.spec = spec = spec or TrackSpec()
        robot, self.plant, observer = spec.build()
        q = first_configuration(robot, clip)
        self.plant.reset(self.plant.on_ground(q))
        observer.reset(q)
        robot.update(q, np.zeros(robot.nv))
        self.control = MotionControl(
            robot, clip, spec.period, _with_mode(track or TrackSettings(), spec.chosen), observer=observer
        )
        limits = self.control.falls.settings
        self._falls = TrueFallDetector(self.plant.robot, PelvisLimits(-limits.drop, limits.tilt))
        self._weight = robot.mass * GRAVITY

    def run(self, after_tick: Callable[[], None] | None = None) -> TrackResult:
        """Track the clip to its end or a fall, once only.

        Args:
            after_tick: Called after each control period, for a viewer.
        """
        plant, control, spec = self.plant, self.control, self.spec
        motion, sites = control.motion, list(plant.sole_sites)
        joints: list[Array] = []
        com: list[Array] = []
        anchors: list[Array | None] = [None, None]
        slide, times, fall = 0.0, [], None
        end = (len(motion) - 1) * spec.period + spec.after
        while plant.time < end - 0.5 * spec.period and fall is None:
            measurement = plant.measure()
            start = time.perf_counter()
            command = control.command(measurement)
            times.append(time.perf_counter() - start)
            plant.step(command)
            plant.raise_if_diverged()
            truth, i = plant.truth(), min(control.tick + 1, len(motion) - 1)
            felt = truth.sole_wrench if measurement.sole_wrench is None else measurement.sole_wrench
            joints.append(truth.q[7:] - motion.q[i, 7:])
            com.append(truth.com[:2] - motion.pendulum[i].com[:2])
            for side, place in enumerate(plant.data.site_xpos[sites]):
                if felt[side, 2] < LOADED * self._weight:
                    anchors[side] = None
                    continue
                anchor = anchors[side]
                if anchor is None:
                    anchors[side] = anchor = place.copy()
                slide = max(slide, float(np.linalg.norm((place - anchor)[:2])))
            reason = control.fallen or self._falls.reason(
                truth.q, motion.q[i, 2], _vertical(motion.q[i, 3:7])
            )
            if reason is not None:
                fall = reason.value
            if after_tick is not None:
                after_tick()
        errors = np.degrees(np.array(joints))
        each = np.sqrt((errors**2).mean(axis=0))
        worst = int(each.argmax())
        return TrackResult(
            motion=control.clip.name,
            robot=spec.robot,
            mode=control.settings.mode,
            completed=fall is None and control.finished,
            seconds=plant.time,
            clip_seconds=control.clip.duration,
            fall=fall,
            joint_rms_deg=float(np.sqrt((errors**2).mean())),
            worst_joint=self.plant.robot.joint_names[worst],
            worst_joint_rms_deg=float(each[worst]),
            largest_deg=float(abs(errors).max()),
            com_rms_mm=1e3 * float(np.sqrt((np.array(com) ** 2).sum(axis=1).mean())),
            foot_slide_mm=1e3 * slide,
            landings=control.landings,
            failures=control.control.failures,
            tick_us={
                "median": 1e6 * float(np.median(times)),
                "p99": 1e6 * float(np.percentile(times, 99)),
            },
        )


@checked
def track_motion(
    clip: MotionClip, spec: TrackSpec | None = None, track: TrackSettings | None = None
) -> TrackResult:
    """Track a clip in the simulator; see `TrackTrial`.

        result = track_motion(make_feasible(robot, clip).clip, TrackSpec(robot="talos"))

    Args:
        clip: Feasible clip.
        spec: The simulation; the defaults when None.
        track: Settings of the controller.
    """
    return TrackTrial(clip, spec, track).run()


def _vertical(quaternion: Array) -> tuple[float, float, float]:
    """Return the vertical axis of the world in a body's frame, from the body's orientation (x, y, z, w)."""
    x, y, z, w = quaternion.tolist()
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _with_mode(track: TrackSettings, mode: Mode) -> TrackSettings:
    walking: WalkingControlSettings = replace(track.walking, mode=mode)
    return replace(track, walking=walking)
