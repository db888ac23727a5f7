"""Mutated files: a valid file of every kind that a command reads, with bits, numbers and pieces changed by a seed."""

from __future__ import annotations

import json
import lzma
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mjcf_biped import biped
from PIL import Image
from recorded import recorded_stand

import wbc
from wbc.feet.stiffness.model import DEFAULT_MODEL, DEFAULT_TABLE
from wbc.motion import write_motion
from wbc.motion.clip import MotionClip
from wbc.sim import WalkPlan, WalkSpec

ROOT = Path(__file__).resolve().parents[2]

NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "1e9", "-1", "0", "1" * 5000, "0x10", "1_0", "٣"),
    *("", "true", "[]", "{}", "null", '"a"', "2020-01-01"),
)
"""What takes the place of a number in a text."""

PIECES = (
    *(b"", b"\0", b"\xff\xfe", b"\x80", b"PK\x03\x04"),
    *(b"{", b"[" * 2000, b"<", b'"', b"'", b"\n", b",", b"&lol;"),
)
"""What takes the place of a piece."""

COMMANDS = {
    "ground.npy": "terrain image --param source={file} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "ground.png": "terrain image --param source={file} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "ground.csv": "terrain image --param source={file} --param metres_per_pixel=0.1 --length 0.5 --width 0.3",
    "packed.npz": "motion check {file}",
    "plain.npz": "motion check {file}",
    "motion.csv": "motion check {file}",
    "walk.toml": "walk --spec {file}",
    "walk.json": "walk --spec {file}",
    "drive.json": "walk --spec {file}",
    "robot.toml": "robots check {file}",
    "robot.xml": "robots check {file}",
    "robot.urdf": "robots check {file} --left left_sole --right right_sole --sole-size 0.2 0.1",
    "log.arrow": "view {file} -o {folder}/new.html",
    "plot.arrow": "plot {file} com/estimated -o {folder}/new.png",
    "study.json": "study show {file}",
    "journal.jsonl": "study table oracle --journal {file} --any-code",
    "journal.jsonl.xz": "study table oracle --journal {file} --any-code",
    "table.csv": "stiffness train {file} -o {folder}/new.json",
    "authors.csv": "stiffness train {file} -o {folder}/new.json",
    "model.json": "walk --distance 0.1 --policy model --policy-param path={file}",
}
"""Valid file → command that reads it."""


