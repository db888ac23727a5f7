"""Hostile input for every option of every command and every parameter of the public packages, run in a worker.

A worker is a process of its own with bounded memory: a case that hangs or crashes ends the worker, not the tests, and
the next worker goes on behind it. `python tests/support/fuzzing.py commands|api|plain|files [from [to [step]]]` lists
what failed; files are mutated ones (`mutated`).
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
import json
import logging
import math
import os
import queue
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from enum import Enum
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args, get_origin

import numpy as np

MEMORY = 8 * 2**30
"""Address space of a worker, bytes."""

LIMIT = 5.0
"""Longest time of a case, s."""

WORDS = ("-1", "0", "1", "1e300", "1e-300", "nan", "inf", "-inf", "1e9", "0.5", "text", "", " ", "x" * 10_000)
HARD_WORDS = (
    "\ud800",
    "a\0b",
    "1" * 5000,
    "none",
    "-5e-324",
    "1_000",
    "٣",
    "../..",
    "1,2,3",
    "=",
    "a=",
    "=1",
)
PAIRS = ("nothing=1", "no_value", "seed=nan")

MUTATIONS = 10_000
"""Mutations of each file that there are."""

LEAST = {"commands": 10_000, "api": 37_000, "files": 20 * MUTATIONS}
"""Number of cases that there are at least."""

PACKAGES = ("wbc", "wbc.tasks", "wbc.robots", "wbc.feet", "wbc.walking", "wbc.sim")

BASE: dict[str, list[str]] = {
    "stand": ["--seconds", "0.05"],
    "walk": ["--distance", "0.1"],
    "bench tick": ["--ticks", "5", "--warm-up", "1"],
    "foot": ["press", "--foot", "rigid"],
    "bench solver": ["--ticks", "5", "--repeat", "1", "--robot", "hrp4_class"],
    "terrain": ["stones"],
    "hands": ["press"],
    "motion": ["track", "{dir}/nothing.npz"],
    "study show": ["{study}"],
    "study run": ["{study}", "--journal", "{dir}/new.jsonl"],
    "study table": ["{study}", "--journal", "{dir}/old.jsonl"],
    "stiffness": ["judge", "{dir}/nothing.csv"],
    "plot": ["{dir}/nothing.arrow", "balance"],
    "view": ["{dir}/nothing.arrow", "-o", "{dir}/new.html"],
}
"""Arguments with which a command ends soon, beside the one that is fuzzed."""

STUBS = (
    "wbc.app.commands.balance:StandTrial.run",
    "wbc.app.commands.balance:push_table",
    "wbc.app.commands.walk:WalkTrial.run",
    "wbc.sim.balance.carrying:CarryTrial.run",
    "wbc.sim.balance.tracking:TrackTrial.run",
    "wbc.sim.hands.carts:CartTrial.run",
    "wbc.sim.hands.doors:DoorTrial.run",
    "wbc.sim.hands.one_foot:OneFootTrial.run",
    "wbc.sim.hands.pressing:HandPressTrial.run",
    "wbc.feet.stiffness.figures:learning_curve",
    "wbc.feet.stiffness.comparison:cross_validate",
    "wbc.machine.conformance:_check_shapes",
    "wbc.machine.run:Runner._make_guard",
    "wbc.sim.studies.sweep:_run_locally",
    "wbc.app.commands.bench:bench_tick",
    "wbc.app.commands.bench:bench_solver",
    "wbc.app.commands.bench:bench_walk",
    "wbc.app.commands.study.run:sweep",
    "wbc.app.commands.terrain:plot_families",
    "wbc.app.live:LiveView.watch",
)
"""Long work that legal values start: a word that gets here was accepted."""


class Accepted(BaseException):
    """Input was accepted: the work begins."""


@dataclass(frozen=True)
class Failure:
    """A case that ended in neither a result nor a refusal."""

    case: str
    why: str


def hostile_files(folder: Path) -> list[str]:
    """Write files that no command can use, and return their paths and some that do not exist."""
    deep = "[" * 100_000
    texts = {
        "empty": b"",
        "text": b"hello\n",
        "binary": bytes(range(256)),
        "deep.json": deep.encode(),
        "deep2.json": (b'{"a":' * 50_000) + b"1" + b"}" * 50_000,
        "list.json": b"[1, 2]",
        "number.json": b"1e400",
        "spec_list.json": b'{"spec": [1, 2]}',
        "spec_text.json": b'{"spec": "walk"}',
        "surrogate.json": b'{"name": "\\ud800", "robot": "\\ud800"}',
        "nan.json": b'{"seed": NaN, "amplitude": Infinity}',
        "study.json": b'{"name": "\\ud800", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": [1]}',
        "seeds.json": b'{"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": {"first": 1, "count": 999999999999}}',  # noqa: E501
        "fields.json": b'{"name": 1, "cells": {"a": 1}, "arms": [], "seeds": -1}',
        "robot.json": b'{"name": "s", "cells": {"a": {"robot": "nobody"}}, "arms": {"b": {}}, "seeds": [1]}',
        "deep.toml": b"a = " + deep.encode(),
        "types.toml": b"seed = []\nrobot = 1\n[gait]\na = 1\n",
        "date.toml": b"seed = 2020-01-01\n",
        "deep.jsonl": deep.encode() + b"\n",
        "lines.jsonl": b"1\nnull\n[]\n{}\n",
        "empty.npy": b"",
        "text.npz": b"hello",
        "empty.arrow": b"",
        "text.arrow": b"hello",
        "empty.csv": b"",
        "text.csv": b"hello\nworld\n",
        "picture.png": b"hello",
    }
    for name, content in texts.items():
        (folder / name).write_bytes(content)
    np.save(folder / "none.npy", np.zeros((0, 0)))
    np.save(folder / "flat.npy", np.zeros((5, 5)))
    np.save(folder / "text.npy", np.array([["a", "b"]]))
    np.save(folder / "nan.npy", np.full((5, 5), np.nan))
    np.savez(folder / "empty.npz")
    return [
        *(str(folder / name) for name in sorted({each.name for each in folder.iterdir()})),
        str(folder),
        str(folder / "missing.json"),
        "/proc/self/mem",
        "/nowhere/at/all.json",
        "x" * 300,
    ]


STUDY = {
    "name": "fuzz",
    "cells": {"flat": {"terrain": "flat"}},
    "arms": {"flat": {"foot": "flat"}},
    "seeds": [100],
    "base": {"plan": {"distance": 0.1}},
}


def command_cases(folder: Path) -> list[list[str]]:
    """Return command lines, each with one hostile word."""
    from wbc.app.cli import make_app  # noqa: PLC0415 - the parent does not need it
    from wbc.app.commands import COMMANDS  # noqa: PLC0415

    files = hostile_files(folder)
    study = folder / "good_study.json"
    study.write_text(json.dumps(STUDY))
    (folder / "old.jsonl").write_bytes(b"")
    app = make_app(None)
    cases: list[list[str]] = []
    for words in COMMANDS:
        command = app
        for word in words.split():
            command = command[word]
        base = [part.format(dir=folder, study=study) for part in BASE.get(words, [])]
        for argument in command.assemble_argument_collection():
            name = argument.name
            kinds = (argument.hint, *get_args(argument.hint))
            if (
                name == "*"
                or not argument.parse
                or any(isinstance(k, type) and hasattr(k, "__settings__") for k in kinds)
            ):
                continue
            if name in ("--json", "--verbose", "--view", "--host", "--cluster"):
                continue
            values: list[str] = [*WORDS, *HARD_WORDS]
            if (
                Path in kinds
                or name in ("STUDY", "WORDS", "LOG", "--name")
                or "param" in name
                or name == "--set"
            ):
                values += files
            if str in kinds and get_origin(argument.hint) is tuple:
                values += PAIRS
            if bool in kinds:
                values = []
            for value in values:
                if not name.startswith("-"):
                    before = base[1:] if base and not base[0].startswith("-") else base
                    cases.append([*words.split(), value, *before])
                else:
                    kept = [w for i, w in enumerate(base) if w != name and (i == 0 or base[i - 1] != name)]
                    if words == "walk" and name in ("--spec", "--velocity", "--steps", "--turn", "--stairs"):
                        kept = []
                    cases.append([*words.split(), *kept, f"{name}={value}"])
        if words == "terrain":
            cases += _family_cases(files)
        if "foot" in words or words == "walk":
            cases += _foot_cases(words, base)
        if words == "walk":
            cases += _set_cases(base)
    return cases


def _family_cases(files: Sequence[str]) -> Iterator[list[str]]:
    from dataclasses import fields  # noqa: PLC0415

    from wbc.sim.terrain import terrain_families  # noqa: PLC0415

    for name, kind in terrain_families().items():
        for field in fields(kind):
            values = [*WORDS[:10], *(files if field.name in ("path", "file", "image", "source") else ())]
            for value in values:
                yield ["terrain", name, "--param", f"{field.name}={value}"]
        for option in ("amplitude", "length", "width", "resolution", "sole-radius"):
            for value in ("1e300", "1e-300", "1e9", "-1", "1e6", "1e-6"):
                yield ["terrain", name, f"--{option}={value}"]


def _foot_cases(words: str, base: Sequence[str]) -> Iterator[list[str]]:
    from dataclasses import fields  # noqa: PLC0415

    from wbc.feet.soles.soft import VariableStiffnessFoot  # noqa: PLC0415

    rest = [w for i, w in enumerate(base) if w != "--foot" and (i == 0 or base[i - 1] != "--foot")]
    for field in fields(VariableStiffnessFoot):
        for value in WORDS[:11]:
            yield [*words.split(), *rest, "--foot", "variable", "--foot-param", f"{field.name}={value}"]


def _set_cases(base: Sequence[str]) -> Iterator[list[str]]:
    from wbc.core.changes import setting_names  # noqa: PLC0415
    from wbc.sim.walks import TrialSettings  # noqa: PLC0415

    for name in setting_names(TrialSettings()):
        for value in ("-1", "1e300", "1e-300", "nan", "text", "none", "true", "1,2"):
            yield ["walk", *base, "--set", f"{name}={value}"]
    for name in ("impulse", "direction", "duration", "body", "time", "step", "phase"):
        for value in WORDS[:12]:
            yield [
                "walk",
                *base,
                "--push",
                f"impulse=0.1,{name}={value}" if name != "impulse" else f"impulse={value}",
            ]


def run_file(case: Any, folder: Path) -> str | None:
    """Run a command on a mutated file; on a valid one it must not be refused."""
    return run_command(case.words(folder), refusable=case.seed is not None)


def run_command(words: list[str], *, refusable: bool = True) -> str | None:
    """Run a command line; return why it failed, None if it ended as it should."""
    from wbc.app import cli  # noqa: PLC0415

    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = cli.main(words)
    except Accepted:
        return None
    lines = err.getvalue().strip().splitlines()
    if "Traceback" in err.getvalue():
        return "traceback: " + " | ".join(line.strip() for line in lines[-6:])[-600:]
    if code == 0:
        return None if out.getvalue().strip() else "silence"
    said = [line for line in lines if line.startswith("wbc: ")]
    if code not in (1, 2) or not refusable or len(said) != 1 or len(said[0]) < 12:
        return f"exit {code}: {lines[-3:]}"
    if code == 1 and "diverged" not in said[0] and "journal" not in said[0]:
        return f"exit 1: {said[0][:300]}"
    if len(said[0]) > 1500:
        return f"a line of {len(said[0])} characters: {said[0][:200]}"
    return None


def stub_long_work() -> None:
    """Replace long work by `Accepted`, so that legal values cost nothing."""

    def accept(*_: Any, **__: Any) -> Any:
        raise Accepted

    for place in STUBS:
        module, _, path = place.partition(":")
        owner: Any = importlib.import_module(module)
        *parents, name = path.split(".")
        for parent in parents:
            owner = getattr(owner, parent)
        assert hasattr(owner, name), place
        setattr(owner, name, accept)


# --- the Python API -------------------------------------------------------------------------------------------------


class Odd:
    """An object of a foreign class."""


HOSTILE: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "1e300": lambda: 1e300,
    "1e-300": lambda: 1e-300,
    "-1": lambda: -1,
    "0": lambda: 0,
    "0.5": lambda: 0.5,
    "10**9": lambda: 10**9,
    "10**400": lambda: 10**400,
    "True": lambda: True,
    "''": lambda: "",
    "'text'": lambda: "text",
    "surrogate": lambda: "\ud800",
    "NUL": lambda: "a\0b",
    "long": lambda: "x" * 100_000,
    "bytes": lambda: b"\xff\x00",
    "[]": lambda: [],
    "[nan]": lambda: [math.nan],
    "[[]]": lambda: [[]],
    "['a']": lambda: ["a"],
    "{}": lambda: {},
    "{1: 2}": lambda: {1: 2},
    "object": Odd,
    "class": lambda: Odd,
    "function": lambda: _wrong,
    "array 0": lambda: np.zeros(0),
    "array (2, 2, 2)": lambda: np.zeros((2, 2, 2)),
    "array nan": lambda: np.full(3, math.nan),
    "array text": lambda: np.array(["a"]),
    "array object": lambda: np.array([None, {}], dtype=object),
    "array 1e300": lambda: np.full(6, 1e300),
    "path": lambda: Path("/nowhere"),
    "folder": lambda: Path("/"),
    "complex": lambda: 1j,
    "set": lambda: {1, 2},
    "recursive": lambda: _recursive(),  # noqa: PLW0108 - defined below
    "deep": lambda: _deep(),  # noqa: PLW0108
    "array float32": lambda: np.float32(1.0),
    "np.nan": lambda: np.float64(math.nan),
}


def _wrong(*_: Any) -> Any:
    return None


def _recursive() -> list[Any]:
    values: list[Any] = []
    values.append(values)
    return values


def _deep() -> list[Any]:
    values: list[Any] = []
    for _ in range(100_000):
        values = [values]
    return values


@cache
def _description() -> Any:
    import wbc  # noqa: PLC0415

    return wbc.load_robot("hrp4_class")


def _plan() -> Any:
    from wbc import sim  # noqa: PLC0415

    del sim
    from wbc.walking import Footstep, FootstepPlan, Gait  # noqa: PLC0415

    return FootstepPlan(Footstep("left", 0.0, 0.1), Footstep("right", 0.0, -0.1), (), Gait())


def _made(target: Any, name: str) -> Any:
    """Return a value of the class that a parameter asks for, where the class has defaults for all; None otherwise."""
    hint = inspect.signature(target, eval_str=True).parameters[name].annotation
    if get_origin(hint) is Mapping:
        return {}
    parameters = inspect.signature(hint).parameters.values() if is_dataclass(hint) else ()
    return hint() if parameters and all(p.default is not p.empty for p in parameters) else None


def valid(target: Any, name: str, package: str) -> Any:
    """Return a usable value for a parameter without default, by function and name; None when unknown."""
    import wbc  # noqa: PLC0415
    from wbc import feet, sim, walking  # noqa: PLC0415
    from wbc.feet.soles.sole import SoleGeometry  # noqa: PLC0415

    makers: dict[str, Callable[[], Any]] = {
        "description": _description,
        "robot": lambda: _description().robot(),
        "dt": lambda: 0.005,
        "period": lambda: 0.005,
        "time": lambda: 0.0,
        "timestep": lambda: 0.001,
        "controller": lambda: wbc.balance_controller(_description().robot(), 0.005),
        "frame": lambda: "left_sole",
        "reference": lambda: "right_sole",
        "sole": (lambda: "left_foot")
        if package != "wbc.feet"
        else (lambda: SoleGeometry.under_ankle(0.1, 0.16, 0.08)),
        "contact": lambda: "left_foot",
        "admittance": lambda: np.full(6, 1e-3),
        "name": lambda: (
            "soft" if package == "wbc.feet" else "stones" if package == "wbc.sim" else "hrp4_class"
        ),
        "dim": lambda: 3,
        "axes": lambda: None,
        "start": _plan,
        "plan": _plan,
        "distance": lambda: 0.5,
        "angle": lambda: 0.5,
        "velocity": lambda: (0.1, 0.0, 0.0),
        "steps": lambda: 3,
        "moves": lambda: [(0.1, 0.0, 0.0)],
        "rise": lambda: 0.02,
        "tread": lambda: 0.2,
        "count": lambda: 2,
        "first_edge": lambda: 0.2,
        "height": lambda: 0.8,
        "com_height": lambda: 0.75,
        "mass": lambda: 40.0,
        "weight": lambda: 400.0,
        "omega": lambda: 3.5,
        "ground": lambda: 0.0,
        "com": lambda: np.array([0.0, 0.0, 0.8]),
        "com_velocity": lambda: np.zeros(3),
        "wrench": lambda: np.array([0.0, 0.0, 400.0, 0.0, 0.0, 0.0]),
        "wrenches": lambda: np.tile([0.0, 0.0, 200.0, 0.0, 0.0, 0.0], (2, 1)),
        "sizes": lambda: ((0.2, 0.1), (0.2, 0.1)),
        "design": lambda: feet.foot("soft"),
        "foot": lambda: feet.foot("variable"),
        "policy": wbc.tasks.FixedPolicy,
        "z": lambda: np.sin(np.arange(100.0)),
        "x": (lambda: np.arange(100.0) * 0.01) if package == "wbc.feet" else (lambda: 0.0),
        "step": lambda: 0.01,
        "corner": lambda: 3.0,
        "length": lambda: 0.2,
        "width": lambda: 0.1,
        "every": lambda: 0.05,
        "values": lambda: np.random.default_rng(0).normal(size=(50, 17)),
        "side": lambda: "left",
        "y": lambda: 0.1,
        "terrain": lambda: sim.make_terrain("stones"),
        "clearance": lambda: 0.05,
        "test": lambda: sim.FootTest(foot=feet.foot("rigid"), settle=0.02, hold=0.02),
        "spec": lambda: None,
        "plant": lambda: sim.Plant(_description()),
        "link": lambda: "left_ankle_link",
        "impulse": lambda: 0.1,
        "duration": lambda: 0.5,
        "min_height": lambda: 0.02,
        "ankle_behind": lambda: 0.03,
        "cells": lambda: (sim.Cell("flat", {"terrain": "flat"}),),
        "arms": lambda: {"flat": {"foot": "flat"}},
        "seeds": lambda: (100,),
        "gait": walking.Gait,
        "left": lambda: walking.Footstep("left", 0.0, 0.1),
        "right": lambda: walking.Footstep("right", 0.0, -0.1),
        "landing": lambda: walking.Footstep("left", 0.2, 0.1),
        "amplitude": lambda: 0.02,
        "parameters": lambda: sim.make_terrain("stones").parameters,
        "estimate": lambda: _description().robot(),
        "edges": lambda: (0.1, 0.05),
        "posture": wbc.PostureTask,
    }
    maker = makers.get(name)
    return _made(target, name) if maker is None else maker()


class SilentDriver:
    """A machine that says nothing."""

    def read(self, timeout: float) -> None:
        """Return no measurement."""

    def write(self, command: Any) -> None:
        """Take a command."""

    def damp(self) -> None:
        """Take the end."""


def own_values(function: str) -> dict[str, Any]:
    """Return usable values for parameters of one function, where those of `valid` do not fit."""
    import pinocchio as pin  # noqa: PLC0415

    import wbc  # noqa: PLC0415
    from wbc import feet, sim, walking  # noqa: PLC0415
    from wbc.tasks.stabilizer.distribution import WrenchDistribution  # noqa: PLC0415

    plane = pin.SE3.Identity()
    x = 0.004 * np.arange(41)
    makers: dict[str, Callable[[], dict[str, Any]]] = {
        "RobotDescription": lambda: {
            name: getattr(_description(), name)
            for name in ("urdf", "soles", "half_sitting", "armature", "imu", "torso")
        },
        "Robot": lambda: {
            name: getattr(_description().robot(), name) for name in ("model", "soles", "half_sitting")
        },
        "SelfCollisionLimit": lambda: {"pairs": [("left_ankle_link", "right_ankle_link")]},
        "CollisionSphere": lambda: {"radius": 0.1},
        "CollisionCapsule": lambda: {"radius": 0.1, "start": (0.0, 0.0, 0.0), "end": (0.0, 0.0, 0.1)},
        "damped_bound": lambda: {
            "distance": np.full(2, 0.1),
            "velocity": np.zeros(2),
            "time_constant": 0.1,
        },
        "rectangle_wrench_cone": lambda: {"half_length": 0.1, "half_width": 0.05, "friction": 0.7},
        "velocity_from_mujoco": lambda: {"q": _description().robot().half_sitting, "qvel": np.zeros(40)},
        "velocity_to_mujoco": lambda: {"q": _description().robot().half_sitting, "v": np.zeros(40)},
        "FootstepPlan": lambda: {"steps": (walking.Footstep("left", 0.2, 0.1),)},
        "conformance": lambda: {"loop": sim.Plant(_description())},
        "check_task": lambda: {"task": wbc.CoMTask()},
        "run": lambda: {
            "driver": SilentDriver(),
            "control": wbc.TorqueControl(wbc.balance_controller(_description().robot(), 0.002)),
            "description": _description(),
        },
        "StiffnessDecision": lambda: {"stiffness": 5.0},
        "stiffness_policy": lambda: {"name": "fixed"},
        "SoleDescription": lambda: {"name": "left_foot", "frame": "left_sole", "link": "left_ankle_link"},
        "profile_roughness": lambda: {
            "profile": feet.Profile(
                x, np.sin(100.0 * x), 0.0 * x, x >= 0.0, np.array([1.0, 0.0]), float(x[1])
            )
        },
        "zmp": lambda: {"plane": plane},
        "Stabilizer": lambda: {"distribution": WrenchDistribution(((0.2, 0.1), (0.2, 0.1)))},
        "MujocoLoop": lambda: {"model": sim.Plant(_description()).model},
        "RobotServer": lambda: {
            "loop": sim.MujocoLoop(_description(), sim.Plant(_description()).model),
            "wire": SimpleNamespace(receive=_wrong, send=_wrong),
        },
        "arms_forward": lambda: {"forward": 0.3},
        "WalkTrial": lambda: {"spec": sim.WalkSpec()},
        "TrackTrial": lambda: {"clip": _clip()},
        "track_motion": lambda: {"clip": _clip()},
        "WalkPush": lambda: {"time": 1.0},
        "bar": lambda: {"yaw": 0.1, "top": 0.01},
        "dome": lambda: {"radius": 0.05, "top": 0.01},
        "plate": lambda: {"size": (0.1, 0.1), "top": 0.01},
        "stone": lambda: {"semi_axes": (0.05, 0.03), "top": 0.01, "yaw": 0.1},
        "press": lambda: {"support": False},
        "make_scene": lambda: {"name": "box"},
        "Cell": lambda: {"values": {"terrain": "flat"}},
        "Journal": lambda: {"path": _new_journal()},
        "read_journal": lambda: {"path": sim.Journal(_new_journal()).path},
        "cluster_executor": lambda: {"address": "local"},
        "study_table": lambda: {"study": sim.Study.from_json(STUDY), "entries": {}},
        "sweep": lambda: {"specs": [sim.WalkSpec()], "journal": sim.Journal(_new_journal())},
    }
    takes_table = ("compare", "cross_validate")
    table = {"table": _stiffness_table()} if function in takes_table else {}
    return table | makers.get(function, dict)()


@cache
def _stiffness_table() -> Any:
    from wbc.feet import StiffnessTable  # noqa: PLC0415
    from wbc.feet.stiffness.roughness import PARAMETERS  # noqa: PLC0415

    random, count = np.random.default_rng(0), 60
    amplitude = np.repeat([0.01, 0.02, 0.03], 20)
    numbers = {name: random.uniform(0.1, 1.0, count) for name in PARAMETERS}
    ground = [f"ground {i % 5}" for i in range(count)]
    return StiffnessTable.from_columns(
        {
            **numbers,
            "ground": ground,
            "family": ground,
            "amplitude": amplitude,
            "seed": np.zeros(count, dtype=int),
            "window": np.arange(count),
            "stiffness": 0.2 / amplitude,
        }
    )


def _new_journal() -> str:
    return f"{time.time_ns()}.jsonl"


def _clip() -> Any:
    import wbc  # noqa: PLC0415
    from wbc.motion import MotionClip  # noqa: PLC0415

    robot = wbc.load_robot("g1").robot()
    q = np.tile(robot.half_sitting, (3, 1))
    return MotionClip(robot.joint_names, 30.0, q[:, :7], q[:, 7:])


LONG_CALLS = {"real_time_factor"}
"""Functions whose legal values begin long work, and which have no part that could be replaced."""

SKIP = {
    # They register: what is registered stays.
    "register", "register_foot", "register_stiffness_policy", "family", "register_trial",
    # A decorator of classes.
    "settings",
}  # fmt: skip


@dataclass(frozen=True)
class ApiCase:
    """A call of a public function with one hostile argument."""

    package: str
    function: str
    parameter: str
    value: str

    def __str__(self) -> str:
        return f"{self.package}.{self.function}({self.parameter}={self.value})"


def api_cases() -> list[ApiCase]:
    """Return calls of every public constructor and function, each with one hostile argument."""
    cases = []
    seen: set[int] = set()
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in module.__all__:
            target = getattr(module, name)
            annotation = get_origin(target) is not None  # Positive, Count, …: no constructors
            if annotation or not callable(target) or id(target) in seen or name in SKIP:
                continue
            if isinstance(target, type) and (
                issubclass(target, (BaseException, Enum))
                or inspect.isabstract(target)
                or getattr(target, "_is_protocol", False)
            ):
                continue
            seen.add(id(target))
            try:
                parameters = inspect.signature(target).parameters.values()
            except ValueError:
                continue
            for parameter in parameters:
                if parameter.name in ("args", "hooks", "options", "values") and parameter.kind in (
                    parameter.VAR_POSITIONAL,
                    parameter.VAR_KEYWORD,
                ):
                    continue
                cases += [ApiCase(package, name, parameter.name, value) for value in HOSTILE]
    for option in ("weight", "stiffness", "damping", "name", "hard", "offset"):
        for task in ("CoMTask", "PoseTask", "PostureTask", "WrenchTask", "ImpedanceTask"):
            cases += [ApiCase("wbc.tasks", task, option, value) for value in HOSTILE]
    for parameter in inspect.signature(importlib.import_module("wbc").RobotDescription.from_urdf).parameters:
        cases += [ApiCase("wbc", "RobotDescription.from_urdf", parameter, value) for value in HOSTILE]
    for name in ("stand", "walk"):
        spec = getattr(importlib.import_module("wbc.sim"), f"{name.title()}Spec")
        for parameter in inspect.signature(spec).parameters:
            cases += [ApiCase("wbc", name, parameter, value) for value in HOSTILE]
    return cases


def plain_calls() -> list[ApiCase]:
    """Return one call of every public constructor and function, without a hostile argument."""
    functions = dict.fromkeys((case.package, case.function) for case in api_cases())
    return [ApiCase(*each, "", "") for each in functions if each[1] not in LONG_CALLS]


def _call(case: ApiCase) -> None:
    """Make a call and use its result."""
    target: Any = importlib.import_module(case.package)
    for part in case.function.split("."):
        target = getattr(target, part)
    arguments = own_values(case.function)
    for parameter in inspect.signature(target).parameters.values():
        several = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        if parameter.default is parameter.empty and not several and parameter.name not in arguments:
            arguments[parameter.name] = valid(target, parameter.name, case.package)
    if case.function == "RobotDescription.from_urdf":
        arguments = {
            "source": _description().urdf,
            "left_sole": _description().soles[0],
            "right_sole": _description().soles[1],
        }
    if case.function == "stand":
        arguments = {"seconds": 0.02}
    if case.function == "walk":
        arguments = {"plan": importlib.import_module("wbc.sim").WalkPlan(distance=0.1)}
    if case.parameter:
        arguments[case.parameter] = HOSTILE[case.value]()
    _use(target(**arguments))


def run_plain(case: ApiCase) -> str | None:
    """Make a call of valid arguments; return why it failed, None if it ended or began long work."""
    try:
        _call(case)
    except Accepted:
        return None
    except Exception as error:
        return _trace(error)
    return None


def run_api(case: ApiCase) -> str | None:
    """Make a call; return why it failed, None for a result or a `WbcError`."""
    from wbc.core.errors import WbcError  # noqa: PLC0415

    if case.function in LONG_CALLS:
        return None
    try:
        _call(case)
    except (WbcError, Accepted):
        return None
    except TypeError as error:
        wrong_name = "unexpected keyword argument" in str(error)
        return None if wrong_name else _trace(error)
    except Exception as error:
        return _trace(error)
    return None


def _use(result: Any) -> None:
    """Use what was made: a task in a controller, a ground's heights."""
    import wbc  # noqa: PLC0415
    from wbc.sim.terrain import Terrain  # noqa: PLC0415

    if isinstance(
        result, wbc.MotionTask | wbc.SoleContact | wbc.PointContact | wbc.JointLimits | wbc.TorqueLimits
    ):
        if type(result).__name__ in ("MotionTask", "SelectionTask", "VariableTask", "FrameTask"):
            return
        controller = wbc.Controller(_description().robot(), 0.005)
        controller.add(result)
        controller.solve()
    if isinstance(result, Terrain):
        result.height(0.5, 0.0)


