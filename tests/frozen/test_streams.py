"""Command streams are those of the stored file: a change of the house changes no number of a walk."""

from __future__ import annotations

import json

import numpy as np
import pytest
import streams

STORED = json.loads(streams.FILE.read_text())
LOOSE = {"carry": 1e-2, "foot pressed": 1e-6}
"""Runs that begin with a search for a posture or with an impact, in which another rounding grows: tolerance there."""

QUICK = ("stand hrp4_class", "walk hrp4_class stones", "walk g1 stepping", "foot pressed")


def _cases() -> list[object]:
    return [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in streams.runs()]


@pytest.mark.parametrize("name", _cases())
def test_commands_are_those_of_the_stored_stream(name: str) -> None:
    stored, found = STORED["streams"][name], streams.run(name)
    tolerance = LOOSE.get(name, 1e-9)
    for tick, values in stored["sample"].items():
        np.testing.assert_allclose(
            found["sample"][tick], values, rtol=tolerance, atol=tolerance, err_msg=f"tick {tick}"
        )
    if streams.processor() == STORED["processor"]:
        assert found["hashes"] == stored["hashes"]
        assert found["commands"] == stored["commands"]


def test_every_run_is_stored() -> None:
    assert set(STORED["streams"]) == set(streams.runs())
