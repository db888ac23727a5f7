"""Contacts of soles that move by rule, footsteps made of them, and the clips, measures and areas that go with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.motion import MotionClip, check_motion, make_feasible
from wbc.motion.contacts import always_standing, find_contacts, runs, touching
from wbc.motion.footsteps import footsteps
from wbc.motion.inverse_kinematics import inverse_kinematics
from wbc.motion.kinematics import BodyMotion, Soles, corners_of, zmp_of
from wbc.motion.measures import measure, nearest_inside, supports_of
from wbc.walking.plans.reach import Reach

RATE = 100.0
"""Frames per second, Hz."""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("hrp4_class").robot()


# Contacts


def test_runs_are_the_runs() -> None:
    rng = np.random.default_rng(0)
    for flags in (*(rng.random((50, 30)) < 0.6), np.ones(5, dtype=bool), np.zeros(5, dtype=bool)):
        again = np.zeros_like(flags)
        found = runs(flags)
        for first, last in found:
            assert flags[first:last].all() and first < last
            again[first:last] = True
        assert (again == flags).all()
        assert all(one[1] < two[0] for one, two in zip(found, found[1:], strict=False))


def stood(*spans: tuple[int, int, int], count: int = 100) -> np.ndarray:
    """Return where soles stand: side, first frame, and the one after the last."""
    standing = np.zeros((count, 2), dtype=bool)
    for side, first, last in spans:
        standing[first:last, side] = True
    return standing


def test_a_foot_stays_until_the_other_one_has_stood_for_the_double_support() -> None:
    """0.15 s at 100 Hz are 15 frames after the landing; short flights are filled by the foot that stood."""
    for spans, time, expected in (
        ([(0, 0, 50), (1, 50, 100)], 0.15, [(0, 0, 65), (1, 50, 100)]),
        ([(0, 0, 50), (1, 45, 100)], 0.15, [(0, 0, 60), (1, 45, 100)]),
        ([(0, 0, 50), (1, 30, 100)], 0.15, [(0, 0, 50), (1, 30, 100)]),
        ([(0, 0, 50), (1, 0, 100)], 0.15, [(0, 0, 50), (1, 0, 100)]),
        ([(0, 0, 10), (1, 0, 100)], 0.15, [(0, 0, 10), (1, 0, 100)]),
        ([(1, 0, 50), (0, 54, 100)], 0.0, [(1, 0, 54), (0, 54, 100)]),
        ([(1, 0, 50), (0, 54, 100)], 0.1, [(1, 0, 64), (0, 54, 100)]),
        ([(0, 8, 50), (1, 40, 92)], 0.0, [(0, 0, 50), (1, 40, 100)]),
    ):
        found = always_standing(stood(*spans), RATE, time)
        assert (found == stood(*expected)).all(), (spans, time)
    for spans, times in (
        ([(0, 0, 50), (1, 59, 100)], "0.50 s to 0.59 s"),
        ([(1, 9, 100)], "0.00 s to 0.09 s"),
    ):
        with pytest.raises(InputError, match=times):
            always_standing(stood(*spans), RATE)


SQUARE = np.array([(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.05, 0.05)])


def soles_at(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the corners of two flat soles that move, shape (T, 2, 4, 3)."""
    return np.stack([left, right], axis=1)[:, :, None] + SQUARE


