"""Studies: the trials that answer a question.

A study has cells (grounds, say) and arms (soles, say); every arm is tried in every cell with the same seeds, so that
arms can be compared in pairs. It is data, and a JSON file of its own::

    {"name": "soles on stones", "kind": "walk", "base": {"plan": {"distance": 3.0}},
     "cells": {"stones 20 mm": {"terrain": "stones", "amplitude": 0.02}},
     "arms": {"flat": {"foot": "flat"}, "soft 5": {"foot": "soft", "stiffness": 5.0}},
     "seeds": {"first": 100, "count": 20}, "reference": "flat"}
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, unknown_name
from wbc.base.registry import allow_code, in_file, is_data, reading_data
from wbc.base.settings import Count, Seed, from_json, json_object, settings, to_json
from wbc.sim.studies.journal import Entry, own_key, trial_key
from wbc.sim.studies.outcomes import KINDS, AnyTrialSpec, TrialKind, trial_from_json
from wbc.sim.studies.provenance import differences

ALL = "all"
"""Name of the row of all cells together in tables; no cell has it."""

Parts = Mapping[str, Any]
"""Parts of a spec, as plain values."""


@settings
class Cell:
    """Row of a study: a part of the specs, for example a ground.

    Attributes:
        name: Name.
        values: Parts of the specs of all trials in this cell; none may be called "arms" or "own", the names of the next
            two in a file.
        arms: Arms that are tried in this cell; all when None.
        arm_values: Parts of the specs that an arm has only in this cell: arm → parts.
    """

    name: str
    values: Parts
    arms: tuple[str, ...] | None = None
    arm_values: Mapping[str, Parts] = field(default_factory=dict)


@dataclass(frozen=True)
class StudyTrial:
    """One trial of a study: its spec, also as plain values, with the cell, arm and seed that it belongs to."""

    cell: str
    arm: str
    seed: int
    spec: AnyTrialSpec
    plain: Mapping[str, Any] = field(repr=False)


@settings
class SeedRange:
    """Consecutive seeds, as a study in a file may give them.

    Attributes:
        first: First seed.
        count: Number of seeds.
    """

    first: Seed
    count: Annotated[Count, Field(le=100_000)]


@settings(kw_only=True)
class Study:
    """Study: trials that answer a question, in cells (rows) and arms (columns).

    Attributes:
        name: Name of the study.
        about: Question that the study answers.
        kind: Kind of the trials: a registered name, or "FILE.py:NAME".
        base: Parts of a spec that all trials share.
        cells: Rows of the table, such as grounds; each is a part of the specs.
        arms: Columns: name → parts of the specs.
        seeds: Seeds of the trials of every arm in every cell.
        metric: Part of the results that the table shows, such as "zmp_error.mean"; that of the kind when None.
        reference: Arm with which the other arms are compared; the first one when None.
        decision: Rule that turns the results into an answer, written before the walks; None for an exploratory study.
    """

    name: str
    about: str = ""
    kind: str = "walk"
    base: Parts = field(default_factory=dict)
    cells: tuple[Cell, ...]
    arms: Mapping[str, Parts]
    seeds: tuple[Seed, ...]
    metric: str | None = None
    reference: str | None = None
    decision: str | None = None

    def __post_init__(self) -> None:
        if not is_data():
            allow_code(self.base, [cell.values for cell in self.cells], self.arms)
            allow_code([cell.arm_values for cell in self.cells])
        if not (in_file(self.kind) and is_data()):  # code of a study in a file is run with its trials
            KINDS.find(self.kind)
        if not self.cells or not self.arms or not self.seeds:
            raise InputError(f"study '{self.name}' needs at least one cell, one arm and one seed")
        names = [cell.name for cell in self.cells]
        self._refuse_twice("cell", names)
        self._refuse_twice("seed", self.seeds)
        if ALL in names:
            raise InputError(
                f"study '{self.name}': no cell can be called '{ALL}', the row of all cells together"
            )
        references = () if self.reference is None else (self.reference,)
        for cell in self.cells:
            if cell.arms == ():
                raise InputError(
                    f"cell '{cell.name}' of the study '{self.name}' has no arms; leave arms out for all"
                )
            self._refuse_twice(f"cell '{cell.name}' with the arm", cell.arms or ())
            for arm in (*(cell.arms or ()), *cell.arm_values, *references):
                choose(f"arm of the study '{self.name}'", arm, self.arms)

    def _refuse_twice(self, what: str, values: Sequence[Any]) -> None:
        """Refuse a value that is given twice: its trials would be run once and counted twice."""
        if len(set(values)) < len(values):
            value = next(each for each, count in Counter(values).items() if count > 1)
            raise InputError(f"study '{self.name}' has the {what} '{value}' twice")

    @property
    def measured(self) -> str:
        """Part of the results that the table shows: `metric`, or that of the kind of trial."""
        return self.metric or self._trial_kind.metric

    @property
    def _trial_kind(self) -> TrialKind:
        with reading_data():
            return KINDS.find(self.kind)[1]

    @checked
    def titled(self, part: str) -> str:
        """Return a part of the results with its unit, such as "zmp_error.mean (m)"."""
        unit = self._trial_kind.units.get(part)
        return part if unit is None else f"{part} ({unit})"

    @property
    def size(self) -> int:
        """Number of trials, counted without making their specs."""
        return len(self.seeds) * sum(len(cell.arms or self.arms) for cell in self.cells)

    def trials(self) -> Iterator[StudyTrial]:
        """Yield all trials, seed by seed, so that a stopped sweep has tried all arms on the same grounds."""
        for seed in self.seeds:
            last = {"seed": seed, "kind": self.kind}
            for cell in self.cells:
                for arm in cell.arms or self.arms:
                    parts = (self.base, cell.values, self.arms[arm], cell.arm_values.get(arm, {}), last)
                    try:
                        spec = trial_from_json(merged(*parts))
                    except (InputError, TypeError) as error:
                        raise InputError(f"study '{self.name}', {cell.name}, {arm}: {error}") from error
                    yield StudyTrial(cell.name, arm, seed, spec, spec.to_json())

    @checked
    def narrowed(
        self, cells: Iterable[str] = (), arms: Iterable[str] = (), seeds: int | None = None
    ) -> Study:
        """Return a part of the study.

        Args:
            cells: Names of cells, or beginnings of names; a whole name stands only for its own cell. All when none is
                given.
            arms: Names of arms; all when none is given.
            seeds: Number of seeds, at most those of the study, of which the first ones are taken; all when None.
        """
        names, columns, rows = [cell.name for cell in self.cells], tuple(arms), set[str]()
        for given in cells:
            found = {given} & {*names} or {name for name in names if name.startswith(given)}
            if not found:
                unknown_name(f"cell of the study '{self.name}'", given, names)
            rows |= found
        for arm in columns:
            choose(f"arm of the study '{self.name}'", arm, self.arms)
        if seeds is not None and not 1 <= seeds <= len(self.seeds):
            raise InputError(f"seeds must be from 1 to the {len(self.seeds)} of the study, got {seeds}")
        chosen = {name: values for name, values in self.arms.items() if not columns or name in columns}
        part = []
        for cell in self.cells:
            tried = tuple(arm for arm in cell.arms or self.arms if arm in chosen)
            if tried and (cell.name in rows or not rows):
                arm_values = {arm: values for arm, values in cell.arm_values.items() if arm in tried}
                part.append(replace(cell, arms=tried, arm_values=arm_values))
        reference = self.reference if self.reference in chosen else None
        with reading_data():  # this study may be that of a file
            return replace(
                self, cells=tuple(part), arms=chosen, seeds=self.seeds[:seeds], reference=reference
            )

    def to_json(self) -> dict[str, Any]:
        """Return the study as plain values, as in its JSON file."""
        cells = {}
        for cell in self.cells:
            arms = {} if cell.arms is None else {"arms": cell.arms}
            own = {"own": cell.arm_values} if cell.arm_values else {}
            cells[cell.name] = to_json({**cell.values, **arms, **own})
        return {**to_json(self), "cells": cells}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Study:
        """Return the study that `to_json` wrote."""
        values = json_object("a study", data)
        cells = values.get("cells", {})
        if not isinstance(cells, Mapping) or not all(isinstance(parts, Mapping) for parts in cells.values()):
            raise InputError("cells of a study must be an object: name → parts of the specs")
        if "cells" in values:
            values["cells"] = [_cell(name, parts) for name, parts in cells.items()]
        if isinstance(values.get("seeds"), Mapping):
            seeds = from_json(SeedRange, values["seeds"])
            values["seeds"] = list(range(seeds.first, seeds.first + seeds.count))
        with reading_data():
            return from_json(Study, values)


def _cell(name: str, parts: Parts) -> dict[str, Any]:
    values = dict(parts)
    arms, arm_values = values.pop("arms", None), values.pop("own", {})
    return {"name": name, "values": values, "arms": arms, "arm_values": arm_values}


def merged(*parts: Parts) -> dict[str, Any]:
    """Merge parts of a spec: a later value replaces an earlier one, objects are merged in turn."""
    result: dict[str, Any] = {}
    for part in parts:
        for key, value in part.items():
            old = result.get(key)
            both = isinstance(old, Mapping) and isinstance(value, Mapping)
            result[key] = merged(old, value) if both else value  # type: ignore[arg-type]
    return result


@checked
def study_entries(study: Study, entries: Mapping[str, Entry]) -> Iterator[tuple[StudyTrial, Entry | None]]:
    """Yield all trials of a study, each with its entry in a journal, or None if it has not been run."""
    for trial in study.trials():
        yield trial, entries.get(trial_key(trial.plain))


@dataclass(frozen=True)
class LeftOut:
    """Numbers of entries of a journal that a result of a study does not use, by reason."""

    entries: int  # all of the journal
    other_code: int  # of the study's trials by another version of the code
    other_trials: int  # of trials that the study, or the part of it, does not have
    unreadable: int  # whose spec the present code cannot read
    differences: Mapping[str, int]  # between the other versions and the present one → number of entries

    def text(self) -> str | None:
        """Return the numbers and reasons; None if there is nothing that a user would miss in a result."""
        total = self.other_code + self.other_trials + self.unreadable
        if not (self.other_code or self.unreadable or (total and total == self.entries)):
            return None
        why = "; ".join(f"{n}: {text}" for text, n in self.differences.items())
        reasons = {
            f"of another version of the code ({why}), which --any-code takes": self.other_code,
            "of trials that are not part of it": self.other_trials,
            "whose spec this version cannot read, or of code that is not named (--code)": self.unreadable,
        }
        parts = ", ".join(f"{number} {reason}" for reason, number in reasons.items() if number)
        return f"{total} of {self.entries} entries are left out: {parts}"


def left_out(study: Study, entries: Mapping[str, Entry]) -> LeftOut:
    """Count the entries of a journal that a result of a study does not use."""
    own = {trial_key(trial.plain) for trial in study.trials()}
    unused = {key: (own_key(entry.spec), entry) for key, entry in entries.items() if key not in own}
    other = [entry.version for today, entry in unused.values() if today in own]
    unreadable = sum(today is None for today, _ in unused.values())
    why = Counter(", ".join(differences(version)) or "an earlier form of the spec" for version in other)
    return LeftOut(
        entries=len(entries),
        other_code=len(other),
        other_trials=len(unused) - len(other) - unreadable,
        unreadable=unreadable,
        differences=dict(why.most_common(3)),
    )
