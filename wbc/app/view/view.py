"""Watch a robot live in a web browser.

    with MeshcatView(plant) as view:
        while plant.time < 10.0:
            plant.step(control.command(plant.measure()))
            view.update()

    walk(spec, hooks=[WatchWalk()])     # a simulated walk, with footsteps and all

SceneObject happens in a process of its own. `update` takes a snapshot at most 30 times a second and leaves it in shared
memory; all other calls return at once. It reads the plant and never writes to it, so that a run gives the same numbers
with and without a view, as long as nobody uses the page's controls that change a run (`wbc.app.view.controls`): what
they have done is in `MeshcatView.interventions`.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import pickle
import selectors
import subprocess
import sys
import time as clock
import urllib.request
import weakref
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

import wbc
from wbc.app.view.channel import Channel
from wbc.app.view.controls import LiveControls
from wbc.app.view.footsteps import FootstepsLayer
from wbc.app.view.layers import BalanceLayer, Layer, RangeLayer, SolesLayer
from wbc.app.view.scene import HIDDEN, Note, Scene, Setup
from wbc.app.view.source import PlantSource, RobotSource
from wbc.core.errors import Array, InputError, WbcError, finite_scalar, positive
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import RobotDescription
from wbc.sim.terrain import Terrain

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.sim import Plant
    from wbc.walking.control import WalkingControl

START_TIME = 60.0
"""Longest time for the drawing process to start, s; it takes about one."""

LAST_FRAME_TIME = 0.5
"""How long `close` waits for the last frame to be taken out, s."""

CATCH_UP_TIME = 0.2
"""A run that is further behind the clock than this does not hurry to catch up, s."""

PAUSE_TICK = 0.02
"""How often a run that is paused looks whether it may go on, s."""

LEAST_LOAD = 0.005
"""Contacts that bear less than this share of the robot's weight are no corners of the support polygon."""

_log = logging.getLogger(__name__)


class ViewError(WbcError):
    """The live view cannot be started."""


class PortError(ViewError, InputError):
    """The address or port to serve a page at cannot be had; the message names another way."""


