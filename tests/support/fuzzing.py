"""Hostile input for every option of every command and every parameter of the public packages, drawn by hypothesis.

A place is a command line with a hole, or a parameter of a public function whose other arguments are valid. What is
drawn for it must end in a result or in a refusal, within bounded memory and time; long work that legal values begin is
replaced by `Accepted`. `tests/app/test_fuzz.py` draws.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import inspect
import io
import json
import logging
import math
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, get_args, get_origin

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

import wbc
from wbc import feet, sim, tasks, walking
from wbc.app import cli
from wbc.app.commands import COMMANDS
from wbc.core.changes import setting_names
from wbc.core.errors import WbcError
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.sim.balance.standing import StandSpec
from wbc.sim.studies.study import Cell
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.spec import Terrain
from wbc.sim.walks.settings import TrialSettings

MEMORY = 8 * 2**30
"""Address space, bytes."""

LIMIT = 5.0
"""Longest processor time of a case, s; as slow as twelve times that on a busy machine."""

PACKAGES = ("wbc", "wbc.tasks", "wbc.robots", "wbc.feet", "wbc.walking", "wbc.sim")

BASE: dict[str, list[str]] = {
    "stand": ["--seconds", "0.05"],
    "walk": ["--distance", "0.1"],
    "bench tick": ["--ticks", "5", "--warm-up", "1"],
    "foot": ["press", "--foot", "rigid"],
    "bench solver": ["--ticks", "5", "--repeat", "1", "--robot", "hrp4_class"],
    "terrain": ["stones"],
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
    "wbc.sim.balance.tracking:TrackTrial.run",
    "wbc.app.commands.stiffness:learning_curve",
    "wbc.feet.stiffness.comparison:cross_validate",
    "wbc.machine.conformance:Session",
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


def _accept(*_: Any, **__: Any) -> Any:
    raise Accepted


@contextlib.contextmanager
def bounded(folder: Path) -> Iterator[Path]:
    """Work in a folder, with bounded memory and without the long work; warnings and the log are silent."""
    memory = resource.getrlimit(resource.RLIMIT_AS)
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        patch.chdir(folder)
        for place in STUBS:
            module, _, path = place.partition(":")
            owner: Any = importlib.import_module(module)
            *parents, name = path.split(".")
            for parent in parents:
                owner = getattr(owner, parent)
            patch.setattr(owner, name, _accept)
        logging.disable(logging.CRITICAL)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, memory[1]))
        try:
            yield folder
        finally:
            resource.setrlimit(resource.RLIMIT_AS, memory)
            logging.disable(logging.NOTSET)


@contextlib.contextmanager
def _in_time() -> Iterator[None]:
    """Raise `TimeoutError` in what takes too long."""

    def late(*_: Any) -> None:
        raise TimeoutError("never ends")

    signals = {
        signal.SIGPROF: (signal.ITIMER_PROF, LIMIT),
        signal.SIGALRM: (signal.ITIMER_REAL, 12.0 * LIMIT),
    }
    before = {number: signal.signal(number, late) for number in signals}
    for timer, seconds in signals.values():
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for timer, _ in signals.values():
            signal.setitimer(timer, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


# ---- command lines --------------------------------------------------------------------------------------------------

HOLE = "<?>"
"""Place that a drawn word takes."""

WORDS = st.sampled_from(
    ("-1", "0", "1", "1e300", "1e-300", "nan", "inf", "-inf", "1e9", "0.5", "text", "", " ", "x" * 10_000)
    + ("\ud800", "a\0b", "1" * 5000, "none", "-5e-324", "1_000", "٣", "../..", "1,2,3", "=", "a=", "=1")
) | st.text(max_size=20)
PAIRS = WORDS | st.sampled_from(("nothing=1", "no_value", "seed=nan"))
NUMBERS = st.sampled_from(
    ("-1", "0", "1e300", "1e-300", "nan", "inf", "1e9", "0.5", "text", "none", "true", "1,2")
)


class Line(NamedTuple):
    """A command line with a hole, and what may be drawn for it."""

    words: list[str]
    drawn: st.SearchStrategy[str]

    def filled(self, word: str) -> list[str]:
        """Return the command line with a word in its hole."""
        return [part.replace(HOLE, word) for part in self.words]


def hostile_files(folder: Path) -> list[str]:
    """Write files that no command can use, and return their paths and some that do not exist."""
    deep = "[" * 100_000
    texts = {
        "empty": b"",
        "text": b"hello\n",
        "binary": bytes(range(256)),
        "deep.json": deep.encode(),
        "list.json": b"[1, 2]",
        "spec_list.json": b'{"spec": [1, 2]}',
        "surrogate.json": b'{"name": "\\ud800", "robot": "\\ud800"}',
        "nan.json": b'{"seed": NaN, "amplitude": Infinity}',
        "study.json": b'{"name": "\\ud800", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": [1]}',
        "seeds.json": b'{"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": {"first": 1, "count": 999999999999}}',  # noqa: E501
        "robot.json": b'{"name": "s", "cells": {"a": {"robot": "nobody"}}, "arms": {"b": {}}, "seeds": [1]}',
        "deep.toml": b"a = " + deep.encode(),
        "types.toml": b"seed = []\nrobot = 1\n[gait]\na = 1\n",
        "deep.jsonl": deep.encode() + b"\n",
        "lines.jsonl": b"1\nnull\n[]\n{}\n",
        "text.npz": b"hello",
        "text.arrow": b"hello",
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


def command_lines(folder: Path) -> list[Line]:
    """Return lines with a hole for every option of every command, parameter of grounds and feet, and setting."""
    files = st.sampled_from(hostile_files(folder))
    study = folder / "good_study.json"
    study.write_text(json.dumps(STUDY))
    (folder / "old.jsonl").write_bytes(b"")
    app = cli.make_app(None)
    lines: list[Line] = []
    for words in COMMANDS:
        command = app
        for word in words.split():
            command = command[word]
        base = [part.format(dir=folder, study=study) for part in BASE.get(words, [])]
        for argument in command.assemble_argument_collection():
            name, kinds = argument.name, (argument.hint, *get_args(argument.hint))
            nested = any(isinstance(k, type) and hasattr(k, "__settings__") for k in kinds)
            if name == "*" or not argument.parse or nested or bool in kinds or name in NOT_DRAWN:
                continue
            drawn = PAIRS if str in kinds and get_origin(argument.hint) is tuple else WORDS
            if Path in kinds or name in ("STUDY", "WORDS", "LOG", "--name", "--set") or "param" in name:
                drawn |= files
            if name.startswith("-"):
                lines.append(Line([*words.split(), *_without(base, name, words), f"{name}={HOLE}"], drawn))
            else:
                before = base[1:] if base and not base[0].startswith("-") else base
                lines.append(Line([*words.split(), HOLE, *before], drawn))
    return [*lines, *_parameters(files)]


NOT_DRAWN = ("--json", "--verbose", "--view", "--host", "--cluster")


def _without(base: Sequence[str], name: str, words: str) -> list[str]:
    """Return the other arguments of a command without an option and its value."""
    if words == "walk" and name in ("--spec", "--velocity", "--steps", "--turn", "--stairs"):
        return []
    return [word for i, word in enumerate(base) if word != name and (i == 0 or base[i - 1] != name)]


def _parameters(files: st.SearchStrategy[str]) -> Iterator[Line]:
    """Lines for what stands behind `--param`, `--foot-param`, `--set` and `--push`."""
    for name, kind in terrain_families().items():
        for field in dataclasses.fields(kind):
            drawn = NUMBERS | files if field.name in ("path", "file", "image", "source") else NUMBERS
            yield Line(["terrain", name, "--param", f"{field.name}={HOLE}"], drawn)
        for option in ("amplitude", "length", "width", "resolution", "sole-radius"):
            yield Line(["terrain", name, f"--{option}={HOLE}"], NUMBERS)
    walk = ["walk", *BASE["walk"]]
    for start in (walk, ["foot", "press"]):
        for field in dataclasses.fields(VariableStiffnessFoot):
            yield Line([*start, "--foot", "variable", "--foot-param", f"{field.name}={HOLE}"], NUMBERS)
    for name in setting_names(TrialSettings()):
        yield Line([*walk, "--set", f"{name}={HOLE}"], NUMBERS)
    for name in ("direction", "duration", "body", "time", "step", "phase"):
        yield Line([*walk, "--push", f"impulse=0.1,{name}={HOLE}"], NUMBERS)


def run_command(words: list[str], *, refusable: bool = True) -> str | None:
    """Run a command line; return why it failed, None if it ended as it should."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with _in_time(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = cli.main(words)
    except Accepted:
        return None
    lines = err.getvalue().strip().splitlines()
    if "Traceback" in err.getvalue():
        return "traceback: " + " | ".join(line.strip() for line in lines[-6:])[-600:]
    if code == 0:
        return None if out.getvalue().strip() else "silence"
    said = [line for line in lines if line.startswith("wbc: ")]
    if code not in (1, 2) or not refusable or len(said) != 1 or not 12 <= len(said[0]) <= 1500:
        return f"exit {code}: {lines[-3:]}"
    if code == 1 and "diverged" not in said[0] and "journal" not in said[0]:
        return f"exit 1: {said[0][:300]}"
    return None


