"""Sources of signals: clock, measurement, command, estimate and controller."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.app.log.columns import (
    QUATERNION,
    WRENCH,
    WRENCH_UNITS,
    XYZ,
    Columns,
    foot_names,
    joint_units,
    torque_units,
)
from wbc.app.log.tick import Source, Tick, copy
from wbc.app.log.truth import GroundTruthSource, TruthSource
from wbc.app.log.walking import WalkSource
from wbc.core.drive.position import PositionControl
from wbc.core.errors import Array
from wbc.core.qp.solution import Solution
from wbc.sim.plant.plant import Plant
from wbc.walking.load import HeldLoad


def sources_for(columns: Columns, tick: Tick) -> list[Source]:
    """Return a source for each object of a run that has signals.

    Args:
        columns: Takes the columns of the signals.
        tick: The first tick.
    """
    sources: list[Source] = [ClockSource(columns)]
    estimate, omega = None if tick.estimate is None else EstimateSource(columns, tick), None
    if estimate is not None and tick.walking is not None:
        walk = WalkSource(columns, tick, estimate.com, estimate.com_velocity)
        omega = walk.omega
        sources.append(walk)
    if estimate is not None:
        sources.append(estimate)
    if tick.drives is not None and tick.drives.observer.outside is not None:
        sources.append(OutsideSource(columns, tick))
    sources += [MeasurementSource(columns, tick), CommandSource(columns, tick)]
    if tick.control is not None or tick.solution is not None:
        sources.append(SolverSource(columns, tick))
    if isinstance(tick.plant, Plant):
        sources.append(TruthSource(columns, tick.plant, omega))
    elif tick.truth is not None:
        sources.append(GroundTruthSource(columns, tick, omega))
    return sources


class ClockSource(Source):
    """Simulated or measured time, and wall-clock time."""

    def __init__(self, columns: Columns) -> None:
        self._time = columns.add("time", "s", "time stamp of the measurement", "double")
        self._clock = columns.add("tick/clock", "s", "wall-clock time of the recording", "double")

    def write(self, tick: Tick, row: Array) -> None:
        row[self._time] = tick.measurement.time
        row[self._clock] = perf_counter()


class MeasurementSource(Source):
    """Measurements of the sensors."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.robot
        joints, units = robot.joint_names, joint_units(robot)
        rates = [f"{unit}/s" for unit in units]
        start = columns.group("joint/position", joints, units, "encoder").start
        columns.group("joint/velocity", joints, rates, "velocity from the drive")
        columns.group("imu/angular_velocity", XYZ, "rad/s", "gyroscope, IMU frame")
        about = "accelerometer: acceleration minus gravity, IMU frame"
        columns.group("imu/specific_force", XYZ, "m/s²", about)
        feet = foot_names(robot)
        about = "of the ground on the sole, sole frame"
        for foot in feet:
            columns.group(f"foot/{foot}/wrench_measured", WRENCH, WRENCH_UNITS, about)
        about = "range sensor under the toe; NaN without an echo"
        columns.each([f"foot/{foot}/range" for foot in feet], "m", about)
        columns.each([f"foot/{foot}/stiffness" for foot in feet], "Nm/rad", "actual, of the sole")
        self._torque = tick.measurement.joint_torque is not None
        if self._torque:
            columns.group("joint/torque_measured", joints, torque_units(robot), "of the drive")
        wrists = tick.measurement.hand_wrenches
        self._wrists = 0 if wrists is None else len(wrists)
        named = list(robot.frames) if len(robot.frames) == self._wrists else range(self._wrists)
        for hand in named:
            about = "on the hand, less its own weight, frame of the hand"
            columns.group(f"hand/{hand}/wrench_measured", WRENCH, WRENCH_UNITS, about)
        self._copied = columns.since(start)

    def write(self, tick: Tick, row: Array) -> None:
        m = tick.measurement
        parts = [  # in the order of the columns
            m.joint_position,
            m.joint_velocity,
            m.angular_velocity,
            m.specific_force,
            np.full(m.sole_range.size * 6, math.nan) if m.sole_wrench is None else m.sole_wrench.ravel(),
            m.sole_range,
            m.sole_stiffness,
        ]
        if self._torque:
            none = np.full(m.joint_position.size, math.nan)
            parts.append(none if m.joint_torque is None else m.joint_torque)
        if self._wrists:
            wrists = m.hand_wrenches
            parts.append(np.full(6 * self._wrists, math.nan) if wrists is None else wrists.ravel())
        np.concatenate(parts, out=row[self._copied])


