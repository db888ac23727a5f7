"""Marks and shapes: where each stands, how large it is, and from which value on it is drawn."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Literal

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from wbc.app.drift import MIN_LOAD, Drift, sole_corners
from wbc.app.view import stage, walk_marks
from wbc.app.view.marks import (
    DCM_COLOUR,
    GROUND_COLOUR,
    LIFT,
    LINE,
    NOTICED,
    POINT,
    SCAN_COLOUR,
    SIDE_COLOURS,
    SOFT_COLOUR,
    STIFF_COLOUR,
    Force,
    Mark,
    Picture,
    Scale,
    css,
    force_marks,
    ground_mark,
    legend,
    mark_mesh,
    planned_step,
    real_step,
    ring,
    scan_mark,
    sole_force,
    stiffness_colour,
    walk_text,
)
from wbc.app.view.meshes import (
    ENDLESS,
    PLANE_DEPTH,
    RINGS,
    SHADES,
    BodyMesh,
    Mesh,
    ball,
    body_meshes,
    box,
    geom_mesh,
    merged,
    normals,
)
from wbc.app.view.stage import DescribedStage, DrawnScene, SimulatedStage, zmp_of
from wbc.app.view.walk_marks import MAP_PERIOD, MAX_STEPS, WalkMarks, outside_force
from wbc.core.robot import GRAVITY
from wbc.core.signals import Measurement
from wbc.feet.soles.actuator import STIFFEST
from wbc.robots import load
from wbc.sim import Plant
from wbc.walking.plans.footsteps import Footstep

SCALE = Scale(0.8, 400.0)
RED = (1.0, 0.0, 0.0, 1.0)
UP = np.array([0.0, 0.0, LIFT])


def by_name(marks: list[Mark]) -> dict[str, Mark]:
    return {mark.name: mark for mark in marks}


# ---- balance --------------------------------------------------------------------------------------------------------


def test_points_of_balance_stand_where_they_are_and_their_shadow_on_the_ground() -> None:
    com, zmp, dcm = np.array([1.0, 2.0, 3.0]), np.array([1.1, 2.1, 0.3]), np.array([1.2, 2.2])
    area = np.array([(0.0, 0.0, 0.1), (1.0, 0.0, 0.2), (0.0, 1.0, 0.3), (0.2, 0.2, 0.4)])
    picture = Picture(0.0)
    picture.add_balance(SCALE, com, 0.25, zmp, dcm, area)
    marks = by_name(picture.marks)
    assert set(marks) == {"com", "com shadow", "zmp", "dcm", "support"}
    assert marks["com"].points.tolist() == [[1.0, 2.0, 3.0]]
    assert marks["com shadow"].points.tolist() == [[1.0, 2.0, 0.25]]
    assert marks["zmp"].points.tolist() == [[1.1, 2.1, 0.3]]
    np.testing.assert_allclose(marks["dcm"].points, [[1.2, 2.2, 0.25 + LIFT]])
    sizes = {name: mark.size / (0.8 * POINT) for name, mark in marks.items() if name != "support"}
    assert sizes == pytest.approx({"com": 1.0, "com shadow": 0.6, "zmp": 1.0, "dcm": 1.0})
    np.testing.assert_allclose(
        marks["support"].points, [(x, y, 0.25 + LIFT) for x, y in ((0, 0), (1, 0), (0, 1))]
    )


@pytest.mark.parametrize("unknown", [None, np.array([0.0, np.nan, 0.0])])
def test_points_that_are_not_known_and_supports_without_an_area_are_not_drawn(unknown: Any) -> None:
    line = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    for support in (None, line[:2], line):
        picture = Picture(0.0)
        picture.add_balance(SCALE, np.ones(3), 0.0, unknown, unknown, support)
        assert set(by_name(picture.marks)) == {"com", "com shadow"}


def test_a_picture_has_the_texts_and_marks_of_its_instant() -> None:
    own = Mark("own", "ball", np.zeros((1, 3)), RED)
    picture = Picture(2.0, [own], ["more"])
    picture.add_balance(SCALE, np.array([1.0, 2.0, 3.0]), 0.0)
    picture.add_planned(SCALE, {"ZMP": np.array([0.5, 0.0, 0.1]), "DCM": np.array([np.nan, 0.0, 0.0])})
    picture.add_soles([[4, 5], [7]], [STIFFEST, math.nan])
    assert set(by_name(picture.marks)) == {"com", "com shadow", "ZMP planned", "own"}
    assert picture.text == ["more", f"soles {STIFFEST:.1f} and nan Nm/rad"]
    assert picture.colours == {4: STIFF_COLOUR, 5: STIFF_COLOUR} and picture.lines == [
        "2.00 s",
        *picture.text,
    ]
    rigid = Picture(2.0)
    rigid.add_soles([[4, 5], [7]], [math.nan, math.nan])
    assert not rigid.colours and not rigid.text


def test_of_a_walk_the_phase_is_told_the_foot_that_swings_and_the_steps_done() -> None:
    assert walk_text("single support", "left", 3) == "single support, left foot swings, 3 steps done"
    assert walk_text("double support", "left", 0) == "double support, 0 steps done"
    assert walk_text("single support", None, 1) == "single support, 1 steps done"


def test_the_force_of_a_sole_acts_at_its_centre_of_pressure_in_the_world() -> None:
    """F = R f at p + R (−my/fz, mx/fz, 0); a sole that bears less than 1 N, or is not measured, has none."""
    turn = pin.rpy.rpyToMatrix(0.2, -0.3, 0.7)
    place, wrench = np.array([1.0, -2.0, 0.5]), np.array([10.0, -5.0, 100.0, 4.0, -3.0, 1.0])
    (force,) = sole_force(place, turn, wrench)
    assert force.kind == "ground"
    np.testing.assert_allclose(force.point, place + turn @ (0.03, 0.04, 0.0))
    np.testing.assert_allclose(force.force, turn @ (10.0, -5.0, 100.0))
    assert sole_force(place, turn, wrench * (1, 1, 0.0101, 1, 1, 1))
    assert not sole_force(place, turn, wrench * (1, 1, 0.0099, 1, 1, 1))
    assert not sole_force(place, turn, wrench * (np.nan, 1, 1, 1, 1, 1))


def test_arrows_are_thin_and_a_force_of_nothing_has_no_length() -> None:
    (mark,) = force_marks(SCALE, [Force("ground", np.ones(3), np.zeros(3))])
    assert mark.size == pytest.approx(0.008) and (mark.points == 1.0).all()


# ---- footsteps and the ground ---------------------------------------------------------------------------------------


def test_what_lies_on_the_ground_is_lifted_above_it() -> None:
    corners = np.array([(0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (1.0, 1.0, 0.1), (0.0, 1.0, 0.2)])
    planned, real = planned_step(3, "left", corners), real_step(4, "right", corners)
    np.testing.assert_allclose(planned.points, np.concatenate([corners, corners[:1]]) + UP)
    np.testing.assert_allclose(real.points, corners + UP)
    assert (planned.kind, real.kind) == ("line", "area")
    assert planned.colour == SIDE_COLOURS["left"] and real.colour[:3] == SIDE_COLOURS["right"][:3]
    assert real.colour[3] < 1.0, "what is below is seen"
    scan, ground = scan_mark(2, corners), ground_mark(corners)
    np.testing.assert_allclose(scan.points, corners + UP)
    np.testing.assert_allclose(ground.points, corners + UP)
    assert (scan.kind, scan.size, scan.colour) == ("line", pytest.approx(2.0 * LINE), SCAN_COLOUR)
    assert (ground.kind, ground.size, ground.colour) == ("cloud", pytest.approx(0.5 * LINE), GROUND_COLOUR)


def test_a_ring_is_a_level_circle_around_its_point() -> None:
    centre = np.array([0.3, -0.2, 0.5])
    mark = ring("DCM", DCM_COLOUR, centre, SCALE)
    away = mark.points - centre
    np.testing.assert_allclose(away[:, 2], LIFT)
    np.testing.assert_allclose(np.hypot(*away[:, :2].T), 1.6 * POINT * 0.8)
    np.testing.assert_allclose(away[0], away[-1], atol=1e-12)
    assert mark.name == "DCM planned" and mark.colour == DCM_COLOUR


def test_corners_of_a_sole_are_half_its_size_from_its_centre() -> None:
    turn, place = pin.rpy.rpyToMatrix(0.1, 0.2, 0.5), np.array([1.0, 2.0, 0.3])
    found = sole_corners((0.2, 0.1), place, turn)
    wanted = [turn @ (x, y, 0.0) + place for x, y in ((0.1, 0.05), (-0.1, 0.05), (-0.1, -0.05), (0.1, -0.05))]
    np.testing.assert_allclose(found, wanted)


# ---- colours --------------------------------------------------------------------------------------------------------


def test_soles_go_from_soft_to_stiff_on_a_logarithmic_scale() -> None:
    """Half of the way at √(1 + stiffest) − 1: share = ln(1 + k) / ln(1 + stiffest)."""
    assert stiffness_colour(0.0) == SOFT_COLOUR == stiffness_colour(-5.0)
    assert stiffness_colour(STIFFEST) == pytest.approx(STIFF_COLOUR) == stiffness_colour(10.0 * STIFFEST)
    middle = 0.5 * (np.array(SOFT_COLOUR) + STIFF_COLOUR)
    np.testing.assert_allclose(stiffness_colour(math.sqrt(1.0 + STIFFEST) - 1.0), middle, atol=1e-4)


def test_a_legend_has_each_meaning_once_and_that_of_coloured_soles() -> None:
    marks = [
        Mark("a", "ball", np.zeros((1, 3)), RED, meaning="point"),
        Mark("b", "ball", np.zeros((1, 3)), RED),
    ]
    assert legend(Picture(0.0, marks)) == {"point": RED}
    soles = legend(Picture(0.0, marks, colours={1: RED}))
    assert list(soles.values()) == [RED, SOFT_COLOUR, STIFF_COLOUR]
    assert css((0.0, 0.5, 1.0, 0.3)) == "rgb(0, 128, 255)"


class Told(DrawnScene):
    """A scene that keeps what it is told."""

    def __init__(self, *bodies: int) -> None:
        """Have an empty mesh for each of some bodies, which stand still."""
        super().__init__(SimpleNamespace(model=mujoco.MjModel.from_xml_string("<mujoco/>")))  # type: ignore[arg-type]
        self.meshes = [
            BodyMesh(body, OWN, Mesh(np.empty((0, 3)), np.empty((0, 3), np.uint32))) for body in bodies
        ]
        self.told: list[Any] = []

    def draw(self, picture: Picture) -> None:
        """See `DrawnScene`; only this picture is kept."""
        self.told = []
        super().draw(picture)

    def _move(self, body: int) -> None:
        raise AssertionError

    def _paint(self, number: int, colour: Any) -> None:
        self.told.append((number, colour))

    def _show(self, mark: Mark) -> None:
        self.told.append(("show", mark.name))

    def _erase(self, mark: Mark) -> None:
        self.told.append(("erase", mark.name))


OWN = (0.1, 0.2, 0.3, 1.0)


def test_a_mesh_is_painted_at_first_and_when_its_body_has_another_colour_and_again_when_it_has_none() -> None:
    other, scene = (0.9, 0.2, 0.3, 1.0), Told(1, 2, 1)
    for colours, painted in (
        ({2: other}, [(0, OWN), (1, other), (2, OWN)]),
        ({}, [(1, OWN)]),
        ({1: other}, [(0, other), (2, other)]),
        ({1: other, 2: OWN}, []),
        ({}, [(0, OWN), (2, OWN)]),
    ):
        scene.draw(Picture(0.0, colours=colours))
        assert scene.told == painted


def test_a_mark_is_drawn_anew_when_it_is_another_one() -> None:
    """Each is compared with what is shown, so that a slow motion is seen, too."""
    points = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    mark = Mark("m", "line", points, RED)
    for size, same in (
        (0.8 * NOTICED, True),
        (-0.8 * NOTICED, True),
        (1.2 * NOTICED, False),
        (-1.2 * NOTICED, False),
    ):
        moved = points.copy()
        moved[1, 1] += size
        assert mark.looks_like(Mark("m", "line", moved, RED)) is same
    assert not mark.looks_like(Mark("m", "line", points, DCM_COLOUR))
    assert not mark.looks_like(Mark("m", "line", points[:1], RED))
    assert not mark.looks_like(replace(mark, size=2.0 * mark.size))
    assert not mark.looks_like(replace(mark, kind="arrow"))
    scene = Told()
    for marks, told in (
        ([mark], [("show", "m")]),
        ([mark], []),
        ([replace(mark, kind="cloud")], [("erase", "m"), ("show", "m")]),
        ([], [("erase", "m")]),
        ([mark], [("show", "m")]),
    ):
        scene.draw(Picture(0.0, marks))
        assert scene.told == told
    drawn = 0
    for step in range(1, 9):
        scene.draw(Picture(0.0, [Mark("m", "line", points + 0.4 * step * NOTICED, RED)]))
        drawn += len(scene.told)
    assert drawn == 2, "at 1.2 and at 2.4 of what is noticed"


# ---- triangles ------------------------------------------------------------------------------------------------------


def mesh_of(kind: Literal["ball", "arrow", "line", "area", "cloud"], points: Any, size: float) -> Any:
    return mark_mesh(Mark("m", kind, np.array(points, dtype=float), RED, size))


def test_lines_are_level_bands_of_their_width_and_clouds_level_squares() -> None:
    vertices, faces = mesh_of("line", [(0.0, 0.0, 1.0), (3.0, 4.0, 1.0), (3.0, 9.0, 1.0)], 0.2)
    aside = np.array([-0.08, 0.06, 0.0])  # 0.1 to the left of (3, 4) / 5
    first = [
        (0.0, 0.0, 1.0) - aside,
        (3.0, 4.0, 1.0) - aside,
        (3.0, 4.0, 1.0) + aside,
        (0.0, 0.0, 1.0) + aside,
    ]
    np.testing.assert_allclose(vertices[:4], first)
    np.testing.assert_allclose(vertices[4:], [(3.1, 4, 1), (3.1, 9, 1), (2.9, 9, 1), (2.9, 4, 1)])
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    vertices, faces = mesh_of("line", [(0.0, 0.0, 0.0)] * 2, 0.2)
    assert np.isfinite(vertices).all(), "a line of no length"
    vertices, faces = mesh_of("cloud", [(1.0, 2.0, 0.5), (5.0, 5.0, 0.0)], 0.1)
    np.testing.assert_allclose(
        vertices[:4], [(1.1, 2.1, 0.5), (0.9, 2.1, 0.5), (0.9, 1.9, 0.5), (1.1, 1.9, 0.5)]
    )
    assert faces.max() == 7 and len(faces) == 4


# ---- the model ------------------------------------------------------------------------------------------------------

WORLD = """<mujoco><asset>
<material name="blue" rgba="0 0 1 1"/>
<hfield name="low" nrow="2" ncol="2" size="1 1 .1 .1" elevation="0 0 0 1"/>
<hfield name="high" nrow="2" ncol="3" size="3 2 .6 .1" elevation="0 1 2 3 4 4"/>
<mesh name="one" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/><mesh name="two" vertex="0 0 0 3 0 0 0 3 0 0 0 3"/>
</asset><worldbody>
<geom name="plain" type="box" size=".1 .1 .1" pos="1 0 0" rgba=".3 .3 .3 1"/>
<geom name="clear" type="box" size=".1 .1 .1" rgba="1 0 0 0"/>
<geom name="hidden" type="box" size=".1 .1 .1" group="3"/>
<geom name="floor" type="plane" size="0 0 1" material="blue"/>
<geom name="painted" type="box" size=".1 .1 .1" material="blue" rgba="1 1 0 1"/>
<geom name="low" type="hfield" hfield="low"/><geom name="high" type="hfield" hfield="high"/>
<body name="held" mocap="true" pos="0 0 5"><geom name="mocap" size=".1" rgba=".3 .3 .3 1"/></body>
<body name="moving" pos="0 0 2" euler="0 0 90"><freejoint/>
<geom name="arm" type="box" size=".1 .2 .3" pos="1 0 0" rgba=".3 .3 .3 1"/>
<geom name="one" type="mesh" mesh="one"/><geom name="two" type="mesh" mesh="two"/></body>
</worldbody></mujoco>"""


def test_bodies_have_their_colours_and_what_is_not_seen_is_not_drawn() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    drawn = {(each.body, each.colour): each.mesh for each in body_meshes(model)}
    held, moving = model.body("held").id, model.body("moving").id
    grey = round(0.3 * SHADES) / SHADES
    assert {colour for body, colour in drawn if body == 0} == {
        (grey, grey, grey, 1.0),
        (0.0, 0.0, 1.0, 1.0),
        (1.0, 1.0, 0.0, 1.0),
        (0.5, 0.5, 0.5, 1.0),
    }
    plain = drawn[0, (grey, grey, grey, 1.0)].vertices
    np.testing.assert_allclose([plain.min(axis=0), plain.max(axis=0)], [(0.9, -0.1, -0.1), (1.1, 0.1, 0.1)])
    own = pytest.approx((0.3, 0.3, 0.3, 1.0))
    assert [colour for body, colour in drawn if body == held] == [own], "moved by a program, it is no ground"
    arm = next(mesh.vertices for (body, colour), mesh in drawn.items() if body == moving and colour == own)
    np.testing.assert_allclose([arm.min(axis=0), arm.max(axis=0)], [(0.9, -0.2, -0.3), (1.1, 0.2, 0.3)])
    assert {body for body, _ in drawn} == {0, held, moving}


def test_a_plane_without_an_end_has_one_and_lies_a_little_low() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    mesh = geom_mesh(model, model.geom("floor").id)
    assert mesh is not None and np.abs(mesh.vertices).max(axis=0) == pytest.approx(
        [ENDLESS, ENDLESS, PLANE_DEPTH]
    )
    assert (mesh.vertices[:, 2] < 0.0).all()


def test_height_fields_and_meshes_are_those_of_their_geoms() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    field = geom_mesh(model, model.geom("high").id)
    assert field is not None
    heights = {(round(x), round(y)): z for x, y, z in field.vertices}
    rows = {2: (0.0, 1.0, 2.0), -2: (3.0, 4.0, 4.0)}  # as in a picture, the first row is the far one
    assert heights == pytest.approx(
        {(x, y): 0.6 * z / 4.0 for y, row in rows.items() for x, z in zip((-3, 0, 3), row, strict=True)}
    )
    for name, size in (("one", 1.0), ("two", 3.0)):
        mesh = geom_mesh(model, model.geom(name).id)
        assert mesh is not None and len(mesh.faces) == 4 and len(mesh.vertices) == 12, "edges are sharp"
        a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(size**3 / 6.0)


@pytest.mark.parametrize("kind", ["cylinder", "box"])
def test_faces_that_meet_at_a_sharp_edge_have_corners_of_their_own(kind: str) -> None:
    """So that no view shades over the edge; each face is flat, or goes around the side."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="{kind}" size="0.1 0.3 0.2"/></worldbody></mujoco>'
    )
    mesh = geom_mesh(model, 0)
    assert mesh is not None
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sides: dict[tuple[int, ...], set[int]] = {}
    for normal, face in zip(normals, mesh.faces, strict=True):
        flat = kind == "box" or abs(normal[2]) > 0.5
        side = tuple(np.round(normal).astype(int).tolist()) if flat else (9,)
        sides.setdefault(side, set()).update(face.tolist())
    assert len(sides) == (6 if kind == "box" else 3)
    for one, other in itertools.combinations(sides.values(), 2):
        assert not one & other
    assert (np.einsum("ij,ij->i", normals, a) > 0.0).all(), "they look outwards"


