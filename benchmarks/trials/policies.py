"""Studies of trained policies: hands by the QP, bad targets and pushes with and without a filter, take-overs.

    python benchmarks/trials/policies.py arms walk.onnx --runs 0-2 --journal arms.jsonl
    python benchmarks/trials/policies.py wild walk.onnx --runs 0-19 --journal wild.jsonl
    python benchmarks/trials/policies.py pushes walk.onnx --runs 0-24 --journal pushes.jsonl
    python benchmarks/trials/policies.py taken walk.onnx --runs 0-66 --journal taken.jsonl
    python benchmarks/trials/policies.py pushed walk.onnx --runs 0-63 --journal pushed.jsonl

Every run is a line of the journal; those of the same code that it has are not run again. Descriptions of the policies
stand beside them (docs/policies.md). Arms, wild runs and pushes are for g1.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pinocchio as pin
from _programs import span
from _runs import Row, make_runs, register_runs

import wbc
from wbc.base.files import file_hash
from wbc.core.drive.control import State
from wbc.core.qp.controller import Controller
from wbc.policy import PolicyControl, PolicyFilter, PolicyGuard
from wbc.tasks import RelativeFrameTask

DT = 0.002
"""Control period, s."""

WILD = ("random", "trunk", "stops")
"""Bad targets of the arms, drawn each 0.4 s: anywhere, through the trunk, and beyond the stops."""

NEAR = ("torso_link", "pelvis", "head_link", "left_hip_yaw_link", "right_hip_yaw_link")
HANDS = ("rubber_hand", "wrist_roll_link")
PAIRS = [(f"{side}_{hand}", link) for side in ("left", "right") for hand in HANDS for link in NEAR]
PAIRS += [(f"left_{one}", f"right_{other}") for one in HANDS for other in HANDS]
"""Pairs that a filter keeps apart."""


ARMS = np.arange(15, 29)
"""Columns of the arms of g1."""


class WildPolicy(PolicyControl):
    """Policy whose arms may get other targets than its own, and which sees them at rest, as arms that others move.

    Attributes:
        wild: Targets of the joints, of which those of the arms count, shape (na,), rad; None for the policy's own.
    """

    wild: np.ndarray | None = None

    def observe(self, state: State) -> None:
        """See `PolicyControl.observe`; the arms are at rest."""
        super().observe(state)
        self.observed.position[ARMS] = self.observed.velocity[ARMS] = 0.0

    def aim(self) -> np.ndarray:
        """See `PolicyControl.aim`; the arms may have other targets."""
        target = super().aim()
        if self.wild is not None:
            target[ARMS] = self.wild[ARMS]
        return target


class TimedFilter(PolicyFilter):
    """Filter with the processor time of each of its QPs, s."""

    times: list[float]

    def bind(self, controller: Controller) -> Any:
        """See `PolicyFilter`."""
        arms, self.times = super().bind(controller), []
        near = arms.near

        def timed(*arguments: Any) -> np.ndarray:
            start = thread_time()
            torques = near(*arguments)
            self.times.append(thread_time() - start)
            return torques

        arms.near = timed  # type: ignore[method-assign]
        return arms


class Walk:
    """A policy that walks, with what a study does to it.

    Attributes:
        plant: The simulation, with realistic noise.
        policy: The control.
    """

    def __init__(
        self,
        file: str,
        seed: int,
        robot: str = "g1",
        *,
        kind: type[PolicyControl] = PolicyControl,
        **options: Any,
    ) -> None:
        """Let the robot stand; `options` are those of the control of this kind."""
        self.plant = wbc.Plant(wbc.load_robot(robot), control_period=DT, noise="realistic", seed=seed)
        self.robot = self.plant.description.robot()
        self.policy = kind(self.robot, file, DT, **options)
        self._lies = 0.6 * float(self.robot.com[2])

    def push(self, impulse: float, angle: float) -> None:
        """Push the torso for 0.08 s: impulse in Ns/kg, angle in the world, rad."""
        force = impulse * self.robot.mass / 0.08 * np.array([math.cos(angle), math.sin(angle), 0.0])
        self.plant.push(self.robot.torso_frame, force, 0.08)

    @property
    def down(self) -> bool:
        """True if the robot lies."""
        return bool(self.plant.truth().com[2] < self._lies)


def drawn(kind: str, robot: wbc.Robot, random: np.random.Generator) -> np.ndarray:
    """Return bad targets of all joints, rad."""
    low, high, names = robot.position_lower, robot.position_upper, list(robot.joint_names)
    if kind == "stops":
        beyond = random.uniform(0.1, 1.0, robot.na)
        return np.where(random.random(robot.na) < 0.5, high + beyond, low - beyond)
    wild = random.uniform(low - 0.5, high + 0.5)
    if kind == "trunk":
        for side, sign in (("left", 1.0), ("right", -1.0)):
            for joint, least, most, mirrored in (
                ("shoulder_pitch", -0.8, 0.3, 1.0),
                ("shoulder_roll", -1.2, -0.1, sign),
                ("shoulder_yaw", -1.5, 1.0, sign),
                ("elbow", 0.0, 1.6, 1.0),
            ):
                wild[names.index(f"{side}_{joint}_joint")] = mirrored * random.uniform(least, most)
    return wild


def filtered(what: str, policy: str, run: int, on: bool, impulse: float) -> Row:
    """Walk at 0.3 m/s with bad targets of the arms, or four pushes, with a filter or without."""
    description = wbc.load_robot("g1")
    shapes = description.collision_shapes()
    limit = wbc.CollisionLimit(PAIRS, shapes=shapes, recovery=100.0, influence=0.5)
    safe = TimedFilter(description.joint_names[15:], [limit]) if on else None
    walk = Walk(policy, run, kind=WildPolicy if what == "wild" else PolicyControl, filter=safe)
    plant, control, robot = walk.plant, walk.policy, walk.robot
    gauge = wbc.Controller(description.robot(), DT)
    near = gauge.add(wbc.CollisionLimit(PAIRS, shapes=shapes))
    random, kind = np.random.default_rng(run + 100), WILD[run % len(WILD)]
    beyond, least, changed, pushed, due = np.zeros(29), math.inf, list[np.ndarray](), 0, 3.0
    while plant.time < (12.0 if what == "wild" else 15.0) and not walk.down:
        time = plant.time
        control.velocity = (0.3, 0.0, 0.0) if time > 1.0 else None
        if isinstance(control, WildPolicy) and time >= due:
            due, control.wild = time + 0.4, drawn(kind, robot, random)
        if what == "pushes" and pushed < 4 and time > 3.0 + 3.0 * pushed:
            walk.push(impulse, random.uniform(0.0, math.tau))
            pushed += 1
        plant.step(control.command(plant.measure()))
        if time > 3.0:
            truth = plant.truth()
            q = np.array(truth.q[7:])
            beyond = np.maximum(beyond, np.maximum(robot.position_lower - q, q - robot.position_upper))
            changed.append(control.changed.copy())
            if round(time / DT) % 5 == 0:
                gauge.update(np.array(truth.q), np.array(truth.v))
                gauge.solve()
                least = min(least, *near.distances.values())
    change, times = np.square(np.array(changed)), [] if safe is None else safe.times
    return {
        "upright": not walk.down,
        "kind": kind if what == "wild" else impulse,
        "pushes": pushed,
        "nearest_mm": 1e3 * least,
        "beyond_mrad": {
            part: 1e3 * float(beyond[joints].max())
            for part, joints in (("legs", slice(12)), ("waist", slice(12, 15)), ("arms", slice(15, 29)))
        },
        "changed_rms": [float(np.sqrt(change[:, part].mean())) for part in (slice(15), slice(15, 29))],
        "cpu_ms": [1e3 * float(np.percentile(times, each)) for each in (50, 99)] if times else None,
    }


def armed(policy: str, run: int, speed: float, swings: bool, sees: bool, load: float, regain: float) -> Row:
    """Walk for 8 s with both hands before the chest, held there or moved 0.3 m up and down, each in 0.5 s.

    A load in each hand, kg, grows in the first second, and the QP knows it.
    """
    names = wbc.load_robot("g1").joint_names[15:]
    walk = Walk(policy, run, arms=names, sees_arms=sees, regain=regain)
    plant, control, truth = walk.plant, walk.policy, walk.plant.description.robot()
    places = {
        f"{side}_rubber_hand": np.array([0.3, y, 0.2]) for side, y in (("left", 0.13), ("right", -0.13))
    }
    hands = {}
    for frame, place in places.items():
        hands[frame] = RelativeFrameTask(frame, "pelvis", axes=("x", "y", "z"), weight=10.0, stiffness=400.0)
        control.controller.add(hands[frame])
        hands[frame].move_to(pin.SE3(hands[frame].target.rotation, place), duration=1.0)
        if load:
            plant.load(frame, load, over=1.0)
            walk.robot.carry(frame, load)
    errors, begin, moves = list[float](), 0.0, 0
    while plant.time < 8.0 and not walk.down:
        control.velocity = (speed, 0.0, 0.0) if speed and plant.time > 1.0 else None
        if swings and plant.time >= 2.0 + 0.5 * moves:
            moves += 1
            for frame, hand in hands.items():
                place = places[frame] + [0.0, 0.0, 0.15 * (-1.0) ** moves]
                hand.move_to(pin.SE3(hand.target.rotation, place), duration=0.5)
        plant.step(control.command(plant.measure()))
        if plant.time <= 3.0:
            begin = float(plant.truth().com[0])
            continue
        truth.update(np.array(plant.truth().q), np.array(plant.truth().v))
        for frame, hand in hands.items():
            place = truth.placement("pelvis").actInv(truth.placement(frame)).translation
            errors.append(float(np.linalg.norm(place - hand.target.translation)))
    return {
        "upright": not walk.down,
        "time": plant.time,
        "mean_mm": 1e3 * float(np.mean(errors)) if errors else None,
        "most_mm": 1e3 * max(errors) if errors else None,
        "forward": (float(plant.truth().com[0]) - begin) / (plant.time - 3.0) if errors else None,
    }


def taken(policy: str, run: int, robot: str, impulse: float) -> Row:
    """Take a policy over at a random instant of its walk, or 0 to 0.4 s after a push; the robot is to stand."""
    random = np.random.default_rng(run)
    walk = Walk(policy, run, robot)
    plant, guard = walk.plant, PolicyGuard(walk.policy)
    speed = 0.3 if impulse else (0.0, 0.3, 0.6)[run % 3]
    push, delay = random.uniform(3.0, 4.5), random.uniform(0.0, 0.4)
    instant, pushed, angle = push + (delay if impulse else 0.0), not impulse, (run % 8) * math.pi / 4
    while plant.time < instant and not walk.down:
        guard.velocity = (speed, 0.0, 0.0) if plant.time > 1.0 else None
        if not pushed and plant.time >= push:
            pushed = True
            walk.push(impulse, angle)
        plant.step(guard.command(plant.measure()))
    air = list(walk.policy.contacts.air)
    end = plant.time + 5.0
    guard.take_over()
    while plant.time < end and not walk.down:
        plant.step(guard.command(plant.measure()))
    speed_left = float(np.linalg.norm(plant.truth().com_velocity))
    return {
        "upright": not walk.down and guard.fallen is None,
        "stands": not walk.down and guard.fallen is None and speed_left < 0.1,
        "speed": speed,
        "delay": delay if impulse else None,
        "angle": angle if impulse else None,
        "air": air,
        "instant": instant,
    }


STUDIES: dict[str, Callable[..., Row]] = {
    "arms": armed,
    "wild": partial(filtered, "wild"),
    "pushes": partial(filtered, "pushes"),
    "taken": taken,
    "pushed": taken,
}
"""Studies, and the functions that make their runs."""


NAMED = ("run", "speed", "swings", "sees")
"""Arguments that name a run of a study."""


def make_run(study: str, content: str, **arguments: Any) -> Row:
    """Make a run of a study; the contents of the policy and of its description are in the journal by their hashes."""
    del content
    return STUDIES[study](**arguments)


register_runs("policy", make_run)


def wanted(options: argparse.Namespace) -> Iterator[Row]:
    """Yield the arguments of each run."""
    about = Path(options.policy).with_suffix(".toml")
    content = file_hash(options.policy) + (file_hash(about) if about.is_file() else "")
    policy = {"study": options.study, "policy": options.policy, "content": content}
    for run in options.runs:
        each: Row = {**policy, "run": run}
        if options.study == "arms":
            loaded = {"load": options.load, "regain": options.regain}
            kinds = (False, False), (True, False), (False, True)
            for speed, (swings, sees) in itertools.product((0.0, 0.3, 0.6), kinds):
                yield {**each, "speed": speed, "swings": swings, "sees": sees, **loaded}
        elif options.study in ("wild", "pushes"):
            for on in (True, False):
                yield {**each, "on": on, "impulse": options.impulse}
        else:
            impulse = options.impulse if options.study == "pushed" else 0.0
            yield {**each, "robot": options.robot, "impulse": impulse}


def main() -> None:
    """Run what the journal has not."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", choices=["arms", "wild", "pushes", "taken", "pushed"])
    parser.add_argument("policy", help="ONNX file, with its description beside it")
    parser.add_argument("--robot", default="g1", help="of take-overs, default %(default)s")
    parser.add_argument("--runs", type=span, default="0-19", help="their numbers, default %(default)s")
    parser.add_argument("--impulse", type=float, default=0.7, help="of a push, Ns/kg")
    parser.add_argument("--load", type=float, default=0.0, help="in each hand of the study of arms, kg")
    parser.add_argument("--regain", type=float, default=0.0, help="of the study of arms, 1/s")
    parser.add_argument("--journal", type=Path, default=Path("policies.jsonl"))
    options = parser.parse_args()
    try:
        runs = list(wanted(options))
    except ValueError as error:  # of a file that cannot be read
        parser.error(str(error))
    found = make_runs(options.journal, "policy", runs)
    key = "stands" if options.study in ("taken", "pushed") else "upright"
    parts = {"filtered": True, "bare": False} if options.study in ("wild", "pushes") else {"": None}
    for part, on in parts.items():
        own = [row for row in found if row.get("on") is on]
        print(f"{options.study} {part}: {key} {sum(row[key] for row in own)} of {len(own)}", flush=True)
        bad = [", ".join(f"{n} {row[n]}" for n in NAMED if n in row) for row in own if not row[key]]
        print("  not:", "; ".join(bad) if bad else "none")


if __name__ == "__main__":
    main()
