"""`StiffnessTable`: training data of stiffness models, roughness of profiles and the best stiffness there."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, InputError, choose, finite_array, shown
from wbc.core.files import csv_rows, decoding, parsing, read_text, replacing
from wbc.core.settings import Positive, from_json, settings, to_json
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.roughness import PARAMETERS, RoughnessSettings

T = TypeVar("T")

FORMAT = "wbc stiffness table"
VERSION = 1

KEYS = ("ground", "family", "amplitude", "seed", "window")
"""Columns that identify a row."""

REQUIRED = (*KEYS, *PARAMETERS, "stiffness")
"""Columns that every table has."""

OPTIONAL = ("stiffness_low", "stiffness_high", "J")
"""Columns that a table may have."""


@settings
class ProfileRecipe:
    """Settings that the roughness of a table or model was computed with.

    Attributes:
        step: Distance of the samples of a profile, m.
        window: Length of a profile, m; None for whole tracks. By default the length scanned in a step of 0.145 m when
            the stiffness is decided (`wbc.tasks.scheduling.record.StiffnessTiming`).
        roughness: Filter, trend and variant.
    """

    step: Annotated[Positive, "m"] = PROFILE_STEP
    window: Annotated[Positive, "m"] | None = 0.182
    roughness: RoughnessSettings = field(default_factory=RoughnessSettings)


@dataclass(frozen=True, eq=False)
class StiffnessTable:
    """Profiles with their best stiffness, one row each; every array has one entry per row.

    Attributes:
        ground: Name of the ground, such as "random w=0.01": rows of one name and amplitude share a best stiffness.
        family: Terrain family.
        amplitude: Highest minus lowest point of the ground, m.
        seed: Seed of the ground.
        window: Number of the profile on this ground, from 0.
        values: Roughness parameters in the order of `PARAMETERS`, shape (n, 10), SI units of their variant.
        stiffness: Best stiffness of the sole there, Nm/rad.
        stiffness_low: Smallest stiffness that is nearly as good, Nm/rad; NaN where unknown.
        stiffness_high: Largest stiffness that is nearly as good, Nm/rad; NaN where unknown.
        J: Cost at the best stiffness, as the paper's eq. 6 (a maximum; 0 is perfect); NaN where unknown.
        recipe: Settings of the roughness.
        made: Provenance of the table, JSON-able.
    """

    ground: NDArray[np.str_]
    family: NDArray[np.str_]
    amplitude: Array
    seed: NDArray[np.int64]
    window: NDArray[np.int64]
    values: Array
    stiffness: Array
    stiffness_low: Array
    stiffness_high: Array
    J: Array
    recipe: ProfileRecipe
    made: Mapping[str, Any]

    def __len__(self) -> int:
        return int(self.stiffness.size)

    @classmethod
    def from_columns(
        cls,
        columns: Mapping[str, Sequence[Any] | NDArray[Any]],
        *,
        recipe: ProfileRecipe | None = None,
        made: Mapping[str, Any] | None = None,
    ) -> StiffnessTable:
        """Return a table with these columns.

        Args:
            columns: Name → entries, shape (rows,): all of `REQUIRED`, any of `OPTIONAL`.
            recipe: Settings of the roughness.
            made: Provenance of the table.

        Raises:
            InputError: A column is missing or unknown, columns of different lengths, no rows, a value that is no
                number, a negative amplitude or stiffness, a best stiffness outside its range.
        """
        missing = [name for name in REQUIRED if name not in columns]
        if missing:
            raise InputError(
                f"stiffness table: missing columns {', '.join(missing)}; there are {', '.join(columns) or 'none'}"
            )
        for name in columns:
            choose("column of a stiffness table", name, (*REQUIRED, *OPTIONAL))
        sizes = {name: len(entries) for name, entries in columns.items()}
        if len(set(sizes.values())) != 1 or 0 in sizes.values():
            raise InputError(
                f"stiffness table: columns must have the same number of rows, at least one, got {sizes}"
            )
        count = sizes["ground"]
        number = {name: _numbers(name, columns[name]) for name in ("amplitude", *PARAMETERS, "stiffness")}
        whole = {name: _whole(name, columns[name]) for name in ("seed", "window")}
        extra = {
            name: _numbers(name, columns[name], missing=True) if name in columns else np.full(count, np.nan)
            for name in OPTIONAL
        }
        for name in ("amplitude", "stiffness"):
            if (number[name] < 0.0).any():
                raise InputError(f"stiffness table: {name} must not be negative, got {number[name].min():g}")
        if (extra["stiffness_low"] > number["stiffness"]).any() or (
            extra["stiffness_high"] < number["stiffness"]
        ).any():
            raise InputError("stiffness table: stiffness must lie between stiffness_low and stiffness_high")
        return cls(
            ground=np.array([str(g) for g in columns["ground"]]),
            family=np.array([str(f) for f in columns["family"]]),
            amplitude=number["amplitude"],
            seed=whole["seed"],
            window=whole["window"],
            values=np.stack([number[name] for name in PARAMETERS], axis=1),
            stiffness=number["stiffness"],
            stiffness_low=extra["stiffness_low"],
            stiffness_high=extra["stiffness_high"],
            J=extra["J"],
            recipe=ProfileRecipe() if recipe is None else recipe,
            made=dict(made or {}),
        )

    def rows(self, choice: ArrayLike | slice) -> StiffnessTable:
        """Return some of the rows.

        Args:
            choice: Numbers of rows, truth values of shape (rows,), or a slice.
        """
        pick = np.arange(len(self))[choice if isinstance(choice, slice) else np.asarray(choice)]
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("recipe", "made")}
        return StiffnessTable(**{k: v[pick] for k, v in arrays.items()}, recipe=self.recipe, made=self.made)

    def groups(self, columns: Iterable[str] = ("ground",)) -> NDArray[np.intp]:
        """Return the number of the group of each row: rows that agree in all these columns are one group.

        Args:
            columns: Of `KEYS`. ("ground",) groups all amplitudes of a ground, ("ground", "amplitude") groups the rows
                that share a best stiffness.

        Raises:
            InputError: No column, or not one of `KEYS`.
        """
        names = tuple(columns)
        if not names:
            raise InputError(f"columns to group by must be some of {', '.join(KEYS)}, got none")
        for name in names:
            choose("column to group by", name, KEYS)
        rows = list(zip(*(getattr(self, name).tolist() for name in names), strict=True))
        order = {row: i for i, row in enumerate(dict.fromkeys(rows))}
        return np.array([order[row] for row in rows])

    def labels(self, clusters: Clusters) -> NDArray[np.intp]:
        """Return the cluster of the best stiffness of each row.

        Raises:
            InputError: A stiffness outside the clusters, or the same cluster for all rows.
        """
        labels = clusters.of(self.stiffness)
        if np.unique(labels).size < 2:
            raise InputError(
                f"the table has a single class: the best stiffness of all {len(self)} rows is in cluster {labels[0]}; "
                "a model needs at least two"
            )
        return labels

    def columns(self) -> dict[str, list[Any]]:
        """Return name → entries, of the optional columns only those with known values."""
        result: dict[str, list[Any]] = {name: getattr(self, name).tolist() for name in KEYS}
        result |= {name: self.values[:, i].tolist() for i, name in enumerate(PARAMETERS)}
        result["stiffness"] = self.stiffness.tolist()
        return result | {
            n: getattr(self, n).tolist() for n in OPTIONAL if np.isfinite(getattr(self, n)).any()
        }

    def save(self, path: str | Path) -> None:
        """Write one line of JSON after a "#" (format, version, recipe, made), then the rows as CSV.

        Raises:
            FileError: The file cannot be written; an old one is unchanged.
        """
        head = {"format": FORMAT, "version": VERSION, "recipe": to_json(self.recipe), "made": dict(self.made)}
        columns = self.columns()
        with replacing(path) as new, new.open("w", encoding="utf-8", newline="") as file:
            file.write("# " + json.dumps(head) + "\n")
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))

    @classmethod
    def load(cls, path: str | Path) -> StiffnessTable:
        """Return the table that `save` wrote.

        Raises:
            InputError: No such file, another format or version, missing columns, rows that cannot be read.
        """
        target = Path(path)
        if not target.is_file():
            raise InputError(f"no stiffness table '{target}'")
        with decoding(target, FORMAT):
            first, _, rest = read_text(target, FORMAT).partition("\n")
            head = parse_head(first.removeprefix("#"), FORMAT, VERSION, target)
            for key in ("recipe", "made"):
                if key not in head:
                    raise InputError(f"{target}: '{key}' is missing from its first line")
            lines = csv_rows(rest, target, FORMAT)
            if not lines:
                raise InputError(f"{target}: no columns")
            names, rows = lines[0], lines[1:]
            for i, row in enumerate(rows):
                if len(row) != len(names):
                    raise InputError(f"{target}: row {i + 1} has {len(row)} entries, {len(names)} are needed")
            columns = {name: [row[i] for row in rows] for i, name in enumerate(names)}
            return cls.from_columns(
                columns, recipe=complete_settings(ProfileRecipe, head["recipe"]), made=head["made"]
            )

    def fingerprint(self) -> str:
        """Return a hash of rows and recipe, hex digits; equal tables have equal hashes on every machine."""
        text = json.dumps([self.columns(), to_json(self.recipe)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def parse_head(text: str, kind: str, version: int, path: Path) -> dict[str, Any]:
    """Return the JSON object at the start of a file, after a check of its format (`kind`) and version.

    Raises `InputError` for no JSON, another format or version, or a provenance ("made") that is no object.
    """
    with parsing(path, kind):
        head = json.loads(text)
    if not isinstance(head, dict) or head.get("format") != kind:
        other = head.get("format") if isinstance(head, dict) else None
        raise InputError(f"{path} is not a {kind}" + (f" but a {other}" if other else ""))
    if head.get("version") != version:
        raise InputError(
            f"{path}: version {head.get('version')!r} of a {kind} cannot be read, this wbc reads version {version}; "
            "make it again with this wbc"
        )
    if not isinstance(head.get("made", {}), dict):
        raise InputError(f"{path}: made must be an object with the provenance, got {shown(head['made'])}")
    return head


def complete_settings(kind: type[T], data: Any) -> T:
    """Return settings that were written in full: in the files here a missing value is an `InputError`."""
    value = from_json(kind, data)
    if to_json(value) != data:
        raise InputError(f"{kind.__name__} must be complete, such as {to_json(value)}, got {data}")
    return value


def _numbers(name: str, entries: Iterable[Any], *, missing: bool = False) -> Array:
    """Return a column of numbers; empty text and NaN only where entries may be missing."""
    filled = ["nan" if missing and entry == "" else entry for entry in entries]
    if not missing:
        return finite_array(f"stiffness table: column {name}", filled)
    try:
        return np.array(filled, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"stiffness table: column {name} must hold numbers: {error}") from error


def _whole(name: str, entries: Iterable[Any]) -> NDArray[np.int64]:
    given = list(entries)
    numbers = _numbers(name, given)
    if (numbers != np.floor(numbers)).any():
        raise InputError(f"stiffness table: column {name} must hold whole numbers")
    # Seeds have up to 63 bits, of which a double keeps 53.
    whole = [
        int(entry) if isinstance(entry, (int, np.integer)) else int(Decimal(str(entry))) for entry in given
    ]
    try:
        return np.array(whole, dtype=np.int64)
    except OverflowError as error:
        raise InputError(
            f"stiffness table: column {name} must be below 2**63, got {max(whole, key=abs)}"
        ) from error
