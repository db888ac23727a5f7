"""Carry: a load of unknown mass is put into both hands, found, carried for some steps, and dropped.

python examples/hands/carry.py --share 0.2 --steps 4
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

import wbc
from wbc.sim import TrueFallDetector, arms_forward
from wbc.walking import FootstepPlan, LoadSettings, WalkingControl, WalkingControlSettings


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="hrp4_class")
    parser.add_argument("--share", type=float, default=0.15, help="load over the robot's mass, default 0.15")
    parser.add_argument("--steps", type=int, default=2, help="steps with the load, default 2")
    options = parser.parse_args(arguments)

    description = wbc.load_robot(options.robot)
    robot = description.robot()
    posture = arms_forward(robot, 0.3)
    plant = wbc.Plant(description, noise="realistic", initial_configuration=posture)
    robot.update(posture, np.zeros(robot.nv))
    settings = WalkingControlSettings(load=LoadSettings())  # looks for a load in all hands
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period, settings)
    load, mass, hands = walking.load, options.share * robot.mass, tuple(robot.frames.values())
    assert load is not None

    def advance(seconds: float) -> None:
        end = plant.time + seconds
        while plant.time < end:
            plant.step(walking.command(plant.measure()))

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
    upright = not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    print(
        f"load {mass:.2f} kg, found {found:.2f} kg at {place.round(3)}, {walking.steps_done} steps, "
        f"{load.mass:.2f} kg after it fell, upright {upright}"
    )
    return {"upright": upright, "mass": mass, "found": found, "steps": walking.steps_done, "left": load.mass}


if __name__ == "__main__":
    main()
