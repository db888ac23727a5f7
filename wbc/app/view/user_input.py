"""Input of the people who watch a run: pause, speed and requests of all pages together.

Messages come from a network: what is not exactly as declared here is dropped, in the drawing process and in the run.
"""

from __future__ import annotations

import json
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from wbc.core.settings import CONFIG

MAX_MESSAGE = 1 << 12
"""Largest message of a page, bytes."""

MAX_REQUESTS = 16
"""Largest number of requests that wait at a time; older ones are dropped."""

Speed = Annotated[float, Field(ge=1e-3, le=1e3)] | None
"""Multiple of real time; None for as fast as possible."""

Text = Annotated[str, Field(max_length=100)]

Request = Annotated[dict[Text, Text | float], Field(max_length=8)]
"""Request to change a run: {"do": name, …}; `wbc.app.view.controls` checks the rest."""


class PageMessage(BaseModel):
    """Message of a page; what it leaves out stays as it is."""

    model_config = CONFIG

    paused: bool = False
    speed: Speed = None
    order: Request | None = None


class RunInput(BaseModel):
    """Input of all pages, as the run takes it: orders with consecutive numbers, and how many pages may change it."""

    model_config = CONFIG

    paused: bool
    speed: Speed
    orders: list[tuple[int, Request]]
    pages: int
    drivers: int


class UserInput:
    """The latest pause and speed, and the last requests with consecutive numbers.

    Attributes:
        paused: The run waits.
        speed: Multiple of real time; None for as fast as possible.
        requests: The last requests, each with its number.
    """

    def __init__(self, speed: float | None) -> None:
        """Start without pause and requests, at a speed."""
        self.paused = False
        self.speed = speed
        self.requests: list[tuple[int, Request]] = []
        self._count = 0

    def take(self, message: str | bytes) -> Request | None:
        """Take over a page's message, and return its order if it has one; no JSON of a `PageMessage` is dropped."""
        if len(message) > MAX_MESSAGE:
            return None
        try:
            said = PageMessage.model_validate_json(message)
        except ValidationError:
            return None
        if "paused" in said.model_fields_set:
            self.paused = said.paused
        if "speed" in said.model_fields_set:
            self.speed = said.speed
        if said.order is not None:
            self._count += 1
            self.requests = [*self.requests, (self._count, said.order)][-MAX_REQUESTS:]
        return said.order

    def pack(self, pages: int = 0, drivers: int = 0) -> bytes:
        """Return the input as JSON, with the numbers of open pages and of those that may change the run."""
        data = {"paused": self.paused, "speed": self.speed, "orders": self.requests}
        return json.dumps(data | {"pages": pages, "drivers": drivers}).encode()


def unpack(text: bytes) -> RunInput | None:
    """Return an input that was packed; None if it is malformed."""
    try:
        return RunInput.model_validate_json(text)
    except ValidationError:
        return None
