"""Policies: what a description says, what the network sees, what the drives get, and bad input."""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.app import Log, Recorder
from wbc.app.view.controls import LiveControls
from wbc.base.errors import InputError, UnknownNameError, WbcError
from wbc.core.estimation.falls import FallReason
from wbc.policy import FootContacts, Guard, OnnxNetwork, PolicyControl, PolicyDescription, PolicyFilter, Term
from wbc.policy.terms import Clock
from wbc.sim import WalkSpec
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.trial import WalkTrial
from wbc.tasks import RelativeFrameTask
from wbc.walking import WalkingControl, WalkingControlSettings
from wbc.walking.contact import GaitPhase

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

DT = 0.002
G1 = wbc.load_robot("g1")
LEGS = tuple(name for name in G1.joint_names if any(part in name for part in ("hip", "knee", "ankle")))
TERMS = ("angular_velocity", "gravity", "command", "joint_position", "joint_velocity", "last_action")


class Known:
    """Network that remembers what it saw, and answers with a given action."""

    def __init__(self, inputs: int, outputs: int, action: float | Sequence[float] = 0.0) -> None:
        self.inputs, self.outputs = inputs, outputs
        self.action = np.broadcast_to(np.asarray(action, np.float32), (outputs,)).copy()
        self.seen: list[np.ndarray] = []

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        self.seen.append(observation.copy())
        return self.action


def described(joints: Sequence[str] = LEGS, **values: Any) -> PolicyDescription:
    n = len(joints)
    given: dict[str, Any] = {
        "default": [0.01 * k for k in range(n)],
        "kp": [50.0 + k for k in range(n)],
        "kd": [1.0 + 0.1 * k for k in range(n)],
        "observation": [Term(name) for name in TERMS],
        "action_scale": 0.25,
    }
    return PolicyDescription(joints=tuple(joints), **given | values)


def control(network: Any, description: PolicyDescription, **options: Any) -> tuple[wbc.Plant, PolicyControl]:
    plant = wbc.Plant(G1, control_period=DT, noise="none")
    return plant, PolicyControl(G1.robot(), network, DT, description=description, **options)


def write_network(
    path: Path, weights: np.ndarray, metadata: dict[str, str] | None = None, **changes: Any
) -> Path:
    """Write the network action = weights · observation."""
    outputs, inputs = weights.shape
    helper, kind = onnx.helper, changes.get("kind", onnx.TensorProto.FLOAT)
    given = [
        helper.make_tensor_value_info(name, kind, changes.get("shape", [1, inputs]))
        for name in changes.get("names", ["obs"])
    ]
    result = helper.make_tensor_value_info("action", kind, [1, outputs])
    held = onnx.numpy_helper.from_array(weights.T.astype(np.float32), "weights")
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["obs", "weights"], ["action"])], "policy", given, [result], [held]
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", changes.get("opset", 17))], ir_version=8
    )
    for key, text in (metadata or {}).items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, text
    path.write_bytes(model.SerializeToString())
    return path


def test_the_network_sees_the_estimate_in_the_order_and_units_of_its_description() -> None:
    """Joints are permuted, and the robot turned, tilted and moving: every term by its definition."""
    joints = tuple(np.random.default_rng(0).permutation(LEGS))
    n = len(joints)
    network = Known(9 + 3 * n, n, np.linspace(-0.2, 0.2, n))
    description = described(joints)
    plant, policy = control(network, description)
    policy.velocity = (0.3, -0.1, 0.2)
    robot, names = policy.observer.robot, list(G1.joint_names)
    for _ in range(25):
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
    robot = policy.observer.robot
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
    for _ in range(50):
        m = plant.measure()
        command = policy.command(m)
        asked = command.joint_torque + command.kp * (command.joint_position - m.joint_position)
        asked += command.kd * (command.joint_velocity - m.joint_velocity)
        assert (np.abs(asked) <= policy.observer.robot.torque_limit * (1.0 + 1e-6)).all()
        plant.step(command)


def test_a_policy_acts_once_in_its_period_and_sees_its_history() -> None:
    n = len(LEGS)
    description = described(
        observation=[Term("command", history=3, scale=(1.0, 2.0, 3.0)), Term("last_action", clip=0.05)]
    )
    network = Known(9 + n, n, 0.1)
    plant, policy = control(network, description)
    speeds = [0.1, 0.2, 0.3, 0.4]
    for speed in speeds:
        policy.velocity = (speed, 0.1, 0.0)
        for _ in range(10):
            plant.step(policy.command(plant.measure()))
    assert len(network.seen) == len(speeds)
    np.testing.assert_allclose(network.seen[0][:9], [0.1, 0.2, 0.0] * 3, atol=1e-6)  # filled with the first
    np.testing.assert_allclose(network.seen[3][:9:3], [0.2, 0.3, 0.4], atol=1e-6)  # oldest first
    np.testing.assert_allclose(network.seen[3][9:], 0.05, atol=1e-6)  # clipped
    policy.reset()
    policy.command(plant.measure())
    assert not network.seen[-1][9:].any()


def test_the_clock_of_a_gait_runs_while_the_robot_walks_and_its_feet_are_half_a_period_apart() -> None:
    clock = Clock(0.8, 0.02)
    clock.reset()
    assert (clock.phase == math.pi).all()
    clock.tick(stands=False)
    np.testing.assert_allclose(clock.phase, [0.0, math.pi])
    for k in range(1, 100):
        clock.tick(stands=False)
        turned = 2.0 * math.pi * 0.02 * k / 0.8
        np.testing.assert_allclose(np.cos(clock.phase), [math.cos(turned), -math.cos(turned)], atol=1e-9)
        assert (np.abs(clock.phase) <= math.pi + 1e-12).all()
    clock.tick(stands=True)
    assert (clock.phase == math.pi).all()


def test_velocities_beyond_those_of_the_policy_are_asked_for_at_their_most() -> None:
    n = len(LEGS)
    plant, policy = control(Known(9 + 3 * n, n), described(fastest=(0.5, 0.2, 0.4)))
    policy.velocity = (0.9, -0.9, 0.1)
    assert policy.velocity == (0.9, -0.9, 0.1)
    np.testing.assert_allclose(policy.observed.command, [0.5, -0.2, 0.1])
    policy.velocity = None
    assert policy.velocity is None and not policy.observed.command.any()


def test_an_action_that_is_none_fails_the_tick_and_the_robot_is_damped_in_the_end() -> None:
    n = len(LEGS)
    network = Known(9 + 3 * n, n)
    plant, policy = control(network, described())
    last = policy.command(plant.measure())
    network.action[3] = math.nan
    for _ in range(100):
        command = policy.command(plant.measure())
        assert np.isfinite(command.joint_torque).all()
        plant.step(command)
    assert policy.failures > 0 and policy.stopped and policy.fallen is FallReason.SOLVER
    assert last.kp is not None and command.kp is None  # damping alone


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
    assert description.joints == LEGS and description.fastest == (0.8, 0.5, 1.0) and description.phase == 0.9
    assert description.default[LEGS.index("left_knee_joint")] == 0.5 and sum(description.default) == 0.5
    assert [term.name for term in description.observation] == [
        "joint_position",
        "gravity",
        "angular_velocity",
    ]
    PolicyControl(G1.robot(), file, DT)

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


def test_a_network_of_a_file_is_its_function(tmp_path: Path) -> None:
    weights = np.random.default_rng(1).normal(size=(4, 7)).astype(np.float32)
    network = OnnxNetwork(write_network(tmp_path / "w.onnx", weights))
    seen = np.random.default_rng(2).normal(size=7).astype(np.float32)
    np.testing.assert_allclose(network(seen), weights @ seen, rtol=1e-5)
    assert (network.inputs, network.outputs) == (7, 4)