@dataclass(frozen=True)
class MutatedFile:
    """A file changed by a seed; without a seed it is as it was."""

    name: str
    seed: int | None

    def __str__(self) -> str:
        return f"{self.name} mutated by {self.seed}"

    def words(self, folder: Path) -> list[str]:
        """Write the file and return the command that reads it."""
        valid = (folder / "valid" / self.name).read_bytes()
        target = folder / "mutated" / self.name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(valid if self.seed is None else mutate(valid, np.random.default_rng(self.seed)))
        return [word.format(file=target, folder=folder) for word in COMMANDS[self.name].split()]


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Return data of which some bits, numbers or pieces are others."""
    changed = bytearray(data)
    ways: list[Callable[[bytearray, np.random.Generator], None]]
    ways = [_flip, _flip_at_begin, _cut, _put, _repeat]
    if b"\0" not in data:
        ways += [_number, _number, _number, _swap_lines]
    for _ in range(int(rng.integers(1, 4))):
        ways[int(rng.integers(len(ways)))](changed, rng)
    return bytes(changed)


def _span(data: bytearray, rng: np.random.Generator) -> slice:
    start = int(rng.integers(len(data) + 1))
    return slice(start, start + int(rng.geometric(0.02)))


def _flip(data: bytearray, rng: np.random.Generator, size: int | None = None) -> None:
    for _ in range(int(rng.geometric(0.3))):
        if data:
            data[int(rng.integers(min(len(data), size or len(data))))] ^= 1 << int(rng.integers(8))


def _flip_at_begin(data: bytearray, rng: np.random.Generator) -> None:
    _flip(data, rng, 200)  # where headers are


def _cut(data: bytearray, rng: np.random.Generator) -> None:
    del data[_span(data, rng) if rng.integers(2) else slice(int(rng.integers(len(data) + 1)), None)]


def _put(data: bytearray, rng: np.random.Generator) -> None:
    place = _span(data, rng)
    data[place] = (
        PIECES[int(rng.integers(len(PIECES)))] if rng.integers(2) else rng.bytes(place.stop - place.start)
    )


def _repeat(data: bytearray, rng: np.random.Generator) -> None:
    place = _span(data, rng)
    data[place.start : place.start] = bytes(data[place]) * int(rng.integers(1, 20))


def _number(data: bytearray, rng: np.random.Generator) -> None:
    found = list(re.finditer(rb"-?\d[\d.e+-]*", data))
    if found:
        chosen = found[int(rng.integers(len(found)))]
        data[chosen.start() : chosen.end()] = NUMBERS[int(rng.integers(len(NUMBERS)))].encode()


def _swap_lines(data: bytearray, rng: np.random.Generator) -> None:
    lines = bytes(data).split(b"\n")
    one, other = rng.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    data[:] = b"\n".join(lines)


def write_valid(folder: Path) -> None:
    """Make a folder with a valid file of every kind."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    heights = rng.integers(0, 255, (6, 8)).astype(np.uint8)
    np.save(folder / "ground.npy", heights.astype(float))
    Image.fromarray(heights).save(folder / "ground.png")
    np.savetxt(folder / "ground.csv", heights, delimiter=",")
    robot = wbc.load_robot("g1").robot()
    q = np.tile(robot.half_sitting, (5, 1))
    clip = MotionClip(robot.joint_names, 30.0, q[:, :7], q[:, 7:])
    write_motion(clip, folder / "packed.npz")
    write_motion(clip, folder / "motion.csv")
    np.savez(folder / "plain.npz", fps=30.0, joint_pos=q, joint_names=np.array(robot.joint_names))
    (folder / "walk.toml").write_text(
        'seed = 3\nfoot = "soft"\namplitude = 0.02\n[plan]\ndistance = 0.5\n[gait]\nswing_height = 0.06\n'
        "[[pushes]]\nimpulse = 5.0\ntime = 1.0\n"
    )
    (folder / "walk.json").write_text(json.dumps(WalkSpec().to_json(), indent=1))
    drive = WalkPlan(drive=((0.0, 0.1, 0.0, 0.0), (2.0, 0.0, 0.0, 0.1), (4.0, 0.0, 0.0, 0.0)))
    plan = {"plan": {"drive": [list(row) for row in drive.drive or ()]}}
    (folder / "drive.json").write_text(json.dumps(plan, indent=1))
    xml = biped()
    (folder / "robot.xml").write_text(xml)
    (folder.parent / "mutated").mkdir(exist_ok=True)
    (folder.parent / "mutated" / "biped.xml").write_text(xml)
    (folder / "robot.toml").write_text(
        'file = "biped.xml"\nname = "little"\nsole_size = [0.2, 0.1]\n[lock]\nwaist = 0.0\n'
    )
    soles = "".join(
        f'<link name="{side}_sole"/><joint name="{side}_fixed" type="fixed"><parent link="{side}_foot"/>'
        f'<child link="{side}_sole"/><origin xyz="0 0 -0.05"/></joint>'
        for side in ("left", "right")
    )
    urdf = wbc.RobotDescription.from_mjcf(xml).urdf.replace("</robot>", f"{soles}</robot>")
    (folder / "robot.urdf").write_text(urdf.replace("><", ">\n<"))
    recorded_stand(folder / "log.arrow", ticks=10)
    (folder / "plot.arrow").write_bytes((folder / "log.arrow").read_bytes())
    study = {
        "name": "small",
        "cells": {"a": {"terrain": "flat"}},
        "arms": {"b": {"foot": "soft"}},
        "seeds": [1, 2],
    }
    (folder / "study.json").write_text(json.dumps(study | {"base": {"plan": {"distance": 0.1}}}, indent=1))
    packed = ROOT / "docs" / "journals" / "oracle.jsonl.xz"
    lines = lzma.decompress(packed.read_bytes()).split(b"\n")[:4]
    (folder / "journal.jsonl").write_bytes(b"\n".join(lines) + b"\n")
    (folder / "journal.jsonl.xz").write_bytes(lzma.compress(b"\n".join(lines) + b"\n"))
    rows = DEFAULT_TABLE.read_text().split("\n")
    (folder / "table.csv").write_text("\n".join(rows[:60]) + "\n")
    authors = [[*rng.uniform(0.1, 1.0, 6).round(4), int(rng.integers(1, 21))] for _ in range(60)]
    (folder / "authors.csv").write_text("\n".join(",".join(map(str, row)) for row in authors) + "\n")
    (folder / "model.json").write_text(DEFAULT_MODEL.read_text())
