"""Scenes: things by name, which all of the robot touches, and force sensors at the wrists."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import Plant, make_scene
from wbc.sim.scenes.base import scene_kinds
from wbc.sim.simulation.machine import Machine
from wbc.sim.trial.falls import TrueFallDetector


@pytest.mark.parametrize(
    ("robot", "kinds"),
    [
        ("hrp4_class", tuple(scene_kinds())),
        pytest.param("talos", ("cart", "door"), marks=pytest.mark.slow),
        pytest.param("g1", ("cart",), marks=pytest.mark.slow),
    ],
)
def test_a_robot_stands_clear_of_every_scene(robot: str, kinds: tuple[str, ...]) -> None:
    for kind in kinds:
        plant = Plant(load(robot), scene=kind, visuals=False)
        start = plant.data.qpos.copy()
        for _ in range(10):
            plant.step(plant.hold())
        assert plant.diverged is None
        wrenches = plant.measure().hand_wrenches
        assert wrenches is not None and np.abs(wrenches[:, :3]).max() < 1.0, "nothing touches the hands"
        things = [j for j in range(plant.model.njnt) if plant.model.joint(j).name.startswith("scene/")]
        for joint in things:  # and nothing moves by itself
            address = plant.model.jnt_qposadr[joint]
            assert np.abs(plant.data.qpos[address : address + 3] - start[address : address + 3]).max() < 2e-3


def test_a_wall_stands_on_the_floor_with_its_face_at_its_distance() -> None:
    angle = 90.0
    model, data = built("wall", distance=0.6, angle=angle, width=1.2, height=0.9)
    place = pin.utils.rotate("z", np.radians(angle)).T @ data.geom_xpos[0]  # as seen by who looks at it
    near, far = place - model.geom_size[0], place + model.geom_size[0]
    np.testing.assert_allclose([*near, *far[1:]], [0.6, -0.6, 0.0, 0.6, 0.9], atol=1e-9)


@pytest.mark.parametrize("pushed", [False, True])
def test_wrist_sensors_feel_a_load_or_a_force_and_not_the_weight_of_the_hand(pushed: bool) -> None:
    plant = Plant(load("hrp4_class"), machine=Machine(hand_sensors=True), visuals=False)
    robot, at = plant.robot, np.array([0.0, 0.0, 0.05])
    force = np.array([-6.0, 3.0, 8.0]) if pushed else np.array([0.0, 0.0, -3.0 * GRAVITY])
    if pushed:
        plant.push("left_hand", force, 1.0, at=at)
    else:
        plant.load("left_hand", 3.0, over=0.1, at=at)
    for _ in range(80 if pushed else 120):
        plant.step(plant.hold())
    measured, truth = plant.measure().hand_wrenches, plant.truth()
    assert measured is not None
    robot.update(truth.q, truth.v)
    local = robot.placement(robot.frames["left_hand"]).rotation.T @ force
    assert measured[0] == pytest.approx(np.hstack([local, np.cross(at, local)]), abs=0.15)
    if not pushed:
        assert measured[1] == pytest.approx(np.zeros(6), abs=0.15)


def test_a_fall_is_felt() -> None:
    plant = Plant(load("hrp4_class"), scene=make_scene("table", distance=3.0), visuals=False)
    plant.push("torso", (0.0, 250.0, 0.0), 0.3)
    lowest = np.inf
    while plant.time < 2.0:
        plant.step(plant.hold())
        lowest = min(lowest, float(plant.data.qpos[2]))
    truth = plant.truth()
    assert TrueFallDetector(plant.robot).fallen(truth.q)
    assert lowest > 0.02, "the trunk does not sink into the ground"
    other = truth.contact_force[truth.contact_sole < 0]
    assert other[:, 2].sum() > 0.3 * plant.robot.mass * 9.81, "more than feet carries the weight"


def test_a_hand_that_grips_a_cart_pulls_it() -> None:
    d = load("hrp4_class")
    plant = Plant(d, scene=make_scene("cart", distance=0.13, handle=0.78, resistance=5.0), visuals=False)
    cart = plant.model.body("scene/cart").id
    with pytest.raises(InputError, match="within"):
        Plant(d, scene="cart", visuals=False).grip("left_hand", "left handle")
    plant.grip("left_hand", "left handle")
    plant.grip("right_hand", "right handle")
    before = plant.data.xpos[cart].copy()
    back = plant.hold()
    for i in range(60):  # both elbows bend
        q = back.joint_position.copy()
        for side in ("left", "right"):
            q[plant.robot.joint_index(f"{side}_elbow_pitch")] -= 0.006 * i
        plant.step(wbc.Command(back.joint_torque, q, back.joint_velocity))
    assert np.linalg.norm(plant.data.xpos[cart] - before) > 0.01
    plant.let_go("left_hand")
    plant.let_go("right_hand")
    assert not plant.data.eq_active.any()


def test_a_hand_reaches_handles_up_to_a_quarter_of_a_metre_away_and_holds_them_where_they_are() -> None:
    plant = Plant(load("hrp4_class"), scene="rail", visuals=False)
    model, data = plant.model, plant.data
    hand, handle = model.site("left_hand site").id, model.site("scene/left handle").id
    way = np.array([1.0, 2.0, -2.0]) / 3.0
    for distance, reached in ((0.2499, True), (0.2501, False)):
        data.site_xpos[handle] = point = data.site_xpos[hand] + distance * way
        if not reached:
            with pytest.raises(InputError):
                plant.grip("left_hand", "left handle")
            continue
        plant.grip("left_hand", "left handle")
        grip = model.equality("left_hand on left handle").id
        assert data.eq_active[grip] == 1 and data.eq_active.sum() == 1
        for body, place in ((model.eq_obj1id[grip], 0), (model.eq_obj2id[grip], 3)):
            held = data.xpos[body] + data.xmat[body].reshape(3, 3) @ model.eq_data[grip, place : place + 3]
            np.testing.assert_allclose(held, point, atol=1e-9)
        before = model.eq_data[grip].copy()
        data.site_xpos[handle] += 0.3  # it has slipped out of the hand by as much
        plant.grip("left_hand", "left handle")
        np.testing.assert_array_equal(model.eq_data[grip], before)
        plant.let_go("left_hand")
        assert not data.eq_active.any()


def test_the_cart_moves_above_its_resistance_and_not_below() -> None:
    plant = Plant(load("hrp4_class"), scene=make_scene("cart", distance=1.0, resistance=15.0), visuals=False)
    cart = plant.model.body("scene/cart").id
    moved = []
    for force in (12.0, 20.0):
        plant.reset()
        for _ in range(200):
            plant.data.xfrc_applied[cart, 0] = force
            mujoco.mj_step(plant.model, plant.data)
        moved.append(float(plant.data.qvel[plant.model.body_dofadr[cart]]))
    assert abs(moved[0]) < 0.005
    assert moved[1] == pytest.approx((20.0 - 15.0) / 10.0 * 0.2, rel=0.3)


def built(kind: str, **values: object) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = make_scene(kind, **values).spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def extents(model: mujoco.MjModel, data: mujoco.MjData, body: str) -> np.ndarray:
    """Lowest and highest x, y and z of the geoms of a body, shape (3, 2), m."""
    ends = []
    for i in np.flatnonzero(model.geom_bodyid == model.body(body).id):
        middle, half = model.geom_aabb[i, :3], model.geom_aabb[i, 3:]
        corners = middle + half * np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        if (
            model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CAPSULE
        ):  # its box is larger than itself when it is turned
            axis = np.outer([-1.0, 1.0], [0.0, 0.0, model.geom_size[i, 1]])
            tips = data.geom_xpos[i] + axis @ data.geom_xmat[i].reshape(3, 3).T
            ends += [tips - model.geom_size[i, 0], tips + model.geom_size[i, 0]]
        else:
            ends.append(data.geom_xpos[i] + corners @ data.geom_xmat[i].reshape(3, 3).T)
    points = np.vstack(ends)
    return np.stack([points.min(axis=0), points.max(axis=0)], axis=1)


sizes = st.floats(0.06, 2.0)


@given(st.floats(-3.0, 3.0), sizes, sizes, sizes)
@examples(10)
def test_a_table_stands_on_the_floor_with_its_edge_at_its_distance(
    distance: float, height: float, length: float, width: float
) -> None:
    found = extents(*built("table", distance=distance, height=height, length=length, width=width), "table")
    expected = [[distance, distance + length], [-0.5 * width, 0.5 * width], [0.0, height]]
    np.testing.assert_allclose(found, expected, atol=1e-9)


@given(st.floats(0.2, 3.0), st.floats(0.3, 2.0), st.floats(0.5, 4.0), st.floats(0.01, 0.05))
@examples(10)
def test_a_rail_has_its_top_at_its_height_and_posts_at_its_ends(
    distance: float, height: float, width: float, radius: float
) -> None:
    model, data = built("rail", distance=distance, height=height, width=width, radius=radius)
    found, half = extents(model, data, "rail"), 0.5 * width + radius
    expected = [[distance - radius, distance + radius], [-half, half], [-radius, height]]
    np.testing.assert_allclose(found, expected, atol=1e-9)  # the round ends of the posts are in the ground
    np.testing.assert_allclose(
        data.site_xpos, [[distance, side * 0.2, height - radius] for side in (1.0, -1.0)], atol=1e-9
    )


@pytest.mark.parametrize("height", [0.0, 0.7])
def test_a_box_lies_on_its_stand_with_its_handles_beside_it(height: float) -> None:
    model, data = built("box", distance=0.6, height=height, mass=4.0, length=0.4, width=0.3, tall=0.2)
    found = extents(model, data, "box")
    np.testing.assert_allclose(found[0], [0.4, 0.8], atol=1e-9)
    np.testing.assert_allclose(found[2], [height, height + 0.2], atol=2e-4)
    np.testing.assert_allclose(found[1], [-0.195, 0.195], atol=1e-9)  # handles 30 mm beside it, of 15 mm
    assert model.body("box").mass[0] == pytest.approx(4.0)
    np.testing.assert_allclose(data.site_xpos[:, 1], [0.18, -0.18])
    assert (model.nbody == 3) == (height > 0.0)
    if height:
        expected = [[0.4, 0.8], [-0.15, 0.15], [0.0, height]]
        np.testing.assert_allclose(extents(model, data, "stand"), expected, atol=1e-9)


def test_a_cart_stands_on_its_wheels_behind_its_bar() -> None:
    """Bar, 0.12 m of room for feet, axles; the middle of the mass is in the plane of symmetry."""
    model, data = built("cart", distance=0.5, mass=20.0, handle=1.0, length=0.8, width=0.6)
    found = extents(model, data, "cart")
    np.testing.assert_allclose(found[0], [0.5 - 0.015, 0.62 + 0.8 + 0.06], atol=1e-9)
    np.testing.assert_allclose(found[1], [-0.36, 0.36], atol=1e-9)  # of the wheels
    np.testing.assert_allclose(found[2], [0.0, 1.015], atol=1e-9)
    np.testing.assert_allclose(data.site_xpos, [[0.5, 0.2, 1.0], [0.5, -0.2, 1.0]], atol=1e-9)
    assert model.body("cart").mass[0] == pytest.approx(20.0)
    assert data.xipos[model.body("cart").id, 1] == pytest.approx(0.0, abs=1e-9)
    balls = model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    np.testing.assert_allclose(model.geom_friction[balls, 0], 15.0 / (20.0 * GRAVITY))
    ends = [[x, y] for x in (0.62, 1.42) for y in (-0.3, 0.3)]
    np.testing.assert_allclose(data.geom_xpos[balls][:, :2], ends, atol=1e-9)


@pytest.mark.parametrize("opens", ["away", "towards"])
@pytest.mark.parametrize(("hinge", "side"), [("left", 1.0), ("right", -1.0)])
def test_a_door_fills_its_frame_but_for_a_gap_and_opens_as_it_is_asked_to(
    hinge: str, side: float, opens: str
) -> None:
    size = {"distance": 0.7, "width": 0.9, "height": 1.8, "handle": 0.95, "mass": 11.0}
    model, data = built("door", hinge=hinge, opens=opens, **size)
    leaf = np.flatnonzero((model.geom_bodyid == model.body("door").id) & (model.geom_type == 6))
    low, high = data.geom_xpos[leaf] - model.geom_size[leaf], data.geom_xpos[leaf] + model.geom_size[leaf]
    np.testing.assert_allclose(low[0], [0.7, -0.44, 0.02], atol=1e-9)
    np.testing.assert_allclose(high[0], [0.74, 0.44, 1.8], atol=1e-9)
    frame = extents(model, data, "door frame")
    np.testing.assert_allclose(frame, [[0.67, 0.77], [-0.54, 0.54], [0.0, 1.8]], atol=1e-9)
    assert model.body("door").mass[0] == pytest.approx(11.3)  # with its handle
    np.testing.assert_allclose(model.jnt_range[0], [0.0, np.radians(110.0)])
    assert data.site_xpos[0] == pytest.approx([0.64, -side * 0.35, 0.95])
    data.qpos[0] = np.radians(90.0)
    mujoco.mj_kinematics(model, data)
    way = 1.0 if opens == "away" else -1.0
    assert data.site_xpos[0] == pytest.approx([0.7 + way * 0.8, side * (0.45 - way * 0.06), 0.95])


@pytest.mark.parametrize(
    ("name", "option", "good", "bad"),
    [("table", "distance", (-100.0, 100.0), (-100.1, 100.1)), ("rail", "width", (0.4, 20.0), (0.39, 20.1))],
)
def test_things_are_within_their_bounds(
    name: str, option: str, good: tuple[float, ...], bad: tuple[float, ...]
) -> None:
    """100 m from the origin at most; a bar is as long as its handles are apart, 0.4 m, and 20 m at most."""
    for value in good:
        assert getattr(make_scene(name, **{option: value}), option) == value
    for value in bad:
        with pytest.raises(InputError):
            make_scene(name, **{option: value})
