"""Built-in robots: what they are, and that Pinocchio and MuJoCo see the same machine."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco_dynamics import assert_same_dynamics

from wbc.base.errors import InputError, UnknownNameError
from wbc.base.registry import Registry
from wbc.core import conventions
from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription, load, names, register, registry, urdf
from wbc.robots.derivation.servo import ServoRule, effective_inertia
from wbc.robots.derivation.soles import sole_rectangle
from wbc.robots.models import example_robots, hrp4_class
from wbc.sim.balance.standing import StandSpec
from wbc.sim.balance.tracking import TrackSpec
from wbc.sim.studies.outcomes import Outcome, TrialKind
from wbc.sim.walks.spec import WalkSpec
from wbc.tasks import CoMTask, PositionTask

BUILT_IN = ("hrp4_class", "talos", "g1")


def mujoco_model(description: RobotDescription) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(description.urdf_without_geometry())
    spec.worldbody.first_body().add_freejoint()
    for name, armature in description.armature.items():
        spec.joint(name).armature = armature
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    return spec.compile()


@pytest.mark.parametrize("name", BUILT_IN)
def test_pinocchio_and_mujoco_agree(name: str) -> None:
    """Mass matrix, bias forces and places of all bodies over random states."""
    description = load(name)
    theirs = mujoco_model(description)
    assert_same_dynamics(description, theirs)
    assert theirs.body_mass.sum() == pytest.approx(description.robot().mass, abs=1e-9)


@pytest.mark.parametrize("name", (*BUILT_IN, "go1", "panda"))
def test_moving_links_are_the_same_robot_with_a_joint_and_an_inertia_each(name: str) -> None:
    description = load(name)
    xml = description.urdf_without_geometry(moving_links=True)
    fixed = description.base == "fixed"
    own, theirs = description.pinocchio_model(), urdf.read(xml).mechanism(fixed).coupled(name)
    assert list(own.names) == list(theirs.names)
    rng = np.random.default_rng(3)
    q, v = pin.integrate(own, pin.neutral(own), rng.normal(size=own.nv)), rng.normal(size=own.nv)
    forces = [pin.nonLinearEffects(model, model.createData(), q, v) for model in (own, theirs)]
    np.testing.assert_allclose(*forces, atol=1e-9)
    root = ElementTree.fromstring(xml)
    links = [str(link.get("name")) for link in root.findall("link")]
    moved = [joint.find("child").get("link") for joint in root.findall("joint")]  # type: ignore[union-attr]
    assert len(links) == len(moved) + 1 and len(root.findall("link/inertial")) == len(links)
    assert not root.findall("joint[@type='fixed']")
    for sole in description.soles:
        assert description.attachment(sole.frame)[0] in links


def test_rotors_of_engines_without_them_are_discs_of_the_links_behind_the_joints() -> None:
    description = load("g1")
    xml = description.urdf_without_geometry(moving_links=True, rotors=True)
    own, theirs = description.pinocchio_model(), urdf.read(xml).mechanism(False).coupled("g1")
    own.armature[:] = theirs.armature[:] = 0.0
    q = description.robot().half_sitting
    masses = [np.diag(pin.crba(model, model.createData(), q)) for model in (own, theirs)]
    more = (masses[1] - masses[0])[6:]
    assert (more > description.armature_array - 1e-12).all()
    for last in ("left_ankle_roll_joint", "right_wrist_yaw_joint"):
        i = description.joint_names.index(last)
        assert more[i] == pytest.approx(description.armature_array[i])
    with pytest.raises(InputError, match="moving_links=True"):
        description.urdf_without_geometry(rotors=True)
    with pytest.raises(InputError, match="slides"):
        load("panda").urdf_without_geometry(moving_links=True, rotors=True)


@pytest.mark.parametrize("name", BUILT_IN)
def test_frames_sit_where_the_attachment_says(name: str) -> None:
    """The link of an attachment survives in MuJoCo, and both libraries put the frame in the same place."""
    description = load(name)
    theirs = mujoco_model(description)
    state = mujoco.MjData(theirs)
    robot = description.robot()
    ids = [theirs.joint(joint).id for joint in description.joint_names]
    rng = np.random.default_rng(2)
    q = pin.integrate(robot.model, robot.half_sitting, rng.normal(size=robot.nv))
    robot.update(q, np.zeros(robot.nv))
    state.qpos[:] = conventions.configuration_to_mujoco(q, theirs.jnt_qposadr[ids])
    mujoco.mj_forward(theirs, state)
    for frame in (*(sole.frame for sole in description.soles), description.imu.frame, description.torso):
        link, placement = description.attachment(frame)
        body = state.body(link)
        world = pin.SE3(body.xmat.reshape(3, 3), body.xpos) * placement
        assert world.isApprox(robot.placement(frame), 1e-9)


@pytest.mark.parametrize("name", BUILT_IN)
def test_soles_are_the_rectangles_around_what_touches_the_ground(name: str) -> None:
    """To a millimetre, whether given or derived."""
    description = load(name)
    model, shapes = description.robot().model, description.mechanism.shapes
    for sole in description.soles:
        found = sole_rectangle(
            shapes, model, model.frames[model.getFrameId(sole.frame)], description.package_dirs
        )
        assert found is not None
        centre, *size = found
        np.testing.assert_allclose(centre, 0.0, atol=1e-3)
        np.testing.assert_allclose((sole.length, sole.width), size, atol=1e-3)


@pytest.mark.parametrize("name", BUILT_IN)
def test_half_sitting_stands(name: str) -> None:
    """Soles flat on z = 0, base upright, centre of mass above the soles, knees bent, inside all limits."""
    description = load(name)
    robot = description.robot()
    assert robot.name == name
    np.testing.assert_array_equal(robot.q, robot.half_sitting)
    np.testing.assert_allclose(robot.model.gravity.linear, [0, 0, -GRAVITY])
    np.testing.assert_allclose(robot.half_sitting[3:7], [0, 0, 0, 1])
    left, right = (robot.placement(sole.frame) for sole in robot.soles)
    np.testing.assert_allclose(0.5 * (left.translation + right.translation), 0.0, atol=1e-6)
    for placement in (left, right):
        np.testing.assert_allclose(placement.rotation, np.eye(3), atol=1e-5)
        assert abs(placement.translation[2]) < 1e-6
    assert left.translation[1] > 0.05 > -0.05 > right.translation[1]
    assert np.abs(robot.com[:2]).max() < 0.02
    joints = robot.half_sitting[7:]
    assert (joints >= robot.position_lower).all()
    assert (joints <= robot.position_upper).all()
    # Both legs are bent: the pelvis is lower than with straight legs by more than 1 % of its height.
    straight = dict.fromkeys(robot.joint_names, 0.0)
    assert robot.half_sitting[2] < 0.99 * robot.configuration(straight)[2]


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_servo_moves_what_is_below_its_joint_and_that_of_a_leg_its_share_of_what_is_above(
    name: str,
) -> None:
    """By Steiner: Σ aᵀIa + m |a × (c − p)|² over the bodies, about the axis of each joint, at half-sitting."""
    description = load(name)
    model, q = description.pinocchio_model(), description.robot().half_sitting
    data, soles, armature = (
        model.createData(),
        tuple(s.frame for s in description.soles),
        0.01 * np.arange(model.nv - 6),
    )
    found = effective_inertia(model, q, soles, armature, 0.4)
    pin.framesForwardKinematics(model, data, q)
    legs = {
        int(j) for frame in soles for j in model.supports[model.frames[model.getFrameId(frame)].parentJoint]
    }

    def about(joint: int, bodies: set[int]) -> float:
        kind = model.joints[joint]
        spin = kind.createData()
        kind.calc(spin, q[kind.idx_q : kind.idx_q + kind.nq])
        axis, size = data.oMi[joint].rotation @ np.ravel(spin.S)[3:], 0.0
        for body in bodies:
            inertia, turn = model.inertias[body], data.oMi[body].rotation
            arm = data.oMi[body].act(inertia.lever) - data.oMi[joint].translation
            size += axis @ turn @ inertia.inertia @ turn.T @ axis + inertia.mass * np.sum(
                np.cross(axis, arm) ** 2
            )
        return float(size)

    for joint in range(2, model.njoints):
        below = {int(each) for each in model.subtrees[joint]}
        expected = about(joint, below)
        if joint in legs:
            expected = max(expected, 0.4 * about(joint, {*range(1, model.njoints)} - below))
        i = model.joints[joint].idx_v - 6
        assert found[i] == pytest.approx(expected + armature[i], rel=1e-9), model.names[joint]


def test_gains_have_the_frequency_and_the_damping_of_their_rule() -> None:
    """By k = (2πf)² I and d = 2ζ √(k I), up to a bound of 13 m g h of a leg, and of 6.5 of its last two joints."""
    rule, inertia = ServoRule(frequency=5.0, damping_ratio=0.7), np.array([0.1, 2.0, 50.0])
    kp, kd = rule.gains(inertia, np.array([np.inf, np.inf, 4000.0]))
    np.testing.assert_allclose(kp, [*((10.0 * np.pi) ** 2 * inertia[:2]), 4000.0])
    np.testing.assert_allclose(kd[:2], 1.4 * np.sqrt(kp[:2] * inertia[:2]))
    np.testing.assert_allclose(kd / kp, kd[0] / kp[0])
    description = load("hrp4_class")
    robot = description.robot()
    bound = rule.bound(robot.model, robot.half_sitting, tuple(sole.frame for sole in description.soles))
    tipping = robot.mass * GRAVITY * robot.com[2]
    for leg in description.legs:
        ratios = bound[[robot.joint_index(joint) for joint in leg]] / tipping
        np.testing.assert_allclose(ratios, [13.0] * 4 + [6.5] * 2, rtol=1e-6)
    assert np.isinf(np.delete(bound, robot.leg_joints)).all()


@pytest.mark.parametrize("name", BUILT_IN)
def test_servos_hold_the_robot(name: str) -> None:
    """Each joint has the frequency that was asked for on the inertia that M(q) shows, legs at least that."""
    description = load(name)
    robot = description.robot()
    omega = 2 * np.pi * description.servo.frequency
    swing = np.diag(robot.mass_matrix)[6:]
    np.testing.assert_allclose(description.armature_array, robot.model.armature[6:])
    assert (description.armature_array > 0.01).all()
    assert (description.kp >= (1 - 1e-9) * omega**2 * swing).all()
    np.testing.assert_allclose(description.kd, 2 * description.kp / omega)
    legs = {joint for leg in description.legs for joint in leg}
    for i, joint in enumerate(robot.joint_names):
        if joint not in legs:
            assert description.kp[i] == pytest.approx(omega**2 * swing[i])
    # A standing ankle balances half the body above it like an inverted pendulum of length h.
    ankle = robot.joint_index(description.legs[0][4])
    height = robot.com[2] - description.ankle("left_foot")[2]
    assert description.effective_inertia[ankle] > 0.5 * 0.8 * robot.mass * height**2
    assert description.effective_inertia[ankle] < 0.5 * 1.5 * robot.mass * height**2


def test_hrp4_class_inertias_are_those_of_its_shapes() -> None:
    """Each link weighs and turns as its drawn solids do at one density; coal integrates them."""
    robot = load("hrp4_class").robot()
    shapes = pin.buildGeomFromUrdf(robot.model, str(hrp4_class.FILE), pin.GeometryType.COLLISION)
    for joint in range(1, robot.model.njoints):
        total = pin.Inertia.Zero()
        for shape in shapes.geometryObjects:
            if shape.parentJoint == joint:
                solid = shape.geometry
                inertia = pin.Inertia(
                    solid.computeVolume(), solid.computeCOM(), solid.computeMomentofInertia()
                )
                total += shape.placement.act(inertia)
        body = robot.model.inertias[joint]
        np.testing.assert_allclose(body.lever, total.lever, atol=1e-8)
        np.testing.assert_allclose(body.inertia / body.mass, total.inertia / total.mass, atol=1e-8)


@pytest.mark.parametrize("name", names())
def test_kinematics_alone_are_those_of_the_whole_update(name: str) -> None:
    """To the last bit, but for the centre of mass, which is summed up in another order."""
    whole = load(name).robot()
    part, rng = whole.clone(), np.random.default_rng(0)
    for _ in range(10):
        q = pin.integrate(whole.model, whole.half_sitting, 0.3 * rng.standard_normal(whole.nv))
        v = rng.standard_normal(whole.nv)
        whole.update(q, v)
        part.update_kinematics(q, v)
        for what in ("q", "v"):
            np.testing.assert_array_equal(getattr(part, what), getattr(whole, what), err_msg=what)
        for what in ("com", "com_velocity"):
            np.testing.assert_allclose(
                getattr(part, what), getattr(whole, what), rtol=0.0, atol=1e-13, err_msg=what
            )
        for i, (one, other) in enumerate(zip(part.data.oMf, whole.data.oMf, strict=True)):
            np.testing.assert_array_equal(one.homogeneous, other.homogeneous)
            rates = (pin.getFrameVelocity(r.model, r.data, i, pin.LOCAL).vector for r in (part, whole))
            np.testing.assert_array_equal(*rates)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_description_goes_to_another_process_and_a_robot_does_not(name: str) -> None:
    """A copied robot would keep the arrays of the old state: only its description can be pickled."""
    known = load(name)
    for twin in (pickle.loads(pickle.dumps(known)), copy.deepcopy(known)):
        assert twin is not known and twin.digest == known.digest and twin.report() == known.report()
        assert (twin.robot().mass_matrix == known.robot().mass_matrix).all()
    robot = known.robot()
    controller = Controller(robot, 0.005)
    task = controller.add(CoMTask())
    for item in (robot, controller, task):
        for duplicate in (pickle.dumps, copy.deepcopy):
            with pytest.raises(InputError, match="clone"):
                duplicate(item)


def test_names_and_registration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_FACTORIES", copy.copy(registry._FACTORIES))
    assert names()[:3] == BUILT_IN
    assert load("talos") is load("talos")
    with pytest.raises(UnknownNameError, match="'talos'"):
        load("taols")
    made = []

    def factory() -> RobotDescription:
        made.append(1)
        return load("hrp4_class")

    register("test_twin", factory)
    assert load("test_twin") is load("test_twin") is load("hrp4_class")
    assert made == [1]
    register("test_twin", factory)
    for another in (example_robots.g1, lambda: load("g1")):
        with pytest.raises(InputError):
            register("test_twin", another)
    for name in (*names()[:3], *registry.others(), "", 3):
        with pytest.raises(InputError):
            register(name, factory)
    assert load("panda").name == "panda" and load("go1").name == "go1"


def test_a_cell_that_runs_again_registers_again() -> None:
    """Functions, classes and records of the same place of a program take the place of what they were."""
    kinds: Registry[Any] = Registry("thing")

    def cell(value: float) -> None:
        class Thing:
            size = value

        kinds.add("function", lambda: value)
        kinds.add("class", Thing)
        kinds.add("record", TrialKind(read=lambda _: value, run=lambda *_: Outcome("done")))

    cell(1.0)
    cell(2.0)
    assert (kinds["function"](), kinds["class"].size, kinds["record"].read({})) == (2.0, 2.0, 2.0)
    for name in kinds:
        with pytest.raises(InputError):
            kinds.add(name, TrialKind(read=load, run=lambda *_: Outcome("done")))


def test_a_robot_that_is_registered_anew_is_the_one_that_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where all that a spec needs without a simulator is kept."""
    monkeypatch.setattr(registry, "_FACTORIES", copy.copy(registry._FACTORIES))
    for torso in ("chest", "pelvis"):
        own = replace(load("hrp4_class"), torso=torso)
        register("own", lambda own=own: own)
        assert load("own") is own
        assert WalkSpec(robot="own").prepare().plant_description.torso == torso


