"""The summary of a robot as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


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
    lines.append(
        f"  {'joint':<28}{'range deg':>16}{'rad/s':>8}{'Nm':>8}{'half-sitting deg':>18}{'kp':>9}{'kd':>8}"
    )
    for name, joint in facts["joints"].items():
        low, high = np.degrees(joint["position"])
        lines.append(
            f"  {name:<28}{f'{low:.0f} .. {high:.0f}':>16}{joint['velocity']:>8.2f}{joint['torque']:>8.1f}"
            f"{np.degrees(joint['half_sitting']):>18.2f}{joint['kp']:>9.0f}{joint['kd']:>8.1f}"
        )
    if facts["derived"]:
        lines.append("  derived from the model:")
        lines += [f"    {line}" for line in facts["derived"]]
    return "\n".join(lines)
