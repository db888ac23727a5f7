"""Checks of encoders and drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.machine.conformance.causes import RATIOS
from wbc.machine.conformance.session import DEGREES, FreeMotion, Record, Session, settled

STEP, TIME = 0.02, 0.1
"""Motion of a joint, rad (or m times this), and its time, s."""

BUZZ, TREMBLE = 1.0, 0.005
"""Speed of a joint that goes to and fro from which on it buzzes, rad/s, and least way that it does so, rad: noise is
less, of readings in degrees as well."""

FOLLOWS, SOME = 0.15, 0.25
"""Share of its step from which on a joint follows, and share of joints that must follow for the others to be judged."""

STUCK, OFF = 25.0, 50.0
"""Share of moving samples that repeat the last one from which on sensors are read late, %; distance from half-sitting
from which on the zero of an encoder is off, mrad."""

PULSES = (1.0, -1.0, -1.0, 1.0)
"""Signs of pulses of torque whose answers are averaged: a robot that lies drifts."""

RISE = 0.0025
"""Time in which a torque shows in the velocity without any delay, s."""


class Steps(NamedTuple):
    """Steps of all joints, one after another: positions are those measured, shape (step, joint)."""

    sizes: Array  # shape (na,), rad (or m)
    moves: tuple[Record, ...]  # of each step on its way there
    before: Array
    there: Array
    back: Array

    @property
    def share(self) -> Array:
        """Change of each position as a share of the step of each joint, shape (step, joint)."""
        return (self.there - self.before) / self.sizes[:, None]


def rest(s: Session) -> str:
    """Hold half-sitting, and see whether the joints come to rest: of joints that buzz nothing else can be told."""
    s.settle()
    begin = len(s.rest["time"]) // 2
    rate, position = s.rest["joint_velocity"][begin:], s.rest["joint_position"][begin:]
    speed, way = np.median(np.abs(rate), axis=0), np.abs(position[-1] - position[0])
    goes = np.abs(np.diff(position, axis=0)).sum(axis=0)
    buzzes = (speed > BUZZ) & (goes > TREMBLE) & (way < 0.5 * goes)
    worst = int(np.argmax(np.where(buzzes, speed, -1.0))) if buzzes.any() else int(np.argmax(speed))
    found = f"{s.robot.joint_names[worst]} at {speed[worst]:.2f} rad/s"
    if buzzes.any():
        found += f" goes nowhere; so do {np.count_nonzero(buzzes)} joints: {s.some(np.flatnonzero(buzzes).tolist())}"
        s.lost = "joints are not at rest"
    s.check("rest", found, buzzes=buzzes.any())
    return s.lost


def joints(s: Session) -> str:
    """Move each joint by a step and back: who follows, which way, how far, how fast and how late."""
    steps = _step_each(s)
    ways = steps.there - steps.before
    distance, returned = (ways * ways).sum(axis=1), (ways * (steps.there - steps.back)).sum(axis=1)
    comes_back = (0.5 * distance < returned) & (returned < 2.0 * distance)
    if np.mean((distance > (FOLLOWS * STEP) ** 2) & comes_back) < SOME:
        answer = np.subtract(*_pulses(s)[0][[-1, 0]])
        alone = bool(max(np.mean(answer > 1e-3), np.mean(answer < -1e-3)) > 0.65)
        found = "position references move no joint" + (", torques do" if alone else "")
        s.check("joint order", found, torque_alone=alone, dead=True)
        s.lost = "the joints do not follow"
        return s.lost
    known, dead = _judge_order(s, steps)
    _judge_motion(s, steps, known)
    if dead:
        s.unknown("joint velocity", "the joints do not follow")
    else:
        _judge_velocity(s, steps, known)
    moving = (move["joint_position"][: len(move["time"]) // 2] for move in steps.moves)
    stuck = 100.0 * max((np.diff(rows, axis=0) == 0.0).all(axis=1).mean() for rows in moving)
    s.check("fresh", f"{stuck:.0f} % of moving samples repeat the last one", repeats=stuck >= STUCK)
    _judge_delay(s, steps)
    if s.confused:
        return s.confused
    position = settled(s.rest["joint_position"])
    off = 1e3 * (position - s.reference)
    worst = int(np.argmax(np.abs(off)))
    moved = 1e3 * float(np.abs(np.diff(s.rest["joint_position"], axis=0)).max())
    rate = float(np.median(np.abs(s.rest["joint_velocity"][-10:])))
    found = f"{s.robot.joint_names[worst]} {off[worst]:+.0f} mrad from half-sitting, {rate:.3f} rad/s at rest"
    s.check("joint zero", found, moves=moved >= 20.0 or rate >= 0.15, off=abs(off[worst]) >= OFF)
    return ""


def _step_each(s: Session) -> Steps:
    """Move each joint by a step towards the middle of its range, and back."""
    middle = 0.5 * (s.robot.position_lower + s.robot.position_upper)
    sizes = np.where(~np.isfinite(middle) | (middle >= s.reference), STEP, -STEP)
    moves, backs = zip(*(s.move(step, TIME) for step in np.diag(sizes)), strict=True)
    there, back = (np.array([settled(move["joint_position"]) for move in way]) for way in (moves, backs))
    return Steps(sizes, moves, np.array([settled(s.rest["joint_position"]), *back[:-1]]), there, back)


def _judge_order(s: Session, steps: Steps) -> tuple[list[int], list[int]]:
    """Judge which joint a step moves; return the joints that follow their own steps, and those that do not follow."""
    na, names, size = s.robot.na, s.robot.joint_names, np.abs(steps.share)
    lead, dead = size.argmax(axis=1), [i for i in range(na) if size[i, i] < FOLLOWS]
    swapped = [i for i in range(na) if lead[i] != i and size[i, lead[i]] > max(0.3, 2.0 * size[i, i])]
    found = f"{len(dead)} joints do not follow: {s.some(dead)}" if dead else f"{na} joints follow"
    if swapped:
        found = ", ".join(f"{names[i]} moves {names[lead[i]]}" for i in swapped[:4])
    s.check("joint order", found, swapped=swapped, dead=dead)
    if len(dead) >= na // 2:
        s.lost = "the joints do not follow"
    return [i for i in range(na) if i not in swapped and i not in dead], dead


def _judge_motion(s: Session, steps: Steps, known: list[int]) -> None:
    """Judge direction and distance of each joint that follows its own steps."""
    own, (least, most) = steps.share.diagonal(), RATIOS["joint motion"]
    turned = [i for i in known if own[i] < 0.0]
    # A joint of a leg that stands goes as far as the rest of the leg lets it.
    lax = s.free if s.standing else known
    odd = [i for i in known if abs(own[i]) > most or (abs(own[i]) < least and i in lax)]
    share = float(np.median(np.abs(own[known]))) if known else 0.0
    found = f"{share:.2f} of the step" + (f"; odd: {s.some(turned or odd)}" if turned or odd else "")
    s.check(
        "joint motion", found, reversed=turned, degrees=odd and abs(share / DEGREES - 1.0) < 0.15, unit=odd
    )


def _judge_velocity(s: Session, steps: Steps, known: list[int]) -> None:
    """Judge the integral of each joint's velocity over its way, where it has gone one."""
    integral = [move["joint_velocity"][:, i].sum() for i, move in enumerate(steps.moves)]
    way = np.array([move["joint_position"][-1, i] - steps.before[i, i] for i, move in enumerate(steps.moves)])
    rates = s.period * np.array(integral) / np.where(np.abs(way) > 1e-4, way, np.nan)
    if np.isnan(rates).all():
        return s.unknown("joint velocity", "the joints do not follow")
    ratio = float(np.nanmedian(rates))
    bad = [i for i in known if np.isfinite(rates[i]) and not s.right("joint velocity", rates[i])]
    s.check(
        "joint velocity",
        f"∫q̇ dt is {ratio:.2f} of the way" + (f"; odd: {s.some(bad)}" if bad else ""),
        reversed=bad and ratio < -0.05,
        still=bad and ratio < 0.05,
        degrees=bad and abs(ratio / DEGREES - 1.0) < 0.4,
        unit=bad,
    )


