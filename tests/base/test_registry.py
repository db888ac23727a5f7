"""Registries, the files of code that names lead to, parameters of calls, and names that a module lacks."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, TypedDict, Unpack

import pytest

from wbc.base import drawing, registry
from wbc.base.errors import InputError, UnknownNameError
from wbc.base.html import html_table
from wbc.base.processes import child_command
from wbc.base.registry import (
    Registry,
    allow_code,
    call_checked,
    code_of,
    in_file,
    is_data,
    reading_data,
    run_code,
)


def of_numbers(value: Any) -> None:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise InputError(f"{value} is no number")


@pytest.fixture(autouse=True)
def no_code_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_allowed", set())


def test_entries_are_checked_and_a_taken_name_stays() -> None:
    things = Registry("thing", {"one": 1}, check=of_numbers)
    things.add("two", 2)
    assert things.names() == ("one", "two") and things["two"] == 2 and dict(things.loaded()) == dict(things)
    assert Registry("thing").names() == () and things.find("one") == ("one", 1)
    wrong: list[tuple[Any, Any]] = [("", 1), ("  ", 1), (3, 1), ("three", "text"), (None, 1)]
    for pair in wrong:
        with pytest.raises(InputError):
            things.add(*pair)
    with pytest.raises(UnknownNameError, match="'two'"):
        things["tow"]
    assert things.names() == ("one", "two")

    @dataclass(frozen=True)
    class Part:
        make: Any

    def first() -> None: ...
    def again() -> None: ...

    makers: Registry[Any] = Registry("maker")
    for name, value, other in (
        ("part", Part(first), Part(again)),
        ("maker", first, again),
        ("kind", Part, int),
    ):
        makers.add(name, value)
        makers.add(name, value)  # the same place
        with pytest.raises(InputError, match="registered already"):
            makers.add(name, other)
        assert makers[name] is value


def test_entries_of_other_packages_are_loaded_when_they_are_used(monkeypatch: pytest.MonkeyPatch) -> None:
    points = {
        "tau": EntryPoint("tau", "math:tau", "wbc.things"),
        "one": EntryPoint("one", "math:pi", "wbc.things"),  # a name that is taken
        "gone": EntryPoint("gone", "math:nothing", "wbc.things"),
    }
    monkeypatch.setattr(registry, "_offered", lambda group, path: points if group == "wbc.things" else {})
    things = Registry("thing", {"one": 1.0}, group="wbc.things", check=of_numbers)
    assert things.names() == ("one", "tau", "gone") and "tau" not in things and things["one"] == 1.0
    assert things["tau"] == pytest.approx(6.283185307179586) and set(things.offered()) == {"gone"}
    for name, said in (("gone", "math:nothing"), ("taw", "'tau'")):
        with pytest.raises(InputError, match=said):
            things[name]
    assert set(things.loaded()) == {"one", "tau"} and not Registry("thing").offered()


CODE = """
from math import tau
import beside
HALF, text = tau / 2, "text"
def own(): ...
"""


@pytest.fixture
def code(tmp_path: Path) -> Path:
    (tmp_path / "beside.py").write_text("")
    path = tmp_path / "mine.py"
    path.write_text(CODE)
    return path


def test_a_file_gives_an_entry_whose_name_has_its_hash(code: Path) -> None:
    before = list(sys.path)
    things = Registry("thing", {"one": 1.0}, check=of_numbers)
    name, value = things.find(f"{code}:HALF")
    assert value == pytest.approx(3.141592653589793) and name.startswith(f"{code}:HALF#")
    assert things.find(name) == (name, value) and sys.path == before
    for bad, said in (
        (f"{code}:nothing", "HALF"),
        (f"{code}:text", "no number"),
        (f"{code}:HALF#12", "changed"),
    ):
        with pytest.raises(InputError, match=said):
            things.find(bad)
    code.write_text(CODE + "HALF = 3.0\n")
    with pytest.raises(InputError, match="changed"):
        things.find(name)
    assert things.find(f"{code}:HALF")[1] == 3.0
    things[f"{code}:HALF"] = 7.0
    assert things.find(f"{code}:HALF") == (f"{code}:HALF", 7.0), "a name that is registered is no file"
    code.write_text("1 / 0")
    with pytest.raises(InputError, match="ZeroDivisionError"):
        things.find(f"{code}:own")
    assert sys.path == before


@pytest.mark.parametrize("named", [lambda code: {"robot": [f"{code}:HALF"]}, str, Path])
def test_data_run_no_code_but_that_of_a_file_which_a_user_has_named(
    code: Path, named: Callable[[Path], object]
) -> None:
    registry._allowed.clear()
    things = Registry("thing", check=of_numbers)
    assert not is_data()
    with reading_data():
        assert is_data()
        with pytest.raises(InputError, match="allow_code"):
            things.find(f"{code}:HALF")
        allow_code(named(code), None, 3)
        assert things.find(f"{code}:HALF")[1] > 3.0
    assert not is_data()
    registry._allowed.clear()
    things.find(f"{code}:HALF")  # a user's
    with reading_data():
        assert things.find(f"{code}:HALF")[1] > 3.0
    given = {"a": "mine.py:A", "b": ["text", ("their.py:B#12", Path("x.py"))], "c": 3.0, "d": None}
    assert [*code_of(given, "last.py:C")] == ["mine.py", "their.py", "x.py", "last.py"]
    assert in_file("mine.py:A") and not in_file("mine.py") and not in_file(3) and not in_file("flat")


def test_code_is_run_once_for_each_content(tmp_path: Path) -> None:
    path, ran = tmp_path / "counted.py", tmp_path / "ran"
    path.write_text(f"open({str(ran)!r}, 'a').write('x')")
    run_code([path, path])
    assert ran.read_text() == "x"
    path.write_text(path.read_text() + "\n")
    run_code([path])
    assert ran.read_text() == "xx"
    for name in ("text.txt", "none.py"):
        (tmp_path / "text.txt").touch()
        with pytest.raises(InputError, match=name):
            run_code([tmp_path / name])


class Options(TypedDict, total=False):
    height: float


def make(length: float, width: float = 2.0, **options: Unpack[Options]) -> float:
    return length * width + options.get("height", 0.0)


def test_parameters_are_checked_before_a_call() -> None:
    assert call_checked("maker", make, {"length": 3.0}) == 6.0
    assert call_checked("maker", make, {"length": 3.0, "width": 1.0, "height": 0.5}) == 3.5
    for given, kind, said in (
        ({"lenght": 3.0}, UnknownNameError, "length"),
        ({"length": 1.0, "heihgt": 3.0}, UnknownNameError, "height"),
        ({"width": 3.0}, InputError, "'length'"),
        ({"length": "a", "width": "b"}, InputError, "maker cannot use"),
    ):
        with pytest.raises(kind, match=said):
            call_checked("maker", make, given)

    def loose(**values: float) -> float:
        return sum(values.values())

    assert call_checked("maker", loose, {"a": 1.0, "b": 2.0}) == 3.0


@pytest.mark.parametrize(
    ("value", "libraries", "usable"),
    [
        ("", (), True),
        (" EGL ", ("EGL",), True),
        ("egl", (), False),
        ("osmesa", ("EGL",), False),
        ("glx", (), True),
        ("off", (), True),
        ("cgl", ("EGL",), False),
        ("nonsense", ("EGL",), False),
    ],
)
def test_mujoco_draws_with_what_this_machine_has(
    monkeypatch: pytest.MonkeyPatch, value: str, libraries: tuple[str, ...], usable: bool
) -> None:
    def load(name: str) -> None:
        raise OSError(name)

    monkeypatch.setenv("MUJOCO_GL", value)
    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(drawing, "find_library", lambda name: name if name in libraries else None)
    monkeypatch.setattr(ctypes, "CDLL", load)
    monkeypatch.setattr(drawing, "_unusable", [])
    drawing.check_opengl()
    assert os.environ["MUJOCO_GL"] == (value if usable else "disable")
    assert (value in drawing.advice() and "egl" in drawing.advice()) if not usable else not drawing.advice()
    if not usable:
        monkeypatch.setenv("MUJOCO_GL", value)
        monkeypatch.setattr(ctypes, "CDLL", lambda name: None)  # found without a list of libraries
        drawing.check_opengl()
        assert (os.environ["MUJOCO_GL"] == value) == (value in ("egl", "osmesa"))
        monkeypatch.setitem(sys.modules, "mujoco", sys)
        monkeypatch.setenv("MUJOCO_GL", value)
        drawing.check_opengl()
        assert os.environ["MUJOCO_GL"] == value, "MuJoCo has read it already"


def test_a_line_of_a_table_is_a_row_and_one_cell_fills_it() -> None:
    table = html_table("Title <1>\n\nname   mass\n  arm    2.5 kg  \n")
    rows = table.split("<tr>")[1:]
    assert [row.count("<td") for row in rows] == [1, 2, 2] and 'colspan="2"' in rows[0]
    assert "&lt;1&gt;" in rows[0] and ">2.5 kg<" in rows[2] and table.count("colspan") == 1


def test_a_child_imports_from_where_its_parent_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "path", [str(tmp_path), "relative"])
    command = child_command("module", "a", "b")
    assert command[0] == sys.executable and "-P" in command and command[-3:] == ["module", "a", "b"]
    assert str(tmp_path) in command[-4] and str(Path("relative").absolute()) in command[-4]


@pytest.mark.parametrize(
    "place", ["\0.py", "a\ud800.py", "~nobody-at-all/a.py", f"{'x' * 5000}.py", "nowhere.py"]
)
def test_a_file_of_code_that_no_file_is_is_refused_by_name(place: str) -> None:
    allow_code(place)
    for run in (lambda: Registry("thing").find(f"{place}:X"), lambda: run_code([Path(place)])):
        with pytest.raises(InputError, match="^no Python file .*; give one"):
            run()
