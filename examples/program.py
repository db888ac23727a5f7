"""Program: stand, reach, look, squat, walk a metre, wave and stand, as states that follow each other by their outcomes.

A state has a start, a condition of its end and a timeout. Targets move on minimum jerk trajectories. A state may set
height, lean, turn and gaze of the walking robot. Try `--robot talos`, or another `--mode`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc
from wbc.tasks import Behaviour, Program, StateMachine, after, reached
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    modes = ("position", "hybrid", "torque")
    options = parse(__doc__, arguments, distance=1.0, robot=("hrp4_class", "talos", "g1"), mode=modes)
    dt = 0.005 if options.mode == "position" else 0.002
    plant = wbc.Plant(wbc.load_robot(options.robot), noise="realistic", control_period=dt)
    robot, settings = plant.description.robot(), WalkingControlSettings(mode=options.mode)
    walking = WalkingControl(robot, FootstepPlan.standing(robot), dt, settings)
    hand, body, high = walking.arms["right_hand"], walking.body, walking.body.com_height
    place = robot.placement(hand.frame).translation + [0.12, 0.0, 0.15]
    carried = robot.placement(robot.base_frame).actInv(place)  # the same place in the pelvis
    states = [
        Behaviour("stand", done=after(1.0)),
        Behaviour("reach", lambda now: hand.reach(place, speed=0.2), done=reached(hand), timeout=8.0),
        Behaviour(
            "look", lambda now: body.look_at([3.0, 1.0, 1.0]), done=lambda now: body.looking, timeout=3.0
        ),
        Behaviour("squat", lambda now: setattr(body, "com_height", high - 0.03), done=reached(body)),
        Behaviour("rise", lambda now: setattr(body, "com_height", high), done=reached(body)),
        Behaviour("let go", lambda now: hand.release(), done=after(1.0)),
        Behaviour(
            "walk", lambda now: walking.go_to(options.distance, 0.0, 0.0), done=lambda now: walking.finished
        ),
        StateMachine(
            "wave", [wave(hand, carried, side, i) for i, side in enumerate((0.06, -0.06, 0.06, -0.06))]
        ),
        Behaviour("rest", lambda now: (hand.release(), body.look_at(None)), done=after(2.0)),
    ]
    program = Program(StateMachine("program", states, {"look": {"timeout": "squat"}}), walking)
    lowest, before = high, float(plant.truth().com[0])

    def watch() -> None:
        nonlocal lowest
        lowest = min(lowest, float(plant.truth().com[2]))
        view.update()

    with options.watch(plant, walking, program) as view:
        outcome = program.run(plant, after_tick=watch)
    for time, path, ended in program.history:
        print(f"{time:6.2f} s  {path}: {ended}")
    forward = float(plant.truth().com[0]) - before
    return report(outcome=outcome, upright=upright(plant), squat_mm=1e3 * (high - lowest), forward_m=forward)


def wave(hand: Any, place: Any, side: float, index: int) -> Behaviour:
    """Return one swing of a hand in front of the pelvis."""
    return Behaviour(
        f"swing {index}",
        lambda now: hand.reach(place + [0.0, side, 0.05], "pelvis", speed=0.4),
        done=reached(hand),
        timeout=4.0,
    )


if __name__ == "__main__":
    main()
