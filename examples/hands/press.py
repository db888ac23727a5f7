"""Press on a table, a wall or a rail with both hands, and hold the force.

On a rail the hands carry the CoM beyond the toes: python examples/hands/press.py --on rail --force 80 --view
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _hands import connect, hand_options, report, stand

from wbc.sim import make_scene

SURFACES = {
    "table": ((0.38, 0.7), (0.0, 0.0, -1.0), 0.0),
    "wall": ((0.76, 0.42), (1.0, 0.0, 0.0), 1.0),
    "rail": ((0.775, 0.53), (0.65, 0.0, -0.76), 1.0),
}
"""Place before and below the shoulder (`Hands.point`); direction of the force; `help`."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, on=tuple(SURFACES), force=20.0, hold=30.0)
    place, direction, help_ = SURFACES[options.on]
    walking = stand(options, edge=0.5, help=help_, ramp=6.0)
    hands, along = walking.hands, np.array(direction) / np.linalg.norm(direction)
    x, y, z = hands.point("left_hand", *place)
    if (options.robot, options.on) == ("talos", "wall"):
        x, z = 0.6, 1.0  # its stretched arms are too heavy for their shoulders
    size = {"wall": {}, "rail": {"height": z}, "table": {"height": z}}[options.on]
    scene = make_scene(options.on, distance=x - (0.06 if options.on == "table" else 0.0), **size)
    trial = connect(options, walking, scene)
    plant, given, ahead = trial.plant, [], []  # by the surface, N; centre of mass before the toes, mm

    def look() -> None:
        given.append(-plant.truth().other_force @ along)
        toes = max(plant.data.site_xpos[list(plant.sole_sites), 0]) + 0.5 * plant.robot.soles[0].length
        ahead.append(1e3 * (plant.truth().com[0] - toes))

    with trial.running(options.hooks()):
        trial.advance(0.5)
        for name, side in (("left_hand", 1.0), ("right_hand", -1.0)):
            hands.press(name, 0.5 * options.force, along, at=(x, side * y, z), firm=True)
        trial.until(lambda: hands.there, 30.0)
        trial.advance(hands.settings.ramp + 1.0)
        trial.advance(options.hold, look)
        trial.stage = "done"

    count = round(0.1 / plant.control_period)
    spans = np.array(given[: len(given) // count * count]).reshape(-1, count).mean(axis=1)  # over 0.1 s each
    steady = float(np.mean(np.abs(spans - options.force) <= 0.1 * options.force))
    asked = {"on": options.on, "force_N": options.force, "lost": hands.lost}
    force = {"mean_N": spans.mean(), "least_N": spans.min(), "greatest_N": spans.max(), "steady": steady}
    return report(trial, options, **asked, **force, beyond_toes_mm=max(ahead))


if __name__ == "__main__":
    main()
