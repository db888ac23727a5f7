"""A trial: a robot in a simulation under its controller; orders, measurement, command, hooks, step and fall test.

    trial = WalkTrial(WalkSpec(robot="talos"))
    trial.scenario.append(Shove())      # a `TrialHook`: pushes, orders to the controller, whatever a trial is about
    result = trial.run()

A trial that is a sequence of stages advances by itself, and ends where a stage does not come to its end:

    with trial.running():
        trial.advance(2.0)
        trial.until(lambda: hand.reached, 10.0)
        trial.follow(walk_distance(FootstepPlan.standing(robot), 1.0))
        trial.stage = "done"

A new kind of trial says how long it goes on (`simulate`) and what its `result` is.
"""

from __future__ import annotations

import logging
import math
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError, MeasurementError, WbcError, check_parts
from wbc.core.drive.control import Control, DriveControl
from wbc.core.estimation.falls import FallReason
from wbc.core.signals import Command, Measurement
from wbc.sim.simulation.simulation import DivergedError, Simulation
from wbc.sim.trial.falls import TrueFallDetector
from wbc.sim.trial.spec import WallClock
from wbc.sim.trial.threads import one_thread
from wbc.walking.plans.footsteps import FootstepPlan

Look = Callable[[], None]
ControlT = TypeVar("ControlT", bound=Control)
ResultT = TypeVar("ResultT")

_log = logging.getLogger(__name__)

SETTING_OFF, LONGEST_STEP, MORE_STEPS = 1.0, 3.0, 4
"""Time in which a robot begins to walk along a plan, s; longest time of one of its steps, s, some three times that of a
slow free step; further steps that balance it, and bring feet to their places."""


class StageError(WbcError):
    """A stage of a trial has not come to its end: the robot has fallen, or the time of the stage is over."""


@dataclass(frozen=True, slots=True)
class TrialTick:
    """One tick of a trial: the measurement, and the command to the drives that follows from it."""

    plant: Simulation  # in the state that was measured; it moves on after the hooks
    control: Any  # with the references of this tick, or of the last one whose measurement was good
    measurement: Measurement
    command: Command


class TrialHook:
    """Hook of a trial, called in every tick: an observer, a recorder or a scenario.

    A hook of your own overrides the methods that it needs, and names in their annotations the kind of trial and of
    result that it is for.

    The result is the same with any hooks that only observe.
    """

    def start(self, trial: Any) -> None:
        """Act once, before the first tick."""

    def before(self, trial: Any) -> None:
        """Act in every tick before the measurement; orders to the controller belong here."""

    def tick(self, tick: TrialTick) -> None:
        """Act in every tick between the command and the step of the plant; pushes belong here."""

    def after(self, trial: Any) -> None:
        """Act in every tick after the step of the plant and the fall test."""

    def end(self, result: Any) -> None:
        """Act once after the last tick, with the result; None if the trial has none, or has raised an exception."""


class Trial(Generic[ControlT, ResultT]):
    """Trial of a kind of control, with a kind of result: a robot in the simulator and its controller, connected.

    Each trial runs once.

    Attributes:
        plant: The plant.
        control: The controller; of any kind, such as a `WalkingControl` or one that only stands.
        meters: Hooks that measure the figures of the result; they come first in every tick.
        hooks: Hooks that observe; their time is not part of the timings. Hooks in `scenario` act: they steer, push or
            give orders.
        stage: Name of the present stage, set by the code that advances the trial.
        fall: Reason of the fall; None while the robot has not fallen.
        diverged: Reason why the simulation has diverged; None while it has not.
        last: Time of the last tick of a trial that was ended by `stop`, s; None for other trials.
        tick_times: Wall time of each tick, from measurement to command, s.
        hook_time: Wall time in `hooks`, s.
        loop_time: Wall time of `run` without the time in `hooks`, s.
        falls: Test of the true state for a fall, at first that of a standing robot.
    """

    _started = False
    _made = math.nan  # clock before the model was built, s; set by trials that build one

    @checked
    def __init__(
        self,
        plant: Simulation | Any,
        control: ControlT,
        scenario: Sequence[TrialHook] = (),
    ) -> None:
        """Connect controller and plant, or a loop of your own with the parts of a `Simulation` that the trial uses."""
        check_parts("a loop", plant, "robot", "control_period", "measure", "step")
        check_parts("a control", control, "command", "check_period")
        control.check_period(plant.control_period)
        self.plant = plant
        self.control = control
        self.meters: list[TrialHook] = []
        self.hooks: list[TrialHook] = []
        self.scenario = list(scenario)
        self.stage = "start"
        self.fall: FallReason | None = None
        self.diverged: str | None = None
        self.last: float | None = None
        self._stopping = False
        self.tick_times = array("d")
        self.hook_time = self.loop_time = 0.0
        self.falls = TrueFallDetector(plant.robot)

    @property
    def drives(self) -> DriveControl:
        """Drives of the controller, with its observer."""
        drives = self.control.drives
        assert drives is not None
        return drives

    @property
    def fallen(self) -> bool:
        """True once the robot has fallen."""
        return self.fall is not None

    @property
    def stopped(self) -> bool:
        """True in the last tick of a trial that was ended by `stop`, and after this tick."""
        return self.last is not None

    @property
    def ground(self) -> float:
        """Height of the ground under the robot, for the fall test, m."""
        return 0.0

    def true_fall(self) -> FallReason | None:
        """Return why the robot has fallen, by the true state of the simulation; None if it has not fallen."""
        return self.falls.reason(self.plant.base_pose[3:], self.plant.com_height - self.ground)

    def find_fall(self) -> FallReason | None:
        """Return why the robot has fallen, by its controller or by the true state; None if it has not fallen."""
        return self.control.fallen or (None if self.plant.diverged else self.true_fall())

    def run(self, hooks: Sequence[TrialHook] = ()) -> ResultT:
        """Run a trial that has an end, with hooks that observe, and return its result; a trial can run only once.

        Raises:
            InputError: The trial has been run.
            DivergedError: The simulation has diverged, and this kind of trial has no result for this case.
            StageError: A stage took too long.
        """
        with self._stages(hooks):
            begin = time.perf_counter()
            try:
                self.simulate()
            finally:
                self.loop_time = time.perf_counter() - begin - self.hook_time
        with self._hooks_end_with_an_error():
            result = self.result()
        for hook in self.hooks:
            hook.end(result)
        return result

    def simulate(self) -> None:
        """Advance to the end; each kind of trial overrides it."""
        raise InputError("a trial of one's own has no end: `advance` or `until`, within `running`")

    def result(self) -> ResultT:
        """Return the result after the end; each kind of trial that has one overrides it."""
        return None  # type: ignore[return-value]

    def stop(self) -> None:
        """End the trial after its next tick; it can be called from a signal handler."""
        self._stopping = True

    def step(self) -> bool:
        """Advance by one control period; return False after a fall or a divergence, and in the last tick."""
        plant, control = self.plant, self.control
        for part in self.scenario:
            part.before(self)
        if self._stopping:
            self.last = plant.time
        try:
            measurement = plant.measure()
        except MeasurementError as error:
            self.diverged = str(error)
            return False
        clouds = plant.clouds()
        start = time.perf_counter()
        for cloud in clouds:
            control.see(cloud)
        command = control.command(measurement)
        self.tick_times.append(time.perf_counter() - start)
        tick = TrialTick(plant, control, measurement, command)
        for meter in self.meters:
            meter.tick(tick)
        if self.hooks:
            start = time.perf_counter()
            for hook in self.hooks:
                hook.tick(tick)
            self.hook_time += time.perf_counter() - start
        for part in self.scenario:
            part.tick(tick)
        plant.step(command)
        self.diverged = plant.diverged
        reason = self.find_fall()
        if reason is FallReason.DIVERGED and self.diverged is None:
            self.diverged = f"estimated speeds beyond any robot's before {plant.time:.4f} s"
        if self.diverged is None:
            self.fall = reason
        for part in (*self.meters, *self.scenario):
            part.after(self)
        if self.hooks:
            start = time.perf_counter()
            for hook in self.hooks:
                hook.after(self)
            self.hook_time += time.perf_counter() - start
        return self.fall is None and self.diverged is None and not self.stopped

    def advance(self, seconds: float, look: Look | None = None) -> None:
        """Simulate for a duration, s; `look` is called after each control period.

        Raises:
            StageError: The robot falls, or has fallen, or the trial is stopped.
            DivergedError: The simulation has diverged, so there is no result.
        """
        plant = self.plant
        end = plant.time + seconds - 0.5 * plant.control_period
        while not (self.fallen or self.stopped) and plant.time < end:
            if not self.step() and self.diverged is not None:
                raise DivergedError(f"the simulation cannot go on: {self.diverged}; reset it")
            if look is not None:
                look()
        if self.fall is not None:
            raise StageError(f"stage '{self.stage}' ended with a fall: {self.fall.value}")
        if self.stopped:
            raise StageError(f"stage '{self.stage}' was stopped")

    def until(self, what: Callable[[], bool], most: float, look: Look | None = None) -> None:
        """Simulate until a condition is True, which is checked every 0.1 s; raises the errors of `advance`, too.

        Raises:
            StageError: The condition is still False after the longest time, s.
        """
        begin = self.plant.time
        while not what():
            if self.plant.time - begin > most:
                raise StageError(f"stage '{self.stage}' was not over after {most:g} s")
            self.advance(0.1, look)

    def follow(self, plan: FootstepPlan, rest: float = 0.0, look: Look | None = None) -> None:
        """Walk from the present place along a plan to its end, and rest for a time, s; errors are as of `advance`.

        A push may leave the last foot beside its place: in free steps `control.source.missed` says how far, m.

        Raises:
            StageError: The robot does not reach the end of the plan, because a step is refused or takes too long.
        """
        control: Any = self.control
        control.follow(plan)
        self.advance(SETTING_OFF, look)
        self.until(lambda: bool(control.done), LONGEST_STEP * (len(plan) + MORE_STEPS), look)
        if control.source.reason:
            raise StageError(f"stage '{self.stage}' ended: {control.source.reason}")
        self.advance(rest, look)

    @contextmanager
    def running(self, hooks: Sequence[TrialHook] = ()) -> Iterator[None]:
        """Return a context that starts all hooks and ends them; a fall or `stop` during a stage ends its block.

        BLAS uses one thread in this context, because sums depend on the number of threads.

        Raises:
            InputError: The trial has been run.
            StageError: A stage was not over in its time, or a step was refused.
        """
        with self._stages(hooks):
            yield
        for hook in self.hooks:
            hook.end(None)

    @contextmanager
    def _stages(self, hooks: Sequence[TrialHook]) -> Iterator[None]:
        """Return a context as `running`, whose hooks end only where it raises."""
        self._check_new()
        with one_thread(), self._hooks_end_with_an_error():
            self.start(hooks)
            try:
                yield
            except StageError:
                if not (self.fallen or self.stopped):
                    raise

    def start(self, hooks: Sequence[TrialHook] = ()) -> None:
        """Add hooks and start all of them, for a trial that other code steps; otherwise use `running`."""
        self._check_new()
        self._started = True
        self.hooks += hooks
        for hook in (*self.meters, *self.hooks, *self.scenario):
            hook.start(self)

    def _check_new(self) -> None:
        if self._started:
            raise InputError("a trial runs once, and this one has been run: make another one")

    def clock(self, decision_us: dict[str, float] | None = None) -> WallClock:
        """Return the wall-clock timings so far."""
        times = 1e6 * np.array(self.tick_times) if self.tick_times else np.array([math.nan])
        return WallClock(
            wall_s=time.perf_counter() - self._made,
            real_time_factor=self.plant.time / self.loop_time if self.loop_time > 0.0 else math.inf,
            tick_us={"median": float(np.median(times)), "p99": float(np.percentile(times, 99))},
            decision_us=decision_us,
        )

    @contextmanager
    def _hooks_end_with_an_error(self) -> Iterator[None]:
        """Let hooks close their files and pages when the block raises."""
        try:
            yield
        except BaseException:
            for hook in self.hooks:
                try:
                    hook.end(None)
                except Exception:
                    _log.exception("a hook of a trial that has failed could not end")
            raise


AnyTrial = Trial[Any, Any]
"""Trial of any control with any result."""
