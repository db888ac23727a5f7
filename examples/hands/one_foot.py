"""Stand on one foot, a hand on the wall beside the robot, and be pushed towards it.

python examples/hands/one_foot.py --impulse 0.2 --view
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from _hands import HandTrial, at_ease, hand_options

import wbc
from wbc.sim import make_scene
from wbc.walking import FootstepPlan, Gait, HandSettings

BEFORE, AFTER, PUSH = 3.5, 4.0, 0.1
"""Time on one foot before and after the push, and duration of the push, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, force=15.0, impulse=0.1, direction=90.0)
    robot = wbc.load_robot(options.robot).robot()
    wall = at_ease(robot, 0.22, 0.39, 0.6)
    settings = HandSettings(help=1.0)
    first = settings.reach + settings.ramp + 3.0  # on both feet, until the hand presses
    plan = FootstepPlan.standing(
        robot, Gait(single_support=BEFORE + AFTER + 5.0, initial_double_support=first)
    )
    scene = make_scene("wall", distance=wall[1], angle=90.0)
    trial = HandTrial(options, scene, replace(plan, steps=(plan.left,)), hands=settings)
    in_the_air: list[bool] = []

    with trial.stages("press"):
        trial.go(0.3)
        if options.force:
            trial.hands.press("left_hand", options.force, (0.0, 1.0, 0.0), at=wall, firm=True)
        trial.go(first - 0.3)
        trial.stage = "lift"
        trial.go(BEFORE)
        trial.stage = "push"
        size, angle = options.impulse * robot.mass / PUSH, math.radians(options.direction)
        trial.plant.push("torso", (size * math.cos(angle), size * math.sin(angle), 0.0), PUSH)
        trial.go(AFTER, lambda: in_the_air.append(not trial.walking.walk.phases.contact[0]))

    return trial.report(on_one_foot=trial.stage == "done" and all(in_the_air), lost=trial.hands.lost)


if __name__ == "__main__":
    main()
