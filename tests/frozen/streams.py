"""Command streams of short runs, as hashes: what a change of the house must not change.

    python tests/frozen/streams.py            # write streams.json anew, after a change that is meant
    python tests/frozen/streams.py walk       # show which runs whose name begins so differ, and from which tick on

Each run steps a plant; every command on the way to its drives goes into a hash, block by block, so that the first block
that differs tells when. On another processor sums are rounded otherwise: there only the first second is compared, by a
sample of values.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import math
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, fields
from importlib import metadata
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from made_motions import make_motion

from wbc import Plant, __version__, load_robot
from wbc.core.signals import Command
from wbc.motion import make_feasible
from wbc.sim import FootTest, Machine, TrackSpec, WalkPush, press, stand, track_motion, walk
from wbc.sim.balance.push_recovery import recovers
from wbc.sim.balance.standing import StandSpec

FILE = Path(__file__).with_name("streams.json")
BLOCK = 100
"""Commands in a block, which has a hash of its own."""

SAMPLED = (0, 1, 10, 50, 100, 150, 199)
"""Ticks whose joint commands are stored as numbers: within the first second at 5 ms."""

STONES = {"terrain": "stones", "amplitude": 0.02, "terrain_params": {"start": 0.1, "ramp": 0.0}}
STAIRS = {
    "terrain": "steps",
    "amplitude": 0.06,
    "terrain_params": {"riser": 0.03, "tread": 0.25, "direction": "up", "start": 0.25, "length": 0.27},
}
DRIVE = ((0.0, 0.2, 0.0, 0.0), (1.5, 0.1, 0.05, 0.3), (3.0, 0.0, 0.0, 0.0))
PUSH = WalkPush(time=2.0, impulse=0.1, direction=1.2)


class EnoughError(Exception):
    """Ends a run of which only the beginning is wanted."""


@contextmanager
def recorded(most: float) -> Iterator[list[Command]]:
    """Give the list of all commands that plants get meanwhile; a number of them ends the run."""
    commands: list[Command] = []
    step = Plant.step

    @functools.wraps(step)
    def record(plant: Plant, command: Command) -> None:
        if len(commands) >= most:
            raise EnoughError
        commands.append(command)
        step(plant, command)

    Plant.step = record  # type: ignore[method-assign]
    try:
        yield commands
    finally:
        Plant.step = step  # type: ignore[method-assign]


def runs() -> dict[str, Callable[[], Any]]:
    """Return what is run, by name."""
    cases: dict[str, Callable[[], Any]] = {}
    for robot in ("hrp4_class", "talos", "g1"):
        common = {"robot": robot, "seed": 3}
        cases |= {
            f"stand {robot}": functools.partial(stand, robot=robot, seconds=1.0, seed=3, noise="realistic"),
            f"walk {robot} flat": functools.partial(walk, **common, distance=0.3),
            f"walk {robot} stones": functools.partial(
                walk, **common, foot="variable", **STONES, distance=0.6
            ),
            f"walk {robot} steered": functools.partial(walk, **common, drive=DRIVE, pushes=[PUSH]),
            f"walk {robot} torque": functools.partial(walk, **common, mode="torque", distance=0.2),
            f"walk {robot} hybrid": functools.partial(walk, **common, mode="hybrid", distance=0.2),
            f"walk {robot} stepping": functools.partial(
                walk, **common, **STONES, law="stepping", distance=0.5
            ),
        }
    soft = {"foot": "soft", "stiffness": 20.0, "seed": 4}
    return cases | {
        "walk stairs": functools.partial(walk, **STAIRS, stairs="together"),
        "walk without force sensors": functools.partial(
            walk, **soft, machine=Machine(force_sensors=False), distance=0.3
        ),
        "walk legacy": functools.partial(walk, **soft, **STONES, gains="no_bias", distance=0.4),
        "stand pushed": lambda: recovers(
            StandSpec(mode="torque", seconds=4.6), WalkPush(time=0.5, impulse=0.2, direction=0.5)
        ),
        "carry": _carry,
        "press": lambda: _of_hands("press").main(["--on", "rail", "--force", "40", "--hold", "0.5"]),
        "cart": lambda: _of_hands("cart").main(
            ["--forward", "0.1", "--turn", "10", "--back", "0", "--corrections", "0"]
        ),
        "motion": _motion,
        **{f"clip {name}": functools.partial(_clip, name) for name in ("squat", "one_leg", "steps", "waist")},
        "foot pressed": lambda: press(FootTest()),
        "stand torque": functools.partial(stand, mode="torque", seconds=1.0, seed=3, noise="realistic"),
    }


def _of_hands(name: str) -> Any:
    """Return a module of the examples of hands."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "hands"))
    return importlib.import_module(name)


def _carry() -> Any:
    """Run the example that is handed a load, for a step."""
    angles = (-0.7816186898784364, 0.13222536818187688, -0.013848294512559645, -0.829715253239616)
    arms = {"hrp4_class": ((*angles, -9.911958910933055e-18), (1, -1, -1, 1, -1))}
    with patch.dict(_of_hands("_hands").ARMS, arms):
        return _of_hands("carry").main(["--share", "0.1", "--over", "0.5", "--steps", "1", "--end", "keep"])


def _motion() -> Any:
    """Track the first second and a half of a clip on g1."""
    robot = load_robot("g1").robot()
    clip = make_feasible(robot, make_motion(robot, "steps", 1)).clip
    return track_motion(clip.sampled(clip.times[:180], clip.rate), TrackSpec(after=0.2))


def _clip(name: str) -> list[Command]:
    """Make a clip; its frames stand for commands."""
    return [Command(frame) for frame in make_motion(load_robot("g1").robot(), name, 1).joints[::5]]


def stream(commands: list[Command]) -> dict[str, Any]:
    """Return hashes of blocks of commands, and a sample of their values."""
    hashes = []
    for first in range(0, len(commands), BLOCK):
        digest = hashlib.sha256()
        for command in commands[first : first + BLOCK]:
            for part in fields(command):
                value = getattr(command, part.name)
                digest.update(b"-" if value is None else np.ascontiguousarray(value, dtype=float).tobytes())
        hashes.append(digest.hexdigest()[:16])
    sample = {}
    for tick in SAMPLED:
        if tick < len(commands):
            command = commands[tick]
            value = command.joint_torque if command.joint_position is None else command.joint_position
            sample[str(tick)] = [float(f"{number:.13g}") for number in value[::5]]
    return {"commands": len(commands), "hashes": hashes, "sample": sample}


def processor() -> str:
    """Return what decides how sums are rounded: processor, kernels of the linear algebra, versions of the libraries."""
    from threadpoolctl import threadpool_info  # type: ignore[import-untyped]  # noqa: PLC0415

    kernels = sorted({str(pool.get("architecture", "")) for pool in threadpool_info()} - {""})
    versions = [
        f"{name} {metadata.version(name)}" for name in ("numpy", "pin", "mujoco", "daqp", "proxsuite")
    ]
    return " ".join([platform.machine(), *kernels, *versions])


def _numbers(value: Any) -> Iterator[float]:
    """Give all numbers in nested dictionaries and sequences."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple, np.ndarray)):
        for part in value:
            yield from _numbers(part)
    elif isinstance(value, (int, float)):
        yield float(value)


def run(name: str, most: float = math.inf) -> dict[str, Any]:
    """Return the stream of a run, or of its first commands."""
    result: Any = None
    with recorded(most) as commands, suppress(EnoughError):
        result = runs()[name]()
    if commands or isinstance(result, list):
        return stream(commands or result)
    numbers = list(_numbers(asdict(result)))  # a rig has no commands: its figures instead
    return stream([Command(np.array(numbers))])


def main(arguments: list[str]) -> int:
    """Write the file, or compare with it."""
    chosen = [name for name in runs() if not arguments or name.startswith(" ".join(arguments))]
    stored = json.loads(FILE.read_text()) if FILE.exists() else {"streams": {}}
    now = {}
    for name in chosen:
        now[name] = found = run(name)
        before = stored["streams"].get(name)
        if before is None or before["hashes"] == found["hashes"]:
            print(f"{name}: {'new' if before is None else 'the same'}, {found['commands']} commands")
            continue
        pairs = zip(before["hashes"], found["hashes"], strict=False)
        same = next(
            (i for i, (a, b) in enumerate(pairs) if a != b), min(len(before["hashes"]), len(found["hashes"]))
        )
        print(f"{name}: differs after command {BLOCK * same}")
    if not arguments:
        data = {"processor": processor(), "version": __version__, "streams": now}
        FILE.write_text(
            json.dumps(data, indent=None, separators=(",", ":")).replace('"walk', '\n"walk') + "\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
