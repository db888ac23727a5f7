"""Files of motions: one reader for each format of the field, all to `MotionClip`; no pickle is ever opened.

| format | container | columns |
|---|---|---|
| `wbc` | .npz of `write_motion` | joint_names, rate, base (x, y, z, qx, qy, qz, qw), joints, optional standing |
| `csv` | .csv with a header | optional time; x, y, z, qx, qy, qz, qw; joints by name |
| `unitree` | .csv without header | x, y, z, qx, qy, qz, qw; joints in an order that the caller names |
| `beyondmimic` | .npz | fps, joint_pos (T, n) or (T, 7 + n) with joint_names, body_pos_w, body_quat_w (w, x, y, z) |
| `gmr` | .npz | fps, root_pos, root_rot (x, y, z, w), dof_pos |

Rates and joint orders that a file does not hold are arguments: neither is guessed from a shape.
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, positive, shown
from wbc.core.files import csv_rows, decoding, read_text, replacing
from wbc.core.registry import Registry
from wbc.motion.clip import MotionClip

BASE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")

LARGEST = 500_000_000
"""Largest file that is read, bytes."""


@checked
def write_motion(clip: MotionClip, path: str | Path) -> None:
    """Write a clip as .npz of the library's own format, or as .csv with a header.

    Args:
        clip: The clip.
        path: File to write, by its ending; one that is there is replaced when the new one is whole.

    Raises:
        InputError: Another ending.
        FileError: The file cannot be written.
    """
    path = Path(path)
    if path.suffix not in (".npz", ".csv"):
        raise InputError(f"the name of a motion must end in .npz or .csv, got '{path}'")
    with replacing(path) as new:
        if path.suffix == ".npz":
            columns: dict[str, Any] = {"rate": clip.rate, "base": clip.base, "joints": clip.joints}
            if clip.standing is not None:
                columns["standing"] = clip.standing
            np.savez_compressed(new, joint_names=np.array(clip.joint_names), **columns)
            return
        with new.open("w", newline="", encoding="utf-8") as text:
            writer = csv.writer(text)
            writer.writerow(["time", *BASE_COLUMNS, *clip.joint_names])
            for time, base, joints in zip(clip.times, clip.base, clip.joints, strict=True):
                writer.writerow([f"{value:.9g}" for value in (time, *base, *joints)])


@checked
def read_motion(
    path: str | Path,
    *,
    rate: float | None = None,
    joints: Sequence[str] | None = None,
    kind: str = "auto",
) -> MotionClip:
    """Read a clip.

    Args:
        path: The file.
        rate: Frames per second, Hz, of a file that does not say it.
        joints: Joint names of the columns, of a file that does not say them.
        kind: Format, one of `MOTION_FORMATS`; "auto" knows it by the ending, the header and the names of the arrays.

    Returns:
        The clip.

    Raises:
        UnknownNameError: No such format.
        InputError: A file that cannot be read or is not of that format, a rate or joint names that are missing or
            contradict the file.
    """
    path = Path(path)
    if rate is not None:
        positive("rate of a motion (Hz)", rate)
    if kind != "auto":
        MOTION_FORMATS[kind]  # noqa: B018 - refuses a name that is not known, before the file is opened
    if path.suffix not in (".npz", ".csv"):
        more = (
            "; convert it outside: a pickle runs any code that it holds"
            if path.suffix in (".pkl", ".pickle")
            else ""
        )
        raise InputError(f"the name of a motion must end in .npz or .csv, got '{path}'{more}")
    data = _arrays(path) if path.suffix == ".npz" else _columns(path)
    if kind == "auto":
        kind = _kind_of(path, data)
    try:
        return MOTION_FORMATS[kind](data, path.stem, rate, None if joints is None else tuple(joints))
    except KeyError as missing:
        raise InputError(f"{path} is not a motion of the format '{kind}': it has no {missing}") from missing
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of an .npz without opening a pickle."""
    with decoding(path, "motion of plain arrays", largest=LARGEST) as place:
        with zipfile.ZipFile(place) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > 4 * LARGEST:
            raise InputError(f"a motion must unpack to at most {4 * LARGEST} bytes, got {unpacked} in {path}")
        with np.load(place, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}


