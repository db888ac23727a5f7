"""Inertias that no body can have, and simple shapes of links: what they become, in closed form."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from meshes import obj
from urdf_biped import FEET, biped, described

from wbc.base.errors import ModelError
from wbc.robots import RobotDescription
from wbc.robots.derivation.inertia import second_moments
from wbc.robots.derivation.link_shapes import link_shapes
from wbc.robots.urdf import HEAVIEST

SMALL = '<mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'


def inertial(mass: float, inertia: np.ndarray) -> str:
    """Return mass and inertia as elements of a URDF."""
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": float(inertia[i, j]) for i in range(3) for j in range(i, 3)}
    return f'<mass value="{mass}"/><inertia ' + " ".join(f'{k}="{v!r}"' for k, v in entries.items()) + "/>"


def test_second_moments_of_a_rod_a_plate_and_a_ball() -> None:
    """∫ x xᵀ dm: a rod along z has m l²/12 there alone, a plate in xy none along z, a ball m r²/5 everywhere."""
    rod, plate = np.diag([3.0, 3.0, 0.0]), np.diag([1.0, 2.0, 3.0])
    np.testing.assert_allclose(second_moments(rod), np.diag([0.0, 0.0, 3.0]))
    np.testing.assert_allclose(second_moments(plate), np.diag([2.0, 1.0, 0.0]))
    np.testing.assert_allclose(second_moments(0.4 * np.eye(3)), 0.2 * np.eye(3))


@pytest.mark.parametrize("mass", [2.0, 100.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_repaired_inertia_has_the_least_thickness_that_a_body_may_have(mass: float, turned: bool) -> None:
    """Second moments 0.01, 0.01 and −0.009: the last one becomes a thousandth of the largest, or m (1 mm)² if more."""
    axes = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0] if turned else np.eye(3)
    least = max(1e-3 * 0.01, mass * 1e-6)
    wrong, right = np.diag([0.001, 0.001, 0.02]), np.diag([0.01 + least, 0.01 + least, 0.02])
    xml = biped(shin=inertial(mass, axes @ wrong @ axes.T))
    model = RobotDescription.from_urdf(xml, repair=True, **FEET).pinocchio_model()
    body = model.inertias[model.getJointId("l_knee")]
    assert body.mass == mass
    np.testing.assert_allclose(body.inertia, axes @ right @ axes.T, atol=1e-12)


@pytest.mark.parametrize("thickness", [-1e-12, 1e-8])
def test_a_plate_without_thickness_is_no_body_and_one_with_some_is(thickness: float) -> None:
    """The moments of a plate in its plane add up to that across it: A + B = C."""
    xml = biped(shin=inertial(2.0, np.diag([0.01 + thickness, 0.02, 0.03])))
    if thickness > 0.0:
        RobotDescription.from_urdf(xml, **FEET)
    else:
        with pytest.raises(ModelError, match="violate A"):
            RobotDescription.from_urdf(xml, **FEET)


@pytest.mark.parametrize(("own", "mass"), [(0.0, 1e-3), (0.5, 0.5)])
def test_a_moving_link_without_mass_or_inertia_gets_a_gram_within_a_millimetre(
    own: float, mass: float
) -> None:
    """Or keeps its own mass: the inertia is that of a radius of gyration of √2 mm."""
    xml = biped(shin=inertial(own, np.zeros((3, 3))))
    with pytest.raises(
        ModelError, match="'l_knee_link': moves but has no " + ("rotational" if own else "mass")
    ):
        RobotDescription.from_urdf(xml, **FEET)
    description = RobotDescription.from_urdf(xml, repair=True, **FEET)
    body = description.pinocchio_model().inertias[description.pinocchio_model().getJointId("l_knee")]
    assert body.mass == pytest.approx(mass)
    np.testing.assert_allclose(body.inertia, 2.0 * mass * 1e-6 * np.eye(3), atol=1e-15)
    assert any(
        "'l_knee_link'" in line and f"repaired with {mass:g} kg" in line for line in description.derived
    )


def test_a_mass_point_is_a_body_where_what_is_fixed_to_it_turns() -> None:
    load = f'<link name="load"><inertial><mass value="0.3"/>{re.sub(".*?/><", "<", SMALL, count=1)}</inertial></link>'
    fix = '<joint name="load_fix" type="fixed"><parent link="{}"/><child link="load"/></joint>'
    xml = biped(shin=inertial(2.0, np.zeros((3, 3))), after=load + fix.format("l_knee_link"))
    with pytest.raises(ModelError) as error:
        RobotDescription.from_urdf(xml, **FEET)
    assert "'r_knee_link'" in str(error.value) and "'l_knee_link'" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (inertial(-1.0, np.eye(3)), "negative mass -1 kg"),
        (inertial(0.0, np.eye(3)), "inertia without mass"),
        (inertial(1.1 * HEAVIEST, np.eye(3)), "at most 1e.06, got 1.1e.06"),
        (inertial(1.0, 1.1 * HEAVIEST * np.eye(3)), "at most 1e.06, got 1 and 1.1e.06"),
        (inertial(1.0, -1.1 * HEAVIEST * np.eye(3)), "at most 1e.06"),
        (inertial(np.nan, np.eye(3)), "must be finite"),
        (inertial(1.0, np.inf * np.ones((3, 3))), "must be finite"),
        (inertial(1.0, np.eye(3)).replace('"1.0"', '"one"', 1), "must be numbers"),
    ],
)
def test_masses_and_inertias_that_are_none_are_refused_by_their_value(text: str, said: str) -> None:
    with pytest.raises(ModelError, match=f"'l_hip_pitch_link'.*{said}"):
        RobotDescription.from_urdf(biped(shin=text), **FEET)


@pytest.mark.parametrize("mass", [-1.0, 0.0])
def test_a_repaired_load_of_no_mass_is_none(mass: float) -> None:
    load = f'<link name="load"><inertial>{inertial(mass, 0.1 * np.eye(3))}</inertial></link>'
    fix = '<joint name="load_fix" type="fixed"><parent link="l_knee_link"/><child link="load"/></joint>'
    description = RobotDescription.from_urdf(biped(after=load + fix), repair=True, **FEET)
    own = described()
    np.testing.assert_allclose(description.robot().mass_matrix, own.robot().mass_matrix, atol=1e-9)
    assert any(
        "'load'" in line and "its inertial element was removed" in line for line in description.derived
    )


# Shapes of links


def trunk(shape: str, folder: Path | None = None, rpy: str = "0 0 0") -> RobotDescription:
    """Return the biped with a shape of its trunk, at (0.1, 0.2, 0.3) m."""
    own = f'<collision><origin xyz="0.1 0.2 0.3" rpy="{rpy}"/><geometry>{shape}</geometry></collision>'
    xml = biped().replace('<link name="trunk">', f'<link name="trunk">{own}', 1)
    return RobotDescription.from_urdf(xml, package_dirs=(folder,) if folder else (), **FEET)


@pytest.mark.parametrize("longest", range(3))
def test_a_box_is_a_capsule_along_its_longest_side_as_thick_as_the_second(longest: int) -> None:
    """Half sizes 0.05, 0.1 and 0.3 m: a radius of 0.1, ends 0.2 m from the middle."""
    half = np.roll([0.3, 0.05, 0.1], longest)
    rotation = pin.rpy.rpyToMatrix(0.3, -0.2, 0.5)
    (shape,) = trunk(
        f'<box size="{" ".join(map(str, 2.0 * half))}"/>', rpy="0.3 -0.2 0.5"
    ).collision_shapes()["trunk"]
    assert shape.radius == pytest.approx(0.1)
    ends = np.array([0.1, 0.2, 0.3]) + np.outer([-0.2, 0.2], rotation[:, longest])
    np.testing.assert_allclose([shape.start, shape.end], ends, atol=1e-12)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("shape", "radius", "half"),
    [
        ('<box size="0.2 0.2 0.2"/>', 0.1, 0.0),
        ('<sphere radius="0.15"/>', 0.15, 0.0),
        ('<cylinder radius="0.04" length="0.3"/>', 0.04, 0.15),
        ('<capsule radius="0.04" length="0.3"/>', 0.04, 0.15),
        ('<cylinder radius="0.04" length="0.001"/>', 0.04, 0.002),
    ],
)
def test_cubes_and_balls_are_spheres_and_rods_are_capsules(shape: str, radius: float, half: float) -> None:
    (made,) = trunk(shape).collision_shapes()["trunk"]
    assert made.radius == pytest.approx(radius)
    if half:
        np.testing.assert_allclose(np.subtract(made.end, made.start), [0.0, 0.0, 2.0 * half])  # type: ignore[union-attr]
        np.testing.assert_allclose(0.5 * np.add(made.end, made.start), [0.1, 0.2, 0.3])  # type: ignore[union-attr]
    else:
        np.testing.assert_allclose(made.centre, [0.1, 0.2, 0.3])  # type: ignore[union-attr]


def test_a_mesh_is_the_least_box_about_its_principal_axes(tmp_path: Path) -> None:
    """A box of 0.2 x 0.4 x 0.6 m that is turned and shifted in its file."""
    half, place = (
        np.array([0.1, 0.2, 0.3]),
        pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.3, 0.9), np.array([0.05, -0.1, 0.2])),
    )
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    (tmp_path / "box.obj").write_text(obj(corners @ place.rotation.T + place.translation))
    description = trunk("<mesh filename='box.obj'/>", tmp_path)
    (found,) = (s for s in link_shapes(description.mechanism, description.package_dirs) if s.link == "trunk")
    assert found.kind == "box" and sorted(found.size) == pytest.approx(half, abs=1e-6)
    np.testing.assert_allclose(found.place.translation, place.translation + [0.1, 0.2, 0.3], atol=1e-6)
    inside = [found.place.actInv(place.act(corner) + [0.1, 0.2, 0.3]) for corner in corners]
    np.testing.assert_allclose(np.abs(inside), np.tile(found.size, (8, 1)), atol=1e-6)
    assert np.linalg.det(found.place.rotation) == pytest.approx(1.0)
    (hull,) = description.collision_hulls()["trunk"]
    points = np.array(sorted(map(tuple, np.round(hull.points, 6))))  # type: ignore[union-attr]
    expected = corners @ place.rotation.T + place.translation + [0.1, 0.2, 0.3]
    np.testing.assert_allclose(points, sorted(map(tuple, np.round(expected, 6))), atol=2e-6)


def test_a_flat_mesh_is_a_thin_box(tmp_path: Path) -> None:
    corners = np.array([[x, y, 0.3] for x in (-0.1, 0.1) for y in (-0.2, 0.2)] * 2)
    (tmp_path / "flat.obj").write_text(obj(corners))
    (box,) = trunk("<mesh filename='flat.obj'/>", tmp_path).collision_hulls()["trunk"]
    assert sorted(box.size) == pytest.approx([0.004, 0.2, 0.4])  # type: ignore[union-attr]


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "capsule"])
def test_hulls_of_simple_shapes_are_these_shapes(kind: str) -> None:
    size = {"box": 'size="0.1 0.2 0.3"', "sphere": 'radius="0.1"'}.get(kind, 'radius="0.1" length="0.4"')
    (hull,) = trunk(f"<{kind} {size}/>", rpy="0.5 0 0").collision_hulls()["trunk"]
    axis = pin.rpy.rpyToMatrix(0.5, 0.0, 0.0)[:, 2]
    if kind == "box":
        assert tuple(hull.size) == pytest.approx((0.1, 0.2, 0.3))  # type: ignore[union-attr]
        np.testing.assert_allclose(hull.centre, [0.1, 0.2, 0.3])  # type: ignore[union-attr]
    elif kind == "sphere":
        assert hull.radius == 0.1  # type: ignore[union-attr]
    else:
        assert hull.radius == 0.1  # type: ignore[union-attr]
        np.testing.assert_allclose(hull.start, [0.1, 0.2, 0.3] - 0.2 * axis)  # type: ignore[union-attr]
        np.testing.assert_allclose(hull.end, [0.1, 0.2, 0.3] + 0.2 * axis)  # type: ignore[union-attr]
