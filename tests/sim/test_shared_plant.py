"""Several robots in one simulation: each stands as it would alone, and they feel each other."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from properties import by_default

import wbc
from wbc.base.errors import InputError
from wbc.sim import MujocoLoop, Plant, SharedPlant
from wbc.sim.plant.link_geoms import SHAPE_GROUP

HRP4, G1 = wbc.load_robot("hrp4_class"), wbc.load_robot("g1")
WALL = """<mujoco><worldbody>
<body name="wall" pos="0 5 1"><geom type="box" size="0.1 0.1 1"/></body>
</worldbody></mujoco>"""


APART = {"two": (1.0, 0.5, 0.0)}


def run(plant: SharedPlant, seconds: float, kind: type = wbc.PositionControl) -> None:
    controls = {
        name: kind(wbc.balance_controller(loop.description.robot(), plant.control_period))
        for name, loop in plant.loops.items()
    }
    end = plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step({name: controls[name].command(m) for name, m in plant.measure().items()})


def test_no_seed_gives_a_robot_the_sensor_errors_of_another() -> None:
    found = set()
    for seed in range(2):
        plant = SharedPlant({"one": HRP4, "two": HRP4}, places=APART, noise="realistic", seed=seed)
        found |= {m.joint_position.tobytes() for m in plant.measure().values()}
    assert len(found) == 4


def test_shapes_of_robots_touch_things_and_each_other_and_not_their_own() -> None:
    plant = SharedPlant(
        {"one": HRP4, "two": HRP4, "three": HRP4}, places={"two": (1, 0, 0), "three": (2, 0, 0)}, scene=WALL
    )
    model = plant.model
    shapes = {
        name: np.flatnonzero((model.geom_group == SHAPE_GROUP) & loop.places.of_robot[model.geom_bodyid])
        for name, loop in plant.loops.items()
    }
    floor = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)[0])

    def touch(a: int, b: int) -> bool:
        types, affinities = model.geom_contype, model.geom_conaffinity
        return bool(types[a] & affinities[b] or types[b] & affinities[a])

    for one, mine in shapes.items():
        assert mine.size and all(touch(geom, floor) for geom in mine)
        for other, theirs in shapes.items():
            assert {touch(a, b) for a in mine for b in theirs} == {one != other}


def test_points_of_a_robots_world_are_turned_and_moved_to_its_place() -> None:
    heading = -2.0
    plant = SharedPlant({"one": HRP4}, places={"one": (1.0, -2.0, heading)})
    c, s = np.cos(heading), np.sin(heading)
    np.testing.assert_allclose(
        plant.in_world("one", [0.3, 0.1, 0.7]), [1 + 0.3 * c - 0.1 * s, -2 + 0.3 * s + 0.1 * c, 0.7]
    )
    middle = 0.5 * (plant.loops["one"].sole_pose(0)[0] + plant.loops["one"].sole_pose(1)[0])
    own = HRP4.robot()
    own.update(own.half_sitting, np.zeros(own.nv))
    there = 0.5 * sum(own.placement(sole.frame).translation for sole in own.soles)
    np.testing.assert_allclose(middle, plant.in_world("one", there), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", by_default([wbc.PositionControl, wbc.HybridControl], wbc.HybridControl))
def test_robots_apart_from_each_other_stand_as_each_would_alone(kind: type) -> None:
    plant = SharedPlant({"one": HRP4, "two": G1}, places={"two": (1.0, 0.5, np.pi / 2)}, control_period=0.002)
    run(plant, 0.15, kind)
    for name, loop in plant.loops.items():
        alone = MujocoLoop(loop.description, Plant(loop.description).model, control_period=0.002)
        control = kind(wbc.balance_controller(loop.description.robot(), 0.002))
        while alone.time < 0.15 - 1e-9:
            alone.step(control.command(alone.measure()))
        np.testing.assert_allclose(loop.truth().com, plant.in_world(name, alone.truth().com), atol=1e-4)
        weight = loop.truth().contact_force[:, 2].sum()
        assert weight == pytest.approx(9.80665 * loop.robot.mass, rel=0.02)


def test_robots_begin_again_where_they_began() -> None:
    plant = SharedPlant({"one": HRP4, "two": HRP4}, places=APART, noise="realistic")
    first = plant.data.qpos.copy()
    run(plant, 0.03)
    after = plant.data.qpos.copy()
    plant.reset()
    np.testing.assert_array_equal(plant.data.qpos, first)
    run(plant, 0.03)
    np.testing.assert_array_equal(plant.data.qpos, after)


def test_robots_that_stand_clear_are_not_noted_and_none_takes_a_step_or_begins_anew_alone() -> None:
    plant = SharedPlant({"one": HRP4, "two": HRP4}, places=APART, scene=WALL)
    assert not [note for loop in plant.loops.values() for note in loop.notes if "inside" in note]
    run(plant, 0.01)
    before, loop = plant.data.qpos.copy(), plant.loops["two"]
    for act in (lambda: loop.step(loop.hold()), loop.reset):
        with pytest.raises(InputError, match="a robot of a SharedPlant cannot .* alone"):
            act()
    assert plant.time == pytest.approx(0.01) and loop.time == pytest.approx(0.01)
    np.testing.assert_array_equal(plant.data.qpos, before)
    with pytest.raises(InputError, match="inside"):
        SharedPlant({"one": HRP4, "two": HRP4}, places={"two": (0.05, 0.0, 0.0)}, scene=WALL)


@pytest.mark.slow
def test_a_robot_that_is_pushed_into_another_moves_it() -> None:
    places = {"two": (0.45, 0.0, 0.0)}
    moved = []
    for scene in (None, WALL):  # without a scene robots touch the ground alone
        plant = SharedPlant({"one": HRP4, "two": HRP4}, places=places, scene=scene)
        plant.loops["one"].push("torso", [200.0, 0.0, 0.0], duration=0.2)
        run(plant, 0.6)
        moved.append(plant.loops["two"].truth().com[0] - 0.45)
    assert abs(moved[0]) < 1e-3 and moved[1] > 0.01


def test_a_loop_that_begins_inside_the_ground_says_so(caplog: pytest.LogCaptureFixture) -> None:
    """Data that nobody has reset: all robots are at the origin, their feet below the ground."""
    model = SharedPlant({"one": HRP4, "two": HRP4}, places=APART).model
    assert not caplog.records
    loop = MujocoLoop(HRP4, model, mujoco.MjData(model), prefix="one/")
    assert "inside the ground" in loop.notes[-1] and "inside the ground" in caplog.text
