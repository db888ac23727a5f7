"""Soles of a robot in a compiled MuJoCo model, from the geoms of its feet that can touch the ground."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from wbc.base.errors import ModelError, unknown_name
from wbc.base.numbers import ROUNDING, Array
from wbc.core.frames import Sole
from wbc.robots.derivation.soles import SLICE, no_sole, plausible, points_of
from wbc.robots.frames import SoleName, frame_at
from wbc.robots.readers.tree_mjcf import Tree

FLAT = np.cos(np.radians(1.0))
"""Cosine of the tilt of a foot against the base, at qpos0, up to which its sole has the axes of the base."""

STEEPEST = np.cos(np.radians(60.0))
"""Cosine of the largest such tilt; a facet of the foot that is steeper is not its sole."""


@dataclass
class FootGeoms:
    """Body and geoms of a foot that was found in the model."""

    body: int  # whose frame moves with the foot
    given: str | None  # name by which the user gave it; None if it was found
    geoms: list[int]  # of its outline
    origin: Array | None = None  # origin of the sole in the frame of the body when a site is given, m


def find_soles(
    tree: Tree,
    names: tuple[str | None, str | None],
    size: tuple[float, float] | None,
    turn: float = 0.0,
) -> tuple[Sole, Sole]:
    """Return the soles; `tree` gets a note for each rule that was used.

    Feet are named by body, site or geom; None for the two lowest ends of limbs. `size` is length and width, m, from the
    geoms when None; `turn` the angle about z from the x axis of the root to where the robot looks, rad.
    """
    data = mujoco.MjData(tree.model)
    _posture(tree, data)
    base = data.xmat[tree.root].reshape(3, 3) @ pin.rpy.rpyToMatrix(0.0, 0.0, turn)
    named = [None if name is None else _named(tree, name) for name in names]
    found = _lowest(tree, data, base[:, 1], [foot.body for foot in named if foot])
    left, right = (foot or found.pop(0) for foot in named)
    return _sole(tree, data, base, "left_foot", left, size), _sole(
        tree, data, base, "right_foot", right, size
    )


def _posture(tree: Tree, data: mujoco.MjData) -> None:
    """Set the robot upright at qpos0, with locked joints where they are fixed."""
    model = tree.model
    for joint, value in tree.locked.items():
        data.qpos[model.jnt_qposadr[joint]] = value
    first = int(model.body_jntadr[tree.root])
    if first >= 0 and int(model.jnt_type[first]) == mujoco.mjtJoint.mjJNT_FREE:
        start = int(model.jnt_qposadr[first])
        data.qpos[start : start + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    mujoco.mj_kinematics(model, data)


def _named(tree: Tree, name: str) -> FootGeoms:
    model, kinds = tree.model, mujoco.mjtObj
    body = {tree.body_name(b): b for b in tree.bodies}
    if name in body:
        return _foot_of(tree, body[name], name)
    site = mujoco.mj_name2id(model, kinds.mjOBJ_SITE, name)
    if site >= 0 and int(model.site_bodyid[site]) in tree.carrier:
        carrier = int(model.site_bodyid[site])
        foot = _foot_of(tree, carrier, name)
        foot.origin = np.array(model.site_pos[site])
        foot.body = carrier
        return foot
    geom = mujoco.mj_name2id(model, kinds.mjOBJ_GEOM, name)
    if geom >= 0 and int(model.geom_bodyid[geom]) in tree.carrier:
        return FootGeoms(int(model.geom_bodyid[geom]), name, [geom])
    sites = [model.site(i).name for i in range(model.nsite) if int(model.site_bodyid[i]) in tree.carrier]
    geoms = [model.geom(i).name for i in range(model.ngeom) if int(model.geom_bodyid[i]) in tree.carrier]
    unknown_name("body, site or geom", name, [each for each in (*body, *sites, *geoms) if each])


def _foot_of(tree: Tree, body: int, given: str | None) -> FootGeoms:
    """Return a foot with its geoms that touch the ground, or, without any, those of group 3, or all."""
    model = tree.model
    geoms = _geoms(tree, _below(tree, tree.carrier[body]))
    if touching := [g for g in geoms if _touches_ground(model, g)]:
        return FootGeoms(body, given, touching)
    third = [g for g in geoms if int(model.geom_group[g]) == 3]
    if geoms:
        tree.notes.append(
            f"body '{tree.body_name(body)}': no geom can touch the ground (contype, conaffinity, pairs); "
            f"the sole is from {'those of group 3' if third else 'all its geoms'}"
        )
    return FootGeoms(body, given, third or geoms)


def _touches_ground(model: mujoco.MjModel, geom: int) -> bool:
    """Return True if a geom collides with a floor of contype and conaffinity 1, or is paired with a world geom."""
    for i in range(model.npair):
        pair = (int(model.pair_geom1[i]), int(model.pair_geom2[i]))
        if geom in pair and int(model.geom_bodyid[pair[pair[0] == geom]]) == 0:
            return True
    body = int(model.geom_bodyid[geom])
    for i in range(model.nexclude):
        signature = int(model.exclude_signature[i])
        if {signature >> 16, signature & 0xFFFF} == {0, body}:
            return False
    floors = [
        (int(model.geom_contype[g]), int(model.geom_conaffinity[g]))
        for g in range(model.ngeom)
        if int(model.geom_bodyid[g]) == 0
    ]
    own = int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])
    return any(own[0] & affinity or kind & own[1] for kind, affinity in [*floors, (1, 1)])


def _lowest(tree: Tree, data: mujoco.MjData, left: Array, taken: list[int]) -> list[FootGeoms]:
    """Return the two feet with the lowest ends of limbs, left first, or the one beside a foot that is known."""
    inner = {
        tree.carrier[int(tree.model.body_parentid[b])]
        for b in tree.bodies
        if b != tree.root and tree.carrier[b] == b
    }
    ends = [b for b in tree.bodies if tree.carrier[b] == b and b not in inner]
    covered = {b for body in taken for b in _below(tree, tree.carrier[body])}
    missing = 2 - len(taken)
    feet: list[int] = []
    for end in sorted(ends, key=lambda body: float(data.xpos[body, 2])):
        if end not in covered and len(feet) < missing:
            feet.append(_whole_foot(tree, data, end))
            covered |= _below(tree, feet[-1])
    if len(feet) < missing:
        raise ModelError(
            "a humanoid needs two feet, but fewer than two limbs end in a body that moves; give left_sole and "
            "right_sole, or feet=False for a robot without"
        )
    feet.sort(key=lambda body: -float(data.xpos[body] @ left))
    for body in feet:
        tree.notes.append(f"foot: body '{tree.body_name(body)}', the end of one of the two lowest limbs")
    return [_foot_of(tree, body, None) for body in feet]


def _below(tree: Tree, carrier: int) -> set[int]:
    """Return a body that moves, what is fixed to it and everything that hangs on it."""
    found = {carrier}
    for body in tree.bodies:
        if tree.carrier[body] == carrier or int(tree.model.body_parentid[body]) in found:
            found.add(body)
    return found


def _geoms(tree: Tree, bodies: set[int]) -> list[int]:
    return [g for g in range(tree.model.ngeom) if int(tree.model.geom_bodyid[g]) in bodies]


def _whole_foot(tree: Tree, data: mujoco.MjData, end: int) -> int:
    """Return the body that carries a foot: above the end of the limb, as long as its geoms share the sole's plane."""
    model, up = tree.model, data.xmat[tree.root].reshape(3, 3)[:, 2]
    while (above := tree.carrier[int(model.body_parentid[end])]) != tree.root:
        toe = _below(tree, end)
        parts = [
            [_points(model, data, g, up) for g in _geoms(tree, bodies) if _touches_ground(model, g)]
            for bodies in (_below(tree, above) - toe, toe)
        ]
        if not all(parts):
            break
        clouds = [np.concatenate(part) for part in parts]
        normal = _flat_side(np.concatenate(clouds), up)
        heights = [float((cloud @ (up if normal is None else normal)).min()) for cloud in clouds]
        if abs(heights[0] - heights[1]) > SLICE:
            break
        end = above
    return end