def _columns(path: Path) -> dict[str, Any]:
    """Return header and numbers of a .csv."""
    rows = csv_rows(read_text(path, "CSV"), path)
    if not rows:
        raise InputError(f"{path} is empty")
    header: list[str] | None = None
    try:
        [float(cell) for cell in rows[0]]
    except ValueError:
        header = [cell.strip() for cell in rows.pop(0)]
    width = len(header) if header else len(rows[0]) if rows else 0
    values = np.empty((len(rows), width))
    for i, row in enumerate(rows):
        if len(row) != width:
            raise InputError(
                f"{path}: every line must have {width} cells, got {len(row)} in line {i + 1 + bool(header)}"
            )
        try:
            values[i] = [float(cell) for cell in row]
        except ValueError as error:
            raise InputError(f"{path}: line {i + 1 + bool(header)}: {error}") from error
    return {"header": header, "values": values}


def _kind_of(path: Path, data: Mapping[str, Any]) -> str:
    if path.suffix == ".csv":
        return "csv" if data["header"] else "unitree"
    for kind, needed in (("wbc", "base"), ("beyondmimic", "joint_pos"), ("gmr", "dof_pos")):
        if needed in data:
            return kind
    raise InputError(
        f"{path} is of no known format: it has {', '.join(sorted(data)[:6]) or 'nothing'}; formats: "
        f"{', '.join(MOTION_FORMATS)}"
    )


def _first(what: str, values: Any) -> float:
    """Return a number that files hold alone or as an array of one."""
    array = np.ravel(values)
    if array.size != 1 or array.dtype.kind not in "iuf":
        raise InputError(f"{what} must be one number, got {shown(array.tolist())}")
    return positive(f"{what} (Hz)", float(array[0]))


def _one_rate(own: float | None, given: float | None, source: str) -> float:
    if own is None and given is None:
        raise InputError(f"the {source} does not say its rate: give it (rate, Hz)")
    if own is not None and given is not None and abs(own - given) > 1e-3 * own:
        raise InputError(f"rate must be that of the file, {own:g} Hz, got {given:g} Hz")
    return float(own if own is not None else given)  # type: ignore[arg-type]


def _names(own: Any, given: tuple[str, ...] | None, count: int, source: str) -> tuple[str, ...]:
    if own is None and given is None:
        raise InputError(f"the {source} does not name its {count} joints: give their order (joints)")
    names = tuple(str(name) for name in np.ravel(own)) if own is not None else given
    assert names is not None
    if given is not None and own is not None and names != given:
        raise InputError("joints must be those of the file, which names its own")
    if len(names) != count:
        raise InputError(f"joints must be {count} names, one for each column, got {len(names)}")
    return names


def _table(data: Mapping[str, Any], key: str, shape: tuple[str | int, ...]) -> Array:
    """Return an array of a file after a check of its shape; a text in the shape stands for any size.

    Raises:
        InputError: Another shape.
        KeyError: The file has no such array.
    """
    array = np.asarray(data[key])
    if array.ndim != len(shape) or any(
        isinstance(size, int) and size != got for size, got in zip(shape, array.shape, strict=True)
    ):
        raise InputError(f"{key} must have shape ({', '.join(map(str, shape))}), got {array.shape}")
    return array


def _base(position: Array, quaternion: Array, keys: str) -> Array:
    """Return the columns of the base, of a position and a quaternion (x, y, z, w) in each frame, as many of each."""
    if len(position) != len(quaternion):
        raise InputError(f"{keys} must have as many frames, got {len(position)} and {len(quaternion)}")
    return np.hstack([position, quaternion])


Names = tuple[str, ...] | None


def _wbc(data: Mapping[str, Any], name: str, rate: float | None, joints: Names) -> MotionClip:
    own = _one_rate(_first("rate", data["rate"]), rate, "file")
    columns = _table(data, "joints", ("T", "n"))
    names = _names(data["joint_names"], joints, columns.shape[1], "file")
    return MotionClip(names, own, data["base"], columns, name, data.get("standing"))


