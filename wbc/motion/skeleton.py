"""Clips of a person: positions of the joints of a skeleton over time, and the names by which its limbs are known."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array
from wbc.motion.clip import real_array, table_of

NAMES: dict[str, tuple[str, ...]] = {
    "hip": ("upleg", "upperleg", "thigh", "hip", "hipjoint"),
    "knee": ("knee", "lowerleg", "lowleg", "shin", "calf", "leg"),
    "ankle": ("ankle", "foot"),
    "toe": ("toe", "toebase", "toes", "ball", "bigtoe", "footindex", "foot"),
    "shoulder": ("upperarm", "uparm", "arm", "shldr", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm", "lowarm"),
    "wrist": ("wrist", "hand"),
}
"""Joint of a limb → its names in the files of the field without side, the surest first: those of LAFAN1, CMU, Mixamo,
SMPL, Human3.6M, Unreal and 3ds Max."""

OPTIONAL = ("toe",)
"""Joints of a limb that a skeleton may lack."""

SIDE_WORDS = {"left": ("left", "l"), "right": ("right", "r")}
"""Side → its words in the names of joints."""

MOST_JOINTS = 1000
"""Most joints and end sites of a skeleton."""

UPRIGHT = 0.5
"""Least share of the way from the ankles to the shoulders that is vertical in the first frame."""


@checked
@dataclass(frozen=True, slots=True, eq=False)
class SkeletonClip:
    """Clip of a person: positions of the joints over time, at a constant rate.

    Attributes:
        joint_names: Joints, length n; of names that occur twice none can be that of a limb.
        rate: Frames per second, Hz.
        positions: Positions in the world, z up, shape (T, n, 3), in any unit of length.
        name: Name of the clip, for reports.
    """

    joint_names: tuple[str, ...]
    rate: Annotated[float, Field(ge=1.0, le=10_000.0), "Hz"]
    positions: Array
    name: str = "person"

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        names = tuple(self.joint_names)
        if len(names) > MOST_JOINTS:
            raise InputError(f"a skeleton may have {MOST_JOINTS} joints, got {len(names)}")
        positions = real_array("positions", self.positions)
        if positions.ndim != 3 or positions.shape[1:] != (len(names), 3):
            raise InputError(
                f"positions of a skeleton must have shape (frames, {len(names)}, 3), got {positions.shape}"
            )
        columns = [f"{joint} {axis}" for joint in names for axis in "xyz"]
        flat = positions.reshape(len(positions), len(columns))
        table = table_of("positions", flat, None, columns, self.rate)
        object.__setattr__(self, "joint_names", names)
        table.setflags(write=False)  # what is checked does not change
        object.__setattr__(self, "positions", table.reshape(positions.shape))

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, s."""
        return (len(self) - 1) / self.rate

    @checked
    def part(self, begin: float = 0.0, end: float | None = None) -> SkeletonClip:
        """Return the clip from one time to another, s; to its end when None."""
        last = self.duration if end is None else end
        inside = max(begin, last) <= self.duration + 1.0
        first, stop = (round(begin * self.rate), round(last * self.rate) + 1) if inside else (0, 0)
        if not 0 <= first < stop - 1 <= len(self) - 1:
            raise InputError(
                f"a part of '{self.name}' must begin and end within 0 to {self.duration:.3f} s, got {begin:g} to "
                f"{last:g} s"
            )
        return SkeletonClip(self.joint_names, self.rate, self.positions[first:stop], self.name)

    def limbs(self, joints: Mapping[str, str] | None = None) -> dict[str, Array]:
        """Return the positions of the joints of the limbs, such as "left_knee", each of shape (T, 3).

        Args:
            joints: Joint of a limb → its name in this clip, for joints with unusual names.

        Raises:
            InputError: A joint is missing, a limb has no length, or the person does not stand upright or is mirrored.
        """
        places = limb_places(self.joint_names, joints or {})
        found = {part: self.positions[:, place] for part, place in places.items()}
        for side in SIDE_WORDS:
            for chain in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
                for upper, lower in zip(chain, chain[1:], strict=False):
                    self._check_length(found, f"{side}_{upper}", f"{side}_{lower}")
        for part in ("hip", "shoulder"):
            self._check_length(found, f"left_{part}", f"right_{part}")
        ankles, shoulders = (
            0.5 * (found[f"left_{part}"][0] + found[f"right_{part}"][0]) for part in ("ankle", "shoulder")
        )
        way = shoulders - ankles
        if not way[2] > UPRIGHT * float(np.linalg.norm(way)):
            raise InputError(
                f"the person must stand upright in the first frame of '{self.name}': the way from the ankles to the "
                f"shoulders is {', '.join(f'{part:.3g}' for part in way)}, and the last number should be the greatest; "
                "does another axis of the file point up?"
            )
        self._refuse_mirrored(found)
        return found

    def _refuse_mirrored(self, found: Mapping[str, Array]) -> None:
        """Raise an `InputError` for legs, or arms, whose left and right side are exchanged.

        Toes are in front of the ankles; without toes nothing is said of both together.
        """
        hips, shoulders = (found[f"left_{part}"] - found[f"right_{part}"] for part in ("hip", "shoulder"))
        up = 0.5 * sum(found[f"{side}_shoulder"] - found[f"{side}_hip"] for side in SIDE_WORDS)
        ahead = np.cross(hips, up)
        wrong = ""
        if float(np.mean((hips * shoulders).sum(axis=1))) < 0.0:
            wrong = "the shoulders lie the other way round than the hips"
        elif all(f"{side}_toe" in found for side in SIDE_WORDS):
            toes = sum(found[f"{side}_toe"] - found[f"{side}_ankle"] for side in SIDE_WORDS)
            if float(np.mean((toes * ahead).sum(axis=1))) < 0.0:
                wrong = "the toes point backward"
        if wrong:
            raise InputError(
                f"the person of '{self.name}' is mirrored: {wrong}; exchange the names of left and right, or turn the "
                "sign of one axis of the positions"
            )

    def _check_length(self, found: Mapping[str, Array], upper: str, lower: str) -> None:
        size = float(np.median(np.linalg.norm(found[upper] - found[lower], axis=1)))
        whole = float(np.median(np.linalg.norm(found["left_hip"] - found["left_ankle"], axis=1)))
        if not size > 0.02 * whole:
            raise InputError(
                f"{upper} and {lower} of '{self.name}' must lie apart, got {size:g} in the unit of the clip"
            )


