"""Closed chains: motion and forces of MuJoCo's equations, closures that are kept, and those that cannot be."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from closed_chains import RODS, four_bar_knee, parallel_ankles, three_bars

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.core.conventions import configuration_to_mujoco, velocity_to_mujoco
from wbc.core.model import Closure
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription

EXAMPLES = Path(__file__).parents[2] / "examples"


# ---- closed chains --------------------------------------------------------------------------------------------------

BIPED = (EXAMPLES / "biped.xml").read_text(encoding="utf-8")
BIPED = BIPED.replace("</worldbody>", '<geom name="floor" type="plane" size="0 0 1"/></worldbody>')


def closed(what: str) -> tuple[RobotDescription, mujoco.MjModel]:
    """Return a robot with closed chains, and its model."""
    if what == "ankles":
        xml = parallel_ankles(BIPED)
        return RobotDescription.from_mjcf(xml, left_sole="left_foot", right_sole="right_foot"), (
            mujoco.MjModel.from_xml_string(xml)
        )
    xml = four_bar_knee("<freejoint/>" if what == "floating knee" else "")
    base = "floating" if what == "floating knee" else "fixed"
    return RobotDescription.from_mjcf(xml, base=base, feet=False), mujoco.MjModel.from_xml_string(xml)


def in_motion(description: RobotDescription, seed: int) -> tuple[wbc.Robot, list[wbc.LoopClosure]]:
    """Return a robot at a random posture in which its chains close, moving so that they stay closed."""
    robot, rng = description.robot(), np.random.default_rng(seed)
    ik = wbc.InverseKinematics(robot, 0.01)
    posture = ik.add(wbc.PostureTask(weight=1e-3))
    ik.add(wbc.JointLimits())
    driven = [i for i in range(robot.na) if i not in robot.passive]
    target = robot.q[robot.base_nq :].copy()
    target[driven] += rng.uniform(-0.15, 0.15, len(driven))
    posture.target = np.clip(
        target, np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0)
    )
    for _ in range(200):
        v = ik.step()
    closures = [contact for contact in ik.contacts if isinstance(contact, wbc.LoopClosure)]
    rows = np.concatenate([rows_of(closure)[0] for closure in closures])
    v = rng.normal(size=robot.nv)
    v -= np.linalg.pinv(rows) @ (rows @ v)
    robot.update(robot.q.copy(), v)
    return robot, closures


def rows_of(closure: wbc.LoopClosure) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Jacobian, error and drift of a closure."""
    rows = np.zeros((closure.dim, closure.robot.nv)), np.zeros(closure.dim), np.zeros(closure.dim)
    closure.evaluate(*rows)
    return rows


