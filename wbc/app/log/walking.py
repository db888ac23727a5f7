"""Signals of a walk: references of the pattern, output of the stabilizer, phases and events."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.app.log.columns import QUATERNION, WRENCH, WRENCH_UNITS, XY, XYZ, Columns, foot_names
from wbc.app.log.tick import Source, Tick
from wbc.core.errors import Array
from wbc.tasks.stabilizer.admittance import FootCorrection
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput
from wbc.walking.progress import ReferenceLike, WalkingLike

_NONE = (math.nan,) * 5
"""Side and landing after the last step."""

_NO_VELOCITY = (math.nan,) * 3
"""Commanded velocity of a robot whose footsteps come from elsewhere."""

_NO_CORRECTION = FootCorrection(math.nan, math.nan, math.nan)
"""Correction of a foot in a walk without a stabilizer."""


class WalkSource(Source):
    """Phase, references and stabilizer of a walk; NaN and null without a reference or a stabilizer.

    A tick is written with one assignment for single values and one for arrays, in the order of the columns.

    Attributes:
        omega: Column of the natural frequency.
    """

    def __init__(self, columns: Columns, tick: Tick, com: slice, com_velocity: slice) -> None:
        """Add the columns.

        Args:
            columns: Takes the columns.
            tick: The first tick.
            com: Columns of the estimated centre of mass.
            com_velocity: Columns of its velocity.
        """
        self._columns, self._fallen = columns, False
        self._estimated = (com, com_velocity)
        self._phase: tuple[Any, int] = (None, 0)  # phase, and index of its text
        self._step: tuple[Any, tuple[float, ...]] = (None, _NONE)  # step, and its values in the row
        feet = foot_names(tick.robot)
        self._values = self._add_values(columns, feet)
        self._arrays = self._add_arrays(columns, feet)
        self._dcm = columns.group("dcm/reference", XY, "m", "world")
        self._dcm_estimated = columns.group("dcm/estimated", XY, "m", "of the estimated CoM, world")

    def _add_values(self, columns: Columns, feet: list[str]) -> slice:
        """Add the columns of single values."""
        first = columns.add("walk/phase", "1", "phase of the walk", "text")
        columns.add("walk/event", "1", "events of this tick, separated by ';'", "text")
        columns.add("walk/step", "1", "index of the step that swings, or swings next", "whole")
        columns.add("walk/steps_done", "1", "single supports that have ended", "whole")
        columns.add("walk/heading", "rad", "desired heading of pelvis and torso")
        columns.add("step/side", "1", "foot that swings, or swings next", "text")
        place = ("x", "y", "z", "yaw")
        columns.group("step/landing", place, ("m", "m", "m", "rad"), "planned landing, world")
        self.omega = columns.add("pendulum/omega", "1/s", "natural frequency")
        columns.group(
            "walk/lean", ("roll", "pitch"), ("rad", "rad"), "of the trunk, about x and y of the world"
        )
        columns.group("stabilizer/bias", XY, "m", "estimated in the measured DCM and subtracted, world")
        velocity, units = ("forward", "left", "turn"), ("m/s", "m/s", "rad/s")
        columns.group("drive/commanded", velocity, units, "commanded velocity; NaN while none is")
        columns.group("drive/granted", velocity, units, "velocity that the planned footsteps give")
        columns.add("stabilizer/in_air", "1", "neither foot has contact", "flag")
        for foot in feet:
            columns.add(f"foot/{foot}/contact", "1", "planned contact", "flag")
            tilts, units = ("roll", "pitch", "height"), ("rad", "rad", "m")
            columns.group(f"foot/{foot}/correction", tilts, units, "added by the stabilizer")
        return columns.since(first)

    def _add_arrays(self, columns: Columns, feet: list[str]) -> slice:
        """Add the columns of arrays."""
        self._com = columns.group("com/reference", XYZ, "m", "world")
        self._velocity = columns.group("com/reference_velocity", XYZ, "m/s", "world")
        columns.group("com/reference_acceleration", XYZ, "m/s²", "world")
        columns.group("zmp/reference", XYZ, "m", "world")
        desired = columns.group("zmp/desired", XYZ, "m", "of the desired net wrench, world")
        columns.group("zmp/measured", XYZ, "m", "of the measured foot wrenches, world")
        columns.group("stabilizer/dcm_error", XY, "m", "target minus measured, world")
        columns.group("stabilizer/dcm_error_average", XY, "m", "world")
        columns.group("stabilizer/dcm_error_rate", XY, "m/s", "world")
        columns.group("stabilizer/com_acceleration", XYZ, "m/s²", "desired, world")
        columns.group("stabilizer/net_wrench", WRENCH, WRENCH_UNITS, "desired, at the world origin")
        columns.group("stabilizer/com_offset", XY, "m", "added to the CoM target, world")
        for foot in feet:
            about = "desired by the stabilizer, sole frame"
            columns.group(f"foot/{foot}/wrench_desired", WRENCH, WRENCH_UNITS, about)
        output = columns.since(desired.start)
        self._no_output = (np.full(output.stop - output.start, math.nan),)
        for foot in feet:
            name = f"foot/{foot}/reference"
            columns.group(f"{name}/position", XYZ, "m", "sole centre, world")
            columns.group(f"{name}/orientation", QUATERNION, "1", "sole frame in the world")
            columns.group(f"{name}/linear_velocity", XYZ, "m/s", "world")
            columns.group(f"{name}/angular_velocity", XYZ, "rad/s", "world")
        return columns.since(self._com.start)

    def write(self, tick: Tick, row: Array) -> None:
        walk = tick.walking
        assert walk is not None
        reference, output = walk.reference, walk.output
        if reference is None:
            row[self._values] = row[self._arrays] = math.nan
            return
        pendulum = reference.pendulum
        left, right = (_NO_CORRECTION, _NO_CORRECTION) if output is None else output.corrections
        row[self._values] = (
            self._phase_number(reference),
            self._events(walk, reference),
            reference.step,
            walk.steps_done,
            reference.heading,
            *self._next_step(walk),
            pendulum.omega,
            *(walk.lean.angle if walk.lean is not None else (0.0, 0.0)),
            *(walk.bias.bias.tolist() if walk.bias is not None else (0.0, 0.0)),
            *(walk.velocity or _NO_VELOCITY),
            *walk.granted_velocity,
            math.nan if output is None else output.in_air,
            reference.contact[0],
            left.roll,
            left.pitch,
            left.height,
            reference.contact[1],
            right.roll,
            right.pitch,
            right.height,
        )
        parts = [
            pendulum.com,
            pendulum.com_velocity,
            pendulum.com_acceleration,
            pendulum.zmp,
            *(self._no_output if output is None else _arrays(output)),
        ]
        for motion in reference.feet:
            parts += (pin.SE3ToXYZQUAT(motion.placement), motion.velocity)
        np.concatenate(parts, out=row[self._arrays])

    def _phase_number(self, reference: ReferenceLike) -> int:
        """Return the index of the phase's text."""
        if reference.phase is not self._phase[0]:
            self._phase = (reference.phase, self._columns.text(reference.phase.value))
        return self._phase[1]

    def _events(self, walk: WalkingLike, reference: ReferenceLike) -> float:
        """Return the index of the text of this tick's events; NaN without any."""
        fallen = walk.fallen is not None and not self._fallen
        if not reference.events and not fallen:
            return math.nan
        events = [event.value for event in reference.events]
        if fallen and walk.fallen is not None:
            self._fallen = True
            events.append(f"fallen: {walk.fallen.value}")
        return self._columns.text("; ".join(events))

    def _next_step(self, walk: WalkingLike) -> tuple[float, ...]:
        """Return side (index of its text) and pose of the next landing."""
        upcoming = walk.progress.upcoming
        if not upcoming:
            return _NONE
        step = upcoming[0]
        if step is not self._step[0]:
            self._step = (step, (self._columns.text(step.side), step.x, step.y, step.z, step.yaw))
        return self._step[1]

    def finish(self, rows: Array) -> None:
        omega = rows[:, self.omega, None]
        for dcm, com, velocity in (
            (self._dcm, self._com, self._velocity),
            (self._dcm_estimated, *self._estimated),
        ):
            rows[:, dcm] = rows[:, com][:, :2] + rows[:, velocity][:, :2] / omega


def _arrays(output: StabilizerOutput) -> tuple[Array, ...]:
    """Return the arrays of a stabilizer's output, in the order of the columns."""
    errors = output.errors
    return (
        output.zmp,
        output.measured_zmp,
        errors.dcm,
        errors.average,
        errors.rate,
        output.com_acceleration,
        output.net_wrench,
        output.com_offset,
        output.feet.wrenches.ravel(),
    )
