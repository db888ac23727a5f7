"""Filters of motions: speed, oscillations, torques, friction and ZMP of a clip that robots can follow."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from still_clips import still

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.robot import Robot
from wbc.motion import MotionClip, check_motion, make_feasible
from wbc.motion.feasible import FeasibleSettings, supports_on
from wbc.motion.kinematics import BodyMotion

BRIEF = FeasibleSettings(hold=0.15)
"""Rests as short as the claims need: each of their frames takes as long as one of the motion."""


@pytest.fixture(scope="module")
def hrp4() -> Robot:
    return load_robot("hrp4_class").robot()


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
    result = make_feasible(hrp4, clip, settings=BRIEF)
    middle = (result.source_times > 0.35) & (result.source_times < 0.45)
    np.testing.assert_allclose(np.diff(result.source_times)[middle[1:]], 0.005, rtol=0.05)
    speed = np.abs(np.gradient(result.clip.joints[:, joint], 0.01))
    assert 0.7 * limit < speed.max() < 0.8 * 1.05 * limit
    assert not result.after.joint_speed and result.after.feasible and max(result.changes.values()) < 0.05


def test_an_oscillation_above_the_cut_off_is_taken_out_and_one_below_stays(hrp4: Robot) -> None:
    """A Butterworth filter of order 2 there and back: 1 / (1 + (f / 6 Hz)⁴); then a Gaussian of 0.03 s."""
    t, waves = np.arange(81) / 100.0, {"left_wrist_yaw": 2.0, "right_wrist_yaw": 6.0}
    given = {name: 0.02 * np.sin(2.0 * np.pi * frequency * t) for name, frequency in waves.items()}
    result = make_feasible(hrp4, still(hrp4, **given), settings=BRIEF)
    inside = (result.source_times > 0.25) & (result.source_times < 0.55)
    pace = float(np.diff(result.source_times)[inside[1:]].mean()) / 0.01
    for name, frequency in waves.items():
        phase = 2.0 * np.pi * frequency * result.source_times[inside]
        columns = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
        joint = result.clip.joints[inside, hrp4.joint_index(name)]
        kept = np.hypot(*np.linalg.lstsq(columns, joint)[0][:2]) / 0.02
        smoothed = np.exp(-0.5 * (2.0 * np.pi * frequency * pace * 0.03) ** 2)
        assert kept == pytest.approx(smoothed / (1.0 + (frequency / 6.0) ** 4), abs=0.08), frequency


@pytest.mark.slow
def test_arms_and_trunk_are_no_further_out_than_their_torques_hold(hrp4: Robot) -> None:
    """Raised arms come down, and a trunk that is bent comes up, until gravity takes the share that is allowed."""
    for changes, share, joint in (
        ({"left_shoulder_pitch": -1.3}, 0.1, "left_shoulder_pitch"),
        ({"waist_pitch": 0.6}, 0.1, "waist_pitch"),
    ):
        clip, place = still(hrp4, 41, **changes), hrp4.joint_index(joint)
        motion = BodyMotion.of(hrp4, clip.configurations(hrp4), 100.0)
        assert motion.torque_share(hrp4)[20, place] > 1.5 * share
        assert check_motion(hrp4, clip, share=share).joint_torque[joint] > 1.5 * share
        result = make_feasible(hrp4, clip, share=share, settings=BRIEF)
        made = BodyMotion.of(hrp4, result.clip.configurations(hrp4), 100.0)
        kept = (result.clip.joints[30, place] - hrp4.half_sitting[7 + place]) / changes[joint]
        assert not result.after.joint_torque and 0.1 < kept < 0.9, "on the same side"
        assert made.torque_share(hrp4)[30].max() == pytest.approx(share, rel=0.02), (
            "no further in than is needed"
        )
    assert abs(changes["waist_pitch"] - result.changes["waist_pitch"]) > 0.4, (
        "it is the whole trunk that comes up"
    )


@pytest.mark.slow
def test_a_motion_that_would_slip_is_slowed_down_until_it_does_not(hrp4: Robot) -> None:
    """Arms that swing against each other turn the body: of half the friction they get, in steps of 1.2 of the time."""
    wave = np.zeros(121)
    wave[60:] = 0.15 * np.sin(2.0 * np.pi * np.arange(61) / 60.0)
    clip = still(hrp4, 121, left_shoulder_pitch=wave, right_shoulder_pitch=-wave)
    assert check_motion(hrp4, clip).friction > 1.7 * 0.05
    result = make_feasible(hrp4, clip, friction=0.05, settings=BRIEF)
    assert result.after.friction < 1.05 * 0.05 and result.after.feasible and result.after.slide_speed < 1e-6
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
    areas = supports_on(hrp4, soles, standing, 0.6)  # type: ignore[arg-type]
    length, width = 0.3 * hrp4.soles[0].length, 0.3 * hrp4.soles[0].width
    for frame, out in ((0, 0.1 - 0.15 * 0.2), (199, 0.1)):
        np.testing.assert_allclose(areas[frame].max(axis=0), (length, out + width), atol=1e-3)
        np.testing.assert_allclose(areas[frame].min(axis=0), (-length, -out - width), atol=1e-3)
    np.testing.assert_allclose(areas[250].min(axis=0), (-length, 0.1 - width), atol=1e-12)
    np.testing.assert_allclose(areas[250].max(axis=0), (length, 0.1 + width), atol=1e-12)
    extents = np.array([area[:, 1].max() for area in areas[:200]])
    assert (np.diff(extents) > -1e-12).all() and np.diff(extents).max() < 0.15 * 0.2 / 15.0, "no jump"
    assert extents[110] == pytest.approx(extents[0], abs=1e-3)


@pytest.mark.slow
def test_a_motion_rests_and_starts_for_the_times_that_are_set_and_slow_parts_alone_pass_a_low_cut_off(
    hrp4: Robot,
) -> None:
    """An arm that swings once in a second and, by a tenth as far, with 4 Hz, of which 1 Hz leaves nothing."""
    times = np.arange(101) / 100.0
    q, arm = np.tile(hrp4.half_sitting, (101, 1)), hrp4.joint_index("left_shoulder_pitch")
    q[:, 7 + arm] += 0.2 * np.sin(np.pi * times) ** 2 + 0.02 * np.sin(8.0 * np.pi * times)
    clip = MotionClip.of(hrp4, q, 100.0)
    settings = FeasibleSettings(cutoff=1.0, hold=1.0, ease=0.8)
    result = make_feasible(hrp4, clip, settings=settings)
    usual = make_feasible(hrp4, clip)
    assert result.clip.duration == pytest.approx(usual.clip.duration + 1.0 + 0.4, abs=0.03)
    assert (result.source_times[:101] == 0.0).all() and result.source_times[110] > 0.0
    bends = [np.abs(np.diff(each.clip.joints[:, arm], 2)).max() for each in (result, usual)]
    assert bends[0] < 0.5 * bends[1] and result.unfinished == usual.unfinished == ()


@pytest.mark.slow
@pytest.mark.parametrize("way", ["sway", "squat"])
def test_the_body_moves_until_the_zmp_is_on_the_soles(hrp4: Robot, way: str) -> None:
    """Swayed 0.15 m aside in 0.6 s: it needs the ground half a metre beside the soles; squatting needs nothing."""
    sway, squat = (np.sin(np.pi * np.arange(count) / (count - 1.0)) ** 2 for count in (61, 81))
    both = {"sway": ({"y": 0.15 * sway}, 0.3, 0.4), "squat": ({"z": -0.05 * squat}, 0.0, 0.15)}
    for changes, worst, hold in [both[way]]:
        clip = still(hrp4, len(*changes.values()), **changes)
        if worst:
            assert check_motion(hrp4, clip).zmp_outside > worst
        result = make_feasible(hrp4, clip, settings=FeasibleSettings(hold=hold))
        made = BodyMotion.of(hrp4, result.clip.configurations(hrp4), 100.0)
        assert result.after.feasible and result.after.zmp_outside < 0.001
        assert result.after.slide_speed < 1e-6 and result.after.sole_depth < 1e-6
        np.testing.assert_allclose(
            made.centres, np.broadcast_to(made.centres[0], made.centres.shape), atol=1e-6
        )
        assert np.abs(made.v[:10]).max() < 0.02 and np.abs(made.v[-10:]).max() < 0.02
        zmp = made.zmp()
        if "z" in changes:
            assert np.ptp(made.com[:, 2]) == pytest.approx(0.05, abs=0.012) and np.ptp(zmp[:, 1]) < 1e-3
            assert made.com[0, 2] - made.com[len(zmp) // 2, 2] > 0.035
