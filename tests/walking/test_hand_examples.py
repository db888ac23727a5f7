"""Examples of hands: what the page of hands has measured holds."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from wbc.robots import load

FOLDER = Path(__file__).parents[2] / "examples" / "hands"
NAMES = ("carry", "cart", "door", "one_foot", "press")


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Import examples by name, as Python does for a script that is run from its folder."""
    monkeypatch.syspath_prepend(str(FOLDER))
    yield importlib.import_module
    for name in {*NAMES, "_hands", "_common"} & set(sys.modules):
        del sys.modules[name]


Example = Callable[[str], ModuleType]


def run(module: ModuleType, *arguments: str) -> dict[str, Any]:
    result: dict[str, Any] = module.main(list(arguments))
    assert result["upright"] and result["stage"] == "done", result
    return result


@pytest.mark.slow
@pytest.mark.parametrize(
    ("on", "force", "robot", "mode"),
    [
        ("table", 60.0, "g1", "position"),
        ("wall", 100.0, "g1", "position"),
        ("wall", 60.0, "hrp4_class", "torque"),
    ],
)
def test_a_press_is_held(example: Example, on: str, force: float, robot: str, mode: str) -> None:
    words = f"--on {on} --force {force} --robot {robot} --seed 201 --hold 3 --mode {mode}".split()
    result = run(example("press"), *words)
    assert result["mean_N"] == pytest.approx(force, rel=0.015) and result["steady"] == 1.0
    assert not result["lost"]


@pytest.mark.slow
def test_a_robot_leans_on_a_rail_with_its_mass_beyond_its_toes(example: Example) -> None:
    result = run(example("press"), "--on", "rail", "--force", "80", "--noise", "none", "--hold", "2")
    assert result["mean_N"] == pytest.approx(80.0, rel=0.1)
    assert result["beyond_toes_mm"] > 0.0


@pytest.mark.slow
def test_a_robot_on_one_foot_stands_a_push_with_a_hand_on_the_wall_and_falls_without(
    example: Example,
) -> None:
    assert run(example("one_foot"), "--impulse", "0.2")["on_one_foot"]
    assert not example("one_foot").main(["--impulse", "0.2", "--force", "0"])["upright"]


@pytest.mark.slow
def test_a_cart_is_pushed_turned_and_pulled(example: Example) -> None:
    result = run(example("cart"), "--seed", "200")
    assert result["place_error_mm"] < 250.0 and abs(result["heading_error_deg"]) < 5.0


@pytest.mark.slow
def test_feet_that_slip_under_a_cart_turn_on_until_the_gyroscope_is_satisfied(example: Example) -> None:
    result = run(example("cart"), "--robot", "g1", "--forward", "0", "--back", "0", "--turn", "120")
    turn = 2 * math.ceil(120.0 / example("cart").ROBOTS["g1"][-1])
    assert result["steps"] > turn, "it turns on: 2 degrees are missing after the steps of the turn"
    assert abs(result["heading_error_deg"]) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "g1"])
def test_free_steps_push_a_cart(example: Example, robot: str) -> None:
    words = ("--mode", "torque", "--forward", "0.4", "--back", "0", "--turn", "0", "--seed", "200")
    result = run(example("cart"), *words, "--robot", robot)
    assert result["place_error_mm"] < 250.0 and abs(result["heading_error_deg"]) < 5.0


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "seed"), [("position", "0"), ("torque", "1")])
def test_a_door_is_opened_by_its_handle_and_walked_through(example: Example, mode: str, seed: str) -> None:
    result = run(example("door"), "--mode", mode, "--seed", seed)
    assert result["open_deg"] > 80.0 > result["released_deg"] > 10.0, "by the handle, then by the other hand"
    assert result["beyond_mm"] > 1000.0, "it stands behind the frame"
    assert result["touch_N"] < 300.0, "the leaf is kept off its body"


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        *(f"--share 0.2 --robot {robot} --steps 22" for robot in ("hrp4_class", "g1", "talos")),
        "--share 0.3 --hold chest --forward 0.2 --steps 6",
    ],
)
def test_a_load_is_found_carried_and_dropped(example: Example, words: str) -> None:
    result = run(example("carry"), *words.split(), "--overs", "2")
    assert result["mass_error"] < 0.05 and result["place_error_mm"] < 11.0
    assert result["steps"] >= 6 and result["at_the_end_kg"] < 0.05


def test_arms_go_ahead(example: Example) -> None:
    for name in ("hrp4_class", "talos", "g1"):
        robot = load(name).robot()
        robot.update(example("_hands").arms_ahead(robot), np.zeros(robot.nv))
        places = np.array([robot.placement(frame).translation for frame in robot.frames.values()])
        assert places[:, 0] == pytest.approx([0.35, 0.35], abs=0.003)
        assert places[0] == pytest.approx(places[1] * (1.0, -1.0, 1.0), abs=1e-3)


def test_a_table_of_trials_has_a_row_for_each_mode_of_control(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER.parents[1] / "benchmarks" / "trials"))
    trials = importlib.import_module("hand_trials")
    measured = {"released_deg": 40.0, "beyond_mm": 500.0, "force_N": 20.0, "touch_N": 0.0, "failures": 0}
    words = ["--robot", "g1", "--seed", "200"]
    found = [
        {"what": "door", "robot": "g1", "seed": 200, "words": [*words, *mode], "stage": stage, **measured}
        for mode, stage in (((), "done"), (("--mode", "torque"), "push"))
    ]
    rows = trials.table("door", found).splitlines()[2:]
    assert [row.split(" | ")[:2] for row in rows] == [["| `g1`", "1 of 1"], ["| `g1`, torque", "0 of 1"]]
