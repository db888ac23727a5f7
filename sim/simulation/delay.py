"""Delay line of the orders to the drives of a simulated machine."""

from __future__ import annotations

import copy
from collections import deque
from typing import Any


class DelayLine:
    """Orders that act some physics steps after they were given."""

    def __init__(self, steps: int) -> None:
        self._delay, self._now = steps, 0
        self._waiting: deque[tuple[int, Any]] = deque()

    def clear(self) -> None:
        """Forget all orders."""
        self._waiting.clear()

    def push(self, order: Any) -> None:
        """Put an order in before the coming physics step; a copy, as arrays of a controller may change."""
        self._waiting.append((self._now + self._delay, copy.deepcopy(order)))

    def advance(self) -> Any:
        """Return the newest order that is due at the coming physics step or None. Called at each step."""
        due = None
        while self._waiting and self._waiting[0][0] <= self._now:
            due = self._waiting.popleft()[1]
        self._now += 1
        return due
