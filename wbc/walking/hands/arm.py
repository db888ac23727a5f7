"""The arm that carries a hand: its joints, its compliance, and the force with which it can press."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.robot import BASE_DOF, Robot, joints_to


class HandArm:
    """Arm of one hand, in the present posture of a robot.

    Attributes:
        frame: Index of the frame of the hand.
        joints: Joints from the chest to the hand, among all joints, shape (n,).
        reach: Length of the stretched arm, from its first joint to the frame of the hand, m.
    """

    def __init__(self, robot: Robot, hand: str) -> None:
        """Find the joints of the arm of a hand's frame."""
        self._robot = robot
        self.frame = robot.frame_id(hand)
        model = robot.model
        arm = joints_to(model, self.frame, robot.frame_id(robot.torso_frame))
        self.joints = np.array(robot.joints_between(hand, robot.torso_frame), dtype=np.intp)
        links = [model.jointPlacements[joint].translation for joint in arm[1:]]
        links.append(model.frames[self.frame].placement.translation)
        self.reach = sum(float(np.linalg.norm(link)) for link in links)
        self._shoulder = arm[0] if arm else 1

    @property
    def shoulder(self) -> Array:
        """Place of the first joint in the world, shape (3,), m."""
        place: Array = self._robot.data.oMi[self._shoulder].translation
        return place

    def compliance(self) -> float | None:
        """Return the compliance of the hand on its servos in the softest direction, m/N; None without gains."""
        robot, arm = self._robot, self.joints
        servos = robot.servos
        if servos is None:
            return None
        jacobian = pin.computeFrameJacobian(
            robot.model, robot.data, robot.q, self.frame, pin.LOCAL_WORLD_ALIGNED
        )[:3, BASE_DOF:]
        return float(np.linalg.norm((jacobian[:, arm] / servos.kp[arm]) @ jacobian[:, arm].T, 2))

    def axis(self) -> Array:
        """Return the direction from the frame of the hand to its mass, in that frame, shape (3,)."""
        model = self._robot.model
        mass, moment = 0.0, np.zeros(3)
        data = model.createData()
        pin.framesForwardKinematics(model, data, self._robot.half_sitting)
        for joint in model.subtrees[model.frames[self.frame].parentJoint]:
            inertia = model.inertias[joint]
            mass += inertia.mass
            moment += inertia.mass * data.oMi[joint].act(inertia.lever)
        arm = data.oMf[self.frame].actInv(moment / mass)
        return np.asarray(arm / max(float(np.linalg.norm(arm)), 1e-6))

    def strength(self, direction: Array, share: float) -> tuple[float, str]:
        """Return the greatest force along a direction, N, by a ratio of the torque limits, and its joint."""
        robot, arm = self._robot, self.joints
        jacobian = pin.getFrameJacobian(robot.model, robot.data, self.frame, pin.LOCAL_WORLD_ALIGNED)
        lever = direction @ jacobian[:3, BASE_DOF:][:, arm]
        # A hand at rest: what carries the arm is left out of what may press, or helps.
        carried = (robot.data.g[BASE_DOF:] + robot.spring_torques(robot.q))[arm]
        limit = np.where(lever > 0.0, robot.torque_upper[arm], -robot.torque_lower[arm])
        spare = np.maximum(share * limit - np.sign(lever) * carried, 0.0)  # torque
        most = spare / np.maximum(np.abs(lever), 1e-6)
        least = int(np.argmin(most))
        return float(most[least]), robot.joint_names[arm[least]]
