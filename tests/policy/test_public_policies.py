"""Public policies of holosoma, from their wheel: they walk, and the QP holds their hands; slow, with a download."""

from __future__ import annotations

import importlib
import json
import shutil
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hanging import HangingMachine

import wbc
from wbc.machine import RunSettings
from wbc.machine.report import Phase
from wbc.machine.run import Runner
from wbc.policy import PolicyControl, PolicyDescription, PolicyGuard
from wbc.tasks import RelativeFrameTask

pytest.importorskip("onnxruntime")

WHEEL = "holosoma-inference==0.1.3"
ROOT = Path(__file__).resolve().parents[2]
DESCRIPTIONS = ROOT / "examples" / "policies"
DT = 0.002


T1 = "https://raw.githubusercontent.com/amazon-far/holosoma/main/src/holosoma/holosoma/data/robots/t1/t1_29dof.xml"
"""Model of the Booster T1 for which its policies were trained."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the wheel of the public policies."""
    folder = tmp_path_factory.mktemp("holosoma")
    done = subprocess.run(
        [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "-d", str(folder), WHEEL],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        pytest.skip(f"{WHEEL} cannot be had: {done.stderr.strip().splitlines()[-1:]}")
    return folder


def unpacked(folder: Path, name: str, description: str) -> Path:
    """Return a policy of the wheel with one of the descriptions of the examples beside it."""
    (wheel,) = folder.glob("*.whl")
    file = folder / Path(name).name
    with zipfile.ZipFile(wheel) as content:
        file.write_bytes(content.read(f"holosoma_inference/models/{name}"))
    shutil.copy(DESCRIPTIONS / f"{description}.toml", file.with_suffix(".toml"))
    return file


def test_descriptions_of_the_g1_fit_it() -> None:
    """They name its joints and known terms; joints and gains are those of the metadata."""
    names = wbc.load_robot("g1").joint_names
    gains = json.dumps([1.0] * len(names))
    metadata = {"dof_names": json.dumps(names), "kp": gains, "kd": gains}
    for file in DESCRIPTIONS.glob("g1_*.toml"):
        description = PolicyDescription.of(file.with_suffix(".onnx"), metadata)
        assert description.joints == names and description.default[names.index("left_knee_joint")] == 0.669


@pytest.fixture(scope="module")
def walk(wheel: Path) -> Path:
    """Return a public policy of the g1."""
    return unpacked(wheel, "loco/g1_29dof/fastsac_g1_29dof.onnx", "g1_walk")


@pytest.mark.slow
def test_a_public_policy_of_the_t1_walks_and_is_taken_over(wheel: Path) -> None:
    try:
        with urllib.request.urlopen(T1, timeout=20.0) as answer:  # a fixed address
            (wheel / "t1.xml").write_bytes(answer.read())
    except OSError as error:
        pytest.skip(f"the model of the T1 cannot be had: {error}")
    description = wbc.RobotDescription.from_mjcf(wheel / "t1.xml", meshes=False)
    file = unpacked(wheel, "loco/t1_29dof/fastsac_t1_29dof.onnx", "t1_walk")
    plant = wbc.Plant(description, control_period=DT, noise="realistic")
    guard = PolicyGuard(PolicyControl(description.robot(), file, DT))
    while plant.time < 7.0:
        if plant.time < 4.0:
            guard.velocity = (0.5, 0.0, 0.0) if plant.time > 1.0 else None
        elif not guard.relieved:
            walked = plant.truth().com[0]
            guard.take_over()
        plant.step(guard.command(plant.measure()))
    assert walked > 0.8 and guard.fallen is None
    assert np.linalg.norm(plant.truth().com_velocity) < 0.05 and plant.truth().com[2] > 0.45


@pytest.mark.slow
def test_a_public_policy_dances(wheel: Path) -> None:
    """It tracks the motion in its network, from the first frame on."""
    file = unpacked(wheel, "wbt/ppo_g1_29dof_dancing.onnx", "g1_dance")
    plant = wbc.Plant("g1", control_period=DT, noise="realistic")
    policy = PolicyControl(plant.description.robot(), file, DT)
    errors = []
    while plant.time < 12.0:
        plant.step(policy.command(plant.measure()))
        if plant.time > 1.0:
            q = np.array(plant.truth().q[7:])
            errors.append(np.abs(q - policy.motion.frame.position).mean())
    assert policy.fallen is None and policy.motion.step == 600 and np.mean(errors) < 0.15


@pytest.mark.slow
def test_a_public_policy_walks_and_holds_its_hands_by_the_qp(walk: Path) -> None:
    description = wbc.load_robot("g1")
    plant, robot, truth = wbc.Plant(description, control_period=DT), description.robot(), description.robot()
    policy = PolicyControl(robot, walk, DT, arms=robot.joint_names[15:])
    hand, worst = "left_rubber_hand", 0.0
    task = RelativeFrameTask(hand, "pelvis", axes=("x", "y", "z"), weight=10.0, stiffness=400.0)
    policy.controller.add(task)
    task.target = pin.SE3(task.target.rotation, np.array([0.3, 0.13, 0.2]))
    policy.velocity = (0.3, 0.0, 0.0)
    start = plant.truth().com[0]
    while plant.time < 6.0:
        plant.step(policy.command(plant.measure()))
        state = plant.truth()
        truth.update(np.array(state.q), np.array(state.v))
        place = truth.placement("pelvis").actInv(truth.placement(hand)).translation
        if plant.time > 2.0:
            worst = max(worst, float(np.linalg.norm(place - task.target.translation)))
    assert policy.fallen is None and policy.status() == "ok"
    assert 1.2 < plant.truth().com[0] - start < 2.2 and policy.steps_done >= 8
    assert worst < 0.008


@pytest.mark.slow
@pytest.mark.parametrize("guarded", [False, True])
def test_a_public_policy_walks_on_a_machine_without_force_sensors(walk: Path, guarded: bool) -> None:
    """The machine hangs at a band and is let down; `wbc.run` hands it to the policy once it stands."""
    machine = HangingMachine()
    control: PolicyControl | PolicyGuard = PolicyControl(machine.description.robot(), walk, 0.004)
    if guarded:
        control = PolicyGuard(control)
    settings = RunSettings(robot_timeout=0.05, control_timeout=0.05, stop=0.7)
    runner = Runner(machine, control, 250.0, settings=settings, guard=False, clock=machine.clock)
    free: float | None = None
    height = 0.0  # at the end of the run, after which the machine is damped

    def until() -> bool:
        nonlocal free, height
        height = machine.height
        if free is None:
            machine.speed = 0.5 if machine.time > 1.0 and (machine.length or 0.0) < 3.0 else 0.0
            if runner.phase is Phase.RUN and machine.pull < 1.0:
                machine.length, free = None, machine.time
        elif machine.time > free + 1.0:
            control.velocity = (0.3, 0.0, 0.0)
        return height < 0.4 or machine.time > (20.0 if free is None else free + 5.0)

    runner.run(until)
    assert free is not None and height > 0.5 and control.status() == "ok"
    assert control.progress.steps_done >= 5


@pytest.mark.slow
def test_a_public_policy_walks_by_the_protocol_of_lerobot(
    walk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "machine"))
    result = importlib.import_module("lerobot_g1").main([str(walk), "--seconds", "5"])
    assert result["forward"] > 1.0 and result["height"] > 0.6
