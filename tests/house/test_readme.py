"""The README does what it says: its programs run, its files are there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.sim.trial.falls import TrueFallDetector

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def test_the_smallest_stand_balances_a_humanoid_and_the_squat_in_one_line_squats() -> None:
    program = blocks("python")[0]
    names: dict[str, Any] = {}
    exec(program.replace("3.0", "1.0"), names)
    plant, start = names["plant"], np.array(names["com"].target)
    assert plant.time == pytest.approx(1.0)
    assert not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    np.testing.assert_allclose(plant.truth().com, start, atol=2e-3)
    (line,) = re.findall(r"`(com\.target = [^`]+)`", README)
    exec(f"{line}\nwhile plant.time < 3.0: plant.step(control.command(plant.measure()))", names)
    np.testing.assert_allclose(plant.truth().com, start - [0.0, 0.0, 0.1], atol=1e-2)  # the posture pulls


def test_the_smallest_walk_walks(capsys: pytest.CaptureFixture[str]) -> None:
    exec(blocks("python")[1].replace("3.0", "0.1"), {})
    assert capsys.readouterr().out == "2 steps\n"


@pytest.mark.slow
def test_the_walks_take_as_many_steps_as_their_comments_say(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    for program in blocks("python")[1:3]:
        exec(program, names)
        assert capsys.readouterr().out.strip() == program.splitlines()[-1].partition("  # ")[2]
