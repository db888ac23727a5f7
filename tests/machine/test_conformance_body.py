"""Figures of the checks of the body, of a robot that stands: each is that of the fault, and bad from its bound on."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_machines import DESCRIPTION, PERIOD, Light, Recorded, Wrapped, healthy

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


@pytest.mark.parametrize(
    ("turn", "weight", "state"),
    [
        (0.53, 1.07, "ok"),
        (0.48, 1.09, "wrong"),
        (1.58, 0.93, "ok"),
        (1.64, 0.91, "wrong"),
        (0.18, -1.0, "wrong"),
    ],
)
def test_a_gyroscope_is_told_by_its_share_of_the_turns_and_forces_by_that_of_the_weight(
    turn: float, weight: float, state: str
) -> None:
    found = checks_of(angular_velocity=lambda w: turn * w, sole_wrench=lambda w: weight * w)
    assert numbers(found["gyroscope"])[0] == pytest.approx(turn * good("gyroscope")[0], abs=0.02)
    assert numbers(found["weight"]) == pytest.approx([weight], abs=0.01)
    assert found["gyroscope"].state == found["weight"].state == state
    if state == "ok":
        assert numbers(found["sides"])[0] == pytest.approx(weight * good("sides")[0], abs=0.11)
        # The centre of pressure is a quotient.
        assert numbers(found["wrench frame"]) == pytest.approx(good("wrench frame"), abs=0.011)


def test_an_imu_that_is_turned_is_told_by_its_angle() -> None:
    """A turn by an angle about z keeps the vertical; turns agree to (1 + 2 cos) / 3, to 0.85 at least."""
    for angle, state in ((0.6, "ok"), (0.75, "wrong")):
        turn = IMU.T @ pin.rpy.rpyToMatrix(0.0, 0.0, angle) @ IMU
        found = checks_of(angular_velocity=lambda w, t=turn: t @ w, specific_force=lambda f, t=turn: t @ f)
        assert found["accelerometer"].state == "ok"
        agree, tilts, by = numbers(found["IMU frame"])
        assert agree == pytest.approx((1.0 + 2.0 * np.cos(angle)) / 3.0, abs=0.02)
        assert by == pytest.approx(np.degrees(angle), abs=2.0)
        assert tilts == pytest.approx(good("IMU frame")[1] * np.cos(angle), abs=0.05)
        assert found["IMU frame"].state == state


@pytest.mark.parametrize(
    ("size", "angle", "state"),
    [(0.5, 0.03, "ok"), (0.4, 0.04, "wrong"), (1.35, -0.03, "ok"), (1.55, -0.04, "wrong")],
)
def test_tilts_that_accelerometer_and_encoders_do_not_see_are_bad(
    size: float, angle: float, state: str
) -> None:
    """Tilts of 0.5 to 1.6 of those made are good; an ankle that is off by an angle tilts its sole by it, from 2° on."""
    up, off = IMU.T @ [0.0, 0.0, GRAVITY], np.zeros(len(NAMES))
    off[NAMES.index("left_ankle_roll_joint")] = angle
    found = checks_of(specific_force=lambda f: up + size * (f - up), joint_position=lambda q: q + off)
    assert numbers(found["IMU frame"])[1] == pytest.approx(size * good("IMU frame")[1], abs=0.02)
    height, tilt = numbers(found["soles"])
    assert tilt == pytest.approx(np.degrees(abs(angle)), abs=0.11) and abs(height) < 1.0
    assert found["IMU frame"].state == found["soles"].state == state


def test_a_sole_does_not_pull() -> None:
    """By a twentieth of the weight at most."""
    for pull, state in ((0.04, "ok"), (0.06, "wrong")):

        def shifted(wrench: np.ndarray, pull: float = pull) -> np.ndarray:
            moved = wrench.copy()
            moved[:, 2] = (1.0 + pull) * WEIGHT, -pull * WEIGHT
            return moved

        assert checks_of(sole_wrench=shifted)["weight"].state == state


@pytest.mark.parametrize(
    ("way", "state"),
    [
        ((0.013, -0.013), "ok"),
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
    for beyond in (0.03, -0.003):

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
            assert check.state == "wrong"


def test_moments_that_lack_or_are_turned_show_in_the_way_of_the_pressure() -> None:
    """Half of the moments about y: half of the way forward; the other sign: the other way."""
    forward, sideways = good("wrench frame")[:2]
    rest = healthy()[0][200].sole_wrench
    assert rest is not None
    still = rest[:, 4]
    for size, state in ((0.5, "ok"), (0.1, "wrong")):

        def scaled(wrench: np.ndarray, size: float = size) -> np.ndarray:
            moved = wrench.copy()
            moved[:, 4] = still + size * (wrench[:, 4] - still)
            return moved

        check = checks_of(sole_wrench=scaled)["wrench frame"]
        assert numbers(check)[:2] == pytest.approx([size * forward, sideways], abs=0.1)
        assert check.state == state


def test_a_sole_that_encoders_lift_is_told_by_its_height() -> None:
    """Hip and ankle as the knee: the sole stays level and moves up."""
    off, q = np.zeros(len(NAMES)), ROBOT.half_sitting.copy()
    for name, bend in (("knee", 0.08), ("hip_pitch", -0.04), ("ankle_pitch", -0.04)):
        off[NAMES.index(f"left_{name}_joint")] = bend
    q[7:] += off
    other = DESCRIPTION.robot()
    other.update(q, np.zeros(other.nv))
    left, right = (other.placement(sole.frame).translation[2] for sole in other.soles)
    check = checks_of(joint_position=lambda q: q + off)["soles"]
    assert numbers(check)[0] == pytest.approx(1e3 * (left - right), abs=0.2)
    assert abs(numbers(check)[0]) > 6.0 and check.state == "wrong"


@functools.cache
def sent_to_light() -> list[Command]:
    """Return the commands that the checks send to a robot that hangs."""
    sent: list[Command] = []
    conformance(Wrapped(Light(), lambda command: [sent.append(command), command][1]))
    return sent


def test_motions_of_the_checks_are_small_smooth_and_one_joint_at_a_time() -> None:
    """Each joint goes 20 mrad towards the middle of its range and back; velocity references are those of the way."""
    robot, reference = DESCRIPTION.robot(), np.array(ROBOT.half_sitting[7:])
    sent = sent_to_light()
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
    sent = sent_to_light()
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
