"""Half-sitting: where its joints, its soles and its centre of mass are, which posture stands, and which is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from closed_chains import three_bars
from mjcf_biped import biped as mjcf_biped
from scipy.optimize import brentq
from urdf_biped import ANKLE, FEET, FOOT_BOX, SHIN, THIGH, biped, described

from wbc.base.errors import InputError, ModelError
from wbc.core.model import Closure
from wbc.robots import RobotDescription, urdf
from wbc.robots.derivation import posture
from wbc.robots.derivation.legs import heading, knee_bend, knee_direction
from wbc.robots.write_urdf import write

HIP = 'xyz="0 {} 0"/><axis xyz="0 0 1"/>'
CENTRED = FOOT_BOX.replace('xyz="0.03 0', 'xyz="0 0')


def hips(y: float = 0.1, z: float = 0.0, knee: str = "") -> str:
    """Return the biped with hips elsewhere under its root, and other knees: attributes of axis and limits."""
    xml = biped()
    for sign in (1, -1):
        old = HIP.format(0.1 * sign)
        assert old in xml
        xml = xml.replace(old, f'xyz="0 {y * sign} {z}"/><axis xyz="0 0 1"/>')
    old = f'xyz="0 0 {-THIGH}"/><axis xyz="0 1 0"/><limit lower="0" upper="2.5"'
    assert old in xml
    return xml.replace(old, f'xyz="0 0 {-THIGH}"/>{knee}') if knee else xml


def apart(description: RobotDescription) -> np.ndarray:
    """Return the way from the right to the left sole in half-sitting, m."""
    robot = description.robot()
    left, right = (robot.placement(sole.frame).translation for sole in robot.soles)
    return np.asarray(left - right)


@pytest.mark.parametrize(
    ("knee", "bend"),
    [
        ("", 40.0),
        ('<axis xyz="0 -1 0"/><limit lower="-2.5" upper="0"', -40.0),
        ('<axis xyz="0 1 0"/><limit lower="-2.5" upper="0"', -40.0),
        ('<axis xyz="0 1 0"/><limit lower="-2.5" upper="0.6"', -40.0),
        ('<axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5"', 40.0),
        ('<axis xyz="0 -1 0"/><limit lower="-2.5" upper="2.5"', -40.0),
    ],
)
def test_knees_bend_forward_by_40_degrees_and_backward_where_they_cannot(knee: str, bend: float) -> None:
    """The knee is the pitch joint in the middle of the leg, also where the root is far above the hips."""
    description = RobotDescription.from_urdf(hips(z=-0.5 if knee else 0.0, knee=knee), **FEET)
    for side in "lr":
        assert math.degrees(description.half_sitting[f"{side}_knee"]) == pytest.approx(bend, abs=1e-4)
    assert apart(description) == pytest.approx([0.0, 0.2, 0.0], abs=1e-6)


@pytest.mark.parametrize(("hip", "width"), [(0.1, 0.2), (0.06, 0.12), (0.03, 0.09 + 0.02)])
def test_soles_are_as_far_apart_as_at_zero_with_two_centimetres_between_them_at_least(
    hip: float, width: float
) -> None:
    assert apart(RobotDescription.from_urdf(hips(hip), **FEET)) == pytest.approx([0.0, width, 0.0], abs=1e-6)


def test_feet_of_legs_that_are_spread_at_zero_come_under_the_hips() -> None:
    """Legs that lean out by 20° at zero; ankles that roll by 12° cannot hold feet flat that far out."""
    xml = mjcf_biped().replace('axis="1 0 0" range="-30 30"', 'axis="1 0 0" range="-12 12"')
    for side, sign in (("left", 1), ("right", -1)):
        xml = xml.replace(
            f'<body name="{side}_hip" pos', f'<body name="{side}_hip" euler="{20 * sign} 0 0" pos'
        )
    assert apart(RobotDescription.from_mjcf(xml)) == pytest.approx([0.0, 0.2, 0.0], abs=1e-6)


def test_joints_that_are_given_stay_and_the_others_put_the_soles_flat_under_the_centre_of_mass() -> None:
    given = {"l_knee": 0.9, "r_knee": 0.9, "l_elbow": -0.7}
    description = RobotDescription.from_urdf(biped(), half_sitting=given, **FEET)
    robot = description.robot()
    assert {name: description.half_sitting[name] for name in given} == given
    assert robot.com[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    for side in "lr":
        pitches = [
            description.half_sitting[f"{side}_{joint}"] for joint in ("hip_pitch", "knee", "ankle_pitch")
        ]
        assert sum(pitches) == pytest.approx(0.0, abs=1e-6)


def test_a_joint_that_cannot_be_at_zero_is_a_twentieth_of_its_range_inside_the_nearer_limit() -> None:
    limits = {"l_elbow": (0.4, 1.4), "r_elbow": (-2.0, -0.5), "l_roll": (-1.0, 0.01)}
    description = RobotDescription.from_urdf(biped(), position_limits=limits, **FEET)
    found = [description.half_sitting[name] for name in limits]
    assert found == pytest.approx([0.4 + 0.05 * 1.0, -0.5 - 0.05 * 1.5, 0.01 - 0.05 * 1.01])
    (legs,) = (line for line in description.derived if "of the legs solved for" in line)
    told = dict(each.split() for each in legs.partition("(deg): ")[2].split(", "))
    assert "-0.0" not in told.values() and len(told) == 12
    for name, degrees in told.items():
        assert float(degrees) == pytest.approx(math.degrees(description.half_sitting[name]), abs=0.0051)
    assert any("half-sitting of 6 other joints" in line for line in description.derived)


@pytest.mark.parametrize(("pitch", "flat"), [(0.0045, True), (0.0055, False), (-0.0055, False)])
def test_a_sole_may_be_tilted_by_five_thousandths(pitch: float, flat: bool) -> None:
    """Half-sitting with one ankle turned further; 0.005 rad is 0.29°."""
    own = described()
    given = own.half_sitting | {"l_ankle_pitch": own.half_sitting["l_ankle_pitch"] + pitch}
    if flat:
        replace(own, half_sitting=given)
    else:
        with pytest.raises(InputError, match=r"tilts sole .* by 0\.32° .* at most 0\.29°"):
            replace(own, half_sitting=given)


@pytest.mark.parametrize("side", "lr")
@pytest.mark.parametrize("height", [0.0008, 0.0012])
def test_one_sole_may_lie_a_millimetre_above_the_other(side: str, height: float) -> None:
    """A leg of thigh a and shin b with its knee bent by k reaches √(a² + b² + 2 a b cos k)."""
    own = described()

    def leg(knee: float) -> tuple[float, float]:
        reach = math.sqrt(THIGH**2 + SHIN**2 + 2.0 * THIGH * SHIN * math.cos(knee))
        return reach, math.asin(SHIN * math.sin(knee) / reach)  # and the angle at the hip

    straight = {f"{s}_{joint}": 0.0 for s in "lr" for joint in ("hip_yaw", "hip_roll", "ankle_roll")}
    given = dict(own.half_sitting) | straight
    for each in "lr":
        knee = math.radians(40.0)
        wanted = leg(knee)[0] - (height if each == side else 0.0)
        knee = math.acos((wanted**2 - THIGH**2 - SHIN**2) / (2.0 * THIGH * SHIN))
        hip = leg(knee)[1]
        given |= {f"{each}_hip_pitch": -hip, f"{each}_knee": knee, f"{each}_ankle_pitch": hip - knee}
    if height < 1e-3:
        replace(own, half_sitting=given)
    else:
        with pytest.raises(InputError, match=r"one sole 1\.2 mm above the other; at most 1 mm"):
            replace(own, half_sitting=given)


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)])
def test_a_posture_stands_with_its_centre_of_mass_above_the_rectangle_around_the_soles(
    axis: int, sign: float
) -> None:
    """Soles of 0.2 x 0.09 m, 0.2 m apart: 0.1 m from the middle to the front, 0.145 m to the side."""
    own, model = described(), described().pinocchio_model()
    data, frames = model.createData(), tuple(sole.frame for sole in own.soles)
    joints = ("hip_pitch", "ankle_pitch") if axis == 0 else ("hip_roll", "ankle_roll")

    def posture_of(angle: float) -> dict[str, float]:
        given = dict(own.half_sitting)
        for side in "lr":
            for joint, turn in zip(joints, (angle, -angle), strict=True):
                given[f"{side}_{joint}"] += turn
        return given

    def offset(angle: float) -> float:
        q = posture.standing_configuration(model, frames, posture_of(angle))
        return float(pin.centerOfMass(model, data, q)[axis])

    turning = sign * math.copysign(1.0, offset(0.1) - offset(0.0))
    for part in (0.97, 1.03):
        edge = sign * part * (0.1 if axis == 0 else 0.145)
        given = posture_of(turning * brentq(lambda lean, edge=edge: offset(turning * lean) - edge, 0.0, 0.45))
        if part < 1.0:
            replace(own, half_sitting=given)
        else:
            with pytest.raises(InputError, match="outside the soles"):
                replace(own, half_sitting=given)


@pytest.mark.parametrize("given", [math.radians(angle) for angle in (-60.0, 0.0, 20.0, 65.0, 100.0)])
def test_the_bend_of_a_knee_is_the_angle_between_thigh_and_shin(given: float) -> None:
    """Of a leg that is straight at zero it is that of its joint, whatever the other joints do."""
    description = RobotDescription.from_urdf(hips(z=-0.4), **FEET)
    model, robot = description.pinocchio_model(), description.robot()
    q, rng = pin.neutral(model), np.random.default_rng(4)
    q[7:] = rng.uniform(-1.0, 1.0, len(q) - 7)
    for side in "lr":
        q[7 + robot.joint_index(f"{side}_knee")] = given
    for sole in description.soles:
        assert knee_bend(model, sole.frame, q) == pytest.approx(abs(given), abs=1e-7)


@pytest.mark.parametrize(("bend", "taken"), [(24.0, False), (26.0, True), (69.0, True), (71.0, False)])
def test_a_keyframe_is_half_sitting_with_knees_between_25_and_70_degrees(bend: float, taken: bool) -> None:
    description = described()
    model, half = description.pinocchio_model(), math.radians(0.5 * bend)
    values = dict(description.half_sitting)
    hip = math.atan2(SHIN * math.sin(2 * half), THIGH + SHIN * math.cos(2 * half))
    for side in "lr":
        values |= {f"{side}_hip_pitch": -hip, f"{side}_knee": 2 * half, f"{side}_ankle_pitch": hip - 2 * half}
    assert posture.stands(model, description.soles, values) == taken
    if taken:
        for name in ("l_knee", "l_elbow"):  # beyond a limit
            limit = description.position_limits[1][description.joint_names.index(name)]
            assert not posture.stands(model, description.soles, values | {name: limit + 1e-3})


@pytest.mark.parametrize(
    ("knee", "z"), [("", 0.0), ('<axis xyz="0 -1 0"/><limit lower="-2.5" upper="0"', -0.5)]
)
def test_where_toes_say_nothing_a_robot_looks_to_where_its_knees_go(knee: str, z: float) -> None:
    """A turn by 1 rad takes a knee forward by the length of the shin and what is below it, whose end stays."""
    xml = hips(z=z, knee=knee).replace(FOOT_BOX, CENTRED)
    description = RobotDescription.from_urdf(xml, **FEET)
    model, soles = description.pinocchio_model(), description.soles
    for sole in soles:
        assert knee_direction(model, sole.frame) == pytest.approx([SHIN + ANKLE, 0.0, 0.0], abs=1e-9)
    assert heading(model, soles, False) == 0.0
    for turn in (math.pi, -0.5 * math.pi):
        turned = write(urdf.read(xml).mechanism(False, turn), "turned", {}, shapes=True)
        found = RobotDescription.from_urdf(turned, **FEET)
        assert any("new root link" in line for line in found.derived)
        assert dict(found.half_sitting) == pytest.approx(dict(description.half_sitting), abs=1e-6)


def test_a_knee_without_stops_does_not_say_where_a_robot_looks() -> None:
    description = RobotDescription.from_urdf(hips().replace(FOOT_BOX, CENTRED), **FEET)
    model, soles = description.pinocchio_model(), description.soles
    for name in ("l_knee", "r_knee"):
        place = model.joints[model.getJointId(name)].idx_q
        for ends in (model.lowerPositionLimit, model.upperPositionLimit):
            ends[place] = math.copysign(math.inf, ends[place] - 1.0)
    for sole in soles:
        assert not knee_direction(model, sole.frame).any()
    assert heading(model, soles, False) == 0.0


def test_a_chain_that_does_not_close_is_refused_with_the_least_gap_that_its_joints_leave() -> None:
    """Of three bars of 0.2, 0.3 and 0.2 m that turn by ±1 rad, in steps of 0.04 rad."""
    first, second, third = np.meshgrid(*[np.linspace(-1.0, 1.0, 51)] * 3)
    x = 0.2 * np.sin(first) + 0.3 * np.cos(first + second) - 0.2 * np.sin(first + second + third)
    z = 0.2 * np.cos(first) - 0.3 * np.sin(first + second) - 0.2 * np.cos(first + second + third)
    least = float(np.hypot(x - 0.9, z).min())
    tie = Closure("tie", "end", "place", False)
    with pytest.raises(ModelError, match="'end' and 'place' stay") as error:
        RobotDescription.from_urdf(three_bars(0.9), base="fixed", closures=[tie])
    gap = float(str(error.value).split("stay ")[1].split(" mm")[0])
    assert 1e3 * least - 5.0 < gap <= 1e3 * least + 0.1


def test_a_leg_that_cannot_stand_is_refused_with_its_greatest_range() -> None:
    limits = {"l_ankle_pitch": (0.5, 0.8), "r_hip_yaw": (-30.0, 60.0)}
    with pytest.raises(ModelError, match="no half-sitting within the joint limits .* turn by 90 rad at most"):
        RobotDescription.from_urdf(biped(), position_limits=limits, **FEET)
