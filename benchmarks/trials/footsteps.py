"""Distances of landings from their footsteps on a flat floor or on stones, with realistic noise.

    python benchmarks/trials/footsteps.py                                # three robots, three ways and seeds, torque
    python benchmarks/trials/footsteps.py --robot talos --mode hybrid --seeds 201
    python benchmarks/trials/footsteps.py --mode position                # the same by planned steps
    python benchmarks/trials/footsteps.py --way straight --stones 0.02   # over stones of 20 mm, on flat feet

The ways are 1.5 m straight on; 0.5 m, a turn of 1.2 rad and 0.5 m; and eight steps aside. A line has the distances in
the estimated and in the true world, mean and greatest, mm, the number of landings that miss by more than 10 mm in each,
and the greatest force on a sole over the weight. In position control the estimated world is the commanded one, in which
footsteps are moved against what soles have moved on the ground, and the steps aside are too wide for `g1`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace

from _programs import span

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY, SIDES
from wbc.walking import (
    FootstepPlan,
    WalkingControl,
    WalkingControlSettings,
    turn_in_place,
    walk_distance,
    walk_velocity,
)

ROBOTS, PERIOD, LIMIT = ("g1", "hrp4_class", "talos"), 0.002, 90.0
"""Robots on their own flat feet; control period and greatest time of a walk, s."""

MISSED = 10.0
"""Distance from which on a landing has missed its footstep, mm."""

WAYS: dict[str, Callable[[FootstepPlan], FootstepPlan]] = {
    "straight": lambda start: walk_distance(start, 1.5),
    "turn": lambda start: walk_distance(start, 0.5) + turn_in_place(start, 1.2) + walk_distance(start, 0.5),
    "aside": lambda start: walk_velocity(start, (0.0, 0.08, 0.0), 8),
}


def walk(
    name: str, way: str, seed: int, settings: WalkingControlSettings, stones: float
) -> tuple[list[float], list[float], float, str]:
    """Return the distances in the estimated and the true world, mm, the greatest force and what became of the walk.

    Stones have a height, m; with 0 the floor is flat.
    """
    description = wbc.load_robot(name)
    ground = wbc.sim.make_terrain("stones", stones, seed=seed) if stones > 0.0 else "flat"
    plant = wbc.Plant(description, terrain=ground, noise="realistic", seed=seed, control_period=PERIOD)
    robot = description.robot()
    plan = WAYS[way](FootstepPlan.standing(robot))
    walking = WalkingControl(robot, plan, PERIOD, settings)
    estimated: list[float] = []
    true: list[float] = []
    force = 0.0
    while not walking.done and plant.time < LIMIT:
        measurement = plant.measure()
        plant.step(walking.command(measurement))
        if plant.time > 0.3:  # it settles on its soles first
            force = max(force, float(measurement.wrenches[:, 2].max()) / (robot.mass * GRAVITY))
        done = len(estimated)
        if done < min(walking.steps_done, len(plan)):
            step = plan.steps[done]
            side = SIDES.index(step.side)
            at, (real, _) = robot.placement(robot.soles[side].frame).translation, plant.sole_pose(side)
            estimated.append(1e3 * math.hypot(at[0] - step.x, at[1] - step.y))
            true.append(1e3 * math.hypot(real[0] - step.x, real[1] - step.y))
    ended = "arrived" if walking.finished else str(walking.fallen or walking.source.reason or "unfinished")
    return estimated, true, force, ended


def main() -> None:
    """Walk, and print a line for each walk and for each robot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", action="append", choices=ROBOTS, help="all when none is given")
    parser.add_argument("--way", action="append", choices=tuple(WAYS), help="all when none is given")
    parser.add_argument(
        "--mode", default="torque", choices=("position", "torque", "hybrid"), help="of the control"
    )
    parser.add_argument("--seeds", type=span, default="201-203", help="of the noise, default %(default)s")
    parser.add_argument("--stones", type=float, default=0.0, help="height of stones on the floor, m")
    given = parser.parse_args()
    settings = replace(WalkingControlSettings(), mode=given.mode)
    for name in given.robot or ROBOTS:
        all_of_it: tuple[list[float], list[float]] = [], []
        for way in given.way or WAYS:
            for seed in given.seeds:
                try:
                    estimated, true, force, ended = walk(name, way, seed, settings, given.stones)
                except InputError as error:
                    print(f"{name} {way} {seed}: refused, {error}", flush=True)
                    continue
                all_of_it[0].extend(estimated)
                all_of_it[1].extend(true)
                print(
                    f"{name} {way} {seed}: {len(estimated)} landings, estimated {_shown(estimated)}, true "
                    f"{_shown(true)}, force {force:.1f}, {ended}",
                    flush=True,
                )
        estimated, true = all_of_it
        print(f"{name}: {len(true)} landings, estimated {_shown(estimated)}, true {_shown(true)}", flush=True)


def _shown(distances: list[float]) -> str:
    mean, most = sum(distances) / max(len(distances), 1), max(distances, default=0.0)
    return f"{mean:.1f} mm, at most {most:.0f} mm, {sum(d > MISSED for d in distances)} missed"


if __name__ == "__main__":
    main()
