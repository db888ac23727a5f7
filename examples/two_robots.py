"""Two robots: they face each other, take the handles of one board, and lift it together by 100 mm.

Each has a controller and a world of its own, which begins between its feet; the plant steps both at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from _common import parse, report

import wbc
from wbc.sim import SharedPlant

BOARD = """<mujoco><worldbody>
  <body name="stand" pos="0.75 0 0.42"><geom type="box" size="0.1 0.1 0.42"/></body>
  <body name="board" pos="0.75 0 0.86"><freejoint/><geom type="box" size="0.35 0.3 0.015" mass="4"/>
    <site name="one left handle" pos="-0.38 0.2 0"/><site name="one right handle" pos="-0.38 -0.2 0"/>
    <site name="two left handle" pos="0.38 -0.2 0"/><site name="two right handle" pos="0.38 0.2 0"/></body>
</worldbody></mujoco>"""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=6.0, lift=0.1)
    robot = wbc.load_robot("hrp4_class")
    plant = SharedPlant(
        {"one": robot, "two": robot}, places={"two": (1.5, 0.0, math.pi)}, scene=BOARD, noise="realistic"
    )
    controls, hands = {}, {}
    for name in plant.loops:
        controller = wbc.balance_controller(robot.robot(), plant.control_period)
        controls[name] = wbc.PositionControl(controller)
        hands[name] = {
            hand: controller.add(wbc.PositionTask(hand, weight=10.0, stiffness=60.0)) for hand in robot.hands
        }
        for side, task in zip((0.2, -0.2), hands[name].values(), strict=True):
            task.move_to([0.3, side, 0.86], speed=0.2)  # the tip of a hand is 0.1 m before its frame
    held = False
    with options.watch(plant.loops["one"]) as view:  # shows that robot
        while plant.time < options.seconds:
            plant.step({name: controls[name].command(m) for name, m in plant.measure().items()})
            if not held and all(task.reached for tasks in hands.values() for task in tasks.values()):
                held = True
                for name, tasks in hands.items():
                    for hand, task in tasks.items():
                        plant.loops[name].grip(hand, f"{name} {hand.removesuffix('_hand')} handle")
                        task.move_to(task.target + [0.0, 0.0, options.lift], speed=0.1)
            view.update()
    board = plant.data.body("scene/board")
    tilt = math.degrees(math.acos(board.xmat[8]))
    return report(lifted_mm=1e3 * (board.xpos[2] - 0.86), tilt_deg=tilt)


if __name__ == "__main__":
    main()
