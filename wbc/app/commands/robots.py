"""`wbc robots`: a table of the robots, the description of one, and robots of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.output import Output, Report, reports
from wbc.core.errors import InputError, finite_scalar
from wbc.core.settings import Positive, settings
from wbc.robots import RobotDescription, load, names, others, saved

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
        name: Name under which the robot is added.
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
    name: str | None = None

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
        str,
        Parameter(
            help="A robot to describe; or check and a file; or add and a file. All in a table when left out."
        ),
    ],
    options: RobotFileOptions,
    output: Output,
) -> Report:
    """List the robots, describe one, check the file of one of your own, or add it under a name for --robot.

    A check reports what is in the file, what was derived and what is doubtful. To add writes a TOML description to the
    user's configuration folder.
    """
    verb, *files = words or ("",)
    if verb in saved.RESERVED:
        if len(files) != 1:
            raise InputError(f"'wbc robots {verb}' takes one file, got {len(files)}")
        return (_check if verb == "check" else _add)(files[0], options, output)
    if files or options != RobotFileOptions():
        raise InputError(
            f"files and their options need one of {', '.join(saved.RESERVED)}: wbc robots check my.xml"
        )
    if verb:
        description = load(verb)
        return output.report(description.summary(), description.report())
    facts = [load(each).summary() for each in names()]
    lines = [
        _table(facts),
        *(f"{other:<18}no feet, from a file or from a package" for other in others()),
    ]
    return output.report(
        {"robots": [_brief(each) for each in facts], "others": list(others())}, "\n".join(lines)
    )


def _check(file: str, options: RobotFileOptions, output: Output) -> Report:
    """Report what is in the file of a robot, what was derived and what is doubtful."""
    if options.name is not None:
        raise InputError("--name is the name under which `wbc robots add` adds a robot")
    description = _described(file, options)
    doubts = description.doubts()
    lines = [
        description.report(),
        "  doubtful:" if doubts else "  nothing is doubtful",
        *(f"    {d}" for d in doubts),
    ]
    return output.report({**description.summary(), "doubts": list(doubts)}, "\n".join(lines))


def _add(file: str, options: RobotFileOptions, output: Output) -> Report:
    """Write a TOML description of a robot to the user's configuration folder."""
    name = options.name
    if name is None:
        raise InputError("a robot is added under a name: give --name")
    if name in names() or name in others() and name not in saved.own_robots():
        raise InputError(f"the name '{name}' is that of a robot of the library; choose another")
    path = saved.save(name, file, options.parameters())
    description = load(name)
    doubts = description.doubts()
    lines = [
        f"wrote {path}",
        f"{name}: {description.robot().mass:.2f} kg, {len(description.joint_names)} joints; "
        f"try: wbc stand --robot {name}",
        *(f"  doubtful: {doubt}" for doubt in doubts),
    ]
    return output.report({"file": str(path), "name": name, "doubts": list(doubts)}, "\n".join(lines))


def _described(file: str, options: RobotFileOptions) -> RobotDescription:
    path = Path(file).expanduser()
    if not path.is_file():
        raise InputError(f"no robot file '{file}'; give an MJCF or a URDF")
    if path.suffix.lower() == ".toml":
        return saved.read(path)
    return saved.describe(path, options.parameters())


def _brief(facts: dict[str, Any]) -> dict[str, Any]:
    sole = next(iter(facts["soles"].values()))
    keys = ("name", *COLUMNS, "nv", "licence", "source")
    return {key: facts[key] for key in keys} | {"sole_m": sole["size_m"]}


def _table(facts: list[dict[str, Any]]) -> str:
    lines = [
        f"{'robot':<18}" + "".join(f"{heading:>10}" for heading in COLUMNS.values()) + f"{'sole mm':>12}"
    ]
    for each in facts:
        values = "".join(f"{'?' if each[key] is None else f'{each[key]:.4g}':>10}" for key in COLUMNS)
        length, width = next(iter(each["soles"].values()))["size_m"]
        lines.append(f"{each['name']:<18}{values}{f'{1e3 * length:.0f} x {1e3 * width:.0f}':>12}")
    return "\n".join(lines)
