"""A control of one's own, without drives, made of a function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import wbc


class OwnControl(wbc.Control):
    """Control that answers a measurement as a function does, and hands clouds to another one."""

    def __init__(
        self, command: Callable[[wbc.Measurement], Any] | None = None, see: Callable[[Any], Any] | None = None
    ) -> None:
        self._command, self._see = command, see

    def command(self, measurement: wbc.Measurement) -> wbc.Command:
        assert self._command is not None
        answer: wbc.Command = self._command(measurement)
        return answer

    def see(self, seen: Any) -> None:
        if self._see is not None:
            self._see(seen)
