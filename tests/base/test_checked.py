"""Arguments that are checked against their annotations: what passes, what is refused, and what the message says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol, TypedDict, Unpack

import numpy as np
import pytest

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError
from wbc.base.settings import Count, NonNegative, Number, PositiveNumbers, Ratio, Triple
from wbc.core.robot import Robot


class Options(TypedDict, total=False):
    ramp: Annotated[NonNegative, "s"]


class Duck(Protocol):
    def quack(self) -> None: ...


class Spring:
    @checked
    def __init__(
        self,
        ratio: Ratio = 1.0,
        *,
        mode: Literal["soft", "hard"] = "soft",
        rate: Annotated[PositiveNumbers, "Nm/s"] | None = None,
        place: tuple[float, float] | float = 0.0,
        other: Spring | str | None = None,
        until: Callable[[], bool] | float = 1.0,
        duck: Duck | None = None,
        names: Sequence[str] = (),
        **options: Unpack[Options],
    ) -> None:
        self.ratio, self.rate, self.options, self.place, self.duck = ratio, rate, options, place, duck
        self._mass = 1.0

    @property
    def mass(self) -> float:
        return self._mass

    @mass.setter
    @checked
    def mass(self, value: Annotated[NonNegative, "kg"]) -> None:
        self._mass = value

    @checked
    def press(self, force: Triple, count: Count = 1) -> Any:
        return force


@checked
@dataclass(frozen=True)
class Ball:
    radius: Annotated[Ratio, "m"]
    height: Number = 0.0


@checked
def stretch(length: Annotated[Number, "m"], spring: Spring | None = None) -> float:
    return length


def test_good_values_pass_as_their_annotations_have_them() -> None:
    duck: Any = object()  # a protocol says what it needs where it is used
    spring = Spring(np.float32(0.5), rate=[1, 2], place=np.array([1, 2]), ramp=np.array(2), duck=duck)  # type: ignore[arg-type]
    assert spring.ratio == 0.5 and type(spring.ratio) is float and spring.options == {"ramp": 2.0}
    assert isinstance(spring.rate, np.ndarray) and spring.rate.dtype == np.float64
    assert spring.place == (1.0, 2.0) and spring.duck is duck
    spring.mass = 2
    assert spring.mass == 2.0 and spring.press([1, 2, 3]).shape == (3,)
    assert Ball(1, height=-3).height == -3.0 and stretch(-2.0, spring) == -2.0
    assert Spring(until=lambda: True, other=spring, mode="hard").ratio == 1.0


def mass(value: Any) -> None:
    Spring().mass = value


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: Spring(0.0), r"^ratio of Spring must be greater than 0, got 0.0$"),
    (lambda: Spring(ratio=1.5), r"^ratio of Spring must be less than or equal to 1, got 1.5$"),
    (lambda: Spring(float("nan")), "ratio of Spring"),
    (lambda: Spring("1"), r"ratio of Spring must be a valid number, got '1'"),  # type: ignore[arg-type]
    (lambda: Spring(True), "ratio of Spring"),
    (lambda: Spring(mode="firm"), r"mode of Spring must be 'soft' or 'hard', got 'firm'"),  # type: ignore[arg-type]
    (
        lambda: Spring(rate=[1.0, 0.0]),
        r"rate of Spring \(Nm/s\) must be finite numbers above 0, got \[1.0, 0.0\]",
    ),
    (lambda: Spring(rate="fast"), r"rate of Spring \(Nm/s\) must be numbers, got 'fast'"),
    (lambda: Spring(place=(1.0, "x")), r"place\[1\] of Spring must be a valid number, got 'x'"),  # type: ignore[arg-type]
    (lambda: Spring(other=3), r"other of Spring must be of class Spring or a valid string, got 3"),  # type: ignore[arg-type]
    (lambda: Spring(until="noon"), r"until of Spring must be callable or a valid number, got 'noon'"),  # type: ignore[arg-type]
    (lambda: Spring(ramp=-1.0), r"ramp of Spring \(s\) must be greater than or equal to 0, got -1.0"),
    (lambda: mass(-1.0), r"^mass of Spring \(kg\) must be greater than or equal to 0, got -1.0$"),
    (lambda: Spring().press([1.0, 2.0]), r"force of Spring.press must have shape \(3,\), got \(2,\)"),
    (lambda: Spring().press((0, 0, 1), 0), "count of Spring.press"),
    (lambda: Ball(2.0), r"^radius of Ball \(m\) must be less than or equal to 1, got 2.0$"),
    (lambda: stretch(float("inf")), r"^length of stretch \(m\) must be a finite number, got inf$"),
    (lambda: Spring(rato=1.0), r"^no argument 'rato' of Spring; did you mean 'ratio'"),  # type: ignore[call-arg]
    (lambda: Spring(rump=1.0), r"^no argument 'rump' of Spring; did you mean 'ramp'"),  # type: ignore[call-arg]
    (lambda: Spring().press(forse=(0, 0, 1)), r"^no argument 'forse' of Spring.press; did you mean 'force'"),  # type: ignore[call-arg]
    (lambda: stretch(1.0, 2.0), r"spring of stretch must be of class Spring, got 2.0"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "message"), REFUSED)
def test_a_value_that_its_annotation_does_not_allow_is_refused(
    call: Callable[[], object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_a_message_can_be_encoded_whatever_it_names() -> None:
    """A surrogate in a name, which a file or a command line may hold."""
    assert str(InputError("no robot '\ud800'")) == r"no robot '\ud800'"

    @checked
    def balance(robot: Robot) -> None: ...

    with pytest.raises(InputError, match="must be of class Robot"):
        balance("\ud800")  # type: ignore[arg-type]


def test_arguments_that_python_refuses_are_refused_by_python() -> None:
    """Too many, too few, and one by place and by name."""
    calls: list[Any] = [
        stretch,
        lambda: stretch(1.0, None, 2.0),  # type: ignore[call-arg]
        lambda: stretch(1.0, length=2.0),  # type: ignore[misc]
        lambda: Spring().press((0, 0, 1), force=(0, 0, 1)),  # type: ignore[misc]
        lambda: Spring(1.0, "soft"),  # type: ignore[call-arg]
    ]
    for call in calls:
        with pytest.raises(TypeError):
            call()


def test_sequences_and_mappings_are_checked_item_by_item() -> None:
    @checked
    def grip(
        names: Sequence[str] = (), forces: Mapping[str, Annotated[NonNegative, "N"]] | None = None
    ) -> tuple[Any, Any]:
        return names, forces

    take: Any = grip
    assert take(["a", "b"], {"a": 1}) == (("a", "b"), {"a": 1.0}) == take(iter("ab"), {"a": np.float64(1.0)})
    assert grip(("a",)) == (("a",), None) and set(take({"a", "b"})[0]) == {"a", "b"}
    for bad, place in (
        (("ab",), "names of grip must be a sequence"),
        ((b"ab",), "names"),
        (({"a": 1},), "names"),
        ((3,), "names"),
        ((["a", 3],), r"names\[1\] of grip"),
        (((), ["a"]), "forces of grip"),
        (((), {"a": -1.0}), r"forces\['a'\] of grip"),
        (((), {3: 1.0}), "forces"),
    ):
        with pytest.raises(InputError, match=place):
            take(*bad)


def test_a_refusal_names_the_argument_and_whose_it_is() -> None:
    """Of constructors, methods, class methods, setters and functions; a class that derives is named itself."""

    class Base:
        @checked
        def __init__(self, length: Ratio = 1.0) -> None: ...
        @checked
        def move(self, *, speed: Annotated[Ratio, "m/s"]) -> None: ...
        @classmethod
        @checked
        def of(cls, size: Ratio | tuple[Ratio, Ratio]) -> None: ...
        @checked
        def set_mass(self, value: Annotated[Ratio, "kg"]) -> None: ...

    class Own(Base): ...

    @checked
    def pull(force: Ratio, value: int = 0) -> None: ...

    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: Own(2.0), "length of Own must"),
        (lambda: Own().move(speed=2.0), "speed of Own.move (m/s) must"),
        (lambda: Own.of((1.0, 2.0)), "size[1] of Own.of must"),
        (lambda: Own.of(2.0), "size of Own.of must"),
        (lambda: Own().set_mass(2.0), "set_mass of Own (kg) must"),
        (lambda: pull(2.0), "force of pull must"),
    ]
    for call, said in calls:
        with pytest.raises(InputError) as refusal:
            call()
        assert str(refusal.value).startswith(said)


def test_what_is_right_already_is_passed_on_as_it_is() -> None:
    """Objects of a class and texts; a number is looked at each time, and no truth value is one."""

    @checked
    def take(thing: Spring | str | None, number: float | int = 0.0) -> Any:
        return thing

    spring = Spring()
    for thing in (spring, "text", None):
        assert take(thing) is thing
    for bad in (float("nan"), True, "1"):
        with pytest.raises(InputError):
            take(spring, bad)  # type: ignore[arg-type]


def test_attributes_that_are_fixed_or_results_are_not_assigned() -> None:
    class Plant:
        period: float = fixed("make another plant")
        place: Any = result("_place", "call `move`")
        parts: Any = result("_parts", "make another plant")

        def __init__(self) -> None:
            self.period, self._place, self._parts = 0.5, np.zeros(2), {"foot": 1}

    plant = Plant()
    for name in ("period", "place", "parts"):
        with pytest.raises(InputError, match=f"{name} of Plant"):
            setattr(plant, name, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        plant.place[0] = 1.0
    with pytest.raises(TypeError, match="does not support item assignment"):
        plant.parts["foot"] = 2
    assert plant.parts == {"foot": 1}
    plant._place[0] = 2.0
    assert plant.period == 0.5 and plant.place[0] == 2.0
