"""Shapes of a robot's bodies in a compiled MuJoCo model, as geoms of its MJCF."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from wbc.base.numbers import Array
from wbc.robots.readers.source_mjcf import SHOWN, Mjcf, along, placed, placement_of, text
from wbc.robots.readers.tree_mjcf import Tree
from wbc.robots.report import listed
from wbc.robots.source import Element

DRAWN = 3
"""Groups of geoms below this one are drawn; MuJoCo's viewers hide the others."""

COLLISIONS = 3
"""Group in which robots by convention have their collision geoms."""

SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2}
"""Kind of a shape → how many sizes it has."""


def mesh_files(model: mujoco.MjModel, moved: Collection[str] = ()) -> dict[int, str]:
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


def add_shapes(source: Mjcf, tree: Tree, moved: Collection[str] = ()) -> None:
    """Add the geoms of a robot to the bodies of its MJCF; `tree` gets notes; `moved` see `mesh_files`.

    What is drawn are the geoms of the groups that viewers show, collisions those that can touch anything; where none of
    a body can, those of the group for collisions, as robots are written whose contacts are explicit pairs.
    """
    model, files = tree.model, mesh_files(tree.model, moved)
    bodies = {str(body.get("name")): body for body in source.root.iter("body")}
    assets = ElementTree.SubElement(source.root, "asset")
    paired = {int(geom) for geom in (*model.pair_geom1, *model.pair_geom2)}
    boxed: dict[str, None] = {}
    for body in tree.bodies:
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = list(range(first, first + count)) if count else []
        shown = [geom for geom in geoms if int(model.geom_group[geom]) < DRAWN]
        touching = [g for g in geoms if g in paired or model.geom_contype[g] or model.geom_conaffinity[g]]
        touching = touching or [g for g in geoms if int(model.geom_group[g]) == COLLISIONS]
        for group, touches, some in ((SHOWN, "0", shown or geoms), (str(COLLISIONS), "1", touching)):
            for geom in some:
                if (made := _geom(model, geom, files, boxed)) is not None:
                    made.attrib.update(group=group, contype=touches, conaffinity=touches)
                    if (mesh := made.get("mesh")) and assets.find(f"mesh[@name='{mesh}']") is None:
                        number = int(model.geom_dataid[geom])
                        scale = text(model.mesh_scale[number])
                        ElementTree.SubElement(assets, "mesh", name=mesh, file=files[number], scale=scale)
                    bodies[tree.body_name(body)].append(made)
    if boxed:
        tree.notes.append(f"shapes of MuJoCo alone are the boxes around them: {listed([*boxed])}")


def kind_of(model: mujoco.MjModel, geom: int) -> str:
    """Return the kind of a geom as an MJCF names it."""
    return str(mujoco.mjtGeom(int(model.geom_type[geom])).name).removeprefix("mjGEOM_").lower()


def vertices_of(model: mujoco.MjModel, mesh: int) -> Array:
    """Return the vertices of a mesh in the frame that the compiler gave it, shape (n, 3), m."""
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    return np.array(model.mesh_vert[start : start + count], dtype=np.float64)


def _geom(
    model: mujoco.MjModel, geom: int, files: Mapping[int, str], boxed: dict[str, None]
) -> Element | None:
    """Return a geom as a box, sphere, cylinder, capsule or mesh of a file; None for one that is none of them."""
    kind, size, mesh = kind_of(model, geom), np.array(model.geom_size[geom]), ""
    place = placement_of(model.geom_pos[geom], model.geom_quat[geom])
    name = str(model.geom(geom).name) or f"geom_{geom}"
    if kind in ("mesh", "sdf") and (number := int(model.geom_dataid[geom])) >= 0:
        if number in files:
            # The compiler has moved the mesh to its centre of mass and principal axes.
            place = place * placement_of(model.mesh_pos[number], model.mesh_quat[number]).inverse()
            kind, mesh = "mesh", f"mesh_{number}"
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
    made = ElementTree.Element("geom", {"type": kind, **placed(place)})
    made.attrib.update({"mesh": mesh} if mesh else {"size": text(size[: SIZES[kind]])})
    material = int(model.geom_matid[geom])
    made.set("rgba", text(model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]))
    return made
