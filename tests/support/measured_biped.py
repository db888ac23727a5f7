"""A biped, its motions, and the measurements that exact or noisy sensors make of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin

from wbc.core.estimation.observer import Observer
from wbc.core.frames import Sole
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement

UP = np.array([0.0, 0.0, 1.0])


@cache
def biped() -> Robot:
    """Two legs of six joints and a chest that carries the IMU off its axis."""
    model = pin.Model()
    model.name = "biped"
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.addFrame(pin.Frame("base", root, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    model.appendBodyToJoint(root, pin.Inertia.FromBox(10.0, 0.2, 0.2, 0.2), pin.SE3.Identity())

    def add(parent: int, joint: object, offset: tuple[float, float, float], name: str, mass: float) -> int:
        i = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(offset)), name)
        model.appendBodyToJoint(i, pin.Inertia.FromSphere(mass, 0.05), pin.SE3.Identity())
        return int(i)

    chest = add(root, pin.JointModelRY(), (0.0, 0.0, 0.2), "chest", 12.0)
    imu = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([0.03, -0.02, 0.15]))
    model.addFrame(pin.Frame("imu", chest, 0, imu, pin.FrameType.OP_FRAME))
    for side, y in (("left", 0.09), ("right", -0.09)):
        i = add(root, pin.JointModelRZ(), (0.0, y, -0.1), f"{side}_hip_yaw", 0.5)
        i = add(i, pin.JointModelRX(), (0.0, 0.0, 0.0), f"{side}_hip_roll", 0.5)
        i = add(i, pin.JointModelRY(), (0.0, 0.0, 0.0), f"{side}_hip_pitch", 3.0)
        i = add(i, pin.JointModelRY(), (0.0, 0.0, -0.35), f"{side}_knee", 2.0)
        i = add(i, pin.JointModelRY(), (0.0, 0.0, -0.35), f"{side}_ankle_pitch", 0.5)
        i = add(i, pin.JointModelRX(), (0.0, 0.0, 0.0), f"{side}_ankle_roll", 1.0)
        sole = pin.SE3(np.eye(3), np.array([0.02, 0.0, -0.09]))
        model.addFrame(pin.Frame(f"{side}_sole", i, 0, sole, pin.FrameType.OP_FRAME))
    q = pin.neutral(model)
    for side in ("left", "right"):
        for joint, angle in (("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4)):
            q[model.joints[model.getJointId(f"{side}_{joint}")].idx_q] = angle
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    q[2] -= data.oMf[model.getFrameId("left_sole")].translation[2]
    soles = [
        Sole(f"{s}_sole", f"{s}_sole", name=f"{s}_foot", length=0.2, width=0.1) for s in ("left", "right")
    ]
    return Robot(model, soles, q, torso_frame="imu", imu_frame="imu")


def measurements(
    robot: Robot, qs: np.ndarray, dt: float, cops: dict[str, np.ndarray], left: np.ndarray
) -> tuple[list[Measurement], np.ndarray]:
    """Exact sensors along a motion, and its velocities, both at the inner samples.

    Args:
        robot: Model.
        qs: Configurations, shape (n, nq).
        dt: Time between them, s.
        cops: Centre of pressure of each sole, shape (n, 2), m.
        left: Share of the weight on the left foot, shape (n,).
    """
    n = len(qs)
    model, data = robot.model, robot.model.createData()
    imu = robot.frame_id("imu")
    points, rotations = np.zeros((n, 3)), []
    for k in range(n):
        pin.framesForwardKinematics(model, data, qs[k])
        points[k] = data.oMf[imu].translation
        rotations.append(np.array(data.oMf[imu].rotation))
    result, velocities = [], []
    for k in range(1, n - 1):
        v = pin.difference(model, qs[k - 1], qs[k + 1]) / (2 * dt)
        acceleration = (points[k + 1] - 2 * points[k] + points[k - 1]) / dt**2
        weight = robot.mass * GRAVITY
        wrench = np.zeros((2, 6))
        for i, (side, share) in enumerate((("left", left[k]), ("right", 1.0 - left[k]))):
            c, f = cops[side][k], share * weight
            wrench[i] = (0.0, 0.0, f, c[1] * f, -c[0] * f, 0.0)
        result.append(
            Measurement(
                time=k * dt,
                joint_position=qs[k, 7:].copy(),
                joint_velocity=v[6:],
                angular_velocity=pin.log3(rotations[k - 1].T @ rotations[k + 1]) / (2 * dt),
                specific_force=rotations[k].T @ (acceleration + GRAVITY * UP),
                sole_wrench=wrench,
            )
        )
        velocities.append(v)
    return result, np.array(velocities)


def errors(observer: Observer, sensors: list[Measurement], qs: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """Base position (m), attitude (rad), base velocity (m/s) and CoM velocity (m/s) errors, shape (n, 4)."""
    truth = biped().clone()
    out = np.zeros((len(sensors), 4))
    for k, sensor in enumerate(sensors):
        estimate = observer.update(sensor)
        truth.update(qs[k], vs[k])
        out[k, 0] = np.linalg.norm(estimate.q[:3] - qs[k, :3])
        turn = pin.Quaternion(*estimate.q[[6, 3, 4, 5]]).angularDistance(pin.Quaternion(*qs[k, [6, 3, 4, 5]]))
        out[k, 1] = turn
        out[k, 2] = np.linalg.norm(estimate.v[:3] - vs[k, :3])
        out[k, 3] = np.linalg.norm(estimate.com_velocity - truth.com_velocity)
    return out


def noisy(sensors: list[Measurement], seed: int) -> list[Measurement]:
    """Encoders 0.1 mrad, joint speeds 5 mrad/s, gyro 3 mrad/s, accelerometer 0.05 m/s², 1 N, 0.05 Nm."""
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])
    return [
        replace(
            s,
            joint_position=s.joint_position + 1e-4 * rng.standard_normal(s.joint_position.shape),
            joint_velocity=s.joint_velocity + 5e-3 * rng.standard_normal(s.joint_velocity.shape),
            angular_velocity=s.angular_velocity + 3e-3 * rng.standard_normal(3),
            specific_force=s.specific_force + 0.05 * rng.standard_normal(3),
            sole_wrench=s.sole_wrench + scale * rng.standard_normal((2, 6)),
        )
        for s in sensors
    ]
