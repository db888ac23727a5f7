"""Tasks and contacts of the stepping walk in the whole-body controller, and the targets that a tick gives them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.controller import Controller
from wbc.core.qp.foothold import Foothold
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.stabilizer.lean import UPRIGHT, LeanMotion
from wbc.walking.body import Twist
from wbc.walking.planning.footsteps import heading
from wbc.walking.planning.phases import Phase
from wbc.walking.source import Reference, Support
from wbc.walking.stepping.settings import Scale, SteppingSettings
from wbc.walking.tasks import leave_to_walk

# In units of the robot; costs are per (m/s²)², those of rotations per (h rad/s²)² with the height h of the CoM.
COM = 10.0, 3.67, 3.46
"""Cost of the CoM's height, on two feet of its place as well; stiffness, ω², and damping, ω, of the height."""

SWING, SWING_TURN = (20.0, 30.6, 9.9), (5.6, 24.5, 8.9)
"""Cost, stiffness, ω², and damping, ω, of the swing foot's place and rotation."""

PELVIS, PELVIS_YAW = (27.8, 7.35, 5.45), 2.78
"""The same of the pelvis, its cost that of tilt; cost of its heading."""

POSTURE, LEGS = (1.39, 4.9, 3.96), (2.8e-3, 0.5)
"""The same of joints that are not in the legs; cost and damping, ω, of those of the legs."""

HELD, HELD_TURN, STANDING_TURN, HELD_DAMPING = 1000.0, 8.3, 2780.0, 5.0
"""Cost of the place of a foot that stands, of its rotation on ground of unknown shape and in a stand; damping, ω."""

YIELDING = 0.1
"""Ratio of these costs for a foot that is unloaded, or waits to take over."""

FORCE, MOMENT = 1.1e-3, 2.0
"""Cost of forces on the feet, per (N/kg)², and of moments, per (Nm/(kg h))²; yaw moments are at most the normal force
times half of the width of the sole."""


