"""Tracking of clips: references against finite differences, refusals, and motions in the simulator."""

from __future__ import annotations

import json
from math import radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_motions import make_motion
from scipy.spatial.transform import Rotation

from wbc import load_robot
from wbc.app.cli import main
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY, Robot
from wbc.motion import MotionClip, MotionSource, make_feasible, tracking_settings, write_motion
from wbc.motion.kinematics import BodyMotion
from wbc.motion.source import FADE, TrackedFoot, clip_references, placed, splines
from wbc.sim import Machine, TrackSpec, track_motion
from wbc.walking import Reference, WalkingControl
from wbc.walking.contact import Event
from wbc.walking.plans.swing import FootMotion

DT = 0.005


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1").robot()


@pytest.fixture(scope="module", params=["made", pytest.param("feasible", marks=pytest.mark.slow)])
def steps(g1: Robot, request: pytest.FixtureRequest) -> MotionClip:
    """Steps that are feasible; or one that is made by rule, in which all joints move and the left foot swings."""
    if request.param == "feasible":
        return make_feasible(g1, make_motion(g1, "steps", 1)).clip
    t = np.arange(101) / 100.0
    q = np.tile(g1.half_sitting, (len(t), 1))
    rise = np.sin(np.pi * t) ** 4
    q[:, :2] += np.outer(rise, (0.03, 0.02))
    q[:, 3:7] = Rotation.from_rotvec(np.outer(rise, (0.05, -0.04, 0.2))).as_quat()
    q[:, 7:] += np.outer(rise, 0.1 * np.sin(1.0 + np.arange(g1.na)))
    for joint, way in (("hip", -0.4), ("knee", 0.8), ("ankle", -0.4)):
        name = f"left_{joint}_pitch_joint" if joint != "knee" else "left_knee_joint"
        q[:, 7 + g1.joint_index(name)] = g1.half_sitting[7 + g1.joint_index(name)] + way * rise
    standing = np.stack([(t < 0.25) | (t > 0.75), np.ones(len(t))], axis=1)
    return MotionClip.of(g1, q, 100.0, standing=standing)


@pytest.fixture(scope="module")
def references(g1: Robot, steps: MotionClip) -> tuple[Reference, ...]:
    return clip_references(g1, steps, steps.standing, 0.0, DT)[1]


def test_a_foot_that_was_lifted_beside_its_place_comes_back_to_it_smoothly() -> None:
    """Velocity and acceleration are the derivatives of the place, and nothing of the offset is left in the end.

    The jerk jumps at the end by 60 · 20 mm / FADE³, of which half a step is 7.5e-3 m/s².
    """
    dt, sole = 1e-4, pin.SE3(np.eye(3), np.array([0.02, -0.01, 0.005]))
    foot, given = TrackedFoot(sole, dt), FootMotion.at_rest(pin.SE3.Identity())
    assert foot.switch(0, given, planned=False, early=False) == (Event.LIFT_OFF,)
    motions = [foot.motion(i, given) for i in range(round(FADE / dt) + 2)]
    places = np.array([motion.placement.translation for motion in motions])
    velocities = np.array([motion.velocity[:3] for motion in motions])
    accelerations = np.array([motion.acceleration[:3] for motion in motions])
    np.testing.assert_allclose(velocities[1:-1], (places[2:] - places[:-2]) / (2.0 * dt), atol=1e-5)
    np.testing.assert_allclose(
        accelerations[1:-1], (velocities[2:] - velocities[:-2]) / (2.0 * dt), atol=1e-2
    )
    np.testing.assert_allclose(places[0], sole.translation, atol=1e-12)
    assert not places[-1].any() and not accelerations[-1].any()


