"""Climb stairs: footsteps at different heights, and a centre of mass that rises with them.

The stairs are known, and the plan puts each foot into the middle of a stair. Both feet step onto each stair; with
`--way alternate` the feet take turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.sim import make_terrain
from wbc.walking import FootstepPlan, Gait, WalkingControl, climb_stairs

TREAD = 0.25
"""Depth of a stair, m."""

BEFORE = 0.25
"""Distance from the robot to the first edge, m."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, stairs=3, rise=0.03, way=("together", "alternate"))
    count = options.stairs
    run = (count - 1) * TREAD  # from the first edge to the last
    ground = make_terrain(
        "steps",
        amplitude=count * options.rise,
        riser=options.rise,
        tread=TREAD,
        direction="up",
        start=BEFORE,
        length=run + 0.02,
    )
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, terrain=ground, noise="realistic")

    robot = description.robot()
    start = FootstepPlan.standing(robot, Gait(swing_height=0.06 + options.rise))
    middle = 0.5 * (start.left.x + start.right.x)
    plan = climb_stairs(
        start,
        rise=options.rise,
        tread=TREAD,
        count=count,
        first_edge=BEFORE + 0.01 - middle,
        together=options.way == "together",
    )
    walking = WalkingControl(robot, plan, plant.control_period)

    began = plant.truth()
    with options.watch(plant, walking) as view:
        while not walking.done:
            plant.step(walking.command(plant.measure()))
            view.update()

    climbed = float(plant.truth().com[2] - began.com[2])
    return report(upright=upright(plant), steps=walking.steps_done, climbed_mm=1e3 * climbed)


if __name__ == "__main__":
    main()