def _csv(data: Mapping[str, Any], name: str, rate: float | None, joints: Names) -> MotionClip:
    header, values = data["header"], data["values"]
    if header is None:
        raise InputError("a file of the format 'csv' has a header; without one it is 'unitree'")
    for column in BASE_COLUMNS:
        if column not in header:
            raise InputError(f"the header must have a column '{column}', got {', '.join(header[:8])}")
    own = None
    if "time" in header and len(values) > 1:
        steps = np.diff(values[:, header.index("time")])
        if not (steps > 0.0).all():
            raise InputError(
                f"times must increase, got a step of {steps.min():g} s in line {int(np.argmin(steps)) + 3}"
            )
        own = 1.0 / float(np.median(steps))
        if (abs(steps * own - 1.0) > 0.01).any():
            raise InputError("times must be evenly spaced, to 1 %")
    rest = [i for i, column in enumerate(header) if column not in (*BASE_COLUMNS, "time")]
    base = values[:, [header.index(column) for column in BASE_COLUMNS]]
    names = _names([header[i] for i in rest], joints, len(rest), "file")
    return MotionClip(names, _one_rate(own, rate, "file"), base, values[:, rest], name)


def _unitree(data: Mapping[str, Any], name: str, rate: float | None, joints: Names) -> MotionClip:
    values = data["values"]
    if data["header"] is not None:
        raise InputError("a file of the format 'unitree' has no header; with one it is 'csv'")
    if values.shape[1] < 8:
        raise InputError(f"a line must have 7 numbers of the base and the joints', got {values.shape[1]}")
    names = _names(None, joints, values.shape[1] - 7, "file")
    return MotionClip(names, _one_rate(None, rate, "file"), values[:, :7], values[:, 7:], name)


def _beyondmimic(data: Mapping[str, Any], name: str, rate: float | None, joints: Names) -> MotionClip:
    own = _one_rate(_first("fps", data["fps"]), rate, "file")
    columns, named = _table(data, "joint_pos", ("T", "n")), data.get("joint_names")
    if named is not None and columns.shape[1] == np.size(named) + 7:  # positions of MuJoCo, base first
        order = [*range(3), 4, 5, 6, 3]
        return MotionClip(
            _names(named, joints, np.size(named), "file"), own, columns[:, order], columns[:, 7:], name
        )
    bodies = [str(body) for body in np.ravel(data["body_names"])] if "body_names" in data else []
    root = 1 if bodies[:1] == ["world"] else 0
    position = _table(data, "body_pos_w", ("T", "bodies", 3))
    quaternion = _table(data, "body_quat_w", ("T", position.shape[1], 4))
    if position.shape[1] <= root:
        raise InputError(f"body_pos_w must have the root of the robot, got {position.shape[1]} bodies")
    base = _base(position[:, root], quaternion[:, root][:, [1, 2, 3, 0]], "body_pos_w and body_quat_w")
    return MotionClip(_names(named, joints, columns.shape[1], "file"), own, base, columns, name)


def _gmr(data: Mapping[str, Any], name: str, rate: float | None, joints: Names) -> MotionClip:
    position, quaternion = _table(data, "root_pos", ("T", 3)), _table(data, "root_rot", ("T", 4))
    base, columns = _base(position, quaternion, "root_pos and root_rot"), _table(data, "dof_pos", ("T", "n"))
    own = _one_rate(_first("fps", data["fps"]) if "fps" in data else None, rate, "file")
    return MotionClip(_names(None, joints, columns.shape[1], "file"), own, base, columns, name)


Reader = Callable[[Mapping[str, Array], str, float | None, Names], MotionClip]

MOTION_FORMATS: Registry[Reader] = Registry(
    "motion format",
    {"wbc": _wbc, "csv": _csv, "unitree": _unitree, "beyondmimic": _beyondmimic, "gmr": _gmr},
)
"""Format → reader of its data."""
