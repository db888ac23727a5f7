"""Hostile input, everywhere: a result, or one line that names value and rule; never a traceback, silence or a hang.

Every option of every command is drawn with hostile words, every parameter of every public constructor and function with
hostile values, one at a time (`tests/support/fuzzing.py`); a small sample by default.
"""

from __future__ import annotations

import json
import lzma
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fuzzing
import mutated
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mjcf_biped import biped
from properties import examples

import wbc
from wbc import app
from wbc.app.cli import BAD_INPUT, main
from wbc.core.errors import InputError, ModelError, WbcError
from wbc.sim import make_terrain, read_journal
from wbc.sim.balance.standing import StandSpec
from wbc.sim.studies.journal import Entry


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with hostile files and valid ones, with bounded memory, where long work ends as soon as it begins."""
    place = tmp_path_factory.mktemp("fuzz")
    (place / "files").mkdir()
    mutated.write_valid(place / "valid")
    with fuzzing.bounded(place):
        yield place


def drawn(count: int, check: Callable[..., str | None], *strategies: st.SearchStrategy[Any]) -> None:
    """Check a number of examples, in the long profile ten times as many."""

    @examples(count)
    @given(st.tuples(*strategies))
    def ends_well(values: tuple[Any, ...]) -> None:
        assert (why := check(*values)) is None, why

    ends_well()


def file_ends_well(file: mutated.MutatedFile, folder: Path) -> str | None:
    """Run a command on a mutated file; on a valid one it must not be refused."""
    return fuzzing.run_command(file.words(folder), refusable=file.seed is not None)


@pytest.mark.parametrize("count", [12, pytest.param(10_000, marks=pytest.mark.slow)])
def test_every_command_line_ends_in_a_result_or_a_refusal(folder: Path, count: int) -> None:
    lines = fuzzing.command_lines(folder / "files")
    assert len(lines) > 600
    filled = st.sampled_from(lines).flatmap(lambda line: line.drawn.map(line.filled))
    drawn(count, fuzzing.run_command, filled)


@pytest.mark.parametrize("count", [40, pytest.param(30_000, marks=pytest.mark.slow)])
def test_every_public_call_ends_in_a_result_or_a_refusal(folder: Path, count: int) -> None:
    places = fuzzing.places()
    assert len(places) > 900
    drawn(count, fuzzing.call, st.sampled_from(places), fuzzing.HOSTILE)


@pytest.mark.parametrize("count", [80, pytest.param(5000, marks=pytest.mark.slow)])
def test_every_call_of_logs_and_replays_ends_in_a_result_or_a_refusal(folder: Path, count: int) -> None:
    plant = wbc.Plant(wbc.load_robot("g1"))
    control = wbc.PositionControl(wbc.balance_controller(plant.description.robot(), plant.control_period))
    measurement = plant.measure()
    tick = plant, control, measurement, control.command(measurement)
    with app.Recorder(folder / "good.arrow") as record:
        record(*tick)
    log, path = app.Log.open(folder / "good.arrow"), folder / "new.arrow"
    replay = app.Replay(log)
    calls: tuple[Callable[[Any], Any], ...] = (
        *(app.Log.open, app.Replay, log.__getitem__, log.__contains__, log.parts, log.texts, log.lists),
        *(replay.show, replay.snapshot, replay.sole_colours, replay.ticks, replay.frame),
        *(lambda v: replay.ticks(30.0, v), lambda v: app.draw(v, [log]), lambda v: app.draw("balance", v)),
        *(lambda v: app.draw_signals(v, ["time"]), lambda v: app.draw_signals([log], v)),
        *(lambda v: app.save({}, v), lambda v: app.save(v, folder / "new.png")),
        *(
            app.replay_page,
            lambda v: app.replay_page(replay, rate=v),
            lambda v: app.replay_page(replay, nonce=v),
        ),
        *(lambda v: app.render_video(v, folder / "new.gif"), lambda v: app.render_video(replay, v)),
        *(lambda v: app.Recorder(v).close(), lambda v: app.Recorder(path, title=v).close()),
        lambda v: app.Recorder(path).add(v, lambda: 1.0),
        *(lambda v, i=i: app.Recorder(path)(*tick[:i], v, *tick[i + 1 :]) for i in range(4)),  # type: ignore[misc]
    )

    def call(function: Callable[[Any], Any], value: Any) -> str | None:
        try:
            function(fuzzing.ODD[value.name]() if isinstance(value, fuzzing.Made) else value)
        except WbcError:
            return None
        except Exception as error:
            return f"{value!r}: {type(error).__name__}: {error}"
        return None

    drawn(count, call, st.sampled_from(calls), fuzzing.HOSTILE)


@pytest.mark.parametrize("count", [40, pytest.param(1000, marks=pytest.mark.slow)])
def test_mutated_files_end_in_a_result_or_a_refusal(folder: Path, count: int) -> None:
    """Files are valid ones of every kind with bits, numbers and pieces changed."""
    files = st.builds(mutated.MutatedFile, st.sampled_from(sorted(mutated.COMMANDS)), st.integers(0, 10_000))
    drawn(count, lambda file: file_ends_well(file, folder), files)


@pytest.mark.slow
@pytest.mark.parametrize("name", mutated.COMMANDS)
def test_the_files_that_are_mutated_are_valid(folder: Path, name: str) -> None:
    assert file_ends_well(mutated.MutatedFile(name, None), folder) is None


@pytest.mark.slow
def test_every_function_takes_the_valid_arguments_beside_which_one_is_hostile(folder: Path) -> None:
    functions = dict.fromkeys(place._replace(parameter="") for place in fuzzing.places())
    failures = {place: why for place in functions if (why := fuzzing.call(place))}
    assert len(functions) >= 140 and not failures, failures


def big_png(path: Path) -> None:
    """Write the header of a picture of 30,000 x 30,000 pixels."""
    parts = ((b"IHDR", struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(b"")))
    chunks = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


IMAGE = "terrain image --param metres_per_pixel=0.1 --param source={file}"
BAD_FILES = {
    "pipe.npy": (os.mkfifo, IMAGE, "is a pipe"),
    "pipe.toml": (os.mkfifo, "walk --spec {file}", "is a pipe"),
    "pipe.xml": (os.mkfifo, "robots check {file}", "no robot file"),
    "zero.json": (lambda path: path.symlink_to("/dev/zero"), "study show {file}", "is a device"),
    "zero.arrow": (
        lambda path: path.symlink_to("/dev/zero"),
        "view {file} -o {folder}/new.html",
        "is a device",
    ),
    "brace.npy": (
        lambda path: path.write_bytes(b"\x93NUMPY\x01\x00\x01\x00{"),
        IMAGE,
        "is not a grey image or array",
    ),
    "big.png": (big_png, IMAGE, "decompression bomb|pixels"),
    "digits.toml": (
        lambda path: path.write_text("seed = " + "1" * 5000),
        "walk --spec {file}",
        "is not TOML",
    ),
    "huge.xml": (
        lambda path: path.write_text(biped().replace("0.13", "1e308", 1)),
        "robots check {file}",
        "huge.xml is not a robot that can be read",
    ),
    "drive.json": (
        lambda path: path.write_text(json.dumps({"plan": {"drive": [[0, 0.1, 0, 0], [1e9, 0, 0, 0]]}})),
        "walk --spec {file}",
        "a drive of 1e\\+09 s takes longer than 3600 s: give its longest time, --seconds",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, words, message = BAD_FILES[name]
    make(file := tmp_path / name)
    assert main([word.format(file=file, folder=tmp_path) for word in words.split()]) == BAD_INPUT
    error = capsys.readouterr().err
    assert re.search(message, error) and error.count("\n") == 1


def test_packed_journals_unpack_to_a_bound(tmp_path: Path) -> None:
    path = tmp_path / "zeros.jsonl.xz"
    path.write_bytes(lzma.compress(bytes(2_000_000)))
    with pytest.raises(
        WbcError, match=r"more than 1000000 bytes: read_journal\(…, largest=…\) raises the bound"
    ):
        read_journal(path, largest=1_000_000)


def chain(*joints: str, inertial: str = "") -> str:
    links = "".join(f'<link name="{name}">{inertial}</link>' for name in "abc")
    return f'<robot name="r">{links}{"".join(joints)}</robot>'


def fixed(name: str, parent: str, child: str) -> str:
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


LEGS = (fixed("1", "a", "b"), fixed("2", "a", "c"))
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
SOLES = {"left_sole": "b", "right_sole": "c"}


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        (b"\xff", "URDF must be|source must be"),
        ("a\0b", "source must be"),
        (chain(*LEGS, inertial=f'<inertial><mass value="1e300"/>{INERTIA}</inertial>'), "at most 1e"),
    ],
)
def test_a_urdf_that_cannot_be_used_is_refused(urdf: Any, message: str) -> None:
    with pytest.raises((InputError, ModelError), match=message):
        wbc.RobotDescription.from_urdf(urdf, **SOLES)


@pytest.mark.parametrize(
    "make",
    [
        lambda: StandSpec(seconds=1e-3),
        lambda: make_terrain("stones", 1e9),
        lambda: make_terrain("stones", length=1e9),
        lambda: make_terrain("stones", rendering="height_field", resolution=1e-300),
    ],
)
def test_sizes_have_limits(make: Any) -> None:
    with pytest.raises(InputError):
        make()


def test_a_line_that_is_nested_deeply_does_not_spoil_a_journal(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    entry = Entry({"kind": "walk"}, "done", {}, {}, None, {})
    path.write_bytes(b"[" * 100_000 + b"\n" + entry.line())
    assert list(read_journal(path)) == [entry.key]


def test_show_refuses_what_run_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "study.json"
    study = {"name": "s", "cells": {"a": {"robot": "nobody"}}, "arms": {"b": {}}, "seeds": [1]}
    path.write_text(json.dumps(study))
    assert main(["study", "show", str(path)]) == BAD_INPUT
    assert "nobody" in capsys.readouterr().err
