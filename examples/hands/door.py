"""Open a door by its handle, push the leaf on with the other hand, and walk through.

python examples/hands/door.py --view
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from _hands import LOW, connect, grip, hand_options, report, stand

from wbc.sim import make_scene
from wbc.walking import FootstepPlan, turn_in_place, walk_distance

WAY, REST = ((-0.25, 0.6, 0.1), (0.45, 0.4, -0.1), (0.65, 0.35, 0.0), (0.65, 0.35, 0.4)), (0.3, 0.5, 0.0)
"""Way of the left hand, which pushes the leaf on when the right one has opened it, and keeps it off the robot that
walks through; place of the right hand meanwhile (`Hands.point`)."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, push=0.25, through=1.5, limit=10.0)
    walking = stand(options, stepping=LOW)
    hands, arms, robot = walking.hands, walking.arms, walking.controller.robot
    pelvis, (x, _, z) = robot.placement(robot.base_frame), hands.point("left_hand", 0.62, 0.42)
    way = [pelvis.actInv(hands.point("left_hand", *place)) for place in WAY]
    rest = pelvis.actInv(hands.point("right_hand", *REST))
    leaf, released, forces, touches = x + 0.06, math.nan, [0.0], [0.0]  # its hinge is on the left
    trial = connect(options, walking, make_scene("door", distance=leaf, handle=z))
    plant, angle = trial.plant, trial.plant.data.joint("scene/door hinge").qpos

    def bump() -> None:
        touches.append(0.7 * touches[-1] + 0.3 * math.hypot(*plant.truth().other_force))  # over 10 ms

    with trial.running(options.hooks()):
        arms["left_hand"].reach(way[0], "pelvis")
        grip(trial, options.limit, right_hand=("door handle", (x, -0.4, z)))
        trial.stage, push = "push", walk_distance(FootstepPlan.standing(robot), options.push)
        trial.follow(push, 1.0, lambda: forces.append(math.hypot(*hands.outside[:3])))
        trial.stage, released = "open", math.degrees(angle[0])
        plant.let_go("right_hand")
        hands.release("right_hand")
        trial.advance(1.0, bump)
        arms["right_hand"].reach(rest, "pelvis")
        for point in way[1:]:
            arms["left_hand"].reach(point, "pelvis")
            trial.advance(1.5, bump)
        trial.stage = "through"
        if abs(hands.slip) > math.radians(3.0):  # the feet have slipped
            trial.follow(turn_in_place(FootstepPlan.standing(robot), -hands.slip), 1.0, bump)
        trial.follow(walk_distance(FootstepPlan.standing(robot), options.through), 1.0, bump)
        trial.stage = "done"

    facts = {"released_deg": released, "open_deg": math.degrees(angle[0]), "steps": walking.steps_done}
    facts |= {"beyond_mm": 1e3 * (plant.data.qpos[0] - leaf), "force_N": max(forces), "touch_N": max(touches)}
    return report(trial, options, **facts)


if __name__ == "__main__":
    main()
