"""`wbc hands`: what a robot does with its hands, in the simulator, and the load that it carries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter
from rich.progress import track

from wbc.app.live import LiveOptions, LiveView, changes_of, interactive, interactive_text
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.changes import changed, read_changes, setting_names
from wbc.core.errors import InputError
from wbc.core.settings import Count, Seed, settings, to_json
from wbc.sim.balance import CarryResult, CarrySpec, CarryTrial
from wbc.sim.hands import (
    CartResult,
    CartSpec,
    CartTrial,
    DoorResult,
    DoorSpec,
    DoorTrial,
    HandPressResult,
    HandPressSpec,
    HandPressTrial,
    OneFootResult,
    OneFootSpec,
    OneFootTrial,
)

What = Literal["press", "one-foot", "cart", "door", "carry"]


@settings(kw_only=True)
class HandsOptions:
    """Options of a trial of hands.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
        seeds: Number of runs, each with the seed after the last one's.
        set: Settings of the trial, each as name=value, such as on=wall, force=100 or hands.reach=0.8.
        list: List the settings of the trial instead.
    """

    robot: str = CarrySpec.robot
    noise: str = CarrySpec.noise
    seed: Seed = CarrySpec.seed
    seeds: Count = 1
    set: tuple[str, ...] = ()
    list: bool = False


@reports
def hands(
    what: Annotated[What, Parameter(help="Trial.")],
    /,
    *,
    options: Flat[HandsOptions] = HandsOptions(),
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Press on a surface, hold on to a wall on one foot, push and pull a cart, open a door, carry a load.

    A press reports the force that both hands hold; a push on one foot, whether a hand on the wall keeps the robot up; a
    cart, where it has come to stand after pushing, turning and pulling; a door, how far it is opened on the way
    through; a load of unknown mass, how well its mass and place are found, and whether the robot carries it.
    """
    kind = _KINDS[what]
    spec = kind.spec(robot=options.robot, noise=options.noise, seed=options.seed)
    if options.list:
        values = {name: _value(spec, name) for name in setting_names(spec)}
        return output.report(
            {"settings": values}, "\n".join(f"{name}={value}" for name, value in values.items())
        )
    changes = read_changes(options.set)
    for name in ("robot", "noise", "seed"):
        if name in changes:
            raise InputError(f"{name} is an option of its own: --{name}")
    spec = changed(spec, changes)
    results: list[Any] = []
    interventions: list[dict[str, Any]] = []
    runs = range(options.seeds)
    for run in track(runs, "running", console=progress_console()) if options.seeds > 1 else runs:
        trial = kind.trial(replace(spec, seed=options.seed + run))
        with live.watch(trial) as watching:
            results.append(trial.run(watching))
        interventions += [{"seed": options.seed + run, **change} for change in changes_of(watching)]
    lines = []
    for each in results:
        ended = f"{'ended' if each.upright else 'FELL'} in stage {each.stage}"
        state = "done" if each.stage == "done" else ended
        lines.append(f"{each.robot}, seed {each.seed}: {state}, {kind.text(each)}")
    upright, done = sum(each.upright for each in results), sum(each.stage == "done" for each in results)
    if len(results) > 1:
        lines.append(f"{done} of {len(results)} came to their end, {upright} stayed on their feet")
    data = {"upright": upright, "done": done, "runs": len(results), "results": to_json(results)}
    return output.report(
        data | interactive(interventions), "\n".join(lines) + interactive_text(interventions)
    )


def _value(spec: Any, name: str) -> Any:
    for part in name.split("."):
        spec = getattr(spec, part)
    return to_json(spec)


def _carry_text(result: CarryResult) -> str:
    return (
        f"{result.load_kg:.2f} kg {result.forward:.2f} m ahead; mass within {100.0 * result.mass_error:.1f} %, place "
        f"within {result.place_error_mm:.1f} mm, {result.steps_done} steps"
    )


def _press_text(result: HandPressResult) -> str:
    bounded = ", the arms have no more" if result.bounded else ""
    lost = f", lost: {', '.join(result.lost)}" if result.lost else ""
    return (
        f"{result.on}: {result.force_N:g} N asked for, held {result.held_s:g} s: mean {result.mean_N:.1f} N "
        f"({result.least_N:.1f} to {result.greatest_N:.1f}{bounded}), each hand within "
        f"10 % for {100.0 * result.within:.0f} % of the time, "
        f"centre of mass {result.beyond_toes_mm:.0f} mm before the toes{lost}"
    )


def _cart_text(result: CartResult) -> str:
    place = f"{result.place_error_mm:.0f} mm and {result.heading_error_deg:.1f}° from where it should be"
    return (
        f"cart of {result.resistance_N:g} N {place}, {result.steps_done} steps, {result.corrections} corrections, at "
        f"most {result.force_N:.0f} N; tilt of the cart within {result.cart_tilt_deg:.1f}°, of the pelvis within "
        f"{result.pelvis_tilt_deg:.1f}°"
    )


def _door_text(result: DoorResult) -> str:
    return (
        f"door let go at {result.released_deg:.0f}°, {result.open_deg:.0f}° open at the end, pelvis "
        f"{result.beyond_mm:.0f} mm behind its frame, {result.steps_done} steps; at most {result.force_N:.0f} N on the "
        f"hand, {result.touch_N:.0f} N on the rest"
    )


def _one_foot_text(result: OneFootResult) -> str:
    hand = f"hand on the wall with {result.force_N:g} N" if result.force_N else "no hand on the wall"
    lost = ", which lost it" if result.lost else ""
    return f"{result.impulse:g} Ns/kg towards {result.direction_deg:g}°, {hand}{lost}"


class _Kind(NamedTuple):
    """Spec, trial and text of one kind of trial."""

    spec: Callable[..., Any]
    trial: Callable[[Any], Any]
    text: Callable[[Any], str]


_KINDS = {
    "press": _Kind(HandPressSpec, HandPressTrial, _press_text),
    "one-foot": _Kind(OneFootSpec, OneFootTrial, _one_foot_text),
    "cart": _Kind(CartSpec, CartTrial, _cart_text),
    "door": _Kind(DoorSpec, DoorTrial, _door_text),
    "carry": _Kind(CarrySpec, CarryTrial, _carry_text),
}
