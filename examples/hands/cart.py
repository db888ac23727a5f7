"""Grip the handles of a cart, push it, turn it about its middle, and pull it back.

The feet slip when the robot turns the cart, and the robot turns further than the cart. The heading of the cart, which
follows from the hands and the gyroscope, is corrected, and the robot walks along it.

Try `python examples/hands/cart.py --robot talos --view`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from _hands import connect, grip, hand_options, report, stand

from wbc.sim import make_scene
from wbc.walking import FootstepPlan, turn_in_place, walk_path

ROBOTS = {
    "hrp4_class": (0.403, 0.893, 15.0, 13.5, 4.4),
    "talos": (0.55, 0.95, 49.0, 30.0, 4.4),
    "g1": (0.365, 0.85, 15.0, 13.5, 2.2),
}
"""Place of the bar, m; resistance of the cart and force above which a hand yields, N; turn in two steps, degrees."""


def along_cart(start: FootstepPlan, way: float, heading: float) -> FootstepPlan:
    """Plan a walk by `way` (m) along the heading (rad) of the cart, with feet that keep their own heading."""
    count = math.ceil(abs(way) / start.gait.full.step_length)
    turned = heading - start.middle[2]
    return walk_path(start, [(way / count * math.cos(turned), way / count * math.sin(turned), 0.0)] * count)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = hand_options(__doc__, arguments, forward=1.0, turn=30.0, back=1.0, corrections=3)
    (x, z, resistance, limit, opening), walking = ROBOTS[options.robot], stand(options)
    hands, robot, most = walking.hands, walking.controller.robot, [0.0, 0.0, 0.0]
    trial = connect(options, walking, make_scene("cart", distance=x, handle=z, resistance=resistance))
    cart, q, turn = trial.plant.data.body("scene/cart"), trial.plant.data.qpos, math.radians(options.turn)
    goal = cart.xpos[:2] + [options.forward - options.back * math.cos(turn), -options.back * math.sin(turn)]

    def look() -> None:
        up = min(cart.xmat[8], 1.0), 1.0 - 2.0 * (q[4] ** 2 + q[5] ** 2)
        most[:] = map(max, most, (*(math.degrees(math.acos(u)) for u in up), math.hypot(*hands.outside[:3])))

    with trial.running(options.hooks()):
        grip(trial, limit, left_hand=("left handle", (x, 0.2, z)), right_hand=("right handle", (x, -0.2, z)))
        held, offset = hands.heading, hands.heading - FootstepPlan.standing(robot).middle[2]
        pivot = {"per_step": math.radians(opening), "ahead": x + 0.57}
        for trial.stage, way, to in (
            ("forward", options.forward, 0),
            ("turn", 0, 1),
            ("back", -options.back, 1),
        ):
            if way:
                trial.follow(along_cart(FootstepPlan.standing(robot), way, hands.heading - offset), 2.0, look)
            for _ in range(options.corrections + (trial.stage == "turn")):
                rest = math.remainder(to * turn + held - hands.heading, math.tau)
                if abs(rest) > math.radians(1.5):
                    trial.follow(turn_in_place(FootstepPlan.standing(robot), rest, **pivot), 2.0, look)
        trial.stage = "done"
    off = math.degrees(math.atan2(cart.xmat[3], cart.xmat[0]) - turn)
    facts = {"resistance_N": resistance, "place_error_mm": 1e3 * math.dist(cart.xpos[:2], goal)}
    facts |= dict(zip(("cart_tilt_deg", "pelvis_tilt_deg", "force_N"), most, strict=True))
    return report(trial, options, **facts, heading_error_deg=off, steps=walking.steps_done)


if __name__ == "__main__":
    main()
