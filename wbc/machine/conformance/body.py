"""Checks of the body: IMU, sole wrenches, and whether both agree with the encoders."""

# A cause with its condition a line:
# fmt: off

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import GRAVITY
from wbc.machine.conformance.session import UNIT, Record, Rows, Session, settled

TILT = 0.04
"""Motion of the base about each axis, rad."""

SHIFT, SWAY_TIME = 0.008, 0.8
"""Shift of the centre of mass, m, and its time, s; the ZMP leads it by about 20 mm, more than the shift at rest."""

SMOOTHING = 0.1
"""Width of the window over which forces and the motion of the body are averaged before they are compared, s."""

AXES = np.eye(3)
FALLEN = "the robot does not stand"


def imu(s: Session) -> Rows:
    """Compare accelerometer and gyroscope with gravity and with turns of the base."""
    s.soles()
    frame, force = np.array(s.robot.placement(s.robot.imu_frame).rotation), settled(s.rest["specific_force"])
    size = float(np.linalg.norm(force))
    along = float(frame[2] @ force) / max(size, 1e-9)
    yield f"accelerometer: {size:.2f} m/s² at rest", {
        "the accelerometer is in units of g": abs(size - 1.0) < 0.2,
        "gravity has been removed: send acceleration minus gravity, +9.81 m/s² upwards at rest": size < 2.0,
        "the accelerometer has the reversed sign: +9.81 m/s² upwards at rest; estimates turn upside "
        "down": along <= -0.7,
        "another unit than m/s²": abs(size - GRAVITY) >= 0.5,
    }
    if not s.standing:
        yield f"gyroscope: {FALLEN}", None
        turned = {"turned IMU": along <= 0.95}
        yield f"IMU frame: {along:.3f} along the vertical", turned if s.good("accelerometer") else None
        return
    # Turns as made and as the gyroscope saw them, and changes of the specific force likewise; one a row.
    turns, seen, tilts, felt = np.zeros((4, 3, 3))
    for axis in range(3):
        joints, q = _base_motion(s, np.zeros(2), TILT * AXES[axis])
        there, _ = s.move(joints, 0.4)
        s.robot.update(q, np.zeros(s.robot.nv))
        after = np.array(s.robot.placement(s.robot.imu_frame).rotation)
        turns[axis], seen[axis] = pin.log3(frame.T @ after), there["angular_velocity"].sum(axis=0) * s.period
        tilts[axis] = (after - frame)[2] * GRAVITY
        felt[axis] = settled(there["specific_force"]) - force
    size = float(np.linalg.norm(seen) / np.linalg.norm(turns))
    yield f"gyroscope: {size:.2f} of the turns made", {
        "the gyroscope does not turn: frozen, or not of this body": size < 0.2,
        "the gyroscope is in degrees per second: the attitude estimate spins": abs(size / UNIT - 1.0) < 0.5,
        "another unit than rad/s": not 0.5 < size < 1.6,
    }
    if not s.good("accelerometer", "gyroscope"):
        return "gyroscope or accelerometer has another unit"
    # seen ≈ R turns for each of three turns: R is what lies between the gyroscope and the IMU frame.
    between = seen.T @ np.linalg.pinv(turns.T) / max(size, 1e-9)
    u, _, vt = np.linalg.svd(between)
    angle = np.degrees(np.linalg.norm(pin.log3(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)))
    agree, tilt = np.trace(between) / 3.0, (tilts * felt)[:2].sum() / (tilts * tilts)[:2].sum()
    level, turned = along > 0.97 and 0.5 < tilt < 1.6, agree <= 0.85  # level: gravity is where it should be
    yield f"IMU frame: turns agree to {agree:.2f}, tilts to {tilt:.2f}", {
        "the accelerometer is in another frame than the gyroscope: tilt grows the wrong way": not (level or turned),
        "the gyroscope has the reversed sign (IMU against world, in the IMU frame): the attitude runs "
        "away": agree < -0.5,
        "the gyroscope is in another frame than the accelerometer (swapped axes, the body's or the "
        "world's)": level and turned,
        f"the IMU is turned by {angle:.0f}° against the description: tilt grows in the wrong plane": turned,
    }


