"""Open a door by its handle, push the leaf on with the other hand, and walk through.

python examples/hands/door.py --view
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from _hands import HandTrial, at_ease, hand_options

import wbc
from wbc.sim import make_scene
from wbc.walking import HandSettings, HandState, turn_in_place, walk_distance

HAND, OTHER = "right_hand", "left_hand"
"""Hand that opens the door, whose hinge is on the left, and the one that pushes the leaf on."""

BACK, TUCK = (-0.25, 0.6, 0.1), (0.3, 0.5, 0.0)
"""A hand out of the way, and one close to the trunk: before, below and outside the shoulder, in shares of the reach."""

SWEEP = ((0.45, 0.4, -0.1), (0.65, 0.35, 0.0), (0.65, 0.35, 0.4), TUCK)
"""Way of the hand that pushes the leaf, likewise."""

ASIDE, LEAF, REST = 0.4, 0.06, 1.0
"""Handle to the right of the middle of the doorway, and before the leaf, m; time at rest after each way, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    ways = {"push": 0.25, "through": 1.5, "resistance": 2.0, "limit": 10.0}
    options = hand_options(__doc__, arguments, **ways)
    robot = wbc.load_robot(options.robot).robot()
    pelvis, (x, _, z) = robot.placement(robot.base_frame), at_ease(robot, 0.62, 0.42)
    scene = make_scene("door", distance=x + LEAF, handle=z, resistance=options.resistance)
    trial = HandTrial(options, scene, hands=HandSettings())
    plant, hands, arms = trial.plant, trial.hands, trial.walking.arms
    hinge = plant.model.joint("scene/door hinge").qposadr[0]
    forces, touches, released = [0.0], [0.0], math.nan

    def feel() -> None:
        forces.append(float(np.linalg.norm(hands.outside[:3])))

    def bump() -> None:
        truth = plant.truth()
        given = float(np.linalg.norm(truth.contact_force[truth.contact_sole < 0].sum(axis=0)))
        touches.append(touches[-1] + 0.3 * (given - touches[-1]))  # over 10 ms

    def reach(hand: str, place: tuple[float, float, float]) -> None:
        point = pelvis.actInv(at_ease(robot, *place))
        arms[hand].reach(point * [1.0, 1.0 if hand == OTHER else -1.0, 1.0], "pelvis")

    with trial.stages("grip"):
        trial.go(0.5)
        reach(OTHER, BACK)
        hands.grip(HAND, (x, -ASIDE, z), (1.0, 0.0, 0.0), options.limit)
        trial.wait(lambda: hands.all[HAND].state is HandState.GRIP, 20.0)
        plant.grip(HAND, "door handle")
        trial.go(0.5)
        trial.stage = "push"
        trial.follow(walk_distance(trial.stand(), options.push), REST, feel)
        trial.stage, released = "open", float(plant.data.qpos[hinge])
        plant.let_go(HAND)
        hands.release(HAND)
        trial.go(1.0, bump)
        reach(HAND, TUCK)
        for place in SWEEP:
            reach(OTHER, place)
            trial.go(1.5, bump)
        trial.stage = "through"
        if abs(hands.slip) > math.radians(3.0):  # the feet have slipped
            trial.follow(turn_in_place(trial.stand(), -hands.slip), REST, bump)
        trial.follow(walk_distance(trial.stand(), options.through), REST, bump)

    return trial.report(
        released_deg=math.degrees(released),
        open_deg=math.degrees(float(plant.data.qpos[hinge])),
        beyond_mm=1e3 * float(plant.data.qpos[0] - x - LEAF),
        force_N=max(forces),
        touch_N=max(touches),
        steps=trial.walking.steps_done,
    )


if __name__ == "__main__":
    main()
