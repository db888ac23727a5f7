"""Signals of a walk: what the pattern wants, what the stabilizer makes of it, and what happened."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math

import pinocchio as pin

from wbc.app.log.names import foot_names
from wbc.app.log.table import QUATERNION, WRENCH, WRENCH_UNITS, XY, XYZ, Columns
from wbc.app.log.tick import Source, Tick
from wbc.core.errors import Array
from wbc.walking.control import WalkingControl
from wbc.walking.stabilizer import StabilizerOutput
from wbc.walking.walk import WalkReference


class WalkSource(Source):
    """Everything of a walk; NaN and null in ticks before there was a reference.

    Attributes:
        omega: Column of the natural frequency.
    """

    def __init__(self, columns: Columns, tick: Tick, com: slice, com_velocity: slice) -> None:
        """Take the columns.

        Args:
            columns: Taken from.
            tick: The first tick.
            com: Columns of the estimated centre of mass.
            com_velocity: Columns of its velocity.
        """
        self._columns, self._fallen = columns, False
        self._estimated = (com, com_velocity)
        self._start = len(columns.signals)
        self._phase = columns.add("walk/phase", "1", "what the feet do", "text")
        self._event = columns.add("walk/event", "1", "what happened in this tick, separated by ';'", "text")
        self._step = columns.add("walk/step", "1", "index of the step that swings, or swings next", "whole")
        self._done = columns.add("walk/steps_done", "1", "single supports that have ended", "whole")
        self._heading = columns.add("walk/heading", "rad", "where pelvis and torso should look")
        self._side = columns.add("step/side", "1", "foot that swings, or swings next", "text")
        self._landing = columns.group(
            "step/landing", ("x", "y", "z", "yaw"), ("m", "m", "m", "rad"), "where it is to land, world"
        )
        self.omega = columns.add("pendulum/omega", "1/s", "natural frequency")
        self._com = columns.group("com/reference", XYZ, "m", "world")
        self._velocity = columns.group("com/reference_velocity", XYZ, "m/s", "world")
        self._acceleration = columns.group("com/reference_acceleration", XYZ, "m/s²", "world")
        self._dcm = columns.group("dcm/reference", XY, "m", "world")
        self._dcm_error = columns.group("stabilizer/dcm_error", XY, "m", "target minus measured, world")
        self._dcm_estimated = columns.group("dcm/estimated", XY, "m", "of the estimated CoM, world")
        self._zmp = columns.group("zmp/reference", XYZ, "m", "world")
        self._zmp_desired = columns.group("zmp/desired", XYZ, "m", "of the desired net wrench, world")
        self._zmp_measured = columns.group("zmp/measured", XYZ, "m", "of the measured foot wrenches, world")
        self._average = columns.group("stabilizer/dcm_error_average", XY, "m", "world")
        self._rate = columns.group("stabilizer/dcm_error_rate", XY, "m/s", "world")
        self._desired = columns.group("stabilizer/com_acceleration", XYZ, "m/s²", "desired, world")
        self._net = columns.group(
            "stabilizer/net_wrench", WRENCH, WRENCH_UNITS, "desired, at the world origin"
        )
        self._offset = columns.group("stabilizer/com_offset", XY, "m", "added to the CoM target, world")
        self._air = columns.add("stabilizer/in_air", "1", "neither foot feels the ground", "flag")
        self._feet = [_Foot(columns, foot) for foot in foot_names(tick.robot)]
        self._end = len(columns.signals)

    def write(self, tick: Tick, row: Array) -> None:
        walk = tick.control
        assert isinstance(walk, WalkingControl)
        reference, output = walk.reference, walk.output
        if reference is None or output is None:
            row[self._start : self._end] = math.nan
            return
        self._write_events(walk, reference, row)
        self._write_pendulum(reference, output, row)
        for i, foot in enumerate(self._feet):
            foot.write(reference, output, i, row)

    def _write_events(self, walk: WalkingControl, reference: WalkReference, row: Array) -> None:
        text = self._columns.text
        events = [event.value for event in reference.events]
        if walk.fallen is not None and not self._fallen:
            self._fallen = True
            events.append(f"fallen: {walk.fallen.value}")
        row[self._event] = text("; ".join(events)) if events else math.nan
        row[self._phase] = text(reference.phase.value)
        row[self._step] = reference.step
        row[self._done] = walk.steps_done
        row[self._heading] = reference.heading
        steps = walk.walk.phases.plan.steps
        if reference.step < len(steps):
            step = steps[reference.step]
            row[self._side] = text(step.side)
            row[self._landing] = (step.x, step.y, step.z, step.yaw)
        else:
            row[self._side] = row[self._landing] = math.nan

    def _write_pendulum(self, reference: WalkReference, output: StabilizerOutput, row: Array) -> None:
        pendulum, errors = reference.pendulum, output.errors
        row[self.omega] = pendulum.omega
        row[self._com] = pendulum.com
        row[self._velocity] = pendulum.com_velocity
        row[self._acceleration] = pendulum.com_acceleration
        row[self._zmp] = pendulum.zmp
        row[self._zmp_desired] = output.zmp
        row[self._zmp_measured] = output.measured_zmp
        row[self._dcm_error] = errors.dcm
        row[self._average] = errors.average
        row[self._rate] = errors.rate
        row[self._desired] = output.com_acceleration
        row[self._net] = output.net_wrench
        row[self._offset] = output.com_offset
        row[self._air] = output.in_air

    def finish(self, rows: Array) -> None:
        omega = rows[:, self.omega, None]
        for dcm, com, velocity in (
            (self._dcm, self._com, self._velocity),
            (self._dcm_estimated, *self._estimated),
        ):
            rows[:, dcm] = rows[:, com][:, :2] + rows[:, velocity][:, :2] / omega


class _Foot:
    """Signals of one foot."""

    def __init__(self, columns: Columns, foot: str) -> None:
        name = f"foot/{foot}"
        self._contact = columns.add(f"{name}/contact", "1", "the walk has it on the ground", "flag")
        start = columns.group(f"{name}/reference/position", XYZ, "m", "sole centre, world").start
        columns.group(f"{name}/reference/orientation", QUATERNION, "1", "sole frame in the world")
        self._place = slice(start, start + 7)
        start = columns.group(f"{name}/reference/linear_velocity", XYZ, "m/s", "world").start
        columns.group(f"{name}/reference/angular_velocity", XYZ, "rad/s", "world")
        self._velocity = slice(start, start + 6)
        self._correction = columns.group(
            f"{name}/correction", ("roll", "pitch", "height"), ("rad", "rad", "m"), "added by the stabilizer"
        )
        self._wrench = columns.group(
            f"{name}/wrench_desired", WRENCH, WRENCH_UNITS, "what the stabilizer wants, sole frame"
        )

    def write(self, reference: WalkReference, output: StabilizerOutput, index: int, row: Array) -> None:
        motion, correction = reference.feet[index], output.corrections[index]
        row[self._contact] = reference.contact[index]
        row[self._place] = pin.SE3ToXYZQUAT(motion.placement)
        row[self._velocity] = motion.velocity
        row[self._correction] = (correction.roll, correction.pitch, correction.height)
        row[self._wrench] = output.feet.wrenches[index]