def test_a_sole_stands_by_its_height_and_its_speed_with_hysteresis() -> None:
    """A contact begins below 0.2 m/s and 30 mm, ends above 0.4 m/s or 30 mm; its ends off by 15 mm are no part."""
    t = np.arange(400) / RATE
    ground = 0.7
    still = np.tile([0.0, 0.1, ground], (400, 1))

    def standing(path: np.ndarray) -> np.ndarray:
        level, found = touching(soles_at(still, still + path), RATE)
        assert level == pytest.approx(ground, abs=1e-9) and found[:, 0].all()
        return found[:, 1]

    def ahead(speed: float) -> np.ndarray:
        """Move ahead from 1 s to 2 s."""
        return np.outer(speed * np.clip(t - 1.0, 0.0, 1.0), (1.0, 0.0, 0.0))

    assert standing(ahead(0.3)).all()
    assert np.array_equal(standing(ahead(0.5)), ~((t > 1.005) & (t < 2.005)))
    lifted = np.outer(0.1 * np.clip(np.minimum(t - 1.0, 3.0 - t), 0.0, None), (0.0, 0.0, 1.0))
    off = lifted[:, 2] > 0.015 - 1e-9
    assert np.array_equal(standing(lifted), ~off)
    begun = standing(np.outer(0.3 * np.clip(t, 0.0, 2.0), (1.0, 0.0, 0.0)))
    assert not begun[:199].any() and begun[201:].all(), "faster than 0.2 m/s no contact begins"
    assert not standing(0.0 * ahead(1.0) + [0.0, 0.0, 0.2]).any(), "a foot that is held up at rest"

    def jerked(*spans: tuple[float, float]) -> np.ndarray:
        """Lift by 0.1 m within spans of time, s, at once."""
        up = sum(((t > a - 1e-9) & (t < b - 1e-9)).astype(float) for a, b in spans)
        return np.outer(0.1 * up, (0.0, 0.0, 1.0))

    assert standing(jerked((1.0, 1.03))).all(), "a gap of 0.05 s with the frames beside, which are fast"
    gap = standing(jerked((1.0, 1.06)))
    assert not gap[100:106].any() and gap[:99].all() and gap[107:].all()
    short = standing(jerked((1.0, 1.1), (1.18, 1.3)))
    assert not short[100:130].any() and short[:99].all() and short[131:].all(), "a contact of 0.06 s is none"
    assert standing(jerked((1.0, 1.1), (1.25, 1.3)))[113], "one of 0.13 s is"


def test_the_ground_is_where_known_contacts_are(robot: Robot) -> None:
    q = np.tile(robot.half_sitting, (50, 1))
    q[:, 2] += 0.3
    motion = BodyMotion.of(robot, q, RATE)
    for known in (None, stood((0, 0, 50), (1, 0, 30), count=50)):
        ground, standing = find_contacts(motion, known)
        assert ground == pytest.approx(0.3, abs=1e-3)
        assert (standing == (np.ones((50, 2), dtype=bool) if known is None else known)).all()
    assert motion.corners[..., 2].min() == pytest.approx(0.3, abs=1e-3)


# Clips


def made_clip(robot: Robot, count: int = 41) -> MotionClip:
    """Return a clip that moves evenly and turns evenly."""
    t = np.arange(count) / RATE
    base = np.zeros((count, 7))
    base[:, :3] = robot.half_sitting[:3] + np.outer(t, (0.3, -0.2, 0.1))
    base[:, 3:] = Rotation.from_rotvec(np.outer(t, (0.1, -0.2, 1.5))).as_quat()
    joints = robot.half_sitting[7:] + np.outer(t, np.linspace(-0.3, 0.3, robot.na))
    return MotionClip(
        robot.joint_names, RATE, base, joints, standing=stood((0, 0, 20), (1, 20, count), count=count)
    )


