"""Soles of a robot in a compiled MuJoCo model, from the geoms of its feet that can touch the ground."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from wbc.base.errors import ModelError, shown, unknown_name
from wbc.base.numbers import ROUNDING, Array
from wbc.core.frames import FrameDescription, Sole, yaw_rotation
from wbc.robots.derivation.soles import SLICE, footprint, no_sole, plausible, points_of, sole_at
from wbc.robots.frames import SoleName, frame_at
from wbc.robots.readers.shapes_mjcf import kind_of, vertices_of
from wbc.robots.readers.tree_mjcf import FREE, Tree

THIN = 1e-3
"""Extent of points over their longest one below which they are a line or lie in a plane."""

NARROW = 1e-3
"""Extent of the points of a side, m, below which it is none."""

FLAT = np.cos(np.radians(1.0))
"""Cosine of the tilt of a foot against the base, at qpos0, up to which its sole has the axes of the base."""

STEEPEST = np.cos(np.radians(60.0))
"""Cosine of the largest such tilt; a facet of the foot that is steeper is not its sole."""


@dataclass
class FootGeoms:
    """Body and geoms of a foot that was found in the model."""

    body: int  # whose frame moves with the foot
    geoms: list[int]  # of its outline
    origin: Array | None = None  # origin of the sole in the frame of the body when a site is given, m


def find_soles(
    tree: Tree,
    given: tuple[str | FrameDescription | None, str | FrameDescription | None],
    size: tuple[float, float] | None,
    _: pin.Model,
    turn: float,
    notes: list[str],
) -> tuple[Sole, Sole]:
    """Return the soles; `notes` gets a line for each rule that was used.

    Feet are given whole, or named by body, site or geom; None for the two lowest ends of limbs. `size` is length and
    width, m, from the geoms when None; `turn` the angle about z from the x axis of the root to where the robot looks,
    rad.
    """
    left, right = given
    if isinstance(left, Sole) and isinstance(right, Sole):
        return left, right
    if isinstance(left, FrameDescription) or isinstance(right, FrameDescription):
        raise ModelError(
            "left_sole and right_sole must both be names, or both have a place, a length and a width, got "
            f"{shown(left)} and {shown(right)}"
        )
    finder = _Finder(tree, turn, notes)
    named = [None if name is None else finder.named(name) for name in (left, right)]
    found = finder.lowest([foot.body for foot in named if foot])
    one, other = (foot or found.pop(0) for foot in named)
    return finder.sole("left_foot", one, size), finder.sole("right_foot", other, size)


class _Finder:
    """The robot upright at qpos0, with locked joints where they are fixed.

    Attributes:
        base: Axes of the base, x to where the robot looks, shape (3, 3).
        touches: True for geoms that collide with a floor of contype and conaffinity 1, or with one of the file.
        notes: Rules that were used, one line each.
    """

    def __init__(self, tree: Tree, turn: float, notes: list[str]) -> None:
        self.tree, self.model, self.notes = tree, tree.model, notes
        self.data = data = mujoco.MjData(self.model)
        for joint, value in tree.locked.items():
            data.qpos[self.model.jnt_qposadr[joint]] = value
        first = int(self.model.body_jntadr[tree.root])
        if first >= 0 and int(self.model.jnt_type[first]) == FREE:
            start = int(self.model.jnt_qposadr[first])
            data.qpos[start : start + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        mujoco.mj_kinematics(self.model, data)
        self.base = data.xmat[tree.root].reshape(3, 3) @ yaw_rotation(turn)
        self.touches = _touch_ground(self.model)

    def named(self, name: str) -> FootGeoms:
        """Return the foot of a body, a site or a geom."""
        tree, model = self.tree, self.model
        bodies = {tree.body_name(body): body for body in tree.bodies}
        sites = {
            model.site(i).name: i for i in range(model.nsite) if int(model.site_bodyid[i]) in tree.carrier
        }
        geoms = {model.geom(i).name: i for i in self._geoms(set(tree.bodies))}
        if name in bodies:
            return self._foot_of(bodies[name])
        if name in sites:
            foot = self._foot_of(int(model.site_bodyid[sites[name]]))
            foot.origin = np.array(model.site_pos[sites[name]])
            return foot
        if name in geoms:
            return FootGeoms(int(model.geom_bodyid[geoms[name]]), [geoms[name]])
        unknown_name("body, site or geom", name, [each for each in (*bodies, *sites, *geoms) if each])

    def lowest(self, taken: list[int]) -> list[FootGeoms]:
        """Return the two feet with the lowest ends of limbs, left first, or the one beside a foot that is known."""
        tree, places = self.tree, self.data.xpos
        moving = [body for body in tree.bodies if tree.carrier[body] == body]
        inner = {tree.carrier[int(self.model.body_parentid[body])] for body in moving if body != tree.root}
        covered = {b for body in taken for b in self._below(tree.carrier[body])}
        missing, feet = 2 - len(taken), list[int]()
        for end in sorted(
            (body for body in moving if body not in inner), key=lambda body: float(places[body, 2])
        ):
            if end not in covered and len(feet) < missing:
                feet.append(self._whole_foot(end))
                covered |= self._below(feet[-1])
        if len(feet) < missing:
            raise ModelError(
                "a humanoid needs two feet, but fewer than two limbs end in a body that moves; give left_sole and "
                "right_sole, or feet=False for a robot without"
            )
        feet.sort(key=lambda body: -float(places[body] @ self.base[:, 1]))
        for body in feet:
            self.notes.append(f"foot: body '{tree.body_name(body)}', the end of one of the two lowest limbs")
        return [self._foot_of(body) for body in feet]

    def sole(self, name: SoleName, foot: FootGeoms, size: tuple[float, float] | None) -> Sole:
        """Return the sole of a foot: the rectangle around what touches the ground, on the flat side of the foot."""
        tree, data, up = self.tree, self.data, self.base[:, 2]
        link = tree.body_name(foot.body)
        if not foot.geoms and (size is None or foot.origin is None):
            raise ModelError(
                f"{name}: body '{link}' has no geom that says where its sole is; give a site at the sole and sole_size"
            )
        normal, points = up, np.zeros((0, 3))
        for _ in range(3):  # lowest points of round geoms depend on the normal, and the normal on the points
            points = self._points(foot.geoms, normal)
            found = _flat_side(points, up)
            if found is None or found @ up > FLAT:
                normal = up
                break
            normal = found
        if normal @ up < FLAT:
            tilt = np.degrees(np.arccos(normal @ up))
            self.notes.append(
                f"{name}: at qpos0 the foot is tilted by {tilt:.0f}°; the sole is its flat side"
            )
        forward = self.base[:, 0] - (self.base[:, 0] @ normal) * normal
        forward /= np.linalg.norm(forward)
        axes = np.stack([forward, np.cross(normal, forward), normal], axis=1)
        body = pin.SE3(data.xmat[foot.body].reshape(3, 3), data.xpos[foot.body])
        centre, sides = np.zeros(3), size
        if foot.geoms:
            middle, length, width = footprint(points @ axes)
            centre, sides = axes @ middle, size or self._sides(name, foot, length, width)
        assert sides is not None
        if foot.origin is not None:
            centre = body.act(foot.origin)
        place = frame_at(f"{name}_sole", link, body.inverse() * pin.SE3(axes, centre))
        return sole_at(place, name, sides)

    def _sides(self, name: str, foot: FootGeoms, length: float, width: float) -> tuple[float, float]:
        """Return length and width of a sole, m, if they are those of one."""
        data, link = self.data, self.tree.body_name(foot.body)
        leg = float(np.linalg.norm(data.xpos[foot.body] - data.xpos[self.model.body_rootid[foot.body]]))
        if not plausible(length, width, leg):
            raise ModelError(
                f"{name}, body '{link}': {no_sole(length, width)}; give sole_size. A humanoid needs two feet; "
                "feet=False describes a robot without, such as a quadruped"
            )
        kinds = Counter(kind_of(self.model, geom) for geom in foot.geoms)
        plural = {"box": "boxes", "mesh": "meshes"}
        said = " and ".join(
            f"a {kind}" if count == 1 else f"{count} {plural.get(kind, f'{kind}s')}"
            for kind, count in kinds.items()
        )
        self.notes.append(f"{name}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from {said} of body '{link}'")
        return length, width

    def _foot_of(self, body: int) -> FootGeoms:
        """Return a foot with its geoms that touch the ground, or, without any, those of group 3, or all."""
        geoms = self._geoms(self._below(self.tree.carrier[body]))
        if touching := [geom for geom in geoms if self.touches[geom]]:
            return FootGeoms(body, touching)
        third = [geom for geom in geoms if int(self.model.geom_group[geom]) == 3]
        if geoms:
            self.notes.append(
                f"body '{self.tree.body_name(body)}': no geom can touch the ground (contype, conaffinity, pairs); "
                f"the sole is from {'those of group 3' if third else 'all its geoms'}"
            )
        return FootGeoms(body, third or geoms)

    def _whole_foot(self, end: int) -> int:
        """Return the body that carries a foot: above the end of a limb, as long as its geoms share the sole's plane."""
        tree, up = self.tree, self.base[:, 2]
        while (above := tree.carrier[int(self.model.body_parentid[end])]) != tree.root:
            toe = self._below(end)
            parts = [
                [geom for geom in self._geoms(bodies) if self.touches[geom]]
                for bodies in (self._below(above) - toe, toe)
            ]
            if not all(parts):
                break
            clouds = [self._points(geoms, up) for geoms in parts]
            normal = _flat_side(np.concatenate(clouds), up)
            heights = [float((cloud @ (up if normal is None else normal)).min()) for cloud in clouds]
            if abs(heights[0] - heights[1]) > SLICE:
                break
            end = above
        return end

    def _below(self, carrier: int) -> set[int]:
        """Return a body that moves, what is fixed to it and everything that hangs on it."""
        found = {carrier}
        for body in self.tree.bodies:
            if self.tree.carrier[body] == carrier or int(self.model.body_parentid[body]) in found:
                found.add(body)
        return found

    def _geoms(self, bodies: set[int]) -> list[int]:
        return [geom for geom in range(self.model.ngeom) if int(self.model.geom_bodyid[geom]) in bodies]

    def _points(self, geoms: Sequence[int], up: Array) -> Array:
        """Return points of geoms in the world that include those on which they stand, shape (n, 3), m."""
        model, clouds = self.model, [np.zeros((0, 3))]
        for geom in geoms:
            rotation = self.data.geom_xmat[geom].reshape(3, 3)
            local = points_of(kind_of(model, geom), np.array(model.geom_size[geom]), rotation.T @ up)
            if int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_MESH:
                local = vertices_of(model, int(model.geom_dataid[geom]))
            if local is not None:
                clouds.append(self.data.geom_xpos[geom] + local @ rotation.T)
        return np.concatenate(clouds)


