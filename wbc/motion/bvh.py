"""BVH files: a hierarchy of joints with offsets, then Euler angles frame by frame.

The rotation of a joint is the product of its channels in the order in which they stand, in degrees. Position channels
take the place of the offset, as the readers of the field have it; so files that write six channels for every joint are
read, too. Where these are zero in all frames below the root, the offset stays: some programs write them so. Nothing in
the format says the unit of length or the axis that points up.

Source: M. Meredith, S. Maddock, "Motion Capture File Formats Explained", University of Sheffield, CS-01-11, 2001.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.base.errors import InputError, choose, shown
from wbc.base.files import decoding
from wbc.base.numbers import Array
from wbc.motion.skeleton import MOST_JOINTS

LARGEST = 100_000_000
"""Largest file that is read, bytes."""

FARTHEST = 1e7
"""Greatest number in a frame, degrees or units of length."""

ZERO = 1e-4
"""Length of a position below which it is zero, as a share of the offset whose place it would take."""

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclass(slots=True)
class _Joint:
    """One joint of the hierarchy; `parent` is its place in the list, −1 for the root."""

    name: str
    parent: int
    offset: list[float] | None = None
    channels: list[str] | None = None
    ends: int = 0  # end sites below it


def read_bvh(path: Path) -> tuple[tuple[str, ...], Array, float]:
    """Return names, positions and rate of the joints of a file.

    Args:
        path: The file.

    Returns:
        Names of the joints, an end site as "LeftToe end"; their positions in the axes and the unit of the file, shape
        (frames, joints, 3); and the frames per second, Hz.
    """
    with decoding(path, "BVH file", largest=LARGEST) as file:
        head, *tail = re.split(
            r"^\s*MOTION\s*$",
            file.read_text(encoding="utf-8-sig", errors="replace"),
            maxsplit=1,
            flags=re.MULTILINE,
        )
        joints = _hierarchy(head)
        if not tail:
            raise InputError("it has no MOTION")
        frames, rate = _frames(tail[0], joints)
        return tuple(joint.name for joint in joints), _positions(joints, frames), rate


def _hierarchy(text: str) -> list[_Joint]:
    """Return the joints, each after its parent."""
    joints: list[_Joint] = []
    opened: list[int] = []  # joints whose braces are open, the innermost last
    for word, rest in _lines(text):
        if word in ("ROOT", "JOINT", "End"):
            joints.append(_joint(word, rest, joints, opened))
            if len(joints) > MOST_JOINTS:
                raise InputError(f"a skeleton may have {MOST_JOINTS} joints at most")
        elif word == "{" and joints and joints[-1].offset is None and len(joints) - 1 not in opened:
            opened.append(len(joints) - 1)
        elif word == "}" and opened:
            opened.pop()
        elif word == "OFFSET" and opened:
            joint = joints[opened[-1]]
            joint.offset = [_number(f"OFFSET of joint '{joint.name}'", part) for part in rest.split()]
            if len(joint.offset) != 3:
                raise InputError(
                    f"OFFSET of joint '{joint.name}' must be three numbers, got {len(joint.offset)}"
                )
        elif word == "CHANNELS" and opened:
            joints[opened[-1]].channels = _channels(joints[opened[-1]].name, rest.split())
        elif word != "HIERARCHY":
            raise InputError(f"'{word[:40]}' is no word of a hierarchy, or belongs to no joint")
    if opened:
        raise InputError(f"the braces of joint '{joints[opened[-1]].name}' are not closed")
    if not joints:
        raise InputError("it has no ROOT")
    for joint in joints:
        if joint.offset is None or joint.channels is None:
            raise InputError(
                f"joint '{joint.name}' has no {'OFFSET' if joint.offset is None else 'CHANNELS'}"
            )
    return joints


def _lines(text: str) -> Iterator[tuple[str, str]]:
    """Yield the first word of each line and the rest; braces stand on lines of their own."""
    for line in text.replace("{", "\n{\n").replace("}", "\n}\n").splitlines():
        word, _, rest = line.strip().replace("\t", " ").partition(" ")
        if word:
            yield word, rest.strip()


def _joint(word: str, name: str, joints: list[_Joint], opened: list[int]) -> _Joint:
    """Return a new joint below the innermost one that is open."""
    if (word == "ROOT") != (not joints):
        raise InputError("a file must have one ROOT, before all other joints")
    if word != "ROOT" and not opened:
        raise InputError(f"joint '{name}' is outside the braces of the root")
    parent = opened[-1] if opened else -1
    if word == "End":
        above = joints[parent]
        above.ends += 1
        name = f"{above.name} end" if above.ends == 1 else f"{above.name} end {above.ends}"
        return _Joint(name, parent, channels=[])
    if not name:
        raise InputError(
            "a joint has no name, " + (f"below '{joints[parent].name}'" if joints else "the root")
        )
    return _Joint(name, parent)


def _number(what: str, text: str) -> float:
    """Return a number of the file, `what` in messages."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{what} must be a number, got {shown(text)}") from None
    if not abs(value) <= FARTHEST:
        raise InputError(f"{what} must be within ±{FARTHEST:g}, got {value:g}")
    return value


