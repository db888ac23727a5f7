"""Markdown tables of foot studies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

import numpy as np

from wbc.core.errors import InputError
from wbc.sim.rig.study import Deflection, StabilityRow, StiffnessRow

MEANS = ("contacts", "contact_area", "support_area", "ankle_height", "absorbed", "peak_force")
"""Fields that are averaged over grounds."""


def stability_table(rows: Iterable[StabilityRow]) -> str:
    """Return the Markdown table of a stability study, one line per physics step and stiffness."""
    groups: dict[tuple[float, float], list[StabilityRow]] = {}
    for row in rows:
        groups.setdefault((row.timestep, row.stiffness), []).append(row)
    lines = [
        "| dt (ms) | k (Nm/rad) | cells | diverged | worst mean force error (%) | force std median / max (N) "
        "| loop gap hold / peak (mm) | penetration hold / peak (mm) | jitter median (rad/s) |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (timestep, stiffness), cells in groups.items():
        good = [row for row in cells if not row.diverged]
        worst = {
            name: max((abs(getattr(row, name)) for row in good), default=math.nan)
            for name in (
                "balance_error",
                "force_std",
                "loop_gap",
                "loop_gap_peak",
                "penetration",
                "penetration_peak",
            )
        }
        middle = {
            name: median(getattr(row, name) for row in good) if good else math.nan
            for name in ("force_std", "jitter")
        }
        lines.append(
            f"| {1e3 * timestep:g} | {stiffness:g} | {len(cells)} | {len(cells) - len(good)} "
            f"| {1e2 * worst['balance_error']:.2f} | {middle['force_std']:.4f} / {worst['force_std']:.1f} "
            f"| {1e3 * worst['loop_gap']:.2f} / {1e3 * worst['loop_gap_peak']:.2f} "
            f"| {1e3 * worst['penetration']:.2f} / {1e3 * worst['penetration_peak']:.2f} | {middle['jitter']:.5f} |"
        )
    return "\n".join(lines)


def stiffness_means(rows: Iterable[StiffnessRow]) -> list[dict[str, Any]]:
    """Return means over the grounds of each family.

    Returns:
        For each family and stiffness: `ground`, `stiffness` (infinite for a rigid foot), `grounds` (their number), and
        for each of `MEANS` a pair of mean and standard error (NaN for one ground); if a rigid foot was tried on the
        same grounds, also `more_contact_area` and `more_support_area`: differences to the rigid foot, ground by
        ground, m².

    Raises:
        InputError: Two grounds of one family and seed, such as two amplitudes.
    """
    groups: dict[tuple[str, float], dict[int, StiffnessRow]] = {}
    for row in rows:
        group = groups.setdefault((row.ground, row.stiffness), {})
        if row.seed in group:
            raise InputError(
                f"each ground of a family must have its own seed, got two of '{row.ground}' with seed {row.seed} at "
                f"{row.stiffness:g} Nm/rad"
            )
        group[row.seed] = row
    means = []
    for (ground, stiffness), cells in sorted(groups.items()):
        entry: dict[str, Any] = {"ground": ground, "stiffness": stiffness, "grounds": len(cells)}
        for name in MEANS:
            entry[name] = _mean_and_error([getattr(row, name) for row in cells.values()])
        rigid = groups.get((ground, math.inf), {})
        both = [seed for seed in cells if seed in rigid]
        if both and stiffness != math.inf:
            for name in ("contact_area", "support_area"):
                more = [getattr(cells[seed], name) - getattr(rigid[seed], name) for seed in both]
                entry[f"more_{name}"] = _mean_and_error(more)
        means.append(entry)
    return means


COLUMNS = (
    ("contacts", "contacts", 1.0, 1),
    ("contact_area", "contact area (cm²)", 1e4, 0),
    ("more_contact_area", "more than rigid", 1e4, 0),
    ("support_area", "support area (cm²)", 1e4, 0),
    ("more_support_area", "more than rigid", 1e4, 0),
    ("ankle_height", "ankle height (mm)", 1e3, 1),
    ("peak_force", "peak force (N)", 1.0, 0),
)
"""Columns of the table over stiffness: key of `stiffness_means`, heading, scale and digits."""


def stiffness_table(rows: Iterable[StiffnessRow]) -> str:
    """Return the Markdown table of contacts, areas and heights over stiffness: mean ± standard error over grounds."""
    headings = " | ".join(heading for _, heading, _, _ in COLUMNS)
    lines = [f"| ground | k (Nm/rad) | grounds | {headings} |", "|---" * (3 + len(COLUMNS)) + "|"]
    for row in stiffness_means(rows):
        cells = [_mean(row.get(key), scale, digits) for key, _, scale, digits in COLUMNS]
        lines.append(
            f"| {row['ground']} | {_stiffness(row['stiffness'])} | {row['grounds']} | {' | '.join(cells)} |"
        )
    return "\n".join(lines)


def deflection_table(curves: Iterable[Deflection]) -> str:
    """Return the Markdown table of force–deflection curves: deflection of the ankle, one line per stiffness."""
    drawn = list(curves)
    loads = max((curve.load for curve in drawn), key=len, default=())
    lines = [
        "| k (Nm/rad) | " + " | ".join(f"{load:.0f} N" for load in loads) + " |",
        "|---" * (1 + len(loads)) + "|",
    ]
    for curve in drawn:
        cells = [f"{1e3 * value:.1f}" for value in curve.deflection]
        cells += ["diverged"] * (len(loads) - len(cells))
        lines.append(f"| {_stiffness(curve.stiffness)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    array = np.array(values, dtype=float)
    error = array.std(ddof=1) / math.sqrt(array.size) if array.size > 1 else math.nan
    return float(array.mean()), float(error)


def _mean(pair: tuple[float, float] | None, scale: float, digits: int) -> str:
    if pair is None:
        return ""
    mean, error = pair
    text = f"{scale * mean:.{digits}f}"
    return text if math.isnan(error) else f"{text} ± {scale * error:.{digits}f}"


def _stiffness(stiffness: float) -> str:
    return "rigid" if math.isinf(stiffness) else f"{stiffness:g}"