def test_normals_of_a_ball_point_away_from_its_middle() -> None:
    mesh = ball(2.0, 2.0, 2.0)
    away = (normals(mesh) * mesh.vertices / 2.0).sum(axis=1)
    assert away.min() > math.cos(math.pi / (RINGS - 1)), "within the angle between two rings"


def test_merged_meshes_keep_their_triangles() -> None:
    parts = [box(1.0, 2.0, 3.0), ball(0.5, 0.5, 0.5), box(0.1, 0.1, 0.1)]
    whole = merged(parts)
    np.testing.assert_array_equal(
        whole.vertices[whole.faces], np.concatenate([part.vertices[part.faces] for part in parts])
    )


# ---- stages ---------------------------------------------------------------------------------------------------------


def test_the_zmp_of_a_wrench_lies_on_the_level_that_is_asked_for() -> None:
    """A force F at a point p: where its line crosses the level."""
    point, force = np.array([0.3, -0.2, 0.1]), np.array([20.0, -10.0, 100.0])
    wrench = np.concatenate([force, np.cross(point, force)])
    np.testing.assert_allclose(zmp_of(wrench, 0.6), point + 0.005 * force)
    assert zmp_of(np.zeros(6), 0.6) is None


def test_contacts_with_hardly_a_load_are_no_corners_and_a_robot_in_the_air_has_no_support(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant = Plant(load("hrp4_class"))
    shown, truth = SimulatedStage(plant, None), plant.truth()
    places = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-9.0, 0.0, 0.0)])
    weight = plant.robot.mass * GRAVITY
    assert shown.scale.weight == pytest.approx(weight)
    assert shown.scale.height == pytest.approx(truth.com[2] - plant.terrain.surface.floor)
    forces = np.zeros((4, 3))
    forces[:, 2] = weight * np.array([1.01 * MIN_LOAD, 0.5, 0.4, 0.99 * MIN_LOAD])

    def with_contacts(count: int, velocity: tuple[float, ...] = (0.0, 0.0, 0.0)) -> dict[str, Mark]:
        values = {"contact_position": places[:count], "contact_force": forces[:count]}
        values |= {"contact_sole": np.zeros(count, dtype=int), "com_velocity": np.array(velocity)}
        changed = replace(truth, **values)  # type: ignore[arg-type]
        monkeypatch.setattr(type(plant), "truth", lambda self: changed)
        return by_name(shown.picture().marks)

    marks = with_contacts(4)
    assert sorted(map(tuple, marks["support"].points[:, :2].tolist())) == [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)]
    air = with_contacts(0, (0.3, -0.6, 0.0))
    assert not {"support", "zmp", "ground force 0"} & set(air)
    omega = math.sqrt(GRAVITY / shown.scale.height)
    np.testing.assert_allclose(
        air["dcm"].points[0],
        [*(truth.com[:2] + np.array([0.3, -0.6]) / omega), plant.terrain.surface.floor + LIFT],
    )
    np.testing.assert_allclose(air["com shadow"].points[0], [*truth.com[:2], plant.terrain.surface.floor])


