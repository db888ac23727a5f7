"""The pages of the documentation do what they say: programs run, names exist, links lead somewhere."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest

import wbc
from wbc.app.cli import main
from wbc.base.settings import full_name, setting_names
from wbc.feet import foot
from wbc.sim.rig.press import press
from wbc.sim.rig.rig import FootTest
from wbc.sim.terrain.spec import terrain
from wbc.walking.stepping.settings import RobotSize, SteppingConstants, SteppingSettings

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md"]
RECIPES = ROOT / "docs" / "howto.md"
PICTURES = ROOT / "docs" / "pictures"
LINKED = [
    *PAGES,
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "benchmarks/README.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
]
LONG = (
    "control.md",
    "estimation.md",
    "falls.md",
    "hands.md",
    "logs.md",
    "motion.md",
    "coming_from.md",
    "own_loop.md",
    "plant.md",
    "policies.md",
    "programs.md",
    "seeing.md",
    "stepping.md",
    "studies.md",
    "tutorial.md",
    "walking.md",
)
"""Pages whose programs take seconds: they run with -m slow."""

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OUTPUT = re.compile(r"\s*^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SLOW = re.compile(r"<!-- slow -->\s*\Z")
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]+))?[^)]*\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)

REGISTERS = (
    ("wbc.robots.registry", "_FACTORIES"),
    ("wbc.feet.soles.catalog", "_FEET"),
    ("wbc.sim.terrain.families.base", "_FAMILIES"),
    ("wbc.tasks.scheduling.policies", "_POLICIES"),
    ("wbc.sim.studies.outcomes", "KINDS"),
)
"""Registries that pages add to, hidden from other tests."""


def text_of(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"^ +```", text, re.MULTILINE), f"{page.name}: an indented program would not be run"
    return text


def programs(page: Path, *, slow: bool = True) -> list[tuple[int, str, str | None]]:
    """Line, program and the output that stands right behind it, for each program of a page.

    Those behind `<!-- slow -->` are left out unless they are wanted.
    """
    text = text_of(page)
    found = []
    for match in FENCE.finditer(text):
        if match[1] == "python" and (slow or not SLOW.search(text, 0, match.start())):
            output = OUTPUT.match(text, match.end())
            found.append((text.count("\n", 0, match.start(2)), match[2], output and output[1]))
    return found


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the examples in it, and registers that nobody else sees."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    registries = [getattr(importlib.import_module(module), name) for module, name in REGISTERS]
    before = [dict(registry) for registry in registries]
    yield tmp_path
    for registry, entries in zip(registries, before, strict=True):
        dict.clear(registry)
        dict.update(registry, entries)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=pytest.mark.slow) if p.name in LONG else p
        for p in PAGES
        if p.name != "CONTRIBUTING.md" and p != RECIPES and programs(p)
    ],
    ids=lambda page: page.stem,
)
def test_programs_of_a_page_run_one_after_the_other(page: Path, workplace: Path) -> None:
    run(page, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [p for p in PAGES if p != RECIPES and len(programs(p)) > len(programs(p, slow=False))],
    ids=lambda page: page.stem,
)
def test_slow_programs_of_a_page_run_too(page: Path, workplace: Path) -> None:
    run(page, slow=True)


OUTCOMES = {
    "Carry a load from the start": r"2 steps, None",
    "Push and plot": r"moved by \d+ mm",
    "Walk an L": r"0\.[345] m ahead and 0\.[345] m to the left, None",
    "A robot from a wheel": r"moved by \d\.\d mm",
    "A sensor of your own": r"[56]\d mm higher, None",
    "Drive from another process": r"[1-9]\d* steps, None and the steering ended with 0",
    "Two laws of balance compared": r"position: completed.*\n.*torque: completed",
}
"""Recipe → what it prints."""

RECIPE = re.compile(r"^## (.*?)\n(.*?)^```python\n(.*?)^```\n+^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def words(text: str) -> list[str]:
    """Words of a printed text without its figures, which are not the same on every machine."""
    return re.sub(r"-?\d[\d.e+-]*", "0", text).split()


@pytest.mark.parametrize(
    ("name", "text", "program", "output"),
    [
        pytest.param(*recipe, id=recipe[0], marks=pytest.mark.slow if "<!-- slow -->" in recipe[1] else ())
        for recipe in RECIPE.findall(text_of(RECIPES))
    ],
)
def test_each_recipe_runs_as_it_stands(
    name: str, text: str, program: str, output: str, workplace: Path
) -> None:
    """Each is a file of its own, of 15 to 30 lines, that ends with the lines of the page but for their figures."""
    lines = [line for line in program.splitlines() if line.strip()]
    assert len(lines) <= 32 and text.strip(), "a recipe is short, and is explained"
    (workplace / "recipe.py").write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "recipe.py"],
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    if "render_video" in program and "RenderError" in done.stderr:
        pytest.skip("films need the extra, and a machine that draws")
    assert done.returncode == 0, done.stderr
    assert re.search(OUTCOMES.get(name, ""), done.stdout), done.stdout
    told = words(output)
    assert words(done.stdout)[-len(told) :] == told, done.stdout


def test_there_are_ten_recipes_and_all_are_in_the_table() -> None:
    names = [name for name, *_ in RECIPE.findall(text_of(RECIPES))]
    assert set(OUTCOMES) <= set(names)
    assert len(names) == 10 and names == re.findall(r"\| \[(.*?)\]\(#", text_of(RECIPES))


def run(page: Path, *, slow: bool) -> dict[str, Any]:
    names: dict[str, Any] = {"__name__": "page"}
    for line, program, expected in programs(page, slow=slow):
        # With the lines of the page in a traceback, and without this file's future statement.
        code = compile("\n" * line + program, str(page), "exec", dont_inherit=True)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(code, names)
        if expected is not None:
            assert printed.getvalue().rstrip() == expected.rstrip(), (
                f"{page.name}:{line + 1} prints otherwise"
            )
    return names


OTHERS = re.compile(r"^```py\n(.*?)^```\n+^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""Programs for other libraries, and what they print."""


