"""Names and units that depend on the robot."""

from __future__ import annotations

from wbc.core.robot import Robot

SIDES = ("left", "right")


def foot_names(robot: Robot) -> list[str]:
    """How the feet are called in a log: left and right, or as the soles when there are others."""
    names = [sole.name for sole in robot.soles]
    return list(SIDES) if names == ["left_foot", "right_foot"] else names


def joint_units(robot: Robot) -> list[str]:
    """Unit of each joint's position: rad, or m of a prismatic joint."""
    kinds = [joint.shortname() for joint in robot.model.joints[2:]]
    return ["m" if kind.startswith("JointModelP") else "rad" for kind in kinds]


def torque_units(robot: Robot) -> list[str]:
    """Unit of each joint's torque: Nm, or N of a prismatic joint."""
    return ["N" if unit == "m" else "Nm" for unit in joint_units(robot)]


def position_signal(joint: str, robot: Robot) -> str:
    """Name of the signal of a joint's true position; hinges of the soles belong to no robot model."""
    return f"truth/joint/position/{joint}" if joint in robot.joint_names else f"truth/sole/{joint}"
