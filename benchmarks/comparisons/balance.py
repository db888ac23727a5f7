"""The balance task that libraries solve in turn, stated once, and the loop in which one of them is timed.

Talos stands on two soles and its centre of mass sways at 1 kHz. `compare.py` writes the task to a file; the program of
each library reads it in an environment of its own. This module uses NumPy alone, so that it runs wherever any of the
libraries does.
"""

from __future__ import annotations

import json
import math
import resource
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter_ns
from typing import Any, Protocol, Self

import numpy as np

BRAKE = 0.1
"""Time constant of braking after a tick without a solution, s."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Task that is the same for all libraries.

    Attributes:
        robot: Name of the robot.
        urdf: Its description without any geometry, as XML text.
        posture: Position of every joint at the start, rad; target of the posture task.
        soles: Frames of the soles, z upwards, at the centre of the rectangle; none of an arm.
        base_height: Height of the base at the start, m; the soles stay wherever this puts them.
    """

    robot: str
    urdf: str
    posture: dict[str, float]
    soles: tuple[str, ...] = ()
    base_height: float = 0.0

    def save(self, path: Path) -> None:
        """Write the scene as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a scene written by `save`."""
        fields = json.loads(path.read_text(encoding="utf-8"))
        return cls(**{**fields, "soles": tuple(fields["soles"])})


@dataclass(frozen=True, kw_only=True)
class BalanceTask(Scene):
    """Balance on two soles.

    Gains and weights cannot be made exactly equal (each library regularises forces in its own way), but they do not
    change what is computed in a tick. They are chosen so that the sway is followed to a tenth of a millimetre and no
    joint limit is active.

    Attributes:
        numbers: Numbers of the task by name: `TASK` of `wbc.app.commands.bench`.
        period: Control period, s.
        warm_up: Ticks before the measured ones, in which the velocity jump of the start dies out.
        ticks: Ticks measured.
    """

    numbers: dict[str, float]
    period: float = 0.001
    warm_up: int = 1000
    ticks: int = 4000

    def sway(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the offset of the centre of mass from its start, m, its velocity, m/s, and acceleration, m/s²."""
        n = self.numbers
        w = math.tau * np.array([n["sagittal_frequency"], n["lateral_frequency"], 0.0])
        size = np.array([n["sagittal_amplitude"], n["lateral_amplitude"], 0.0])
        sine, cosine = np.sin(w * time), np.cos(w * time)
        return size * sine, size * w * cosine, -size * w * w * sine


class Balance(Protocol):
    """The balance task in the terms of a library.

    Attributes:
        nv: Degrees of freedom.
        effort: Torque limits of the joints, shape (na,), Nm.
        com_start: Centre of mass at the start, m.
    """

    nv: int
    effort: np.ndarray
    com_start: np.ndarray

    def tick(self, time: float, com: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> bool:
        """Set the reference of the centre of mass, solve, and hold torques and accelerations; False if it fails."""
        ...

    def com(self) -> np.ndarray:
        """Return the centre of mass, m."""
        ...

    def move_on(self, *, solved: bool) -> np.ndarray:
        """Integrate the accelerations, or brake where there are none; return the joint torques, Nm."""
        ...


def damping(stiffness: float) -> float:
    """Return the critical damping of a stiffness, 1/s."""
    return 2 * math.sqrt(stiffness)


def timings(durations: list[int]) -> dict[str, float]:
    """Return the 5th, 50th and 99th percentile of times in ns, µs."""
    least, median, most = np.round(np.percentile(durations, [5, 50, 99]) / 1e3, 2).tolist()
    return {"least_us": least, "median_us": median, "p99_us": most}


def preemptions() -> int:
    """Return how often the system has preempted this process: a measure of the noise."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw


def run(task: BalanceTask, version: str, make: Callable[[BalanceTask], Balance]) -> str:
    """Run the task with a library, and return the record as a line of JSON.

    Timed is everything from setting the reference of the centre of mass to holding torques and accelerations;
    integrating the state is not.
    """
    balance = make(task)
    durations: list[int] = []
    failures, com_error, torque_use, preempted = 0, 0.0, 0.0, 0
    for tick in range(task.warm_up + task.ticks):
        time = tick * task.period
        offset, velocity, acceleration = task.sway(time)
        com = balance.com_start + offset
        if tick == task.warm_up:
            preempted = preemptions()
        start = perf_counter_ns()
        solved = balance.tick(time, com, velocity, acceleration)
        stop = perf_counter_ns()
        failures += not solved
        error = float(np.linalg.norm(balance.com() - com))
        torques = balance.move_on(solved=solved)
        if tick >= task.warm_up:
            durations.append(stop - start)
            com_error = max(com_error, error)
            torque_use = max(torque_use, float(np.max(np.abs(torques) / balance.effort)))
    record: dict[str, Any] = {
        "version": version,
        "nv": balance.nv,
        **timings(durations),
        "failures": failures,
        "com_error_mm": round(com_error * 1e3, 3),
        "torque_use": round(torque_use, 3),
        "preempted": preemptions() - preempted,
    }
    return json.dumps(record)
