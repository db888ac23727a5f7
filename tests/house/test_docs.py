"""The pages of the documentation do what they say: programs run, names exist, links lead somewhere."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import importlib
import inspect
import io
import json
import os
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import wbc
from wbc.app.cli import main
from wbc.core.settings import unit_and_choices
from wbc.feet import foot
from wbc.sim.rig.actions import press
from wbc.sim.rig.spec import FootTest
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.spec import terrain

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

import measured  # noqa: E402 - of docs

PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md"]
LONG = ("logs.md", "motion.md", "own_loop.md", "stiffness.md", "studies.md", "walking.md")
"""Pages whose programs take seconds: they run with -m slow."""

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OUTPUT = re.compile(r"\s*^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SLOW = re.compile(r"<!-- slow -->\s*\Z")
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")

REGISTERS = (
    ("wbc.robots.registry", "_FACTORIES"),
    ("wbc.feet.soles.catalog", "_FEET"),
    ("wbc.sim.terrain.families.base", "_FAMILIES"),
    ("wbc.tasks.scheduling.policies", "_POLICIES"),
    ("wbc.sim.studies.trials", "KINDS"),
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
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the examples in it, and registers that nobody else sees."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    for module, name in REGISTERS:
        place = importlib.import_module(module)
        monkeypatch.setattr(place, name, copy.copy(getattr(place, name)))
    return tmp_path


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=pytest.mark.slow) if p.name in LONG else p
        for p in PAGES
        if p.name != "CONTRIBUTING.md" and programs(p)
    ],
    ids=lambda page: page.stem,
)
def test_programs_of_a_page_run_one_after_the_other(page: Path, workplace: Path) -> None:
    run(page, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [p for p in PAGES if len(programs(p)) > len(programs(p, slow=False))], ids=lambda page: page.stem
)
def test_slow_programs_of_a_page_run_too(page: Path, workplace: Path) -> None:
    run(page, slow=True)


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


def test_the_smallest_of_each_works(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Task, foot, ground, robot, study and command of CONTRIBUTING."""
    names = run(ROOT / "CONTRIBUTING.md", slow=False)
    assert len((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines()) <= 110
    robot = wbc.load_robot("biped").robot()
    controller = wbc.Controller(robot, 0.005)
    controller.add(wbc.PostureTask(), wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    height = controller.add(names["HeightTask"](robot.torso_frame))
    assert controller.solve().ok and abs(height.error[0]) < 1e-12
    height.target = height.target + 0.1
    assert controller.solve().ok and height.error[0] == pytest.approx(0.1)
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


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.stem)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(FENCE.sub("", text_of(page))):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_family_of_grounds_is_on_its_page() -> None:
    """With what it is, its amplitude and its cost."""
    page = text_of(ROOT / "docs" / "grounds.md")
    row = r"^\| `(\w+)` \|[^|]*\| \d+ \| [\d,]+(?: nodes)? \| [\d,]+ \|$"
    assert set(re.findall(row, page, flags=re.MULTILINE)) == set(terrain_families())


def test_every_picture_is_shown_on_a_page() -> None:
    shown = "".join(page.read_text(encoding="utf-8") for page in (*PAGES, ROOT / "README.md"))
    for picture in (ROOT / "docs" / "images").iterdir():
        assert f"images/{picture.name})" in shown, f"no page shows {picture.name}"


def test_extras_are_installed_from_a_clone() -> None:
    """The library is in no package index: `pip install wbc[…]` would install something else."""
    sources = (path for room in ("wbc", "sim", "feet") for path in (ROOT / room).rglob("*.py"))
    for path in (*PAGES, ROOT / "README.md", *sources):
        assert not re.search(r"\bwbc\[[a-z]+\]", path.read_text(encoding="utf-8")), path


@pytest.mark.slow
def test_the_programs_that_draw_pictures_can_be_imported() -> None:
    """They run seldom: a name that has moved is noticed here."""
    names = ", ".join(sorted(file.stem for file in (ROOT / "docs").glob("*.py") if file.stem != "conf"))
    done = subprocess.run(
        [sys.executable, "-c", f"import {names}"],
        cwd=ROOT / "docs",
        env={**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_the_page_of_measurements_is_that_of_its_data() -> None:
    data = measured.read()
    assert measured.page(data) == (ROOT / "docs" / "measured.md").read_text(encoding="utf-8")
    walks = [version["walk"] for version in data["version"]]
    assert walks == list(range(1, len(walks) + 1))
    for table in data["table"]:
        assert {"commit", "date", "columns", "align"} <= table.keys() or "rows" not in table, table
        assert table.get("walk", 1) in walks


def test_a_table_of_an_older_walk_is_stale_but_on_a_flat_floor() -> None:
    table = {"commit": "abcdef0", "date": "2026-11-25", "walk": 8}
    assert measured.caption(table, 8) == "*Measured at `abcdef0`, 2026-11-25, walk 8.*"
    assert "**stale**: the walk is 9 now" in measured.caption(table, 9)
    assert "as 9 on a flat floor" in measured.caption({**table, "flat": True}, 9)


@pytest.mark.slow
def test_the_reference_walk_is_that_of_the_last_version(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when walks compute something else: then add a version to measured.toml."""
    data = measured.read()
    (command,) = re.findall(r"The reference walk is `wbc ([^`]+)`", data["reference"])
    assert main([*command.split(), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    errors = [1e3 * result[name]["mean"] for name in ("zmp_error", "com_error", "dcm_error")]
    assert errors == pytest.approx(data["version"][-1]["errors"], rel=0.01)


ATTRIBUTE = re.compile(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", re.MULTILINE)


def test_settings_say_the_units_of_their_numbers() -> None:
    """Pages and `--help` show the text of a field alone, without the unit in its annotation."""
    told = 0
    for module in pkgutil.walk_packages(wbc.__path__, "wbc."):
        if module.name.endswith("__main__"):
            continue
        for kind in filter(inspect.isclass, vars(importlib.import_module(module.name)).values()):
            if not (dataclasses.is_dataclass(kind) and kind.__module__ == module.name):
                continue
            _, _, text = (inspect.getdoc(kind) or "").partition("Attributes:\n")
            about = dict(ATTRIBUTE.findall(text))
            for field in dataclasses.fields(kind):
                for unit in filter(None, unit_and_choices(kind, field.name)[0].split(", ")):
                    words = "degrees" if unit == "°" else re.escape(unit)
                    said = about.get(field.name)
                    told += said is not None
                    assert said is None or re.search(rf"(?i)(?<![\w/]){words}(?![\w/²])", said), (
                        f"{kind.__name__}.{field.name} has the unit {unit}"
                    )
    assert told > 350


def test_a_name_that_does_not_exist_is_noticed() -> None:
    assert exists("wbc.tasks.stabilizer.gains.StabilizerGains.dcm_p") and exists("wbc.Plant")
    assert not exists("wbc.tasks.stabilizer.gains.StabilizerGains.dcm_q") and not exists("wbc.wlak")
