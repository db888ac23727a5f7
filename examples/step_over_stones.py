"""Free steps: the robot walks over stones of 60 mm on its own small feet, and is pushed.

No footsteps are planned. Place and time of each step are decided anew from the state of the robot, about 170 times a
second, so that its steps keep the balance. The robot knows neither the ground nor the push.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.sim import make_terrain
from wbc.walking import WalkingControl, WalkingControlSettings

DURATION = 0.1
"""Duration of the push, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=1.5, amplitude=0.06, seed=7, impulse=0.2)
    description = wbc.load_robot("g1")
    stones = make_terrain("stones", amplitude=options.amplitude, seed=options.seed)
    plant = wbc.Plant(description, terrain=stones, noise="realistic", seed=3, control_period=0.002)
    robot = description.robot()
    walking = WalkingControl(robot, None, plant.control_period, WalkingControlSettings(mode="torque"))
    force = [0.0, options.impulse * robot.mass / DURATION, 0.0]  # to the left
    start, pushed = float(plant.truth().com[0]), False
    walking.velocity = (0.3, 0.0, 0.0)  # forward m/s, left m/s, turn rad/s
    with options.watch(plant, walking) as view:
        while not walking.done and plant.time < 10.0 * options.distance:
            way = float(plant.truth().com[0]) - start
            if not pushed and way > 0.5 * options.distance:
                plant.push("torso", force, DURATION)
                pushed = True
            if way > options.distance and walking.velocity is not None:
                walking.velocity = None  # stop: feet together, and a stand
            plant.step(walking.command(plant.measure()))
            view.update()
    return report(
        upright=upright(plant) and walking.fallen is None,
        steps=walking.steps_done,
        pushed=pushed,
        forward_m=float(plant.truth().com[0]) - start,
        aside_m=float(plant.truth().com[1]),
    )


if __name__ == "__main__":
    main()
