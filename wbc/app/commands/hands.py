"""`wbc hands`: what a robot does with its hands, in the simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from rich.progress import track

from wbc.app.live import LiveOptions, LiveView, interactive, interactive_text
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.settings import Count, settings, to_json
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
    HandTrial,
    HandTrialResult,
    HandTrialSpec,
    OneFootResult,
    OneFootSpec,
    OneFootTrial,
)

S = TypeVar("S", bound=HandTrialSpec)


@settings(kw_only=True)
class PressOptions(HandPressSpec):
    """A press, once or on several seeds.

    Attributes:
        seeds: Number of runs, each with the seed after the last one's.
    """

    seeds: Count = 1


@settings(kw_only=True)
class CartOptions(CartSpec):
    """A cart trial, once or on several seeds.

    Attributes:
        seeds: Number of runs, each with the seed after the last one's.
    """

    seeds: Count = 1


@settings(kw_only=True)
class OneFootOptions(OneFootSpec):
    """A stand on one foot, once or on several seeds.

    Attributes:
        seeds: Number of runs, each with the seed after the last one's.
    """

    seeds: Count = 1


@settings(kw_only=True)
class DoorOptions(DoorSpec):
    """A door trial, once or on several seeds.

    Attributes:
        seeds: Number of runs, each with the seed after the last one's.
    """

    seeds: Count = 1


@reports
def press(
    options: Flat[PressOptions] = PressOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Press with both hands on a table, a wall or a rail, and report the force that is held."""
    return _report(_specs(HandPressSpec, options, options.seeds), HandPressTrial, _press_text, live, output)


@reports
def cart(
    options: Flat[CartOptions] = CartOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Push a cart forward, turn it about its middle, pull it back, and report where it has come to stand."""
    return _report(_specs(CartSpec, options, options.seeds), CartTrial, _cart_text, live, output)


@reports
def door(
    options: Flat[DoorOptions] = DoorOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Open a door by its handle while walking, let go, and walk on."""
    return _report(_specs(DoorSpec, options, options.seeds), DoorTrial, _door_text, live, output)


@reports
def one_foot(
    options: Flat[OneFootOptions] = OneFootOptions(),
    *,
    live: LiveOptions = LiveView(),
    output: OutputOptions = Output(),
) -> Report:
    """Push a robot that stands on one foot with a hand on a wall."""
    return _report(_specs(OneFootSpec, options, options.seeds), OneFootTrial, _one_foot_text, live, output)


def _specs(kind: type[S], options: HandTrialSpec, seeds: int) -> list[S]:
    """Return a spec for each run."""
    values = {each.name: getattr(options, each.name) for each in fields(kind)}
    return [replace(kind(**values), seed=options.seed + run) for run in range(seeds)]


def _report(
    specs: Sequence[S],
    trial: Callable[[S], Any],
    text: Callable[[Any], str],
    live: LiveView,
    output: Output,
) -> Report:
    """Run all trials and report them."""
    results: list[HandTrialResult] = []
    changes: list[dict[str, Any]] = []
    for spec in track(specs, "running", console=progress_console()) if len(specs) > 1 else specs:
        one: HandTrial = trial(spec)
        with live.show(one.plant, one.walking) as watching:
            results.append(one.run(watching.after_tick))  # type: ignore[attr-defined]
        changes += [{"seed": spec.seed, **change} for change in watching.interventions]
    lines = []
    for each in results:
        state = (
            "done" if each.stage == "done" else f"{'ended' if each.upright else 'FELL'} in stage {each.stage}"
        )
        lines.append(f"{each.robot}, seed {each.seed}: {state}, {text(each)}")
    upright = sum(each.upright for each in results)
    done = sum(each.stage == "done" for each in results)
    if len(results) > 1:
        lines.append(f"{done} of {len(results)} came to their end, {upright} stayed on their feet")
    data = {"upright": upright, "done": done, "runs": len(results), "results": to_json(results)}
    return output.report(data | interactive(changes), "\n".join(lines) + interactive_text(changes))


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
