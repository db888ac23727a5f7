"""The plant against theory and against Pinocchio: drives, clamps, contacts, pushes, time."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from properties import by_default

from wbc.base.numbers import Array
from wbc.core.signals import Command
from wbc.feet.soles.build_mjcf import VISUAL_GROUP
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.rigid import FlatFoot
from wbc.robots import RobotDescription, load, urdf
from wbc.robots.derivation.link_shapes import link_shapes
from wbc.robots.models.hrp4_class import FILE
from wbc.sim import Machine, PhysicsSettings, Plant
from wbc.sim.plant.link_geoms import SHAPE_GROUP
from wbc.sim.plant.model import drawing_model
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.terrain.spec import terrain

ROBOTS = ("hrp4_class", "talos", "g1")
FEW_SPHERES = FlatFoot(ContactSpheres(row_spacing=0.1))
IN_SPACE = PhysicsSettings(gravity=0.0)
A_BOX = '<mujoco><worldbody><geom type="box" size="0.1 0.1 0.1" pos="3 0 0.1"/></worldbody></mujoco>'
EXAMPLE = Path(__file__).parents[2] / "examples" / "biped.xml"


def state_in_the_air(plant: Plant, rng: np.random.Generator, speed: float) -> tuple[Array, Array]:
    """A random configuration away from the ground and from the joint limits, and a velocity."""
    robot = plant.robot
    q = np.array(robot.half_sitting)
    share = rng.uniform(0.2, 0.8, robot.na)
    q[:3] = [1.0, -2.0, 5.0]
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    q[7:] = robot.position_lower + share * (robot.position_upper - robot.position_lower)
    return q, speed * rng.normal(size=robot.nv)


@pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
def test_masses_and_clamps_are_those_of_the_description(name: str) -> None:
    plant = Plant(load(name), foot="rigid", visuals=False)
    model = plant.model
    feet = sum(foot.fit.added_inertia.mass for foot in plant.feet)
    assert model.body_mass.sum() == pytest.approx(plant.robot.mass + feet, rel=1e-12)
    joint = model.actuator_trnid[:, 0]
    limit = np.stack([-plant.robot.torque_limit, plant.robot.torque_limit], axis=1)
    np.testing.assert_array_equal(model.actuator_forcerange, limit)
    np.testing.assert_array_equal(model.jnt_actfrcrange[joint], limit)
    assert model.jnt_actfrclimited[joint].all() and model.actuator_forcelimited.all()


@pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
@pytest.mark.parametrize("times_limit", [0.5, 10.0])
def test_torque_control_moves_as_pinocchio_says(name: str, times_limit: float) -> None:
    """Pinocchio's inverse dynamics of the motion give back the torque, cut off at the limit, and no base wrench."""
    plant = Plant(load(name), control_period=1e-5, timestep=1e-5, foot=FEW_SPHERES, visuals=False)
    robot, rng = plant.robot, np.random.default_rng(1)
    data = robot.model.createData()
    for _ in range(3):
        q, v = state_in_the_air(plant, rng, 0.5)
        plant.reset(q, velocity=v)
        torque = times_limit * robot.torque_limit * rng.uniform(-1.0, 1.0, robot.na)
        plant.step(Command(torque))
        applied = np.clip(torque, -robot.torque_limit, robot.torque_limit)
        assert (np.abs(torque) > robot.torque_limit).any() == (times_limit > 1.0)
        np.testing.assert_allclose(plant.joint_torque, applied, rtol=1e-12)
        acceleration = (plant.truth().v - v) / plant.timestep
        force = pin.rnea(robot.model, data, q, v, acceleration)
        np.testing.assert_allclose(force[:6], 0.0, atol=1e-3 * robot.mass * plant.physics.gravity)
        np.testing.assert_allclose(force[6:], applied, atol=1e-3 * robot.torque_limit.max())


@pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
def test_servo_torque_is_its_law_within_the_limit(name: str) -> None:
    plant = Plant(load(name), control_period=0.001, physics=IN_SPACE, foot=FEW_SPHERES, visuals=False)
    robot, description, rng = plant.robot, plant.description, np.random.default_rng(2)
    limited = 0
    for error in (1e-4, 1e-2, 0.3):
        q, v = state_in_the_air(plant, rng, 0.2)
        plant.reset(q, velocity=v)
        position = q[7:] + error * rng.normal(size=robot.na)
        velocity = v[6:] + rng.normal(size=robot.na)
        torque = rng.normal(size=robot.na)
        plant.step(Command(torque, position, velocity))
        law = description.kp * (position - q[7:]) + description.kd * (velocity - v[6:]) + torque
        limited += int((np.abs(law) > robot.torque_limit).sum())
        expected = np.clip(law, -robot.torque_limit, robot.torque_limit)
        np.testing.assert_allclose(plant.joint_torque, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(plant.truth().joint_torque, plant.joint_torque)
    assert 0 < limited < 3 * robot.na


@pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
@pytest.mark.parametrize("foot", by_default(["flat", "rigid"], "flat"))
def test_a_flat_sole_on_a_level_floor_needs_few_of_its_spheres(name: str, foot: str) -> None:
    """Eight or nine spheres a sole: the same corners, levers of friction within 12 %, and the same rest under load."""
    few, all_of_them = (
        Plant(load(name), foot=foot, physics=PhysicsSettings(few_contacts=value), visuals=False)
        for value in (True, False)
    )
    sole = few.feet[0].fit.sole
    places = []
    for plant in (few, all_of_them):
        command = plant.hold()
        for _ in range(150):
            plant.step(command)
        truth = plant.truth()
        mine = truth.contact_sole == 0
        place, rotation = plant.data.site_xpos[plant.sole_sites[0]], plant.data.site_xmat[plant.sole_sites[0]]
        places.append(((truth.contact_position[mine] - place) @ rotation.reshape(3, 3))[:, :2])
    assert len(places[0]) <= 9 and len(places[1]) > 20
    for points in places:
        np.testing.assert_allclose(np.ptp(points, axis=0), [sole.length, sole.width], atol=1e-4)
    levers = [np.linalg.norm(points - points.mean(axis=0), axis=1).mean() for points in places]
    assert levers[0] == pytest.approx(levers[1], rel=0.12)
    wrenches = [plant.measure().sole_wrench for plant in (few, all_of_them)]
    weight = few.robot.mass * few.physics.gravity
    np.testing.assert_allclose(wrenches[0], wrenches[1], atol=2e-3 * weight)
    np.testing.assert_allclose(few.truth().com, all_of_them.truth().com, atol=1e-3)


def test_contacts_carry_what_moves_the_centre_of_mass() -> None:
    """Mass times (dv/dt + g) is the sum of the contact forces in every physics step of a landing."""
    plant = Plant(load("hrp4_class"), control_period=0.001, foot=FEW_SPHERES, visuals=False)
    q = plant.on_ground(plant.robot.half_sitting)
    q[2] += 0.01
    plant.reset(q)
    command, mass = plant.hold(), plant.robot.mass
    before, impact = plant.truth().com_velocity, 0.0
    for _ in range(150):
        plant.step(command)
        truth = plant.truth()
        force = truth.contact_force.sum(axis=0)
        momentum = mass * (truth.com_velocity - before) / plant.timestep
        expected = momentum + [0.0, 0.0, mass * plant.physics.gravity]
        impact = max(impact, float(np.linalg.norm(force)))
        np.testing.assert_allclose(force, expected, atol=1e-3 * max(np.linalg.norm(force), 1.0) + 0.05)
        before = truth.com_velocity
    assert impact > 1.5 * mass * plant.physics.gravity


def test_reset_puts_the_soles_on_rough_ground() -> None:
    ground = terrain("stones", amplitude=0.03, seed=3, start=-1.0)
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES, terrain=ground, visuals=False)
    rng = np.random.default_rng(0)
    gaps = []
    for i, foot in enumerate(plant.feet):
        sole = foot.fit.sole
        pin.framesForwardKinematics(plant.robot.model, plant.robot.data, plant.truth().q)
        placement = plant.robot.placement(plant.robot.soles[i].frame)
        local = rng.uniform(-0.5, 0.5, (2000, 3)) * [sole.length, sole.width, 0.0]
        points = local @ placement.rotation.T + placement.translation
        gaps.append(points[:, 2] - ground.height(points[:, 0], points[:, 1]))
    assert -2e-3 < min(gap.min() for gap in gaps) < 2e-3