def test_only_pushes_on_the_robot_are_shown() -> None:
    cup = '<mujoco><worldbody><body name="cup" pos="2 0 1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    plant = Plant(load("hrp4_class"), scene=cup)
    shown = SimulatedStage(plant, None)
    plant.data.xfrc_applied[plant.model.body("scene/cup").id, 0] = 5.0
    assert "push force 0" not in by_name(shown.picture().marks)


def test_a_described_robot_has_the_zmp_of_what_its_soles_feel() -> None:
    """Both soles bear the weight straight from below: the ZMP is between them, on the level of the lower one."""
    robot = load("hrp4_class").robot()
    shown = DescribedStage(load("hrp4_class"))
    weight = robot.mass * GRAVITY
    assert shown.scale == pytest.approx((robot.com[2], weight))
    left, right = (robot.placement(sole.frame).translation for sole in robot.soles)
    wrenches = np.zeros((2, 6))
    wrenches[:, 2] = 0.25 * weight, 0.75 * weight
    read = replace(Measurement.resting(robot), time=3.5, sole_wrench=wrenches)
    assert shown.picture() is None
    assert shown.take(robot, read) == 3.5
    picture = shown.picture()
    assert picture is not None
    marks = by_name(picture.marks)
    assert picture.time == 3.5
    np.testing.assert_allclose(marks["zmp"].points[0], 0.25 * left + 0.75 * right, atol=1e-9)
    np.testing.assert_allclose(marks["ground force 1"].points[0], right, atol=1e-9)
    assert marks["com shadow"].points[0, 2] == pytest.approx(min(left[2], right[2]), abs=1e-9)
    for link in ("head", robot.base_frame):
        assert shown.data.body(link).xpos == pytest.approx(robot.placement(link).translation, abs=1e-9)
    shown.take(robot.half_sitting, replace(read, time=5.0, sole_wrench=None))
    without = shown.picture()
    assert without is not None
    assert set(by_name(without.marks)) == {"com", "com shadow"} and without.time == 5.0
    assert shown.take(robot, None) == 5.0, "nothing was measured since"
    for other, said in ((load("g1").robot(), "hrp4_class"), (np.zeros(3), "shape"), (None, "state")):
        with pytest.raises(stage.InputError, match=said):
            shown.take(other, None)
    assert shown.picture() is not None, "the last good state"