N = len(LEGS)


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
            lambda: control(Known(3, N), described(observation=[Term("gravity", scale=(1.0, 2.0))])),
            InputError,
        ),
        (lambda: PolicyControl(G1.robot(), Known(3, 3), DT), InputError),
        (lambda: control("nowhere.onnx", described()), InputError),
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
    lies = {"dof_names": json.dumps(LEGS), "kp": "[1, 2]", "kd": "hello", "command_ranges": "[]"}
    with pytest.raises(WbcError):
        PolicyDescription.of(write_network(tmp_path / "lies.onnx", weights, lies))


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a policy whose joints stay in half-sitting, by the servos of the robot."""
    robot = G1.robot()
    file = tmp_path_factory.mktemp("policy") / "stand.onnx"
    n = len(G1.joint_names)
    meta = {
        "joint_names": json.dumps(list(G1.joint_names)),
        "joint_stiffness": json.dumps(robot.servos.kp.tolist()),
        "joint_damping": json.dumps(robot.servos.kd.tolist()),
        "default_joint_pos": json.dumps(robot.half_sitting[7:].tolist()),
        "observation_names": "projected_gravity",
    }
    return write_network(file, np.zeros((n, 3)), meta)


def test_a_policy_walks_in_trials_logs_and_environments(standing: Path, tmp_path: Path) -> None:
    """A spec with the policy is one walk: read again and repeated from its log it is the same, bit for bit."""
    spec = WalkSpec(
        robot="g1", trained=str(standing), noise="none", plan=WalkPlan(drive=((0.5, 0.0, 0.0, 0.0),))
    )
    assert spec.chosen == "torque" and WalkSpec.from_json(spec.to_json()) == spec
    with Recorder(tmp_path / "log.arrow") as recorder:
        result = WalkTrial(spec).run([recorder])
    assert result.outcome == "completed" and result.failures == 0 and result.steps_done == 0
    assert 2.0 <= result.seconds < 2.6 and abs(result.distance) < 0.05 and result.peak_torque_ratio > 0.01
    assert WalkTrial(WalkSpec.from_json(spec.to_json())).run().record() == result.record()
    log, knee = Log.open(tmp_path / "log.arrow"), "left_knee_joint"
    held = G1.robot().half_sitting[7 + G1.joint_names.index(knee)]
    np.testing.assert_allclose(log[f"joint/position_reference/{knee}"], held, atol=1e-6)


def test_a_page_steers_and_pushes_a_policy(standing: Path) -> None:
    plant = wbc.Plant(G1, control_period=DT)
    policy = PolicyControl(G1.robot(), standing, DT)
    controls = LiveControls(plant, policy)
    assert {"drive", "stop", "push"} <= set(controls.offered)
    controls.apply({"do": "drive", "forward": 0.2, "left": 0.0, "turn": 0.1})
    assert policy.velocity == (0.2, 0.0, 0.1)
    controls.apply({"do": "stop"})
    assert policy.velocity is None


def test_an_environment_steers_a_policy(standing: Path) -> None:
    environment = pytest.importorskip("wbc.sim.environment")
    env = environment.WbcEnv(robot="g1", trained=str(standing), noise="none", seconds=0.5)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        observation, _, terminated, _, _ = env.step([0.3, 0.0, 0.1])
    assert env.trial.walking.velocity == (0.3, 0.0, 0.1) and not terminated and np.isfinite(observation).all()
    with pytest.raises(InputError, match="trained"):
        environment.WbcEnv("stand", robot="g1", trained=str(standing))


def test_steps_of_a_policy_are_counted_by_the_loads_of_its_feet() -> None:
    contacts = FootContacts(G1.robot(), DT)
    weight = G1.robot().mass * 9.81
    assert contacts.progress.phase is GaitPhase.STANDING
    for _ in range(3):  # left, right, left swing for 0.4 s each; the right one bounces in between
        for loads, ticks in (((0.0, weight), 200), ((0.5 * weight, 0.5 * weight), 25)):
            for _ in range(ticks):
                contacts.update(loads)
    assert contacts.steps_done == 3 and contacts.progress.phase is GaitPhase.DOUBLE
    for _ in range(20):  # thrown off the ground for 0.04 s
        contacts.update((weight, 0.0))
    assert contacts.progress.swing == 1 and contacts.air == pytest.approx([0.0, 0.04])
    contacts.update((0.5 * weight, 0.5 * weight))
    assert contacts.steps_done == 3 and contacts.landed[1] == pytest.approx(DT)


@pytest.mark.parametrize(
    "fields",
    [
        {"mode": "position"},
        {"eyes": "depth"},
        {"plan": WalkPlan(turn=0.5)},
        {"gait": {"step_length": 0.1}},
        {"robot": "hrp4_class"},
        {"trained": "nowhere.onnx"},
    ],
)
def test_walks_that_no_policy_does_are_refused(standing: Path, fields: dict[str, Any]) -> None:
    with pytest.raises(WbcError):
        WalkSpec(**({"robot": "g1", "trained": str(standing)} | fields))


def test_another_policy_of_the_same_name_is_another_walk(standing: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.onnx"
    file.write_bytes(standing.read_bytes())
    before = WalkSpec(robot="g1", trained=str(file)).to_json()
    file.with_suffix(".toml").write_text("action_scale = 0.5\n", encoding="utf-8")
    assert WalkSpec(robot="g1", trained=str(file)).to_json() != before
    with pytest.raises(InputError, match="changed"):
        WalkSpec.from_json(before)


ARMS = tuple(G1.joint_names[15:])
REST = {name: float(q) for name, q in zip(G1.joint_names, G1.robot().half_sitting[7:], strict=True)}


def bobbing(**options: Any) -> tuple[wbc.Plant, PolicyControl]:
    """Return a policy that bends the knees by 0.15 rad and stretches them, once in a second, soles level."""

    class Bob:
        inputs, outputs = 2 + len(G1.joint_names), len(G1.joint_names)
        seen: list[np.ndarray] = []

        def __call__(self, observation: np.ndarray) -> np.ndarray:
            self.seen.append(observation.copy())
            action = np.zeros(self.outputs, np.float32)
            for part, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
                for side in ("left", "right"):
                    action[G1.joint_names.index(f"{side}_{part}_joint")] = share * 0.15 * observation[0]
            return action

    servos = G1.robot().servos
    description = PolicyDescription(
        joints=tuple(G1.joint_names),
        default=tuple(REST.values()),
        kp=tuple(servos.kp),
        kd=tuple(servos.kd),
        observation=(Term("phase_sine"), Term("joint_position")),
        phase=1.0,
    )
    return control(Bob(), description, **options)


def hands_error(plant: wbc.Plant, policy: PolicyControl, carried: bool = True) -> float:
    """Greatest distance of the left hand from its place before the pelvis, m, after 1.5 s of 3 s."""
    task = policy.controller.add(
        RelativeFrameTask("left_rubber_hand", "pelvis", axes=("x", "y", "z"), weight=10.0, stiffness=400.0)
    )
    task.target = pin.SE3(task.target.rotation, np.array([0.3, 0.15, 0.2]))
    if not carried:
        policy._arms._carried.measured = lambda measurement: None  # type: ignore[method-assign]
    policy.velocity = (0.1, 0.0, 0.0)
    truth, worst = G1.robot(), 0.0
    while plant.time < 3.0:
        plant.step(policy.command(plant.measure()))
        state = plant.truth()
        truth.update(np.array(state.q), np.array(state.v))
        place = truth.placement("pelvis").actInv(truth.placement("left_rubber_hand")).translation
        if plant.time > 1.5:
            worst = max(worst, float(np.linalg.norm(place - task.target.translation)))
    assert policy.status() == "ok"
    return worst


def test_hands_of_the_qp_stay_while_the_policy_moves_the_pelvis() -> None:
    """The pelvis moves up and down by its IMU's acceleration: without it the hands lag."""
    error, blind = hands_error(*bobbing(arms=ARMS)), hands_error(*bobbing(arms=ARMS), carried=False)
    assert error < 1e-3 and blind > 3.0 * error


