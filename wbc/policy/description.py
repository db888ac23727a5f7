"""Description of a policy: joints, default posture, gains, action, and the terms of its observation.

    description = PolicyDescription.of("policy.onnx")    # from its metadata and from policy.toml beside it
    description = PolicyDescription.from_deploy(yaml.safe_load(text), robot.joint_names)    # from a deploy.yaml

Two conventions of metadata are known: that of holosoma (dof_names, kp, kd, command_ranges), and that of mjlab and
whole_body_tracking (joint_names, joint_stiffness, joint_damping, default_joint_pos, action_scale, observation_names).
What a file does not say, or says otherwise, stands in a TOML file of the same name beside it, whose keys are the fields
of `PolicyDescription`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, shown, shown_path, unknown_name
from wbc.base.files import read_toml
from wbc.base.settings import Count, NonNegative, Number, Period, Positive, from_json, settings
from wbc.policy.network import OnnxNetwork
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

NonPositive = Annotated[float, Field(le=0.0)]
"""A number of at most zero."""


@settings
class Term:
    """One term of an observation.

    Attributes:
        name: Name of the term, one of `TERMS` or a name that other projects give it.
        scale: Factor of its values: one for all, or one for each.
        history: Number of values of the last periods, oldest first, of which the term consists.
        clip: Largest magnitude of a value before the factor; None for no bound.
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
        action_clip: Largest magnitude of an action, before its scale.
        observation: Terms of the observation, in order.
        period: Time between two actions, s.
        phase: Period of the gait's clock, which terms of the phase show, s; None for a policy without one.
        fastest: Largest velocity that the policy is made for: ahead and aside, m/s, and turn, rad/s.
        slowest: Least velocity that the policy is made for, likewise: backwards, to the right and a right turn, all
            at most zero; −`fastest` when None.
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
    slowest: tuple[NonPositive, NonPositive, NonPositive] | None = None
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
        values = _from_metadata(OnnxNetwork(file).metadata if metadata is None else metadata)
        beside = Path(file).with_suffix(".toml")
        if beside.is_file():
            given = read_toml(beside)
            if "fastest" in given:  # one range is of one source
                values.pop("slowest", None)
            values |= given
        needed = ("joints", "default", "kp", "kd", "observation")
        if missing := [name for name in needed if name not in values]:
            raise InputError(
                f"the policy {shown_path(file)} does not say its {', '.join(missing)}: put what its metadata lack into "
                f"{shown_path(beside)}; `wbc.policy.PolicyDescription` says what each key means"
            )
        names, default = values["joints"], values["default"]
        if isinstance(default, Mapping) and isinstance(names, list) and {*map(type, names)} == {str}:
            values["default"] = _by_joint(default, names)
        return from_json(cls, values)

    @classmethod
    @checked
    def from_deploy(cls, deploy: Mapping[str, Any], machine_joints: Sequence[str]) -> PolicyDescription:
        """Return the description in a `deploy.yaml`, which unitree_rl_lab writes beside the network of a policy.

            deploy = yaml.safe_load(Path("deploy.yaml").read_text())
            description = PolicyDescription.from_deploy(deploy, robot.joint_names)

        Args:
            deploy: Values of the file, as PyYAML's `safe_load` reads them.
            machine_joints: Names of the joints in the order of the machine's motors, to which `joint_ids_map` refers.

        Raises:
            InputError: A key that lacks, or a value that cannot be; an action or an observation that a description
                cannot express, with the reason.

        Source: `export_deploy_cfg.py` and `manager_term_cfg.h` of unitree_rl_lab.
        """
        motors, columns = range(len(machine_joints)), _in_deploy(deploy, "joint_ids_map", kind=list)
        if not columns or not all(type(column) is int and column in motors for column in columns):
            raise InputError(
                f"joint_ids_map of a deploy.yaml must have numbers of the machine's {len(motors)} joints, from 0 to "
                f"{len(motors) - 1}, got {shown(columns)}"
            )
        default = _in_deploy(deploy, "default_joint_pos")
        action = _in_deploy(deploy, "actions", "JointPositionAction", kind=Mapping)
        if len(deploy["actions"]) > 1:
            raise InputError(
                f"actions of a deploy.yaml must be JointPositionAction alone, got {shown([*deploy['actions']])}"
            )
        for key, wanted, why in (
            ("joint_ids", None, "the joints of a description are observed and moved"),
            ("clip", None, "a description bounds actions, and no targets"),
            ("offset", default, "the target of a zero action is the default posture"),
        ):
            if (given := action.get(key, wanted)) != wanted:
                raise InputError(
                    f"{key} of the JointPositionAction of a deploy.yaml must be "
                    f"{'null' if wanted is None else 'default_joint_pos'}, got {shown(given)}: {why}"
                )
        values = {
            "joints": [machine_joints[column] for column in columns],
            "default": default,
            "kp": _of_columns(deploy, "stiffness", columns),
            "kd": _of_columns(deploy, "damping", columns),
            "action_scale": _in_deploy(deploy, "actions", "JointPositionAction", "scale"),
            "period": _in_deploy(deploy, "step_dt"),
            "observation": [
                _term_of_deploy(*term) for term in _in_deploy(deploy, "observations", kind=Mapping).items()
            ],
        }
        if "base_velocity" in _in_deploy(deploy, "commands", kind=Mapping):
            ranges = _in_deploy(deploy, "commands", "base_velocity", "ranges")
            values |= _of_ranges("ranges of base_velocity of a deploy.yaml", ranges, "ang_vel_z")
        return from_json(cls, values)


