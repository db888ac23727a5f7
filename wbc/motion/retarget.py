"""Retargeting: the motion of a person becomes a clip of a robot, by the positions of the person's joints.

    person  →  scaled by the legs, floor at z = 0  →  feet that stand  →  footsteps within reach
            →  targets of pelvis, trunk, elbows and hands  →  inverse kinematics with the feet as contacts  →  clip

Positions alone are read: no rest pose and no axes of the skeleton's joints are needed, so that a file of another origin
needs no table of its own. Lengths are those of the robot, directions those of the person: the legs give the scale of
the whole, and an upper arm or a forearm points where that of the person points.

The floor is where ankles and toes are at rest. A foot stands while its ankle or its toes are; it then is a contact,
flat on the floor, at one place. What the person's foot slides, floats or sinks is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.limits.joint import JointLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.robot import SIDES, Robot
from wbc.motion.clip import MotionClip
from wbc.motion.contacts import always_standing, touching
from wbc.motion.footsteps import footsteps
from wbc.motion.inverse_kinematics import SMALL, searching
from wbc.motion.kinematics import BodyMotion, Soles, arm_joints
from wbc.motion.measures import MotionMeasures, measure
from wbc.motion.skeleton import SkeletonClip
from wbc.tasks import OrientationTask, PoseTask, PositionTask, PostureTask
from wbc.walking.plans.leg import Leg

FASTEST = 60.0
"""Most frames per second that are solved for, Hz: of a faster clip every second frame is used, or every third …"""

SMOOTHING = 0.03
"""Standard deviation with which the positions of a person are smoothed, s: markers are noisy."""

STRETCH = 0.96
"""Ratio of its length to which a robot's leg is stretched where that of the person is straight."""

BENT = 0.5
"""Share of the trunk's tilt that the pelvis has; the waist has the rest, where the robot has such joints."""

# Weights per squared error: feet come first, then pelvis, arms and trunk; joints are for what the positions of a person
# leave open.

SWING = 1e3
"""Weight of the pose of a foot in the air, 1/m² and 1/rad²."""

PELVIS = 1e2
"""Weight of the place of the pelvis, 1/m²."""

ARM = 30.0
"""Weight of the places of elbow and hand, 1/m²."""

TRUNK = 3.0
"""Weight of the rotation of the trunk, 1/rad²."""

TILT = 1.0
"""Weight of the rotation of the pelvis, 1/rad²."""

JOINTS = 0.01
"""Weight of the joints outside the legs, 1/rad²."""

LEGS = 1e-4
"""Weight of the joints of the legs, 1/rad²."""

MARGIN = 0.05
"""Distance to the joint limits, rad."""

ITERATIONS = 30
"""Most steps of a frame."""

FIRST = 200
"""Most steps of the first frame."""

ON_END = 0.3
"""Level share of a person's foot up to which its toe says nothing of its heading; from twice as much on it says all."""

TIPPED = 0.8
"""Greatest sine of the pitch of a foot."""

JUMP = 12.0
"""Greatest speed of the hips, in lengths of the legs per second: beyond it, frames of two motions follow each other."""

SAMPLES = 200
"""Postures of a limb from which the centre of its shoulder or hip is found."""

ROUND = 0.1
"""Greatest distance of the elbow from the sphere about the shoulder, as a share of the upper arm."""


@dataclass(frozen=True, slots=True, eq=False)
class RetargetedMotion:
    """Result of retargeting.

    Attributes:
        clip: The clip of the robot, with the soles that stand in each frame.
        scale: Length of the robot's legs over that of the person's, m per unit of the person's clip.
        measures: Measures of the clip: limits, slide of the feet, penetration and more. Balance and speeds are those of
            the person: `make_feasible` makes them those of the robot.
        errors: Target, such as "left_hand" → root mean square of its error over the clip, m; of "trunk" and "pelvis
            rotation" in rad.
        shortened: Greatest distance by which a step was brought within reach of the robot, m.
    """

    clip: MotionClip
    scale: float
    measures: MotionMeasures
    errors: Mapping[str, float]
    shortened: float