# ---- walks ----------------------------------------------------------------------------------------------------------


def walk_of(plant: Plant, **values: Any) -> Any:
    """A walk that stands, as its marks see it."""
    robot = plant.robot
    pendulum = SimpleNamespace(zmp=np.array([0.1, 0.2, 0.3]), dcm=np.array([0.4, 0.5, 0.0]), omega=3.0)
    progress = SimpleNamespace(
        phase=SimpleNamespace(value="double support"), swing_side=None, steps_done=0, upcoming=[]
    )
    observer = SimpleNamespace(robot=robot, outside=None)
    parts = {
        "reference": SimpleNamespace(pendulum=pendulum),
        "drives": SimpleNamespace(observer=observer),
        "progress": progress,
        "stiffness": None,
        "ground": None,
        "load": None,
    }
    return SimpleNamespace(**parts | values)


def test_planned_points_and_steps_lie_where_the_estimate_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = Plant(load("hrp4_class"))
    walking = walk_of(plant)
    shift = np.array([[0.5, -0.25, 0.1]])
    monkeypatch.setattr(walk_marks, "drift_of", lambda *_: Drift(np.zeros(1), np.zeros((1, 3)), shift))
    marks = WalkMarks(plant, walking, SCALE)
    walking.progress.upcoming = [Footstep("left", 0.1 * i, 0.05) for i in range(MAX_STEPS + 3)]
    marks.add(now := Picture(0.0))
    assert now.text == ["double support, 0 steps done", Drift(np.zeros(1), shift, 0 * shift).text(0)]
    drawn = by_name(now.marks)
    for name, middle in (("ZMP planned", [0.6, -0.05, 0.4 + LIFT]), ("DCM planned", [0.9, 0.25, 0.4 + LIFT])):
        np.testing.assert_allclose(drawn[name].points[:-1].mean(axis=0), middle)
    assert sum(name.startswith("planned step") for name in drawn) == MAX_STEPS
    np.testing.assert_allclose(drawn["planned step 2"].points[:4].mean(axis=0), [0.7, -0.2, 0.1 + LIFT])


