"""`hrp4_class`: a humanoid of the class of HRP-4, written here from published figures. It is fictional.

No such machine exists and no CAD data of HRP-4 is in it. Class and size are those published for HRP-4: 151 cm,
39 kg, 34 joints, 7 of them in each arm (Kaneko et al., "Humanoid Robot HRP-4", IROS 2011, abstract). Proportions,
masses, joint ranges and speeds come from the model of its sister HRP-4C (isri-aist/hrp4c_description, BSD-3-Clause,
URDF of 1.58 m and 42.77 kg), changed as follows.

- Legs: thigh, shin, hip spacing and ankle height of HRP-4C, but straight: the ankles stay ±87.5 mm apart as the
  hips are (HRP-4C's are ±68.5 mm). Axes yaw, roll, pitch, knee, ankle pitch, ankle roll.
- Upper body: HRP-4C's lengths times 0.912, so that the whole stands 1.51 m tall.
- Masses: HRP-4C's, times 39 / 42.77, grouped into the links that this robot has; inertias are those of the solid
  primitive shapes that are drawn.
- Waist: pitch and yaw; neck: yaw and pitch; arm: shoulder pitch, roll, yaw, elbow, wrist yaw, pitch, roll; hand:
  thumb and fingers. That makes 2 + 2 + 14 + 4 + 12 = 34.
- Soles: the flat rectangle of the walking experiments, 160 × 76 mm, 93 mm below the ankle, its centre 20 mm ahead
  of the ankle (HRP-4C's foot surface), laterally under it.

Speed limits are HRP-4C's. Its torque limits are a placeholder (100 Nm everywhere), so they are chosen here, before
any walk was simulated with this model:

- Legs: those of Talos (100, 160, 160, 300, 160, 100 Nm along the leg; 90.27 kg, centre of mass at 0.877 m), the one
  robot at hand with published torque limits and the same leg, scaled by the ratio of m g h, 0.39 for 39 kg and
  0.80 m, and rounded: 40, 60, 60, 115, 60, 40 Nm.
- Waist: 60 Nm, as the hip; the upper body bent forward by 90° needs about 2/3 of that.
- Arms: at least twice what holds the arm stretched out sideways: shoulder pitch and roll 20 Nm, shoulder yaw and
  elbow 10 Nm, wrist 4 Nm; hand and neck 2 and 6 Nm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from xml.etree import ElementTree

import numpy as np

from wbc.core.errors import Array
from wbc.robots.description import RobotDescription
from wbc.robots.frames import FrameDescription, SoleDescription

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
"""Scale of the upper body: what HRP-4's height leaves above the hips over what HRP-4C has there."""

Triple = tuple[float, float, float]

WHITE, GREY, DARK = "0.92 0.93 0.95 1", "0.55 0.58 0.62 1", "0.15 0.17 0.20 1"


@dataclass(frozen=True)
class LinkShape:
    """A solid of uniform density.

    Attributes:
        kind: "box", "cylinder" or "sphere".
        size: Edges x, y, z; radius and length; or radius; m.
        at: Centre in the link frame, m.
        axis: Axis of a cylinder, "x", "y" or "z".
        colour: Red, green, blue, alpha.
    """

    kind: str
    size: tuple[float, ...]
    at: Triple = (0.0, 0.0, 0.0)
    axis: str = "z"
    colour: str = WHITE

    @property
    def volume(self) -> float:
        """Volume, m³."""
        if self.kind == "box":
            return math.prod(self.size)
        if self.kind == "cylinder":
            return math.pi * self.size[0] ** 2 * self.size[1]
        return 4.0 / 3.0 * math.pi * self.size[0] ** 3

    @property
    def variances(self) -> Array:
        """Second moments about the centre per unit of mass, along x, y, z of the link, shape (3,), m²."""
        if self.kind == "box":
            return np.array(self.size) ** 2 / 12.0
        if self.kind == "cylinder":
            along = ["x", "y", "z"].index(self.axis)
            values = np.full(3, self.size[0] ** 2 / 4.0)
            values[along] = self.size[1] ** 2 / 12.0
            return values
        return np.full(3, self.size[0] ** 2 / 5.0)


@dataclass(frozen=True)
class Link:
    """A link: its share of the mass (kg of HRP-4C) spread evenly over its shapes."""

    name: str
    mass: float
    shapes: tuple[LinkShape, ...]


