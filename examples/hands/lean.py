"""Lean on a rail, until the centre of mass is beyond the toes; or press on a table or a wall.

python examples/hands/lean.py --on rail --view

The hands go before the surface, approach until they touch, and press with a force that the wrists measure.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from wbc.sim import make_scene
from wbc.walking import FootstepPlan, HandSettings, WalkingControl, WalkingControlSettings

sys.path.insert(0, str(Path(__file__).parents[1]))
from _common import parse, report, upright  # noqa: E402

SCENES = {
    "rail": ({"distance": 0.45, "height": 0.85}, (0.65, 0.0, -0.76), (0.45, 0.2, 0.85), 40.0),
    "table": ({"distance": 0.18, "height": 0.7}, (0.0, 0.0, -1.0), (0.24, 0.2, 0.7), 30.0),
    "wall": ({"distance": 0.46}, (1.0, 0.0, 0.0), (0.46, 0.2, 0.95), 10.0),
}
"""Parameters of the scene, direction and point (m) of the left hand, force of each hand (N)."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=10.0, on=tuple(SCENES))
    parameters, direction, (x, y, z), force = SCENES[options.on]
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, scene=make_scene(options.on, **parameters))
    robot = description.robot()
    settings = WalkingControlSettings(hands=HandSettings())
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period, settings)
    assert walking.hands is not None
    for name, side in (("left_hand", 1.0), ("right_hand", -1.0)):
        walking.hands.press(name, force, direction, at=(x, side * y, z), firm=True)  # none of them gives way

    with options.watch(plant, walking) as view:
        while plant.time < options.seconds:
            plant.step(walking.command(plant.measure()))
            view.update()

    toes = (
        max(place[0] for place in plant.data.site_xpos[list(plant.sole_sites)]) + 0.5 * robot.soles[0].length
    )
    return report(
        upright=upright(plant),
        force_N=float(np.mean([hand.pressed for hand in walking.hands.all.values()])),
        beyond_toes_mm=1e3 * float(plant.truth().com[0] - toes),
    )


if __name__ == "__main__":
    main()
