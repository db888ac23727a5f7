"""Hostile command lines and files: a result, or one line that says what is wrong; no traceback, crash or hang."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import fuzzing
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_person import LAFAN1, person, write_bvh
from mjcf_biped import biped
from PIL import Image
from properties import examples
from recorded import recorded_stand

import wbc
from wbc.motion import MotionClip, write_motion
from wbc.sim import WalkSpec
from wbc.sim.studies.journal import Entry

pytestmark = pytest.mark.slow  # a process of its own, which imports the library

SOLE = """<link name="{side}_sole"/><joint name="{side}_fixed" type="fixed"><parent link="{side}_foot"/>
<child link="{side}_sole"/><origin xyz="0 0 -0.05"/></joint>"""
STUDY = {"name": "s", "cells": {"a": {"terrain": "flat"}}, "arms": {"b": {"foot": "soft"}}, "seeds": [1, 2]}


def write_valid(folder: Path) -> None:
    """Write a valid file of every kind that a command reads."""
    heights = np.random.default_rng(0).integers(0, 255, (6, 8)).astype(np.uint8)
    np.save(folder / "ground.npy", heights.astype(float))
    Image.fromarray(heights).save(folder / "ground.png")
    np.savetxt(folder / "ground.csv", heights, delimiter=",")
    robot = wbc.load_robot("g1").robot()
    q = np.tile(robot.half_sitting, (5, 1))
    people = {name: (place[:8], turn[:8]) for name, (place, turn) in person(30.0).items()}
    write_bvh(folder / "person.bvh", LAFAN1, people, 30.0)
    for name in ("motion.npz", "motion.csv"):
        write_motion(MotionClip(robot.joint_names, 30.0, q[:, :7], q[:, 7:]), folder / name)
    (folder / "walk.toml").write_text(
        'seed = 3\nfoot = "soft"\nterrain = "stones"\namplitude = 0.02\n'
        "[plan]\ndistance = 0.5\n[gait]\nswing_height = 0.06\n"
    )
    (folder / "robot.xml").write_text(xml := biped())
    (folder / "robot.toml").write_text('file = "robot.xml"\nname = "little"\nsole_size = [0.2, 0.1]\n')
    soles = "".join(SOLE.format(side=side) for side in ("left", "right"))
    (folder / "robot.urdf").write_text(
        wbc.RobotDescription.from_mjcf(xml).urdf.replace("</robot>", f"{soles}</robot>").replace("><", ">\n<")
    )
    recorded_stand(folder / "log.arrow", ticks=10)
    (folder / "study.json").write_text(json.dumps(STUDY, indent=1))
    entry = Entry(WalkSpec().to_json(), "done", {"steps_done": 3, "outcome": "fell"}, {}, None, {})
    (folder / "journal.jsonl").write_bytes(entry.line())
    (folder / "deep.json").write_text("[" * 100_000)
    (folder / "empty.json").write_bytes(b"")


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[fuzzing.Commands]:
    folder = tmp_path_factory.mktemp("fuzz")
    write_valid(folder)
    made = fuzzing.Commands(folder)
    yield made
    made.close()


@pytest.mark.long
def test_every_option_takes_hostile_words(commands: fuzzing.Commands) -> None:
    places = [(words, option) for words in fuzzing.COMMANDS for option in fuzzing.options(words)]
    assert len(places) > 100

    @examples(5000)
    @given(st.sampled_from(places), st.sampled_from(fuzzing.WORDS) | st.text(max_size=20))
    def ends_well(place: tuple[str, str], value: str) -> None:
        assert (why := commands(fuzzing.line(*place, value))) is None, why

    ends_well()


@pytest.mark.long
def test_every_reader_takes_damaged_files(commands: fuzzing.Commands) -> None:
    @examples(5000)
    @given(st.sampled_from(sorted(fuzzing.READERS)), st.integers(0, 10_000))
    def ends_well(name: str, seed: int) -> None:
        damaged = commands.folder / f"damaged_{name}"
        damaged.write_bytes(fuzzing.damaged(name, (commands.folder / name).read_bytes(), seed))
        assert (why := commands(fuzzing.words_of(fuzzing.READERS[name], damaged))) is None, why

    ends_well()


@pytest.mark.parametrize("name", fuzzing.READERS)
def test_the_file_that_is_damaged_is_valid(commands: fuzzing.Commands, name: str) -> None:
    words = fuzzing.words_of(fuzzing.READERS[name], commands.folder / name)
    assert (why := commands(words, refusable=False)) is None, why


def big_png(path: Path) -> None:
    """Write the header of a picture of 30,000 x 30,000 pixels."""
    parts = ((b"IHDR", struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(b"")))
    chunks = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in parts)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


IMAGE = "terrain image --param metres_per_pixel=0.1 --param source={}"
BAD_FILES: dict[str, tuple[Callable[[Path], object], str]] = {
    "pipe.npy": (os.mkfifo, IMAGE),
    "pipe.toml": (os.mkfifo, "walk --spec {}"),
    "pipe.xml": (os.mkfifo, "robots check {}"),
    "zero.json": (lambda path: path.symlink_to("/dev/zero"), "study show {}"),
    "zero.arrow": (lambda path: path.symlink_to("/dev/zero"), "plot {} balance -o new.png"),
    "brace.npy": (lambda path: path.write_bytes(b"\x93NUMPY\x01\x00\x01\x00{"), IMAGE),
    "big.png": (big_png, IMAGE),
    "digits.toml": (lambda path: path.write_text("seed = " + "1" * 5000), "walk --spec {}"),
    "huge.xml": (lambda path: path.write_text(biped().replace("0.13", "1e308", 1)), "robots check {}"),
    "drive.toml": (
        lambda path: path.write_text("[plan]\ndrive = [[0, 0.1, 0, 0], [1e9, 0, 0, 0]]"),
        "walk --spec {}",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_that_cannot_be_used_is_refused(commands: fuzzing.Commands, tmp_path: Path, name: str) -> None:
    make, words = BAD_FILES[name]
    make(file := tmp_path / name)
    assert (why := commands(fuzzing.words_of(words, file), acceptable=False)) is None, why