def test_an_even_motion_is_sampled_exactly_at_any_time(robot: Robot) -> None:
    clip = made_clip(robot)
    assert clip.duration == pytest.approx(0.4) and np.allclose(np.diff(clip.times), 0.01)
    times = np.array([0.0, 0.0013, 0.1, 0.1949, 0.1951, 0.333, 0.4])
    found = clip.sampled(times, 50.0)
    assert found.rate == 50.0 and found.duration == pytest.approx(0.12)
    np.testing.assert_allclose(
        found.base[:, :3] - clip.base[0, :3], np.outer(times, (0.3, -0.2, 0.1)), atol=1e-12
    )
    rates = np.linspace(-0.3, 0.3, robot.na)
    np.testing.assert_allclose(found.joints - clip.joints[0], np.outer(times, rates), atol=1e-12)
    turns = Rotation.from_quat(found.base[:, 3:]).as_rotvec()
    np.testing.assert_allclose(turns, np.outer(times, (0.1, -0.2, 1.5)), atol=1e-9)
    assert found.standing is not None
    assert found.standing[:, 0].tolist() == [True, True, True, True, False, False, False]
    bad: list[Any] = [[0.1], [[0.0, 0.1]], [0.1, 0.05], [-0.01, 0.1], [0.1, 0.41], [0.0, np.nan]]
    for wrong in bad:
        with pytest.raises(InputError):
            clip.sampled(np.array(wrong), 50.0)
    assert len(clip.sampled(np.array([0.1, 0.1, 0.4 + 1e-7]), 50.0)) == 3


def test_quaternions_keep_their_sign_and_have_length_one(robot: Robot) -> None:
    clip = made_clip(robot)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], len(clip))
    signs[0] = 1.0
    base = clip.base.copy()
    base[:, 3:] *= (signs * np.linspace(0.96, 1.04, len(clip)))[:, None]
    np.testing.assert_allclose(replace(clip, base=base).base, clip.base, atol=1e-12)
    again = MotionClip.of(robot, clip.configurations(robot), clip.rate)
    np.testing.assert_allclose(again.joints, clip.joints, atol=1e-12)
    few = MotionClip(clip.joint_names[3:5], RATE, clip.base, clip.joints[:, 3:5])
    q = few.configurations(robot)
    rest = np.delete(q, [10, 11], axis=1)[:, 7:]
    assert (rest == np.delete(robot.half_sitting, [10, 11])[7:]).all() and (q[:, 10:12] == few.joints).all()
    lying = clip.base.copy()
    lying[7, 3:] *= 1.06
    with pytest.raises(InputError, match=r"1.060 in frame 7$"):
        replace(clip, base=lying)
    lying = clip.base.copy()
    for tilt, good in ((1.0, True), (1.1, False)):  # cos 1.047 is a half
        lying[0, 3:] = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_quat()
        if good:
            replace(clip, base=lying)
        else:
            with pytest.raises(InputError, match="upright"):
                replace(clip, base=lying)
    for joints, good in ((12.5, True), (12.6, False)):  # two turns
        changed = clip.joints.copy()
        changed[7, 3] = -joints
        if good:
            replace(clip, joints=changed)
        else:
            with pytest.raises(InputError, match=robot.joint_names[3]):
                replace(clip, joints=changed)
    for wrong in (
        {"standing": 2 * np.ones((len(clip), 2))},
        {"standing": np.ones((3, 2))},
        {"joints": clip.joints[:1], "base": clip.base[:1], "standing": None},
        {"joints": clip.joints.astype(complex)},
    ):
        with pytest.raises(InputError):
            replace(clip, **wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="shape"):
        MotionClip.of(robot, clip.joints, RATE)


# Measures


