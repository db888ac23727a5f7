"""Figures of the checks of the body, of a robot that stands: each is that of the fault, and bad from its bound on."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_machines import DESCRIPTION, PERIOD, Light, Recorded, healthy

from wbc import Command, Measurement
from wbc.core.robot import GRAVITY
from wbc.machine import conformance
from wbc.machine.conformance import Check

ROBOT = DESCRIPTION.robot()
WEIGHT = ROBOT.mass * GRAVITY
NAMES = DESCRIPTION.joint_names
IMU = ROBOT.placement(ROBOT.imu_frame).rotation


def checks_of(**changes: Any) -> dict[str, Check]:
    """Check what a good machine has measured, each of these signals changed by a function of it."""

    def fault(m: Measurement, tick: int) -> Measurement:
        return replace(m, **{name: change(getattr(m, name)) for name, change in changes.items()})

    return {check.name: check for check in conformance(Recorded(fault)).checks}


def numbers(check: Check) -> list[float]:
    return [float(text) for text in re.findall(r"[+-]?\d+\.?\d*", check.found)]


def good(name: str) -> list[float]:
    return numbers(next(check for check in healthy()[1].checks if check.name == name))


def pressed(wrench: np.ndarray, way: tuple[float, float]) -> np.ndarray:
    """Wrenches whose forces act elsewhere by (x, y), m: τ_x = y f_z, τ_y = −x f_z."""
    moved = wrench.copy()
    moved[:, 3] += way[1] * wrench[:, 2]
    moved[:, 4] -= way[0] * wrench[:, 2]
    return moved


def test_figures_of_a_good_machine() -> None:
    """A robot that stands still carries its weight, turns as it is turned and presses below its centre of mass."""
    assert good("gyroscope") == pytest.approx([1.0], abs=0.05)
    turns, tilts, angle = good("IMU frame")
    assert turns == pytest.approx(1.0, abs=0.02) and tilts == pytest.approx(1.0, abs=0.2) and angle <= 2.0
    assert good("weight") == pytest.approx([1.0], abs=0.01)
    assert 2.0 < good("sides")[0] < 6.0  # 8 mm between soles 0.24 m apart: 3.4 % of the weight
    assert good("wrench frame") == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=0.1)
    assert good("soles") == pytest.approx([0.0, 0.0], abs=0.1)


@pytest.mark.parametrize(
    ("size", "state"), [(0.53, "ok"), (0.48, "wrong"), (1.58, "ok"), (1.64, "wrong"), (0.18, "wrong")]
)
def test_a_gyroscope_is_told_by_its_share_of_the_turns(size: float, state: str) -> None:
    check = checks_of(angular_velocity=lambda w: size * w)["gyroscope"]
    assert numbers(check)[0] == pytest.approx(size * good("gyroscope")[0], abs=0.02) and check.state == state


def test_an_imu_that_is_turned_is_told_by_its_angle() -> None:
    """A turn by an angle about z keeps the vertical; turns agree to (1 + 2 cos) / 3, to 0.85 at least."""
    for angle, state in ((0.6, "ok"), (0.75, "wrong"), (1.2, "wrong")):
        turn = IMU.T @ pin.rpy.rpyToMatrix(0.0, 0.0, angle) @ IMU
        found = checks_of(angular_velocity=lambda w, t=turn: t @ w, specific_force=lambda f, t=turn: t @ f)
        assert found["accelerometer"].state == "ok"
        agree, tilts, by = numbers(found["IMU frame"])
        assert agree == pytest.approx((1.0 + 2.0 * np.cos(angle)) / 3.0, abs=0.02)
        assert by == pytest.approx(np.degrees(angle), abs=2.0)
        assert tilts == pytest.approx(good("IMU frame")[1] * np.cos(angle), abs=0.05)
        assert found["IMU frame"].state == state


def test_tilts_that_the_accelerometer_does_not_see_are_bad() -> None:
    """Tilts of 0.5 to 1.6 of those made are good: the vertical moves as the IMU does."""
    up = IMU.T @ [0.0, 0.0, GRAVITY]
    for size, state in ((0.5, "ok"), (0.4, "wrong"), (1.35, "ok"), (1.55, "wrong")):
        check = checks_of(specific_force=lambda f, size=size: up + size * (f - up))["IMU frame"]
        assert numbers(check)[1] == pytest.approx(size * good("IMU frame")[1], abs=0.02)
        assert check.state == state


@pytest.mark.parametrize(
    ("size", "state"), [(1.07, "ok"), (1.09, "wrong"), (0.93, "ok"), (0.91, "wrong"), (-1.0, "wrong")]
)
def test_normal_forces_are_told_as_a_share_of_the_weight(size: float, state: str) -> None:
    check = checks_of(sole_wrench=lambda w: size * w)["weight"]
    assert numbers(check) == pytest.approx([size], abs=0.01) and check.state == state


def test_a_sole_does_not_pull() -> None:
    """By a twentieth of the weight at most."""
    for pull, state in ((0.04, "ok"), (0.06, "wrong")):

        def shifted(wrench: np.ndarray, pull: float = pull) -> np.ndarray:
            moved = wrench.copy()
            moved[:, 2] = (1.0 + pull) * WEIGHT, -pull * WEIGHT
            return moved

        assert checks_of(sole_wrench=shifted)["weight"].state == state


def test_loads_that_change_sides_go_the_other_way() -> None:
    check = checks_of(sole_wrench=lambda w: w[::-1])["sides"]
    assert numbers(check) == pytest.approx([-good("sides")[0]], abs=0.2) and check.state == "wrong"


@pytest.mark.parametrize(
    ("way", "state"),
    [
        ((0.013, 0.0), "ok"),
        ((0.0, -0.013), "ok"),
        ((0.017, 0.0), "wrong"),
        ((0.0, 0.017), "wrong"),
        ((-0.017, 0.0), "wrong"),
    ],
)
def test_pressure_that_is_off_is_told_in_millimetres(way: tuple[float, float], state: str) -> None:
    check = checks_of(sole_wrench=lambda w: pressed(w, way))["wrench frame"]
    forward, sideways, x, y = numbers(check)[:4]
    assert (x, y) == (pytest.approx(1e3 * way[0], abs=1.01), pytest.approx(1e3 * way[1], abs=1.01))
    assert [forward, sideways] == pytest.approx(good("wrench frame")[:2], abs=0.02)
    assert check.state == state and "beyond" not in check.found


@pytest.mark.parametrize("column", [3, 4])
def test_pressure_beyond_the_edge_of_a_sole_is_told(column: int) -> None:
    """By how far, at the worst of all soles: half of its length or width is subtracted."""
    half = 0.5 * (ROBOT.soles[0].width if column == 3 else ROBOT.soles[0].length)
    for beyond in (0.012, 0.03, -0.003):

        def pushed(wrench: np.ndarray, beyond: float = beyond) -> np.ndarray:
            moved = wrench.copy()
            for sign, row in ((1.0, 0), (-1.0, 1)):  # together they act in the middle
                moved[row, column] = sign * (half + beyond) * wrench[row, 2]
            return moved

        check = checks_of(sole_wrench=pushed)["wrench frame"]
        found = re.search(r", (\d+) mm beyond the edge of a sole", check.found)
        assert (found is not None) == (beyond > 0.0)
        if found is not None:
            assert float(found.group(1)) == pytest.approx(1e3 * beyond, abs=0.51)
        if beyond > 0.02:
            assert check.state == "wrong"


def test_moments_that_lack_or_are_turned_show_in_the_way_of_the_pressure() -> None:
    """Half of the moments about y: half of the way forward; the other sign: the other way."""
    forward, sideways = good("wrench frame")[:2]
    rest = healthy()[0][200].sole_wrench
    assert rest is not None
    still = rest[:, 4]
    for size, state in ((0.5, "ok"), (0.1, "wrong"), (-1.0, "wrong")):

        def scaled(wrench: np.ndarray, size: float = size) -> np.ndarray:
            moved = wrench.copy()
            moved[:, 4] = still + size * (wrench[:, 4] - still)
            return moved

        check = checks_of(sole_wrench=scaled)["wrench frame"]
        assert numbers(check)[:2] == pytest.approx([size * forward, sideways], abs=0.1)
        assert check.state == state


def test_soles_that_encoders_tilt_are_told_by_height_and_degrees() -> None:
    """An ankle that is off by an angle tilts its sole by it; both knees and hips keep the soles' heights."""
    for angle, state in ((0.03, "ok"), (0.04, "wrong"), (-0.04, "wrong")):
        off = np.zeros(len(NAMES))
        off[NAMES.index("left_ankle_roll_joint")] = angle
        check = checks_of(joint_position=lambda q, off=off: q + off)["soles"]
        height, tilt = numbers(check)
        assert tilt == pytest.approx(np.degrees(abs(angle)), abs=0.11) and abs(height) < 1.0
        assert check.state == state
    for bend in (0.04, -0.04):  # hip and ankle as the knee: the sole stays level and moves up or down
        off, q = np.zeros(len(NAMES)), ROBOT.half_sitting.copy()
        names = ("left_knee_joint", "left_hip_pitch_joint", "left_ankle_pitch_joint")
        for name, share in zip(names, (2.0, -1.0, -1.0), strict=True):
            off[NAMES.index(name)] = share * bend
        q[7:] += off
        other = DESCRIPTION.robot()
        other.update(q, np.zeros(other.nv))
        heights = [other.placement(sole.frame).translation[2] for sole in other.soles]
        check = checks_of(joint_position=lambda q, off=off: q + off)["soles"]
        assert numbers(check)[0] == pytest.approx(1e3 * (heights[0] - heights[1]), abs=0.2)
        assert abs(numbers(check)[0]) > 6.0 and check.state == "wrong"


