"""Talos, G1 and robots without feet from the installed `example-robot-data` distribution; nothing is downloaded."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

from wbc.base.errors import InputError
from wbc.core.frames import FrameDescription, Sole
from wbc.core.robot import SIDES
from wbc.robots.description import RobotDescription
from wbc.robots.frames import SOLE_NAMES

DISTRIBUTION = "example-robot-data"


def share_directory() -> Path:
    """Return the directory of `package://example-robot-data/…`; `InputError` if that distribution is not installed."""
    try:
        distribution = metadata.distribution(DISTRIBUTION)
    except metadata.PackageNotFoundError as error:
        raise InputError(
            f"this robot needs the distribution '{DISTRIBUTION}', which is not installed"
        ) from error
    return Path(str(distribution.locate_file("cmeel.prefix/share")))


def _path(relative: str) -> Path:
    return share_directory() / DISTRIBUTION / "robots" / relative


def talos() -> RobotDescription:
    """Return PAL Robotics Talos, fingers fixed.

    Half-sitting and rotor data are those of its SRDF (ankle roll −0.0017 rad taken as zero, so that soles are flat).
    The sole, 211 × 124 mm, is the outline of its foot mesh within 5 mm of the ground; its centre is 5 mm behind the
    sole link.
    """
    leg = {"1": 0.0, "2": 0.0, "3": -0.411354, "4": 0.859395, "5": -0.448041, "6": 0.0}
    arm = {"1": 0.25847, "2": 0.173046, "3": -0.0002, "4": -0.525366, "5": 0.0, "6": 0.0, "7": 0.1}
    mirrored = {"1", "2", "3"}
    half_sitting = {"torso_1_joint": 0.0, "torso_2_joint": 0.006761}
    for side in SIDES:
        half_sitting |= {f"leg_{side}_{i}_joint": value for i, value in leg.items()}
        half_sitting |= {
            f"arm_{side}_{i}_joint": -value if side == "right" and i in mirrored else value
            for i, value in arm.items()
        }
    left, right = (
        Sole(
            f"{side}_sole",
            f"{side}_sole_link",
            translation=(-0.0054, 0.0, 0.0),
            name=name,
            length=0.211,
            width=0.124,
        )
        for side, name in zip(SIDES, SOLE_NAMES, strict=True)
    )
    return RobotDescription.from_urdf(
        _path("talos_data/robots/talos_reduced.urdf"),
        name="talos",
        left_sole=left,
        right_sole=right,
        package_dirs=(share_directory(),),
        half_sitting=half_sitting,
        torso="torso_2_link",
        imu="imu_link",
        hands={"left_hand": "wrist_left_ft_tool_link", "right_hand": "wrist_right_ft_tool_link"},
        armature=0.1,
        height=1.76,
        provenance=f"{DISTRIBUTION}: talos_reduced",
        licence="Apache-2.0 in its README, BSD in its package, CC BY-NC-ND 3.0 in the file: see there",
    )


def g1() -> RobotDescription:
    """Return Unitree G1 with 29 joints.

    The sole is the rectangle around the four contact spheres of its URDF.
    """
    return RobotDescription.from_urdf(
        _path("g1_description/urdf/g1_29dof_rev_1_0.urdf"),
        name="g1",
        left_sole="left_ankle_roll_link",
        right_sole="right_ankle_roll_link",
        package_dirs=(share_directory(),),
        torso="torso_link",
        imu=FrameDescription("imu_in_pelvis", "imu_in_pelvis"),
        hands={"left_hand": "left_rubber_hand", "right_hand": "right_rubber_hand"},
        height=1.32,
        provenance=f"{DISTRIBUTION}: g1_29dof_rev_1_0",
        licence="BSD-3-Clause",
    )


def panda() -> RobotDescription:
    """Return Franka Emika Panda, a bolted arm of seven joints with a gripper, its hand in front of it."""
    return RobotDescription.from_urdf(
        _path("panda_description/urdf/panda.urdf"),
        base="fixed",
        package_dirs=(share_directory(),),
        half_sitting={
            "panda_joint2": -0.3,
            "panda_joint4": -2.0,
            "panda_joint6": 1.7,
            "panda_joint7": 0.8,
        },
        hands={"hand": "panda_hand"},
        armature=0.01,
        provenance=f"{DISTRIBUTION}: panda",
        licence="Apache-2.0",
    )


def go1() -> RobotDescription:
    """Return Unitree Go1, a quadruped with twelve joints, its legs bent; no soles."""
    half_sitting: dict[str, float] = {}
    for leg in ("FL", "FR", "RL", "RR"):
        half_sitting |= {f"{leg}_hip_joint": 0.0, f"{leg}_thigh_joint": 0.9, f"{leg}_calf_joint": -1.8}
    return RobotDescription.from_urdf(
        _path("go1_description/urdf/go1.urdf"),
        package_dirs=(share_directory(),),
        half_sitting=half_sitting,
        armature=0.01,
        repair=True,
        provenance=f"{DISTRIBUTION}: go1",
        licence="MPL-2.0",
    )