@pytest.mark.parametrize("library", ["pink", "mink", "placo"])
def test_programs_of_other_libraries_print_what_ours_do(library: str, workplace: Path) -> None:
    """They are run where the library is installed; each has its program, and what it prints is that of ours."""
    page = ROOT / "docs" / "coming_from.md"
    (program, expected), *more = (each for each in OTHERS.findall(text_of(page)) if library in each[0])
    assert not more and expected in {output for _, _, output in programs(page)}
    compile(program, str(page), "exec")
    pytest.importorskip(library)
    exec(next(text for _, text, _ in programs(page) if "panda.urdf" in text), {})
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(program, {"__name__": "page"})
    assert printed.getvalue() == expected


def test_the_task_of_the_page_of_tasks_works() -> None:
    names = run(ROOT / "docs" / "tasks.md", slow=False)
    robot = wbc.load_robot("hrp4_class").robot()
    controller = wbc.Controller(robot, 0.005)
    controller.add(wbc.PostureTask(), wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    height = controller.add(names["HeightTask"](robot.torso_frame))
    assert controller.solve().ok and abs(height.error[0]) < 1e-12
    height.target = height.target + 0.1
    assert controller.solve().ok and height.error[0] == pytest.approx(0.1)


def test_the_smallest_of_each_works(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Foot, ground, robot, study and command of CONTRIBUTING."""
    names = run(ROOT / "CONTRIBUTING.md", slow=False)
    robot = wbc.load_robot("biped").robot()
    assert {trial.spec.foot for trial in names["study"].trials()} == {"flat", "long_toes"}
    assert press(FootTest(foot("long_toes"), terrain("waves", amplitude=0.01))).hold is not None
    names["mass"]("biped")
    assert capsys.readouterr().out == f"biped: {robot.mass:.1f} kg\n"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_in_the_text_exist(page: Path) -> None:
    for code in CODE.findall(FENCE.sub("", text_of(page))):
        name = code.partition("(")[0]
        if re.fullmatch(r"wbc(\.\w+)+", name):
            assert exists(name), f"{page.name}: there is no {name}"


def exists(name: str) -> bool:
    """Return True if a dotted name is that of a module, or of something in one."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            if not hasattr(found, part) and part not in getattr(found, "__dataclass_fields__", {}):
                return False
            found = getattr(found, part, None)
        return True
    return False


def headings(page: Path) -> set[str]:
    """Return the headings of a page as they are written in links to them."""
    titles = HEADING.findall(FENCE.sub("", page.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT).with_suffix("")))
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    for target, heading in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        if "://" not in target:
            there = page.parent / target if target else page
            assert there.exists() and (there.is_dir() or there.stat().st_size > 0), f"{page.name}: {target}"
            assert not heading or heading in headings(there), f"{page.name}: {target}#{heading}"
            # The built reference has docstrings in place of these headings.
            assert not (heading and target.startswith("api/")), f"{page.name}: {target}#{heading}"


@pytest.mark.slow
def test_the_programs_that_draw_pictures_can_be_imported_and_those_that_only_compute_draw(
    tmp_path: Path,
) -> None:
    """They run seldom: a name that has moved, or a table with another head, is noticed here."""
    names = ", ".join(sorted(file.stem for file in PICTURES.glob("*.py")))
    draw = f"sys.argv[1:] = [{str(tmp_path)!r}]; charts.main(); figures.main()"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys, {names}; {draw}"],
        cwd=PICTURES,
        env={**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    drawn = (tmp_path / "architecture.svg").read_text(encoding="utf-8")
    told = (ROOT / "docs" / "images" / "architecture.svg").read_text(encoding="utf-8")
    assert drawn == told, "draw it anew: python docs/pictures/figures.py"


def test_constants_of_the_law_are_those_of_the_code() -> None:
    size = RobotSize.of(wbc.load_robot("g1").robot(), SteppingSettings().bend)
    found = re.findall(
        r"\| \*?`(\w+)`\*? \| ([\d.]+)[^|]* \| ([\d.]+)[^|]* \|", text_of(ROOT / "docs/stepping_law.md")
    )
    assert len(found) > 20
    for name, value, of_g1 in found:
        own = SteppingSettings() if name in SteppingSettings.__dataclass_fields__ else SteppingConstants()
        place = attrgetter(full_name(setting_names(own), name))
        given, si = (np.atleast_1d(place(values))[0] for values in (own, own.in_si(size)))
        assert given == float(value), name
        assert si == pytest.approx(float(of_g1), rel=0.05, abs=5e-4), name
    units = re.findall(
        r"^\| (?:length|time|velocity|force) \|.*", text_of(ROOT / "docs/stepping_law.md"), re.MULTILINE
    )
    for column, robot in enumerate(("g1", "hrp4_class", "talos"), start=3):
        size = RobotSize.of(wbc.load_robot(robot).robot(), SteppingSettings().bend)
        own = size.height, 1.0 / size.omega, size.height * size.omega, size.weight
        told = [float(row.split("|")[column].split()[0]) for row in units]
        assert own == pytest.approx(told, rel=2e-3), robot


@pytest.mark.slow
def test_the_reference_walk_is_that_of_the_last_version(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when walks compute something else: then measured.md needs a row of changes."""
    text = " ".join((ROOT / "docs" / "measured.md").read_text(encoding="utf-8").split())
    found = re.search(r"The reference walk is `wbc ([^`]+)`: its errors .*? are (.*?) mm\.", text)
    assert found is not None
    assert main([*found[1].split(), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    errors = [1e3 * result[name]["mean"] for name in ("zmp_error", "com_error", "dcm_error")]
    assert errors == pytest.approx([float(e) for e in re.findall(r"[\d.]+", found[2])], rel=0.01)
