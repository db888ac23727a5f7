"""Settings: what is refused, by the name in the message; JSON and changes there and back."""

from __future__ import annotations

import itertools
from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest

from wbc.base.errors import InputError, UnknownNameError
from wbc.base.settings import (
    Angle,
    Count,
    NonNegative,
    Positive,
    Seed,
    Share,
    as_changes,
    changed,
    from_json,
    in_units,
    json_object,
    nested_settings,
    normal_changes,
    read_changes,
    setting_names,
    settings,
    to_json,
    unit_and_choices,
    units,
)


@settings
class Push:
    impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
    time: Annotated[Positive, "s"] | None = None


@settings(kw_only=True)
class Spec:
    kind: ClassVar[str] = "spec"
    name: str = "walk"
    length: Annotated[Positive, "m"] = 0.1
    count: Count = 3
    seed: Seed = 0
    share: Share = 0.5
    side: Literal["left", "right"] = "left"
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    open: bool = False
    push: Push = field(default_factory=Push)
    pushes: tuple[Push, ...] = ()


@settings
class Scale:
    factor: Annotated[Positive | tuple[Positive, ...], "m"] = 1.0
    of: Annotated[dict[str, Positive], "kg"] = field(default_factory=dict)


@settings(kw_only=True)
class Gait:
    first: Push = field(default_factory=Push)
    later: Push | None = None
    spec: Spec = field(default_factory=Spec)
    steps: int | None = None


def test_a_class_that_derives_from_settings_has_other_defaults_in_fields_of_its_own() -> None:
    class Shove(Push):
        impulse: float = 0.3

    class Named(Push):
        def label(self) -> str:
            return f"{self.impulse} Ns/kg"

    with pytest.raises(InputError, match="impulse in class Shove"):
        Shove()
    assert settings(Shove)().impulse == 0.3 and Named(0.2).label() == "0.2 Ns/kg"
    with pytest.raises(InputError, match="impulse in class Bare"):
        settings(type("Bare", (Push,), {"impulse": 0.3}))


def test_json_goes_there_and_back() -> None:
    spec = Spec(pushes=(Push(), Push(time=2.0)), start=(0.1, 1 / 3, 0.0))
    assert from_json(Spec, to_json(spec)) == spec and from_json(Spec, {}) == Spec()


def test_changes_are_read_from_texts() -> None:
    texts = ["com-height=0.8", "steps = 4", "axes=1, 2.5,x", "on=True", "off=none", "name=a=b"]
    plain = {"com_height": 0.8, "steps": 4, "axes": (1, 2.5, "x"), "on": True, "off": None, "name": "a=b"}
    assert read_changes(texts) == plain
    for wrong in (["steps"], ["=4"], ["steps= "], ["a-b=1", "a_b=2"]):
        with pytest.raises(InputError):
            read_changes(wrong)


def test_settings_are_changed_by_as_much_of_their_name_as_is_unique() -> None:
    gait = Gait()
    assert {"first.impulse", "later", "spec.push.time", "steps"} <= set(setting_names(gait))
    new = changed(gait, {"count": 8.0, "first.impulse": 0.5, "push.time": 3.0, "start": [1, 2, 3]})
    spec = Spec(count=8, push=Push(time=3.0), start=(1.0, 2.0, 3.0))
    assert new == Gait(first=Push(impulse=0.5), spec=spec)
    for values, kind, named in (
        ({"impulse": 1.0}, InputError, "first.impulse"),  # or spec.push.impulse
        ({"lenght": 1.0}, UnknownNameError, "length"),
        ({"count": 8.5}, InputError, "count"),
    ):
        with pytest.raises(kind, match=named):
            changed(gait, values)


def test_settings_that_are_off_are_switched_on_before_their_own_are_changed() -> None:
    on = {"later.impulse": 0.3, "later": True}
    for order in (on, dict(reversed(on.items()))):
        assert changed(Gait(), order).later == Push(impulse=0.3)
    there = Gait(later=Push(time=2.0))
    assert changed(there, {"later": True}).later == Push(time=2.0), "what is on stays as it is"
    assert changed(there, {"later": None}).later is None


GIVEN: dict[str, Any] = {
    "b": [1, 2.5],
    "a": np.float64(0.5),
    "c": None,
    "d": np.arange(2),
    "e": "text",
    "f": True,
}


def test_changes_have_one_form_whatever_their_order() -> None:
    form = (("a", 0.5), ("b", (1, 2.5)), ("c", None), ("d", (0, 1)), ("e", "text"), ("f", True))
    assert as_changes(GIVEN) == form and hash(as_changes(GIVEN))
    for pairs in itertools.permutations(GIVEN.items(), 3):
        assert as_changes(pairs) == as_changes(sorted(pairs, reverse=True)) == as_changes(dict(pairs))
    for bad in (
        ["ab"],
        [("a",)],
        [("a", 1, 2)],
        [3],
        [(3, 1.0)],
        [("a", 1), ("a", 1)],
        {"a": object()},
        {"a": [[1.0]]},
        {"a": {"b": 1}},
        {"a": (1, object())},
    ):
        with pytest.raises(InputError):
            as_changes(bad)  # type: ignore[arg-type]


