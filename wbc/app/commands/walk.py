"""`wbc walk`: a robot that walks."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from wbc.app.files import check_target
from wbc.app.live import LiveOptions, LiveView, interactive, interactive_text
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.changes import read_changes
from wbc.core.errors import InputError, finite_scalar, unknown_name
from wbc.core.files import read_text
from wbc.core.settings import from_json
from wbc.sim.balance.standing import Mode
from wbc.sim.terrain.checks import check_clearance
from wbc.sim.terrain.report import read_params
from wbc.sim.walks import (
    WalkHook,
    WalkPlan,
    WalkPush,
    WalkResult,
    WalkSpec,
    WalkTrial,
)
from wbc.walking.planning.gait import Gait

STONES_AMPLITUDE = 0.02
"""Height of the stones that are walked over when no ground is named, m."""

TRACK = ("length", "width", "start", "strip", "resolution", "sole_radius")
"""Parameters of every ground, numbers in m, beside those of its family."""


@dataclass(frozen=True, kw_only=True)
class WalkOptions:
    """Which robot walks where, and how.

    Without any options: 3 m over unknown stones, on soles whose stiffness is set to what each swing foot has scanned.

    Attributes:
        robot: Robot, one of those that `wbc robots` lists.
        foot: Foot under both ankles: flat (the robot's own sole), rigid, soft, long_arch (soft, too) or variable (its
            stiffness is set while it swings).
        stiffness: Of the sole hinges of a soft or variable foot, Nm/rad; the foot's own when not given.
        foot_param: Further parameters of the foot, each as name=value.
        policy: Who sets soles of variable stiffness while they swing: model or fixed; the model that comes with the
            library when not given.
        policy_param: Parameters of the policy, each as name=value, such as stiffness=5 or path=model.json.
        terrain: Family of grounds, one of those that `wbc terrains` lists; stones of 20 mm when not given.
        amplitude: Highest minus lowest point of the ground, m; the family's own when not given, 20 mm if no ground is
            named either.
        param: Parameters of the ground, each as name=value; also length, width, start, strip, resolution, rendering.
        seed: Fixes the ground and the errors of the sensors.
        noise: Errors of the sensors, none or realistic.
        noise_seed: Another seed for the errors of the sensors.
        distance: How far to go straight on, m; 3 m when nothing else is asked for.
        velocity: Walk with a velocity instead: forward (m/s), left (m/s), turn (rad/s).
        steps: Number of steps with a velocity.
        turn: Turn on the spot instead, to the left, degrees.
        stairs: Climb the stairs of the terrain instead: together (both feet on each stair) or alternate.
        first: Side that steps first.
        mode: What the drives are given: position and velocity, or torque.
        control_period: Time between two commands, s; 5 ms in position control and 2 ms in torque control when not
            given.
        timestep: Physics step, s; 0.002 with a control period of 0.01 is the fast mode.
        gains: Settings to begin with: default, or legacy for mc_rtc's plain law.
        set: Settings that differ, each as name=value, such as dcm_p=5 or walk.phases.lift_off=0.2.
        push: Pushes on the way, each as impulse=0.2,direction=90,step=5,phase=0.5: Ns/kg, degrees (0 forward, 90
            left), number of the step, share of that step.
        gait: Sizes and timings of steps.
        config: File with some of these options, TOML or JSON, such as swing_height = 0.07; names and values are tables,
            such as dcm_p = 5 under [set]. What is given on the command line comes before it.
        spec: File with the whole walk as JSON, such as an earlier output of --json; takes the place of all of these.
        record: File to write everything to that happens, tick by tick (.arrow).
    """

    robot: str = WalkSpec.robot
    foot: str = "variable"
    stiffness: float | None = None
    foot_param: tuple[str, ...] = ()
    policy: str | None = None
    policy_param: tuple[str, ...] = ()
    terrain: str | None = None
    amplitude: float | None = None
    param: tuple[str, ...] = ()
    seed: int = WalkSpec.seed
    noise: str = WalkSpec.noise
    noise_seed: int | None = None
    distance: float | None = None
    velocity: tuple[float, float, float] | None = None
    steps: int | None = None
    turn: float | None = None
    stairs: Literal["together", "alternate"] | None = None
    first: Literal["left", "right"] | None = None
    mode: Mode = WalkSpec.mode
    control_period: float | None = None
    timestep: float = WalkSpec.timestep
    gains: str = WalkSpec.gains
    set: tuple[str, ...] = ()
    push: tuple[str, ...] = ()
    gait: Annotated[Gait, Parameter(name="*")] = field(default_factory=Gait)
    config: Path | None = None
    spec: Path | None = None
    record: Path | None = None

    def walk(self) -> WalkSpec:
        """The walk that is asked for.

        Raises:
            InputError: Whatever is wrong with it.
        """
        if self.spec is not None:
            return read_spec(self.spec)
        terrain = "stones" if self.terrain is None else self.terrain
        return WalkSpec(
            robot=self.robot,
            foot=self.foot,
            stiffness=self.stiffness,
            foot_changes=tuple(read_changes(self.foot_param).items()),
            policy=self.policy,
            policy_params=tuple(read_changes(self.policy_param).items()),
            terrain=terrain,
            amplitude=STONES_AMPLITUDE if self.terrain is None and self.amplitude is None else self.amplitude,
            terrain_params=tuple(_ground_params(terrain, self.param).items()),
            seed=self.seed,
            noise=self.noise,
            noise_seed=self.noise_seed,
            mode=self.mode,
            control_period=self.control_period,
            timestep=self.timestep,
            plan=WalkPlan(
                distance=self.distance,
                velocity=self.velocity,
                steps=self.steps,
                turn=None if self.turn is None else math.radians(self.turn),
                stairs=self.stairs,
                first=self.first,
            ),
            gait=self.gait,
            gains=self.gains,
            changes=tuple(read_changes(self.set).items()),
            pushes=tuple(read_push(text) for text in self.push),
        )


@reports
def walk(
    options: Flat[WalkOptions] = WalkOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Walk in the simulator, and say how far the robot came and how well. A fall is a result like any other."""
    spec = options.walk()
    if spec.plan.stairs is None:  # a swing over stairs counts its height from the higher end
        check_clearance(spec.ground(), spec.gait.swing_height)
    hooks: list[WalkHook] = []
    with ExitStack() as stack:
        trial = WalkTrial(spec)
        watch = stack.enter_context(live.watch(trial))
        if options.record is not None:
            from wbc.app.log import Recorder  # noqa: PLC0415 - most walks are not recorded

            record = stack.enter_context(
                Recorder(check_target("a log", options.record, (".arrow",)), spec=spec)
            )
            if watch is not None:
                record.add("view/change", watch.news, about="changed from the page since the tick before")
            hooks.append(record)
        if watch is not None:
            hooks.append(watch)
        result = trial.run(hooks)
    changes = [] if watch is None else watch.interventions
    data = result.to_json() | interactive(changes) | {"spec": spec.to_json()}
    if options.record is not None:
        data["record"] = str(options.record)
    return output.report(data, walk_text(result, spec) + interactive_text(changes))


