"""Delay line of the commands of a simulated machine."""

from __future__ import annotations

import copy
from collections import deque

from wbc.core.signals import Command


class DelayLine:
    """Commands that act some physics steps after they were given."""

    def __init__(self, steps: int) -> None:
        self._delay, self._now = steps, 0
        self._waiting: deque[tuple[int, Command]] = deque()

    def clear(self) -> None:
        """Forget all commands."""
        self._waiting.clear()

    def push(self, command: Command) -> None:
        """Put a command in before the coming physics step; a copy, as arrays of a controller may change."""
        self._waiting.append((self._now + self._delay, copy.deepcopy(command)))

    def advance(self) -> Command | None:
        """Return the newest command that is due at the coming physics step or None. Called at each step."""
        due = None
        while self._waiting and self._waiting[0][0] <= self._now:
            due = self._waiting.popleft()[1]
        self._now += 1
        return due