# ---- the Python API -------------------------------------------------------------------------------------------------


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


class Odd:
    """An object of a foreign class."""


ODD: dict[str, Callable[[], Any]] = {
    "object": Odd,
    "class": lambda: Odd,
    "function": lambda: _wrong,
    "recursive": _recursive,
    "deep": _deep,
    "complex": lambda: 1j,
    "set": lambda: {1, 2},
    "path": lambda: Path("/nowhere"),
    "folder": lambda: Path("/"),
    "long": lambda: "x" * 100_000,
    "array of texts": lambda: np.array(["a"]),
    "array of objects": lambda: np.array([None, {}], dtype=object),
    "float32": lambda: np.float32(1.0),
}
"""Values that are made in the call: some have no end that could be printed."""


class Made(NamedTuple):
    """One of the odd values."""

    name: str


FLOATS = st.sampled_from((math.nan, math.inf, -math.inf, 1e300, 1e-300, -1.0, 0.0, 0.5)) | st.floats(
    -1.0, 1.0
)
SCALARS = (
    *(st.none(), st.booleans(), FLOATS, st.integers(-3, 3), st.sampled_from((10**9, 10**400))),
    *(st.text(max_size=5), st.sampled_from(("text", "\ud800", "a\0b")), st.binary(max_size=3)),
)
HOSTILE = st.one_of(
    *SCALARS,
    st.lists(st.one_of(*SCALARS), max_size=4) | st.lists(st.lists(FLOATS, max_size=3), max_size=3),
    st.dictionaries(st.text(max_size=5) | st.integers(), st.one_of(*SCALARS), max_size=2),
    st_numpy.arrays(
        float, st_numpy.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=7), elements=FLOATS
    ),
    st.builds(Made, st.sampled_from(sorted(ODD))),
)
"""Parameter → value that is given to it."""


