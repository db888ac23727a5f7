"""Workbench: a live view whose page changes the run: drive, push, gains, tasks, targets, pause, restart.

It needs viser (`pip install -e ".[workbench]"`).
"""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.app.view.base import View
from wbc.app.view.controls import DIRECTIONS, IMPULSE, MAX_IMPULSE, LiveControls, Setting
from wbc.app.view.marks import Picture
from wbc.app.view.viser_page import ROOT, SPEEDS, ViserPage, ViserPanel, text_html, when
from wbc.tasks.behaviours import Program

PAUSE_TICK = 0.02
"""Period at which a page is asked whether a run that waits may go on, s."""

RELOAD_TIME = 5.0
"""Time for which a page that was open may be gone, s: one that is loaded again is, for a second or two."""

KEYS = {"i": (0, 1), "k": (0, -1), "j": (2, 1), "l": (2, -1), "u": (1, 1), "o": (1, -1)}
"""Keys that drive a robot: part of the velocity, and its sign. Arrows turn viser's camera."""


class Workbench(View):
    """Live view with controls for all parts of the run; `View` lists its contents.

    Each task has a folder with a gizmo at its target, its weight and its gains. A robot that can be steered is driven
    by sliders or keys. Orders are carried out at the next tick and stored in `controls.interventions`, each with its
    simulated time (s). Anyone who can open the page on this machine can change the run.
    """

    controls: LiveControls

    def _open(self, port: int) -> None:
        self._page = ViserPage(port, self.run.stage.title)
        self.url = self._page.url
        self._attended_at = -math.inf  # clock when a page was open last, s

    def _build(self) -> None:
        self.controls = LiveControls(self.run.stage.plant, self.run.steered, self.run.controller)
        with self._page.server.atomic():
            self._panel = ControlPanel(self._page, self)

    # ---- the run ----------------------------------------------------------------------------------------------------

    def _take_orders(self, time: float) -> None:
        panel, pause = self._panel, self._panel.pause
        self.controls.update(time)
        attended = self._attended
        if self.controls.interventions and not self.pages:
            self.controls.halt()  # nobody is left who could
        if not pause.value:
            return
        self._show()
        while pause.value and attended:
            attended = self._attended
            clock.sleep(PAUSE_TICK)
            self.controls.update(time)
            panel.speak()
        pause.value = False

    def ended(self, how: str) -> bool:
        """Show on the page how the run has ended; return True if the user asks for a restart, False otherwise."""
        answers: deque[bool] = deque()
        super().ended(how)
        self._show()
        gui = self._panel.gui
        with (folder := gui.add_folder("the run has ended", order=-2.0)):
            gui.add_html(text_html(how))
            when(gui.add_button("restart", color="green").on_click, lambda _: answers.append(True))
            when(gui.add_button("leave").on_click, lambda _: answers.append(False))
        try:
            while not answers and self._attended:
                clock.sleep(PAUSE_TICK)
                self._panel.speak()
        except KeyboardInterrupt:
            return False
        folder.remove()
        return bool(answers) and answers[0]

    # ---- the page ---------------------------------------------------------------------------------------------------

    def _count(self) -> int:
        return self._page.open_pages

    @property
    def _attended(self) -> bool:
        """True while a page is open, or may be loaded again."""
        if self.pages:
            self._attended_at = clock.monotonic()
        return not self.closed and clock.monotonic() < self._attended_at + RELOAD_TIME

    def _end(self) -> None:
        self._page.close()

    def _send(self, picture: Picture) -> None:
        self._panel.draw(picture)


