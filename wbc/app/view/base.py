"""Base of live views: the source of pictures and the pace of the run.

`update` takes a picture at most so many times a second. It reads the plant and never writes to it: a run gives the same
numbers with and without a view.
"""

from __future__ import annotations

import math
import socket
import sys
import time as clock
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import Field

from wbc.app.view.marks import Picture
from wbc.app.view.stage import ShownRun
from wbc.base.checked import checked
from wbc.base.errors import InputError, WbcError
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive
from wbc.robots import RobotDescription
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.trial.trial import TrialHook
from wbc.tasks.behaviours import Program

if TYPE_CHECKING:
    from wbc.app.view.controls import LiveControls
    from wbc.core.robot import Robot
    from wbc.core.signals import Measurement
    from wbc.sim.trial.trial import AnyTrial, TrialTick

LOCAL = "127.0.0.1"
"""Address of all pages: they are reached from this machine alone, from another one through `ssh -L`."""

HOSTS = (LOCAL, "localhost", "::1")
"""Names of this machine, as a browser has them in an address."""

Port = Annotated[int, Field(ge=0, le=65535)]
"""Port to listen at; 0 is any free one."""

FIRST_PORT, PORTS = 7000, 200
"""Ports that are tried when none is given."""

RATE = 20.0
"""Largest rate of pictures unless told otherwise, 1/s."""

TEXT_PERIOD = 0.2
"""Period of texts, s."""

CATCH_UP_TIME, MAX_STEP = 0.2, 1.0
"""A run that is further behind the clock does not catch up, nor one whose time has gone on by more, or back, s."""


CLOSED = "the live view has been closed; open another one"


class ViewError(WbcError):
    """A live view cannot be started."""


class PortError(ViewError, InputError):
    """A port is in use."""