def _judge_delay(s: Session, steps: Steps) -> None:
    """Judge the time after which a torque acts; without one that is seen, the lag behind the references."""
    torque, lags, stated = None, [], 1e3 * s.delay
    if s.free:
        answer, noise = _pulses(s)
        seen = (answer / noise).clip(-20.0, 20.0).mean(axis=1)
        acts = seen > max(4.0 / np.sqrt(len(PULSES) * len(s.free)), 0.2 * float(seen.max()))
        torque = 1e3 * s.period * int(acts.argmax()) if acts.any() else None
    for i, move in enumerate(steps.moves):
        moved = move["joint_position"][:, i] - move["joint_position"][0, i]
        if 0.3 <= abs(moved[-1] / steps.sizes[i]) <= 3.0:
            # Areas between a curve and its end: their difference is the lag, whatever the shape.
            lags.append(1e3 * s.period * (s.profile(TIME)[0] - moved / moved[-1]).sum())
    if not lags:
        return s.unknown("delay", "the joints do not follow")
    lag = float(np.median(lags))
    found = f"{lag:.1f} ms behind the references"
    if torque is None:
        return s.check("delay", found, late=lag > stated + 10.0)
    late = torque > stated + 1e3 * max(1.01 * s.period, RISE)
    return s.check("delay", f"{found}, torque acts after {torque:.0f} ms", late=late)


