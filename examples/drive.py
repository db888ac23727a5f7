"""Drive a robot by the arrow keys in the terminal; space stands, q ends. With `--view` the browser shows the robot.

    python drive.py --view

Without a terminal the robot walks an S. The velocity may change at any tick; footsteps are planned step by step.
"""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.walking import FootstepPlan, WalkingControl

KEYS = {"A": (0.05, 0.0), "B": (-0.05, 0.0), "C": (0.0, -0.1), "D": (0.0, 0.1)}  # how arrows' sequences end
S = [(0.5, (0.2, 0.0, 0.2)), (6.0, (0.2, 0.0, -0.2)), (12.0, None)]


@contextlib.contextmanager
def keys() -> Iterator[Any]:
    """Give a function that returns the next key, or nothing at once."""
    import termios  # noqa: PLC0415 - only on a terminal
    import tty  # noqa: PLC0415

    terminal = sys.stdin.fileno()
    old = termios.tcgetattr(terminal)

    def key() -> str:
        if not select.select([terminal], [], [], 0.0)[0]:
            return ""
        # Not of sys.stdin, whose buffer would hide the rest of an arrow's sequence from `select`.
        return os.read(terminal, 1).decode(errors="replace")

    try:
        tty.setcbreak(terminal)
        yield key
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, old)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=16.0)
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), noise="realistic")
    robot = plant.description.robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
    by_hand, way, key = sys.stdin.isatty(), list(S), ""
    with keys() if by_hand else contextlib.nullcontext(str) as pressed, options.watch(plant, walking) as view:
        while (plant.time < options.seconds or by_hand) and key != "q" and walking.fallen is None:
            while way and plant.time >= way[0][0] and not by_hand:
                walking.velocity = way.pop(0)[1]
            if (key := pressed()) in KEYS or key == " ":
                change = (0.0, 0.0) if key == " " else KEYS[key]
                forward, _, turn = (0.0, 0.0, 0.0) if key == " " else walking.velocity or (0.0, 0.0, 0.0)
                walking.velocity = (forward + change[0], 0.0, turn + change[1])
            plant.step(walking.command(plant.measure()))
            view.update()
    return report(upright=upright(plant), steps=walking.steps_done, forward_m=float(plant.truth().com[0]))


if __name__ == "__main__":
    main()
