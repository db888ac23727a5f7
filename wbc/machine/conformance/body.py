"""Checks of the body: IMU, sole wrenches, and whether both agree with the encoders."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import GRAVITY
from wbc.machine.conformance.excitation import Record
from wbc.machine.conformance.session import UNIT, Session

TILT = 0.04
"""Motion of the base about each axis, rad."""

SHIFT = 0.008
"""Shift of the centre of mass, m."""

SWAY_TIME = 0.8
"""Time of a shift, s; the ZMP leads it by about 20 mm, which tells more than the shift at rest does."""

SMOOTHING = 0.1
"""Width of the window over which forces and the motion of the body are averaged before they are compared, s."""

LEVEL = 0.035
"""Largest tilt of a sole that stands, against the other one and against gravity, rad."""

APART = 15.0
"""Largest distance of the centre of pressure from the centre of mass at rest, forward and to the left, mm."""

BEYOND = 20.0
"""Largest distance of the centre of pressure of a sole from its edge, outwards, mm."""


class BodyChecks(Session):
    """Checks of IMU and force sensors."""

    def check_imu(self) -> None:
        """Compare accelerometer and gyroscope with gravity and with turns of the base."""
        robot, excite = self.robot, self.excite
        robot.update(robot.half_sitting, np.zeros(robot.nv))
        frame = np.array(robot.placement(robot.imu_frame).rotation)
        force = self.rest.settled("accelerometer")
        size = float(np.linalg.norm(force))
        up = frame.T @ np.array([0.0, 0.0, 1.0])
        along = float(force @ up) / max(size, 1e-9)
        if size < 2.0:
            cause = (
                "the accelerometer is in units of g"
                if abs(size - 1.0) < 0.2
                else "gravity has been removed: send acceleration minus gravity, +9.81 m/s² upwards at rest"
            )
        elif along < -0.7:
            cause = "the accelerometer has the reversed sign: +9.81 m/s² upwards at rest; estimates turn upside down"
        else:
            cause = "another unit than m/s²"
        unit = self.add(
            "accelerometer", abs(size - GRAVITY) < 0.5 and along > -0.7, f"{size:.2f} m/s² at rest", cause
        )
        turns: list[
            tuple[Array, Array, Array]
        ] = []  # expected turn, gyroscope, change of the accelerometer's direction
        if self.standing:
            for axis in range(3):
                turn = [0.0, 0.0, 0.0]
                turn[axis] = TILT
                joints, q = excite.base_motion((0.0, 0.0), (turn[0], turn[1], turn[2]))
                there, _ = excite.move(joints, 0.4)
                robot.update(q, np.zeros(robot.nv))
                after = np.array(robot.placement(robot.imu_frame).rotation)
                expected = pin.log3(frame.T @ after)
                turned = there.gyroscope.sum(axis=0) * excite.period
                direction = there.settled("accelerometer") - force
                expected_direction = (after.T - frame.T) @ np.array([0.0, 0.0, GRAVITY])
                turns.append((expected, turned, np.array([expected_direction, direction])))
        if not turns:
            self.add("gyroscope", "unknown", "the robot does not stand")
            self.add(
                "IMU frame",
                bool(along > 0.95) if unit else "unknown",
                f"{along:.3f} along the vertical",
                "turned IMU",
            )
            return
        self._judge_turns(turns, along, unit)

    def _judge_turns(self, turns: list[tuple[Array, Array, Array]], along: float, unit: bool) -> None:
        expected = np.array([t[0] for t in turns])
        turned = np.array([t[1] for t in turns])
        size = float(np.linalg.norm(turned) / np.linalg.norm(expected))
        # turned ≈ R expected for each of three turns: R is what lies between the gyroscope and the IMU frame.
        between = turned.T @ np.linalg.pinv(expected.T) / max(size, 1e-9)
        gyro_right = float(np.trace(between)) / 3.0
        flat = np.array([t[2][0] for t in turns])[:2]
        found = np.array([t[2][1] for t in turns])[:2]
        tilt_right = float((flat * found).sum() / max(float((flat * flat).sum()), 1e-9))
        reversed_ = gyro_right < -0.5
        cause = (
            "the gyroscope does not turn: frozen, or not of this body"
            if size < 0.2
            else "the gyroscope is in degrees per second: the attitude estimate spins"
            if abs(size / UNIT - 1.0) < 0.5
            else "another unit than rad/s"
        )
        gyro = self.add("gyroscope", 0.5 < size < 1.6, f"{size:.2f} of the turns made", cause)
        if not gyro or not unit:
            self.add("IMU frame", "unknown", "gyroscope or accelerometer has another unit")
            return
        right = gyro_right > 0.85 and 0.5 < tilt_right < 1.6 and along > 0.97
        if gyro_right > 0.85 and not (0.5 < tilt_right < 1.6 and along > 0.97):
            cause = "the accelerometer is in another frame than the gyroscope: tilt grows the wrong way"
        elif reversed_:
            cause = "the gyroscope has the reversed sign (IMU against world, in the IMU frame): the attitude runs away"
        elif along > 0.97 and 0.5 < tilt_right < 1.6:
            cause = "the gyroscope is in another frame than the accelerometer (swapped axes, the body's or the world's)"
        else:
            axis = pin.log3(_nearest_rotation(between))
            angle = float(np.degrees(np.linalg.norm(axis)))
            cause = (
                f"the IMU is turned by {angle:.0f}° against the description: tilt grows in the wrong plane"
            )
        self.add("IMU frame", right, f"turns agree to {gyro_right:.2f}, tilts to {tilt_right:.2f}", cause)

    def check_wrenches(self) -> None:
        """Compare the loads of the soles with the weight, and where they are with where the body is."""
        robot, excite = self.robot, self.excite
        weight = robot.mass * GRAVITY
        rest = excite.hold(0.1)
        normal = rest.settled("wrench")[:, 2]
        total = float(normal.sum())
        cause = (
            "the wrench is that of the foot on the ground, it must be the ground's on the foot: the robot seems to fly"
            if total < -0.5 * weight
            else "another unit, offsets that were not removed, or a robot of another mass than the description"
        )
        good = self.add("weight", abs(total / weight - 1.0) < 0.08 and bool((normal > -0.05 * weight).all()),
                         f"normal forces are {total / weight:.2f} of the weight", cause)  # fmt: skip
        self._loads(rest, good=good)

    def _loads(self, rest: Record, *, good: bool) -> None:
        """Shift the centre of mass to the left and forward; loads and centres of pressure go with it."""
        robot, excite = self.robot, self.excite
        weight = robot.mass * GRAVITY
        left = excite.move(excite.base_motion((0.0, SHIFT), (0.0, 0.0, 0.0))[0], SWAY_TIME)[0]
        front = excite.move(excite.base_motion((SHIFT, 0.0), (0.0, 0.0, 0.0))[0], SWAY_TIME)[0]
        joints = self.bad("joint order", "joint sign", "joint unit")
        if not good or joints:
            why = "joints are not measured as they should" if joints else "normal forces are wrong"
            for name in ("sides", "wrench frame"):
                self.add(name, "unknown", why)
            return
        to_left, to_front = self._zmp(left)[:, 1], self._zmp(front)[:, 0]
        sway, surge = float(to_left @ to_left), float(to_front @ to_front)
        wrench, ahead = (self._smoothed(record.wrench)[1:-1] for record in (left, front))
        load = float(to_left @ (wrench[:, 0, 2] - wrench[:, -1, 2])) / sway * SHIFT / weight
        cause = "left and right wrench are swapped: walks step into the air"
        self.add("sides", load > 0.0, f"load moves by {100 * load:+.0f} % to the left", cause)
        robot.update(robot.half_sitting, np.zeros(robot.nv))
        places = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
        still = rest.settled("wrench")
        start = self._pressure(still, places)
        pressed = np.array([self._pressure(each, places)[1] for each in wrench])
        sideways = float(to_left @ pressed) / sway
        pressed = np.array([self._pressure(each, places)[0] for each in ahead])
        forward = float(to_front @ pressed) / surge
        rolling = [
            float(to_left @ (wrench[:, i, 3] / np.maximum(wrench[:, i, 2], 1.0))) / sway for i in (0, -1)
        ]
        ways = [1e3 * (start - com) for com in self._coms_at_rest(rest, places)]
        off = min(ways, key=lambda way: float(way @ way))
        beyond = self._beyond(still)
        found = (
            f"pressure moves {forward:.2f} and {sideways:.2f} of the way; it is {off[0]:+.0f}, {off[1]:+.0f} mm "
            "from the centre of mass"
        ) + (f", {beyond:.0f} mm beyond the edge of a sole" if beyond > 0.0 else "")
        cause = (
            "moments have the reversed sign, or the sensor's x axis points backwards: the ankles push the wrong way"
            if forward < -0.2
            else "moments are about another point than the sole centre (the sensor's or the ankle's), or in another "
            "frame or unit: the robot leans, the feet tilt"
        )
        right = 0.25 < forward < 2.5 and max(np.abs(rolling)) < 2.5
        self.add("wrench frame", right and max(np.abs(off)) < APART and beyond < BEYOND, found, cause)

    def _coms_at_rest(self, rest: Record, places: list[pin.SE3]) -> list[Array]:
        """Return where the centre of mass is at rest, in the world, each of shape (2,), m.

        By the encoders on level soles, and by the lean that the IMU sees as well where it is right: soles give way
        under a body that leans, and an IMU may be mounted a little off.
        """
        robot = self.robot
        q = np.array(robot.half_sitting)
        q[7:] = rest.settled("position")
        robot.update(q, np.zeros(robot.nv))
        soles = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
        pairs = list(zip(places, soles, strict=True))
        coms = [np.mean([(place * sole.inverse()).act(robot.com) for place, sole in pairs], axis=0)]
        if not self.bad("accelerometer", "IMU frame"):
            up = robot.placement(robot.imu_frame).rotation @ rest.settled("accelerometer")
            lean = pin.Quaternion.FromTwoVectors(up, np.array([0.0, 0.0, 1.0])).toRotationMatrix()
            ways = [place.translation + lean @ (robot.com - sole.translation) for place, sole in pairs]
            coms.append(np.mean(ways, axis=0))
        return [com[:2] for com in coms]

    def _beyond(self, wrench: Array) -> float:
        """Return how far the centre of pressure lies outside its sole at most, mm; below zero inside of all soles."""
        beyond = [-np.inf]
        for (*_, normal, roll, pitch, _), sole in zip(wrench, self.robot.soles, strict=True):
            if normal > 0.1 * self.robot.mass * GRAVITY:
                half = 0.5 * np.array([sole.length, sole.width])
                beyond.append(float((np.abs([pitch, roll]) / normal - half).max()))
        return 1e3 * max(beyond)

    def _zmp(self, record: Record) -> Array:
        """Return the ZMP less its mean, by the encoders and level soles at rest, smoothed, shape (n, 2), m.

        What the references ask for would not do: a heavy body on its ankles follows them late.
        """
        robot = self.robot
        q = np.array(robot.half_sitting)
        robot.update(q, np.zeros(robot.nv))
        height = float(robot.com[2])
        places = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
        com = np.zeros((len(record.position), 2))
        for i, position in enumerate(record.position):
            q[7:] = position
            robot.update(q, np.zeros(robot.nv))
            for place, sole in zip(places, robot.soles, strict=True):
                com[i] += (place * robot.placement(sole.frame).inverse()).act(robot.com)[:2] / len(places)
        com = self._smoothed(com)
        zmp = com[1:-1] - height / GRAVITY * np.diff(com, 2, axis=0) / self.excite.period**2
        zmp -= zmp.mean(axis=0)
        return np.asarray(zmp)

    def _smoothed(self, rows: Array) -> Array:
        """Return rows averaged over `SMOOTHING`, where the window fits."""
        window = np.hanning(max(5, round(SMOOTHING / self.excite.period)))
        smooth: Array = np.apply_along_axis(np.convolve, 0, rows, window / window.sum(), "valid")
        return smooth

    def _pressure(self, wrench: Array, places: list[pin.SE3]) -> Array:
        """Return the centre of pressure of all soles in the world, shape (2,), m."""
        total = np.zeros(6)
        for place, part in zip(places, wrench, strict=True):
            total += place.act(pin.Force(part)).vector
        return np.array([-total[4], total[3]]) / max(float(total[2]), 1.0)

    def check_soles(self) -> None:
        """Check that both soles are flat and level by the encoders, against each other and against gravity."""
        if self.bad("joint order", "joint sign", "joint unit"):
            self.add("soles", "unknown", "joints are not measured as they should")
            return
        robot = self.robot
        q = np.array(robot.half_sitting)
        q[7:] = self.rest.settled("position")
        robot.update(q, np.zeros(robot.nv))
        left, right = (pin.SE3(robot.placement(sole.frame)) for sole in robot.soles[:2])
        height = float(left.translation[2] - right.translation[2])
        tilt = float(np.linalg.norm(np.cross(left.rotation[:, 2], right.rotation[:, 2])))
        if not self.bad("accelerometer", "IMU frame"):
            up = robot.placement(robot.imu_frame).rotation @ self.rest.settled("accelerometer")
            up /= np.linalg.norm(up)
            tilt = max(tilt, float(np.linalg.norm(np.cross(left.rotation[:, 2], up))))
        cause = "zeros of leg encoders, or legs of another length than in the description: one foot is light"
        found = f"{1e3 * height:+.1f} mm apart in height, {np.degrees(tilt):.1f}° of tilt"
        self.add("soles", abs(height) < 0.006 and tilt < LEVEL, found, cause)


def _nearest_rotation(matrix: Array) -> Array:
    u, _, vt = np.linalg.svd(matrix)
    rotation: Array = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation
