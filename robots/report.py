"""The facts of a robot for JSON, as text, and what is doubtful about them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.drive.servos import ANKLE_SHARE
from wbc.core.qp.closure import LoopClosure
from wbc.core.robot import SIDES, Robot
from wbc.robots.derivation.defaults import feet_hint
from wbc.robots.derivation.legs import FULL_LEG
from wbc.robots.notes import listed
from wbc.robots.tidying import TAKEN_RANGE

NEAR_LIMIT = 0.6
"""Share of a torque limit from which on a joint that only stands is doubtful."""

UNLIKE = 0.01
"""Share by which the mass of the legs may differ."""

FASTEST = 100.0
"""Doubtful limits of speeds, rad/s: drives of humanoids reach 40."""

Doubt = tuple[str, list[str]]
"""A doubt, and the joints that it is about; one about no joints is none."""

HEADINGS = {
    "velocity": "rad/s",
    "torque": "Nm",
    "half_sitting": "sitting",
    "armature": "kg m²",
    "kp": "kp",
    "kd": "kd",
}
"""Columns of the joints in a report: key of the facts → heading."""


def facts(robot: Any) -> dict[str, Any]:
    """Return mass, size, soles, joints and sources of a `RobotDescription`, which imports this, ready for JSON."""
    model = robot.robot()
    return {
        "name": robot.name,
        "mass_kg": model.mass,
        "height_m": robot.height,
        "com_height_m": float(model.com[2]),
        "dof": model.na,
        "nv": model.nv,
        "legs": dict(zip(SIDES, map(list, robot.legs), strict=True)),
        "soles": {
            sole.name: {
                "frame": sole.frame,
                "link": sole.link,
                "size_m": [sole.length, sole.width],
                "ankle_m": robot.ankle(sole.name).tolist(),
            }
            for sole in robot.soles
        },
        "torso": robot.torso,
        "imu": robot.imu.frame,
        "hands": dict(robot.hands),
        "sensors": dict(robot.sensors),
        "joints": _joints(robot, model),
        "source": robot.source,
        "licence": robot.licence,
        "derived": list(robot.derived),
    }


def _joints(robot: Any, model: Robot) -> dict[str, dict[str, Any]]:
    """Return joint → its unit, limits, posture, rotor, servo gains and passive forces."""
    limits = model.velocity_limit, model.torque_limit
    columns = (*limits, model.half_sitting[model.base_nq :], robot.armature_array, robot.kp, robot.kd)
    ends = zip(model.position_lower.tolist(), model.position_upper.tolist(), strict=True)
    return {
        name: {
            "unit": "m" if slides else "rad",
            "position": [end if math.isfinite(end) else None for end in pair],
            **dict(zip(HEADINGS, map(float, values), strict=True)),
            "damping": float(robot.damping.get(name, 0.0)),
            "frictionloss": float(robot.frictionloss.get(name, 0.0)),
            "gains": "given" if name in robot.gains else "derived",
        }
        for name, slides, pair, *values in zip(robot.joint_names, model.slides, ends, *columns, strict=True)
    }


def report(facts: Mapping[str, Any]) -> str:
    """Return the facts of `RobotDescription.summary` as text of several lines."""
    height = "unknown" if facts["height_m"] is None else f"{facts['height_m']:.2f} m"
    lines = [
        f"{facts['name']}: {facts['mass_kg']:.2f} kg, height {height}, centre of mass at "
        f"{facts['com_height_m']:.3f} m in half-sitting, {facts['dof']} joints",
        f"  source   {facts['source']}",
        f"  licence  {facts['licence']}",
    ]
    for name, sole in facts["soles"].items():
        length, width = 1e3 * np.array(sole["size_m"])
        x, y, z = 1e3 * np.array(sole["ankle_m"])
        lines.append(
            f"  {name:<10}  {sole['frame']}: {length:.0f} x {width:.0f} mm, ankle at ({x:.0f}, {y:.0f}, {z:.0f}) mm"
        )
    lines.append(f"  torso  {facts['torso']}, IMU {facts['imu']}, hands {facts['hands'] or 'none'}")
    heads = "".join(f"  {heading:>9}" for heading in HEADINGS.values())
    lines.append(f"  {'joint (half-sitting in deg)':<28}  {'range deg':>15}{heads}  gains")
    for name, joint in facts["joints"].items():
        shown = 1e3 if joint["unit"] == "m" else np.degrees(1.0)
        low, high = (end and shown * end for end in joint["position"])
        span = "without end" if low is None or high is None else f"{low:.0f} .. {high:.0f}"
        values = joint | {"half_sitting": shown * joint["half_sitting"]}
        columns = "".join(f"  {values[key]:>9.4g}" for key in HEADINGS)
        lines.append(f"  {name:<28}  {span:>15}{columns}  {joint['gains']}")
    if sliding := [name for name, joint in facts["joints"].items() if joint["unit"] == "m"]:
        lines.append(f"  sliding joints, in mm, m/s, N and kg: {', '.join(sliding)}")
    if facts["derived"]:
        lines += ["  derived from the model:", *(f"    {line}" for line in facts["derived"])]
    return "\n".join(lines)


def doubts(robot: Any) -> tuple[str, ...]:
    """Return the doubtful values of a description, one line each."""
    model = robot.robot()
    if not robot.soles:
        hint = feet_hint(model.model)
        said = "no feet: it has a QP (docs/robots.md), but neither stands nor walks"
        first = [f"{said}; it has two lowest limbs: {hint}" if hint else said]
    else:
        first = _legs(robot, model)
    named = (f"{what}: {listed(names)}" for what, names in _by_joint(robot, model) if names)
    return (*first, *robot.doubtful, *named)


def _by_joint(robot: Any, model: Robot) -> list[Doubt]:
    """Return the doubts about torque limits, servos, rotors, passive forces and ranges."""
    tight = [
        f"{name} {share:.0%}" if math.isfinite(share) else f"{name}, which is driven the other way alone"
        for name, share in standing_torques(model).items()
        if share > NEAR_LIMIT
    ]
    undamped = [
        n for n, (kp, kd) in robot.gains.items() if kp > 0.0 and kd + robot.damping.get(n, 0.0) == 0.0
    ]
    light = [n for n, a in robot.armature.items() if a == 0.0 and n not in robot.passive]
    damping, friction = (max(each.values(), default=0.0) for each in (robot.damping, robot.frictionloss))
    (lower, upper), fast = robot.position_limits, robot.velocity_limit > FASTEST
    taken = np.maximum(abs(lower + TAKEN_RANGE), abs(upper - TAKEN_RANGE)) < 1e-6
    named = [[n for n, odd in zip(robot.joint_names, each, strict=True) if odd] for each in (fast, taken)]
    return [
        (f"standing still takes more than {NEAR_LIMIT:.0%} of the torque limit of", tight),
        ("given servo gains without damping", undamped),
        ("no rotor inertia (armature); real drives have some", light),
        (
            f"torques make up for damping of up to {damping:g} Nms/rad, which a real machine may not have",
            [f"{len(robot.damping)} joints"] if robot.damping else [],
        ),
        (
            f"dry friction up to {friction:g} Nm, which the controller neglects",
            [f"{len(robot.frictionloss)} joints"] if robot.frictionloss else [],
        ),
        (f"speed limits above {FASTEST:g} rad/s, in another unit or none?", named[0]),
        ("no position limits (±π taken)", named[1]),
    ]


def standing_torques(model: Robot) -> dict[str, float]:
    """Return joint → share of its torque limit that a robot in half-sitting takes, the weight on both soles."""
    if not model.soles:
        return {}
    gravity = model.bias  # and springs
    rows = [
        pin.computeFrameJacobian(model.model, model.data, model.q, model.frame_id(sole.frame), pin.LOCAL)
        for sole in model.soles
    ]
    for each in model.closures:
        closure = LoopClosure(each.frame, each.other, rotation=each.rotation)
        closure.bind(model)
        jacobian = np.zeros((closure.dim, model.nv))
        closure.evaluate(jacobian, np.zeros(closure.dim), np.zeros(closure.dim))
        rows.append(jacobian)
    jacobian = np.concatenate(rows)
    still = np.concatenate([np.arange(6), 6 + model.passive])  # what only forces of soles and closures hold
    wrench = np.linalg.lstsq(jacobian[:, still].T, gravity[still], rcond=None)[0]
    torque = gravity[6:] - jacobian[:, 6:].T @ wrench
    torque[model.passive] = 0.0
    bound = np.where(torque < 0.0, -model.torque_lower, model.torque_upper)
    shares = np.divide(np.abs(torque), bound, out=np.full(model.na, np.inf), where=bound > 0.0)
    shares[model.passive] = 0.0
    return dict(zip(model.joint_names, shares.tolist(), strict=True))


def _legs(robot: Any, model: Robot) -> list[str]:
    """Return the doubts about legs and feet, one line each."""
    left, right = robot.soles
    found = [
        f"the {side} leg has {len(leg)} joints: it cannot shift the weight sideways on a flat sole"
        for side, leg in zip(SIDES, robot.legs, strict=True)
        if len(leg) < FULL_LEG
    ]
    if max(abs(left.length - right.length), abs(left.width - right.width)) > 5e-3:
        sizes = [f"{1e3 * sole.length:.0f} x {1e3 * sole.width:.0f} mm" for sole in robot.soles]
        found.append(f"the soles differ: {sizes[0]} and {sizes[1]}")
    data = model.model.createData()
    pin.centerOfMass(model.model, data, pin.neutral(model.model))
    masses = [float(data.mass[model.model.getJointId(leg[0])]) for leg in robot.legs]
    if abs(masses[0] - masses[1]) > UNLIKE * max(masses):
        found.append(f"the legs differ in mass: {masses[0]:.2f} and {masses[1]:.2f} kg")
    if (ankle := robot.servos.soft_ankle) is not None:
        found.append(
            f"given servo gains are soft: kp of '{ankle}' is {robot.gains[ankle][0]:.0f} Nm/rad; position control "
            f"needs {ANKLE_SHARE:g} m g h, {ANKLE_SHARE * robot.servos.tipping:.0f} Nm/rad"
        )
    return found
