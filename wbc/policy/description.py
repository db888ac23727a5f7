"""Description of a policy: joints, default posture, gains, action, and the terms of its observation.

    description = PolicyDescription.of("policy.onnx")    # from its metadata and from policy.toml beside it

Two conventions of metadata are known: that of holosoma (dof_names, kp, kd, command_ranges), and that of mjlab and
whole_body_tracking (joint_names, joint_stiffness, joint_damping, default_joint_pos, action_scale, observation_names).
What a file does not say, or says otherwise, stands in a TOML file of the same name beside it, whose keys are the fields
of `PolicyDescription`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from wbc.base.errors import InputError, choose, shown, shown_path, unknown_name
from wbc.base.files import read_toml
from wbc.base.settings import Count, NonNegative, Number, Period, Positive, from_json, settings
from wbc.policy.references import HeightScan
from wbc.policy.terms import TERMS

HOLOSOMA = {"dof_names": "joints", "kp": "kp", "kd": "kd"}
MJLAB = {
    "joint_names": "joints",
    "joint_stiffness": "kp",
    "joint_damping": "kd",
    "default_joint_pos": "default",
    "action_scale": "action_scale",
    "observation_names": "observation",
    "anchor_body_name": "anchor",
}
"""Keys of the metadata → fields of `PolicyDescription`."""

NAMES = {
    "base_lin_vel": "linear_velocity",
    "base_ang_vel": "angular_velocity",
    "projected_gravity": "gravity",
    "velocity_commands": "command",
    "twist": "command",
    "command_lin_vel": "command_linear",
    "command_ang_vel": "command_turn",
    "joint_pos": "joint_position",
    "joint_pos_rel": "joint_position",
    "dof_pos": "joint_position",
    "joint_vel": "joint_velocity",
    "joint_vel_rel": "joint_velocity",
    "dof_vel": "joint_velocity",
    "actions": "last_action",
    "sin_phase": "phase_sine",
    "cos_phase": "phase_cosine",
    "motion_command": "motion_joints",
    "motion_ref_ori_b": "motion_orientation",
    "motion_anchor_ori_b": "motion_orientation",
    "motion_ref_pos_b": "motion_position",
    "motion_anchor_pos_b": "motion_position",
}
"""Names of terms in other projects → names of `TERMS`."""


@settings
class Term:
    """One term of an observation.

    Attributes:
        name: Name of the term, one of `TERMS` or a name that other projects give it.
        scale: Factor of its values: one for all, or one for each.
        history: Number of values of the last periods, oldest first, of which the term consists.
        clip: Largest magnitude of a value after the factor; None for no bound.
    """

    name: str
    scale: Number | tuple[Number, ...] = 1.0
    history: Count = 1
    clip: Positive | None = None

    def __post_init__(self) -> None:
        name = NAMES.get(self.name, self.name)
        object.__setattr__(self, "name", choose("term of an observation", name, sorted({*TERMS, *NAMES})))


@settings(kw_only=True)
class PolicyDescription:
    """Joints, gains, action and observation of a policy; arrays are in the order of `joints`.

    The target of a joint is default + action_scale × action. The observation is the terms one after another.

    Attributes:
        joints: Names of the joints that the policy moves.
        default: Joint positions of a zero action, rad.
        kp: Stiffness of the servos, Nm/rad.
        kd: Damping of the servos, Nms/rad.
        action_scale: Angle of an action of one, one for all joints or one for each, rad.
        action_clip: Largest magnitude of an action.
        observation: Terms of the observation, in order.
        period: Time between two actions, s.
        phase: Period of the gait's clock, which terms of the phase show, s; None for a policy without one.
        fastest: Largest velocity that the policy is made for: ahead and aside, m/s, and turn, rad/s.
        anchor: Frame of the robot that follows that of a motion, for a policy that tracks one; the torso when None.
        scan: Heights that the policy sees, for one that sees the ground.
    """

    joints: tuple[str, ...] = Field(min_length=1)
    default: tuple[Number, ...]
    kp: tuple[NonNegative, ...]
    kd: tuple[NonNegative, ...]
    observation: tuple[Term, ...] = Field(min_length=1)
    action_scale: Positive | tuple[Positive, ...] = 1.0
    action_clip: Positive = 100.0
    period: Period = 0.02
    phase: Annotated[Positive, "s"] | None = None
    fastest: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 1.0)
    anchor: str | None = None
    scan: HeightScan = field(default_factory=HeightScan)

    def __post_init__(self) -> None:
        if len(set(self.joints)) < len(self.joints):
            twice = next(name for name in self.joints if self.joints.count(name) > 1)
            raise InputError(f"joints of a policy must be different, got '{twice}' twice")
        for name in ("default", "kp", "kd", "action_scale"):
            values = getattr(self, name)
            if isinstance(values, tuple) and len(values) != len(self.joints):
                raise InputError(
                    f"{name} of a policy must have a value for each of its {len(self.joints)} joints, got {len(values)}"
                )
        if self.phase is None and (shows := [t.name for t in self.observation if t.name.startswith("phase")]):
            raise InputError(
                f"a policy that observes '{shows[0]}' needs the period of its clock: phase, in s"
            )

    @classmethod
    def of(cls, file: str | Path, metadata: Mapping[str, str] | None = None) -> PolicyDescription:
        """Return the description of a policy from a TOML file beside its network, over the network's metadata.

        Args:
            file: The network's file; a description in TOML has the same name and the ending .toml.
            metadata: Metadata of the network; read from the file when None.

        Raises:
            InputError: A file that cannot be read; a description with a value that cannot be, or without one that is
                needed.
        """
        if metadata is None:
            from wbc.policy.network import OnnxNetwork  # noqa: PLC0415 - an extra

            metadata = OnnxNetwork(file).metadata
        values = _from_metadata(metadata)
        beside = Path(file).with_suffix(".toml")
        if beside.is_file():
            values |= read_toml(beside)
        needed = ("joints", "default", "kp", "kd", "observation")
        if missing := [name for name in needed if name not in values]:
            raise InputError(
                f"the policy {shown_path(file)} does not say its {', '.join(missing)}: put what its metadata lack into "
                f"{shown_path(beside)}; `wbc.policy.PolicyDescription` says what each key means"
            )
        if isinstance(values["default"], Mapping):
            values["default"] = _by_joint(values["default"], values["joints"])
        return from_json(cls, values)


def _by_joint(default: Mapping[str, Any], joints: Sequence[str]) -> list[Any]:
    """Return a posture that names its joints in the order of all; joints that it does not name are at zero."""
    for name in default:
        if name not in joints:
            unknown_name("joint of the policy", name, joints)
    return [default.get(name, 0.0) for name in joints]


def _from_metadata(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return the fields of a description that the metadata of a network have."""
    keys = HOLOSOMA if "dof_names" in metadata else MJLAB
    values = {field: _value(key, metadata[key]) for key, field in keys.items() if key in metadata}
    if "observation" in values:
        tracks = "motion" in _value("command_names", metadata.get("command_names", "none"))
        given = {"command": "motion_joints"} if tracks else {}
        values["observation"] = [{"name": given.get(name, name)} for name in values["observation"]]
    for name in ("action_scale", "anchor"):
        if isinstance(value := values.get(name), list) and len(value) == 1:
            values[name] = value[0]
    ranges = _value("command_ranges", metadata.get("command_ranges", "null"))
    if ranges is not None:
        try:
            values["fastest"] = [max(ranges[n]) for n in ("lin_vel_x", "lin_vel_y", "ang_vel_yaw")]
        except (KeyError, TypeError, ValueError):
            raise InputError(
                "command_ranges of a policy must have lin_vel_x, lin_vel_y and ang_vel_yaw, each with its least and "
                f"greatest value, got {shown(ranges)}"
            ) from None
    return values


def _value(key: str, text: str) -> Any:
    """Return the value of a key of metadata, JSON or numbers and names between commas."""
    try:
        return json.loads(text)
    except ValueError:
        parts = [part.strip() for part in text.split(",")]
    try:
        return [float(part) for part in parts]
    except ValueError:
        if not all(parts):
            raise InputError(f"{key} in the metadata of a policy must be a list, got {shown(text)}") from None
        return parts
