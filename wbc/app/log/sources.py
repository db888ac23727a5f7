"""Where the signals of a log come from: clock, measurement, command and controller.

`write` copies values into the row of a tick, and is all that a tick pays for; what can be computed from the row alone
is computed by `finish`, for a whole batch at a time.
"""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from time import perf_counter

import numpy as np
import pinocchio as pin

from wbc.app.log.names import foot_names, joint_units, torque_units
from wbc.app.log.table import QUATERNION, WRENCH, WRENCH_UNITS, XYZ, Columns
from wbc.app.log.tick import Source, Tick, copy
from wbc.app.log.truth import TruthSource
from wbc.app.log.walking import WalkSource
from wbc.core.control import PositionControl
from wbc.core.errors import Array
from wbc.core.solution import Solution
from wbc.walking.control import WalkingControl


def sources_for(columns: Columns, tick: Tick) -> list[Source]:
    """Make every source that the objects of a run have something for.

    Args:
        columns: Taken from.
        tick: The first tick.
    """
    sources: list[Source] = [ClockSource(columns)]
    estimate, omega = EstimateSource(columns, tick), None
    if isinstance(tick.control, WalkingControl):
        walk = WalkSource(columns, tick, estimate.com, estimate.com_velocity)
        omega = walk.omega
        sources.append(walk)
    sources += [estimate, MeasurementSource(columns, tick), CommandSource(columns, tick)]
    sources.append(SolverSource(columns, tick))
    if tick.plant is not None:
        sources.append(TruthSource(columns, tick.plant, omega))
    return sources


class ClockSource(Source):
    """Time of the run, and of the clock on the wall."""

    def __init__(self, columns: Columns) -> None:
        self._time = columns.add("time", "s", "time stamp of the measurement", "double")
        self._clock = columns.add("tick/clock", "s", "clock on the wall when the tick was recorded", "double")

    def write(self, tick: Tick, row: Array) -> None:
        row[self._time] = tick.measurement.time
        row[self._clock] = perf_counter()


class MeasurementSource(Source):
    """What the sensors said."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.robot
        joints, units = robot.joint_names, joint_units(robot)
        rates = [f"{unit}/s" for unit in units]
        self._position = columns.group("joint/position", joints, units, "encoder")
        self._velocity = columns.group("joint/velocity", joints, rates, "velocity from the drive")
        self._rate = columns.group("imu/angular_velocity", XYZ, "rad/s", "gyroscope, IMU frame")
        self._force = columns.group(
            "imu/specific_force", XYZ, "m/s²", "accelerometer: acceleration minus gravity, IMU frame"
        )
        feet = foot_names(robot)
        about = "what the ground does to the sole, sole frame"
        self._wrenches = [
            columns.group(f"foot/{foot}/wrench_measured", WRENCH, WRENCH_UNITS, about) for foot in feet
        ]
        self._ranges = columns.each(
            [f"foot/{foot}/range" for foot in feet],
            "m",
            "range sensor under the toe; NaN when it saw nothing",
        )
        self._stiffness = columns.each(
            [f"foot/{foot}/stiffness" for foot in feet], "Nm/rad", "actual, of the sole"
        )

    def write(self, tick: Tick, row: Array) -> None:
        m = tick.measurement
        row[self._position] = m.joint_position
        row[self._velocity] = m.joint_velocity
        row[self._rate] = m.angular_velocity
        row[self._force] = m.specific_force
        row[self._ranges] = m.sole_range
        row[self._stiffness] = m.sole_stiffness
        for places, wrench in zip(self._wrenches, m.sole_wrench, strict=True):
            row[places] = wrench


class CommandSource(Source):
    """What the drives were asked for."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.robot
        joints, units = robot.joint_names, joint_units(robot)
        rates = [f"{unit}/s" for unit in units]
        self._position = columns.group("joint/position_reference", joints, units, "of the servo")
        self._velocity = columns.group("joint/velocity_reference", joints, rates, "of the servo")
        self._torque = columns.group(
            "joint/torque_command", joints, torque_units(robot), "torque, or feed-forward of the servo"
        )
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
        copy(row, self._stiffness, c.sole_stiffness)


