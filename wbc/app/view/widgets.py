"""Parts of viser's panel that give orders to a run, and those that follow it: texts and gizmos."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    import viser

    from wbc.app.view.controls import Setting

Order = Callable[[dict[str, Any]], None]
"""Function that queues an order, see `wbc.app.view.controls`."""

TEXT_PERIOD = 0.2
"""Period of texts, s."""


class Widgets:
    """Parts of a page's panel; what follows the run is brought up to date by `show`.

    Attributes:
        gizmos: Gizmos that follow the run.
    """

    def __init__(self, server: viser.ViserServer, order: Order) -> None:
        self.server, self._order = server, order
        self.gizmos: list[Gizmo] = []
        self._texts: list[tuple[Any, Callable[[], str]]] = []
        self._spoken = -math.inf

    def show(self) -> bool:
        """Bring gizmos, and texts that are older than `TEXT_PERIOD`, up to date; True when texts were."""
        for gizmo in self.gizmos:
            gizmo.follow()
        due = clock.perf_counter() >= self._spoken + TEXT_PERIOD
        if due:
            self.speak()
        return due

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

    def slider(self, setting: Setting) -> None:
        """Add a slider that orders a setting; its steps are round numbers."""
        label = setting.name.rpartition("/")[2] + (f" ({setting.unit})" if setting.unit else "")
        low, high, value = setting.low, setting.high, min(max(setting.value, setting.low), setting.high)
        if setting.by_power:
            label, (low, high, value) = f"{label}, power of ten", map(math.log10, (low, high, value))
        step, shown = round_slider(low, high, value)
        slider = self.server.gui.add_slider(label, low, high, step, shown, hint=setting.about or None)

        def moved(_: object) -> None:
            given = 10.0**slider.value if setting.by_power else float(slider.value)
            self._order({"do": "set", "name": setting.name, "value": given})

        when(slider.on_update, moved)

    def gizmo(
        self,
        name: str,
        size: float,
        place: Callable[[], pin.SE3],
        order: Callable[[pin.SE3], dict[str, Any]],
        *,
        turns: bool = True,
        moves: bool = True,
    ) -> Gizmo:
        """Return a gizmo of a size (m) at a place, hidden until it is asked for; moving it gives an order."""
        handle = self.server.scene.add_transform_controls(
            f"/wbc/gizmos/{name.replace('/', '_')}",
            scale=size,
            disable_axes=not moves,
            disable_sliders=not moves,
            disable_rotations=not turns,
            depth_test=False,
            visible=False,
        )
        gizmo = Gizmo(handle, place, lambda there: self._order(order(there)))
        self.gizmos.append(gizmo)
        return gizmo


class Gizmo:
    """A gizmo that follows a place, and gives orders where it is moved."""

    def __init__(self, handle: Any, place: Callable[[], pin.SE3], moved: Callable[[pin.SE3], None]) -> None:
        self._handle, self._place, self._moved, self._held = handle, place, moved, False
        when(handle.on_update, self._take)

    def ask(self, shown: bool) -> None:
        """Show it or hide it."""
        self._handle.visible = shown
        self.follow()

    def follow(self) -> None:
        """Move it to its place, unless somebody holds it."""
        if self._handle.visible and not self._held:
            now = self._place()
            x, y, z, w = pin.Quaternion(now.rotation).coeffs().tolist()
            self._handle.position, self._handle.wxyz = now.translation, (w, x, y, z)

    def remove(self) -> None:
        """Take it away."""
        self._handle.remove()

    def _take(self, event: Any) -> None:
        self._held = event.phase != "end"
        w, x, y, z = map(float, event.target.wxyz)
        turn = pin.Quaternion(w, x, y, z).normalized().matrix()
        self._moved(pin.SE3(turn, np.array(event.target.position, dtype=float)))


def when(event: Callable[[Any], object], call: Callable[[Any], object]) -> None:
    """Call a function at an event of the page, one after the other in the order of the events."""

    async def take(given: Any) -> None:
        call(given)

    event(take)


def round_slider(low: float, high: float, value: float) -> tuple[float, float]:
    """Return step of a slider, a power of ten, and a value rounded to it, within the slider's ends."""
    digits = -math.floor(math.log10((high - low) / 200.0))
    return 10.0**-digits, min(max(round(value, digits) + 0.0, low), high)