@checked
def retarget(
    clip: SkeletonClip, robot: Robot, *, joints: Mapping[str, str] | None = None
) -> RetargetedMotion:
    """Retarget the motion of a person to a robot.

        person = read_skeleton("walk1_subject1.bvh").part(10.0, 20.0)
        result = make_feasible(robot, retarget(person, robot).clip)

    Args:
        clip: Clip of the person; it must have legs, shoulders and arms.
        robot: The robot, with two soles; its state is not changed. For a robot without hands only legs and trunk move.
        joints: Joint of a limb, such as "left_knee" → its name in the clip, for joints with unusual names.

    Raises:
        InputError: The robot has no feet, a joint of a limb is missing, a limb has no length, or the person does not
            stand upright in the first frame, or jumps from one place to another. The person leaves the ground for
            longer than 0.08 s; the time is named.
    """
    robot.needs_feet("the motion of a person")
    step = max(1, math.ceil(clip.rate / FASTEST - 1e-9))
    if len(clip) // step < 2:
        raise InputError(f"a clip at {clip.rate:g} Hz must have {2 * step} frames at least, got {len(clip)}")
    rate = clip.rate / step
    given = clip.limbs(joints)
    _refuse_jumps(clip, given)
    parts = {
        name: gaussian_filter1d(places, SMOOTHING * clip.rate, axis=0, mode="nearest")[::step]
        for name, places in given.items()
    }
    legs = _Legs.of(robot)
    parts, scale, lift, standing = _on_floor(legs, parts, rate)
    soles = _soles(robot, parts, lift)
    com_height = parts["hips"][:, 2] - legs.hips_over_com
    paths, moves, shortened = footsteps(robot, soles, com_height, rate, standing)
    q, errors = _follow(robot, legs, parts, paths, moves, standing)
    motion = BodyMotion.of(robot, q, rate)
    return RetargetedMotion(
        clip=MotionClip.of(robot, q, rate, clip.name, standing),
        scale=scale,
        measures=measure(robot, motion, standing, share=1.0, friction=0.7),
        errors=errors,
        shortened=shortened,
    )


def _refuse_jumps(clip: SkeletonClip, parts: Mapping[str, Array]) -> None:
    hips = 0.5 * (parts["left_hip"] + parts["right_hip"])
    speed = np.linalg.norm(np.diff(hips, axis=0), axis=1) * clip.rate / _leg_length(parts, "left")
    frame = int(speed.argmax())
    if speed[frame] > JUMP:
        raise InputError(
            f"the person of '{clip.name}' jumps {speed[frame] / clip.rate:.2g} times the length of the legs from frame "
            f"{frame} to the next one; if a pose stands there that is no part of the motion, as in files of CMU, leave "
            f"it out: part({(frame + 1) / clip.rate:.4g})"
        )