class EstimateSource(Source):
    """Where the controller believes the robot to be and, in position control, where it has commanded it to be.

    Attributes:
        com: Columns of the centre of mass.
        com_velocity: Columns of its velocity.
    """

    def __init__(self, columns: Columns, tick: Tick) -> None:
        robot = tick.drives.observer.robot
        self._estimated = _base(columns, "estimated")
        self._commanded = _base(columns, "commanded") if isinstance(tick.drives, PositionControl) else None
        self.com = columns.group("com/estimated", XYZ, "m", "world")
        self.com_velocity = columns.group("com/estimated_velocity", XYZ, "m/s", "world")
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._places = []
        for foot in foot_names(robot):
            start = columns.group(f"foot/{foot}/estimated/position", XYZ, "m", "sole centre, world").start
            columns.group(f"foot/{foot}/estimated/orientation", QUATERNION, "1", "sole frame in the world")
            self._places.append(slice(start, start + 7))

    def write(self, tick: Tick, row: Array) -> None:
        drives = tick.drives
        robot = drives.observer.robot
        position, velocity = self._estimated
        row[position] = robot.q[:7]
        row[velocity] = robot.v[:6]
        row[self.com] = robot.com
        row[self.com_velocity] = robot.com_velocity
        placements = robot.data.oMf
        for places, sole in zip(self._places, self._soles, strict=True):
            row[places] = pin.SE3ToXYZQUAT(placements[sole])
        if self._commanded is not None and isinstance(drives, PositionControl):
            position, velocity = self._commanded
            row[position] = drives.q[:7]
            row[velocity] = drives.v[:6]


class SolverSource(Source):
    """How the problem was solved, and how long it took."""

    def __init__(self, columns: Columns, tick: Tick) -> None:
        solution = tick.drives.solution
        self._columns = columns
        self._status = columns.add("solver/status", "1", "how the problem was solved", "text")
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
        self._patterns: dict[bytes, int] = {}  # sets of active limits that have occurred, and their texts
        if solution is not None:
            self._prepare(columns, tick, solution)

    def _prepare(self, columns: Columns, tick: Tick, solution: Solution) -> None:
        layout = solution.layout
        feet = dict(zip((s.name for s in tick.robot.soles), foot_names(tick.robot), strict=True))
        for name, variables in layout.contacts.items():
            parts = WRENCH[: variables.stop - variables.start]
            where = f"foot/{feet[name]}" if name in feet else f"contact/{name}"
            about = "solution of the quadratic program, sole frame"
            units = WRENCH_UNITS[: len(parts)]
            self._wrenches.append((variables, columns.group(f"{where}/wrench_solved", parts, units, about)))
        self._residuals = columns.hidden(solution.residual_rows.size)
        for name, rows in layout.tasks.items():
            about = "norm of achieved minus wanted acceleration, torque or wrench"
            place = columns.add(f"solver/residual/{name}", layout.units[name], about)
            start = self._residuals.start
            self._norms[place] = slice(start + rows.start, start + rows.stop)
        self._active = columns.add("solver/active_limits", "1", "limits that push, separated by ';'", "text")
        self._multipliers = columns.hidden(solution.multipliers.size)

    def write(self, tick: Tick, row: Array) -> None:
        drives = tick.drives
        solution = drives.solution
        row[self._failures] = drives.failures
        if (
            solution is None or solution.layout is not self._layout
        ):  # tasks have been added: others than announced
            row[self._status] = row[self._iterations] = math.nan
            row[self._times] = math.nan
            if self._layout is not None:
                row[self._residuals] = row[self._multipliers] = math.nan
                for _, places in self._wrenches:
                    row[places] = math.nan
            return
        row[self._status] = self._columns.text(solution.status.value)
        row[self._iterations] = solution.iterations
        row[self._times] = solution.timings
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


def _base(columns: Columns, which: str) -> tuple[slice, slice]:
    """Columns of a base: pose, and velocity in its own frame."""
    start = columns.group(f"base/{which}/position", XYZ, "m", "world").start
    columns.group(f"base/{which}/orientation", QUATERNION, "1", "base frame in the world")
    middle = columns.group(f"base/{which}/linear_velocity", XYZ, "m/s", "base frame").start
    columns.group(f"base/{which}/angular_velocity", XYZ, "rad/s", "base frame")
    return slice(start, middle), slice(middle, middle + 6)
