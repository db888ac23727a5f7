"""`wbc walk`: a robot that walks. Options are fields of `WalkSpec`; `--set` and `--spec` reach all the others."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

from wbc.app.arguments import Fields
from wbc.app.files import read_object
from wbc.app.live import LiveDrive, ending, with_changes
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.output import Report, reports
from wbc.app.repeat import RepeatWalk, first_difference, recorded_walk
from wbc.app.walk_report import walk_text
from wbc.base.errors import InputError, WbcError, shown
from wbc.base.files import check_target, read_toml
from wbc.base.numbers import finite_scalar
from wbc.base.registry import allow_code
from wbc.base.settings import Positive, full_name, nested_settings, read_changes, setting_names, settings
from wbc.sim.studies.provenance import differences
from wbc.sim.trial.loops import PLANT
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.plan import TooFastError
from wbc.sim.walks.presets import USUAL, WALK_PRESETS, over
from wbc.sim.walks.settings import WalkTrialSettings
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

if TYPE_CHECKING:
    from wbc.app.view.base import View
    from wbc.sim.walks.result import WalkResult

PAIRS = ("foot_changes", "policy_params", "terrain_params", "scene_params", "changes")
"""Fields that hold names and values."""

DRIVE_TIME = 3600.0
"""Longest time of a drive from the page, s, unless another one is given."""

OPTIONS = Fields(
    WalkSpec,
    "robot eyes foot stiffness foot-param=foot_changes policy policy-param=policy_params terrain "
    "amplitude param=terrain_params scene trained guarded seed noise distance=plan.distance velocity=plan.velocity "
    "steps=plan.steps turn=plan.turn stairs=plan.stairs mode servo push=pushes loop",
    defaults=WALK_PRESETS[USUAL],
    help={
        "foot": "Foot under both ankles; flat is the robot's own sole.",
        "eyes": "Sensors by which the robot sees the ground: depth (a camera), toes (range sensors) or none.",
        "turn": "Angle of a turn on the spot, degrees; positive to the left.",
        "push": "A push such as impulse=0.2,direction=90,step=5,phase=0.5: Ns/kg, degrees (90 is left), at a share of "
        "a step.",
    },
)


@settings(kw_only=True)
class WalkOptions:
    """Options of the run, and the rest of the walk's spec.

    Attributes:
        seconds: Longest time of a drive, s.
        set: Any other setting, as name=value: dcm_p=5, single_support=0.7, payload=2.
        spec: Walk to begin with: a preset (stones, which is taken without this option, or frizza, the paper's), or a
            file, whole or in part (JSON, TOML; --json prints one). What it leaves out is as in a program: flat ground,
            flat foot, no eyes.
        record: File to write every tick to (.arrow).
        repeat: Log of a walk to repeat, with changes from its page and its end, and to compare with.
        code: Python file that the log or the spec names as its loop and that may be run; no other is.
    """

    seconds: Positive | None = None
    set: tuple[str, ...] = ()
    spec: str | None = None
    record: Path | None = None
    repeat: Path | None = None
    code: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        allow_code(self.code)


@reports
def walk(given: Annotated[Mapping[str, Any], OPTIONS], *, options: WalkOptions, live: LiveDrive) -> Report:
    """Walk in the simulator, by default 3 m over stones, and report how far the robot came and how the walk ended."""
    if options.repeat is not None and (
        given or options != WalkOptions(repeat=options.repeat, record=options.record, code=options.code)
    ):
        raise InputError(
            "--repeat takes the walk from its log: only --record, --code and the views go with it"
        )
    target = None
    if options.record is not None:
        named = (
            each for name in ("terrain_params", "policy_params") for each in given.get(name, {}).values()
        )
        target = check_target(
            "a log", options.record, (".arrow",), [options.spec, options.repeat, *map(str, named)]
        )
    first = walk_spec(given, options, live.drive) if options.repeat is None else Log.open(options.repeat)
    run = _Run(first, target)
    spec = run.spec
    if spec.plan.stairs is None:  # a swing over stairs counts its height from the higher end
        spec.ground().clears(spec.gait.full.swing_height)
    result, trial, _ = live.run(
        lambda: WalkTrial(spec, visuals=live.view is not None),
        run.simulate,
        lambda ended: f"{ended.outcome} after {ended.steps_done} steps and {ended.seconds:.1f} s",
    )
    data, text = with_changes(run.acting, trial, result.to_json(), walk_text(result, spec))
    data["spec"] = spec.to_json()
    if options.record is not None:
        lost = None if run.loss is None else str(run.loss)
        data |= {"record": str(options.record), "record_failure": lost}
    compared, words = run.comparison()
    failure = run.loss
    if failure is None and not compared.get("same", True):
        failure = WbcError(f"the walk is not that of {options.repeat}")
    return Report(data | compared, text + words, failure)


class _Run:
    """Simulation of a walk, or of that of a log again, with a log of its own.

    Attributes:
        spec: The walk.
        acting: What may change the last trial: the changes of the log that it repeats, and the page.
    """

    def __init__(self, walk: WalkSpec | Log, target: Path | None) -> None:
        self._original = walk if isinstance(walk, Log) else None
        self.spec, self._changes = recorded_walk(walk) if isinstance(walk, Log) else (walk, [])
        self._target = target
        self.acting: list[View | RepeatWalk] = []
        self._record: Recorder | None = None
        self._difference: str | None = None

    @property
    def loss(self) -> WbcError | None:
        """Failure of the recording of the last trial; None without one."""
        return None if self._record is None else self._record.loss

    def simulate(self, trial: WalkTrial, watching: list[View]) -> WalkResult:
        """Simulate a trial that some views show."""
        original, place = self._original, self._target
        repeat = [] if original is None else [RepeatWalk(self._changes)]
        acting: list[View | RepeatWalk] = [*repeat, *watching]
        self.acting = acting
        hooks: list[TrialHook] = [*acting]

        def news(_: object) -> str:
            controls = [hook.controls for hook in acting if hook.controls is not None]
            entries = [entry for each in controls for entry in each.news()] + ending(trial)
            return json.dumps(entries) if entries else ""

        with ExitStack() as stack:
            if original is not None and place is None:
                place = Path(stack.enter_context(TemporaryDirectory())) / "again.arrow"
            if place is not None:
                self._record = record = stack.enter_context(Recorder(place, spec=self.spec))
                about = "what was changed from the page since the tick before, and an end by Ctrl-C, JSON"
                record.add("view/change", news, about=about)
                hooks.insert(0, record)
            result: WalkResult = trial.run(hooks)
            if original is not None and place is not None and self.loss is None:
                self._difference = first_difference(original, Log.open(place))
            return result

    def comparison(self) -> tuple[dict[str, Any], str]:
        """Return how the last log compares with the one that it repeats, as plain values and as text."""
        if self._original is None or self.loss is not None:
            return {}, ""
        versions, other = differences(self._original.header.get("versions", {})), self._difference
        text = f"\n  repeated  {'bit for bit the same' if other is None else f'NOT THE SAME: {other}'}"
        if other is not None and versions:
            text += f"; the log is of {', '.join(versions)}"
        return {"same": other is None, "difference": other, "versions": versions}, text


def walk_spec(given: Mapping[str, Any], options: WalkOptions, drive: bool = False) -> WalkSpec:
    """Return the walk: `--set` over the other options over the walk of `--spec`, which is a preset without one."""
    upper = copy.deepcopy(dict(given))
    plan = upper.setdefault("plan", {})
    if "turn" in plan:
        plan["turn"] = math.radians(plan["turn"])
    for push in upper.get("pushes", ()):
        if "direction" in push:
            push["direction"] = math.radians(
                finite_scalar("direction of a push (degrees)", push["direction"])
            )
    for name, value in read_changes(options.set).items():
        *group, last = place_of(name).split(".", 1)
        (upper.setdefault(group[0], {}) if group else upper)[last] = value
    allow_code(upper)
    # Another simulation may have only a floor and the robot's own soles; a policy walks blind on those of its training.
    plain = upper.get("loop", PLANT) != PLANT or "trained" in upper
    lower = read_spec(options.spec or USUAL) if options.spec or not plain else {}
    if drive:
        plan["drive"] = [[options.seconds or DRIVE_TIME, 0.0, 0.0, 0.0]]
    if "policy" in upper and "foot" not in {*upper, *({} if lower is WALK_PRESETS[USUAL] else lower)}:
        upper["foot"] = "variable"  # the only one that a policy sets
    try:
        spec = WalkSpec.from_json(over(upper, lower))
    except TooFastError:
        if "mode" in {*upper, *lower}:
            raise
        spec = WalkSpec.from_json(over({**upper, "mode": "torque"}, lower))
    return spec if drive else _bounded(spec, options.seconds)


def _bounded(spec: WalkSpec, seconds: float | None) -> WalkSpec:
    """Return a walk whose drive, if it is one, ends with a stand after some seconds at the latest."""
    rows = spec.plan.drive
    if rows is None:
        if seconds is not None:
            raise InputError("seconds belong to a drive; give --drive as well")
        return spec
    if seconds is None and rows[-1][0] > DRIVE_TIME:
        raise InputError(
            f"a drive of {rows[-1][0]:g} s takes longer than {DRIVE_TIME:g} s: give its longest time, --seconds"
        )
    if seconds is None or rows[-1][0] <= seconds:
        return spec
    kept = (*(row for row in rows if row[0] < seconds), (seconds, 0.0, 0.0, 0.0))
    return replace(spec, plan=replace(spec.plan, drive=kept))


def place_of(name: str) -> str:
    """Return the place in a spec of what `--set` names: one of its fields, or under "changes" one of the settings."""
    own = [each.name for each in fields(WalkSpec)]
    for kind in ("plan", "machine", "gait"):
        own += [f"{kind}.{each.name}" for each in fields(nested_settings(WalkSpec, kind))]
    if name.partition(".")[0] in PAIRS:
        return name
    path = full_name((*own, *setting_names(WalkTrialSettings())), name)
    return path if path in own else f"changes.{path}"


def read_spec(name: str) -> Mapping[str, Any]:
    """Return a preset, or the walk in a file as plain values: a spec, a part of one, or the output of `--json`."""
    path = Path(name)
    if path.suffix.lower() == ".toml":
        data = read_toml(path)
    elif path.suffix.lower() == ".json" or path.exists():
        data = read_object("walk", path)
    else:
        return WALK_PRESETS[name]
    spec = data.get("spec", data)
    if not isinstance(spec, dict):
        raise InputError(f"spec in {path} must be an object, got {shown(spec)}")
    return spec
