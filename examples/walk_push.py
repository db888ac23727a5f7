"""Push while walking: a shove in the middle of a step, and how the robot steps aside to catch itself.

An error that the standing foot cannot correct needs another landing, or an earlier one. With `wbc walk --workbench` you
can push the robot yourself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc
from wbc.walking import FootstepPlan, WalkingControl, walk_distance

DURATION = 0.1
"""Duration of the push, s."""

STEP = 1
"""Index of the step in whose middle the push begins: the second one, of the right foot."""

DIRECTIONS = {"right": (0.0, -1.0), "left": (0.0, 1.0), "forward": (1.0, 0.0), "back": (-1.0, 0.0)}


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=0.6, impulse=0.15, direction=tuple(DIRECTIONS))
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, noise="realistic")
    robot = description.robot()
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period)

    force = options.impulse * robot.mass / DURATION * np.array([*DIRECTIONS[options.direction], 0.0])
    pushed, farthest, landing = False, 0.0, plan.steps[STEP]
    with options.watch(plant, walking) as view:
        while not walking.done:
            phases = walking.walk.phases
            swings = phases.swing is not None and phases.step == STEP
            if swings and not pushed and phases.elapsed > 0.5 * phases.duration:
                plant.push("torso", force, DURATION)
                pushed = True
            if swings:
                landing = phases.plan.steps[STEP]  # the plan as it has been adjusted so far
            plant.step(walking.command(plant.measure()))
            view.update()
            if walking.output is not None:
                farthest = max(farthest, float(np.linalg.norm(walking.output.errors.dcm[:2])))

    aside = landing.position - plan.steps[STEP].position
    return report(
        upright=upright(plant) and walking.fallen is None,
        steps=walking.steps_done,
        dcm_off_mm=1e3 * farthest,
        landed_ahead_mm=1e3 * float(aside[0]),
        landed_left_mm=1e3 * float(aside[1]),
    )


if __name__ == "__main__":
    main()