@pytest.mark.parametrize("sees", [False, True])
def test_a_policy_sees_the_arms_of_the_qp_at_rest_or_as_they_are(sees: bool) -> None:
    plant, policy = bobbing(arms=ARMS, sees_arms=sees)
    policy.posture.target = {"left_elbow_joint": REST["left_elbow_joint"] + 0.3}
    elbow = G1.joint_names.index("left_elbow_joint")
    for _ in range(500):
        plant.step(policy.command(plant.measure()))
    seen = policy.network.seen[-1][2 + elbow]
    assert policy.observer.robot.q[7 + elbow] - REST["left_elbow_joint"] == pytest.approx(0.3, abs=0.03)
    assert seen == pytest.approx(0.3, abs=0.03) if sees else seen == 0.0


def test_arms_without_a_solution_are_damped_and_the_policy_goes_on() -> None:
    plant, policy = bobbing(arms=ARMS)
    for place in (0.0, 1.0):
        policy.controller.add(
            wbc.tasks.PositionTask(
                "left_rubber_hand", hard=True, target=np.full(3, place), name=f"at {place}"
            )
        )
    knee, elbow = (G1.joint_names.index(f"left_{part}_joint") for part in ("knee", "elbow"))
    for _ in range(200):
        measurement = plant.measure()
        command = policy.command(measurement)
        assert command.kp[knee] > 0.0 and command.kp[elbow] == 0.0
        assert command.joint_torque[elbow] * measurement.joint_velocity[elbow] <= 0.0
        plant.step(command)
    assert policy.arm_failure and "arms damped" in policy.status() and policy.fallen is None


