"""Workbench: a live view whose page changes the run: drive, push, gains, tasks, targets, pause, restart.

It needs viser (`pip install -e ".[workbench]"`). Values over time are looked at in the log (`wbc plot`, Rerun).
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
from wbc.app.view.controls import DIRECTIONS, IMPULSE, MAX_IMPULSE, LiveControls
from wbc.app.view.marks import Picture
from wbc.app.view.stage import SimulatedStage
from wbc.app.view.viser_page import ViserPage, start_server, stop_server
from wbc.app.view.widgets import Gizmo, Widgets, when
from wbc.core.errors import Array
from wbc.robots import RobotDescription
from wbc.sim.plant.robot import SimulatedRobot
from wbc.tasks.behaviours import Program

SPEEDS = {"0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0, "4": 4.0, "as fast as it goes": None}
"""Choices of the run's speed, multiples of real time."""

DRAG_FORCE = 2.0
"""Force of a link that is dragged, in weights of the robot a metre."""

PAUSE_TICK = 0.02
"""Period at which a page is asked whether a run that waits may go on, s."""

KEYS = (
    ("faster", "i", 0, 1),
    ("slower", "k", 0, -1),
    ("turn left", "j", 2, 1),
    ("turn right", "l", 2, -1),
    ("to the left", "u", 1, 1),
    ("to the right", "o", 1, -1),
)
"""Commands of a robot that is driven: label, key, part of the velocity, and its sign. Arrows turn viser's camera."""


class Workbench(View):
    """A live view with controls of everything that the run has: see `View` for what it shows.

    Each task has a folder: gizmo on its target, weight, gains. Ctrl and the mouse pull at a link; a robot that is
    steered is driven by sliders or keys. Orders are carried out at ticks and kept in `interventions`. Whoever
    reaches the page, on this machine, changes the run.

    Attributes:
        controls: Controls of the page, with the changes so far.
    """

    def show(
        self, source: SimulatedRobot | RobotDescription, control: Any = None, program: Program | None = None
    ) -> None:
        """Show another run in the same page, as after `ended`; its interventions are counted anew."""
        self._set_source(source, control, program)
        self._begin()

    def _open(self, port: int) -> None:
        server, self.url = start_server(port, self.stage.title)
        self._server: Any = server
        self._commands: list[Any] = []

    def _build(self) -> None:
        server, stage = self._server, self.stage
        robot = stage.robot if isinstance(stage, SimulatedStage) else None
        self.controls = LiveControls(robot, self.walking, self._controller)
        for command in self._commands:
            command.remove()
        self._commands.clear()
        server.gui.reset()
        server.scene.reset()
        self._widgets = Widgets(server, self.controls.order)
        self._pace.restart()
        self._room: Any = None  # folder of settings and targets
        self._shown: list[str] = []  # settings in it
        with server.atomic():
            self._page = ViserPage(server, stage, None if robot is None else self._pull)
            self._fill(self._program)

    # ---- the run ----------------------------------------------------------------------------------------------------

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """Changes made from the page, each with its simulated time (s); empty if nobody changed the run."""
        return self.controls.interventions

    def _take_orders(self, time: float, picture: Callable[[], Picture]) -> None:
        self.controls.update(time)
        if self.controls.interventions and not self.pages:
            self.controls.halt()  # nobody is left who could
        if not self._pace.paused:
            return
        self._show(picture())
        while self._pace.paused and self.pages > 0:
            clock.sleep(PAUSE_TICK)
            before = self.controls.message
            self.controls.carry_out(time)
            if self.controls.message != before:
                self._widgets.speak()
        self._pace.paused = False
        self._pace.restart()

    def ended(self, how: str) -> bool:
        """Say on the page in a few words how the run has ended; True if it asks for a restart, False if it is left."""
        answers: deque[bool] = deque()
        self._show_last()
        gui = self._server.gui
        with (folder := gui.add_folder("the run has ended", order=-2.0)):
            gui.add_markdown(f"**{how}**")
            when(gui.add_button("restart", color="green").on_click, lambda _: answers.append(True))
            when(gui.add_button("leave").on_click, lambda _: answers.append(False))
        try:
            while not answers and self.pages > 0:
                clock.sleep(PAUSE_TICK)
        except KeyboardInterrupt:
            return False
        folder.remove()
        self._pace.restart()
        return bool(answers) and answers[0]

    # ---- the page ---------------------------------------------------------------------------------------------------

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return 0 if self.closed else len(self._server.get_clients())

    def _end(self) -> None:
        stop_server(self._server)

    def _send(self, picture: Picture) -> None:
        self._page.draw(picture)
        if self._widgets.show():
            self._match()

    def _status(self) -> str:
        return "  \n".join([*self._page.said, *([self.controls.message] if self.controls.message else [])])

    def _pull(self, body: str, way: Array) -> None:
        force = DRAG_FORCE * self.stage.scale.weight * way
        self.controls.order({"do": "pull", "body": body, "force": force.tolist()})

    # ---- folders ----------------------------------------------------------------------------------------------------

    def _fill(self, program: Program | None) -> None:
        """Make all controls."""
        gui, offered, walking = self._server.gui, self.controls.offered, self.walking
        self._widgets.text(self._status)
        self._widgets.checkbox("pause", False, lambda on: setattr(self._pace, "paused", on))
        speed = next((name for name, value in SPEEDS.items() if value == self._pace.speed), "1")
        chosen = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=speed)
        when(chosen.on_update, lambda _: setattr(self._pace, "speed", SPEEDS[chosen.value]))
        self._page.options(self._widgets)
        if program is not None:
            with gui.add_folder("program"):
                self._widgets.text(lambda: program_text(program))
        if "drive" in offered and walking is not None:
            self._drive_folder(walking.velocity_limits)
        if "stop" in offered and "drive" not in offered:
            self._widgets.button("stop walking", lambda: {"do": "stop"}, "the run ends when the robot stands")
        if "push" in offered:
            self._push_folder()
        self._match()

    def _match(self) -> None:
        """Make the folders of settings and targets anew when tasks have come or gone."""
        settings, gui = self.controls.settings, self._server.gui
        if list(settings) == self._shown:
            return
        self._shown = list(settings)
        for gone in self._widgets.gizmos:
            gone.remove()
        self._widgets.gizmos.clear()
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
                            self._widgets.slider(setting)
                    task = tasks.get(group)
                    if task is not None and task.held_by is None and _has_place(task):
                        self._widgets.checkbox("gizmo on the target", False, self._task_gizmo(task).ask)

    def _drive_folder(self, limits: Iterable[float]) -> None:
        gui, parts = self._server.gui, ("forward", "left", "turn")
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
        for label, key, index, sign in KEYS:
            self._commands.append(gui.add_command(label, hotkey=key))
            when(self._commands[-1].on_trigger, partial(step, index, sign))
        self._commands.append(gui.add_command("stand", hotkey="space"))
        when(self._commands[-1].on_trigger, halt)

    def _push_folder(self) -> None:
        gui = self._server.gui
        with gui.add_folder("push", expand_by_default=False):
            side = gui.add_dropdown("direction", tuple(DIRECTIONS))
            size = gui.add_slider("impulse (Ns/kg)", 0.0, MAX_IMPULSE, 0.01, IMPULSE)
            self._widgets.button(
                "push", lambda: {"do": "push", "direction": side.value, "impulse": size.value}
            )
            gui.add_markdown("Ctrl and the mouse pull at a link.")

    def _task_gizmo(self, task: Any) -> Gizmo:
        """Return the gizmo on the target of a task, which is shown when it is asked for."""
        robot, whole = task.robot, isinstance(task.target, pin.SE3)
        turns = whole or np.shape(task.target) == (3, 3)
        moves = whole or not turns

        def place() -> pin.SE3:
            target = task.target
            if isinstance(target, pin.SE3):
                return target
            if np.shape(target) == (3, 3):
                return pin.SE3(np.array(target), robot.placement(task.frame).translation)
            return pin.SE3(np.eye(3), np.array(target))

        def order(place: pin.SE3) -> dict[str, Any]:
            value = pin.SE3ToXYZQUAT(place) if whole else place.rotation if turns else place.translation
            return {"do": "target", "task": task.name, "target": np.asarray(value).tolist()}

        size = 0.25 * self.stage.scale.height
        return self._widgets.gizmo(task.name, size, place, order, turns=turns, moves=moves)


def program_text(program: Program) -> str:
    """Return the present state of a program, and how the last ones ended."""
    now = f"ended: **{program.outcome}**" if program.ended else f"**{program.path}**"
    return "  \n".join([now, *(f"{t:.2f} s {path}: {how}" for t, path, how in program.history[-5:])])


def _has_place(task: Any) -> bool:
    """Return true for a task whose target is a point, a rotation or a pose."""
    target: Any = getattr(task, "target", None)
    return isinstance(target, pin.SE3) or np.shape(target) in ((3,), (3, 3))
