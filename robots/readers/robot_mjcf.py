"""A robot read from an MJCF: its bodies, its feet, and everything that the file says of its drives and sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from wbc.base.errors import ModelError
from wbc.core.frames import FrameDescription
from wbc.robots.derivation.complete import FileRobot
from wbc.robots.notes import UNMODELLED, listed
from wbc.robots.readers import drives_mjcf, feet_mjcf, mechanism_mjcf, shapes_mjcf, tree_mjcf
from wbc.robots.readers.actuators_mjcf import driven
from wbc.robots.readers.compile_mjcf import compiled
from wbc.robots.readers.forces_mjcf import unmodelled
from wbc.robots.readers.tree_mjcf import Tree

NO_DRIVE = 1.0
"""Torque limit of a joint without a drive, Nm: it needs one, and the description has none."""

NO_SPEEDS = (
    f"velocity limits: an MJCF has none; {tree_mjcf.SPEED:g} rad/s (slides {tree_mjcf.SLIDE_SPEED:g} m/s)"
)
"""Note on the velocity limits of all joints."""


def read(
    source: object,
    soles: tuple[str | FrameDescription | None, str | FrameDescription | None],
    sole_size: tuple[float, float] | None,
    *,
    feet: bool,
    fixed: bool,
    root: str | None,
    meshes: bool,
    use_gains: bool,
    lock: Mapping[str, float],
) -> FileRobot:
    """Return the robot in an MJCF; see `RobotDescription.from_mjcf`."""
    model, moved = compiled(source, meshes=meshes)
    _refuse_odd_inertias(model)
    tree, chains, held, idle = _tree_of(model, root, lock, fixed)
    drives = drives_mjcf.read_drives(tree)
    notes = tree.left_out()
    if not driven(model) & set(tree.joints.values()):
        notes.append("no actuators in the file that act: all joints are taken as driven")
    shapes, closures = shapes_mjcf.shapes(tree, moved, notes), mechanism_mjcf.closures(tree, chains)
    torque = {joint: max(-low, high) for joint, (low, high) in drives.torque.items()}
    torque |= dict.fromkeys(idle, NO_DRIVE)
    imu, sensors = drives_mjcf.sensors(tree)
    what = "joints without an actuator, passive and taken as fixed"
    doubtful = [f"{UNMODELLED}{len(held)} {what}: {listed(held)}"] if held else []
    ties = [*tree.ties, *(chain.number for chain in chains)]  # of which a description has the forces
    doubtful += unmodelled(model, tree.bodies, {number: name for name, number in tree.joints.items()}, ties)
    return FileRobot(
        mechanism=lambda turn: mechanism_mjcf.mechanism(tree, torque, chains, shapes, turn),
        name=_model_name(model) or tree.body_name(tree.root),
        source=_origin(source),
        notes=(*notes, NO_SPEEDS),
        doubtful=tuple(doubtful),
        find_soles=partial(feet_mjcf.find_soles, tree, soles, sole_size) if feet and not fixed else None,
        named=soles != (None, None),
        postures=drives_mjcf.keyframes(tree),
        closures=closures,
        passive=tuple(idle),
        imu=imu,
        joints=drives if use_gains else replace(drives, gains={}),
        sensors=sensors,
        locked={tree.joint_name(joint): value for joint, value in tree.locked.items()},
    )


def _origin(source: object) -> str:
    if not isinstance(source, (str, Path)):
        return "MjSpec"
    return "MJCF string" if str(source).lstrip().startswith("<") else str(source)


def _tree_of(
    model: mujoco.MjModel, root: str | None, lock: Mapping[str, float], fixed: bool
) -> tuple[Tree, list[mechanism_mjcf.Chain], list[str], list[str]]:
    """Return the robot, its closed chains, and its joints without a drive: those that are fixed, those that are not."""
    tree = tree_mjcf.find_tree(model, root, lock, fixed)
    passive = drives_mjcf.passive_joints(tree)
    moved_along = passive.keys() & mechanism_mjcf.joints_between(tree, mechanism_mjcf.find_chains(tree))
    passive = {joint: at for joint, at in passive.items() if joint not in moved_along}
    if (
        passive
    ):  # which joints have no drive is known of a tree alone: it is found once more with these locked
        tree = tree_mjcf.find_tree(model, root, {**lock, **passive}, fixed)
    chains = mechanism_mjcf.find_chains(tree)
    idle = sorted(moved_along & mechanism_mjcf.joints_between(tree, chains))
    return tree, chains, [*passive, *tree.ball_joints()], idle


def _model_name(model: mujoco.MjModel) -> str:
    name = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    return "" if name == "MuJoCo Model" else name


def _refuse_odd_inertias(model: mujoco.MjModel) -> None:
    for body in range(1, model.nbody):
        numbers = np.concatenate([[model.body_mass[body]], model.body_inertia[body], model.body_ipos[body]])
        if not np.isfinite(numbers).all():
            raise ModelError(f"body '{model.body(body).name}': mass, inertia and its place must be finite")