def sent_to(loop: Light) -> list[Command]:
    """Return the commands that the checks send to a robot that hangs."""
    sent: list[Command] = []
    step = loop.step

    def keep(command: Command) -> None:
        sent.append(command)
        step(command)

    loop.step = keep  # type: ignore[method-assign]
    conformance(loop)
    return sent


def test_motions_of_the_checks_are_small_smooth_and_one_joint_at_a_time() -> None:
    """Each joint goes 20 mrad towards the middle of its range and back; velocity references are those of the way."""
    robot, reference = DESCRIPTION.robot(), np.array(ROBOT.half_sitting[7:])
    sent = sent_to(Light())
    way = np.array([command.joint_position - reference for command in sent])
    rate = np.array([command.joint_velocity for command in sent])
    moving = np.flatnonzero(np.abs(way).max(axis=1) > 1e-12)
    assert np.abs(way).max() == pytest.approx(0.02) and (np.count_nonzero(way, axis=1) <= 1).all()
    middle = 0.5 * (robot.position_lower + robot.position_upper)
    order = []
    for k in range(robot.na):
        (own,) = np.nonzero(np.abs(way[:, k]) > 1e-12)
        order.append(own[0])
        # Ten ticks of the way there, ten at rest, ten back less the last, which has arrived.
        assert len(own) == 29 and (np.diff(own) == 1).all()
        there = way[own, k]
        assert np.sign(there[-1]) == (1.0 if middle[k] >= reference[k] else -1.0)
        u = np.arange(1, 11) / 10.0
        shape = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        assert np.abs(there[:10]) == pytest.approx(0.02 * shape, abs=1e-12)
        assert np.abs(there[10:20]) == pytest.approx(0.02) and np.abs(there[20:]) == pytest.approx(
            0.02 * (1.0 - shape[:9]), abs=1e-12
        )
        slope = 30.0 * u**2 * (1.0 - u) ** 2 / (10 * PERIOD)
        assert rate[own[:10], k] == pytest.approx(0.02 * np.sign(there[-1]) * slope, abs=1e-9)
        assert rate[own[20:], k] == pytest.approx(-0.02 * np.sign(there[-1]) * slope[:9], abs=1e-9)
    assert order == sorted(order) and len(moving) == 29 * robot.na


