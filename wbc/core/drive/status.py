"""Status of a control in one line: what is refused, doubted, clipped, relaxed, failing or lost."""

from __future__ import annotations

import math

from wbc.core.drive.failures import FailureRecord
from wbc.core.drive.gate import CommandGate
from wbc.core.drive.sensing import Sensing
from wbc.core.estimation.checks.refusal import few
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import GRAVITY, Robot

FEET_STAY = 0.35
"""Distance of the DCM from the nearest sole that nothing recovers whose feet stay, as a multiple of the CoM height."""

UNUSUAL = {
    Status.RELAXED: ("relaxed: limits, hard tasks and contacts cannot all be satisfied",),
    Status.BADLY_SCALED: ("badly scaled: weights span too many decades, or friction is nearly zero",),
}
"""Words for a tick that was solved in another way than it was asked for."""


def status_of(
    sensing: Sensing, record: FailureRecord, gate: CommandGate, solution: Solution | None, *, lost: bool
) -> str:
    """Return the status of drives with these parts and the solution of the last tick; `lost` is their balance."""
    parts, plausibility = list[str](), sensing.plausibility
    if sensing.falls.reason is not None:
        parts.append(f"fallen: {sensing.falls.reason.value}{'; damped' if sensing.damped else ''}")
    if record.failing:
        parts.append(f"{'stopped' if record.stopped else 'failing'}: {record.reason}")
    if lost:
        parts.append("balance lost: the DCM is out of reach")
    if plausibility.faults:
        parts.append(f"refused: {few(plausibility.faults)}")
    if sensing.accelerometer.left_out:
        parts.append("refused: accelerometer, which contradicts attitude and legs")
    parts += [each for each in (plausibility.pull, plausibility.stamps.pace) if each]
    if sensing.monitor is not None and sensing.monitor.doubts:
        parts.append(f"doubtful: {', '.join(sensing.monitor.doubts)}")
    if solution is not None and not record.failing:
        parts += UNUSUAL.get(solution.status, ())
    if gate.faults:
        parts.append(f"command clipped: {', '.join(gate.faults)}")
    return "; ".join(parts) or "ok"


def balance_lost(robot: Robot, limit: float) -> bool:
    """Return True if the DCM is further from the soles than a limit, a multiple of the height of the CoM."""
    soles = [robot.placement(sole.frame).translation for sole in robot.soles]
    height = max(float(robot.com[2]) - min(float(sole[2]) for sole in soles), 0.0)
    dcm = robot.com[:2] + robot.com_velocity[:2] * math.sqrt(height / GRAVITY)
    return min(math.hypot(*(dcm - sole[:2])) for sole in soles) > limit * height
