"""Check of a loop: whether it measures and obeys as this library expects, and what is wrong if it does not.

    report = wbc.conformance(loop)
    print(report)

The robot stands at half-sitting, or hangs at it; drives follow position references. The motions are the
same whatever is found, of a few degrees at most; what is measured is compared with the model.
"""

from __future__ import annotations

import numpy as np

from wbc.core.errors import InputError, check_parts, finite_scalar, shown
from wbc.core.signals import Measurement
from wbc.machine.conformance.body import BodyChecks
from wbc.machine.conformance.joints import JointChecks
from wbc.machine.conformance.session import Check, ConformanceReport
from wbc.machine.loop import Loop
from wbc.robots import RobotDescription

__all__ = ["Check", "ConformanceReport", "conformance"]

LONGEST_PERIOD = 0.025
"""Longest control period, s: a joint moves within 50 ms, of which a slower loop sees too little."""

LONGEST_DELAY = 0.2
"""Longest delay that can be stated, s: the way there and back of 0.1 s each, as a `wbc.sim.Machine` has at most."""

OF_JOINTS: tuple[str, ...] = (
    *("joint sign", "joint unit", "joint velocity", "fresh", "delay", "joint zero"),
    *("torque", "gains", "velocity reference", "measured torque"),
)
OF_BODY = (
    *("accelerometer", "gyroscope", "IMU frame", "weight", "sides", "wrench frame", "soles"),
    "commanded gains",
)
"""Checks that need joints which follow position references, in their order."""


def conformance(loop: Loop, *, delay: float = 0.0) -> ConformanceReport:
    """Check a loop by exciting it a little.

    Args:
        loop: A plant, a `wbc.sim.MujocoLoop`, a driver as `wbc.machine.DriverLoop`, or anything with `description`,
            `control_period`, `measure()` and `step(command)`. Its robot is at half-sitting, standing or hanging, and
            its drives follow position references.
        delay: Delay from a command to its effect in a measurement that the loop is known to have, 0 to 0.2 s.

    Returns:
        One result a check.

    Raises:
        InputError: Something without the four parts of a loop, a control period above 0.025 s, a delay out of range.
        MeasurementError: `measure` returns something else than a `Measurement`.
    """
    delay = finite_scalar("delay of the loop (s)", delay, low=0.0, high=LONGEST_DELAY)
    if isinstance(loop, type):
        raise InputError(f"a loop must be an object, got the class {shown(loop)}: make one of it")
    check_parts("a loop", loop, "description", "control_period", "measure", "step")
    if not isinstance(loop.description, RobotDescription):
        raise InputError(f"description of a loop must be a RobotDescription, got {shown(loop.description)}")
    finite_scalar(
        "control period of the loop (s)", loop.control_period, low=0.0, high=LONGEST_PERIOD, open_low=True
    )
    return _Conformance(loop, delay).run()


class _Conformance(JointChecks, BodyChecks):
    """All checks, in the order in which one depends on the others."""

    def run(self) -> ConformanceReport:
        """Make all checks."""
        if not self._shapes(self.excite.measure()):
            return ConformanceReport(tuple(self.checks))
        self.settle()
        moves = self.move_joints()
        if not self.check_references(moves):
            return self._end(OF_JOINTS + OF_BODY, "the joints do not follow")
        self._hold()
        self.check_joints(moves)
        self.check_zeros()
        self.check_torques()
        if not self.obeys:
            return self._end(OF_BODY, "the joints do not follow")
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
        self.check_commanded_gains()  # last: a robot may fall by it
        return self._end()

    def _end(self, left: tuple[str, ...] = (), why: str = "") -> ConformanceReport:
        """Add what cannot be told for a reason, and the clock."""
        for name in left:
            self.add(name, "unknown", why)
        self._clock()
        return ConformanceReport(tuple(self.checks))

    def _shapes(self, m: Measurement) -> bool:
        na, soles, hands = self.robot.na, len(self.robot.soles), len(self.robot.frames)
        needed: dict[str, tuple[int, ...]] = {
            "time": (),
            "joint_position": (na,),
            "joint_velocity": (na,),
            "angular_velocity": (3,),
            "specific_force": (3,),
        }
        optional = {"sole_wrench": (soles, 6), "joint_torque": (na,), "hand_wrenches": (hands, 6)}
        wrong = []
        for name, shape in (needed | optional).items():
            value = getattr(m, name)
            if value is None and name in optional:
                continue
            array = np.asarray(value)
            if array.shape != shape:
                wrong.append(f"{name} has shape {array.shape}, not {shape}")
            elif array.dtype.kind not in ("iuf" if name == "time" else "f"):
                wrong.append(f"{name} is not made of floats")
            elif not (np.isfinite(array) | (name == "hand_wrenches" and np.isnan(array))).all():
                wrong.append(f"{name} is not finite")
        cause = "joints, soles or hands that the description has not or the machine has not; first tick fails"
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
