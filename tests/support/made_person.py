"""A person made by rule, who squats, raises the arms, shifts the weight and takes four steps; and files of it.

The person is a skeleton of human lengths. Its feet slide, float and tremble a little, as recorded ones do. Files are
written as LAFAN1 and CMU publish theirs: other names, channels, units, rest poses and rates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.base.numbers import Array
from wbc.core.trajectories import minimum_jerk
from wbc.motion import SkeletonClip

THIGH, SHANK, ANKLE, FOOT = 0.42, 0.41, 0.09, 0.15
"""Lengths of thigh and shank, height of the ankle, and length from ankle to toe, m."""

HIP, SHOULDER, TRUNK, UPPER, LOWER = 0.09, 0.18, 0.50, 0.29, 0.26
"""Half the distances of hips and shoulders, lengths of trunk, upper arm and forearm, m."""

DURATION, STEP, STEPS = 15.0, 0.30, 4
"""Duration, s; length of a whole step, m; number of steps, of which the first and last are half."""

Joints = dict[str, tuple[Array, Rotation]]
"""Joint of a limb → its position, shape (T, 3), m, and the rotation of the limb below it, in the world, z up."""


def make_person(rate: float = 30.0, seed: int = 0, noise: float = 1.0) -> SkeletonClip:
    """Return the clip of the person.

    Args:
        rate: Frames per second, Hz.
        seed: Fixes how feet slide, float and tremble.
        noise: Factor of that; without any, feet that stand are at rest on z = 0.
    """
    joints = person(rate, seed, noise)
    return SkeletonClip(
        tuple(joints), rate, np.stack([place for place, _ in joints.values()], axis=1), "made"
    )


def person(rate: float, seed: int = 0, noise: float = 1.0) -> Joints:
    """Return the joints of the person; x is ahead."""
    t = np.arange(round(DURATION * rate) + 1) / rate
    random = np.random.default_rng(seed)
    squat, raise_arms = _bump(t, 0.8, 1.8, 2.2, 3.2), _bump(t, 3.2, 4.4, 4.8, 6.0)
    shift = _bump(t, 6.0, 7.0, 7.6, 8.6)  # weight on the left foot
    ankles = np.tile([[0.0, HIP, ANKLE], [0.0, -HIP, ANKLE]], (len(t), 1, 1))
    pitch, body = np.zeros((len(t), 2)), np.zeros((len(t), 3))
    body[:, 1] += 0.7 * HIP * shift
    ankles[:, 1, 2] += 0.08 * _bump(t, 6.8, 7.2, 7.4, 7.8)
    for number in range(STEPS):
        side, begin = number % 2, 9.0 + 1.3 * number
        way = STEP * (0.5 if number in (0, STEPS - 1) else 1.0)
        air = np.clip((t - begin) / 0.6, 0.0, 1.0)
        ankles[:, side, 0] += way * minimum_jerk(air)[0]
        ankles[:, side, 2] += 0.1 * np.sin(np.pi * air) ** 2
        pitch[:, side] += 0.5 * np.sin(2.0 * np.pi * air) * (air > 0.0) * (air < 1.0)
        over = _bump(t, begin - 0.5, begin, begin + 0.6, begin + 1.1)
        body[:, 1] += (0.7 if side else -0.7) * HIP * over
        body[:, 0] += 0.5 * way * minimum_jerk(np.clip((t - begin) / 1.0, 0.0, 1.0))[0]
    rough = noise * np.array([0.01, 0.006, 0.006])
    drift = np.cumsum(random.normal(size=(len(t), 2, 3)), axis=0) / math.sqrt(len(t))
    ankles += rough * drift + noise * random.normal(scale=5e-4, size=ankles.shape)
    ankles[..., 2] += 0.004 * noise
    height = 0.985 * (THIGH + SHANK) + ANKLE - 0.22 * squat
    hips = body + np.column_stack([-0.06 * squat, 0.0 * t, height])
    lean = 0.5 * squat
    ahead = np.array([1.0, 0.0, 0.0])
    trunk = Rotation.from_euler("y", lean[:, None])
    chest = hips + TRUNK * trunk.apply([0.0, 0.0, 1.0])
    joints: Joints = {"hips": (hips, trunk)}
    for number, (name, sign) in enumerate((("left", 1.0), ("right", -1.0))):
        hip, ankle = hips + [0.0, sign * HIP, 0.0], ankles[:, number]
        knee = _knee(hip, ankle)
        foot = Rotation.from_euler("ZY", np.column_stack([np.full(len(t), 0.12 * sign), pitch[:, number]]))
        joints[f"{name}_hip"] = hip, _limb(knee - hip, ahead)
        joints[f"{name}_knee"] = knee, _limb(ankle - knee, ahead)
        joints[f"{name}_ankle"] = ankle, foot
        joints[f"{name}_toe"] = ankle + foot.apply([FOOT, 0.0, -0.6 * ANKLE]), foot
        shoulder = chest + trunk.apply([0.0, sign * SHOULDER, 0.0])
        out = np.column_stack([np.zeros(len(t)), 0.15 + 1.2 * raise_arms]) * [1.0, -sign]
        upper = Rotation.from_euler("yx", np.column_stack([-0.9 * squat, -out[:, 1]]))
        elbow = shoulder + UPPER * upper.apply([0.0, 0.0, -1.0])
        lower = upper * Rotation.from_euler("y", -(0.3 + 0.9 * raise_arms)[:, None])
        joints[f"{name}_shoulder"] = shoulder, upper
        joints[f"{name}_elbow"] = elbow, lower
        joints[f"{name}_wrist"] = elbow + LOWER * lower.apply([0.0, 0.0, -1.0]), lower
    return joints


def _bump(t: Array, rise: float, high: float, fall: float, low: float) -> Array:
    up, down = (t - rise) / (high - rise), (low - t) / (low - fall)
    return np.asarray(minimum_jerk(np.clip(up, 0.0, 1.0))[0] * minimum_jerk(np.clip(down, 0.0, 1.0))[0])


def _knee(hip: Array, ankle: Array) -> Array:
    """Return the place of a knee that bends forward, shape (T, 3)."""
    way = ankle - hip
    length = np.linalg.norm(way, axis=1, keepdims=True)
    assert (length < THIGH + SHANK).all(), f"a leg of {length.max():.3f} m is too long"
    along = (length**2 + THIGH**2 - SHANK**2) / (2.0 * length)
    aside = np.sqrt(THIGH**2 - along**2)
    direction = way / length
    bend = np.array([1.0, 0.0, 0.0]) - direction * direction[:, :1]
    return np.asarray(hip + along * direction + aside * bend / np.linalg.norm(bend, axis=1, keepdims=True))


def _limb(down: Array, ahead: Array) -> Rotation:
    """Return the rotations of a limb whose −z axis points along it, with its x axis ahead."""
    z = -down / np.linalg.norm(down, axis=1, keepdims=True)
    x = ahead - z * (z @ ahead)[:, None]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


@dataclass(frozen=True)
class Dialect:
    """Format of the files of a source.

    Attributes:
        chains: Names below the root, each with its parent and the joint of a limb at its place.
        unit: Length of a unit, m.
        order: Axes of the rotations, in the order of their channels.
        turned: Rest pose: rotation of the bones' own axes.
    """

    chains: Sequence[tuple[str, str, str]]
    unit: float
    order: str
    turned: Rotation


def on_both_sides(*rows: tuple[str, str, str]) -> list[tuple[str, str, str]]:
    """Return rows of a chain for "Left" and "Right" in place of {0}."""
    return [
        (bone.format(side), parent.format(side), part)
        for side in ("Left", "Right")
        for bone, parent, part in rows
    ]


def arms(spine: str) -> list[tuple[str, str, str]]:
    """Return the chains of both arms on a bone of the spine."""
    return on_both_sides(
        ("{0}Shoulder", spine, "hips"),
        ("{0}Arm", "{0}Shoulder", "shoulder"),
        ("{0}ForeArm", "{0}Arm", "elbow"),
        ("{0}Hand", "{0}ForeArm", "wrist"),
    )


LAFAN1 = Dialect(
    (
        *on_both_sides(
            ("{0}UpLeg", "Hips", "hip"),
            ("{0}Leg", "{0}UpLeg", "knee"),
            ("{0}Foot", "{0}Leg", "ankle"),
            ("{0}Toe", "{0}Foot", "toe"),
        ),
        ("Spine", "Hips", "hips"),
        *arms("Spine"),
    ),
    0.01,
    "ZYX",
    Rotation.from_euler("xyz", [0.4, -0.3, 1.2]),
)

CMU = Dialect(
    (
        *on_both_sides(
            ("{0[0]}HipJoint", "Hips", "hips"),
            ("{0}UpLeg", "{0[0]}HipJoint", "hip"),
            ("{0}Leg", "{0}UpLeg", "knee"),
            ("{0}Foot", "{0}Leg", "ankle"),
            ("{0}ToeBase", "{0}Foot", "toe"),
        ),
        ("LowerBack", "Hips", "hips"),
        *arms("LowerBack"),
    ),
    0.0564,
    "ZXY",
    Rotation.identity(),
)


def write_bvh(path: Path, dialect: Dialect, joints: Joints, rate: float) -> None:
    """Write the person as a file of a dialect: y up, ahead along z, with an end site at each hand and toe.

    Bones keep their lengths in a BVH file. Those of this person are constant, but for the noise of the feet: the toe
    and the ankle are where the rest pose and the rotations have them.
    """
    to_file = np.roll(np.eye(3), -1, axis=0)  # z up to y up: (x, y, z) → (y, z, x)
    turn = Rotation.from_matrix(to_file)

    def of(name: str, part: str) -> tuple[Array, Rotation]:
        side = "right" if name.startswith("R") else "left"
        place, rotation = joints["hips"] if part == "hips" else joints[f"{side}_{part}"]
        return turn.apply(place) / dialect.unit, turn * rotation * turn.inv() * dialect.turned

    parents = {name: parent for name, parent, _ in dialect.chains}
    world = {"Hips": of("Hips", "hips")} | {name: of(name, part) for name, _, part in dialect.chains}
    lines, columns = ["HIERARCHY"], []

    def write(name: str, depth: int) -> None:
        indent = "\t" * depth
        place, rotation = world[name]
        if name == "Hips":
            offset, local = np.zeros(3), rotation
            columns.append(place)
        else:
            above, own = world[parents[name]]
            offset = np.median(own.inv().apply(place - above), axis=0)
            local = own.inv() * rotation
        axes = " ".join(f"{axis}rotation" for axis in dialect.order)
        six = "6 Xposition Yposition Zposition" if name == "Hips" else "3"
        columns.append(local.as_euler(dialect.order, degrees=True))
        lines.extend(
            [
                f"{indent}{'ROOT' if name == 'Hips' else 'JOINT'} {name}",
                f"{indent}{{",
                f"{indent}\tOFFSET {' '.join(f'{v:.6f}' for v in offset)}",
                f"{indent}\tCHANNELS {six} {axes}",
            ]
        )
        children = [child for child, parent, _ in dialect.chains if parent == name]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.extend(
                [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 1 0", f"{indent}\t}}"]
            )
        lines.append(f"{indent}}}")

    write("Hips", 0)
    table = np.hstack(columns)
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {1.0 / rate:.6f}"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
