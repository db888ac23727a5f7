"""Summary of the swings of soles of variable stiffness, over the walks of a study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import ALL, Study, study_entries
from wbc.tasks.scheduling.record import as_good_as

TOLERANCE = 0.05
"""Largest difference of equal stiffnesses, as a share."""


@dataclass(frozen=True)
class SwingSummary:
    """Summary of the swings of several walks. Quantities without a value are None.

    Attributes:
        walks: Number of walks.
        swings: Number of swings.
        reached: Share of swings whose stiffness was reached before touch-down.
        decided: Share of swings whose stiffness the policy decided.
        as_wanted: Share of these in which the choice of the policy was commanded, not the part of the way to it that
            could be made in time.
        fallbacks: Reason why the policy was not asked or not followed → number.
        stiffness: Commanded stiffness: 10th, 50th and 90th percentile over the swings, Nm/rad.
        ahead: Time from the decision to the landing: 1st, 50th and 99th percentile over the swings, s.
        profile_error: |scanned − true| ground as the policy sees it (its shape), m: mean, and mean of the scans' 95th
            percentiles.
        decision_us: Time from the complete scan to the command, µs: median over the walks, and the longest.
    """

    walks: int
    swings: int
    reached: float
    decided: float
    as_wanted: float | None
    fallbacks: dict[str, int]
    stiffness: tuple[float, float, float]
    ahead: tuple[float, float, float] | None
    profile_error: tuple[float, float] | None
    decision_us: tuple[float, float] | None


def swing_summaries(study: Study, entries: Mapping[str, Entry]) -> dict[str, SwingSummary]:
    """Sum up the swings of each cell of a study, and of all cells as "all" if there are several.

    Walks on other soles than those of variable stiffness are left out.
    """
    walks: dict[str, list[Entry]] = {}
    for trial, entry in study_entries(study, entries):
        if entry is not None and entry.status == "done" and (entry.result or {}).get("stiffness"):
            walks.setdefault(trial.cell, []).append(entry)
    found = {cell: _summary(mine) for cell, mine in walks.items()}
    if len(walks) > 1:
        found[ALL] = _summary([entry for mine in walks.values() for entry in mine])
    return found


def _summary(walks: Sequence[Entry]) -> SwingSummary:
    swings = [swing for entry in walks for swing in (entry.result or {})["stiffness"]]
    clocks = [e.clock["decision_us"] for e in walks if e.clock and e.clock.get("decision_us")]
    fallbacks = Counter(s["fallback"].partition(":")[0].partition(",")[0] for s in swings if s["fallback"])
    decided = [s for s in swings if s["fallback"] is None]
    followed = [as_good_as(s["wanted_nm_per_rad"], s["commanded_nm_per_rad"], TOLERANCE) for s in decided]
    ahead = [s["seconds_before_landing"] for s in swings if s["seconds_before_landing"] is not None]
    errors = [(e["mean"], e["p95"]) for s in swings if (e := s["profile_error_m"]) is not None]
    return SwingSummary(
        walks=len(walks),
        swings=len(swings),
        reached=float(np.mean([s["reached"] for s in swings])),
        decided=len(decided) / len(swings),
        as_wanted=float(np.mean(followed)) if followed else None,
        fallbacks=dict(fallbacks.most_common()),
        stiffness=_percentiles([s["commanded_nm_per_rad"] for s in swings], 10),
        ahead=_percentiles(ahead, 1) if ahead else None,
        profile_error=tuple(np.mean(errors, axis=0).tolist()) if errors else None,
        decision_us=(
            (float(np.median([c["median"] for c in clocks])), max(c["max"] for c in clocks))
            if clocks
            else None
        ),
    )


def _percentiles(values: list[float], outer: float) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, [outer, 50.0, 100.0 - outer])
    return float(low), float(middle), float(high)


def swing_table(summaries: Mapping[str, SwingSummary]) -> str:
    """Return summaries as a table for people."""
    width = max(len(row) for row in summaries)
    head = f"{'':<{width}} swings reached decided as wanted  k 10/50/90 %     ahead (s)      scan error (mm)"
    lines = [head]
    for row, s in summaries.items():
        k = "/".join(f"{value:.3g}" for value in s.stiffness)
        ahead = "" if s.ahead is None else "/".join(f"{value:.2f}" for value in s.ahead)
        error = (
            ""
            if s.profile_error is None
            else f"{1e3 * s.profile_error[0]:.1f}, 95 % {1e3 * s.profile_error[1]:.1f}"
        )
        wanted = "" if s.as_wanted is None else f"{100 * s.as_wanted:.1f} %"
        lines.append(
            f"{row:<{width}} {s.swings:6d} {100 * s.reached:5.1f} % {100 * s.decided:5.1f} % {wanted:>9}"
            f"  {k:<15} {ahead:<15} {error}"
        )
    last = list(summaries.values())[-1]
    if last.fallbacks:
        lines.append("not decided: " + ", ".join(f"{n} {reason}" for reason, n in last.fallbacks.items()))
    if last.decision_us is not None:
        lines.append(f"a decision takes {last.decision_us[0]:.0f} µs, {last.decision_us[1]:.0f} µs at most")
    return "\n".join(lines)