def test_a_push_gives_its_impulse() -> None:
    """Floating in space, the momentum after pushes is their impulse, for any duration and several at a time."""
    duration = 0.0123
    plant = Plant(load("hrp4_class"), physics=IN_SPACE, foot=FEW_SPHERES, visuals=False)
    q, _ = state_in_the_air(plant, np.random.default_rng(3), 0.0)
    plant.reset(q)
    force, other = np.array([30.0, -20.0, 10.0]), np.array([0.0, 40.0, 5.0])
    plant.push("torso", 0.25 * force, duration)
    plant.push("torso", 0.75 * force, duration)
    plant.push(plant.robot.base_frame, other, 2.0 * duration, at=[0.1, 0.0, 0.05])
    for _ in range(20):
        plant.step(plant.hold())
    momentum = plant.robot.mass * plant.truth().com_velocity
    # 1e-4: moving joints exchange momentum with an error of the first order in the physics step.
    np.testing.assert_allclose(momentum, (force + 2.0 * other) * duration, rtol=1e-4)


def test_a_push_acts_where_it_is_told() -> None:
    """About the point of attack the angular momentum stays zero; about the centre of mass it is r × F t."""
    fine = {"physics": IN_SPACE, "timestep": 1e-4, "control_period": 1e-4}
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False, **fine)
    robot = plant.robot
    frame, at, force = robot.soles[0].frame, np.array([0.05, 0.02, 0.0]), np.array([5.0, 7.0, -3.0])
    q, _ = state_in_the_air(plant, np.random.default_rng(4), 0.0)
    plant.reset(q)
    pin.framesForwardKinematics(robot.model, robot.data, q)
    point = robot.placement(frame).act(at)
    com = plant.truth().com
    plant.push(frame, force, 1e-3, at=at)
    for _ in range(10):
        plant.step(Command(np.zeros(robot.na)))
    truth = plant.truth()
    momentum = pin.computeCentroidalMomentum(robot.model, robot.model.createData(), truth.q, truth.v)
    np.testing.assert_allclose(momentum.linear, force * 1e-3, rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(momentum.angular, np.cross(point - com, force) * 1e-3, rtol=2e-3, atol=1e-6)


def test_a_load_moves_the_centre_of_mass_of_all_bodies_above_it() -> None:
    """MuJoCo's centre of mass of a subtree is the mean of its bodies, whose masses have changed, weighted by mass."""
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False)
    model, data = plant.model, plant.data
    before = model.body_subtreemass.copy()
    plant.load("torso", 5.0, at=[0.1, 0.0, 0.2])
    plant.load("left_hand", 2.0)
    plant.step(plant.hold())
    mujoco.mj_forward(model, data)
    parents = model.body_parentid
    for root in range(model.nbody):
        below = [body for body in range(model.nbody) if _is_below(body, root, parents)]
        masses = model.body_mass[below]
        assert model.body_subtreemass[root] == pytest.approx(masses.sum(), rel=1e-12)
        if masses.sum() > 0.0:
            np.testing.assert_allclose(
                data.subtree_com[root], masses @ data.xipos[below] / masses.sum(), atol=1e-9
            )
    assert model.body_subtreemass[0] - before[0] == pytest.approx(7.0)


def inertia_at_origin(plant: Plant, body: int) -> Array:
    """Inertia of a body about the origin of its frame, in its axes, shape (3, 3), kg m²."""
    model = plant.model
    w, x, y, z = model.body_iquat[body]
    axes = pin.Quaternion(w, x, y, z).matrix()
    return axes @ np.diag(model.body_inertia[body]) @ axes.T + point_inertia(
        model.body_mass[body], model.body_ipos[body]
    )


def point_inertia(mass: float, place: Array) -> Array:
    """Inertia of a point about the origin, m (|p|² 1 − p pᵀ), shape (3, 3), kg m²."""
    return np.asarray(mass * (place @ place * np.eye(3) - np.outer(place, place)))


