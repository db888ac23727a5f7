"""The journal: nothing that was written is lost or mixed up, and nothing that was not is made up."""

from __future__ import annotations

import contextlib
import json
import logging
import lzma
import math
import os
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

import wbc
from wbc.base.errors import InputError
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.studies.journal import (
    Entry,
    Journal,
    JournalError,
    canonical,
    check_journal_path,
    own_key,
    read_journal,
    trial_key,
)
from wbc.sim.studies.provenance import LABEL, LIBRARIES, differences, provenance, sources
from wbc.sim.studies.study import Cell, Study, left_out
from wbc.sim.studies.study_table import study_frame, study_table

VERSION = {"wbc": "1", "code": "abc"}


def entry(number: int, status: str = "done") -> Entry:
    result = {"steps": number, "x": 0.1 * number} if status in ("done", "diverged") else None
    return Entry({"kind": "walk", "seed": number}, status, result, {"wall_s": 1.5}, None, VERSION)


def written(path: Path, count: int) -> list[Entry]:
    entries = [entry(number) for number in range(count)]
    with Journal(path) as journal:
        for one in entries:
            journal.add(one)
    return entries


def test_gives_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "journal.jsonl"
    entries = written(path, 3)
    assert list(read_journal(path).values()) == entries
    with Journal(path) as journal:
        assert len(journal.entries) == 3 and entries[1].key in journal
    assert [json.loads(line)["result"]["steps"] for line in path.read_text().splitlines()] == [0, 1, 2]


def test_a_later_line_takes_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add(entry(1, "timeout"))
        journal.add(entry(1))
        assert len(journal.entries) == 1
    (only,) = read_journal(path).values()
    assert only.status == "done"


