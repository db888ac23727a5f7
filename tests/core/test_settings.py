"""Validated settings and registries: what is refused, and in which words."""

from __future__ import annotations

import abc
import dataclasses
import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypedDict, Unpack

import numpy as np
import pytest
from pydantic import Field

from wbc.core.arguments import check_fields, checked
from wbc.core.attributes import FixedAttributes
from wbc.core.changes import changed, normal_changes, read_changes, setting_names
from wbc.core.errors import InputError, UnknownNameError, check_parts, unknown_name
from wbc.core.registry import Registry, call_checked
from wbc.core.settings import (
    Count,
    NonNegative,
    Positive,
    Seed,
    Share,
    from_json,
    settings,
    to_json,
    unit_and_choices,
)


@settings
class Push:
    impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
    time: Annotated[Positive, "s"] | None = None

    def __post_init__(self) -> None:
        if self.impulse == 7.0:
            raise InputError("an impulse of seven is a rule of its own")


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
class Named:
    named: dict[str, Push] | None = None


@settings
class Design(abc.ABC):
    """Settings that others derive from, some with `@dataclass` alone."""

    size: tuple[Annotated[Positive, "m"], Annotated[Positive, "m"]] = (1.0, 2.0)
    rate: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "1/s"] = math.inf

    def __post_init__(self) -> None:
        check_fields(self)

    @abc.abstractmethod
    def area(self) -> float: ...


@dataclass(frozen=True)
class Plate(Design):
    holes: int = 0

    def area(self) -> float:
        return self.size[0] * self.size[1] - self.holes


class NamedPlate(Plate):
    pass


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"length": -1}, r"^length \(m\) must be a finite number above 0, got -1$"),
    ({"length": math.nan}, r"^length \(m\) must be a finite number above 0, got nan$"),
    ({"length": math.inf}, "finite"),
    ({"length": "1"}, "got '1'"),
    ({"length": True}, "got True"),
    ({"length": None}, "got None"),
    ({"length": 10**400}, r"got 1000.*\.\.\.$"),
    ({"count": 0}, "^count must be an integer of at least 1, got 0$"),
    ({"count": 2.0}, "integer"),
    ({"seed": -1}, "at least 0"),
    ({"share": 1.5}, "^share must be a finite number of at least 0 and of at most 1, got 1.5$"),
    ({"side": "lef"}, "did you mean 'left'"),
    ({"side": 3}, "^side must be 'left' or 'right', got 3$"),
    ({"start": (1, 2)}, "^start must be 3 values, each a finite number, got "),
    ({"start": (1, 2, "x")}, r"^start\[2\] must be a finite number, got 'x'$"),
    ({"open": 1}, "true or false"),
    ({"name": 3}, "text"),
    ({"name": "a\0b"}, r"^name must be text without NUL, got 'a\\x00b'$"),
    ({"push": 3}, "^push must be Push, got 3$"),
    ({"lenght": 1.0}, "did you mean 'length'"),
]


