"""Checks of the body: IMU, sole wrenches, and whether both agree with the encoders."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import GRAVITY
from wbc.machine.conformance.session import DEGREES, Record, Session, settled

TILT = 0.04
"""Motion of the base about each axis, rad."""

SHIFT, SWAY_TIME = 0.008, 1.6
"""Shift of the centre of mass, m, and the time to get there and settle, s: bodies swing on their ankles."""

AXES = np.eye(3)
FALLEN = "the robot does not stand"


def imu(s: Session) -> str:
    """Compare accelerometer and gyroscope with gravity and with turns of the base."""
    frame, force = s.posture().imu, settled(s.rest["specific_force"])
    size = float(np.linalg.norm(force))
    along = float(frame[2] @ force) / max(size, ROUNDING)
    s.check(
        "accelerometer",
        f"{size:.2f} m/s² at rest",
        in_g=abs(size - 1.0) < 0.2,
        without_gravity=size < 2.0,
        reversed=along <= -0.7,
        unit=abs(size - GRAVITY) >= 0.5,
    )
    if not s.standing:
        if s.good("accelerometer"):
            s.check("IMU frame", f"{along:.3f} along the vertical", turned=along <= 0.95)
        return FALLEN
    # Turns of the base about x, y and z, one a row, in the IMU frame: rotation vectors that were made and that the
    # gyroscope saw, rad, and changes of gravity that were made and that the accelerometer felt, m/s².
    made, seen, tilts, felt = np.zeros((4, 3, 3))
    for axis in range(3):
        joints, q = _base_motion(s, np.zeros(2), TILT * AXES[axis])
        there, _ = s.move(joints, 0.4)
        s.robot.update(q, np.zeros(s.robot.nv))
        after = np.array(s.robot.placement(s.robot.imu_frame).rotation)
        made[axis] = pin.log3(frame.T @ after)
        seen[axis] = there["angular_velocity"].sum(axis=0) * s.period
        tilts[axis] = (after - frame)[2] * GRAVITY
        felt[axis] = settled(there["specific_force"]) - force
    size = float(np.linalg.norm(seen) / np.linalg.norm(made))
    degrees = abs(size / DEGREES - 1.0) < 0.5
    found = f"{size:.2f} of the turns made"
    s.check("gyroscope", found, still=size < 0.2, degrees=degrees, unit=not s.right("gyroscope", size))
    if not s.good("accelerometer", "gyroscope"):
        return "gyroscope or accelerometer has another unit"
    # Of three turns seen ≈ size R made: R is what lies between the gyroscope and the IMU frame.
    between = seen.T @ np.linalg.pinv(made.T) / max(size, ROUNDING)
    u, _, vt = np.linalg.svd(between)
    angle = np.degrees(np.linalg.norm(pin.log3(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)))
    agree, tilt = np.trace(between) / 3.0, (tilts * felt)[:2].sum() / (tilts * tilts)[:2].sum()
    turned, level = (
        agree <= 0.85,
        along > 0.97 and s.right("IMU frame", tilt),
    )  # level: gravity is where it should be
    s.check(
        "IMU frame",
        f"turns agree to {agree:.2f}, tilts to {tilt:.2f}, turned by {angle:.0f}°",
        other_frames=not (level or turned),
        reversed=agree < -0.5,
        gyroscope_turned=level and turned,
        turned=turned,
    )
    return ""


def wrenches(s: Session) -> str:
    """Compare the loads of the soles with the weight, and where they are with where the body is.

    The centre of mass is shifted to the left and forward; loads and centres of pressure go with it.
    """
    if not s.standing or np.isnan(s.rest["sole_wrench"]).any():
        return "no force sensors" if s.standing else FALLEN
    still = settled(s.hold(0.1)["sole_wrench"])
    share, least = still[:, 2].sum() / s.weight, still[:, 2].min() / s.weight
    s.check(
        "weight",
        f"normal forces are {share:.2f} of the weight",
        reversed=share < -0.5,
        unit=not s.right("weight", share) or least <= -0.05,
    )
    (left, rest), (front, _) = (
        s.move(_base_motion(s, SHIFT * AXES[axis, :2], np.zeros(3))[0], SWAY_TIME) for axis in (1, 0)
    )
    if s.confused or not s.good("weight"):
        return s.confused or "normal forces are wrong"
    still, wrench = settled(rest["sole_wrench"]), settled(left["sole_wrench"])
    com, pressure = _com(s, rest), _pressure(s, still)
    (_, to_left), (to_front, _) = (_com(s, record) - com for record in (left, front))
    load = 100.0 * float(np.subtract(*(wrench - still)[[0, -1], 2])) / s.weight
    s.check("sides", f"load moves by {load:+.1f} % to the left", swapped=not load * to_left > 0.0)
    sideways = (_pressure(s, wrench) - pressure)[1] / to_left
    forward = (_pressure(s, settled(front["sole_wrench"])) - pressure)[0] / to_front
    roll, roll_at_rest = (each[:, 3] / np.maximum(each[:, 2], 1.0) for each in (wrench, still))
    # Soles give way under a body that leans, and an IMU may be mounted a little off: the nearer one counts.
    ways = [1e3 * (pressure - place) for place in (com, _com_by_lean(s, rest)) if place is not None]
    off = min(ways, key=lambda way: float(way @ way))
    beyond = _beyond_edges(s, still)
    edge = f", {beyond:.0f} mm beyond the edge of a sole" if beyond > 0.0 else ""
    far = np.abs((roll - roll_at_rest) / to_left).max() >= 2.5 or np.abs(off).max() >= 15.0 or beyond >= 20.0
    s.check(
        "wrench frame",
        f"pressure moves {forward:.2f} and {sideways:.2f} of the way; it is {off[0]:+.0f}, {off[1]:+.0f} mm from the "
        f"centre of mass{edge}",
        reversed=forward < -0.2,
        elsewhere=far or not s.right("wrench frame", forward),
    )
    return ""


def _beyond_edges(s: Session, wrench: Array) -> float:
    """Return how far the pressure of wrenches lies outside its sole at most, mm; below zero inside of all soles."""
    beyond = -np.inf
    for (*_, normal, tau_x, tau_y, _), sole in zip(wrench, s.robot.soles, strict=True):
        if normal > 0.1 * s.weight:
            half = 0.5 * np.array([sole.length, sole.width])
            beyond = max(beyond, 1e3 * float((np.abs([tau_y, tau_x]) / normal - half).max()))
    return beyond


def soles(s: Session) -> str:
    """Check that both soles are flat and level by the encoders, against each other and against gravity."""
    if s.confused or not s.standing:
        return s.confused if s.standing else FALLEN
    left, right = s.posture(settled(s.rest["joint_position"])).soles[:2]
    height, up = 1e3 * float(left.translation[2] - right.translation[2]), _up(s, s.rest)
    verticals = [right.rotation[:, 2]] + ([] if up is None else [up / np.linalg.norm(up)])
    tilt = np.degrees(max(np.linalg.norm(np.cross(left.rotation[:, 2], other)) for other in verticals))
    found = f"{height:+.1f} mm apart in height, {tilt:.1f}° of tilt"
    s.check("soles", found, uneven=abs(height) >= 6.0 or tilt >= 2.0)
    return ""


def _base_motion(s: Session, com: Array, turn: Array) -> tuple[Array, Array]:
    """Return a change of the joints, shape (na,), the soles in their places, and the configuration there, shape (nq,).

    It shifts the centre of mass by `com`, forward and to the left, shape (2,), m, and turns the base by `turn`, about
    x, y and z of the world, shape (3,), rad.
    """
    robot, model, data, q0 = s.robot, s.robot.model, s.robot.data, np.array(s.robot.half_sitting)
    s.posture()
    pin.computeJointJacobians(model, data, q0)
    *soles, base = (
        pin.getFrameJacobian(model, data, robot.frame_id(frame), pin.LOCAL_WORLD_ALIGNED)
        for frame in (*(sole.frame for sole in robot.soles), robot.base_frame)
    )
    rows = np.vstack([*soles, robot.com_jacobian[:2], base[3:]])
    target = np.concatenate([np.zeros(6 * len(soles)), com, turn])
    velocity = np.linalg.lstsq(rows, target, rcond=1e-6)[0]
    return velocity[6:], pin.integrate(model, q0, velocity)


def _com(s: Session, record: Record) -> Array:
    """Return the centre of mass at the end of a motion by the encoders, on level soles, shape (2,), m."""
    now = s.posture(settled(record["joint_position"]))
    pairs = zip(s.posture().soles, now.soles, strict=True)
    com: Array = np.mean([(place * sole.inverse()).act(now.com) for place, sole in pairs], axis=0)
    return com[:2]


def _com_by_lean(s: Session, rest: Record) -> Array | None:
    """Return the centre of mass at rest by the lean that a good IMU sees, shape (2,), m; None without one."""
    up = _up(s, rest)
    if up is None:
        return None
    lean = pin.Quaternion.FromTwoVectors(up, AXES[2]).toRotationMatrix()
    now = s.posture(settled(rest["joint_position"]))
    ways = [
        place.translation + lean @ (now.com - sole.translation)
        for place, sole in zip(s.posture().soles, now.soles, strict=True)
    ]
    com: Array = np.mean(ways, axis=0)
    return com[:2]


def _up(s: Session, rest: Record) -> Array | None:
    """Return the specific force at rest, shape (3,), m/s², the base as at half-sitting; None without a good IMU."""
    up: Array = s.posture(settled(rest["joint_position"])).imu @ settled(rest["specific_force"])
    return up if s.good("accelerometer", "IMU frame") else None


def _pressure(s: Session, wrench: Array) -> Array:
    """Return the centre of pressure of all soles in their places at half-sitting, shape (2,), m."""
    total = sum(
        (place.act(pin.Force(part)) for place, part in zip(s.posture().soles, wrench, strict=True)),
        pin.Force.Zero(),
    )
    return np.array([-total.angular[1], total.angular[0]]) / max(float(total.linear[2]), 1.0)