def _sole(
    tree: Tree,
    data: mujoco.MjData,
    base: Array,
    name: SoleName,
    foot: FootGeoms,
    size: tuple[float, float] | None,
) -> Sole:
    model = tree.model
    link = tree.body_name(foot.body)
    if not foot.geoms and (size is None or foot.origin is None):
        raise ModelError(
            f"{name}: body '{link}' has no geom that says where its sole is; give a site at the sole and sole_size"
        )
    normal, points = base[:, 2], np.zeros((0, 3))
    for _ in range(3):  # the lowest points of round geoms depend on the normal, and the normal on the points
        clouds = [_points(model, data, geom, normal) for geom in foot.geoms]
        points = np.concatenate([*clouds, np.zeros((0, 3))])
        found = _flat_side(points, base[:, 2])
        if found is None or found @ base[:, 2] > FLAT:
            normal = base[:, 2]
            break
        normal = found
    if normal @ base[:, 2] < FLAT:
        tilt = np.degrees(np.arccos(normal @ base[:, 2]))
        tree.notes.append(f"{name}: at qpos0 the foot is tilted by {tilt:.0f}°; the sole is its flat side")
    forward = base[:, 0] - (base[:, 0] @ normal) * normal
    forward /= np.linalg.norm(forward)
    axes = np.stack([forward, np.cross(normal, forward), normal], axis=1)
    body = pin.SE3(data.xmat[foot.body].reshape(3, 3), data.xpos[foot.body])
    if foot.origin is not None:
        centre = body.act(foot.origin)
    if foot.geoms:
        local = points @ axes
        touching = local[local[:, 2] < local[:, 2].min() + SLICE]
        low, high = touching.min(axis=0), touching.max(axis=0)
        length, width = (high - low)[:2].tolist()
        middle = axes @ np.array([*(0.5 * (low + high))[:2], low[2]])
        if foot.origin is None:
            centre = middle
        leg = float(np.linalg.norm(data.xpos[foot.body] - data.xpos[model.body_rootid[foot.body]]))
        if size is None and not plausible(length, width, leg):
            raise ModelError(
                f"{name}, body '{link}': {no_sole(length, width)}; give sole_size. A humanoid needs two feet; "
                "feet=False describes a robot without, such as a quadruped"
            )
        if size is None:
            tree.notes.append(
                f"{name}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from {_kinds(model, foot.geoms)} of body '{link}'"
            )
    if size is not None:
        length, width = size
    place = body.inverse() * pin.SE3(axes, centre)
    frame = frame_at(f"{name}_sole", link, place)
    return Sole(frame.frame, frame.link, frame.translation, frame.rpy, name=name, length=length, width=width)


