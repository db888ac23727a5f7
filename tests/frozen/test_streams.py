"""Command streams are those of the stored file: a change of the house changes no number of a walk."""

from __future__ import annotations

import json

import numpy as np
import pytest
import streams

STORED = json.loads(streams.FILE.read_text())
LOOSE = {"carry": 1e-2, "foot pressed": 1e-6}
"""Runs that begin with a search for a posture or with an impact, in which another rounding grows: tolerance there."""

BEGINNINGS = {"stand hrp4_class": 2, "walk hrp4_class stones": 4, "walk g1 stepping": 5}
"""Runs that are walked in every test run, and how many blocks of them: a stand, or two steps."""


@pytest.mark.slow
@pytest.mark.parametrize("name", streams.runs())
def test_commands_are_those_of_the_stored_stream(name: str) -> None:
    stored, found = STORED["streams"][name], streams.run(name)
    tolerance = LOOSE.get(name, 1e-9)
    check_sample(found["sample"], stored["sample"], tolerance)
    if streams.processor() == STORED["processor"]:
        assert found["hashes"] == stored["hashes"]
        assert found["commands"] == stored["commands"]


@pytest.mark.parametrize("name", BEGINNINGS)
def test_first_steps_are_those_of_the_stored_stream(name: str) -> None:
    blocks, stored = BEGINNINGS[name], STORED["streams"][name]
    found = streams.run(name, blocks * streams.BLOCK)
    check_sample(found["sample"], stored["sample"], 1e-9)
    if streams.processor() == STORED["processor"]:
        assert found["hashes"] == stored["hashes"][:blocks]


def check_sample(found: dict[str, list[float]], stored: dict[str, list[float]], tolerance: float) -> None:
    assert found
    for tick, values in found.items():  # of a beginning, fewer than are stored
        np.testing.assert_allclose(
            values, stored[tick], rtol=tolerance, atol=tolerance, err_msg=f"tick {tick}"
        )


def test_every_run_is_stored() -> None:
    assert set(STORED["streams"]) == set(streams.runs())
