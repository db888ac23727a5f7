"""Motions: files of all formats, measures against closed forms, and the filter on motions of every kind."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_motions import MOTIONS, make_motion
from scipy.optimize import minimize

from wbc import load_robot
from wbc.app.cli import main
from wbc.base.errors import InputError
from wbc.core.friction import mean_distance
from wbc.core.robot import GRAVITY, Robot
from wbc.motion import MotionClip, check_motion, make_feasible, read_motion, write_motion
from wbc.motion.contacts import find_contacts, runs
from wbc.motion.feasible import centre_of_mass_shift, supports_on
from wbc.motion.footsteps import footsteps
from wbc.motion.inverse_kinematics import planted
from wbc.motion.kinematics import BodyMotion, corners_of
from wbc.walking.plans.reach import Reach


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1").robot()


@pytest.fixture(scope="module")
def arms(g1: Robot) -> MotionClip:
    return make_motion(g1, "arms", 3)


@pytest.fixture(scope="module")
def stepping(g1: Robot) -> tuple[BodyMotion, np.ndarray]:
    """A motion with steps, and which soles stand."""
    clip = make_motion(g1, "steps", 1)
    motion = BodyMotion.of(g1, clip.configurations(g1), clip.rate)
    return motion, find_contacts(motion, double_support=0.15)[1]


# Clips and files


def columns(clip: MotionClip, name: str) -> tuple[object, tuple[str, ...]]:
    """Return what a file of the field holds, and what it does not say."""
    base, wxyz, names = clip.base, clip.base[:, [6, 3, 4, 5]], np.array(clip.joint_names)
    bodies = {"body_pos_w": base[:, None, :3], "body_quat_w": wxyz[:, None]}
    # The root is the first body but the world; others come after it.
    more = {key: np.concatenate((0.0 * value, value, 2.0 * value), axis=1) for key, value in bodies.items()}
    more["body_names"] = np.array(["world", "pelvis", "torso"])
    qpos = np.hstack([base[:, :3], wxyz, clip.joints])
    return {
        "unitree.csv": (np.hstack([base, clip.joints]), ("rate", "joints")),
        "beyondmimic.npz": ({"fps": [clip.rate], "joint_pos": clip.joints} | bodies, ("joints",)),
        "world.npz": ({"fps": [clip.rate], "joint_pos": clip.joints} | more, ("joints",)),
        "mujoco.npz": ({"fps": [clip.rate], "joint_pos": qpos, "joint_names": names}, ()),
        "gmr.npz": (
            {"fps": clip.rate, "root_pos": base[:, :3], "root_rot": base[:, 3:], "dof_pos": clip.joints},
            ("joints",),
        ),
    }.get(name, (None, ()))


FORMATS = ("own.npz", "own.csv", "unitree.csv", "beyondmimic.npz", "world.npz", "mujoco.npz", "gmr.npz")


@pytest.mark.parametrize("name", FORMATS)
def test_all_formats_become_the_same_clip(arms: MotionClip, tmp_path: Path, name: str) -> None:
    """A rate or joint names that a file does not hold have to be given, are never guessed, and contradict no file."""
    base = arms.base.copy()  # with a quaternion of four different numbers
    base[:, 3:] = pin.Quaternion(pin.exp3(np.array([0.2, -0.4, 0.9]))).coeffs()
    arms = replace(arms, base=base)
    path, (content, given) = tmp_path / name, columns(arms, name)
    if content is None:
        write_motion(arms, path)
    elif isinstance(content, dict):
        np.savez(path, **content)
    else:
        np.savetxt(path, content, delimiter=",", fmt="%.12g")
    options = {"rate": arms.rate, "joints": arms.joint_names}
    again = read_motion(path, **{key: options[key] for key in given})  # type: ignore[arg-type]
    assert again.rate == pytest.approx(arms.rate) and again.joint_names == arms.joint_names
    np.testing.assert_allclose(again.base, arms.base, atol=1e-8)
    np.testing.assert_allclose(again.joints, arms.joints, atol=1e-8)
    for key in given:
        with pytest.raises(InputError, match="does not say its (rate|joint names)"):
            read_motion(path, **{other: options[other] for other in given if other != key})  # type: ignore[arg-type]
    if "rate" not in given:
        with pytest.raises(InputError, match="the file says another rate.*, not 50"):
            read_motion(path, rate=50.0, joints=arms.joint_names)


@pytest.mark.parametrize("kind", ["bytes", "padded", "letters", "opaque", "of C", "unused"])
def test_names_are_read_however_an_array_holds_them(arms: MotionClip, tmp_path: Path, kind: str) -> None:
    """Bytes of HDF5 or C, padded texts, rows of single letters of MATLAB; what is not read may be a pickle."""
    width = max(map(len, arms.joint_names))
    padded = [name.ljust(width) for name in arms.joint_names]
    names = {
        "bytes": np.array([name.encode() for name in arms.joint_names]),
        "padded": np.array([name.encode() for name in padded]),
        "letters": np.array([list(name) for name in padded]),
        "opaque": np.array([name.encode() for name in arms.joint_names]).view(f"V{width}"),
        "of C": np.array([list(name.encode()) for name in padded], dtype=np.uint8),
        "unused": np.array(arms.joint_names),
    }[kind]
    more = {"info": np.array({"by": "somebody"})} if kind == "unused" else {}
    path = tmp_path / "CLIP.NPZ"
    with path.open("wb") as file:
        np.savez(file, joint_names=names, rate=arms.rate, base=arms.base, joints=arms.joints, **more)
    assert read_motion(path).joint_names == arms.joint_names


@pytest.mark.parametrize("ending", [".NPZ", ".Csv"])
def test_endings_may_be_written_large(arms: MotionClip, tmp_path: Path, ending: str) -> None:
    write_motion(arms, tmp_path / f"clip{ending}")
    assert read_motion(tmp_path / f"clip{ending}").joint_names == arms.joint_names


BODIES = {"body_pos_w": np.zeros((5, 1, 3)), "body_quat_w": np.ones((5, 1, 4))}
BEYONDMIMIC = {"fps": 30, "joint_pos": np.zeros((5, 2))} | BODIES
GMR = {"fps": 30, "root_pos": np.zeros((5, 3)), "root_rot": np.ones((5, 4)), "dof_pos": np.zeros((5, 2))}
HEADER, ROW = "time,x,y,z,qx,qy,qz,qw,a\n", "0,0,0,1,0,0,0,1,0\n"


@pytest.mark.parametrize(
    "content",
    [
        BEYONDMIMIC | {"joint_pos": np.zeros(5)},
        GMR | {"fps": "fast"},
        {name: GMR[name] for name in ("fps", "dof_pos")},
        {"joint_pos": np.array([{}], dtype=object)},
        "",
        HEADER + 2 * ROW,
        HEADER + ROW + ROW.replace("1", "one"),
        GMR | {"joint_names": np.arange(2)},
        HEADER.replace("qx", "rot_x") + ROW + ROW,
        HEADER.replace("time", "x") + ROW + ROW,
        (HEADER + ROW + ROW).replace(",", ";").replace("1", "1,0"),
        HEADER + ROW + "0," + ROW,
        "".join(f"{name}\n" for name in ("x", "y")),
    ],
)
def test_files_of_other_content_are_refused_in_one_line(tmp_path: Path, content: object) -> None:
    path = tmp_path / ("clip.npz" if isinstance(content, dict) else "clip.csv")
    if isinstance(content, dict):
        np.savez(path, **content)
    else:
        path.write_text(str(content))
    with pytest.raises(InputError, match=path.name) as refused:
        read_motion(path, joints=("a", "b") if isinstance(content, dict) else None)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("times", "rate"),
    [
        ((0, 0.02, 0.04, 0.06), 50.0),
        ((1, 1.0201, 1.04, 1.06), 50.0),
        ((0, 0.02, 0.05, 0.07), None),
        ((0, 0.02, 0.02, 0.04), None),
        ((0.06, 0.04, 0.02, 0), None),
    ],
)
def test_times_of_a_table_give_the_rate_and_increase_evenly(
    tmp_path: Path, times: tuple[float, ...], rate: float | None
) -> None:
    path = tmp_path / "clip.csv"
    path.write_text(HEADER + "".join(f"{time},{ROW.partition(',')[2]}" for time in times))
    if rate is not None:
        assert read_motion(path).rate == pytest.approx(rate, rel=1e-2)
        return
    with pytest.raises(InputError, match="evenly"):
        read_motion(path)


def test_names_in_a_pickle_are_refused_with_the_way_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "clip.npz", **GMR, joint_names=np.array(["a", "b"], dtype=object))
    with pytest.raises(
        InputError, match=r"'joint_names' is of Python objects.*np\.array\(names, dtype=str\)"
    ):
        read_motion(tmp_path / "clip.npz")


def test_bad_clips_are_refused(arms: MotionClip) -> None:
    broken, lying = arms.joints.copy(), arms.base.copy()
    broken[123, 4] = np.nan
    lying[:, 3:] = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    for changes, named in (
        ({"joints": broken}, "left_ankle_pitch_joint"),
        ({"base": lying}, "quaternion"),
        ({"rate": 1e9}, "rate"),
        ({"joints": arms.joints[:, :3]}, "joints"),
        ({"joints": np.degrees(arms.joints)}, "degrees"),
        ({"joint_names": ("a", *arms.joint_names[2:], "a")}, "'a'"),
    ):
        with pytest.raises(InputError, match=named):
            replace(arms, **changes)  # type: ignore[arg-type]


# Measures


def test_the_zmp_is_the_point_without_horizontal_moment(g1: Robot) -> None:
    """Checked with inverse dynamics: base wrench of the whole motion, moved to the ZMP."""
    rate, frame = 1000.0, 500
    t = np.arange(1001) / rate
    q = np.tile(g1.half_sitting, (len(t), 1))
    q[:, 0] += 0.03 * np.sin(5.0 * t)
    q[:, 7:] += 0.1 * np.sin(6.0 * t[:, None] + np.arange(g1.na))
    motion = BodyMotion.of(g1, q, rate)
    v = motion.v
    acceleration = (v[frame + 1] - v[frame - 1]) * rate / 2.0
    data = g1.model.createData()
    wrench = pin.rnea(g1.model, data, q[frame], v[frame], acceleration)[:6]
    pin.forwardKinematics(g1.model, data, q[frame])
    world = data.oMi[1].act(pin.Force(wrench[:3], wrench[3:]))
    place = np.array([-world.angular[1], world.angular[0]]) / world.linear[2]
    np.testing.assert_allclose(motion.zmp()[frame], place, atol=1e-4)


def test_the_shift_of_the_centre_of_mass_shifts_the_zmp_by_what_was_asked_for(g1: Robot) -> None:
    rate, height = 100.0, 0.8
    still = BodyMotion.of(g1, np.tile(g1.half_sitting, (400, 1)), rate)
    t = np.arange(400) / rate
    wanted = np.column_stack([0.05 * (t > 2.0), 0.02 * np.sin(3.0 * t)])
    shift = centre_of_mass_shift(wanted, height, rate)
    acceleration = replace(still, com=np.insert(shift, 2, height, axis=1)).acceleration()[:, :2]
    np.testing.assert_allclose(shift - height / GRAVITY * acceleration, wanted, atol=1e-10)
    assert shift[150, 0] > 1e-3, "it moves ahead of the change"


def test_the_friction_that_soles_need_is_that_of_the_forces_and_of_the_yaw_moment(g1: Robot) -> None:
    """Closed forms on one sole and two: a force needs f/N, a yaw moment τ/(N d), of two soles over their distance."""
    still = BodyMotion.of(g1, np.tile(g1.half_sitting, (100, 1)), 100.0)
    t, middle = np.arange(100) / 100.0, slice(20, 80)
    weight, sole = g1.mass * GRAVITY, g1.soles[0]
    distance = mean_distance(0.5 * sole.length, 0.5 * sole.width)
    both, left = np.ones((100, 2), dtype=bool), np.tile((True, False), (100, 1))
    turning = replace(still, momentum=np.outer(t, (0.0, 0.0, 3.0 / g1.mass)))  # 3 Nm
    for standing, lever in (
        (left, distance),
        (both, np.hypot(0.5 * np.linalg.norm(np.diff(still.centres[0], axis=0)), distance)),
    ):
        needed = turning.friction(g1, standing)[middle]
        np.testing.assert_allclose(needed, 3.0 / (weight * lever), rtol=0.02)
    above = still.com + (still.centres[0, 0] - still.com[0]) * (1.0, 1.0, 0.0)
    pushed = replace(still, com=above + np.outer(0.5 * 0.2 * t**2, (1.0, 0.0, 0.0)))  # 0.2 m/s²
    np.testing.assert_allclose(pushed.friction(g1, left)[middle], 0.2 / GRAVITY, rtol=0.02)
    # Of no slip the power is more than friction gives, of one it is as much. Two thirds of the load are on the left.
    aside = (still.centres[0, 0] - still.centres[0, 1])[1] / 6.0
    mixed = replace(
        pushed, com=pushed.com - pushed.com[0] + still.com + (0.0, aside, 0.0), momentum=turning.momentum
    )
    needed, loads = mixed.friction(g1, both)[20], np.array([2.0, 1.0]) / 3.0 * GRAVITY
    x, y, _ = (still.centres[0] - mixed.com[20]).T

    def ratio(slip: np.ndarray) -> float:
        forward, aside, turn = slip
        speeds = np.sqrt((forward - turn * y) ** 2 + (aside + turn * x) ** 2 + (distance * turn) ** 2)
        return float((0.2 * forward + 3.0 / g1.mass * turn) / (loads @ speeds))

    best = max(ratio(slip) for slip in np.random.default_rng(0).normal(size=(20_000, 3)) * (0.05, 0.05, 1.0))
    assert 0.97 * needed < best < 1.02 * needed


def test_the_friction_of_soles_is_the_greatest_ratio_of_power_to_what_slips(g1: Robot) -> None:
    """By the dual problem, max over all motions of the ground of f·v + τω over Σ N √(|v|² + (dω)²), at any stance."""
    t, rng = np.arange(60) / 100.0, np.random.default_rng(3)
    still = BodyMotion.of(g1, np.tile(g1.half_sitting, (60, 1)), 100.0)
    both = np.ones((60, 2), dtype=bool)
    distance = mean_distance(0.5 * g1.soles[0].length, 0.5 * g1.soles[0].width)
    for _ in range(4):
        corners = still.corners.copy()
        corners[:, 1] += [*rng.uniform(-0.3, 0.3, 2), 0.0]
        motion = replace(still, corners=corners)
        force, turn, share = rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.2, 0.2), rng.uniform(0.2, 0.8)
        place = share * motion.centres[0, 0] + (1.0 - share) * motion.centres[0, 1]
        path = 0.5 * np.outer((t - t[30]) ** 2, [*force, 0.0])
        com = np.array([*place[:2], still.com[0, 2]]) + path
        com[:, :2] += com[0, 2] / GRAVITY * force  # so that the ZMP is there
        motion = replace(motion, com=com, momentum=np.outer(t, (0.0, 0.0, turn)))
        arms = (motion.centres[30] - com[30])[:, :2]
        loads = GRAVITY * np.array([share, 1.0 - share])

        def ratio(
            slip: Any, arms: Any = arms, force: Any = force, turn: Any = turn, loads: Any = loads
        ) -> float:
            speeds = slip[:2] + slip[2] * np.column_stack([-arms[:, 1], arms[:, 0]])
            sizes = np.sqrt((speeds**2).sum(axis=1) + (distance * slip[2]) ** 2)
            return -float(force @ slip[:2] + turn * slip[2]) / float(loads @ sizes)

        starts = ((*force, 0.0), (0.0, 0.0, turn), (*force, 9.0 * turn), (*force, -9.0 * turn))
        best = min(
            minimize(ratio, start, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9}).fun
            for start in starts
        )
        assert motion.friction(g1, both)[30] == pytest.approx(-best, rel=0.03)


@pytest.mark.slow
def test_contacts_are_found_and_flight_is_refused_with_its_time(g1: Robot) -> None:
    clip = make_motion(g1, "one_leg", 1)
    motion = BodyMotion.of(g1, clip.configurations(g1), clip.rate)
    _, stands = find_contacts(motion)
    lifted = (~stands).any(axis=0)
    assert lifted.sum() == 1, "one foot leaves the ground"
    slid = np.linalg.norm(motion.centres - motion.centres[0], axis=-1)[:, ~lifted]
    assert slid.max() < 3e-4, "where the roll of an ankle meets its limit, the other joints keep the foot"
    (begin, end), *_ = [
        (np.argmin(column), len(column) - np.argmin(column[::-1])) for column in stands.T[lifted]
    ]
    assert 2.5 <= begin / clip.rate <= 3.2 and 5.8 <= end / clip.rate <= 6.5
    standing = np.ones((len(clip), 2), dtype=bool)
    standing[40:60] = False
    raised = replace(clip, base=clip.base + 0.4 * np.eye(7)[2])
    high, low = (check_motion(g1, each) for each in (raised, clip))
    assert (high.penetration, high.friction) == pytest.approx((low.penetration, low.friction), abs=1e-9)
    with pytest.raises(InputError, match=r"no sole stands from 0\.40 s to 0\.60 s"):
        find_contacts(motion, known=standing)


# The filter


@pytest.mark.slow
def test_steps_out_of_reach_are_shortened_and_the_body_comes_along(
    g1: Robot, stepping: tuple[BodyMotion, np.ndarray]
) -> None:
    """A step of 0.6 m becomes one that the walk's planner allows; steps within reach stay."""
    motion, standing = stepping
    same, body, shortened = footsteps(g1, motion.soles, motion.com[:, 2], motion.rate, standing)
    assert shortened == 0.0 and np.allclose([move.homogeneous for move in body], np.eye(4), atol=1e-12)
    first = runs(standing[:, 1])[1][0]  # where the right foot lands first
    away = pin.SE3(np.eye(3), np.array([0.6, 0.0, 0.0]))
    far = [(left, away * right if i >= first else right) for i, (left, right) in enumerate(motion.soles)]
    moved, body, shortened = footsteps(g1, far, motion.com[:, 2], motion.rate, standing)
    step = moved[first][0].actInv(moved[first][1])
    longest = Reach.of(g1, float(np.median(motion.com[standing.sum(axis=1) == 1, 2]))).max_length
    assert step.translation[0] == pytest.approx(longest, abs=1e-3)
    assert shortened == pytest.approx(
        0.6 + same[first][0].actInv(same[first][1]).translation[0] - longest, abs=2e-3
    )
    np.testing.assert_allclose(body[0].homogeneous, np.eye(4), atol=1e-12)
    assert body[-1].translation[0] < -0.2
    assert corners_of(g1, moved)[..., 2].min() > -1e-9


