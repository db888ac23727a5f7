"""Tour of the G1 with punches: 90 s through 18 waypoints, with arms that somebody else moves; see README.md here.

python examples/tour/tour.py 0-127 --no-force-sensors > tour.jsonl    one JSON object a run, and the table at the end
python examples/tour/tour.py tour.jsonl                               the table of runs that have been walked
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import logging
import math
import multiprocessing
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import model
import numpy as np
from table import table
from task import COMMANDS, DURATION, FLOOR, SECONDS, MovingArms, Teleoperator, punches, standing

import wbc
from wbc.sim import Machine, MujocoLoop
from wbc.walking import WalkingControl, WalkingControlSettings

PERIOD = 0.002
"""Control period, s."""

LIMITS = (0.5, 0.25, 0.5)
"""Greatest velocity that the harness asks for: forward and aside, m/s, and turn, rad/s."""


@dataclasses.dataclass(frozen=True)
class Setup:
    """Settings of a run besides its number."""

    force_sensors: bool = True
    noise: str = "none"
    mode: str = "torque"
    delay: float = 0.0  # of measurements, and of commands, s
    own_arms: bool = False  # the walk has the arms as well, and nobody else moves them
    punched: bool = True
    seconds: float = SECONDS
    settings: WalkingControlSettings | None = None


class Tour:
    """One run.

    Attributes:
        loop: The simulation.
        walking: The control.
        operator: The harness's commands, and the errors at the waypoints.
        fell: Time of the fall, s; None before one.
        told: Time, s, and reason of the fall that the control has named; None before.
    """

    def __init__(self, run: int, setup: Setup) -> None:
        """Put the robot on the ground."""
        self.run, self.setup = run, setup
        simulated = model.load()
        description = wbc.RobotDescription.from_mjcf(simulated)
        machine = Machine(
            measurement_delay=setup.delay,
            command_delay=setup.delay,
            torque_sensors=True,
            force_sensors=setup.force_sensors,
        )
        self.loop = MujocoLoop(
            description, simulated, control_period=PERIOD, noise=setup.noise, seed=run, machine=machine
        )
        robot = description.robot()
        self.arms = MovingArms(run, robot)
        self.loop.reset(standing(robot))
        robot.update(standing(robot), np.zeros(robot.nv))
        settings = setup.settings or WalkingControlSettings(mode=setup.mode, step_kind="free")
        observer = None
        if setup.delay > 0.0:
            stated = wbc.ObserverSettings(measurement_delay=setup.delay, command_delay=setup.delay)
            observer = wbc.Observer(robot, stated, adopt=True)
        self.walking = WalkingControl(robot, None, PERIOD, settings, observer=observer)
        self.operator = Teleoperator(run, LIMITS)
        self.punches = punches(run) if setup.punched else []
        self.given = 0  # punches
        self.ticks = 0
        self.fell: float | None = None
        self.told: tuple[float, str] | None = None
        places = self.loop.places
        self._positions, self._rates = (
            indices[self.arms.columns] for indices in (places.joint_qpos, places.joint_dof)
        )
        self._pelvis = simulated.body("pelvis").id
        if not setup.own_arms:
            self.walking.release(model.ARMS)

    @property
    def over(self) -> bool:
        """True after a fall, and at the end."""
        return self.fell is not None or self.ticks >= round(self.setup.seconds / PERIOD)

    def step(self) -> None:
        """Walk one control period."""
        time, data, walking = self.ticks * PERIOD, self.loop.data, self.walking
        if self.ticks % round(COMMANDS / PERIOD) == 0:
            x, y, height = (float(v) for v in data.xpos[self._pelvis])
            if height < FLOOR:
                self.fell = time
                return
            a, b, c, d = (float(v) for v in data.xquat[self._pelvis])
            yaw = math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
            velocity = self.operator.command(time, x, y, yaw)
            walking.velocity = velocity if any(velocity) else None
            if not self.setup.own_arms:
                self.arms.move(time)
        if self.given < len(self.punches) and time >= self.punches[self.given].time - 1e-9:
            punch = self.punches[self.given]
            self.given += 1
            simulated = self.loop.model
            body = simulated.body(simulated.jnt_bodyid[simulated.joint(punch.joint).id]).name
            self.loop.push(body, punch.force, DURATION, at=[0.0, 0.0, 0.0])
        command = walking.command(self.loop.measure())
        if not self.setup.own_arms:
            torque = np.array(command.joint_torque)
            torque[self.arms.columns] = self.arms.torque(data.qpos[self._positions], data.qvel[self._rates])
            command = dataclasses.replace(command, joint_torque=torque, released=None)
        self.loop.step(command)
        self.ticks += 1
        if walking.fallen is not None and self.told is None:
            self.told = time, walking.fallen.value

    def result(self) -> dict[str, Any]:
        """Return the row of this run: times, s, and errors, m and rad."""
        if self.fell is None:
            self.operator.finish()
        errors = np.array(self.operator.errors).reshape(-1, 2)
        places, headings = errors.mean(0).tolist() if len(errors) else (None, None)
        last = self.punches[self.given - 1] if self.given else None
        return {
            "run": self.run,
            "survived": self.setup.seconds if self.fell is None else self.fell,
            "completed": self.fell is None,
            "position_error": places,
            "heading_error": headings,
            "steps": self.walking.steps_done,
            "failed_ticks": self.walking.control.failures,
            "told": self.told,
            "last_punch": None if last is None else [last.time, last.joint, *last.force.round(1).tolist()],
        }


def walk(job: tuple[int, Setup]) -> dict[str, Any]:
    """Walk a run and return its row."""
    tour = Tour(*job)
    while not tour.over:
        tour.step()
    return tour.result()


def walked(runs: Sequence[int], setup: Setup, processes: int) -> Iterator[dict[str, Any]]:
    """Walk runs over processes; their rows come in order."""
    jobs = [(run, setup) for run in runs]
    if processes <= 1:
        yield from map(walk, jobs)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(walk, jobs)


def numbers(text: str) -> list[int]:
    """Return the run numbers of "7" or "0-127"."""
    first, _, last = text.partition("-") if "-" in text else (text, "", text)
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
        raise ValueError(f"runs are numbers such as 7 or 0-127, or a file of rows, got '{text}'")
    return list(range(int(first), int(last) + 1))


def main(arguments: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Run the example."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", help="numbers such as 0-127, or files of rows")
    parser.add_argument("--no-force-sensors", action="store_true", help="feet without force sensors")
    parser.add_argument(
        "--noise", default="none", choices=("none", "realistic"), help="errors of all sensors"
    )
    parser.add_argument("--mode", default="torque", choices=("torque", "hybrid"), help="control mode")
    parser.add_argument(
        "--delay", type=float, default=0.0, help="stated delay of sensors, and of commands (s)"
    )
    parser.add_argument("--own-arms", action="store_true", help="the walk has the arms, and holds them")
    parser.add_argument("--no-punches", action="store_true", help="nobody punches")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="time of a run (s), default %(default)s"
    )
    parser.add_argument("--processes", type=int, default=1, help="runs at a time, default %(default)s")
    parser.add_argument("--json", action="store_true", help="print rows alone, without the table")
    options = parser.parse_args(arguments)
    files = [Path(given) for given in options.runs if Path(given).is_file()]
    try:
        runs = [run for given in options.runs if Path(given) not in files for run in numbers(given)]
    except ValueError as error:
        parser.error(str(error))
    for name, least in (("seconds", 0.0), ("processes", 0)):
        if not getattr(options, name) > least:
            parser.error(f"{name} must be above {least:g}, got {getattr(options, name):g}")
    setup = Setup(
        force_sensors=not options.no_force_sensors,
        noise=options.noise,
        mode=options.mode,
        delay=options.delay,
        own_arms=options.own_arms,
        punched=not options.no_punches,
        seconds=options.seconds,
    )
    rows: list[dict[str, Any]] = []
    for file in files:
        rows += [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    for row in walked(runs, setup, options.processes):
        rows.append(row)
        print(json.dumps(row), flush=True)
    if not options.json:
        print(table(rows), file=sys.stderr if runs else sys.stdout)
    return rows


if __name__ == "__main__":
    logging.getLogger("wbc").setLevel(logging.CRITICAL)  # robots that fall are in the rows
    main()