@cache
def _description() -> Any:
    return wbc.load_robot("hrp4_class")


def _plan() -> Any:
    from wbc.walking import Footstep, FootstepPlan, Gait  # noqa: PLC0415

    return FootstepPlan(Footstep("left", 0.0, 0.1), Footstep("right", 0.0, -0.1), (), Gait())


def _made(target: Any, name: str) -> Any:
    """Return a value of the class that a parameter asks for, where the class has defaults for all; None otherwise."""
    hint = inspect.signature(target, eval_str=True).parameters[name].annotation
    if get_origin(hint) is Mapping:
        return {}
    parameters = inspect.signature(hint).parameters.values() if dataclasses.is_dataclass(hint) else ()
    return hint() if parameters and all(p.default is not p.empty for p in parameters) else None


PLAIN: dict[str, Any] = {
    **dict.fromkeys(("dt", "period"), 0.005),
    **dict.fromkeys(("time", "ground"), 0.0),
    **dict.fromkeys(("distance", "angle", "duration"), 0.5),
    **dict.fromkeys(("rise", "min_height", "amplitude"), 0.02),
    **dict.fromkeys(("tread", "first_edge", "length"), 0.2),
    **dict.fromkeys(("width", "y", "impulse"), 0.1),
    **dict.fromkeys(("every", "clearance"), 0.05),
    **{"timestep": 0.001, "height": 0.8, "com_height": 0.75, "mass": 40.0, "weight": 400.0, "omega": 3.5},
    **{"step": 0.01, "corner": 3.0, "ankle_behind": 0.03, "dim": 3, "steps": 3, "count": 2, "seeds": (100,)},
    **{"frame": "left_sole", "reference": "right_sole", "contact": "left_foot", "side": "left"},
    **{"link": "left_ankle_link", "axes": None, "spec": None, "edges": (0.1, 0.05)},
    **{"velocity": (0.1, 0.0, 0.0), "sizes": ((0.2, 0.1), (0.2, 0.1))},
}
"""Parameter without default → value that any function can use."""


