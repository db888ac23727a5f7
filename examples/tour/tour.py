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
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

import model
import numpy as np
from _runs import Row, make_runs, register_runs
from pydantic import Field
from table import table
from task import COMMANDS, DURATION, FLOOR, SECONDS, Effort, MovingArms, Teleoperator, punches, standing

import wbc
from wbc.app import Recorder
from wbc.app.arguments import attribute_docs
from wbc.base.errors import InputError
from wbc.base.settings import Positive, from_json, settings, to_json
from wbc.core.estimation.observer import ObserverSettings
from wbc.policy import PolicyControl, PolicyFilter, PolicyGuard
from wbc.sim import Machine, MujocoLoop, Simulation, trial_loop
from wbc.walking import SteppingSettings, WalkingControl, WalkingControlSettings

HERE = Path(__file__).resolve().parent

PERIOD = 0.002
"""Control period, s."""

LIMITS = (0.5, 0.4, 1.0)
"""Greatest velocity that the harness asks for: forward and aside, m/s, and turn, rad/s."""

SWING = 0.09
"""Height of a swing, over that of the CoM: the floor is flat, and the default is one for rough ground."""

ENGINES = {"mujoco": "", "dart": f"{HERE.parent / 'other_engine.py'}:DartLoop"}
"""Physics engine → its loop; MuJoCo simulates the benchmark's model as it is."""

DART_STEP = 0.001
"""Physics step in DART, s."""

Control = Literal["policy", "guarded", "filtered"]
"""Controls of a policy: the policy alone, with the library's walk beside it, or with a filter of its arms."""

KEPT_APART = [
    (f"{side}_{hand}_link", link)
    for side in ("left", "right")
    for hand in ("wrist_yaw", "wrist_roll")
    for link in ("torso_link", "pelvis", "left_hip_yaw_link", "right_hip_yaw_link")
] + [("left_wrist_yaw_link", "right_wrist_yaw_link")]
"""Pairs of links that a filter keeps apart."""


@settings
class Setup:
    """Settings of a run besides its number.

    Attributes:
        force_sensors: Feet with force sensors.
        noise: Errors of all sensors.
        mode: Control; in hybrid control with the machine's gains.
        delay: Stated delay of sensors, and of commands, s.
        own_arms: The walk has the arms, and holds them; nobody else moves them.
        punches: Somebody punches the robot.
        drop: Height over the ground at the start, m.
        seconds: Time of a run, s.
        engine: Physics engine.
        policy: ONNX file of a trained policy that walks in place of the library.
        control: Control of a policy: alone, guarded by the library's walk, or with a filter of its arms.
    """

    force_sensors: bool = True
    noise: Literal["none", "realistic"] = "none"
    mode: Literal["torque", "hybrid"] = "torque"
    delay: Annotated[float, Field(ge=0.0, le=0.1), "s"] = 0.0
    own_arms: bool = False
    punches: bool = True
    drop: Annotated[float, Field(ge=0.0, le=1.0), "m"] = 0.0
    seconds: Annotated[Positive, "s"] = SECONDS
    engine: Literal["mujoco", "dart"] = "mujoco"
    policy: str = ""
    control: Control = "policy"

    def __post_init__(self) -> None:
        if self.control != "policy" and not self.policy:
            raise InputError(f"the control '{self.control}' is that of a policy: name its file, too")
        if self.control == "filtered" and not self.own_arms:
            raise InputError("a filter is for the arms of the policy: it needs own_arms")

    @property
    def name(self) -> str:
        """Name of the row of such runs in a table, whatever the engine."""
        parts = ["force sensors" if self.force_sensors else "no force sensors"]
        parts += [f"policy {Path(self.policy).stem}"] if self.policy else []
        parts += [self.control] if self.control != "policy" else []
        parts += [f"{self.noise} noise"] if self.noise != "none" else []
        parts += ["hybrid, machine's gains"] if self.mode == "hybrid" else []
        parts += [f"delays {1e3 * self.delay:g} + {1e3 * self.delay:g} ms"] if self.delay > 0.0 else []
        parts += ["with arms (unranked)"] if self.own_arms else []
        parts += [] if self.punches else ["no punches"]
        parts += [f"dropped by {1e3 * self.drop:g} mm"] if self.drop > 0.0 else []
        parts += [f"{self.seconds:g} s"] if self.seconds != SECONDS else []
        return ", ".join(parts)