def _touch_ground(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return True for each geom that collides with a floor, by masks or pairs of the file, shape (ngeom,)."""
    kinds, affinities, bodies = model.geom_contype, model.geom_conaffinity, model.geom_bodyid
    floors = {(1, 1), *zip(kinds[bodies == 0].tolist(), affinities[bodies == 0].tolist(), strict=True)}
    touches = np.zeros(model.ngeom, dtype=bool)
    for kind, affinity in floors:
        touches |= (kinds & affinity | affinities & kind) != 0
    for signature in model.exclude_signature.tolist():
        pair = signature >> 16, signature & 0xFFFF
        if 0 in pair:
            touches[bodies == max(pair)] = False
    for pair in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True):
        for one, other in (pair, pair[::-1]):
            touches[one] |= bodies[other] == 0
    return touches


def _flat_side(points: Array, up: Array) -> Array | None:
    """Return the normal, pointing up, of the largest flat side of a foot that looks down; None without one."""
    points = np.unique(np.round(points, 7), axis=0)
    if len(points) < 3:
        return None
    centred = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    if sizes[1] < THIN * max(sizes[0], ROUNDING):
        return None  # a line
    if len(points) == 3 or sizes[2] < THIN * sizes[0]:
        normal = -axes[2] if axes[2] @ up < 0.0 else axes[2]
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
        if (spread < NARROW).any() or len(near) < 3:
            continue
        try:
            area = float(ConvexHull(flat).volume)
        except QhullError:
            continue
        # The side that looks straight down wins among equals, such as the bottom and the chamfer of a mesh.
        if area * (normal @ up) > largest:
            best, largest = normal, area * float(normal @ up)
    return best
