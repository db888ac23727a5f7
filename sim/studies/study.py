"""Studies: which trials answer a question.

A study has cells (grounds, say) and arms (soles, say); every arm is tried in every cell with the same seeds, so that
arms can be compared in pairs. It is data: the ones below are made by functions, others are read from JSON::

    {"name": "soles on stones", "kind": "walk", "base": {"plan": {"distance": 3.0}},
     "cells": {"stones 20 mm": {"terrain": "stones", "amplitude": 0.02}},
     "arms": {"flat": {"foot": "flat"}, "soft 5": {"foot": "soft", "stiffness": 5.0}},
     "seeds": {"first": 100, "count": 20}, "reference": "flat"}
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from wbc.core.errors import InputError, choose, unknown_name
from wbc.sim.studies.journal import Entry, trial_key
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.sweep import by_spec
from wbc.sim.studies.trials import Trial, trial_from_json

FRESH_SEED = 100
"""First seed of the tables: gains are tuned on seeds 0 to 99, and tables are made on others."""

METRICS = {"walk": "steps_done", "push_limit": "impulse"}
"""What a table of a kind of trial is about unless told otherwise."""


@dataclass(frozen=True)
class Cell:
    """One row of a study.

    Attributes:
        name: Name.
        values: Parts of the specs.
        arms: Arms that are tried here; all when None.
        own: Parts of the specs that an arm has in this cell alone: arm → parts.
    """

    name: str
    values: Mapping[str, Any]
    arms: tuple[str, ...] | None = None
    own: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def cell_name(ground: str, amplitude: float) -> str:
    """Name of the cell of a ground at an amplitude (m), such as "stones, 20 mm"."""
    return f"{ground}, {round(1e3 * amplitude, 1):g} mm"


def ground_of(cell: str) -> str:
    """The ground in the name of a cell; the whole name if it says no amplitude."""
    ground, separator, height = cell.rpartition(", ")
    return ground if separator and height.endswith(" mm") else cell


@dataclass(frozen=True)
class StudyTrial:
    """One trial of a study, and where it belongs."""

    cell: str
    arm: str
    seed: int
    spec: Trial


@dataclass(frozen=True, kw_only=True)
class Study:
    """Which trials answer a question.

    Attributes:
        name: Name.
        about: What the question is.
        kind: Kind of its trials.
        base: Parts of a spec that all trials share.
        cells: Rows.
        arms: Columns: name → parts of the specs.
        seeds: Seeds that every arm is tried with in every cell.
        metric: What the table is about: part of a result, such as "steps_done" or "zmp_error.mean".
        reference: Arm that the others are compared with; the first one when None.
    """

    name: str
    about: str = ""
    kind: str = "walk"
    base: Mapping[str, Any] = field(default_factory=dict)
    cells: tuple[Cell, ...]
    arms: Mapping[str, Mapping[str, Any]]
    seeds: tuple[int, ...]
    metric: str | None = None
    reference: str | None = None

    def __post_init__(self) -> None:
        choose("kind of trial", self.kind, METRICS)
        if not self.cells or not self.arms or not self.seeds:
            raise InputError(f"study '{self.name}' needs at least one cell, one arm and one seed")
        names = [cell.name for cell in self.cells]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"study '{self.name}' has the cell '{name}' twice")
        for cell in self.cells:
            for arm in (*(cell.arms or ()), *cell.own):
                choose(f"arm of the study '{self.name}'", arm, self.arms)
        if self.reference is not None:
            choose(f"arm of the study '{self.name}'", self.reference, self.arms)

    def trials(self) -> Iterator[StudyTrial]:
        """All trials, seed by seed, so that a sweep that is stopped has tried all arms on the same grounds.

        Raises:
            InputError: A spec that cannot be run; the message says in which cell and arm.
        """
        for seed in self.seeds:
            for cell in self.cells:
                for arm in cell.arms or self.arms:
                    own = cell.own.get(arm, {})
                    data = merged(
                        self.base, cell.values, self.arms[arm], own, {"seed": seed, "kind": self.kind}
                    )
                    try:
                        spec = trial_from_json(data)
                    except (InputError, TypeError) as error:
                        raise InputError(f"study '{self.name}', {cell.name}, {arm}: {error}") from error
                    yield StudyTrial(cell.name, arm, seed, spec)

    def narrowed(
        self, cells: Iterable[str] = (), arms: Iterable[str] = (), seeds: int | None = None
    ) -> Study:
        """A part of the study.

        Args:
            cells: Names of cells, or beginnings of names; all when none is given.
            arms: Names of arms; all when none is given.
            seeds: Number of seeds, the first ones; all when None.

        Raises:
            UnknownNameError: No such cell or arm.
        """
        wanted, columns = list(cells), list(arms)
        for name in wanted:
            if not any(cell.name.startswith(name) for cell in self.cells):
                unknown_name(f"cell of the study '{self.name}'", name, [cell.name for cell in self.cells])
        for arm in columns:
            choose(f"arm of the study '{self.name}'", arm, self.arms)
        if seeds is not None and not 1 <= seeds <= len(self.seeds):
            raise InputError(f"seeds must be from 1 to the {len(self.seeds)} of the study, got {seeds}")
        kept = []
        for cell in self.cells:
            mine = tuple(arm for arm in cell.arms or self.arms if not columns or arm in columns)
            if mine and (not wanted or any(cell.name.startswith(name) for name in wanted)):
                own = {arm: values for arm, values in cell.own.items() if arm in mine}
                kept.append(replace(cell, arms=mine, own=own))
        chosen = {name: values for name, values in self.arms.items() if not columns or name in columns}
        reference = self.reference if self.reference in chosen else None
        return replace(self, cells=tuple(kept), arms=chosen, seeds=self.seeds[:seeds], reference=reference)

    def to_json(self) -> dict[str, Any]:
        """The study as plain values."""
        return {
            "name": self.name,
            "about": self.about,
            "kind": self.kind,
            "base": dict(self.base),
            "cells": {
                cell.name: {
                    **cell.values,
                    **({} if cell.arms is None else {"arms": list(cell.arms)}),
                    **({"own": {arm: dict(values) for arm, values in cell.own.items()}} if cell.own else {}),
                }
                for cell in self.cells
            },
            "arms": {name: dict(values) for name, values in self.arms.items()},
            "seeds": list(self.seeds),
            "metric": self.metric,
            "reference": self.reference,
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Study:
        """The study that `to_json` wrote.

        Raises:
            UnknownNameError: A key that a study does not have.
            InputError: Something is missing or of another form.
        """
        known = ("name", "about", "kind", "base", "cells", "arms", "seeds", "metric", "reference")
        for key in data:
            if key not in known:
                unknown_name("part of a study", key, known)
        missing = [key for key in ("name", "cells", "arms", "seeds") if key not in data]
        if missing:
            raise InputError(f"a study needs name, cells, arms and seeds; {' and '.join(missing)} missing")
        for key in ("base", "cells", "arms"):
            if not isinstance(data.get(key, {}), Mapping):
                raise InputError(f"{key} of a study must be an object of names and values")
        cells = []
        for name, values in data["cells"].items():
            parts = dict(values)
            arms, own = parts.pop("arms", None), parts.pop("own", {})
            cells.append(Cell(name, parts, None if arms is None else tuple(arms), own))
        rest = {key: data[key] for key in ("about", "kind", "base", "metric", "reference") if key in data}
        return Study(
            name=data["name"], cells=tuple(cells), arms=data["arms"], seeds=_seeds(data["seeds"]), **rest
        )


def _seeds(given: Any) -> tuple[int, ...]:
    if isinstance(given, Mapping):
        if set(given) != {"first", "count"}:
            raise InputError(f"seeds of a study are a list, or first and count, got {dict(given)}")
        return tuple(range(given["first"], given["first"] + given["count"]))
    if not isinstance(given, (list, tuple)):
        raise InputError(f"seeds of a study are a list, or first and count, got {given!r}")
    return tuple(given)


def merged(*parts: Mapping[str, Any]) -> dict[str, Any]:
    """Parts of a spec put together: later values take the place of earlier ones, objects are put together."""
    result: dict[str, Any] = {}
    for part in parts:
        for key, value in part.items():
            old = result.get(key)
            both = isinstance(old, Mapping) and isinstance(value, Mapping)
            result[key] = merged(old, value) if both else value  # type: ignore[arg-type]
    return result


def found_entries(
    study: Study, entries: Mapping[str, Entry], *, any_code: bool = False
) -> Iterator[tuple[StudyTrial, Entry | None]]:
    """All trials of a study, each with what a journal has of it; None where it has not been run.

    Args:
        study: The study.
        entries: Those of a journal, by key.
        any_code: Take results of other versions of the code, too; else only those of the present one.
    """
    others = by_spec(entries.values()) if any_code else {}
    version = provenance()
    for trial in study.trials():
        plain = trial.spec.to_json()
        yield trial, entries.get(trial_key(plain, version)) or others.get(trial_key(plain, {}))
