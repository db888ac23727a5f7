"""Feet and tree of an MJCF: what touches the ground, which side is flat, and what belongs to the robot."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mjcf_biped import MOTORS, biped
from mjcf_robot import plain

from wbc.base.errors import InputError, ModelError
from wbc.core.model import Coupling
from wbc.robots import RobotDescription
from wbc.robots.readers.feet_mjcf import _flat_side, _touch_ground
from wbc.robots.readers.tree_mjcf import find_tree

UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("extra", ["", "exclude", "pair"])
def test_geoms_that_touch_the_ground_are_those_with_contacts_in_mujoco(extra: str) -> None:
    """Balls of all masks that stick in two floors: one that touches everything, and one of masks of its own."""
    masks = list(itertools.product(range(4), repeat=2))
    ball = (
        '<body name="b{0}" pos="{0} 0 0"><freejoint/>'
        '<geom name="g{0}" size=".1" contype="{1}" conaffinity="{2}"/></body>'
    )
    balls = "".join(ball.format(i, *each) for i, each in enumerate(masks))
    contact = {
        "": "",
        "exclude": '<contact><exclude body1="b5" body2="world"/><exclude body1="world" body2="b7"/>'
        '<exclude body1="b9" body2="b10"/></contact>',
        "pair": '<contact><pair geom1="g0" geom2="own"/><pair geom1="usual" geom2="g8"/><pair geom1="g0" geom2="g8"/>'
        "</contact>",
    }[extra]
    floors = '<geom name="usual" type="plane" size="0 0 1"/><geom name="own" type="plane" size="0 0 1" contype="2"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{floors.replace('2', '2', 1)}{balls}</worldbody>{contact}</mujoco>"
    )
    model.geom_conaffinity[1] = 0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    touching = {int(g) for pair in data.contact.geom for g in pair if model.geom_bodyid[pair].min() == 0}
    found = _touch_ground(model)
    own = [i for i in range(model.ngeom) if model.geom_bodyid[i]]
    assert [bool(found[i]) for i in own] == [i in touching for i in own]
    assert 8 < len(touching & {*own}) == {"": 14, "exclude": 12, "pair": 16}[extra]


def hexagon(height: float, radius: float = 0.1) -> np.ndarray:
    angles = np.arange(6) * np.pi / 3.0
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(6, height)], axis=1)


@pytest.mark.parametrize("tilt", [0.0, 20.0, -50.0])
def test_the_flat_side_of_a_foot_is_the_largest_that_looks_down(tilt: float) -> None:
    """Of a frustum with a bottom of 0.1 m and a top of 0.05 m; its normal points up, whatever the foot's place."""
    turn = pin.rpy.rpyToMatrix(np.radians(tilt), 0.0, 0.3)
    for shift in (0.0, 3.0):
        points = np.concatenate([hexagon(0.0), hexagon(0.06, 0.05)]) @ turn.T + shift
        normal = _flat_side(points, UP)
        assert normal is not None
        np.testing.assert_allclose(normal, turn[:, 2], atol=1e-3)


def test_points_that_span_no_side_have_none_and_flat_ones_their_own() -> None:
    turn = pin.rpy.rpyToMatrix(0.3, 0.2, 0.0)
    line = np.array([[x, 0.0, 0.0] for x in (0.0, 0.1, 0.2, 0.3)])
    for points in (line[:2], line, np.zeros((5, 3))):
        assert _flat_side(points, UP) is None
    for points in (hexagon(0.0)[:3], hexagon(0.0)[:4], hexagon(0.0)):
        for turned in (points @ turn.T + 0.5, (points @ turn.T)[::-1] + 0.5):
            normal = _flat_side(turned, UP)
            assert normal is not None
            np.testing.assert_allclose(normal, turn[:, 2], atol=1e-6)
    steep = pin.rpy.rpyToMatrix(np.radians(61.0), 0.0, 0.0)
    assert _flat_side(hexagon(0.0) @ steep.T, UP) is None
    assert _flat_side(hexagon(0.0)[:3] @ steep.T, UP) is None


