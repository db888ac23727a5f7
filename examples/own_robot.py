"""A robot of your own: from a bare URDF to standing on its feet.

Besides the URDF, only the links of the feet must be known. Sole rectangles, half-sitting posture, servo gains and rotor
inertia are derived from the model, and printed as a report. To try your robot:

    python own_robot.py --urdf my.urdf --left l_foot_link --right r_foot_link --view
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from _common import parse, report, upright

import wbc


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(
        __doc__,
        arguments,
        seconds=5.0,
        urdf=Path(__file__).parent / "biped.urdf",
        left="left_foot",
        right="right_foot",
    )
    description = wbc.RobotDescription.from_urdf(
        options.urdf, left_sole=options.left, right_sole=options.right
    )
    print(description.report())

    plant = wbc.Plant(description)
    controller = wbc.balance_controller(description.robot(), plant.control_period)
    control = wbc.PositionControl(controller)
    start = plant.truth().com
    with options.watch(plant) as view:
        while plant.time < options.seconds:
            if plant.ticks == 200:  # after 1 s: a push, to test the balance
                plant.push("base", [0.05 * plant.robot.mass / 0.1, 0.0, 0.0], duration=0.1)
            plant.step(control.command(plant.measure()))
            view.update()

    moved = abs(plant.truth().com - start).max()
    return report(upright=upright(plant), moved_mm=1e3 * float(moved))


if __name__ == "__main__":
    main()
