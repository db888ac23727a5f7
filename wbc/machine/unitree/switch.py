"""Unitree's motion switcher: it gives the motors to a built-in controller, or to whoever sends commands.

A request and its answer carry the same identity; a request that is not answered is sent again, since a message that is
sent before the machine has been discovered is lost.

Source of the numbers and of the JSON: unitree_sdk2_python 9b05080, `comm/motion_switcher`; topics: unitree_ros2.
"""

from __future__ import annotations

import itertools
import json
import time

from wbc.core.errors import InputError
from wbc.core.settings import Positive
from wbc.machine.unitree.dds import REQUEST_TOPIC, RESPONSE_TOPIC, DdsError, Topics, message

CHECK, SELECT, RELEASE = 1001, 1002, 1003
"""Numbers of the requests: who has the motors, give them to a controller, take them from it."""

AGAIN = 0.2
"""Time after which a request is sent again, s."""


class MotionSwitcher:
    """Client of the motion switcher.

    A machine obeys no low-level commands while its built-in controller has the motors. `release` takes them from it:
    the robot then carries nothing and must hang.
    """

    def __init__(self, interface: str = "lo", *, domain: int = 1, timeout: Positive = 5.0) -> None:
        """Join the topics.

        Args:
            interface: Network interface of the robot.
            domain: DDS domain: 0 on the machine, 1 in simulators.
            timeout: Longest wait for an answer, and for the motors to be free, s.

        Raises:
            DdsError: cyclonedds is not installed.
        """
        self._topics = Topics(domain, interface, RESPONSE_TOPIC, REQUEST_TOPIC)
        self._timeout = timeout
        self._numbers = itertools.count(time.monotonic_ns())

    def mode(self) -> str:
        """Return the name of the controller that has the motors; empty when none has.

        Raises:
            DdsError: No answer, or a refusal.
        """
        answer = self._call(CHECK, {})
        try:
            return str(json.loads(answer)["name"])
        except (ValueError, KeyError, TypeError) as error:
            raise DdsError(f"the motion switcher's answer is not understood: {answer!r}") from error

    def release(self) -> str:
        """Take the motors from the built-in controller; return its name, to give them back with `select`.

        Raises:
            DdsError: No answer, a refusal, or a controller that does not let go in time.
        """
        first = name = self.mode()
        end = time.monotonic() + self._timeout
        while name:
            if time.monotonic() > end:
                raise DdsError(f"the built-in controller '{name}' does not release the motors")
            self._call(RELEASE, {})
            name = self.mode()
        return first

    def select(self, name: str) -> None:
        """Give the motors to a built-in controller.

        Args:
            name: Its name, as `release` returned it.

        Raises:
            InputError: An empty name.
            DdsError: No answer, or a refusal.
        """
        if not name:
            raise InputError("name of a built-in controller must not be empty")
        self._call(SELECT, {"name": name})

    def _call(self, request: int, parameter: dict[str, str]) -> str:
        """Return the data of an answer."""
        topics, number = self._topics, next(self._numbers)
        asked = message(REQUEST_TOPIC, ((number, request), (0,), (0, False)), json.dumps(parameter), [])
        end = time.monotonic() + self._timeout
        while (now := time.monotonic()) < end:
            topics.send(asked)
            again = min(now + AGAIN, end)
            while (left := again - time.monotonic()) > 0.0:
                for answer in topics.take(left):
                    header = getattr(answer, "header", None)
                    if header is None or header.identity.id != number:
                        continue
                    if header.status.code != 0:
                        raise DdsError(
                            f"the motion switcher refused request {request}: code {header.status.code}"
                        )
                    return str(answer.data)
        raise DdsError(f"no answer from a motion switcher within {self._timeout:g} s: interface and domain?")
