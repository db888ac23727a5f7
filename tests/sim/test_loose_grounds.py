"""Scenes to walk on that move: stones at rest, kicked and seen; plates that tilt by their springs."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import mujoco
import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.sim import make_scene
from wbc.sim.plant.model import MANY_THINGS
from wbc.sim.scenes.base import Scene
from wbc.sim.scenes.loose import DENSITY
from wbc.sim.terrain.render import TERRAIN_GROUP


def stones(**values: Any) -> Scene:
    return make_scene("loose_stones", **values)


def alone(scene: Scene) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Stones on a floor, without a robot, at the plant's step."""
    spec = scene.spec()
    floor = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0, 0, 1], "friction": [0.7, 0.005, 1e-4]}
    spec.worldbody.add_geom(**floor)
    spec.option.timestep, spec.option.gravity = 0.001, [0.0, 0.0, -GRAVITY]
    spec.option.integrator, spec.option.cone = (
        mujoco.mjtIntegrator.mjINT_DISCRETE,
        mujoco.mjtCone.mjCONE_ELLIPTIC,
    )
    spec.option.impratio = 10.0
    model = spec.compile()
    return model, mujoco.MjData(model)


def test_stones_stay_where_they_lie_and_weigh_what_stones_weigh() -> None:
    model, data = alone(stones(seed=3))
    start = data.qpos.copy()
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - start).max() < 1e-4
    volumes = 8.0 * model.geom_size[1:].prod(axis=1)  # the first geom is the floor
    np.testing.assert_allclose(model.body_mass[1:], DENSITY * volumes)


PEBBLES: dict[str, Any] = {"shape": "pebble", "size": 0.04, "height": 0.02}


def test_pebbles_lie_where_they_begin_beside_each_other_and_weigh_what_ellipsoids_weigh() -> None:
    scene = stones(seed=3, count=100, length=0.6, width=0.5, **PEBBLES)
    model, data = alone(scene)
    mujoco.mj_forward(model, data)
    assert (data.contact.geom.min(axis=1) == 0).all() and data.contact.dist.min() > -1e-6, (
        "with the floor alone"
    )
    half = model.geom_size[1:]
    np.testing.assert_allclose(model.body_mass[1:], DENSITY * 4.0 / 3.0 * np.pi * half.prod(axis=1))
    assert (2.0 * half[:, :2] <= 0.04).all() and (2.0 * half[:, 2] <= 0.02).all()
    start = data.qpos.copy()
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - start).max() < 1e-4


@pytest.mark.parametrize("count", [MANY_THINGS - 10, MANY_THINGS + 1])
def test_a_robot_stands_alike_whether_the_stones_around_it_sleep(count: int) -> None:
    scene = stones(seed=3, count=count, **PEBBLES)
    plant = wbc.Plant("hrp4_class", scene=scene, visuals=False)
    many, heights = count > MANY_THINGS, []
    for flag in (plant.model.opt.enableflags, 0):
        plant.model.opt.enableflags = flag
        plant.reset()
        for _ in range(5):
            plant.step(plant.hold())
        heights.append(plant.com_height)
        asleep = int((plant.data.tree_asleep >= 0).sum())
        assert asleep == (count if many and flag else 0)
    assert heights[0] == pytest.approx(heights[1], abs=1e-9)


def test_things_that_begin_inside_something_are_refused() -> None:
    """Stones on a rough ground, and a box of an own scene in another one."""
    with pytest.raises(InputError, match=r"'stone \d+' is \d+ mm inside the ground"):
        wbc.Plant(
            "hrp4_class", scene="loose_stones", terrain=wbc.sim.make_terrain("stones", 0.03, 1), visuals=False
        )
    box = '<body name="{0}" pos="{1} 0 0.05"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>'
    for place, refused in ((1.05, True), (1.11, False)):
        scene = f"<mujoco><worldbody>{box.format('a', 1.0)}{box.format('b', place)}</worldbody></mujoco>"
        with pytest.raises(InputError, match="'a' is 50 mm inside 'b'") if refused else nullcontext():
            wbc.Plant("hrp4_class", scene=scene, visuals=False)