def test_references_are_derivatives_of_each_other(g1: Robot, steps: MotionClip) -> None:
    """The jerk jumps at each frame of the clip: differences over short steps come close to the derivatives."""
    fine, share = DT / 20.0, (0.3, 0.6)
    count = len(splines(g1, steps, fine)[0])
    q, v, a = (part[round(share[0] * count) : round(share[1] * count)] for part in splines(g1, steps, fine))
    differences = np.array([pin.difference(g1.model, q[i - 1], q[i + 1]) for i in range(1, len(q) - 1)])
    np.testing.assert_allclose(differences / (2.0 * fine), v[1:-1], atol=0.02)
    change = (v[2:] - v[:-2]) / (2.0 * fine)
    assert np.sqrt(((change - a[1:-1]) ** 2).mean()) < 0.05
    short = DT / 5.0
    references = clip_references(g1, steps, steps.standing, 0.0, short)[1]
    middle = slice(round(0.3 * len(references)), round(0.6 * len(references)))
    com, velocity = (
        np.array([getattr(r.pendulum, name) for r in references]) for name in ("com", "com_velocity")
    )
    np.testing.assert_allclose(np.gradient(com, short, axis=0)[middle], velocity[middle], atol=1e-2)
    acceleration = np.array([r.body.com_acceleration for r in references if r.body is not None])
    rise = np.gradient(velocity, short, axis=0)[middle] - acceleration[middle]
    assert np.sqrt((rise**2).mean()) < 0.02
    for side in (0, 1):
        place = np.array([r.feet[side].placement.translation for r in references])
        speed = np.array([r.feet[side].velocity[:3] for r in references])
        np.testing.assert_allclose(np.gradient(place, short, axis=0)[middle], speed[middle], atol=5e-3)


def test_ticks_begin_and_end_with_the_frames_of_the_clip_at_rest(g1: Robot, steps: MotionClip) -> None:
    """A period that is no part of the duration has its last tick after the end, in the last frame."""
    frames, every = steps.configurations(g1), round(1.0 / (steps.rate * 0.002))
    for dt in (0.002, 0.005, 0.3 * steps.duration):
        q, v, a = splines(g1, steps, dt)
        assert len(q) == len(v) == len(a) == int(np.ceil(steps.duration / dt - 1e-6)) + 1
        for end in (0, -1):
            assert np.abs(pin.difference(g1.model, q[end], frames[end])).max() < 1e-9
            assert not v[end].any() and not a[end].any()
    coarse = clip_references(g1, steps, steps.standing, 0.0, 0.3 * steps.duration)[1]
    frames_of = np.minimum(np.round(0.3 * np.arange(5) * (len(steps) - 1)).astype(int), len(steps) - 1)
    assert [list(each.progress.contact) for each in coarse] == steps.standing[frames_of].tolist()
    q = splines(g1, steps, 0.002)[0][::every]
    apart = [np.abs(pin.difference(g1.model, *pair)).max() for pair in zip(q, frames, strict=True)]
    assert max(apart) < 1e-9


def test_the_pendulum_has_the_zmp_of_the_whole_body(references: tuple[Reference, ...]) -> None:
    """The force that it asks for goes through that ZMP, whatever the arms do meanwhile."""
    for pendulum, *_ in references[::50]:
        reach = (pendulum.com[2] - pendulum.zmp[2]) / (pendulum.com_acceleration[2] + GRAVITY)
        meets = pendulum.com[:2] - reach * pendulum.com_acceleration[:2]
        np.testing.assert_allclose(meets, pendulum.zmp[:2], atol=1e-9)
        assert pendulum.omega == pytest.approx(np.sqrt(GRAVITY / (pendulum.com[2] - pendulum.zmp[2])))


