"""Property tests draw the same examples in every run, unless the long profile is asked for."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from properties import examples, load_profile

TESTS = Path(__file__).resolve().parents[1]


def drawn() -> list[float]:
    """Return the numbers that a property test draws in one run."""
    numbers = []

    @examples(20)
    @given(st.floats(0.0, 1.0))
    def collect(number: float) -> None:
        numbers.append(number)

    collect()
    return numbers


@pytest.mark.skipif("HYPOTHESIS_PROFILE" in os.environ, reason="another profile is asked for")
def test_the_default_profile_draws_the_same_examples_again() -> None:
    assert settings().derandomize and settings().deadline is None
    first = drawn()
    assert len(set(first)) > 10 and drawn() == first
    assert examples(20).max_examples == 20 and examples(20).derandomize


def test_the_long_profile_is_random_and_ten_times_as_long(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as environment:
        environment.setenv("HYPOTHESIS_PROFILE", "long")
        load_profile()
        long = examples(20)
    load_profile()
    assert (long.max_examples, long.derandomize, long.deadline) == (200, False, None)


def test_no_test_has_settings_of_hypothesis_beside_the_profile() -> None:
    own = re.compile(r"from hypothesis import .*\bsettings\b|hypothesis\.settings|\bderandomize\s*=")
    here = {Path(__file__), TESTS / "support" / "properties.py"}
    found = [str(file) for file in TESTS.rglob("*.py") if file not in here and own.search(file.read_text())]
    assert not found, f"use properties.examples instead of hypothesis.settings in {found}"
