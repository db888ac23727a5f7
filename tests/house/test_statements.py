"""Statements and figures of the pages, against the code that they are about."""

from __future__ import annotations

import ast
import importlib
import re
import signal
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Annotated

import pytest
from numpy.typing import ArrayLike
from pydantic import Field

import wbc
from wbc.app import cli
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Numbers, Positive, Seed
from wbc.sim.balance.standing import StandSpec, recovers
from wbc.sim.trial.push import WalkPush
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings, walk_distance
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.reach import Reach

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = ("g1", "hrp4_class", "talos")


def text_of(name: str) -> str:
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def script(name: str, monkeypatch: pytest.MonkeyPatch, folder: str = "") -> ModuleType:
    """Return a program of the folder docs as a module."""
    monkeypatch.syspath_prepend(ROOT / "docs" / folder)
    return importlib.import_module(name)


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_body_goes_as_low_as_the_page_says(robot: str) -> None:
    """One millimetre lower is refused; bounds are rounded down."""
    text = (ROOT / "docs" / "walking.md").read_text(encoding="utf-8")
    heads, free, planned = (
        [cell.strip(" `") for cell in line.strip("|").split("|")]
        for line in re.findall(
            r"^\| (?:Lowest CoM|the robot stands,|planned steps \|).*$", text, re.MULTILINE
        )
    )
    column = heads.index(robot)
    model = wbc.load_robot(robot).robot()
    half_sitting = float(model.com[2])
    standing = FootstepPlan.standing(model)
    for plan, mode, bound in ((None, "torque", free), (walk_distance(standing, 3.0), "position", planned)):
        settings = WalkingControlSettings(mode=mode)
        body = WalkingControl(wbc.load_robot(robot).robot(), plan, 0.005, settings).body
        body.com_height = half_sitting - 1e-3 * float(bound[column])
        with pytest.raises(InputError):
            body.com_height = half_sitting - 1e-3 * float(bound[column]) - 1e-3


def test_legs_reach_further_from_a_low_body() -> None:
    robot = wbc.load_robot("g1").robot()
    found = re.search(
        r"reaches ([\d.]+) m with a step; with the CoM (\d+) mm lower it reaches ([\d.]+) m",
        text_of("docs/walking.md"),
    )
    assert found is not None
    high, low = (Reach.of(robot, float(robot.com[2]) - 1e-3 * down).max_length for down in (0, int(found[2])))
    assert (high, low) == (
        pytest.approx(float(found[1]), abs=0.005),
        pytest.approx(float(found[3]), abs=0.005),
    )


@pytest.mark.parametrize(("robot", "inward"), [("talos", 20), ("hrp4_class", 18), ("g1", 10)])
def test_the_pattern_in_the_figure_is_that_of_a_walk(robot: str, inward: int) -> None:
    """The reference of the ZMP lies to the inner side of the foot's middle as the page says."""
    text = text_of("docs/planned_law.md")
    assert f"{inward} mm to the inner side" in text or f"{inward} mm on `{robot}`" in text
    model = wbc.load_robot(robot).robot()
    plan = walk_distance(FootstepPlan.standing(model), 0.58)
    planner = LipmWalk(model, plan, float(model.com[2]), 0.005).course.preview
    assert planner.settings.target.inward == pytest.approx(1e-3 * inward)
    words = {4: "Four", 5: "Five", 6: "Six"}
    assert robot != "hrp4_class" or f"*{words[len(plan)]} steps of `hrp4_class` as planned" in text


def test_the_picture_of_a_tick_has_the_order_of_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = script("tick_picture", monkeypatch, "pictures")
    svg = (ROOT / "docs" / "images" / "tick.svg").read_text(encoding="utf-8")
    assert svg == picture.tick_svg(), "draw it anew: python docs/pictures/figures.py"
    assert picture.order(wbc.PositionControl.act, {"_follow": "b", "_hold": "a"}) == ["a", "b"]


def test_captions_tell_the_speed_of_films() -> None:
    """Each film of the gallery, and those of the README and the first page."""
    tree = ast.parse((ROOT / "docs" / "pictures" / "render_walk.py").read_text(encoding="utf-8"))
    films = next(
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "FILMS"
    )
    assert isinstance(films, ast.Dict)
    paces = {
        ast.literal_eval(name): next(word.value.value for word in film.keywords if word.arg == "pace")
        for name, film in zip(films.keys, films.values, strict=True)
    }
    words = {1.0: "at its own speed", 2.0: "at twice the speed"}
    told = re.findall(
        r"\(images/(\w+)\.webp\) \*[^*]*?(at its own speed|at twice the speed|at [\d.]+ times the speed)",
        text_of("docs/gallery.md"),
    )
    said_of = {name: words.get(pace, f"at {pace:g} times the speed") for name, pace in paces.items()}
    assert dict(told).items() >= said_of.items()
    said = re.search(
        r"\*Left, at (\w+) the speed: .* Right, at ([\d.]+) times the speed", text_of("README.md")
    )
    assert (
        said is not None and (paces["walk"], paces["drive"]) == (2.0, float(said[2])) and said[1] == "twice"
    )
    assert "at twice the speed" in text_of("docs/index.md")


