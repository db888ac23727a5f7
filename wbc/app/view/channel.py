"""Channel between a run and its drawing process: messages over a socket, of which the newest counts."""

from __future__ import annotations

import contextlib
import socket
from multiprocessing.connection import Connection

TAKEN = b""
"""Answer to a message."""


class Channel:
    """One end of a channel.

    Nobody waits: a message goes out when the other end has taken the one before, and of those that are written
    meanwhile only the newest does.
    """

    def __init__(self, fd: int) -> None:
        """Take over the file descriptor of a connected socket."""
        self._connection = Connection(fd)
        self._waiting: bytes | None = None
        self._taken = True  # the last message that went out

    @staticmethod
    def pair() -> tuple[Channel, Channel]:
        """Return two ends of a new channel."""
        one, other = socket.socketpair()
        return Channel(one.detach()), Channel(other.detach())

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._connection.fileno()

    @property
    def idle(self) -> bool:
        """True if the other end has taken all messages."""
        return self._taken and self._waiting is None

    def write(self, message: bytes) -> None:
        """Write a message, which is not empty, in place of one that has not gone out."""
        self._waiting = message
        self._send()

    def _send(self) -> None:
        if self._taken and self._waiting is not None:
            message, self._waiting, self._taken = self._waiting, None, False
            with contextlib.suppress(OSError):  # the other end is gone, which reading says
                self._connection.send_bytes(message)

    def read(self, wait: float = 0.0) -> bytes | None:
        """Return the next message, None without one after a time, s; `EOFError` if the other end is gone."""
        try:
            while self._connection.poll(wait):
                message = self._connection.recv_bytes()
                if message != TAKEN:
                    with contextlib.suppress(OSError):  # the last words of an end that is gone
                        self._connection.send_bytes(TAKEN)
                    return message
                self._taken = True
                self._send()
        except OSError as error:
            raise EOFError from error
        return None

    def close(self) -> None:
        """Close this end."""
        self._connection.close()
