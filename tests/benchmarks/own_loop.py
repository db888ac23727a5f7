"""Somebody else's robot in a loop of its own: stands, walks and pushes with noise, delays, and without force sensors.

The file is used as it is, but for a floor and physics steps of 1 ms; a robot without actuators in its file gets its
torques directly. Every run is a line of the journal, and a run that is there already is not made again.

Usage: python tests/benchmarks/own_loop.py my.xml --journal runs.jsonl [--case NAME ...] [--seeds N] [--distance M]
           [--servo "*knee*=100,2" ...] [--armature "*ankle*=0.0072" ...] [--seconds S]
       python tests/benchmarks/own_loop.py --journal runs.jsonl --table    (or --pushes; the journal may be an .xz)
"""

from __future__ import annotations

import argparse
import fnmatch
import hashlib
import json
import logging
import lzma
import math
import time
from collections import deque
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

import wbc
from wbc.core.control import Mode
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.robot import GRAVITY, Robot
from wbc.sim import Machine, MujocoLoop
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings
from wbc.walking.planning.phases import Phase
from wbc.walking.planning.planners import walk_distance

PERIOD: dict[Mode, float] = {"position": 0.005, "torque": 0.002, "hybrid": 0.002}
FIRST_SEED = 100
STAND = 60.0  # s
PUSH = 0.1  # s
AT_REST = 0.1  # m/s, of the centre of mass after a push
PUSHED_STEP = 5


@dataclass(frozen=True)
class Case:
    """A row of the table: how the robot is driven, and what it does.

    Attributes:
        mode: Command of the drives.
        delay: Half of it of measurements, half of commands, both stated, s.
        what: Walk, stand, or one of them with a push.
        forces: False for feet without force sensors; the drives then report their torques.
        payload: Mass at the torso's centre of mass that the description does not have, kg.
        impulse: Of the push, Ns/kg: in eight directions, while walking at four phases of a step.
    """

    mode: Mode
    delay: float = 0.0
    what: Literal["stand", "walk"] = "walk"
    forces: bool = True
    payload: float = 0.0
    impulse: float = 0.0


MODES: tuple[Mode, ...] = ("torque", "hybrid", "position")
CASES: dict[str, Case] = {
    **{f"walk {m} {d} ms": Case(m, 1e-3 * d) for d in (0, 4, 8) for m in MODES},
    **{
        f"walk {m} 4 ms, no force sensors, 1 kg": Case(m, 0.004, forces=False, payload=1.0)
        for m in ("hybrid", "torque")
    },
    **{f"stand {m} {d} ms": Case(m, 1e-3 * d, "stand") for d in (0, 4, 8) for m in MODES},
    **{f"push standing {m}": Case(m, what="stand", impulse=0.25) for m in MODES},
    **{f"push walking {m}": Case(m, impulse=0.15) for m in MODES},
}


class Scene:
    """The robot of a file on a floor, and the description of the robot alone."""

    def __init__(self, path: Path, servo: list[str], armature: list[str]) -> None:
        self.path = path
        self.digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        self.given = wbc.RobotDescription.from_mjcf(path)
        self.armature: dict[str, float] = {}
        for pattern, _, inertia in (given.partition("=") for given in armature):
            self.armature |= dict.fromkeys(fnmatch.filter(self.given.joint_names, pattern), float(inertia))
        if self.armature:
            self.given = wbc.RobotDescription.from_mjcf(path, armature=self.armature)
        self.soft = self.given.with_servos(servo)

    def loop(self, case: Case, seed: int) -> MujocoLoop:
        spec = mujoco.MjSpec.from_file(str(self.path))
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
        spec.option.timestep = 0.001
        spec.body(self.given.torso).mass += case.payload
        for name, inertia in self.armature.items():
            spec.joint(name).armature = inertia
        return MujocoLoop(
            self.soft if case.mode == "hybrid" else self.given,
            spec.compile(),
            control_period=PERIOD[case.mode],
            noise="realistic",
            seed=seed,
            machine=Machine(
                measurement_delay=0.5 * case.delay,
                command_delay=0.5 * case.delay,
                force_sensors=case.forces,
                torque_sensors=not case.forces,
            ),
        )


