"""Names, parts and units of the signals of robots, bodies and joints."""

from __future__ import annotations

from wbc.app.log.signals import Read, Signals
from wbc.core.robot import SIDES, Robot

XYZ, XY, QUATERNION = ("x", "y", "z"), ("x", "y"), ("x", "y", "z", "w")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")


def add_motion(signals: Signals, name: str, what: str, frame: str, pose: Read, velocity: Read | None) -> None:
    """Describe the pose (position, quaternion) and velocity (linear, angular) of a base or sole."""
    about = "sole centre, world" if what == "sole" else "world"
    parts = [f"{name}/position/{axis}" for axis in XYZ]
    parts += [f"{name}/orientation/{axis}" for axis in QUATERNION]
    signals.each(parts, ["m"] * 3 + ["1"] * 4, f"{about}; {what} frame in the world", pose)
    if velocity is not None:
        parts = [f"{name}/{kind}_velocity/{axis}" for kind in ("linear", "angular") for axis in XYZ]
        signals.each(parts, ["m/s"] * 3 + ["rad/s"] * 3, frame, velocity)


def foot_names(robot: Robot) -> list[str]:
    """Return the names of the feet in a log: left and right, or the names of the soles of any other robot."""
    names = [sole.name for sole in robot.soles]
    return list(SIDES) if names == ["left_foot", "right_foot"] else names


def joint_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's position: rad, or m for a prismatic joint."""
    kinds = [robot.model.joints[number].shortname() for number in robot.joint_numbers]
    return ["m" if kind.startswith("JointModelP") else "rad" for kind in kinds]


def torque_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's torque: Nm, or N for a prismatic joint."""
    return ["N" if unit == "m" else "Nm" for unit in joint_units(robot)]


def position_signal(joint: str, robot: Robot) -> str:
    """Return the name of the signal of a joint's true position; sole hinges are not in the robot model."""
    return f"truth/joint/position/{joint}" if joint in robot.joint_names else f"truth/sole/{joint}"
