"""Walk: footsteps, a controller and the loop between them and the robot, with everything spelled out.

A plan is two standing feet and a sequence of landings. The controller computes the rest: phases, motion of the centre
of mass, and contact wrench of each sole. With `--view` the browser shows the walk: outlines are planned footsteps,
filled areas are soles as they landed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.walking import FootstepPlan, WalkingControl, walk_distance


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=1.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, noise="realistic")  # of the sensors

    robot = description.robot()
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period)

    start = plant.truth().com
    with options.watch(plant, walking) as view:
        while not walking.done:
            plant.step(walking.command(plant.measure()))
            view.update()

    distance = float(plant.truth().com[0] - start[0])
    return report(upright=upright(plant), steps=walking.steps_done, distance_m=distance, seconds=plant.time)


if __name__ == "__main__":
    main()