def test_the_repository_and_the_version_are_named_alike_everywhere() -> None:
    """The address is that of pyproject, the version that of the package."""
    address = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Repository"]
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), ROOT / "CITATION.cff"]
    named = {
        page.name: set(re.findall(r"(?:git\+|url *= \{|code: )(https://[^\s\"}`]+)", page.read_text("utf-8")))
        for page in pages
    }
    assert {name: found for name, found in named.items() if found - {address}} == {}
    assert {"start.md", "index.md", "CITATION.cff"} <= {name for name, found in named.items() if found}
    for page in ("docs/index.md", "CITATION.cff"):
        assert re.findall(r"version *[=:] \{?([\d.]+)", text_of(page))[-1] == wbc.__version__


def test_the_sheet_of_examples_has_all_that_it_does_not_leave_out(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = script("render_examples", monkeypatch, "pictures")
    found = {
        str(file.relative_to(sheet.EXAMPLES).with_suffix(""))
        for folder in (sheet.EXAMPLES, sheet.EXAMPLES / "hands")
        for file in folder.glob("*.py")
        if not file.stem.startswith("_")
    }
    assert found == {*sheet.INSTANTS, *sheet.NOT_DRAWN}
    assert len(sheet.INSTANTS) == 14 and "Fourteen of the examples" in text_of("examples/README.md")


def test_exit_codes_are_those_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    """A fall is a result; a signal ends with its number and 128."""
    fall = ["walk", "--distance", "0.2", "--foot", "flat", "--terrain", "flat", "--eyes", "none"]
    assert main([*fall, "--push", "impulse=3,direction=90,time=0.1"]) == RAN
    assert "fell" in capsys.readouterr().out.lower()
    assert main(["walk", "--distance", "far"]) == BAD_INPUT
    table = dict(re.findall(r"\| (\d[\d, ]*) \| ([a-z ]+)", text_of("docs/commands.md").partition("## ")[0]))
    assert [*table] == ["0", "1", "2", "130", "129, 143"]
    for number in (signal.SIGHUP, signal.SIGTERM):
        with pytest.raises(SystemExit) as ended:
            cli._end(number, None)
        assert str(ended.value.code) in "129, 143"


@pytest.mark.slow
@pytest.mark.parametrize("feedback", ["closed", "open"])
def test_a_stand_holds_the_pushes_of_the_page(feedback: str) -> None:
    in_loop = re.search(
        r"In open loop.*`hrp4_class` holds ([\d.]+) Ns/kg forward in place of ([\d.]+)",
        (ROOT / "docs/measured_pushes.md").read_text(),
    )
    assert in_loop is not None and StandSpec().feedback == "closed"
    limit = float(in_loop[1 if feedback == "open" else 2])
    spec = StandSpec(robot="hrp4_class", mode="position", feedback=feedback, seconds=4.6)
    held = [recovers(spec, WalkPush(impulse=limit + change, time=0.5)) for change in (-0.01, 0.02)]
    assert held == [True, False]


def test_the_reference_says_types_as_a_reader_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unit and range behind the type, whatever annotates it; a signature with them can be parsed."""
    typing = pytest.importorskip("sphinx.util.typing")
    types = script("short_types", monkeypatch)
    for kind, said in (
        (Positive, "float (> 0)"),
        (Annotated[Positive, "rad"], "float (rad, > 0)"),
        (Annotated[NonNegative, "m/s²"] | None, "float (m/s², ≥ 0) | None"),
        (Annotated[float, Field(ge=0.3, le=0.7)], "float (≥ 0.3, ≤ 0.7)"),
        (tuple[Annotated[Seed, ""], ...], "tuple[int (≥ 0), ...]"),
        (Annotated[ArrayLike, Numbers(above=0.0), "Nm"], "(Nm, > 0)"),
    ):
        text = typing.stringify_annotation(kind, "smart")
        assert types.short_types(text).endswith(said)
        signature = f"(one: {text} = <factory>, *, two: int = 3)"
        (function,) = ast.parse(f"def f{types.as_names(signature)}: ...").body
        assert isinstance(function, ast.FunctionDef) and function.args.args[0].annotation is not None
        assert ast.unparse(function.args.args[0].annotation).translate(types.SIGNS).endswith(said)
    assert types.short_types("Annotated[Positive, 's'] | None") == "float (s, > 0) | None"


def test_tables_of_the_pages_are_those_of_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings, fields, terms, commands, grounds and studies, which a reader of a clone finds in the text."""
    tables = script("page_tables", monkeypatch)
    pages = [page for page in tables.PAGES if tables.MADE.search(page.read_text("utf-8"))]
    assert {page.stem for page in pages} == {
        *("README", "commands", "grounds", "measured", "policy_files", "settings"),
        *(page.stem for page in (ROOT / "docs" / "api").glob("*.md")),
    }
    for page in pages:
        text = page.read_text("utf-8")
        assert tables.filled(text) == text, f"{page.name} is not that of the code: python docs/page_tables.py"


def test_pages_of_the_reference_say_in_a_clone_how_to_read_it() -> None:
    pages = [page for page in (ROOT / "docs" / "api").glob("*.md")]
    assert len(pages) > 8
    for page in pages:
        before = page.read_text("utf-8").partition(".. automodule::")[0]
        assert re.search(r"^> .* type `python -m pydoc wbc\.", before, re.MULTILINE), page.name