@pytest.mark.slow
def test_arms_that_ask_for_more_yaw_moment_than_the_soles_hold_are_slowed_down(g1: Robot) -> None:
    clip = make_motion(g1, "dance", 6)
    loose, kept = make_feasible(g1, clip, friction=9.0), make_feasible(g1, clip)
    assert loose.after.friction > 0.8 and loose.stretched < 1.2
    assert kept.after.feasible and kept.after.friction < 1.05 * 0.5
    assert kept.stretched > 1.2 * loose.stretched


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_motions_become_feasible(g1: Robot, name: str) -> None:
    clip = make_motion(g1, name, 1)
    result = make_feasible(g1, clip)
    after = result.after
    assert after.feasible and not after.joint_excess and not after.joint_speed
    assert after.foot_slide < 1e-3 and after.penetration < 1e-3 and after.zmp_worst < 5.0
    speed = BodyMotion.of(g1, result.clip.configurations(g1), result.clip.rate).v
    assert abs(speed[:10]).max() < 0.02 and abs(speed[-10:]).max() < 0.02, "it rests at both ends"
    if name in ("one_leg", "steps"):
        assert after.single_support > 0.1


@pytest.mark.slow
def test_a_feasible_motion_hardly_changes(g1: Robot) -> None:
    first = make_feasible(g1, make_motion(g1, "squat", 2))
    assert max(make_feasible(g1, first.clip).changes.values()) < np.radians(0.5)