def test_the_nearest_point_of_a_support_is_the_point_or_on_its_edge() -> None:
    """Of rectangles, turned and moved: their coordinates are cut off at the sides."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        size, turn = rng.uniform(0.05, 0.3, 2), rng.uniform(0.0, 6.0)
        rotation, middle = pin.utils.rotate("z", turn)[:2, :2], rng.normal(size=2)
        corners = size * [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        points = rng.uniform(-0.5, 0.5, (20, 2))
        found = nearest_inside([corners @ rotation.T + middle] * 20, points @ rotation.T + middle)
        np.testing.assert_allclose(found, np.clip(points, -size, size) @ rotation.T + middle, atol=1e-12)


def test_supports_are_the_hulls_of_the_soles_that_stand(robot: Robot) -> None:
    soles = [
        (pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.0])), pin.SE3(np.eye(3), np.array([0.0, -0.1, 0.0])))
    ] * 2
    corners = corners_of(robot, soles)
    length, width = robot.soles[0].length, robot.soles[0].width
    np.testing.assert_allclose(np.ptp(corners, axis=2)[0], [[length, width, 0.0]] * 2, atol=1e-12)
    np.testing.assert_allclose(corners.mean(axis=2)[0], [(0.0, 0.1, 0.0), (0.0, -0.1, 0.0)], atol=1e-12)
    one, both = supports_of(corners, np.array([(True, False), (True, True)]))
    np.testing.assert_allclose(np.ptp(one, axis=0), (length, width), atol=1e-12)
    np.testing.assert_allclose(np.ptp(both, axis=0), (length, width + 0.2), atol=1e-12)
    assert one[:, 1].min() == pytest.approx(0.1 - 0.5 * width)


def test_measures_of_a_robot_that_is_moved_by_rule(robot: Robot) -> None:
    """Soles that slide at 50 mm/s and lie 2 mm deep, a ZMP 30 mm ahead of them, a joint over its limits."""
    count = 60
    still = BodyMotion.of(robot, np.tile(robot.half_sitting, (count, 1)), RATE)
    both = np.ones((count, 2), dtype=bool)

    def measured(
        motion: BodyMotion, standing: np.ndarray = both, share: float = 1.0, friction: float = 0.7
    ) -> Any:
        return measure(robot, motion, standing, share=share, friction=friction)

    rest = measured(still)
    assert rest.feasible and not rest.infeasible_frames.any() and rest.slide_speed == rest.zmp_outside == 0.0
    assert (
        rest.sole_depth == pytest.approx(0.0, abs=1e-4)
        and rest.friction < 1e-6
        and rest.single_support == 0.0
    )
    slid = replace(still, corners=still.corners + np.outer(np.arange(count), (5e-4, 0.0, 0.0))[:, None, None])
    assert measured(slid).slide_speed == pytest.approx(0.05)
    third = stood((0, 0, count), (1, 0, 40), count=count)
    assert measured(slid, third).slide_speed == pytest.approx(0.05)
    assert measured(still, third).single_support == pytest.approx(1.0 / 3.0)
    one = still.corners.copy()
    one[:, 1, :, 0] += 5e-4 * np.arange(count)[:, None]
    assert measured(replace(still, corners=one)).slide_speed == pytest.approx(0.025), "per second of contact"
    deep = replace(still, corners=still.corners - [0.0, 0.0, 0.002 + still.corners[..., 2].min()])
    assert measured(deep).sole_depth == pytest.approx(0.002)
    front = still.corners[..., 0].max()
    for ahead, good in ((0.030, False), (0.004, True), (-0.010, True)):
        com = still.com.copy()
        com[:, 0] = front + ahead
        found = measured(replace(still, com=com))
        assert found.zmp_outside == pytest.approx(max(0.0, ahead), abs=1e-9)
        assert found.feasible == good and found.infeasible_frames.all() != good
    joint = robot.joint_index(robot.joint_names[-1])
    q = still.q.copy()
    q[20:, 7 + joint] = robot.position_upper[joint] + 0.1
    over = measured(replace(still, q=q))
    assert over.joint_excess == {robot.joint_names[joint]: pytest.approx(0.1)} and not over.feasible
    q[20:, 7 + joint] = robot.position_lower[joint] - 0.2
    assert measured(replace(still, q=q)).joint_excess == {robot.joint_names[joint]: pytest.approx(0.2)}
    v = still.v.copy()
    v[30:32, 6 + joint] = -0.9 * robot.velocity_limit[joint]
    fast = replace(still, v=v)
    assert not measured(fast).joint_speed
    slow = measured(fast, share=0.8)
    assert slow.joint_speed == {robot.joint_names[joint]: pytest.approx(0.9)}
    assert np.flatnonzero(slow.infeasible_frames[30:32]).size == 2 and slow.to_json()["feasible"] is False
    assert measured(fast, share=0.86).joint_speed == {}, "5 % more is let pass"
    for share in (0.0, -0.1, 1.1):
        for refuse in (check_motion, make_feasible):
            with pytest.raises(InputError, match="share"):
                refuse(robot, made_clip(robot), share=share)


def test_torques_above_the_legs_are_those_of_inverse_dynamics(robot: Robot) -> None:
    """At rest those of gravity; at an even acceleration of one joint its column of the mass matrix more."""
    count, joint = 60, robot.joint_index(robot.joint_names[-1])
    still = BodyMotion.of(robot, np.tile(robot.half_sitting, (count, 1)), RATE)
    data, rest = robot.model.createData(), np.zeros(robot.nv)
    pushed = rest.copy()
    pushed[6 + joint] = 20.0
    v = np.outer(np.arange(count) / RATE, pushed)
    for motion, acceleration in ((still, rest), (replace(still, v=v - v[30]), pushed)):
        torques = pin.rnea(robot.model, data, robot.half_sitting, rest, acceleration)[6:]
        torques += robot.passive_torques(robot.half_sitting[None], rest[None])[0]
        torques[robot.leg_joints] = 0.0
        np.testing.assert_allclose(
            motion.torque_share(robot)[30], np.abs(torques) / robot.torque_limit, rtol=1e-9, atol=1e-12
        )


def test_drives_make_up_for_the_damping_of_their_joints() -> None:
    """At a steady speed by damping times speed, on top of inverse dynamics."""
    name = "left_elbow_pitch"
    robot = replace(load_robot("hrp4_class"), damping={name: 2.0}).robot()
    joint, v = robot.joint_index(name), np.zeros(robot.nv)
    v[6 + joint] = 1.5
    still = BodyMotion.of(robot, np.tile(robot.half_sitting, (60, 1)), RATE)
    moving = replace(still, v=np.tile(v, (60, 1)))
    torque = (
        pin.rnea(robot.model, robot.model.createData(), robot.half_sitting, v, 0.0 * v)[6 + joint] + 2.0 * 1.5
    )
    assert moving.torque_share(robot)[30, joint] == pytest.approx(abs(torque) / robot.torque_limit[joint])


def test_velocities_and_momentum_are_those_of_an_even_motion(robot: Robot) -> None:
    clip = made_clip(robot)
    motion = BodyMotion.of(robot, clip.configurations(robot), RATE)
    rates = np.linspace(-0.3, 0.3, robot.na)
    np.testing.assert_allclose(motion.v[:, 6:], np.tile(rates, (len(clip), 1)), atol=1e-9)
    np.testing.assert_allclose(motion.v[:, 3:6], np.tile((0.1, -0.2, 1.5), (len(clip), 1)), atol=1e-9)
    data = robot.model.createData()
    momentum = pin.computeCentroidalMomentum(robot.model, data, motion.q[20], motion.v[20])
    np.testing.assert_allclose(motion.momentum[20], momentum.angular / robot.mass, atol=1e-12)
    np.testing.assert_allclose(np.gradient(motion.com, 1.0 / RATE, axis=0)[20], data.vcom[0], atol=1e-3)


def test_the_zmp_of_a_point_mass_is_where_its_force_meets_the_ground() -> None:
    """And a rate of angular momentum L̇ moves it by L̇ over the vertical force, across."""
    rng = np.random.default_rng(2)
    com, force = rng.uniform(0.3, 1.0, (20, 3)), rng.uniform(-3.0, 3.0, (20, 3))
    turning = rng.normal(size=(20, 3))
    for ground in (0.0, -0.4):
        zmp = zmp_of(com, force, turning, ground)
        lift = force + [0.0, 0.0, GRAVITY]
        arm = np.column_stack([zmp, np.full(20, ground)]) - com
        moment = np.cross(arm, lift) - turning  # of the contact force about the CoM, less what turns the body
        np.testing.assert_allclose(moment[:, :2], 0.0, atol=1e-12)
    falling = zmp_of(com, -GRAVITY * np.array([[0.0, 0.0, 1.0]] * 20) + [1.0, 0.0, 0.0], 0.0 * turning)
    np.testing.assert_allclose(falling[:, 0], com[:, 0] - com[:, 2] / (0.2 * GRAVITY), atol=1e-12)


# Footsteps


def steps_of(way: pin.SE3, height: float = 0.08, width: float = 0.2) -> tuple[list[Soles], np.ndarray]:
    """Return soles of which the right one goes a way, then the left one the same, and where they stand."""
    places = [pin.SE3(np.eye(3), np.array([0.0, side * 0.5 * width, 0.0])) for side in (1.0, -1.0)]
    given, standing = [], []
    for i in range(200):
        shares = [np.clip((i - begin) / 50.0, 0.0, 1.0) for begin in (110, 30)]
        moved = []
        for place, share in zip(places, shares, strict=True):
            turn = pin.log3(way.rotation)
            sole = pin.SE3(
                pin.exp3(share * turn) @ place.rotation, place.translation + share * way.translation
            )
            sole.translation[2] = height * np.sin(np.pi * share) ** 2
            moved.append(sole)
        given.append((moved[0], moved[1]))
        standing.append([share in (0.0, 1.0) for share in shares])
    return given, np.array(standing)


def shift(x: float, y: float = 0.0, yaw: float = 0.0) -> pin.SE3:
    return pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))


def planned(robot: Robot, way: pin.SE3, **more: float) -> Any:
    given, standing = steps_of(way, **more)
    com_height = np.full(
        len(given), float(robot.com[2] - robot.placement(robot.soles[0].frame).translation[2])
    )
    return given, standing, *footsteps(robot, given, com_height, RATE, standing)


def test_steps_within_reach_stay_where_they_are(robot: Robot) -> None:
    given, standing, made, body, shortened = planned(robot, shift(0.1, 0.0, 0.1))
    assert shortened == 0.0 and np.allclose([move.homogeneous for move in body], np.eye(4), atol=1e-12)
    for side in (0, 1):
        for first, last in runs(standing[:, side]):
            for own, pair in zip(made[first:last], given[first:last], strict=True):
                assert own[side].isApprox(pair[side], 1e-9)
    air = runs(~standing[:, 1])[0]
    lowest = corners_of(robot, made)[air[0] : air[1], 1, :, 2]
    assert lowest.min() > 0.0 and lowest.min(axis=1)[7:-7].min() > 0.01 - 1e-9
    assert lowest.max() == pytest.approx(0.08, abs=2e-3)
    before, after = made[air[0] - 1][1], made[air[1]][1]
    for k in range(1, 6):  # it leaves and reaches its place from above: 0.06 s are six frames
        for sole, place in ((made[air[0] - 1 + k][1], before), (made[air[1] - k][1], after)):
            np.testing.assert_allclose(sole.translation[:2], place.translation[:2], atol=1e-9)
            rise = k / 6.0
            assert sole.translation[2] >= 0.01 * (3.0 * rise**2 - 2.0 * rise**3) - 1e-9
            np.testing.assert_allclose(sole.rotation, place.rotation, atol=1e-9)


@pytest.mark.parametrize("kind", ["ahead", "back", "apart", "together", "out", "in"])
def test_steps_out_of_reach_end_at_its_bounds_and_the_body_comes_along(robot: Robot, kind: str) -> None:
    """Of the first step, seen from the foot that stands, one coordinate is too great; the second follows the first."""
    height = float(robot.com[2] - robot.placement(robot.soles[0].frame).translation[2])
    reach = replace(Reach.of(robot, height), max_spacing=Reach.of(robot).max_spacing)
    length, width, yaw = reach.max_length, 0.2, reach.max_yaw
    way, bound = {
        "ahead": (shift(length + 0.2), (length, -width, 0.0)),
        "back": (shift(-length - 0.2), (-length, -width, 0.0)),
        "apart": (shift(0.0, width - reach.max_spacing - 0.1), (0.0, -reach.max_spacing, 0.0)),
        "together": (shift(0.0, width - reach.min_spacing + 0.03), (0.0, -reach.min_spacing, 0.0)),
        "out": (shift(0.0, 0.0, -yaw - 0.2), (0.0, -width, -yaw)),
        "in": (shift(0.0, 0.0, 0.5 * yaw + 0.1), (0.0, -width, 0.5 * yaw)),
    }[kind]
    _, standing, made, body, shortened = planned(robot, way, width=width)
    left, right = made[100]
    step = left.actInv(right)
    np.testing.assert_allclose((*step.translation[:2], heading(step.rotation)), bound, atol=1e-6)
    asked = np.array([0.0, -width, 0.0]) + way.translation
    assert shortened == pytest.approx(max(0.0, np.linalg.norm(asked - step.translation)), abs=1e-6)
    np.testing.assert_allclose(body[0].homogeneous, np.eye(4), atol=1e-12)
    # The body moves by the mean of what both feet were moved by.
    moved = 0.5 * (right.translation - (shift(0.0, -0.1) * pin.SE3.Identity()).translation - way.translation)
    if kind in ("ahead", "back", "apart", "together"):
        np.testing.assert_allclose(body[100].translation, moved, atol=1e-6)
    assert standing[100].all()


def test_the_height_on_one_foot_decides_how_far_a_step_goes(robot: Robot) -> None:
    given, standing = steps_of(shift(2.0))
    height = float(robot.com[2] - robot.placement(robot.soles[0].frame).translation[2])
    for fall in (0.0, 0.05):
        heights = np.where(standing.all(axis=1), height, height - fall)
        made, _, _ = footsteps(robot, given, heights, RATE, standing)
        step = made[100][0].actInv(made[100][1]).translation[0]
        assert step == pytest.approx(Reach.of(robot, height - fall).max_length, abs=1e-6)


# Inverse kinematics


def test_configurations_have_the_soles_and_the_centre_of_mass_that_are_asked_for(robot: Robot) -> None:
    """Those of other configurations: the soles and the centre of mass are met, within the limits of the joints."""
    rng = np.random.default_rng(5)
    wanted = np.tile(robot.half_sitting, (3, 1))
    wanted[:, 7:] += 0.05 * rng.normal(size=(3, robot.na))
    motion = BodyMotion.of(robot, wanted, RATE)
    given = np.tile(robot.half_sitting, (3, 1))
    for standing in (np.ones((3, 2)), stood((0, 0, 3), count=3).astype(float)):
        found = inverse_kinematics(robot, 0.05, given, motion.soles, standing, motion.com)
        made = BodyMotion.of(robot, found, RATE)
        for ours, theirs, stands in zip(made.soles, motion.soles, standing, strict=True):
            for sole, place, firm in zip(ours, theirs, stands, strict=True):
                apart = np.linalg.norm(pin.log6(place.actInv(sole)).vector)
                assert apart < (1e-3 if firm else 1e-2)
        np.testing.assert_allclose(made.com, motion.com, atol=2e-3)
    lower, upper = robot.position_lower, robot.position_upper
    room = np.minimum(0.05, 0.5 * (upper - lower))
    assert (found[:, 7:] >= lower + room - 1e-9).all() and (found[:, 7:] <= upper - room + 1e-9).all()
    still = BodyMotion.of(robot, given, RATE)
    same = inverse_kinematics(robot, 0.05, given, still.soles, np.ones((3, 2)), still.com)
    np.testing.assert_allclose(same[:, :7], given[:, :7], atol=1e-4)
