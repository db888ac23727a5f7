"""Workbench: a live view whose page changes tasks, gains, targets and whatever a program of one's own offers.

It needs viser (`pip install -e ".[workbench]"`), and shows the scene of the live view. Folders are closed and plots are
off until somebody asks for them, so that nothing is computed for a page that nobody looks at.
"""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np
import pinocchio as pin

from wbc.app.address import Address
from wbc.app.arguments import attribute_docs
from wbc.app.scene.layer import Annotations
from wbc.app.view.base import View
from wbc.app.view.controls import DIRECTIONS
from wbc.app.view.workbench_scene import WorkbenchScene
from wbc.app.view.workbench_server import start_server, stop_server
from wbc.core.errors import Array, InputError, finite_array, finite_scalar
from wbc.core.qp.contact import Contact
from wbc.core.qp.solution import Solution
from wbc.core.qp.task import Task
from wbc.core.robot import GRAVITY
from wbc.tasks.behaviours import Program, StateMachine
from wbc.tasks.stabilizer.gains import StabilizerGains

SPEEDS = {"0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0, "4": 4.0, "as fast as it goes": None}
"""Choices of the run's speed, multiples of real time."""

PLOT_TIME, PLOT_PERIOD, TEXT_PERIOD = 10.0, 0.1, 0.2
"""Length of a plot, period of its points and of texts, s."""

DRAG_FORCE = 2.0
"""Force of a link that is dragged, in weights of the robot a metre."""

KEYS = (
    ("faster", "i", 0, 1),
    ("slower", "k", 0, -1),
    ("turn left", "j", 2, 1),
    ("turn right", "l", 2, -1),
    ("to the left", "u", 1, 1),
    ("to the right", "o", 1, -1),
)
"""Commands of a robot that is driven: label, key, part of the velocity, and its sign. Arrows turn viser's camera."""

GAINS = (
    ("stiffness", "1/s²", "acceleration per error; the damping stays critical unless it was set"),
    ("damping", "1/s", "acceleration per velocity error"),
)
"""Gains of a task: name, unit and hint."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


ValueT = TypeVar("ValueT")


@dataclass
class Setting(Generic[ValueT]):
    """Setting of a slider or gizmo of a program.

    Attributes:
        value: Value at the present tick.
    """

    value: ValueT


class Workbench(View):
    """A live view with controls of everything that the run has: see `View` for what it shows.

    Each task has a folder: gizmo on its target, weight, gains, on or off, error and residual as plots. Each contact
    shows its force and margin to its cone, limits how often they act. Ctrl and the mouse pull at a link; a robot that
    is steered is driven by sliders or keys. A program of one's own adds buttons, sliders, plots and gizmos.
    Orders are carried out at ticks and kept in `interventions`; `repeat` carries them out again.
    """

    RATE = 20.0

    def _open(self, address: Address) -> None:
        server, self.url = start_server(address, self.scene.title, self._framed)
        self._server: Any = server
        self._live: list[Callable[[float], None]] = []  # called with each picture
        self._texts: list[tuple[Any, Callable[[], str]]] = []
        self._spoken = self._plotted = -math.inf
        self._said: tuple[str, ...] = ()
        self._rooms: dict[type, Any] = {}  # folders of all tasks and of all contacts
        self._made: list[tuple[Any, Any, list[Any]]] = []  # task or contact, its folder, what it shows live
        with server.atomic():
            self._drawn = WorkbenchScene(server, self.scene, self._pull)
            self._fill(self._program)

    # ---- a program's own controls -----------------------------------------------------------------------------------

    def button(self, name: str, call: Callable[[], object]) -> None:
        """Add a button.

        Args:
            name: Label, unique among the program's controls.
            call: Called at the tick after a click.

        Raises:
            InputError: A name that is taken, or not a function.
        """
        self._add_own(name, lambda _: call(), call)
        with self._folder():
            self._button(name, lambda: {"do": "own", "name": name})

    def slider(
        self,
        name: str,
        low: float,
        high: float,
        value: float,
        call: Callable[[float], object] | None = None,
        unit: str = "",
    ) -> Setting[float]:
        """Add a slider, and return its setting.

        Args:
            name: Label, unique among the program's controls.
            low: Lowest value.
            high: Highest value.
            value: Value at the start.
            call: Called with the value at the tick after a change.
            unit: Unit for the label.

        Raises:
            InputError: A name that is taken, or a value out of range.
        """
        if not finite_scalar(f"low of slider '{name}'", low) < finite_scalar(
            f"high of slider '{name}'", high
        ):
            raise InputError(f"slider '{name}' needs low below high, got {low:g} and {high:g}")
        what = f"value of slider '{name}'"
        setting = Setting(finite_scalar(what, value, low=low, high=high))

        def take(given: Any) -> None:
            setting.value = finite_scalar(what, given, low=low, high=high)
            if call is not None:
                call(setting.value)

        self._add_own(name, take, call)
        with self._folder():
            label = f"{name} ({unit})" if unit else name
            self._slider(label, low, high, value, "", {"do": "own", "name": name})
        return setting

    def plot(self, name: str, function: Callable[[], Any], unit: str = "") -> None:
        """Add a plot over the last seconds.

        Args:
            name: Title.
            function: Called with each picture, at most ten times a second; returns a number or a few.
            unit: Unit for the title.

        Raises:
            InputError: Not a function.
        """
        if not callable(function):
            raise InputError(f"plot '{name}' needs a function, got {function!r}")
        with self._folder():
            self._plot(lambda: True, {f"{name} ({unit})" if unit else name: function})

    def gizmo(
        self,
        thing: Task | str,
        place: pin.SE3 | None = None,
        call: Callable[[pin.SE3], object] | None = None,
    ) -> Setting[pin.SE3] | None:
        """Show a gizmo on the target of a task, or a free one of which the setting is returned.

        Args:
            thing: A task with a point, orientation or pose as its target; or the name of a free gizmo.
            place: Place of a free gizmo at the start, in the world; the origin when None.
            call: Called with the place at the tick after a free gizmo has moved.

        Raises:
            InputError: A task of another controller, one whose target another part sets or is none of these; a name
                that is taken.
        """
        if isinstance(thing, Task):
            self.controls.check_task(thing)
            if not _has_place(thing):
                raise InputError(f"task '{thing.name}' has no point, orientation or pose as its target")
            self._task_gizmo(thing, lambda: True)
            return None
        setting = Setting(pin.SE3.Identity() if place is None else pin.SE3(place))

        def take(given: Any) -> None:
            setting.value = pin.XYZQUATToSE3(finite_array(f"place of gizmo '{thing}' (m, xyzw)", given, (7,)))
            if call is not None:
                call(setting.value)

        def order(place: pin.SE3) -> dict[str, Any]:
            return {"do": "own", "name": thing, "value": pin.SE3ToXYZQUAT(place).tolist()}

        self._add_own(thing, take, call)
        self._gizmo(thing, lambda: setting.value, order, lambda: True)
        return setting

    def _add_own(self, name: str, take: Callable[[Any], object], call: object) -> None:
        if call is not None and not callable(call):
            raise InputError(f"control '{name}' needs a function, got {call!r}")
        self.controls.add_own(name, take)

    # ---- the page ---------------------------------------------------------------------------------------------------

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return 0 if self.closed else len(self._server.get_clients())

    def _end(self) -> None:
        stop_server(self._server)

    def _send(self, time: float, matrices: Array, annotations: Annotations) -> None:
        self._drawn.draw(matrices, annotations)
        self._said = (f"**{time:.2f} s**", *annotations.text)
        now = clock.perf_counter()
        if now >= self._plotted + PLOT_PERIOD:
            self._plotted = now
            for show in self._live:
                show(time)
        if now >= self._spoken + TEXT_PERIOD:
            self._spoken = now
            self._match()
            for place, text in self._texts:
                new = text()
                if place.content != new:
                    place.content = new

    def _pull(self, body: str, way: Array) -> None:
        if self._plant is not None:
            force = DRAG_FORCE * self._plant.robot.mass * GRAVITY * way
            self.controls.order({"do": "pull", "body": body, "force": force.tolist()})

    # ---- folders ----------------------------------------------------------------------------------------------------

    def _fill(self, program: Program | None) -> None:
        """Make all controls."""
        gui, offered = self._server.gui, self.controls.available()
        self._text(lambda: "  \n".join(self._said))
        self._checkbox("pause", False, lambda on: setattr(self._pace, "paused", on))
        speed = next((name for name, value in SPEEDS.items() if value == self._pace.speed), "1")
        chosen = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=speed)
        when(chosen.on_update, lambda _: setattr(self._pace, "speed", SPEEDS[chosen.value]))
        self._checkbox("camera follows", True, lambda on: setattr(self._drawn, "follows", on))
        self._checkbox("see through the robot", False, self._drawn.see_through)
        with gui.add_folder("meaning of the colours", expand_by_default=False):
            lines = (
                f'<span style="color: rgb{tuple(round(255 * part) for part in colour[:3])}">⬤</span> {text}'
                for text, colour in self.scene.legend
            )
            gui.add_html("<div style='padding: 0 1em; font-size: 0.85em'>" + "<br>".join(lines) + "</div>")
        if program is not None:
            with gui.add_folder("program"):
                self._text(lambda: program_text(program))
        self._own_folder: Any = None
        if "drive" in offered:
            self._drive_folder(offered["drive"])
        if "stop" in offered and "drive" not in offered:
            self._button("stop walking", lambda: {"do": "stop"}, "the run ends when the robot stands")
        if "push" in offered:
            self._push_folder(offered["push"])
        if "gains" in offered:
            docs = attribute_docs(StabilizerGains)
            with gui.add_folder("stabilizer gains", expand_by_default=False):
                for gain in offered["gains"]:
                    name, unit, most = gain["name"], gain["unit"], gain["largest"]
                    label, order = f"{name} ({unit})" if unit else name, {"do": "gain", "name": name}
                    self._slider(label, 0.0, most, min(gain["value"], most), docs[name], order)
        if "stiffness" in offered:
            soles = offered["stiffness"]
            with gui.add_folder("soles", expand_by_default=False):
                low, value = soles["low"], soles["value"]
                high, hint = (
                    min(soles["high"], max(100.0, 2.0 * value)),
                    "each foot takes it in its next swing",
                )
                self._slider("stiffness (Nm/rad)", low, high, value, hint, {"do": "stiffness"})
        controller = self.controls.controller
        if controller is None:
            return
        self._rooms = {
            kind: gui.add_folder(name, expand_by_default=False)
            for kind, name in ((Task, "tasks"), (Contact, "contacts"))
        }
        with gui.add_folder("limits", expand_by_default=False):
            self._limits()
        self._match()

    def _match(self) -> None:
        """Make the folders of tasks and contacts that have come, as with a state, and remove those of what has gone."""
        controller = self.controls.controller
        present: list[Any] = [] if controller is None else [*controller.tasks, *controller.contacts]
        for thing, folder, live in [made for made in self._made if made[0] not in present]:
            self._made.remove((thing, folder, live))
            for show in live:
                show(math.nan)  # takes its plots and gizmo away
                self._live.remove(show)
            folder.remove()
        for thing in present:
            if thing not in [made[0] for made in self._made]:
                before, task = len(self._live), isinstance(thing, Task)
                with self._rooms[Task if task else Contact]:
                    folder = self._task_folder(thing) if task else self._contact_folder(thing)
                self._made.append((thing, folder, self._live[before:]))

    def _there(self, thing: object) -> bool:
        """Return true while the controller has a task or contact."""
        controller = self.controls.controller
        return controller is not None and thing in (*controller.tasks, *controller.contacts)

    def _folder(self) -> Any:
        """Folder of the program's own controls."""
        if self._own_folder is None:
            self._own_folder = self._server.gui.add_folder("own controls", order=-1.0)
        return self._own_folder

    def _drive_folder(self, limits: dict[str, float]) -> None:
        gui, parts = self._server.gui, ("forward", "left", "turn")
        most = {name: math.floor(100.0 * limit) / 100.0 for name, limit in limits.items()}
        low = (-most["back"], -most["left"], -most["turn"])
        high = (most["forward"], most["left"], most["turn"])
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
            command = gui.add_command(label, hotkey=key)
            when(command.on_trigger, partial(step, index, sign))
        when(gui.add_command("stand", hotkey="space").on_trigger, halt)

    def _push_folder(self, push: dict[str, Any]) -> None:
        gui = self._server.gui
        with gui.add_folder("push", expand_by_default=False):
            side = gui.add_dropdown("direction", tuple(DIRECTIONS))
            size = gui.add_slider("impulse (Ns/kg)", 0.0, push["largest"], 0.01, push["impulse"])
            self._button("push", lambda: {"do": "push", "direction": side.value, "impulse": size.value})
            gui.add_markdown("Ctrl and the mouse pull at a link.")

    def _task_folder(self, task: Task) -> Any:
        gui, name, order = self._server.gui, task.name, {"do": "task", "task": task.name}
        with (folder := gui.add_folder(name, expand_by_default=False)):
            if task.hard:
                gui.add_markdown("hard: a constraint")
            else:
                weight = float(task.weight.max())
                self._checkbox("on", weight > 0.0, lambda on: self.controls.order(order | {"on": on}))
                power = math.log10(weight) if weight > 0.0 else 0.0
                self._slider(
                    "weight, power of ten",
                    math.floor(power) - 3.0,
                    math.ceil(power) + 3.0,
                    power,
                    f"cost per squared residual, ({task.residual_unit})²; all rows get the same",
                    order,
                    "weight",
                    lambda power: 10.0**power,
                )
            for gain, unit, about in GAINS:
                value = float(getattr(task, gain).max())
                if value > 0.0:
                    self._slider(f"{gain} ({unit})", 0.0, 4.0 * value, value, about, order, gain)
            if task.held_by is not None:
                gui.add_markdown(f"Target set at every tick: use {task.held_by}")
            elif _has_place(task):
                shown = gui.add_checkbox("gizmo on the target", False)
                self._task_gizmo(task, lambda: shown.value and self._there(task))
            plotted = gui.add_checkbox("plots", False)
            self._plot(
                lambda: plotted.value and self._there(task),
                {
                    f"error ({task.unit})": lambda: float(np.linalg.norm(task.error)),
                    f"residual ({task.residual_unit})": lambda: self._residual(name),
                },
            )
        return folder

    def _residual(self, task: str) -> float:
        """Return the norm of a task's residual, NaN before the first tick."""
        rows = None if self._solution is None else self._solution.residuals.get(task)
        return math.nan if rows is None else float(np.linalg.norm(rows))

    def _contact_folder(self, contact: Contact) -> Any:
        gui = self._server.gui

        def force() -> float:
            wrench = self._wrench(contact)
            return math.nan if wrench is None else float(wrench[contact.force_axis])

        def margin() -> float:
            wrench = self._wrench(contact)
            return math.nan if wrench is None else cone_margin(contact, wrench)

        with (folder := gui.add_folder(contact.name, expand_by_default=False)):
            plotted = gui.add_checkbox("plots", False)
            self._plot(
                lambda: plotted.value and self._there(contact),
                {"normal force (N)": force, "margin to the cone (1: none used, 0: on its edge)": margin},
            )
        return folder

    def _wrench(self, contact: Contact) -> Array | None:
        return None if self._solution is None else self._solution.wrenches.get(contact.name)

    @property
    def _solution(self) -> Solution | None:
        return None if self.controls.controller is None else self.controls.controller.solution

    def _limits(self) -> None:
        asked = self._server.gui.add_checkbox("show", False)
        seen: deque[tuple[str, ...]] = deque(maxlen=round(PLOT_TIME / PLOT_PERIOD))

        def look(_: float) -> None:
            if asked.value and self._solution is not None:
                seen.append(tuple(dict.fromkeys(self._solution.active_limits)))

        def text() -> str:
            if not asked.value or not seen:
                return ""
            names = dict.fromkeys(name for each in seen for name in each)
            rows = [(sum(name in each for each in seen) / len(seen), name) for name in names]
            now = {*seen[-1]}
            return "  \n".join(
                [f"{len(now)} active now; share of the last pictures in which each was:"]
                + [
                    f"{'**' if name in now else ''}{share:.0%} {name}{'**' if name in now else ''}"
                    for share, name in sorted(rows, reverse=True)
                ]
            )

        self._live.append(look)
        self._text(text)

    # ---- parts of folders -------------------------------------------------------------------------------------------

    def _text(self, text: Callable[[], str]) -> None:
        self._texts.append((self._server.gui.add_markdown(""), text))

    def _button(self, label: str, order: Callable[[], dict[str, Any]], hint: str = "") -> None:
        button = self._server.gui.add_button(label, hint=hint or None)

        when(button.on_click, lambda _: self.controls.order(order()))

    def _checkbox(self, label: str, value: bool, call: Callable[[bool], object]) -> None:
        box = self._server.gui.add_checkbox(label, value)
        when(box.on_update, lambda _: call(bool(box.value)))

    def _slider(
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
        step = 10.0 ** math.floor(math.log10((high - low) / 200.0))
        slider = self._server.gui.add_slider(label, low, high, step, float(value), hint=hint or None)

        when(slider.on_update, lambda _: self.controls.order(order | {key: taken(slider.value)}))

    def _plot(self, asked: Callable[[], bool], curves: dict[str, Callable[[], Any]]) -> None:
        """Add plots under each other, which are there while they are asked for."""
        gui = self._server.gui
        place = gui.add_folder(None)
        kept: deque[list[Array]] = deque(maxlen=round(PLOT_TIME / PLOT_PERIOD))
        handles: list[Any] = []

        def show(time: float) -> None:
            if not asked():
                for handle in handles:
                    handle.remove()
                handles.clear()
                kept.clear()
                return
            kept.append([np.array([time]), *(np.atleast_1d(function()) for function in curves.values())])
            if len(kept) < 2:  # a line needs two points
                return
            data = [np.array([row[i] for row in kept], dtype=float).T for i in range(len(curves) + 1)]
            from viser import uplot  # noqa: PLC0415 - an extra

            for i, title in enumerate(curves):
                columns = (data[0][0], *_without_noise(data[i + 1]))
                if i < len(handles):
                    handles[i].data = columns
                    continue
                series = [uplot.Series(label="s")] + [
                    uplot.Series(label=str(k), stroke=COLOURS[k % len(COLOURS)], width=1.5)
                    for k in range(len(columns) - 1)
                ]
                scales = {"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)}
                with place:
                    handles.append(
                        gui.add_uplot(
                            columns,
                            tuple(series),
                            title=title,
                            scales=scales,
                            legend=uplot.Legend(show=False),
                            height=150,
                        )
                    )

        self._live.append(show)

    def _task_gizmo(self, task: Any, asked: Callable[[], bool]) -> None:
        """Show a gizmo on the target of a task while it is asked for."""
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
            return {"do": "task", "task": task.name, "target": np.asarray(value).tolist()}

        self._gizmo(task.name, place, order, asked, turns=turns, moves=moves)

    def _gizmo(
        self,
        name: str,
        place: Callable[[], pin.SE3],
        order: Callable[[pin.SE3], dict[str, Any]],
        asked: Callable[[], bool],
        *,
        turns: bool = True,
        moves: bool = True,
    ) -> None:
        handles: list[Any] = []
        held = False

        def show(_: float) -> None:
            if not asked():
                for handle in handles:
                    handle.remove()
                handles.clear()
                return
            if not handles:
                handle = self._server.scene.add_transform_controls(
                    f"/wbc/gizmos/{name.replace('/', '_')}",
                    scale=0.25 * self.scene.com_height,
                    disable_axes=not moves,
                    disable_sliders=not moves,
                    disable_rotations=not turns,
                    depth_test=False,
                )
                when(handle.on_update, moved)
                handles.append(handle)
            if not held:
                handle, now = handles[0], place()
                x, y, z, w = pin.Quaternion(now.rotation).coeffs().tolist()
                handle.position, handle.wxyz = now.translation, (w, x, y, z)

        def moved(event: Any) -> None:
            nonlocal held
            held = event.phase != "end"
            w, x, y, z = map(float, event.target.wxyz)
            turn = pin.Quaternion(w, x, y, z).normalized().matrix()
            self.controls.order(order(pin.SE3(turn, np.array(event.target.position, dtype=float))))

        self._live.append(show)


def when(event: Callable[[Any], object], call: Callable[[Any], object]) -> None:
    """Call a function at an event of the page, one after the other in the order of the events."""

    async def take(given: Any) -> None:
        call(given)

    event(take)


def program_text(program: Program) -> str:
    """Return the present state of a program, where its outcomes lead, and what was before."""
    lines = [f"**{program.path}**" if not program.ended else f"ended: **{program.outcome}**"]
    machine: Any = program.machine
    for name in () if program.ended else program.path.split("/")[1:]:
        follows = machine.transitions[name]
        lines += [f"{name}: {outcome} → {goal}" for outcome, goal in follows.items()]
        machine = machine.states[name]
        if not isinstance(machine, StateMachine):
            break
    return "  \n".join([*lines, *(f"{t:.2f} s {path}: {how}" for t, path, how in program.history[-5:])])


def cone_margin(contact: Contact, wrench: Array) -> float:
    """Return the margin of a wrench, force variables of a contact (N and Nm), to its cone.

    1 for a force along the normal through the centre, 0 on the edge of the cone, below outside of it; NaN without a
    normal force.
    """
    normal = float(wrench[contact.force_axis])
    if not normal > 1.0:
        return math.nan
    allowed = -contact.cone[:, contact.force_axis] * normal
    used = contact.cone @ wrench + allowed
    bounds = allowed > 0.0
    return float(1.0 - (used[bounds] / allowed[bounds]).max())


def _without_noise(values: Array) -> Array:
    """Return values to seven digits of the largest, and to 1e-9: uPlot cannot draw an axis with finer ticks."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    return values if largest == 0.0 else np.round(np.round(values / largest, 7) * largest, 9)


def _has_place(task: Any) -> bool:
    """Return true for a task whose target is a point, a rotation or a pose."""
    target: Any = getattr(task, "target", None)
    return isinstance(target, pin.SE3) or np.shape(target) in ((3,), (3, 3))