@pytest.mark.slow
def test_feet_leave_and_reach_their_places_from_above(
    g1: Robot, stepping: tuple[BodyMotion, np.ndarray]
) -> None:
    """A foot that drags or glides along the ground lands early, and beside its place."""
    motion, standing = stepping
    steps, *_ = footsteps(g1, motion.soles, motion.com[:, 2], motion.rate, standing)
    _, lift_off = runs(standing[:, 1])[0]
    landing, _ = runs(standing[:, 1])[1]
    path = [pair[1] for pair in steps[lift_off - 1 : landing + 1]]
    for sole, place in [
        (path[3], path[0]),
        (path[-4], path[-1]),
    ]:  # 0.03 s after lift-off, and before landing
        np.testing.assert_allclose(sole.translation[:2], place.translation[:2], atol=1e-9)
        assert 1e-3 < sole.translation[2] < 0.02
    lowest, given = (
        corners_of(g1, soles[lift_off - 1 : landing + 1])[:, 1, :, 2].min(axis=1)
        for soles in (steps, list(motion.soles))
    )
    assert lowest.min() > -1e-9 and lowest[6:-6].min() > 0.01 - 1e-9
    assert lowest.max() == pytest.approx(given.max() - given[0], abs=1e-3), (
        "as high over its place as it is given"
    )
    tip = pin.SE3(pin.utils.rotate("y", 0.8), np.zeros(3))
    middle = (lift_off + landing) // 2
    tipped = [(left, right * tip if i == middle else right) for i, (left, right) in enumerate(motion.soles)]
    steps, *_ = footsteps(g1, tipped, motion.com[:, 2], motion.rate, standing)
    assert corners_of(g1, steps[middle : middle + 1])[0, 1, :, 2].min() == pytest.approx(0.01, abs=1e-9)


