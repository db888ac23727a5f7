"""The drawing process of a live view, as the run sees it: start, address, frames and end."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import subprocess
import sys
import time as clock
import urllib.request
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wbc.app.address import Address, PortError, ServedAddress, ViewError
from wbc.app.scene.layer import Annotations
from wbc.app.scene.scene import Scene
from wbc.app.view.channel import Channel
from wbc.app.view.user_input import RunInput, unpack
from wbc.core.errors import Array

START_TIME = 60.0
"""Longest time for the drawing process to start, s; it takes about one."""

LAST_FRAME_TIME = 0.5
"""Longest time that `close` and `html` wait for the last frame to be taken, s."""

MAX_ANNOTATIONS = 1 << 15
"""Largest packed annotations of a frame, bytes; larger ones are dropped."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServerSetup:
    """Setup of the drawing process.

    Attributes:
        scene: The scene.
        address: Address to listen at.
        speed: Multiple of real time at the start; None for as fast as possible.
        controls: Controls of the page and their values at the start; see `wbc.app.view.controls`.
        token: Secret that a page shows to be allowed to change the run, or to pause it.
        framed: Pages of this machine may show the page in a frame.
    """

    scene: Scene
    address: Address
    speed: float | None
    controls: dict[str, Any]
    token: str
    framed: bool = False


class DrawingProcess:
    """A process that serves the page and draws frames.

    It is a process and not a thread because drawing costs milliseconds of Python a frame, which in a thread would stop
    the control loop.

    Attributes:
        url: Link to the page, with the token that allows to change the run.
        pid: Identifier of the process.
        frames: Number of frames so far.
    """

    def __init__(self, setup: ServerSetup) -> None:
        """Start the process and wait until it listens.

        Raises:
            PortError: The port is in use; nothing is left running.
            ViewError: The process does not start; nothing is left running.
        """
        self._channel, other = Channel.pair()
        self._process = _launch(other)
        try:
            served = self._begin(setup)
        except ViewError:
            _stop(self._process, self._channel)
            raise
        self.pid = self._process.pid
        self.url = f"{served.url}?token={setup.token}"
        self._local = served.local_url
        self._finalizer = weakref.finalize(self, _stop, self._process, self._channel)
        self.frames, self._warned = 0, False
        self._input: RunInput | None = None

    def _begin(self, setup: ServerSetup) -> ServedAddress:
        """Send the setup and return the address that the process has got."""
        answer = None
        self._channel.write(pickle.dumps(setup))
        with contextlib.suppress(EOFError):
            answer = self._channel.read(START_TIME)
        if answer is None:
            raise ViewError("the live view cannot be served: its process ended at once or does not answer")
        facts = json.loads(answer)
        if "error" in facts:
            raise PortError.at("live view", setup.address, facts["error"])
        return ServedAddress(**facts)

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return not self._finalizer.alive

    @property
    def running(self) -> bool:
        """True as long as the process runs."""
        return not self.closed and self._process.poll() is None

    @property
    def input(self) -> RunInput | None:
        """The newest input of the pages; None before there is any."""
        with contextlib.suppress(EOFError):
            if not self.closed and (text := self._channel.read()) is not None:
                self._input = unpack(text) or self._input
        return self._input

    def draw(self, time: float, matrices: Array, annotations: Annotations) -> None:
        """Hand over a frame; log a warning once if the process has ended."""
        note = annotations.pack()
        columns = matrices.transpose(0, 2, 1).reshape(-1, 16)  # as the viewer takes them
        frame = time, columns, note if len(note) <= MAX_ANNOTATIONS else b"{}"
        self._channel.write(pickle.dumps(frame))
        self.frames += 1
        if not self._warned and not self.running:
            self._warned = True
            _log.warning("the live view has ended (exit code %s); the run goes on", self._process.returncode)

    def flush(self, seconds: float = LAST_FRAME_TIME) -> None:
        """Wait until the process has taken the last frame, for some seconds at most."""
        end = clock.perf_counter() + seconds
        while self.running and not self._channel.idle and clock.perf_counter() < end:
            _ = self.input
            clock.sleep(0.001)

    def html(self) -> str:
        """Return the present picture as a self-contained page; `ViewError` if the process has ended."""
        if not self.running:
            raise ViewError("the live view has ended")
        self.flush()
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # it is this machine
        with direct.open(self._local + "scene.html", timeout=30.0) as answer:
            return str(answer.read().decode("utf-8"))

    def close(self) -> None:
        """End the process, after it has taken the last frame."""
        self.flush()
        self._finalizer()


def _launch(channel: Channel) -> subprocess.Popen[bytes]:
    """Start the process with its end of a channel and this copy of the library."""
    paths = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "wbc.app.view.server", str(channel.fileno())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        pass_fds=[channel.fileno()],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)},
    )
    channel.close()
    return process


def _stop(process: subprocess.Popen[bytes], channel: Channel) -> None:
    """End the process by closing its channel."""
    channel.close()
    try:
        process.wait(2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
