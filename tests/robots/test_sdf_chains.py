"""Trees and chains of SDF files: joints that close chains, ball joints, limits, and motors."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from closed_chains import RODS
from mjcf_biped import MOTORS, biped

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.robots import RobotDescription

# ---- SDF ------------------------------------------------------------------------------------------------------------

BAR = """<link name="{name}"><pose>{x} 0 {z} 0.1 {turn} 0.2</pose><inertial><pose>0 0 0.05 0 0 0.3</pose>
<mass>{mass}</mass><inertia><ixx>0.02</ixx><iyy>0.01</iyy><izz>0.015</izz><ixy>0.001</ixy></inertia></inertial>
<collision name="{name}"><geometry>
<cylinder><radius>0.02</radius><length>0.1</length></cylinder></geometry></collision></link>"""
PIN = """<joint name="{name}" type="{kind}"><parent>{one}</parent><child>{two}</child><pose>{pose}</pose>
<axis><xyz>0 1 0</xyz>{frame}<limit><lower>-1</lower><upper>1</upper><effort>30</effort></limit>
<dynamics><damping>0.1</damping><spring_stiffness>7</spring_stiffness></dynamics></axis></joint>"""


def bars(
    *, joints: str = "", links: str = "", closing: str = "revolute", hang: tuple[str, str] = ("base", "rod")
) -> str:
    """Return the SDF of four bars, each turned otherwise, with axes along y of the model."""
    made = "".join(
        BAR.format(name=name, x=x, z=z, turn=0.3 * i, mass=1 + i)
        for i, (name, x, z) in enumerate(
            (("base", 0, 1), ("crank", 0.2, 1), ("coupler", 0.25, 0.8), ("rod", 0, 0.8))
        )
    )
    axis = "<use_parent_model_frame>1</use_parent_model_frame>"
    pins = "".join(
        PIN.format(name=name, kind=kind, one=one, two=two, pose="0 0 0 0 0 0", frame=axis)
        for name, kind, one, two in (
            ("drive", "revolute", "base", "crank"),
            ("knee", "revolute", "crank", "coupler"),
            ("hip", "revolute", *hang),
            ("pin", closing, "rod", "coupler"),
        )
    ).replace('name="pin" type="revolute"><parent>rod</parent><child>coupler</child><pose>0 0 0 0', PIN_AT)
    return f'<sdf version="1.6"><model name="bars">{made}{links}{pins}{joints}</model></sdf>'


MOUNT = '<joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>'
PIN_AT = 'name="pin" type="revolute"><parent>rod</parent><child>coupler</child><pose>0.05 0 0.1 0'


def test_an_sdf_is_read_as_the_tree_of_its_first_joints_and_the_others_close_chains(tmp_path: Path) -> None:
    """Joints lie and turn where the file says, whichever way round it names their links; by path, text and spec."""
    path = tmp_path / "bars.sdf"
    path.write_text(bars(), encoding="utf-8")
    spec = wbc.robots.read_sdf(path)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places = {"crank": [0.2, 0, 1], "coupler": [0.25, 0, 0.8], "rod": [0, 0, 0.8], "base": [0, 0, 1]}
    for link, place in places.items():
        np.testing.assert_allclose(data.body(link).xpos, place, atol=1e-9)
    for joint, link in (("drive", "crank"), ("knee", "coupler"), ("hip", "rod")):
        number = model.joint(joint).id
        np.testing.assert_allclose(data.xaxis[number], [0.0, 1.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(data.xanchor[number], places[link], atol=1e-9)
        assert model.jnt_stiffness[number] == 7.0 and tuple(model.jnt_actfrcrange[number]) == (-30.0, 30.0)
    assert abs(data.efc_pos[:3]).max() < 1e-9  # the chain closes where it is read
    wanted = data.body("coupler").xpos + data.body("coupler").xmat.reshape(3, 3) @ [0.05, 0.0, 0.1]
    ours = data.body("rod").xpos + data.body("rod").xmat.reshape(3, 3) @ model.eq_data[0][3:6]
    np.testing.assert_allclose(ours, wanted, atol=1e-9)
    swapped = wbc.robots.read_sdf(_written(tmp_path, bars(hang=("rod", "base"), joints=MOUNT))).compile()
    other = mujoco.MjData(swapped)
    mujoco.mj_forward(swapped, other)
    number = swapped.joint("hip").id  # the joint is at the base, and turns the rod the other way
    np.testing.assert_allclose(other.xaxis[number], [0.0, -1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(other.xanchor[number], places["base"], atol=1e-9)
    for source in (path, bars(), spec):
        description = RobotDescription.from_mjcf(source, feet=False)
        assert [closure.name for closure in description.closures] == ["pin"]
        assert description.robot().mass == pytest.approx(10.0)
    assert wbc.load_robot(_toml(tmp_path, path)).closures


def _written(folder: Path, text: str) -> Path:
    path = folder / "other.sdf"
    path.write_text(text, encoding="utf-8")
    return path


def _toml(folder: Path, path: Path) -> Path:
    """Return a description of a robot without feet in a file."""
    toml = folder / "bars.toml"
    toml.write_text(f'file = "{path.name}"\nfeet = false\n', encoding="utf-8")
    return toml


def test_a_ball_joint_of_an_sdf_is_three_hinges_and_a_joint_to_the_world_bolts_the_robot() -> None:
    ball = PIN.format(name="ball", kind="ball", one="rod", two="tip", pose="0 0 0 0 0 0", frame="")
    tip = BAR.format(name="tip", x=0, z=0.5, turn=0.1, mass=1)
    limits = dict.fromkeys(("ball_x", "ball_y", "ball_z"), 1.0)
    description = RobotDescription.from_mjcf(
        bars(links=tip, joints=ball + MOUNT), base="fixed", torque_limits=limits
    )
    assert set(limits) <= set(description.joint_names)
    assert not description.robot().floating


@pytest.mark.parametrize(
    ("low", "high", "found"),
    [
        ("-0.5", "1", (-0.5, 1.0)),
        ("-inf", "1", (-np.inf, 1.0)),
        ("-1e16", "1", (-np.inf, 1.0)),
        ("-1", "Infinity", (-1.0, np.inf)),
        ("-1e16", "inf", (-np.inf, np.inf)),
    ],
)
def test_limits_of_an_sdf_may_be_endless_on_either_side(
    low: str, high: str, found: tuple[float, float]
) -> None:
    limit = f"<limit><lower>{low}</lower><upper>{high}</upper><effort>5</effort></limit>"
    pin_of = PIN.format(name="neck", kind="revolute", one="base", two="tip", pose="0 0 0 0 0 0", frame="")
    pin_of = re.sub(r"<limit>.*?</limit>", "", pin_of, flags=re.DOTALL).replace("</axis>", f"{limit}</axis>")
    tip = BAR.format(name="tip", x=0, z=0.5, turn=0.1, mass=1)
    robot = RobotDescription.from_mjcf(bars(links=tip, joints=pin_of), feet=False).robot()
    i = robot.joint_index("neck")
    assert (robot.position_lower[i], robot.position_upper[i]) == found


BAD_SDFS = {  # text → words of the error
    "no model": ('<sdf version="1.6"/>', "one <model>"),
    "no name": (
        bars().replace('<joint name="knee"', "<joint"),
        "<joint> must have a name of its own, got none for",
    ),
    "a name twice": (
        bars().replace('"rod"', '"base"', 1),
        "<link> must have a name of its own, got 'base' twice",
    ),
    "no link": ('<sdf version="1.6"><model name="a"/></sdf>', "no link"),
    "no XML": ("<sdf><model>", "SDF string"),
    "other link": (bars(hang=("base", "nowhere")), "'hip' names link 'nowhere'"),
    "loose link": (bars(links=BAR.format(name="far", x=0, z=0, turn=0, mass=1)), "no joint ties link 'far'"),
    "screw": (bars(closing="screw"), "'pin' closes a chain and is of type 'screw'"),
    "pose of words": (bars().replace("0 0 0.05 0 0 0.3", "up"), "6 finite numbers, got 'up'"),
    "endless pose": (bars().replace("0 0 0.05 0 0 0.3", "0 0 inf 0 0 0"), "6 finite numbers"),
    "other frame": (
        bars().replace("<pose>0 0 0 0", '<pose relative_to="base">0 0 0 0'),
        "without relative_to",
    ),
}


@pytest.mark.parametrize("what", BAD_SDFS)
def test_an_sdf_that_cannot_be_read_is_refused_by_name(what: str) -> None:
    text, words = BAD_SDFS[what]
    with pytest.raises(ModelError, match=words):
        RobotDescription.from_mjcf(text, feet=False)


def test_what_is_no_sdf_is_no_sdf(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="is no SDF"):
        wbc.robots.read_sdf(_written(tmp_path, RODS))
    with pytest.raises(InputError, match=r"missing\.sdf"):
        wbc.robots.read_sdf(tmp_path / "missing.sdf")


@pytest.mark.parametrize(
    ("attributes", "limit"),
    [
        ('gear="2" ctrlrange="-40 40" ctrllimited="false"', None),
        ('gear="2" ctrlrange="-40 40"', 80.0),
        ('gear="2" ctrlrange="-40 40" forcerange="-30 30"', 60.0),
    ],
)
def test_the_torque_of_a_motor_is_bounded_by_what_its_file_limits(
    attributes: str, limit: float | None
) -> None:
    """A range of controls that limits nothing is no bound of a torque."""
    drives = MOTORS.replace('gear="2" ctrlrange="-40 40"', attributes)
    description = RobotDescription.from_mjcf(biped(drives=drives))
    found = description.torque_limit[description.joint_names.index("left_knee")]
    assert (found == pytest.approx(80.0 if limit is None else limit)) == (limit is not None)
