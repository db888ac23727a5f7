"""The facts of a robot for JSON, as text, and what is doubtful about them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.robot import GRAVITY, SIDES
from wbc.core.servos import ANKLE_SHARE
from wbc.robots.derivation.defaults import feet_hint
from wbc.robots.urdf import CONTINUOUS_RANGE

NEAR_LIMIT = 0.6
"""Share of a torque limit from which on a joint that only stands is doubtful."""

UNLIKE = 0.01
"""Share by which the mass of the legs may differ."""

MOST_RANGE = 4.0 * math.pi
"""Range of a joint from which on its limits may be in degrees, rad."""

UNMODELLED = "not in the controller's model: "
"""Beginning of a note on a force that the controller does not know of."""

TALLEST = 3.0
"""Height of the centre of mass from which on lengths may be in another unit, m."""

DENSITY = (5.0, 2000.0)
"""Range of mass over the height of the centre of mass cubed, kg/m³; Talos 134, a man 70, Robotis OP3 185."""

GYRATION = (0.002, 0.8)
"""Range of the radius of gyration of a link, heights of the centre of mass."""

INERTIA_UNITS = {
    "kg mm²": 1e-6,
    "kg cm²": 1e-4,
    "g m²": 1e-3,
    "g cm²": 1e-7,
    "g mm²": 1e-9,
}
"""Units of inertia that files have by mistake → in kg m²."""

FASTEST = 100.0
"""Speed limit from which on a joint is doubtful, rad/s or m/s: drives of humanoids reach 40."""

SLOW = 1.0
"""Speed limit of a leg joint below which a step is doubtful, rad/s; published ones are 2 to 30."""

BRAKED = 6.0
"""Speed at which damping may take all torque of a leg joint, rad/s; swings reach 3 to 8."""

FULL_LEG = 6
"""Joints of a leg that can put its sole anywhere."""


def facts(robot: Any) -> dict[str, Any]:
    """Return mass, size, soles, joints and sources of a robot, ready for JSON."""
    model = robot.robot()
    values = {
        "velocity": model.velocity_limit,
        "torque": model.torque_limit,
        "half_sitting": model.half_sitting[7:],
        "armature": robot.armature_array,
        "kp": robot.kp,
        "kd": robot.kd,
    }
    joints: dict[str, dict[str, Any]] = {}
    for i, name in enumerate(robot.joint_names):
        slides = model.model.joints[i + 2].shortname().startswith("JointModelP")
        joints[name] = {
            "unit": "m" if slides else "rad",
            "position": [float(model.position_lower[i]), float(model.position_upper[i])],
            **{key: float(array[i]) for key, array in values.items()},
            "damping": float(robot.damping.get(name, 0.0)),
            "frictionloss": float(robot.frictionloss.get(name, 0.0)),
            "gains": robot.servo_gains[name].source,
        }
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
        "joints": joints,
        "source": robot.source,
        "licence": robot.licence,
        "derived": list(robot.derived),
    }


HEADINGS = {
    "velocity": "rad/s",
    "torque": "Nm",
    "half_sitting": "sitting",
    "armature": "kg m²",
    "kp": "kp",
    "kd": "kd",
}
"""Columns of the joints in a report: key of the facts → heading."""


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
            f"  {name:<10} {sole['frame']}: {length:.0f} x {width:.0f} mm, ankle at ({x:.0f}, {y:.0f}, {z:.0f}) mm"
        )
    lines.append(f"  torso {facts['torso']}, IMU {facts['imu']}, hands {facts['hands'] or 'none'}")
    heads = "".join(f" {heading:>9}" for heading in HEADINGS.values())
    lines.append(f"  {'joint (half-sitting in deg)':<28} {'range deg':>15}{heads}  gains")
    for name, joint in facts["joints"].items():
        shown = 1e3 if joint["unit"] == "m" else np.degrees(1.0)
        low, high = shown * np.array(joint["position"])
        values = joint | {"half_sitting": shown * joint["half_sitting"]}
        columns = "".join(f" {values[key]:>9.4g}" for key in HEADINGS)
        lines.append(f"  {name:<28} {f'{low:.0f} .. {high:.0f}':>15}{columns}  {joint['gains']}")
    if sliding := [name for name, joint in facts["joints"].items() if joint["unit"] == "m"]:
        lines.append(f"  sliding joints, in mm, m/s, N and kg: {', '.join(sliding)}")
    if facts["derived"]:
        lines += ["  derived from the model:", *(f"    {line}" for line in facts["derived"])]
    return "\n".join(lines)


def doubts(robot: Any) -> tuple[str, ...]:
    """Return what of a description is doubtful, one line each."""
    found = (
        _scale(robot)
        + _drives(robot)
        + _legs(robot)
        + [line for line in robot.derived if line.startswith(UNMODELLED)]
    )
    tight = [
        f"{name} {share:.0%}" if math.isfinite(share) else f"{name}, which is driven the other way alone"
        for name, share in standing_torques(robot).items()
        if share > NEAR_LIMIT
    ]
    if tight:
        found.append(
            f"standing still takes more than {NEAR_LIMIT:.0%} of the torque limit of: {', '.join(tight)}"
        )
    if any("torque limits not given" in line for line in robot.derived):
        found.append(
            "torque limits that the file does not give are guessed from mass and size; see the list above"
        )
    if fast := [n for n, v in zip(robot.joint_names, robot.velocity_limit, strict=True) if v > FASTEST]:
        found.append(f"speed limits above {FASTEST:g} rad/s, in another unit or none? {listed(fast)}")
    limits = [*zip(robot.joint_names, *robot.position_limits, strict=True)]
    if wide := [name for name, low, high in limits if _is_taken(low, high)]:
        found.append(f"no position limits (±π taken): {listed(wide)}")
    if turns := [name for name, low, high in limits if high - low > MOST_RANGE]:
        found.append(f"position limits of more than two turns, in degrees? {listed(turns)}")
    return tuple(found)


def standing_torques(robot: Any) -> dict[str, float]:
    """Return joint → share of its torque limit that half-sitting takes, the weight on both soles."""
    model = robot.robot()
    if not model.soles:
        return {}
    gravity = model.bias  # and springs
    jacobian = np.concatenate(
        [
            pin.computeFrameJacobian(model.model, model.data, model.q, model.frame_id(sole.frame), pin.LOCAL)
            for sole in model.soles
        ]
    )
    wrench = np.linalg.lstsq(jacobian[:, :6].T, gravity[:6], rcond=None)[0]
    torque = gravity[6:] - jacobian[:, 6:].T @ wrench
    bound = np.where(torque < 0.0, -model.torque_lower, model.torque_upper)
    shares = np.divide(np.abs(torque), bound, out=np.full(model.na, np.inf), where=bound > 0.0)
    return dict(zip(robot.joint_names, shares.tolist(), strict=True))


def _drives(robot: Any) -> list[str]:
    found, model = [], robot.robot()
    tipping = model.mass * GRAVITY * float(model.com[2])
    soft = {
        name: robot.servo_gains[name].kp
        for leg in robot.legs
        for name in leg[-2:]
        if robot.servo_gains[name].source == "given" and robot.servo_gains[name].kp < ANKLE_SHARE * tipping
    }
    if soft:
        name, kp = min(soft.items(), key=lambda item: item[1])
        found.append(
            f"given servo gains are soft: kp of '{name}' is {kp:.0f} Nm/rad, {kp / tipping:.2f} m g h; position "
            f"control needs {ANKLE_SHARE:g} m g h, {ANKLE_SHARE * tipping:.0f} Nm/rad"
        )
    undamped = [
        name
        for name, (kp, kd) in robot.gains.items()
        if kp > 0.0 and kd + robot.damping.get(name, 0.0) == 0.0
    ]
    if undamped:
        found.append(f"given servo gains without damping: {listed(undamped)}")
    bare = [name for name in robot.joint_names if robot.armature[name] == 0.0]
    if bare:
        found.append(f"no rotor inertia (armature); real drives have some: {listed(bare)}")
    rubbing = {**robot.damping, **robot.frictionloss}
    if rubbing:
        found.append(
            f"damping up to {max(robot.damping.values(), default=0.0):g} Nms/rad and dry friction up to "
            f"{max(robot.frictionloss.values(), default=0.0):g} Nm of {len(rubbing)} joints are "
            "not in the controller's model"
        )
    speeds = {name: model.velocity_limit[model.joint_index(name)] for leg in robot.legs for name in leg}
    if slow := [f"{name} {speed:.2g} rad/s" for name, speed in speeds.items() if speed < SLOW]:
        found.append(f"legs that step need quicker joints: {listed(slow)}")
    braked = {
        name: model.torque_limit[model.joint_index(name)] / robot.damping[name]
        for name in speeds
        if robot.damping.get(name)
    }
    if braked := {name: speed for name, speed in braked.items() if speed < BRAKED}:
        name, speed = min(braked.items(), key=lambda item: item[1])
        found.append(
            f"damping takes the whole torque of {len(braked)} leg joints at the speeds of a step, that of '{name}' at "
            f"{speed:.2g} rad/s"
        )
    return found


def _scale(robot: Any) -> list[str]:
    """Return doubts about the units of lengths, masses and inertias."""
    model = robot.robot()
    mass, height = model.mass, float(model.com[2])
    if not robot.soles or height <= 0.0:
        return []
    found = []
    if height > TALLEST:
        unit, factor = ("centimetres", 1e-2) if height < 1e2 * TALLEST else ("millimetres", 1e-3)
        found.append(
            f"the centre of mass is {height:.4g} m high: lengths in {unit} ({factor * height:.4g} m)?"
        )
    elif not DENSITY[0] < mass / height**3 < DENSITY[1]:
        unit, factor = ("grams", 1e-3) if mass / height**3 > DENSITY[1] else ("tonnes", 1e3)
        found.append(
            f"{mass:.4g} kg with the centre of mass {height:.2f} m high: masses in {unit} ({factor * mass:.4g} kg)?"
        )
    odd: dict[str, tuple[float, float, float]] = {}  # mass, greatest inertia, radius of gyration
    for joint in range(1, model.model.njoints) if not found else ():
        inertia = model.model.inertias[joint]
        largest = float(np.linalg.eigvalsh(inertia.inertia)[-1])
        radius = math.sqrt(largest / max(inertia.mass, 1e-12))
        if inertia.mass > 0.01 * mass and not GYRATION[0] < radius / height < GYRATION[1]:
            odd[str(model.model.names[joint])] = float(inertia.mass), largest, radius
    if odd:
        name, (own, largest, radius) = max(odd.items(), key=lambda item: item[1][2])
        said = f"{largest:.4g} kg m² at {own:.4g} kg, a radius of gyration of {radius:.4g} m"
        if radius > GYRATION[1] * height:
            typical = 0.15 * height
            unit = min(INERTIA_UNITS, key=lambda u: abs(math.log(radius * INERTIA_UNITS[u] ** 0.5 / typical)))
            said += f": inertias in {unit}?"
        found.append(f"inertias of {len(odd)} links do not fit their masses: that below '{name}' has {said}")
    return found


def _legs(robot: Any) -> list[str]:
    found = []
    for side, leg in zip(SIDES, robot.legs, strict=True):
        if len(leg) < FULL_LEG:
            found.append(
                f"the {side} leg has {len(leg)} joints: it cannot shift the weight sideways on a flat sole"
            )
    if not robot.soles:
        hint = feet_hint(robot.pinocchio_model())
        said = "no feet: it has a QP (docs/robots.md), but neither stands nor walks"
        return [f"{said}; it has two lowest limbs: {hint}" if hint else said]
    left, right = robot.soles
    if max(abs(left.length - right.length), abs(left.width - right.width)) > 5e-3:
        sizes = [f"{1e3 * sole.length:.0f} x {1e3 * sole.width:.0f} mm" for sole in robot.soles]
        found.append(f"the soles differ: {sizes[0]} and {sizes[1]}")
    model = robot.pinocchio_model()
    data = model.createData()
    pin.centerOfMass(model, data, pin.neutral(model))
    names = list(model.names)
    masses = [float(data.mass[names.index(leg[0])]) for leg in robot.legs]
    if abs(masses[0] - masses[1]) > UNLIKE * max(masses):
        found.append(f"the legs differ in mass: {masses[0]:.2f} and {masses[1]:.2f} kg")
    return found


def _is_taken(low: float, high: float) -> bool:
    """Return True for the range of a joint that was given none."""
    return bool(abs(low + CONTINUOUS_RANGE) < 1e-6 and abs(high - CONTINUOUS_RANGE) < 1e-6)


def listed(names: list[str]) -> str:
    """Return the first of some names, and how many more there are."""
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
