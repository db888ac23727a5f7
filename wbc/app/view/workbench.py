"""Workbench: a live view whose page changes the run: drive, push, gains, tasks, targets, pause, restart.

It needs viser (`pip install -e ".[workbench]"`). Folders are closed and plots are off until somebody asks for them, so
that nothing is computed for a page that nobody looks at.
"""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np
import pinocchio as pin

from wbc.app.arguments import attribute_docs
from wbc.app.view.base import View
from wbc.app.view.controls import DIRECTIONS, LiveControls
from wbc.app.view.marks import Picture, legend
from wbc.app.view.stage import SimulatedStage
from wbc.app.view.viser_page import ViserPage, legend_html, start_server, stop_server
from wbc.app.view.widgets import PLOT_PERIOD, PLOT_TIME, Widgets, round_up, when
from wbc.core.errors import Array, InputError, finite_array, finite_scalar
from wbc.core.qp.contact import Contact
from wbc.core.qp.solution import Solution
from wbc.core.qp.task import Task
from wbc.robots import RobotDescription
from wbc.sim.plant.robot import SimulatedRobot
from wbc.tasks.behaviours import Program, StateMachine
from wbc.tasks.stabilizer.gains import StabilizerGains

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

GAINS = (
    ("stiffness", "1/s²", "acceleration per error; the damping stays critical unless it was set"),
    ("damping", "1/s", "acceleration per velocity error"),
)
"""Gains of a task: name, unit and hint."""

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
    Orders are carried out at ticks and kept in `interventions`; `repeat` carries them out again. Whoever reaches the
    page, on this machine, changes the run.

    Attributes:
        controls: Controls of the page, with the changes so far.
    """

    RATE = 20.0

    def __init__(
        self,
        source: SimulatedRobot | RobotDescription,
        control: Any = None,
        *,
        repeat: Iterable[dict[str, Any]] = (),
        **options: Any,
    ) -> None:
        """Start serving the page; see `View` for the other options and what is raised.

        Args:
            source: A plant or a `MujocoLoop`; or the description of a robot whose states are given to `update`.
            control: A walk, a control of drives or a `Controller`.
            repeat: Interventions of a former run, carried out again at their times, see `interventions_of`.
            **options: Program, terrain, port, rate and speed.
        """
        self._repeat = list(repeat)
        super().__init__(source, control, **options)

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
        self.controls = LiveControls(robot, self.walking, self._controller, repeat=self._repeat)
        for command in self._commands:
            command.remove()
        self._commands.clear()
        server.gui.reset()
        server.scene.reset()
        self._widgets = Widgets(server, self.controls.order)
        self._pace.restart()
        self._said: tuple[str, ...] = ()
        self._meanings: dict[str, Any] = {}
        self._rooms: dict[type, Any] = {}  # folders of all tasks and of all contacts
        self._made: list[tuple[Any, Any, list[Any]]] = []  # task or contact, its folder, what it shows live
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
        """Say on the page how the run has ended, and wait there: True for a restart, False when the page is left.

            while True:
                simulate(plant, control, view)
                if not view.ended("fallen"):
                    break
                plant.reset()  # and the control; or view.show(another_plant, another_control)

        Args:
            how: A few words.
        """
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
            self._widgets.button(name, lambda: {"do": "own", "name": name})

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
            self._widgets.slider(label, low, high, value, "", {"do": "own", "name": name})
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
            self._widgets.plot(lambda: True, {f"{name} ({unit})" if unit else name: function})

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
        self._widgets.gizmo(thing, self._gizmo_size, lambda: setting.value, order, lambda: True)
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

    def _send(self, picture: Picture) -> None:
        self._page.draw(picture)
        self._said = (f"**{picture.time:.2f} s**", *picture.text)
        self._meanings |= legend([picture])
        if self._widgets.show(picture.time):
            self._match()

    def _status(self) -> str:
        return "  \n".join([*self._said, *([self.controls.message] if self.controls.message else [])])

    def _pull(self, body: str, way: Array) -> None:
        force = DRAG_FORCE * self.stage.scale.weight * way
        self.controls.order({"do": "pull", "body": body, "force": force.tolist()})

    # ---- folders ----------------------------------------------------------------------------------------------------

    def _fill(self, program: Program | None) -> None:
        """Make all controls."""
        gui, offered = self._server.gui, self.controls.available()
        self._widgets.text(self._status)
        self._widgets.checkbox("pause", False, lambda on: setattr(self._pace, "paused", on))
        speed = next((name for name, value in SPEEDS.items() if value == self._pace.speed), "1")
        chosen = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=speed)
        when(chosen.on_update, lambda _: setattr(self._pace, "speed", SPEEDS[chosen.value]))
        self._widgets.checkbox("camera follows", True, lambda on: setattr(self._page, "follows", on))
        self._widgets.checkbox("see through the robot", False, self._page.see_through)
        with gui.add_folder("meaning of the colours", expand_by_default=False):
            self._widgets.text(lambda: legend_html(self._meanings), html=True)
        if program is not None:
            with gui.add_folder("program"):
                self._widgets.text(lambda: program_text(program))
        self._own_folder: Any = None
        if "drive" in offered:
            self._drive_folder(offered["drive"])
        if "stop" in offered and "drive" not in offered:
            self._widgets.button("stop walking", lambda: {"do": "stop"}, "the run ends when the robot stands")
        if "push" in offered:
            self._push_folder(offered["push"])
        if "gains" in offered:
            docs = attribute_docs(StabilizerGains)
            with gui.add_folder("stabilizer gains", expand_by_default=False):
                for gain in offered["gains"]:
                    name, unit, most = gain["name"], gain["unit"], gain["largest"]
                    label, order = f"{name} ({unit})" if unit else name, {"do": "gain", "name": name}
                    self._widgets.slider(label, 0.0, most, min(gain["value"], most), docs[name], order)
        if "stiffness" in offered:
            soles = offered["stiffness"]
            with gui.add_folder("soles", expand_by_default=False):
                low, value = soles["low"], soles["value"]
                high, hint = (
                    min(soles["high"], max(100.0, 2.0 * value)),
                    "each foot takes it in its next swing",
                )
                self._widgets.slider("stiffness (Nm/rad)", low, high, value, hint, {"do": "stiffness"})
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
                self._widgets.live.remove(show)
            folder.remove()
        for thing in present:
            if thing not in [made[0] for made in self._made]:
                before, task = len(self._widgets.live), isinstance(thing, Task)
                with self._rooms[Task if task else Contact]:
                    folder = self._task_folder(thing) if task else self._contact_folder(thing)
                self._made.append((thing, folder, self._widgets.live[before:]))

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
            self._commands.append(gui.add_command(label, hotkey=key))
            when(self._commands[-1].on_trigger, partial(step, index, sign))
        self._commands.append(gui.add_command("stand", hotkey="space"))
        when(self._commands[-1].on_trigger, halt)

    def _push_folder(self, push: dict[str, Any]) -> None:
        gui = self._server.gui
        with gui.add_folder("push", expand_by_default=False):
            side = gui.add_dropdown("direction", tuple(DIRECTIONS))
            size = gui.add_slider("impulse (Ns/kg)", 0.0, push["largest"], 0.01, push["impulse"])
            self._widgets.button(
                "push", lambda: {"do": "push", "direction": side.value, "impulse": size.value}
            )
            gui.add_markdown("Ctrl and the mouse pull at a link.")

    def _task_folder(self, task: Task) -> Any:
        gui, name, order = self._server.gui, task.name, {"do": "task", "task": task.name}
        with (folder := gui.add_folder(name, expand_by_default=False)):
            if task.hard:
                gui.add_markdown("hard: a constraint")
            else:
                weight = float(task.weight.max())
                self._widgets.checkbox("on", weight > 0.0, lambda on: self.controls.order(order | {"on": on}))
                power = math.log10(weight) if weight > 0.0 else 0.0
                self._widgets.slider(
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
                    self._widgets.slider(
                        f"{gain} ({unit})", 0.0, round_up(4.0 * value), value, about, order, gain
                    )
            if task.held_by is not None:
                gui.add_markdown(f"Target set at every tick: use {task.held_by}")
            elif _has_place(task):
                shown = gui.add_checkbox("gizmo on the target", False)
                self._task_gizmo(task, lambda: shown.value and self._there(task))
            plotted = gui.add_checkbox("plots", False)
            self._widgets.plot(
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
            self._widgets.plot(
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

        self._widgets.live.append(look)
        self._widgets.text(text)

    @property
    def _gizmo_size(self) -> float:
        return 0.25 * self.stage.scale.height

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

        self._widgets.gizmo(task.name, self._gizmo_size, place, order, asked, turns=turns, moves=moves)


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


def _has_place(task: Any) -> bool:
    """Return true for a task whose target is a point, a rotation or a pose."""
    target: Any = getattr(task, "target", None)
    return isinstance(target, pin.SE3) or np.shape(target) in ((3,), (3, 3))
