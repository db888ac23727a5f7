"""The drawing process of a live view, as the run sees it: start, address, frames and end."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import selectors
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
from wbc.core.errors import Array

START_TIME = 60.0
"""Longest time for the drawing process to start, s; it takes about one."""

LAST_FRAME_TIME = 0.5
"""Longest time that `close` waits for the last frame to be read, s."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServerSetup:
    """Setup of the drawing process.

    Attributes:
        scene: The scene.
        address: Address to listen at.
        rate: Largest rate of frames, 1/s.
        speed: Multiple of real time at the start; None for as fast as possible.
        controls: Controls of the page and their values at the start; see `wbc.app.view.controls`.
        token: Secret that a page shows to be allowed to change the run, or to pause it.
        framed: Pages of this machine may show the page in a frame.
    """

    scene: Scene
    address: Address
    rate: float
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
        channel: Frames to it, user input from it.
    """

    def __init__(self, setup: ServerSetup) -> None:
        """Start the process and wait until it listens.

        Raises:
            PortError: The port is in use; nothing is left running.
            ViewError: The process does not start; nothing is left running.
        """
        self.channel = Channel(len(setup.scene.moving))
        self._process = _launch(self.channel.fd)
        try:
            served = self._begin(setup)
        except ViewError:
            _stop(self._process, self.channel)
            raise
        self.pid = self._process.pid
        self.url = f"{served.url}?token={setup.token}"
        self._local = served.local_url
        self._finalizer = weakref.finalize(self, _stop, self._process, self.channel)
        self._warned = False

    def _begin(self, setup: ServerSetup) -> ServedAddress:
        """Send the setup and return the address that the process has got."""
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        answer = b""
        with contextlib.suppress(BrokenPipeError), selectors.DefaultSelector() as selector:
            pickle.dump(setup, process.stdin)
            process.stdin.flush()
            selector.register(process.stdout, selectors.EVENT_READ)
            if selector.select(START_TIME):
                answer = process.stdout.readline()
        if not answer:
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

    def draw(self, time: float, matrices: Array, annotations: Annotations) -> None:
        """Hand over a frame; log a warning once if the process has ended."""
        self.channel.write(time, matrices, annotations.pack())
        if not self._warned and not self.running:
            self._warned = True
            _log.warning("the live view has ended (exit code %s); the run goes on", self._process.returncode)

    def html(self) -> str:
        """Return the present picture as a self-contained page; `ViewError` if the process has ended."""
        if not self.running:
            raise ViewError("the live view has ended")
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # it is this machine
        with direct.open(self._local + "scene.html", timeout=30.0) as answer:
            return str(answer.read().decode("utf-8"))

    def close(self) -> None:
        """End the process, after it has read the last frame."""
        end = clock.perf_counter() + LAST_FRAME_TIME
        channel = self.channel
        while self.running and channel.shown < channel.newest and clock.perf_counter() < end:
            clock.sleep(0.01)
        self._finalizer()


def _launch(fd: int) -> subprocess.Popen[bytes]:
    """Start the process with a channel's file descriptor and this copy of the library."""
    paths = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "wbc.app.view.server", str(fd)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=[fd],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)},
    )


def _stop(process: subprocess.Popen[bytes], channel: Channel) -> None:
    """End the process by closing its input."""
    assert process.stdin is not None and process.stdout is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.close()
    try:
        process.wait(2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
    channel.close()
