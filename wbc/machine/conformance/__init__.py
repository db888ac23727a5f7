"""Check of a loop: whether it measures and obeys as this library expects, and what is wrong if it does not.

    report = wbc.conformance(loop)
    print(report)

The robot stands at half-sitting, or hangs at it; drives follow position references. The motions are the
same whatever is found, of a few degrees at most; what is measured is compared with the model.
"""

from __future__ import annotations

import numpy as np

from wbc.core.errors import check_parts, non_negative
from wbc.core.signals import Measurement
from wbc.machine.conformance.body import BodyChecks
from wbc.machine.conformance.joints import JointChecks
from wbc.machine.conformance.session import Check, ConformanceReport
from wbc.machine.loop import Loop

__all__ = ["Check", "ConformanceReport", "conformance"]


def conformance(loop: Loop, *, delay: float = 0.0) -> ConformanceReport:
    """Check a loop by exciting it a little.

    Args:
        loop: A plant, a `wbc.sim.MujocoLoop`, a driver as `wbc.machine.DriverLoop`, or anything with `description`,
            `control_period`, `measure()` and `step(command)`. Its robot is at half-sitting, standing or hanging, and
            its drives follow position references.
        delay: Delay from a command to its effect in a measurement that the loop is known to have, s.

    Returns:
        One result a check.

    Raises:
        InputError: Something without the four parts of a loop, or a delay below zero.
    """
    delay = non_negative("delay of the loop (s)", delay)
    check_parts("a loop", loop, "description", "control_period", "measure", "step")
    return _Conformance(loop, delay).run()


class _Conformance(JointChecks, BodyChecks):
    """All checks, in the order in which one depends on the others."""

    def run(self) -> ConformanceReport:
        """Make all checks."""
        if not self._shapes(self.excite.first()):
            return ConformanceReport(tuple(self.checks))
        self.settle()
        self._hold()
        self.check_joints()
        self.check_zeros()
        self.check_torques()
        if not self.obeys:
            for name in (
                "accelerometer",
                "gyroscope",
                "IMU frame",
                "weight",
                "sides",
                "wrench frame",
                "soles",
            ):
                self.add(name, "unknown", "the joints do not follow")
            self._clock()
            return ConformanceReport(tuple(self.checks))
        self.check_imu()
        if self.standing and self.force_sensors:
            self.check_wrenches()
        else:
            why = "no force sensors" if self.standing else "the robot does not stand"
            for name in ("weight", "sides", "wrench frame"):
                self.add(name, "unknown", why)
        if self.standing:
            self.check_soles()
        else:
            self.add("soles", "unknown", why)
        self._clock()
        return ConformanceReport(tuple(self.checks))

    def _shapes(self, m: Measurement) -> bool:
        na, soles = self.robot.na, len(self.robot.soles)
        shapes = {
            "joint_position": (na,),
            "joint_velocity": (na,),
            "angular_velocity": (3,),
            "specific_force": (3,),
            "sole_wrench": (soles, 6),
        }
        wrong = []
        for name, shape in shapes.items():
            if name == "sole_wrench" and m.sole_wrench is None:
                continue
            value = np.asarray(getattr(m, name))
            if value.shape != shape:
                wrong.append(f"{name} has shape {value.shape}, not {shape}")
            elif value.dtype.kind != "f" or not np.isfinite(value).all():
                wrong.append(f"{name} is not made of finite floats")
        cause = "joints that the description has not or the machine has not; first tick fails"
        return self.add("shapes", not wrong, "; ".join(wrong) or f"{na} joints, {soles} soles", cause)

    def _hold(self) -> None:
        """Holding half-sitting, a robot at half-sitting does not move."""
        moved = float(np.abs(np.diff(self.rest.position, axis=0)).max())
        rate = float(np.median(np.abs(self.rest.velocity[-10:])))
        still = moved < 0.02 and rate < 0.15
        cause = (
            "the robot was not at half-sitting, references reach other joints or have another unit or zero than the "
            "encoders, or the drives are too soft to stand: it jumps when it is switched on"
        )
        self.add("hold", still, f"{1e3 * moved:.1f} mrad in a period, {rate:.3f} rad/s", cause)

    def _clock(self) -> None:
        steps = np.concatenate(
            [np.diff(record.time) for record in self.excite.records if len(record.time) > 1]
        )
        period = self.excite.period
        mean, worst = float(steps.mean()), float(np.abs(steps - period).max())
        ratio = mean / period
        cause = (
            "the time stamp stands still or runs backwards"
            if float(steps.min()) < 0.0 or mean <= 0.0
            else "time stamps in milliseconds"
            if abs(ratio - 1000.0) < 100.0
            else f"the loop runs at {1.0 / mean:.0f} Hz and not at the {1.0 / period:.0f} Hz that it states"
            if not 0.95 < ratio < 1.05
            else "time stamps jitter: those of the arrival, or samples are lost"
        )
        good = 0.95 < ratio < 1.05 and worst < 0.5 * period
        self.add("clock", good, f"period {1e3 * mean:.3f} ms, worst {1e3 * worst:.3f} ms off", cause)
