"""Shapes of a robot's bodies in a compiled MuJoCo model."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import mujoco
import numpy as np

from wbc.base.numbers import Array
from wbc.robots.mechanism import Geometry, along, placement_of
from wbc.robots.notes import listed
from wbc.robots.readers.tree_mjcf import Tree

DRAWN = 3
"""Groups of geoms below this one are drawn; MuJoCo's viewers hide the others."""

COLLISIONS = 3
"""Group in which robots by convention have their collision geoms."""

SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "mesh": 3}
"""Kind of a shape → how many sizes it has; scales of a mesh."""


def mesh_files(model: mujoco.MjModel, moved: Collection[str]) -> dict[int, str]:
    """Return the files of the meshes of a compiled model by their numbers; those without a file on disk are left out.

    So are those that the compiler has moved against their files, by name.

    The compiler keeps the whole path, whatever the folder that the file names, and of models that were attached too.
    """
    found = {}
    for i in range(model.nmesh):
        if str(model.mesh(i).name) in moved:
            continue
        if (start := int(model.mesh_pathadr[i])) >= 0:
            name = bytes(model.paths[start:]).split(b"\0", 1)[0].decode("utf-8", "surrogateescape")
            if Path(name).is_file():
                found[i] = str(Path(name).resolve())
    return found


def shapes(tree: Tree, moved: Collection[str], notes: list[str]) -> tuple[Geometry, ...]:
    """Return the shapes of a robot's bodies; `notes` gets those that are boxes here; `moved` see `mesh_files`.

    What is drawn are the geoms of the groups that viewers show, collisions those that can touch anything; where none of
    a body can, those of the group for collisions, as robots are written whose contacts are explicit pairs.
    """
    model, files = tree.model, mesh_files(tree.model, moved)
    paired = {int(geom) for geom in (*model.pair_geom1, *model.pair_geom2)}
    boxed: dict[str, None] = {}
    found = []
    for body in tree.bodies:
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = list(range(first, first + count)) if count else []
        shown = [geom for geom in geoms if int(model.geom_group[geom]) < DRAWN]
        touching = [g for g in geoms if g in paired or model.geom_contype[g] or model.geom_conaffinity[g]]
        touching = touching or [g for g in geoms if int(model.geom_group[g]) == COLLISIONS]
        for role, some in (("visual", shown or geoms), ("collision", touching)):
            made = (_shape(model, geom, tree.body_name(body), role, files, boxed) for geom in some)
            found += [each for each in made if each is not None]
    if boxed:
        notes.append(f"shapes of MuJoCo alone are the boxes around them: {listed([*boxed])}")
    return tuple(found)


def kind_of(model: mujoco.MjModel, geom: int) -> str:
    """Return the kind of a geom as an MJCF names it."""
    return str(mujoco.mjtGeom(int(model.geom_type[geom])).name).removeprefix("mjGEOM_").lower()


def vertices_of(model: mujoco.MjModel, mesh: int) -> Array:
    """Return the vertices of a mesh in the frame that the compiler gave it, shape (n, 3), m."""
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    return np.array(model.mesh_vert[start : start + count], dtype=np.float64)


def _shape(
    model: mujoco.MjModel, geom: int, link: str, role: str, files: Mapping[int, str], boxed: dict[str, None]
) -> Geometry | None:
    """Return a geom as a box, sphere, cylinder, capsule or mesh of a file; None for one that is none of them."""
    kind, size, file = kind_of(model, geom), np.array(model.geom_size[geom]), ""
    place = placement_of(model.geom_pos[geom], model.geom_quat[geom])
    name = str(model.geom(geom).name) or f"geom_{geom}"
    if kind in ("mesh", "sdf") and (number := int(model.geom_dataid[geom])) >= 0:
        if number in files:
            # The compiler has moved the mesh to its centre of mass and principal axes.
            place = place * placement_of(model.mesh_pos[number], model.mesh_quat[number]).inverse()
            kind, file, size = "mesh", files[number], np.array(model.mesh_scale[number])
        else:
            vertices = vertices_of(model, number)
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            place, size, kind = place * along(0.5 * (low + high)), 0.5 * (high - low), "box"
            boxed[f"mesh '{model.mesh(number).name or number}' without a file that has it so"] = None
    elif kind == "ellipsoid":
        kind = "box"
        boxed[f"ellipsoid '{name}'"] = None
    elif kind not in SIZES:
        boxed[f"{kind} '{name}', left out"] = None
        return None
    material = int(model.geom_matid[geom])
    red, green, blue, opacity = (model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]).tolist()
    return Geometry(link, role, kind, size[: SIZES[kind]], place, file, (red, green, blue, opacity))