def test_a_foot_goes_over_to_the_clip_from_where_it_was_lifted_and_may_land_early(steps: MotionClip) -> None:
    robot = load_robot("g1").robot()
    q = steps.configurations(robot)[0]
    robot.update(q, np.zeros(robot.nv))
    source = MotionSource(robot, steps, DT)
    swings = ~np.array([reference.progress.contact for reference in source.motion])
    lift = int(swings.any(axis=1).argmax())
    side = int(swings[lift].argmax())
    landing = lift + int((~swings[lift:, side]).argmax())
    beside = pin.XYZQUATToSE3(q[:7]) * pin.SE3(pin.utils.rotate("z", 0.02), np.array([0.0, 0.005, 0.0]))
    robot.update(np.concatenate([pin.SE3ToXYZQUAT(beside), q[7:]]), np.zeros(robot.nv))
    stood = pin.SE3(robot.placement(robot.soles[side].frame))

    def update(tick: int, load: float) -> Reference:
        return source.update(SimpleNamespace(time=tick * DT, load=np.full(2, load)))  # type: ignore[arg-type]

    heavy = robot.mass * GRAVITY
    path = [update(tick, heavy if tick == lift + 50 else 0.0) for tick in range(lift, lift + 60)]
    assert not any(reference.progress.contact[side] for reference in path), (
        "a load amid a swing is no landing"
    )
    feet = [reference.feet[side] for reference in path]
    assert feet[0].placement.isApprox(stood, 1e-9)
    assert feet[-1].placement.isApprox(source.motion[lift + 59].feet[side].placement, 1e-12)
    moved = np.gradient([foot.placement.translation for foot in feet], DT, axis=0)
    np.testing.assert_allclose(moved[2:-2], [foot.velocity[:3] for foot in feet[2:-2]], atol=0.01)
    given = source.motion[lift].feet[side].placement, source.motion[lift + 20].feet[side].placement
    whole, half = pin.log3(stood.rotation @ given[0].rotation.T), feet[20].placement  # after 0.1 of 0.2 s
    assert np.linalg.norm(whole) > 0.015
    np.testing.assert_allclose(pin.log3(half.rotation @ given[1].rotation.T), 0.5 * whole, atol=1e-9)
    away = half.translation - given[1].translation
    np.testing.assert_allclose(away, 0.5 * (stood.translation - given[0].translation), atol=1e-9)
    assert not update(landing - 10, 0.0).progress.contact[side]
    early = update(landing - 9, heavy)
    assert (
        early.progress.contact[side]
        and early.progress.events == (Event.EARLY_TOUCH_DOWN,)
        and source.landings == 1
    )
    assert update(landing, 0.0).progress.contact[side] and source.landings == 1
    assert not update(lift, 0.0).progress.contact[side], "it lifts anew"


def test_a_robot_that_does_not_stand_as_the_clip_begins_is_told_the_joint_and_both_places(
    steps: MotionClip,
) -> None:
    robot = load_robot("g1").robot()
    name, q = "right_elbow_joint", steps.configurations(robot)[0]
    i = 7 + robot.joint_index(name)
    for off, good in ((0.099, True), (-0.099, True), (0.101, False), (-0.3, False)):
        moved = q.copy()
        moved[i] += off
        robot.update(moved, np.zeros(robot.nv))
        if good:
            MotionSource(robot, steps, DT)
            continue
        with pytest.raises(InputError, match=name) as refusal:
            MotionSource(robot, steps, DT)
        assert f"{moved[i]:.3f} rad" in str(refusal.value) and f"{q[i]:.3f} rad" in str(refusal.value)