def controller(robot: Robot, case: Case, distance: float) -> WalkingControl:
    """Return the controller of a walk, or of a robot that stands for ever."""
    plan = FootstepPlan.standing(robot)
    if case.what == "walk":
        plan = walk_distance(plan, distance)
    stated = ObserverSettings(measurement_delay=0.5 * case.delay, command_delay=0.5 * case.delay)
    observer = Observer(robot, stated, adopt=case.mode != "position", dynamics=False)
    settings = WalkingControlSettings(mode=case.mode)
    return WalkingControl(robot, plan, PERIOD[case.mode], settings, observer=observer)


def run(scene: Scene, case: Case, seed: int, distance: float) -> dict[str, Any]:
    """Return the figures of one run."""
    began = time.perf_counter()
    loop = scene.loop(case, seed)
    walking = controller(loop.description.robot(), case, distance)
    truth = loop.truth()
    weight, start = loop.robot.mass * GRAVITY, truth.com
    true_forces: deque[np.ndarray[Any, Any]] = deque(maxlen=1 + round(0.5 * case.delay / loop.control_period))
    errors: list[float] = []
    pushed, offset, lift_off = False, 0.0, math.inf
    direction, phase = (seed % 8) * math.pi / 4.0, 0.25 * (seed // 8 % 4)
    across = np.array([math.cos(direction), math.sin(direction), 0.0])
    gait = walking.walk.phases.plan.gait
    limit = 90.0 if case.what == "walk" else 0.5 + PUSH + 4.0 if case.impulse else STAND
    fell = False
    while loop.time < limit and not fell and not (case.what == "walk" and walking.finished):
        true_forces.append(truth.sole_wrench[:, 2])
        command = walking.command(loop.measure())
        used = walking.control.measurement
        if used is not None and loop.time > 0.5:
            errors.extend(np.abs(used.wrenches[:, 2] - true_forces[0]) / weight)
        reference = walking.reference
        if case.impulse and not pushed and reference is not None:
            if walking.steps_done == PUSHED_STEP - 1 and walking.walk.phases.phase is Phase.SINGLE:
                lift_off = min(lift_off, loop.time)
            due = lift_off + phase * (gait.single_support + gait.double_support)
            if loop.time >= (0.5 if case.what == "stand" else due):
                pushed = True
                loop.push("torso", case.impulse * loop.robot.mass / PUSH * across, PUSH)
        loop.step(command)
        truth = loop.truth()
        com = truth.com
        offset = max(offset, float(np.hypot(*(com - start)[:2])))
        fell = walking.fallen is not None or bool(com[2] < 0.7 * start[2])
    speed = float(np.hypot(*truth.com_velocity[:2]))
    planned = len(walking.walk.phases.plan)
    good = not fell and (walking.finished if case.what == "walk" else speed < AT_REST)
    return {
        "good": bool(good and (pushed or not case.impulse)),
        "steps": walking.steps_done,
        "planned": planned,
        "time": round(loop.time, 3),
        "com_offset": offset,
        "force_error": float(np.percentile(errors, 95)) if errors else None,
        "failures": walking.control.failures,
        "wall": round(time.perf_counter() - began, 1),
    }


Row = dict[str, Any]

DIRECTIONS = ("forward", "forward left", "left", "back left", "back", "back right", "right", "forward right")
"""Of a push, by the seed modulo 8."""


def share(rows: list[Row]) -> str:
    """Return how many of some runs were good."""
    return f"{sum(row['good'] for row in rows)} of {len(rows)}" if rows else ""


def driven(row: Row) -> tuple[str, str, str]:
    """Return how the robot of a run was driven: mode, gains, and what else was different."""
    key, case = row["key"], row["key"]["case"]
    soft = "; ".join(_in_words(gains) for gains in key["servo"]) or "3 % of derived"
    gains = {"torque": "", "position": "derived", "hybrid": soft}[case["mode"]]
    other = [] if case["forces"] else ["no force sensors"]
    other += [f"{case['payload']:g} kg unknown"] if case["payload"] else []
    other += ["rotor inertias"] if key["armature"] else []
    return case["mode"], gains, ", ".join(other)


def _in_words(gains: str) -> str:
    """Return "*hip*=60,1" as "hip 60, 1"."""
    pattern, _, values = gains.partition("=")
    return f"{pattern.strip('*') or 'all'} {values.replace(',', ', ')}"


def table(rows: list[Row]) -> str:
    """Return the table of a journal: a row for each way of driving, with stands, walks and pushes."""
    lines = [
        "| control | gains |  | delay | stands 60 s | walks 3 m | fewest steps | force error "
        "| pushed standing, 0.25 Ns/kg | walking, 0.15 |",
        "|---|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for how, delay in sorted({(driven(row), row["key"]["case"]["delay"]) for row in rows}, key=_order):
        mine = [row for row in rows if (driven(row), row["key"]["case"]["delay"]) == (how, delay)]
        kinds: dict[tuple[str, bool], list[Row]] = {}
        for row in mine:
            case = row["key"]["case"]
            kinds.setdefault((case["what"], case["impulse"] > 0.0), []).append(row)
        stands, walks = kinds.get(("stand", False), []), kinds.get(("walk", False), [])
        steps = f"{min(row['steps'] for row in walks)} of {walks[0]['planned']}" if walks else ""
        errors = [row["force_error"] for row in stands + walks if row["force_error"] is not None]
        lines.append(
            f"| {' | '.join(how)} | {1e3 * delay:g} ms | {share(stands)} | {share(walks)} | {steps} | "
            f"{f'{100 * max(errors):.0f} %' if errors else ''} | "
            f"{share(kinds.get(('stand', True), []))} | {share(kinds.get(('walk', True), []))} |"
        )
    return "\n".join(lines)


def _order(key: tuple[tuple[str, str, str], float]) -> tuple[Any, ...]:
    (mode, gains, other), delay = key
    return other, MODES.index(mode) if mode in MODES else 9, gains, delay


def pushes(rows: list[Row]) -> str:
    """Return which pushes while walking a robot recovered from: a row for each direction, by the time of the push."""
    mine = [row for row in rows if row["key"]["case"]["what"] == "walk" and row["key"]["case"]["impulse"]]
    lines = [
        "| control | push | at lift-off | 1/4 | 1/2 | 3/4 of a step later |",
        "|---|---|---|---|---|---|",
    ]
    for how in dict.fromkeys(driven(row) for row in mine):
        for turn, direction in enumerate(DIRECTIONS):
            cells = []
            for phase in range(4):
                found = [
                    row["good"]
                    for row in mine
                    if driven(row) == how
                    and (row["key"]["seed"] % 8, row["key"]["seed"] // 8 % 4) == (turn, phase)
                ]
                cells.append(", ".join("walks on" if good else "falls" for good in found))
            lines.append(f"| {how[0]} | {direction} | {' | '.join(cells)} |")
    return "\n".join(lines)


def journal(path: Path) -> list[Row]:
    """Return the runs of a journal; none of one that does not exist."""
    if not path.exists():
        return []
    data = path.read_bytes()
    text = (lzma.decompress(data) if path.suffix == ".xz" else data).decode()
    return [json.loads(line) for line in text.splitlines()]


def main() -> None:
    """Run what the journal lacks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", type=Path, nargs="?")
    parser.add_argument("--journal", type=Path, required=True)
    parser.add_argument("--case", action="append", choices=CASES, help="all when none is given")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--distance", type=float, default=3.0, help="of a walk, m")
    parser.add_argument("--servo", action="append", default=[], help="gains of hybrid control: pattern=kp,kd")
    parser.add_argument("--armature", action="append", default=[], help="pattern=rotor inertia, kg m²")
    parser.add_argument("--seconds", type=float, default=math.inf, help="start no run after this time, s")
    parser.add_argument("--table", action="store_true", help="only print the table of the journal")
    parser.add_argument("--pushes", action="store_true", help="only print the pushes while walking")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    rows = journal(options.journal)
    if options.table or options.pushes:
        print(table(rows) if options.table else pushes(rows))
        return
    if options.model is None:
        parser.error("a model is needed")
    scene = Scene(options.model, options.servo, options.armature)
    end = time.monotonic() + options.seconds
    done = {json.dumps(row["key"], sort_keys=True) for row in rows}
    for name in options.case or CASES:
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
            case = CASES[name]
            key = {"model": scene.digest, "case": asdict(case), "seed": seed}
            key |= {"distance": options.distance, "armature": options.armature}
            key |= {"servo": options.servo if case.mode == "hybrid" else []}
            if json.dumps(key, sort_keys=True) in done or time.monotonic() > end:
                continue
            figures = run(scene, case, seed, options.distance)
            rows.append({"name": name, "distance": options.distance, **figures, "key": key})
            with options.journal.open("a") as lines:
                lines.write(json.dumps(rows[-1]) + "\n")
            print(name, seed, figures, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