class CommandSource(Source):
    """Commands to the joint drives and soles."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.robot
        joints, units = robot.joint_names, joint_units(robot)
        rates = [f"{unit}/s" for unit in units]
        self._position = columns.group("joint/position_reference", joints, units, "of the servo")
        self._velocity = columns.group("joint/velocity_reference", joints, rates, "of the servo")
        self._torque = columns.group(
            "joint/torque_command", joints, torque_units(robot), "torque, or feed-forward of the servo"
        )
        self._gains: slice | None = None
        if tick.command.kp is not None or tick.command.kd is not None:
            torques = torque_units(robot)
            per_angle = [f"{torque}/{unit}" for torque, unit in zip(torques, units, strict=True)]
            per_speed = [f"{torque}s/{unit}" for torque, unit in zip(torques, units, strict=True)]
            start = columns.group("joint/kp_command", joints, per_angle, "gain of the servo").start
            columns.group("joint/kd_command", joints, per_speed, "gain of the servo")
            self._gains = columns.since(start)
        self._stiffness = columns.each(
            [f"foot/{foot}/stiffness_command" for foot in foot_names(robot)],
            "Nm/rad",
            "commanded, of the sole",
        )

    def write(self, tick: Tick, row: Array) -> None:
        c = tick.command
        row[self._torque] = c.joint_torque
        copy(row, self._position, c.joint_position)
        copy(row, self._velocity, c.joint_velocity)
        if self._gains is not None:
            none = np.full(c.joint_torque.size, math.nan)
            np.concatenate([none if gain is None else gain for gain in (c.kp, c.kd)], out=row[self._gains])
        copy(row, self._stiffness, c.sole_stiffness)


class EstimateSource(Source):
    """Estimated state of the robot and, in position control, the commanded base.

    Attributes:
        com: Columns of the estimated centre of mass.
        com_velocity: Columns of its velocity.
    """

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.estimate
        assert robot is not None
        start = _base(columns, "estimated")
        self.com = columns.group("com/estimated", XYZ, "m", "world")
        self.com_velocity = columns.group("com/estimated_velocity", XYZ, "m/s", "world")
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        for foot in foot_names(robot):
            columns.group(f"foot/{foot}/estimated/position", XYZ, "m", "sole centre, world")
            columns.group(f"foot/{foot}/estimated/orientation", QUATERNION, "1", "sole frame in the world")
        if isinstance(tick.drives, PositionControl):
            _base(columns, "commanded")
        self._copied = columns.since(start)

    def write(self, tick: Tick, row: Array) -> None:
        drives, robot = tick.drives, tick.estimate
        assert robot is not None
        placements = robot.data.oMf
        # In the order of the columns.
        parts = [robot.q[:7], robot.v[:6], robot.com, robot.com_velocity]
        parts += [pin.SE3ToXYZQUAT(placements[sole]) for sole in self._soles]
        if isinstance(drives, PositionControl):
            parts += [drives.q[:7], drives.v[:6]]
        np.concatenate(parts, out=row[self._copied])


class OutsideSource(Source):
    """Outside wrench of an observer that estimates it, and the load of a walk that carries one."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        about = "of the surroundings besides the ground, without the load that the models carry; about the CoM, world"
        self._wrench = columns.group("outside/wrench", WRENCH, WRENCH_UNITS, about)
        load = _load(tick)
        self._load = None if load is None else columns.add("load/mass", "kg", "as estimated")
        self._place = None if load is None else columns.group("load/place", XYZ, "m", "as estimated, world")

    def write(self, tick: Tick, row: Array) -> None:
        assert tick.drives is not None and tick.drives.observer.outside is not None
        row[self._wrench] = tick.drives.observer.outside.wrench
        load = _load(tick)
        if load is not None and self._load is not None and self._place is not None:
            row[self._load], row[self._place] = load.mass, load.place


def _load(tick: Tick) -> HeldLoad | None:
    """Return the load of a walk; None where none is expected."""
    return None if tick.walking is None else tick.walking.load