def _in_deploy(deploy: Mapping[str, Any], *keys: str, kind: type = object) -> Any:
    """Return the value of a deploy.yaml behind nested keys, which is of a kind."""
    value: Any = deploy
    for depth, key in enumerate(keys, 1):
        if not isinstance(value, Mapping) or key not in value:
            raise InputError(f"a deploy.yaml must have {'.'.join(keys[:depth])}")
        value = value[key]
    if not isinstance(value, kind):
        raise InputError(
            f"{'.'.join(keys)} of a deploy.yaml must be a {'list' if kind is list else 'mapping'}, got {shown(value)}"
        )
    return value


def _of_columns(deploy: Mapping[str, Any], key: str, columns: Sequence[int]) -> list[Any]:
    """Return the values of a list of a deploy.yaml, which is in the order of the machine, in that of the policy."""
    values = _in_deploy(deploy, key, kind=list)
    if len(values) <= max(columns):
        raise InputError(
            f"{key} of a deploy.yaml must have a value for each joint of the machine up to number {max(columns)} of "
            f"joint_ids_map, got {len(values)} values"
        )
    return [values[column] for column in columns]


def _term_of_deploy(name: str, term: Any) -> dict[str, Any]:
    """Return the fields of a `Term`, which checks its name, from a key of the observations of a deploy.yaml."""
    if name == "joint_pos":
        raise InputError(
            "the term joint_pos of a deploy.yaml is the absolute position of the joints, and observations have them "
            "from the default posture: joint_pos_rel"
        )
    term = term if isinstance(term, Mapping) else {}
    if (clip := term.get("clip")) is not None:
        numbers = isinstance(clip, list) and len(clip) == 2 and all(type(c) in (int, float) for c in clip)
        if not numbers or clip[0] != -clip[1]:
            raise InputError(
                f"clip of the term {name} of a deploy.yaml must be null or [-c, c] with a number c, got {shown(clip)}"
            )
        clip = clip[1]
    scale = 1.0 if term.get("scale") is None else term["scale"]
    return {"name": name, "scale": scale, "history": term.get("history_length", 1), "clip": clip}


def _of_ranges(what: str, ranges: Any, turn: str) -> dict[str, list[Any]]:
    """Return `fastest` and `slowest` of ranges of velocities: ahead, aside and turn, whose name is given."""
    try:
        pairs = [ranges[name] for name in ("lin_vel_x", "lin_vel_y", turn)]
        if not all(-math.inf < low <= high < math.inf for low, high in pairs):
            raise ValueError
        return {"fastest": [high for _, high in pairs], "slowest": [min(low, 0.0) for low, _ in pairs]}
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{what} must have lin_vel_x, lin_vel_y and {turn}, each with its least and greatest value, got "
            f"{shown(ranges)}"
        ) from None


def _by_joint(default: Mapping[str, Any], joints: Sequence[str]) -> list[Any]:
    """Return a posture that names its joints in the order of all; joints that it does not name are at zero."""
    for name in default:
        if name not in joints:
            unknown_name("joint of the policy", name, joints)
    return [default.get(name, 0.0) for name in joints]


def _from_metadata(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return the fields of a description that the metadata of a network have."""
    keys = HOLOSOMA if "dof_names" in metadata else MJLAB
    values = {
        field: (_names if field in ("joints", "observation") else _value)(key, metadata[key])
        for key, field in keys.items()
        if key in metadata
    }
    if "observation" in values:
        tracks = "motion" in _names("command_names", metadata.get("command_names", "none"))
        given = {"command": "motion_joints"} if tracks else {}
        values["observation"] = [{"name": given.get(name, name)} for name in values["observation"]]
    for name in ("action_scale", "anchor"):
        if isinstance(value := values.get(name), list) and len(value) == 1:
            values[name] = value[0]
    ranges = _value("command_ranges", metadata.get("command_ranges", "null"))
    if ranges is not None:
        values |= _of_ranges("command_ranges of a policy", ranges, "ang_vel_yaw")
    return values


def _names(key: str, text: str) -> list[str]:
    """Return the names in a key of metadata, a list or a single name."""
    value = _value(key, text)
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{key} in the metadata of a policy must be a list of names, got {shown(text)}")
    return names


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