def test_of_two_equal_sides_the_one_that_looks_straight_down_is_flat() -> None:
    """A wedge with two sides of the same size, one level and one that rises by 40° from the edge between them."""
    rise = np.radians(40.0)
    edge = np.array([[0.0, y, 0.0] for y in (-0.05, 0.05)])
    points = np.concatenate(
        [
            edge,
            edge + [-0.2, 0.0, 0.0],
            edge + [0.2 * np.cos(rise), 0.0, 0.2 * np.sin(rise)],
            edge + [-0.2, 0.0, 0.3],
        ]
    )
    longer = points.copy()
    longer[4:6] = edge + np.array([0.6 * np.cos(rise), 0.0, 0.6 * np.sin(rise)])
    longer[6:8] = edge + [-0.2, 0.0, 0.9]
    for mirror in ([1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]):
        np.testing.assert_allclose(_flat_side(points * mirror, UP), UP, atol=1e-3)
        steep = np.multiply([-np.sin(rise), 0.0, np.cos(rise)], mirror)
        np.testing.assert_allclose(_flat_side(longer * mirror, UP), steep, atol=1e-3)


TOE = """<geom class="foot" type="box" size="0.05 0.05 0.02" pos="-0.02 0 -0.05"/><body name="{0}_toe"
pos="0.06 0 {1}"><joint name="{0}_toe" axis="0 1 0" range="-20 60"/><inertial pos="0.03 0 0" mass="0.1"
diaginertia="1e-4 1e-4 1e-4"/><geom class="foot" type="box" size="0.04 0.05 0.02" pos="0.04 0 0"/></body>"""


@pytest.mark.parametrize("higher", [0.0, 0.004, -0.004])
def test_toes_within_five_millimetres_of_the_plane_of_a_foot_are_a_part_of_it(higher: float) -> None:
    motors = MOTORS + "".join(f'<motor joint="{side}_toe" ctrlrange="-1 1"/>' for side in ("left", "right"))
    xml = biped("<site/>", drives=motors)
    for side in ("left", "right"):
        cell = f'<site name="{side}_load_cell" pos="0 0 -0.03"/>'
        xml = xml.replace(cell, cell + TOE.format(side, -0.05 + higher))
    for sole in RobotDescription.from_mjcf(xml).soles:
        assert sole.length == pytest.approx(0.21, abs=1e-3) and sole.link == sole.name


def test_a_foot_that_is_named_leaves_the_other_to_be_found() -> None:
    own = plain()
    for given in ({"left_sole": "left_foot"}, {"right_sole": "right_foot"}):
        assert RobotDescription.from_mjcf(biped(), **given).soles == own.soles  # type: ignore[arg-type]
    derived = plain().derived
    assert "foot: body 'left_foot', the end of one of the two lowest limbs" in derived
    assert "left_foot: 210 x 100 mm, from 2 capsules of body 'left_foot'" not in derived
    assert "left_foot: 190 x 80 mm, from 2 capsules of body 'left_foot'" in derived
    box = '<geom class="foot" type="box" size="0.105 0.05 0.02" pos="0.035 0 -0.05"/>'
    mixed = RobotDescription.from_mjcf(
        biped(box + box.replace("-0.05", "-0.049") + '<geom class="foot" size=".02"/>')
    )
    assert "left_foot: 210 x 100 mm, from 2 boxes and a sphere of body 'left_foot'" in mixed.derived


def test_a_robot_that_looks_backward_is_not_turned_against_the_side_that_a_foot_is_named_for() -> None:
    """Its right foot lies to the left of its root: named as the left one, toes behind it say nothing."""
    xml = biped()
    start, end = xml.index('<body name="left_hip"'), xml.rindex("</body>", 0, xml.index("</worldbody>"))
    backward = f'{xml[:start]}<frame euler="0 0 180">{xml[start:end]}</frame>{xml[end:]}'
    for named, turned in (
        ({}, True),
        ({"left_sole": "right_foot"}, False),
        ({"right_sole": "left_foot"}, False),
    ):
        derived = RobotDescription.from_mjcf(backward, **named).derived  # type: ignore[arg-type]
        assert any("new root link" in line for line in derived) == turned


def test_a_size_that_is_given_needs_a_site_or_a_geom_that_says_where_the_sole_is() -> None:
    site = '<site name="{0}_sole" pos="0.03 0 -0.07"/>'
    xml = biped("")
    for side in ("left", "right"):
        cell = f'<site name="{side}_load_cell" pos="0 0 -0.03"/>'
        xml = xml.replace(cell, cell + site.format(side))
    named = {"left_sole": "left_sole", "right_sole": "right_sole"}
    own = RobotDescription.from_mjcf(xml, sole_size=(0.2, 0.1), **named)  # type: ignore[arg-type]
    for sole in own.soles:
        assert (sole.length, sole.width) == (0.2, 0.1)
        np.testing.assert_allclose(own.ankle(sole.name), [-0.03, 0.0, 0.07], atol=1e-9)
    for options in (named, {"sole_size": (0.2, 0.1)}):
        with pytest.raises(ModelError, match="has no geom that says where its sole is"):
            RobotDescription.from_mjcf(xml, **options)  # type: ignore[arg-type]


