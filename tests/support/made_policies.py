"""Policies for tests: networks that answer with a given action, their descriptions, and files of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
from wbc.policy import Network, PolicyControl, PolicyDescription, Term

DT = 0.004
G1 = wbc.load_robot("g1")
LEGS = tuple(name for name in G1.joint_names if any(part in name for part in ("hip", "knee", "ankle")))
TERMS = ("angular_velocity", "gravity", "command", "joint_position", "joint_velocity", "last_action")


def ticks(seconds: float) -> range:
    """Return the numbers of the ticks of a time, s."""
    return range(round(seconds / DT))


class Known(Network):
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


def control(
    network: Any, description: PolicyDescription, period: float = DT, **options: Any
) -> tuple[wbc.Plant, PolicyControl]:
    plant = wbc.Plant(G1, control_period=period, noise="none", visuals=False)
    return plant, PolicyControl(G1.robot(), network, period, description=description, **options)


def write_network(
    path: Path, weights: np.ndarray, metadata: dict[str, str] | None = None, **changes: Any
) -> Path:
    """Write the network action = weights · observation."""
    onnx = pytest.importorskip("onnx")
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


def write_tracker(path: Path, outputs: dict[str, np.ndarray], observed: int, **metadata: str) -> Path:
    """Write a network of zero actions that holds a motion: tables of its outputs, one row a frame, the last one stays.

    Its actions are zero times the observation, of a width.
    """
    onnx = pytest.importorskip("onnx")
    helper, kind = onnx.helper, onnx.TensorProto
    joints, last = outputs["joint_pos"].shape[1], len(outputs["joint_pos"]) - 1
    held = [
        onnx.numpy_helper.from_array(np.zeros((observed, joints), np.float32), "weights"),
        onnx.numpy_helper.from_array(np.array(last, np.int64), "last"),
        onnx.numpy_helper.from_array(np.array([0], np.int64), "axis"),
    ]
    nodes = [
        helper.make_node("MatMul", ["obs", "weights"], ["actions"]),
        helper.make_node("Cast", ["time_step"], ["whole"], to=kind.INT64),
        helper.make_node("Min", ["whole", "last"], ["frame"]),
        helper.make_node("Squeeze", ["frame", "axis"], ["row"]),
    ]
    results = [helper.make_tensor_value_info("actions", kind.FLOAT, [1, joints])]
    for name, table in outputs.items():
        held.append(onnx.numpy_helper.from_array(table.astype(np.float32), f"{name} table"))
        nodes.append(helper.make_node("Gather", [f"{name} table", "row"], [name]))
        results.append(helper.make_tensor_value_info(name, kind.FLOAT, [1, *table.shape[1:]]))
    given = [
        helper.make_tensor_value_info("obs", kind.FLOAT, [1, observed]),
        helper.make_tensor_value_info("time_step", kind.FLOAT, [1, 1]),
    ]
    graph = helper.make_graph(nodes, "tracker", given, results, held)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    for key, text in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, text
    path.write_bytes(model.SerializeToString())
    return path


ARMS = tuple(G1.joint_names[15:])
REST = {name: float(q) for name, q in zip(G1.joint_names, G1.robot().half_sitting[7:], strict=True)}


def standing_metadata() -> dict[str, str]:
    """Return the metadata of a policy whose zero action is half-sitting, on the servos of the robot."""
    robot = G1.robot()
    return {
        "joint_names": json.dumps(list(G1.joint_names)),
        "joint_stiffness": json.dumps(robot.servos.kp.tolist()),
        "joint_damping": json.dumps(robot.servos.kd.tolist()),
        "default_joint_pos": json.dumps(robot.half_sitting[7:].tolist()),
        "observation_names": "projected_gravity",
    }


def write_standing(file: Path) -> Path:
    """Write a policy whose joints stay in half-sitting, by the servos of the robot."""
    return write_network(file, np.zeros((len(G1.joint_names), 3)), standing_metadata())


def resting(**values: Any) -> PolicyDescription:
    """Return the description of a policy of all joints of g1; its zero action is half-sitting on the servos."""
    servos = G1.robot().servos
    return PolicyDescription(
        joints=tuple(G1.joint_names),
        default=tuple(REST.values()),
        kp=tuple(servos.kp),
        kd=tuple(servos.kd),
        **values,
    )


def bobbing(**options: Any) -> tuple[wbc.Plant, PolicyControl]:
    """Return a policy that bends the knees by 0.15 rad and stretches them, once in a second, soles level."""

    class Bob(Network):
        inputs, outputs = 2 + len(G1.joint_names), len(G1.joint_names)
        seen: list[np.ndarray] = []

        def __call__(self, observation: np.ndarray) -> np.ndarray:
            self.seen.append(observation.copy())
            action = np.zeros(self.outputs, np.float32)
            for part, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
                for side in ("left", "right"):
                    action[G1.joint_names.index(f"{side}_{part}_joint")] = share * 0.15 * observation[0]
            return action

    description = resting(
        observation=(Term("phase_sine"), Term("joint_position")),
        phase=1.0,
    )
    return control(Bob(), description, **options)
