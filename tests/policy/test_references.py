"""Motions that a policy tracks, and the ground that it sees."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_policies import DT, G1, LEGS, Known, control, described, ticks, write_tracker

import wbc
from wbc.base.errors import InputError, WbcError
from wbc.ground import KnownGround
from wbc.ground.cloud import ElevationMap
from wbc.motion import MotionClip
from wbc.policy import HeightScan, OnnxNetwork, PolicyControl, PolicyDescription, Term
from wbc.policy.references import ClipFrame, Frames, ScannedGround

pytest.importorskip("onnxruntime")

N = len(LEGS)
MOTION = (Term("motion_joints"), Term("motion_orientation"), Term("motion_position"))
COLUMNS = [G1.joint_names.index(joint) for joint in LEGS]


def swaying(seconds: float = 1.0, rate: float = 50.0) -> tuple[MotionClip, np.ndarray]:
    """Return a clip in which the robot turns, goes on, and bends its waist and knees, and its configurations."""
    robot = G1.robot()
    times = np.arange(round(rate * seconds) + 1) / rate
    q = np.tile(robot.half_sitting, (len(times), 1))
    q[:, 0], q[:, 1] = 3.0 + 0.4 * times, -1.0 + 0.1 * times
    q[:, 3:7] = [pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 0.7 + 0.3 * t)).coeffs() for t in times]
    for name, size in (("left_knee_joint", 0.2), ("waist_yaw_joint", 0.3), ("waist_pitch_joint", 0.2)):
        q[:, 7 + G1.joint_names.index(name)] += size * np.sin(2.0 * np.pi * times)
    return MotionClip.of(robot, q, rate), q


def anchor_of(q: np.ndarray) -> pin.SE3:
    robot = G1.robot()
    robot.update(q, np.zeros(robot.nv))
    return robot.placement("torso_link").copy()


def test_a_policy_sees_its_clip_turned_to_where_it_stands() -> None:
    clip, q = swaying()
    network = Known(2 * N + 9, N)
    default = G1.robot().half_sitting[7:][COLUMNS].tolist()
    plant, policy = control(
        network, described(observation=MOTION, anchor="torso_link", default=default), clip=clip
    )
    robot = policy.drives.observer.robot
    begin, seen = None, 0
    for tick in ticks(0.6):
        command = policy.command(plant.measure())
        if policy.acted:
            k = tick // len(ticks(0.02))
            here, there = robot.placement("torso_link").copy(), anchor_of(q[min(k, 50)])
            begin = begin or (here, there)
            # Both turned and shifted on the ground to where each of them began.
            level = []
            for first, now in zip(begin, (here, there), strict=True):
                yaw = math.atan2(first.rotation[1, 0], first.rotation[0, 0])
                place = first.translation.copy()
                place[2] = 0.0
                level.append(pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), place).actInv(now))
            relative, shown = level[0].actInv(level[1]), network.seen[-1]
            np.testing.assert_allclose(shown[:N], q[min(k, 50), 7:][COLUMNS], atol=1e-5)
            np.testing.assert_allclose(shown[2 * N : 2 * N + 6], relative.rotation[:, :2].ravel(), atol=1e-5)
            np.testing.assert_allclose(shown[2 * N + 6 :], relative.translation, atol=1e-5)
            if 0 < k < 50:
                rate = (q[k + 1, 7:] - q[k - 1, 7:])[COLUMNS] * 25.0
                np.testing.assert_allclose(shown[N : 2 * N], rate, atol=1e-3)
            seen += 1
        plant.step(command)
    assert seen == 30


def test_a_motion_waits_and_begins_anew() -> None:
    clip, _ = swaying(seconds=0.1)
    network = Known(2 * N, N)
    plant, policy = control(network, described(observation=MOTION[:1]), clip=clip)
    policy.motion.playing = False
    for _ in ticks(0.1):
        plant.step(policy.command(plant.measure()))
    assert policy.motion.step == 0 and np.ptp(network.seen, axis=0).max() == 0.0
    policy.motion.playing = True
    for _ in ticks(0.2):  # beyond the end, where the last frame stays
        plant.step(policy.command(plant.measure()))
    assert policy.motion.step == 10
    np.testing.assert_allclose(network.seen[-1][:N], clip.joints[-1][COLUMNS], atol=1e-6)
    policy.reset()
    policy.command(plant.measure())
    np.testing.assert_allclose(network.seen[-1][:N], clip.joints[0][COLUMNS], atol=1e-6)


@pytest.mark.parametrize("several", [False, True])
def test_a_network_holds_a_motion_as_one_body_or_as_several(several: bool, tmp_path: Path) -> None:
    """The files of holosoma state one body with a quaternion xyzw, those of whole_body_tracking many, wxyz."""
    random = np.random.default_rng(0)
    table: dict[str, np.ndarray] = {name: random.normal(size=(5, N)) for name in ("joint_pos", "joint_vel")}
    quaternions = random.normal(size=(5, 2, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    places = random.normal(size=(5, 2, 3))
    if several:
        table |= {"body_pos_w": places, "body_quat_w": np.roll(quaternions, 1, axis=2)}
    else:
        table |= {"ref_pos_xyz": places[:, 1], "ref_quat_xyzw": quaternions[:, 1]}
    about = {
        "joint_names": ",".join(LEGS),
        "joint_stiffness": json.dumps([40.0] * N),
        "joint_damping": json.dumps([2.0] * N),
        "default_joint_pos": json.dumps([0.0] * N),
        "action_scale": "0.25",
        "anchor_body_name": "torso_link",
        "command_names": "motion",
        "observation_names": "command,motion_anchor_ori_b,actions",
    } | ({"body_names": "pelvis,torso_link"} if several else {})
    file = write_tracker(tmp_path / "dance.onnx", table, 3 * N + 6, **about)
    description = PolicyDescription.of(file)
    assert [term.name for term in description.observation] == [
        "motion_joints",
        "motion_orientation",
        "last_action",
    ]
    policy = PolicyControl(G1.robot(), file, DT)
    plant = wbc.Plant(G1, control_period=DT, noise="none", visuals=False)
    for tick in ticks(0.14):
        plant.step(policy.command(plant.measure()))
        if policy.acted:
            k = min(tick // len(ticks(0.02)), 4)
            frame = policy.motion.frame
            np.testing.assert_allclose(frame.position, table["joint_pos"][k], atol=1e-6)
            np.testing.assert_allclose(frame.velocity, table["joint_vel"][k], atol=1e-6)
            np.testing.assert_allclose(frame.anchor.translation, places[k, 1], atol=1e-6)
            rotation = pin.Quaternion(quaternions[k, 1]).matrix()
            np.testing.assert_allclose(frame.anchor.rotation, rotation, atol=1e-6)
            np.testing.assert_allclose(policy._period.observation[:N], table["joint_pos"][k], atol=1e-6)
    del table["joint_vel"]
    with pytest.raises(InputError, match="joint_vel"):
        OnnxNetwork(write_tracker(tmp_path / "half.onnx", table, 3 * N + 6))
    with pytest.raises(WbcError, match="anchor|body|frame"):
        PolicyControl(G1.robot(), file, DT, description=_anchored(description, "left_gripper"))


def test_a_network_of_ones_own_holds_a_motion_and_is_doubted() -> None:
    """Its actions are the frames that it is asked for: the policy sees the frame of each action."""

    class Held(Known):
        took = 0.05

        def act(self, observation: np.ndarray, step: int) -> np.ndarray:
            self(observation)
            return np.full(N, 0.01 * step, np.float32)

        def motion(self, anchor: str) -> Frames:
            place = anchor_of(G1.robot().half_sitting)
            return lambda step: ClipFrame(np.full(N, 0.01 * step), np.zeros(N), place)

    network = Held(2 * N + 9, N)
    plant, policy = control(network, described(observation=MOTION, anchor="torso_link"))
    assert any("50.0 ms" in doubt for doubt in policy.doubts())
    for _ in ticks(0.09):
        plant.step(policy.command(plant.measure()))
    np.testing.assert_allclose(np.array(network.seen)[:, 0], 0.01 * np.arange(5))
    np.testing.assert_allclose(policy.observed.action, 0.04)


def _anchored(description: PolicyDescription, anchor: str) -> PolicyDescription:
    values = {name: getattr(description, name) for name in ("joints", "default", "kp", "kd", "observation")}
    return PolicyDescription(**values, anchor=anchor)


def test_a_policy_sees_the_heights_of_the_ground_about_it() -> None:
    """A ramp to the left: rows of points from right to left fall, each is level along itself."""
    scan = HeightScan(length=0.4, width=0.2, resolution=0.1, offset=0.3)
    network = Known(15, N)
    robot = G1.robot()
    ground = KnownGround(robot)
    plant = wbc.Plant(G1, control_period=DT, noise="none", visuals=False)
    policy = PolicyControl(
        robot, network, DT, description=described(observation=[Term("height_scan")], scan=scan), ground=ground
    )
    policy.command(plant.measure())
    height = float(policy.drives.observer.robot.placement("pelvis").translation[2])
    np.testing.assert_allclose(network.seen[-1], height - 0.3, atol=2e-3)  # nothing is known yet: level
    y = np.arange(-50, 51) * 0.02
    heights = np.tile(0.2 * y, (101, 1))
    policy.see(ElevationMap(heights, 0.02, (-1.01, -1.01, 0.0)))
    for _ in ticks(0.02):
        plant.step(policy.command(plant.measure()))
    _, aside, z = policy.drives.observer.robot.placement("pelvis").translation
    expected = z - 0.3 - 0.2 * (aside + np.array([-0.1, 0.0, 0.1]))
    np.testing.assert_allclose(network.seen[-1].reshape(3, 5), np.tile(expected[:, None], 5), atol=5e-3)


@pytest.mark.parametrize(
    ("terms", "options", "named"),
    [
        ([Term("motion_joints")], {}, "clip"),
        ([Term("height_scan")], {}, "ground"),
        ([Term("gravity")], {"clip": swaying()[0]}, "motion"),
        ([Term("gravity")], {"ground": KnownGround(G1.robot())}, "ground"),
        ([Term("height_scan")], {"ground": KnownGround(G1.robot()), "frame": "tail"}, "tail"),
    ],
)
def test_motions_and_grounds_that_lack_or_that_nothing_sees_are_refused(
    terms: list[Term], options: dict[str, Any], named: str
) -> None:
    frame = options.pop("frame", None)
    with pytest.raises(WbcError, match=named):
        control(Known(3, N), described(observation=terms, scan=HeightScan(frame=frame)), **options)


def test_points_of_a_height_scan_are_about_the_robot_and_turn_with_its_heading() -> None:
    """A pelvis at (1, 2), turned by a quarter to the left: what is ahead of it is further to the left in the world."""
    robot, asked = G1.robot(), []

    class Slope:
        def at(self, points: np.ndarray) -> tuple[np.ndarray, None]:
            asked.append(points)
            return 0.1 * points.real + 0.01 * points.imag, None

    q = np.array(robot.half_sitting)
    q[:2], q[3:7] = (1.0, 2.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    robot.update(q, np.zeros(robot.nv))
    scan = ScannedGround(robot, HeightScan(length=0.2, width=0.2, resolution=0.1, offset=0.5), Slope())  # type: ignore[arg-type]
    seen = scan()
    place = robot.placement(robot.base_frame).translation
    grid = np.array([complex(x, y) for y in (-0.1, 0.0, 0.1) for x in (-0.1, 0.0, 0.1)])
    world = complex(place[0], place[1]) + 1j * grid
    np.testing.assert_allclose(asked[0], world, atol=1e-12)
    np.testing.assert_allclose(seen, place[2] - 0.5 - 0.1 * world.real - 0.01 * world.imag, atol=1e-12)


def test_the_quaternion_of_a_motion_in_a_network_is_of_length_one() -> None:
    network = OnnxNetwork.__new__(OnnxNetwork)
    parts = [np.zeros((1, 2)), np.zeros((1, 2)), np.ones((1, 3)), np.array([[0.0, 0.0, 3.0, 4.0]])]
    network._frame, network.inputs, network._run = ["all"], 3, lambda *_: parts  # type: ignore[method-assign]
    network.holds_motion, network.metadata = True, {}
    frames = network.motion("pelvis")
    assert frames is not None
    np.testing.assert_allclose(frames(0).anchor.rotation[:2, 0], [1.0 - 2.0 * 0.6**2, 2.0 * 0.6 * 0.8])
