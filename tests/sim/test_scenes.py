"""Scenes: things by name, which all of the robot touches, and force sensors at the wrists."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import Plant, make_scene
from wbc.sim.plant.settings import Machine
from wbc.sim.scenes.base import scene_kinds
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
        plant = Plant(load(robot), scene=kind)
        start = plant.data.qpos.copy()
        for _ in range(20):
            plant.step(plant.hold())
        assert plant.diverged is None
        wrenches = plant.measure().hand_wrenches
        assert wrenches is not None and np.abs(wrenches[:, :3]).max() < 1.0, "nothing touches the hands"
        things = [j for j in range(plant.model.njnt) if plant.model.joint(j).name.startswith("scene/")]
        for joint in things:  # and nothing moves by itself
            address = plant.model.jnt_qposadr[joint]
            assert np.abs(plant.data.qpos[address : address + 3] - start[address : address + 3]).max() < 2e-3


@pytest.mark.parametrize("angle", [0.0, 90.0])
def test_a_wall_stands_on_the_floor_with_its_face_at_its_distance(angle: float) -> None:
    model, data = built("wall", distance=0.6, angle=angle, width=1.2, height=0.9)
    place = pin.utils.rotate("z", np.radians(angle)).T @ data.geom_xpos[0]  # as seen by who looks at it
    near, far = place - model.geom_size[0], place + model.geom_size[0]
    np.testing.assert_allclose([*near, *far[1:]], [0.6, -0.6, 0.0, 0.6, 0.9], atol=1e-9)


@pytest.mark.parametrize("pushed", [False, True])
def test_wrist_sensors_feel_a_load_or_a_force_and_not_the_weight_of_the_hand(pushed: bool) -> None:
    plant = Plant(load("hrp4_class"), machine=Machine(hand_sensors=True))
    robot, at = plant.robot, np.array([0.0, 0.0, 0.05])
    force = np.array([-6.0, 3.0, 8.0]) if pushed else np.array([0.0, 0.0, -3.0 * GRAVITY])
    if pushed:
        plant.push("left_hand", force, 1.0, at=at)
    else:
        plant.load("left_hand", 3.0, over=0.3, at=at)
    for _ in range(150 if pushed else 200):
        plant.step(plant.hold())
    measured, truth = plant.measure().hand_wrenches, plant.truth()
    assert measured is not None
    robot.update(truth.q, truth.v)
    local = robot.placement(robot.frames["left_hand"]).rotation.T @ force
    assert measured[0] == pytest.approx(np.hstack([local, np.cross(at, local)]), abs=0.15)
    if not pushed:
        assert measured[1] == pytest.approx(np.zeros(6), abs=0.15)


def test_a_fall_is_felt() -> None:
    plant = Plant(load("hrp4_class"), scene=make_scene("table", distance=3.0))
    plant.push("torso", (0.0, 250.0, 0.0), 0.3)
    lowest = np.inf
    while plant.time < 3.0:
        plant.step(plant.hold())
        lowest = min(lowest, float(plant.data.qpos[2]))
    truth = plant.truth()
    assert TrueFallDetector(plant.robot).fallen(truth.q)
    assert lowest > 0.02, "the trunk does not sink into the ground"
    other = truth.contact_force[truth.contact_sole < 0]
    assert other[:, 2].sum() > 0.3 * plant.robot.mass * 9.81, "more than feet carries the weight"


def test_a_hand_that_grips_a_cart_pulls_it() -> None:
    d = load("hrp4_class")
    plant = Plant(d, scene=make_scene("cart", distance=0.13, handle=0.78, resistance=5.0))
    cart = plant.model.body("scene/cart").id
    with pytest.raises(InputError, match="within"):
        Plant(d, scene="cart").grip("left_hand", "left handle")
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


def test_the_cart_moves_above_its_resistance_and_not_below() -> None:
    plant = Plant(load("hrp4_class"), scene=make_scene("cart", distance=1.0, resistance=15.0))
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


@pytest.mark.parametrize("opens", ["away", "towards"])
@pytest.mark.parametrize(("hinge", "side"), [("left", 1.0), ("right", -1.0)])
def test_a_door_hangs_in_its_frame_and_opens_as_it_is_asked_to(hinge: str, side: float, opens: str) -> None:
    model, data = built(
        "door", distance=0.7, width=0.9, height=1.8, handle=0.95, hinge=hinge, opens=opens, mass=11.0
    )
    assert data.site_xpos[0] == pytest.approx([0.64, -side * 0.35, 0.95])
    data.qpos[0] = np.radians(90.0)
    mujoco.mj_kinematics(model, data)
    way = 1.0 if opens == "away" else -1.0
    assert data.site_xpos[0] == pytest.approx([0.7 + way * 0.8, side * (0.45 - way * 0.06), 0.95])