class MeshcatView:
    """A page in the browser that shows a robot as it moves.

    Robot and ground; soft soles as they are bent, in the colour of their stiffness; contact forces (an arrow as long as
    the centre of mass is high is the robot's weight) and pushes; centre of mass, ZMP, DCM and support polygon. Of a
    walk also footsteps, planned and real, ZMP and DCM as planned, what range sensors see, and words: time, step, phase,
    stiffness. The camera follows if the page is told so.

    The page can pause a run and set its speed; and, unless `controls` are off, push the robot, stop a walk and change
    gains and stiffness (see `wbc.app.view.controls`, also for what cannot be changed live). A run that is paused goes
    on when the last page is closed.

    The view ends when it is closed or when the program ends; the page then keeps its last picture, and a later view on
    the same port goes on in the same page.

    Attributes:
        url: Address of the page.
        scene: What is drawn.
        pid: Identifier of the process that draws.
        controls: What the page can change, and has changed.
    """

    def __init__(
        self,
        source: Plant | RobotDescription,
        *,
        walking: WalkingControl | None = None,
        terrain: Terrain | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
        rate: float = 30.0,
        speed: float | None = None,
        controls: bool = True,
    ) -> None:
        """Start serving the page; its address goes to the standard error.

        Args:
            source: A plant, or the description of a robot whose states are given to `update`.
            walking: Controller of a walk, to show its footsteps and references; only with a plant.
            terrain: The ground under a described robot; flat when None. A plant has its own.
            host: Address to listen at. The default is reached from this machine alone; on a remote one use it with
                `ssh -L`, or "0.0.0.0" to let everybody in the network watch, and use the controls.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.
            rate: Most pictures a second.
            speed: Hold the run back to this multiple of real time, 1 for real time; None never waits. The page can
                change it.
            controls: Let the page change the run; pause and speed are always there.

        Raises:
            InputError: A value out of range, a terrain given with a plant, or a walk without one.
            PortError: The port cannot be had; nothing is left running.
            ViewError: The process does not start; nothing is left running.
        """
        self._period = 1.0 / positive("rate of the view (1/s)", rate)
        self._speed = None if speed is None else positive("speed of the view", speed)
        if port is not None:
            finite_scalar("port of the view", port, low=0, high=65535)
        self._plant: PlantSource | None = None
        self._model: RobotSource | None = None
        if isinstance(source, RobotDescription):
            if walking is not None:
                raise InputError("a walk is shown with its plant; give the plant in place of the description")
            self._model = RobotSource(source, terrain)
        elif terrain is not None:
            raise InputError("a plant has its own terrain; leave `terrain` out")
        else:
            self._plant = PlantSource(source)
        plant = None if self._plant is None else self._plant.plant
        self._layers = () if plant is None else make_layers(plant, self._source.scene, walking)
        self.scene: Scene = self._source.scene.extended(
            [drawing for layer in self._layers for drawing in layer.drawings],
            [path for layer in self._layers for path in layer.moving],
            [entry for layer in self._layers for entry in layer.legend],
        )
        self.controls = LiveControls(plant if controls else None, walking)
        self._measurement: Measurement | None = None
        self._channel = Channel(len(self.scene.moving))
        setup = Setup(self.scene, host, port, rate, self._channel.fd, speed, self.controls.offer())
        self._process, port = self._start(setup)
        self.pid = self._process.pid
        self._finalizer = weakref.finalize(self, _stop, self._process, self._channel)
        self._local = f"http://127.0.0.1:{port}/" if host == "0.0.0.0" else f"http://{host}:{port}/"
        self.url = self._local.replace("127.0.0.1", os.uname().nodename) if host == "0.0.0.0" else self._local
        self._next = -math.inf
        self._begin: tuple[float, float] | None = (
            None  # clock and simulated time from which the pace is counted
        )
        self._warned = False
        self._wishes = self._orders = 0  # numbers of the last ones that are known
        self._paused = False
        print(f"live view: {self.url}", file=sys.stderr, flush=True)
        if self._plant is not None:
            self.update()

    @property
    def _source(self) -> PlantSource | RobotSource:
        source = self._plant or self._model
        assert source is not None
        return source

    def _start(self, setup: Setup) -> tuple[subprocess.Popen[bytes], int]:
        """Start the drawing process and wait until it listens; returns it and its port."""
        paths = [str(Path(wbc.__file__).parent.parent), os.environ.get("PYTHONPATH", "")]
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "wbc.app.view.server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[self._channel.fd],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)},
        )
        assert process.stdin is not None and process.stdout is not None
        try:
            pickle.dump(setup, process.stdin)
            process.stdin.flush()
            with selectors.DefaultSelector() as selector:
                selector.register(process.stdout, selectors.EVENT_READ)
                answer = process.stdout.readline() if selector.select(START_TIME) else b""
        except BrokenPipeError:
            answer = b""
        if not answer:
            _stop(process, self._channel)
            raise ViewError("the live view cannot be served: its process ended at once or does not answer")
        facts = json.loads(answer)
        if "error" in facts:
            _stop(process, self._channel)
            where = setup.host if setup.port is None else f"{setup.host}:{setup.port}"
            hint = "; choose another port, or leave it out to take a free one" if setup.port else ""
            raise PortError(f"the live view cannot be served at {where}: {facts['error']}{hint}")
        return process, int(facts["port"])

    def update(
        self,
        state: Robot | Array | None = None,
        *,
        sole_wrench: Array | None = None,
        time: float | None = None,
        measurement: Measurement | None = None,
    ) -> None:
        """Show the present state, unless the last picture is too recent; wait while the page says pause.

        Args:
            state: Only without a plant: the robot, up to date, or a configuration of shape (nq,).
            sole_wrench: Only without a plant: what the ground does to each sole, [force; moment] in the sole frame,
                shape (number of soles, 6), N and Nm.
            time: Only without a plant: s.
            measurement: Only with a plant: what its sensors have just said, to show the rays of range sensors.

        Raises:
            InputError: A state given with a plant, none without, or one of another robot.
        """
        if (state is None) is not (self._plant is not None) or (
            self._plant is not None and (sole_wrench is not None or time is not None)
        ):
            self._refuse()
        self._measurement = measurement
        self._listen()
        if self._paused:
            self._show(state, sole_wrench, time)
            self._wait_for_end_of_pause()
        now = clock.perf_counter()
        if self._speed is not None:
            self._keep_pace(now, time)
        if now >= self._next:
            self._next = now + self._period
            self._show(state, sole_wrench, time)

    def _refuse(self) -> NoReturn:
        if self._plant is not None:
            raise InputError("a view of a plant takes its state from the plant; call update() alone")
        raise InputError("a view of a robot description needs a state: update(robot)")

    def _listen(self) -> None:
        """Do what the pages wish for."""
        newer = self._channel.wishes(self._wishes)
        if newer is None:
            return
        self._wishes, text = newer
        said = json.loads(text)
        self._paused = said["paused"]
        if said["speed"] != self._speed:
            self._speed, self._begin = said["speed"], None
        for number, order in said["orders"]:
            if number > self._orders:
                self._orders = number
                self.controls.obey(order)

    def _wait_for_end_of_pause(self) -> None:
        while self._paused and self.pages > 0 and self._process.poll() is None:
            clock.sleep(PAUSE_TICK)
            self._listen()
        self._paused, self._begin = False, None

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """What was changed from the page, each with its simulated time (s); empty if nobody changed the run."""
        return self.controls.interventions

    def _show(self, state: Robot | Array | None, sole_wrench: Array | None, time: float | None) -> None:
        if self._plant is not None:
            snapshot = self._plant.snapshot()
        else:
            assert self._model is not None and state is not None
            snapshot = self._model.snapshot(state, sole_wrench, 0.0 if time is None else time)
        matrices = np.tile(HIDDEN, (len(self.scene.moving), 1, 1))
        own = self.scene.frame(snapshot)
        matrices[: len(own)] = own
        place, note = len(own), Note(target=tuple(snapshot.com.tolist()))
        for layer in self._layers:
            if isinstance(layer, RangeLayer):
                layer.measurement = self._measurement
            layer.fill(matrices[place : place + len(layer.moving)], note)
            place += len(layer.moving)
        if self.controls.message:
            note.text.append(self.controls.message)
        self._channel.write(snapshot.time, matrices, note.pack())
        if not self._warned and self._process.poll() is not None:
            self._warned = True
            _log.warning("the live view has ended (exit code %s); the run goes on", self._process.returncode)

    def _keep_pace(self, now: float, time: float | None) -> None:
        """Wait until the clock has come as far as the run."""
        assert self._speed is not None
        simulated = self._plant.plant.time if self._plant is not None else time
        if simulated is None:
            return
        if self._begin is None:
            self._begin = (now, simulated)
        ahead = self._begin[0] + (simulated - self._begin[1]) / self._speed - now
        if (
            ahead < -CATCH_UP_TIME or ahead > 1.0
        ):  # too slow, or the plant has been reset or has gone far ahead
            self._begin = (now, simulated)
        elif ahead > 0.0:
            clock.sleep(ahead)

    @property
    def pages(self) -> int:
        """Number of browser pages that are open."""
        return self._channel.pages

    @property
    def frames(self) -> int:
        """Number of pictures taken so far."""
        return self._channel.newest

    def wait(self, seconds: float) -> bool:
        """Wait until a page is open.

        Args:
            seconds: How long at most, s.

        Returns:
            True if one is open.
        """
        end = clock.perf_counter() + finite_scalar("time to wait for a page (s)", seconds, low=0.0)
        while self.pages == 0 and self._process.poll() is None and clock.perf_counter() < end:
            clock.sleep(0.02)
        return self.pages > 0

    def html(self) -> str:
        """Return the present picture as one page that holds everything in itself and opens without network.

        Raises:
            ViewError: The view has ended.
        """
        if not self._finalizer.alive or self._process.poll() is not None:
            raise ViewError("the live view has ended")
        with urllib.request.urlopen(self._local + "scene.html", timeout=30.0) as answer:
            return str(answer.read().decode("utf-8"))

    def close(self) -> None:
        """Show the last state of a plant, and end the view; the page keeps its picture."""
        if not self._finalizer.alive:
            return
        if self._plant is not None and self._process.poll() is None:
            self._show(None, None, None)
        end = clock.perf_counter() + LAST_FRAME_TIME
        while self._channel.shown < self._channel.newest and clock.perf_counter() < end:
            if self._process.poll() is not None:
                break
            clock.sleep(0.01)
        self._finalizer()

    def __enter__(self) -> MeshcatView:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_layers(plant: Plant, scene: Scene, walking: WalkingControl | None = None) -> tuple[Layer, ...]:
    """All that is shown beside a robot and can be.

    Args:
        plant: The plant.
        scene: The robot on its ground.
        walking: The controller, if it is a walk.
    """
    layers: list[Layer] = [] if walking is None else [FootstepsLayer(plant, walking)]
    layers.append(BalanceLayer(plant, scene.size, LEAST_LOAD * plant.robot.mass * GRAVITY, walking))
    if all(foot.variable_joints for foot in plant.feet):
        layers.append(SolesLayer(plant, walking))
    layers.append(RangeLayer(plant, walking))
    return tuple(layers)


def _stop(process: subprocess.Popen[bytes], channel: Channel) -> None:
    """End the drawing process: it goes when its input ends."""
    assert process.stdin is not None and process.stdout is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.close()
    try:
        process.wait(2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
    channel.close()