def test_soles_that_are_put_back_leave_and_reach_their_places_from_rest(g1: Robot) -> None:
    """A sole that slides ever faster before it leaves the ground: put back, it does not jump to that speed."""
    t = np.linspace(0.0, 1.0, 101)
    standing = np.stack([(t < 0.4) | (t > 0.7), np.ones(101)], axis=1)
    given = np.tile(g1.half_sitting, (101, 1))
    given[:, 7 + g1.joint_index("left_hip_pitch_joint")] += 0.1 * np.exp(-(((t - 0.55) / 0.1) ** 2))
    robot, sole = g1.clone(), g1.soles[0].frame

    def path_of(motion: np.ndarray) -> np.ndarray:
        path = []
        for q in motion:
            robot.update(q, np.zeros(robot.nv))
            path.append(robot.placement(sole).translation.copy())
        return np.array(path)

    home = [pin.SE3(g1.placement(each.frame)) for each in g1.soles[:2]]
    soles = [
        (home[0] if stands else pin.SE3(home[0].rotation, place), home[1])
        for place, stands in zip(path_of(given), standing[:, 0], strict=True)
    ]
    paths = path_of(given), path_of(planted(g1, given, soles, standing, 20))
    off = [np.abs(path - home[0].translation)[standing[:, 0] > 0.0].max() for path in paths]
    assert off[0] > 1e-3 and off[1] < 1e-5
    bends = [np.abs(np.diff(path, 2, axis=0)).max() for path in paths]
    assert bends[1] < 1.5 * bends[0]


