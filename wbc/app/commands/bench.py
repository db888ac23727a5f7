"""`wbc bench`: time of one tick of the controller, a robot on two soles that sways at 1 kHz.

The same task is set to other libraries in `benchmarks`, where a program compares them.
"""

from __future__ import annotations

import math
import resource
from time import perf_counter_ns
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc._version import __version__
from wbc.app.output import Report, reports
from wbc.base.numbers import Array
from wbc.base.settings import Count, Positive, settings, to_json
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.posture import PostureTask

CLEARANCE = 0.05
"""Joints that half-sitting puts nearer to a limit than this start in the middle of their range, rad; grippers do."""

FALL_BACK = 0.1
"""Time constant of braking after a tick without solution, s; the run continues and counts the tick."""


TASK = {
    "sole_length": 0.2,  # of the contact rectangles, at most the soles, m
    "sole_width": 0.13,
    "friction": 0.7,
    "lateral_amplitude": 0.020,  # of the sway along y, m and Hz
    "lateral_frequency": 0.5,
    "sagittal_amplitude": 0.010,  # of the sway along x, m and Hz
    "sagittal_frequency": 1.0,
    "com_weight": 1000.0,  # cost per (m/s²)²
    "com_stiffness": 100.0,  # 1/s²
    "posture_weight": 0.1,  # cost per (rad/s²)²
    "posture_stiffness": 25.0,  # 1/s²
    "contact_stiffness": 100.0,  # pull of each sole back to where it started, 1/s²
    "braking": 20.0,  # deceleration that the joint position limits count on, rad/s²
}
"""Numbers of the task, the same for all libraries that are compared."""


@settings(kw_only=True)
class BenchTickOptions:
    """A robot on two soles whose centre of mass sways.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        ticks: Ticks measured.
        warm_up: Ticks before them, in which the velocity jump of the start dies out.
        period: Control period, s.
    """

    robot: str = "talos"
    ticks: Count = 4000
    warm_up: Annotated[int, Field(ge=0)] = 1000
    period: Annotated[Positive, "s"] = 0.001

    def __post_init__(self) -> None:
        load(self.robot)


@reports
def tick(options: BenchTickOptions) -> Report:
    """Time a tick of the controller: two soles, a swaying centre of mass, posture, joint and torque limits."""
    facts = bench_tick(options)
    parts = ", ".join(f"{name} {value:.1f}" for name, value in facts["parts"].items())
    text = (
        f"{facts['robot']}, {facts['nv']} degrees of freedom, {facts['ticks']} ticks: "
        f"median {facts['median_us']:.1f} us, 99 % below {facts['p99_us']:.1f} us\n"
        f"  {parts}; {facts['failures']} failures, solved by {facts['solvers']}\n"
        f"  centre of mass within {facts['com_error_mm']:.2f} mm, torques up to {100 * facts['torque_use']:.0f} % of "
        f"their limits, {facts['active_limits']:g} limits active, {facts['preempted']} times interrupted"
    )
    return Report(facts, text)


def sway(time: float) -> tuple[Array, Array, Array]:
    """Return offset (m), velocity (m/s) and acceleration (m/s²) of the centre of mass at a time (s)."""
    w = math.tau * np.array([TASK["sagittal_frequency"], TASK["lateral_frequency"], 0.0])
    size = np.array([TASK["sagittal_amplitude"], TASK["lateral_amplitude"], 0.0])
    sine, cosine = np.sin(w * time), np.cos(w * time)
    return size * sine, size * w * cosine, -size * w * w * sine


def _controller(robot: Robot, period: float) -> tuple[Controller, CoMTask]:
    controller = Controller(robot, period)
    com = controller.add(CoMTask(weight=TASK["com_weight"], stiffness=TASK["com_stiffness"]))
    controller.add(PostureTask(weight=TASK["posture_weight"], stiffness=TASK["posture_stiffness"]))
    for sole in robot.soles:
        contact = controller.add(
            SoleContact(sole.name, friction=TASK["friction"], margin=0.0, stiffness=TASK["contact_stiffness"])
        )
        contact.set_box(min(TASK["sole_length"], sole.length), min(TASK["sole_width"], sole.width))
    controller.add(JointLimits(braking=TASK["braking"]), TorqueLimits())
    return controller, com


def bench_tick(options: BenchTickOptions) -> dict[str, Any]:
    """Time the ticks: median and 99th percentile, medians of parts (µs), failures, solvers, errors of CoM and torque.

    Timed is everything from setting the reference of the centre of mass to holding joint torques and accelerations;
    integrating the state is not.
    """
    robot = load(options.robot).robot()
    q, v, dt = start_configuration(robot), np.zeros(robot.nv), options.period
    robot.update(q, v)
    controller, com = _controller(robot, dt)
    start_com, ticks, preempted = np.array(robot.com), list[tuple[Any, ...]](), 0
    counts: dict[str, int] = {}
    for tick in range(-options.warm_up, options.ticks):
        offset, velocity, acceleration = sway((tick + options.warm_up) * dt)
        target = start_com + offset
        if tick == 0:
            preempted, counts = _preemptions(), controller.solver_counts
        start = perf_counter_ns()
        com.target = target
        com.feedforward_velocity = velocity
        com.feedforward_acceleration = acceleration
        controller.update(q, v)
        solution = controller.solve()
        torques, accelerations = solution.torques, solution.accelerations
        stop = perf_counter_ns()
        if tick >= 0:
            held, away = np.count_nonzero(solution.multipliers), robot.com - target
            ticks.append((stop - start, solution.timings, held, away, torques.copy(), solution.ok))
        if not solution.ok:
            accelerations = -v / FALL_BACK
        q = pin.integrate(robot.model, q, v * dt + 0.5 * dt * dt * accelerations)
        v = v + dt * accelerations
    solvers = {name: count - counts.get(name, 0) for name, count in controller.solver_counts.items()}
    preempted = _preemptions() - preempted
    durations, parts, active, off, torques, ok = map(np.array, zip(*ticks, strict=True))
    names = ("model", "assembly", "solve", "decode")
    return {
        "library": "wbc",
        "version": f"{__version__} (pin {pin.__version__})",
        "robot": options.robot,
        "nv": robot.nv,
        "median_us": round(float(np.median(durations)) / 1e3, 2),
        "p99_us": round(float(np.percentile(durations, 99)) / 1e3, 2),
        "parts": dict(zip(names, np.round(1e6 * np.median(parts, axis=0), 2).tolist(), strict=True)),
        "ticks": options.ticks,
        "failures": int((~ok).sum()),
        "solvers": solvers,
        "active_limits": round(float(active.mean()), 3),
        "com_error_mm": round(1e3 * float(np.linalg.norm(off, axis=1).max()), 3),
        "torque_use": round(float(robot.torque_share(torques).max()), 3),
        "preempted": preempted,
        "options": to_json(options),
    }


def start_configuration(robot: Robot) -> Array:
    """Return half-sitting with every joint clear of its limits, shape (nq,)."""
    q = np.array(robot.half_sitting)
    room = np.minimum(q[7:] - robot.position_lower, robot.position_upper - q[7:])
    q[7:] = np.where(room < CLEARANCE, 0.5 * (robot.position_lower + robot.position_upper), q[7:])
    return q


def _preemptions() -> int:
    """Return how often the system has preempted this process: a measure of the noise."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw
