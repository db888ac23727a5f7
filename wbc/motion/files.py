"""Files of motions: what the field writes, all to `MotionClip` or `SkeletonClip`; docs/motion.md lists the formats.

No pickle is ever opened. Rates and joint orders that a file does not hold are arguments: neither is guessed from a
shape. A shape alone tells `joint_pos` of MuJoCo, which begins with the seven numbers of the base.
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.files import decoding, naming, read_text, replacing
from wbc.base.numbers import Array, finite_scalar
from wbc.base.settings import Positive
from wbc.motion.bvh import read_bvh
from wbc.motion.clip import BASE_COLUMNS, MotionClip
from wbc.motion.skeleton import SkeletonClip

Axis = Literal["x", "y", "z"]
Said = TypeVar("Said", float, tuple[str, ...])
AnyArray = NDArray[Any]
Arrays = Mapping[str, AnyArray | None]
"""Arrays of a file by their names; None for those that stay closed."""

LARGEST = 500_000_000
"""Largest file that is read, bytes."""

USED = frozenset(
    ("rate", "fps", "joint_names", "body_names", "standing", "base", "joints", "positions")
    + ("root_pos", "root_rot", "dof_pos", "joint_pos", "body_pos_w", "body_quat_w")
)
"""Arrays that are read; others, which may be pickles, stay closed."""

STANDING = ("left_stands", "right_stands")
"""Columns with 1 where a sole stands, and 0 elsewhere, of a clip that knows it."""

HEADER = f"{', '.join(BASE_COLUMNS)} and the names of the joints"
"""Columns that a header names."""


@checked
def write_motion(clip: MotionClip, path: str | Path) -> None:
    """Write a clip as .npz in the library's own format, or as .csv with a header.

    Args:
        clip: The clip.
        path: File to write, with the ending of its format. An existing file is replaced once the new one is complete.

    Raises:
        FileError: The file cannot be written.
        InputError: A name of a joint is that of another column, or is not printable.
    """
    path = _known(Path(path))
    for name in clip.joint_names:
        if name in ("time", *BASE_COLUMNS, *STANDING) or name != name.strip() or not name.isprintable():
            raise InputError(f"a joint of a motion that is written cannot be called {shown(name)}")
    with replacing(path) as new:
        if path.suffix.lower() == ".npz":
            columns: dict[str, Any] = {"rate": clip.rate, "base": clip.base, "joints": clip.joints}
            if clip.standing is not None:
                columns["standing"] = clip.standing
            with new.open("wb") as packed:
                np.savez_compressed(packed, joint_names=np.array(clip.joint_names), **columns)
            return
        known = np.zeros((len(clip), 0)) if clip.standing is None else clip.standing
        table = np.column_stack([clip.times, clip.base, clip.joints, known])
        with new.open("w", newline="", encoding="utf-8") as text:
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow(["time", *BASE_COLUMNS, *clip.joint_names, *STANDING[: known.shape[1]]])
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
    with naming(path, "motion"):
        data = _arrays(path) if path.suffix.lower() == ".npz" else _columns(path)
        base, positions = _placed(data)
        names = data.get("joint_names")
        return MotionClip(
            _agreed(
                "joint names (joints)",
                None if names is None else _texts(names),
                None if joints is None else tuple(joints),
            ),
            _agreed("rate (rate, Hz)", _rate(data), rate),
            base,
            positions,
            path.stem,
            data.get("standing"),
        )


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
    kind = path.suffix.lower()
    if kind not in (".bvh", ".npz"):
        raise InputError(f"the name of a clip of a person must end in .bvh or .npz, got '{path}'")
    with naming(path, "clip of a person"):
        own_rate: float | None
        if kind == ".bvh":
            names, positions, own_rate = read_bvh(path)
        else:
            data = _arrays(path)
            texts, positions = _need(data, "a clip of a person", joint_names="", positions="T n 3")
            names, own_rate = _texts(texts), _rate(data)
        turn = 2 - "xyz".index(up or ("y" if kind == ".bvh" else "z"))
        rate = _agreed("rate (rate, Hz)", own_rate, rate)
        return SkeletonClip(names, rate, np.roll(positions, turn, axis=-1), path.stem)


def shows_person(path: Path) -> bool:
    """Return True for a file that `read_skeleton` reads, by its ending and the names of its arrays."""
    if path.suffix.lower() != ".npz":
        return path.suffix.lower() == ".bvh"
    with (
        decoding(path, "motion of plain arrays", largest=LARGEST) as place,
        zipfile.ZipFile(place) as archive,
    ):
        return "positions.npy" in archive.namelist()


def _known(path: Path) -> Path:
    """Return the path of a file whose ending is that of a motion."""
    if path.suffix.lower() not in (".npz", ".csv"):
        raise InputError(
            f"the name of a motion must end in .npz or .csv, got '{path}'; convert others outside: a pickle runs any "
            "code that it holds"
        )
    return path


def _arrays(path: Path) -> dict[str, AnyArray | None]:
    """Return the arrays of an .npz without opening a pickle; of arrays that are not used, None by their names."""
    with (
        decoding(path, "motion of plain arrays", largest=LARGEST) as place,
        np.load(place, allow_pickle=False) as file,
    ):
        return {name: file[name] if name in USED else None for name in file.files}


def _need(data: Arrays, what: str, **shapes: str) -> list[AnyArray]:
    """Return arrays whose sides are numbers, or letters with one length in all of them, such as "T 3"; "" is any.

    Raises:
        InputError: One is missing, with what the file has and what it must have; or one has another shape.
    """
    if missing := [name for name in shapes if data.get(name) is None]:
        raise InputError(
            f"it has no {', '.join(missing)}, but {_found(data)}; {what} needs {', '.join(shapes)}"
        )
    arrays, sides = [], dict[str, int]()
    for name, shape in shapes.items():
        arrays.append(array := np.asarray(data[name]))
        wanted = shape.split()
        for side, size in zip(wanted, array.shape, strict=False):
            sides.setdefault(side, int(side) if side.isdigit() else size)
        if wanted and array.shape != tuple(sides.get(side) for side in wanted):
            expected = ", ".join(str(sides.get(side, side)) for side in wanted)
            raise InputError(f"{name} of {what} must have shape ({expected}), got {array.shape}")
    return arrays


def _found(data: Arrays) -> str:
    """Return the names of the first arrays of a file for messages."""
    return ", ".join(map(shown, sorted(data)[:12])) or "nothing"


def _rate(data: Arrays) -> float | None:
    """Return the frames per second of a file, Hz; None where it does not say them."""
    rate = data.get("rate", data.get("fps"))
    if rate is not None and np.size(rate) != 1:
        raise InputError(f"rate (fps) must be one number, Hz, got {shown(rate)}")
    return None if rate is None else finite_scalar("rate (fps), Hz,", np.asarray(rate).item())


def _columns(path: Path) -> dict[str, AnyArray | None]:
    """Return the columns of a .csv under the names of `write_motion`; one without a header names no joints."""
    lines = [line for line in read_text(path, "motion").splitlines() if line.strip()]
    header = [cell.strip() for cell in next(csv.reader(lines[:1]), [])]
    named = not all(map(_is_number, header))
    if len(lines) <= named:
        raise InputError("it has no frames")
    if named and not set(BASE_COLUMNS) <= set(header):
        missing = next(column for column in BASE_COLUMNS if column not in header)
        raise InputError(
            f"it has no column '{missing}': columns are separated by commas, numbers have a decimal point, and the "
            f"first line names {HEADER}; got {shown(lines[0])}"
        )
    own = (*BASE_COLUMNS, *STANDING, "time")
    twice = next((name for name in own if header.count(name) > 1), None)
    if named and twice is not None:
        raise InputError(f"a column must occur once, got '{twice}' {header.count(twice)} times")
    values = np.loadtxt(lines[named:], delimiter=",", comments=None, quotechar='"', ndmin=2)
    if named and values.shape[1] != len(header):
        raise InputError(f"its header names {len(header)} columns, its rows have {values.shape[1]}")
    if not named:
        return {"base": values[:, :7], "joints": values[:, 7:]}
    rest = [i for i, column in enumerate(header) if column not in own]
    base = values[:, [header.index(column) for column in BASE_COLUMNS]]
    data: dict[str, AnyArray | None] = {"base": base, "joints": values[:, rest]}
    if {*STANDING} <= {*header}:
        data["standing"] = values[:, [header.index(column) for column in STANDING]]
    if "time" in header and len(values) > 1:
        data["rate"] = np.array(_rate_of(values[:, header.index("time")]))
    return data | {"joint_names": np.array([header[i] for i in rest])}


def _rate_of(times: Array) -> float:
    """Return the frames per second, Hz, of times, s."""
    steps = np.diff(times)
    step = float(np.median(steps))
    if not (steps > 0.0).all() or (abs(steps - step) > 0.01 * step).any():
        raise InputError(
            f"times must increase evenly, to 1 %, got steps of {steps.min():g} to {steps.max():g} s"
        )
    return 1.0 / step


def _placed(data: Arrays) -> tuple[AnyArray, AnyArray]:
    """Return base and joints of arrays, or of columns, by their names."""
    if "base" in data:
        base, joints = _need(data, "a motion", base="T 7", joints="T n")
        return base, joints
    if "dof_pos" in data:
        what = "a motion of GMR"
        place, turn, joints = _need(data, what, root_pos="T 3", root_rot="T 4", dof_pos="T n")
        return np.hstack([place, turn]), joints
    if "joint_pos" not in data:
        raise InputError(
            f"it has {_found(data)}; a motion of a robot needs base and joints, or joint_pos and body_pos_w, or "
            "dof_pos and root_pos"
        )
    (joints,) = _need(data, "a motion", joint_pos="T n")
    names = data.get("joint_names")
    if names is not None and joints.shape[1] == names.size + 7:  # of MuJoCo, base first
        return joints[:, [0, 1, 2, 4, 5, 6, 3]], joints[:, 7:]
    what, shapes = "a motion of BeyondMimic", {"body_pos_w": "T bodies 3", "body_quat_w": "T bodies 4"}
    joints, places, turns = _need(data, what, joint_pos="T n", **shapes)
    bodies = data.get("body_names")
    root = 1 if bodies is not None and _texts(bodies)[:1] == ("world",) else 0
    if places.shape[1] <= root:
        raise InputError(f"body_pos_w of {what} must have the base of the robot, got shape {places.shape}")
    return np.hstack([places[:, root], turns[:, root][:, [1, 2, 3, 0]]]), joints


def _texts(names: AnyArray) -> tuple[str, ...]:
    """Return names of an array of texts, or of bytes; of no names NumPy makes an array of numbers."""
    if names.size and names.dtype.kind not in "SU":
        raise InputError(f"names must be texts, got an array of type {names.dtype}")
    if names.dtype.kind == "S":
        names = np.char.decode(names, "utf-8")
    return tuple(str(name).strip() for name in np.ravel(names))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _agreed(what: str, own: Said | None, given: Said | None) -> Said:
    """Return the value of a file, or else that of the caller; they must not contradict each other."""
    said = given if own is None else own
    if said is None:
        raise InputError(f"the file does not say its {what}: give them")
    if given is not None and not (
        np.allclose(said, given, rtol=1e-3) if isinstance(said, float) else said == given
    ):
        raise InputError(f"the file says another {what}: {said}, not {given}")
    return said