class Tour:
    """One run.

    Attributes:
        loop: The simulation.
        walking: The control.
        operator: The harness's commands, and the errors at the waypoints.
        effort: Energy and vibration up to now.
        fell: Time of the fall, or of a divergence of the simulation, s; None before one.
        told: Time, s, and reason of the fall that the control has named; None before.
        record: Called with loop, walk, measurement and command of each tick, such as a `Recorder`; None for nothing.
    """

    def __init__(self, run: int, setup: Setup, record: Callable[..., object] | None = None) -> None:
        """Put the robot on the ground."""
        self.run, self.setup, self.record = run, setup, record
        simulated = model.load()
        description = wbc.RobotDescription.from_mjcf(simulated)
        if setup.mode == "hybrid":
            description = description.with_servos(model.GAINS)
        self.loop = _loop(description, simulated, run, setup)
        robot = description.robot()
        self.arms = MovingArms(run, robot)
        start = standing(robot)
        start[2] += setup.drop
        self.loop.reset(start)
        robot.update(standing(robot), np.zeros(robot.nv))
        self.walking = _control(description, robot, setup)
        self.operator = Teleoperator(run, LIMITS)
        self.effort = Effort(robot.joint_names)
        self.punches = punches(run) if setup.punches else []
        self.changed = 0.0  # square of the torques that a filter has changed, over joints and ticks, (Nm)²
        self.given = 0  # punches
        self.ticks = 0
        self.fell: float | None = None
        self.told: tuple[float, str] | None = None
        if not setup.own_arms:
            guard = self.walking if isinstance(self.walking, PolicyGuard) else None
            for each in (self.walking,) if guard is None else (guard.policy, guard.walking):
                each.release(model.ARMS)

    @property
    def over(self) -> bool:
        """True after a fall or a divergence, and at the end."""
        return self.fell is not None or self.ticks >= round(self.setup.seconds / PERIOD)

    def step(self) -> None:
        """Walk one control period."""
        time, loop, walking = self.ticks * PERIOD, self.loop, self.walking
        down = loop.diverged is not None
        if not down and self.ticks % round(COMMANDS / PERIOD) == 0:
            down = self._order(time)
        if down:
            self.fell = time
            return
        if self.given < len(self.punches) and time >= self.punches[self.given].time - 1e-9:
            punch = self.punches[self.given]
            self.given += 1
            loop.push(punch.joint, punch.force, DURATION, at=[0.0, 0.0, 0.0])
        measurement = loop.measure()
        command = walking.command(measurement)
        if isinstance(walking, PolicyControl):
            self.changed += float(walking.changed @ walking.changed)
        if self.record is not None:
            self.record(loop, walking, measurement, command)
        loop.step(command if self.setup.own_arms else self._with_arms(command))
        self.ticks += 1
        if walking.fallen is not None and self.told is None:
            self.told = time, walking.fallen.value

    def _order(self, time: float) -> bool:
        """Tell the walk and the arms where to go; return True for a robot that lies."""
        self.effort.add(self.loop.joint_torque, self.loop.joint_velocity)
        x, y, height, i, j, k, w = self.loop.base_pose
        if height < FLOOR:
            return True
        yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        velocity = self.operator.command(time, x, y, yaw)
        self.walking.velocity = velocity if any(velocity) else None
        if not self.setup.own_arms:
            self.arms.move(time)
        return False

    def _with_arms(self, command: wbc.Command) -> wbc.Command:
        """Return a command with the torques of the arms, whose torques and gains the walk leaves at zero."""
        columns, torque = self.arms.columns, np.array(command.joint_torque)
        torque[columns] = self.arms.torque(
            self.loop.joint_position[columns], self.loop.joint_velocity[columns]
        )
        return dataclasses.replace(command, joint_torque=torque, released=None)

    def result(self) -> Row:
        """Return the row of this run: times, s, errors, m and rad, and torques that a filter changes, rms, Nm."""
        if self.fell is None:
            self.operator.finish()
        errors = np.array(self.operator.errors).reshape(-1, 2)
        places, headings = errors.mean(0).tolist() if len(errors) else (None, None)
        last = self.punches[self.given - 1] if self.given else None
        return {
            "run": self.run,
            "setup": self.setup.name,
            "engine": self.setup.engine,
            "survived": self.setup.seconds if self.fell is None else self.fell,
            "completed": self.fell is None,
            "position_error": places,
            "heading_error": headings,
            **self.effort.by_group(),
            "steps": self.walking.steps_done,
            "failed_ticks": self.walking.drives.failures,
            "relieved": getattr(self.walking, "relieved", ""),
            "changed": math.sqrt(self.changed / (max(self.ticks, 1) * len(self.loop.joint_torque))),
            "told": self.told,
            "last_punch": None if last is None else [last.time, last.joint, *last.force.round(1).tolist()],
        }


def _control(
    description: wbc.RobotDescription, robot: wbc.Robot, setup: Setup
) -> WalkingControl | PolicyControl | PolicyGuard:
    """Return the control of a robot that stands: the walk, or a policy with a filter or a guard."""
    observer = None
    if setup.delay > 0.0:
        stated = ObserverSettings(measurement_delay=setup.delay, command_delay=setup.delay)
        observer = wbc.Observer(robot, stated, adopt=True)
    if not setup.policy:
        walks = WalkingControlSettings(mode=setup.mode, stepping=SteppingSettings(swing_height=SWING))
        return WalkingControl(robot, None, PERIOD, walks, observer=observer)
    arms = None
    if setup.control == "filtered":
        shapes = description.collision_shapes()
        hands = wbc.CollisionLimit(KEPT_APART, shapes=shapes, recovery=100.0, influence=0.5)
        arms = PolicyFilter(model.ARMS, [hands])
    policy = PolicyControl(robot, setup.policy, PERIOD, filter=arms, observer=observer)
    return PolicyGuard(policy) if setup.control == "guarded" else policy


