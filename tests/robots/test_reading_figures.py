"""Figures and rules of reading robots: files of packages, gains by patterns, carriers of links, numbers of bodies."""

from __future__ import annotations

from pathlib import Path

import pytest
from mjcf_biped import MOTORS, biped

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.robots import RobotDescription, urdf
from wbc.robots.derivation.inertia import _carriers
from wbc.robots.derivation.servo import read_gains
from wbc.robots.mesh_files import resolve
from wbc.robots.notes import listed
from wbc.robots.readers.compile_mjcf import MOST_LINKS


@pytest.mark.parametrize(
    "name", ["package://a.stl", "package://some_package/a.stl", "model://a.stl", "a.stl"]
)
def test_a_mesh_of_a_package_is_found_in_a_folder_with_and_without_its_package(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "a.stl").touch()
    assert resolve(name, (str(tmp_path),)) == tmp_path / "a.stl"
    assert resolve(name.replace("a.stl", "b.stl"), (str(tmp_path),)) is None


def test_gains_of_a_pattern_are_those_of_all_joints_that_fit() -> None:
    names = ("left_knee", "right_knee", "waist")
    assert read_gains(["*knee*=100,2"], names) == {"left_knee": (100.0, 2.0), "right_knee": (100.0, 2.0)}
    assert read_gains(["*=1,0.5", "waist=7,3"], names)["waist"] == (7.0, 3.0)
    for text in ("*elbow*=1,2", "*knee*=1", "*knee*"):
        with pytest.raises(InputError):
            read_gains([text], names)


def test_links_are_carried_by_the_link_that_moves_or_by_the_root_unless_it_is_bolted() -> None:
    joints = (("fixed", "a", "b"), ("revolute", "b", "c"), ("fixed", "c", "d"))
    text = "".join(f'<link name="{name}"/>' for name in "abcd") + "".join(
        f'<joint name="{parent}{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for kind, parent, child in joints
    )
    robot = urdf.read(f"<robot>{text}</robot>")
    assert _carriers(robot, False) == {"a": "a", "b": "a", "c": "c", "d": "c"}
    assert _carriers(robot, True) == {"c": "c", "d": "c"}


def test_an_actuator_without_gear_drives_nothing() -> None:
    """A coupling leads a joint that nothing drives."""
    tie = (
        '<equality><joint joint1="right_shoulder" joint2="left_shoulder" polycoef="0 0.5 0 0 0"/></equality>'
    )
    motor = '<motor joint="right_shoulder"/>'
    loose = MOTORS.replace(motor, '<motor joint="right_shoulder" gear="0"/>')
    assert motor in MOTORS
    assert "right_shoulder" in RobotDescription.from_mjcf(biped(drives=loose, extra=tie)).couplings
    assert "right_shoulder" not in RobotDescription.from_mjcf(biped(extra=tie)).couplings


@pytest.mark.parametrize(("count", "refused"), [(MOST_LINKS - 1, True), (2, False)])
def test_copies_count_as_bodies(count: int, refused: bool) -> None:
    copies = (
        f'<worldbody><replicate count="{count}"><body><geom size="1"/></body></replicate><body/></worldbody>'
    )
    with pytest.raises(ModelError) as error:
        RobotDescription.from_mjcf(f"<mujoco>{copies}</mujoco>")
    assert (f"may have {MOST_LINKS} bodies, got {MOST_LINKS + 1}" in str(error.value)) == refused


@pytest.mark.parametrize(("count", "rest"), [(6, ""), (7, " and 1 more"), (9, " and 3 more")])
def test_six_of_many_names_are_listed_and_the_others_counted(count: int, rest: str) -> None:
    names = [f"joint {k}" for k in range(count)]
    assert listed(names) == ", ".join(names[:6]) + rest


def test_talos_sits_as_its_srdf_says() -> None:
    half_sitting = wbc.load_robot("talos").half_sitting
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = [half_sitting[f"arm_{side}_{i}_joint"] for i in range(1, 8)]
        expected = [sign * 0.25847, sign * 0.173046, -sign * 0.0002, -0.525366, 0.0, 0.0, 0.1]
        assert arm == pytest.approx(expected, abs=1e-9)
