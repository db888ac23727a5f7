"""`wbc robots`: a table of the robots, the description of one, and robots of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.output import Report, reports
from wbc.base.errors import InputError
from wbc.base.files import check_target, existing
from wbc.base.numbers import finite_scalar
from wbc.base.settings import Positive, settings
from wbc.robots import files, load, names
from wbc.robots.registry import others

COLUMNS = {"mass_kg": "mass kg", "height_m": "height m", "com_height_m": "CoM m", "dof": "joints"}
"""Columns of the table: key of `RobotDescription.summary` → heading."""


@settings(kw_only=True)
class RobotFileOptions:
    """Options for all that a robot's file does not say.

    Attributes:
        left: Left foot: a body, site or geom of an MJCF, a link of a URDF; the lowest limb of an MJCF when not given.
        right: Right foot.
        sole_size: Length and width of the soles, m; from the geometry of the feet when not given.
        root: Body that floats, in an MJCF without a free joint or with several.
        lock: Joints to fix, such as those of fingers, each as joint=position, rad or m.
        without_meshes: Read an MJCF whose meshes are missing.
        derive_gains: Derive the servo gains instead of taking those of the file.
        repair: Clamp inertias that no body can have, and go on, instead of refusing them.
        package_dir: Folders in which package:// of a URDF is looked for.
        out: TOML description to write of the file with these options, for --robot.
    """

    left: str | None = None
    right: str | None = None
    sole_size: tuple[Positive, Positive] | None = None
    root: str | None = None
    lock: tuple[str, ...] = ()
    without_meshes: bool = False
    derive_gains: bool = False
    repair: bool = False
    package_dir: tuple[Path, ...] = ()
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the readers that differ from their defaults, as plain values."""
        given: dict[str, Any] = {
            "left_sole": self.left,
            "right_sole": self.right,
            "sole_size": None if self.sole_size is None else list(self.sole_size),
            "root": self.root,
            "lock": {name: value for name, value in map(_locked, self.lock)} or None,
            "meshes": False if self.without_meshes else None,
            "use_gains": False if self.derive_gains else None,
            "repair": True if self.repair else None,
            "package_dirs": [str(folder.expanduser().resolve()) for folder in self.package_dir] or None,
        }
        return {name: value for name, value in given.items() if value is not None}


def _locked(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise InputError(f"a locked joint must be joint=position, got '{text}'")
    try:
        return name, finite_scalar(f"position of locked joint '{name}'", float(value))
    except ValueError as error:
        raise InputError(f"position of locked joint '{name}' must be a number, got '{value}'") from error


@reports
def robots(
    *words: Annotated[
        str, Parameter(help="A robot to describe; or check and a file. All in a table when left out.")
    ],
    options: RobotFileOptions,
) -> Report:
    """List the robots, describe one, or check the file of one of your own.

    A check reports what is in the file, what was derived and what is doubtful; with -o it writes the options that the
    file needs to a TOML description, which every --robot takes.
    """
    verb, *rest = words or ("",)
    if verb == "check":
        if len(rest) != 1:
            raise InputError(f"'wbc robots check' takes one file, got {len(rest)}")
        return _check(rest[0], options)
    if rest or options != RobotFileOptions():
        raise InputError("files and their options need a check: wbc robots check my.xml")
    if verb:
        description = load(verb)
        return Report(description.summary(), description.report())
    facts = [load(each).summary() for each in names()]
    lines = [_table(facts), *(f"{other:<18}no feet, from a file or from a package" for other in others())]
    return Report({"robots": facts, "others": list(others())}, "\n".join(lines))


def _check(file: str, options: RobotFileOptions) -> Report:
    path, parameters = existing(file, "robot", "an MJCF or a URDF"), options.parameters()
    target = None
    if options.out is not None:
        target = check_target("a description", options.out, (".toml",), [path])
    own = path.suffix.lower() == ".toml"
    if own and (parameters or target is not None):
        raise InputError(f"'{file}' has its options in itself: edit it, or give the file that it names")
    description = files.read(path) if own else files.describe(path, parameters)
    doubts = description.doubts()
    lines = [
        description.report(),
        "  doubtful:" if doubts else "  nothing is doubtful",
        *(f"    {d}" for d in doubts),
    ]
    if target is not None:
        files.write(target, path, parameters)
        lines.append(f"wrote {target}; try: wbc stand --robot {target}")
    return Report({**description.summary(), "doubts": list(doubts)}, "\n".join(lines))


def _table(facts: list[dict[str, Any]]) -> str:
    lines = [
        f"{'robot':<18}" + "".join(f"{heading:>10}" for heading in COLUMNS.values()) + f"{'sole mm':>12}"
    ]
    for each in facts:
        values = "".join(f"{'?' if each[key] is None else f'{each[key]:.4g}':>10}" for key in COLUMNS)
        length, width = next(iter(each["soles"].values()))["size_m"]
        lines.append(f"{each['name']:<18}{values}{f'{1e3 * length:.0f} x {1e3 * width:.0f}':>12}")
    return "\n".join(lines)
