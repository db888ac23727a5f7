"""The README does what it says: its programs run, its files are there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.sim.plant.falls import TrueFallDetector

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def test_the_smallest_program_is_small_and_balances_a_humanoid(capsys: pytest.CaptureFixture[str]) -> None:
    smallest, squat = blocks("python")
    assert len(smallest.strip().splitlines()) <= 15
    names: dict[str, Any] = {}
    exec(smallest, names)
    plant, start = names["plant"], np.array(names["com"].target)
    assert plant.time == pytest.approx(5.0)
    assert not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    np.testing.assert_allclose(plant.truth().com, start, atol=2e-3)
    exec(squat, names)
    np.testing.assert_allclose(plant.truth().com, start - [0.0, 0.0, 0.1], atol=1e-2)  # the posture pulls
    assert "contact left_foot" in capsys.readouterr().out


def test_the_two_lines_of_the_start_do_all_set_up() -> None:
    lines = [li for block in blocks("bash") for li in block.splitlines() if "venv" in li]
    assert len(lines) == 2
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install") for line in lines)


def test_links_and_pictures_lead_somewhere() -> None:
    targets = [t for t in re.findall(r"\]\(([^)#]+)\)", README) if "://" not in t]
    assert "docs/images/push.png" in targets
    for target in targets:
        assert (ROOT / target).exists(), target