def valid(target: Any, name: str, package: str) -> Any:
    """Return a usable value for a parameter without default, by function and name; None when unknown."""
    from wbc.feet.soles.sole import SoleGeometry  # noqa: PLC0415

    makers: dict[str, Callable[[], Any]] = {
        "description": _description,
        "robot": lambda: _description().robot(),
        "controller": lambda: wbc.balance_controller(_description().robot(), 0.005),
        "sole": (lambda: "left_foot")
        if package != "wbc.feet"
        else (lambda: SoleGeometry.under_ankle(0.1, 0.16, 0.08)),
        "admittance": lambda: np.full(6, 1e-3),
        "name": lambda: (
            "soft" if package == "wbc.feet" else "stones" if package == "wbc.sim" else "hrp4_class"
        ),
        "start": _plan,
        "plan": _plan,
        "moves": lambda: [(0.1, 0.0, 0.0)],
        "com": lambda: np.array([0.0, 0.0, 0.8]),
        "com_velocity": lambda: np.zeros(3),
        "wrench": lambda: np.array([0.0, 0.0, 400.0, 0.0, 0.0, 0.0]),
        "wrenches": lambda: np.tile([0.0, 0.0, 200.0, 0.0, 0.0, 0.0], (2, 1)),
        "design": lambda: feet.foot("soft"),
        "foot": lambda: feet.foot("variable"),
        "policy": tasks.FixedPolicy,
        "z": lambda: np.sin(np.arange(100.0)),
        "x": (lambda: np.arange(100.0) * 0.01) if package == "wbc.feet" else (lambda: 0.0),
        "values": lambda: np.random.default_rng(0).normal(size=(50, 17)),
        "terrain": lambda: sim.make_terrain("stones"),
        "test": lambda: sim.FootTest(foot=feet.foot("rigid"), settle=0.02, hold=0.02),
        "plant": lambda: sim.Plant(_description()),
        "cells": lambda: (Cell("flat", {"terrain": "flat"}),),
        "arms": lambda: {"flat": {"foot": "flat"}},
        "gait": walking.Gait,
        "left": lambda: walking.Footstep("left", 0.0, 0.1),
        "right": lambda: walking.Footstep("right", 0.0, -0.1),
        "landing": lambda: walking.Footstep("left", 0.2, 0.1),
        "parameters": lambda: sim.make_terrain("stones").parameters,
        "estimate": lambda: _description().robot(),
        "posture": wbc.PostureTask,
    }
    if name in PLAIN:
        return PLAIN[name]
    maker = makers.get(name)
    return _made(target, name) if maker is None else maker()


