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
from wbc.machine.conformance.body import Body
from wbc.machine.conformance.joints import Joints
from wbc.machine.conformance.rules import RULES
from wbc.machine.conformance.session import Check, ConformanceReport, Session
from wbc.machine.loop import Loop
from wbc.robots import RobotDescription

__all__ = ["Check", "ConformanceReport", "conformance"]

LONGEST_PERIOD = 0.025
"""Longest control period, s: a joint moves within 50 ms, of which a slower loop sees too little."""

LONGEST_DELAY = 0.2
"""Longest delay that can be stated, s: the way there and back of 0.1 s each, as a `wbc.sim.Machine` has at most."""

NEED_JOINTS = [
    name for name in RULES if name not in {"shapes", "hold", "joint order", "IMU frame, hanging", "clock"}
]
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
    session = Session(loop)
    if _check_shapes(session, session.measure()):
        session.settle()
        _check_motions(session, Joints(session, delay))
        _check_clock(session)
    return ConformanceReport(tuple(session.checks))


def _check_motions(session: Session, joints: Joints) -> None:
    """Make the checks in the order in which one depends on the others."""
    if joints.check_references():
        _check_hold(session)
        joints.check_following()
        joints.check_zeros()
        joints.check_torques()
        if joints.obey:
            body = Body(session)
            body.check_imu()
            body.check_wrenches()
            body.check_soles()
            joints.check_commanded_gains()  # last: a robot may fall by it
            return
    made = {check.name for check in session.checks}
    session.unknown("the joints do not follow", *(name for name in NEED_JOINTS if name not in made))


def _check_shapes(session: Session, m: Measurement) -> bool:
    na, soles, hands = session.robot.na, len(session.robot.soles), len(session.robot.frames)
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
    return session.judge("shapes", wrong=wrong, found="; ".join(wrong) or f"{na} joints, {soles} soles")


def _check_hold(session: Session) -> None:
    """Holding half-sitting, a robot at half-sitting does not move."""
    moved = float(np.abs(np.diff(session.rest.position, axis=0)).max())
    session.judge("hold", moved=1e3 * moved, rate=float(np.median(np.abs(session.rest.velocity[-10:]))))


def _check_clock(session: Session) -> None:
    steps = np.concatenate([np.diff(record.time) for record in session.records])
    period, mean = session.period, float(steps.mean())
    session.judge(
        "clock",
        ratio=mean / period,
        mean=1e3 * mean,
        least=steps.min(),
        worst=1e3 * float(np.abs(steps - period).max()),
        period=1e3 * period,
        rate=1.0 / mean if mean else np.inf,
        stated=1.0 / period,
    )
