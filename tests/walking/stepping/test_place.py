"""A landing that is moved lands there by the law itself, and leaves the balance what it needs."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from point_mass import PointMass

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


class Grooves:
    """Ground at z = 0 on which a sole is restless near stripes across and along the way, as `KnownGround` tells it."""

    version = 0

    def __init__(self, mirror: bool = False) -> None:
        self._sign = -1.0 if mirror else 1.0

    def unrest(self, x, y):
        across = np.cos(2.0 * math.pi * x / 0.08) > 0.3
        along = np.cos(2.0 * math.pi * (self._sign * y - 0.013) / 0.06) > 0.3
        return 0.02 * (1.0 * across + along)

    def stand(self, side, placement) -> None:
        pass

    def support(self, side, x, y, yaw):
        return SimpleNamespace(x=x, y=y, z=0.0, slope=(0.0, 0.0))

    def best(self, side, x, y, yaw, allowed, cost):
        places = complex(x, y) + GRID * complex(math.cos(yaw), math.sin(yaw))
        ranked = np.argsort(cost(GRID) + self.unrest(places.real, places.imag), kind="stable")
        k = next(k for k in ranked if GRID[k] == 0.0 or allowed(places[k].real, places[k].imag))
        return self.support(side, places[k].real, places[k].imag, yaw)

    def highest(self, side, start, end, yaw) -> float:
        return -math.inf


def grooved(sight, push: float, velocity=(0.25, 0.0, 0.0)) -> tuple[PointMass, np.ndarray]:
    """Step out of a push to a side and walk; return the body and its landings."""
    body = PointMass()
    body.gait.ground.sight = sight
    body.run(0.7)
    body.speed += [0.0, push]
    body.run(0.1)
    body.gait.steering.command(velocity)
    ticks = body.run(12.0)
    last = [a for a, b in zip(ticks, ticks[1:], strict=False) if a.reference.step != b.reference.step]
    return body, np.array([tick.reference.landing.position for tick in last])


def test_a_walk_that_chooses_lands_quieter_and_keeps_its_velocity() -> None:
    _, blind = grooved(None, 0.6)
    body, chosen = grooved(Grooves(), 0.6)
    rest = [Grooves().unrest(places[:, 0], places[:, 1]).mean() for places in (blind, chosen)]
    assert rest[1] < 0.6 * rest[0]
    assert body.com[0] == pytest.approx(0.25 * 12.0, rel=0.1)
    apart = np.abs(np.diff(chosen[:, 1]))
    assert apart.min() > body.gait.settings.gap - 1e-6


@pytest.mark.slow
def test_a_mirrored_ground_gives_mirrored_landings() -> None:
    _, left = grooved(Grooves(), 0.6, (0.25, 0.05, 0.0))
    _, right = grooved(Grooves(mirror=True), -0.6, (0.25, -0.05, 0.0))
    np.testing.assert_allclose(right, left * (1.0, -1.0, 1.0), atol=1e-9)