@pytest.mark.parametrize(("values", "message"), REFUSED)
def test_a_value_that_breaks_a_rule_is_refused_with_name_rule_and_value(
    values: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Spec(**values)
    if list(values.values()) != [10**400]:
        with pytest.raises(InputError, match=message):
            from_json(Spec, values)


def test_settings_that_take_their_values_by_name_say_so() -> None:
    @settings(kw_only=True)
    class Named:
        mass: Positive = 1.0

    with pytest.raises(InputError, match="^Named takes its values by name: mass=2.0$"):
        Named(2.0)  # type: ignore[misc]


def test_an_unknown_field_or_choice_is_an_unknown_name() -> None:
    for values in ({"lenght": 1.0}, {"side": "lef"}):
        with pytest.raises(UnknownNameError):
            Spec(**values)  # type: ignore[arg-type]


def test_a_wrong_name_is_refused_before_the_value_that_it_leaves_missing() -> None:
    @settings
    class Step:
        length: Positive

    for make in (lambda: Step(lenght=1.0), lambda: from_json(Step, {"lenght": 1.0})):  # type: ignore[call-arg]
        with pytest.raises(UnknownNameError, match="did you mean 'length'"):
            make()


def test_messages_name_the_place_of_what_is_nested() -> None:
    with pytest.raises(InputError, match=r"^pushes\[1\].impulse \(Ns/kg\) must be .* at least 0, got -2$"):
        from_json(Spec, {"pushes": [{}, {"impulse": -2}]})
    with pytest.raises(InputError, match=r"^named.first.impulse \(Ns/kg\) must be .* at least 0, got -2$"):
        from_json(Named, {"named": {"first": {"impulse": -2}}})
    with pytest.raises(UnknownNameError, match="no setting of push 'impuls'"):
        from_json(Spec, {"push": {"impuls": 1}})
    with pytest.raises(InputError, match="rule of its own"):
        from_json(Spec, {"push": {"impulse": 7}})
    with pytest.raises(InputError, match="^Spec must be Spec, got"):
        from_json(Spec, [1])


def test_values_without_a_name_are_named_in_messages() -> None:
    for args, message in (
        ((-1.0,), r"^impulse \(Ns/kg\) must be .* got -1.0$"),
        ((1.0, 0), r"^time \(s\) must be .* got 0$"),
        ((1.0, 2.0, 3.0), r"^Push takes 2 values \(impulse, time\), got more$"),
    ):
        with pytest.raises(InputError, match=message):
            Push(*args)


@pytest.mark.parametrize("kind", [Plate, NamedPlate])
def test_plain_dataclasses_that_derive_from_settings_are_checked(kind: type[Plate]) -> None:
    plate = kind(size=[2, 3], holes=2)  # type: ignore[arg-type]
    assert plate.size == (2.0, 3.0) and plate.area() == 4.0 and plate.rate == math.inf
    assert replace(plate, rate=2).size == plate.size and hash(plate) == hash(replace(plate))
    for values, message in (
        ({"size": (1.0,)}, r"^size must be 2 values, each a finite number above 0, got \(1.0,\)$"),
        ({"size": (1.0, 0.0)}, r"^size must be 2 values, each a finite number above 0, got \(1.0, 0.0\)$"),
        ({"rate": math.nan}, r"^rate \(1/s\) must be a number above 0, got nan$"),
    ):
        with pytest.raises(InputError, match=message):
            kind(**values)  # type: ignore[arg-type]
        with pytest.raises(InputError, match=message):
            replace(plate, **values)  # type: ignore[arg-type]


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
    assert from_json(Spec, to_json(spec)) == spec
    assert from_json(Spec, {}) == Spec()


def test_unit_and_choices_of_a_field_can_be_shown() -> None:
    assert unit_and_choices(Spec, "length") == ("m", [])
    assert unit_and_choices(Push, "time") == ("s", [])
    assert unit_and_choices(Spec, "side") == ("", ["left", "right"])


def test_a_registry_names_what_is_near_and_refuses_what_is_taken() -> None:
    feet = Registry("foot", {"flat": 1, "soft": 2})
    assert feet["flat"] == 1
    with pytest.raises(UnknownNameError, match="no foot 'flt'; did you mean 'flat'"):
        feet["flt"]
    with pytest.raises(InputError, match="registered already"):
        feet.add("soft", 3)
    for name in ("", "  ", 3):
        with pytest.raises(InputError, match="must be text"):
            feet.add(name, 3)  # type: ignore[arg-type]
    feet.add("long", 3)
    assert list(feet) == ["flat", "soft", "long"]


def test_parameters_are_looked_up_before_the_call() -> None:
    def make(size: float, colour: str = "red") -> tuple[float, str]:
        return size, colour

    assert call_checked("foot 'x'", make, {"size": 2.0}) == (2.0, "red")
    with pytest.raises(UnknownNameError, match="no parameter of the foot 'x' 'sise'"):
        call_checked("foot 'x'", make, {"sise": 2.0})
    with pytest.raises(InputError, match="the foot 'x' needs a value for 'size'"):
        call_checked("foot 'x'", make, {})


def test_a_decorated_function_refuses_names_it_does_not_take() -> None:
    class Shoe:
        @classmethod
        @checked
        def of(cls, size: float, *, colour: str = "red") -> tuple[float, str]:
            """Return size and colour."""
            return size, colour

    assert Shoe.of(2.0) == (2.0, "red") and Shoe.of(size=1.0, colour="blue") == (1.0, "blue")
    assert (
        str(inspect.signature(Shoe.of)) == "(size: 'float', *, colour: 'str' = 'red') -> 'tuple[float, str]'"
    )
    with pytest.raises(UnknownNameError, match="no parameter of .*Shoe.of 'color'; did you mean 'colour'"):
        Shoe.of(2.0, color="blue")  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="size"):
        Shoe.of()  # type: ignore[call-arg]


