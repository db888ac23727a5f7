"""Where the time of a walk goes: the parts make up the whole. The times themselves are no test."""

from __future__ import annotations

import mujoco
import pytest

from wbc.app.bench.walk import CASES, PARTS, WalkCostOptions, walk_costs


def test_parts_make_up_the_period_of_a_walk_that_is_otherwise_the_same() -> None:
    costs = list(walk_costs(WalkCostOptions(distance=0.15, repeats=1)))
    assert [cost.name for cost in costs] == list(CASES)
    for cost in costs:
        assert cost.steps_done == cost.steps_planned == 3
        assert tuple(cost.parts_us) == PARTS and min(cost.parts_us.values()) > 0.0
        assert sum(cost.parts_us.values()) == pytest.approx(cost.period_us)
        assert cost.real_time_factor == pytest.approx(1e6 * cost.control_period / cost.period_us)
        assert cost.parts_us["physics"] > cost.parts_us["sensors"]
        assert 0.0 < cost.collision_share < cost.constraint_share < 1.0
    assert mujoco.get_mjcb_time() is None
