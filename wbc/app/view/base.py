"""Base of live views: the source of pictures, the layers, the pace and the controls of a run.

`update` takes a snapshot at most so many times a second; all other calls return at once. It reads the plant and never
writes to it, so that a run gives the same numbers with and without a view, unless somebody uses the controls that
change a run (`wbc.app.view.controls`): these changes are in `View.interventions`.
"""

from __future__ import annotations

import math
import sys
import time as clock
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from wbc.app.address import Address, ViewError
from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.layers import make_layers
from wbc.app.scene.scene import Scene, Snapshot
from wbc.app.scene.shapes import HIDDEN
from wbc.app.scene.sources import PlantSource, RobotSource
from wbc.app.view.controls import LiveControls
from wbc.app.view.pace import Pace
from wbc.core.errors import Array, InputError, finite_scalar, positive
from wbc.core.html import html_frame, html_text
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.robots import RobotDescription
from wbc.sim.plant.plant import Plant
from wbc.sim.terrain.spec import Terrain
from wbc.tasks.behaviours import Program

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.sim import MujocoLoop
    from wbc.sim.plant.truth import GroundTruth
    from wbc.walking.control import ReferenceControl

PAUSE_TICK = 0.02
"""Period at which a paused run checks whether it may go on, s."""


class View(ABC):
    """A page in the browser that shows a robot as it moves.

    Robot and ground; soft soles as they are bent, in the colour of their stiffness; contact forces (an arrow as long as
    the centre of mass is high is the robot's weight) and pushes; centre of mass, ZMP, DCM and support polygon. Of a
    walk also footsteps, planned and real, ZMP and DCM as planned, scans of range sensors, and text: time, step, phase,
    stiffness, state of a program. The camera follows the robot if that is checked on the page. The page can pause a run
    and set its speed; a paused run goes on when the last page is closed.

    Attributes:
        scene: The scene.
        controls: Controls of the page, with the changes so far.
        walking: Controller of a walk; None for any other.
        frames: Number of pictures so far.
        url: Link to the page, with the token that its controls need.
        closed: True after `close`.
    """

    RATE: float
    """Largest rate of pictures unless told otherwise, 1/s."""

    url: str

    def __init__(
        self,
        source: Plant | MujocoLoop | RobotDescription,
        control: Any = None,
        *,
        program: Program | None = None,
        terrain: Terrain | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
        rate: float | None = None,
        speed: float | None = None,
        notebook: bool = False,
        repeat: Iterable[dict[str, Any]] = (),
    ) -> None:
        """Start serving the page; its address goes to the standard error.

        Args:
            source: A plant; another loop, of which the robot is shown; or the description of a robot whose states are
                given to `update`.
            control: A walk, whose footsteps and references are shown, only with a plant; a control of drives or a
                `Controller`, whose tasks a workbench shows; that of the program, or none, when None.
            program: Program whose state is shown.
            terrain: The ground under a described robot; flat when None. A plant has its own.
            host: Address to listen at. The default is reached from this machine alone; on a remote one use it with
                `ssh -L` from the same port, or "0.0.0.0" to let everybody in the network watch. The controls need the
                link that is printed.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.
            rate: Largest rate of pictures, 1/s; `RATE` when None.
            speed: Hold the run back to this multiple of real time, 1 for real time; None never waits. The page can
                change it.
            notebook: Let pages of this machine, such as a notebook, show the page in a frame.
            repeat: Interventions of a former run, carried out again at their times, see `interventions_of`.

        Raises:
            InputError: A value out of range, no host, something else than a control, a terrain given with a plant, or a
                walk without one.
            PortError: The port is in use.
            ViewError: A workbench without viser, or with one that cannot be guarded.
        """
        address = Address(host, port)
        self._program = program
        control = program.control if control is None and program is not None else control
        self._period = 1.0 / positive("rate of the view (1/s)", self.RATE if rate is None else rate)
        self._pace = Pace(None if speed is None else positive("speed of the view", speed))
        self._source: PlantSource | RobotSource
        self._plant: Plant | None = None
        self._layers: tuple[Layer, ...] = ()
        self._loop = None if isinstance(source, (RobotDescription, Plant)) else source
        self.walking: ReferenceControl | None = control if hasattr(control, "progress") else None
        controller = control if isinstance(control, Controller) else getattr(control, "controller", None)
        if control is not None and not isinstance(controller, Controller):
            raise InputError(f"a view shows a walk, a control or a Controller, got {control!r}")
        if self._loop is not None:
            if not callable(getattr(self._loop, "truth", None)):
                raise InputError(
                    "a view of a loop needs its truth(); give the description of the robot, and update(robot) its state"
                )
            source = self._loop.description
        if isinstance(source, RobotDescription):
            if self.walking is not None:
                raise InputError("a walk is shown with its plant; give the plant in place of the description")
            self._source = RobotSource(source, terrain)
        elif terrain is not None:
            raise InputError("a plant has its own terrain; leave `terrain` out")
        else:
            assert isinstance(source, Plant)
            self._plant, self._source = source, PlantSource(source)
            self._layers = make_layers(source, self._source.scene, self.walking)
        self.scene: Scene = self._source.scene.extended(
            [thing for layer in self._layers for thing in layer.objects],
            [path for layer in self._layers for path in layer.moving],
            tuple(entry for layer in self._layers for entry in layer.legend),
        )
        self.controls = LiveControls(self._plant, self.walking, controller, repeat=repeat)
        self._next, self._framed, self.frames, self.closed = -math.inf, notebook, 0, False
        self._simulated = 0.0  # time of the run, s
        self._measurement: Measurement | None = None
        self._open(address)
        print(f"live view: {self.url}", file=sys.stderr, flush=True)
        if self._plant is not None:
            self._draw(self._snapshot())
        elif self._loop is not None:
            truth = self._loop.truth()
            self._draw(self._snapshot(truth.q, truth))

    def _repr_html_(self) -> str:
        hint = f"live view: {self.url}\nIn a frame of this notebook it is shown with notebook=True."
        return html_frame(self.url) if self._framed else html_text(hint)

    # ---- what a kind of page does -----------------------------------------------------------------------------------

    @abstractmethod
    def _open(self, address: Address) -> None:
        """Serve the page, and set its link."""

    @property
    @abstractmethod
    def pages(self) -> int:
        """Number of open browser pages; 0 after `close`."""

    @property
    def drivers(self) -> int:
        """Number of open pages that may change the run."""
        return self.pages

    @abstractmethod
    def _send(self, time: float, matrices: Array, annotations: Annotations) -> None:
        """Show a picture."""

    @abstractmethod
    def _end(self) -> None:
        """End the page."""

    # ---- the run ----------------------------------------------------------------------------------------------------

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """Changes made from the page, each with its simulated time (s); empty if nobody changed the run."""
        return self.controls.interventions

    def update(
        self,
        state: Robot | Array | None = None,
        *,
        measurement: Measurement | None = None,
        truth: GroundTruth | None = None,
    ) -> None:
        """Show the present state, unless the last picture is too recent; wait while the page is paused.

        Args:
            state: Only without a plant: the robot, up to date, or a configuration of shape (nq,).
            measurement: The latest measurement: with a plant, to show the rays of range sensors; without one, for time
                and contact wrenches of the soles.
            truth: Only without a plant: true state of the robot, in place of `state` and `measurement`; a loop is asked
                for its own.

        Raises:
            InputError: A state given with a plant, none without, or one of another robot.
            ViewError: The view has been closed.
        """
        if self.closed:
            raise ViewError("the live view has been closed; open another one")
        if self._loop is not None and state is None and truth is None:
            truth = self._loop.truth()
        if self._plant is not None and not (state is None and truth is None):
            raise InputError("a view of a plant takes its state from the plant; call update() alone")
        if self._plant is None and state is None and truth is None:
            raise InputError("a view of a robot description needs a state: update(robot)")
        self._measurement = measurement
        read = truth or measurement
        state = state if truth is None else truth.q
        now = self._plant.time if self._plant is not None else None if read is None else read.time
        self._simulated = 0.0 if now is None else now
        self.controls.update(self._simulated)
        if self.controls.interventions and not self.drivers:
            self.controls.halt()  # nobody is left who may
        if self._pace.paused:
            self._wait_for_end_of_pause(lambda: self._draw(self._snapshot(state, read)))
        self._pace.wait(now)
        if (present := clock.perf_counter()) >= self._next:
            self._next = present + self._period
            self._draw(self._snapshot(state, read))

    def _snapshot(
        self, state: Robot | Array | None = None, read: GroundTruth | Measurement | None = None
    ) -> Snapshot:
        if isinstance(self._source, PlantSource):
            return self._source.snapshot()
        assert state is not None
        wrench, time = (None, 0.0) if read is None else (read.sole_wrench, read.time)
        return self._source.snapshot(state, wrench, time)

    def _draw(self, snapshot: Snapshot) -> None:
        self.frames += 1
        matrices = np.tile(HIDDEN, (len(self.scene.moving), 1, 1))
        robot = self.scene.frame(snapshot)
        place = len(robot)
        matrices[:place] = robot
        annotations = Annotations(target=tuple(snapshot.com.tolist()))
        for layer in self._layers:
            layer.measurement = self._measurement
            layer.fill(matrices[place : place + len(layer.moving)], annotations)
            place += len(layer.moving)
        if self._program is not None:
            annotations.text.insert(0, self._program.path)
        if self.controls.message:
            annotations.text.append(self.controls.message)
        self._send(snapshot.time, matrices, annotations)

    def _wait_for_end_of_pause(self, draw: Callable[[], None]) -> None:
        draw()
        while self._pace.paused and self.pages > 0:
            clock.sleep(PAUSE_TICK)
            before = self.controls.message
            self.controls.carry_out(self._simulated)
            if self.controls.message != before:
                draw()
        self._pace.paused = False
        self._pace.restart()

    def wait_for_page(self, seconds: float) -> bool:
        """Wait, for some seconds at most, until a page is open; say so on the standard error. True if one is."""
        end = clock.perf_counter() + finite_scalar("time to wait for a page (s)", seconds, low=0.0)
        if seconds > 0.0:
            print(f"open it now: the run begins with it, or in {seconds:.0f} s", file=sys.stderr, flush=True)
        while self.pages == 0 and not self.closed and clock.perf_counter() < end:
            clock.sleep(0.02)
        return self.pages > 0

    def close(self) -> None:
        """Show the last state of a plant and end the view; the page keeps its picture."""
        if self.closed:
            return
        if self._plant is not None:
            self._draw(self._snapshot())
        self.closed = True
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
