"""Input of the people who watch a run: pause, speed and requests of all pages together.

Messages come from a network: what is not exactly as declared here is dropped, in the drawing process and in the run.
"""

from __future__ import annotations

import json
from typing import Annotated

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

MAX_MESSAGE = 1 << 12
"""Largest message of a page, bytes."""

MAX_BYTES = 1 << 12
"""Largest packed input, bytes."""

MAX_REQUESTS = 16
"""Largest number of requests that wait at a time; older ones are dropped."""

Speed = Annotated[float, Field(ge=1e-3, le=1e3)] | None
"""Multiple of real time; None for as fast as possible."""

Text = Annotated[str, Field(max_length=100)]

Request = Annotated[dict[Text, Text | float], Field(max_length=8)]
"""Request to change a run: {"do": name, …}; `wbc.app.view.controls` checks the rest."""

_STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class PageMessage(TypedDict, total=False):
    """Message of a page."""

    __pydantic_config__ = _STRICT  # type: ignore[misc]

    paused: bool
    speed: Speed
    order: Request


class RunInput(TypedDict):
    """Input of all pages, as the run takes it; requests with consecutive numbers."""

    __pydantic_config__ = _STRICT  # type: ignore[misc]

    paused: bool
    speed: Speed
    orders: list[tuple[int, Request]]


_MESSAGE, _INPUT = TypeAdapter(PageMessage), TypeAdapter(RunInput)


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
        self.requests: list[tuple[int, Request]] = []
        self._count = 0

    def take(self, message: str | bytes) -> None:
        """Take over a page's message; malformed ones are dropped.

        Args:
            message: JSON of a `PageMessage`.
        """
        try:
            said = _MESSAGE.validate_json(message) if len(message) <= MAX_MESSAGE else {}
        except ValidationError:
            return
        self.paused = said.get("paused", self.paused)
        self.speed = said.get("speed", self.speed)
        if "order" in said:
            self._count += 1
            self.requests = [*self.requests, (self._count, said["order"])][-MAX_REQUESTS:]

    def pack(self) -> bytes:
        """Return the input as JSON, without the oldest requests if it is too long."""
        while True:
            data = {"paused": self.paused, "speed": self.speed, "orders": self.requests}
            text = json.dumps(data).encode()
            if len(text) < MAX_BYTES or not self.requests:
                return text
            self.requests = self.requests[1:]


def unpack(text: bytes) -> RunInput | None:
    """Return an input that was packed; None if it is malformed."""
    try:
        return _INPUT.validate_json(text)
    except ValidationError:
        return None
