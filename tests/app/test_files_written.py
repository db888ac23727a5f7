"""Files that commands write: a full disk leaves the old one, and none is written over a file that is read."""

from __future__ import annotations

import csv
import importlib
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from full_disk import limited_file_size
from log_writing import write
from properties import by_default

from wbc.app.cli import BAD_INPUT, FAILED, RAN, main
from wbc.sim.studies.journal import Entry, Journal, read_journal
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Study

Captured = pytest.CaptureFixture[str]

STUDY = {
    "name": "small",
    "base": {
        "plan": {"distance": 0.05},
        "gait": {"single_support": 0.5, "double_support": 0.2},
        "noise": "none",
    },
    "cells": {"level": {"terrain": "flat"}},
    "arms": {"flat": {"foot": "flat"}, "soft": {"foot": "soft"}},
    "seeds": [1, 2],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a study, its journal, a log and a picture."""
    importlib.import_module("joblib")  # which tries the disk when it is imported
    monkeypatch.chdir(tmp_path)
    Path("study.json").write_text(json.dumps(STUDY))
    with Journal("journal.jsonl") as journal:
        for trial in Study.from_json(STUDY).trials():
            result = {"outcome": "completed", "steps_done": 2 + trial.seed}
            journal.add(Entry(trial.spec.to_json(), "done", result, None, None, provenance()))
    write(Path("log.arrow"), 300).close()
    np.savetxt("heights.csv", np.outer(np.arange(8.0), np.arange(8.0)), delimiter=",")
    yield tmp_path


STUDY_WORDS = ["study.json", "--journal", "journal.jsonl", "-o"]
IMAGE = ["terrain", "image", "--param", "source=heights.csv", "--param", "metres_per_pixel=0.02", "--plot"]

WRITERS: dict[str, list[str]] = {
    "table.csv": ["study", "table", *STUDY_WORDS],
    "signals.png": ["plot", "log.arrow", "com/estimated", "-o"],
    "ground.svg": IMAGE,
    "scene.rrd": ["view", "log.arrow", "-o"],
}
"""File to write → command that writes it."""


@pytest.mark.parametrize("name", by_default(WRITERS, "table.csv", "scene.rrd"))
def test_a_full_disk_leaves_the_old_file_and_one_line(folder: Path, name: str, capsys: Captured) -> None:
    Path(name).write_text("old")
    before = sorted(os.listdir())
    with limited_file_size(20):
        assert main([*WRITERS[name], name]) == FAILED
    captured = capsys.readouterr()
    assert captured.err.splitlines()[-1] == f"wbc: cannot write {name}: File too large"
    assert "Traceback" not in captured.err and not captured.out
    assert Path(name).read_text() == "old" and sorted(os.listdir()) == before
    assert main([*WRITERS[name], name]) == RAN
    assert Path(name).read_bytes() != b"old" and sorted(os.listdir()) == before


INPUTS: list[tuple[list[str], str]] = [
    (WRITERS["table.csv"], "journal.jsonl"),
    (WRITERS["table.csv"], "study.json"),
    (WRITERS["signals.png"], "log.arrow"),
    (["view", "log.arrow", "-o"], "log.arrow"),
    (IMAGE, "heights.csv"),
    (["walk", "--spec", "study.json", "--record"], "study.json"),
    (["walk", "--distance", "0.05", "--param", "source=heights.csv", "--record"], "heights.csv"),
]
"""Command that ends in the option of a file to write, and a file that it reads."""

ENDINGS = {"table": ".csv", "view": ".rrd", "walk": ".arrow"}


@pytest.mark.parametrize(
    ("words", "read", "kind"),
    [(words, read, ("hard", "symbolic")[i % 2]) for i, (words, read) in enumerate(INPUTS)],
)
def test_a_file_that_is_read_is_not_written(
    folder: Path, words: list[str], read: str, kind: str, capsys: Captured
) -> None:
    """By another name, because the ending of the same name is refused already where it is not that of the output."""
    ending = next((ending for word, ending in ENDINGS.items() if word in words), ".png")
    output = Path(f"output{ending}")
    content = Path(read).read_bytes()
    if kind == "hard":
        output.hardlink_to(read)
    else:
        output.symlink_to(read)
    assert main([*words, str(output)]) == BAD_INPUT
    captured = capsys.readouterr()
    assert "it is read, too" in captured.err and captured.err.count("\n") == 1, captured.err
    assert Path(read).read_bytes() == content


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.slow  # a process that imports the library
def test_a_result_that_cannot_be_printed_is_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "wbc", "--version"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (FAILED, "wbc: [Errno 28] No space left on device\n")


@pytest.mark.slow
def test_a_trial_without_a_result_is_run_again_by_the_printed_command(folder: Path, capsys: Captured) -> None:
    entries = list(read_journal("journal.jsonl").values())
    with Journal("bad journal.jsonl") as journal:
        for entry, status in zip(entries, ("done", "diverged", "crashed", "timeout"), strict=True):
            result = entry.result if status == "done" else None
            error = None if status == "done" else "the process that ran it died"
            journal.add(replace(entry, status=status, result=result, error=error))
    assert main(["study", "run", "study.json", "--journal", "bad journal.jsonl"]) == RAN
    lines = [line for line in capsys.readouterr().out.splitlines() if "wbc study run" in line]
    assert [line.partition("#")[2].strip() for line in lines] == [
        "diverged: level, soft, seed 1",
        "crashed: level, flat, seed 2",
        "timeout: level, soft, seed 2",
    ]
    words = shlex.split(lines[1], comments=True)[1:]
    assert main([*words, "--json"]) == RAN
    Path("walk.json").write_text(told := capsys.readouterr().out)
    again = json.loads(told)
    assert again["status"] == "done" and again["result"]["outcome"] == "completed" and not again["same"]
    assert again["journal"]["status"] == "crashed" and "died" in again["journal"]["error"]
    assert again["spec"] == entries[2].spec
    assert main(["walk", "--spec", "walk.json", "--json"]) == RAN
    walked = json.loads(capsys.readouterr().out)
    assert walked["spec"] == again["spec"] and walked["distance"] == again["result"]["distance"]
    for key, message in (("zz", "no key 'zz' of the journal"), ("", "no key '' of the journal")):
        assert main(["study", "run", "--journal", "bad journal.jsonl", "--key", key]) == BAD_INPUT
        assert message in capsys.readouterr().err


STEERING = "\x1b]0;title\x07\x1b[2J\u202e"
ODD = STUDY | {
    "name": f"=1+1 [red]{STEERING}",
    "about": f"{STEERING}\nforged: 5 done",
    "cells": {"=cmd|' /C calc'!A0": {}},
    "arms": {f"@SUM(1){STEERING}": {"foot": "flat"}, "-1 flat": {"foot": "flat"}},
    "seeds": [1],
}


def test_texts_of_files_are_shown_as_texts(folder: Path, capsys: Captured) -> None:
    """No character that steers a terminal, no forged line, no formula in a spreadsheet, in whatever is written."""
    Path("odd").mkdir()
    Path("odd/study.json").write_text(json.dumps(ODD))
    with Journal("odd.jsonl") as journal:
        for trial in Study.from_json(ODD).trials():
            result = {"outcome": "completed", "steps_done": 2, "=note": f"+1 {STEERING}"}
            journal.add(Entry(trial.spec.to_json(), "done", result, None, None, provenance()))
    study = ["odd/study.json", "--journal", "odd.jsonl"]
    for words in (
        ["show", "odd"],
        ["show", "odd/study.json"],
        ["run", *study],
        ["table", *study],
        ["table", *study, "-o", "odd.csv"],
        ["plot", *study, "-o", "odd.svg"],
    ):
        assert main(["study", *words]) == RAN
        said = capsys.readouterr()
        for text in (said.out, said.err):
            assert not set(STEERING) & {"\x1b", "\x07", "\u202e"} & set(text)
            assert not any(line.startswith("forged") for line in text.splitlines())
    assert not {"\x1b", "\x07", "\u202e"} & set(Path("odd.svg").read_text() + Path("odd.csv").read_text())
    with open("odd.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 3 and {"=", "+", "@"}.isdisjoint(cell[:1] for row in rows for cell in row)
    assert "'-1 flat" in rows[2] and "2" in rows[1]