class ControlPanel(ViserPanel):
    """Content of the page of a workbench: beside the scene the controls of all parts of the run.

    Attributes:
        pause: Checkbox by which the user lets the run wait.
    """

    def __init__(self, page: ViserPage, view: Workbench) -> None:
        run, controls = view.run, view.controls
        super().__init__(page, run.stage)
        gui, offered, order = self.gui, controls.offered, controls.order
        self.text(lambda: text_html(controls.message))
        self.pause = gui.add_checkbox("pause", False)
        speeds = {**SPEEDS, "as fast as it goes": None}
        speed = next((name for name, value in speeds.items() if value == view.speed), "1")
        chosen = gui.add_dropdown("speed", tuple(speeds), initial_value=speed)
        when(chosen.on_update, lambda _: setattr(view, "speed", speeds[chosen.value]))
        if (program := run.program) is not None:
            with gui.add_folder("program"):
                self.text(lambda: program_text(program))
        if "drive" in offered and run.steered is not None:
            add_drive(self, run.steered.velocity_limits, order)
        elif "stop" in offered:
            stop = gui.add_button("stop walking", hint="the run ends when the robot stands")
            when(stop.on_click, lambda _: order({"do": "stop"}))
        if "push" in offered:
            with gui.add_folder("push", expand_by_default=False):
                side = gui.add_dropdown("direction", tuple(DIRECTIONS))
                size = gui.add_slider("impulse (Ns/kg)", 0.0, MAX_IMPULSE, 0.01, IMPULSE)
                push = gui.add_button("push")
            when(
                push.on_click, lambda _: order({"do": "push", "direction": side.value, "impulse": size.value})
            )
        self._settings = SettingsFolder(self, page.server.scene, controls)

    def draw(self, picture: Picture) -> None:
        """See `ViserPanel`; the texts follow if they are due."""
        super().draw(picture)
        self._settings.follow()
        if self.speak():
            self._settings.match()


def add_drive(panel: ViserPanel, limits: Iterable[float], order: Callable[[dict[str, Any]], None]) -> None:
    """Add sliders and keys that drive a robot up to limits: forward, back and aside, m/s, and in turns, rad/s."""
    gui, parts = panel.gui, ("forward", "left", "turn")
    ahead, back, aside, turn = (math.floor(100.0 * limit) / 100.0 for limit in limits)
    low, high = (-back, -aside, -turn), (ahead, aside, turn)
    with gui.add_folder("drive"):
        sliders = [
            gui.add_slider(f"{name} ({unit})", a, b, 0.01, 0.0)
            for name, unit, a, b in zip(parts, ("m/s", "m/s", "rad/s"), low, high, strict=True)
        ]
        gui.add_markdown("keys i, k: faster, slower; j, l: turn; u, o: to the side; space: stand")
        stand = gui.add_button("stand", hint="the robot can be driven on")

    def drive(_: Any = None) -> None:
        order({"do": "drive", **{n: s.value for n, s in zip(parts, sliders, strict=True)}})

    def step(index: int, sign: int) -> None:
        value = sliders[index].value + 0.25 * sign * (high[index] if sign > 0 else -low[index])
        sliders[index].value = round(min(max(value, low[index]), high[index]), 2)
        drive()

    def halt(_: Any = None) -> None:
        for slider in sliders:
            slider.value = 0.0
        drive()

    for slider in sliders:
        when(slider.on_update, lambda event: drive() if event.client is not None else None)
    when(stand.on_click, halt)
    for key, (index, sign) in KEYS.items():
        panel.key(key, f"{parts[index]} {sign:+d}", partial(step, index, sign))
    panel.key("space", "stand", halt)