@examples(40)
@given(st.data())
def test_a_torn_last_line_is_cut_off_wherever_it_is_torn(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("torn") / "journal.jsonl"
    whole = [entry(number) for number in range(data.draw(st.integers(0, 3)))]
    torn = entry(99).line()
    kept = data.draw(st.integers(0, len(torn) - 1))
    content = b"".join(one.line() for one in whole)
    path.write_bytes(content + torn[:kept])
    assert list(read_journal(path).values()) == whole
    with Journal(path) as journal:
        assert list(journal.entries.values()) == whole
        journal.add(entry(5))
    assert path.read_bytes() == content + journal.entries[entry(5).key].line()


def test_the_key_of_today_is_found_for_specs_that_only_some_seeds_allow() -> None:
    """An oracle knows the ground of the seed 1, and not that of the seed 0."""
    spec = WalkSpec(
        foot="variable",
        policy="oracle",
        policy_params={"stones": 80.0, "boards": 5.0},
        terrain="patchwork",
        amplitude=0.04,
        terrain_params={"families": "boards stones cylinder_obstacles", "length": 1.2},
        seed=1,
        plan=WalkPlan(distance=1.0),
    )
    with pytest.raises(InputError, match="oracle"):
        replace(spec, seed=0)
    assert own_key(spec.to_json()) == trial_key(spec.to_json())
    plain = WalkSpec(seed=3).to_json()
    assert own_key(plain) == trial_key(plain) != own_key({**plain, "seed": 4})


def test_entries_that_a_study_does_not_use_are_counted_by_their_reason() -> None:
    """Of other code, of trials that the study has not, and of specs that cannot be read; its own are used."""
    study = Study(
        name="s", base={"plan": {"distance": 0.1}}, cells=(Cell("a", {}),), arms={"flat": {}}, seeds=(1, 2, 3)
    )
    other = {**provenance(), "files": "another"}
    specs = [trial.plain for trial in study.trials()]
    rows = [(specs[0], provenance()), (specs[1], other), (specs[2], other)]
    rows += [({**specs[0], "seed": 7 + k}, provenance()) for k in range(4)]
    rows += [({**specs[0], "robot": "nobody", "seed": k}, provenance()) for k in range(5)]
    entries = {
        entry.key: entry for entry in (Entry(spec, "done", {}, None, None, version) for spec, version in rows)
    }
    found = left_out(study, entries)
    assert (found.entries, found.other_code, found.other_trials, found.unreadable) == (12, 2, 4, 5)
    assert sum(found.differences.values()) == 2
    text = found.text()
    assert text is not None and text.startswith("11 of 12 entries are left out: 2 of another version")
    assert "4 of trials that are not part of it" in text and "5 whose spec" in text
    own = {key: entry for key, entry in entries.items() if entry.spec == specs[0]}
    assert left_out(study, own).text() is None
    foreign = {key: entry for key, entry in entries.items() if entry.spec.get("seed") == 8}
    assert left_out(study, foreign).text() is not None  # nothing at all is of the study
    assert left_out(study, own | foreign).text() is None


def test_numbers_that_json_has_not_are_written_as_null_whatever_holds_them() -> None:
    class Plain(dict):  # no dict of JSON's own
        pass

    values = {"a": math.nan, "b": [math.inf, 1.5, (-math.inf, 2)], "c": Plain(d=math.nan, e="x", f=3)}
    assert json.loads(canonical(values)) == {
        "a": None,
        "b": [None, 1.5, [None, 2]],
        "c": {"d": None, "e": "x", "f": 3},
    }


def test_entries_that_this_version_cannot_read_are_counted_where_any_code_is_taken(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, spec = tmp_path / "journal.jsonl", WalkSpec(plan=WalkPlan(distance=0.1)).to_json()
    with Journal(path) as journal:
        for seed in range(3):
            journal.add(Entry({**spec, "robot": "nobody", "seed": seed}, "done", {}, None, None, VERSION))
        journal.add(Entry(spec, "done", {}, None, None, VERSION))
    with caplog.at_level(logging.WARNING):
        assert len(read_journal(path, any_code=True)) == 1
    assert "3 entries" in caplog.text


def test_damaged_lines_are_passed_over_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "journal.jsonl"
    written(path, 3)
    one, other, last = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join((one, other.replace(b'"done"', b""), last)))
    with caplog.at_level(logging.WARNING):
        left = read_journal(path)
    assert sorted(one.spec["seed"] for one in left.values()) == [0, 2]
    assert "line 2" in caplog.text


def test_a_file_without_an_entry_is_no_journal_but_for_the_beginning_of_one(tmp_path: Path) -> None:
    path, line = tmp_path / "journal.jsonl", entry(1).line()
    for content in (b"notes\n", b"notes", b"{}\n", b"notes\n" + line[:20], line[5:20]):
        path.write_bytes(content)
        with pytest.raises(JournalError, match="no journal"):
            read_journal(path)
    for content in (b"", b"\n", line[:1], line[:20]):
        path.write_bytes(content)
        assert read_journal(path) == {}
    path.write_bytes(b"notes\n" + line)
    assert len(read_journal(path)) == 1


def test_one_writes_at_a_time_and_all_may_read(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add(entry(1))
        with pytest.raises(JournalError, match="another program"):
            Journal(path)
        assert len(read_journal(path)) == 1
    with Journal(path) as journal:
        assert len(journal.entries) == 1


def test_a_full_disk_leaves_no_part_of_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add(entry(1))
        before = path.read_bytes()
        write = os.write
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", lambda file, line: write(file, line[:20]))
            with pytest.raises(JournalError, match="20 of"):
                journal.add(entry(2))
        assert path.read_bytes() == before
        journal.add(entry(2))
    assert len(read_journal(path)) == 2


def test_keys_name_spec_and_code() -> None:
    spec = {"kind": "walk", "seed": 1, "gains": {"b": 2.0, "a": 1.0}}
    same = {"gains": {"a": 1.0, "b": 2.0}, "seed": 1, "kind": "walk"}
    assert trial_key(spec, VERSION) == trial_key(same, VERSION)
    assert trial_key(spec, VERSION) != trial_key(spec | {"seed": 2}, VERSION)
    assert trial_key(spec, VERSION) != trial_key(spec, VERSION | {"code": "abd"})
    assert trial_key(spec) == trial_key(spec, provenance()) == trial_key(spec, dict(provenance()))
    read, renamed, edited = (
        {"kind": "walk", "policy_params": {"path": f"{name}.json#{4 * content}"}}
        for name, content in (("a", "1234"), ("b", "1234"), ("a", "5678"))
    )
    assert trial_key(read, VERSION) == trial_key(renamed, VERSION) != trial_key(edited, VERSION)


def test_every_file_of_the_package_is_in_the_version_and_nothing_else_is(tmp_path: Path) -> None:
    package = Path(wbc.__file__).parent
    rooms = [path.name for path in package.iterdir() if path.is_dir() and path.name != "__pycache__"]
    for room in rooms:
        (tmp_path / "wbc" / room / "deep").mkdir(parents=True)
        (tmp_path / "wbc" / room / "deep" / "a.py").write_text("x = 1\n")
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside" / "model.urdf").write_text("<robot/>")
    (tmp_path / "wbc" / "linked").symlink_to(tmp_path / "beside")
    (tmp_path / "docs.md").write_text("pages change no walk")
    found = [sources(tmp_path)]
    (tmp_path / "docs.md").write_text("and no page does")
    (tmp_path / "wbc" / rooms[0] / "__pycache__").mkdir()
    (tmp_path / "wbc" / rooms[0] / "__pycache__" / "a.pyc").write_text("compiled")
    assert sources(tmp_path) == found[0]
    for room in rooms:
        (tmp_path / "wbc" / room / "deep" / "a.py").write_text("x = 2\n")
        found.append(sources(tmp_path))
    (tmp_path / "beside" / "model.urdf").write_text("<robot />")
    found.append(sources(tmp_path))
    (tmp_path / "wbc" / "new.json").touch()
    found.append(sources(tmp_path))
    (tmp_path / "wbc" / "new.json").rename(tmp_path / "wbc" / "renamed.json")
    found.append(sources(tmp_path))
    assert len(set(found)) == len(rooms) + 4
    assert {"base", "motion", "core", "sim"} <= set(rooms)


def test_every_library_that_can_change_a_result_is_in_the_version() -> None:
    found = provenance()["libraries"]
    assert {"coal", "mujoco", "pin", "scipy"} <= set(found) and found["numpy"] == np.__version__
    pages = {
        "cyclopts",
        "docstring-parser",
        "lazy-loader",
        "matplotlib",
        "meshcat",
        "pyarrow",
        "rich",
        "tornado",
    }
    pages |= {"pydantic-core", "threadpoolctl"}
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    required = {re.split(r"[^\w.-]", each)[0] for each in project["dependencies"]}
    assert required <= {*LIBRARIES} | pages and not set(found) & pages


def test_the_commit_is_a_label_and_no_part_of_the_code() -> None:
    spec = {"kind": "walk", "seed": 1}
    amended = {**provenance(), LABEL: "another"}
    assert trial_key(spec, amended) == trial_key(spec) and not differences(amended)
    other = {**provenance(), "libraries": {**provenance()["libraries"], "coal": "0.1"}}
    assert trial_key(spec, other) != trial_key(spec) and len(differences(other)) == 1


def test_a_compressed_journal_is_read_and_never_written(tmp_path: Path) -> None:
    plain, packed = tmp_path / "journal.jsonl", tmp_path / "journal.jsonl.xz"
    entries = written(plain, 200)
    packed.write_bytes(lzma.compress(plain.read_bytes()))
    for opened in (check_journal_path, Journal):
        for path in (packed, tmp_path / "new.xz"):
            with pytest.raises(InputError, match="compressed"):
                opened(path)
    assert list(read_journal(packed).values()) == entries and not (tmp_path / "new.xz").exists()


def test_an_edited_robot_file_is_another_robot(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    text = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text()
    path.write_text(text)
    spec = WalkSpec(robot=str(path))
    assert spec.robot.startswith(f"{path}#") and WalkSpec.from_json(spec.to_json()) == spec
    path.write_text(text.replace('mass="', 'mass="1', 1))
    os.utime(path, ns=(0, 0))
    edited = WalkSpec(robot=str(path))
    assert trial_key(edited.to_json()) != trial_key(spec.to_json())
    with pytest.raises(InputError, match=r"mine\.xml has changed"):
        WalkSpec.from_json(spec.to_json())
    assert WalkSpec(robot="g1").robot == "g1"


@pytest.mark.parametrize(
    "values",
    [
        {"spec": []},
        {"spec": None},
        {"spec": "walk"},
        {"status": "finished"},
        {"status": ["done"]},
        {"result": [1]},
        {"clock": 3},
        {"error": {}},
        {"version": None},
        {"version": {"libraries": ["numpy"]}},
        {"ended": 12},
    ],
)
def test_a_line_whose_values_are_of_other_kinds_is_damaged(
    values: dict[str, Any], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "journal.jsonl"
    entries = written(path, 1)
    with path.open("ab") as file:
        file.write(canonical(json.loads(entries[0].line()) | values).encode() + b"\n")
    assert list(read_journal(path).values()) == list(read_journal(path, any_code=True).values()) == entries
    assert "1 damaged lines skipped, the first is line 2" in caplog.text


@pytest.mark.parametrize(
    "result",
    [
        {"fall": "tilt"},
        {"fall": {"cause": ["left"]}},
        {"outcome": {"a": 1}, "steps_done": 3},
        {"outcome": "fell", "steps_done": "three"},
        {"outcome": "fell", "steps_done": 10**400},
        {"a.b": 1, "a": {"b": 2}, "steps_done": 1},
        {"impact": "hard", "steps_done": 1, "outcome": "fell"},
    ],
)
def test_a_table_of_results_that_mean_nothing_is_made_or_refused_in_a_line(result: dict[str, Any]) -> None:
    study = Study(name="s", cells=(Cell("a", {"plan": {"distance": 0.1}}),), arms={"x": {}}, seeds=(1,))
    entries = {
        trial_key(t.plain): Entry(t.plain, "done", result, None, None, provenance()) for t in study.trials()
    }
    with contextlib.suppress(InputError):
        study_table(study, entries).markdown()
    study_frame(study, entries).to_csv()


@pytest.mark.parametrize("kind", [WalkSpec, Study])
@pytest.mark.parametrize("data", [None, [1, 2], "walk", 3.0])
def test_a_spec_is_read_from_an_object_alone(kind: Any, data: Any) -> None:
    with pytest.raises(InputError, match="must be an object of names and values"):
        kind.from_json(data)