def test_a_clip_is_played_once_by_its_robot_with_its_period(steps: MotionClip) -> None:
    robots = [load_robot(name).robot() for name in ("g1", "g1", "hrp4_class")]
    robots[0].update(steps.configurations(robots[0])[0], np.zeros(robots[0].nv))
    source = MotionSource(robots[0], steps, DT)
    for robot, dt in ((robots[1], DT), (robots[2], DT), (robots[0], 0.004)):
        with pytest.raises(InputError, match="another one"):
            WalkingControl(robot, source, dt, tracking_settings())
    WalkingControl(robots[0], source, DT, tracking_settings())
    source.update(SimpleNamespace(time=DT, load=np.zeros(2)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="has had a control"):
        WalkingControl(robots[0].clone(), source, DT, tracking_settings())


def test_a_clip_is_placed_under_the_feet_of_a_robot(g1: Robot, steps: MotionClip) -> None:
    """Turned about the vertical and moved: its soles begin where those of the robot are."""
    own = BodyMotion.of(g1, steps.configurations(g1)[:2], steps.rate).soles[0]
    there = pin.SE3(pin.utils.rotate("z", 2.0), np.array([3.0, -1.0, 0.4]))
    clip = placed(steps, own, (there * own[0], there * own[1]))
    for frame in (0, 40):
        base, given = (pin.XYZQUATToSE3(each.base[frame]) for each in (clip, steps))
        assert base.isApprox(there * given, 1e-6)
    assert np.array_equal(clip.joints, steps.joints)
    back = placed(clip, (there * own[0], there * own[1]), own)
    np.testing.assert_allclose(back.base[:, :3], steps.base[:, :3], atol=1e-6)
    q = clip.configurations(g1)[0]
    robot = g1.clone()
    robot.update(q, np.zeros(robot.nv))
    source = MotionSource(robot, steps, DT)
    height = 0.5 * (own[0].translation[2] + own[1].translation[2]) + 0.4
    assert source.motion[0].pendulum.zmp[2] == pytest.approx(height, abs=1e-6)
    assert source.com_height <= robot.com[2] - height + 1e-9


@pytest.mark.slow
def test_arms_are_tracked_while_the_robot_stands(g1: Robot) -> None:
    """A second of a dance: fast arms are no disturbance."""
    clip = make_motion(g1, "dance", 1)
    short = make_feasible(g1, clip.sampled(clip.times[:100], clip.rate)).clip
    result = track_motion(short, TrackSpec(after=0.0))
    assert result.fall is None and result.failures == 0
    assert result.joint_rms < radians(1.0) and result.com_rms < 0.005 and result.foot_slide < 0.001


@pytest.mark.slow
def test_the_command_tracks_a_clip_that_is_feasible_as_it_is(
    g1: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, file = make_motion(g1, "squat", 1), str(tmp_path / "clip.npz")
    clip = make_feasible(g1, whole.sampled(whole.times[:80], whole.rate)).clip
    write_motion(clip, file)
    assert main(["motion", "track", file, "--after", "0", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["completed"] and found["failures"] == 0
    assert found["clip_seconds"] == pytest.approx(clip.duration)
    assert "stretched" not in found, "it was not changed"
    assert main(["motion", "track", file, "--robot", "talos"]) == 2
    assert "no joint 'left_hip_pitch_joint'" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
@pytest.mark.parametrize("name", ["one_leg", "steps"])
def test_motions_on_one_foot_and_with_steps_are_tracked(robot: str, name: str) -> None:
    model = load_robot(robot).robot()
    result = track_motion(make_feasible(model, make_motion(model, name, 2)).clip, TrackSpec(robot=robot))
    assert result.completed and result.failures == 0, result
    assert result.landings == {"one_leg": 1, "steps": 4}[name]
    assert result.worst_joint_rms < radians(3.0) and result.foot_slide < 0.005, result


@pytest.mark.slow
def test_a_dance_that_is_too_fast_for_the_joints_has_no_failed_tick() -> None:
    """0.8 rad at 1.5 Hz as it is given, beyond the speeds that the filter allows."""
    model = load_robot("hrp4_class").robot()
    clip = make_motion(model, "dance", 1)
    result = track_motion(clip, TrackSpec(robot="hrp4_class"))
    assert result.completed and result.failures == 0, result


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"mode": "torque"}, {"machine": Machine(force_sensors=False)}])
def test_feet_stand_still_while_arms_dance(g1: Robot, options: dict[str, Any]) -> None:
    """Seed 6 asks for the greatest yaw moment of twelve."""
    clip = make_feasible(g1, make_motion(g1, "dance", 6)).clip
    result = track_motion(clip, TrackSpec(**options))
    assert result.completed and result.failures == 0 and result.foot_slide < 0.003, result
