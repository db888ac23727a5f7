"""A biped in URDF with nothing in it but links, inertias, joints and the boxes of its feet."""

from __future__ import annotations

from functools import cache

from wbc.robots import RobotDescription

THIGH, SHIN, ANKLE = 0.30, 0.28, 0.06
LIMITS = 'lower="{low}" upper="{high}" effort="80" velocity="8"'


FOOT_BOX = (
    '<collision><origin xyz="0.03 0 -0.05"/><geometry><box size="0.20 0.09 0.02"/></geometry></collision>'
)


def biped(
    *,
    geometry: str = FOOT_BOX,
    limits: str = LIMITS,
    kind: str = "revolute",
    root: str = "trunk",
    before: str = "",
    after: str = "",
    shin: str = '<mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/>',
) -> str:
    """Return a small biped of 12 leg joints and two arms of 3; nothing in it but links, inertias and joints."""
    joints, links = [], []

    def link(name: str, inertial: str, shape: str = "") -> None:
        links.append(f'<link name="{name}"><inertial>{inertial}</inertial>{shape}</link>')

    def joint(name: str, parent: str, child: str, xyz: str, axis: str, low: float, high: float) -> None:
        span = f"<limit {limits.format(low=low, high=high)}/>" if limits else ""
        joints.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{span}</joint>'
        )

    small = '<mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
    link(
        root,
        '<origin xyz="0.01 0 0.2"/><mass value="15"/><inertia ixx=".3" iyy=".3" izz=".2" ixy="0" ixz="0" iyz="0"/>',
    )
    for side, s in (("l", 1), ("r", -1)):
        chain = [
            ("hip_yaw", f"0 {0.1 * s} 0", "0 0 1", -1, 1, small),
            ("hip_roll", "0 0 0", "1 0 0", -0.6, 0.6, small),
            ("hip_pitch", "0 0 0", "0 1 0", -2, 1, f'<origin xyz="0 0 {-THIGH / 2}"/>{shin}'),
            ("knee", f"0 0 {-THIGH}", "0 1 0", 0, 2.5, f'<origin xyz="0 0 {-SHIN / 2}"/>{shin}'),
            ("ankle_pitch", f"0 0 {-SHIN}", "0 1 0", -1.2, 0.8, small),
            ("ankle_roll", "0 0 0", "1 0 0", -0.5, 0.5, small),
        ]
        parent = root
        for name, xyz, axis, low, high, inertial in chain:
            child = f"{side}_{name}_link"
            link(child, inertial, geometry if name == "ankle_roll" else "")
            joint(f"{side}_{name}", parent, child, xyz, axis, low, high)
            parent = child
        parent = root
        for name, xyz, axis in (
            ("shoulder", f"0 {0.2 * s} 0.4", "0 1 0"),
            ("roll", "0 0 0", "1 0 0"),
            ("elbow", "0 0 -0.2", "0 1 0"),
        ):
            child = f"{side}_{name}_link"
            link(child, f'<origin xyz="0 0 -0.1"/>{small}')
            joint(f"{side}_{name}", parent, child, xyz, axis, -1.5, 1.5)
            parent = child
    return f'<robot name="biped">{before}{"".join(links)}{"".join(joints)}{after}</robot>'  # fmt: skip


FEET = {"left_sole": "l_ankle_roll_link", "right_sole": "r_ankle_roll_link"}


@cache
def described() -> RobotDescription:
    """Return the description of the robot that most cases change."""
    return RobotDescription.from_urdf(biped(), **FEET)
