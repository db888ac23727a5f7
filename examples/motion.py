"""A motion of your own: a clip of turning and spreading the arms is made feasible, and the robot tracks it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report

import wbc
from wbc.motion import MotionClip, check_motion, make_feasible
from wbc.sim import TrackSpec, track_motion

RATE = 50.0
"""Frames per second of the clip, Hz."""

SWAY = {"shoulder_roll": 0.8, "shoulder_pitch": -0.6, "elbow": 0.5, "waist_yaw": 0.5}
"""Part of a joint's name → how far it goes from half-sitting and back, rad; to the right with the other sign."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=4.0)
    robot = wbc.load_robot("g1").robot()
    frames = np.tile(robot.half_sitting, (round(RATE * options.seconds), 1))
    there_and_back = 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, len(frames)))
    for joint, name in enumerate(robot.joint_names):
        for part, angle in SWAY.items():
            if part in name:
                mirrored = -1.0 if "roll" in part and "right" in name else 1.0
                frames[:, 7 + joint] += mirrored * angle * there_and_back
    clip = MotionClip.of(robot, frames, RATE, "turn and reach")  # or wbc.motion.read_motion("clip.npz")
    feasible = make_feasible(robot, clip)
    result = track_motion(feasible.clip, TrackSpec(robot="g1"), hooks=options.hooks())
    return report(
        upright=result.completed,
        zmp_outside_before_mm=1e3 * check_motion(robot, clip).zmp_outside,
        zmp_outside_mm=1e3 * feasible.after.zmp_outside,
        joints_rms_deg=float(np.degrees(result.joint_rms)),
    )


if __name__ == "__main__":
    main()
