"""How long one tick of the controller takes: a robot on two soles that sways at 1 kHz.

The same task is set to other libraries in `tests/benchmarks`; a test there compares the numbers.
"""

from __future__ import annotations

import math
import resource
from dataclasses import asdict, dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

from wbc._version import __version__
from wbc.core.errors import Array, InputError, positive
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.posture import PostureTask

CLEARANCE = 0.05
"""Joints that half-sitting puts nearer to a limit than this start in the middle of their range, rad; grippers do."""

FALL_BACK = 0.1
"""Time constant of braking after a tick without solution, s; the run goes on and counts it."""


@dataclass(frozen=True, kw_only=True)
class BenchTickOptions:
    """A robot on two soles whose centre of mass sways.

    Attributes:
        robot: Robot, one of those that `wbc robots` lists.
        ticks: Ticks measured.
        warm_up: Ticks before them, in which the velocity jump of the start dies out.
        period: Control period, s.
        sole_length: Of the contact rectangles, m.
        sole_width: Of the contact rectangles, m.
        friction: Coulomb coefficient.
        lateral_amplitude: Of the sway along y, m.
        lateral_frequency: Of the sway along y, Hz.
        sagittal_amplitude: Of the sway along x, m.
        sagittal_frequency: Of the sway along x, Hz.
        com_weight: Cost per (m/s²)².
        com_stiffness: 1/s².
        posture_weight: Cost per (rad/s²)².
        posture_stiffness: 1/s².
        contact_stiffness: Pull of each sole back to where it started, 1/s².
        braking: Deceleration that the joint position limits count on, rad/s².
    """

    robot: str = "talos"
    ticks: int = 4000
    warm_up: int = 1000
    period: float = 0.001
    sole_length: float = 0.2
    sole_width: float = 0.13
    friction: float = 0.7
    lateral_amplitude: float = 0.020
    lateral_frequency: float = 0.5
    sagittal_amplitude: float = 0.010
    sagittal_frequency: float = 1.0
    com_weight: float = 1000.0
    com_stiffness: float = 100.0
    posture_weight: float = 0.1
    posture_stiffness: float = 25.0
    contact_stiffness: float = 100.0
    braking: float = 20.0

    def __post_init__(self) -> None:
        load(self.robot)
        positive("control period (s)", self.period)
        if self.ticks < 1 or self.warm_up < 0:
            raise InputError(
                f"ticks must be at least 1 and warm-up ticks at least 0, got {self.ticks} and {self.warm_up}"
            )

    def sway(self, time: float) -> tuple[Array, Array, Array]:
        """Offset of the centre of mass from its start (m), its velocity (m/s) and acceleration (m/s²) at a time (s)."""
        w = 2.0 * math.pi * np.array([self.sagittal_frequency, self.lateral_frequency, 0.0])
        size = np.array([self.sagittal_amplitude, self.lateral_amplitude, 0.0])
        sine, cosine = np.sin(w * time), np.cos(w * time)
        return size * sine, size * w * cosine, -size * w * w * sine

    def controller(self, robot: Robot) -> tuple[Controller, CoMTask]:
        """The controller, and its task on the centre of mass."""
        controller = Controller(robot, self.period)
        com = controller.add(CoMTask(weight=self.com_weight, stiffness=self.com_stiffness))
        controller.add(PostureTask(weight=self.posture_weight, stiffness=self.posture_stiffness))
        for sole in robot.soles:
            contact = SoleContact(
                sole.name, friction=self.friction, margin=0.0, stiffness=self.contact_stiffness
            )
            controller.add(contact)
            contact.set_rectangle(self.sole_length, self.sole_width)
        controller.add(JointLimits(braking=self.braking), TorqueLimits())
        return controller, com


def bench_tick(options: BenchTickOptions) -> dict[str, Any]:
    """Time the ticks.

    Timed is everything from setting the reference of the centre of mass to holding joint torques and accelerations;
    integrating the state is not.

    Args:
        options: The task.

    Returns:
        Plain values: median and 99th percentile of a tick, medians of its parts (µs), failures, who solved how many
        ticks, how well the sway was followed and how near the torques came to their limits.
    """
    robot = load(options.robot).robot()
    q, v, dt = start_configuration(robot), np.zeros(robot.nv), options.period
    robot.update(q, v)
    controller, com = options.controller(robot)
    start_com = np.array(robot.com)
    durations, parts = np.zeros(options.ticks), np.zeros((options.ticks, 4))
    com_seen, com_wanted = np.zeros((options.ticks, 3)), np.zeros((options.ticks, 3))
    torque_seen, active = np.zeros((options.ticks, robot.na)), np.zeros(options.ticks, dtype=int)
    failures, preempted = 0, 0
    counts: dict[str, int] = {}
    for tick in range(-options.warm_up, options.ticks):
        offset, velocity, acceleration = options.sway((tick + options.warm_up) * dt)
        target = start_com + offset
        if tick == 0:
            preempted, counts = _preemptions(), solver_counts(controller)
        start = perf_counter_ns()
        com.target = target
        com.feedforward_velocity = velocity
        com.feedforward_acceleration = acceleration
        controller.update(q, v)
        solution = controller.solve()
        torques, accelerations = solution.torques, solution.accelerations
        stop = perf_counter_ns()
        if tick >= 0:
            durations[tick], parts[tick] = stop - start, solution.timings
            com_seen[tick], com_wanted[tick], torque_seen[tick] = robot.com, target, torques
            active[tick] = np.count_nonzero(solution.multipliers)
            failures += not solution.ok
        if not solution.ok:
            accelerations = -v / FALL_BACK
        q = pin.integrate(robot.model, q, v * dt + 0.5 * dt * dt * accelerations)
        v = v + dt * accelerations
    names = ("model", "assembly", "solve", "decode")
    after = solver_counts(controller)
    return {
        "library": "wbc",
        "version": f"{__version__} (pin {pin.__version__})",
        "robot": options.robot,
        "nv": robot.nv,
        "median_us": round(float(np.median(durations)) / 1e3, 2),
        "p99_us": round(float(np.percentile(durations, 99)) / 1e3, 2),
        "parts": dict(zip(names, np.round(1e6 * np.median(parts, axis=0), 2).tolist(), strict=True)),
        "ticks": options.ticks,
        "failures": failures,
        "solvers": {name: after[name] - counts.get(name, 0) for name in after},
        "active_limits": round(float(active.mean()), 3),
        "com_error_mm": round(1e3 * float(np.linalg.norm(com_seen - com_wanted, axis=1).max()), 3),
        "torque_use": round(float(np.abs(torque_seen / robot.torque_limit).max()), 3),
        "preempted": _preemptions() - preempted,
        "options": asdict(options),
    }


def start_configuration(robot: Robot) -> Array:
    """Half-sitting with every joint clear of its limits, shape (nq,)."""
    q = np.array(robot.half_sitting)
    room = np.minimum(q[7:] - robot.position_lower, robot.position_upper - q[7:])
    q[7:] = np.where(room < CLEARANCE, 0.5 * (robot.position_lower + robot.position_upper), q[7:])
    return q


def solver_counts(controller: Controller) -> dict[str, int]:
    """How many ticks each rung of the solver's ladder has solved since the last change of the layout."""
    return dict(controller._solver.counts) if hasattr(controller, "_solver") else {}


def _preemptions() -> int:
    """How often the system has taken the processor away from this process: a measure of the noise."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw
