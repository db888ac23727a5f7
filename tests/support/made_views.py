"""A clock that goes on while somebody sleeps, and the robot of pages."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest


class Clock:
    """A clock that goes on while somebody sleeps."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *modules: Any, start: float = 100.0) -> None:
        self.now, self.slept = start, list[float]()
        names = {"perf_counter": lambda: self.now, "monotonic": lambda: self.now, "sleep": self.sleep}
        for module in modules:
            monkeypatch.setattr(module, "clock", SimpleNamespace(**names))

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.slept.append(seconds)
