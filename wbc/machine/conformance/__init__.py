"""Check of a loop: whether it measures and obeys as this library expects, and what is wrong if it does not.

    report = wbc.conformance(loop)
    print(report)

The robot stands at half-sitting, or hangs at it; drives follow position references. `Session` makes motions of a few
degrees at most and records them; the groups of `CHECKS` compare what was measured with the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, check_parts, shown
from wbc.base.numbers import finite_scalar
from wbc.base.settings import Share
from wbc.machine.conformance.body import imu, soles, wrenches
from wbc.machine.conformance.joints import commanded_gains, joints, rest, torques
from wbc.machine.conformance.session import Check, Session
from wbc.machine.loop import Loop, check_described

__all__ = ["Check", "ConformanceReport", "conformance"]

LONGEST_PERIOD = 0.025
"""Longest control period, s: a joint moves within 50 ms, of which a slower loop sees too little."""

LONGEST_DELAY = 0.2
"""Longest delay that can be stated, s: the way there and back of 0.1 s each, as a `wbc.sim.Machine` has at most."""


@dataclass(frozen=True)
class ConformanceReport:
    """Results of all checks.

    Attributes:
        checks: All checks, in the order in which they were made.
    """

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """True if nothing is wrong."""
        return not self.wrong

    @property
    def wrong(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.state == "wrong")

    def __str__(self) -> str:
        lines = []
        for check in self.checks:
            lines.append(f"{check.state:9}{check.name:20}{check.found}")
            if check.cause:
                lines.append(f"{'':29}{check.cause}")
        return "\n".join(lines)


@checked
def conformance(
    loop: Loop, *, delay: Annotated[Share, Field(le=LONGEST_DELAY), "s"] = 0.0
) -> ConformanceReport:
    """Check a loop by small excitations of its robot.

    Args:
        loop: A plant, a `wbc.sim.MujocoLoop`, a `wbc.machine.DriverLoop`, or any object with `description`,
            `control_period`, `measure()` and `step(command)`. Its robot must be at half-sitting, standing or hanging,
            and its drives must follow position references.
        delay: Known delay of the loop from a command to its effect in a measurement, 0 to 0.2 s.

    Returns:
        One result for each check.

    Raises:
        MeasurementError: `measure` returns an object that is not a `Measurement`.
    """
    if isinstance(loop, type):
        raise InputError(f"a loop must be an object, got the class {shown(loop)}: make one of it")
    check_parts("a loop", loop, "description", "control_period", "measure", "step")
    check_described("loop", loop)
    finite_scalar("control period of the loop (s)", loop.control_period, above=0.0, high=LONGEST_PERIOD)
    session = Session(loop, delay)
    for group, names in CHECKS:
        why = session.lost if session.lost and group is not _clock else group(session)
        for name in names:
            if name not in session.checks:
                session.unknown(name, why)
    return ConformanceReport(tuple(session.checks.values()))


def _shapes(s: Session) -> str:
    measurement, wrong = s.measure(), []
    for name, shape in s.shapes.items():
        value = getattr(measurement, name)
        if value is None and name in {"sole_wrench", "joint_torque", "hand_wrenches"}:
            continue
        array = np.asarray(value)
        if array.shape != shape:
            wrong.append(f"{name} has shape {array.shape}, not {shape}")
        elif array.dtype.kind not in ("iuf" if name == "time" else "f"):
            wrong.append(f"{name} is not made of floats")
        elif not (np.isfinite(array) | (name == "hand_wrenches" and np.isnan(array))).all():
            wrong.append(f"{name} is not finite")
    found = "; ".join(wrong) or f"{s.robot.na} joints, {len(s.robot.soles)} soles"
    s.check("shapes", found, shape=wrong)
    s.lost = "shapes are wrong" if wrong else ""
    return ""


def _clock(s: Session) -> str:
    if not s.records:
        return s.lost
    steps, period = 1e3 * np.concatenate([np.diff(record["time"]) for record in s.records]), 1e3 * s.period
    mean, worst = float(steps.mean()), float(np.abs(steps - period).max())
    rate = 1e3 / mean if mean else np.inf
    s.check(
        "clock",
        f"{rate:.0f} Hz of {1e3 / period:.0f} Hz stated, period {mean:.3f} ms, worst {worst:.3f} ms off",
        still=steps.min() < 0.0 or mean <= 0.0,
        milliseconds=abs(mean / period - 1000.0) < 100.0,
        rate=not s.right("clock", mean / period),
        jitter=worst >= 0.5 * period,
    )
    return ""


CHECKS: tuple[tuple[Callable[[Session], str], tuple[str, ...]], ...] = (
    (_shapes, ("shapes",)),
    (rest, ("rest",)),
    (joints, ("joint order", "joint motion", "joint velocity", "fresh", "delay", "joint zero")),
    (torques, ("torque", "velocity reference", "measured torque")),
    (imu, ("accelerometer", "gyroscope", "IMU frame")),
    (wrenches, ("weight", "sides", "wrench frame")),
    (soles, ("soles",)),
    (commanded_gains, ("commanded gains",)),  # late: a robot may fall by it
    (_clock, ("clock",)),
)
"""Groups of checks in the order in which one depends on the others, with their names; a group returns why those that it
has not made cannot be made."""