class SteppingTasks:
    """Tasks, contacts and limits of one walk.

    Attributes:
        contacts: Footholds of the left and of the right sole.
        com: Task of the centre of mass.
        posture: Task of all joints.
    """

    def __init__(self, controller: Controller, gait: SteppingSettings, scale: Scale) -> None:
        """Add all tasks, contacts and limits to a controller of a robot that stands at the start.

        Settings of the gait are in SI units.
        """
        self._gait, self._scale = gait, scale
        robot, omega, square = controller.robot, scale.omega, scale.omega**2
        turn = scale.height**2  # from (h rad/s²)² to (rad/s²)²
        weight, stiffness, damping = COM
        self.com = controller.add(
            CoMTask(
                weight=weight, stiffness=(0.0, 0.0, stiffness * square), damping=(0.0, 0.0, damping * omega)
            )
        )
        self._com_weights = np.array([0.0, 0.0, weight]), np.full(3, weight)
        self._swings = [
            controller.add(
                PoseTask(
                    sole.frame,
                    name=f"{sole.name} swing",
                    weight=0.0,
                    stiffness=_halves(SWING[1] * square, SWING_TURN[1] * square),
                    damping=_halves(SWING[2] * omega, SWING_TURN[2] * omega),
                )
            )
            for sole in robot.soles
        ]
        self._swing_weight = _halves(SWING[0], SWING_TURN[0] * turn)
        tilt, yaw = PELVIS[0] * turn, PELVIS_YAW * turn
        self._pelvis = controller.add(
            OrientationTask(
                robot.base_frame,
                name="pelvis",
                weight=(tilt, tilt, yaw),
                stiffness=PELVIS[1] * square,
                damping=PELVIS[2] * omega,
            )
        )
        upright = heading(robot.placement(robot.base_frame).rotation)
        self._pelvis_tilt = pin.rpy.rpyToMatrix(0.0, 0.0, -upright) @ self._pelvis.target
        self.posture = controller.add(self._posture(controller, turn))
        controller.add(JointLimits())
        force, moment = FORCE / scale.mass**2, MOMENT / (scale.mass**2 * turn)
        self._held = _halves(HELD, HELD_TURN * turn)
        self._firm = _halves(HELD, STANDING_TURN * turn)
        self.contacts = [
            controller.add(
                Foothold(
                    sole.name,
                    friction=gait.friction,
                    torsion=scale.sole[1],
                    damping=HELD_DAMPING * omega,
                    wrench_weight=_halves(force, moment),
                    motion_weight=self._firm,
                )
            )
            for sole in robot.soles
        ]
        controller.add(TorqueLimits())
        leave_to_walk(self.com, self._swings, [self._pelvis])
        self._state: tuple[object, ...] = ()

    def _posture(self, controller: Controller, turn: float) -> PostureTask:
        """Return the task of all joints: those of the legs are only damped."""
        robot, omega = controller.robot, self._scale.omega
        stiffness = np.full(robot.na, POSTURE[1] * omega**2)
        damping = np.full(robot.na, POSTURE[2] * omega)
        legs = robot.leg_joints
        stiffness[legs], damping[legs] = 0.0, LEGS[1] * omega
        share = LEGS[0] / POSTURE[0]
        return PostureTask(
            joints=robot.joint_names,
            weight=POSTURE[0] * turn,
            stiffness=stiffness,
            damping=damping,
            joint_weights={robot.joint_names[j]: share for j in legs},
        )

    def follow(
        self,
        reference: Reference,
        lean: LeanMotion = UPRIGHT,
        twist: Twist | None = None,
    ) -> None:
        """Set all targets of a tick; `UPRIGHT` itself is no lean, None no twist of the trunk against the heading."""
        support = reference.support
        assert support is not None
        self._stand(reference, support)
        if support.swing is not None:
            self._swings[support.swing].follow(*reference.feet[support.swing])
        pendulum = reference.pendulum
        self.com.follow(pendulum.com, pendulum.com_velocity, pendulum.com_acceleration)
        if twist is None:
            self._pelvis.follow(pin.rpy.rpyToMatrix(0.0, 0.0, reference.heading) @ self._pelvis_tilt)
            return
        angle, rate, acceleration, _ = twist
        turn, up = pin.rpy.rpyToMatrix(0.0, 0.0, reference.heading + angle), np.array([0.0, 0.0, 1.0])
        self._pelvis.follow(
            lean.rotation @ turn @ self._pelvis_tilt,
            lean.velocity + rate * up,
            lean.acceleration + acceleration * up,
        )

    def _stand(self, reference: Reference, support: Support) -> None:
        """Switch contacts, and the weights that go with them, where they change."""
        gait, most = self._gait, support.most_force
        balanced, standing = support.balanced, reference.phase is Phase.STANDING
        state = (reference.contact, most, support.stance, balanced, standing, support.swing)
        if state == self._state:
            return
        before, self._state = self._state, state
        if not before or before[3] != balanced:
            self.com.weight = self._com_weights[balanced]
        if not before or before[3:5] != state[3:5]:
            length, width = gait.standing_box if balanced else gait.box
            for contact in self.contacts:
                contact.set_box(length, width, (0.0 if standing else gait.foothold, 0.0))
        both = all(reference.contact)
        for side, contact in enumerate(self.contacts):
            on = reference.contact[side]
            contact.active = on
            self._swings[side].weight = self._swing_weight if side == support.swing else 0.0
            if not on:
                continue
            full = balanced or side == support.stance
            weight = self._firm if balanced else self._held
            contact.motion_weight = weight if full else YIELDING * weight
            contact.min_force = 0.0  # first: a foot that was unloading may have less than it must carry now
            contact.max_force = max(most[side], 1e-3 * gait.most_force)
            if full:
                contact.min_force = gait.least_force * (0.2 if both else 1.0)


def _halves(linear: float, angular: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return a value for three linear and one for three angular rows, shape (6,)."""
    return np.array([linear] * 3 + [angular] * 3)