def _leg_length(parts: Mapping[str, Array], side: str) -> float:
    """Return the length of a person's thigh and shank together, the median over the clip, m."""
    return sum(
        float(np.median(np.linalg.norm(parts[f"{side}_{upper}"] - parts[f"{side}_{lower}"], axis=1)))
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Legs:
    """Legs of the robot as two bars each.

    Attributes:
        hips: Place half way between the centres of both hips, in the axes of the base, shape (3,), m.
        length: Length of thigh and shank together, m.
        ankle_height: Height of the ankle over the sole, m.
        hips_over_com: Height of the hips over the CoM in half-sitting, m.
    """

    hips: Array
    length: float
    ankle_height: float
    hips_over_com: float

    @staticmethod
    def of(robot: Robot) -> _Legs:
        """Find the legs of a robot."""
        leg, joints = Leg(robot), robot.joints_between(robot.soles[0].frame, robot.base_frame)
        above = joints[: joints.index(leg.knee)]
        hip, thigh, _ = centre_of_turning(robot, robot.base_frame, robot.joint_numbers[leg.knee], above)
        data = robot.model.createData()
        pin.centerOfMass(robot.model, data, robot.half_sitting)
        base = pin.updateFramePlacement(robot.model, data, robot.frame_id(robot.base_frame))
        over = float(base.act(hip)[2] - data.com[0][2])
        return _Legs(hip * (1.0, 0.0, 1.0), thigh + leg.shank, leg.ankle_height, over)


def _on_floor(
    legs: _Legs, parts: Mapping[str, Array], rate: float
) -> tuple[dict[str, Array], float, Array, Array]:
    """Scale a person by the legs and put the person on the floor.

    Returns:
        Positions by part, m, with "hips", "chest" between both sides; the scale; height of ankles and toes over their
        places at rest, shape (T, 2, 2), m; and true where a foot stands, shape (T, 2).
    """
    scale = STRETCH * legs.length / (0.5 * sum(_leg_length(parts, side) for side in SIDES))
    parts = {name: scale * places for name, places in parts.items()}
    kinds = ["ankle", "toe"] if all(f"{side}_toe" in parts for side in SIDES) else ["ankle"]
    points = [np.stack([parts[f"{side}_{kind}"] for side in SIDES], axis=1) for kind in kinds]
    rests, stands = zip(*(touching(each[:, :, None], rate) for each in points), strict=True)
    lift = np.stack([each[..., 2] - rest for each, rest in zip(points, rests, strict=True)], axis=2)
    standing = always_standing(np.any(stands, axis=0), rate)
    parts = {name: places - [0.0, 0.0, rests[0] - legs.ankle_height] for name, places in parts.items()}
    for name, part in (("hips", "hip"), ("chest", "shoulder")):
        parts[name] = 0.5 * (parts[f"left_{part}"] + parts[f"right_{part}"])
    return parts, scale, lift, standing


def _soles(robot: Robot, parts: Mapping[str, Array], lift: Array) -> list[Soles]:
    """Return the placements of the robot's soles under the person's ankles, turned as the person's feet, T pairs."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    left = parts["left_hip"] - parts["right_hip"]
    facing = np.unwrap(np.arctan2(-left[:, 0], left[:, 1]))
    feet = []
    for number, (side, sole) in enumerate(zip(SIDES, robot.soles, strict=False)):
        ankle = data.oMi[robot.model.frames[robot.frame_id(sole.frame)].parentJoint].translation
        place = data.oMf[robot.frame_id(sole.frame)]
        offset = place.rotation.T @ (place.translation - ankle)
        yaw, pitch = facing, np.zeros(len(facing))
        if lift.shape[2] == 2:  # both toes are known
            foot = parts[f"{side}_toe"] - parts[f"{side}_ankle"]
            level = np.hypot(foot[:, 0], foot[:, 1])
            seen = np.clip(level / np.linalg.norm(foot, axis=1) - ON_END, 0.0, ON_END) / ON_END
            turn = np.angle(np.exp(1j * (np.arctan2(foot[:, 1], foot[:, 0]) - facing)))
            yaw = facing + seen * turn
            size = float(np.median(np.linalg.norm(foot, axis=1)))
            pitch = np.arcsin(np.clip((lift[:, number, 0] - lift[:, number, 1]) / size, -TIPPED, TIPPED))
        height = lift[:, number].min(axis=1).clip(0.0)
        rotations = Rotation.from_euler("ZY", np.column_stack([yaw, pitch])).as_matrix()
        places = parts[f"{side}_ankle"] + rotations @ offset
        places[:, 2] = height
        feet.append([pin.SE3(*each) for each in zip(rotations, places, strict=True)])
    return list(zip(*feet, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class _Arm:
    """An arm of the robot as two bars.

    Attributes:
        side: Side.
        elbow: Frame at the elbow.
        hand: Frame of the hand.
        trunk: Frame that carries the shoulder.
        shoulder: Centre of the shoulder in the axes of that frame, shape (3,), m.
        upper: Length from shoulder to elbow, m.
        lower: Length from elbow to hand, m.
    """

    side: str
    elbow: str
    hand: str
    trunk: str
    shoulder: Array
    upper: float
    lower: float


def arms_of(robot: Robot) -> list[_Arm]:
    """Return the arms of a robot; the elbow is the joint that brings the hand nearest to the shoulder.

    The joints before the elbow are those of the shoulder. If their axes are far from meeting in a point, the first one
    moves the shoulder itself, as a collar-bone does, and so on.
    """
    model, data = robot.model, robot.model.createData()
    arms = []
    for side, chain in arm_joints(robot).items():
        if len(chain) < 3:
            continue
        hand, root = robot.frames[f"{side}_hand"], robot.joint_numbers[chain[0]]

        def reach(joint: int, root: int = root, hand: str = hand) -> float:
            q, ends = robot.half_sitting.copy(), []
            for position in np.linspace(*_range(robot, joint), 9):
                q[7 + joint] = position
                pin.framesForwardKinematics(model, data, q)
                ends.append(
                    np.linalg.norm(data.oMf[robot.frame_id(hand)].translation - data.oMi[root].translation)
                )
            return float(max(ends) - min(ends))

        elbow = max(chain[1:], key=reach)
        number, above = robot.joint_numbers[elbow], chain[: chain.index(elbow)]
        trunk = robot.torso_frame
        shoulder, upper, spread = centre_of_turning(robot, trunk, number, above)
        while spread > ROUND * upper and len(above) > 1:
            trunk, above = _frame_at(robot, robot.joint_numbers[above[0]]), above[1:]
            shoulder, upper, spread = centre_of_turning(robot, trunk, number, above)
        pin.framesForwardKinematics(model, data, robot.half_sitting)
        lower = np.linalg.norm(data.oMf[robot.frame_id(hand)].translation - data.oMi[number].translation)
        arms.append(_Arm(side, _frame_at(robot, number), hand, trunk, shoulder, upper, float(lower)))
    return arms


def _frame_at(robot: Robot, number: int) -> str:
    """Return the name of a frame at the origin of a joint, on the link that the joint moves."""
    for frame in robot.model.frames:
        if frame.parentJoint == number and not np.any(frame.placement.translation):
            return str(frame.name)
    raise InputError(
        f"robot '{robot.name}' has no frame at the origin of joint '{robot.model.names[number]}', which moves an arm"
    )


def _range(robot: Robot, joint: int) -> tuple[float, float]:
    """Return the limits of a joint, at most half a turn to either side, rad."""
    return max(float(robot.position_lower[joint]), -math.pi), min(float(robot.position_upper[joint]), math.pi)


def centre_of_turning(robot: Robot, trunk: str, number: int, joints: list[int]) -> tuple[Array, float, float]:
    """Return the centre about which some joints turn the origin of another one, in a trunk frame, m.

    It is that of the sphere which fits best where the origin can go, p² = 2 c·p + r² − c². Its radius, and the greatest
    distance of the origin from the sphere follow, m.
    """
    data, q = robot.model.createData(), robot.half_sitting.copy()
    random, places = np.random.default_rng(0), []
    for _ in range(SAMPLES):
        q[[7 + joint for joint in joints]] = [random.uniform(*_range(robot, joint)) for joint in joints]
        pin.framesForwardKinematics(robot.model, data, q)
        places.append(data.oMf[robot.frame_id(trunk)].actInv(data.oMi[number].translation))
    points = np.array(places)
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    centre = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=1e-6)[0][:3]
    distances = np.linalg.norm(points - centre, axis=1)
    return centre, float(distances.mean()), float(abs(distances - distances.mean()).max())


def _follow(
    given: Robot,
    legs: _Legs,
    parts: Mapping[str, Array],
    paths: list[Soles],
    moves: list[pin.SE3],
    standing: Array,
) -> tuple[Array, dict[str, float]]:
    """Follow a person frame by frame, by inverse kinematics of a copy of the robot.

    Returned are configurations, shape (T, nq), and the root mean square of the error of each target, m or rad.
    """
    ik = searching(given)
    robot, base, torso = ik.robot, given.base_frame, given.torso_frame
    ik.update(robot.half_sitting)
    rest = [robot.placement(frame).rotation.copy() for frame in (base, torso)]
    contacts = [SoleContact(sole.name, ramp=0.0) for sole in robot.soles[:2]]
    feet = [PoseTask(sole.frame, weight=SWING, name=f"{sole.name} in the air") for sole in robot.soles[:2]]
    pelvis = PositionTask(base, weight=PELVIS, name="pelvis")
    tilts = [OrientationTask(base, weight=TILT, name="pelvis rotation")]
    if torso != base:
        tilts.append(OrientationTask(torso, weight=TRUNK, name="trunk"))
    arms = arms_of(robot)
    elbows = [PositionTask(arm.elbow, weight=ARM, name=f"{arm.side}_elbow") for arm in arms]
    hands = [PositionTask(arm.hand, weight=ARM, name=f"{arm.side}_hand") for arm in arms]
    light = {robot.joint_names[joint]: LEGS / JOINTS for joint in robot.leg_joints}
    limits, kept = JointLimits(margin=MARGIN), (pelvis, *tilts, *elbows, *hands)
    ik.add(*contacts, *feet, *kept)
    ik.add(PostureTask(weight=JOINTS, joint_weights=light), limits)
    turns = _turns_of_trunk(parts)
    directions = {
        (arm.side, part): _unit(parts[f"{arm.side}_{end}"] - parts[f"{arm.side}_{begin}"])
        for arm in arms
        for part, begin, end in (("upper", "shoulder", "elbow"), ("lower", "elbow", "wrist"))
    }
    q, errors = np.empty((len(paths), robot.nq)), np.empty((len(paths), len(kept)))
    now = robot.half_sitting.copy()
    for i, (soles, move) in enumerate(zip(paths, moves, strict=True)):
        for contact, foot, sole, on in zip(contacts, feet, soles, standing[i], strict=True):
            contact.active, contact.target, foot.target = bool(on), sole, sole
        rotations = [move.rotation @ turn[i] for turn in turns]
        for task, rotation, own in zip(tilts, rotations, rest, strict=False):
            task.target = rotation @ own
        pelvis.target = move.act(parts["hips"][i]) - tilts[0].target @ legs.hips
        if i == 0:
            now[:3], now[3:7] = pelvis.target, pin.Quaternion(rotations[0]).coeffs()
            now[7:] = np.clip(now[7:], limits.lower, limits.upper)
        for _ in range(2):  # the shoulders are where the trunk is, which the first search moves
            ik.update(now)
            for arm, elbow, hand in zip(arms, elbows, hands, strict=True):
                shoulder = robot.placement(arm.trunk).act(arm.shoulder)
                elbow.target = shoulder + arm.upper * move.rotation @ directions[arm.side, "upper"][i]
                hand.target = elbow.target + arm.lower * move.rotation @ directions[arm.side, "lower"][i]
            found = ik.reach(SMALL, ITERATIONS if i else FIRST)
            now = found.configuration
        q[i] = now
        errors[i] = [found.errors[task.name][0] for task in kept]
    return q, {
        task.name: float(np.sqrt(np.mean(np.square(each))))
        for task, each in zip(kept, np.ascontiguousarray(errors.T), strict=True)
    }


def _turns_of_trunk(parts: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the rotations of pelvis and trunk from upright, shape (T, 3, 3) each."""
    up, trunk = np.array([0.0, 0.0, 1.0]), parts["chest"] - parts["hips"]
    return (
        _axes(parts["left_hip"] - parts["right_hip"], _unit(BENT * _unit(trunk) + (1.0 - BENT) * up)),
        _axes(parts["left_shoulder"] - parts["right_shoulder"], _unit(trunk)),
    )


def _unit(vectors: Array) -> Array:
    """Return vectors of length one, shape (..., 3)."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _axes(left: Array, up: Array) -> Array:
    """Return rotations whose z axis points up and whose y axis points left as far as it can, shape (T, 3, 3)."""
    ahead = _unit(np.cross(left, up))
    return np.stack([ahead, np.cross(up, ahead), up], axis=-1)
