"""Faults of sensors, clock, shapes, masses and tasks, injected into the loop of a robot that stands or walks."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from wbc.base.errors import MeasurementError
from wbc.base.numbers import Array
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import HybridControl, TorqueControl
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.signals import Command, Measurement
from wbc.sim import Plant, WalkPlan, WalkSpec, WalkTrial
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.trial.falls import TrueFallDetector
from wbc.tasks import CoMTask

Fault = Callable[[Measurement, "Memory"], Any]
"""Makes a faulty measurement out of a good one; None for a dropped tick."""

Control = PositionControl | TorqueControl | HybridControl


@dataclass
class Memory:
    """State of a fault while it lasts: the measurements before it, and its random generator."""

    before: list[Measurement]
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))


def _changed(name: str, change: Callable[[Array], Array]) -> Fault:
    return lambda m, _: replace(m, **{name: change(np.array(getattr(m, name)))})


def _element(name: str, index: Any, value: Callable[[float], float]) -> Fault:
    def change(array: Array) -> Array:
        array[index] = value(array[index])
        return array

    return _changed(name, change)


def _stuck(name: str, index: Any = ...) -> Fault:
    def fault(m: Measurement, memory: Memory) -> Measurement:
        array = np.array(getattr(m, name))
        array[index] = getattr(memory.before[-1], name)[index]
        return replace(m, **{name: array})

    return fault


def _delayed(ticks: int) -> Fault:
    def fault(m: Measurement, memory: Memory) -> Measurement:
        memory.before.append(m)
        return memory.before[-1 - ticks]

    return fault


def _dropped(share: float) -> Fault:
    return lambda m, memory: None if memory.random.random() < share else m


SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench")
INDEX: dict[str, Any] = {"joint_position": 3, "joint_velocity": 3, "sole_wrench": (0, 2)}


def faults() -> dict[str, tuple[Fault, bool]]:
    """Return all faults by name, each with True if it can be noticed by the measurements alone when it lasts."""
    found: dict[str, tuple[Fault, bool]] = {}
    for name in SIGNALS:
        i = INDEX.get(name, 0)
        for text, value in (
            ("nan", math.nan),
            ("inf", math.inf),
            ("1e200", 1e200),
            ("1e9", 1e9),
            ("1e3", 1e3),
        ):
            noticed = not (name == "sole_wrench" and text == "1e3")
            found[f"{name} {text}"] = (_element(name, i, lambda _, v=value: v), noticed)
        found[f"{name} -1e6"] = (_element(name, i, lambda _: -1e6), True)
        found[f"{name} all zero"] = (_changed(name, np.zeros_like), name != "joint_velocity")
        found[f"{name} all frozen"] = (_stuck(name), True)
        found[f"{name} one frozen"] = (_stuck(name, i), True)
        found[f"{name} opposite sign"] = (_changed(name, np.negative), False)
    found["encoder lost a turn"] = (_element("joint_position", 3, lambda x: x + 2.0 * math.pi), True)
    found["encoder off by 0.1 rad"] = (_element("joint_position", 3, lambda x: x + 0.1), False)
    found["encoder off by 0.3 rad"] = (_element("joint_position", 3, lambda x: x + 0.3), False)
    for factor in (180.0 / math.pi, 1000.0):
        found[f"velocities times {factor:.0f}"] = (
            _changed("joint_velocity", lambda v, f=factor: f * v),
            False,
        )
    found["velocities twice as large"] = (_changed("joint_velocity", lambda v: 2.0 * v), False)
    found["gyroscope off by 0.1 rad/s"] = (_element("angular_velocity", 0, lambda x: x + 0.1), True)
    found["accelerometer off by 1 m/s²"] = (_element("specific_force", 0, lambda x: x + 1.0), False)
    found["gyroscope saturated"] = (_changed("angular_velocity", lambda w: np.full(3, 34.9)), True)
    found["left force sensor dead"] = (_element("sole_wrench", 0, lambda _: 0.0), True)
    found["right force sensor dead"] = (_element("sole_wrench", 1, lambda _: 0.0), True)
    found["force sensors swapped"] = (_changed("sole_wrench", lambda w: w[::-1].copy()), False)
    found["force sensor off by 100 N"] = (_element("sole_wrench", (0, 2), lambda f: f + 100.0), False)
    for step in (0.2, 1000.0, -1.0, -1e9):
        found[f"clock {step:+g} s"] = (lambda m, _, step=step: replace(m, time=m.time + step), True)
    for text, time in (("nan", math.nan), ("inf", math.inf), ("1e300", 1e300), ("0", 0.0)):
        found[f"clock at {text}"] = (lambda m, _, time=time: replace(m, time=time), True)
    found["clock as text"] = (lambda m, _: replace(m, time="now"), True)
    found["same measurement again"] = (lambda m, memory: memory.before[-1], True)
    found["same signals, clock runs"] = (lambda m, memory: replace(memory.before[-1], time=m.time), True)
    found["measurement None"] = (lambda m, _: None.__class__, True)
    found["measurement a text"] = (lambda m, _: "measurement", True)
    for name in SIGNALS:
        found[f"{name} None"] = (lambda m, _, name=name: replace(m, **{name: None}), True)
        found[f"{name} too short"] = (_changed(name, lambda a: a[:-1]), True)
    found["joint_position a list"] = (
        lambda m, _: replace(m, joint_position=m.joint_position.tolist()),
        False,
    )
    found["joint_position in float32"] = (_changed("joint_position", lambda q: q.astype(np.float32)), False)
    for name in SIGNALS:
        found[f"{name} of objects"] = (_changed(name, lambda a: a.astype(object)), True)
        found[f"{name} masked"] = (_changed(name, lambda a: np.ma.masked_array(a, mask=True)), True)
    found["joint_position as texts"] = (_changed("joint_position", lambda q: q.astype(str)), True)
    found["sole_wrench transposed"] = (_changed("sole_wrench", lambda w: w.T.copy()), True)
    for ticks in range(1, 6):
        found[f"delay of {ticks} ticks"] = (_delayed(ticks), False)
    for share in (0.1, 0.3, 0.5):
        found[f"{share:.0%} of ticks dropped"] = (_dropped(share), False)
    return found


def _heavier(factor: float) -> Callable[[Plant, Control], None]:
    def change(plant: Plant, control: Control) -> None:
        plant.model.body_mass *= factor
        plant.model.body_inertia *= factor
        mujoco.mj_setConst(plant.model, mujoco.MjData(plant.model))

    return change


def _contradicting_tasks(plant: Plant, control: Control) -> None:
    for name, height in (("up", 0.1), ("down", -0.1)):
        target = control.controller.robot.com + (0.0, 0.0, height)
        control.controller.add(CoMTask(name=name, target=target, stiffness=100.0, hard=True))


def _contradicting_limits(plant: Plant, control: Control) -> None:
    """The torques cannot hold the robot, the accelerations of its joints must not let it sink."""
    controller = control.controller
    controller.remove(*[x for x in controller.limits if isinstance(x, (JointLimits, TorqueLimits))])
    controller.add(JointLimits(acceleration=0.5), TorqueLimits(ratio=0.01))


def _far_target(plant: Plant, control: Control) -> None:
    far = control.controller.robot.com + (10.0, 0.0, 0.0)
    control.controller.add(CoMTask(name="far", target=far, stiffness=100.0, weight=1e4))


CHANGES: dict[str, tuple[Callable[[Plant, Control], None], bool]] = {
    "masses +30 %": (_heavier(1.3), False),
    "masses -30 %": (_heavier(0.7), False),
    "hard tasks that contradict each other": (_contradicting_tasks, True),
    "limits that contradict each other": (_contradicting_limits, True),
    "target 10 m away": (_far_target, False),
}
"""Faults of the robot and of what is asked of it, each with True if the status names it; they last."""


@dataclass
class Report:
    """Outcome of a run with a fault.

    Attributes:
        raised: Text of the first exception out of `command`, None if none came.
        wild: Description of the first command beyond a limit, None if there was none.
        named: Time from the first fault to the first tick whose status says that something is refused, doubtful,
            relaxed, failing or stopped, s; infinite if none did.
        stopped: True if the control had stopped the robot at the end.
        upright: True if the robot had not fallen at the end.
        status: That status.
        last: Name of the last fault that was injected.
    """

    raised: str | None = None
    wild: str | None = None
    named: float = math.inf
    stopped: bool = False
    upright: bool = True
    status: str = ""
    last: str = ""


class Injector:
    """Feeds a control with a lasting fault, or with faults of one tick one after the other; looks at its commands."""

    def __init__(
        self, robot: Any, given: dict[str, Fault], start: float, every: float | None, dt: float
    ) -> None:
        self.robot, self.start, self.every = robot, start, every
        self.report = Report()
        self._to_come = list(given.items())
        self._next = start
        self._fault: Fault | None = None
        self._memory = Memory([])
        self._last: Array | None = None
        self._command: Command | None = None
        limit = robot.torque_limit
        self._torque = np.where(np.isfinite(limit), limit, 1e6) * (1.0 + 1e-9)
        self._step = np.minimum(2.0 * robot.velocity_limit, 1e6) * dt + 1e-9

    @property
    def all_came(self) -> bool:
        """True once every fault has been injected."""
        return not self._to_come

    def command(
        self, measurement: Measurement, command: Callable[[Measurement], Command], status: Any
    ) -> Any:
        """Return the command for a tick; the last one where the tick is dropped."""
        now = measurement.time
        given: Any = measurement
        if self.every is not None:
            self._fault = None
        if now >= self._next and self._to_come:
            self.report.last, self._fault = self._to_come.pop(0)
            self._next += self.every or 0.0
        if self._fault is not None:
            given = self._fault(measurement, self._memory)
            if given is None and self._command is not None:
                return self._command
            if given is type(None):
                given = None
        else:
            self._memory.before = [*self._memory.before[-9:], measurement]
        try:
            sent = command(given)
        except Exception as error:
            self.report.raised = self.report.raised or f"{self.report.last}: {type(error).__name__}: {error}"
            return self._command
        self._look(sent, now)
        said = status()
        told = any(word in said for word in ("refused", "doubtful", "relaxed", "failing", "stopped"))
        if now >= self.start - 1e-9 and told and not self.report.status:
            self.report.named, self.report.status = now - self.start, said
        self._command = sent
        return sent

    def _look(self, sent: Command, now: float) -> None:
        if self.report.wild is None:
            self.report.wild = next(
                (f"{self.report.last}: {text}" for text in self._exceeded(sent, now)), None
            )
        if sent.joint_position is not None:
            self._last = sent.joint_position

    def _exceeded(self, sent: Command, now: float) -> Iterator[str]:
        if not (np.abs(sent.joint_torque) <= self._torque).all():
            yield f"{now:.3f} s: torque {np.nanmax(np.abs(sent.joint_torque) / self._torque):.3g} x its limit"
        if sent.kp is not None and not (sent.kp >= 0.0).all():
            yield f"{now:.3f} s: negative kp"
        if sent.kd is not None and not (sent.kd >= 0.0).all():
            yield f"{now:.3f} s: negative kd"
        if sent.joint_position is None:
            return
        low, high = self.robot.position_lower - 1e-9, self.robot.position_upper + 1e-9
        if not ((sent.joint_position >= low) & (sent.joint_position <= high)).all():
            yield f"{now:.3f} s: position reference out of range"
        if self._last is None:
            return
        jump = np.abs(sent.joint_position - self._last)
        if sent.kp is not None:
            jump = np.where(sent.kp > 0.0, jump, 0.0)  # a reference without stiffness moves nothing
        if not (jump <= self._step).all():
            yield f"{now:.3f} s: position reference jumps by {jump.max():.3g}"


def run(task: str, mode: str, names: Sequence[str], *, lasting: bool) -> Report:
    """Return what a run with faults came to.

    Args:
        task: "stand" or "walk".
        mode: "position", "torque" or "hybrid".
        names: A lasting fault, of `faults()` or of `CHANGES`, or up to 18 faults of `faults()` of one tick each.
        lasting: From its start to the end of the run; otherwise each fault lasts one tick, and the next one comes
            0.1 s later while the robot stands, 0.15 s later while it walks.
    """
    if task == "stand":
        stand = StandTrial(
            StandSpec(robot="hrp4_class", mode=mode, seconds=3.0, noise="realistic"), visuals=False
        )
        plant, control, command = stand.plant, stand.control, stand.control.command
        start, end, every = (0.8, 1.6, None) if lasting else (0.4, 0.7 + 0.1 * len(names), 0.1)
        if names[0] in CHANGES:
            start, end = 0.5, 1.2
    else:
        plan = WalkPlan(velocity=(0.1, 0.0, 0.0), steps=4)
        spec = WalkSpec(robot="hrp4_class", foot="rigid", mode=mode, plan=plan)
        trial = WalkTrial(spec, visuals=False)
        plant, control, command = trial.plant, trial.control.drives, trial.control.command
        start, end, every = 2.2, 5.5, 0.15
        if lasting:
            end, every = 5.0, None
    robot = control.controller.robot
    control.watch()
    change = CHANGES[names[0]][0] if names[0] in CHANGES else None
    given = {name: _good if change else faults()[name][0] for name in names}
    injector = Injector(robot, given, start, every, plant.control_period)
    report = injector.report
    falls = TrueFallDetector(plant.robot)
    while plant.time < end and report.upright:
        if change is not None and plant.time >= start:
            change(plant, control)
            change = None
        try:
            measurement = plant.measure()
        except MeasurementError:  # the simulation has diverged
            report.upright = False
            break
        sent = injector.command(measurement, command, control.status)
        if sent is None:
            break
        plant.step(sent)
        report.upright = falls.reason(plant.base_pose[3:], plant.com_height) is None
    assert injector.all_came or not report.upright or report.raised is not None
    report.stopped = control.stopped
    return report


def _good(measurement: Measurement, memory: Memory) -> Measurement:
    return measurement


MODES = ("position", "torque", "hybrid")


@contextmanager
def silence() -> Iterator[None]:
    """Log nothing while the block, or the decorated function, runs; not after it either, whatever it raises."""
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
