"""Motions: files of all formats, measures against closed forms, and the filter on motions of every kind."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_motions import MOTIONS, make_motion
from made_person import make_person
from scipy.optimize import minimize

from wbc import load_robot
from wbc.app.cli import main
from wbc.base.errors import InputError
from wbc.core.friction import mean_distance
from wbc.core.robot import GRAVITY, Robot
from wbc.motion import (
    MotionClip,
    MotionSource,
    check_motion,
    make_feasible,
    read_motion,
    read_skeleton,
    retarget,
    write_motion,
)
from wbc.motion.contacts import find_contacts
from wbc.motion.feasible import centre_of_mass_shift
from wbc.motion.inverse_kinematics import planted
from wbc.motion.kinematics import BodyMotion


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1").robot()


@pytest.fixture(scope="module")
def arms(g1: Robot) -> MotionClip:
    return make_motion(g1, "arms", 3)


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


@pytest.mark.parametrize("ending", ["npz", "csv", "bvh"])
def test_a_file_keeps_what_is_known_and_one_that_is_missing_is_named_once(
    arms: MotionClip, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"clip.{ending}"
    with pytest.raises(InputError) as missing:
        read_skeleton(path) if ending == "bvh" else read_motion(path)
    assert str(missing.value).count(str(path)) == 1
    if ending != "bvh":
        standing = np.arange(2 * len(arms)).reshape(-1, 2) % 3 > 0
        write_motion(replace(arms, standing=standing), path)
        again = read_motion(path)
        assert again.standing is not None and (again.standing == standing).all()
        assert again.joint_names == arms.joint_names


@pytest.mark.parametrize("ending", ["npz", "csv"])
def test_a_clip_that_is_written_is_read_with_the_names_of_its_joints(
    arms: MotionClip, tmp_path: Path, ending: str
) -> None:
    """Whatever a joint is called, in one piece or several: other names are refused, and nothing is written."""
    pieces = [*'a,1#é" \\\n\t\0\x1c\u2028\ufeff\ud800', "time", "x", "left_stands", "nan", ""]
    path, written = tmp_path / f"clip.{ending}", 0
    arms = replace(arms, base=arms.base[:2], joints=arms.joints[:2])
    write_motion(replace(arms, joint_names=(), joints=arms.joints[:, :0]), path)
    assert read_motion(path).joint_names == () and read_motion(path).joints.shape == (len(arms), 0)
    for k, name in enumerate([*pieces, *map("".join, np.random.default_rng(0).choice(pieces, (20, 3)))]):
        clip = replace(arms, joint_names=(name, *(f"{j} of {k}" for j in arms.joint_names[1:])))
        path.unlink(missing_ok=True)
        try:
            write_motion(clip, path)
        except InputError as error:
            assert "cannot be called" in str(error) and not path.exists() and name not in ("a", "1", "é")
        else:
            assert read_motion(path).joint_names == clip.joint_names
            written += 1
    assert written > 5


GOOD: dict[str, dict[str, Any]] = {
    "a motion": {"base": (5, 7), "joints": (5, 2)},
    "a motion of GMR": {"root_pos": (5, 3), "root_rot": (5, 4), "dof_pos": (5, 2)},
    "a motion of BeyondMimic": {"joint_pos": (5, 2), "body_pos_w": (5, 3, 3), "body_quat_w": (5, 3, 4)},
}


@pytest.mark.parametrize("what", GOOD)
@pytest.mark.parametrize("shape", [(), (5,), (4, 2), (5, 0), (5, 0, 3), (5, 2, 3), (5, 3, 2, 1), (6, 3, 4)])
def test_an_array_of_another_shape_is_named_with_the_shape_that_it_must_have(
    what: str, shape: tuple[int, ...], tmp_path: Path
) -> None:
    for wrong in GOOD[what]:
        arrays = {name: np.zeros(shape if name == wrong else good) for name, good in GOOD[what].items()}
        np.savez(path := tmp_path / "a.npz", rate=50.0, joint_names=np.array(["a", "b"]), **arrays)
        with pytest.raises(InputError, match=r"must have (shape \(|2 to )") as refused:
            read_motion(path)
        assert len(shape) == 2 or any(
            str(refused.value).partition(": ")[2].startswith(f"{name} of a motion") for name in arrays
        )


@pytest.mark.parametrize("kind", ["bytes", "padded", "unused"])
def test_names_are_read_however_an_array_holds_them(arms: MotionClip, tmp_path: Path, kind: str) -> None:
    """Bytes of HDF5, padded texts; what is not read may be a pickle."""
    width = max(map(len, arms.joint_names))
    padded = [name.ljust(width) for name in arms.joint_names]
    names = {
        "bytes": np.array([name.encode() for name in arms.joint_names]),
        "padded": np.array([name.encode() for name in padded]),
        "unused": np.array(arms.joint_names),
    }[kind]
    more = {"info": np.array({"by": "somebody"})} if kind == "unused" else {}
    path = tmp_path / "CLIP.NPZ"
    with path.open("wb") as file:
        np.savez(file, joint_names=names, rate=arms.rate, base=arms.base, joints=arms.joints, **more)
    assert read_motion(path).joint_names == arms.joint_names


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
        GMR | {"joint_names": np.array(["a", "b"], dtype=object)},
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
        ({"base": np.ma.masked_equal(arms.base, arms.base[7, 2])}, "finite"),
        *(({name: [[1.0], [1.0, 2.0]]}, "rows of one length") for name in ("base", "joints", "standing")),
    ):
        with pytest.raises(InputError, match=named):
            replace(arms, **changes)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rows of one length"):
        replace(make_person(), positions=[[[1.0]], [[1.0, 2.0]]])  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["go1", "panda"])
@pytest.mark.parametrize(
    "use",
    [
        check_motion,
        make_feasible,
        lambda robot, clip: MotionSource(robot, clip, 0.005),
        lambda robot, _: retarget(make_person(), robot),
    ],
)
def test_a_robot_without_feet_or_bolted_has_no_motion(use: Callable[..., object], name: str) -> None:
    robot = load_robot(name).robot()
    base = np.tile((0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0), (40, 1))
    clip = MotionClip(robot.joint_names, 50.0, base, np.tile(robot.half_sitting[robot.base_nq :], (40, 1)))
    with pytest.raises(InputError, match=f"'{name}' is (described with|bolted)"):
        use(robot, clip)
    if not robot.floating:
        for make in (lambda: clip.configurations(robot), lambda: MotionClip.of(robot, clip.joints, 50.0)):
            with pytest.raises(InputError, match="'panda' is bolted to the world"):
                make()


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
    assert (high.sole_depth, high.friction) == pytest.approx((low.sole_depth, low.friction), abs=1e-9)
    with pytest.raises(InputError, match=r"no sole stands from 0\.40 s to 0\.60 s"):
        find_contacts(motion, known=standing)


# The filter


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
    assert after.slide_speed < 1e-6 and after.sole_depth < 1e-6 and after.zmp_outside < 0.005
    speed = BodyMotion.of(g1, result.clip.configurations(g1), result.clip.rate).v
    assert abs(speed[:10]).max() < 0.02 and abs(speed[-10:]).max() < 0.02, "it rests at both ends"
    if name in ("one_leg", "steps"):
        assert after.single_support > 0.1


@pytest.mark.slow
def test_a_feasible_motion_hardly_changes(g1: Robot) -> None:
    first = make_feasible(g1, make_motion(g1, "squat", 2))
    assert max(make_feasible(g1, first.clip).changes.values()) < np.radians(0.5)


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


def test_numbers_of_a_clip_that_were_checked_cannot_be_written() -> None:
    """Nor those of a motion, of which centre of mass and soles are made once; what is given stays its owner's."""
    robot = load_robot("hrp4_class").robot()
    clip, q = make_motion(robot, "arms"), np.tile(robot.half_sitting, (3, 1))
    standing = np.ones((len(clip), 2), dtype=bool)
    person = make_person()
    motion = BodyMotion.of(robot, q, 100.0)
    with_soles = replace(clip, standing=standing)
    for values in (
        *(with_soles.joints, with_soles.base, with_soles.standing, person.positions),
        *(motion.q, motion.v, motion.com, motion.momentum, motion.corners),
    ):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0
    q[0, 0] = standing[0, 0] = 0.0
    assert motion.q[0, 0] == robot.half_sitting[0] and with_soles.standing[0, 0]