@dataclass(frozen=True)
class Joint:
    """A revolute joint between links.

    Attributes:
        name: Name.
        parent: Parent link.
        child: Child link.
        at: Origin in the parent frame, m.
        axis: "x", "y" or "z".
        range: Least and greatest position, degrees.
        velocity: Largest speed, rad/s.
        torque: Largest torque, Nm.
    """

    name: str
    parent: str
    child: str
    at: Triple
    axis: str
    range: tuple[float, float]
    velocity: float
    torque: float


def trunk() -> tuple[list[Link], list[Joint]]:
    """Pelvis, waist, chest, neck and head."""
    u = UPPER
    crown = (1.58 - 0.784 - 0.197 - 0.434) * u  # top of the head above the neck joints
    links = [
        Link(
            "pelvis",
            7.649,
            (
                LinkShape("box", (0.130, 0.200, 0.080), (-0.010, 0.0, 0.062)),
                LinkShape("box", (0.110, 0.150, 0.050), (-0.008, 0.0, 0.127), colour=GREY),
            ),
        ),
        Link("waist_link", 1.777, (LinkShape("cylinder", (0.052, 0.130), axis="y", colour=DARK),)),
        Link(
            "chest",
            7.067,
            (
                LinkShape("box", (0.120, 0.170, 0.100), (-0.018, 0.0, 0.090), colour=GREY),
                LinkShape("box", (0.165, 0.210, 0.130), (-0.025, 0.0, 0.200)),
                LinkShape("box", (0.120, 0.150, 0.035), (-0.036, 0.0, 0.2825)),
                LinkShape("cylinder", (0.033, 0.090), (-0.036, 0.0, 0.345), colour=DARK),
            ),
        ),
        Link("neck_link", 0.339, (LinkShape("sphere", (0.030,), colour=DARK),)),
        Link(
            "head",
            3.257,
            (
                LinkShape("sphere", (0.068,), (0.004, 0.0, crown - 0.068)),
                LinkShape("cylinder", (0.058, 0.080), (0.004, 0.0, 0.050), colour=WHITE),
                LinkShape("box", (0.030, 0.100, 0.034), (0.062, 0.0, 0.085), colour=DARK),
            ),
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
    """One arm with its hand; the right one is the mirror image of the left."""
    u, s = UPPER, 1.0 if side == "left" else -1.0
    upper, fore = 0.283 * u, 0.222 * u

    def turn(low: float, high: float) -> tuple[float, float]:
        """Range of a roll or yaw joint, mirrored."""
        return (low, high) if s > 0 else (-high, -low)

    links = [
        Link(
            f"{side}_shoulder_pitch_link",
            0.412,
            (LinkShape("cylinder", (0.042, 0.050), axis="y", colour=DARK),),
        ),
        Link(f"{side}_shoulder_roll_link", 0.576, (LinkShape("sphere", (0.046,), (0.0, 0.010 * s, 0.0)),)),
        Link(
            f"{side}_upper_arm",
            1.218,
            (
                LinkShape("cylinder", (0.034, 0.170), (0.0, 0.010 * s, -0.120)),
                LinkShape("cylinder", (0.032, 0.060), (0.0, 0.005 * s, -upper), axis="y", colour=DARK),
            ),
        ),
        Link(
            f"{side}_elbow_link",
            0.338,
            (LinkShape("cylinder", (0.029, 0.060), (0.0, 0.0, -0.045), colour=GREY),),
        ),
        Link(f"{side}_forearm", 0.218, (LinkShape("cylinder", (0.029, 0.100), (0.0, 0.0, -0.125)),)),
        Link(f"{side}_wrist_link", 0.060, (LinkShape("sphere", (0.023,), colour=DARK),)),
        Link(
            f"{side}_hand", 0.260, (LinkShape("box", (0.060, 0.026, 0.070), (0.0, 0.0, -0.055), colour=GREY),)
        ),
        Link(
            f"{side}_thumb",
            0.050,
            (LinkShape("box", (0.018, 0.018, 0.050), (0.0, 0.0, -0.025), colour=DARK),),
        ),
        Link(
            f"{side}_fingers",
            0.090,
            (LinkShape("box", (0.058, 0.018, 0.065), (0.0, 0.0, -0.0325), colour=DARK),),
        ),
    ]
    chain: list[tuple[str, str, Triple, str, tuple[float, float], float, float]] = [
        (
            "shoulder_pitch",
            "shoulder_pitch_link",
            (-0.040 * u, 0.160 * u * s, 0.285 * u),
            "y",
            (-147, 60),
            2.91,
            20,
        ),
        ("shoulder_roll", "shoulder_roll_link", (0, 0, 0), "x", turn(-10, 89), 2.51, 20),
        ("shoulder_yaw", "upper_arm", (0, 0, 0), "z", (-92, 92), 5.05, 10),
        ("elbow_pitch", "elbow_link", (0, 0, -upper), "y", (-123, 2), 2.09, 10),
        ("wrist_yaw", "forearm", (0, 0, 0), "z", (-92, 92), 3.80, 4),
        ("wrist_pitch", "wrist_link", (0, 0, -fore), "y", (-84, 84), 3.80, 4),
        ("wrist_roll", "hand", (0, 0, 0), "x", (-84, 84), 3.80, 4),
    ]
    joints, parent = [], "chest"
    for name, child, at, axis, span, velocity, torque in chain:
        joints.append(Joint(f"{side}_{name}", parent, f"{side}_{child}", at, axis, span, velocity, torque))
        parent = f"{side}_{child}"
    hand = f"{side}_hand"
    joints += [
        Joint(f"{side}_thumb_joint", hand, f"{side}_thumb", (0.036, 0.0, -0.040), "y", (-90, 0), 14.6, 2),
        Joint(f"{side}_fingers_joint", hand, f"{side}_fingers", (0, 0, -0.092), "x", turn(-90, 20), 16.0, 2),
    ]
    return links, joints


def leg(side: str) -> tuple[list[Link], list[Joint]]:
    """One leg; the right one is the mirror image of the left."""
    s = 1.0 if side == "left" else -1.0
    plate = 0.020
    links = [
        Link(
            f"{side}_hip_yaw_link",
            1.173,
            (LinkShape("cylinder", (0.046, 0.070), (0.0, 0.0, 0.050), colour=DARK),),
        ),
        Link(f"{side}_hip_roll_link", 0.604, (LinkShape("sphere", (0.048,), colour=GREY),)),
        Link(
            f"{side}_thigh",
            2.363,
            (
                LinkShape("cylinder", (0.054, 0.160), (0.002, 0.0, -0.125)),
                LinkShape("cylinder", (0.046, 0.110), (0.002, 0.0, -0.255)),
            ),
        ),
        Link(
            f"{side}_shin",
            2.215,
            (
                LinkShape("cylinder", (0.045, 0.090), axis="y", colour=DARK),
                LinkShape("cylinder", (0.043, 0.150), (-0.006, 0.0, -0.125)),
                LinkShape("cylinder", (0.035, 0.100), (-0.006, 0.0, -0.250)),
            ),
        ),
        Link(f"{side}_ankle_link", 0.278, (LinkShape("cylinder", (0.028, 0.060), axis="y", colour=DARK),)),
        Link(
            f"{side}_foot",
            1.475,
            (
                LinkShape("box", (0.070, 0.062, 0.050), (0.0, 0.0, -0.048), colour=GREY),
                LinkShape("box", (*SOLE, plate), (SOLE_FORWARD, 0.0, 0.5 * plate - ANKLE_HEIGHT)),
            ),
        ),
    ]
    chain: list[tuple[str, str, Triple, str, tuple[float, float], float, float]] = [
        ("hip_yaw", "hip_yaw_link", (0.0, HIP_OFFSET * s, 0.0), "z", (-45, 45), 8.76, 40),
        ("hip_roll", "hip_roll_link", (0, 0, 0), "x", (-25, 25), 5.45, 60),
        ("hip_pitch", "thigh", (0, 0, 0), "y", (-77, 24), 5.42, 60),
        ("knee_pitch", "shin", (0, 0, -THIGH), "y", (0.7, 124.7), 4.06, 115),
        ("ankle_pitch", "ankle_link", (0, 0, -SHIN), "y", (-56.7, 15.3), 4.63, 60),
        ("ankle_roll", "foot", (0, 0, 0), "x", (-34, 34), 9.75, 40),
    ]
    joints, parent = [], "pelvis"
    for name, child, at, axis, span, velocity, torque in chain:
        joints.append(Joint(f"{side}_{name}", parent, f"{side}_{child}", at, axis, span, velocity, torque))
        parent = f"{side}_{child}"
    return links, joints


def urdf() -> str:
    """Write the robot as URDF.

    Returns:
        URDF string, without meshes.
    """
    links: list[Link] = []
    joints: list[Joint] = []
    for part in (trunk(), leg("left"), leg("right"), arm("left"), arm("right")):
        links += part[0]
        joints += part[1]
    scale = MASS / sum(link.mass for link in links)
    root = ElementTree.Element("robot", name="hrp4_class")
    for link in links:
        _add_link(root, link, scale)
    for joint in joints:
        element = ElementTree.SubElement(root, "joint", name=joint.name, type="revolute")
        ElementTree.SubElement(element, "parent", link=joint.parent)
        ElementTree.SubElement(element, "child", link=joint.child)
        ElementTree.SubElement(element, "origin", xyz=_text(joint.at), rpy="0 0 0")
        ElementTree.SubElement(element, "axis", xyz=_text([float(axis == joint.axis) for axis in "xyz"]))
        low, high = np.radians(joint.range)
        ElementTree.SubElement(
            element,
            "limit",
            lower=f"{low:.6g}",
            upper=f"{high:.6g}",
            velocity=f"{joint.velocity:g}",
            effort=f"{joint.torque:g}",
        )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_link(root: ElementTree.Element, link: Link, scale: float) -> None:
    """Add a link with the mass, centre of mass and inertia of its shapes taken together."""
    mass = link.mass * scale
    volumes = np.array([shape.volume for shape in link.shapes])
    masses = mass * volumes / volumes.sum()
    centres = np.array([shape.at for shape in link.shapes])
    com = masses @ centres / mass
    arms = centres - com
    moments = np.diag(masses @ np.array([shape.variances for shape in link.shapes]))
    moments += np.einsum("k,ki,kj->ij", masses, arms, arms)
    inertia = np.trace(moments) * np.eye(3) - moments

    element = ElementTree.SubElement(root, "link", name=link.name)
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=f"{mass:.9g}")
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": f"{inertia[i, j]:.9g}" for i in range(3) for j in range(i, 3)}
    ElementTree.SubElement(inertial, "inertia", entries)
    turned = {"x": "0 1.5707963267948966 0", "y": "1.5707963267948966 0 0", "z": "0 0 0"}
    for tag in ("visual", "collision"):
        for shape in link.shapes:
            outer = ElementTree.SubElement(element, tag)
            ElementTree.SubElement(outer, "origin", xyz=_text(shape.at), rpy=turned[shape.axis])
            geometry = ElementTree.SubElement(outer, "geometry")
            if shape.kind == "box":
                ElementTree.SubElement(geometry, "box", size=_text(shape.size))
            elif shape.kind == "cylinder":
                radius, length = shape.size
                ElementTree.SubElement(geometry, "cylinder", radius=f"{radius:g}", length=f"{length:g}")
            else:
                ElementTree.SubElement(geometry, "sphere", radius=f"{shape.size[0]:g}")
            if tag == "visual":
                # Viewers share materials by name: one name for each colour.
                colour_name = {WHITE: "white", GREY: "grey", DARK: "dark"}[shape.colour]
                material = ElementTree.SubElement(outer, "material", name=colour_name)
                ElementTree.SubElement(material, "color", rgba=shape.colour)


def _text(values: Array | list[float] | tuple[float, ...]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)


@cache
def describe() -> RobotDescription:
    """Description of `hrp4_class`."""
    arms = {
        "left_shoulder_roll": math.radians(10.0),
        "right_shoulder_roll": math.radians(-10.0),
        **{f"{side}_shoulder_pitch": math.radians(4.0) for side in ("left", "right")},
        **{f"{side}_elbow_pitch": math.radians(-30.0) for side in ("left", "right")},
    }
    left, right = (
        SoleDescription(
            frame=f"{side}_sole",
            link=f"{side}_foot",
            translation=(SOLE_FORWARD, 0.0, -ANKLE_HEIGHT),
            name=f"{side}_foot",
            length=SOLE[0],
            width=SOLE[1],
        )
        for side in ("left", "right")
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
