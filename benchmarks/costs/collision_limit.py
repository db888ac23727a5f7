"""Time that the rows of a limit on collisions take.

    python benchmarks/costs/collision_limit.py --seconds 5

A G1 stands with its arms beside its body, or with both hands pressed at its thighs. The limit is on 20 pairs of its
forearms and hands against its trunk and legs, of capsules or of the hulls of the meshes. The states of 60 ticks are
recorded, and filled in again. To compare two versions, run each in turn with `PYTHONPATH`.
"""

from __future__ import annotations

import argparse
import logging
import time

import numpy as np
import pinocchio as pin

import wbc
from wbc.base.numbers import Array

ARMS = ("left_elbow_link", "left_rubber_hand", "right_elbow_link", "right_rubber_hand")
BODY = ("torso_link", "left_hip_yaw_link", "right_hip_yaw_link", "left_knee_link", "right_knee_link")
PERIOD = 0.005
SCENES = [(shapes, pressed) for pressed in (False, True) for shapes in ("capsules", "hulls")]


def limit_on(description: wbc.RobotDescription, shapes: str) -> wbc.CollisionLimit:
    found = description.collision_hulls() if shapes == "hulls" else description.collision_shapes()
    pairs = [(one, other) for one in ARMS for other in BODY]
    return wbc.CollisionLimit(pairs, shapes={link: found[link] for link in (*ARMS, *BODY)})


def states(description: wbc.RobotDescription, shapes: str, pressed: bool) -> list[tuple[Array, Array]]:
    """Return configurations and velocities of 60 ticks at the end of 2 s."""
    robot, found = description.robot(), list[tuple[Array, Array]]()
    controller = wbc.Controller(robot, PERIOD)
    controller.add(wbc.PostureTask(weight=0.01), wbc.CoMTask(), wbc.OrientationTask(robot.torso_frame))
    controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    controller.add(wbc.JointLimits(), wbc.TorqueLimits(), limit_on(description, shapes))
    for side in ("left", "right") if pressed else ():
        hand = controller.add(wbc.PositionTask(robot.frames[f"{side}_hand"], weight=10.0, name=side))
        hand.target = robot.placement(f"{side}_hip_yaw_link").translation - [0.0, 0.0, 0.05]
    q, v = robot.q.copy(), robot.v.copy()
    for _ in range(400):
        controller.update(q, v)
        v = v + PERIOD * controller.solve().accelerations
        q = pin.integrate(robot.model, q, PERIOD * v)
        found.append((q.copy(), v.copy()))
    return found[-60:]


def main(seconds: float) -> None:
    """Print the fastest twentieth of each scene, µs."""
    description = wbc.load_robot("g1")
    for shapes, pressed in SCENES:
        robot, limit = description.robot(), limit_on(description, shapes)
        limit.bind(robot)
        rows, lower, upper = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
        recorded, end = states(description, shapes, pressed), time.perf_counter() + seconds
        times: tuple[list[float], list[float]] = ([], [])
        while time.perf_counter() < end:
            for q, v in recorded:
                for kind, write in enumerate((limit.write, limit.write_velocity)):
                    robot.update(q, v)
                    start = time.perf_counter()
                    write(PERIOD, rows, lower, upper)
                    times[kind].append(1e6 * (time.perf_counter() - start))
        control, kinematics = (np.sort(each)[len(each) // 20] for each in times)
        near = sum(distance < 0.03 for distance in limit.distances.values())
        place = "hands at the thighs" if pressed else "standing"
        print(
            f"{shapes}, {place}, {near} pairs below 30 mm: {control:.0f} µs; kinematics {kinematics:.0f} µs"
        )


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="time for each scene, default %(default)s")
    main(parser.parse_args().seconds)
