"""A box as a mesh in the formats of robots."""

from __future__ import annotations

import struct

import numpy as np

CORNERS = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.15, 0.15) for z in (0.0, 0.4)])
FACES = (
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
)
FACES = (*FACES, (1, 5, 7), (1, 7, 3))


def stl(corners: np.ndarray) -> bytes:
    """Return a box as a binary STL whose header begins as that of a text does."""
    facets = (struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in FACES)
    return b"solid".ljust(80) + struct.pack("<I", len(FACES)) + b"".join(facets)


def obj(corners: np.ndarray) -> str:
    vertices = "".join("v {} {} {}\n".format(*corner) for corner in corners)
    return vertices + "".join("f {} {} {}\n".format(*np.add(face, 1)) for face in FACES)


def text_stl(corners: np.ndarray) -> str:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[i]) for i in face)
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid box\n{facets}endsolid box\n"


def dae(corners: np.ndarray, unit: str, up: str = "Z") -> str:
    """Return a box as COLLADA."""
    numbers, places = (
        " ".join(map(repr, corners.ravel().tolist())),
        " ".join(str(i) for face in FACES for i in face),
    )
    source = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset>{unit}<up_axis>{up}_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="s">
    <float_array id="f" count="24">{numbers}</float_array><technique_common><accessor source="#f" count="8" stride="3">
    {source}</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
    <triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{places}</p></triangles></mesh></geometry>
    </library_geometries><library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"/></node>
    </visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""
