"""A robot read from an MJCF: its bodies, its feet, and everything that the file says of its drives and sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from wbc.base.errors import ModelError
from wbc.core.frames import FrameDescription
from wbc.robots.derivation.complete import Notes, Read, complete
from wbc.robots.options import DescriptionOptions
from wbc.robots.readers import chains_mjcf, drives_mjcf, feet_mjcf, mechanism_mjcf, shapes_mjcf, tree_mjcf
from wbc.robots.readers.compile_mjcf import compiled
from wbc.robots.readers.tree_mjcf import Tree
from wbc.robots.report import UNMODELLED, listed

NO_DRIVE = 1.0
"""Torque limit of a joint without a drive, Nm: it needs one, and the description has none."""


def fields(
    source: Any,
    soles: tuple[str | FrameDescription | None, str | FrameDescription | None],
    sole_size: tuple[float, float] | None,
    *,
    name: str | None,
    feet: bool,
    fixed: bool,
    root: str | None,
    meshes: bool,
    use_gains: bool,
    provenance: str | None,
    **options: Unpack[DescriptionOptions],
) -> dict[str, Any]:
    """Return the fields of the `RobotDescription` of an MJCF; see `RobotDescription.from_mjcf`."""
    model, moved = compiled(source, meshes=meshes)
    _refuse_odd_inertias(model)
    tree, chains, idle = _tree_of(model, root, options.pop("lock", None) or {}, fixed)
    drives = drives_mjcf.read_drives(tree)
    shapes, closures = shapes_mjcf.shapes(tree, moved), mechanism_mjcf.closures(tree, chains)
    torque = {joint: max(-low, high) for joint, (low, high) in drives.torque.items()}
    torque |= dict.fromkeys(idle, NO_DRIVE)
    given = options.get("torque_limits") or {}
    one_sided = {
        joint: (low, high)
        for joint, (low, high) in drives.torque.items()
        if not math.isclose(-low, high) and joint not in given
    }
    tree.note_speeds()
    imu, sensors = drives_mjcf.sensors(tree)
    read = Read(
        lambda turn: mechanism_mjcf.mechanism(tree, torque, chains, shapes, turn),
        name or _model_name(model) or tree.body_name(tree.root),
        provenance or _origin(source),
        tree.notes,
        partial(feet_mjcf.find_soles, tree, soles, sole_size) if feet and not fixed else None,
        named=soles != (None, None),
        postures=drives_mjcf.keyframes(tree),
        loops=closures,
        passive=tuple(idle),
        fields={
            "damping": drives.damping,
            "frictionloss": drives.frictionloss,
            "springs": drives.springs,
            "torque_ranges": one_sided,
            "sensors": sensors,
            "locked": {tree.joint_name(joint): value for joint, value in tree.locked.items()},
        },
    )
    _take(options, drives, imu, use_gains, tree.notes)
    return complete(read, **options)


def _take(
    options: DescriptionOptions,
    drives: drives_mjcf.JointData,
    imu: FrameDescription | None,
    use_gains: bool,
    notes: Notes,
) -> None:
    """Put gains, rotor inertias and the IMU of the file where the options do not give them."""
    if use_gains:
        options["gains"] = {**drives.gains, **(options.get("gains") or {})}
    armature = options.get("armature")
    if armature is None or isinstance(armature, Mapping):
        options["armature"] = {**drives.armature, **(armature or {})}
    if options.get("imu") is None and imu is not None:
        options["imu"] = imu
        notes.append(f"IMU: site '{imu.frame}' on link '{imu.link}'")


def _origin(source: Any) -> str:
    if not isinstance(source, (str, Path)):
        return "MjSpec"
    return "MJCF string" if str(source).lstrip().startswith("<") else str(source)


def _tree_of(
    model: Any, root: str | None, lock: Mapping[str, float], fixed: bool
) -> tuple[Tree, list[chains_mjcf.Chain], list[str]]:
    """Return the robot, its closed chains, and their joints without a drive; others without one are fixed."""
    tree = tree_mjcf.find_tree(model, root, lock, fixed)
    passive = drives_mjcf.passive_joints(tree)
    moved_along = passive.keys() & chains_mjcf.joints_of(tree, chains_mjcf.find_chains(tree))
    passive = {joint: at for joint, at in passive.items() if joint not in moved_along}
    if passive:
        tree = tree_mjcf.find_tree(model, root, {**lock, **passive}, fixed)
    if held := [*passive, *tree.balls()]:
        tree.notes.doubtful.append(
            f"{UNMODELLED}{len(held)} joints without an actuator, passive and taken as fixed: {listed(held)}"
        )
    chains = chains_mjcf.find_chains(tree)
    tree.ties += [chain.number for chain in chains]
    return tree, chains, sorted(moved_along & chains_mjcf.joints_of(tree, chains))


def _model_name(model: Any) -> str:
    name = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    return "" if name == "MuJoCo Model" else name


def _refuse_odd_inertias(model: Any) -> None:
    for body in range(1, model.nbody):
        numbers = np.concatenate([[model.body_mass[body]], model.body_inertia[body], model.body_ipos[body]])
        if not np.isfinite(numbers).all():
            raise ModelError(f"body '{model.body(body).name}': mass, inertia and its place must be finite")