def _pulses(s: Session) -> tuple[Array, Array]:
    """Return the mean answer of velocities to pulses of torque, one row a tick, and the noise of each."""
    moved, rests, answers = s.jolt != 0.0, [], []
    for sign in PULSES:
        rests.append(s.hold(0.15)["joint_velocity"][:, moved])  # what the last pulse left decays
        pulse = s.hold(0.04, torque=sign * s.jolt)["joint_velocity"][:, moved]
        answers.append(sign * (pulse - rests[-1][-3:].mean(axis=0)))
    s.hold(0.1)
    # Without sensor noise it is the decay that an answer must exceed.
    return np.mean(answers, axis=0), np.maximum(np.mean([rest.std(axis=0) for rest in rests], axis=0), 1e-4)


def torques(s: Session) -> str:
    """Feed-forward, velocity reference and gains: kp Δq = τ, and kp Δq = kd q̇_ref, of joints that hang free."""
    free, robot, (kp, kd), (tau, rate) = s.free, s.robot, s.gains, np.zeros((2, s.robot.na))
    if not free:
        return "no joint beside the legs"
    # Torques and velocity references that move free joints by 20 mrad.
    tau[free] = np.clip(0.02 * kp[free], 0.0, 1.5 * s.jolt[free])
    rate[free] = np.clip(0.02 * kp[free] / np.maximum(kd[free], ROUNDING), 0.0, 1.0)
    pushed, dragged = _moved_by(s, tau, rate)
    s.free_motion = FreeMotion(tau, rate, pushed, dragged)
    if s.confused:
        return s.confused
    with np.errstate(divide="ignore", invalid="ignore"):
        share = float(np.nanmedian((pushed * kp / tau)[free]))
        drag = float(np.nanmedian((dragged * kp / (kd * rate))[free]))
    found = f"τ = kp Δq to {share:.2f}"
    s.check(
        "torque", found, reversed=share < -0.05, ignored=not share > 0.05, gains=not s.right("torque", share)
    )
    found = f"kd q̇_ref = kp Δq to {drag:.2f}"
    s.check(
        "velocity reference", found, reversed=drag < -0.1, ignored=not s.right("velocity reference", drag)
    )
    torque = settled(s.rest["joint_torque"])[free]
    if not np.isfinite(torque).all():
        return "not measured"
    # At rest, joints that hang free report the weight that they carry.
    weight = pin.computeGeneralizedGravity(robot.model, robot.data, np.array(robot.half_sitting))[6:]
    weight = (weight + robot.spring_torques(robot.half_sitting))[free]
    if np.abs(weight).max() < 0.3:
        return "no joint beside the legs carries weight"
    slope = float(weight @ torque / (weight @ weight))
    found = f"{slope:.2f} of the weight that the joints carry"
    s.check("measured torque", found, reversed=slope < -0.2, unit=not s.right("measured torque", slope))
    return ""


def _moved_by(
    s: Session, torque: Array, velocity: Array, gains: tuple[Array | None, Array | None] = (None, None)
) -> tuple[Array, Array]:
    """Return how far the torque and the velocity reference move the joints, each of shape (na,), rad (or m)."""
    start = s.hold(0.1 if gains[0] is None else 0.2, gains=gains)
    pushed = s.hold(0.25, torque=torque, gains=gains)
    middle = s.hold(0.2, gains=gains)
    dragged = s.hold(0.25, velocity=velocity, gains=gains)
    s.hold(0.2)
    places = [settled(record["joint_position"]) for record in (start, pushed, middle, dragged)]
    return places[1] - places[0], places[3] - places[2]


def commanded_gains(s: Session) -> str:
    """Send half the gains: a torque moves a joint twice as far, a velocity reference as far as before."""
    free, (kp, kd) = s.free, np.copy(s.gains)
    if s.free_motion is None or not s.good("torque"):
        return "own gains are not as they should" if free else "no joint beside the legs"
    tau, rate, pushed, dragged = s.free_motion
    strong = sorted(free, key=lambda i: float(tau[i]))[len(free) // 2 :]  # friction is least there

    def middle(values: Array, divisors: Array) -> float:
        return float(np.median(values[strong] / divisors[strong]))

    own_kp, own_kd, judged = middle(tau, pushed * kp), 1.0, ["kp"]
    if s.good("velocity reference"):
        own_kd, judged = own_kp * middle(dragged * kp, kd * rate), ["kp", "kd"]
    kp[free] *= 0.5 * own_kp
    kd[free] *= 0.5 * own_kd
    try:
        softly_pushed, softly_dragged = _moved_by(s, tau, rate, (kp, kd))
    except (InputError, NotImplementedError) as error:
        return f"the loop takes none: {error}"
    stiffness = middle(pushed, softly_pushed)
    shares = {"kp": stiffness, "kd": stiffness * middle(softly_dragged, dragged)}
    bad = " and ".join(name for name in judged if not s.right("commanded gains", shares[name]))
    found = "commanded halves: kp acts with {kp:.2f}, kd with {kd:.2f} of the machine's own".format_map(
        shares
    )
    s.check("commanded gains", found + (f"; wrong: {bad}" if bad else ""), ignored=bad)
    return ""
