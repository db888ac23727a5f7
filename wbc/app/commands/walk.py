"""`wbc walk`: a robot that walks."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from wbc.app.bench.profile import ProfileRow, profile_text, profile_walk
from wbc.app.files import check_target
from wbc.app.live import LiveOptions, LiveView, interactive, interactive_text
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.app.walk_options import WalkOptions
from wbc.app.walk_report import walk_text
from wbc.core.settings import to_json
from wbc.sim.terrain import check_clearance
from wbc.sim.walks import WalkHook, WalkTrial

if TYPE_CHECKING:
    from wbc.app.log import Recorder


@reports
def walk(
    options: Flat[WalkOptions] = WalkOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Walk in the simulator, and report how far the robot came and how well. A fall is a result like any other."""
    target = None
    if options.record is not None:
        inputs = [options.spec, options.config, options.velocity_file, *options.param, *options.policy_param]
        target = check_target("a log", options.record, (".arrow",), inputs)
    spec = options.walk()
    if options.drive:
        live = replace(live, view=True)
    if spec.plan.stairs is None:  # a swing over stairs counts its height from the higher end
        check_clearance(spec.ground(), spec.gait.swing_height)
    hooks: list[WalkHook] = []
    record: Recorder | None = None
    with ExitStack() as stack:
        trial = WalkTrial(spec)
        watch = stack.enter_context(live.watch(trial))
        if target is not None:
            from wbc.app.log import Recorder as LogFile  # noqa: PLC0415 - most walks are not recorded

            record = stack.enter_context(LogFile(target, spec=spec))
            if watch is not None:
                record.add("view/change", watch.news, about="changed from the page since the tick before")
            hooks.append(record)
        if watch is not None:
            hooks.append(watch)
        profile: tuple[ProfileRow, ...] = ()
        if options.profile:
            result, profile = profile_walk(trial, hooks)
        else:
            result = trial.run(hooks)
    changes = [] if watch is None else watch.interventions
    data = result.to_json() | interactive(changes) | {"spec": spec.to_json()}
    lost = None if record is None else record.loss
    if options.record is not None:
        data |= {"record": str(options.record), "record_failure": None if lost is None else str(lost)}
    text = walk_text(result, spec) + interactive_text(changes)
    if options.profile:
        data |= {"profile": to_json(profile)}
        text += f"\n\n{profile_text(profile)}"
    return output.report(data, text, lost)
