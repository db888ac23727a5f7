"""Grip the handles of a cart, push it, turn it about its middle, and pull it back.

python examples/hands/cart.py --robot talos --view

Feet slip under a heavy cart: its heading, known from the hands and the gyroscope, is corrected after each way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from _hands import HANDS, HandTrial, at_ease, hand_options

import wbc
from wbc.sim import make_scene
from wbc.walking import FootstepPlan, HandSettings, HandState, walk_distance, walk_velocity

BEHIND, BESIDE = 0.57, 0.2
"""Distance of the bar behind the cart's middle, and of a handle from the middle of the bar, m."""

ROBOTS = {"hrp4_class": (15.0, 13.5, 2.2), "talos": (49.0, 30.0, 2.2), "g1": (15.0, 13.5, 1.1)}
"""Resistance of the cart, N; force above which a hand yields, N; turn of a step, degrees."""

BARS = {"talos": {"x": 0.55, "z": 0.95}, "g1": {"z": 0.85}}
"""Distance and height of the bar, m, where they are not where the arms are at ease."""


REST, GOOD = 2.0, math.radians(1.5)
"""Time at rest after each way, s, and error of the heading that is left alone."""


def heading(plan: FootstepPlan) -> float:
    """Return the heading at the end of a plan, half way between both feet."""
    left, right = plan.final
    return right.yaw + 0.5 * math.remainder(left.yaw - right.yaw, math.tau)


def turning(start: FootstepPlan, angle: float, radius: float, turn_step: float) -> FootstepPlan:
    """Return steps that turn a robot about a point ahead of it."""
    steps = max(2, math.ceil(abs(angle) / math.radians(turn_step)))
    rate = angle / (steps * (start.gait.single_support + start.gait.double_support))
    for _ in range(4):  # the step that closes up turns as well
        plan = walk_velocity(start, (0.0, -radius * rate, rate), steps=steps)
        turned = angle + math.remainder(heading(plan) - heading(start) - angle, math.tau)
        rate *= angle / turned if turned else 1.0
    return plan


def yaw(pose: pin.SE3) -> float:
    """Return the heading of a pose."""
    return math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    ways = {"forward": 1.0, "turn": 30.0, "back": 1.0, "corrections": 3}
    options = hand_options(__doc__, arguments, robot=tuple(ROBOTS), **ways)
    resistance, limit, turn_step = ROBOTS[options.robot]
    x, _, z = at_ease(wbc.load_robot(options.robot).robot(), 0.69, 0.48)
    x, z = ({"x": x, "z": z} | BARS.get(options.robot, {})).values()
    scene = make_scene("cart", distance=x, handle=z, resistance=resistance)
    trial = HandTrial(options, scene, hands=HandSettings())
    plant, hands = trial.plant, trial.hands
    cart, known = plant.model.body("scene/cart").id, trial.walking.control.observer.robot
    greatest = np.zeros(3)  # tilt of cart and pelvis, rad, force of both hands, N

    def pose() -> pin.SE3:
        """Return the true place of the cart."""
        turn = yaw(pin.SE3(plant.data.xmat[cart].reshape(3, 3), np.zeros(3)))
        return pin.SE3(pin.utils.rotate("z", turn), np.array([*plant.data.xpos[cart][:2], 0.0]))

    def felt() -> float:
        """Heading of the line between both hands, as the robot knows it."""
        left, right = (known.placement(known.frames[name]).translation for name in HANDS)
        return math.atan2(right[0] - left[0], left[1] - right[1]) + hands.slip

    def look() -> None:
        x, y = plant.data.qpos[4:6]
        up = np.clip([plant.data.xmat[cart][8], 1.0 - 2.0 * (x * x + y * y)], -1.0, 1.0)
        np.maximum(greatest, [*np.arccos(up), np.linalg.norm(hands.outside[:3])], out=greatest)

    begin = goal = pose()
    corrections = 0
    with trial.stages("grip"):
        trial.go(0.5)
        for name, side in HANDS.items():
            hands.grip(name, (x, side * BESIDE, z), (1.0, 0.0, 0.0), limit)
        trial.wait(lambda: all(hand.state is HandState.GRIP for hand in hands.all.values()), 20.0)
        for name in HANDS:
            plant.grip(name, name.replace("_hand", " handle"))
        trial.go(1.0)
        held = felt()
        ways = (("forward", options.forward, 0.0), ("turn", 0.0, options.turn), ("back", -options.back, 0.0))
        for trial.stage, way, turn in ways:
            goal = goal * pin.SE3(pin.utils.rotate("z", math.radians(turn)), np.array([way, 0.0, 0.0]))
            if way:
                trial.follow(walk_distance(trial.stand(), way), REST, look)
            elif turn:
                trial.follow(turning(trial.stand(), math.radians(turn), x + BEHIND, turn_step), REST, look)
            for _ in range(options.corrections if way or turn else 0):
                rest = math.remainder(yaw(goal) - felt() + held - yaw(begin), math.tau)
                if abs(rest) < GOOD:
                    break
                corrections += 1
                trial.follow(turning(trial.stand(), rest, x + BEHIND, turn_step), REST, look)

    error = goal.actInv(pose())
    cart_tilt, pelvis_tilt, force = greatest.tolist()
    return trial.report(
        resistance_N=resistance,
        place_error_mm=1e3 * float(np.hypot(*error.translation[:2])),
        heading_error_deg=math.degrees(yaw(error)),
        cart_tilt_deg=math.degrees(cart_tilt),
        pelvis_tilt_deg=math.degrees(pelvis_tilt),
        force_N=force,
        steps=trial.walking.steps_done,
        corrections=corrections,
    )


if __name__ == "__main__":
    main()