def test_limits_are_kept_that_a_clip_exceeds(g1: Robot, arms: MotionClip) -> None:
    arms = arms.sampled(np.arange(45) / 30.0, 30.0)
    joints = arms.joints.copy()
    elbow = arms.joint_names.index("left_elbow_joint")
    joints[:, elbow] += 3.0 * np.sin(np.linspace(0.0, np.pi, len(joints)))
    wild = replace(arms, joints=joints)
    assert check_motion(g1, wild).joint_excess.keys() == {"left_elbow_joint"}
    assert not check_motion(g1, arms).joint_speed and check_motion(g1, arms, share=0.01).joint_speed
    result = make_feasible(g1, wild)
    assert not result.after.joint_excess and result.changes["left_elbow_joint"] > 0.5
    assert max(result.changes, key=lambda joint: result.changes[joint]) == "left_elbow_joint"
    times = result.source_times
    assert times[0] == 0.0 and times[-1] == pytest.approx(wild.duration) and times.max() <= wild.duration


@pytest.fixture(scope="module")
def hrp4() -> Robot:
    return load_robot("hrp4_class").robot()


def still(robot: Robot, count: int = 81, **changes: Any) -> MotionClip:
    """Return frames of half-sitting at 100 Hz with both soles on the ground: joint, or x, y, z, → its changes."""
    q = np.tile(robot.half_sitting, (count, 1))
    for name, change in changes.items():
        q[:, "xyz".index(name) if name in "xyz" else 7 + robot.joint_index(name)] += change
    return MotionClip.of(robot, q, 100.0, standing=np.ones((count, 2), dtype=bool))


