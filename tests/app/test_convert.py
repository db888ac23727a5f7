"""Converted logs hold what the log holds, are opened by Rerun without a complaint, and have no spaces."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from recorded import recorded_stand, recorded_walk

from wbc.app.cli import main
from wbc.app.log.reader import Log
from wbc.app.replay.convert import convert_log
from wbc.core.errors import InputError

pytest.importorskip("rerun")


def test_rerun_opens_an_rrd(tmp_path: Path) -> None:
    half, whole = tmp_path / "walk.arrow", recorded_walk().read_bytes()
    half.write_bytes(whole[: len(whole) // 2])
    path = tmp_path / "walk.rrd"
    assert convert_log(Log.open(half), path, rate=5.0) is None

    def rerun(word: str) -> str:
        words = [sys.executable, "-m", "rerun", "rrd", word, str(path)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout + done.stderr

    assert "1 file verified without error" in rerun("verify")
    listed = rerun("print")
    assert "/com/estimated" in listed and "left_foot swing" not in listed


def test_a_log_without_a_robot_has_signals_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = tmp_path / "stand.arrow", tmp_path / "stand.rrd"
    opened = recorded_stand(log, shown=lambda plant: None)
    with pytest.raises(InputError, match="rate"):
        convert_log(opened, out, rate=0.0)
    assert main(["log", "convert", str(log), str(out), "--json"]) == 0
    assert "without a plant" in json.loads(capsys.readouterr().out)["without_scene"]
    assert main(["log", "convert", str(log), str(tmp_path / "stand.bag")]) == 2
    assert "one of .rrd" in capsys.readouterr().err
