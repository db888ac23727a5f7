"""Recorder of runs: called once a tick, it writes measurement, command, estimate, references and ground truth.

It only reads the objects of a run, so that a run gives the same numbers with and without it.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.app.log.header import make_header
from wbc.app.log.signals import XY, XYZ, Read, Signal, Signals, Tick
from wbc.app.log.sources import tick_signals
from wbc.app.log.writer import LogWriter
from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.files import FileError
from wbc.base.numbers import Array
from wbc.base.settings import to_json
from wbc.core.drive.control import Control
from wbc.core.estimation.checks.stamps import stamp_of
from wbc.core.qp.solving.solution import Solution
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.sim.plant.plant import Plant
from wbc.sim.simulation.simulation import GroundTruth
from wbc.sim.studies.provenance import provenance
from wbc.sim.trial.trial import TrialHook

if TYPE_CHECKING:
    from wbc.sim.simulation.simulation import Simulation
    from wbc.sim.trial.trial import TrialTick
    from wbc.sim.walks.result import WalkResult


class Recorder(TrialHook):
    """Recorder of a log, tick by tick, in a `with` block or as a hook: `walk(spec, hooks=[recorder])`.

    Attributes:
        path: The file.
    """

    @checked
    def __init__(self, path: str | Path, *, spec: Any = None, title: str = "") -> None:
        """Open the file.

        Args:
            path: The file, usually with the ending .arrow. An existing log is replaced after the first 256 ticks, or at
                the end of a shorter run.
            spec: Specification of the run, stored in the header: a dataclass, or plain values.
            title: Title of the log; the robot's name when empty.
        """
        self._writer = LogWriter(path)
        provenance()  # asks git once, before the run
        self.path = self._writer.path
        self._spec, self._title = _plain(spec), title
        self._added: list[tuple[Signal, Callable[..., Any]]] = []
        self._signals: Signals | None = None
        self._first: Tick
        self._time = -math.inf  # of the measurement of the last tick, s
        self._model: Robot | None = None  # of a controller of one's own

    @checked
    def add(self, name: str, value: Callable[[Tick], Any], unit: str = "1", about: str = "") -> None:
        """Add a signal, before the first tick is recorded.

        Args:
            name: Parts separated by "/".
            value: Function that is called in every tick with the `Tick` (plant, control, measurement, command). It
                returns a number, a bool, a text, or an array of constant length whose parts are named x, y, z or by
                their indices.
            unit: Unit of the signal; "1" for a signal without a unit.
            about: Description.
        """
        if self._signals is not None:
            raise InputError(f"signal '{name}' comes too late: add it before the first tick is recorded")
        if not all(part.strip() for part in name.split("/")) or "\n" in name:
            raise InputError(f"a signal's name is made of parts separated by '/', got {name!r}")
        if any(name == signal.name for signal, _ in self._added):
            raise InputError(f"there is a signal '{name}' already; choose another name")
        self._added.append((Signal(name, unit, about), value))

    def __call__(
        self, plant: Simulation | None, control: Control, measurement: Measurement, command: Command
    ) -> None:
        """Record one tick, after the command has been computed and before the plant takes it.

        Args:
            plant: The plant or loop, for ground truth and for the robot that a replay shows; None without one: `write`
                takes a description.
            control: A control with drives; of a guard of a policy, that of who controls the robot in this tick is
                recorded.
            measurement: Input of the control.
            command: Output of the control.
        """
        if not isinstance(control, Control) or (drives := control.drives) is None:
            raise InputError(
                "a control without drives, or a Controller alone, is recorded by write(…); the program of a Controller "
                "by add(…, lambda: program.path)"
            )
        told = None if isinstance(plant, Plant) else getattr(plant, "truth", None)  # one's own may have none
        truth = None if told is None else told()
        about = None if plant is None else plant.description
        state = drives.observer.robot
        self._record(Tick(plant, control, measurement, command, about, drives.solution, truth, state))

    @checked
    def write(
        self,
        description: RobotDescription,
        measurement: Measurement,
        command: Command,
        solution: Solution | None = None,
        *,
        truth: GroundTruth | None = None,
        estimate: Robot | None = None,
    ) -> None:
        """Record one tick of any loop with any controller.

        The log has columns for those optional values that the first tick has.

        Args:
            description: The robot.
            measurement: Input of the controller.
            command: Output of the controller.
            solution: Solution of the QP.
            truth: True state, from a simulator.
            estimate: Estimated robot in this tick.
        """
        if self._model is None:
            self._model = description.robot()
        robots = description, self._model if estimate is None else estimate
        of_other = solution is not None and len(solution.accelerations) != self._model.nv
        if of_other or any(robot.joint_names != self._model.joint_names for robot in robots):
            raise InputError(
                f"{self.path} is the log of '{self._model.name}'; make another Recorder for others"
            )
        self._record(
            Tick(None, None, measurement, command, description, solution, truth, estimate, self._model)
        )

    def _record(self, tick: Tick) -> None:
        self._check_open()
        for what, kind in (("measurement", Measurement), ("command", Command)):
            if not isinstance(value := getattr(tick, what), kind):
                raise InputError(f"{what} of a tick must be a {kind.__name__}, got {shown(value)}")
        if self._signals is None:
            self._signals, self._first = self._begin(tick), tick
        elif tick.plant is not self._first.plant or tick.program is not self._first.program:
            raise InputError(
                f"{self.path} is the log of one plant and program; make another Recorder for others"
            )
        time = stamp_of(tick.measurement.time)
        if not self._time <= time < math.inf:  # nobody could read what follows
            raise InputError(
                f"{self.path} is the log of one run up to {self._time:g} s, got a measurement at {time:g} s; make "
                "another Recorder after a reset"
            )
        self._time = time
        self._writer.commit(self._signals.read(tick, self._writer.row))

    def _check_open(self) -> None:
        if self._writer.ended:
            raise InputError(f"the recording {self.path} has ended; make another Recorder")

    def start(self, trial: Any) -> None:
        """Take the specification of a trial that has one; see `TrialHook`."""
        self._check_open()
        if (spec := getattr(trial, "spec", None)) is not None:
            self._spec = self._spec or _plain(spec)

    def tick(self, tick: TrialTick) -> None:
        """Record one tick; see `TrialHook`."""
        self(tick.plant, tick.control, tick.measurement, tick.command)

    def end(self, result: WalkResult) -> None:
        """End the file; see `TrialHook`."""
        self.close()

    def _begin(self, tick: Tick) -> Signals:
        signals = tick_signals(tick)
        for signal, function in self._added:
            _add_own(signals, signal, function, function(tick))
        self._writer.begin(signals, make_header(tick, self._spec, self._title))
        return signals

    def close(self) -> None:
        """Write the last batch and end the file."""
        self._writer.close()

    @property
    def loss(self) -> FileError | None:
        """Error that says how much was written, where, and why the rest is missing; None if nothing was lost."""
        return self._writer.loss

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _add_own(signals: Signals, signal: Signal, function: Read, first: Any) -> None:
    """Describe a signal of `Recorder.add`; its first value decides its kind and shape.

    Its numbers keep double precision: a stamp in seconds since 1970 would be 64 s off in single precision.
    """
    name, waiting = signal.name, [first]
    text, flag = isinstance(first, str), isinstance(first, (bool, np.bool_))

    def numbers(value: Any) -> Array:
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            array = np.array(value, dtype=np.float64)
            if not flag or isinstance(value, (bool, np.bool_)):
                return array
        raise InputError(f"signal '{name}' began with {shown(first)} and cannot keep {shown(value)}")

    shape = () if text else numbers(first).shape

    def read(tick: Tick) -> Any:
        value = waiting.pop() if waiting else function(tick)
        if value is None:
            return None
        if text:
            return str(value)
        array = numbers(value)
        if array.shape != shape:
            raise InputError(f"signal '{name}' has changed from shape {shape} to {array.shape}")
        return array

    if len(shape) > 1 or 0 in shape:
        raise InputError(f"signal '{name}' must be a number or an array of one dimension, got shape {shape}")
    if not shape:
        signals.one(name, signal.unit, signal.about, read, "text" if text else "flag" if flag else "double")
        return
    parts = {2: XY, 3: XYZ}.get(shape[0]) or tuple(map(str, range(shape[0])))
    signals.group(name, parts, signal.unit, signal.about, read, "double")


def _plain(spec: Any) -> Any:
    """Return a specification as plain values, which no change of it reaches."""
    try:
        return spec.to_json() if hasattr(spec, "to_json") else to_json(spec)
    except TypeError as error:
        raise InputError(f"the spec of a recording cannot be kept: {error}") from error
