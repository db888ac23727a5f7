"""Runs of all kinds of controllers: they end as they should, and the same run gives the same commands, bit for bit.

Bits are compared between two runs on the machine of the test; none are stored, since processors round sums differently.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from made_motions import make_motion

from wbc import Plant, load_robot
from wbc.core.signals import Command
from wbc.motion import make_feasible
from wbc.sim import FootTest, Machine, TrackSpec, WalkPush, press, stand, track_motion, walk
from wbc.sim.balance.standing import StandSpec, recovers

STONES = {"terrain": "stones", "amplitude": 0.02, "terrain_params": {"start": 0.1, "ramp": 0.0}}
STAIRS = {
    "terrain": "steps",
    "amplitude": 0.06,
    "terrain_params": {"riser": 0.03, "tread": 0.25, "direction": "up", "start": 0.25, "length": 0.27},
}
DRIVE = ((0.0, 0.2, 0.0, 0.0), (1.5, 0.1, 0.05, 0.3), (3.0, 0.0, 0.0, 0.0))
PUSH = WalkPush(time=2.0, impulse=0.1, direction=1.2)

BEGINNINGS = {"stand hrp4_class": 20, "walk hrp4_class stones": 60, "walk g1 free": 60}
"""Runs of which the beginning is made in another process, too, and how many commands of it."""

SUPPORT = str(Path(__file__).parents[1] / "support")


class EnoughError(Exception):
    """Ends a run of which only the beginning is wanted."""


@contextmanager
def recorded(most: float = math.inf) -> Iterator[list[Command]]:
    """Give the list of all commands that plants get meanwhile; a number of them ends the run."""
    commands: list[Command] = []
    step = Plant.step

    @functools.wraps(step)
    def record(plant: Plant, command: Command) -> None:
        if len(commands) >= most:
            raise EnoughError
        commands.append(command)
        step(plant, command)

    with patch.object(Plant, "step", record), suppress(EnoughError):
        yield commands


def walks() -> dict[str, Callable[[], Any]]:
    """Return runs that end with an outcome, by name."""
    cases: dict[str, Callable[[], Any]] = {}
    for robot in ("hrp4_class", "talos", "g1"):
        common = {"robot": robot, "seed": 3}
        soft = {**common, "foot": "variable", **STONES}
        cases |= {
            f"stand {robot}": functools.partial(stand, robot=robot, seconds=1.0, seed=3, noise="realistic"),
            f"walk {robot} flat": functools.partial(walk, **common, distance=0.3),
            f"walk {robot} stones": functools.partial(walk, **soft, distance=0.6),
            f"walk {robot} steered": functools.partial(walk, **common, drive=DRIVE, pushes=[PUSH]),
            f"walk {robot} torque": functools.partial(walk, **common, mode="torque", distance=0.2),
            f"walk {robot} hybrid": functools.partial(walk, **common, mode="hybrid", distance=0.2),
            f"walk {robot} free": functools.partial(walk, **common, **STONES, mode="torque", distance=0.5),
        }
    soft = {"foot": "soft", "stiffness": 20.0, "seed": 4}
    return cases | {
        "walk stairs": functools.partial(walk, **STAIRS, stairs="together"),
        "walk without force sensors": functools.partial(
            walk, **soft, machine=Machine(force_sensors=False), distance=0.3
        ),
        "stand torque": functools.partial(stand, mode="torque", seconds=1.0, seed=3, noise="realistic"),
    }


def others() -> dict[str, Callable[[], Any]]:
    """Return runs of other kinds, by name; their own tests judge how they end."""
    return {
        "walk without bias": lambda: walk(
            robot="hrp4_class", seed=3, foot="variable", **STONES, gains="no_bias", distance=0.4
        ),  # this law falls on most of such stones
        "stand pushed": lambda: recovers(
            StandSpec(mode="torque", seconds=4.6), WalkPush(time=0.5, impulse=0.2, direction=0.5)
        ),
        "carry": carry,
        "press": lambda: example("press").main(["--on", "rail", "--force", "40", "--hold", "0.5"]),
        "cart": lambda: example("cart").main(
            ["--forward", "0.1", "--turn", "10", "--back", "0", "--corrections", "0"]
        ),
        "motion": motion,
    }


def example(name: str) -> Any:
    """Return a module of the examples of hands."""
    folder = str(Path(__file__).parents[2] / "examples" / "hands")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return importlib.import_module(name)


def carry() -> Any:
    """Run the example that is handed a load, for a step."""
    angles = (-0.7816186898784364, 0.13222526818187688, -0.013848294512559645, -0.829715253239616)
    arms = {"hrp4_class": ((*angles, -9.911958910933055e-18), (1, -1, -1, 1, -1))}
    with patch.dict(example("_hands").ARMS, arms):
        return example("carry").main(["--share", "0.1", "--over", "0.5", "--steps", "1", "--end", "keep"])


def motion() -> Any:
    """Track the first second and a half of a clip on g1."""
    robot = load_robot("g1").robot()
    clip = make_feasible(robot, make_motion(robot, "steps", 1)).clip
    return track_motion(clip.sampled(clip.times[:180], clip.rate), TrackSpec(after=0.2))


def digest(commands: list[Command]) -> str:
    """Return a hash of all numbers of commands."""
    whole = hashlib.sha256()
    for command in commands:
        for part in fields(command):
            value = getattr(command, part.name)
            whole.update(b"-" if value is None else np.ascontiguousarray(value, dtype=float).tobytes())
    return whole.hexdigest()


def beginning(name: str) -> str:
    """Return the hash of the first commands of a run."""
    with recorded(BEGINNINGS[name]) as commands:
        walks()[name]()
    assert len(commands) == BEGINNINGS[name]
    return digest(commands)


@pytest.mark.slow
def test_another_process_gives_the_same_commands_bit_for_bit() -> None:
    found = [beginning(name) for name in BEGINNINGS]
    assert len(set(found)) == len(found)
    path = os.pathsep.join(filter(None, (SUPPORT, os.environ.get("PYTHONPATH"))))
    again = subprocess.run(
        [sys.executable, __file__],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert again.stdout.split() == found


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", walks())
def test_every_kind_of_walk_ends_well_and_is_repeated_bit_for_bit(name: str) -> None:
    with recorded() as commands:
        result = walks()[name]()
    assert result.upright if name.startswith("stand") else result.outcome == "completed", result
    with recorded() as again:
        walks()[name]()
    assert commands
    assert digest(again) == digest(commands)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", others())
def test_every_other_kind_of_run_is_repeated_bit_for_bit(name: str) -> None:
    with recorded() as commands:
        others()[name]()
    with recorded() as again:
        others()[name]()
    assert commands
    assert digest(again) == digest(commands)


@pytest.mark.slow
def test_a_pressed_foot_is_repeated_bit_for_bit() -> None:
    assert press(FootTest()) == press(FootTest())


if __name__ == "__main__":
    print(*(beginning(name) for name in BEGINNINGS))
