"""Humanoids of example-robot-data that nobody prepared: each does from its file what docs/robots.md lists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import wbc
from wbc.robots import others
from wbc.robots.models.example_robots import share_directory
from wbc.sim import stand, walk

ROBOTS = {
    "talos_full_v2": ("talos_data/robots/talos_full_v2.urdf", "{}_sole_link", ("left", "right")),
    "g1 with hands": (
        "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
        "{}_ankle_roll_link",
        ("left", "right"),
    ),
    "romeo": ("romeo_description/urdf/romeo.urdf", "{}_sole", ("l", "r")),
    "romeo_small": ("romeo_description/urdf/romeo_small.urdf", "{}_sole", ("l", "r")),
    "icub": ("icub_description/robots/icub.urdf", "{}_sole", ("l", "r")),
    "alexander lower body": (
        "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
        "{}_FOOT",
        ("LEFT", "RIGHT"),
    ),
}
"""Name in the table → file, link of a sole, and its sides."""

MODES = ("position", "torque")


@pytest.fixture(params=ROBOTS)
def humanoid(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, str]:
    """Name in the table, and a TOML description as `wbc robots add --repair --package-dir` writes it."""
    file, sole, (left, right) = ROBOTS[request.param]
    share = share_directory()
    path = tmp_path / "robot.toml"
    path.write_text(
        f'file = "{share / "example-robot-data/robots" / file}"\npackage_dirs = ["{share}"]\nrepair = true\n'
        f'left_sole = "{sole.format(left)}"\nright_sole = "{sole.format(right)}"\n',
        encoding="utf-8",
    )
    return request.param, str(path)


def rows(heading: str) -> dict[str, list[str]]:
    """Return the rows of the first table under a heading of docs/robots.md: first cell → the others."""
    page = (Path(__file__).parents[2] / "docs/robots.md").read_text(encoding="utf-8")
    lines = page.partition(f"## {heading}\n")[2].partition("\n#")[0].splitlines()
    cells = [re.split(r"\s*\|\s*", line.strip("| ")) for line in lines if line.startswith("|")]
    return {cell.strip("`"): others for cell, *others in cells}


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


@pytest.mark.slow
def test_a_humanoid_from_its_file_stands_and_walks(humanoid: tuple[str, str]) -> None:
    """Each does what its row in docs/robots.md says."""
    name, file = humanoid
    _, _, stands, *walks = rows("Humanoids of other files")[name]
    for mode, says in zip(MODES, walks, strict=True):
        assert (stands == "yes") == stand(robot=file, seconds=5.0, mode=mode).upright
        result = walk(robot=file, foot="flat", terrain="flat", mode=mode, velocity=(0.12, 0.0, 0.0), steps=6)
        assert f"{result.steps_done}/{result.steps_planned}" == says


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jvrc1", "t1", "apollo"])
def test_a_humanoid_of_a_wheel_stands_and_walks(name: str) -> None:
    """Those of docs/robots.md that walk in both modes with default steps, where their wheel is installed."""
    if others()[name]:
        pytest.skip(f"{name}: {others()[name]}")
    for mode in MODES:
        assert stand(robot=name, seconds=5.0, mode=mode).upright
        result = walk(robot=name, foot="flat", terrain="flat", mode=mode, velocity=(0.12, 0.0, 0.0), steps=6)
        assert result.steps_done == 7