class View(TrialHook, ABC):
    """A page in the browser, or a window, that shows a robot as it moves; as a hook it shows a trial.

        wbc.walk(hooks=[MeshcatView(speed=1.0)])

    The result of a trial is the same as without the view, unless a user of a workbench changes the run.

    Robot, feet, ground and things are those of the simulation's model. Marks: contact forces (an arrow as long as the
    centre of mass is high is the robot's weight) and pushes; centre of mass, ZMP, DCM and support polygon; of a walk
    also footsteps, planned and real, ZMP and DCM as planned, scans of range sensors. The camera follows the robot.
    Texts: time, state of a program, phase of a walk, state of the control, end of the run, and a legend of the marks.

    Attributes:
        run: Run that is shown: its stage, program and controls.
        frames: Number of pictures so far.
        url: Address of the page; empty for a window.
        closed: True after `close`.
        stays: True for a hook that does not close at the end of its trial, so that it can show another one.
        controls: Controls of the run, with the changes made so far; None for a view without controls.
    """

    run: ShownRun
    url: str = ""
    controls: LiveControls | None = None

    @checked
    def __init__(
        self,
        source: MujocoRobot | RobotDescription | None = None,
        control: Any = None,
        *,
        program: Program | None = None,
        port: Port | None = None,
        rate: Annotated[Positive, "1/s"] = RATE,
        speed: Positive | None = None,
        wait: Annotated[NonNegative, "s"] = 0.0,
    ) -> None:
        """Open the view; the address of a page goes to the standard error.

        Args:
            source: A plant or a `MujocoLoop`; or the description of a robot whose states are given to `update`. When
                None, the view opens with the trial whose hook it is.
            control: A walk, whose footsteps and references are shown, only with a simulation; a control of drives or a
                `Controller`, whose tasks a workbench shows; that of the program, or none, when None.
            program: Program whose state is shown.
            port: Port of the page; when None, the first free port from 7000 on.
            rate: Largest rate of pictures, 1/s.
            speed: Hold the run back to this multiple of real time, 1 for real time; None never waits.
            wait: Longest time that a trial waits for a page to be opened, s.

        Raises:
            PortError: The port is in use.
            ViewError: The view needs an extra or a screen that is not there.
        """
        self._period = 1.0 / rate
        self.speed = speed
        self._time = self._due = 0.0  # of the run at the last tick, and of the clock for that tick, s
        self._next, self.frames, self.closed = -math.inf, 0, False
        self._port, self._wait, self._opened, self.stays = port, wait, False, False
        if source is not None:
            self.show(source, control, program)

    def show(
        self, source: MujocoRobot | RobotDescription, control: Any = None, program: Program | None = None
    ) -> None:
        """Show a run, another one in the same view for example after `ended`."""
        if self.closed:
            raise ViewError(CLOSED)
        self.run = ShownRun(source, control, program)
        if opens := not self._opened:
            self._open(free_port(self._port))
            self._opened = True
        self._build()
        self._show()
        if opens and self.url:
            told = f"live view: {self.url} (of this machine alone; from another: ssh -L)"
            print(told, file=sys.stderr, flush=True)

    # ---- as a hook of a trial ---------------------------------------------------------------------------------------

    def start(self, trial: AnyTrial) -> None:
        """See `TrialHook`; of a simulation without a model of MuJoCo's the robot alone is shown."""
        if isinstance(plant := trial.plant, MujocoRobot):
            self.show(plant, trial.control)
        else:
            self.show(plant.description)
        self.wait_for_page(self._wait)

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        if isinstance(tick.plant, MujocoRobot):
            self.update()
        else:
            self.update(tick.plant.truth().q, measurement=tick.measurement)

    def end(self, result: object) -> None:
        """See `TrialHook`."""
        del result
        if not self.stays:
            self.close()

    # ---- what a kind of page does -----------------------------------------------------------------------------------

    @abstractmethod
    def _open(self, port: int) -> None:
        """Serve the page at a port and set its link, or check that a window can be opened."""

    @abstractmethod
    def _build(self) -> None:
        """Make everything that the page shows of the present stage."""

    @abstractmethod
    def _count(self) -> int:
        """Return the number of open pages or windows."""

    @abstractmethod
    def _send(self, picture: Picture) -> None:
        """Show a picture."""

    def _take_orders(self, time: float) -> None:  # noqa: B027 - a page may give none
        """Carry out what the page has ordered before a tick at a time (s), and wait while it holds the run."""

    @abstractmethod
    def _end(self) -> None:
        """End the page."""

    # ---- the run ----------------------------------------------------------------------------------------------------

    @property
    def speed(self) -> float | None:
        """Multiple of real time that the run is held back to; None never waits. It may be set at any time."""
        return self._speed

    @speed.setter
    @checked
    def speed(self, speed: Positive | None) -> None:
        self._speed = speed

    @property
    def pages(self) -> int:
        """Number of open pages or windows; 0 before the view shows a run, and after `close`."""
        return self._count() if self._opened and not self.closed else 0

    def update(self, state: Robot | Array | None = None, *, measurement: Measurement | None = None) -> None:
        """Show the present state, unless the last picture is too recent; wait for the pace.

        Args:
            state: Only of a described robot: the robot, up to date, or a configuration of shape (nq,).
            measurement: Only of a described robot: time and contact wrenches of the soles.

        Raises:
            ViewError: The view has been closed, or shows no run yet.
        """
        self._check()
        now = self.run.stage.take(state, measurement)
        self._take_orders(now)
        self._keep_pace(now)
        if (present := clock.perf_counter()) >= self._next:
            self._next = present + self._period
            self._show()

    def _keep_pace(self, time: float) -> None:
        """Wait until the clock has come as far as the run, at a time (s)."""
        step, self._time, present = time - self._time, time, clock.perf_counter()
        self._due += step / (self.speed or math.inf)
        if not 0.0 <= step <= MAX_STEP or present > self._due + CATCH_UP_TIME:
            self._due = present
        elif self.speed is not None:
            clock.sleep(max(0.0, self._due - present))

    def _show(self) -> None:
        """Show the present state, of a described robot that which was given last; nothing before one was."""
        if (picture := self.run.stage.picture()) is not None:
            self.frames += 1
            self.run.add_texts(picture)
            self._send(picture)

    def ended(self, how: str) -> bool:
        """Say on the page, from the next picture on, how the run has ended; True if the page asks for a restart."""
        self._check()
        self.run.ending = how
        return False

    @checked
    def wait_for_page(self, seconds: Annotated[NonNegative, "s"]) -> bool:
        """Wait, for some seconds at most, until a page is open; say so on the standard error. True if one is."""
        end = clock.perf_counter() + seconds
        if seconds > 0.0 and self.pages == 0:
            print(f"open it now: the run begins with it, or in {seconds:.0f} s", file=sys.stderr, flush=True)
        while self.pages == 0 and not self.closed and clock.perf_counter() < end:
            clock.sleep(0.02)
        return self.pages > 0

    def close(self) -> None:
        """Show the last state and end the view; the page keeps its picture."""
        opened, self.closed = self._opened and not self.closed, True
        if opened:
            try:
                self._show()
            finally:
                self._end()

    def _check(self) -> None:
        if self.closed:
            raise ViewError(CLOSED)
        if not self._opened:
            raise ViewError("the view shows no run yet: give it a plant, or use it as a hook of a trial")

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="480"></iframe>'

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def free_port(port: int | None) -> int:
    """Return a port of this machine, the first free one from `FIRST_PORT` on when None; `PortError` if it is in use."""
    for each in range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else (port,):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((LOCAL, each))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    where = f"port {port}" if port is not None else f"every port from {FIRST_PORT} on"
    raise PortError(f"{where} is in use; choose another one")
