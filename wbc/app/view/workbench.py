"""Workbench: a live view whose page changes the run: drive, push, gains, tasks, targets, pause, restart.

It needs viser (`pip install -e ".[workbench]"`). The panel plots DCM and ZMP over time; the log has all other values
(`wbc plot`, Rerun).
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
from wbc.app.view.stage import SimulatedStage
from wbc.app.view.viser_page import ROOT, SPEEDS, ViserPage, text_html, when
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
        self.url, self._gui = self._page.url, self._page.server.gui
        self._commands: list[Any] = []
        self._attended_at = -math.inf  # clock when a page was open last, s

    def _build(self) -> None:
        run, stage = self.run, self.run.stage
        robot = stage.robot if isinstance(stage, SimulatedStage) else None
        self.controls = LiveControls(robot, run.steered, run.controller)
        for command in self._commands:
            command.remove()
        self._commands.clear()
        self._paused = False
        self._room: Any = None  # folder of settings and targets
        self._shown: list[str] = []  # settings in it
        self._gizmos: list[Gizmo] = []
        with self._page.server.atomic():
            self._page.build(stage)
            self._fill(run.program)

    # ---- the run ----------------------------------------------------------------------------------------------------

    def _take_orders(self, time: float) -> None:
        self.controls.update(time)
        attended = self._attended
        if self.controls.interventions and not self.pages:
            self.controls.halt()  # nobody is left who could
        if self._paused:
            self._show()
        while self._paused and attended:
            attended = self._attended
            clock.sleep(PAUSE_TICK)
            self.controls.update(time)
            self._page.speak()
        self._paused = False

    def ended(self, how: str) -> bool:
        """Show on the page how the run has ended; return True if the user asks for a restart, False otherwise."""
        answers: deque[bool] = deque()
        self._show()
        with (folder := self._gui.add_folder("the run has ended", order=-2.0)):
            self._gui.add_html(text_html(how))
            when(self._gui.add_button("restart", color="green").on_click, lambda _: answers.append(True))
            when(self._gui.add_button("leave").on_click, lambda _: answers.append(False))
        self.controls.end()
        try:
            while not answers and self._attended:
                clock.sleep(PAUSE_TICK)
                self._page.speak()
        except KeyboardInterrupt:
            return False
        folder.remove()
        return bool(answers) and answers[0]

    # ---- the page ---------------------------------------------------------------------------------------------------

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return 0 if self.closed else self._page.open_pages

    @property
    def _attended(self) -> bool:
        """True while a page is open, or may be loaded again."""
        if self.pages:
            self._attended_at = clock.monotonic()
        return not self.closed and clock.monotonic() < self._attended_at + RELOAD_TIME

    def _end(self) -> None:
        self._page.close()

    def _send(self, picture: Picture) -> None:
        self._page.draw(picture)
        for gizmo in self._gizmos:
            gizmo.follow()
        if self._page.speak():
            self._match()

    # ---- the panel --------------------------------------------------------------------------------------------------

    def _fill(self, program: Program | None) -> None:
        """Make all controls."""
        gui, offered, order = self._gui, self.controls.offered, self.controls.order
        self._page.text(lambda: text_html(self.controls.message))
        self._page.checkbox("pause", False, lambda on: setattr(self, "_paused", on))
        speeds = {**SPEEDS, "as fast as it goes": None}
        speed = next((name for name, value in speeds.items() if value == self.speed), "1")
        chosen = gui.add_dropdown("speed", tuple(speeds), initial_value=speed)
        when(chosen.on_update, lambda _: setattr(self, "speed", speeds[chosen.value]))
        if program is not None:
            with gui.add_folder("program"):
                self._page.text(lambda: program_text(program))
        if "drive" in offered and self.run.steered is not None:
            self._drive_folder(self.run.steered.velocity_limits)
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
        self._match()

    def _match(self) -> None:
        """Make the folders of settings and targets anew when tasks have come or gone."""
        settings, gui = self.controls.settings, self._gui
        if list(settings) == self._shown:
            return
        self._shown = list(settings)
        for gone in self._gizmos:
            gone.remove()
        self._gizmos = []
        if self._room is not None:
            self._room.remove()
        self._room = gui.add_folder("settings and targets", expand_by_default=False)
        tasks = {f"task {task.name}": task for task in getattr(self.controls.controller, "tasks", ())}
        groups = dict.fromkeys([*(name.rpartition("/")[0] for name in settings), *tasks])
        with self._room:
            for group in groups:
                with gui.add_folder(group, expand_by_default=False):
                    for name, setting in settings.items():
                        if name.rpartition("/")[0] == group:
                            self._add_number(setting)
                    task: Any = tasks.get(group)
                    if task is not None and task.held_by is None and _has_place(task):
                        gizmo = Gizmo(
                            self._page, task, 0.25 * self.run.stage.scale.height, self.controls.order
                        )
                        self._gizmos.append(gizmo)
                        self._page.checkbox("gizmo on the target", False, gizmo.show)

    def _add_number(self, setting: Setting) -> None:
        label = setting.name.rpartition("/")[2] + (f" ({setting.unit})" if setting.unit else "")
        number = self._gui.add_number(
            label, float(f"{setting.value:.4g}"), min=0.0, hint=setting.about or None
        )

        def given(_: Any) -> None:
            self.controls.order({"do": "set", "name": setting.name, "value": float(number.value)})

        when(number.on_update, given)

    def _drive_folder(self, limits: Iterable[float]) -> None:
        gui, parts = self._gui, ("forward", "left", "turn")
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
            self.controls.order({"do": "drive", **{n: s.value for n, s in zip(parts, sliders, strict=True)}})

        def step(index: int, sign: int, _: Any) -> None:
            value = sliders[index].value + 0.25 * sign * (high[index] if sign > 0 else -low[index])
            sliders[index].value = round(min(max(value, low[index]), high[index]), 2)
            drive()

        def halt(_: Any) -> None:
            for slider in sliders:
                slider.value = 0.0
            drive()

        for slider in sliders:
            when(slider.on_update, lambda event: drive() if event.client is not None else None)
        when(stand.on_click, halt)
        for key, (index, sign) in KEYS.items():
            self._commands.append(gui.add_command(f"{parts[index]} {sign:+d}", hotkey=key))
            when(self._commands[-1].on_trigger, partial(step, index, sign))
        self._commands.append(gui.add_command("stand", hotkey="space"))
        when(self._commands[-1].on_trigger, halt)


class Gizmo:
    """Gizmo on the target of a task, hidden until it is asked for: it follows the target, and moves it."""

    def __init__(
        self, page: ViserPage, task: Any, size: float, order: Callable[[dict[str, Any]], None]
    ) -> None:
        """Make it, of a size in m."""
        self._task, self._order, self._held = task, order, False
        self._turns, self._moves = np.shape(task.target) != (3,), np.shape(task.target) != (3, 3)
        self._handle = page.server.scene.add_transform_controls(
            f"{ROOT}/gizmos/{task.name.replace('/', '_')}",
            scale=size,
            disable_axes=not self._moves,
            disable_sliders=not self._moves,
            disable_rotations=not self._turns,
            depth_test=False,
            visible=False,
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


def _has_place(task: Any) -> bool:
    """Return true for a task whose target is a point, a rotation or a pose."""
    target: Any = getattr(task, "target", None)
    return isinstance(target, pin.SE3) or np.shape(target) in ((3,), (3, 3))