def test_steps_that_were_done_stay_for_a_while_and_each_stance_has_its_own_area() -> None:
    plant = Plant(load("hrp4_class"))
    walking = walk_of(plant)
    marks, progress = WalkMarks(plant, walking, SCALE), walking.progress
    shown: dict[str, Mark] = {}
    for done in range(MAX_STEPS + 6):
        progress.steps_done, progress.upcoming = done, [Footstep("left", 0.1 * done, 0.05)]
        for side in ("left" if done % 2 else "right", None):
            progress.swing_side = side
            marks.add(now := Picture(0.0))
            shown = by_name(now.marks)
    steps = MAX_STEPS + 6
    planned = {int(name.split()[-1]) for name in shown if name.startswith("planned")}
    assert planned == set(range(steps - 1 - MAX_STEPS, steps)), "those of the last steps, and the next one"
    real = {int(name.split()[-1]) for name in shown if name.startswith("real")}
    assert real == set(range(steps + 1 - MAX_STEPS, steps + 1)), (
        "one for each stance; the first had only one foot"
    )


def test_the_known_ground_is_drawn_anew_when_it_is_another_and_not_too_often() -> None:
    plant = Plant(load("hrp4_class"))
    cells = [np.array([(0.0, 0.0, 0.1)])]
    ground = SimpleNamespace(version=0, map=SimpleNamespace(known=lambda: (cells[-1], None)))
    marks = WalkMarks(plant, walk_of(plant, ground=ground), SCALE)

    def height(time: float) -> float | None:
        marks.add(now := Picture(time))
        found = by_name(now.marks).get("known ground")
        return None if found is None else round(float(found.points[0, 2]) - LIFT, 4)

    assert height(1.0) == 0.1
    cells.append(np.array([(0.0, 0.0, 0.2)]))
    assert height(3.0) == 0.1, "its version is the same"
    ground.version = 1
    assert height(3.0) == 0.2
    cells.append(np.array([(0.0, 0.0, 0.3)]))
    ground.version = 2
    assert height(3.0 + 0.9 * MAP_PERIOD) == 0.2 and height(3.0 + 1.1 * MAP_PERIOD) == 0.3
    ground.version = 3
    cells.append(np.empty((0, 3)))
    assert height(0.0) is None, "a run that has begun anew; nothing is known"