@pytest.mark.parametrize("text", ["a\0b", "\ud800"])
def test_text_that_no_file_takes_is_refused(text: str) -> None:
    @checked
    def call(name: str, *, place: Path | str | None = None) -> None:
        """Do nothing."""

    call("é", place="ü")
    with pytest.raises(InputError, match="^name must be text (without NUL|of whole characters), got"):
        call(text)
    with pytest.raises(InputError, match="^place must be"):
        call("a", place=text)
    with pytest.raises(InputError, match="^name must be text (without NUL|of whole characters), got"):
        Spec(name=text)


class Laces(TypedDict, total=False):
    length: float | None
    colour: str


def test_options_of_a_typed_dictionary_are_checked_and_named_like_parameters() -> None:
    @checked
    def shoe(size: float, **options: Unpack[Laces]) -> tuple[float, Laces]:
        return size, options

    assert shoe(2.0) == (2.0, {}) and shoe(2.0, length=None) == (2.0, {"length": None})
    parameters = inspect.signature(shoe).parameters
    assert list(parameters) == ["size", "length", "colour"]
    assert [parameters[name].default for name in Laces.__annotations__] == [None, ...]
    with pytest.raises(InputError, match="length must be a finite number or none, got 'long'"):
        shoe(2.0, length="long")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="no parameter of .*shoe 'color'; did you mean 'colour'"):
        shoe(2.0, color="red")  # type: ignore[call-arg]


def test_a_mapping_that_makes_its_values_when_asked_is_not_gone_through() -> None:
    class Made(Mapping[str, int]):
        def __getitem__(self, key: str) -> int:
            raise AssertionError(key)

        def __iter__(self) -> Iterator[str]:
            raise AssertionError

        def __len__(self) -> int:
            return 1

    assert _count(Made()) == 1
    with pytest.raises(InputError, match="numbers"):
        _count({"a": "b"})  # type: ignore[dict-item]


@checked
def _count(numbers: Mapping[str, int]) -> int:
    return len(numbers)


@settings(kw_only=True)
class Gait:
    first: Push = field(default_factory=Push)
    later: Push | None = None
    spec: Spec = field(default_factory=Spec)
    steps: int | None = None


def test_changes_are_read_from_texts() -> None:
    texts = [
        "com-height=0.8",
        "steps = 4",
        "axes=1, 2.5,x",
        "on=True",
        "off=none",
        "later=NULL",
        "name=a=b",
        "no=false,",
    ]
    assert read_changes(texts[:-1]) == {
        **{"com_height": 0.8, "steps": 4, "axes": (1, 2.5, "x"), "on": True, "off": None, "later": None},
        "name": "a=b",
    }  # fmt: skip
    assert read_changes(texts[-1:]) == {"no": (False, "")}
    for wrong in ("steps", "=4", " = 4", "steps= "):
        with pytest.raises(InputError, match=f"^a setting is given as name=value, got '{wrong}'$"):
            read_changes([wrong])
    with pytest.raises(InputError, match="^setting 'a_b' is given twice$"):
        read_changes(["a-b=1", "a_b=2"])