def wrenches(s: Session) -> Rows:
    """Compare the loads of the soles with the weight, and where they are with where the body is.

    The centre of mass is shifted to the left and forward; loads and centres of pressure go with it.
    """
    if not s.standing or np.isnan(s.rest["sole_wrench"]).any():
        return "no force sensors" if s.standing else FALLEN
    rest = s.hold(0.1)
    still, places = settled(rest["sole_wrench"]), s.soles()
    share, least = still[:, 2].sum() / s.weight, still[:, 2].min() / s.weight
    unit = abs(share - 1.0) >= 0.08 or least <= -0.05
    yield f"weight: normal forces are {share:.2f} of the weight", {
        "the wrench is that of the foot on the ground, it must be the ground's on the foot: the robot seems to "
        "fly": share < -0.5,
        "another unit, offsets that were not removed, or a robot of another mass than the description": unit,
    }
    shifts = [_base_motion(s, SHIFT * AXES[axis, :2], np.zeros(3))[0] for axis in (1, 0)]
    left, front = (s.move(joints, SWAY_TIME)[0] for joints in shifts)
    if s.confused or not s.good("weight"):
        return s.confused or "normal forces are wrong"
    to_left, to_front = _zmp(s, left)[:, 1], _zmp(s, front)[:, 0]
    to_left, to_front = to_left / float(to_left @ to_left), to_front / float(to_front @ to_front)
    wrench, ahead = (_smoothed(s, record["sole_wrench"])[1:-1] for record in (left, front))
    load = 100.0 * float(to_left @ (wrench[:, 0, 2] - wrench[:, -1, 2])) * SHIFT / s.weight
    yield f"sides: load moves by {load:+.0f} % to the left", {
        "left and right wrench are swapped: walks step into the air": not load > 0.0,
    }
    sideways = float(to_left @ [_pressure(places, each)[1] for each in wrench])
    forward = float(to_front @ [_pressure(places, each)[0] for each in ahead])
    rolls = to_left @ (wrench[:, :, 3] / np.maximum(wrench[:, :, 2], 1.0))
    at_rest = _pressure(places, still)
    off = min((1e3 * (at_rest - com) for com in _coms_at_rest(s, rest)), key=lambda way: float(way @ way))
    beyond = -np.inf  # how far the pressure lies outside its sole at most, mm; below zero inside of all soles
    for (*_, normal, roll, pitch, _), sole in zip(still, s.robot.soles, strict=True):
        if normal > 0.1 * s.weight:
            half = 0.5 * np.array([sole.length, sole.width])
            beyond = max(beyond, 1e3 * float((np.abs([pitch, roll]) / normal - half).max()))
    edge = f", {beyond:.0f} mm beyond the edge of a sole" if beyond > 0.0 else ""
    found = (
        f"pressure moves {forward:.2f} and {sideways:.2f} of the way; it is {off[0]:+.0f}, {off[1]:+.0f} mm "
    )
    near = np.abs(rolls).max() < 2.5 and np.abs(off).max() < 15.0 and beyond < 20.0
    yield f"wrench frame: {found}from the centre of mass{edge}", {
        "moments have the reversed sign, or the sensor's x axis points backwards: the ankles push the wrong "
        "way": forward < -0.2,
        "moments are about another point than the sole centre (the sensor's or the ankle's), or in another frame "
        "or unit: the robot leans, the feet tilt": not (0.25 < forward < 2.5 and near),
    }


def soles(s: Session) -> Rows:
    """Check that both soles are flat and level by the encoders, against each other and against gravity."""
    if s.confused or not s.standing:
        return s.confused if s.standing else FALLEN
    left, right = s.soles(settled(s.rest["joint_position"]))[:2]
    height, up = 1e3 * float(left.translation[2] - right.translation[2]), _up(s, s.rest)
    verticals = [right.rotation[:, 2]] + ([] if up is None else [up / np.linalg.norm(up)])
    tilt = np.degrees(max(np.linalg.norm(np.cross(left.rotation[:, 2], other)) for other in verticals))
    apart = abs(height) >= 6.0 or tilt >= 2.0
    yield f"soles: {height:+.1f} mm apart in height, {tilt:.1f}° of tilt", {
        "zeros of leg encoders, or legs of another length than in the description: one foot is light": apart,
    }


