"""Text of a walk's result: how far the robot came, how it fell, how well it tracked, what its soles did."""

from __future__ import annotations

import math
import re
from collections import Counter
from pathlib import Path

import numpy as np

from wbc.base.files import file_of
from wbc.sim.walks.result import Spread, WalkResult
from wbc.sim.walks.spec import WalkSpec

REASONS = {"height": "it dropped", "tilt": "it tilted", "down": "it lay down", "solver": "the QP failed"}
"""Reason of a fall → words."""

CAUSES = {
    "dropped": "downwards",
    "forward": "forward",
    "backward": "backward",
    "left": "to the left",
    "right": "to the right",
}
"""Cause of a fall → words."""

SLIPPED = 0.03
"""Way of the soles along the ground from which a report tells it, m."""

ENDS = {"completed": "walked", "stopped": "stopped", "strayed": "STRAYED", "unfinished": "NOT DONE:"}
"""Outcome of a walk without a fall → word."""


def walk_text(result: WalkResult, spec: WalkSpec) -> str:
    """Return the text of a result."""
    # Of free steps none are planned.
    steps = f"{result.steps_done} {'' if spec.free else f'of {result.steps_planned} '}steps"
    lines = [_head(result, spec), *(f"  note      {note}" for note in result.notes)]
    if result.diverged is not None:
        lines.append(f"  DIVERGED  after {steps}: {result.diverged}")
        return "\n".join(lines)
    lines += [_end(result, steps), *_balance_lines(result, spec)]
    lines += [
        f"  torque    up to {100 * result.peak_torque_ratio:.0f} % of its limit ({result.peak_torque_joint})",
        f"  cost      {_cost(result)}",
    ]
    if result.slip > SLIPPED:
        lines.append(f"  SLIPPED   {1e3 * result.slip:.0f} mm, both soles together")
    lines += _soles_lines(result)
    if result.clock is not None:
        lines.append(f"  speed     {result.clock}; {result.failures} failed")
    return "\n".join(lines)


def _head(result: WalkResult, spec: WalkSpec) -> str:
    fixed = result.sole_stiffness is not None and result.stiffness is None
    foot = f"{result.foot} feet" + (f" of {result.sole_stiffness:g} Nm/rad" if fixed else "")
    ground = result.terrain + (f", {1e3 * result.amplitude:.0f} mm" if result.amplitude else "")
    kind = "free steps, " if spec.free else ""
    if spec.trained is not None:
        kind = f"trained policy {Path(file_of(spec.trained)).name}, "
    control = f"{kind}{spec.chosen} control, noise {spec.noise}"
    return f"{result.robot} on {foot}, {ground}, seed {result.seed}, {control}"


def _end(result: WalkResult, steps: str) -> str:
    fall, after = result.fall, f"{result.seconds:.1f} s"
    if fall is not None:
        return (
            f"  FELL      after {steps} and {after} ({REASONS[fall.reason]}); the fall "
            f"began {CAUSES[fall.cause]} at {100 * fall.share:.0f} % of the {fall.phase} of step {fall.step}, the "
            f"stance sole tilted by {math.degrees(fall.sole_roll):.1f}° roll, "
            f"{math.degrees(fall.sole_pitch):.1f}° pitch"
        )
    end = f"  {ENDS[result.outcome]:<9} {steps} in {after}"
    if result.outcome not in ("completed", "strayed") or result.goal_error is None:
        return end
    end += f", {result.goal_error:.2f} m from the goal"
    return end if result.outcome == "completed" else f"{end}, up to {result.track_error:.2f} m off the track"


def _balance_lines(result: WalkResult, spec: WalkSpec) -> list[str]:
    speed = "" if result.speed is None else f", {result.speed:.2f} m/s over its middle half"
    lines = [
        f"  distance  {result.distance:.2f} m, {100 * result.drift:+.1f} cm to the left, heading off by "
        f"{math.degrees(result.yaw_error):+.1f}°{speed}"
    ]
    if result.dcm_error_max is not None:  # a stepping walk has no references for them
        lines.append(
            f"  errors    ZMP {_mm(result.zmp_error)}, CoM {_mm(result.com_error)}, DCM {_mm(result.dcm_error)} mm, at "
            f"most {1e3 * result.dcm_error_max:.0f} mm"
        )
    if spec.trained is None:
        down = result.touchdowns
        most = "" if result.impact is None else f"; at most {result.impact:.2f} x weight"
        lines.append(
            f"  landing   {down.early} early, {down.on_time} on time, {down.late} late, {down.missed} without ground"
            f"{most}"
        )
    return lines


def _cost(result: WalkResult) -> str:
    legs, upper = result.energy.legs, result.energy.upper_body
    work = f"{legs + upper:.0f} J, {legs:.0f} J of them in the legs; vibration {result.vibration:.3g} rad/s²"
    transport = result.cost_of_transport
    return work if transport is None else f"of transport {transport:.2f}: {work}"


def _soles_lines(result: WalkResult) -> list[str]:
    steps = result.stiffness
    if not steps:
        return []
    decided = [step["commanded_nm_per_rad"] for step in steps if step["fallback"] is None]
    reached = sum(step["reached"] for step in steps)
    text = (
        f"  soles     set by the policy '{result.policy}': decided in {len(decided)} of {len(steps)} swings"
    )
    if decided:
        low, middle, high = (f"{k:.3g}" for k in np.percentile(decided, (0, 50, 100)))
        text += f", {low} … {high} Nm/rad, median {middle}"
    second = f"stiffness reached before the landing in {reached} of {len(steps)}"
    reasons = Counter(re.split("[:,]", step["fallback"])[0] for step in steps if step["fallback"] is not None)
    if reasons:
        counts = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
        second = f"fell back in the others ({counts}); {second}"
    lines = [text, f"            {second}"]
    errors = [step["profile_error_m"] for step in steps if step["profile_error_m"] is not None]
    if errors:
        mean, most = (1e3 * float(np.mean([error[part] for error in errors])) for part in ("mean", "p95"))
        clock = result.clock.decision_us if result.clock is not None else None
        time = "" if clock is None else f"; decided in {clock['median']:.0f} us, {clock['max']:.0f} at most"
        lines.append(
            f"  scan      {mean:.1f} mm from the true ground, 95 % of a scan within {most:.1f} mm{time}"
        )
    return lines


def _mm(spread: Spread) -> str:
    if spread.mean is None or spread.std is None:
        return "–"
    return f"{1e3 * spread.mean:.1f} ± {1e3 * spread.std:.1f}"