def test_scans_are_kept_and_the_last_ones_are_drawn() -> None:
    plant = Plant(load("hrp4_class"))
    soles = SimpleNamespace(steps=[])
    marks = WalkMarks(plant, walk_of(plant, stiffness=soles), SCALE)
    for number in range(MAX_STEPS + 2):
        profile = SimpleNamespace(points=np.full((3, 3), float(number)))
        soles.steps = [SimpleNamespace(profile=None if number == 1 else profile)]
        for _ in range(2):
            marks.add(now := Picture(0.0))
    scans = [name for name in by_name(now.marks) if name.startswith("scan")]
    assert scans == [f"scan {i}" for i in range(1, MAX_STEPS + 1)]


def test_the_force_on_the_hands_is_that_of_the_surroundings_with_the_weight_of_the_load() -> None:
    plant = Plant(load("hrp4_class"))
    walking, robot = walk_of(plant), plant.robot
    assert outside_force(walking) is None
    walking.drives.observer.outside = SimpleNamespace(wrench=np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]))
    force, place = outside_force(walking)
    assert force is not None and force.tolist() == [1.0, 2.0, 3.0]
    hands = [robot.placement(frame).translation for frame in robot.frames.values()]
    np.testing.assert_allclose(place, np.mean(hands, axis=0))
    walking.load = SimpleNamespace(applied=2.0, place=np.array([0.3, 0.0, 1.0]))
    force, place = outside_force(walking)
    assert force is not None and force == pytest.approx([1.0, 2.0, 3.0 - 2.0 * GRAVITY])
    assert place.tolist() == [0.3, 0.0, 1.0]
    marks = WalkMarks(plant, walking, SCALE)
    marks.add(now := Picture(0.0))
    start, end = by_name(now.marks)["outside force 0"].points
    np.testing.assert_allclose(
        (end - start) * SCALE.weight / SCALE.height, force, atol=0.1
    )  # turned by the drift
