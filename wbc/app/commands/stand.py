"""`wbc stand`: a robot that stands."""

from __future__ import annotations

from wbc.app.live import LiveOptions, LiveView, interactive, interactive_text
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.settings import to_json
from wbc.sim.balance import StandSpec, StandTrial


@reports
def stand(
    options: Flat[StandSpec] = StandSpec(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Let a robot stand in the simulator, and say how still it stands and how fast the controller is."""
    trial = StandTrial(options)
    with live.show(trial.plant) as watching:
        result = trial.run(watching.after_tick)
    state = "stood" if result.upright else "FELL after"
    text = (
        f"{result.robot}, {result.mode} control, {result.foot} feet, noise {result.noise}: "
        f"{state} {result.seconds:g} s\n"
        f"  centre of mass within {result.com_error_mm:.3g} mm of its target, "
        f"zero-tilting moment point ± {result.zmp_noise_mm:.3g} mm (second half)\n"
        f"  {result.real_time_factor:.2f} x real time; a tick takes {result.tick_us['median']:.0f} us, "
        f"99 % take less than {result.tick_us['p99']:.0f} us; {result.failures} failed"
    )
    changes = watching.interventions
    return output.report(to_json(result) | interactive(changes), text + interactive_text(changes))
