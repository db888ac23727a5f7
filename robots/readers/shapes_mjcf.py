"""Shapes of a robot's bodies in a compiled MuJoCo model, as visuals of a URDF: for pictures alone."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

from wbc.robots.readers.tree_mjcf import Tree, placement_of
from wbc.robots.readers.write_urdf import text
from wbc.robots.urdf import Element

DRAWN = 3
"""Groups of geoms below this one are drawn; MuJoCo's viewers hide the others."""


def add_visuals(root: Element, tree: Tree, meshes: Mapping[str, str]) -> None:
    """Add the geoms of a robot to the links of its URDF, which is changed; `meshes` is mesh → file."""
    model = tree.model
    links = {str(link.get("name")): link for link in root.findall("link")}
    for body in tree.bodies:
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = list(range(first, first + count)) if count else []
        shown = [geom for geom in geoms if int(model.geom_group[geom]) < DRAWN]
        for geom in shown or geoms:
            _add(links[tree.body_name(body)], model, geom, meshes)


def _add(link: Element, model: mujoco.MjModel, geom: int, meshes: Mapping[str, str]) -> None:
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    x, y, z = (float(value) for value in model.geom_size[geom])
    place = placement_of(model.geom_pos[geom], model.geom_quat[geom])
    if kind == kinds.mjGEOM_BOX:
        shape = ElementTree.Element("box", size=text((2.0 * x, 2.0 * y, 2.0 * z)))
    elif kind == kinds.mjGEOM_SPHERE:
        shape = ElementTree.Element("sphere", radius=repr(x))
    elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        name = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
        shape = ElementTree.Element(name, radius=repr(x), length=repr(2.0 * y))
    elif kind == kinds.mjGEOM_MESH:
        number = int(model.geom_dataid[geom])
        file = meshes.get(str(model.mesh(number).name))
        if file is None:
            return
        # The compiler has moved the mesh to its centre of mass and principal axes.
        place = place * placement_of(model.mesh_pos[number], model.mesh_quat[number]).inverse()
        shape = ElementTree.Element("mesh", filename=file, scale=text(model.mesh_scale[number]))
    else:
        return
    visual = ElementTree.SubElement(link, "visual")
    rpy = pin.rpy.matrixToRpy(place.rotation)
    ElementTree.SubElement(visual, "origin", xyz=text(place.translation), rpy=text(rpy))
    ElementTree.SubElement(visual, "geometry").append(shape)
    material = int(model.geom_matid[geom])
    colour = np.array(model.geom_rgba[geom] if material < 0 else model.mat_rgba[material], dtype=np.float64)
    named = ElementTree.SubElement(visual, "material", name=f"geom_{geom}")
    ElementTree.SubElement(named, "color", rgba=text(colour))
