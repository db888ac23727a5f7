"""Soles from shapes: where shapes touch the ground, which rectangle is a sole, and which frame it has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshes import FACES, dae, stl
from urdf_biped import ANKLE, FEET, FOOT_BOX, SHIN, THIGH, biped

from wbc.base.errors import ModelError
from wbc.core.frames import FrameDescription
from wbc.robots import RobotDescription
from wbc.robots.derivation.soles import footprint, plausible, points_of
from wbc.robots.mesh_files import mesh_defect

SIZES = {
    "box": np.array([0.1, 0.05, 0.02]),
    "sphere": np.array([0.03]),
    "capsule": np.array([0.02, 0.11]),
    "ellipsoid": np.array([0.1, 0.05, 0.02]),
    "cylinder": np.array([0.04, 0.13]),
}


def lowest(kind: str, size: np.ndarray, up: np.ndarray) -> float:
    """Return the height of the lowest point of a shape over its middle: its support function, with the other sign."""
    across = np.hypot(*up[:2])
    return -{
        "box": lambda: np.abs(size * up).sum(),
        "sphere": lambda: size[0],
        "capsule": lambda: size[0] + size[1] * abs(up[2]),
        "ellipsoid": lambda: np.linalg.norm(size * up),
        "cylinder": lambda: size[0] * across + size[1] * abs(up[2]),
    }[kind]()


@pytest.mark.parametrize("kind", SIZES)
def test_points_of_a_shape_are_on_it_and_have_the_lowest_one_of_every_direction(kind: str) -> None:
    """A cylinder has 32 on each rim, so that its lowest one is within a 200th of its radius."""
    size, rng = SIZES[kind], np.random.default_rng(6)
    directions = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(20, 3))])
    for up in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        points = points_of(kind, size, up)
        assert points is not None
        off = 0.005 * size[0] if kind == "cylinder" else 1e-12
        assert (points @ up).min() == pytest.approx(lowest(kind, size, up), abs=off)
        if kind == "box":
            np.testing.assert_allclose(np.abs(points), np.tile(size, (8, 1)))
        elif kind == "ellipsoid":
            np.testing.assert_allclose(np.linalg.norm(points / size, axis=1), 1.0)
        elif kind == "cylinder":
            np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), size[0])
            assert sorted(points[:, 2]) == pytest.approx([-size[1]] * 32 + [size[1]] * 32)
        elif kind == "capsule":
            ends = np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
            np.testing.assert_allclose(np.linalg.norm(points - ends, axis=1), size[0])
    assert points_of("plane", size, up) is None


def test_what_touches_the_ground_is_within_five_millimetres_of_the_lowest_point() -> None:
    points = np.array([[0.1, 0.0, -0.5], [-0.06, 0.03, -0.4951], [0.0, -0.05, -0.4951], [0.9, 0.9, -0.4949]])
    centre, length, width = footprint(points)
    assert (*centre, length, width) == pytest.approx((0.02, -0.01, -0.5, 0.16, 0.08))


@pytest.mark.parametrize(
    ("side", "leg", "possible"),
    [
        (0.029, np.inf, False),
        (0.031, np.inf, True),
        (0.59, np.inf, True),
        (0.61, np.inf, False),
        (0.019, 0.4, False),
        (0.021, 0.4, True),
        (0.029, 5.0, False),
        (0.0049, 0.01, False),
        (0.0051, 0.01, True),
    ],
)
def test_the_sides_of_a_sole_are_3_to_60_cm_and_of_a_small_robot_a_twentieth_of_its_leg(
    side: float, leg: float, possible: bool
) -> None:
    assert plausible(side, 0.1, leg) == plausible(0.1, side, leg) == plausible(side, side, leg) == possible


FOOT = np.array([[x, y, z] for x in (-0.05, 0.15) for y in (-0.04, 0.04) for z in (-ANKLE, 0.24)])
"""Corners of a foot that is higher than long: taken for the way across, its height would make it wider than long."""


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_collada_foot_that_is_wider_than_long_is_read_with_its_own_up_axis(up: str, tmp_path: Path) -> None:
    """With y up the file's axes are x, z and −y of the foot."""
    corners = FOOT[:, [0, 2, 1]] * [1.0, 1.0, -1.0] if up == "Y" else FOOT
    (tmp_path / "foot.dae").write_text(dae(corners, "", up))
    shape = "<collision><geometry><mesh filename='foot.dae'/></geometry></collision>"
    description = RobotDescription.from_urdf(biped(geometry=shape), package_dirs=(tmp_path,), **FEET)
    for sole in description.soles:
        assert (sole.length, sole.width) == pytest.approx((0.2, 0.08), abs=1e-6)
        np.testing.assert_allclose(description.ankle(sole.name), [-0.05, 0.0, ANKLE], atol=1e-6)


