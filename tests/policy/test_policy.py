"""Policies: what a description says, what the network sees, what the drives get, and bad input."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_policies import (
    DT,
    G1,
    LEGS,
    Known,
    control,
    described,
    resting,
    ticks,
    write_network,
    write_tracker,
)
from numpy.typing import NDArray
from properties import each_once

import wbc
from wbc.base.errors import InputError, UnknownNameError, WbcError
from wbc.core.estimation.falls import FallReason
from wbc.policy import (
    HeightScan,
    OnnxNetwork,
    PolicyControl,
    PolicyDescription,
    PolicyFilter,
    PolicyGuard,
    Term,
)

pytest.importorskip("onnxruntime")

N = len(LEGS)


def test_the_network_sees_the_estimate_in_the_order_and_units_of_its_description() -> None:
    """Joints are permuted, and the robot turned, tilted and moving: every term by its definition."""
    joints = tuple(np.random.default_rng(0).permutation(LEGS))
    n = len(joints)
    network = Known(9 + 3 * n, n, np.linspace(-0.2, 0.2, n))
    description = described(joints)
    plant, policy = control(network, description)
    policy.velocity = (0.3, -0.1, 0.2)
    robot, names = policy.drives.observer.robot, list(G1.joint_names)
    for _ in ticks(0.05):
        plant.step(policy.command(plant.measure()))
    columns = [names.index(joint) for joint in joints]
    network.seen.clear()
    while not network.seen:
        command = policy.command(plant.measure())
        q, v = np.array(robot.q), np.array(robot.v)
        plant.step(command)
    rotation = pin.Quaternion(q[3:7]).matrix()
    expected = [
        v[3:6],
        rotation.T @ [0.0, 0.0, -1.0],
        [0.3, -0.1, 0.2],
        q[7:][columns] - description.default,
        v[6:][columns],
        network.action,
    ]
    np.testing.assert_allclose(network.seen[0], np.concatenate(expected), rtol=1e-5, atol=1e-6)


def test_targets_and_gains_are_those_of_the_policy_and_other_joints_are_held() -> None:
    n = len(LEGS)
    network = Known(9 + 3 * n, n, 0.1)
    description = described(
        default=[float(G1.robot().half_sitting[7 + G1.joint_names.index(j)]) for j in LEGS]
    )
    plant, policy = control(network, description)
    command = policy.command(plant.measure())
    columns = [G1.joint_names.index(joint) for joint in LEGS]
    others = [k for k in range(len(G1.joint_names)) if k not in columns]
    robot = policy.drives.observer.robot
    np.testing.assert_allclose(
        command.joint_position[columns], np.array(description.default) + 0.025, atol=1e-12
    )
    np.testing.assert_allclose(command.kp[columns], description.kp)
    np.testing.assert_allclose(command.kd[columns], description.kd)
    np.testing.assert_allclose(command.joint_position[others], robot.half_sitting[7:][others])
    np.testing.assert_allclose(command.kp[others], robot.servos.kp[others])


def test_torques_that_a_policy_asks_for_stay_within_the_limits() -> None:
    n = len(LEGS)
    plant, policy = control(Known(9 + 3 * n, n, 100.0), described(action_scale=10.0))
    for _ in ticks(0.1):
        m = plant.measure()
        command = policy.command(m)
        asked = command.joint_torque + command.kp * (command.joint_position - m.joint_position)
        asked += command.kd * (command.joint_velocity - m.joint_velocity)
        assert (np.abs(asked) <= policy.drives.observer.robot.torque_limit * (1.0 + 1e-6)).all()
        plant.step(command)


class Scribbler(Known):
    """A network that uses its observation as room for its own numbers."""

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        action = super().__call__(observation)
        observation[:] = -9.0
        return action


def test_a_policy_acts_once_in_its_period_and_sees_its_history() -> None:
    n = len(LEGS)
    description = described(
        observation=[
            Term("command", history=3, scale=(1.0, 2.0, 3.0)),
            Term("last_action", clip=0.05, scale=2.0),
        ]
    )
    network = Scribbler(9 + n, n, 0.1)
    plant, policy = control(network, description)
    speeds = [0.1, 0.2, 0.3, 0.4]
    for speed in speeds:
        policy.velocity = (speed, 0.1, 0.0)
        for _ in ticks(policy.description.period):
            plant.step(policy.command(plant.measure()))
    assert len(network.seen) == len(speeds)
    np.testing.assert_allclose(network.seen[0][:9], [0.1, 0.2, 0.0] * 3, atol=1e-6)  # filled with the first
    np.testing.assert_allclose(network.seen[3][:9:3], [0.2, 0.3, 0.4], atol=1e-6)  # oldest first
    np.testing.assert_allclose(network.seen[3][9:], 2.0 * 0.05, atol=1e-6)  # bounded, and then multiplied
    policy.reset()
    policy.command(plant.measure())
    assert not network.seen[-1][9:].any()


def test_a_policy_that_begins_anew_is_as_one_that_has_not_begun() -> None:
    """Until its first action, too, which a first measurement that cannot be used puts off by a period."""
    network = Known(sum((3, 3, 3, N, N, N)), N, 0.5)
    plant, policy = control(network, described())
    nothing = replace(plant.measure(), joint_position=np.full(len(G1.joint_names), np.nan))
    told = []
    for _ in range(2):
        commands = [policy.command(measurement) for measurement in (nothing, *(plant.measure(),) * 3)]
        told.append([command.joint_position for command in commands[1:]])
        for _ in ticks(0.05):
            policy.command(plant.measure())
        policy.reset()
    np.testing.assert_array_equal(*told)


def test_velocities_beyond_those_of_the_policy_are_asked_for_at_their_most() -> None:
    n = len(LEGS)
    plant, policy = control(Known(9 + 3 * n, n), described(fastest=(0.5, 0.2, 0.4)))
    policy.velocity = (0.9, -0.9, 0.1)
    assert policy.velocity == (0.9, -0.9, 0.1)
    np.testing.assert_allclose(policy.observed.command, [0.5, -0.2, 0.1])
    policy.velocity = None
    assert policy.velocity is None and not policy.observed.command.any()
    assert policy.velocity_limits == (0.5, 0.5, 0.2, 0.4)
    one_sided = described(fastest=(1.5, 0.3, 0.2), slowest=(-0.5, 0.0, -0.4))
    plant, policy = control(Known(9 + 3 * n, n), one_sided)
    policy.velocity = (-9.0, -9.0, -9.0)
    np.testing.assert_allclose(policy.observed.command, [-0.5, 0.0, -0.4])
    policy.velocity = (9.0, 9.0, 9.0)
    np.testing.assert_allclose(policy.observed.command, [1.5, 0.3, 0.2])
    assert policy.velocity_limits == (1.5, 0.5, 0.0, 0.2)


def test_a_policy_is_asked_for_no_velocity_of_its_own_in_a_stand() -> None:
    """It falls behind as it walks, and is asked for more; in a stand its clock rests, whatever it drifts by."""
    n = len(LEGS)
    seen = [Term("command"), Term("phase_cosine")]
    plant, policy = control(Known(5, n), described(observation=seen, phase=0.8), regain=0.5)
    policy.velocity = (0.5, 0.0, 0.0)
    while plant.time < 0.4:
        plant.step(policy.command(plant.measure()))
    assert policy.observed.command[0] > 0.55
    policy.velocity = None
    policy.network.seen.clear()
    while plant.time < 0.8:
        plant.step(policy.command(plant.measure()))
    assert (np.array(policy.network.seen) == [0.0, 0.0, 0.0, -1.0, -1.0]).all()
    policy.velocity = (0.5, 0.0, 0.0)
    while policy.network.seen[-1][0] == 0.0:
        plant.step(policy.command(plant.measure()))
    assert policy.network.seen[-1][0] < 0.52  # what lacked before the stand is forgotten


def test_what_a_policy_shows_is_not_what_it_commands() -> None:
    n = len(LEGS)
    plant, policy = control(Known(9 + 3 * n, n), described())
    before = policy.command(plant.measure())
    policy.changed[:] = 7.0
    after = policy.command(plant.measure())
    np.testing.assert_allclose(after.joint_torque, before.joint_torque, atol=1e-9)
    np.testing.assert_allclose(after.joint_velocity, 0.0, atol=1e-12)


RUNNING = {"policy": (made := control(Known(9 + 3 * N, N), described())[1]), "guard": PolicyGuard(made)}
PARTS = ("controller", "drives", "description", "network", "ground", "contacts")


@pytest.mark.parametrize(
    ("of", "name"),
    [("policy", name) for name in PARTS]
    + [("guard", name) for name in ("policy", "walking")]
    + [("filter", name) for name in ("arms", "limits", "speed", "margin", "reaction")],
)
def test_parts_of_a_policy_are_not_swapped_in_a_run(of: str, name: str) -> None:
    made = PolicyFilter(["left_elbow_joint"]) if of == "filter" else RUNNING[of]
    with pytest.raises((InputError, AttributeError), match=name):
        setattr(made, name, None)


def test_an_action_that_is_none_fails_the_tick_and_the_robot_is_damped_in_the_end() -> None:
    n = len(LEGS)
    network = Known(9 + 3 * n, n)
    plant, policy = control(network, described())
    last = policy.command(plant.measure())
    network.action[3] = math.nan
    for _ in ticks(0.2):
        command = policy.command(plant.measure())
        assert np.isfinite(command.joint_torque).all()
        plant.step(command)
    assert policy.drives.failures > 0 and policy.drives.stopped and policy.fallen is FallReason.SOLVER
    assert last.kp is not None and command.kp is None  # damping alone


@pytest.mark.parametrize(
    ("reading", "joint"),
    each_once(
        (100.0, -1e30, math.nan),
        ("left_knee_joint", "right_ankle_pitch_joint", "waist_yaw_joint"),
    ),
)
def test_a_refused_encoder_brings_a_joint_no_more_torque_than_before(reading: float, joint: str) -> None:
    """Predicted, then held: with the servos of the machine on the encoder that is wrong, and on a right one."""
    plant, policy = control(Known(3, len(G1.joint_names)), resting(observation=(Term("gravity"),)))
    column, failing = G1.joint_names.index(joint), 0

    def made(command: wbc.Command, measurement: wbc.Measurement) -> float:
        drive = command.drive_torque(measurement.joint_position, measurement.joint_velocity, policy.gains)
        return abs(float(drive[column]))

    while plant.time < 0.4:
        measurement = plant.measure()
        command = policy.command(measurement)
        plant.step(command)
    most = made(command, measurement)
    for _ in ticks(0.12):
        measurement = plant.measure()
        position = measurement.joint_position.copy()
        position[column] = reading
        command = policy.command(replace(measurement, joint_position=position))
        failing += policy.drives.failing
        assert command.kp is not None and command.kp[column] == 0.0
        assert abs(command.joint_torque[column]) <= 1.05 * most + 0.05
        assert made(command, measurement) <= 1.05 * most + 0.05
        plant.step(command)
    assert DT * failing > 0.04 and not policy.drives.stopped and policy.drives.sensing.falls.reason is None


def test_metadata_of_two_projects_and_a_file_beside_are_read(tmp_path: Path) -> None:
    n = len(LEGS)
    numbers = {"kp": [10.0] * n, "kd": [1.0] * n}
    holosoma = {"dof_names": json.dumps(LEGS), **{key: json.dumps(values) for key, values in numbers.items()}}
    holosoma["command_ranges"] = json.dumps(
        {"lin_vel_x": [-1, 0.8], "lin_vel_y": [-0.5, 0.5], "ang_vel_yaw": [-1, 1]}
    )
    file = write_network(tmp_path / "a.onnx", np.zeros((n, 6 + n)), holosoma)
    with pytest.raises(InputError, match=r"default, observation.*a\.toml"):
        PolicyDescription.of(file)
    names = '{name = "dof_pos"}, {name = "projected_gravity"}, {name = "base_ang_vel", scale = 0.25}'
    beside = f"phase = 0.9\nobservation = [{names}]\n"
    (tmp_path / "a.toml").write_text(f"{beside}[default]\nleft_knee_joint = 0.5\n", encoding="utf-8")
    description = PolicyDescription.of(file)
    assert description.joints == LEGS and description.phase == 0.9
    assert (description.fastest, description.slowest) == ((0.8, 0.5, 1.0), (-1.0, -0.5, -1.0))
    assert description.default[LEGS.index("left_knee_joint")] == 0.5 and sum(description.default) == 0.5
    assert [term.name for term in description.observation] == [
        "joint_position",
        "gravity",
        "angular_velocity",
    ]
    PolicyControl(G1.robot(), file, DT)
    for joints in ("3", '"left_knee_joint"', "[1, 2]", "[[1]]"):
        (tmp_path / "a.toml").write_text(f"joints = {joints}\n{beside}[default]\na = 0.5\n", encoding="utf-8")
        with pytest.raises(InputError, match="joints"):
            PolicyDescription.of(file)
    (tmp_path / "a.toml").write_text(
        f"fastest = [0.3, 0.2, 0.1]\ndefault = {[0.0] * n}\n{beside}", encoding="utf-8"
    )
    description = PolicyDescription.of(file)
    assert (description.fastest, description.slowest) == ((0.3, 0.2, 0.1), None)  # of one source

    mjlab = {
        "joint_names": ",".join(LEGS),
        "joint_stiffness": ",".join(["40.5"] * n),
        "joint_damping": ",".join(["2.5"] * n),
        "default_joint_pos": ",".join(["0.1"] * n),
        "action_scale": "0.5",
        "observation_names": "base_lin_vel,base_ang_vel,joint_pos,actions",
    }
    file = write_network(tmp_path / "b.onnx", np.zeros((n, 6 + 2 * n)), mjlab)
    description = PolicyDescription.of(file)
    assert (
        description.kp == (40.5,) * n
        and description.action_scale == 0.5
        and description.default == (0.1,) * n
    )
    PolicyControl(G1.robot(), file, DT)


@pytest.mark.parametrize("key", ["joint_names", "observation_names", "command_names"])
def test_names_in_metadata_are_a_list_or_one_name(key: str) -> None:
    one = {
        "joint_names": LEGS[0],
        "joint_stiffness": "[40.0]",
        "joint_damping": "[2.0]",
        "default_joint_pos": "[0.1]",
        "observation_names": "command",
        "command_names": "motion",
    }
    description = PolicyDescription.of("none.onnx", one | {key: json.dumps(one[key])})
    assert description == PolicyDescription.of("none.onnx", one)
    assert [term.name for term in description.observation] == ["motion_joints"]
    for text in ("1", "null", "[[1]]", '{"motion": 1}', "1, 2"):
        with pytest.raises(InputError, match=f"{key} in the metadata of a policy must be a list of names"):
            PolicyDescription.of("none.onnx", one | {key: text})


RANGES = ("lin_vel_x", "lin_vel_y", "ang_vel_z")


def deploy_file(**changes: Any) -> dict[str, Any]:
    """Return what a deploy.yaml holds, of a policy whose joints are the reversed ones of a machine."""
    action = {"scale": [0.25] * N, "offset": [0.1 * k for k in range(N)], "clip": None, "joint_ids": None}
    return {
        "joint_ids_map": list(reversed(range(N))),
        "step_dt": 0.04,
        "stiffness": [50.0 + k for k in range(N)],
        "damping": [1.0 + k for k in range(N)],
        "default_joint_pos": [0.1 * k for k in range(N)],
        "commands": {
            "base_velocity": {
                "ranges": {"lin_vel_x": [-0.5, 1.5], "lin_vel_y": [0, 0.3], "ang_vel_z": [-0.2, 0.2]}
            }
        },
        "actions": {"JointPositionAction": action | changes.pop("action", {})},
        "observations": {
            "base_ang_vel": {"params": {}, "scale": [0.2] * 3, "clip": None, "history_length": 5},
            "joint_pos_rel": {"params": {}, "scale": None, "clip": [-9.0, 9.0]},
        },
    } | changes


def test_a_deploy_file_gives_each_joint_its_own_gains() -> None:
    description = PolicyDescription.from_deploy(deploy_file(), LEGS)
    assert description.joints == LEGS[::-1] and description.default == tuple(0.1 * k for k in range(N))
    for k, name in enumerate(LEGS):
        own = description.joints.index(name)
        assert (description.kp[own], description.kd[own]) == (50.0 + k, 1.0 + k)
    assert (description.period, description.fastest) == (0.04, (1.5, 0.3, 0.2))
    assert description.slowest == (-0.5, 0.0, -0.2)
    assert description.observation == (
        Term("angular_velocity", (0.2, 0.2, 0.2), 5),
        Term("joint_position", clip=9.0),
    )
    assert description.action_scale == (0.25,) * N
    assert PolicyDescription.from_deploy(deploy_file(commands={}), LEGS).fastest == (1.0, 1.0, 1.0)
    PolicyControl(G1.robot(), Known(15 + N, N), DT, description=description)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"joint_ids_map": [0, 99]}, "joint_ids_map.*from 0 to 11"),
        ({"joint_ids_map": [0, -1]}, "joint_ids_map"),
        ({"joint_ids_map": [0, 1.0]}, "joint_ids_map"),
        ({"joint_ids_map": []}, "joint_ids_map"),
        ({"joint_ids_map": None}, "joint_ids_map"),
        ({"joint_ids_map": [0] * N}, "twice"),
        ({"stiffness": [50.0]}, "stiffness.*up to number 11"),
        ({"stiffness": 50.0}, "stiffness"),
        ({"damping": [-1.0] * N}, "kd"),
        ({"step_dt": 0.0}, "period"),
        ({"default_joint_pos": [0.0] * N}, "offset.*default_joint_pos"),
        ({"commands": None}, "commands"),
        ({"commands": {"base_velocity": {}}}, "commands.base_velocity.ranges"),
        ({"commands": {"base_velocity": {"ranges": {"lin_vel_x": [0, 1]}}}}, "ang_vel_z"),
        *(
            ({"commands": {"base_velocity": {"ranges": dict.fromkeys(RANGES, given)}}}, "least and greatest")
            for given in ([1, -1], [0, math.nan], [-math.inf, 1], [0.5], [0, 1, 2], ["a", "b"], "ab", 3)
        ),
        ({"actions": {}}, "actions.JointPositionAction"),
        ({"actions": {"JointPositionAction": None}}, "actions.JointPositionAction"),
        ({"actions": deploy_file()["actions"] | {"JointVelocityAction": {}}}, "JointVelocityAction"),
        ({"action": {"joint_ids": [0]}}, "joint_ids"),
        ({"action": {"clip": [[-1.0, 1.0]] * N}}, "clip"),
        ({"action": {"scale": [0.25]}}, "action_scale"),
        ({"observations": {}}, "observation"),
        ({"observations": []}, "observations"),
        ({"observations": {"joint_pos": {}}}, "joint_pos_rel"),
        ({"observations": {"gait_phase": {}}}, "gait_phase"),
        ({"observations": {"use_gym_history": True}}, "use_gym_history"),
        ({"observations": {"joint_pos_rel": {"clip": [0.0, 1.0]}}}, "clip of the term joint_pos_rel"),
        ({"observations": {"joint_pos_rel": {"clip": ["a", "b"]}}}, "clip"),
        ({"observations": {"joint_pos_rel": {"history_length": 0}}}, "history"),
        ({"observations": {"joint_pos_rel": {"scale": "all"}}}, "scale"),
    ],
)
def test_deploy_files_that_cannot_be_described_are_refused(changes: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        PolicyDescription.from_deploy(deploy_file(**changes), LEGS)


def test_a_deploy_file_is_a_mapping_with_all_its_keys() -> None:
    for lacks in deploy_file():
        with pytest.raises(InputError, match=lacks):
            PolicyDescription.from_deploy({k: v for k, v in deploy_file().items() if k != lacks}, LEGS)
    with pytest.raises(InputError, match="deploy"):
        PolicyDescription.from_deploy("deploy.yaml", LEGS)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="machine_joints"):
        PolicyDescription.from_deploy(deploy_file(), 3)  # type: ignore[arg-type]


def test_a_network_of_a_file_is_its_function(tmp_path: Path) -> None:
    weights = np.random.default_rng(1).normal(size=(4, 7)).astype(np.float32)
    network = OnnxNetwork(write_network(tmp_path / "w.onnx", weights))
    seen = np.random.default_rng(2).normal(size=7).astype(np.float32)
    np.testing.assert_allclose(network(seen), weights @ seen, rtol=1e-5)
    assert (network.inputs, network.outputs) == (7, 4)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"kp": [1.0]}, "kp"),
        ({"kd": [-1.0] * N}, "kd"),
        ({"default": [math.nan] * N}, "default"),
        ({"observation": []}, "observation"),
        ({"observation": [Term("phase_sine")]}, "phase"),
        ({"period": 0.0}, "period"),
        ({"period": 20.0}, "period"),
        ({"action_scale": 0.0}, "action_scale"),
        ({"action_scale": [0.1]}, "action_scale"),
        ({"phase": -1.0}, "phase"),
        ({"slowest": (0.1, 0.0, 0.0)}, "slowest"),
        ({"slowest": (-1.0, 0.0)}, "slowest"),
    ],
)
def test_descriptions_that_cannot_be_are_refused(values: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        described(**values)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: Term("joint_psition"), UnknownNameError),
        (lambda: described(joints=("left_knee_joint", "left_knee_joint")), InputError),
        (lambda: control(Known(9 + 3 * N, N), described(period=0.003)), InputError),
        (lambda: control(Known(8 + 3 * N, N), described()), InputError),
        (lambda: control(Known(9 + 3 * N, N - 1), described()), InputError),
        (lambda: control(Known(9 + 3, 1), described(joints=("left_gripper",))), UnknownNameError),
        (
            lambda: control(Known(9 + 3 * 2, 2), described(joints=("left_knee", "left_knee_joint"))),
            InputError,
        ),
        (
            lambda: control(Known(3, N), described(observation=[Term("gravity", scale=(1.0, 2.0))])),
            InputError,
        ),
        (lambda: PolicyControl(G1.robot(), Known(3, 3), DT), InputError),
        (lambda: control("nowhere.onnx", described()), InputError),
        (lambda: HeightScan(length=1e6, resolution=1e-3), InputError),
        (
            lambda: control(Known(3, N), described(observation=[Term("gravity", history=10_000_000)])),
            InputError,
        ),
    ],
)
def test_policies_that_do_not_fit_are_refused_before_the_first_tick(make: Any, error: type[WbcError]) -> None:
    with pytest.raises(error):
        make()


def test_files_that_are_no_network_of_a_policy_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("no network", encoding="utf-8")
    (tmp_path / "empty.onnx").write_bytes(b"")
    for name in ("text.onnx", "empty.onnx"):
        with pytest.raises(InputError, match=name):
            OnnxNetwork(tmp_path / name)
    weights = np.zeros((2, 3))
    write_network(tmp_path / "opset.onnx", weights, opset=900)
    with pytest.raises(InputError, match="opset"):
        OnnxNetwork(tmp_path / "opset.onnx")
    write_network(tmp_path / "free.onnx", weights, shape=[1, "n"])
    with pytest.raises(InputError, match="width"):
        OnnxNetwork(tmp_path / "free.onnx")
    write_network(tmp_path / "two.onnx", weights, names=["obs", "memory"])
    with pytest.raises(InputError, match="memory"):
        OnnxNetwork(tmp_path / "two.onnx")
    write_tracker(tmp_path / "motion.onnx", {"joint_pos": np.zeros((2, 3))}, 4)
    with pytest.raises(InputError, match="joint_vel"):
        OnnxNetwork(tmp_path / "motion.onnx")
    write_network(tmp_path / "shape.onnx", weights, shape=[1, 4])  # of which three fit
    with pytest.raises(InputError, match="shape.onnx"):
        OnnxNetwork(tmp_path / "shape.onnx")
    lies = {"dof_names": json.dumps(LEGS), "kp": "[1, 2]", "kd": "hello", "command_ranges": "[]"}
    with pytest.raises(WbcError):
        PolicyDescription.of(write_network(tmp_path / "lies.onnx", weights, lies))
    lies |= {"kp": "[1, 2]", "kd": "[1, 2]", "dof_names": '["a", "b"]'}
    with pytest.raises(InputError, match="command_ranges"):
        PolicyDescription.of(write_network(tmp_path / "lies.onnx", weights, lies))


def test_what_of_a_policy_hardly_fits_is_said_before_the_first_tick() -> None:
    """Gains of a machine that are known, a posture beyond the stops, and a network slower than its period."""

    class Slow(Known):
        took = 0.03

    knee, roll = LEGS.index("left_knee_joint"), LEGS.index("left_hip_roll_joint")
    machine = wbc.load_robot("g1").with_servos(["left_knee_joint=100,2", "left_hip_roll_joint=50,3"])
    default = [float(q) for q in G1.robot().half_sitting[7:]][: len(LEGS)]
    kp, kd = [70.0] * N, [2.0] * N
    kp[knee], kp[roll], kd[roll] = 95.0, 50.0, 6.0
    description = described(kp=kp, kd=kd, default=default)
    policy = PolicyControl(machine.robot(), Known(9 + 3 * N, N), DT, description=description)
    (said,) = policy.doubts()
    assert "left_hip_roll_joint" in said and "damping" in said
    default[knee] = -1.0
    slow = Slow(9 + 3 * N, N)
    policy = PolicyControl(G1.robot(), slow, DT, description=described(kp=kp, kd=kd, default=default))
    posture, time = policy.doubts()
    assert "left_knee_joint" in posture and "30" in time and "20" in time