class SolverSource(Source):
    """Status, residuals, active limits and timings of the QP."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        solution = tick.solution
        self._columns = columns
        self._status = columns.add("solver/status", "1", "status of the QP", "text")
        self._iterations = columns.add("solver/iterations", "1", "outer iterations", "whole")
        self._failures = columns.add("solver/failures", "1", "failed ticks so far", "whole")
        self._times = columns.group(
            "tick",
            ("model", "assembly", "solve", "decode"),
            "s",
            "wall time of a part of the controller's tick",
        )
        self._layout = None if solution is None else solution.layout
        self._wrenches: list[tuple[slice, slice]] = []
        self._norms: dict[int, slice] = {}
        self._active = -1
        self._last: tuple[Any, int] = (None, 0)  # status, and index of its text
        self._patterns: dict[bytes, int] = {}  # index of the text of each set of active limits
        if solution is not None:
            self._prepare(columns, tick, solution)

    def _prepare(self, columns: Columns, tick: Tick, solution: Solution) -> None:
        layout = solution.layout
        feet = dict(zip((s.name for s in tick.robot.soles), foot_names(tick.robot), strict=True))
        for name, variables in layout.contacts.items():
            parts = WRENCH[: variables.stop - variables.start]
            where = f"foot/{feet[name]}" if name in feet else f"contact/{name}"
            about = "solution of the QP, sole frame"
            units = WRENCH_UNITS[: len(parts)]
            self._wrenches.append((variables, columns.group(f"{where}/wrench_solved", parts, units, about)))
        self._residuals = columns.hidden(solution.residual_rows.size)
        for name, rows in layout.tasks.items():
            about = "norm of achieved minus desired acceleration, torque or wrench"
            place = columns.add(f"solver/residual/{name}", layout.units[name], about)
            start = self._residuals.start
            self._norms[place] = slice(start + rows.start, start + rows.stop)
        self._active = columns.add("solver/active_limits", "1", "active limits, separated by ';'", "text")
        self._multipliers = columns.hidden(solution.multipliers.size)

    def write(self, tick: Tick, row: Array) -> None:
        drives, solution = tick.drives, tick.solution
        row[self._failures] = 0 if drives is None else drives.failures
        if solution is None:
            row[self._status] = row[self._iterations] = math.nan
            row[self._times] = math.nan
        else:
            if solution.status is not self._last[0]:
                self._last = (solution.status, self._columns.text(solution.status.value))
            row[self._status] = self._last[1]
            row[self._iterations] = solution.iterations
            row[self._times] = solution.timings
        if self._layout is None:
            return
        if solution is None or solution.layout is not self._layout:  # other tasks than in the first tick
            row[self._residuals] = row[self._multipliers] = math.nan
            for _, places in self._wrenches:
                row[places] = math.nan
            return
        row[self._residuals] = solution.residual_rows
        row[self._multipliers] = solution.multipliers
        variables = solution.variables
        for source, places in self._wrenches:
            row[places] = variables[source]

    def finish(self, rows: Array) -> None:
        if self._layout is None:
            return
        for place, places in self._norms.items():
            rows[:, place] = np.sqrt(np.square(rows[:, places]).sum(axis=1))
        size = np.abs(rows[:, self._multipliers])
        largest = size.max(axis=1, initial=0.0)  # the threshold is that of `Solution.active_limits`
        active = size > 1e-6 * np.maximum(1.0, np.nan_to_num(largest))[:, None]
        rows[:, self._active] = math.nan
        patterns = np.packbits(active, axis=1)
        for i in np.flatnonzero(active.any(axis=1)):
            pattern = patterns[i].tobytes()
            if pattern not in self._patterns:
                names = [self._layout.limits[k] for k in np.flatnonzero(active[i])]
                self._patterns[pattern] = self._columns.text("; ".join(names))
            rows[i, self._active] = self._patterns[pattern]


def _base(columns: Columns, which: str) -> int:
    """Add the columns of a base, pose and velocity in its own frame, and return the first."""
    start = columns.group(f"base/{which}/position", XYZ, "m", "world").start
    columns.group(f"base/{which}/orientation", QUATERNION, "1", "base frame in the world")
    columns.group(f"base/{which}/linear_velocity", XYZ, "m/s", "base frame")
    columns.group(f"base/{which}/angular_velocity", XYZ, "rad/s", "base frame")
    return int(start)
