"""Random drives with pushes, plans, stands and hands: falls in half an hour.

    python benchmarks/trials/auto_drives.py --journal drives.jsonl                       # 30 minutes of each robot
    python benchmarks/trials/auto_drives.py --journal drives.jsonl --robot g1 --minutes 10
    python benchmarks/trials/auto_drives.py --journal drives.jsonl --table

A drive is two minutes on the flat floor in torque control: every few seconds another order (a velocity, a goal, a plan
of footsteps, a stand), and every ten seconds a push of 0.085 Ns/kg from any side. With every second order a hand goes
to a place beside the pelvis, or both hands do. All draws follow from its seed. Every drive is a line of the journal; an
interrupted program goes on where it stopped.
"""

from __future__ import annotations

import argparse
import math
import random
from pathlib import Path
from typing import Any

import _programs  # noqa: F401 - finds `_runs`
from _runs import Row, make_runs, register_runs, rows

from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.studies.intervals import rate_interval
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.trial import WalkTrial
from wbc.walking import FootstepPlan, turn_in_place, walk_distance

ROBOTS: dict[str, dict[str, Any]] = {
    "g1": {},
    "hrp4_class": {"foot": "long_arch", "stiffness": 5.0},
    "talos": {},
}
"""Robots, g1 and talos on their own flat feet."""

FIRST_SEED, SECONDS = 40_000, 120.0
"""First seed; length of a drive, s."""

PUSH, PUSH_PERIOD = 0.085, 10.0
"""Impulse over the mass, Ns/kg, and time between pushes, s."""

HANDS = (("left_hand", 1.0), ("right_hand", -1.0))
"""Roles of the hands, and the sign of their side."""


class RandomOrders(TrialHook):
    """Another order every few seconds, and counts of what became of them."""

    def __init__(self, seed: int) -> None:
        """Draw all orders from a seed."""
        self._random = random.Random(seed)
        self._kind, self._until = "stand", 2.0
        names = ("velocity", "goal", "plan", "stand", "reach", "refused")
        self.counts = dict.fromkeys(names, 0)

    def before(self, trial: Any) -> None:
        """Give an order when the last one is over: after its time, or once the robot is there and stands."""
        walking, now, draw = trial.control, trial.plant.time, self._random
        there = self._kind in ("goal", "plan") and walking.finished
        if (now < self._until and not there) or now > SECONDS - 10.0:
            return
        if self._kind == "plan":
            self.counts["refused"] += bool(walking.source.reason)
        if self._kind == "to plan" and walking.finished:
            self._plan(walking, now)
            return
        kind = draw.choices(("velocity", "goal", "plan", "stand"), (5, 2, 2, 2))[0]
        self._reach(walking)
        if kind == "plan":  # begins where the feet stand
            walking.velocity, self._kind, self._until = None, "to plan", now + 4.0
            return
        self._kind = kind
        self.counts[kind] += 1
        if kind == "velocity":
            walking.velocity = (draw.uniform(-0.2, 0.5), draw.uniform(-0.12, 0.12), draw.uniform(-0.4, 0.4))
            self._until = now + draw.uniform(3.0, 8.0)
        elif kind == "goal":
            (x, y), away = walking.controller.robot.com[:2], draw.uniform(0.3, 1.5)
            way, yaw = draw.uniform(-math.pi, math.pi), draw.uniform(-math.pi, math.pi)
            walking.go_to(float(x) + away * math.cos(way), float(y) + away * math.sin(way), yaw)
            self._until = now + 15.0
        else:
            walking.velocity = None
            self._until = now + draw.uniform(3.0, 6.0)

    def _reach(self, walking: Any) -> None:
        """Send one hand, both hands or none to a place beside the pelvis, and let the others go back."""
        draw = self._random
        sent = draw.choices(((), HANDS[:1], HANDS[1:], HANDS), (3, 1, 1, 1))[0]
        for name, side in HANDS:
            if (name, side) not in sent:
                walking.arms[name].release()
                continue
            ahead, aside, up = draw.uniform(0.1, 0.4), draw.uniform(0.1, 0.4), draw.uniform(0.0, 0.4)
            walking.arms[name].reach((ahead, side * aside, up), "pelvis")
            self.counts["reach"] += 1

    def _plan(self, walking: Any, now: float) -> None:
        """Follow a plan of footsteps from where the robot stands."""
        start, draw = FootstepPlan.standing(walking.controller.robot), self._random
        if draw.random() < 0.5:
            plan = walk_distance(start, draw.uniform(0.2, 1.0))
        else:
            plan = turn_in_place(start, draw.choice((-1.0, 1.0)) * draw.uniform(0.2, 1.0))
        walking.follow(plan)
        self._kind, self._until = "plan", now + 20.0
        self.counts["plan"] += 1


def drive(robot: str, seed: int, impulse: float) -> Row:
    """Drive, and return what became of it; the impulse of a push is in Ns/kg."""
    draw = random.Random(f"pushes of {seed}")
    times = [k * PUSH_PERIOD + draw.uniform(-3.0, 3.0) for k in range(1, int(SECONDS / PUSH_PERIOD))]
    pushes = tuple(
        WalkPush(time=t, impulse=impulse, direction=draw.uniform(-math.pi, math.pi)) for t in times
    )
    stand = ((0.0, 0.0, 0.0, 0.0), (SECONDS, 0.0, 0.0, 0.0))
    orders = RandomOrders(seed)
    spec = WalkSpec(
        robot=robot, mode="torque", seed=seed, plan=WalkPlan(drive=stand), pushes=pushes, **ROBOTS[robot]
    )
    trial = WalkTrial(spec)
    trial.scenario.append(orders)
    result = trial.run()
    return {
        "outcome": result.outcome, "seconds": result.seconds, "steps": result.steps_done,
        "failures": result.failures, "fall": result.fall_reason, "orders": orders.counts,
    }  # fmt: skip


register_runs("random drive", drive)


def main() -> None:
    """Drive what the journal does not have, and print a line for each robot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--journal", type=Path, required=True, help="file of the drives")
    parser.add_argument("--robot", action="append", choices=tuple(ROBOTS), help="all when none is given")
    parser.add_argument("--minutes", type=float, default=30.0, help="of each robot, default %(default)s")
    parser.add_argument("--impulse", type=float, default=PUSH, help="of a push, Ns/kg, default %(default)s")
    parser.add_argument("--table", action="store_true", help="drive nothing")
    given = parser.parse_args()
    count, robots = math.ceil(60.0 * given.minutes / SECONDS), given.robot or list(ROBOTS)
    seeds = range(FIRST_SEED, FIRST_SEED + (0 if given.table else count))
    wanted = [{"robot": robot, "seed": seed, "impulse": given.impulse} for seed in seeds for robot in robots]
    if wanted:
        make_runs(given.journal, "random drive", wanted)
    found = rows(given.journal, "random drive")
    for robot in robots:
        own = [row for row in found if row["robot"] == robot and row["impulse"] == given.impulse]
        if not own:
            continue
        hours = sum(row["seconds"] for row in own) / 3600.0
        falls, steps = sum(row["outcome"] == "fell" for row in own), sum(row["steps"] for row in own)
        print(
            f"{robot}: {60.0 * hours:.0f} minutes, {steps} steps, {falls} falls "
            f"(at most {rate_interval(falls, hours)[1]:.1f} an hour)"
        )


if __name__ == "__main__":
    main()
