"""Somebody else's robot in a loop of its own: stands, walks and pushes with noise, delays, and without force sensors.

The file is used as it is, but for a floor and physics steps of 1 ms; a robot without actuators in its file gets its
torques directly. Every run is a line of the journal, and a run that is there already is not made again.

Usage: python tests/benchmarks/own_loop.py my.xml --journal runs.jsonl [--case NAME ...] [--seeds N] [--distance M]
           [--servo "*knee*=100,2" ...] [--armature A] [--seconds S] [--table]
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
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
STAND = 10.0  # s
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

    def __init__(self, path: Path, servo: list[str], armature: float | None) -> None:
        self.path, self.armature = path, armature
        self.digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        self.given = wbc.RobotDescription.from_mjcf(path, armature=armature)
        self.soft = self.given.with_servos(servo)

    def loop(self, case: Case, seed: int) -> MujocoLoop:
        spec = mujoco.MjSpec.from_file(str(self.path))
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
        spec.option.timestep = 0.001
        spec.body(self.given.torso).mass += case.payload
        if self.armature is not None:
            for name in self.given.joint_names:
                spec.joint(name).armature = self.armature
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
    weight, start = loop.robot.mass * GRAVITY, loop.truth().com
    true_forces: deque[np.ndarray[Any, Any]] = deque(maxlen=1 + round(0.5 * case.delay / loop.control_period))
    errors: list[float] = []
    pushed, offset, lift_off = False, 0.0, math.inf
    direction, phase = (seed % 8) * math.pi / 4.0, 0.25 * (seed // 8 % 4)
    across = np.array([math.cos(direction), math.sin(direction), 0.0])
    gait = walking.walk.phases.plan.gait
    limit = 90.0 if case.what == "walk" else 0.5 + PUSH + 4.0 if case.impulse else STAND
    fell = False
    while loop.time < limit and not fell and not (case.what == "walk" and walking.finished):
        true_forces.append(loop.truth().sole_wrench[:, 2])
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
        com = loop.truth().com
        offset = max(offset, float(np.hypot(*(com - start)[:2])))
        fell = walking.fallen is not None or bool(com[2] < 0.7 * start[2])
    speed = float(np.hypot(*loop.truth().com_velocity[:2]))
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


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of a journal: a row for each case."""
    lines = [
        "| | distance | good | steps, fewest | force error, 95 %, largest |",
        "|---|---:|---:|---:|---:|",
    ]
    keys = dict.fromkeys((row["name"], row["distance"]) for row in rows)
    for name, distance in keys:
        mine = [row for row in rows if (row["name"], row["distance"]) == (name, distance)]
        good = sum(row["good"] for row in mine)
        steps = f"{min(row['steps'] for row in mine)} of {mine[0]['planned']}" if mine[0]["planned"] else ""
        force = max(row["force_error"] or 0.0 for row in mine)
        lines.append(f"| {name} | {distance:g} m | {good} of {len(mine)} | {steps} | {100 * force:.0f} % |")
    return "\n".join(lines)


def main() -> None:
    """Run what the journal lacks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", type=Path)
    parser.add_argument("--journal", type=Path, required=True)
    parser.add_argument("--case", action="append", choices=CASES, help="all when none is given")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--distance", type=float, default=3.0, help="of a walk, m")
    parser.add_argument("--servo", action="append", default=[], help="gains of hybrid control: pattern=kp,kd")
    parser.add_argument("--armature", type=float, help="in place of the file's, kg m²")
    parser.add_argument("--seconds", type=float, default=math.inf, help="start no run after this time, s")
    parser.add_argument("--table", action="store_true", help="only print the table of the journal")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    lines = options.journal.read_text().splitlines() if options.journal.exists() else []
    rows = [json.loads(line) for line in lines]
    if not options.table:
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
                name_in_table = name if options.armature is None else f"{name}, armature {options.armature:g}"
                rows.append({"name": name_in_table, "distance": options.distance, **figures, "key": key})
                with options.journal.open("a") as journal:
                    journal.write(json.dumps(rows[-1]) + "\n")
                print(name, seed, figures, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