def test_settings_are_changed_by_as_much_of_their_name_as_is_unique() -> None:
    gait = Gait()
    own = (
        "name",
        "length",
        "count",
        "seed",
        "share",
        "side",
        "start",
        "open",
        "push.impulse",
        "push.time",
        "pushes",
    )
    names = ("first.impulse", "first.time", "later", *(f"spec.{name}" for name in own), "steps")
    assert setting_names(gait) == names
    assert setting_names(replace(gait, later=Push()))[2:5] == ("later", "later.impulse", "later.time")
    new = changed(
        gait, {"count": 8.0, "first.impulse": 0.5, "push.time": 3.0, "steps": 2, "start": [1, 2, 3]}
    )
    spec = Spec(count=8, push=Push(time=3.0), start=(1.0, 2.0, 3.0))
    assert new == Gait(first=Push(impulse=0.5), spec=spec, steps=2) and type(new.spec.count) is int
    with pytest.raises(
        InputError, match="^setting 'impulse' could be first.impulse or spec.push.impulse; give more"
    ):
        changed(gait, {"impulse": 1.0})
    with pytest.raises(UnknownNameError, match="^no setting 'lenght'; did you mean 'length'"):
        changed(gait, {"lenght": 1.0})
    with pytest.raises(InputError, match="count must be an integer"):
        changed(gait, {"count": 8.5})


def test_settings_that_are_off_are_switched_on_before_their_own_are_changed() -> None:
    gait, on = Gait(), {"later.impulse": 0.3, "later": True}
    for order in (on, dict(reversed(on.items()))):
        assert changed(gait, order).later == Push(impulse=0.3)
    there = Gait(later=Push(time=2.0))
    assert changed(there, {"later": True}).later == Push(time=2.0), "what is on stays as it is"
    assert (
        changed(there, {"later": None}).later is None
        and changed(there, {"later.impulse": 0.3, "later": None}) == gait
    )
    for settings_, value in ((gait, 3), (there, "x")):
        with pytest.raises(
            InputError, match="^setting 'later' has settings of its own; change those, or give true or"
        ):
            changed(settings_, {"later": value})
    assert changed(gait, {"spec.open": True}).spec.open is True
    normal = normal_changes(gait, {"later": True, "later.impulse": 0.3, "count": 8.0, "start": [1, 2, 3]})
    assert normal == (
        *(("later", True), ("later.impulse", 0.3), ("spec.count", 8), ("spec.start", (1.0, 2.0, 3.0))),
    )
    with pytest.raises(InputError, match="^setting 'spec.count' is given twice$"):
        normal_changes(gait, {"count": 4, "spec.count": 4})


def test_attributes_are_fixed_when_the_last_constructor_has_returned() -> None:
    class Shoe(FixedAttributes):
        def __init__(self, size: float) -> None:
            self.size, self._lace = size, 1

    class Boot(Shoe):
        def __init__(self, size: float, height: float = 0.2) -> None:
            super().__init__(size)
            self.height = height

        def wear(self) -> None: ...

    assert str(inspect.signature(Boot)) == "(size: 'float', height: 'float' = 0.2) -> 'None'"
    boot = Boot(1.0)
    boot.size, boot._hidden = 2.0, 3.0  # type: ignore[attr-defined]
    with pytest.raises(UnknownNameError, match="^no attribute of Boot 'colour'; choices: height, size$"):
        boot.colour = "red"  # type: ignore[attr-defined]


def test_messages_list_few_choices_and_count_many() -> None:
    for count, hint in (
        (20, ", n19, n2, n3, "),
        (21, "there are 21, among them n0, n1, n10, n11, n12, n13, n14, n15, n16, n17$"),
    ):
        with pytest.raises(UnknownNameError, match=f"^no tool 'xyz'; (choices: n0, .*)?{hint}"):
            unknown_name("tool", "xyz", [f"n{i}" for i in range(count)])
    check_parts("a number", 3, "real", "imag")
    with pytest.raises(InputError, match="^a driver must have read, write and damp; 'read' is missing in 3$"):
        check_parts("a driver", 3, "read", "write", "damp")
    with pytest.raises(InputError, match="^a controller must have command; 'command' is missing in 3$"):
        check_parts("a controller", 3, "command")
