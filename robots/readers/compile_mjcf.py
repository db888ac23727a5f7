"""An MJCF as MuJoCo's compiled model: everything else reads defaults, classes and includes wrong."""

from __future__ import annotations

import os
import re
from pathlib import Path

import mujoco
import numpy as np

from wbc.base.errors import InputError, ModelError, shown, shown_path
from wbc.base.files import existing, first_tag, home_path, read_text
from wbc.robots.mesh_files import mesh_defect
from wbc.robots.urdf import MOST_LINKS

OTHER_FORMATS = {
    "": "no XML",
    "robot": "a URDF; use from_urdf",
    "sdf": "an SDF; convert it to an MJCF with sdf2mjcf of sdformat-mjcf, and close its chains with <connect>",
}
"""First tag of a file that is no MJCF → what it is, and what to do."""


def compiled(source: object, *, meshes: bool) -> tuple[mujoco.MjModel, frozenset[str]]:
    """Return MuJoCo's compiled model of an MJCF, and the meshes that are moved against their files (refpos, refquat).

    The source is the path of a file, the XML itself, an `MjSpec` (not changed) or an `MjModel` (returned as it is).
    Without `meshes`, for a file that came without them, every body must give its inertia.
    """
    if isinstance(source, mujoco.MjModel):
        return source, frozenset()
    where, spec = "MJCF string", None
    try:
        if isinstance(source, mujoco.MjSpec):
            where, spec = "MjSpec", source.copy()
        elif isinstance(source, (str, Path)):
            where = "MJCF string" if str(source).lstrip().startswith("<") else shown_path(home_path(source))
            spec = read_spec(source)
        else:
            raise InputError(
                f"an MJCF must be a path, the XML itself, an MjSpec or an MjModel, got {shown(source)}"
            )
        if not meshes:
            _drop_meshes(spec)
        moved = [
            mesh.name
            for mesh in spec.meshes
            if np.any(mesh.refpos) or not np.array_equal(mesh.refquat, [1, 0, 0, 0])
        ]
        if (count := len(spec.bodies)) > MOST_LINKS:
            raise ModelError(f"{where} may have {MOST_LINKS} bodies, got {count}")
        return spec.compile(), frozenset(moved)
    except (ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        said = one_line(error)
        defects = "" if spec is None or not meshes else _defects(spec)
        if defects or (meshes and re.search(r"\.(stl|obj|msh|dae|ply|png)\b", said, re.IGNORECASE)):
            said += f"{defects}; a file whose meshes are elsewhere is read without them: --without-meshes, meshes=False"
        raise ModelError(f"{where}: {said}") from error


def one_line(error: BaseException) -> str:
    """Return MuJoCo's message on one line, without its prefix."""
    line = " ".join(str(error).split()).encode("utf-8", "backslashreplace").decode()
    return re.sub(r"^((XML )?Error: ?|compile: )+", "", line) or type(error).__name__


def read_spec(source: str | Path) -> mujoco.MjSpec:
    """Return the spec of an MJCF, the XML itself or the path of a file with its meshes beside it; MuJoCo's errors pass.

    MuJoCo reads a file with the ending .xml; any other one is given to it as text, and must include no further file.
    """
    content = str(source)
    if content.lstrip().startswith("<"):
        content.encode()  # surrogates, which no XML holds, are a ValueError
        _refuse_other_formats("MJCF string", content)
        return mujoco.MjSpec.from_string(content)
    path = existing(content, "MJCF", "a path, the XML itself, an MjSpec or an MjModel")
    content = read_text(path, "MJCF")
    _refuse_other_formats(shown_path(path), content)
    if path.suffix == ".xml":
        return mujoco.MjSpec.from_file(str(path))
    spec = mujoco.MjSpec.from_string(content)
    spec.modelfiledir = str(path.parent)
    return spec


def _refuse_other_formats(where: str, content: str) -> None:
    """Raise `ModelError` for a URDF, which MuJoCo would read without the feet of `from_urdf`, and for NaN."""
    if (first := first_tag(content)) in OTHER_FORMATS:
        raise ModelError(f"{where} is {OTHER_FORMATS[first]}")
    content = re.sub(r"<!--.*?-->", lambda note: "\n" * note.group().count("\n"), content, flags=re.DOTALL)
    wrong = re.search(r"<(\w+)[^<>]*?\s(\w+)\s*=\s*\"[^\"]*\b[Nn][Aa][Nn]\b[^\"]*\"", content)
    if wrong and wrong.group(2) not in ("name", "class", "childclass", "file"):
        line = content.count("\n", 0, wrong.start()) + 1
        raise ModelError(f"{where}: {wrong.group(2)} of the <{wrong.group(1)}> in line {line} is NaN")


def _defects(spec: mujoco.MjSpec) -> str:
    """Return the defects of the files of meshes and pictures of a spec, each after a semicolon."""
    folder, found = Path(spec.modelfiledir or "."), dict[str, None]()
    named = [(spec.meshdir, each.file) for each in spec.meshes]
    named += [(spec.texturedir, each.file) for each in spec.textures]
    for place in (folder / part / name for part, name in named if name):
        if os.path.isfile(place) and (defect := mesh_defect(place)):
            found[f"; {place.name} {defect}"] = None
    return "".join(found)


def _drop_meshes(spec: mujoco.MjSpec) -> None:
    for body in spec.bodies[1:]:
        shaped = [geom for geom in body.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
        if not shaped:
            continue
        if not body.explicitinertial:
            raise ModelError(
                f"body '{body.name}' has its inertia from meshes: without them its mass would be lost"
            )
        for geom in shaped:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in [each for each in spec.textures if each.file]:
        spec.delete(texture)
