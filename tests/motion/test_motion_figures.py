"""Figures of motions by closed forms: scale, floor and feet of a person, jumps, rates, paces, and measures as data."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from made_person import make_person
from scipy.spatial.transform import Rotation

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY, Robot
from wbc.motion import MotionClip, SkeletonClip, retarget
from wbc.motion.feasible import _drawn_in
from wbc.motion.footsteps import footsteps
from wbc.motion.kinematics import BodyMotion, arm_joints
from wbc.motion.measures import measure
from wbc.motion.retarget import (
    FASTEST,
    JUMP,
    _Legs,
    _on_floor,
    _refuse_jumps,
    _soles,
)

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("hrp4_class").robot()


# --- retargeting -----------------------------------------------------------------------------------------------------


def test_legs_of_a_robot_are_those_of_its_description(robot: Robot) -> None:
    """Hips where the axes meet, thigh and shank from joint to joint, the ankle over the sole, hips over the CoM."""
    legs, model, data = _Legs.of(robot), robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.half_sitting)
    com = pin.centerOfMass(model, data, robot.half_sitting)
    chain = robot.joints_between(robot.soles[0].frame, robot.base_frame)
    origins = [data.oMi[robot.joint_numbers[joint]].translation for joint in chain]
    base = data.oMf[robot.frame_id(robot.base_frame)]
    hip, knee, ankle = origins[2], origins[3], origins[4]
    assert legs.length == pytest.approx(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee), abs=1e-6)
    own = base.actInv(hip)
    np.testing.assert_allclose(legs.hips, [own[0], 0.0, own[2]], atol=1e-6)
    sole = data.oMf[robot.frame_id(robot.soles[0].frame)]
    assert legs.ankle_height == pytest.approx(ankle[2] - sole.translation[2], abs=1e-6)
    assert legs.hips_over_com == pytest.approx(hip[2] - com[2], abs=1e-6)


def person(rest: float = 0.3, unit: float = 10.0, count: int = 60) -> dict[str, np.ndarray]:
    """Return a person who stands still in another unit, ankles 0.9 over a floor at `rest`, of legs of 4 and 5."""
    parts = {}
    for side, y in (("left", 1.0), ("right", -1.0)):
        for name, place in (
            ("hip", (0.0, y, 9.9)),
            ("knee", (0.0, y, 5.9)),
            ("ankle", (0.0, y, 0.9)),
            ("toe", (1.5, y, 0.2)),
            ("shoulder", (0.0, 2.0 * y, 15.0)),
        ):
            parts[f"{side}_{name}"] = np.tile(np.array(place) + [0.0, 0.0, rest], (count, 1)) * unit / 10.0
    return parts


@pytest.mark.parametrize("unit", [10.0, 393.7])
@pytest.mark.parametrize("rest", [0.3, -2.0])
def test_a_person_is_scaled_by_the_legs_and_put_on_the_floor(robot: Robot, rest: float, unit: float) -> None:
    """Straight legs of 9 become 0.96 of the robot's; ankles at rest are as high as the robot's, whatever the toes."""
    legs, given = _Legs.of(robot), person(rest, unit)
    given["right_ankle"][40:, 2] += 0.2 * unit  # the right foot is lifted by a fiftieth of ten
    given["right_toe"][40:, 2] += 0.1 * unit
    parts, scale, lift, standing = _on_floor(legs, given, 50.0)
    assert scale == pytest.approx(0.96 * legs.length / (9.0 * unit / 10.0))
    assert parts["left_ankle"][:, 2] == pytest.approx(legs.ankle_height)
    assert parts["right_ankle"][50, 2] == pytest.approx(legs.ankle_height + 0.2 * unit * scale)
    assert parts["hips"][5] == pytest.approx([0.0, 0.0, legs.ankle_height + 0.96 * legs.length])
    assert parts["chest"][5, 2] - parts["hips"][5, 2] == pytest.approx(5.1 * unit / 10.0 * scale)
    assert lift.shape == (60, 2, 2) and np.abs(lift[:40]).max() < 1e-9 and np.abs(lift[:, 0]).max() < 1e-9
    assert lift[50, 1] == pytest.approx([0.2 * unit * scale, 0.1 * unit * scale])
    assert standing[:, 0].all() and standing[:38, 1].all() and not standing[42:, 1].any()
    bare = {name: places for name, places in given.items() if "toe" not in name}
    assert _on_floor(legs, bare, 50.0)[2].shape == (60, 2, 1)


@pytest.mark.parametrize("facing", [0.0, 1.3, -2.5])
def test_soles_stand_under_the_ankles_turned_as_the_feet_point(robot: Robot, facing: float) -> None:
    """A foot turned out by 0.2 rad with its heel up: its sole tips over its toes, its lowest part in its height."""
    turn, count = pin.utils.rotate("z", facing), 3
    ankle, out, size = np.array([0.3, 0.1, 0.2]), 0.2, 0.15
    parts = {}
    for side, y in (("left", 0.1), ("right", -0.1)):
        parts[f"{side}_hip"] = np.tile(turn @ [0.0, y, 1.0], (count, 1))
        parts[f"{side}_ankle"] = np.tile(turn @ (ankle * [1.0, np.sign(y), 1.0]), (count, 1))
        level = size * np.array([math.cos(out * np.sign(y)), math.sin(out * np.sign(y)), 0.0])
        parts[f"{side}_toe"] = parts[f"{side}_ankle"] + np.tile(turn @ level, (count, 1))
    lift = np.zeros((count, 2, 2))
    lift[1, 0] = 0.06, 0.02  # the left heel is up
    lift[2, 0] = 0.01, 0.04  # its toes are
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    soles = _soles(robot, parts, lift)
    for side, name in enumerate(SIDES):
        frame = robot.frame_id(robot.soles[side].frame)
        own, joint = data.oMf[frame], data.oMi[robot.model.frames[frame].parentJoint]
        offset = own.rotation.T @ (own.translation - joint.translation)
        for i in range(count):
            yaw = facing + out * (1.0 if side == 0 else -1.0)
            pitch = math.asin((lift[i, side, 0] - lift[i, side, 1]) / size)
            rotation = pin.utils.rotate("z", yaw) @ pin.utils.rotate("y", pitch)
            np.testing.assert_allclose(soles[i][side].rotation, rotation, atol=1e-9)
            place = parts[f"{name}_ankle"][i] + rotation @ offset
            np.testing.assert_allclose(soles[i][side].translation[:2], place[:2], atol=1e-9)
            assert soles[i][side].translation[2] == pytest.approx(lift[i, side].min())
    flat = _soles(
        robot, parts, lift[:, :, :1]
    )  # toes that are not known: the foot points where the person faces
    np.testing.assert_allclose(flat[1][0].rotation, turn, atol=1e-9)
    assert flat[1][0].translation[2] == pytest.approx(0.06)


def test_a_foot_on_end_does_not_say_where_it_points(robot: Robot) -> None:
    """Its way counts in proportion from 0.3 of its length on the level to 0.6."""
    for share, seen in ((0.0, 0.0), (0.3, 0.0), (0.45, 0.5), (0.6, 1.0), (1.0, 1.0)):
        parts = {}
        for side, y in (("left", 0.1), ("right", -0.1)):
            parts[f"{side}_hip"] = np.array([[0.0, y, 1.0]])
            parts[f"{side}_ankle"] = np.array([[0.0, y, 0.1]])
            way = 0.2 * np.array([0.0, share, -math.sqrt(1.0 - share**2)])  # to the left
            parts[f"{side}_toe"] = parts[f"{side}_ankle"] + way
        soles = _soles(robot, parts, np.zeros((1, 2, 2)))
        yaw = math.atan2(soles[0][0].rotation[1, 0], soles[0][0].rotation[0, 0])
        assert yaw == pytest.approx(seen * 0.5 * math.pi), share


def test_a_jump_beyond_twelve_legs_a_second_is_told_by_its_frame() -> None:
    rate = 25.0
    for speed, good in ((0.99 * JUMP, True), (1.01 * JUMP, False)):
        parts = person(count=20)
        for places in parts.values():
            places[8:, 0] += speed * 9.0 / rate  # of legs of 9
        names = tuple(parts)
        positions = np.stack([parts[name] for name in names], axis=1)
        clip = SkeletonClip(names, rate, positions)
        if good:
            _refuse_jumps(clip, parts)
            continue
        with pytest.raises(InputError, match=r"0\.48 times .* frame 7 .*part\(0\.32\)"):
            _refuse_jumps(clip, parts)


def test_a_person_is_upright_whose_way_from_ankles_to_shoulders_is_steeper_than_thirty_degrees() -> None:
    """Wherever the person is: half of that way is vertical at a tilt of 60°."""
    given = make_person(noise=0.0).part(0.0, 0.1)
    for away in (np.zeros(3), np.array([500.0, -70.0, 33.0])):
        for tilt, good in ((0.0, True), (58.0, True), (62.0, False), (90.0, False), (180.0, False)):
            turned = Rotation.from_euler("x", tilt, degrees=True).apply(given.positions.reshape(-1, 3).copy())
            clip = replace(given, positions=turned.reshape(given.positions.shape) + away)
            if good:
                assert len(clip.limbs()) > 10
                continue
            with pytest.raises(InputError, match="upright"):
                clip.limbs()


def test_a_clip_that_squats_or_flies_has_the_reach_of_what_its_legs_span(robot: Robot) -> None:
    """Of heights of the CoM on one foot that no leg reaches the nearest counts; none is refused."""
    soles = [
        tuple(pin.SE3(np.eye(3), np.array([x, y, 0.0])) for x, y in ((0.0, 0.1), (3.0 * (i > 40), -0.1)))
        for i in range(80)
    ]
    standing = np.ones((80, 2), dtype=bool)
    standing[30:50, 1] = False
    height = float(robot.com[2])
    lengths = []
    for share in (0.1, 0.6, 1.0, 3.0):
        made, *_ = footsteps(robot, soles, np.full(80, share * height), 50.0, standing)  # type: ignore[arg-type]
        lengths.append(float(made[70][0].actInv(made[70][1]).translation[0]))
    assert np.isfinite(lengths).all() and lengths == sorted(lengths, reverse=True)
    assert lengths[0] > lengths[2] > lengths[3] >= 0.0


@pytest.mark.parametrize("pitch", [0.0, 0.4, -0.3])
def test_a_foot_that_is_tipped_in_the_air_clears_the_ground_with_its_lowest_corner(
    robot: Robot, pitch: float
) -> None:
    """In the middle of a step 10 mm over the ground, at the height at which it is given where that is more."""
    sole = robot.soles[1]
    for given in (0.0, 0.2):
        tip = pin.utils.rotate("y", pitch)
        left = pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.0]))
        right = pin.SE3(np.eye(3), np.array([0.0, -0.1, 0.0]))
        soles = [
            (
                left,
                pin.SE3(
                    tip if 30 <= i < 70 else np.eye(3), right.translation + [0, 0, given * (30 <= i < 70)]
                ),
            )
            for i in range(100)
        ]
        standing = np.ones((100, 2), dtype=bool)
        standing[30:70, 1] = False
        height = np.full(100, float(robot.com[2]))
        made, *_ = footsteps(robot, soles, height, 50.0, standing)
        foot = made[50][1]
        drop = 0.5 * sole.length * abs(math.sin(pitch))
        assert foot.translation[2] == pytest.approx(max(given, drop + 0.01), abs=1e-6)
        np.testing.assert_allclose(foot.rotation, tip, atol=1e-9)


def test_a_swing_is_moved_from_where_it_was_lifted_to_where_it_may_land(robot: Robot) -> None:
    """A landing that is brought back by 0.3 m or so: on the way its share 3r² − 2r³, where the foot is in the air."""
    rise = np.clip((np.arange(120) - 30) / 60.0, 0.0, 1.0)
    left = pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.0]))
    soles = [
        (left, pin.SE3(np.eye(3), np.array([0.9 * r, -0.1, 0.15 * math.sin(math.pi * r)]))) for r in rise
    ]
    standing = np.ones((120, 2), dtype=bool)
    standing[31:90, 1] = False
    made, body, shortened = footsteps(robot, soles, np.full(120, float(robot.com[2])), 100.0, standing)
    back = 0.9 - float(made[110][1].translation[0])
    assert shortened == pytest.approx(back) and back > 0.1
    for i in (50, 60, 70):
        r = (i - 30) / 60.0
        share = 3.0 * r**2 - 2.0 * r**3
        assert made[i][1].translation[0] == pytest.approx(0.9 * r - share * back, abs=1e-9)
        assert body[i].translation[0] == pytest.approx(-0.5 * share * back, abs=1e-9)


@pytest.mark.parametrize("end", ["first", "last"])
def test_a_foot_that_is_in_the_air_at_an_end_of_the_clip_clears_the_ground_there(
    robot: Robot, end: str
) -> None:
    """Given on the ground it is lifted by 10 mm in every frame but those next to its contact."""
    left, right = (pin.SE3(np.eye(3), np.array([0.0, y, 0.0])) for y in (0.1, -0.1))
    standing = np.ones((60, 2), dtype=bool)
    air = slice(0, 30) if end == "first" else slice(30, 60)
    standing[air, 1] = False
    made, *_ = footsteps(robot, [(left, right)] * 60, np.full(60, float(robot.com[2])), 50.0, standing)
    heights = np.array([pair[1].translation[2] for pair in made])
    far = heights[:20] if end == "first" else heights[-20:]
    np.testing.assert_allclose(far, 0.01, atol=1e-9)
    assert heights[~standing[:, 1]].min() >= 0.0 and not heights[standing[:, 1]].any()


def test_a_part_of_a_clip_ends_with_its_last_frame_at_the_latest() -> None:
    given = make_person(rate=50.0, noise=0.0).part(0.0, 1.0)
    assert len(given) == 51 and given.duration == pytest.approx(1.0)
    assert len(given.part(0.2, 0.5)) == 16 and len(given.part(0.98)) == 2
    np.testing.assert_array_equal(given.part(0.2, 0.5).positions, given.positions[10:26])
    for begin, end in ((0.0, 1.02), (0.0, 1.04), (1.0, None), (0.5, 0.5), (-0.02, 0.5)):
        with pytest.raises(InputError, match="begin and end"):
            given.part(begin, end)


def test_a_frame_needs_too_much_friction_from_a_twentieth_beyond_on(robot: Robot) -> None:
    """A CoM that accelerates by 0.3 m/s² over one sole needs 0.3 over gravity."""
    t = np.arange(80) / 100.0
    still = BodyMotion.of(robot, np.tile(robot.half_sitting, (80, 1)), 100.0)
    left = np.tile((True, False), (80, 1))
    above = still.com + (still.centres[0, 0] - still.com[0]) * (1.0, 1.0, 0.0)
    motion = replace(still, com=above + np.outer(0.5 * 0.3 * (t - 0.4) ** 2, (1.0, 0.0, 0.0)))
    needed = 0.3 / GRAVITY
    for friction, good in ((1.03 * needed / 1.05, True), (0.97 * needed / 1.05, False)):
        found = measure(robot, motion, left, share=1.0, friction=friction)
        assert found.infeasible_frames[30:50].any() != good
    assert measure(robot, motion, left, share=1.0, friction=9.0).friction >= 0.98 * needed


@pytest.mark.parametrize(("rate", "found"), [(60.1, 30.05), (200.0, 50.0)])
def test_of_a_fast_clip_as_many_frames_are_left_out_as_bring_it_to_sixty(
    robot: Robot, rate: float, found: float
) -> None:
    given = make_person(rate=rate, noise=0.0).part(0.0, 0.1)
    result = retarget(given, robot)
    assert FASTEST == 60.0 and result.clip.rate == pytest.approx(found)
    step = round(rate / found)
    assert len(result.clip) == math.ceil(len(given) / step)
    few = replace(given, positions=given.positions[: 2 * step])
    if step > 1:
        retarget(few, robot)
        with pytest.raises(InputError, match=f"must have {2 * step} frames"):
            retarget(replace(given, positions=given.positions[: 2 * step - 1]), robot)


# --- the filter ------------------------------------------------------------------------------------------------------


def test_arms_are_drawn_in_by_one_ratio_until_their_drives_hold_them(robot: Robot) -> None:
    """All joints of an arm come nearer to half-sitting alike; the other arm stays."""
    q = np.tile(robot.half_sitting, (60, 1))
    moved = {"left_shoulder_pitch": -1.2, "left_elbow_pitch": 0.4}
    for name, by in moved.items():
        q[:, 7 + robot.joint_index(name)] += by
    share = 0.1
    found = _drawn_in(robot, MotionClip.of(robot, q, 100.0), share, unfinished := set())
    ratios = [
        (found.joints[30, robot.joint_index(name)] - robot.half_sitting[7 + robot.joint_index(name)]) / by
        for name, by in moved.items()
    ]
    assert ratios[0] == pytest.approx(ratios[1]) and 0.1 < ratios[0] < 0.9 and not unfinished
    arm = [i for i, name in enumerate(robot.joint_names) if name.startswith("left_") and "hip" not in name]
    others = np.setdiff1d(np.arange(robot.na), arm)
    np.testing.assert_array_equal(found.joints[:, others], q[:, 7 + others])
    gravity = pin.computeGeneralizedGravity(
        robot.model, robot.model.createData(), found.configurations(robot)[30]
    )
    used = np.abs(gravity[6:]) / robot.torque_limit
    assert used[robot.joint_index("left_shoulder_pitch")] == pytest.approx(share, rel=0.02)
    light = _drawn_in(robot, MotionClip.of(robot, q, 100.0), 1.0, set())
    np.testing.assert_array_equal(light.joints, q[:, 7:])
    _drawn_in(robot, MotionClip.of(robot, q, 100.0), 1e-4, unfinished)  # half-sitting itself is too much
    assert unfinished == {"arms"}


def test_a_frame_that_is_no_hand_makes_no_arm(robot: Robot) -> None:
    """A role on a toe leaves the leg as the clip has it, however small the share of torques is."""
    toed = replace(load_robot("hrp4_class"), hands={"left_toe": robot.soles[0].frame}).robot()
    q = np.tile(toed.half_sitting, (20, 1))
    q[:, 7 + toed.joint_index("left_knee_pitch")] += 0.3
    kept = _drawn_in(toed, MotionClip.of(toed, q, 100.0), 1e-3, set())
    np.testing.assert_array_equal(kept.joints, q[:, 7:])
    assert set(arm_joints(robot)) == {"left", "right"} and not arm_joints(toed)


def test_springs_that_carry_an_arm_leave_it_where_it_is() -> None:
    """Of a spring that takes what gravity asks for nothing is left for the drive; one against it is drawn in more."""
    plain = load_robot("hrp4_class")
    robot, name = plain.robot(), "left_shoulder_pitch"
    joint = robot.joint_index(name)
    q = np.tile(robot.half_sitting, (40, 1))
    q[:, 7 + joint] -= 1.2
    gravity = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q[0])[6 + joint]
    kept = {}
    for sign in (1.0, 0.0, -1.0):
        springs = {} if sign == 0.0 else {name: (20.0, float(q[0, 7 + joint] + sign * gravity / 20.0))}
        sprung = replace(plain, springs=springs).robot()
        made = _drawn_in(sprung, MotionClip.of(sprung, q, 100.0), 0.2, set())
        kept[sign] = float(made.joints[20, joint] - robot.half_sitting[7 + joint]) / -1.2
    assert kept[1.0] == pytest.approx(1.0, abs=1e-6) and kept[1.0] > kept[0.0] > kept[-1.0]


# --- measures --------------------------------------------------------------------------------------------------------


def test_accelerations_are_second_differences_at_rest_before_and_after(robot: Robot) -> None:
    """Of a parabola the curvature, at both ends as if it had stood there before."""
    t = np.arange(40) / 50.0
    still = BodyMotion.of(robot, np.tile(robot.half_sitting, (40, 1)), 50.0)
    com = still.com + np.outer(0.5 * t**2, (1.0, -2.0, 0.5))
    motion = replace(still, com=com, momentum=np.outer(t, (0.3, -0.1, 0.2)))
    np.testing.assert_allclose(motion.acceleration()[1:-1], np.tile((1.0, -2.0, 0.5), (38, 1)), atol=1e-8)
    first, last = (com[1] - com[0]) * 2500.0, (com[-2] - com[-1]) * 2500.0
    np.testing.assert_allclose(motion.acceleration()[[0, -1]], [first, last], atol=1e-9)
    np.testing.assert_allclose(motion.turning(), np.tile((0.3, -0.1, 0.2), (40, 1)), atol=1e-9)