def _channels(name: str, words: list[str]) -> list[str]:
    """Return the channels of a joint: those of positions and rotations are each of another axis."""
    channels = words[1:]
    if not words or words[0] != str(len(channels)):
        raise InputError(
            f"CHANNELS of joint '{name}' says {words[0] if words else 'no'} channels, and names {len(channels)}"
        )
    for channel in channels:
        choose(f"channel of joint '{name}'", channel, CHANNELS)
    if len(set(channels)) != len(channels):
        raise InputError(f"a channel of joint '{name}' stands twice: {' '.join(channels)}")
    return channels


def _frames(text: str, joints: Sequence[_Joint]) -> tuple[Array, float]:
    """Return the values of all channels, shape (frames, channels), and the frames per second, Hz."""
    found = re.match(r"\s*Frames:\s*([0-9]{1,9})\s+Frame\s+Time:\s*(\S+)", text)
    if found is None:
        raise InputError("after MOTION must stand 'Frames: NUMBER' and 'Frame Time: SECONDS'")
    count, period = int(found[1]), _number("Frame Time", found[2])
    if not 1e-4 <= period <= 1.0:
        raise InputError(f"Frame Time must be 0.0001 to 1 s, got {period:g}")
    columns = [f"{channel} of joint '{joint.name}'" for joint in joints for channel in joint.channels or ()]
    if not columns:
        raise InputError("no joint has a channel, so that nothing moves")
    words = text[found.end() :].split()
    try:
        values = np.array(words, dtype=float)
        good = bool((abs(values) <= FARTHEST).all())
    except ValueError:
        good = False
    for i, word in enumerate(() if good else words):  # one of them is refused by its place
        _number(f"{columns[i % len(columns)]} in frame {i // len(columns)}", word)
    whole, rest = divmod(len(values), len(columns))
    if rest or whole != count:
        raise InputError(
            f"'Frames: {count}' does not fit: the file holds {whole} frames of {len(columns)} numbers, and {rest} "
            "numbers more"
        )
    return values.reshape(count, len(columns)), 1.0 / period


def _positions(joints: list[_Joint], frames: Array) -> Array:
    """Return the positions of all joints, shape (frames, joints, 3), by forward kinematics."""
    positions, at = np.empty((len(frames), len(joints), 3)), 0
    turns: list[Rotation] = []
    for number, joint in enumerate(joints):
        channels = joint.channels or []
        values = frames[:, at : at + len(channels)]
        at += len(channels)
        place = np.tile(joint.offset or [0.0] * 3, (len(frames), 1))
        moves = [column for column, channel in enumerate(channels) if channel.endswith("position")]
        least = ZERO * float(np.linalg.norm(place[:1])) if joint.parent >= 0 else -1.0
        if (abs(values[:, moves]) > least).any():
            place[:, ["XYZ".index(channels[column][0]) for column in moves]] = values[:, moves]
        order = [column for column, channel in enumerate(channels) if channel.endswith("rotation")]
        axes = "".join(channels[column][0] for column in order)
        turn = Rotation.from_euler(axes, values[:, order], degrees=True) if axes else Rotation.identity()
        if joint.parent >= 0:
            place = positions[:, joint.parent] + turns[joint.parent].apply(place)
            turn = turns[joint.parent] * turn
        positions[:, number] = place
        turns.append(turn)
    return positions