def read_spec(path: Path) -> WalkSpec:
    """A walk out of a file: a spec, or the output of `wbc walk --json`, which has it inside.

    Raises:
        InputError: The file cannot be read, or is no walk.
    """
    data = read_json(path)
    if isinstance(data, dict) and isinstance(data.get("spec"), dict):
        data = data["spec"]
    if not isinstance(data, dict):
        raise InputError(f"{path} is no walk: it must hold a JSON object")
    try:
        return WalkSpec.from_json(data)
    except TypeError as error:
        raise InputError(f"{path} is no walk: {error}") from error


def read_json(path: Path) -> Any:
    """What a JSON file holds.

    Raises:
        InputError: It cannot be read, or is no JSON.
    """
    text = read_text(path)
    try:
        return json.loads(text)
    except ValueError as error:
        raise InputError(f"{path} is not JSON: {error}") from error


def _ground_params(family: str, texts: tuple[str, ...]) -> dict[str, Any]:
    """Parameters of a ground: those of its track, and those of its family."""
    track: dict[str, Any] = {}
    own = []
    for text in texts:
        name, _, value = text.partition("=")
        if name.strip() in TRACK:
            track |= read_changes([text])
        elif name.strip() == "rendering":
            track["rendering"] = value.strip()
        else:
            own.append(text)
    return track | read_params(family, tuple(own))


def read_push(text: str) -> WalkPush:
    """A push out of a text such as impulse=0.2,direction=90,step=5,phase=0.5; the direction in degrees.

    Raises:
        InputError: Not of that form, or a value out of range.
    """
    values: dict[str, Any] = dict(read_changes(part for part in text.split(",")))
    known = [f.name for f in fields(WalkPush)]
    for name in values:
        if name not in known:
            unknown_name("part of a push", name, known)
    if "direction" in values:
        values["direction"] = math.radians(
            finite_scalar("direction of a push (degrees)", values["direction"])
        )
    return from_json(WalkPush, values)


