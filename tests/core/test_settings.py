"""Settings: what is refused, by the name in the message; JSON and changes there and back."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import field, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest

from wbc.core.changes import changed, read_changes, setting_names
from wbc.core.errors import InputError, UnknownNameError
from wbc.core.settings import Count, NonNegative, Positive, Seed, Share, from_json, settings, to_json


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


@settings(kw_only=True)
class Gait:
    first: Push = field(default_factory=Push)
    later: Push | None = None
    spec: Spec = field(default_factory=Spec)
    steps: int | None = None


@pytest.mark.parametrize(
    ("values", "kind", "named"),
    [
        ({"length": 0.0}, InputError, "length"),
        ({"length": math.inf}, InputError, "length"),
        ({"length": "1"}, InputError, "length"),
        ({"length": True}, InputError, "length"),
        ({"length": None}, InputError, "length"),
        ({"count": 0}, InputError, "count"),
        ({"count": 2.5}, InputError, "count"),
        ({"seed": -1}, InputError, "seed"),
        ({"share": 1.5}, InputError, "share"),
        ({"side": "lef"}, InputError, "left"),
        ({"start": (1, 2)}, InputError, "start"),
        ({"start": (1, 2, "x")}, InputError, "start"),
        ({"open": "yes"}, InputError, "open"),
        ({"name": 3}, InputError, "name"),
        ({"push": 3}, InputError, "push"),
        ({"push": {"impulse": -2}}, InputError, "impulse"),
        ({"push": {"impuls": 1}}, UnknownNameError, "impulse"),
        ({"pushes": [{}, {"impulse": -2}]}, InputError, "impulse"),
        ({"lenght": 1.0}, UnknownNameError, "length"),
    ],
)
def test_a_value_that_breaks_a_rule_is_refused(
    values: dict[str, Any], kind: type[Exception], named: str
) -> None:
    with pytest.raises(kind, match=named) as refused:
        from_json(Spec, values)
    assert "\n" not in str(refused.value)


def test_settings_are_frozen_hashable_and_checked_again_when_replaced() -> None:
    spec = Spec(start=[1, 2, 3], count=np.int64(4), length=np.float64(2.0))  # type: ignore[arg-type]
    assert spec.start == (1.0, 2.0, 3.0) and type(spec.count) is int and spec.length == 2.0
    assert hash(spec) == hash(replace(spec)) and Spec(start=np.zeros(3)) == Spec()  # type: ignore[arg-type]
    with pytest.raises(dataclasses.FrozenInstanceError):
        spec.count = 5  # type: ignore[misc]
    with pytest.raises(InputError, match="count"):
        replace(spec, count=0)


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
