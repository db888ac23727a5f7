"""`wbc bench physics`: how fast the simulation of a standing robot is."""

from __future__ import annotations

from rich.progress import track

from wbc.app.bench.physics import SpeedOptions, standing_speeds
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports


@reports
def physics(
    options: Flat[SpeedOptions] = SpeedOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Steps per second of a robot that its servos keep standing, with each sole on each ground."""
    total = len(options.timestep) * len(options.terrain) * len(options.foot)
    rows = list(track(standing_speeds(options), "standing", total, console=progress_console()))
    lines = [
        "| step (ms) | ground | foot | dof | contacts | steps/s | x real time | plant, x real time | stood |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {1e3 * row.timestep:g} | {row.terrain} {1e3 * row.amplitude:g} mm | {row.foot} | {row.nv} "
        f"| {row.contacts:.0f} | {row.steps_per_s:.0f} | {row.real_time_factor:.1f} "
        f"| {row.plant_real_time_factor:.1f} | {'yes' if row.upright else 'NO'} |"
        for row in rows
    ]
    return output.report({"rows": [row.to_json() for row in rows]}, "\n".join(lines))
