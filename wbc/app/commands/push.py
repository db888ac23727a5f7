"""`wbc push`: how hard a standing robot can be pushed."""

from __future__ import annotations

import logging

from rich.progress import track

from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.settings import to_json
from wbc.sim.balance import PushTableSpec, format_push_table, push_table


@reports
def push(
    options: Flat[PushTableSpec] = PushTableSpec(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Push standing robots on the torso from all sides: largest impulse per kg that they recover from."""
    if not output.verbose:
        logging.getLogger("wbc.core").setLevel(logging.CRITICAL)  # robots that fall are expected here
    cells = []
    total = len(options.specs())
    for cell in track(push_table(options), "pushing", total=total, console=progress_console()):
        cells.append(cell)
    text = (
        f"Largest impulse recovered, Ns/kg, force constant for {options.duration:g} s; 0° is forward, 90° left\n\n"
        + format_push_table(cells)
    )
    data = {
        "unit": "Ns/kg",
        "duration_s": options.duration,
        "resolution": options.resolution,
        "noise": options.noise,
        "cells": to_json(cells),
    }
    return output.report(data, text)
