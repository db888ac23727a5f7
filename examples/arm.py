"""Inverse kinematics of an arm: its hand goes round a circle, and around a ball that lies in the way and moves.

Tasks, limits and contacts are those of a controller. Inverse kinematics solves for joint velocities; it has no forces.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from _common import parse, report

import wbc


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=8.0)
    description = wbc.load_robot("panda")
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, dt=0.01)
    ik.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-3))
    hand = ik.add(wbc.PoseTask("panda_hand"))
    start, radius = hand.target, 0.15
    ball = wbc.Obstacle("ball", wbc.CollisionSphere(0.05))
    ball.placement = pin.SE3(np.eye(3), start.translation + [0.0, 0.03, -2.3 * radius])
    limit = wbc.CollisionLimit("all", obstacles=[ball], shapes=description.collision_shapes())
    ik.add(limit)
    nearest, errors = np.inf, []
    with options.watch(description) as view:
        for step in range(round(options.seconds / ik.dt)):
            angle = 0.5 * np.pi * step * ik.dt
            goal, sway = pin.SE3(start), 0.03 * np.array([np.sin(angle), np.cos(angle), 0.0])
            goal.translation += radius * np.array([0.0, np.sin(angle), np.cos(angle) - 1.0])
            hand.target = goal
            hand.feedforward_velocity = (
                0.5 * np.pi * radius * np.array([0.0, np.cos(angle), -np.sin(angle), 0, 0, 0])
            )
            ball.placement = pin.SE3(np.eye(3), start.translation + sway - [0.0, 0.0, 2.3 * radius])
            ball.velocity = 0.5 * np.pi * np.array([sway[1], -sway[0], 0.0, 0.0, 0.0, 0.0])
            ik.step()
            away = min(distance for pair, distance in limit.distances.items() if "ball" in pair)
            nearest = min(nearest, away)
            errors.append(float(np.linalg.norm(hand.error[:3])))
            view.update(robot)
    return report(
        error_mm=1e3 * float(np.median(errors)), furthest_mm=1e3 * max(errors), ball_mm=1e3 * nearest
    )


if __name__ == "__main__":
    main()
