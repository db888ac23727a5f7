"""Feet and grounds from the command line: what they say, and that wrong input is refused before anything starts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest

from wbc.app import cli
from wbc.feet.soles.catalog import foot_names
from wbc.robots import names

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Run:
    def command(*words: str) -> tuple[int, str, str]:
        code = cli.main(list(words))
        out, err = capfd.readouterr()
        return code, out, err

    return command


def data_of(run: Run, *words: str) -> Any:
    code, out, err = run(*words, "--json")
    assert code == cli.RAN, err
    return json.loads(out)


# --- feet ------------------------------------------------------------------------------------------------------------


def test_feet_are_listed_under_every_robot(run: Run) -> None:
    listed = {entry["name"]: entry for entry in data_of(run, "foot")["feet"]}
    assert set(listed) == set(foot_names())
    for robot in names():
        own, soft = (listed[name]["fits"][robot] for name in ("flat", "soft"))
        assert own["added_mass_kg"] == own["height_change_m"] == 0.0
        assert soft["added_mass_kg"] == pytest.approx(0.34)
        assert soft["ankle_in_sole_m"][0] == pytest.approx(-0.03)
        assert soft["footprint_m"] == pytest.approx([0.2778, 0.1045], abs=1e-4)


# --- rig -------------------------------------------------------------------------------------------------------------


def test_a_press_says_what_was_pressed(run: Run) -> None:
    ground = "--terrain stones --amplitude 0.02 --seed 4"
    words = f"foot press --robot g1 --foot-param phalanges=8 --stiffness 20 --settle 0.1 --hold 0.1 {ground}"
    facts = data_of(run, *words.split())
    assert (facts["foot"], facts["terrain"], facts["seed"], facts["load_n"]) == ("soft", "stones", 4, 200.0)
    assert facts["foot_parameters"]["phalanges"] == len(facts["hold"]["sole_angles"]) == 8
    assert facts["foot_parameters"]["stiffness"] == 20.0
    assert facts["ankle_in_sole_m"][2] == pytest.approx(0.035)  # g1's ankles are low
    assert facts["added_mass_kg"] == pytest.approx(0.30)


@pytest.mark.slow
def test_a_drop_is_harder_from_higher_up(run: Run) -> None:
    low, high = (data_of(run, "foot", "press", "--drop", h)["impact"] for h in ("0.01", "0.05"))
    assert high["peak_force"] > low["peak_force"] and high["speed"] > 2.0 * low["speed"]


# --- grounds ---------------------------------------------------------------------------------------------------------


def test_roughness_is_what_the_feet_know_of_the_ground(run: Run) -> None:
    found = data_of(run, "terrain", "metal_sheets", "--param", "period=0.1", "--ramp", "0")["roughness"]
    assert found["Sz_m"] == pytest.approx(0.02, rel=0.05)  # a line is taken off a sine
    assert found["Sq_m"] == pytest.approx(0.02 / math.sqrt(8.0), rel=0.02)
    assert found["Sku"] == pytest.approx(1.5, rel=0.02) and found["K"] == pytest.approx(0.5, abs=0.05)
    assert data_of(run, "terrain", "flat")["roughness"]["Sq_m"] == 0.0
