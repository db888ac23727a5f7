"""Choice of an arm by the ground: which is best where, and what knowing it is worth on layouts it was not chosen on."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.settings import to_json
from wbc.sim.studies.best_stiffness import Label
from wbc.sim.studies.intervals import Equivalence, Estimate, equivalence, holm, mean_interval, sign_flip_p
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import METRICS, Study, study_entries
from wbc.sim.studies.study_table import layout_of, reach_of, value_of

FOLDS = 5
"""Parts of the layouts of a ground: an arm is chosen on all but one of them and judged on the last."""

DEFAULT_MARGIN = 0.5
"""Gain that counts as none, in the unit of the metric; half a step."""

LEVEL = 0.05
"""Level of the tests."""


@dataclass(frozen=True)
class GroundChoice:
    """Best arm on one ground.

    Attributes:
        row: Name of the ground.
        layouts: Number of layouts on which all arms were walked.
        means: Arm → mean of the metric over them, with its interval.
        best: Arm of the greatest mean; of several, the one that is best over all grounds.
        same: Arms that cannot be told from it (sign flips, 5 % after Holm's correction for all grounds and arms).
    """

    row: str
    layouts: int
    means: Mapping[str, Estimate]
    best: str
    same: tuple[str, ...]


@dataclass(frozen=True)
class Choice:
    """Best arm of each ground, and the worth of choosing it.

    Attributes:
        study: Name of the study.
        metric: Part of the results.
        arms: Arms to choose from.
        grounds: Results of the grounds.
        single: Arm of the greatest mean over all grounds.
        gain: Arm chosen for the ground minus the single best one, both chosen on other layouts than judged; without a
            mean if a ground has fewer than five layouts.
        over: Arm → arm chosen for the ground minus this one, on layouts it was not chosen on.
        equivalence: Test of the gain being less than a margin.
        missing: Number of layouts that were left out because not all arms were walked there.
    """

    study: str
    metric: str
    arms: tuple[str, ...]
    grounds: tuple[GroundChoice, ...]
    single: str
    gain: Estimate
    over: Mapping[str, Estimate]
    equivalence: Equivalence
    missing: int

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        plain: dict[str, Any] = to_json(self)
        return plain

    def labels(self, study: Study) -> dict[str, Label]:
        """Return the stiffness of the best arm of each ground, for the table of a model: cell → label.

        Args:
            study: The study.

        Raises:
            InputError: An arm without a stiffness.
        """
        without = ", ".join(arm for arm in self.arms if "stiffness" not in study.arms[arm])
        if without:
            raise InputError(f"a table needs arms with a stiffness; {without} of '{study.name}' has none")
        k = {arm: float(study.arms[arm]["stiffness"]) for arm in self.arms}
        found = {}
        for ground in self.grounds:
            same = [k[arm] for arm in {*ground.same, ground.best}]
            found[ground.row] = Label(
                stiffness=k[ground.best],
                nearly_low=min(same),
                nearly_high=max(same),
                best_low=min(same),
                best_high=max(same),
                J=math.nan,
                J_std=math.nan,
                gain=math.nan,
                walks=ground.layouts * len(self.arms),
            )
        return found

    def markdown(self) -> str:
        """Return the table of grounds and the worth of choosing, as Markdown."""
        lines = [
            f"| {self.metric.replace('_', ' ')} (layouts) | {' | '.join(self.arms)} | best | not told from it |",
            "|---|" + "---|" * (len(self.arms) + 2),
        ]
        for ground in self.grounds:
            means = [ground.means[arm].text() for arm in self.arms]
            same = "all" if len(ground.same) == len(self.arms) else ", ".join(ground.same)
            lines.append(
                f"| {ground.row} ({ground.layouts}) | {' | '.join(means)} | {ground.best} | {same} |"
            )
        if self.gain.mean is None:
            return "\n".join(lines) + f"\n\nWhat choosing is worth needs {FOLDS} layouts on each ground."
        over = "; ".join(f"over {arm}: {each.text(2)}" for arm, each in self.over.items())
        small = self.equivalence.margin
        worth = (
            f"Choosing for each ground, on other layouts than it is judged on ({FOLDS} folds), is worth "
            f"{self.gain.text(2)} over the single best arm chosen likewise (here {self.single}), on {self.gain.n} "
            f"layouts; it is {'' if self.equivalence.equivalent else 'not '}shown to be less than {small:g} (two "
            f"one-sided tests, 5 %). {over[:1].upper()}{over[1:]}."
        )
        return "\n".join(lines) + f"\n\n{worth}"


@checked
def choice(
    study: Study,
    entries: Mapping[str, Entry],
    arms: Sequence[str] = (),
    *,
    metric: str | None = None,
    margin: float = DEFAULT_MARGIN,
    any_code: bool = False,
) -> Choice:
    """Find the best arm of each cell, and what choosing it by the cell is worth.

    A mean that is best of several is too good by chance. So the worth is judged by cross-validation over layouts: for a
    fifth of them, arms are chosen by the means of the other four; the arm for the cell and the single arm for all cells
    both. Cells count the same in the choice of the single arm.

    Args:
        study: The study.
        entries: Entries of a journal, by key.
        arms: Arms to choose from; those with a stiffness when none is given.
        metric: Part of the results; more is better. That of the study when None.
        margin: Gain that counts as none, in the unit of the metric.
        any_code: Take walks of other versions of the code, too.

    Raises:
        UnknownNameError: An arm or metric that there is not.
        InputError: Fewer than two arms, no cell with two layouts that all arms have walked, or a metric that is no
            number.
    """
    name = metric or study.metric or METRICS[study.kind]
    chosen = tuple(arms) or tuple(arm for arm, parts in study.arms.items() if "stiffness" in parts)
    part = study.narrowed(arms=chosen)
    if len(part.arms) < 2:
        raise InputError(f"a choice needs at least two arms, got {', '.join(chosen) or 'none'}")
    cells, layouts, missing = _complete(part, entries, name, any_code)
    if not cells:
        raise InputError(
            f"no ground of '{study.name}' has two layouts on which all of {', '.join(chosen)} were walked"
        )
    reach = reach_of((entry for _, entry in study_entries(part, entries, any_code=any_code)), name)
    names = tuple(part.arms)
    pooled = np.mean([values.mean(axis=0) for values in cells.values()], axis=0)
    enough = min(len(values) for values in cells.values()) >= FOLDS
    scores, judged = _judged(cells, layouts) if enough else (np.empty((0, 2 + len(names))), None)
    gain = mean_interval((scores[:, 0] - scores[:, 1]).tolist(), judged)
    grounds, p_values = [], []
    for row, values in cells.items():
        best = _best(values, pooled)
        grounds.append((row, values, best))
        p_values += [sign_flip_p((values[:, best] - each).tolist()) for each in values.T]
    corrected = iter(holm(p_values))
    rows = []
    for row, values, best in grounds:
        told = [p is not None and p < LEVEL for p in (next(corrected) for _ in names)]
        rows.append(
            GroundChoice(
                row=row,
                layouts=len(values),
                means={arm: mean_interval(values[:, i].tolist()) for i, arm in enumerate(names)},
                best=names[best],
                same=tuple(arm for arm, other in zip(names, told, strict=True) if not other),
            )
        )
    return Choice(
        study=study.name,
        metric=name,
        arms=names,
        grounds=tuple(rows),
        single=names[int(np.argmax(pooled))],
        gain=gain,
        over={
            arm: mean_interval((scores[:, 0] - scores[:, 2 + i]).tolist(), judged)
            for i, arm in enumerate(names)
        },
        equivalence=equivalence((scores[:, 0] - scores[:, 1]).tolist(), margin, judged, reach=reach),
        missing=missing,
    )


def _complete(
    study: Study, entries: Mapping[str, Entry], metric: str, any_code: bool
) -> tuple[dict[str, Array], dict[str, list[Hashable]], int]:
    """Return values of the layouts that all arms have walked, these layouts, and the number of the others.

    Returns:
        Cell → values, shape (layouts, arms); cell → layouts in the same order; number of layouts that are left out.
    """
    found: dict[tuple[str, int], dict[str, float]] = {}
    layout: dict[tuple[str, int], Hashable] = {}
    for trial, entry in study_entries(study, entries, any_code=any_code):
        value = value_of(entry, metric)
        if value is not None:
            found.setdefault((trial.cell, trial.seed), {})[trial.arm] = value
            layout[trial.cell, trial.seed] = layout_of(trial.plain)
    rows: dict[str, list[list[float]]] = {}
    layouts: dict[str, list[Hashable]] = {}
    missing = 0
    for (cell, seed), values in found.items():
        if len(values) == len(study.arms):
            rows.setdefault(cell, []).append([values[arm] for arm in study.arms])
            layouts.setdefault(cell, []).append(layout[cell, seed])
        else:
            missing += 1
    cells = [cell.name for cell in study.cells if len(rows.get(cell.name, ())) > 1]
    return {cell: np.array(rows[cell]) for cell in cells}, {cell: layouts[cell] for cell in cells}, missing


def _best(values: Array, pooled: Array) -> int:
    """Return the arm of the greatest mean; the pooled mean decides between equal ones."""
    return int(np.argmax(values.mean(axis=0) + 1e-6 * pooled))


def _judged(
    cells: Mapping[str, Array], layouts: Mapping[str, Sequence[Hashable]]
) -> tuple[Array, list[Hashable]]:
    """Return own choice, single choice and every arm on each layout of each cell, shape (n, 2 + arms); the layouts.

    Cells that share a layout, as those that differ in the sole do, have it in the same fold.
    """
    fold_of: dict[Hashable, int] = {}
    for own_layouts in layouts.values():
        for number, layout in enumerate(own_layouts):
            fold_of.setdefault(layout, number % FOLDS)
    folds = {name: np.array([fold_of[layout] for layout in layouts[name]]) for name in cells}
    rows, judged = [], []
    for fold in range(FOLDS):
        train = {name: values[folds[name] != fold] for name, values in cells.items()}
        pooled = np.mean([values.mean(axis=0) for values in train.values()], axis=0)
        single = int(np.argmax(pooled))
        for name, values in cells.items():
            own = _best(train[name], pooled)
            rows += [[each[own], each[single], *each] for each in values[folds[name] == fold]]
            judged += [layouts[name][i] for i in np.flatnonzero(folds[name] == fold).tolist()]
    return np.array(rows), judged