def test_equivalent_changes_are_equal() -> None:
    """Full names or short ones, lists or tuples, 8.0 or 8: they make the same settings, so they are the same."""
    full = {"spec.count": 8, "spec.start": (1.0, 2.0, 3.0), "spec.push.time": 2.0, "later": True}
    short = {"start": [1, 2, 3], "later": True, "count": 8.0, "push.time": 2}
    normal = normal_changes(Gait(), short)
    assert normal == normal_changes(Gait(), full) == normal_changes(Gait(), normal)
    assert repr(normal) == repr(normal_changes(Gait(), full)), "they are written alike"
    assert dict(normal) == full and [name for name, _ in normal] == sorted(full)
    assert changed(Gait(), normal) == changed(Gait(), short) and changed(Gait(), {}) == Gait()
    with pytest.raises(InputError, match="twice"):
        normal_changes(Gait(), {"count": 8, "spec.count": 8})
    for bad in ({"later": Push()}, {"spec": 3}, {"later": 1.0}, {"count": True}, {"length": True}):
        with pytest.raises(InputError):
            changed(Gait(), bad)


@settings(kw_only=True)
class Lengths:
    reach: Annotated[Positive, "m"] = 0.5
    time: Annotated[Positive, "s"] = 2.0
    box: tuple[Annotated[float, "m"], Annotated[float, "s"]] = (1.0, 3.0)
    sides: Annotated[tuple[float, float], "m"] = (1.0, 4.0)
    share: Share = 0.25
    mode: Annotated[Literal["soft", "hard"], "m"] | None = None


def test_numbers_are_scaled_by_the_value_of_their_unit() -> None:
    scaled = in_units(Lengths(), {"m": 2.0, "s": 10.0})
    assert scaled == Lengths(reach=1.0, time=20.0, box=(2.0, 30.0), sides=(2.0, 8.0))
    assert in_units(scaled, {"m": 0.5, "s": 0.1}) == Lengths() == in_units(Lengths(), {})


def test_units_choices_and_kinds_of_fields() -> None:
    assert units(Gait)["first.impulse"] == units(Gait)["spec.push.impulse"] == "Ns/kg"
    assert units(Lengths) == dict.fromkeys(("reach", "sides", "mode"), "m") | {"time": "s"}
    assert unit_and_choices(Lengths, "mode") == ("m", ["soft", "hard"])
    assert unit_and_choices(Spec, "side") == ("", ["left", "right"])
    assert unit_and_choices(Spec, "length") == ("m", [])
    assert nested_settings(Gait, "later") is Push and nested_settings(Gait, "steps") is None


def test_a_refused_value_is_named_by_its_place_its_unit_and_what_was_given() -> None:
    for kind, data, parts in (
        (Spec, {"pushes": [{}, {"time": -2.0}]}, ("pushes[1].time (s)", "-2.0")),
        (Spec, {"start": [0.0, "x", 0.0]}, ("start[1]", "'x'")),
        (Gait, {"spec": {"push": {"impulse": -3.0}}}, ("spec.push.impulse (Ns/kg)", "-3.0")),
        (Spec, [1], ("Spec", "1")),
        (Scale, {"factor": [1.0, -2.0]}, ("factor[1] (m) must be greater than 0", "-2.0")),
        (Scale, {"factor": "x"}, ("factor (m) must be a valid number or a sequence", "'x'")),
        (Scale, {"of": {"knee": -2.0}}, ("of['knee'] (kg) must be", "-2.0")),
    ):
        with pytest.raises(InputError) as refusal:
            from_json(kind, data)
        assert all(part in str(refusal.value) for part in parts), refusal.value
    with pytest.raises(UnknownNameError, match="length"):
        from_json(Spec, {"lenght": 1.0})
    for given, said in (((-1.0,), "impulse (Ns/kg)"), ((0.1, -1.0), "time (s)"), ((0.1, 1e-13), "time (s)")):
        with pytest.raises(InputError) as refusal:
            Push(*given)
        assert str(refusal.value).startswith(said) and str(refusal.value).count(f"{given[-1]:g}") == 1
    assert json_object("a spec", {"a": 1}) == {"a": 1}
    for bad in ([("a", 1)], "a", None):
        with pytest.raises(InputError):
            json_object("a spec", bad)
    for tiny in (0.0, -1.0, 0.99e-12, np.inf, np.nan):
        with pytest.raises(InputError, match="length"):
            Spec(length=tiny)
    assert Spec(length=1e-12).length == 1e-12

    @settings
    class Turn:
        angle: Angle = 0.0

    assert Turn(-np.pi).angle == -np.pi and Turn(2.0 * np.pi).angle > 6.28
    for degrees in (-360.0, 7.0, -7.0):
        with pytest.raises(InputError, match=r"angle \(rad\)"):
            Turn(degrees)


def test_a_setting_under_two_names_is_refused() -> None:
    for change in (changed, normal_changes):
        with pytest.raises(InputError, match="spec.start' is given twice"):
            change(Gait(), {"start": (1.0, 2.0, 3.0), "spec.start": (1.0, 2.0, 4.0)})
