"""A view draws each geom where MuJoCo has it, marks where the run has them, and changes nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from properties import by_default
from scipy.spatial import KDTree
from watched_walk import tick

import wbc
from wbc.app import live
from wbc.app.view.marks import (
    LIFT,
    Force,
    Mark,
    Picture,
    Scale,
    force_marks,
    mark_mesh,
    stiffness_colour,
)
from wbc.app.view.meshes import PLANE_DEPTH, SHOWN_GROUPS, body_meshes, geom_mesh
from wbc.app.view.stage import SimulatedStage
from wbc.app.view.walk_marks import drift_of
from wbc.base.hull import convex_hull
from wbc.core.robot import GRAVITY
from wbc.motion import MotionClip
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.balance.tracking import TrackSpec, TrackTrial
from wbc.sim.plant.model import drawing_model
from wbc.sim.terrain.spec import terrain
from wbc.sim.trial.trial import Trial
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.plans.gait import Gait
from wbc.walking.steered import SteeredControl

HRP4 = wbc.load_robot("hrp4_class")
GAIT = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
"""Quick steps: these tests are about the view."""


def short_walk(**values: Any) -> WalkSpec:
    return WalkSpec(**{"plan": WalkPlan(distance=0.1), "gait": GAIT, "timestep": 0.0025} | values)


def named(picture: Picture, prefix: str) -> dict[str, Mark]:
    return {mark.name: mark for mark in picture.marks if mark.name.startswith(prefix)}


def middle(mark: Mark) -> NDArray[np.float64]:
    return np.asarray(np.unique(np.round(mark.points, 9), axis=0).mean(axis=0))


# ---- the model ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ground", ["stones", "random"])
def test_each_geom_is_drawn_where_mujoco_has_it(ground: str) -> None:
    cup = '<body name="cup" pos=".4 .3 .05"><freejoint/><geom size=".05"/></body>'
    scene = f"<mujoco><worldbody>{cup}</worldbody></mujoco>"
    plant = wbc.Plant(HRP4, foot="soft", terrain=ground, scene=scene)
    model, data = plant.model, plant.data
    rng = np.random.default_rng(0)
    data.qpos[7:] += 0.2 * rng.standard_normal(model.nq - 7)
    mujoco.mj_forward(model, data)
    drawn: dict[int, list[NDArray[np.float64]]] = {}
    for body, _, mesh in body_meshes(model):
        points = mesh.vertices @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
        drawn.setdefault(body, []).append(points)
    clouds = {body: np.concatenate(points) for body, points in drawn.items()}
    trees = {body: KDTree(points) for body, points in clouds.items()}
    count = 0
    for geom in range(model.ngeom):
        mesh = geom_mesh(model, geom)
        if model.geom_group[geom] >= SHOWN_GROUPS or mesh is None:
            continue
        body = int(model.geom_bodyid[geom])
        own = mesh.vertices[:: max(1, len(mesh.vertices) // 5)]
        there = own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        distance, _ = trees[0 if model.body_weldid[body] == 0 else body].query(there)
        assert distance.max() < 1e-5, model.geom(geom)
        count += 1
    body = model.body("scene/cup").id
    assert count > 50 and np.linalg.norm(clouds[body] - data.xpos[body], axis=1) == pytest.approx(
        0.05, rel=1e-5
    )


@pytest.mark.parametrize("kind", by_default(["walk", "stand", "track"], "walk"))
def test_a_trial_of_ones_own_can_be_watched(kind: str) -> None:
    """A hook that shows a trial draws what its plant has: the links of the robot, as those of a plant."""
    q = np.tile(HRP4.robot().half_sitting, (5, 1))
    clip = MotionClip(HRP4.joint_names, 30.0, q[:, :7], q[:, 7:])
    trial: Trial = {
        "walk": lambda: WalkTrial(short_walk()),
        "stand": lambda: StandTrial(StandSpec()),
        "track": lambda: TrackTrial(clip, TrackSpec(robot=HRP4.name)),
    }[kind]()
    links = {each.body for each in body_meshes(wbc.Plant(HRP4).model)}
    assert {each.body for each in body_meshes(trial.plant.model)} == links and len(links) > 30


def test_shapes_have_the_size_of_their_geoms() -> None:
    """The farthest point of a shape in a direction, against the support functions of the solids."""
    kinds = {
        "box": (0.1, 0.2, 0.3),
        "sphere": (0.2,),
        "ellipsoid": (0.1, 0.2, 0.3),
        "cylinder": (0.1, 0.3),
        "capsule": (0.1, 0.3),
    }
    geoms = "".join(
        f'<geom type="{kind}" size="{" ".join(map(str, size))}"/>' for kind, size in kinds.items()
    )
    field = '<hfield name="f" nrow="3" ncol="4" size="2 1 .5 .1" elevation="0 0 0 0  0 1 .5 0  0 0 0 0"/>'
    world = f'<geom type="plane" size="1 2 1"/><geom type="hfield" hfield="f"/>{geoms}'
    text = f"<mujoco><asset>{field}</asset><worldbody>{world}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    plane, hills, *solids = (geom_mesh(model, geom) for geom in range(model.ngeom))
    assert plane is not None and hills is not None
    assert np.abs(plane.vertices).max(axis=0) == pytest.approx([1.0, 2.0, PLANE_DEPTH])
    assert hills.vertices[:, 2].max() == pytest.approx(0.5) and np.ptp(
        hills.vertices, axis=0
    ) == pytest.approx([4.0, 2.0, 0.5])
    for mesh, (kind, size) in zip(solids, kinds.items(), strict=True):
        assert mesh is not None
        high = {
            "sphere": size * 3,
            "cylinder": (size[0], size[0], size[-1]),
            "capsule": (size[0], size[0], sum(size)),
        }
        assert np.abs(mesh.vertices).max(axis=0) == pytest.approx(high.get(kind, size), rel=0.02)
        a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) > 0.0).all(), "faces look outwards"
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
        x, y, z = (*size, size[-1])[:3] if kind != "sphere" else size * 3
        solid = {
            "box": 8.0 * x * y * z,
            "sphere": 4.0 / 3.0 * np.pi * x**3,
            "ellipsoid": 4.0 / 3.0 * np.pi * x * y * z,
            "cylinder": 2.0 * np.pi * x**2 * y,
            "capsule": 2.0 * np.pi * x**2 * y + 4.0 / 3.0 * np.pi * x**3,
        }
        assert 0.9 * solid[kind] < volume < solid[kind] * (1.0 + 1e-9), "closed, and inside of the solid"
    for flat, area in ((plane, 2.0 * 4.0), (hills, 4.0 * 2.0)):
        a, b, c = flat.vertices[flat.faces].transpose(1, 0, 2)
        up = 0.5 * np.cross(b - a, c - a)[:, 2]
        assert (up > 0.0).all() and up.sum() == pytest.approx(area), "each place once, and from above"


@pytest.mark.parametrize("robot", ["hrp4_class", pytest.param("talos", marks=pytest.mark.slow)])
def test_a_link_is_drawn_where_its_urdf_has_it_and_nothing_is_missing(robot: str) -> None:
    description = wbc.load_robot(robot)
    model = drawing_model(description, description.robot(), terrain("flat"))
    bodies = {model.body(each.body).name for each in body_meshes(model) if each.body > 0}
    moving = {description.attachment(name)[0] for name in bodies}
    assert len(moving) >= description.robot().na  # each joint moves something that can be seen
    assert not model.geom_contype[model.geom_group == 1].any()
    assert model.body_mass.sum() == pytest.approx(description.robot().mass)


# ---- marks ----------------------------------------------------------------------------------------------------------


def test_areas_and_arrows_have_their_size_and_face_outwards() -> None:
    """A polygon looks up with all of its area; an arrow is closed: its volume is that of a cylinder and a cone."""
    angles = 2.0 * np.pi * np.arange(7) / 7.0
    corners = np.column_stack([np.cos(angles), np.sin(angles), np.full(7, 0.3)])

    def triangles(mark: Mark) -> NDArray[np.float64]:
        vertices, faces = mark_mesh(mark)
        return np.asarray(vertices[faces].transpose(1, 0, 2))

    a, b, c = triangles(Mark("m", "area", corners, (1, 1, 1, 1)))
    across = 0.5 * np.cross(b - a, c - a)
    assert (across[:, 2] > 0.0).all() and across[:, 2].sum() == pytest.approx(
        3.5 * math.sin(2.0 * np.pi / 7.0)
    )
    for end in ((0.0, 0.0, 2.0), (1.0, -2.0, 0.5), (0.0, 0.0, -1.0)):
        points, size = np.array([(1.0, 2.0, 3.0), np.add((1.0, 2.0, 3.0), end)]), 0.03
        a, b, c = triangles(Mark("m", "arrow", points, (1, 1, 1, 1), size))
        length = float(np.linalg.norm(end))
        volume = np.einsum("ij,ij->i", a - points[0], np.cross(b - points[0], c - points[0])).sum() / 6.0
        solid = 0.75 * size**2 + (2.5 * size) ** 2 * 0.25 / 3.0
        assert volume == pytest.approx(np.pi * length * solid, rel=0.05)
    line = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, 0.0)])
    a, b, c = triangles(Mark("m", "line", line, (1, 1, 1, 1), 0.02))
    assert np.linalg.norm(0.5 * np.cross(b - a, c - a), axis=1).sum() == pytest.approx(0.02 * 3.0)


def test_arrows_of_forces_are_as_long_as_their_share_of_the_weight() -> None:
    """That of the weight is as long as the centre of mass is high; one of more than 1.5 weights is cut off."""
    scale = Scale(0.8, 400.0)
    for share, shown in ((0.25, 0.25), (1.5, 1.5), (6.0, 1.5)):
        force = 400.0 * share * np.array([0.6, 0.0, 0.8])
        point = np.array([1.0, 2.0, 3.0])
        ground, push, other = force_marks(
            scale, [Force(kind, point, force) for kind in ("ground", "push", "ground")]
        )
        way = 0.8 * shown * np.array([0.6, 0.0, 0.8])
        np.testing.assert_allclose(ground.points, [point, point + way])
        np.testing.assert_allclose(push.points, [point - way, point])
        assert [ground.name, push.name, other.name] == ["ground force 0", "push force 0", "ground force 1"]


@pytest.mark.slow
def test_footsteps_are_where_they_are_planned_and_where_feet_really_stand() -> None:
    trial = WalkTrial(short_walk(plan=WalkPlan(distance=0.2), noise="none"))
    stage, walking = SimulatedStage(trial.plant, trial.control), trial.control
    steps = walking.source.phases.plan.steps
    first = stage.picture()
    for mark, step in zip(named(first, "planned step").values(), steps, strict=True):
        assert middle(mark) == pytest.approx(step.position + (0.0, 0.0, LIFT), abs=1e-5)
        assert mark.meaning == f"{step.side} footstep, planned (outline)"
    assert len(named(first, "real step")) == 2
    wanted = None
    while walking.steps_done < 2:
        if walking.progress.swing_side == "left":
            place = walking.source.phases.plan.steps[0].position
            wanted = drift_of(trial.plant, walking)(np.array([place]), 0)[0]
        tick(trial)
        picture = stage.picture()
        if walking.steps_done == 1 and walking.progress.swing_side == "right":
            assert "single support, right foot swings, 1 steps done" in picture.text
    real = named(picture, "real step")
    assert len(real) == 4 and wanted is not None
    assert middle(real["real step 0"]) == pytest.approx(
        middle(named(first, "real step")["real step 0"]), abs=2e-3
    )
    assert middle(real["real step 2"])[:2] == pytest.approx(wanted[:2], abs=0.02)  # where the foot has landed
    assert middle(named(picture, "planned step 0")["planned step 0"])[:2] == pytest.approx(
        wanted[:2], abs=1e-3
    )


def test_what_is_planned_is_shown_where_it_lies_in_the_true_world() -> None:
    trial = WalkTrial(short_walk(plan=WalkPlan(distance=0.2), noise="none"))
    stage = SimulatedStage(trial.plant, trial.control)
    for _ in range(20):
        tick(trial)
    before, data = stage.picture(), trial.plant.data
    x, y, turn = 0.3, -0.4, 0.5 * math.pi
    # The robot turns and moves, the estimate does not see it.
    data.qpos[:2] = (x - data.qpos[1], y + data.qpos[0])
    half = np.array([math.cos(0.5 * turn), 0, 0, math.sin(0.5 * turn)])
    mujoco.mju_mulQuat(data.qpos[3:7], half, data.qpos[3:7].copy())
    mujoco.mj_forward(trial.plant.model, data)
    after = stage.picture()
    for prefix in ("planned step", "ZMP planned", "DCM planned"):
        for name, mark in named(before, prefix).items():
            was_x, was_y, _ = middle(mark)
            assert middle(named(after, name)[name])[:2] == pytest.approx([x - was_y, y + was_x], abs=1e-3)
    assert any(line.endswith(" mm and +90.0° off") for line in after.text)


def test_balance_is_shown_as_it_is_and_as_planned() -> None:
    trial = WalkTrial(short_walk(foot="soft", noise="none"))
    stage, walking = SimulatedStage(trial.plant, trial.control), trial.control
    while walking.source.feet.swing is None:
        tick(trial)
    for _ in range(40):
        tick(trial)
    picture, truth, reference = stage.picture(), trial.plant.truth(), walking.reference
    marks = {mark.name: mark for mark in picture.marks}
    assert reference is not None
    dcm = truth.com + truth.com_velocity / reference.pendulum.omega
    assert marks["dcm"].points[0, :2] == pytest.approx(dcm[:2])
    assert middle(marks["ZMP planned"])[:2] == pytest.approx(reference.pendulum.zmp[:2], abs=3e-3)
    assert middle(marks["DCM planned"])[:2] == pytest.approx(reference.pendulum.dcm[:2], abs=3e-3)
    assert marks["com"].points[0] == pytest.approx(truth.com)
    corners, zmp = marks["support"].points[:, :2], marks["zmp"].points[:, :2]
    assert convex_hull(np.concatenate([corners, zmp])) == pytest.approx(
        corners, abs=1e-6
    )  # a ZMP cannot be elsewhere
    arrows = [mark for name, mark in marks.items() if name.startswith("ground force")]
    total = sum(mark.points[1] - mark.points[0] for mark in arrows)
    assert total == pytest.approx(stage.scale.height * truth.contact_force.sum(axis=0) / stage.scale.weight)
    assert stage.scale.weight == pytest.approx(trial.plant.robot.mass * GRAVITY)


def test_contacts_of_a_sole_are_one_arrow_and_those_beside_have_one_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At the centre of the loads of the sole; all arrows together are the whole contact force."""
    plant = wbc.Plant(HRP4)
    stage, rng = SimulatedStage(plant, None), np.random.default_rng(2)
    places, forces = rng.normal(size=(5, 3)), rng.uniform(1.0, 50.0, (5, 3))
    truth = replace(
        plant.truth(), contact_position=places, contact_force=forces, contact_sole=np.array([0, 1, 0, -1, -1])
    )
    monkeypatch.setattr(type(plant), "truth", lambda self: truth)
    picture = stage.picture()
    arrows = [mark.points for mark in named(picture, "ground force").values()]
    way = stage.scale.height / stage.scale.weight
    for own, points in zip(([0, 2], [1], [3], [4]), arrows, strict=True):
        load = forces[own, 2]
        np.testing.assert_allclose(points[0], load @ places[own] / load.sum())
        np.testing.assert_allclose(points[1] - points[0], way * forces[own].sum(axis=0))
    level = forces[:, 2] @ places[:, 2] / forces[:, 2].sum()
    zmp = named(picture, "zmp")["zmp"].points[0]
    moment = np.cross(places - zmp, forces).sum(axis=0)
    assert zmp[2] == pytest.approx(level) and np.allclose(moment[:2], 0.0)