def _trace(error: BaseException) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {str(error)[:200]} ({where.filename}:{where.lineno})"


# --- workers --------------------------------------------------------------------------------------------------------


def worker(kind: str, indices: Sequence[int]) -> None:
    """Run cases and write a line for each: its number, what it is, and why it failed."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    channel = os.fdopen(os.dup(1), "w")
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    folder = Path(os.environ["FUZZ_FOLDER"])
    os.chdir(folder)
    import mutated  # noqa: PLC0415 - the parent does not need it

    makers: dict[str, tuple[Callable[[], Sequence[Any]], Callable[[Any], str | None]]] = {
        "commands": (lambda: command_cases(folder / "files"), run_command),
        "files": (lambda: mutated.cases(folder, MUTATIONS), lambda case: run_file(case, folder)),
        "api": (api_cases, run_api),
        "plain": (plain_calls, run_plain),
    }
    make, run = makers[kind]
    cases = make()
    stub_long_work()
    print(json.dumps({"total": len(cases)}), file=channel, flush=True)
    warm = False
    for index in indices:
        if index >= len(cases):
            break
        case = cases[index]
        text = (
            str(case)
            if kind != "commands"
            else " ".join(word[:80].encode("unicode_escape").decode() for word in case)
        )
        print(json.dumps({"begin": index, "case": text}), file=channel, flush=True)
        if str(case).startswith("journal") and not warm:
            warm = (
                run_command(replace(case, seed=None).words(folder)) is None
            )  # its first table hashes the code
        start = time.monotonic()
        try:
            why = run(case)
        except BaseException as error:
            why = _trace(error)
        took = time.monotonic() - start
        if why is None and took > LIMIT and kind != "plain" and getattr(case, "seed", 0) is not None:
            why = f"took {took:.1f} s"
        print(json.dumps({"end": index, "why": why, "took": took}), file=channel, flush=True)


def fuzz(
    kind: str, indices: Sequence[int], report: Callable[[Failure], None] | None = None
) -> tuple[int, list[Failure]]:
    """Run cases in workers.

    Args:
        kind: "commands", "api", or "plain": calls of "api" with valid arguments alone.
        indices: Numbers of the cases.
        report: Called with every failure.

    Returns:
        Number of cases run, and the failures.
    """
    left = list(indices)
    failures: list[Failure] = []
    done = 0

    def failed(case: str, why: str) -> None:
        failures.append(Failure(case, why))
        if report is not None:
            report(failures[-1])

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "files").mkdir()
        while left:
            process = subprocess.Popen(
                [sys.executable, __file__, "worker", kind],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "FUZZ_FOLDER": folder, "OMP_NUM_THREADS": "1"},
                text=True,
            )
            assert process.stdin is not None and process.stdout is not None
            process.stdin.write(json.dumps(left))
            process.stdin.close()
            lines: queue.Queue[str] = queue.Queue()
            pump = threading.Thread(target=_pump, args=(process.stdout, lines), daemon=True)
            pump.start()
            begun, case = None, ""
            patience = 120.0
            while True:
                try:
                    line = lines.get(timeout=patience)
                except queue.Empty:
                    line = "hang"
                if line in ("", "hang"):
                    process.send_signal(signal.SIGKILL)
                    process.wait()
                    pump.join()
                    process.stdout.close()
                    if begun is not None:
                        failed(case, "never ends" if line else f"the process died ({process.returncode})")
                        left = left[left.index(begun) + 1 :]
                        done += 1
                    elif line:
                        raise RuntimeError("the worker did not start")
                    else:
                        left = []
                    break
                data = json.loads(line)
                if "begin" in data:
                    begun, case, patience = (
                        data["begin"],
                        data["case"],
                        patience if kind == "plain" else 4.0 * LIMIT,
                    )
                elif "end" in data:
                    done += 1
                    if data["why"] is not None:
                        failed(case, data["why"])
                    begun = None
    return done, failures


def _pump(stream: Any, lines: queue.Queue[str]) -> None:
    for line in stream:
        lines.put(line)
    lines.put("")


if __name__ == "__main__":
    if sys.argv[1] == "worker":
        worker(sys.argv[2], json.load(sys.stdin))
    else:
        first, last, step = (*map(int, sys.argv[2:]), *(0, 10**6, 1)[len(sys.argv) - 2 :])
        ran, bad = fuzz(
            sys.argv[1],
            range(first, last, step),
            lambda failure: print(f"{failure.case}\n    {failure.why}", flush=True),
        )
        print(f"{len(bad)} of {ran} failed")
