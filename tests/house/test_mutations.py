"""The table of mutations fits the code that it mutates."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[1] / "mutations.py"


@pytest.fixture(scope="module")
def mutations() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutations", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutations"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_every_mutation_occurs_exactly_once_in_its_file(mutations: ModuleType) -> None:
    table = list(mutations.read_table())
    assert not mutations.faults(table)
    assert len(set(table)) == len(table) >= 100
    assert {mutation.room for mutation in table} == {"core", "walking", "motion", "tasks", "feet", "sim"}


def test_a_mutation_that_no_longer_fits_is_named(mutations: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "code.py").write_text("a = 1 + 2 + 3\nb = 4\n")
    make = [
        mutations.Mutation("code.py", old, new, "")
        for old, new in (("b = 4", "b = 5"), (" + ", " - "), ("c", "d"))
    ]
    assert mutations.faults(make, tmp_path) == [
        "code.py:  +  =>  - : occurs 2 times",
        "code.py: c => d: occurs 0 times",
    ]


def test_results_are_read_back_and_counted(mutations: ModuleType, tmp_path: Path) -> None:
    table = list(mutations.read_table())[:3]
    lines = [
        mutations.json.dumps(mutations.dataclasses.asdict(mutation) | {"result": result, "seconds": 1.0})
        for mutation, result in zip(table, ("noticed", "survived"), strict=False)
    ]
    path = tmp_path / "results.jsonl"
    path.write_text("\n".join(lines))
    known = mutations.results(path)
    assert list(known.values()) == ["noticed", "survived"]
    text = mutations.summary(table, known)
    assert f"survived  {table[1]}" in text and text.endswith("1 of 2 noticed, 50.0 %; 1 not run")