def test_a_kicked_stone_slides_by_its_energy_over_its_friction() -> None:
    """The way is v²/(2 μ g), whatever the stone weighs."""
    model, data = alone(stones(seed=3, count=1, height=0.02))
    speed, start = 0.8, data.qpos[:3].copy()
    data.qvel[0] = speed
    for _ in range(600):
        mujoco.mj_step(model, data)
    assert np.abs(data.qvel).max() < 1e-3
    way = float(np.linalg.norm(data.qpos[:2] - start[:2]))
    assert way == pytest.approx(speed**2 / (2.0 * 0.7 * GRAVITY), rel=0.06)


def test_stones_of_a_seed_are_the_same_and_none_lies_in_another() -> None:
    one, same, other = (stones(seed=seed).spec().compile() for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.body_pos, same.body_pos)
    assert not np.allclose(one.body_pos, other.body_pos)
    places, sizes = one.body_pos[1:, :2], np.linalg.norm(one.geom_size[:, :2], axis=1)
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.diag(np.full(len(places), np.inf))
    assert (apart >= sizes[:, None] + sizes).all()


def test_more_stones_than_have_room_are_refused_with_the_number_that_has() -> None:
    with pytest.raises(InputError, match="count 200") as refused:
        stones(count=200, length=0.5, width=0.5).spec()
    fitting = int(str(refused.value).rpartition(" did;")[0].rpartition(": ")[2])
    stones(count=fitting, length=0.5, width=0.5).spec()


def test_a_plate_tilts_by_moment_over_stiffness() -> None:
    scene = make_scene("tilting_plates", count=2, stiffness=200.0)
    model = scene.spec().compile()
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    data.qfrc_applied[0] = 20.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert data.qpos == pytest.approx([0.1, 0.0], abs=1e-4)


def test_a_plank_sinks_in_its_middle_by_force_times_length_squared_over_stiffness() -> None:
    """F l²/(8 k) for small angles; the halves meet in the middle, and the outer ends stay."""
    force, length, stiffness = 60.0, 0.8, 400.0
    scene = make_scene("tilting_plates", bend=True, count=1, length=length, stiffness=stiffness, distance=0.0)
    model = scene.spec().compile()
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    half = 0.25 * length
    for _ in range(3000):
        data.qfrc_applied[:] = 0.0
        for body, inner in ((1, half), (2, -half)):
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ [inner, 0.0, 0.0]
            if data.time > 0.0:
                mujoco.mj_applyFT(
                    model, data, [0.0, 0.0, -0.5 * force], np.zeros(3), place, body, data.qfrc_applied
                )
        mujoco.mj_step(model, data)
    depth = [
        0.05 * 0.75 - (data.xpos[b] + data.xmat[b].reshape(3, 3) @ [s * half, 0.0, 0.0])[2]
        for b, s in ((1, 1), (2, -1))
    ]
    assert depth == pytest.approx([force * length**2 / (8.0 * stiffness)] * 2, rel=0.02)
    assert model.body_mass[1:].sum() == pytest.approx(4.0)


def test_sensors_see_what_the_robot_walks_on_and_no_furniture() -> None:
    for name, seen in (("loose_stones", True), ("tilting_plates", True), ("table", False)):
        plant = wbc.Plant("hrp4_class", scene=make_scene(name), visuals=False)
        things = [b for b in range(plant.model.nbody) if plant.model.body(b).name.startswith("scene")]
        groups = {
            int(plant.model.geom_group[g]) for g in np.flatnonzero(np.isin(plant.model.geom_bodyid, things))
        }
        assert things and groups == ({TERRAIN_GROUP} if seen else {0})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("loose_stones", {}),
        ("loose_stones", {**PEBBLES, "count": 400, "length": 1.6}),
        ("tilting_plates", {}),
    ],
)
def test_a_robot_walks_over_what_moves(name: str, values: dict[str, Any]) -> None:
    spec = wbc.sim.WalkSpec(
        robot="g1",
        foot="flat",
        scene=name,
        scene_params=values,
        mode="torque",
        seed=4,
        noise="realistic",
        plan=wbc.sim.WalkPlan(distance=1.5),
    )
    result = wbc.walk(spec)
    assert result.outcome == "completed", result