def test_a_description_is_the_robot_of_a_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """A spec keeps a name: that of a built-in robot, or one with the hash of what was given."""
    own = replace(load("hrp4_class"), name="own")
    for robot in (own, load("g1")):
        for make in (WalkSpec, StandSpec, TrackSpec):
            spec = make(robot=robot)
            assert load(spec.robot) is robot and type(spec).from_json(spec.to_json()) == spec
    assert StandSpec(robot=load("g1")).robot == "g1" != StandSpec(robot=own).robot
    with pytest.raises(InputError):
        StandSpec(robot=load("panda"))
    with pytest.raises(UnknownNameError):  # of another process
        StandSpec(robot="gone#0123456789ab")


@pytest.mark.parametrize("name", ["panda", "hrp4_class"])
def test_only_rotors_that_are_derived_are_told_as_derived(name: str) -> None:
    """Mass and size of a robot over its soles give rotors; of an arm none are known."""
    model = load(name)
    soles = {f"{sole.name.removesuffix('_foot')}_sole": sole.link for sole in model.soles}
    bare = RobotDescription.from_urdf(model.urdf, base=model.base, **soles)
    (line,) = (line for line in bare.derived if line.startswith("armature"))
    value = next(iter(bare.armature.values()))
    assert {*bare.armature.values()} == {value} and (value > 0.0) == (f"{value:.3g} kg m²" in line)


@pytest.mark.parametrize("name", ["g1", "talos", "hrp4_class"])
def test_the_role_of_a_hand_or_a_sole_is_a_name_of_its_frame(name: str) -> None:
    robot = load(name).robot()
    roles = {**robot.frames, **{sole.name: sole.frame for sole in robot.soles}}
    assert {"left_hand", "right_hand", "left_foot", "right_foot"} <= set(roles)
    own = {frame.name for frame in robot.model.frames}
    for role, frame in roles.items():
        assert robot.frame_id(role) == robot.frame_id(role if role in own else frame), (
            "a name goes before a role"
        )
    controller = Controller(robot, 0.005)
    task = controller.add(PositionTask("left_hand"))
    assert np.array_equal(task.target, robot.placement(robot.frames["left_hand"]).translation)
    with pytest.raises(InputError, match="did you mean .*'left_hand'"):
        robot.placement("left_hnd")