def test_a_policy_that_is_too_slow_is_asked_for_more() -> None:
    """The velocity that is asked for as well is the integral of what lacks, at most 0.5 m/s."""
    plant, policy = bobbing(regain=0.5)
    policy.velocity = (0.2, 0.0, 0.0)
    for _ in range(1000):
        plant.step(policy.command(plant.measure()))
    assert policy.observed.command[0] == pytest.approx(
        0.2 + 2.0 * 0.5 * 0.2, abs=0.03
    )  # it does not walk at all


@pytest.mark.parametrize("arms", [("left_knee_joint",), ("left_gripper",), (*ARMS, ARMS[0])])
def test_arms_that_the_qp_cannot_have_are_refused(arms: tuple[str, ...]) -> None:
    with pytest.raises(WbcError):
        bobbing(arms=arms)
    with pytest.raises(InputError, match="shared"):
        bobbing(arms=ARMS)[1].release(["left_elbow_joint"])


def filtered(
    wish: dict[str, float], limits: Sequence[Any] = (), **options: Any
) -> tuple[wbc.Plant, PolicyControl]:
    """Return a policy whose joints stay in half-sitting but for those of a wish, rad, with a filter of its arms."""
    n = len(G1.joint_names)
    servos = G1.robot().servos
    description = PolicyDescription(
        joints=tuple(G1.joint_names),
        default=tuple(REST.values()),
        kp=tuple(servos.kp),
        kd=tuple(servos.kd),
        observation=(Term("gravity"),),
    )
    action = [wish.get(name, REST[name]) - REST[name] for name in G1.joint_names]
    return control(Known(3, n, action), description, filter=PolicyFilter(ARMS, limits, **options))


def test_a_filter_changes_nothing_that_no_limit_asks_for() -> None:
    plant, policy = filtered({"left_elbow_joint": REST["left_elbow_joint"] + 0.2})
    asked = []
    for k in range(400):
        m = plant.measure()
        command = policy.command(m)
        if k > 50:
            asked.append(np.abs(policy.changed).max())
        made = command.joint_torque + command.kp * (command.joint_position - m.joint_position)
        made += command.kd * (command.joint_velocity - m.joint_velocity)
        wish = policy._kp * (policy._target - m.joint_position) - policy._kd * m.joint_velocity
        np.testing.assert_allclose(made, wish + policy.changed, atol=1e-9)
        plant.step(command)
    assert max(asked) < 0.01


