"""Reports and doubts of a description: their figures, and from which value on one is doubtful."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from closed_chains import parallel_ankles
from urdf_biped import FEET, biped, described

import wbc
from wbc.core.drive.servos import ANKLE_SHARE
from wbc.robots import RobotDescription
from wbc.robots.report import standing_torques

BIPED = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")


def own(**options: Any) -> RobotDescription:
    return RobotDescription.from_urdf(biped(), **FEET, **options) if options else described()


def scaled(what: str, factor: float, xml: str) -> str:
    """Return a URDF with all numbers of an attribute times a factor."""

    def change(match: re.Match[str]) -> str:
        return match[1] + " ".join(repr(float(float(each) * factor)) for each in match[2].split()) + '"'

    return re.sub(rf'({what}=")([^"]+)"', change, xml)


def doubts_of(xml: str, word: str) -> list[str]:
    return [line for line in RobotDescription.from_urdf(xml, **FEET).doubts() if word in line]


def test_a_report_is_in_degrees_and_millimetres() -> None:
    description = own(armature=0.02, gains={"l_knee": (400.0, 9.0)})
    text, robot = description.report(), description.robot()
    assert (
        f"biped: {robot.mass:.2f} kg, height unknown, centre of mass at {robot.com[2]:.3f} m in half-sitting"
        in text
    )
    assert "  left_foot   left_foot_sole: 200 x 90 mm, ankle at (-30, 0, 60) mm" in text
    assert "  torso  trunk, IMU trunk, hands none" in text
    lines = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.strip()}
    assert lines["l_knee"] == ["0", "..", "143", "8", "80", "40", "0.02", "400", "9", "given"]
    assert (
        lines["r_ankle_roll"][:5] == ["-29", "..", "29", "8", "80"] and lines["r_ankle_roll"][-1] == "derived"
    )
    assert "sliding" not in text


def test_hands_are_told_by_their_sides() -> None:
    hands = {"left_hand": "l_elbow_link", "right_hand": "r_elbow_link"}
    assert f"hands {hands}" in dataclasses.replace(own(), hands=hands).report()


def test_a_report_of_joints_that_slide_is_in_millimetres() -> None:
    panda = wbc.load_robot("panda")
    lines = [line for line in panda.report().splitlines() if line.startswith("  panda_finger_joint1")]
    low, _, high, speed, force, place = lines[0].split()[1:7]
    assert (low, high) == ("0", "40")
    i = panda.joint_names.index("panda_finger_joint1")
    assert (float(speed), float(force)) == (panda.velocity_limit[i], panda.torque_limit[i])
    assert float(place) == pytest.approx(1e3 * panda.half_sitting["panda_finger_joint1"], rel=1e-3)
    assert "  sliding joints, in mm, m/s, N and kg: panda_finger_joint1" in panda.report()
    assert panda.summary()["joints"]["panda_finger_joint1"]["unit"] == "m"
    assert panda.summary()["joints"]["panda_joint1"]["unit"] == "rad"


def doubted(description: RobotDescription, word: str, **changes: Any) -> list[str]:
    return [line for line in dataclasses.replace(description, **changes).doubts() if word in line]


@pytest.mark.parametrize("side", ["length", "width"])
@pytest.mark.parametrize(("more", "said"), [(0.004, False), (0.006, True), (-0.006, True)])
def test_soles_that_differ_by_more_than_five_millimetres_are_doubted(
    side: str, more: float, said: bool
) -> None:
    description = own()
    left, right = description.soles
    other = dataclasses.replace(right, **{side: getattr(right, side) + more})
    lines = doubted(description, "the soles differ", soles=(left, other))
    size = f"{1e3 * other.length:.0f} x {1e3 * other.width:.0f}"
    assert lines == ([f"the soles differ: 200 x 90 mm and {size} mm"] if said else [])


def test_limits_that_are_none_or_in_another_unit_are_doubted() -> None:
    for speed, word, said in ((99.0, "another unit", False), (101.0, "another unit", True)):
        lines = [line for line in own(velocity_limits={"l_elbow": speed}).doubts() if word in line]
        assert bool(lines) == said and all("l_elbow" in line for line in lines)
    taken = re.sub(r'(<joint name="l_elbow".*?)lower="[^"]*" upper="[^"]*"', r"\1", biped())
    lines = doubts_of(taken, "±π taken")
    assert lines == ["no position limits (±π taken): l_elbow"]
    for low, high in ((-np.pi, 1.0), (-1.0, np.pi), (np.pi - 0.5, np.pi)):
        assert not [
            line for line in own(position_limits={"l_elbow": (low, high)}).doubts() if "±π taken" in line
        ]


def test_damping_friction_and_servos_are_doubted_with_their_figures() -> None:
    description = own()
    tipping = description.robot().mass * 9.80665 * description.robot().com[2]
    lines = doubted(description, "damping of up to", damping={"l_elbow": 0.5, "r_elbow": 0.25})
    assert lines[0].startswith("torques make up for damping of up to 0.5 Nms/rad") and "2 joints" in lines[0]
    (line,) = doubted(description, "dry friction", frictionloss={"l_elbow": 0.125, "r_elbow": 0.5})
    assert "up to 0.5 Nm" in line and line.endswith("2 joints")
    soft = {"r_ankle_roll": (0.5 * ANKLE_SHARE * tipping, 1.0), "l_ankle_pitch": (ANKLE_SHARE * tipping, 1.0)}
    (line,) = doubted(description, "gains are soft", gains=soft)
    assert f"kp of 'r_ankle_roll' is {0.5 * ANKLE_SHARE * tipping:.0f} Nm/rad" in line
    assert line.endswith(f"m g h, {ANKLE_SHARE * tipping:.0f} Nm/rad")
    assert not doubted(description, "gains are soft", gains={"l_knee": (1.0, 1.0)})
    assert "l_knee" in doubted(description, "no rotor", armature=description.armature | {"l_knee": 0.0})[0]
    assert not doubted(description, "guessed")
    assert [
        line for line in RobotDescription.from_urdf(biped(limits=""), **FEET).doubts() if "guessed" in line
    ]


def test_a_leg_without_an_ankle_roll_cannot_shift_the_weight() -> None:
    xml = biped().replace(
        '<joint name="l_ankle_roll" type="revolute"', '<joint name="l_ankle_roll" type="fixed"'
    )
    xml = xml.replace('<joint name="r_ankle_roll" type="revolute"', '<joint name="r_ankle_roll" type="fixed"')
    description = RobotDescription.from_urdf(xml, **FEET)
    lines = [line for line in description.doubts() if "cannot shift" in line]
    assert lines == [
        f"the {side} leg has 5 joints: it cannot shift the weight sideways on a flat sole"
        for side in ("left", "right")
    ]
    assert not [line for line in own().doubts() if "cannot shift" in line]


def test_rods_at_the_ankles_take_their_share_of_the_torques_of_standing() -> None:
    """By the least wrenches of contacts and rods that leave nothing to the base and to passive joints."""
    description = RobotDescription.from_mjcf(
        parallel_ankles(BIPED), left_sole="left_foot", right_sole="right_foot"
    )
    robot = description.robot()
    shares = standing_torques(robot)
    rows = [
        pin.computeFrameJacobian(robot.model, robot.data, robot.q, robot.frame_id(sole.frame), pin.LOCAL)
        for sole in robot.soles
    ]
    for closure in (c for c in wbc.Controller(robot, 0.002).contacts if isinstance(c, wbc.LoopClosure)):
        rows.append(np.zeros((closure.dim, robot.nv)))
        closure.evaluate(rows[-1], np.zeros(closure.dim), np.zeros(closure.dim))
    jacobian = np.vstack(rows)
    still = [*range(6), *(6 + robot.joint_index(name) for name in description.passive)]
    gravity = pin.computeGeneralizedGravity(robot.model, robot.data, robot.q)
    left = gravity - jacobian.T @ (np.linalg.pinv(jacobian[:, still].T) @ gravity[still])
    np.testing.assert_allclose(left[still], 0.0, atol=1e-8)
    for name, torque in zip(robot.joint_names, left[6:], strict=True):
        i = robot.joint_index(name)
        most = robot.torque_upper[i] if torque > 0.0 else -robot.torque_lower[i]
        assert shares[name] == pytest.approx(
            0.0 if name in description.passive else abs(torque) / most, abs=1e-8
        )
    assert len(description.passive) > 3 and max(shares.values()) > 0.05
