"""Humanoids from their files: each does what its row of the table in docs/measured_walks.md says."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from mujoco_dynamics import assert_same_dynamics

import wbc
from wbc.robots.models.example_robots import share_directory
from wbc.robots.readers.compile_mjcf import compiled

PAGE = Path(__file__).parents[2] / "docs" / "measured_walks.md"
LAWS = {
    "with both kinds": {"LIPM", "stepping"},
    "with planned steps alone": {"LIPM"},
    "with free steps alone": {"stepping"},
    "with neither": set(),
}
"""Rows of the table → columns of the program whose walks arrive."""

PROGRAM = Path(__file__).parents[2] / "benchmarks" / "trials" / "robot_table.py"


def program() -> ModuleType:
    """Return the program that makes the table."""
    spec = importlib.util.spec_from_file_location("robot_table", PROGRAM)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLE = program()


def test_the_root_of_icub_looks_backward_and_is_turned() -> None:
    """Its left foot hangs to the right and its feet say nothing of where it looks: the knees do."""
    share = share_directory()
    icub = wbc.RobotDescription.from_urdf(
        share / "example-robot-data/robots/icub_description/robots/icub.urdf",
        left_sole="l_sole",
        right_sole="r_sole",
        package_dirs=(share,),
        repair=True,
    )
    assert any("new root link" in line for line in icub.derived)
    for sole in icub.soles:
        assert sole.length > 2.0 * sole.width  # its meshes are only right about the axis that they call up
        assert icub.ankle(sole.name)[0] == pytest.approx(-0.03, abs=2e-3)  # toes in front of the ankle


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", TABLE.ROBOTS)
def test_a_humanoid_from_its_file_does_what_the_table_says(name: str) -> None:
    if TABLE.ROBOTS[name][1] and TABLE.find(TABLE.ROBOTS[name][1]) is None:
        pytest.skip(f"wheel {TABLE.ROBOTS[name][0]} is not installed")
    rows = [line.strip("| ").split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines()]
    said = [
        row[0] for row in rows if row[0] in LAWS and name in map(str.strip, re.split(r"[,;:()`]", row[1]))
    ]
    made = TABLE.row(name)
    assert made["stands"] == "yes"
    assert [LAWS[each] for each in said] == [{law for law in ("LIPM", "stepping") if ":" not in made[law]}]


@pytest.mark.parametrize(
    "name", [name for name, (_, file, _) in TABLE.ROBOTS.items() if file.endswith(".xml")]
)
def test_robots_of_other_projects_have_the_dynamics_of_their_files(name: str) -> None:
    found = TABLE.find(TABLE.ROBOTS[name][1])
    if found is None:
        pytest.skip(f"wheel {TABLE.ROBOTS[name][0]} is not installed")
    meshes = TABLE.ROBOTS[name][2].get("meshes", True)
    assert_same_dynamics(TABLE.describe(name), compiled(found[0], meshes=meshes)[0])
