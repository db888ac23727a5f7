"""Settings: what is refused, by the name in the message; JSON and changes there and back."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, ClassVar, Literal

import pytest

from wbc.base.changes import changed, read_changes, setting_names
from wbc.base.errors import InputError, UnknownNameError
from wbc.base.settings import Count, NonNegative, Positive, Seed, Share, from_json, settings, to_json


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