def walk_text(result: WalkResult, spec: WalkSpec) -> str:
    """A result for people."""
    foot = (
        f"{result.foot} feet"
        if result.sole_stiffness is None or result.stiffness is not None
        else f"{result.foot} feet of {result.sole_stiffness:g} Nm/rad"
    )
    ground = (
        result.terrain if result.amplitude == 0.0 else f"{result.terrain}, {1e3 * result.amplitude:.0f} mm"
    )
    steps = f"{result.steps_done} of {result.steps_planned} steps"
    lines = [
        f"{result.robot} on {foot}, {ground}, seed {result.seed}, {spec.mode} control, noise {spec.noise}"
    ]
    lines += [f"  note      {note}" for note in result.notes]
    if result.diverged is not None:
        lines.append(f"  DIVERGED  after {steps}: {result.diverged}")
        return "\n".join(lines)
    if result.fall is not None:
        fall = result.fall
        lines.append(
            f"  FELL      after {steps} and {result.seconds:.1f} s ({REASONS[fall.reason]}); it began "
            f"{fall.direction} at {100 * fall.share:.0f} % of the {fall.phase} of step {fall.step}, the stance sole "
            f"tilted by {math.degrees(fall.sole_roll):.1f}° roll, {math.degrees(fall.sole_pitch):.1f}° pitch"
        )
    else:
        verb = "walked" if result.outcome == "completed" else "NOT DONE: "
        lines.append(f"  {verb}    {steps} in {result.seconds:.1f} s")
    down = result.touchdowns
    lines += [
        f"  distance  {result.distance:.2f} m, {100 * result.drift:+.1f} cm to the left, heading off by "
        f"{math.degrees(result.yaw_error):+.1f}°",
        f"  errors    ZMP {_mm(result.zmp_error)}, CoM {_mm(result.com_error)}, DCM {_mm(result.dcm_error)} mm"
        + ("" if result.dcm_error_max is None else f", at most {1e3 * result.dcm_error_max:.0f} mm"),
        f"  landing   {down.early} early, {down.on_time} on time, {down.late} late, {down.missed} without ground"
        + ("" if result.impact is None else f"; at most {result.impact:.2f} x weight"),
        f"  torque    up to {100 * result.peak_torque_ratio:.0f} % of its limit ({result.peak_torque_joint})",
    ]
    lines += soles_text(result)
    if result.clock is not None:
        tick = result.clock.tick_us
        lines.append(
            f"  speed     {result.clock.real_time_factor:.2f} x real time; a tick takes {tick['median']:.0f} us, 99 % "
            f"less than {tick['p99']:.0f} us; {result.failures} failed"
        )
    return "\n".join(lines)


def soles_text(result: WalkResult) -> list[str]:
    """What soles of variable stiffness saw and did, for people; nothing of others."""
    steps = result.stiffness
    if not steps:
        return []
    decided = [step["commanded_nm_per_rad"] for step in steps if step["fallback"] is None]
    reached = sum(step["reached"] for step in steps)
    text = f"  soles     set by the policy '{result.policy}' in {len(decided)} of {len(steps)} swings"
    if decided:
        low, middle, high = (f"{k:.3g}" for k in np.percentile(decided, (0, 50, 100)))
        text += f" to {low} … {high} Nm/rad, median {middle}"
    lines = [f"{text}; {reached} there before they landed"]
    reasons = Counter(re.split("[:,]", step["fallback"])[0] for step in steps if step["fallback"] is not None)
    if reasons:
        kept = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
        lines.append(f"            the others fell back ({kept})")
    errors = [step["profile_error_m"] for step in steps if step["profile_error_m"] is not None]
    if errors:
        mean, most = (1e3 * float(np.mean([error[part] for error in errors])) for part in ("mean", "p95"))
        clock = result.clock.decision_us if result.clock is not None else None
        time = "" if clock is None else f"; decided in {clock['median']:.0f} us, {clock['max']:.0f} at most"
        lines.append(
            f"  scan      {mean:.1f} mm from the true ground, 95 % of a scan within {most:.1f} mm{time}"
        )
    return lines


REASONS = {
    "height": "it dropped",
    "tilt": "it tilted",
    "dcm": "the DCM was out of reach",
    "solver": "the quadratic program failed",
}
"""Reasons of falls for people."""


def _mm(value: Any) -> str:
    mean, std = asdict(value).values()
    return "–" if mean is None else f"{1e3 * mean:.1f} ± {1e3 * std:.1f}"
