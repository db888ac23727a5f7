"""Figure of what the filter of motions changed: joints, ZMP and contacts."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import BLACK, BLUE, COLOURS, ORANGE, SIDE_COLOURS, grid, legend, new_figure
from wbc.core.robot import Robot
from wbc.motion import MotionClip
from wbc.motion.feasible import FeasibleMotion
from wbc.motion.kinematics import BodyMotion

SHOWN = 5
"""Joints that are drawn: those that were changed most."""


def draw_changes(robot: Robot, given: MotionClip, result: FeasibleMotion) -> Figure:
    """Draw joints that changed most, CoM and ZMP of the feasible result of a clip, and which foot stands."""
    figure = new_figure(10.0, 9.0)
    joints, forward, sideways, stands = (
        row[0] for row in grid(figure, 4, 1, sharex=True, height_ratios=(3, 2, 2, 1))
    )
    clip, time = result.clip, result.clip.times
    standing = np.ones((len(clip), 2), dtype=bool) if clip.standing is None else clip.standing
    source = np.clip(result.source_times, 0.0, given.duration)
    before = given.sampled(source, clip.rate)
    most = sorted((n for n in result.changes if n in given.joint_names), key=lambda n: -result.changes[n])[
        :SHOWN
    ]
    for name, colour in zip(most, COLOURS, strict=False):
        joints.plot(time, np.degrees(before.joints[:, given.joint_names.index(name)]), ":", color=colour)
        joints.plot(time, np.degrees(clip.joints[:, clip.joint_names.index(name)]), color=colour, label=name)
    joints.set_ylabel("joints (°)")
    joints.set_title(
        f"{given.name}: given (dotted, slowed down as the result) and feasible", loc="left", fontsize=10
    )
    legend(joints)
    body = BodyMotion.of(robot, clip.configurations(robot), clip.rate)
    zmp = body.zmp()
    for axes, axis, label in ((forward, 0, "x (m)"), (sideways, 1, "y (m)")):
        low, high = (
            getattr(np, bound)(np.where(standing[..., None], body.corners[..., axis], fill), axis=(1, 2))
            for bound, fill in (("min", np.inf), ("max", -np.inf))
        )
        axes.fill_between(time, low, high, color="0.88", label="support")
        axes.plot(time, zmp[:, axis], color=ORANGE, linewidth=0.9, label="ZMP")
        axes.plot(time, body.com[:, axis], color=BLUE, label="CoM")
        axes.set_ylabel(label)
    legend(forward)
    for side, name in enumerate(("left", "right")):
        stands.fill_between(time, side + 0.1, side + 0.9, where=standing[:, side], color=SIDE_COLOURS[name])
    stands.set_yticks([0.5, 1.5], ["left", "right"], color=BLACK)
    stands.set_xlabel("time (s)")
    return figure
