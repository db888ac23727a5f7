"""What soles of variable stiffness did in the swings of a study's walks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import Study, found_entries
from wbc.sim.studies.tables import ALL

NEAR = 0.5
"""A stiffness is as wanted if it is this near, Nm/rad."""


@dataclass(frozen=True)
class SwingSummary:
    """The swings of several walks. Quantities without a value are None.

    Attributes:
        walks: Number of walks.
        swings: Number of swings.
        reached: Share whose sole had the commanded stiffness at the landing.
        decided: Share decided by the policy.
        as_wanted: Share of these in which the policy's own choice was commanded, not the part of the way that could be
            made in time.
        fallbacks: Why it was not asked or not followed → number.
        stiffness: Commanded stiffness: 10, 50 and 90 % of the swings have less, Nm/rad.
        ahead: Time from the decision to the landing: 1, 50 and 99 % of the swings have less, s.
        profile_error: |scanned − true| ground as the policy sees it (its shape), m: mean, and mean of the scans' 95th
            percentiles.
        profile_error_as_believed: The same where the controller believes the ground to be, m.
        decision_us: From a whole scan to the command, µs: median over the walks, and the longest.
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
    profile_error_as_believed: tuple[float, float] | None
    decision_us: tuple[float, float] | None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass
class _Collected:
    walks: int = 0
    swings: list[Mapping[str, Any]] = field(default_factory=list)
    clocks: list[Mapping[str, float]] = field(default_factory=list)


def swing_report(
    study: Study, entries: Mapping[str, Entry], *, any_code: bool = False
) -> dict[str, SwingSummary]:
    """Sum up the swings of each cell, and of all of them.

    Args:
        study: With walks on soles of variable stiffness; others are passed over.
        entries: Those of a journal, by key.
        any_code: Take walks of other versions of the code, too.

    Returns:
        Cell → summary; the last is "all" if there are several.
    """
    collected: dict[str, _Collected] = {}
    for trial, entry in found_entries(study, entries, any_code=any_code):
        if entry is None or entry.status != "done" or not (entry.result or {}).get("stiffness"):
            continue
        for row in (trial.cell, ALL):
            mine = collected.setdefault(row, _Collected())
            mine.walks += 1
            mine.swings += (entry.result or {})["stiffness"]
            if entry.clock and entry.clock.get("decision_us"):
                mine.clocks.append(entry.clock["decision_us"])
    total = collected.pop(ALL, None)
    if total is not None and len(collected) > 1:
        collected[ALL] = total
    return {row: _summary(mine) for row, mine in collected.items()}


def _summary(mine: _Collected) -> SwingSummary:
    swings = mine.swings
    fallbacks = Counter(s["fallback"].partition(":")[0].partition(",")[0] for s in swings if s["fallback"])
    decided = [s for s in swings if s["fallback"] is None]
    wanted = [abs(s["wanted_nm_per_rad"] - s["commanded_nm_per_rad"]) <= NEAR for s in decided]
    ahead = [s["seconds_before_landing"] for s in swings if s["seconds_before_landing"] is not None]
    return SwingSummary(
        walks=mine.walks,
        swings=len(swings),
        reached=float(np.mean([s["reached"] for s in swings])),
        decided=len(decided) / len(swings),
        as_wanted=float(np.mean(wanted)) if wanted else None,
        fallbacks=dict(fallbacks.most_common()),
        stiffness=_percentiles([s["commanded_nm_per_rad"] for s in swings], 10),
        ahead=_percentiles(ahead, 1) if ahead else None,
        profile_error=_errors(swings, "profile_error_m"),
        profile_error_as_believed=_errors(swings, "profile_error_as_believed_m"),
        decision_us=(
            (float(np.median([c["median"] for c in mine.clocks])), max(c["max"] for c in mine.clocks))
            if mine.clocks
            else None
        ),
    )


def _percentiles(values: list[float], outer: float) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, [outer, 50.0, 100.0 - outer])
    return float(low), float(middle), float(high)


def _errors(swings: list[Mapping[str, Any]], name: str) -> tuple[float, float] | None:
    known = [s[name] for s in swings if s[name] is not None]
    if not known:
        return None
    return float(np.mean([e["mean"] for e in known])), float(np.mean([e["p95"] for e in known]))


def swing_text(found: Mapping[str, SwingSummary]) -> str:
    """The summaries as a table for people."""
    width = max(len(row) for row in found)
    head = f"{'':<{width}} swings reached decided as wanted  k 10/50/90 %     ahead (s)      scan error (mm)"
    lines = [head]
    for row, s in found.items():
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
    last = list(found.values())[-1]
    if last.fallbacks:
        lines.append("not decided: " + ", ".join(f"{n} {reason}" for reason, n in last.fallbacks.items()))
    if last.decision_us is not None:
        lines.append(f"a decision takes {last.decision_us[0]:.0f} µs, {last.decision_us[1]:.0f} µs at most")
    return "\n".join(lines)
