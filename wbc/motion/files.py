"""Files of motions: what the field writes, all to `MotionClip` or `SkeletonClip`; docs/motion.md lists the formats.

No pickle is ever opened. Rates and joint orders that a file does not hold are arguments: neither is guessed from a
shape.
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.files import decoding, parsing, read_text, replacing
from wbc.base.numbers import Array
from wbc.base.settings import Positive
from wbc.motion.bvh import read_bvh
from wbc.motion.clip import BASE_COLUMNS, MotionClip
from wbc.motion.skeleton import SkeletonClip

Axis = Literal["x", "y", "z"]

LARGEST = 500_000_000
"""Largest file that is read, bytes; one of arrays unpacks to four times as many at most."""


@checked
def write_motion(clip: MotionClip, path: str | Path) -> None:
    """Write a clip as .npz in the library's own format, or as .csv with a header.

    Args:
        clip: The clip.
        path: File to write, with the ending of its format. An existing file is replaced once the new one is complete.

    Raises:
        FileError: The file cannot be written.
    """
    path = _known(Path(path))
    with replacing(path) as new:
        if path.suffix == ".npz":
            columns: dict[str, Any] = {"rate": clip.rate, "base": clip.base, "joints": clip.joints}
            if clip.standing is not None:
                columns["standing"] = clip.standing
            np.savez_compressed(new, joint_names=np.array(clip.joint_names), **columns)
            return
        table = np.column_stack([clip.times, clip.base, clip.joints])
        with new.open("w", newline="", encoding="utf-8") as text:
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow(["time", *BASE_COLUMNS, *clip.joint_names])
            rows.writerows([f"{value:.9g}" for value in row] for row in table.tolist())


@checked
def read_motion(
    path: str | Path, *, rate: Annotated[Positive, "Hz"] | None = None, joints: Sequence[str] | None = None
) -> MotionClip:
    """Read a clip from a file; its ending, its header and the names of its arrays tell the format.

    The formats are .npz and .csv of `write_motion`, .csv of Unitree (without a header), and .npz of BeyondMimic and
    GMR.

    Args:
        path: The file.
        rate: Frames per second, Hz, for a file that does not contain it.
        joints: Joint names of the columns, for a file that does not contain them.
    """
    path = _known(Path(path))
    with parsing(path, "motion"):
        data = _arrays(path) if path.suffix == ".npz" else _columns(path)
        try:
            base, positions = _placed(data)
            fps, names = data.get("rate", data.get("fps")), data.get("joint_names")
            return MotionClip(
                _agreed("joint names (joints)", None if names is None else _texts(names), joints),
                _agreed("rate (rate, Hz)", None if fps is None else float(np.asarray(fps).item()), rate),
                base,
                positions,
                path.stem,
                data.get("standing"),
            )
        except KeyError as missing:
            raise InputError(f"{path} has no {missing}") from missing
        except InputError as error:
            raise InputError(f"{path}: {error}") from error


@checked
def read_skeleton(
    path: str | Path, *, rate: Annotated[Positive, "Hz"] | None = None, up: Axis | None = None
) -> SkeletonClip:
    """Read a clip of a person from a file, in any unit of length.

    Args:
        path: A .bvh file, as LAFAN1 and CMU publish them; or an .npz file with `joint_names` (n), `positions`
            (T, n, 3), and `rate` or `fps`, Hz.
        rate: Frames per second, Hz, for a file that does not contain it.
        up: Axis of the file that points up; y of a .bvh file and z of an .npz file when None.
    """
    path = Path(path)
    if path.suffix not in (".bvh", ".npz"):
        raise InputError(f"the name of a clip of a person must end in .bvh or .npz, got '{path}'")
    with parsing(path, "clip of a person"):
        try:
            if path.suffix == ".bvh":
                names, positions, own = read_bvh(path)
                own_rate: float | None = own
            else:
                data = _arrays(path)
                fps, names, positions = (
                    data.get("rate", data.get("fps")),
                    _texts(data["joint_names"]),
                    data["positions"],
                )
                own_rate = None if fps is None else float(np.asarray(fps).item())
            turn = 2 - "xyz".index(up or ("y" if path.suffix == ".bvh" else "z"))
            return SkeletonClip(
                names,
                _agreed("rate (rate, Hz)", own_rate, rate),
                np.roll(np.asarray(positions), turn, axis=-1),
                path.stem,
            )
        except KeyError as missing:
            raise InputError(f"{path} has no {missing}") from missing
        except InputError as error:
            raise InputError(f"{path}: {error}") from error


def shows_person(path: Path) -> bool:
    """Return True for a file that `read_skeleton` reads, by its ending and the names of its arrays."""
    if path.suffix != ".npz":
        return path.suffix == ".bvh"
    with (
        decoding(path, "motion of plain arrays", largest=LARGEST) as place,
        zipfile.ZipFile(place) as archive,
    ):
        return "positions.npy" in archive.namelist()


def _known(path: Path) -> Path:
    """Return the path of a file whose ending is that of a motion."""
    if path.suffix not in (".npz", ".csv"):
        raise InputError(
            f"the name of a motion must end in .npz or .csv, got '{path}'; convert others outside: a pickle runs any "
            "code that it holds"
        )
    return path


def _arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of an .npz without opening a pickle."""
    with decoding(path, "motion of plain arrays", largest=LARGEST) as place:
        with zipfile.ZipFile(place) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > 4 * LARGEST:
            raise InputError(f"a motion must unpack to at most {4 * LARGEST} bytes, got {unpacked} in {path}")
        with np.load(place, allow_pickle=False) as file:
            return dict(file)


