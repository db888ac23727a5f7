"""Parts of viser's panel that give orders to a run, and those that follow it: texts, plots, gizmos."""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array

if TYPE_CHECKING:
    import viser

Order = Callable[[dict[str, Any]], None]
"""Function that queues an order, see `wbc.app.view.controls`."""

PLOT_TIME, PLOT_PERIOD, TEXT_PERIOD = 10.0, 0.1, 0.2
"""Length of a plot, period of its points and of texts, s."""

PLOT_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


class Widgets:
    """Parts of a page's panel; what follows the run is brought up to date by `show`.

    Attributes:
        live: Functions that are called with each picture, at most every `PLOT_PERIOD`, with its time (s).
    """

    def __init__(self, server: viser.ViserServer, order: Order) -> None:
        self.server, self._order = server, order
        self.live: list[Callable[[float], None]] = []
        self._texts: list[tuple[Any, Callable[[], str]]] = []
        self._plotted = self._spoken = -math.inf

    def show(self, time: float) -> bool:
        """Bring everything up to date at the time of the run (s); True when texts were, too."""
        now = clock.perf_counter()
        if now >= self._plotted + PLOT_PERIOD:
            self._plotted = now
            for show in [*self.live]:
                show(time)
        if now < self._spoken + TEXT_PERIOD:
            return False
        self.speak()
        return True

    def speak(self) -> None:
        """Bring all texts up to date."""
        self._spoken = clock.perf_counter()
        for place, text in self._texts:
            if place.content != (new := text()):
                place.content = new

    def text(self, text: Callable[[], str], *, html: bool = False) -> None:
        """Add a text that follows the run, in Markdown or HTML."""
        gui = self.server.gui
        self._texts.append((gui.add_html("") if html else gui.add_markdown(""), text))

    def button(self, label: str, order: Callable[[], dict[str, Any]], hint: str = "") -> None:
        """Add a button that gives an order."""
        button = self.server.gui.add_button(label, hint=hint or None)
        when(button.on_click, lambda _: self._order(order()))

    def checkbox(self, label: str, value: bool, call: Callable[[bool], object]) -> None:
        """Add a checkbox."""
        box = self.server.gui.add_checkbox(label, value)
        when(box.on_update, lambda _: call(bool(box.value)))

    def slider(
        self,
        label: str,
        low: float,
        high: float,
        value: float,
        hint: str,
        order: dict[str, Any],
        key: str = "value",
        taken: Callable[[float], float] = float,
    ) -> None:
        """Add a slider whose value, as `taken`, is the `key` of an order; its steps are round numbers."""
        step, shown = round_slider(low, high, value)
        slider = self.server.gui.add_slider(label, low, high, step, shown, hint=hint or None)
        when(slider.on_update, lambda _: self._order(order | {key: taken(slider.value)}))

    def plot(self, asked: Callable[[], bool], curves: dict[str, Callable[[], Any]]) -> None:
        """Add plots under each other, which are there while they are asked for."""
        gui, handles = self.server.gui, list[Any]()
        place = gui.add_folder(None)
        kept: deque[list[Array]] = deque(maxlen=round(PLOT_TIME / PLOT_PERIOD))

        def show(time: float) -> None:
            if not asked():
                for handle in handles:
                    handle.remove()
                handles.clear()
                kept.clear()
                return
            kept.append(
                [np.array([round(time, 3)]), *(np.atleast_1d(function()) for function in curves.values())]
            )
            if len(kept) < 2:  # a line needs two points
                return
            data = [np.array([row[i] for row in kept], dtype=float).T for i in range(len(curves) + 1)]
            for i, title in enumerate(curves):
                columns = (data[0][0], *_without_noise(data[i + 1]))
                if i < len(handles):
                    handles[i].data = columns
                else:
                    with place:
                        handles.append(_uplot(gui, title, columns))

        self.live.append(show)

    def gizmo(
        self,
        name: str,
        size: float,
        place: Callable[[], pin.SE3],
        order: Callable[[pin.SE3], dict[str, Any]],
        asked: Callable[[], bool],
        *,
        turns: bool = True,
        moves: bool = True,
    ) -> None:
        """Show a gizmo of a size (m) at a place while it is asked for; moving it gives an order."""
        handles: list[Any] = []
        held = False

        def show(_: float) -> None:
            if not asked():
                for handle in handles:
                    handle.remove()
                handles.clear()
                return
            if not handles:
                handle = self.server.scene.add_transform_controls(
                    f"/wbc/gizmos/{name.replace('/', '_')}",
                    scale=size,
                    disable_axes=not moves,
                    disable_sliders=not moves,
                    disable_rotations=not turns,
                    depth_test=False,
                )
                when(handle.on_update, moved)
                handles.append(handle)
            if not held:
                now = place()
                x, y, z, w = pin.Quaternion(now.rotation).coeffs().tolist()
                handles[0].position, handles[0].wxyz = now.translation, (w, x, y, z)

        def moved(event: Any) -> None:
            nonlocal held
            held = event.phase != "end"
            w, x, y, z = map(float, event.target.wxyz)
            turn = pin.Quaternion(w, x, y, z).normalized().matrix()
            self._order(order(pin.SE3(turn, np.array(event.target.position, dtype=float))))

        self.live.append(show)


def when(event: Callable[[Any], object], call: Callable[[Any], object]) -> None:
    """Call a function at an event of the page, one after the other in the order of the events."""

    async def take(given: Any) -> None:
        call(given)

    event(take)


def round_slider(low: float, high: float, value: float) -> tuple[float, float]:
    """Return step of a slider, a power of ten, and a value rounded to it, within the slider's ends."""
    digits = -math.floor(math.log10((high - low) / 200.0))
    return 10.0**-digits, min(max(round(value, digits) + 0.0, low), high)


def round_up(value: float) -> float:
    """Return the next number that is not below and has one digit alone, such as 0.3, 8 or 200."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(f"{math.ceil(round(value / power, 9)) * power:.0e}")


def _uplot(gui: Any, title: str, columns: tuple[Array, ...]) -> Any:
    """Return a plot of curves over the time, the first column (s)."""
    from viser import uplot  # noqa: PLC0415 - an extra

    series = [uplot.Series(label="s")] + [
        uplot.Series(label=str(k), stroke=PLOT_COLOURS[k % len(PLOT_COLOURS)], width=1.5)
        for k in range(len(columns) - 1)
    ]
    scales = {"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)}
    return gui.add_uplot(
        columns, tuple(series), title=title, scales=scales, legend=uplot.Legend(show=False), height=150
    )


def _without_noise(values: Array) -> Array:
    """Return values to seven digits of the largest, and to 1e-9: uPlot cannot draw an axis with finer ticks."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    return values if largest == 0.0 else np.round(np.round(values / largest, 7) * largest, 9)
