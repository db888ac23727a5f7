"""Reports: violations of a QP that has no solution against their closed form, and tables to the letter."""
# ruff: noqa: E501 - one row of a table a line

from __future__ import annotations

import math

import numpy as np
import pytest

from wbc.core.qp.diagnosis import violated_groups
from wbc.core.qp.solving.problem import Problem


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