def test_a_load_comes_evenly_in_its_time_and_is_a_point_where_it_is_put() -> None:
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False)
    model = plant.model
    body, place = plant.places.carrier("torso")
    at, compiled = np.array([0.1, -0.05, 0.2]), [model.body_mass.copy(), model.body_inertia.copy()]
    mass, moment = model.body_mass[body], model.body_mass[body] * model.body_ipos[body]
    before, point = inertia_at_origin(plant, body), place.act(at)
    for target, over, masses in (
        (4.0, 0.02, (1.0, 2.0, 3.0, 4.0, 4.0)),
        (1.0, 0.01, (2.5, 1.0, 1.0)),
        (2.0, 0.0, (2.0,)),
    ):
        for now in masses:
            plant.load("torso", target, over=over, at=at)  # a stream of equal orders is one order
            plant.step(plant.hold())
            assert plant.load_mass == pytest.approx(now)
            assert model.body_mass[body] == pytest.approx(mass + now)
            np.testing.assert_allclose(
                model.body_mass[body] * model.body_ipos[body], moment + now * point, atol=1e-12
            )
            np.testing.assert_allclose(
                inertia_at_origin(plant, body), before + point_inertia(now, point), atol=1e-12
            )
    plant.load("torso", 3.0)
    plant.step(plant.hold())
    assert plant.load_mass == pytest.approx(5.0)
    plant.reset()
    np.testing.assert_array_equal(model.body_mass, compiled[0])
    np.testing.assert_array_equal(model.body_inertia, compiled[1])
    assert plant.load_mass == 0.0


def _is_below(body: int, root: int, parents: Any) -> bool:
    while body not in (root, 0):
        body = parents[body]
    return body == root


def test_control_period_changes_nothing_but_the_rhythm() -> None:
    """The same command, held: five ticks of one step are one tick of five steps, bit for bit."""
    fast = Plant(load("g1"), control_period=0.001, foot=FEW_SPHERES, visuals=False)
    slow = Plant(load("g1"), control_period=0.005, foot=FEW_SPHERES, visuals=False)
    assert (fast.steps, slow.steps) == (1, 5)
    for tick in range(1, 51):
        fast.step(fast.hold())
        if tick % 5 == 0:
            slow.step(slow.hold())
            assert slow.time == pytest.approx(fast.time, abs=1e-12)
            np.testing.assert_array_equal(slow.data.qpos, fast.data.qpos)
            np.testing.assert_array_equal(slow.truth().sole_wrench, fast.truth().sole_wrench)


def test_joints_have_the_damping_and_friction_of_their_file() -> None:
    description = RobotDescription.from_mjcf(EXAMPLE)
    for friction in (0.0, 0.3):
        model = Plant(description, machine=Machine(friction=friction), visuals=False).model
        for name in description.joint_names:
            dof = int(model.joint(name).dofadr[0])
            assert model.dof_damping[dof] == description.damping[name] == 0.2
            assert model.dof_frictionloss[dof] == pytest.approx(0.1 + friction)
    assert not Plant(load("g1"), visuals=False).model.dof_damping.any()


def test_a_payload_is_in_the_torso() -> None:
    plain, loaded = (
        Plant(load("hrp4_class"), machine=Machine(payload=payload), visuals=False).model
        for payload in (0.0, 2.5)
    )
    torso = plain.body(load("hrp4_class").robot().torso_frame).id
    gained = loaded.body_mass - plain.body_mass
    assert gained[torso] == pytest.approx(2.5) and np.count_nonzero(gained) == 1


