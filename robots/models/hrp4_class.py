"""`hrp4_class`: a fictional humanoid of the class of HRP-4, from published figures.

No such machine exists and the model has no CAD data of HRP-4. Class and size are those published for HRP-4: 151 cm,
39 kg, 34 joints, 7 of them in each arm (Kaneko et al., "Humanoid Robot HRP-4", IROS 2011, abstract). Proportions,
masses, joint ranges and speeds come from the model of its sister HRP-4C (isri-aist/hrp4c_description, BSD-3-Clause,
URDF of 1.58 m and 42.77 kg), changed as follows.

- Legs: thigh, shin, hip spacing and ankle height of HRP-4C, but straight: the ankles stay ±87.5 mm apart as the hips
  are (HRP-4C's are ±68.5 mm). Axes yaw, roll, pitch, knee, ankle pitch, ankle roll.
- Upper body: HRP-4C's lengths times 0.912, so that the whole stands 1.51 m tall.
- Masses: HRP-4C's, times 39 / 42.77, grouped into the links of this robot; the inertia of a link is that of the solids
  that are drawn, all of one density.
- Waist: pitch and yaw; neck: yaw and pitch; arm: shoulder pitch, roll, yaw, elbow, wrist yaw, pitch, roll; hand:
  thumb and fingers. That makes 2 + 2 + 14 + 4 + 12 = 34.
- Soles: the flat rectangle of the walking experiments, 160 × 76 mm, 93 mm below the ankle, its centre 20 mm ahead of
  the ankle (HRP-4C's foot surface), laterally under it.

Speed limits are HRP-4C's. Its torque limits are a placeholder (100 Nm everywhere), so torque limits were chosen
before any walk was simulated with this model:

- Legs: those of Talos (100, 160, 160, 300, 160, 100 Nm along the leg; 90.27 kg, centre of mass at 0.877 m), whose
  torque limits are published and whose legs have the same axes, scaled by the ratio of m g h, 0.39 for 39 kg and 0.80
  m, and rounded: 40, 60, 60, 115, 60, 40 Nm.
- Waist: 60 Nm, as the hip; holding the upper body bent forward by 90° takes about 2/3 of that.
- Arms: at least twice the torque that holds the arm stretched out sideways: shoulder pitch and roll 20 Nm, shoulder
  yaw and elbow 10 Nm, wrist 4 Nm; hand and neck 2 and 6 Nm.
"""

from __future__ import annotations

import math
from pathlib import Path

from wbc.core.frames import FrameDescription, Sole
from wbc.core.robot import SIDES
from wbc.robots.description import RobotDescription
from wbc.robots.frames import SOLE_NAMES

FILE = Path(__file__).with_suffix(".urdf")
"""The robot as URDF, without meshes."""


def describe() -> RobotDescription:
    """Return the description of `hrp4_class`."""
    arms = {
        "left_shoulder_roll": math.radians(10.0),
        "right_shoulder_roll": math.radians(-10.0),
        **{f"{side}_shoulder_pitch": math.radians(4.0) for side in SIDES},
        **{f"{side}_elbow_pitch": math.radians(-30.0) for side in SIDES},
    }
    left, right = (
        Sole(
            frame=f"{side}_sole",
            link=f"{side}_foot",
            translation=(0.020, 0.0, -0.093),
            name=name,
            length=0.160,
            width=0.076,
        )
        for side, name in zip(SIDES, SOLE_NAMES, strict=True)
    )
    return RobotDescription.from_urdf(
        FILE,
        name="hrp4_class",
        left_sole=left,
        right_sole=right,
        half_sitting=arms,
        torso="chest",
        imu=FrameDescription("imu", "pelvis"),
        hands={"left_hand": "left_hand", "right_hand": "right_hand"},
        height=1.51,
        provenance="wbc.robots.models.hrp4_class, fictional, "
        "from figures of HRP-4 (IROS 2011) and HRP-4C (BSD-3-Clause)",
        licence="BSD-2-Clause",
    )
