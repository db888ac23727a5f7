"""Mechanisms with closed chains, written by rule: a knee of four bars, and a biped with two rods at each ankle."""

from __future__ import annotations

KNEE = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.80665" timestep="0.0005"/>
<worldbody><body name="thigh" pos="0 0 1">{root}<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass="2"/>
<body name="crank" pos="0.05 0 -.1"><joint name="crank" axis="0 1 0" range="-1.4 1.4" actuatorfrcrange="-60 60"
 armature="0.01"/><geom type="capsule" fromto="0 0 0 .06 0 0" size=".01" mass=".2"/>
<body name="rod" pos=".06 0 0"><joint name="rod" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 -.02 0 -.2" size=".008" mass=".15"/></body></body>
<body name="shin" pos="0 0 -.3"><joint name="knee" axis="0 1 0" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".025" mass="1.5"/>
<geom type="sphere" pos="0.09 0 0" size=".01" mass=".1"/></body></body></worldbody>
<equality><connect name="four bars" body1="rod" body2="shin" anchor="-.02 0 -.2" {stiff}/></equality>
<actuator><motor joint="crank"/></actuator></mujoco>"""
"""A thigh, bolted or floating, whose crank bends the knee over a rod: the crank alone is driven."""

RODS = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.80665"/><worldbody><body name="left" pos="-.2 0 1">
<joint name="left" axis="0 1 0" range="-1 1" actuatorfrcrange="-9 9"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/>
<body name="bar" pos="0 0 .2"><joint name="bar" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".02"/>
<body name="right" pos=".4 0 0"><joint name="right" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/></body></body></body></worldbody>
<equality><{tie} name="foot" body1="{one}" body2="{two}" {at}/></equality>
<actuator><motor joint="left"/></actuator></mujoco>"""
"""A parallelogram that stands on the world with both ends; `tie` and the rest say how it is closed there."""

STIFF = 'solref="0.002 1" solimp="0.9999 0.9999 0.001"'
"""Options of an equality that hardly gives."""


def three_bars(x: float) -> str:
    """Return the URDF of three bars whose last one has a frame "end", for a "place" at x, m, on their stand."""
    inertia = '<mass value="1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
    links = "".join(
        f'<link name="{n}"><inertial>{inertia}</inertial></link>' for n in ("stand", "up", "bar", "down")
    )
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{above}"/><child link="{below}"/><origin xyz="{at}"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="3"/></joint>'
        for name, kind, above, below, at in (
            ("first", "revolute", "stand", "up", "0 0 0.2"),
            ("second", "revolute", "up", "bar", "0 0 0.2"),
            ("third", "revolute", "bar", "down", "0.3 0 0"),
            ("at_end", "fixed", "down", "end", "0 0 -0.2"),
            ("at_place", "fixed", "stand", "place", f"{x} 0 0.2"),
        )
    )
    return f'<robot name="bars">{links}<link name="end"/><link name="place"/>{joints}</robot>'


def four_bar_knee(root: str = "") -> str:
    """Return the MJCF of a knee of four bars, closed at its zero; `root` is the joint of the thigh."""
    return KNEE.format(root=root, stiff=STIFF)


def parallel_ankles(biped: str) -> str:
    """Return the MJCF of a biped whose ankle motors sit at the shins and move the feet over a rod on each side.

    `biped` is examples/biped.xml: pitch and roll of its ankles become passive. Each motor has a crank on the shin,
    whose end a rod joins with the foot: two hinges at the crank, a point at the foot.
    """
    xml, motors, ties = biped, "", ""
    for side in ("left", "right"):
        for joint in ("ankle_pitch", "ankle_roll"):
            xml = xml.replace(f'<motor joint="{side}_{joint}"/>', "")
        cranks = ""
        for name, y in (("inner", 0.03), ("outer", -0.03)):
            key = f"{side}_{name}"
            cranks += (
                f'<body name="{key}_crank" pos="0 {y} -0.1"><joint name="{key}_crank" axis="0 1 0" range="-1 1" '
                'armature="0.02" actuatorfrcrange="-60 60" damping="0" frictionloss="0"/>'
                '<geom type="sphere" size="0.01" mass="0.1" pos="-0.02 0 0" contype="0" conaffinity="0"/>'
                f'<body name="{key}_rod" pos="-0.05 0 0">'
                f'<joint name="{key}_rod_pitch" axis="0 1 0" armature="0" damping="0" frictionloss="0" range="-2 2"/>'
                f'<joint name="{key}_rod_roll" axis="1 0 0" armature="0" damping="0" frictionloss="0" range="-2 2"/>'
                '<geom type="capsule" size="0.006" fromto="0 0 0 0 0 -0.2" mass="0.1" contype="0" conaffinity="0"/>'
                "</body></body>"
            )
            motors += f'<motor joint="{key}_crank"/>'
            ties += f'<connect name="{key}" body1="{key}_rod" body2="{side}_foot" anchor="0 0 -0.2" {STIFF}/>'
        shin = f'<joint name="{side}_knee"'
        at = xml.index("/>", xml.index(shin)) + 2
        xml = xml[:at] + cranks + xml[at:]
    xml = xml.replace("</actuator>", f"{motors}</actuator>")
    return xml.replace("</mujoco>", f"<equality>{ties}</equality></mujoco>")