def test_arms_that_a_policy_sends_through_the_trunk_stop_before_it() -> None:
    wish = {"left_shoulder_roll_joint": -1.0, "left_elbow_joint": 1.2, "left_shoulder_yaw_joint": -1.2}
    pairs = [
        ("left_rubber_hand", "torso_link"),
        ("left_rubber_hand", "pelvis"),
        ("left_wrist_roll_link", "torso_link"),
    ]

    def nearest(limit: bool) -> float:
        shapes = G1.collision_shapes()
        limits = [wbc.CollisionLimit(pairs, shapes=shapes, recovery=100.0, influence=0.5)] if limit else []
        plant, policy = filtered(wish, limits)
        gauge = wbc.Controller(G1.robot(), DT)
        near = gauge.add(wbc.CollisionLimit(pairs, shapes=shapes))
        least = math.inf
        while plant.time < 1.5:
            plant.step(policy.command(plant.measure()))
            state = plant.truth()
            gauge.update(np.array(state.q), np.array(state.v))
            gauge.solve()
            least = min(least, *near.distances.values())
        assert policy.status() in ("ok", "relaxed: limits, hard tasks and contacts cannot all be satisfied")
        return least

    assert nearest(limit=False) < 0.0
    assert nearest(limit=True) > 0.01


def test_stops_hold_in_a_filter_whatever_a_policy_asks_for() -> None:
    wish = {
        "left_elbow_joint": -9.0,
        "right_shoulder_roll_joint": -9.0,
        "right_wrist_roll_joint": 9.0,
        "waist_yaw_joint": 9.0,
    }
    plant, policy = filtered(wish)
    robot, over = G1.robot(), np.zeros(len(G1.joint_names))
    while plant.time < 1.0:
        plant.step(policy.command(plant.measure()))
        q = np.array(plant.truth().q[7:])
        over = np.maximum(over, np.maximum(robot.position_lower - q, q - robot.position_upper))
    assert over.max() < 2e-3


def test_arms_are_of_the_qp_or_filtered() -> None:
    with pytest.raises(InputError, match="filter"):
        bobbing(arms=ARMS, filter=PolicyFilter(ARMS))
    with pytest.raises(InputError, match="legs"):
        bobbing(filter=PolicyFilter(["left_knee_joint"]))


def guarded(**options: Any) -> tuple[wbc.Plant, Guard, Known]:
    """Return a guard of a policy that stands."""
    n = len(G1.joint_names)
    servos = G1.robot().servos
    network = Known(3, n)
    description = PolicyDescription(
        joints=tuple(G1.joint_names),
        default=tuple(REST.values()),
        kp=tuple(0.3 * servos.kp),
        kd=tuple(0.3 * servos.kd),
        observation=(Term("gravity"),),
    )
    plant, policy = control(network, description)
    return plant, Guard(policy, **options), network


def run_guard(plant: wbc.Plant, guard: Guard, seconds: float) -> None:
    end = plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(guard.command(plant.measure()))


def break_by_nan(network: Known) -> None:
    network.action[:] = math.nan


def break_by_error(network: Known) -> None:
    network.action = np.zeros(1, np.float32)[:0].reshape(0, 3)  # of no shape that can be taken


def break_by_torques(network: Known) -> None:
    network.action[:] = 20.0 * np.where(np.arange(network.outputs) % 2, 1.0, -1.0)


BREAKS = [(break_by_nan, "nan"), (break_by_error, ""), (break_by_torques, "torque")]


@pytest.mark.parametrize(("breaks", "named"), BREAKS)
def test_a_policy_that_fails_is_relieved_and_the_robot_stands(breaks: Any, named: str) -> None:
    plant, guard, network = guarded()
    run_guard(plant, guard, 0.3)
    assert not guard.relieved and guard.status() == "ok"
    breaks(network)
    run_guard(plant, guard, 0.02)
    assert guard.relieved and named in guard.relieved and guard.control is guard.walking.control
    run_guard(plant, guard, 2.0)
    assert guard.fallen is None and np.linalg.norm(plant.truth().com_velocity) < 0.05
    with_walk = guard.progress.steps_done
    guard.velocity = (0.2, 0.0, 0.0)
    run_guard(plant, guard, 2.0)
    assert (
        guard.progress.steps_done > with_walk and guard.fallen is None
    )  # the library walks on where it is told to
    with pytest.raises(InputError, match="stand"):
        guard.hand_back()


