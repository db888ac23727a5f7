"""Press on a table, a wall or a rail with both hands, and hold the force.

python examples/hands/press.py --on wall --force 60 --view

On a rail or a wall the hands help to balance: the centre of mass goes beyond the toes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _hands import HANDS, HandTrial, at_ease, hand_options

import wbc
from wbc.sim import make_scene
from wbc.walking import HandSettings, HandState

SURFACES = {
    "table": ((0.42, 0.7), (0.0, 0.0, -1.0), 0.0),
    "wall": ((0.8, 0.42), (1.0, 0.0, 0.0), 1.0),
    "rail": ((0.8, 0.55), (0.65, 0.0, -0.76), 1.0),
}
"""Point in front of and below the shoulder, in shares of the arm's reach; direction of the force; `help`."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, on=tuple(SURFACES), force=20.0, hold=30.0)
    place, direction, help_ = SURFACES[options.on]
    x, y, z = at_ease(wbc.load_robot(options.robot).robot(), *place)
    if (options.robot, options.on) == ("talos", "wall"):
        x, z = 0.6, 1.0  # its stretched arms are too heavy for their shoulders
    size = {"wall": {}, "rail": {"height": z}, "table": {"height": z}}[options.on]
    scene = make_scene(options.on, distance=x - (0.06 if options.on == "table" else 0.0), **size)
    trial = HandTrial(options, scene, hands=HandSettings(edge=0.5, help=help_, ramp=6.0))
    hands, plant, along = trial.hands, trial.plant, np.array(direction) / np.linalg.norm(direction)
    given: list[float] = []  # by the surface, N
    ahead: list[float] = []  # centre of mass before the toes, m

    def look() -> None:
        truth = plant.truth()
        given.append(-float(truth.contact_force[truth.contact_sole < 0].sum(axis=0) @ along))
        toes = max(plant.data.site_xpos[list(plant.sole_sites), 0]) + 0.5 * trial.robot.soles[0].length
        ahead.append(float(truth.com[0] - toes))

    with trial.stages("reach"):
        trial.go(0.5)
        for name, side in HANDS.items():
            hands.press(name, 0.5 * options.force, along, at=(x, side * y, z), firm=True)
        trial.wait(lambda: all(hand.state is HandState.HOLD for hand in hands.all.values()), 30.0)
        trial.stage = "ramp"
        trial.go(hands.settings.ramp + 1.0)
        trial.stage = "hold"
        trial.go(options.hold, look)

    size = round(0.1 / plant.control_period)
    spans = np.array(given[: len(given) // size * size]).reshape(-1, size).mean(axis=1)  # over 0.1 s each
    return trial.report(
        on=options.on,
        force_N=options.force,
        mean_N=float(spans.mean()),
        least_N=float(spans.min()),
        greatest_N=float(spans.max()),
        steady=float(np.mean(np.abs(spans - options.force) <= 0.1 * options.force)),
        beyond_toes_mm=1e3 * max(ahead),
        lost=hands.lost,
    )


if __name__ == "__main__":
    main()