class SilentDriver:
    """A machine that says nothing."""

    def __init__(self) -> None:
        self.description = _description()

    def read(self, timeout: float) -> None:
        """Return no measurement."""

    def write(self, command: Any) -> None:
        """Take a command."""

    def damp(self) -> None:
        """Take the end."""


def own_values(function: str) -> dict[str, Any]:
    """Return usable values for parameters of one function, where those of `valid` do not fit."""
    import pinocchio as pin  # noqa: PLC0415

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
        "velocity_from_mujoco": lambda: {"q": _description().robot().half_sitting, "qvel": np.zeros(40)},
        "velocity_to_mujoco": lambda: {"q": _description().robot().half_sitting, "v": np.zeros(40)},
        "FootstepPlan": lambda: {"steps": (walking.Footstep("left", 0.2, 0.1),)},
        "conformance": lambda: {"loop": sim.Plant(_description())},
        "check_task": lambda: {"task": wbc.CoMTask()},
        "run": lambda: {
            "driver": SilentDriver(),
            "control": wbc.TorqueControl(wbc.balance_controller(_description().robot(), 0.002)),
        },
        "StiffnessDecision": lambda: {"stiffness": 5.0},
        "StabilizerTask": lambda: {"contacts": (wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))},
        "configuration_from_mujoco": lambda: {"qpos": _description().robot().half_sitting},
        "configuration_to_mujoco": lambda: {"q": _description().robot().half_sitting},
        "WalkingControl": lambda: {"source": walking.FootstepPlan.standing(_description().robot())},
        "Trajectory": lambda: {"points": [[0.0], [1.0]], "duration": 1.0},
        "StateMachine": lambda: {"states": [wbc.tasks.Behaviour("hold", timeout=0.1)]},
        "Program": lambda: {
            "machine": wbc.tasks.StateMachine("program", [wbc.tasks.Behaviour("hold", timeout=0.1)]),
            "control": wbc.balance_controller(_description().robot(), 0.005),
        },
        "read_state_machine": lambda: {
            "source": {"state": [{"name": "hold", "timeout": 0.1}]},
            "control": wbc.balance_controller(_description().robot(), 0.005),
        },
        "after": lambda: {"seconds": 1.0},
        "error_below": lambda: {"thing": wbc.CoMTask(), "bound": 0.1},
        "speed_below": lambda: {"thing": wbc.CoMTask(), "bound": 0.1},
        "SharedPlant": lambda: {"robots": {"one": _description()}},
        "Cell": lambda: {"values": {"terrain": "flat"}},
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
        "WalkTrial": lambda: {"spec": sim.WalkSpec()},
        "track_motion": lambda: {"clip": _clip()},
        "WalkPush": lambda: {"time": 1.0},
        "bar": lambda: {"yaw": 0.1, "top": 0.01},
        "dome": lambda: {"radius": 0.05, "top": 0.01},
        "plate": lambda: {"size": (0.1, 0.1), "top": 0.01},
        "stone": lambda: {"semi_axes": (0.05, 0.03), "top": 0.01, "yaw": 0.1},
        "press": lambda: {"support": False},
        "make_scene": lambda: {"name": "box"},
        "Journal": lambda: {"path": _new_journal()},
        "read_journal": lambda: {"path": sim.Journal(_new_journal()).path},
        "cluster_executor": lambda: {"address": "local"},
        "study_table": lambda: {"study": sim.Study.from_json(STUDY), "entries": {}},
        "sweep": lambda: {"specs": [sim.WalkSpec()], "journal": sim.Journal(_new_journal())},
    }
    table = {"table": _stiffness_table()} if function == "cross_validate" else {}
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
    from wbc.motion import MotionClip  # noqa: PLC0415

    robot = wbc.load_robot("g1").robot()
    q = np.tile(robot.half_sitting, (3, 1))
    return MotionClip(robot.joint_names, 30.0, q[:, :7], q[:, 7:])


