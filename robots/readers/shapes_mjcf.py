"""Shapes of a robot's bodies in a compiled MuJoCo model, as visuals and collisions of a URDF."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

from wbc.robots.readers.tree_mjcf import Tree, placement_of
from wbc.robots.readers.write_urdf import text
from wbc.robots.report import listed
from wbc.robots.urdf import Element

DRAWN = 3
"""Groups of geoms below this one are drawn; MuJoCo's viewers hide the others."""

COLLISIONS = 3
"""Group in which robots by convention have their collision geoms."""


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


def add_shapes(root: Element, tree: Tree, moved: Collection[str] = ()) -> None:
    """Add the geoms of a robot to the links of its URDF, which is changed; `tree` gets notes; `moved` see `mesh_files`.

    What is drawn are the geoms of the groups that viewers show, collisions those that can touch anything; where none of
    a body can, those of the group for collisions, as robots are written whose contacts are explicit pairs.
    """
    model, files = tree.model, mesh_files(tree.model, moved)
    links = {str(link.get("name")): link for link in root.findall("link")}
    paired = {int(geom) for geom in (*model.pair_geom1, *model.pair_geom2)}
    boxed: dict[str, None] = {}
    for body in tree.bodies:
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = list(range(first, first + count)) if count else []
        shown = [geom for geom in geoms if int(model.geom_group[geom]) < DRAWN]
        touching = [g for g in geoms if g in paired or model.geom_contype[g] or model.geom_conaffinity[g]]
        touching = touching or [g for g in geoms if int(model.geom_group[g]) == COLLISIONS]
        for tag, some in (("visual", shown or geoms), ("collision", touching)):
            for geom in some:
                _add(links[tree.body_name(body)], tag, model, geom, files, boxed)
    if boxed:
        tree.notes.append(f"shapes that a URDF has not are the boxes around them: {listed([*boxed])}")


def _add(
    link: Element,
    tag: str,
    model: mujoco.MjModel,
    geom: int,
    files: Mapping[int, str],
    boxed: dict[str, None],
) -> None:
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    x, y, z = (float(value) for value in model.geom_size[geom])
    place = placement_of(model.geom_pos[geom], model.geom_quat[geom])
    name = str(model.geom(geom).name) or f"geom_{geom}"
    if kind == kinds.mjGEOM_BOX:
        shape = _box(2.0 * x, 2.0 * y, 2.0 * z)
    elif kind == kinds.mjGEOM_SPHERE:
        shape = ElementTree.Element("sphere", radius=repr(x))
    elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        word = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
        shape = ElementTree.Element(word, radius=repr(x), length=repr(2.0 * y))
    elif kind == kinds.mjGEOM_ELLIPSOID:
        shape = _box(2.0 * x, 2.0 * y, 2.0 * z)
        boxed[f"ellipsoid '{name}'"] = None
    elif kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF) and int(model.geom_dataid[geom]) >= 0:
        number = int(model.geom_dataid[geom])
        if file := files.get(number):
            # The compiler has moved the mesh to its centre of mass and principal axes.
            place = place * placement_of(model.mesh_pos[number], model.mesh_quat[number]).inverse()
            shape = ElementTree.Element("mesh", filename=file, scale=text(model.mesh_scale[number]))
        else:
            start, count = int(model.mesh_vertadr[number]), int(model.mesh_vertnum[number])
            vertices = np.array(model.mesh_vert[start : start + count], dtype=np.float64)
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            place = place * pin.SE3(np.eye(3), 0.5 * (low + high))
            shape = _box(*(high - low))
            boxed[f"mesh '{model.mesh(number).name or number}' without a file that has it so"] = None
    else:
        boxed[f"{mujoco.mjtGeom(kind).name.removeprefix('mjGEOM_').lower()} '{name}', left out"] = None
        return
    made = ElementTree.SubElement(link, tag)
    rpy = pin.rpy.matrixToRpy(place.rotation)
    ElementTree.SubElement(made, "origin", xyz=text(place.translation), rpy=text(rpy))
    ElementTree.SubElement(made, "geometry").append(shape)
    if tag == "visual":
        material = int(model.geom_matid[geom])
        colour = np.array(
            model.geom_rgba[geom] if material < 0 else model.mat_rgba[material], dtype=np.float64
        )
        named = ElementTree.SubElement(made, "material", name=f"geom_{geom}")
        ElementTree.SubElement(named, "color", rgba=text(colour))


def _box(x: float, y: float, z: float) -> Element:
    return ElementTree.Element("box", size=text((x, y, z)))
