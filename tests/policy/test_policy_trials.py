"""Policies elsewhere: in trials, logs, pages, environments, and in the examples of machines."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_policies import (
    DT,
    G1,
    REST,
    Known,
    described,
    standing_metadata,
    ticks,
    write_network,
    write_standing,
)
from properties import by_default

import wbc
from wbc.app import Log, Recorder
from wbc.app.view.controls import LiveControls
from wbc.base.errors import InputError, WbcError
from wbc.policy import PolicyControl, PolicyGuard, Term
from wbc.sim import WalkSpec
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.trial import WalkTrial

pytest.importorskip("onnxruntime")


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a policy whose joints stay in half-sitting, by the servos of the robot."""
    return write_standing(tmp_path_factory.mktemp("policy") / "stand.onnx")


def test_a_policy_walks_in_trials_logs_and_environments(standing: Path, tmp_path: Path) -> None:
    """A spec with the policy is one walk: read again and repeated from its log it is the same, bit for bit."""
    spec = WalkSpec(
        robot="g1",
        trained=str(standing),
        noise="none",
        control_period=DT,
        plan=WalkPlan(drive=((0.5, 0.0, 0.0, 0.0),)),
    )
    assert spec.chosen == "torque" and WalkSpec.from_json(spec.to_json()) == spec
    with Recorder(tmp_path / "log.arrow") as recorder:
        result = WalkTrial(spec, visuals=False).run([recorder])
    assert result.outcome == "completed" and result.failures == 0 and result.steps_done == 0
    assert 2.0 <= result.seconds < 2.6 and abs(result.distance) < 0.05 and result.peak_torque_ratio > 0.01
    assert WalkTrial(WalkSpec.from_json(spec.to_json()), visuals=False).run().record() == result.record()
    log, knee = Log.open(tmp_path / "log.arrow"), "left_knee_joint"
    held = G1.robot().half_sitting[7 + G1.joint_names.index(knee)]
    np.testing.assert_allclose(log[f"joint/position_reference/{knee}"], held, atol=1e-6)


@pytest.mark.slow
def test_a_guard_takes_over_in_trials_logs_and_pages(tmp_path: Path) -> None:
    """A policy that asks for all torques once it is to walk is relieved: the robot stands, then the library walks."""
    n = len(G1.joint_names)
    weights = np.zeros((n, 3))
    weights[:, 0] = 1e3 * np.where(np.arange(n) % 2, 1.0, -1.0)  # of the velocity ahead
    meta = standing_metadata() | {"observation_names": "velocity_commands"}
    file = write_network(tmp_path / "mad.onnx", weights, meta)
    spec = WalkSpec(
        robot="g1",
        trained=str(file),
        guarded=True,
        noise="none",
        control_period=DT,
        plan=WalkPlan(drive=((0.3, 0.2, 0.0, 0.0), (1.0, 0.2, 0.0, 0.1), (3.0, 0.0, 0.0, 0.0))),
    )
    assert WalkSpec.from_json(spec.to_json()) == spec
    with Recorder(tmp_path / "log.arrow") as recorder:
        result = WalkTrial(spec, visuals=False).run([recorder])
    assert result.outcome == "completed" and result.steps_done >= 2 and result.distance > 0.2
    assert any("relieved" in note for note in result.notes)
    log = Log.open(tmp_path / "log.arrow")
    assert log.time[-1] == pytest.approx(result.seconds, abs=2 * DT)
    assert WalkTrial(dataclasses.replace(spec, guarded=False), visuals=False).run().outcome == "fell"
    with pytest.raises(InputError, match="trained"):
        WalkSpec(robot="g1", guarded=True)
    plant = wbc.Plant(G1, control_period=DT, visuals=False)
    guard = PolicyGuard(PolicyControl(G1.robot(), file, DT))
    controls = LiveControls(plant, guard)
    controls.apply({"do": "drive", "forward": 0.2, "left": 0.0, "turn": 0.1})
    assert guard.policy.velocity == guard.velocity == (0.2, 0.0, 0.1)
    controls.apply({"do": "stop"})
    assert guard.velocity is None


def test_a_page_steers_and_pushes_a_policy(standing: Path) -> None:
    plant = wbc.Plant(G1, control_period=DT, visuals=False)
    policy = PolicyControl(G1.robot(), standing, DT)
    controls = LiveControls(plant, policy)
    assert {"drive", "stop", "push"} <= set(controls.offered)
    controls.apply({"do": "drive", "forward": 0.2, "left": 0.0, "turn": 0.1})
    assert policy.velocity == (0.2, 0.0, 0.1)
    controls.apply({"do": "stop"})
    assert policy.velocity is None


