"""Tasks and contacts of the stepping walk in the whole-body controller, and the targets that a tick gives them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.controller import Controller
from wbc.core.qp.foothold import Foothold
from wbc.core.settings import NonNegative, Positive, settings
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


@settings
class SteppingGains:
    """Weights and gains of the tasks of a stepping walk, in units of the robot.

    Weights are costs per (m/s²)²; those of rotations per (h rad/s²)², h the height of the CoM.

    Attributes:
        com_weight: Height of the CoM; on two feet its place as well.
        com_stiffness: Stiffness of the CoM's height, ω².
        com_damping: Damping of the CoM's height, ω.
        swing_weight: Place of the swing foot.
        swing_stiffness: Stiffness of its place, ω².
        swing_damping: Damping of its place, ω.
        swing_turn_weight: Rotation of the swing foot.
        swing_turn_stiffness: Stiffness of its rotation, ω².
        swing_turn_damping: Damping of its rotation, ω.
        pelvis_weight: Tilt of the pelvis.
        pelvis_yaw_weight: Heading of the pelvis.
        pelvis_stiffness: Stiffness of the pelvis, ω².
        pelvis_damping: Damping of the pelvis, ω.
        posture_weight: Joints that are not in the legs.
        posture_stiffness: Stiffness of these joints, ω².
        posture_damping: Damping of these joints, ω.
        leg_weight: Joints of the legs, which are only damped.
        leg_damping: Damping of the joints of the legs, ω.
        foothold_weight: Place of a foot that stands.
        foothold_turn_weight: Rotation of a foot that stands on ground of unknown shape.
        standing_turn_weight: Rotation of both feet in a stand.
        foothold_damping: Damping of a foot that stands, ω.
        yielding: Ratio of these weights for a foot that is unloaded, or waits to take over.
        force_weight: Forces on the feet, cost per (N/kg)².
        moment_weight: Moments on the feet, cost per (Nm/(kg h))².
        torsion: Greatest yaw moment over the normal force, in half widths of the sole.
    """

    com_weight: Positive = 10.0
    com_stiffness: Annotated[Positive, "ω²"] = 3.67
    com_damping: Annotated[Positive, "ω"] = 3.46
    swing_weight: Positive = 20.0
    swing_stiffness: Annotated[Positive, "ω²"] = 30.6
    swing_damping: Annotated[Positive, "ω"] = 9.9
    swing_turn_weight: Positive = 5.6
    swing_turn_stiffness: Annotated[Positive, "ω²"] = 24.5
    swing_turn_damping: Annotated[Positive, "ω"] = 8.9
    pelvis_weight: Positive = 27.8
    pelvis_yaw_weight: Positive = 2.78
    pelvis_stiffness: Annotated[Positive, "ω²"] = 7.35
    pelvis_damping: Annotated[Positive, "ω"] = 5.45
    posture_weight: Positive = 1.39
    posture_stiffness: Annotated[Positive, "ω²"] = 4.9
    posture_damping: Annotated[Positive, "ω"] = 3.96
    leg_weight: Positive = 2.8e-3
    leg_damping: Annotated[NonNegative, "ω"] = 0.5
    foothold_weight: Positive = 1000.0
    foothold_turn_weight: NonNegative = 8.3
    standing_turn_weight: Positive = 2780.0
    foothold_damping: Annotated[Positive, "ω"] = 5.0
    yielding: Positive = 0.1
    force_weight: Positive = 1.1e-3
    moment_weight: Positive = 2.0
    torsion: Annotated[Positive, "sole"] = 1.0


class SteppingTasks:
    """Tasks, contacts and limits of one walk.

    Attributes:
        contacts: Footholds of the left and of the right sole.
        com: Task of the centre of mass.
        posture: Task of all joints.
    """

    def __init__(
        self, controller: Controller, gait: SteppingSettings, gains: SteppingGains, scale: Scale
    ) -> None:
        """Add all tasks, contacts and limits to a controller of a robot that stands at the start.

        Settings of the gait are in SI units.
        """
        self._gait, self._scale = gait, scale
        robot, omega, square = controller.robot, scale.omega, scale.omega**2
        turn = scale.height**2  # from (h rad/s²)² to (rad/s²)²
        self.com = controller.add(
            CoMTask(
                weight=gains.com_weight,
                stiffness=(0.0, 0.0, gains.com_stiffness * square),
                damping=(0.0, 0.0, gains.com_damping * omega),
            )
        )
        self._com_weights = (
            np.array([0.0, 0.0, gains.com_weight]),
            np.full(3, gains.com_weight),
        )
        self._swings = [
            controller.add(
                PoseTask(
                    sole.frame,
                    name=f"{sole.name} swing",
                    weight=0.0,
                    stiffness=_halves(gains.swing_stiffness * square, gains.swing_turn_stiffness * square),
                    damping=_halves(gains.swing_damping * omega, gains.swing_turn_damping * omega),
                )
            )
            for sole in robot.soles
        ]
        self._swing_weight = _halves(gains.swing_weight, gains.swing_turn_weight * turn)
        tilt, yaw = gains.pelvis_weight * turn, gains.pelvis_yaw_weight * turn
        self._pelvis = controller.add(
            OrientationTask(
                robot.base_frame,
                name="pelvis",
                weight=(tilt, tilt, yaw),
                stiffness=gains.pelvis_stiffness * square,
                damping=gains.pelvis_damping * omega,
            )
        )
        upright = heading(robot.placement(robot.base_frame).rotation)
        self._pelvis_tilt = pin.rpy.rpyToMatrix(0.0, 0.0, -upright) @ self._pelvis.target
        self.posture = controller.add(self._posture(controller, gains, turn))
        controller.add(JointLimits())
        force, moment = gains.force_weight / scale.mass**2, gains.moment_weight / (scale.mass**2 * turn)
        self._held = _halves(gains.foothold_weight, gains.foothold_turn_weight * turn)
        self._firm = _halves(gains.foothold_weight, gains.standing_turn_weight * turn)
        self._yielding = gains.yielding
        self.contacts = [
            controller.add(
                Foothold(
                    sole.name,
                    friction=gait.friction,
                    torsion=gains.torsion * scale.sole[1],
                    damping=gains.foothold_damping * omega,
                    wrench_weight=_halves(force, moment),
                    motion_weight=self._firm,
                )
            )
            for sole in robot.soles
        ]
        controller.add(TorqueLimits())
        leave_to_walk(self.com, self._swings, [self._pelvis])
        self._state: tuple[object, ...] = ()

    def _posture(self, controller: Controller, gains: SteppingGains, turn: float) -> PostureTask:
        """Return the task of all joints: those of the legs are only damped."""
        robot, omega = controller.robot, self._scale.omega
        stiffness = np.full(robot.na, gains.posture_stiffness * omega**2)
        damping = np.full(robot.na, gains.posture_damping * omega)
        legs = robot.leg_joints
        stiffness[legs], damping[legs] = 0.0, gains.leg_damping * omega
        share = gains.leg_weight / gains.posture_weight
        return PostureTask(
            joints=robot.joint_names,
            weight=gains.posture_weight * turn,
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
            contact.motion_weight = weight if full else self._yielding * weight
            contact.min_force = 0.0  # first: a foot that was unloading may have less than it must carry now
            contact.max_force = max(most[side], 1e-3 * gait.most_force)
            if full:
                contact.min_force = gait.least_force * (0.2 if both else 1.0)


def _halves(linear: float, angular: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return a value for three linear and one for three angular rows, shape (6,)."""
    return np.array([linear] * 3 + [angular] * 3)
