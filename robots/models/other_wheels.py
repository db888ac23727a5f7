"""Robots of wheels that are not among the dependencies: `pip` installs them, nothing is cloned or downloaded here."""

from __future__ import annotations

from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from wbc.core.errors import InputError
from wbc.robots.description import RobotDescription

JVRC = "jvrc_description==1.1.1"
PLAYGROUND = "playground==0.2.0"
"""MuJoCo Playground, Apache-2.0: robot files of several humanoids, without their meshes."""


def installed(requirement: str) -> bool:
    """Return True if a wheel is installed, in whatever version."""
    try:
        metadata.distribution(requirement.partition("==")[0])
    except metadata.PackageNotFoundError:
        return False
    return True


def how_to_install(requirement: str) -> str:
    """Return the command that installs a wheel without what its own programs need."""
    return f"pip install --no-deps {requirement}"


def _file(requirement: str, relative: str) -> Path:
    """Return a file of an installed wheel; an `InputError` says how to install it."""
    name = requirement.partition("==")[0]
    how = how_to_install(requirement)
    if not installed(requirement):
        raise InputError(f"this robot is in the wheel '{name}', which is not installed: {how}")
    path = Path(str(metadata.distribution(name).locate_file(relative)))
    if not path.is_file():
        raise InputError(f"the installed '{name}' has no file '{relative}': {how}")
    return path


@cache
def jvrc1() -> RobotDescription:
    """Return JVRC-1, the virtual robot of the Japan Virtual Robotics Challenge, fingers fixed.

    Its torque limits, 100 Nm for every joint, are place-holders of the model.
    """
    path = _file(JVRC, "jvrc_description/urdf/jvrc1.urdf")
    fingers = [f"{side}_{finger}" for side in "LR" for finger in ("UINDEX", "LINDEX", "ULITTLE", "LLITTLE")]
    thumbs = [f"{side}_{part}THUMB" for side in "LR" for part in "UL"]
    return RobotDescription.from_urdf(
        path,
        name="jvrc1",
        left_sole="L_ANKLE_P_S",
        right_sole="R_ANKLE_P_S",
        package_dirs=(path.parents[2],),
        lock=dict.fromkeys((*fingers, *thumbs), 0.0),
        hands={"left_hand": "l_wrist", "right_hand": "r_wrist"},
        height=1.71,
        provenance=f"{JVRC}: jvrc1.urdf",
        licence="BSD-2-Clause in its repository, Apache-2.0 in the metadata of the wheel",
    )


BSD, APACHE = "BSD-3-Clause", "Apache-2.0"

PLAYGROUND_ROBOTS: dict[str, dict[str, Any]] = {
    "h1": {"height": 1.80, "torso": "torso_link", "licence": f"{BSD} (Unitree)"},
    "t1": {"height": 1.18, "licence": APACHE},
    "op3": {"height": 0.51, "licence": APACHE},
    "berkeley_humanoid": {"height": 0.85, "licence": BSD},
    "apollo": {"height": 1.73, "licence": APACHE},
}
"""Robots of MuJoCo Playground: name, also of its folder → what their files do not say.

- h1: Unitree H1, 19 joints; its ankles pitch but do not roll.
- t1: Booster T1, 23 joints; both its legs hang below the waist joint, its root is the trunk.
- op3: Robotis OP3, 20 joints, 3.1 kg; its joints have no position limits in the file.
- berkeley_humanoid: 12 joints: two legs under a body without arms.
- apollo: Apptronik Apollo, 32 joints; its file names a floor that only the scene around it has.
"""


@cache
def playground(name: str) -> RobotDescription:
    """Return a robot of `PLAYGROUND_ROBOTS`; its servo gains are derived, the file's are those of a simulator."""
    file = f"{name}_mjx_feetonly.xml" if name != "apollo" else "scene_mjx_feetonly_flat_terrain.xml"
    return RobotDescription.from_mjcf(
        _file(PLAYGROUND, f"mujoco_playground/_src/locomotion/{name}/xmls/{file}"),
        name=name,
        meshes=False,
        use_gains=False,
        provenance=f"{PLAYGROUND}: {file}",
        **PLAYGROUND_ROBOTS[name],
    )
