"""A landing that is moved lands there by the law itself, and leaves the balance what it needs."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbc.walking.stepping.law import Divergent, Orbit, SteppingConstants, landing_place
from wbc.walking.stepping.place import Moves
from wbc.walking.stepping.settings import in_si

HEIGHT, OMEGA, STEP, WIDTH = 0.72, math.sqrt(9.81 / 0.72), 0.45, 0.26
SCALE = SimpleNamespace(height=HEIGHT, omega=OMEGA, weight=400.0, leg=0.7, ankle=0.05, sole=(0.12, 0.05))
CONSTANTS = in_si(SteppingConstants(), SCALE)  # type: ignore[arg-type]
GRID = (0.02 * np.arange(-2, 3)[:, None] + 0.012j * np.arange(-2, 3)).ravel()

offsets = st.floats(-0.06, 0.06), st.floats(0.02, 0.1)
lefts, speeds = st.floats(0.05, 0.35), st.floats(-0.2, 0.4)


def landing(ahead: float, outwards: float, left: float, speed: float):
    """Return ξ and the orbit of a left foot that swings about a stance foot at the origin, and the growth g."""
    orbit = Orbit.of((speed, 0.0), 1.0, WIDTH, STEP, STEP, OMEGA)
    growth = math.exp(OMEGA * left)
    return Divergent(ahead, outwards, OMEGA), orbit, (growth * ahead, growth * outwards)


@given(*offsets, lefts, speeds)
def test_a_moved_landing_is_where_the_law_lands_with_its_time_and_offset(
    ahead, outwards, left, speed
) -> None:
    dcm, orbit, growth = landing(ahead, outwards, left, speed)
    moves = Moves(growth, (-1.0, 1.0), orbit, 0j, CONSTANTS)
    there = complex(*landing_place((0.0, 0.0), dcm, left, (orbit.ahead, -orbit.inwards)))
    for by in GRID[np.isfinite(moves(GRID))]:
        move = moves.at(complex(by))
        offset = orbit.ahead - move.ahead, -(orbit.inwards + move.outwards)
        moved = complex(*landing_place((0.0, 0.0), dcm, left + move.later / OMEGA, offset))
        # The growth itself grows with the time.
        assert abs(moved - there - by) <= abs(complex(*growth)) * move.later**2 + 1e-12


@given(*offsets, lefts, speeds)
def test_a_move_leaves_the_next_step_viable_and_takes_the_cheapest_time(ahead, outwards, left, speed) -> None:
    _, orbit, growth = landing(ahead, outwards, left, speed)
    moves, c = Moves(growth, (-0.1, 0.12), orbit, 0j, CONSTANTS), CONSTANTS
    costs = moves(GRID)
    assert costs[len(GRID) // 2] == 0.0 == costs.min()
    times = np.linspace(-0.1, 0.12, 221)
    for by, cost in zip(GRID, costs, strict=True):
        if by == 0.0 or not math.isfinite(cost):
            continue
        move = moves.at(complex(by))
        assert -0.1 <= move.later <= 0.12
        assert 0.75 <= (orbit.inwards + move.outwards) / orbit.inwards <= 1.5
        assert abs(move.ahead) <= c.most_ahead
        least = (c.time_cost * times**2 + c.offset_cost * np.abs(by - times * complex(*growth)) ** 2).min()
        assert cost - c.change * abs(by) - c.move == pytest.approx(least, rel=0.01, abs=1e-6)
