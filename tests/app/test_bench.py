"""`wbc bench tick`: the task that other libraries are compared with."""

from __future__ import annotations

import pytest
from properties import by_default

from wbc.app.bench import BenchTickOptions, bench_tick
from wbc.robots import names


@pytest.mark.parametrize("robot", by_default(names(), "talos"))
def test_ticks_are_solved_and_follow_the_sway(robot: str) -> None:
    # The soles of the comparison are wider than the small robots' own; the ticks stay what they are.
    result = bench_tick(BenchTickOptions(robot=robot, ticks=200, warm_up=1000))
    assert result["failures"] == 0 and sum(result["solvers"].values()) == result["ticks"] == 200
    assert result["com_error_mm"] < 1.0 and 0.0 < result["torque_use"] < 1.0
    assert result["p99_us"] >= result["median_us"]
    assert 0.5 < result["median_us"] / sum(result["parts"].values()) < 5.0, (
        "the parts are those of a tick, µs"
    )
    assert set(result["parts"]) == {"model", "assembly", "solve", "decode"}