def _loop(description: wbc.RobotDescription, simulated: Any, run: int, setup: Setup) -> Simulation:
    """Return the simulation."""
    machine = Machine(
        measurement_delay=setup.delay,
        command_delay=setup.delay,
        torque_sensors=True,
        force_sensors=setup.force_sensors,
    )
    options = {"control_period": PERIOD, "noise": setup.noise, "seed": run, "machine": machine}
    if place := ENGINES[setup.engine]:
        loop: Simulation = trial_loop(place).make(description, timestep=DART_STEP, **options)
        return loop
    return MujocoLoop(description, simulated, **options)


def walk(run: int, setup: Setup) -> Row:
    """Walk a run, and return its row."""
    tour = Tour(run, setup)
    while not tour.over:
        tour.step()
    return tour.result()


def walk_values(run: int, **setup: Any) -> Row:
    """Walk a run with a setup of plain values, as a journal has it."""
    return walk(run, from_json(Setup, setup))


register_runs(
    "tour", walk_values, (*HERE.glob("*.py"), model.FILE, HERE.parent / "other_engine.py"), metric="survived"
)


def walked(runs: Sequence[int], setup: Setup, processes: int, journal: Path | None = None) -> list[Row]:
    """Walk the runs that are not in a journal yet, over processes; print the row of each, and return all rows."""

    def tell(row: Row) -> None:
        print(json.dumps(row), file=sys.stderr if "error" in row else sys.stdout, flush=True)

    with tempfile.TemporaryDirectory() as folder:
        place, wanted = (
            journal or Path(folder) / "tour.journal",
            [{"run": run, **to_json(setup)} for run in runs],
        )
        return make_runs(place, "tour", wanted, workers=processes, tell=tell)


def film(run: int, setup: Setup, path: Path) -> Row:
    """Walk a run, film it, and return its row."""
    from wbc.app.log.reader import Log  # noqa: PLC0415 - slow
    from wbc.app.replay.film import check_film, render_video  # noqa: PLC0415 - slow
    from wbc.app.replay.replay import Replay  # noqa: PLC0415 - slow

    check_film(path)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "tour.arrow"
        with Recorder(log, title=f"tour, run {run}") as record:
            tour = Tour(run, setup, record)
            while not tour.over:
                tour.step()
        render_video(Replay(Log.open(log)), path)
    return tour.result()


def read(path: Path) -> list[Row]:
    """Return the rows in a file: rows as they were printed, or a journal."""
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    rows = [line.get("result") if "spec" in line else line for line in lines]
    return [row for row in rows if row is not None]


def numbers(text: str) -> list[int]:
    """Return the run numbers of "7" or "0-127"."""
    first, _, last = text.partition("-") if "-" in text else (text, "", text)
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
        raise InputError(f"runs are numbers such as 7 or 0-127, or a file of rows, got '{text}'")
    return list(range(int(first), int(last) + 1))


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Run the example."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", help="numbers such as 0-127, or files of rows")
    hints = get_type_hints(Setup)
    for name, about in attribute_docs(Setup).items():
        default, option = getattr(Setup, name), f"--{name.replace('_', '-')}"
        kind: dict[str, Any] = {"type": type(default), "choices": get_args(hints[name]) or None}
        if isinstance(default, bool):
            kind = {"action": argparse.BooleanOptionalAction}
        parser.add_argument(option, default=default, help=f"{about} Default: %(default)s.", **kind)
    parser.add_argument("--processes", type=int, default=1, help="runs at a time, default %(default)s")
    parser.add_argument("--journal", type=Path, help="file that keeps what has been walked, to go on from")
    parser.add_argument("--film", type=Path, help="film of one run (.mp4)")
    parser.add_argument("--rows", type=int, help="rows of the table, default all")
    parser.add_argument("--json", action="store_true", help="print rows alone, without the table")
    options = parser.parse_args(arguments)
    files = [Path(given) for given in options.runs if Path(given).is_file()]
    try:
        runs = [run for given in options.runs if Path(given) not in files for run in numbers(given)]
        if options.film is not None and (len(runs) != 1 or files or options.journal is not None):
            raise InputError(
                f"a film shows one run, without a journal; got {len(runs)} runs and {len(files)} files"
            )
        setup = Setup(**{name: getattr(options, name) for name in hints})
        rows = [row for file in files for row in read(file)]
        if options.film is not None:
            rows.append(film(runs[0], setup, options.film))
            print(json.dumps(rows[-1]))
        elif runs:
            if place := ENGINES[setup.engine]:
                trial_loop(place)
            rows += walked(runs, setup, options.processes, options.journal)
    except (wbc.WbcError, ValueError) as error:
        parser.error(str(error))
    if not options.json and rows:
        print(table(rows, most=options.rows), file=sys.stderr if runs else sys.stdout)
    if {row["run"] for row in rows} < {*runs}:
        raise SystemExit(1)  # the rest has crashed, as is said
    return rows


if __name__ == "__main__":
    logging.getLogger("wbc").setLevel(logging.CRITICAL)  # robots that fall are in the rows
    main()
