"""`hrp4_class`: a fictional humanoid of the class of HRP-4, from published figures.

No such machine exists and the model has no CAD data of HRP-4. Class and size are those published for HRP-4: 151 cm,
39 kg, 34 joints, 7 of them in each arm (Kaneko et al., "Humanoid Robot HRP-4", IROS 2011, abstract). Proportions,
masses, joint ranges and speeds come from the model of its sister HRP-4C (isri-aist/hrp4c_description, BSD-3-Clause,
URDF of 1.58 m and 42.77 kg), changed as follows.

- Legs: thigh, shin, hip spacing and ankle height of HRP-4C, but straight: the ankles stay ±87.5 mm apart as the hips
  are (HRP-4C's are ±68.5 mm). Axes yaw, roll, pitch, knee, ankle pitch, ankle roll.
- Upper body: HRP-4C's lengths times 0.912, so that the whole stands 1.51 m tall.
- Masses: HRP-4C's, times 39 / 42.77, grouped into the links of this robot; inertias are those of the solid primitive
  shapes that are drawn.
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
from functools import cache

from wbc.core.robot import SIDES
from wbc.robots.description import RobotDescription
from wbc.robots.frames import SOLE_NAMES, FrameDescription, SoleDescription
from wbc.robots.models.primitives import DARK, GREY, Joint, Link, box, cylinder, serial_chain, sphere, to_urdf

HEIGHT = 1.51
"""Standing height, m (HRP-4, IROS 2011)."""

MASS = 39.0
"""Total mass, kg (HRP-4, IROS 2011)."""

HIP_OFFSET = 0.0875
"""Half the distance between the hips, m (HRP-4C)."""

THIGH = 0.350
"""Hip to knee, m (HRP-4C)."""

SHIN = 0.341
"""Knee to ankle, m (HRP-4C, 0.341151)."""

ANKLE_HEIGHT = 0.093
"""Ankle above the sole, m (HRP-4C)."""

SOLE = (0.160, 0.076)
"""Length and width of the sole, m (HRP-4C's foot surface, the flat foot of the experiments)."""

SOLE_FORWARD = 0.020
"""Sole centre ahead of the ankle, m (HRP-4C's foot surface)."""

UPPER = (HEIGHT - ANKLE_HEIGHT - SHIN - THIGH) / (1.58 - 0.784)
"""Scale of the upper body: height above the hips, of HRP-4 over that of HRP-4C."""


def trunk() -> tuple[list[Link], list[Joint]]:
    """Return links and joints of pelvis, waist, chest, neck and head."""
    u = UPPER
    crown = (1.58 - 0.784 - 0.197 - 0.434) * u  # top of the head above the neck joints
    links = [
        Link(
            "pelvis",
            7.649,
            box((0.130, 0.200, 0.080), (-0.010, 0.0, 0.062)),
            box((0.110, 0.150, 0.050), (-0.008, 0.0, 0.127), colour=GREY),
        ),
        Link("waist_link", 1.777, cylinder((0.052, 0.130), axis="y", colour=DARK)),
        Link(
            "chest",
            7.067,
            box((0.120, 0.170, 0.100), (-0.018, 0.0, 0.090), colour=GREY),
            box((0.165, 0.210, 0.130), (-0.025, 0.0, 0.200)),
            box((0.120, 0.150, 0.035), (-0.036, 0.0, 0.2825)),
            cylinder((0.033, 0.090), (-0.036, 0.0, 0.345), colour=DARK),
        ),
        Link("neck_link", 0.339, sphere((0.030,), colour=DARK)),
        Link(
            "head",
            3.257,
            sphere((0.068,), (0.004, 0.0, crown - 0.068)),
            cylinder((0.058, 0.080), (0.004, 0.0, 0.050)),
            box((0.030, 0.100, 0.034), (0.062, 0.0, 0.085), colour=DARK),
        ),
    ]
    joints = [
        Joint("waist_pitch", "pelvis", "waist_link", (0.010 * u, 0.0, 0.197 * u), "y", (-12, 30), 5.42, 60.0),
        Joint("waist_yaw", "waist_link", "chest", (0.0, 0.0, 0.0), "z", (-35, 35), 5.82, 60.0),
        Joint("neck_yaw", "chest", "neck_link", (-0.040 * u, 0.0, 0.434 * u), "z", (-70, 70), 4.04, 6.0),
        Joint("neck_pitch", "neck_link", "head", (0.0, 0.0, 0.0), "y", (-30, 25), 4.04, 6.0),
    ]
    return links, joints


def arm(side: str) -> tuple[list[Link], list[Joint]]:
    """Return links and joints of an arm with its hand; the right one mirrors the left."""
    u, s = UPPER, 1.0 if side == "left" else -1.0
    upper, fore = 0.283 * u, 0.222 * u

    def turn(low: float, high: float) -> tuple[float, float]:
        """Return the range of a roll or yaw joint, mirrored on the right."""
        return (low, high) if s > 0 else (-high, -low)

    links = [
        Link(f"{side}_shoulder_pitch_link", 0.412, cylinder((0.042, 0.050), axis="y", colour=DARK)),
        Link(f"{side}_shoulder_roll_link", 0.576, sphere((0.046,), (0.0, 0.010 * s, 0.0))),
        Link(
            f"{side}_upper_arm",
            1.218,
            cylinder((0.034, 0.170), (0.0, 0.010 * s, -0.120)),
            cylinder((0.032, 0.060), (0.0, 0.005 * s, -upper), axis="y", colour=DARK),
        ),
        Link(f"{side}_elbow_link", 0.338, cylinder((0.029, 0.060), (0.0, 0.0, -0.045), colour=GREY)),
        Link(f"{side}_forearm", 0.218, cylinder((0.029, 0.100), (0.0, 0.0, -0.125))),
        Link(f"{side}_wrist_link", 0.060, sphere((0.023,), colour=DARK)),
        Link(f"{side}_hand", 0.260, box((0.060, 0.026, 0.070), (0.0, 0.0, -0.055), colour=GREY)),
        Link(f"{side}_thumb", 0.050, box((0.018, 0.018, 0.050), (0.0, 0.0, -0.025), colour=DARK)),
        Link(f"{side}_fingers", 0.090, box((0.058, 0.018, 0.065), (0.0, 0.0, -0.0325), colour=DARK)),
    ]
    shoulder = (-0.040 * u, 0.160 * u * s, 0.285 * u)
    joints = serial_chain(
        side,
        "chest",
        ("shoulder_pitch", "shoulder_pitch_link", shoulder, "y", (-147, 60), 2.91, 20),
        ("shoulder_roll", "shoulder_roll_link", (0, 0, 0), "x", turn(-10, 89), 2.51, 20),
        ("shoulder_yaw", "upper_arm", (0, 0, 0), "z", (-92, 92), 5.05, 10),
        ("elbow_pitch", "elbow_link", (0, 0, -upper), "y", (-123, 2), 2.09, 10),
        ("wrist_yaw", "forearm", (0, 0, 0), "z", (-92, 92), 3.80, 4),
        ("wrist_pitch", "wrist_link", (0, 0, -fore), "y", (-84, 84), 3.80, 4),
        ("wrist_roll", "hand", (0, 0, 0), "x", (-84, 84), 3.80, 4),
    )
    hand = f"{side}_hand"
    joints += [
        Joint(f"{side}_thumb_joint", hand, f"{side}_thumb", (0.036, 0.0, -0.040), "y", (-90, 0), 14.6, 2),
        Joint(f"{side}_fingers_joint", hand, f"{side}_fingers", (0, 0, -0.092), "x", turn(-90, 20), 16.0, 2),
    ]
    return links, joints


def leg(side: str) -> tuple[list[Link], list[Joint]]:
    """Return links and joints of a leg; the right one mirrors the left."""
    s = 1.0 if side == "left" else -1.0
    plate = 0.020
    links = [
        Link(f"{side}_hip_yaw_link", 1.173, cylinder((0.046, 0.070), (0.0, 0.0, 0.050), colour=DARK)),
        Link(f"{side}_hip_roll_link", 0.604, sphere((0.048,), colour=GREY)),
        Link(
            f"{side}_thigh",
            2.363,
            cylinder((0.054, 0.160), (0.002, 0.0, -0.125)),
            cylinder((0.046, 0.110), (0.002, 0.0, -0.255)),
        ),
        Link(
            f"{side}_shin",
            2.215,
            cylinder((0.045, 0.090), axis="y", colour=DARK),
            cylinder((0.043, 0.150), (-0.006, 0.0, -0.125)),
            cylinder((0.035, 0.100), (-0.006, 0.0, -0.250)),
        ),
        Link(f"{side}_ankle_link", 0.278, cylinder((0.028, 0.060), axis="y", colour=DARK)),
        Link(
            f"{side}_foot",
            1.475,
            box((0.070, 0.062, 0.050), (0.0, 0.0, -0.048), colour=GREY),
            box((*SOLE, plate), (SOLE_FORWARD, 0.0, 0.5 * plate - ANKLE_HEIGHT)),
        ),
    ]
    joints = serial_chain(
        side,
        "pelvis",
        ("hip_yaw", "hip_yaw_link", (0.0, HIP_OFFSET * s, 0.0), "z", (-45, 45), 8.76, 40),
        ("hip_roll", "hip_roll_link", (0, 0, 0), "x", (-25, 25), 5.45, 60),
        ("hip_pitch", "thigh", (0, 0, 0), "y", (-77, 24), 5.42, 60),
        ("knee_pitch", "shin", (0, 0, -THIGH), "y", (0.7, 124.7), 4.06, 115),
        ("ankle_pitch", "ankle_link", (0, 0, -SHIN), "y", (-56.7, 15.3), 4.63, 60),
        ("ankle_roll", "foot", (0, 0, 0), "x", (-34, 34), 9.75, 40),
    )
    return links, joints


def urdf() -> str:
    """Return the robot as URDF, without meshes."""
    parts = (trunk(), leg("left"), leg("right"), arm("left"), arm("right"))
    links = [link for part in parts for link in part[0]]
    joints = [joint for part in parts for joint in part[1]]
    return to_urdf("hrp4_class", links, joints, MASS)


@cache
def describe() -> RobotDescription:
    """Return the description of `hrp4_class`."""
    arms = {
        "left_shoulder_roll": math.radians(10.0),
        "right_shoulder_roll": math.radians(-10.0),
        **{f"{side}_shoulder_pitch": math.radians(4.0) for side in SIDES},
        **{f"{side}_elbow_pitch": math.radians(-30.0) for side in SIDES},
    }
    left, right = (
        SoleDescription(
            frame=f"{side}_sole",
            link=f"{side}_foot",
            translation=(SOLE_FORWARD, 0.0, -ANKLE_HEIGHT),
            name=name,
            length=SOLE[0],
            width=SOLE[1],
        )
        for side, name in zip(SIDES, SOLE_NAMES, strict=True)
    )
    return RobotDescription.from_urdf(
        urdf(),
        name="hrp4_class",
        left_sole=left,
        right_sole=right,
        half_sitting=arms,
        torso="chest",
        imu=FrameDescription("imu", "pelvis"),
        hands={"left_hand": "left_hand", "right_hand": "right_hand"},
        height=HEIGHT,
        provenance="wbc.robots.models.hrp4_class, fictional, "
        "from figures of HRP-4 (IROS 2011) and HRP-4C (BSD-3-Clause)",
        licence="BSD-2-Clause",
    )
