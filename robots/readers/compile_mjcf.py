"""An MJCF as MuJoCo's compiled model: everything else reads defaults, classes and includes wrong."""

from __future__ import annotations

import codecs
import contextlib
import html
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np

from wbc.base.errors import InputError, ModelError, shown, shown_path
from wbc.base.files import decoding, existing, first_tag, read_xml
from wbc.robots.mesh_files import mesh_defect
from wbc.robots.urdf import MOST_LINKS

MOST_FOLDERS = 100
"""Most folders of meshes, pictures and included files that an MJCF may name."""

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
            where, read = _source(source)
            spec = read()
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
        if re.search("(no|not find) decoder", said):
            said += (
                "; files must end as MuJoCo knows them: attached models in .xml, meshes in .obj, .stl or .msh"
            )
        elif defects or (meshes and re.search(r"\.(stl|obj|msh|dae|ply|png)\b", said, re.IGNORECASE)):
            said += f"{defects}; a file whose meshes are elsewhere is read without them: --without-meshes, meshes=False"
        raise ModelError(f"{where}: {said}") from error


def one_line(error: BaseException) -> str:
    """Return MuJoCo's message on one line, without its prefix."""
    line = " ".join(str(error).split()).encode("utf-8", "backslashreplace").decode()
    return re.sub(r"^((XML )?Error: ?|compile: )+", "", line) or type(error).__name__


def _source(source: str | Path) -> tuple[str, Callable[[], mujoco.MjSpec]]:
    """Return the name of a source for messages, and a function that reads it."""
    content = str(source)
    if content.lstrip().startswith("<"):
        content.encode()  # surrogates, which no XML holds, are a ValueError
        _refuse_other_formats("MJCF string", content)
        _refuse_pipes(Path(), content)
        return "MJCF string", lambda: mujoco.MjSpec.from_string(content)
    path = existing(content, "MJCF", "a path, the XML itself, an MjSpec or an MjModel")
    where = shown_path(path)
    _refuse_pipes(path.parent, read_xml(path, "MJCF"))
    texts = _texts(path)
    _refuse_other_formats(where, texts[path.name])
    return where, lambda: _spec_of(path, texts)


def read_spec(source: str | Path) -> mujoco.MjSpec:
    """Return the spec of an MJCF: the XML itself, or a file of any ending and encoding, with its meshes beside it."""
    return _source(source)[1]()


def _spec_of(path: Path, texts: Mapping[str, str]) -> mujoco.MjSpec:
    """Return the spec of a file, given its text and those of what it includes.

    MuJoCo knows UTF-8 and the ending .xml alone; what is written otherwise it gets as text.
    """
    plain = (
        (path.parent / name).read_bytes().removeprefix(codecs.BOM_UTF8) == text.encode()
        for name, text in texts.items()
    )
    if path.suffix == ".xml" and all(plain):
        return mujoco.MjSpec.from_file(str(path))
    own, *others = texts
    spec = mujoco.MjSpec.from_string(texts[own], include={name: texts[name].encode() for name in others})
    spec.modelfiledir = str(path.parent)
    return spec


def _refuse_pipes(folder: Path, text: str) -> None:
    """Raise an `InputError` for a pipe or a device among the files that an MJCF names: MuJoCo would wait for its end.

    Files of models that it includes or attaches are looked at as well; `folder` is that of the MJCF. Any name may be
    in any of the folders that the files name.
    """
    folders, names, read = {folder}, dict[str, None](), set[Path]()
    waiting = [text]
    while waiting:
        for content in waiting:
            named = re.findall(r"(?:mesh|texture|asset)dir\s*=\s*(?:\"([^\"]*)\"|'([^']*)')", content)
            folders |= {folder / html.unescape(one or other) for one, other in named}
            for one, other in re.findall(r"file\w*\s*=\s*(?:\"([^\"]+)\"|'([^']+)')", content):
                name = html.unescape(one or other)
                names |= {name: None, Path(name).name: None}  # strippath
        if len(folders) > MOST_FOLDERS:
            raise InputError(f"an MJCF may name {MOST_FOLDERS} folders of files at most, got {len(folders)}")
        waiting = []
        for place in {each / name for each in folders for name in names} - read:
            read.add(place)
            if not os.path.exists(place):  # false for a name that is too long, too
                continue
            with decoding(place, "file of an MJCF"):
                begin = place.open("rb").read(64)
            if b"<" in begin:  # a model, or what is included
                folders.add(place.parent)
                with contextlib.suppress(InputError):  # MuJoCo reads, or refuses, what is included
                    waiting.append(read_xml(place, "MJCF"))


def _texts(path: Path) -> dict[str, str]:
    """Return the text of a file and of what it includes, by names relative to its folder, the file itself first."""
    texts: dict[str, str] = {}
    waiting = [path.name]
    for name in waiting:
        if name in texts or not os.path.isfile(path.parent / name):
            continue
        try:
            texts[name] = read_xml(path.parent / name, "MJCF")
        except InputError:
            if not texts:
                raise
            continue  # MuJoCo reads, or refuses, what is included
        waiting += re.findall(r"<include\s[^>]*?file\s*=\s*[\"']([^\"']+)", texts[name])
    return texts


def _refuse_other_formats(where: str, content: str) -> None:
    """Raise `ModelError` for a URDF, which MuJoCo would read without the feet of `from_urdf`, NaN and many bodies."""
    if (first := first_tag(content)) in OTHER_FORMATS:
        raise ModelError(f"{where} is {OTHER_FORMATS[first]}")
    content = re.sub(r"<!--.*?-->", lambda note: "\n" * note.group().count("\n"), content, flags=re.DOTALL)
    count = content.count("<body") + sum(
        map(int, re.findall(r"<replicate\b[^<>]*\bcount\s*=\s*[\"'](\d+)", content))
    )
    if count > MOST_LINKS:
        raise ModelError(f"{where} may have {MOST_LINKS} bodies, got {count}")
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
