"""Carry: a load of unknown mass is put into both hands, found, carried for some steps, and dropped.

python examples/hands/carry.py --share 0.2 --steps 4 --view
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from wbc.sim import arms_forward
from wbc.walking import FootstepPlan, LoadSettings, WalkingControl, WalkingControlSettings

sys.path.insert(0, str(Path(__file__).parents[1]))
from _common import parse, report, upright  # noqa: E402


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, robot=("hrp4_class", "talos", "g1"), share=0.15, steps=2)

    description = wbc.load_robot(options.robot)
    robot = description.robot()
    posture = arms_forward(robot, 0.3)
    plant = wbc.Plant(description, noise="realistic", initial_configuration=posture)
    robot.update(posture, np.zeros(robot.nv))
    settings = WalkingControlSettings(load=LoadSettings())  # looks for a load in all hands
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period, settings)
    load, mass, hands = walking.load, options.share * robot.mass, tuple(robot.frames.values())
    assert load is not None

    with options.watch(plant, walking) as view:

        def advance(seconds: float) -> None:
            end = plant.time + seconds
            while plant.time < end:
                plant.step(walking.command(plant.measure()))
                view.update()

        def put(kilograms: float, over: float) -> None:
            for hand in hands:
                plant.load(hand, kilograms / len(hands), over=over)

        advance(2.0)  # with empty hands: what the sensors show now is no load
        put(mass, over=1.0)
        advance(4.0)
        found, place = load.mass, load.place
        walking.velocity = (0.1, 0.0, 0.0)
        while walking.steps_done < options.steps - 1 and walking.fallen is None:
            advance(0.1)
        walking.velocity = None  # one more step closes up
        advance(3.0)
        put(0.0, over=0.0)  # dropped
        advance(3.0)

    return report(
        upright=upright(plant),
        load_kg=mass,
        found_kg=found,
        ahead_m=float(place[0]),
        steps=walking.steps_done,
        after_it_fell_kg=load.mass,
    )


if __name__ == "__main__":
    main()
