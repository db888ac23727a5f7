"""Replay of a log in the browser, with a time slider: a page of viser."""

from __future__ import annotations

import math
import time as clock

import numpy as np

from wbc.app.replay.replay import Replay
from wbc.app.view.base import Port, free_port
from wbc.app.view.viser_page import SPEEDS, ViserPage, ViserPanel
from wbc.base.checked import checked

RATE = 30.0
"""Largest rate of pictures, 1/s."""


class Player:
    """Page of a replay: a slider of the time, play and pause, and the speed.

    Attributes:
        url: Address of the page.
    """

    @checked
    def __init__(self, replay: Replay, port: Port | None = None) -> None:
        """Start serving the page on this machine.

        Args:
            replay: The replay.
            port: Port of the page; when None, the first free port from 7000 on.

        Raises:
            PortError: The port is in use.
            ViewError: The package viser is not installed.
        """
        self._replay, self._times = replay, replay.log.time
        self._page = ViserPage(free_port(port), replay.title)
        self._panel = ViserPanel(self._page, replay.stage)
        self.url, gui = self._page.url, self._panel.gui
        self._tick, first = -1, math.floor(100.0 * self._times[0]) / 100.0
        last = math.ceil(100.0 * self._times[-1]) / 100.0  # no earlier than the last tick
        self._time = gui.add_slider("time (s)", first, last, 0.01, first)
        self._playing = gui.add_checkbox("play", True)
        self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1")
        playing = self._playing
        self._panel.key("space", "play or pause", lambda: setattr(playing, "value", not playing.value))
        self.show(0)

    def show(self, tick: int) -> None:
        """Show a tick of the log, unless it is shown already."""
        if tick != self._tick:
            self._panel.draw(self._replay.picture(tick))
            self._tick = tick
            self._panel.speak(now=True)

    def run(self) -> None:
        """Play until the program is interrupted; pressing play at the end starts again."""
        last = clock.perf_counter()
        while True:
            clock.sleep(1.0 / RATE)
            now = clock.perf_counter()
            if self._playing.value and self._page.open_pages:
                ahead = self._time.value + (now - last) * SPEEDS[self._speed.value]
                if self._time.value >= self._time.max:
                    ahead = self._time.min
                elif ahead >= self._time.max:
                    ahead, self._playing.value = self._time.max, False
                self._time.value = ahead
            last = now
            self.show(min(int(np.searchsorted(self._times, self._time.value - 1e-6)), len(self._times) - 1))

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="480"></iframe>'

    def close(self) -> None:
        """End the page."""
        self._page.close()