def test_torques_of_the_checks_move_joints_beside_the_legs_alone() -> None:
    """Pulses of a tenth of their limits for 40 ms, of alternating signs; then what bends the servos by 20 mrad."""
    robot = DESCRIPTION.robot()
    legs = {name for leg in DESCRIPTION.legs for name in leg}
    free = np.array([name not in legs for name in NAMES])
    sent = sent_to(Light())
    torque = np.array([command.joint_torque for command in sent])
    assert not torque[:, ~free].any()
    jolt = 0.1 * robot.torque_limit
    pulses = [row for row in torque if np.allclose(np.abs(row[free]), jolt[free])]
    assert [np.sign(row[free][0]) for row in pulses] == [
        sign for sign in (1.0, -1.0, -1.0, 1.0) for _ in range(8)
    ]
    bend = np.where(free, np.clip(0.02 * np.array(DESCRIPTION.kp), 0.0, 1.5 * jolt), 0.0)
    assert sum(np.allclose(row, bend) for row in torque) == 2 * 50  # a quarter of a second, with two gains
    drag = np.where(free, np.clip(0.02 * np.array(DESCRIPTION.kp) / np.array(DESCRIPTION.kd), 0.0, 1.0), 0.0)
    rate = np.array([command.joint_velocity for command in sent])
    assert sum(np.allclose(row, drag) for row in rate) == 2 * 50
    soft = [command for command in sent if command.kp is not None]
    assert len(soft) == 40 + 50 + 40 + 50  # the rest after them is on the machine's own gains
    assert soft[0].kp[free] == pytest.approx(0.5 * np.array(DESCRIPTION.kp)[free], rel=0.02)
    assert soft[0].kd[free] == pytest.approx(0.5 * np.array(DESCRIPTION.kd)[free], rel=0.05)
    assert soft[0].kp[~free].tolist() == np.array(DESCRIPTION.kp)[~free].tolist()


def test_what_cannot_be_told_says_of_what_it_would_need() -> None:
    """Loads where the weight is wrong, and where the joints are; turns where the accelerometer is."""
    light = checks_of(sole_wrench=lambda w: 0.5 * w)
    for name in ("sides", "wrench frame"):
        assert (light[name].state, light[name].found) == ("unknown", "normal forces are wrong")
    assert light["soles"].state == "ok"
    turned = checks_of(joint_position=np.degrees)
    for name in ("sides", "wrench frame", "soles", "torque", "joint zero"):
        assert turned[name].state == "unknown"
        assert turned[name].found == "joints are not measured as they should", name
    weightless = checks_of(specific_force=lambda f: 0.1 * f)
    assert weightless["IMU frame"].found == "gyroscope or accelerometer has another unit"
    fallen = checks_of(sole_wrench=lambda w: 0.01 * w)
    for name in ("gyroscope", "weight", "sides", "wrench frame", "soles"):
        assert fallen[name].found == "the robot does not stand", name
    assert fallen["gyroscope"].state == fallen["soles"].state == "unknown"