def test_a_feasible_clip_rests_half_a_second_at_both_ends_and_eases_in_and_out(hrp4: Robot) -> None:
    """Its time is eased by 3r² − 2r³ over 0.4 s, of which the way is r³ − r⁴/2: 0.4 s longer, and as fast between."""
    result = make_feasible(hrp4, still(hrp4))
    assert len(result.clip) == 50 + 121 + 50 and result.stretched == pytest.approx(1.21 / 0.8)
    assert result.after.feasible and not result.changes and result.shortened == 0.0
    t = np.clip(np.arange(-50, 171) / 100.0, 0.0, 1.2)
    rise, fall = np.clip(t / 0.4, 0.0, 1.0), np.clip((1.2 - t) / 0.4, 0.0, 1.0)
    way = 0.4 * (rise**3 - 0.5 * rise**4) + np.clip(t - 0.4, 0.0, 0.4)
    way += 0.4 * (0.5 - (fall**3 - 0.5 * fall**4)) * (t > 0.8)
    np.testing.assert_allclose(result.source_times, way, atol=1e-4)
    np.testing.assert_allclose(result.clip.base[:, :3], np.tile(hrp4.half_sitting[:3], (221, 1)), atol=1e-6)
    with pytest.raises(InputError, match="10002 s"):  # of 1e6 frames 10,000 s
        make_feasible(hrp4, MotionClip.of(hrp4, np.tile(hrp4.half_sitting, (10_003, 1)), 1.0))


def test_a_joint_of_twice_the_allowed_speed_is_moved_in_twice_the_time(hrp4: Robot) -> None:
    joint, t = hrp4.joint_index("left_elbow_pitch"), np.arange(81) / 100.0
    limit = hrp4.velocity_limit[joint]
    clip = still(hrp4, left_elbow_pitch=-1.6 * limit * np.clip(t - 0.3, 0.0, 0.2))
    assert check_motion(hrp4, clip).joint_speed == {"left_elbow_pitch": pytest.approx(1.6)}
    result = make_feasible(hrp4, clip)
    middle = (result.source_times > 0.35) & (result.source_times < 0.45)
    np.testing.assert_allclose(np.diff(result.source_times)[middle[1:]], 0.005, rtol=0.05)
    speed = np.abs(np.gradient(result.clip.joints[:, joint], 0.01))
    assert 0.7 * limit < speed.max() < 0.8 * 1.05 * limit
    assert not result.after.joint_speed and result.after.feasible and max(result.changes.values()) < 0.05


def test_an_oscillation_above_the_cut_off_is_taken_out_and_one_below_stays(hrp4: Robot) -> None:
    """A Butterworth filter of order 2 there and back: 1 / (1 + (f / 6 Hz)⁴); then a Gaussian of 0.03 s."""
    t = np.arange(81) / 100.0
    for frequency in (2.0, 6.0):
        given = 0.02 * np.sin(2.0 * np.pi * frequency * t)
        result = make_feasible(hrp4, still(hrp4, left_wrist_yaw=given))
        joint = hrp4.joint_index("left_wrist_yaw")
        inside = (result.source_times > 0.25) & (result.source_times < 0.55)
        phase = 2.0 * np.pi * frequency * result.source_times[inside]
        waves = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
        kept = np.hypot(*np.linalg.lstsq(waves, result.clip.joints[inside, joint])[0][:2]) / 0.02
        pace = float(np.diff(result.source_times)[inside[1:]].mean()) / 0.01
        smoothed = np.exp(-0.5 * (2.0 * np.pi * frequency * pace * 0.03) ** 2)
        assert kept == pytest.approx(smoothed / (1.0 + (frequency / 6.0) ** 4), abs=0.08), frequency


def test_arms_and_trunk_are_no_further_out_than_their_torques_hold(hrp4: Robot) -> None:
    """Raised arms come down, and a trunk that is bent comes up, until gravity takes the share that is allowed."""
    for changes, share, joint in (
        ({"left_shoulder_pitch": -1.3}, 0.1, "left_shoulder_pitch"),
        ({"waist_pitch": 0.6}, 0.1, "waist_pitch"),
    ):
        clip, place = still(hrp4, **changes), hrp4.joint_index(joint)
        motion = BodyMotion.of(hrp4, clip.configurations(hrp4), 100.0)
        assert motion.torque_share(hrp4)[40, place] > 1.5 * share
        assert check_motion(hrp4, clip, share=share).joint_torque[joint] > 1.5 * share
        result = make_feasible(hrp4, clip, share=share)
        made = BodyMotion.of(hrp4, result.clip.configurations(hrp4), 100.0)
        kept = (result.clip.joints[100, place] - hrp4.half_sitting[7 + place]) / changes[joint]
        assert not result.after.joint_torque and 0.1 < kept < 0.9, "on the same side"
        assert made.torque_share(hrp4)[100].max() == pytest.approx(share, rel=0.02), (
            "no further in than is needed"
        )
    assert abs(changes["waist_pitch"] - result.changes["waist_pitch"]) > 0.4, (
        "it is the whole trunk that comes up"
    )


