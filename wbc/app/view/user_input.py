"""Input of the people who watch a run: pause, speed and requests of all pages together."""

from __future__ import annotations

import json
from typing import Any

MAX_BYTES = 1 << 12
"""Largest packed input, bytes."""

MAX_REQUESTS = 16
"""Largest number of requests that wait at a time; older ones are dropped."""


class UserInput:
    """The latest pause and speed, and the last requests with consecutive numbers.

    Attributes:
        paused: The run waits.
        speed: Multiple of real time; None for as fast as possible.
        requests: The last requests, each with its number.
    """

    def __init__(self, speed: float | None) -> None:
        """Start without pause and requests.

        Args:
            speed: Speed at the start.
        """
        self.paused = False
        self.speed = speed
        self.requests: list[tuple[int, Any]] = []
        self._count = 0

    def take(self, message: Any) -> None:
        """Take over a page's message; malformed ones are dropped."""
        if not isinstance(message, dict):
            return
        if isinstance(message.get("paused"), bool):
            self.paused = message["paused"]
        if "speed" in message:
            speed = message["speed"]
            number = isinstance(speed, (int, float)) and not isinstance(speed, bool)
            if speed is None or (number and 1e-3 <= speed <= 1e3):
                self.speed = None if speed is None else float(speed)
        if isinstance(message.get("order"), dict):
            self._count += 1
            self.requests = [*self.requests, (self._count, message["order"])][-MAX_REQUESTS:]

    def pack(self) -> bytes:
        """Return the input as JSON, without the oldest requests if it is too long."""
        while True:
            data = {"paused": self.paused, "speed": self.speed, "orders": self.requests}
            text = json.dumps(data).encode()
            if len(text) < MAX_BYTES or not self.requests:
                return text
            self.requests = self.requests[1:]
