"""Choice of a sole by the ground: which is best where, and what knowing it is worth on layouts it was not chosen on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from walks import gain, markdown, shown

from wbc.sim.studies import Estimate, holm, sign_flip_p

FOLDS = 5
"""Parts of the layouts of a ground: an arm is chosen on all but one of them and judged on the last."""

FAMILIES = 8
"""Number of families of grounds from which the families are the unit of chance, with all of their layouts."""

GROUND = ["terrain", "amplitude"]

STAKES = (0.5, 1.0)
"""Stakes of the test of small differences: 1 is best where few differ, 0.5 survives the largest."""


@dataclass(frozen=True)
class Choice:
    """Best arm of each ground, and the worth of choosing it.

    Attributes:
        means: Mean of each arm (columns) on each ground (rows), on the layouts that judge.
        best: Ground → arm of the greatest mean on the layouts that choose; of equal ones the best over all grounds.
        same: Ground → arms not told from it there (sign flips, 5 % after Holm's correction for all comparisons).
        single: Arm of the greatest mean over all grounds.
        gain: Arm chosen for the ground minus the single one, both chosen on other layouts than they are judged on.
        p: p-value of no gain.
        over: Arm → arm chosen for the ground minus this one, likewise.
        margin: Gain that counts as none.
        p_small: p-value of a gain of the margin or more.
    """

    means: pd.DataFrame
    best: dict[tuple[str, float], str]
    same: dict[tuple[str, float], tuple[str, ...]]
    single: str
    gain: Estimate
    p: float | None
    over: dict[str, Estimate]
    margin: float
    p_small: float

    def markdown(self) -> str:
        """Return the table of grounds and the worth of choosing."""
        arms = list(self.means.columns)
        rows = []
        for place, means in zip(self.means.index, self.means.to_numpy(), strict=True):
            same = "all" if len(self.same[place]) == len(arms) else ", ".join(self.same[place])
            name = f"{place[0]}, {1e3 * place[1]:g} mm"
            rows.append([name, *(f"{each:.1f}" for each in means), self.best[place], same])
        over = "; ".join(f"over '{arm}' {shown(each, 2)}" for arm, each in self.over.items())
        worth = (
            f"Choosing by the ground is worth {shown(self.gain, 2)} over '{self.single}', the single best "
            f"(p = {self.p:.2g}), {'' if self.p_small < 0.05 else 'not '}shown to be less than "
            f"{self.margin:g}; {over}."
        )
        return markdown(["steps", *arms, "best", "not told from it"], rows) + f"\n\n{worth}"


def choice(
    values: pd.DataFrame, *, chosen_by: int | None = None, margin: float = 0.5, reach: float = 22.0
) -> Choice:
    """Find the best arm of each ground, and what choosing it by the ground is worth.

    A mean that is best of several is too good by chance. So the worth is judged by cross-validation over layouts: for a
    fifth of them, arms are chosen by the means of the other four. With `chosen_by` that many first layouts of each
    ground choose, once for all, and the others judge.

    Args:
        values: Steps, say: a row for each layout (levels terrain, amplitude, …, seed), a column for each arm. Layouts
            that an arm has not walked are left out.
        chosen_by: Number of layouts that choose; folds when None.
        margin: Gain that counts as none.
        reach: Greatest possible difference.
    """
    whole = values.dropna()
    number = whole.groupby(level=GROUND).cumcount()
    fold = number % FOLDS if chosen_by is None else (number < chosen_by).map({True: -1, False: 0})
    judged = []
    for part in range(FOLDS if chosen_by is None else 1):
        choose, judge = whole[fold != part], whole[fold == part]
        best, single = _best(choose)
        own = [best[place] for place in zip(*(judge.index.get_level_values(n) for n in GROUND), strict=True)]
        picked = judge.to_numpy()[np.arange(len(judge)), [judge.columns.get_loc(arm) for arm in own]]
        judged.append(judge.assign(chosen=picked, single=judge[single]))
    scores = pd.concat(judged)
    choose = whole if chosen_by is None else whole[fold == -1]
    best, single = _best(choose)
    unit = "terrain" if scores.index.get_level_values("terrain").nunique() >= FAMILIES else None
    found, p = gain(scores, "chosen", "single", unit)
    return Choice(
        means=(whole if chosen_by is None else whole[fold == 0]).groupby(level=GROUND).mean(),
        best=best,
        same=_same(choose, best),
        single=single,
        gain=found,
        p=p,
        over={arm: gain(scores, "chosen", arm, unit)[0] for arm in values.columns},
        margin=margin,
        p_small=p_small((scores["chosen"] - scores["single"]).tolist(), margin, reach),
    )


def p_small(differences: Sequence[float], margin: float, reach: float) -> float:
    """Return the p-value of a mean difference that is not smaller than a margin, of differences within ± `reach`.

    A t-test does not know of falls that are rare and cost all steps. A player who stakes a share of his money on each
    layout against such a mean wins nothing on average; the inverse of what he has won in the end is a p-value.

    Source: D. Schuirmann, J. Pharmacokin. Biopharm. 15(6), 1987 (two one-sided tests); I. Waudby-Smith, A. Ramdas,
    "Estimating means of bounded random variables by betting", J. R. Stat. Soc. B 86(1), 2024.
    """
    found = np.array(differences)
    lead = (margin - np.outer([1.0, -1.0], found)) / (reach - margin)
    won = np.mean([np.prod(1.0 + stake * lead, axis=1) for stake in STAKES], axis=0)
    return float(np.clip(1.0 / np.maximum(won, 1e-300), 0.0, 1.0).max())


def _best(values: pd.DataFrame) -> tuple[dict[tuple[str, float], str], str]:
    """Return the best arm of each ground and of all; the mean over all grounds decides between equal ones."""
    means = values.groupby(level=GROUND).mean()
    pooled = means.mean()
    return (means + 1e-6 * pooled).idxmax(axis=1).to_dict(), str(pooled.idxmax())


def _same(
    values: pd.DataFrame, best: dict[tuple[str, float], str]
) -> dict[tuple[str, float], tuple[str, ...]]:
    """Return the arms of each ground that cannot be told from the best one, which is compared with the others alone."""
    compared = {
        (place, arm): sign_flip_p((ground[best[place]] - ground[arm]).tolist())
        for place, ground in values.groupby(level=GROUND)
        for arm in values.columns
        if arm != best[place]
    }
    p = dict(zip(compared, holm(list(compared.values())), strict=True))
    told = {pair for pair, value in p.items() if value is not None and value < 0.05}
    return {place: tuple(arm for arm in values.columns if (place, arm) not in told) for place in best}
