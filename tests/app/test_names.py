"""Names that are loaded when they are used are listed for completion."""

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest
from recorded import recorded_stand

import wbc
from wbc import app
from wbc.app.cli import main
from wbc.base.errors import IN_PLACE_OF


@pytest.mark.parametrize("package", [wbc, app])
def test_all_listed_names_are_there(package: ModuleType) -> None:
    assert dir(package)
    for name in dir(package):
        assert getattr(package, name) is not None


@pytest.mark.parametrize(
    ("module", "name", "said"),
    [
        ("wbc", "ComTask", "did you mean 'CoMTask'"),
        ("wbc", "FrameTask", "in its place: PoseTask, PositionTask or OrientationTask"),
        ("wbc", "solve_ik", "in its place: InverseKinematics"),
        ("wbc", "WatchWalk", "in its place: MeshcatView, a hook of the walk"),
        ("wbc", "retarget", "did you mean 'wbc.motion.retarget'?"),
        ("wbc", "walk_distanc", "did you mean 'walk_distance'"),
        ("wbc.sim", "zzzzz", "module 'wbc.sim' has no attribute 'zzzzz'"),
    ],
)
def test_a_name_that_is_near_is_suggested(module: str, name: str, said: str) -> None:
    with pytest.raises(AttributeError) as missing:
        getattr(importlib.import_module(module), name)
    assert said in str(missing.value)
    assert missing.value.name == name


def test_names_of_other_libraries_lead_to_names_that_exist() -> None:
    rooms = [
        wbc,
        *(importlib.import_module(f"wbc.{room}") for room in (*wbc._ROOMS, "sim.balance.standing")),
    ]
    for old, new in IN_PLACE_OF.items():
        assert not any(old in dir(room) for room in rooms)
        for name in re.findall(r"\b[A-Z]\w*[a-z]\w*", new):
            assert name == "Python" or any(name in dir(room) for room in rooms), name


def test_a_figure_that_is_near_is_suggested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded_stand(tmp_path / "log.arrow", ticks=5)
    assert main(["plot", str(tmp_path / "log.arrow"), "balanc"]) == 2
    assert "no figure or signal 'balanc'; did you mean 'balance'" in capsys.readouterr().err


def test_a_frame_that_has_the_name_of_a_class_of_another_library_is_a_frame() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    with pytest.raises(wbc.WbcError, match="no frame 'Configuration'") as missing:
        robot.placement("Configuration")
    assert "in its place" not in str(missing.value)


def test_a_role_that_is_near_is_suggested_and_each_name_once() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    with pytest.raises(wbc.WbcError, match="no role 'left_hnd' of a frame; did you mean 'left_hand'"):
        robot.frames["left_hnd"]
    with pytest.raises(wbc.WbcError) as missing:
        wbc.balance_controller(robot, 0.005).add(wbc.PositionTask("left_han"))
    assert str(missing.value).count("'left_hand'") == 1
