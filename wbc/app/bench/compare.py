"""Comparison of two records of benchmarks: what became slower, beyond the noise of their repeats.

A figure became slower if the Mann–Whitney test of its repeats, two-sided and corrected by Holm for the number of
figures, has p below 0.05, and its median grew by more than the threshold. The interval of the ratio of medians is a
percentile bootstrap over the repeats.

Repeats of one record share a process and a quarter of an hour; what changes between two, such as the clock of the
processor, is not in their noise. The threshold stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from wbc.app.bench.record import BenchRecord
from wbc.core.errors import InputError
from wbc.sim.studies.intervals import holm

SIGNIFICANCE = 0.05
"""Largest p-value, after Holm's correction, of a difference."""

MOST = 100.0
"""Largest threshold."""

RESAMPLES = 5000
"""Resamples of the bootstrap."""

Verdict = Literal["slower", "faster", "same"]


@dataclass(frozen=True)
class FigureChange:
    """One figure of two records.

    Attributes:
        benchmark: Name of the benchmark.
        figure: Name of the figure.
        before_us: Its median in the first record, µs.
        after_us: Its median in the second, µs.
        ratio: Second over first.
        low: Lower end of the ratio's interval, 95 %.
        high: Upper end.
        p: p-value of the Mann–Whitney test, after Holm's correction.
        verdict: "slower", "faster", or "same": no difference that the repeats and the threshold show.
    """

    benchmark: str
    figure: str
    before_us: float
    after_us: float
    ratio: float
    low: float
    high: float
    p: float
    verdict: Verdict


@dataclass(frozen=True)
class RecordComparison:
    """Two records beside each other.

    Attributes:
        changes: Every figure that both have, by its benchmark; the one that grew most first.
        only_one: Figures that one of the records alone has.
        notes: Differences of machine, versions and commit, and too few repeats.
    """

    changes: tuple[FigureChange, ...]
    only_one: tuple[str, ...]
    notes: tuple[str, ...]


def compare_records(before: BenchRecord, after: BenchRecord, threshold: float) -> RecordComparison:
    """Compare all figures of two records.

    Args:
        before: The first.
        after: The second.
        threshold: Share by which a median must grow to be slower, such as 0.05.

    Raises:
        InputError: A negative threshold, records without a benchmark in common, or of benchmarks with other options.
    """
    if not 0.0 <= threshold <= MOST:
        raise InputError(f"the threshold must be a share from 0 to {MOST:g}, got {threshold}")
    common = [name for name in before.benchmarks if name in after.benchmarks]
    if not common:
        first, second = (", ".join(record.benchmarks) or "none" for record in (before, after))
        raise InputError(f"the records are of other benchmarks: the first of {first}, the second of {second}")
    pairs: list[tuple[str, str, Sequence[float], Sequence[float]]] = []
    only_one: list[str] = [f"all of {name}" for name in {*before.benchmarks} ^ {*after.benchmarks}]
    for name in common:
        one, two = before.benchmarks[name], after.benchmarks[name]
        for option in {**one.options, **two.options}:
            values = [benchmark.options.get(option) for benchmark in (one, two)]
            if values[0] != values[1]:
                raise InputError(
                    f"the records are of other benchmarks: {option} of {name} is {values[0]} in the first, {values[1]} "
                    f"in the second"
                )
        only_one += [f"{name}: {figure}" for figure in {*one.samples_us} ^ {*two.samples_us}]
        pairs += [
            (name, figure, values, two.samples_us[figure])
            for figure, values in one.samples_us.items()
            if figure in two.samples_us
        ]
    tests = [float(stats.mannwhitneyu(a, b).pvalue) for _, _, a, b in pairs]
    changes = [
        _change(*pair, p=1.0 if p is None else p, threshold=threshold)
        for pair, p in zip(pairs, holm(tests), strict=True)
    ]
    changes.sort(key=lambda change: (common.index(change.benchmark), -change.ratio))
    return RecordComparison(tuple(changes), tuple(sorted(only_one)), tuple(_notes(before, after, pairs)))


def _change(
    benchmark: str,
    figure: str,
    before: Sequence[float],
    after: Sequence[float],
    *,
    p: float,
    threshold: float,
) -> FigureChange:
    rng = np.random.default_rng(0)
    medians = [np.median(rng.choice(values, (RESAMPLES, len(values))), axis=1) for values in (before, after)]
    low, high = np.percentile(medians[1] / medians[0], [2.5, 97.5]).tolist()
    one, two = float(np.median(before)), float(np.median(after))
    verdict: Verdict = "same"
    if p < SIGNIFICANCE and two > one * (1.0 + threshold):
        verdict = "slower"
    elif p < SIGNIFICANCE and two * (1.0 + threshold) < one:
        verdict = "faster"
    return FigureChange(benchmark, figure, one, two, two / one, low, high, p, verdict)


def _notes(
    before: BenchRecord,
    after: BenchRecord,
    pairs: Sequence[tuple[str, str, Sequence[float], Sequence[float]]],
) -> list[str]:
    notes = []
    for what in ("processor", "cores", "system"):
        one, two = getattr(before.machine, what), getattr(after.machine, what)
        if one != two:
            notes.append(f"{what}: {one}, then {two}; ratios between machines say little about the code")
    for name in {**before.versions, **after.versions}:
        one, two = before.versions.get(name), after.versions.get(name)
        if one != two:
            notes.append(f"{name}: {one}, then {two}")
    if before.commit != after.commit:
        notes.append(f"commit: {before.commit}, then {after.commit}")
    fewest = min((min(len(a), len(b)) for _, _, a, b in pairs), default=0)
    if pairs and 2.0 * len(pairs) / math.comb(2 * fewest, fewest) >= SIGNIFICANCE:
        notes.append(
            f"{fewest} repeats are too few to tell a difference among {len(pairs)} figures; record more"
        )
    return notes


def comparison_text(comparison: RecordComparison) -> str:
    """Return what became slower and faster, as text."""
    count = len(comparison.changes)
    lines = []
    for verdict in ("slower", "faster"):
        found = [change for change in comparison.changes if change.verdict == verdict]
        lines.append(f"{len(found)} of {count} figures became {verdict}" + (":" if found else ""))
        lines += [
            f"  {change.benchmark}, {change.figure}: {change.before_us:.1f} → {change.after_us:.1f} us, "
            f"x {change.ratio:.2f} ({change.low:.2f} … {change.high:.2f}), p = {change.p:.1g}"
            for change in found
        ]
    if comparison.only_one:
        lines.append(f"in one record alone: {', '.join(comparison.only_one)}")
    return "\n".join([*lines, *(f"note: {note}" for note in comparison.notes)])
