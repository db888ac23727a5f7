"""Public policies of holosoma, from their wheel: they walk, and the QP holds their hands; slow, with a download."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.policy import PolicyControl
from wbc.tasks import RelativeFrameTask

pytest.importorskip("onnxruntime")

WHEEL = "holosoma-inference==0.1.3"
ROOT = Path(__file__).resolve().parents[2]
DT = 0.002


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a public policy of the g1 with the description that the page of policies prints."""
    folder = tmp_path_factory.mktemp("holosoma")
    done = subprocess.run(
        [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "-d", str(folder), WHEEL],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        pytest.skip(f"{WHEEL} cannot be had: {done.stderr.strip().splitlines()[-1:]}")
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        name = "holosoma_inference/models/loco/g1_29dof/fastsac_g1_29dof.onnx"
        (folder / "walk.onnx").write_bytes(content.read(name))
    page = (ROOT / "docs" / "policies.md").read_text(encoding="utf-8")
    toml = re.search(r"```toml\n(.*?)```", page, re.DOTALL)
    assert toml is not None
    (folder / "walk.toml").write_text(toml[1], encoding="utf-8")
    return folder / "walk.onnx"


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