def limb_places(names: tuple[str, ...], joints: Mapping[str, str]) -> dict[str, int]:
    """Return the place of each joint of the limbs among the names of a skeleton; see `SkeletonClip.limbs`."""
    wanted = [f"{side}_{part}" for part in NAMES for side in SIDE_WORDS]
    for part, name in joints.items():
        choose("joint of a limb", part, wanted)
        choose(f"joint for {part}", name, names)
    places = {part: names.index(name) for part, name in joints.items()}
    sided = [_without_side(name) for name in names]
    for part in wanted:
        side, _, kind = part.partition("_")
        if part not in places:
            known = ((side, name) for name in NAMES[kind])
            place = next((sided.index(key) for key in known if key in sided), None)
            if place is not None and place not in places.values():
                places[part] = place
    missing = [part for part in wanted if part not in places and part.partition("_")[2] not in OPTIONAL]
    if missing:
        raise InputError(
            f"no joint is known as {', '.join(missing[:4])}{' …' if len(missing) > 4 else ''} among "
            f"{', '.join(names[:30])}; give it, such as joints={{'{missing[0]}': '{names[-1]}'}}"
        )
    for part, place in places.items():
        if (times := names.count(names[place])) > 1:
            raise InputError(
                f"{part} must be one joint, but {times} have the name '{names[place]}': rename the others in the file"
            )
    return places


def _without_side(name: str) -> tuple[str, str] | None:
    """Return side and rest of the name of a joint: LeftUpLeg, mixamorig:LeftUpLeg, left_hip, thigh_l, Bip01 L Thigh."""
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    words = [word.lower() for word in words]
    for place, word in enumerate(words):
        for side, marks in SIDE_WORDS.items():
            if word in marks:
                return side, "".join(words[place + 1 :] or words[:place])
    return None