# The tree

ARM = '<body name="{0}"{1}>{2}<geom size=".1"/>{3}</body>'
HINGE = '<joint axis="0 1 0"/>'


def world(*bodies: str, extra: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{''.join(bodies)}</worldbody>{extra}</mujoco>")


def limb(count: int, name: str = "limb") -> str:
    """Return bodies that turn, one on the other."""
    made = ""
    for i in reversed(range(count)):
        made = ARM.format(f"{name}{i}", ' pos=".3 0 0"', HINGE, made)
    return made


def test_a_robot_is_the_body_that_floats_with_joints_below_it_or_the_one_with_most_joints() -> None:
    ball = ARM.format("ball", "", "<freejoint/>", "")
    robot = ARM.format("robot", "", "<freejoint/>", limb(2))
    bench, shelf = ARM.format("bench", "", "", limb(1, "k")), ARM.format("shelf", "", "", limb(3, "s"))
    model = world(ball, shelf, robot)
    tree = find_tree(model, None, {})
    assert model.body(tree.root).name == "robot" and [*tree.joints] == ["limb0_joint", "limb1_joint"]
    assert [model.body(b).name for b in tree.bodies] == ["robot", "limb0", "limb1"]
    assert [note.split("'")[1] for note in tree.left_out()] == ["ball", "shelf"]
    for bodies in ((bench, shelf), (shelf, bench), (shelf, bench, robot)):
        assert world(*bodies).body(find_tree(world(*bodies), None, {}, True).root).name == "shelf"
    assert world(robot).body(find_tree(world(robot), None, {}, True).root).name == "robot"
    for bodies, said in (
        ((ball,), "holds no robot"),
        ((bench, shelf), "root='shelf' replaces"),
        (
            (robot, robot.replace("robot", "twin").replace("limb", "arm")),
            "holds 2 robots, at bodies 'robot', 'twin'",
        ),
    ):
        with pytest.raises(ModelError, match=said):
            find_tree(world(*bodies), None, {})
    with pytest.raises(InputError, match="'limb1' must be a body of the world, it hangs on 'robot'"):
        find_tree(model, "limb1", {})
    with pytest.raises(ModelError, match="at body 'ball' has no joint that moves"):
        find_tree(model, "ball", {})


def test_joints_and_bodies_without_names_have_those_of_their_places() -> None:
    two = '<joint axis="0 1 0"/><joint axis="1 0 0"/><joint name="own" axis="0 0 1"/>'
    model = world(ARM.format("robot", "", "<freejoint/>", f"<body>{two}<geom size='.1'/></body>"))
    assert [*find_tree(model, None, {}).joints] == ["body_2_joint", "body_2_joint1", "own"]
    bolted = world(ARM.format("robot", "", HINGE, limb(1)))
    assert [*find_tree(bolted, None, {}, True).joints] == ["robot_joint", "limb0_joint"]
    assert [*find_tree(bolted, "robot", {}).joints] == ["limb0_joint"], (
        "a root that floats has no other joints"
    )


def test_bodies_are_carried_by_what_moves_them() -> None:
    fixed = ARM.format("tip", "", "", ARM.format("end", "", "", ""))
    model = world(ARM.format("robot", "", "<freejoint/>", ARM.format("arm", "", HINGE, fixed) + limb(1)))
    for lock, carriers in (
        ({}, {"robot": "robot", "arm": "arm", "tip": "arm", "end": "arm", "limb0": "limb0"}),
        (
            {"arm_joint": 0.2},
            {"robot": "robot", "arm": "robot", "tip": "robot", "end": "robot", "limb0": "limb0"},
        ),
    ):
        tree = find_tree(model, None, lock)
        assert {model.body(b).name: model.body(c).name for b, c in tree.carrier.items()} == carriers


@pytest.mark.parametrize(
    ("drive", "moves"), [("", False), ("gear='0'", False), ("group='3'", False), ("gear='2'", True)]
)
def test_a_ball_joint_is_fixed_unless_something_drives_it(drive: str, moves: bool) -> None:
    ball = ARM.format("tail", "", '<joint name="ball" type="ball"/>', "")
    motor = f'<motor joint="ball" {drive}/>' if drive else ""
    extra = f'<option actuatorgroupdisable="3"/><actuator><motor joint="limb0_joint"/>{motor}</actuator>'
    hinge = limb(1).replace("<joint ", '<joint name="limb0_joint" ')
    model = world(ARM.format("robot", "", "<freejoint/>", ball + hinge), extra=extra)
    if moves:
        with pytest.raises(ModelError, match="'ball' is a ball joint"):
            find_tree(model, None, {})
    else:
        tree = find_tree(model, None, {})
        assert tree.ball_joints() == ["ball"] and [*tree.joints] == ["limb0_joint"]


def coupled(ties: str, driven: str, lock: dict[str, float] | None = None) -> object:
    """Return the tree of four joints at references of their own with some equalities."""
    joints = "".join(
        ARM.format(f"l{n}", "", f'<joint name="{n}" axis="0 1 0" ref="{0.1 * i}"/>', "")
        for i, n in enumerate("abcd")
    )
    drives = "".join(f'<motor joint="{name}"/>' for name in driven)
    extra = f"<compiler angle='radian'/><actuator>{drives}</actuator><equality>{ties}</equality>"
    return find_tree(world(ARM.format("robot", "", "<freejoint/>", joints), extra=extra), None, lock or {})


def tie(one: str, two: str, poly: str = "0.5 2 0 0 0", more: str = "") -> str:
    return f'<joint joint1="{one}" joint2="{two}" polycoef="{poly}" {more}/>'


def test_couplings_hold_between_positions_of_mujoco_whichever_joint_leads() -> None:
    """B − 0.1 = 0.5 + 2 (a − 0) by the file, so that b = 2 a + 0.6, and a = 0.5 b − 0.3."""
    for driven, expected in (
        ("acd", {"b": Coupling("a", 2.0, pytest.approx(0.6))}),
        ("bcd", {"a": Coupling("b", 0.5, pytest.approx(-0.3))}),
        ("abcd", {}),
        ("cd", {}),
    ):
        assert coupled(tie("b", "a"), driven).coupled == expected  # type: ignore[attr-defined]
    for odd in (
        tie("b", "a", "0.5 0 0 0 0"),
        tie("b", "a", "0 1 1 0 0"),
        tie("b", "a", "0 1 0 0 1"),
        tie("b", "a", more='active="false"'),
        '<joint joint1="b"/>',
        '<connect body1="lb" body2="la" anchor="0 0 0"/>',
    ):
        assert not coupled(odd, "acd").coupled  # type: ignore[attr-defined]
    still = coupled(tie("b", "a"), "acd", {"a": 0.4}).locked  # type: ignore[attr-defined]
    assert sorted(still.values()) == pytest.approx([0.4, 1.4])


def test_a_chain_of_couplings_leads_back_to_the_drive() -> None:
    """C − 0.2 = 0.1 + 3 (b − 0.1) and b = 2 a + 0.6, so that c = 6 a + 1.8."""
    for ties in (tie("b", "a") + tie("c", "b", "0.1 3 0 0 0"), tie("c", "b", "0.1 3 0 0 0") + tie("b", "a")):
        found = coupled(ties, "ad").coupled  # type: ignore[attr-defined]
        assert found == {
            "b": Coupling("a", 2.0, pytest.approx(0.6)),
            "c": Coupling("a", 6.0, pytest.approx(1.8)),
        }


@pytest.mark.parametrize(
    ("leader", "follower"), [("two", "one"), ("deep", "two"), ("deep", "one"), ("one", "two")]
)
def test_a_joint_is_led_by_none_that_hangs_on_it(leader: str, follower: str) -> None:
    """Joints of one body hang on the ones before them."""
    joints = '<joint name="one" axis="0 1 0"/><joint name="two" axis="1 0 0"/>'
    deep = ARM.format("far", "", '<joint name="deep" axis="0 1 0"/>', "")
    body = ARM.format("near", "", joints, ARM.format("between", "", "", deep))
    extra = f'<actuator><motor joint="{leader}"/></actuator><equality>{tie(follower, leader)}</equality>'
    tree = find_tree(world(ARM.format("robot", "", "<freejoint/>", body), extra=extra), None, {})
    assert bool(tree.coupled) == (leader == "one")
    assert bool(tree.ties) == (leader == "one")
