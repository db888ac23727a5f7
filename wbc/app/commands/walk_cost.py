"""`wbc bench walk`: where the time of a simulated walk goes."""

from __future__ import annotations

from rich.progress import track

from wbc.app.bench.walk import CASES, PARTS, WalkCostOptions, walk_costs
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports


@reports
def walk(
    options: Flat[WalkCostOptions] = WalkCostOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Time the closed loop of walks, and say where it goes: physics, observer, stabilizer, program and the rest."""
    rows = list(track(walk_costs(options), "walking", len(CASES), console=progress_console()))
    lines = [
        "| us of a control period | " + " | ".join(row.name for row in rows) + " |",
        "|---|" + "---:|" * len(rows),
    ]
    lines += [
        f"| {part} | " + " | ".join(f"{row.parts_us[part]:.0f}" for row in rows) + " |" for part in PARTS
    ]
    lines += [
        "| all | " + " | ".join(f"{row.period_us:.0f}" for row in rows) + " |",
        "| x real time | " + " | ".join(f"{row.real_time_factor:.1f}" for row in rows) + " |",
        "| physics: collision, constraints | "
        + " | ".join(f"{row.collision_share:.0%}, {row.constraint_share:.0%}" for row in rows)
        + " |",
        "| steps done | " + " | ".join(f"{row.steps_done} of {row.steps_planned}" for row in rows) + " |",
    ]
    return output.report({"rows": [row.to_json() for row in rows]}, "\n".join(lines))