def _base_motion(s: Session, com: Array, turn: Array) -> tuple[Array, Array]:
    """Return a change of the joints, shape (na,), the soles in their places, and the configuration there, shape (nq,).

    It shifts the centre of mass by `com`, forward and to the left, shape (2,), m, and turns the base by `turn`, about
    x, y and z of the world, shape (3,), rad.
    """
    robot, model, data, q0 = s.robot, s.robot.model, s.robot.data, np.array(s.robot.half_sitting)
    s.soles()
    pin.computeJointJacobians(model, data, q0)
    *soles, base = (
        pin.getFrameJacobian(model, data, robot.frame_id(frame), pin.LOCAL_WORLD_ALIGNED)
        for frame in (*(sole.frame for sole in robot.soles), robot.base_frame)
    )
    rows = np.vstack([*soles, robot.com_jacobian[:2], base[3:]])
    target = np.concatenate([np.zeros(6 * len(soles)), com, turn])
    velocity = np.linalg.lstsq(rows, target, rcond=1e-6)[0]
    return velocity[6:], pin.integrate(model, q0, velocity)


def _coms_at_rest(s: Session, rest: Record) -> list[Array]:
    """Return where the centre of mass is at rest by the encoders, and by the lean that a good IMU sees as well.

    Soles give way under a body that leans, and an IMU may be mounted a little off. Each of shape (2,), m.
    """
    pairs = list(zip(s.soles(), s.soles(settled(rest["joint_position"])), strict=True))
    coms = [np.mean([(place * sole.inverse()).act(s.robot.com) for place, sole in pairs], axis=0)]
    up = _up(s, rest)
    if up is not None:
        lean = pin.Quaternion.FromTwoVectors(up, AXES[2]).toRotationMatrix()
        ways = [place.translation + lean @ (s.robot.com - sole.translation) for place, sole in pairs]
        coms.append(np.mean(ways, axis=0))
    return [com[:2] for com in coms]


def _up(s: Session, rest: Record) -> Array | None:
    """Return the specific force at rest, shape (3,), m/s², the base as at half-sitting; None without a good IMU."""
    s.soles(settled(rest["joint_position"]))
    up: Array = s.robot.placement(s.robot.imu_frame).rotation @ settled(rest["specific_force"])
    return up if s.good("accelerometer", "IMU frame") else None


def _zmp(s: Session, record: Record) -> Array:
    """Return the ZMP less its mean, by the encoders and level soles at rest, smoothed, shape (n, 2), m.

    What the references ask for would not do: a heavy body on its ankles follows them late.
    """
    places, height = s.soles(), float(s.robot.com[2])
    com = np.zeros((len(record["time"]), 2))
    for i, position in enumerate(record["joint_position"]):
        for place, sole in zip(places, s.soles(position), strict=True):
            com[i] += (place * sole.inverse()).act(s.robot.com)[:2] / len(places)
    com = _smoothed(s, com)
    zmp: Array = com[1:-1] - height / GRAVITY * np.diff(com, 2, axis=0) / s.period**2
    zmp -= zmp.mean(axis=0)
    return zmp


def _smoothed(s: Session, rows: Array) -> Array:
    """Return rows averaged over `SMOOTHING`, where the window fits."""
    window = np.hanning(max(5, round(SMOOTHING / s.period)))
    smooth: Array = np.apply_along_axis(np.convolve, 0, rows, window / window.sum(), "valid")
    return smooth


def _pressure(places: list[pin.SE3], wrench: Array) -> Array:
    """Return the centre of pressure of all soles in the world, shape (2,), m."""
    total = sum(
        (place.act(pin.Force(part)) for place, part in zip(places, wrench, strict=True)), pin.Force.Zero()
    )
    return np.array([-total.angular[1], total.angular[0]]) / max(float(total.linear[2]), 1.0)