SKIP = {
    # They register: what is registered stays.
    "register", "register_foot", "register_stiffness_policy", "family", "register_trial",
    # A decorator of classes.
    "settings",
    # It takes at least one thing, by its place.
    "reached",
}  # fmt: skip


class Place(NamedTuple):
    """A parameter of a public function; of no function's parameter where it is empty: then all arguments are valid."""

    package: str
    function: str
    parameter: str = ""


def places() -> list[Place]:
    """Return every parameter of every public constructor and function."""
    found: list[Place] = []
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
            with contextlib.suppress(ValueError):
                for parameter in inspect.signature(target).parameters.values():
                    several = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
                    if not several or parameter.name not in ("args", "hooks", "options", "values"):
                        found.append(Place(package, name, parameter.name))
    for option in ("weight", "stiffness", "damping", "name", "hard", "offset"):
        for task in ("CoMTask", "PoseTask", "PostureTask", "WrenchTask", "ImpedanceTask"):
            found.append(Place("wbc.tasks", task, option))
    for parameter in inspect.signature(wbc.RobotDescription.from_urdf).parameters:
        found.append(Place("wbc", "RobotDescription.from_urdf", parameter))
    for name, spec in (("stand", StandSpec), ("walk", sim.WalkSpec)):
        found += [Place("wbc", name, parameter) for parameter in inspect.signature(spec).parameters]
    return found


def call(place: Place, value: Any = None) -> str | None:
    """Make a call and use its result; return why it failed, None for a result, a refusal or the begin of long work."""
    target: Any = importlib.import_module(place.package)
    for part in place.function.split("."):
        target = getattr(target, part)
    refusals: tuple[type[BaseException], ...] = (Accepted, WbcError) if place.parameter else (Accepted,)
    try:
        with _in_time():
            arguments = _valid_arguments(place, target)
            if place.parameter:
                arguments[place.parameter] = ODD[value.name]() if isinstance(value, Made) else value
            _use(target(**arguments))
    except refusals:
        return None
    except TypeError as error:
        return None if place.parameter and "unexpected keyword argument" in str(error) else _trace(error)
    except Exception as error:
        return _trace(error)
    return None


def _valid_arguments(place: Place, target: Any) -> dict[str, Any]:
    match place.function:
        case "RobotDescription.from_urdf":
            left, right = _description().soles
            return {"source": _description().urdf, "left_sole": left, "right_sole": right}
        case "stand":
            return {"seconds": 0.02}
        case "walk":
            return {"plan": sim.WalkPlan(distance=0.1)}
    arguments = own_values(place.function)
    for parameter in inspect.signature(target).parameters.values():
        several = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        if parameter.default is parameter.empty and not several and parameter.name not in arguments:
            arguments[parameter.name] = valid(target, parameter.name, place.package)
    return arguments


def _use(result: Any) -> None:
    """Use what was made: a task in a controller, a ground's heights."""
    kinds = (wbc.MotionTask, wbc.SoleContact, wbc.PointContact, wbc.JointLimits, wbc.TorqueLimits)
    if isinstance(result, kinds):
        alone = ("MotionTask", "SelectionTask", "VariableTask", "FrameTask", "StabilizerTask")
        if type(result).__name__ in alone:  # bases, and one that needs its contacts beside it
            return
        controller = wbc.Controller(_description().robot(), 0.005)
        controller.add(result)
        controller.solve()
    if isinstance(result, Terrain):
        result.height(0.5, 0.0)


def _trace(error: BaseException) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {str(error)[:200]} ({where.filename}:{where.lineno})"
