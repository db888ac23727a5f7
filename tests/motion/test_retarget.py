"""Motions of people: files of BVH and of positions, names of limbs, and clips of a robot that stands on its feet."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from fuzzing import mutate
from made_person import CMU, LAFAN1, Dialect, Joints, make_person, person, write_bvh
from scipy.spatial.transform import Rotation

from wbc import load_robot
from wbc.app.cli import main
from wbc.base.errors import InputError
from wbc.core.robot import Robot
from wbc.motion import SkeletonClip, make_feasible, read_motion, read_skeleton, retarget
from wbc.motion.files import shows_person
from wbc.motion.kinematics import BodyMotion
from wbc.motion.retarget import arms_of
from wbc.motion.skeleton import NAMES, limb_places
from wbc.sim import TrackSpec, track_motion

SLIDE, DEPTH = 1e-6, 1e-6
"""Greatest slide of feet that stand, m/s, and depth of their soles in the floor, m."""


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1").robot()


@pytest.fixture(scope="module")
def clip() -> SkeletonClip:
    return make_person()


# Files

SMALL = """HIERARCHY
ROOT Hips
{
  OFFSET 1 2 3
  CHANNELS 6 Zrotation Yrotation Xrotation Xposition Yposition Zposition
  JOINT Long name {
    OFFSET 0 10 0
    CHANNELS 1 Xrotation
    JOINT Tip
    {
      OFFSET 5 5 5
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 1 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.025
0 0 0  0 0 0  0  0 2 0  0 0 0
90 0 0  1 0 0  90  0 2 0  0 0 0
"""


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_positions_of_a_small_file_are_those_by_hand(tmp_path: Path) -> None:
    """Rotations before positions, one axis alone, six channels in every joint, braces on the line, an end site."""
    clip = read_skeleton(written(tmp_path / "small.bvh", SMALL), up="z")
    assert clip.joint_names == ("Hips", "Long name", "Tip", "Tip end") and clip.rate == 40.0
    np.testing.assert_allclose(clip.positions[0], [[0, 0, 0], [0, 10, 0], [0, 12, 0], [0, 13, 0]], atol=1e-12)
    # The root is turned about z, so y points to −x; the second joint about its own x, so its y points up.
    expected = [[1, 0, 0], [-9, 0, 0], [-9, 0, 2], [-9, 0, 3]]
    np.testing.assert_allclose(clip.positions[1], expected, atol=1e-12)
    # Positions stand in place of the offset. Up is y if nothing is said.
    turned = read_skeleton(tmp_path / "small.bvh").positions
    np.testing.assert_allclose(turned, np.roll(clip.positions, 1, axis=-1), atol=1e-12)


def test_positions_that_are_zero_below_the_root_leave_the_offset(tmp_path: Path) -> None:
    """Also where they are not quite zero, in one joint alone; positions that move take the place of the offset."""
    given = read_skeleton(
        written(tmp_path / "small.bvh", SMALL.replace("0 2 0  0 0 0", "5 5 5  0 0 0"))
    ).positions
    for zero in ("0 0 0  0 0 0", "1e-9 0 -1e-9  0 0 0"):
        text = SMALL.replace("0 2 0  0 0 0", zero)
        assert np.allclose(read_skeleton(written(tmp_path / "zero.bvh", text)).positions, given, atol=1e-8)
    moving = SMALL.replace("0  0 2 0", "0  0 0 0", 1)
    assert read_skeleton(written(tmp_path / "moving.bvh", moving), up="z").positions[0, 2, 1] == 10.0


@pytest.mark.parametrize(("dialect", "rate"), [(LAFAN1, 30.0), (CMU, 120.0)], ids=["lafan1", "cmu"])
def test_files_of_both_sources_become_the_same_person(tmp_path: Path, dialect: Dialect, rate: float) -> None:
    joints = {name: (place[:100], turn[:100]) for name, (place, turn) in person(rate).items()}
    write_bvh(tmp_path / "person.bvh", dialect, joints, rate)
    found = read_skeleton(tmp_path / "person.bvh")
    assert found.rate == pytest.approx(rate, rel=1e-4)
    limbs = found.limbs()
    assert set(limbs) == set(joints) - {"hips"}
    for name, places in limbs.items():
        np.testing.assert_allclose(dialect.unit * places, joints[name][0], atol=1e-5, err_msg=name)


def test_positions_by_name_are_read_in_any_axes(tmp_path: Path, clip: SkeletonClip) -> None:
    path, arrays = tmp_path / "person.npz", {"joint_names": clip.joint_names, "positions": clip.positions}
    np.savez(path, **arrays, fps=30.0)
    assert np.array_equal(read_skeleton(path).positions, clip.positions)
    np.savez(path, **arrays | {"positions": clip.positions[..., [1, 2, 0]]})
    assert np.array_equal(read_skeleton(path, up="y", rate=30.0).positions, clip.positions)
    with pytest.raises(InputError, match="does not say its rate"):
        read_skeleton(path)
    with pytest.raises(InputError, match="stand upright"):
        read_skeleton(path, rate=30.0).limbs()


def test_a_file_of_a_person_is_told_from_one_of_a_robot(tmp_path: Path) -> None:
    for name, arrays in (("person.npz", {"positions": np.zeros(3)}), ("robot.NPZ", {"joints": np.zeros(3)})):
        with (tmp_path / name).open("wb") as file:
            np.savez(file, **arrays)
        assert shows_person(tmp_path / name) == ("positions" in arrays)
    assert shows_person(tmp_path / "walk.BVH") and not shows_person(tmp_path / "walk.csv")


BAD = {
    "it has no ROOT": "HIERARCHY\n",
    "one ROOT, before all": "JOINT Hips",
    "no MOTION": SMALL.partition("MOTION")[0],
    "one ROOT": SMALL.replace("JOINT Tip", "ROOT Tip"),
    "outside the braces": SMALL.replace("MOTION", "JOINT Lost\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION"),
    "'Tip' are not closed": "\n".join(SMALL.split("\n")[:12]),
    "'}' is no word": SMALL.replace("MOTION", "}\nMOTION"),
    "'OFFSET' is no word of a hierarchy, or belongs": SMALL.replace("MOTION", "OFFSET 0 0 0\nMOTION"),
    "'Bones' is no word": SMALL.replace("CHANNELS 1", "Bones 1"),
    "a joint has no name": SMALL.replace("JOINT Tip", "JOINT"),
    "'Tip' must be three numbers": SMALL.replace("OFFSET 5 5 5", "OFFSET 5 5"),
    "'Tip' must be a number, got 'five'": SMALL.replace("OFFSET 5 5 5", "OFFSET 5 five 5"),
    "Xrotation of joint 'Long name' in frame 1 must be a number, got": SMALL.replace("90  0 2", "90,0  0 2"),
    "Frame Time must be a number, got '0,025'": SMALL.replace("0.025", "0,025"),
    "no joint has a channel": "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION\nFrames: 2\nFrame Time: 1\n",
    "'Tip' has no OFFSET": SMALL.replace("OFFSET 5 5 5", ""),
    "'Long name' has no CHANNELS": SMALL.replace("CHANNELS 1 Xrotation", ""),
    "says 2 channels, and names 1": SMALL.replace("CHANNELS 1", "CHANNELS 2"),
    "no channel 'Wrotation' of joint 'Long name'": SMALL.replace("CHANNELS 1 X", "CHANNELS 1 W"),
    "stands twice": SMALL.replace("Zrotation Yrotation Xrotation X", "Zrotation Zrotation Xrotation X"),
    "Frames: NUMBER": SMALL.replace("Frames: 2", "Frames: two"),
    "Frame Time must be 0.0001 to 1 s, got 0": SMALL.replace("0.025", "0"),
    "within ±1e+07, got nan": SMALL.replace("0.025", "nan"),
    "got -0.025": SMALL.replace("0.025", "-0.025"),
    "holds 2 frames of 13 numbers, and 0": SMALL.replace("Frames: 2", "Frames: 999999999"),
    "1 frames of 13 numbers, and 7 numbers more": SMALL[:-14],
    "after MOTION must stand": SMALL.replace("Frames: 2", "Frames: 1000000000000"),
    "Zrotation of joint 'Hips' in frame 1 must be within": SMALL.replace("\n90 ", "\nnan "),
    "Xposition of joint 'Hips' in frame 1 must be within": SMALL.replace("0  1 0 0  90", "0  1e300 0 0  90"),
    "2 to 1000000 frames, got 1": SMALL.replace("Frames: 2", "Frames: 1").rpartition("90 0 0")[0],
    "Zrotation of joint 'a' in frame 0 must be within": "ROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Zrotation\n}\nMOTION\n"
    "Frames: 2\nFrame Time: 0.01\n1e9\n1e9\n",
    "1000 joints at most": "HIERARCHY\nROOT a\n{\n" + "".join(f"JOINT b{i}\n{{\n" for i in range(1001)),
}  # fmt: skip
"""Words of the message → a file that is wrong."""


@pytest.mark.parametrize("said", BAD)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, said: str) -> None:
    path = written(tmp_path / "bad.bvh", BAD[said])
    with pytest.raises(InputError, match=r"bad\.bvh") as refused:
        read_skeleton(path)
    assert "\n" not in str(refused.value) and said in str(refused.value)


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    for seed in range(100):
        (tmp_path / "damaged.bvh").write_bytes(mutate(SMALL.encode(), seed))
        with contextlib.suppress(InputError):
            assert np.isfinite(read_skeleton(tmp_path / "damaged.bvh").positions).all()


@pytest.mark.parametrize("name", ["walk_poses.npz", "walk.npz"])
def test_arrays_of_another_kind_are_refused_with_what_is_needed(tmp_path: Path, name: str) -> None:
    model = (
        {"poses": np.zeros((5, 156)), "trans": np.zeros((5, 3))}
        if "poses" in name
        else {"dof_names": np.zeros(2)}
    )
    np.savez(tmp_path / name, **model)
    for read in (read_skeleton, read_motion):
        with pytest.raises(InputError) as refused:
            read(tmp_path / name)
        said = str(refused.value)
        assert all(word in said for word in model)
        assert ("joint_names, positions" if read is read_skeleton else "base and joints") in said


# Limbs

PARTS = [f"{side}_{part}" for part in NAMES for side in ("left", "right")]
SOURCES = {
    "LAFAN1": "{}UpLeg {}Leg {}Foot {}Toe {}Arm {}ForeArm {}Hand; {}Shoulder Hips {}Toe_end",
    "CMU": "{}UpLeg {}Leg {}Foot {}ToeBase {}Arm {}ForeArm {}Hand; {0}HipJoint {}Shoulder {}HandIndex1 {0}Thumb",
    "Mixamo": "m:{}UpLeg m:{}Leg m:{}Foot m:{}ToeBase m:{}Arm m:{}ForeArm m:{}Hand; m:{}Shoulder m:{}HandIndex1",
    "SMPL": "{}_hip {}_knee {}_ankle {}_foot {}_shoulder {}_elbow {}_wrist; {}_collar {}_hand pelvis",
    "MediaPipe": "{}_hip {}_knee {}_ankle {}_foot_index {}_shoulder {}_elbow {}_wrist; {}_heel {}_index nose",
    "3ds Max": "Bip01_{0}_Thigh Bip01_{0}_Calf Bip01_{0}_Foot Bip01_{0}_Toe0 Bip01_{0}_UpperArm Bip01_{0}_Forearm "
    "Bip01_{0}_Hand; Bip01_{0}_Clavicle Bip01_{0}_Finger0",
    "Unreal": "thigh_{1} calf_{1} foot_{1} ball_{1} upperarm_{1} lowerarm_{1} hand_{1}; clavicle_{1} thigh_twist_{1}",
    "classic": "{}Hip {}Knee {}Ankle {}Toe {}Shoulder {}Elbow {}Wrist; {}Collar Chest Neck",
}  # fmt: skip
"""Source → names of the limbs' joints in the order of `NAMES`, then others; with a side, {0} its letter."""


@pytest.mark.parametrize("source", SOURCES)
def test_limbs_are_known_by_the_names_of_the_field(source: str) -> None:
    wanted, others = (part.split() for part in SOURCES[source].split(";"))

    def named(name: str, side: str) -> str:
        side = side if "{}_" in name else side.capitalize()
        return name.replace("{}", side).format(side[0].upper(), side[0].lower())

    sides = ("left", "right")
    names = tuple(dict.fromkeys(named(name, side) for side in sides for name in (*others, *wanted)))
    places = limb_places(names, {})
    found = [names[places[part]] for part in PARTS if not (source == "3ds Max" and "toe" in part)]
    expected = [named(name, side) for name in wanted for side in sides]
    assert found == [name for name in expected if not name.endswith("Toe0")]


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        ({}, "no joint is known as left_knee among"),
        ({"left_knee": "Patella"}, None),
        ({"left_knee": "patella"}, "did you mean 'Patella'"),
        ({"left_kneecap": "Patella"}, "did you mean 'left_knee'"),
    ],
)
def test_a_joint_of_another_name_is_given(
    clip: SkeletonClip, joints: dict[str, str], said: str | None
) -> None:
    names = tuple("Patella" if name == "left_knee" else name for name in clip.joint_names)
    if said is None:
        assert limb_places(names, joints)["left_knee"] == names.index("Patella")
        return
    with pytest.raises(InputError, match=said):
        replace(clip, joint_names=names).limbs(joints)


def test_names_that_occur_twice_are_no_names_of_limbs(clip: SkeletonClip) -> None:
    spare = clip.positions[:, :1]

    def named(*more: str) -> SkeletonClip:
        positions = np.concatenate([clip.positions, *(spare for _ in more)], axis=1)
        return replace(clip, joint_names=(*clip.joint_names, *more), positions=positions)

    for part, places in named("Tip", "Tip").limbs().items():
        assert np.array_equal(places, clip.limbs()[part])
    for joints in ({}, {"left_knee": "left_knee"}):
        with pytest.raises(
            InputError, match="left_knee must be one joint, but 2 have the name 'left_knee': rename"
        ):
            named("left_knee").limbs(joints)


def test_a_mirrored_person_is_refused(clip: SkeletonClip) -> None:
    """Names exchanged, of all limbs, arms or legs alone, or one axis turned."""
    swapped = {"left": "right", "right": "left"}

    def renamed(*kinds: str) -> SkeletonClip:
        names = [
            f"{swapped[name.partition('_')[0]]}_{name.partition('_')[2]}" if name.endswith(kinds) else name
            for name in clip.joint_names
        ]
        return replace(clip, joint_names=tuple(names))

    arms, legs = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toe")
    mirrored = [renamed(*arms), renamed(*legs), renamed(*arms, *legs)]
    mirrored += [replace(clip, positions=clip.positions * signs) for signs in ((1, -1, 1), (-1, 1, 1))]
    assert clip.limbs()
    for each in mirrored:
        with pytest.raises(InputError, match="is mirrored"):
            each.limbs()


def test_people_that_cannot_be_are_refused(clip: SkeletonClip, g1: Robot) -> None:
    def moved(name: str, places: object) -> SkeletonClip:
        positions = clip.positions.copy()
        positions[:, clip.joint_names.index(name)] = places
        return replace(clip, positions=positions)

    knee = clip.limbs()["left_knee"]
    up = np.zeros(len(clip))
    up[100:130] = 0.3
    jump = replace(clip, positions=clip.positions + up[:, None, None] * (0.0, 0.0, 1.0))
    posed = clip.positions.copy()
    posed[0] += [1.0, 0.0, 0.0]  # a pose before the motion, somewhere else
    for bad, said in (
        (lambda: replace(clip, positions=posed), "1.2 times .* from frame 0 to the next one.*: part.0.03333"),
        (lambda: moved("left_ankle", knee), "left_knee and left_ankle of 'made' must lie apart"),
        (lambda: moved("right_hip", clip.limbs()["left_hip"]), "left_hip and right_hip"),
        (lambda: moved("left_wrist", np.nan), "must be finite, got nan in frame 0 .0.000 s., column 'left_wrist "),
        (lambda: replace(clip, positions=clip.positions * [1.0, 1.0, -1.0]), "upright in the first frame"),
        (lambda: replace(clip, positions=clip.positions[:, :3]), "must have shape"),
        (lambda: replace(clip, positions=clip.positions.astype(str)), "real numbers"),
        (lambda: replace(clip, joint_names=("a",) * len(clip.joint_names)), "no joint is known as"),
        (lambda: replace(clip, rate=0.0), "rate"),
        (lambda: clip.part(3.0, 2.0), "begin and end within 0 to 15"),
        (lambda: clip.part(-1.0), "begin and end"),
        (lambda: clip.part(0.0, 1e308), "begin and end"),
        (lambda: jump, "no sole stands from 3.* s to 4"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            retarget(bad(), g1)


# Clips of robots


@pytest.mark.parametrize(("name", "spread"), [("hrp4_class", 1e-9), ("g1", 0.08), ("talos", 0.08)])
def test_a_shoulder_is_the_centre_of_where_the_elbow_goes(name: str, spread: float) -> None:
    """The elbow stays at one distance from it: exactly where the axes of the shoulder meet in a point."""
    robot = load_robot(name).robot()
    chain = robot.joints_between(robot.frames["left_hand"], robot.torso_frame)
    arm, number = arms_of(robot)[0], robot.joint_numbers[chain[3]]
    random, q = np.random.default_rng(7), robot.half_sitting.copy()
    for _ in range(20):
        q[[7 + joint for joint in chain[:3]]] = random.uniform(-0.5, 0.5, 3)
        robot.update(q, np.zeros(robot.nv))
        elbow = robot.placement(arm.trunk).actInv(robot.data.oMi[number].translation)
        assert np.linalg.norm(elbow - arm.shoulder) == pytest.approx(arm.upper, rel=spread)
    assert np.allclose(robot.placement(arm.elbow).translation, robot.data.oMi[number].translation)


def squat(rate: float = 30.0, noise: float = 1.0) -> SkeletonClip:
    """Return the first bend of the person."""
    return make_person(rate, noise=noise).part(0.8, 1.8)


def test_feet_that_slide_float_and_tremble_stand_on_the_floor(g1: Robot) -> None:
    given = squat()
    ankles = [given.limbs()[f"{side}_ankle"] for side in ("left", "right")]
    assert min(np.ptp(ankle, axis=0).max() for ankle in ankles) > 2e-3, "the person's feet are not at rest"
    result = retarget(given, g1)
    assert result.clip.standing is not None and result.clip.standing.all()
    assert result.measures.slide_speed < SLIDE and result.measures.sole_depth < DEPTH
    assert not result.measures.joint_excess
    assert all(error < 0.02 for name, error in result.errors.items() if "hand" in name or "elbow" in name)
    assert result.errors["pelvis"] < 0.02 and result.errors["trunk"] < 0.1
    # The pelvis goes down as far as the ratio of the legs says.
    fall = np.ptp(result.clip.base[:, 2])
    hips = 0.5 * (given.limbs()["left_hip"] + given.limbs()["right_hip"])[:, 2]
    assert fall == pytest.approx(result.scale * np.ptp(hips), abs=0.03)


def test_neither_the_unit_nor_the_place_nor_the_heading_of_a_person_matters(g1: Robot) -> None:
    given = squat().part(0.0, 0.3)
    turn = Rotation.from_euler("z", 2.0)
    away = turn.apply((39.37 * given.positions).reshape(-1, 3)).reshape(given.positions.shape)
    far = retarget(replace(given, positions=away + [500.0, -70.0, 33.0]), g1)
    near = retarget(given, g1)
    assert near.scale == pytest.approx(39.37 * far.scale, rel=1e-9)
    np.testing.assert_allclose(far.clip.joints, near.clip.joints, atol=1e-3)
    np.testing.assert_allclose(far.clip.base[:, 2], near.clip.base[:, 2], atol=1e-4)


@pytest.mark.parametrize("missing", [("left_toe",), ("left_toe", "right_toe")])
def test_toes_may_be_missing(g1: Robot, missing: tuple[str, ...]) -> None:
    given = squat().part(0.0, 0.2)
    kept = [i for i, name in enumerate(given.joint_names) if name not in missing]
    names = tuple(given.joint_names[i] for i in kept)
    result = retarget(replace(given, joint_names=names, positions=given.positions[:, kept]), g1)
    assert result.measures.slide_speed < SLIDE and result.measures.sole_depth < DEPTH


def test_limbs_of_the_robot_point_where_those_of_the_person_point(g1: Robot) -> None:
    """Arms that are raised to the side, at any length of the limbs."""
    given = make_person(noise=0.0).part(4.4, 4.6)
    result = retarget(given, g1)
    robot = g1.clone()
    robot.update(result.clip.configurations(robot)[3], np.zeros(robot.nv))
    limbs = given.limbs()
    chain = robot.joints_between(robot.frames["left_hand"], robot.torso_frame)
    elbow = robot.data.oMi[robot.joint_numbers[chain[3]]].translation
    shoulder = robot.data.oMi[robot.joint_numbers[chain[1]]].translation
    hand = robot.placement(robot.frames["left_hand"]).translation
    for ours, theirs in (
        (elbow - shoulder, limbs["left_elbow"][3] - limbs["left_shoulder"][3]),
        (hand - elbow, limbs["left_wrist"][3] - limbs["left_elbow"][3]),
    ):
        cosine = ours @ theirs / np.linalg.norm(ours) / np.linalg.norm(theirs)
        assert np.degrees(np.arccos(cosine)) < 12.0


def test_a_step_of_a_person_is_a_step_of_the_robot() -> None:
    """Half a step of 0.15 m with the left foot, turned out by 0.12 rad; its heel rises first, then its toes."""
    robot, begin = load_robot("hrp4_class").robot(), 8.7
    result = retarget(make_person(noise=0.0).part(begin, 9.8), robot)
    made = BodyMotion.of(robot, result.clip.configurations(robot), result.clip.rate)
    air = np.clip((begin + result.clip.times - 9.0) / 0.6, 0.0, 1.0)
    standing = result.clip.standing
    assert standing is not None and standing[:, 1].all()
    assert (
        standing[(air == 0.0) | (air == 1.0), 0].all() and not standing[(air > 0.15) & (air < 0.9), 0].any()
    )
    left = [soles[0] for soles in made.soles]
    ankle = left[0].act(np.array(load_robot("hrp4_class").ankle("left_foot")))
    np.testing.assert_allclose(ankle[:2], [0.0, 0.09 * result.scale], atol=2e-3)
    fast = retarget(make_person(rate=120.0, noise=0.0).part(begin, begin + 0.1), robot).clip
    assert fast.rate == 60.0 and fast.duration == pytest.approx(0.1)
    way = left[-1].translation - left[0].translation
    np.testing.assert_allclose(way, [0.15 * result.scale, 0.0, 0.0], atol=1e-3)
    places = np.array([soles[1].translation for soles in made.soles])
    np.testing.assert_allclose(places, np.broadcast_to(places[0], places.shape), atol=1e-5)
    for sole in left:
        assert np.arctan2(sole.rotation[1, 0], sole.rotation[0, 0]) == pytest.approx(0.12, abs=0.01)
    high = (air > 0.5) & (air < 0.67)
    pitch = np.array([-np.arcsin(sole.rotation[2, 0]) for sole in left])
    np.testing.assert_allclose(pitch[high], 0.5 * np.sin(2.0 * np.pi * air[high]), atol=0.1)
    assert pitch.max() > 0.1 and pitch.min() < -0.3
    assert max(sole.translation[2] for sole in left) == pytest.approx(0.1 * result.scale, abs=0.02)
    legs, hips = (
        made.com[:, 1] - made.com[0, 1],
        0.7 * 0.09 * result.scale,
    )  # the weight goes to the right foot
    assert -1.2 * hips < legs.min() < -0.5 * hips


@pytest.mark.slow
def test_a_foot_stands_when_that_of_the_person_does(g1: Robot, clip: SkeletonClip) -> None:
    """Contacts of the clip against those of the rule that made it: two lifts of each foot, and one more."""
    result = retarget(clip, g1)
    standing = result.clip.standing
    assert standing is not None
    true = make_person(noise=0.0).limbs()
    for side, name in enumerate(("left", "right")):
        up = true[f"{name}_ankle"][:, 2] > 0.091
        lifts = np.flatnonzero(np.diff(up.astype(int)) == 1)
        assert len(lifts) == 2 + side
        assert np.mean(standing[:, side] == ~up) > 0.95
        for lift in lifts:
            assert not standing[lift + 6 : lift + 10, side].any(), "in the middle of a step"
    assert result.measures.slide_speed < SLIDE and result.measures.sole_depth < DEPTH
    assert not result.measures.joint_excess and result.shortened < 0.01


@pytest.mark.slow
def test_the_command_retargets_a_file_of_a_person(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    joints: Joints = person(30.0)
    write_bvh(tmp_path / "person.bvh", LAFAN1, joints, 30.0)
    file = str(tmp_path / "person.bvh")
    assert main(["motion", "check", file, "--end", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["slide_speed"] < SLIDE and found["sole_depth"] < DEPTH and not found["joint_excess"]
    for words, said in (
        (["--up", "x"], "upright"),
        (["--begin", "20"], "begin and end within 0 to 15"),
        (["--joint", "left_knee"], "such as left_knee=LKnee"),
        (["--joint", "left_knee=Knee"], "Knee"),
        (["--rate", "60"], "another rate"),
    ):
        assert main(["motion", "check", file, *words]) == 2
        assert said in capsys.readouterr().err, words


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", ["g1", "hrp4_class", "talos"])
def test_the_motion_of_a_person_is_tracked_in_torque_control(name: str, clip: SkeletonClip) -> None:
    """Squat, arms, weight on one foot, four steps: feasible feet do not slide, and the robot stands at the end."""
    robot = load_robot(name).robot()
    feasible = make_feasible(robot, retarget(clip, robot).clip)
    assert feasible.after.feasible, feasible.after
    assert feasible.after.slide_speed < 0.002 and feasible.after.sole_depth < DEPTH
    result = track_motion(feasible.clip, TrackSpec(robot=name, mode="torque"))
    assert result.completed and result.failures == 0 and result.landings >= 5, result
    assert result.worst_joint_rms < radians(3.0) and result.foot_slide < 0.005, result