def test_a_policy_that_takes_too_long_is_relieved() -> None:
    plant, guard, network = guarded(longest=1e-9)
    run_guard(plant, guard, 0.004)
    assert "longer" in guard.relieved


def test_the_estimate_goes_on_over_a_change_and_a_policy_takes_the_robot_back(tmp_path: Path) -> None:
    plant, guard, network = guarded()
    run_guard(plant, guard, 0.5)
    before = np.array(guard.policy.observer.robot.q)
    guard.take_over()
    with Recorder(tmp_path / "guard.arrow") as recorder:
        for _ in range(10):
            m = plant.measure()
            command = guard.command(m)
            recorder(plant, guard, m, command)
            plant.step(command)
    assert len(Log.open(tmp_path / "guard.arrow").time) == 10
    assert guard.relieved == "asked for"
    assert np.abs(guard.walking.control.observer.robot.q - before).max() < 5e-3
    run_guard(plant, guard, 1.0)
    guard.hand_back()
    seen = len(network.seen)
    run_guard(plant, guard, 0.2)
    assert not guard.relieved and len(network.seen) - seen == 10 and guard.fallen is None


@pytest.mark.parametrize(
    ("period", "own", "options"),
    [
        (DT, False, {}),
        (0.001, True, {}),
        (DT, True, {"step_kind": "planned"}),
        (DT, False, {"mode": "position"}),
    ],
)
def test_walks_that_cannot_take_over_are_refused(period: float, own: bool, options: dict[str, Any]) -> None:
    _, policy = bobbing()
    observer = policy.observer if own else None
    settings = WalkingControlSettings(**{"mode": "torque", **options})
    walking = WalkingControl(policy.controller.robot, None, period, settings, observer=observer)
    with pytest.raises(InputError):
        Guard(policy, walking)
    with pytest.raises(InputError):
        Guard(policy, longest=0.0)


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import an example of a machine by its name."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples" / "machine"))
    return importlib.import_module


def test_a_controller_of_lerobot_targets_motors_by_name_and_hides_the_arms(example: Any) -> None:
    lerobot = example("lerobot_g1")
    n = len(G1.joint_names)
    network = Known(2 * n, n, 0.1)
    names = ("joint_position", "joint_velocity")
    description = described(
        G1.joint_names, default=list(REST.values()), observation=[Term(name) for name in names]
    )
    controller = lerobot.PolicyController(network, control_dt=DT, description=description)
    machine = wbc.sim.Machine(force_sensors=False, torque_sensors=True)
    plant = wbc.Plant(G1, control_period=DT, noise="none", machine=machine)
    assert controller.run_step({}, None) == {} and controller.control_dt == DT
    for _ in range(20):
        targets = controller.run_step({"remote.ly": 1.0, "remote.lx": 0.05}, lerobot.message(plant.measure()))
        plant.step(wbc.Command(np.zeros(n)))  # all joints move
    assert len(targets) == 15 and list(targets)[:2] == ["kLeftHipPitch.q", "kLeftHipRoll.q"]
    assert targets["kRightKnee.q"] == pytest.approx(REST["right_knee_joint"] + 0.025)
    np.testing.assert_allclose(controller.kp, description.kp)
    assert controller.control.velocity == (0.5, 0.0, 0.0)
    seen = network.seen[-1].reshape(2, n)
    assert not seen[:, 15:].any() and seen[:, :15].any()


@pytest.mark.parametrize("what", ["stand", "walk", "policy"])
def test_controls_for_the_simulator_of_unitree_run_without_force_sensors(
    example: Any, what: str, standing: Path
) -> None:
    simulator = example("unitree_simulator")
    control, period = simulator.control_of(what, str(standing)), 1.0 / simulator.RATE
    machine = wbc.sim.Machine(force_sensors=False, torque_sensors=True)
    plant = wbc.Plant(G1, control_period=period, machine=machine)
    while plant.time < 0.4:
        plant.step(control.command(plant.measure()))
    assert control.fallen is None and plant.truth().com[2] > 0.6