@pytest.mark.parametrize("what", ["knee", "floating knee", "ankles"])
def test_motion_and_forces_of_a_closed_chain_are_those_of_mujocos_equations(what: str) -> None:
    """Its mass matrix, its bias and the rows of its own equalities: accelerations under the torques of the solution.

    Forces in the chain do no work and give no momentum, passive joints have no torque.
    """
    description, model = closed(what)
    robot, closures = in_motion(description, 1)
    assert all(max(closure.gap()) < 1e-6 for closure in closures)
    controller = wbc.Controller(robot, 0.002)
    driven = [name for name in robot.joint_names if name not in description.passive]
    posture = controller.add(wbc.PostureTask(joints=driven, stiffness=400.0))
    controller.add(wbc.TorqueLimits())
    posture.target = {name: description.half_sitting[name] + 0.3 for name in driven[-1:]}
    solution = controller.solve()
    assert solution.ok
    assert not solution.torques[robot.passive].any()
    assert np.abs(np.delete(solution.torques, robot.passive)).max() > 0.1
    tau = np.concatenate([np.zeros(robot.base_dof), solution.torques])
    forces = sum(
        rows_of(closure)[0].T @ solution.wrenches[closure.name]
        for closure in controller.contacts
        if isinstance(closure, wbc.LoopClosure)
    )
    left = robot.mass_matrix @ solution.accelerations + robot.bias - tau - forces
    np.testing.assert_allclose(left, 0.0, atol=1e-5)  # joints without a drive included
    inner = robot.mass_matrix @ solution.accelerations + robot.bias - tau
    assert inner @ robot.v == pytest.approx(0.0, abs=1e-5) and np.abs(inner).max() > 0.05
    if robot.floating:
        assert np.abs(inner[:6]).max() < 1e-6  # no momentum

    data, ids = mujoco.MjData(model), [model.joint(name).id for name in robot.joint_names]
    dofs, base = model.jnt_dofadr[ids], [] if not robot.floating else list(range(6))
    if robot.floating:
        configuration_to_mujoco(robot.q, model.jnt_qposadr[ids], data.qpos)
        velocity_to_mujoco(robot.q, robot.v, dofs, data.qvel)
    else:
        data.qpos[model.jnt_qposadr[ids]], data.qvel[dofs] = robot.q, robot.v
    model.dof_frictionloss[:] = 0.0
    model.opt.gravity[2] = -GRAVITY
    model.dof_armature[base] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    for _ in range(2):  # rows of its equalities and their change along the motion
        mujoco.mj_forward(model, data)
        if not _:
            before, full = equality_rows(model, data), np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            force = data.qfrc_passive - data.qfrc_bias
            force[dofs] += solution.torques
            mujoco.mj_integratePos(model, data.qpos, data.qvel, 1e-6)
    drift = (equality_rows(model, data) - before) @ data.qvel / 1e-6
    n = len(before)
    kkt = np.block([[full, before.T], [before, np.zeros((n, n))]])
    found = np.linalg.lstsq(kkt, np.concatenate([force, -drift]), rcond=None)[0][: model.nv]
    np.testing.assert_allclose(
        found[dofs], solution.accelerations[robot.base_dof :], atol=2e-3 * np.abs(found).max()
    )


def equality_rows(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return MuJoCo's own Jacobian of its equalities, shape (rows, nv)."""
    rows = data.efc_J.reshape(-1, model.nv) if not mujoco.mj_isSparse(model) else None
    if rows is None:
        rows = np.zeros((data.nefc, model.nv))
        mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return np.array(rows[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)])


@pytest.mark.parametrize(("what", "dim"), [("knee", 2), ("ankles", 3)])
def test_rows_of_a_closure_are_the_change_of_its_gap(what: str, dim: int) -> None:
    """Out of the plane of four bars there is none. Error, Jacobian and drift by finite differences, open chains too."""
    description, _ = closed(what)
    robot = description.robot()
    closure = description.closures[0]
    for rotation in (False, True):
        contact = wbc.LoopClosure(closure.frame, closure.other, rotation=rotation)
        contact.bind(robot)
        if not rotation:
            assert contact.dim == dim
        rng = np.random.default_rng(0)
        q = robot.half_sitting.copy()
        spread = (
            0.2 if not rotation else 0.0
        )  # orientations, with the linear change of a rotation, where they are one
        q[robot.base_nq :] += spread * rng.normal(size=robot.na)
        v = rng.normal(size=robot.nv)
        robot.update(q, v)
        jacobian, _, drift = rows_of(contact)
        ends = []
        for step in (1e-6, -1e-6):
            robot.update(pin.integrate(robot.model, q, step * v), v)
            ends.append(rows_of(contact))
        if not rotation:
            np.testing.assert_allclose(jacobian @ v, -(ends[0][1] - ends[1][1]) / 2e-6, atol=1e-6)
        np.testing.assert_allclose(drift, (ends[0][0] - ends[1][0]) @ v / 2e-6, atol=1e-5)
        robot.update(robot.half_sitting.copy(), np.zeros(robot.nv))


OPTIONS = ("stiffness", "damping", "rate", "wrench_weight", "motion_weight")


