"""Reports: violations of a QP that has no solution against their closed form, and tables to the letter."""
# ruff: noqa: E501 - one row of a table a line

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wbc.core.qp.diagnosis import groups_not_finite, violated_groups
from wbc.core.qp.problem import Problem


def contradictory() -> Problem:
    """Return equalities and inequalities of four variables that contradict each other; the first is physics."""
    p = Problem(4, 0, 4, n_eq=5, n_soft=0, n_in=6)
    p.equality[:] = np.eye(4)[[3, 0, 1, 0, 0]]
    p.target[:] = [5.0, 1.0, 2.0, 4.0, 10.0]
    p.n_physics = 1
    p.inequality[:] = [[0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, -1], [0, 0, 0, 1], [1, 0, 0, 0], [0, 0, 0, 3]]
    p.lower[:] = [-np.inf, 3.4, -3.0, -np.inf, -1e21, 15.0]
    p.upper[:] = [1.0, 1.0, np.inf, np.inf, 1e21, 15.0]
    p.equality_groups = {
        name: slice(i, j) for name, i, j in (("physics", 0, 1), ("a", 1, 3), ("b", 3, 4), ("c", 4, 5))
    }
    p.inequality_groups = {"up": slice(0, 1), "crossed": slice(1, 2), "low": slice(2, 3), "fine": slice(3, 6)}
    return p


def test_violations_are_those_of_least_squares() -> None:
    """At x = (5, 4/5, 2.2, 5): the mean of 1, 4 and 10; from 2 towards 1/2 with a slope of two; halfway; physics."""
    p = contradictory()
    violated = violated_groups(p)
    assert list(violated) == ["c", "a", "low", "crossed", "b", "up"]
    assert list(violated.values()) == pytest.approx([5.0, 4.0, 2.0, 1.2, 1.0, 0.6], abs=1e-6)
    p.lower[1:3], p.upper[0] = (0.5, -5.0), 4.0
    for size, names in ((0.9e-4, []), (1.1e-4, ["a", "b"])):  # on both sides of the tolerance
        p.target[[3, 4]] = 1.0 + 2.0 * size, 1.0 + size
        assert sorted(violated_groups(p)) == names
    p.n_physics, p.equality[1], p.target[1] = 2, p.equality[0], 6.0
    assert violated_groups(p) == {"floating-base dynamics": math.inf}


def test_groups_and_tasks_with_numbers_that_are_not_finite_are_named() -> None:
    """Rows of hard tasks are equalities; those of a selection stand behind all rows of the QP."""
    p = Problem(2, 0, 2, n_eq=2, n_soft=2, n_in=3)
    p.equality_groups = {"physics": slice(0, 1), "hard": slice(1, 2)}
    p.inequality_groups = {"joints": slice(0, 2), "polygon": slice(2, 3)}
    tasks = [
        SimpleNamespace(name=name, hard=name == "hand", error=np.zeros(1))
        for name in ("hand", "com", "wrench")
    ]
    places = {"hand": slice(1, 2), "com": slice(2, 4), "wrench": slice(7, 8)}

    def named(array: np.ndarray, place: Any, value: float) -> list[str]:
        before, array[place] = array[place], value
        found = groups_not_finite(p, tasks, places)  # type: ignore[arg-type]
        array[place] = before
        assert all(math.isnan(number) for number in found.values())
        return list(found)

    assert groups_not_finite(p, tasks, places) == {}  # type: ignore[arg-type]
    assert named(p.rows, (0, 1), np.nan) == ["physics"]
    assert named(p.rows, (1, 0), np.inf) == named(p.target, 1, np.nan) == ["hard", "hard task 'hand'"]
    assert named(p.rows, (3, 1), -np.inf) == named(p.target, 2, np.inf) == ["task 'com'"]
    assert (
        named(p.rows, (5, 0), np.nan) == named(p.lower, 0, np.inf) == named(p.upper, 1, -np.inf) == ["joints"]
    )
    assert named(p.lower, 2, np.nan) == named(p.upper, 2, np.nan) == ["polygon"]
    assert named(tasks[2].error, 0, np.nan) == ["task 'wrench'"]
    assert not named(p.lower, 1, -np.inf) and not named(p.upper, 1, np.inf), "a limit may be without a bound"
