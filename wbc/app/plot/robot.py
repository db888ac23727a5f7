"""Figure of a robot: its soles from above, and its posture from the side."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from wbc.app.plot.style import BLACK, BLUE, GREEN, ORANGE, grid, legend, new_figure
from wbc.robots import RobotDescription


def draw_robot(description: RobotDescription) -> Figure:
    """Draw soles, ankles and centre of mass from above, and the joints in half-sitting from the side."""
    figure = new_figure(11.0, 6.0)
    above, side = grid(figure, 1, 2, width_ratios=(1.2, 1.0))[0]
    robot = description.robot()
    for sole, colour in zip(robot.soles, (BLUE, ORANGE), strict=True):
        place = robot.placement(sole.frame)
        corners = [
            place.act(np.array([0.5 * x * sole.length, 0.5 * y * sole.width, 0.0]))
            for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        above.add_patch(Polygon([(-c[1], c[0]) for c in corners], fill=True, alpha=0.25, color=colour))
        ankle = place.act(description.ankle(sole.name))
        size = f"{1e3 * sole.length:.0f} x {1e3 * sole.width:.0f} mm"
        above.plot(-ankle[1], ankle[0], "o", color=colour, label=f"ankle of {sole.name}, {size}")
        side.plot([c[0] for c in corners], [c[2] for c in corners], color=colour, linewidth=3.0)
    above.plot(-robot.com[1], robot.com[0], "x", color=BLACK, label="centre of mass")
    side.plot(robot.com[0], robot.com[2], "x", color=BLACK, label="centre of mass")
    model, data = robot.model, robot.data
    for joint in range(2, model.njoints):
        ends = [data.oMi[i].translation for i in (model.parents[joint], joint)]
        side.plot(
            [end[0] for end in ends], [end[2] for end in ends], "-", color=GREEN, marker=".", markersize=4
        )
    imu = robot.placement(robot.imu_frame).translation
    side.plot(imu[0], imu[2], "^", color=BLACK, markersize=5, label="IMU")
    lowest = min(float(robot.placement(sole.frame).translation[2]) for sole in robot.soles)
    side.axhline(lowest, color=BLACK, linewidth=0.6)
    above.set_title(f"{description.name}: soles from above", loc="left", fontsize=10)
    side.set_title("half-sitting from the side", loc="left", fontsize=10)
    above.set_xlabel("right (m)")
    above.set_ylabel("forward (m)")
    side.set_xlabel("forward (m)")
    side.set_ylabel("up (m)")
    for ax in (above, side):
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.15)
        legend(ax, columns=1)
    return figure