def test_a_closure_keeps_what_is_given_for_its_rows() -> None:
    """Along axes in which the chain does not open there is no row."""
    given = {name: np.arange(1.0, 7.0) * (k + 1) for k, name in enumerate(OPTIONS)}
    robot = wbc.load_robot("hrp4_class").robot()
    hands = wbc.LoopClosure("left_hand", "right_hand", motion_weight=1.0)
    for name, values in given.items():
        setattr(hands, name, values)
    controller = wbc.Controller(robot, 0.002)
    for _ in range(2):
        controller.add(hands)
        for name, values in given.items():
            np.testing.assert_array_equal(getattr(hands, name), values, name)
        controller.remove(hands)
    description, _ = closed("knee")
    closure, robot = description.closures[0], description.robot()
    knee = wbc.LoopClosure(closure.frame, closure.other, rotation=False)
    knee.wrench_weight = [1.0, 2.0, 3.0]
    knee.bind(robot)
    lines = np.abs(knee.directions)
    np.testing.assert_allclose(knee.wrench_weight, lines @ [1.0, 2.0, 3.0])
    assert set(lines.ravel()) == {0.0, 1.0} and knee.dim == 2


def test_a_biped_with_rods_at_its_ankles_stands_in_its_own_model() -> None:
    description, model = closed("ankles")
    assert {"left_ankle_pitch", "right_ankle_roll"} <= set(description.passive)
    with pytest.raises(ModelError, match="left_inner.*MujocoLoop"):
        wbc.Plant(description)
    loop = wbc.sim.MujocoLoop(description, model)
    assert not loop.notes and set(loop.actuators.kinds) == {"motor", "none"}
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), loop.control_period))
    start = loop.truth().com
    loop.push("trunk", [25.0, 10.0, 0.0], 0.1)
    while loop.time < 0.4:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and control.status() == "ok"
    assert np.abs(loop.truth().com - start).max() < 0.01
    wrenches = control.controller.solution.wrenches
    assert abs(wrenches["left_inner"][2]) > 10.0


def test_inverse_kinematics_keeps_a_chain_closed_and_closes_an_open_one() -> None:
    description, _ = closed("knee")
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, 0.01)
    shin = ik.add(wbc.OrientationTask("shin"))
    ik.add(wbc.PostureTask(weight=1e-6), wbc.JointLimits())
    (closure,) = ik.contacts
    shin.target = pin.rpy.rpyToMatrix(0.0, 0.4, 0.0)
    result = ik.reach()
    knee, crank = (result.configuration[robot.joint_index(name)] for name in ("knee", "crank"))
    assert result.reached and knee == pytest.approx(0.4, abs=1e-3) and abs(crank) > 0.3
    robot.q[:] = result.configuration
    robot.q[robot.joint_index("rod")] += 0.2
    ik.update(robot.q.copy())
    assert closure.gap()[0] > 0.01
    for _ in range(300):
        ik.step()
    assert closure.gap()[0] < 1e-6


def test_closed_chains_that_cannot_be_are_refused_by_name() -> None:
    short = (
        four_bar_knee()
        .replace('fromto="0 0 0 .06 0 0"', 'fromto="0 0 0 .06 0 0"')
        .replace('anchor="-.02 0 -.2"', 'anchor="-.02 0 -.9"')
    )
    far = RobotDescription.from_mjcf(short, base="fixed")  # closed where the file has it
    assert far.closures
    with pytest.raises(ModelError, match="'four bars' does not close in half-sitting.* mm"):
        RobotDescription.from_mjcf(four_bar_knee(), base="fixed", half_sitting={"crank": 1.3, "knee": -1.9})
    with pytest.raises(InputError, match="'shin' twice"):
        wbc.LoopClosure("shin", "shin")
    robot = RobotDescription.from_mjcf(four_bar_knee(), base="fixed").robot()
    with pytest.raises(InputError, match="no joint moves 'shin' against 'four bars_2'"):
        wbc.Controller(robot, 0.002).add(wbc.LoopClosure("shin", "four bars_2"))