def _kinds(model: mujoco.MjModel, geoms: list[int]) -> str:
    names = [_kind(model, geom) for geom in geoms]
    counts = {name: names.count(name) for name in dict.fromkeys(names)}
    plural = {"box": "boxes", "mesh": "meshes"}
    return " and ".join(
        f"a {name}" if count == 1 else f"{count} {plural.get(name, f'{name}s')}"
        for name, count in counts.items()
    )


def _flat_side(points: Array, up: Array) -> Array | None:
    """Return the normal, pointing up, of the largest flat side of a foot that looks down; None without one."""
    points = np.unique(np.round(points, 7), axis=0)
    if len(points) < 3:
        return None
    centred = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    if sizes[1] < 1e-3 * max(sizes[0], ROUNDING):
        return None  # a line
    if len(points) == 3 or sizes[2] < 1e-3 * sizes[0]:
        normal = axes[2] * np.sign(axes[2] @ up or 1.0)
        return np.asarray(normal) if normal @ up > STEEPEST else None
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    facing = -np.unique(np.round(hull.equations, 4), axis=0)[:, :3]
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    facing = facing[facing @ up >= STEEPEST]
    sides = np.cross(facing, np.where(np.abs(facing[:, 1:2]) < 0.7, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]))
    best, largest = None, 0.0
    for normal, side, across in zip(facing, sides, np.cross(facing, sides), strict=True):
        height = points @ normal
        near = points[height < height.min() + SLICE]
        flat = near @ np.stack([side, across], axis=1)
        spread = np.ptp(flat, axis=0)
        if (spread < 1e-3).any() or len(near) < 3:
            continue
        try:
            area = float(ConvexHull(flat).volume)
        except QhullError:
            continue
        # The side that looks straight down wins among equals, such as the bottom and the chamfer of a mesh.
        if area * (normal @ up) > largest:
            best, largest = normal, area * float(normal @ up)
    return best


def _points(model: mujoco.MjModel, data: mujoco.MjData, geom: int, up: Array) -> Array:
    """Return points of a geom in the world that include those on which it stands, shape (n, 3), m."""
    kind, rotation = int(model.geom_type[geom]), data.geom_xmat[geom].reshape(3, 3)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        local = np.array(model.mesh_vert[start : start + count], dtype=np.float64)
    else:
        found = points_of(_kind(model, geom), np.array(model.geom_size[geom]), rotation.T @ up)
        local = np.zeros((0, 3)) if found is None else found
    return np.asarray(data.geom_xpos[geom] + local @ rotation.T)


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return str(mujoco.mjtGeom(int(model.geom_type[geom])).name).removeprefix("mjGEOM_").lower()
