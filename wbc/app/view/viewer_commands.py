"""Commands of MeshCat's viewer: objects, transforms and properties, packed as MessagePack."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import umsgpack  # type: ignore[import-untyped]  # comes with meshcat
from meshcat import geometry

from wbc.app.scene.colours import SKY_COLOURS
from wbc.app.scene.shapes import ROOT, Colour, MeshFile, SceneObject, Shape, Surface
from wbc.core.errors import Array


def empty_scene() -> list[bytes]:
    """Return the commands that remove all objects of a former scene and set the background."""
    commands = [_packed(type="delete", path=ROOT), property_command("/Grid", "visible", False)]
    return commands + [property_command("/Background", key, list(c)) for key, c in SKY_COLOURS.items()]


def object_commands(thing: SceneObject) -> Iterator[bytes]:
    """Yield the commands that create an object."""
    matrix = thing.placement
    if isinstance(thing.shape, MeshFile):
        matrix = matrix @ np.diag([*thing.shape.scale, 1.0])
    lowered = geometry.Mesh(_geometry(thing.shape), _material(thing)).lower()
    for made in lowered["geometries"]:  # the viewer's present name of the package's "_meshfile"
        made["type"] = made["type"].replace("_meshfile", "_meshfile_geometry")
    yield transform_command(f"{thing.path}/0", matrix.T.ravel())
    yield _packed(type="set_object", path=f"{thing.path}/0", object=lowered)


def transform_command(path: str, columns: Array) -> bytes:
    """Return the command that moves a path to a homogeneous matrix by columns, shape (16,)."""
    return transform_head(path) + transform_tail(columns)


def property_command(path: str, name: str, value: Any) -> bytes:
    """Return the command that sets a property of a path."""
    return _packed(type="set_property", path=path, property=name, value=value)


def transform_head(path: str) -> bytes:
    """Return the part of a transform command that is the same for every matrix."""
    return _packed(type="set_transform", path=path, matrix=[])[:-1]  # less the empty list


def transform_tail(columns: Array) -> bytes:
    """Return the matrix of a transform command: a list of 16 doubles in MessagePack."""
    values = np.empty(16, [("tag", "u1"), ("value", ">f8")])
    values["tag"], values["value"] = 0xCB, columns
    return struct.pack(">BH", 0xDC, 16) + values.tobytes()


def _packed(**command: Any) -> bytes:
    packed: bytes = umsgpack.packb(command)
    return packed


def _geometry(shape: Shape) -> Any:
    """Return MeshCat's geometry of a shape."""
    if isinstance(shape, Surface):
        colours = None if shape.colours is None else shape.colours.astype(np.float32)
        return geometry.TriangularMeshGeometry(shape.vertices.astype(np.float32), shape.faces, colours)
    kinds = {
        ".stl": geometry.StlMeshGeometry,
        ".obj": geometry.ObjMeshGeometry,
        ".dae": geometry.DaeMeshGeometry,
    }
    return kinds[os.path.splitext(shape.path)[1].lower()].from_file(shape.path)


def _material(thing: SceneObject) -> Any:
    options: dict[str, Any] = {"color": _colour_number(thing.colour), "opacity": thing.colour[3]}
    if isinstance(thing.shape, Surface) and thing.shape.colours is not None:
        options["vertexColors"] = True
    if thing.on_top:  # drawn last and not hidden by anything
        options |= {"transparent": True, "depthTest": False}
    return (geometry.MeshLambertMaterial if thing.shaded else geometry.MeshBasicMaterial)(**options)


def _colour_number(colour: Colour) -> int:
    red, green, blue = (round(255 * value) for value in colour[:3])
    return (red << 16) + (green << 8) + blue