@SteeredControl.register
class Counted:
    """A control that walks, of which the number of steps is known."""

    steps_done = 0


def test_progress_is_told_ten_times_a_second_of_the_run() -> None:
    told: list[str] = []
    line = live.ProgressLine(SimpleNamespace(update=told.append))  # type: ignore[arg-type]
    for number in range(201):
        control = Counted()
        control.steps_done = number
        line.tick(SimpleNamespace(plant=SimpleNamespace(time=0.005 * number), control=control))  # type: ignore[arg-type]
    assert len(told) == pytest.approx(11, abs=1) and told[0].startswith("0.0 s") and "20 steps" in told[1]


def test_a_push_is_an_arrow_that_ends_where_it_pushes() -> None:
    plant = wbc.Plant(HRP4)
    stage = SimulatedStage(plant, None)
    plant.push("torso", (0.0, 30.0, 0.0), 0.05)
    plant.step(plant.hold())
    (push,) = named(stage.picture(), "push").values()
    torso = plant.data.xipos[plant.model.body(plant.robot.torso_frame).id]
    assert push.points[1] == pytest.approx(torso, abs=1e-3) and push.points[0][1] < push.points[1][1]


def test_soles_have_the_colour_of_their_stiffness() -> None:
    trial = WalkTrial(short_walk(foot="variable", stiffness=10.0))
    plant, stage = trial.plant, SimulatedStage(trial.plant, trial.control)
    colours = stage.picture().colours
    assert len(colours) == 2 * 10 and set(colours.values()) == {stiffness_colour(10.0)}  # the phalanges
    joints = [plant.model.joint(name).id for name in plant.feet[1].variable_joints]
    plant.model.jnt_stiffness[joints] = 40.0
    picture = stage.picture()
    assert set(picture.colours.values()) == {stiffness_colour(10.0), stiffness_colour(40.0)}
    assert "soles 10.0 and 40.0 Nm/rad" in picture.text
    reds = [stiffness_colour(k)[0] for k in (0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)]
    assert all(a < b for a, b in zip(reds, reds[1:], strict=False))
