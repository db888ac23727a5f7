"""Servo gains and rotor inertias from the model alone.

The servo of a joint accelerates the arm or leg beyond it; the servo of a standing leg accelerates the body above, half
of it when both legs stand. The gains give this inertia a natural frequency and a damping ratio.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.model import driven_joints, joints_to
from wbc.core.robot import GRAVITY

ARMATURE_RATIO = 0.1 / (90.27 * 0.877**2)
"""Rotor inertia seen at a joint over m h², with m the mass of the robot and h the height of its centre of mass.

Talos declares 0.1 kg m² for every joint (rotor 1e-5 kg m², reduction 100, in its SRDF) at 90.27 kg and 0.877 m.
Inertias of similar robots scale with m h²: 0.036 kg m² for a robot of 39 kg and 0.80 m.
"""


@settings
class ServoRule:
    """Proportional-derivative gains from effective inertia.

    The effective inertia of a joint in half-sitting is its armature plus the inertia of the links below it. For a leg
    joint a share of the inertia above it is taken instead if this is larger.

    The stiffness of legs has bounds, for two reasons. The foot admittance θ̇ = A (τ − τ*) through an ankle of stiffness
    K is a loop of rate A K, which must stay well below 1 / control period. And a leg as stiff as the floor transmits
    every bump. The bounds are multiples of m g h, the stiffness below which the robot would tip over. For comparison,
    the published servo gains of JVRC-1 (62 kg; hips and knees 5000 to 6000, ankles 3000 Nm/rad, jvrc_mj_description,
    BSD-2) are 9.4 to 11.3 and 5.7 of them.

    Attributes:
        frequency: Natural frequency of the held joint, Hz. 3 to 25 Hz stood quietly in simulation at 1 ms.
        damping_ratio: Damping ratio of the held joint; 1 is critical.
        stance_share: Share of the inertia above a leg joint that this leg holds; 0.5 with the weight on both legs.
        leg_stiffness: Bound of the stiffness of hips and knees, m g h/rad.
        ankle_stiffness: Bound of the stiffness of the last two joints of a leg, m g h/rad.
    """

    frequency: Annotated[Positive, "Hz"] = 8.0
    damping_ratio: Positive = 1.0
    stance_share: NonNegative = 0.5
    leg_stiffness: Annotated[Positive, "m g h/rad"] = 13.0
    ankle_stiffness: Annotated[Positive, "m g h/rad"] = 6.5

    def gains(self, inertia: Array, bound: Array) -> tuple[Array, Array]:
        """Return kp (Nm/rad) and kd (Nms/rad) by effective inertia (kg m²) and bound (Nm/rad), all of shape (na,)."""
        omega = math.tau * self.frequency
        kp = np.minimum(omega**2 * inertia, bound)
        return kp, kp * (2.0 * self.damping_ratio / omega)

    def bound(self, model: pin.Model, q: Array, sole_frames: tuple[str, ...]) -> Array:
        """Return the largest stiffness of each joint, shape (na,), Nm/rad; infinite where the rule gives none."""
        base = model.nv - len(driven_joints(model))
        bound = np.full(len(driven_joints(model)), np.inf)
        if not sole_frames:
            return bound
        data = model.createData()
        com = pin.centerOfMass(model, data, q)
        pin.updateFramePlacements(model, data)
        sole = min(data.oMf[model.getFrameId(frame)].translation[2] for frame in sole_frames)
        tipping = pin.computeTotalMass(model) * GRAVITY * (com[2] - sole)
        for frame in sole_frames:
            leg = [model.joints[joint].idx_v - base for joint in joints_to(model, frame)]
            bound[leg] = self.leg_stiffness * tipping
            bound[leg[-2:]] = self.ankle_stiffness * tipping
        return bound


def read_gains(texts: Sequence[str], joint_names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return joint → (kp, kd), Nm/rad and Nms/rad, of texts such as "*knee*=100,2"; later ones override earlier ones.

    Raises `InputError` for a text of another form, or a pattern that fits no joint.
    """
    gains: dict[str, tuple[float, float]] = {}
    for text in texts:
        pattern, _, values = text.partition("=")
        try:
            kp, kd = (float(value) for value in values.split(","))
        except ValueError:
            raise InputError(
                f"gains of servos are given as pattern=kp,kd, such as '*knee*=100,2', got {shown(text)}"
            ) from None
        found = fnmatch.filter(joint_names, pattern.strip())
        if not found:
            raise InputError(f"no joint fits '{pattern}'; joints: {', '.join(joint_names)}")
        gains |= dict.fromkeys(found, (kp, kd))
    return gains


def effective_inertia(
    model: pin.Model, q: Array, sole_frames: tuple[str, ...], armature: Array, stance_share: float
) -> Array:
    """Return the inertia that each servo accelerates at a configuration, shape (na,), kg m² (kg where it slides)."""
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    legs = {joint for frame in sole_frames for joint in joints_to(model, frame)}
    spatial = [np.zeros((6, 6))]
    spatial += [data.oMi[i].act(model.inertias[i]).matrix() for i in range(1, model.njoints)]
    total = sum(spatial, np.zeros((6, 6)))
    driven = driven_joints(model)
    base, result = model.nv - len(driven), np.zeros(len(driven))
    own = np.diag(pin.crba(model, model.createData(), q)) - model.armature  # with what is coupled to a joint
    for joint in driven:
        column = data.J.reshape(6, -1)[:, model.joints[joint].idx_v]
        below = sum((spatial[i] for i in model.subtrees[joint]), np.zeros((6, 6)))
        inertia = float(own[model.joints[joint].idx_v])
        if joint in legs:
            inertia = max(inertia, stance_share * float(column @ (total - below) @ column))
        result[model.joints[joint].idx_v - base] = inertia
    return np.asarray(result + armature)