CLOSURES: dict[str, tuple[float, object, str]] = {
    "too far": (
        0.9,
        Closure("tie", "end", "place", False),
        "'tie' does not close.* 'end' and 'place' stay .* mm",
    ),
    "turned": (0.9, Closure("tie", "end", "place", True), "'end' and 'place' stay .* mm and .*°"),
    "no frame": (0.3, Closure("tie", "ende", "place", False), "'ende'.*'end'"),
    "one frame": (0.3, Closure("tie", "end", "end", False), "'end' twice"),
    "one body": (0.3, Closure("tie", "end", "down", False), "'end' to 'down'.*one rigid body"),
    "a pair of names": (0.3, ("end", "place"), "class Closure.*'place'"),
}


@pytest.mark.parametrize("what", CLOSURES)
def test_closures_of_a_urdf_that_cannot_be_are_refused_by_name(what: str) -> None:
    x, closure, said = CLOSURES[what]
    with pytest.raises((ModelError, InputError), match=said):
        RobotDescription.from_urdf(three_bars(x), base="fixed", closures=[closure])  # type: ignore[list-item]


def test_a_closure_of_a_urdf_closes_where_its_joints_let_it() -> None:
    near = Closure("tie", "end", "place", True)
    robot = RobotDescription.from_urdf(three_bars(0.35), base="fixed", closures=[near]).robot()
    apart = robot.placement("end").actInv(robot.placement("place"))
    assert np.linalg.norm(pin.log6(apart).vector) < 1e-6


TIES = {
    "to the world": {"tie": "connect", "one": "right", "two": "world", "at": 'anchor="0 0 -.2"'},
    "from the world": {"tie": "connect", "one": "world", "two": "right", "at": 'anchor=".2 0 1"'},
    "weld": {"tie": "weld", "one": "bar", "two": "right", "at": 'anchor="0 0 0"'},
}


@pytest.mark.parametrize("what", ["to the world", "from the world"])
def test_a_chain_that_closes_at_the_world_of_a_bolted_robot(what: str) -> None:
    """A parallelogram: its bar stays level, and half of its weight rests on the far end."""
    description = RobotDescription.from_mjcf(RODS.format(**TIES[what]), base="fixed")
    assert description.passive == ("bar", "right") and not any(
        "'foot'" in line for line in description.doubts()
    )
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(wbc.PostureTask({"left": 0.4}, joints=["left"]), wbc.JointLimits())
    found = dict(zip(robot.joint_names, ik.reach().configuration.tolist(), strict=True))
    assert found == pytest.approx({"left": 0.4, "bar": -0.4, "right": 0.4}, abs=1e-4)
    controller = wbc.Controller(robot, 0.002)
    controller.add(wbc.PostureTask(joints=["left"], hard=True))
    solution = controller.solve()
    (closure,) = controller.contacts
    force = closure.directions.T @ solution.wrenches[closure.name]
    bar, right = (float(robot.model.inertias[robot.model.getJointId(name)].mass) for name in ("bar", "right"))
    assert abs(force[2]) == pytest.approx(GRAVITY * (0.5 * bar + right), rel=1e-3)


def test_a_weld_of_what_one_joint_moves_leaves_that_joint_alone_out() -> None:
    """A weld across a single hinge: all rows but those that the hinge turns are none."""
    robot = RobotDescription.from_mjcf(RODS.format(**TIES["weld"]), base="fixed").robot()
    controller = wbc.Controller(robot, 0.002)
    assert controller.contacts[0].dim == 1
    controller.add(wbc.PostureTask())
    solution = controller.solve()
    assert solution.ok and solution.accelerations[robot.joint_index("right")] == pytest.approx(0.0, abs=1e-6)


def test_a_chain_of_a_urdf_is_closed_by_a_pair_of_frames() -> None:
    own = RobotDescription.from_mjcf(four_bar_knee(), base="fixed")
    again = RobotDescription.from_urdf(
        own.urdf, base="fixed", closures=own.closures, passive=own.passive, armature=dict(own.armature)
    )
    one, two = own.robot(), again.robot()
    np.testing.assert_allclose(one.mass_matrix, two.mass_matrix, atol=1e-12)
    assert two.closures == one.closures and (two.passive == one.passive).all()
    with pytest.raises(InputError, match="wheel"):
        RobotDescription.from_urdf(own.urdf, base="fixed", closures=own.closures, passive=["wheel"])
