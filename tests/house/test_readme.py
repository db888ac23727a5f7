"""The README does what it says: its programs run, its files are there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.sim.trial.falls import TrueFallDetector
from wbc.tasks import check_rows

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def test_the_smallest_stand_balances_a_humanoid_and_the_squat_in_one_line_squats(
    capsys: pytest.CaptureFixture[str],
) -> None:
    program = blocks("python")[0]
    names: dict[str, Any] = {}
    exec(program.replace("3.0", "1.0"), names)
    assert capsys.readouterr().out.endswith(f" {program.rpartition('  # ')[2]}")
    plant, start = names["plant"], np.array(names["com"].target)
    assert plant.time == pytest.approx(1.0)
    assert not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    np.testing.assert_allclose(plant.truth().com, start, atol=2e-3)
    (line,) = re.findall(r"`(com\.target = [^`]+)`", README)
    exec(f"{line}\nwhile plant.time < 3.0: plant.step(control.command(plant.measure()))", names)
    np.testing.assert_allclose(plant.truth().com, start - [0.0, 0.0, 0.1], atol=1e-2)  # the posture pulls


def names_of_stand() -> dict[str, Any]:
    """Return the names of earlier programs that the others go on with."""
    return {"wbc": wbc, "pin": pin, "description": wbc.load_robot("hrp4_class")}


def test_the_smallest_walk_walks(capsys: pytest.CaptureFixture[str]) -> None:
    exec(blocks("python")[1].replace("3.0", "0.1"), names_of_stand())
    assert capsys.readouterr().out == "2 steps\n"


def test_the_hand_of_the_arm_moves_to_the_left() -> None:
    names = names_of_stand()
    exec(blocks("python")[2], names)
    start = wbc.load_robot("panda").robot().placement("panda_hand").translation
    np.testing.assert_allclose(names["hand"].target.translation, start + [0.0, 0.2, 0.0], atol=1e-9)
    np.testing.assert_allclose(names["hand"].error, 0.0, atol=1e-2)


def test_the_task_holds_a_hand_at_its_height() -> None:
    names = names_of_stand()
    exec(blocks("python")[0].replace("3.0", "0.0"), names)
    exec(blocks("python")[3], names)
    check_rows(names["HeightTask"]("left_hand", 1.0), names["robot"])
    (line,) = re.findall(r"`(controller\.add\(HeightTask[^`]+)`", README)
    exec(f"hand = {line}\nwhile plant.time < 2.0: plant.step(control.command(plant.measure()))", names)
    assert names["hand"].error == pytest.approx(0.0, abs=0.01)


@pytest.mark.slow
def test_the_walk_takes_as_many_steps_as_its_comment_says(capsys: pytest.CaptureFixture[str]) -> None:
    program = blocks("python")[1]
    exec(program, names_of_stand())
    assert capsys.readouterr().out.strip() == program.splitlines()[-1].partition("  # ")[2]