@pytest.mark.parametrize("guarded", by_default([False, True], True))
def test_an_environment_steers_a_policy(standing: Path, guarded: bool) -> None:
    environment = pytest.importorskip("wbc.sim.environment")
    env = environment.WbcEnv(robot="g1", trained=str(standing), guarded=guarded, noise="none", seconds=0.5)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        observation, _, terminated, _, _ = env.step([0.3, 0.0, 0.1])
    assert env.trial.control.velocity == (0.3, 0.0, 0.1) and not terminated and np.isfinite(observation).all()
    with pytest.raises(InputError, match="trained"):
        environment.WbcEnv("stand", robot="g1", trained=str(standing))


@pytest.mark.parametrize("guarded", by_default([False, True], True))
def test_a_policy_that_sees_the_ground_walks_with_a_camera_alone(guarded: bool, tmp_path: Path) -> None:
    """Its network stands; what it sees of the floor is level, once the camera has seen it."""
    n, points = len(G1.joint_names), 17 * 11
    file = write_network(
        tmp_path / "seeing.onnx",
        np.zeros((n, points)),
        standing_metadata() | {"observation_names": "height_scan"},
    )
    with pytest.raises(InputError, match="eyes"):
        WalkSpec(robot="g1", trained=str(file))
    plan = WalkPlan(drive=((0.1, 0.0, 0.0, 0.0),))
    about: dict[str, Any] = {"eyes": "depth", "noise": "none", "control_period": DT, "plan": plan}
    spec = WalkSpec(robot="g1", trained=str(file), guarded=guarded, **about)
    trial = WalkTrial(spec, visuals=False)
    assert trial.run().outcome == "completed"
    policy = trial.control.policy if guarded else trial.control
    assert not guarded or trial.control.walking.ground is policy.ground
    seen = policy._period.observation
    height = policy.drives.observer.robot.placement("pelvis").translation[2]
    assert policy.ground.version > 0 and len(seen) == points
    np.testing.assert_allclose(seen, height - 0.5, atol=0.01)


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
    plant = wbc.Plant(G1, control_period=DT, noise="none", machine=machine, visuals=False)
    assert controller.run_step({}, None) == {} and controller.control_dt == DT
    for _ in ticks(0.04):
        targets = controller.run_step({"remote.ly": 1.0, "remote.lx": 0.05}, lerobot.message(plant.measure()))
        plant.step(wbc.Command(np.zeros(n)))  # all joints move
    assert len(targets) == 15 and list(targets)[:2] == ["kLeftHipPitch.q", "kLeftHipRoll.q"]
    assert targets["kRightKnee.q"] == pytest.approx(REST["right_knee_joint"] + 0.025)
    np.testing.assert_allclose(controller.kp, description.kp)
    assert controller.control.velocity == (0.5, 0.0, 0.0)
    seen = network.seen[-1].reshape(2, n)
    assert not seen[:, 15:].any() and seen[:, :15].any()


@pytest.mark.parametrize("what", by_default(["stand", "walk", "policy"], "policy"))
def test_controls_for_the_simulator_of_unitree_run_without_force_sensors(
    example: Any, what: str, standing: Path
) -> None:
    simulator = example("unitree_simulator")
    control, period = simulator.control_of(what, str(standing)), 1.0 / simulator.RATE
    machine = wbc.sim.Machine(force_sensors=False, torque_sensors=True)
    plant = wbc.Plant(G1, control_period=period, machine=machine, visuals=False)
    while plant.time < 0.4:
        plant.step(control.command(plant.measure()))
    assert control.fallen is None and plant.truth().com[2] > 0.6


def test_arms_of_a_study_get_other_targets_and_the_policy_sees_them_at_rest(
    standing: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Path(__file__).parents[2] / "benchmarks" / "trials"
    monkeypatch.syspath_prepend(str(folder))
    spec = importlib.util.spec_from_file_location("policy_studies", folder / "policies.py")
    assert spec is not None and spec.loader is not None
    studies = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(studies)
    plant = wbc.Plant(G1, control_period=DT, noise="none", visuals=False)
    policy, rest = studies.WildPolicy(G1.robot(), standing, DT), G1.robot().half_sitting[7:]
    policy.wild = rest + 0.1
    for _ in ticks(0.1):
        command = policy.command(plant.measure())
        plant.step(command)
    assert policy.network_error is None
    np.testing.assert_allclose(command.joint_position - rest, 0.1 * (np.arange(29) >= 15), atol=1e-6)
    assert np.abs(plant.joint_position - rest)[15:].max() > 0.05
    assert not policy.observed.position[15:].any() and not policy.observed.velocity[15:].any()
    assert policy.observed.velocity[:15].any()
