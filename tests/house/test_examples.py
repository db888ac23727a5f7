"""The examples do what they say, and end by themselves."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import io
import os
import pty
import select
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOMS = ("tasks", "robots", "feet", "ground", "walking", "motion", "machine", "sim", "app")
SURFACES = ("wbc", *(f"wbc.{room}" for room in ROOMS))
"""The packages that users import from; pages name `wbc.core.conventions` for the states of MuJoCo."""

FOLDER = Path(__file__).parents[2] / "examples"
STANDING = (
    "arm",
    "cassie",
    "handles",
    "learn",
    "motion",
    "other_engine",
    "own_robot",
    "own_source",
    "stand",
    "two_robots",
    "without_feet",
)
WALKING = (
    "walk",
    "walk_soles",
    "walk_stairs",
    "walk_stones",
    "drive",
    "program",
    "reach_walking",
    "step_over_stones",
)
NAMES = (*STANDING, *WALKING)
NEEDED = {"other_engine": "dartpy", "learn": "stable_baselines3"}
"""Example → library that is no dependency of the tests."""

Load = Callable[[str], ModuleType]


@pytest.fixture
def load() -> Iterator[Load]:
    """Import examples by name, as Python does for a script that is run from its folder."""
    sys.path.insert(0, str(FOLDER))
    before = set(sys.modules)
    try:
        yield importlib.import_module
    finally:
        sys.path.remove(str(FOLDER))
        for name in {*NAMES, "_common"} & (set(sys.modules) - before):
            del sys.modules[name]


def run(module: ModuleType, *arguments: str, seconds: float = 2.0) -> dict[str, Any]:
    result: dict[str, Any] = module.main(["--seconds", str(seconds), *arguments])
    assert result["upright"]
    return result


def test_every_example_is_tested_indexed_and_takes_the_common_options(
    load: Load, capsys: pytest.CaptureFixture[str]
) -> None:
    found = {path.stem for path in FOLDER.glob("*.py")} - {"_common"}
    assert found == set(NAMES)
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"({name}.py)" in index
        if name in NEEDED and importlib.util.find_spec(NEEDED[name]) is None:
            continue  # it needs what is not installed here
        module = load(name)
        with pytest.raises(SystemExit, match="0"):
            module.main(["--help"])
        assert "--view" in capsys.readouterr().out


def test_examples_import_public_names_alone() -> None:
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "wbc":
                if node.module == "wbc.core.conventions":
                    continue
                assert node.module in SURFACES, f"{path.name} imports from {node.module}"
                public = importlib.import_module(node.module).__all__
                assert {alias.name for alias in node.names} <= set(public), path.name


@pytest.mark.slow
def test_two_robots_lift_a_board_together(load: Load) -> None:
    result = load("two_robots").main([])
    assert abs(result["lifted_mm"] - 100.0) < 10.0 and result["tilt_deg"] < 2.0


@pytest.mark.parametrize(
    ("mode", "robot", "bound"),
    [("position", "hrp4_class", 0.2), pytest.param("torque", "g1", 3.0, marks=pytest.mark.slow)],
)
def test_stand_keeps_the_centre_of_mass(load: Load, mode: str, robot: str, bound: float) -> None:
    assert run(load("stand"), "--mode", mode, "--robot", robot, seconds=0.5)["com_error_mm"] < bound


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_source_of_ones_own_marches(load: Load, mode: str) -> None:
    assert run(load("own_source"), "--mode", mode, seconds=3.5)["lifted_mm"] > 25.0


@pytest.mark.slow
def test_in_another_engine_a_push_is_stepped_out_of(load: Load) -> None:
    """Without steps the robot would come back to where it stood; with them it stands ahead of it."""
    pytest.importorskip("dartpy")
    result = run(load("other_engine"), seconds=3.0)
    assert result["upright"] and result["steps"] > 1 and result["forward_mm"] > 50.0


@pytest.mark.slow
def test_a_residual_is_learnt_on_top_of_the_walk(load: Load) -> None:
    """The plain walk goes as far as its velocity and time say, less the first and the last step."""
    pytest.importorskip("stable_baselines3")
    result = load("learn").main(["--seconds", "3", "--steps", "48"])
    assert 0.1 < result["plain_m"] < 0.6 and result["learnt_m"] > -1.0


@pytest.mark.slow
def test_cassie_stands_on_springs_that_its_controller_takes_for_rigid_and_takes_a_push(load: Load) -> None:
    """Ten seconds with a push of 3 Ns; its chains stay closed but for what the springs give."""
    result = run(load("cassie"), seconds=10.0)
    assert result["moved_mm"] < 20.0 and result["gap_mm"] < 3.0


def test_own_robot_stands_though_pushed(load: Load, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(load("own_robot"))
    assert result["moved_mm"] < 1.0
    assert "half-sitting of the legs solved for" in capsys.readouterr().out


@pytest.mark.slow
def test_a_clip_becomes_feasible_and_is_tracked(load: Load) -> None:
    result = run(load("motion"))
    assert result["zmp_outside_mm"] < 5.0 and result["joints_rms_deg"] < 2.0


def test_a_robot_without_feet_follows_a_circle(load: Load) -> None:
    result = load("without_feet").main(["--seconds", "1"])
    assert result["solved"] and result["error_mm"] < 10.0


def test_an_arm_goes_around_a_ball_on_its_circle(load: Load) -> None:
    result = load("arm").main(["--seconds", "4"])
    assert result["error_mm"] < 5.0 and 19.0 < result["ball_mm"] < 30.0 and result["furthest_mm"] > 20.0


def test_hands_follow_their_handles(load: Load) -> None:
    assert load("handles").main(["--seconds", "2"])["hands_mm"] < 5.0


# ---- walks ----------------------------------------------------------------------------------------------------------


def walk(module: ModuleType, *arguments: str) -> dict[str, Any]:
    result: dict[str, Any] = module.main(list(arguments))
    assert result["upright"]
    return result


@pytest.mark.slow
def test_walk_arrives(load: Load) -> None:
    result = walk(load("walk"), "--distance", "0.1")
    assert result["distance_m"] == pytest.approx(0.1, abs=0.03)
    assert result["steps"] == 2  # one, and one to close up


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["position", "hybrid"])
@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
def test_program_does_one_thing_after_the_other(load: Load, robot: str, mode: str) -> None:
    result = walk(load("program"), "--robot", robot, "--mode", mode)
    assert result["outcome"] == "done"
    assert result["squat_mm"] == pytest.approx(30.0, abs=6.0)
    near = 0.06 if mode == "position" else 0.12  # steps that balance the robot end within 0.15 of its height
    assert result["forward_m"] == pytest.approx(1.0, abs=near)


@pytest.mark.slow
def test_reach_walking_carries_one_hand_and_arrives_with_the_other(load: Load) -> None:
    result = walk(load("reach_walking"), "--distance", "0.6")
    assert result["carried_rms_mm"] < 10.0 and result["distance_mm"] < 40.0


@pytest.mark.slow
def test_drive_walks_an_s_without_a_terminal(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    result = load("drive").main(["--seconds", "4"])
    assert result["upright"] and result["steps"] >= 2 and 0.05 < result["forward_m"] < 0.8


def test_drive_takes_every_key_as_soon_as_it_is_pressed(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, terminal = pty.openpty()
    with os.fdopen(ours, "wb", buffering=0) as keyboard, os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        with load("drive").keys() as pressed:
            keyboard.write(b"\x1b[Aq")  # arrow up, q
            assert select.select([terminal], [], [], 10.0)[0]
            assert [pressed() for _ in range(5)] == ["\x1b", "[", "A", "q", ""]


@pytest.mark.slow
def test_walk_on_stones_feels_them(load: Load) -> None:
    result = walk(load("walk_stones"), "--distance", "0.2", "--amplitude", "0.015")
    assert result["outcome"] == "completed"
    assert result["early_landings"] + result["late_landings"] > 0  # nobody knew of the stones


@pytest.mark.slow
def test_walk_sets_its_soles(load: Load) -> None:
    module = load("walk_soles")
    own = walk(module, "--distance", "0.35")
    assert own["policy"] == "SofterWhereItIsRough" and own["decided"] > 0
    assert 2.0 <= own["softest_nm_per_rad"] <= own["stiffest_nm_per_rad"] <= 60.0
    assert walk(module, "--distance", "0.05", "--policy", "fixed")["stiffest_nm_per_rad"] == 5.0


@pytest.mark.slow
def test_step_over_stones_comes_through_a_push(load: Load) -> None:
    result = walk(load("step_over_stones"), "--distance", "0.6")
    assert 0.6 <= result["forward_m"] < 1.2 and abs(result["aside_m"]) < 0.3 and result["pushed"]


@pytest.mark.slow
def test_walk_climbs(load: Load) -> None:
    result = walk(load("walk_stairs"), "--stairs", "1", "--rise", "0.04")
    assert result["climbed_mm"] == pytest.approx(40.0, abs=8.0)


@pytest.mark.slow
def test_a_walk_gives_the_same_result_with_a_view(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = load("walk_stones")
    common = sys.modules["_common"]
    monkeypatch.setattr(common, "BROWSER_TIME", 0.0)
    view = common.MeshcatView
    monkeypatch.setattr(
        common, "MeshcatView", lambda **options: view(**options | {"speed": None})
    )  # it need not take its time
    plain = walk(module, "--distance", "0.05")
    assert walk(module, "--distance", "0.05", "--view", "--port", "0") == plain
    assert "http://127.0.0.1:" in capsys.readouterr().err