def test_a_motion_that_would_slip_is_slowed_down_until_it_does_not(hrp4: Robot) -> None:
    """Arms that swing against each other turn the body: of half the friction they get, in steps of 1.2 of the time."""
    wave = np.zeros(121)
    wave[60:] = 0.15 * np.sin(2.0 * np.pi * np.arange(61) / 60.0)
    clip = still(hrp4, 121, left_shoulder_pitch=wave, right_shoulder_pitch=-wave)
    assert check_motion(hrp4, clip).friction > 1.7 * 0.05
    result = make_feasible(hrp4, clip, friction=0.05)
    assert result.after.friction < 1.05 * 0.05 and result.after.feasible and result.after.foot_slide < 1e-3
    early, late = (
        np.diff(result.source_times)[(result.source_times[1:] > begin) & (result.source_times[1:] < end)]
        for begin, end in ((0.21, 0.24), (0.7, 0.9))
    )
    assert early.min() > 0.0075 and late.max() < 0.0102 / 1.2


def test_the_zmp_is_kept_to_the_middle_of_the_soles_and_of_both_where_both_carry(hrp4: Robot) -> None:
    """On 0.6 of length and width; between two soles 0.15 of their distance further in, from 0.6 s beside a step on."""
    soles = [tuple(pin.SE3(np.eye(3), np.array([0.0, y, 0.0])) for y in (0.1, -0.1))] * 300
    standing = np.ones((300, 2), dtype=bool)
    standing[200:, 1] = False
    areas = supports_on(hrp4, soles, standing)  # type: ignore[arg-type]
    length, width = 0.3 * hrp4.soles[0].length, 0.3 * hrp4.soles[0].width
    for frame, out in ((0, 0.1 - 0.15 * 0.2), (199, 0.1)):
        np.testing.assert_allclose(areas[frame].max(axis=0), (length, out + width), atol=1e-3)
        np.testing.assert_allclose(areas[frame].min(axis=0), (-length, -out - width), atol=1e-3)
    np.testing.assert_allclose(areas[250].min(axis=0), (-length, 0.1 - width), atol=1e-12)
    np.testing.assert_allclose(areas[250].max(axis=0), (length, 0.1 + width), atol=1e-12)
    extents = np.array([area[:, 1].max() for area in areas[:200]])
    assert (np.diff(extents) > -1e-12).all() and np.diff(extents).max() < 0.15 * 0.2 / 15.0, "no jump"
    assert extents[110] == pytest.approx(extents[0], abs=1e-3)


def test_the_body_moves_until_the_zmp_is_on_the_soles(hrp4: Robot) -> None:
    """Swayed 0.25 m aside in 0.8 s: it needs the ground half a metre beside the soles; squatting needs nothing."""
    bump = np.sin(np.pi * np.arange(81) / 80.0) ** 2
    for changes, worst in (({"y": 0.25 * bump}, 300.0), ({"z": -0.1 * bump}, 0.0)):
        clip = still(hrp4, **changes)
        if worst:
            assert check_motion(hrp4, clip).zmp_worst > worst
        result = make_feasible(hrp4, clip)
        made = BodyMotion.of(hrp4, result.clip.configurations(hrp4), 100.0)
        assert result.after.feasible and result.after.zmp_worst < 1.0
        assert result.after.foot_slide < 1e-3 and result.after.penetration < 1e-3
        np.testing.assert_allclose(
            made.centres, np.broadcast_to(made.centres[0], made.centres.shape), atol=1e-6
        )
        assert np.abs(made.v[:10]).max() < 0.02 and np.abs(made.v[-10:]).max() < 0.02
        zmp = made.zmp()
        if "z" in changes:
            assert np.ptp(made.com[:, 2]) == pytest.approx(0.1, abs=0.025) and np.ptp(zmp[:, 1]) < 1e-3
            assert made.com[0, 2] - made.com[100, 2] > 0.07


@pytest.mark.slow
def test_a_motion_that_is_too_fast_takes_longer() -> None:
    hrp4 = load_robot("hrp4_class").robot()
    dance = make_motion(hrp4, "dance")
    short = dance.sampled(dance.times[:200], 100.0)
    assert check_motion(hrp4, short).joint_speed
    result = make_feasible(hrp4, short)
    assert not result.after.joint_speed and result.after.feasible and result.stretched > 1.5


@pytest.mark.slow
def test_commands_check_and_filter_a_clip(
    g1: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip, feasible = str(tmp_path / "clip.npz"), str(tmp_path / "feasible.npz")
    write_motion(make_motion(g1, "dance"), clip)
    assert main(["motion", "check", clip]) == 0
    assert "not feasible as it is" in capsys.readouterr().out
    assert main(["motion", "filter", clip, "-o", feasible]) == 0
    capsys.readouterr()
    assert main(["motion", "check", feasible, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["feasible"] is True
    assert main(["motion", "filter", clip, "-o", clip]) == 2
