"""Choice of an arm by the ground: which is best where, and what knowing it is worth on layouts it was not chosen on."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.core.errors import Array, InputError, whole_number
from wbc.core.settings import to_json
from wbc.sim.studies.best_stiffness import Label
from wbc.sim.studies.intervals import Equivalence, Estimate, equivalence, holm, mean_interval, sign_flip_p
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import Study, study_entries
from wbc.sim.studies.study_table import layout_of, reach_of, value_of

FOLDS = 5
"""Parts of the layouts of a ground: an arm is chosen on all but one of them and judged on the last."""

DEFAULT_MARGIN = 0.5
"""Gain that counts as none, in the unit of the metric; half a step."""

LEVEL = 0.05
"""Level of the tests."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class GroundChoice:
    """Best arm on one ground.

    Attributes:
        row: Name of the ground.
        layouts: Number of layouts of the means: all that all arms have walked, or those of them that judge.
        means: Arm → mean of the metric over them, with its interval.
        best: Arm of the greatest mean on the layouts that choose; of several, the one that is best over all grounds.
        same: Arms that cannot be told from it there (sign flips, 5 % after Holm's correction for all grounds and arms).
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
        chosen_by: Number of first layouts that choose while the others judge; None for folds.
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
    chosen_by: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        plain: dict[str, Any] = to_json(self)
        return plain

    def labels(self, study: Study) -> dict[str, Label]:
        """Return the stiffness of the best arm of each ground, for the table of a model: cell → label."""
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
        first = f"the first {self.chosen_by} layouts"
        what = f"{self.metric.replace('_', ' ')} (layouts)"
        columns = ("best", "not told from it")
        if self.chosen_by is not None:
            columns = (f"best of {first}", "not told from it there")
        lines = [
            f"| {' | '.join((what, *self.arms, *columns))} |",
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
        how, judging = f"on other layouts than it is judged on ({FOLDS} folds)", "layouts"
        if self.chosen_by is not None:
            how, judging = f"by {first}", "others"
        worth = (
            f"Choosing for each ground, {how}, is worth {self.gain.text(2)} over the single best arm chosen likewise "
            f"(here {self.single}), on {self.gain.n} {judging}; it is "
            f"{'' if self.equivalence.equivalent else 'not '}shown to be less than {small:g} (two one-sided tests, "
            f"5 %). {over[:1].upper()}{over[1:]}."
        )
        return "\n".join(lines) + f"\n\n{worth}"


def choice(
    study: Study,
    entries: Mapping[str, Entry],
    arms: Sequence[str] = (),
    *,
    metric: str | None = None,
    margin: float = DEFAULT_MARGIN,
    chosen_by: int | None = None,
) -> Choice:
    """Find the best arm of each cell, and what choosing it by the cell is worth.

    A mean that is best of several is too good by chance. So the worth is judged by cross-validation over layouts: for a
    fifth of them, arms are chosen by the means of the other four; the arm for the cell and the single arm for all cells
    both. Cells count the same in the choice of the single arm. With `chosen_by` that many first seeds of the study
    choose, once for all, and the others judge: a confirmation where these were walked after the choice.

    `arms` are those with a stiffness when none is given; more of `metric`, that of the study when None, is better; a
    gain below `margin`, in its unit, counts as none. What leaves nothing to choose from or to judge by is an
    `InputError`.
    """
    name = metric or study.measured
    chosen = tuple(arms) or tuple(arm for arm, parts in study.arms.items() if "stiffness" in parts)
    part = study.narrowed(arms=chosen)
    if len(part.arms) < 2:
        raise InputError(f"a choice needs at least two arms, got {', '.join(chosen) or 'none'}")
    grounds, missing = _complete(part, entries, name)
    if not grounds:
        raise InputError(
            f"no ground of '{study.name}' has two layouts on which all of {', '.join(chosen)} were walked"
        )
    reach = reach_of((entry for _, entry in study_entries(part, entries)), name)
    names = tuple(part.arms)
    if chosen_by is None:
        enough = min(len(ground.values) for ground in grounds) >= FOLDS
        splits = _folds(grounds) if enough else []
        choose = judge = [np.ones(len(ground.values), dtype=bool) for ground in grounds]
    else:
        judge = _others(part, grounds, chosen_by)
        splits, choose = [judge], [~each for each in judge]
    scores, judged = _judged(grounds, splits, len(names))
    gain = mean_interval((scores[:, 0] - scores[:, 1]).tolist(), judged)
    pooled = _pooled(grounds, choose)
    best = [_best(ground.values[by], pooled) for ground, by in zip(grounds, choose, strict=True)]
    p_values = [
        sign_flip_p((ground.values[by, own] - other).tolist())
        for ground, by, own in zip(grounds, choose, best, strict=True)
        for other in ground.values[by].T
    ]
    corrected = iter(holm(p_values))
    rows = []
    for ground, by, own in zip(grounds, judge, best, strict=True):
        told = [p is not None and p < LEVEL for p in (next(corrected) for _ in names)]
        rows.append(
            GroundChoice(
                row=ground.name,
                layouts=int(by.sum()),
                means={arm: mean_interval(ground.values[by, i].tolist()) for i, arm in enumerate(names)},
                best=names[own],
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
        chosen_by=chosen_by,
    )


@dataclass(frozen=True, eq=False)
class _Ground:
    """Layouts of a cell that all arms have walked: values, shape (layouts, arms), layouts and seeds of these rows."""

    name: str
    values: Array
    layouts: Sequence[Hashable]
    seeds: Sequence[int]


def _complete(study: Study, entries: Mapping[str, Entry], metric: str) -> tuple[list[_Ground], int]:
    """Return the cells with two layouts that all arms have walked, and the number of layouts that are left out."""
    found: dict[tuple[str, int], dict[str, float]] = {}
    layout: dict[tuple[str, int], Hashable] = {}
    for trial, entry in study_entries(study, entries):
        value = value_of(entry, metric)
        if value is not None:
            found.setdefault((trial.cell, trial.seed), {})[trial.arm] = value
            layout[trial.cell, trial.seed] = layout_of(trial.plain)
    whole = {place: values for place, values in found.items() if len(values) == len(study.arms)}
    grounds = []
    for cell in study.cells:
        seeds = [seed for name, seed in whole if name == cell.name]
        if len(seeds) > 1:
            rows = [[whole[cell.name, seed][arm] for arm in study.arms] for seed in seeds]
            layouts = [layout[cell.name, seed] for seed in seeds]
            grounds.append(_Ground(cell.name, np.array(rows), layouts, seeds))
    return grounds, len(found) - len(whole)


def _best(values: Array, pooled: Array) -> int:
    """Return the arm of the greatest mean; the pooled mean decides between equal ones."""
    return int(np.argmax(values.mean(axis=0) + 1e-6 * pooled))


def _pooled(grounds: Sequence[_Ground], choose: Sequence[Mask]) -> Array:
    """Return the mean of each arm over all grounds, by the layouts that choose, shape (arms,)."""
    means = [ground.values[by].mean(axis=0) for ground, by in zip(grounds, choose, strict=True)]
    return np.asarray(np.mean(means, axis=0))


def _folds(grounds: Sequence[_Ground]) -> list[list[Mask]]:
    """Return the layouts that judge in each fold, a mask for each ground.

    Cells that share a layout, as those that differ in the sole do, have it in the same fold.
    """
    fold_of: dict[Hashable, int] = {}
    for ground in grounds:
        for number, layout in enumerate(ground.layouts):
            fold_of.setdefault(layout, number % FOLDS)
    folds = [np.array([fold_of[layout] for layout in ground.layouts]) for ground in grounds]
    return [[own == fold for own in folds] for fold in range(FOLDS)]


def _others(study: Study, grounds: Sequence[_Ground], chosen_by: int) -> list[Mask]:
    """Return the layouts after the first ones, a mask a ground; `InputError` for less than two first or none after."""
    first = study.seeds[: whole_number("chosen_by", chosen_by, low=1)]
    masks = [~np.isin(ground.seeds, first) for ground in grounds]
    for ground, mask in zip(grounds, masks, strict=True):
        if (~mask).sum() < 2 or not mask.any():
            raise InputError(
                f"chosen_by must leave two layouts to choose by and one to judge on each ground, got {chosen_by}; of "
                f"'{ground.name}' that is {(~mask).sum()} and {mask.sum()} of those that all arms have walked"
            )
    return masks


def _judged(
    grounds: Sequence[_Ground], splits: Sequence[Sequence[Mask]], arms: int
) -> tuple[Array, list[Hashable] | None]:
    """Return own choice, single choice and every arm on each layout that judges, shape (n, 2 + arms); these layouts."""
    rows: list[list[float]] = []
    judged: list[Hashable] = []
    for judge in splits:
        choose = [~mask for mask in judge]
        pooled = _pooled(grounds, choose)
        single = int(np.argmax(pooled))
        for ground, by, mask in zip(grounds, choose, judge, strict=True):
            own = _best(ground.values[by], pooled)
            rows += [[each[own], each[single], *each] for each in ground.values[mask]]
            judged += [ground.layouts[i] for i in np.flatnonzero(mask).tolist()]
    return np.reshape(np.array(rows), (-1, 2 + arms)), judged or None
