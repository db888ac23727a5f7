"""Measurements of the body: IMU, sole wrenches, and whether both agree with the encoders."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import GRAVITY
from wbc.machine.conformance.session import Record, Session

TILT = 0.04
"""Motion of the base about each axis, rad."""

SHIFT = 0.008
"""Shift of the centre of mass, m."""

SWAY_TIME = 0.8
"""Time of a shift, s; the ZMP leads it by about 20 mm, which tells more than the shift at rest does."""

SMOOTHING = 0.1
"""Width of the window over which forces and the motion of the body are averaged before they are compared, s."""


class Body:
    """Checks of IMU and force sensors."""

    def __init__(self, session: Session) -> None:
        """Store the run; the robot is at half-sitting."""
        self._session, self._robot = session, session.robot
        self._weight = self._robot.mass * GRAVITY
        self._places = self._soles()

    def _soles(self, position: Array | None = None) -> list[pin.SE3]:
        """Set the joints, the base as at half-sitting; return the placements of the soles."""
        robot, q = self._robot, np.array(self._robot.half_sitting)
        if position is not None:
            q[7:] = position
        robot.update(q, np.zeros(robot.nv))
        return [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]

    def check_imu(self) -> None:
        """Compare accelerometer and gyroscope with gravity and with turns of the base."""
        session, robot = self._session, self._robot
        self._soles()
        frame = np.array(robot.placement(robot.imu_frame).rotation)
        force = session.rest.settled("accelerometer")
        size = float(np.linalg.norm(force))
        along = float(force @ (frame.T @ np.array([0.0, 0.0, 1.0]))) / max(size, 1e-9)
        unit = session.judge("accelerometer", size=size, along=along)
        if not session.standing:
            session.unknown("the robot does not stand", "gyroscope")
            if unit:
                session.judge("IMU frame, hanging", along=along)
            else:
                session.unknown(f"{along:.3f} along the vertical", "IMU frame")
            return
        turns, turned = np.zeros((3, 3)), np.zeros((3, 3))  # as made, as the gyroscope saw them; one a row
        tilts, tilted = (
            np.zeros((3, 3)),
            np.zeros((3, 3)),
        )  # change of the specific force, as the accelerometer saw it
        for axis in range(3):
            joints, q = session.base_motion(np.zeros(2), TILT * np.eye(3)[axis])
            there, _ = session.move(joints, 0.4)
            robot.update(q, np.zeros(robot.nv))
            after = np.array(robot.placement(robot.imu_frame).rotation)
            turns[axis], turned[axis] = (
                pin.log3(frame.T @ after),
                there.gyroscope.sum(axis=0) * session.period,
            )
            tilts[axis] = (after.T - frame.T) @ np.array([0.0, 0.0, GRAVITY])
            tilted[axis] = there.settled("accelerometer") - force
        size = float(np.linalg.norm(turned) / np.linalg.norm(turns))
        if not session.judge("gyroscope", size=size) or not unit:
            session.unknown("gyroscope or accelerometer has another unit", "IMU frame")
            return
        # turned ≈ R turns for each of three turns: R is what lies between the gyroscope and the IMU frame.
        between = turned.T @ np.linalg.pinv(turns.T) / max(size, 1e-9)
        tilts, tilted = tilts[:2], tilted[:2]
        session.judge(
            "IMU frame",
            along=along,
            turns=float(np.trace(between)) / 3.0,
            tilts=float((tilts * tilted).sum() / max(float((tilts * tilts).sum()), 1e-9)),
            angle=float(np.degrees(np.linalg.norm(pin.log3(_nearest_rotation(between))))),
        )

    def check_wrenches(self) -> None:
        """Compare the loads of the soles with the weight, and where they are with where the body is.

        The centre of mass is shifted to the left and forward; loads and centres of pressure go with it.
        """
        session, weight = self._session, self._weight
        if not session.standing or not session.force_sensors:
            why = "no force sensors" if session.standing else "the robot does not stand"
            session.unknown(why, "weight", "sides", "wrench frame")
            return
        rest = session.hold(0.1)
        still = rest.settled("wrench")
        share, least = float(still[:, 2].sum()) / weight, float(still[:, 2].min()) / weight
        good = session.judge("weight", share=share, least=least)
        left = session.move(session.base_motion(SHIFT * np.eye(2)[1], np.zeros(3))[0], SWAY_TIME)[0]
        front = session.move(session.base_motion(SHIFT * np.eye(2)[0], np.zeros(3))[0], SWAY_TIME)[0]
        why = session.confused or ("" if good else "normal forces are wrong")
        if why:
            session.unknown(why, "sides", "wrench frame")
            return
        to_left, to_front = self._zmp(left)[:, 1], self._zmp(front)[:, 0]
        sway, surge = float(to_left @ to_left), float(to_front @ to_front)
        wrench, ahead = (self._smoothed(record.wrench)[1:-1] for record in (left, front))
        load = float(to_left @ (wrench[:, 0, 2] - wrench[:, -1, 2])) / sway * SHIFT / weight
        session.judge("sides", load=100.0 * load)
        sideways = float(to_left @ [self._pressure(each)[1] for each in wrench]) / sway
        forward = float(to_front @ [self._pressure(each)[0] for each in ahead]) / surge
        rolling = [to_left @ (wrench[:, i, 3] / np.maximum(wrench[:, i, 2], 1.0)) / sway for i in (0, -1)]
        ways = [1e3 * (self._pressure(still) - com) for com in self._coms_at_rest(rest)]
        off = min(ways, key=lambda way: float(way @ way))
        beyond = self._beyond(still)
        edge = f", {beyond:.0f} mm beyond the edge of a sole" if beyond > 0.0 else ""
        session.judge("wrench frame", forward=forward, sideways=sideways, rolling=max(np.abs(rolling)),
                      ahead=off[0], aside=off[1], off=max(np.abs(off)), beyond=beyond, edge=edge)  # fmt: skip

    def _coms_at_rest(self, rest: Record) -> list[Array]:
        """Return where the centre of mass is at rest, in the world, each of shape (2,), m.

        By the encoders on level soles, and by the lean that the IMU sees as well where it is right: soles give way
        under a body that leans, and an IMU may be mounted a little off.
        """
        robot = self._robot
        pairs = list(zip(self._places, self._soles(rest.settled("position")), strict=True))
        coms = [np.mean([(place * sole.inverse()).act(robot.com) for place, sole in pairs], axis=0)]
        up = self._up(rest)
        if up is not None:
            lean = pin.Quaternion.FromTwoVectors(up, np.array([0.0, 0.0, 1.0])).toRotationMatrix()
            ways = [place.translation + lean @ (robot.com - sole.translation) for place, sole in pairs]
            coms.append(np.mean(ways, axis=0))
        return [com[:2] for com in coms]

    def _up(self, rest: Record) -> Array | None:
        """Return the specific force at rest, shape (3,), m/s², the base as at half-sitting; None without a good IMU."""
        if self._session.bad("accelerometer", "IMU frame"):
            return None
        up: Array = self._robot.placement(self._robot.imu_frame).rotation @ rest.settled("accelerometer")
        return up

    def _beyond(self, wrench: Array) -> float:
        """Return how far the centre of pressure lies outside its sole at most, mm; below zero inside of all soles."""
        beyond = [-np.inf]
        for (*_, normal, roll, pitch, _), sole in zip(wrench, self._robot.soles, strict=True):
            if normal > 0.1 * self._weight:
                half = 0.5 * np.array([sole.length, sole.width])
                beyond.append(float((np.abs([pitch, roll]) / normal - half).max()))
        return 1e3 * max(beyond)

    def _zmp(self, record: Record) -> Array:
        """Return the ZMP less its mean, by the encoders and level soles at rest, smoothed, shape (n, 2), m.

        What the references ask for would not do: a heavy body on its ankles follows them late.
        """
        self._soles()
        height = float(self._robot.com[2])
        com = np.zeros((len(record.position), 2))
        for i, position in enumerate(record.position):
            for place, sole in zip(self._places, self._soles(position), strict=True):
                com[i] += (place * sole.inverse()).act(self._robot.com)[:2] / len(self._places)
        com = self._smoothed(com)
        zmp: Array = com[1:-1] - height / GRAVITY * np.diff(com, 2, axis=0) / self._session.period**2
        zmp -= zmp.mean(axis=0)
        return zmp

    def _smoothed(self, rows: Array) -> Array:
        """Return rows averaged over `SMOOTHING`, where the window fits."""
        window = np.hanning(max(5, round(SMOOTHING / self._session.period)))
        smooth: Array = np.apply_along_axis(np.convolve, 0, rows, window / window.sum(), "valid")
        return smooth

    def _pressure(self, wrench: Array) -> Array:
        """Return the centre of pressure of all soles in the world, shape (2,), m."""
        parts = [place.act(pin.Force(part)).vector for place, part in zip(self._places, wrench, strict=True)]
        total = np.sum(parts, axis=0)
        return np.array([-total[4], total[3]]) / max(float(total[2]), 1.0)

    def check_soles(self) -> None:
        """Check that both soles are flat and level by the encoders, against each other and against gravity."""
        session = self._session
        why = session.confused if session.standing else "the robot does not stand"
        if why:
            session.unknown(why, "soles")
            return
        left, right = self._soles(session.rest.settled("position"))[:2]
        height, up = 1e3 * float(left.translation[2] - right.translation[2]), self._up(session.rest)
        verticals = [right.rotation[:, 2]] + ([] if up is None else [up / np.linalg.norm(up)])
        tilt = max(float(np.linalg.norm(np.cross(left.rotation[:, 2], other))) for other in verticals)
        session.judge("soles", height=height, tilt=np.degrees(tilt))


def _nearest_rotation(matrix: Array) -> Array:
    u, _, vt = np.linalg.svd(matrix)
    rotation: Array = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation
