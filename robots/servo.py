"""Servo gains and rotor inertias for joints of which nothing is known but the model.

A servo that holds a joint sees the inertia that its torque accelerates. For an arm that is the arm; for a leg
that stands it is the body above, and half of it when both legs stand. The gains give that inertia a natural
frequency and a damping ratio.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, non_negative, positive

ARMATURE_RATIO = 0.1 / (90.27 * 0.877**2)
"""Rotor inertia seen at a joint over m h², with m the mass of the robot and h the height of its centre of mass.

Talos declares 0.1 kg m² for every joint (rotor 1e-5 kg m², reduction 100, in its SRDF) at 90.27 kg and 0.877 m.
Inertias of similar robots scale with m h²: 0.036 kg m² for a robot of 39 kg and 0.80 m.
"""


@dataclass(frozen=True)
class ServoRule:
    """Proportional-derivative gains from effective inertia.

    The effective inertia of a joint, at half-sitting, is the larger of what hangs below it and, for a leg joint, a
    share of what stands above it, plus its armature.

    Attributes:
        frequency: Natural frequency of the held joint, Hz. 3 to 25 Hz stood quietly in simulation at 1 ms.
        damping_ratio: Of the held joint; 1 is critical.
        stance_share: Share of the inertia above that one leg holds; 0.5 with the weight on both.
    """

    frequency: float = 8.0
    damping_ratio: float = 1.0
    stance_share: float = 0.5

    def __post_init__(self) -> None:
        positive("servo frequency (Hz)", self.frequency)
        positive("servo damping ratio", self.damping_ratio)
        non_negative("servo stance share", self.stance_share)

    def gains(self, inertia: Array) -> tuple[Array, Array]:
        """Stiffness kp and damping kd of joints.

        Args:
            inertia: Effective inertia, shape (na,), kg m².

        Returns:
            kp in Nm/rad and kd in Nms/rad, each of shape (na,).
        """
        omega = 2.0 * math.pi * self.frequency
        return omega**2 * inertia, 2.0 * self.damping_ratio * omega * inertia


def leg_joints(model: pin.Model, frame: str) -> list[int]:
    """Joints from the root to a frame, as indices of the model, the free-flyer left out."""
    parent = model.frames[model.getFrameId(frame)].parentJoint
    return [joint for joint in model.supports[parent] if joint > 1]


def effective_inertia(
    model: pin.Model, q: Array, sole_frames: tuple[str, ...], armature: Array, stance_share: float
) -> Array:
    """Inertia that each servo accelerates.

    Args:
        model: Pinocchio model with a free-flyer.
        q: Configuration, shape (nq,).
        sole_frames: Frames of the soles.
        armature: Rotor inertia per joint, shape (na,), kg m².
        stance_share: See `ServoRule`.

    Returns:
        Effective inertia, shape (na,), kg m² (kg for prismatic joints).
    """
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    legs = {joint for frame in sole_frames for joint in leg_joints(model, frame)}
    spatial = [np.zeros((6, 6))]
    spatial += [data.oMi[i].act(model.inertias[i]).matrix() for i in range(1, model.njoints)]
    total = sum(spatial, np.zeros((6, 6)))
    result = np.zeros(model.nv - 6)
    for joint in range(2, model.njoints):
        column = data.J[:, model.joints[joint].idx_v]
        below = sum((spatial[i] for i in model.subtrees[joint]), np.zeros((6, 6)))
        inertia = float(column @ below @ column)
        if joint in legs:
            inertia = max(inertia, stance_share * float(column @ (total - below) @ column))
        result[model.joints[joint].idx_v - 6] = inertia
    return np.asarray(result + armature)
