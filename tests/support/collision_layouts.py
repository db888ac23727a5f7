"""Random layouts: a shape at the hand of an arm, an obstacle in its way that may move, and a target behind it.

`python tests/support/collision_layouts.py kinematics 0 10000 FILE` runs layouts in inverse kinematics (or in `torque`
control), with a line of JSON for each in FILE, and prints what came out.
"""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

import wbc
from wbc.base.numbers import Array
from wbc.core.limits.obstacles import Shape, geometry_of

HAND, MARGIN, PERIOD, SECONDS, MOVING = "panda_hand", 0.02, 0.005, 1.5, 0.6
KINDS = ("box", "box", "cylinder", "capsule", "sphere", "hull")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a layout.

    Attributes:
        seed: Seed of the layout.
        shapes: Shape at the hand, and obstacle.
        deepest: How far the shapes came closer than the margin, m.
        steepest: How much closer they came in a period than the limit allows, as a share of θ² ℓ: θ is the sum of the
            turns of all joints in the period, rad, and ℓ the distance of the shape from the root of the arm, m.
        jump: Change of joint speeds in a period at the end, median, rad/s.
        unsolved: Periods without a solution that keeps all limits.
    """

    seed: int
    shapes: str
    deepest: float
    steepest: float
    jump: float
    unsolved: int


@cache
def panda() -> wbc.RobotDescription:
    return wbc.load_robot("panda")


def random_shape(rng: np.random.Generator, small: bool) -> Shape:
    """Return a shape of 3 to 12 cm, or of 8 to 30 cm."""
    size, kind = rng.uniform(0.03, 0.12, 3) if small else rng.uniform(0.08, 0.3, 3), rng.choice(KINDS)
    end = (0.0, 0.0, 0.5 * float(size[1]))
    start = (0.0, 0.0, -end[2])
    if kind == "box":
        return wbc.CollisionBox(tuple(size.tolist()))
    if kind == "cylinder":
        return wbc.CollisionCylinder(0.5 * float(size[0]), start, end)
    if kind == "capsule":
        return wbc.CollisionCapsule(float(size[0]) / 3.0, start, end)
    if kind == "sphere":
        return wbc.CollisionSphere(0.5 * float(size[0]))
    points = rng.uniform(-0.5, 0.5, (14, 3)) * size
    return wbc.CollisionHull(tuple(map(tuple, points.tolist())))


def kinematics(task: wbc.Task, limit: wbc.CollisionLimit) -> Iterator[tuple[Array, bool]]:
    """Yield joint velocities of inverse kinematics and whether all limits hold, a period at a time."""
    ik = wbc.InverseKinematics(panda().robot(), PERIOD)
    ik.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-4), task, limit)
    while True:
        velocity = ik.step()
        assert ik.solution is not None
        yield velocity, ik.solution.status.name == "SOLVED"


def torque(task: wbc.Task, limit: wbc.CollisionLimit) -> Iterator[tuple[Array, bool]]:
    """Yield the joint velocities of torque control and whether all limits hold, a period at a time."""
    robot = panda().robot()
    controller = wbc.Controller(robot, PERIOD)
    controller.add(wbc.JointLimits(), wbc.TorqueLimits(), wbc.PostureTask(weight=0.01), task, limit)
    q, v = robot.q.copy(), robot.v.copy()
    while True:
        controller.update(q, v)
        solution = controller.solve()
        v = v + PERIOD * solution.accelerations
        q = pin.integrate(robot.model, q, PERIOD * v)
        robot.update_jacobians(q)
        yield v, solution.status.name == "SOLVED"


CONTROLS: dict[str, Callable[[wbc.Task, wbc.CollisionLimit], Iterator[tuple[Array, bool]]]] = {
    "kinematics": kinematics,
    "torque": torque,
}


def run(seed: int, control: str) -> Outcome | None:
    """Run the layout of a seed; None where the shapes begin closer than 3 cm."""
    rng = np.random.default_rng(seed)
    small, large = random_shape(rng, True), random_shape(rng, False)
    hand = pin.SE3(panda().robot().placement(HAND))
    way = rng.normal(size=3)
    way[2] = -0.7 * abs(way[2])
    way /= np.linalg.norm(way)
    turn = hand.rotation if rng.random() < 0.5 else pin.exp3(rng.normal(size=3))
    begin = pin.SE3(turn, hand.translation + 0.35 * way)
    speed, spin = -rng.uniform(0.0, 0.15) * way, 0.5 * rng.normal(size=3)
    speed, spin = speed * (rng.random() < 0.3), spin * (rng.random() < 0.15)
    bodies = [(geometry_of(shape)) for shape in (small, large)]

    def distance(at: pin.SE3, obstacle: pin.SE3) -> float:
        places = [place * local for place, (_, local) in zip((at, obstacle), bodies, strict=True)]
        there = [coal.Transform3s(place.rotation, place.translation) for place in places]
        result = coal.DistanceResult()
        return float(
            coal.distance(bodies[0][0], there[0], bodies[1][0], there[1], coal.DistanceRequest(), result)
        )

    if distance(hand, begin) < MARGIN + 0.01:
        return None
    free = rng.random() < 0.5
    weight = {"kinematics": 1.0, "torque": 10.0}[control]
    task: wbc.Task
    if free:
        task = wbc.PositionTask(HAND, begin.translation, weight=weight)
    else:
        task = wbc.PoseTask(HAND, pin.SE3(hand.rotation, begin.translation), weight=weight)
    obstacle = wbc.Obstacle("obstacle", large, begin)
    limit = wbc.CollisionLimit(obstacles=[obstacle], against=[HAND], shapes={HAND: small}, margin=MARGIN)
    steps, before, last = CONTROLS[control](task, limit), np.inf, np.zeros(9)
    deepest, steepest, unsolved, jumps = -np.inf, -np.inf, 0, list[float]()
    for tick in range(round(SECONDS / PERIOD)):
        moves = (tick + 1) * PERIOD <= MOVING
        obstacle.velocity = np.concatenate((speed, spin)) * moves
        velocity, solved = next(steps)
        ending = PERIOD * min(tick + 1, round(MOVING / PERIOD))
        obstacle.placement = pin.SE3(pin.exp3(ending * spin) @ turn, begin.translation + ending * speed)
        robot = task.robot
        robot.update_jacobians(robot.q)
        after = distance(robot.placement(HAND), obstacle.placement)
        theta = PERIOD * (np.abs(velocity[:7]).sum() + np.linalg.norm(spin) * moves)
        reach = np.linalg.norm(robot.placement(HAND).translation)
        if theta > 1e-2:
            steepest = max(steepest, (min(before, MARGIN) - after) / (theta**2 * reach))
        deepest, before = max(deepest, MARGIN - after), after
        jumps.append(float(np.abs(velocity - last[: velocity.size]).max()))
        last, unsolved = velocity.copy(), unsolved + (not solved)
    names = f"{type(small).__name__[9:]} {type(large).__name__[9:]} {'free' if free else 'pose'}"
    return Outcome(seed, names, deepest, float(steepest), float(np.median(jumps[-60:])), unsolved)


def summary(found: Sequence[Outcome]) -> str:
    deep = np.array([each.deepest for each in found])
    return (
        f"{len(found)} layouts; beyond the margin, mm: 99 % {1e3 * np.percentile(deep, 99):.3f}, most "
        f"{1e3 * deep.max():.3f}, more than 1 mm in {(deep > 1e-3).sum()}; share of θ² ℓ in a period at most "
        f"{max(each.steepest for each in found):.2f}; quiet (< 1e-2 rad/s) {sum(e.jump < 1e-2 for e in found)}; with "
        f"unsolved periods {sum(each.unsolved > 0 for each in found)}"
    )


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    control, first, beyond, path = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
    outcomes: list[Outcome] = []
    with path.open("a") as file:
        for number in range(first, beyond):
            outcome = run(number, control)
            if outcome is not None:
                outcomes.append(outcome)
                file.write(json.dumps(asdict(outcome)) + "\n")
                file.flush()
    print(control, summary(outcomes))