class SettingsFolder:
    """Folder of the settings of a run, and of the gizmos of its targets; made anew when tasks have come or gone."""

    def __init__(self, panel: ViserPanel, nodes: Any, controls: LiveControls) -> None:
        self._panel, self._nodes, self._controls = panel, nodes, controls
        self._folder: Any = None
        self._shown: list[str] = []  # settings in it
        self._gizmos: list[Gizmo] = []
        self.match()

    def follow(self) -> None:
        """Move the gizmos to their targets."""
        for gizmo in self._gizmos:
            gizmo.follow()

    def match(self) -> None:
        """Make the folder anew if tasks have come or gone."""
        panel, controls = self._panel, self._controls
        settings = controls.settings
        if list(settings) == self._shown:
            return
        self._shown = list(settings)
        for gone in self._gizmos:
            gone.remove()
        self._gizmos = []
        if self._folder is not None:
            self._folder.remove()
        self._folder = panel.gui.add_folder("settings and targets", expand_by_default=False)
        tasks = {f"task {task.name}": task for task in getattr(controls.controller, "tasks", ())}
        groups = dict.fromkeys([*(name.rpartition("/")[0] for name in settings), *tasks])
        size = 0.25 * panel.scene.stage.scale.height
        with self._folder:
            for group in groups:
                with panel.gui.add_folder(group, expand_by_default=False):
                    for name, setting in settings.items():
                        if name.rpartition("/")[0] == group:
                            self._add_number(setting)
                    task: Any = tasks.get(group)
                    target: Any = getattr(task, "target", None)
                    placed = isinstance(target, pin.SE3) or np.shape(target) in ((3,), (3, 3))
                    if placed and task.held_by is None:
                        self._gizmos.append(Gizmo(self._nodes, task, size, controls.order))
                        panel.checkbox("gizmo on the target", False, self._gizmos[-1].show)

    def _add_number(self, setting: Setting) -> None:
        label = setting.name.rpartition("/")[2] + (f" ({setting.unit})" if setting.unit else "")
        number = self._panel.gui.add_number(
            label, float(f"{setting.value:.4g}"), min=0.0, hint=setting.about or None
        )

        def given(_: Any) -> None:
            self._controls.order({"do": "set", "name": setting.name, "value": float(number.value)})

        when(number.on_update, given)


class Gizmo:
    """Gizmo on the target of a task, hidden until it is asked for: it follows the target, and moves it."""

    def __init__(self, nodes: Any, task: Any, size: float, order: Callable[[dict[str, Any]], None]) -> None:
        """Make it among the nodes of viser's scene, of a size in m."""
        self._task, self._order, self._held = task, order, False
        self._turns, self._moves = np.shape(task.target) != (3,), np.shape(task.target) != (3, 3)
        name, still = f"{ROOT}/gizmos/{task.name.replace('/', '_')}", not self._moves
        fixed = {"disable_axes": still, "disable_sliders": still, "disable_rotations": not self._turns}
        self._handle = nodes.add_transform_controls(
            name, scale=size, depth_test=False, visible=False, **fixed
        )
        when(self._handle.on_update, self._take)

    def show(self, on: bool) -> None:
        """Show it or hide it."""
        self._handle.visible = on
        self.follow()

    def follow(self) -> None:
        """Move it to the target, unless somebody holds it."""
        if self._handle.visible and not self._held:
            task, place = self._task, self._task.target
            if not self._moves:
                place = pin.SE3(np.array(place), task.robot.placement(task.frame).translation)
            elif not self._turns:
                place = pin.SE3(np.eye(3), np.array(place))
            x, y, z, w = pin.Quaternion(place.rotation).coeffs().tolist()
            self._handle.position, self._handle.wxyz = place.translation, (w, x, y, z)

    def remove(self) -> None:
        """Take it away."""
        self._handle.remove()

    def _take(self, event: Any) -> None:
        self._held = event.phase != "end"
        (w, x, y, z), position = map(float, event.target.wxyz), np.array(event.target.position, dtype=float)
        turn = pin.Quaternion(w, x, y, z).normalized()
        target = turn.matrix() if not self._moves else position
        if self._moves and self._turns:
            target = np.concatenate([position, turn.coeffs()])
        self._order({"do": "target", "task": self._task.name, "target": target.tolist()})


def program_text(program: Program) -> str:
    """Return the present state of a program, and how the last ones ended, as HTML."""
    now = f"ended: {program.outcome}" if program.ended else program.path
    return text_html(now, *(f"{t:.2f} s {path}: {how}" for t, path, how in program.history[-5:]))
