"""Stand on one foot, a hand on the wall beside the robot, and be pushed towards it.

python examples/hands/one_foot.py --impulse 0.2 --view
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from _hands import connect, hand_options, report, stand

import wbc
from wbc.sim import make_scene
from wbc.walking import FootstepPlan, Gait, HandSettings

BEFORE, AFTER, PUSH = 3.5, 4.0, 0.1
"""Time on one foot before and after the push, and duration of the push, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, mode=("position",), force=15.0, impulse=0.1, direction=90.0)
    first = HandSettings().reach_time + HandSettings().ramp + 3.0  # on both feet, until the hand presses
    gait = Gait(single_support=BEFORE + AFTER + 5.0, initial_double_support=first)
    plan = FootstepPlan.standing(wbc.load_robot(options.robot).robot(), gait)
    walking = stand(options, replace(plan, steps=(plan.left,)), help=1.0)
    hands, mass = walking.hands, walking.controller.robot.mass
    wall = hands.point("left_hand", 0.22, 0.39, 0.6)
    trial = connect(options, walking, make_scene("wall", distance=wall[1], angle=90.0))
    in_the_air: list[bool] = []

    with trial.running(options.hooks()):
        trial.stage = "press"
        trial.advance(0.3)
        if options.force:
            hands.press("left_hand", options.force, (0.0, 1.0, 0.0), at=wall, firm=True)
        trial.advance(first - 0.3)
        trial.stage = "lift"
        trial.advance(BEFORE)
        trial.stage = "push"
        size, angle = options.impulse * mass / PUSH, math.radians(options.direction)
        trial.plant.push("torso", (size * math.cos(angle), size * math.sin(angle), 0.0), PUSH)
        trial.advance(AFTER, lambda: in_the_air.append(walking.progress.swing == 0))
        trial.stage = "done"

    return report(trial, options, on_one_foot=trial.stage == "done" and all(in_the_air), lost=hands.lost)


if __name__ == "__main__":
    main()