def test_collision_shapes_decide_before_visual_ones_unless_they_are_no_sole() -> None:
    seen = FOOT_BOX.replace("collision", "visual").replace("0.20 0.09", "0.18 0.08")
    small, wide = FOOT_BOX.replace("0.20 0.09", "0.02 0.01"), FOOT_BOX.replace("0.20 0.09", "0.1 0.2")
    for shapes, size in (
        (FOOT_BOX + seen, (0.2, 0.09)),
        (small + seen, (0.18, 0.08)),
        (wide + seen, (0.18, 0.08)),
        (wide, (0.1, 0.2)),
        (wide + small.replace("collision", "visual"), (0.1, 0.2)),
    ):
        sole = RobotDescription.from_urdf(biped(geometry=shapes), **FEET).soles[0]
        assert (sole.length, sole.width) == pytest.approx(size)


@pytest.mark.parametrize(("away", "own"), [(0.0009, True), (0.0011, False)])
def test_a_frame_at_the_centre_of_its_sole_is_the_frame_of_the_sole(away: float, own: bool) -> None:
    """Within a millimetre; else a new one is put there, and its place is told."""
    frames = "".join(
        f'<link name="{s}_at"/><joint name="{s}_fix" type="fixed"><parent link="{s}_ankle_roll_link"/>'
        f'<child link="{s}_at"/><origin xyz="{0.03 + away} 0 {-ANKLE}"/></joint>'
        for s in "lr"
    )
    description = RobotDescription.from_urdf(biped(after=frames), left_sole="l_at", right_sole="r_at")
    assert [sole.frame for sole in description.soles] == (
        ["l_at", "r_at"] if own else ["left_foot_sole", "right_foot_sole"]
    )
    assert "left_foot: 200 x 90 mm, from the geometry of the foot" in description.derived
    said = "left_foot: sole frame 'left_foot_sole' at (-1, 0, 0) mm from 'l_at'"
    assert (said in description.derived) != own
    robot = description.robot()
    assert robot.placement(description.soles[0].frame).translation[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("z", [0.0, -0.5, 0.3])
def test_a_foot_without_geometry_has_the_sole_of_a_leg_of_its_length(z: float) -> None:
    """Length and breadth of a foot over the height of the hip, wherever the root is: 0.152 and 0.055 over 0.530."""
    xml = biped(geometry="")
    for y in (0.1, -0.1):
        old = f'xyz="0 {y} 0"/><axis xyz="0 0 1"/>'
        assert old in xml
        xml = xml.replace(old, f'xyz="0 {y} {z}"/><axis xyz="0 0 1"/>')
    below = {
        f"{side}_sole": FrameDescription("at", f"{side[0]}_ankle_roll_link", (0.0, 0.0, -ANKLE))
        for side in ("left", "right")
    }
    description = RobotDescription.from_urdf(xml, **below)
    for sole in description.soles:
        sides = np.array([0.152, 0.055]) / 0.530 * (THIGH + SHIN + ANKLE)
        assert (sole.length, sole.width) == pytest.approx(tuple(sides))
    assert f"left_foot: {1e3 * sides[0]:.0f} x {1e3 * sides[1]:.0f} mm, from the hip" in "".join(
        description.derived
    )
    assert f"from the hip height {THIGH + SHIN + ANKLE:.3f} m" in "".join(description.derived)


def test_a_sole_is_told_with_its_place_from_the_frame_that_was_given() -> None:
    for y, said in ((0.0, "0"), (-2e-4, "0"), (-7e-4, "-1"), (0.012, "12")):
        foot = FOOT_BOX.replace('xyz="0.03 0 ', f'xyz="0.03 {y} ')
        derived = RobotDescription.from_urdf(biped(geometry=foot), **FEET).derived
        told = f"left_foot: sole frame 'left_foot_sole' at (30, {said}, -60) mm from 'l_ankle_roll_link'"
        assert told in derived


def test_soles_above_the_centre_of_mass_are_refused() -> None:
    """A robot that stands on its head, whose z axis points down."""
    xml = biped().replace('xyz="0 0 -', 'xyz="0 0 ').replace('xyz="0.03 0 -0.05"', 'xyz="0.03 0 1.5"')
    xml = xml.replace("0.01 0 0.2", "0.01 0 -0.2")
    with pytest.raises(ModelError, match="above the centre of mass: the z axis of the root must point up"):
        RobotDescription.from_urdf(xml, **FEET)


def test_a_binary_stl_without_facets_is_cut_off_and_one_with_all_of_them_is_whole(tmp_path: Path) -> None:
    whole = stl(FOOT)
    assert len(whole) == 84 + 50 * len(FACES)
    file = tmp_path / "foot.stl"
    for content, said in (
        (whole, ""),
        (whole + b"more", ""),
        (whole[:-1], "cut off"),
        (bytes(84), "cut off"),
    ):
        file.write_bytes(content)
        assert said in mesh_defect(file) and bool(mesh_defect(file)) == bool(said)
