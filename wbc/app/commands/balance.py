"""`wbc stand` and `wbc push`: a robot that stands, and what it recovers from."""

from __future__ import annotations

import logging

from rich.progress import track

from wbc.app.live import LiveView, with_changes
from wbc.app.output import Output, Report, progress_console, quiet, reports
from wbc.base.errors import WbcError
from wbc.base.settings import to_json
from wbc.sim.balance.push_recovery import PushTableSpec, format_push_table, push_table
from wbc.sim.balance.standing import StandSpec, StandTrial


@reports
def stand(
    options: StandSpec,
    *,
    live: LiveView,
    output: Output,
) -> Report:
    """Let a robot stand in the simulator, and report how still it stands and how fast the controller is."""
    result, trial, hooks = live.run(
        lambda: StandTrial(options, visuals=live.watched),
        lambda trial, hooks: trial.run(hooks),
        lambda ended: f"{'stood' if ended.upright else 'fell after'} {ended.seconds:g} s",
    )
    failed = None
    if result.failures:
        ticks = round(result.seconds / options.period)
        failed = WbcError(f"{result.failures} of {ticks} ticks failed: {trial.control.reason}")
    state = "FELL after" if not result.upright else "stood" if failed is None else "FAILED within"
    steps = f", {result.steps_taken} steps" if options.steps == "allowed" else ""
    text = (
        f"{result.robot}, {result.mode} control, {result.foot} feet, noise {result.noise}: "
        f"{state} {result.seconds:g} s{steps}\n"
        f"  centre of mass within {result.com_error_mm:.3g} mm of its target, "
        f"zero-tilting moment point ± {result.zmp_noise_mm:.3g} mm (second half)\n"
        f"  {result.real_time_factor:.2f} x real time; a tick takes {result.tick_us['median']:.0f} us, "
        f"99 % take less than {result.tick_us['p99']:.0f} us; {result.failures} failed"
    )
    data, text = with_changes(hooks, trial, to_json(result), text)
    return output.report(data, text, failed)


@reports
def push(
    options: PushTableSpec,
    *,
    output: Output,
) -> Report:
    """Push standing robots on the torso from all sides: largest impulse per kg that they recover from."""
    total = len(options.specs()) * options.directions
    with quiet(
        "wbc.core", logging.INFO if output.verbose else logging.CRITICAL
    ):  # robots are expected to fall
        cells = list(track(push_table(options), "pushing", total=total, console=progress_console()))
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