def _columns(path: Path) -> dict[str, Any]:
    """Return the columns of a .csv under the names of `write_motion`; one without a header names no joints."""
    lines = [line for line in read_text(path, "motion").splitlines() if line.strip()]
    header = [cell.strip() for cell in next(csv.reader(lines[:1]), [])]
    named = any(column in header for column in BASE_COLUMNS)
    if len(lines) <= named:
        raise InputError(f"{path} has no frames")
    values = np.loadtxt(lines[named:], delimiter=",", comments=None, quotechar='"', ndmin=2)
    if not named:
        return {"base": values[:, :7], "joints": values[:, 7:]}
    if missing := set(BASE_COLUMNS) - set(header):
        raise InputError(f"{path} has no column '{min(missing)}'")
    rest = [i for i, column in enumerate(header) if column not in (*BASE_COLUMNS, "time")]
    data = {"base": values[:, [header.index(c) for c in BASE_COLUMNS]], "joints": values[:, rest]}
    if "time" in header and len(values) > 1:
        steps = np.diff(values[:, header.index("time")])
        step = float(np.median(steps))
        if not (steps > 0.0).all() or (abs(steps - step) > 0.01 * step).any():
            raise InputError(
                f"{path}: times must increase evenly, to 1 %, got steps of {steps.min():g} to {steps.max():g} s"
            )
        data["rate"] = np.array(1.0 / step)
    return data | {"joint_names": np.array([header[i] for i in rest])}


def _placed(data: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return base and joints of arrays, or of columns, by their names."""
    if "base" in data:
        return data["base"], data["joints"]
    if "dof_pos" in data:
        return np.hstack([data["root_pos"], data["root_rot"]]), data["dof_pos"]
    if "joint_pos" not in data:
        known = "; the arrays of a motion are named base, joint_pos or dof_pos"
        raise InputError(f"of no known format: it has {', '.join(sorted(data)[:6]) or 'nothing'}{known}")
    joints = data["joint_pos"]
    if (
        "joint_names" in data and joints.shape[1] == data["joint_names"].size + 7
    ):  # positions of MuJoCo, base first
        return joints[:, [0, 1, 2, 4, 5, 6, 3]], joints[:, 7:]
    root = 1 if _texts(data.get("body_names", ()))[:1] == ("world",) else 0
    position, quaternion = data["body_pos_w"][:, root], data["body_quat_w"][:, root]
    return np.hstack([position, quaternion[:, [1, 2, 3, 0]]]), joints


def _texts(names: Any) -> tuple[str, ...]:
    return tuple(str(name) for name in np.ravel(names))


def _agreed(what: str, own: Any, given: Any) -> Any:
    """Return what a file says, or else the caller; they must not contradict each other."""
    if own is None and given is None:
        raise InputError(f"the file does not say its {what}: give them")
    if own is None or given is None:
        return given if own is None else own
    if not (np.allclose(own, given, rtol=1e-3) if isinstance(own, float) else own == tuple(given)):
        raise InputError(f"the file says another {what}: {own}, not {given}")
    return own
