"""`wbc stand`: a robot that stands."""

from __future__ import annotations

from wbc.app.live import LiveView, with_changes
from wbc.app.output import Report, reports
from wbc.base.errors import WbcError
from wbc.sim.balance.standing import StandSpec, StandTrial


@reports
def stand(options: StandSpec, *, live: LiveView) -> Report:
    """Let a robot stand in the simulator, and report how still it stands and how fast the controller is."""
    result, trial, hooks = live.run(
        lambda: StandTrial(options, visuals=live.view is not None),
        lambda trial, hooks: trial.run(hooks),
        lambda ended: f"{'stood' if ended.upright else 'fell after'} {ended.seconds:g} s",
    )
    failed = None
    if result.failures:
        ticks = round(result.seconds / options.period)
        failed = WbcError(f"{result.failures} of {ticks} ticks failed: {trial.drives.reason}")
    state = "FELL after" if not result.upright else "stood" if failed is None else "FAILED within"
    steps = f", {result.steps_taken} steps" if options.steps == "allowed" else ""
    text = (
        f"{result.robot}, {result.mode} control, {result.foot} feet, noise {result.noise}: "
        f"{state} {result.seconds:g} s{steps}\n"
        f"  centre of mass within {1e3 * result.com_error:.3g} mm of its target, "
        f"zero-tilting moment point ± {1e3 * result.zmp_noise:.3g} mm (second half)\n"
        f"  {result.clock}; {result.failures} failed"
    )
    data, text = with_changes(hooks, trial, result.to_json(), text)
    return Report(data, text, failed)