def test_coupled_joints_go_where_their_leaders_take_them() -> None:
    """By ratio and offset, their speeds by the ratio; a leader feels friction by the ratio, inertia by its square."""
    whole, tie = load("hrp4_class"), '<mimic joint="left_wrist_yaw" multiplier="-2" offset="0.03"/>'
    end = whole.urdf.index("</joint>", whole.urdf.index('<joint name="right_wrist_yaw"'))
    left, right = whole.soles
    description = RobotDescription.from_urdf(
        whole.urdf[:end] + tie + whole.urdf[end:], left_sole=left, right_sole=right
    )
    model = Plant(description, visuals=False).model
    robot = description.robot()
    places, data = RobotPlaces(model, robot), mujoco.MjData(model)
    q = robot.half_sitting.copy()
    q[7 + robot.joint_index("left_wrist_yaw")] = 0.04
    places.set_configuration(q, data.qpos)
    leader, follower = model.joint("left_wrist_yaw"), model.joint("right_wrist_yaw")
    assert data.qpos[follower.qposadr[0]] == pytest.approx(-2.0 * 0.04 + 0.03)
    data.qvel[leader.dofadr[0]] = 0.5
    places.couple_velocities(data.qvel)
    assert data.qvel[follower.dofadr[0]] == pytest.approx(-1.0)
    values = np.zeros(model.nv)
    values[leader.dofadr[0]], values[follower.dofadr[0]] = 0.1, 0.3
    i = robot.joint_index("left_wrist_yaw")
    assert places.reflected(values, 1)[i] == pytest.approx(0.1 + 2.0 * 0.3)
    assert places.reflected(values, 2)[i] == pytest.approx(0.1 + 4.0 * 0.3)
    assert np.count_nonzero(places.reflected(values, 1)) == 1
    (tied,) = places.ties()
    assert {int(model.eq_obj1id[tied]), int(model.eq_obj2id[tied])} == {leader.id, follower.id}
    model.eq_active0[tied] = 0
    assert places.ties() == []


def test_a_robot_without_shapes_is_drawn_as_a_stick_figure() -> None:
    """A ball at each joint, a rod from it to each joint below, and each sole as a plate that stands on the ground."""
    description = load("hrp4_class")
    bare = replace(description, mechanism=replace(description.mechanism, shapes=()))
    robot = bare.robot()
    model, kinds = drawing_model(bare, robot, terrain("flat")), mujoco.mjtGeom
    data = mujoco.MjData(model)
    places = RobotPlaces(model, robot)
    places.set_configuration(robot.half_sitting, data.qpos)
    mujoco.mj_forward(model, data)
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    joints = [robot.data.oMi[j].translation for j in range(1, robot.model.njoints)]
    thickness, seen = 0.03 * float(robot.com[2]), Counter[mujoco.mjtGeom]()
    for i in np.flatnonzero(model.geom_group == VISUAL_GROUP):
        kind, size, place = kinds(model.geom_type[i]), model.geom_size[i], data.geom_xpos[i]
        seen[kind] += 1
        origin = data.xpos[model.geom_bodyid[i]]
        if kind == kinds.mjGEOM_SPHERE:
            assert size[0] == pytest.approx(1.3 * thickness) and np.allclose(place, origin)
        elif kind == kinds.mjGEOM_CYLINDER:
            assert size[0] == pytest.approx(thickness)
            axis = data.geom_xmat[i].reshape(3, 3)[:, 2]
            np.testing.assert_allclose(place - size[1] * axis, origin, atol=1e-6)
            end = place + size[1] * axis
            soles = [robot.placement(sole.frame).translation for sole in robot.soles]
            assert min(np.linalg.norm(end - each) for each in (*joints, *soles)) < 1e-5
        else:
            sole = min(
                robot.soles, key=lambda sole: np.linalg.norm(robot.placement(sole.frame).translation - place)
            )
            np.testing.assert_allclose(2.0 * size, [sole.length, sole.width, 0.8 * thickness], atol=1e-9)
            assert place[2] - size[2] == pytest.approx(robot.placement(sole.frame).translation[2], abs=1e-6)
    assert seen[kinds.mjGEOM_BOX] == 2 and seen[kinds.mjGEOM_SPHERE] == robot.model.njoints - 1
    assert seen[kinds.mjGEOM_CYLINDER] >= 15


def test_links_are_drawn_by_their_visuals_else_by_their_collisions_else_as_sticks() -> None:
    """Each geom of the file in its size and colour; a colour may be that of a name, and one without any is plain."""
    description, kinds = load("hrp4_class"), mujoco.mjtGeom
    root = ElementTree.parse(FILE).getroot()
    links = {str(link.get("name")): link for link in root.findall("link")}
    for name, tag in (("left_shin", "visual"), ("right_shin", "visual"), ("right_shin", "collision")):
        for element in links[name].findall(tag):
            links[name].remove(element)
    links["neck_link"].find("visual/geometry/sphere").set("radius", "0")  # type: ignore[union-attr] # cannot be read
    named: Any = links["head"].find("visual/material")
    named.remove(named.find("color"))
    named.set("name", "dark")
    changed = replace(
        description, mechanism=replace(description.mechanism, shapes=tuple(urdf.shapes(root, [])))
    )
    model = drawing_model(changed, changed.robot(), terrain("flat"))
    drawn: dict[str, list[int]] = {}
    for i in np.flatnonzero(model.geom_group == VISUAL_GROUP).tolist():
        drawn.setdefault(model.body(int(model.geom_bodyid[i])).name, []).append(i)
    plain = [0.78, 0.80, 0.83, 1.0]
    for name, link in links.items():
        if name == "right_shin":
            thickness = 0.03 * float(changed.robot().com[2])
            balls = [i for i in drawn[name] if model.geom_type[i] == kinds.mjGEOM_SPHERE]
            assert [model.geom_size[i, 0] for i in balls] == pytest.approx([1.3 * thickness])
            continue
        instead = name in ("left_shin", "neck_link")
        elements = link.findall("collision" if instead else "visual")
        assert len(drawn.get(name, ())) == len(elements), name
        for i, element in zip(drawn.get(name, ()), elements, strict=True):
            (shape,) = element.find("geometry") or ()
            values = {key: [float(v) for v in text.split()] for key, text in shape.attrib.items()}
            size = {
                "box": [0.5 * v for v in values.get("size", ())],
                "sphere": values.get("radius", []),
                "cylinder": [*values.get("radius", ()), *(0.5 * v for v in values.get("length", ()))],
            }[shape.tag]
            np.testing.assert_allclose(model.geom_size[i, : len(size)], size)
            assert kinds(int(model.geom_type[i])).name == f"mjGEOM_{shape.tag.upper()}"
            color = element.find("material/color")
            wanted = plain if color is None else [float(v) for v in str(color.get("rgba")).split()]
            if name == "head" and element is elements[0]:
                wanted = [0.15, 0.17, 0.20, 1.0]
            np.testing.assert_allclose(model.geom_rgba[i], wanted, atol=1e-6)
            place = np.array([float(v) for v in str((element.find("origin")).get("xyz")).split()])  # type: ignore[union-attr]
            np.testing.assert_allclose(model.geom_pos[i], place, atol=1e-9)


def test_all_links_but_the_feet_touch_things() -> None:
    """The soles touch by themselves."""
    description = load("hrp4_class")
    plant = Plant(description, scene=A_BOX, visuals=False)
    model = plant.model
    shaped = {
        model.body(int(model.geom_bodyid[i])).name for i in np.flatnonzero(model.geom_group == SHAPE_GROUP)
    }
    feet = {description.attachment(sole.frame)[0] for sole in description.soles}
    links = {shape.link for shape in link_shapes(description.mechanism, description.package_dirs)}
    assert len(feet) == 2 and feet <= links
    assert {name for name in links if description.attachment(name)[0] in feet}.isdisjoint(shaped)
    assert {name for name in links if description.attachment(name)[0] not in feet} <= shaped
    touching = model.geom_group == SHAPE_GROUP
    assert (model.geom_conaffinity[touching] == 1).all() and not model.geom_contype[touching].any()


def test_shins_of_a_robot_whose_ankles_are_bent_stay_off_the_ground() -> None:
    """Those of g1 end 50 mm over its soles, within 22 mm where they lean by 0.85 rad; the box about them is longer."""
    description = load("g1")
    plant, robot = Plant(description, scene=A_BOX, visuals=False), description.robot()
    q = np.array(robot.half_sitting)
    for side in ("left", "right"):
        for joint, angle in (("hip_pitch", -0.75), ("knee", 1.6), ("ankle_pitch", -0.85)):
            q[7 + robot.joint_index(f"{side}_{joint}_joint")] = angle
    robot.update(q, np.zeros(robot.nv))
    q[2] -= robot.placement(robot.soles[0].frame).translation[2]
    plant.reset(q)
    mujoco.mj_forward(plant.model, plant.data)
    model = plant.model
    bodies = {model.body(int(model.geom_bodyid[geom])).name for geom in plant.data.contact.geom.ravel()}
    assert bodies == {"world", "left/foot", "right/foot"}
