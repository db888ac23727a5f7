"""Checks of joints: order, signs, units, velocities, freshness, delay, torques and gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError
from wbc.machine.conformance.excitation import Gains, Record
from wbc.machine.conformance.session import UNIT, Session

STEP = 0.02
"""Motion of a joint, rad (or m times this)."""

JOINT_TIME = 0.1
"""Time of it, s."""


PULSES = 4
"""Pulses of torque whose beginning is averaged."""

RISE = 0.0025
"""Time in which a torque shows in the velocity without any delay, s."""

HALF = 0.5
"""Share of the own gains that is commanded."""

SEEN = 1e-3
"""Change of a position or velocity from which on it counts, rad or rad/s."""

NOTHING_FOLLOWS = "the command does not reach the drives, these are off or too soft, or the encoder is frozen"
"""Cause of joints that do not move."""


class Moves(NamedTuple):
    """Answers of all joints to a step of each.

    Attributes:
        follows: Change of each measured position (column) as a share of the step of each joint (row), shape (na, na).
        answers: True for references of joints (row) after which what has moved comes back, shape (na,).
        rates: Integral of each joint's velocity over its way, shape (na,); NaN without a way.
        delays: Lag of each joint behind its reference, shape (na,), s; NaN where it does not follow.
        stuck: Greatest share of samples that repeat the last one while a joint moves.
    """

    follows: Array
    answers: Array
    rates: Array
    delays: Array
    stuck: float


class JointChecks(Session):
    """Checks of encoders and drives."""

    def check_references(self, moves: Moves) -> bool:
        """Report drives that no position reference moves; return False then.

        Args:
            moves: Answers to position references.
        """
        if np.count_nonzero(moves.answers) > 0.25 * self.robot.na:
            return True
        chosen = self._free_joints() or list(range(self.robot.na))
        tau, step = np.zeros(self.robot.na), np.zeros(self.robot.na)
        tau[chosen], step[chosen] = 0.1 * np.minimum(self.robot.torque_limit, 1e3)[chosen], STEP
        if self._sways(lambda sign: self.excite.move(sign * step, JOINT_TIME)[0].position[:, chosen]):
            return True
        torques = self._sways(lambda sign: self.excite.hold(0.04, torque=sign * tau).velocity[:, chosen])
        self.add("hold", "unknown", "position references move no joint")
        found = "position references move no joint" + (", torques do" if torques else "")
        cause = (
            "joint_position is ignored, as by drives of torque alone, or the servos are far too soft: torque control "
            "alone works; the others and these checks need kp (q_ref - q) + kd (q̇_ref - q̇) + τ"
            if torques
            else NOTHING_FOLLOWS
        )
        return self.add("joint order", False, found, cause)

    def _sways(self, push: Callable[[float], Array]) -> bool:
        """Return True if a signal of most joints follows the sign of a push, wherever a robot that lies drifts.

        Args:
            push: Makes a push of a sign; returns the signal while it lasts, shape (ticks, joints).
        """
        changes = []
        for sign in (1.0, -1.0, -1.0, 1.0) * (PULSES // 2):
            self.excite.hold(0.1)
            signal = push(sign)
            changes.append(sign * (signal[-1] - signal[0]))
        apart = np.array(changes[::2]) + np.array(changes[1::2])
        return bool(max(np.mean(apart > SEEN), np.mean(apart < -SEEN)) > 0.65)

    def check_joints(self, moves: Moves) -> None:
        """Judge who follows a step of each joint, which way, how far, and with which velocity.

        Args:
            moves: Answers to position references.
        """
        own = moves.follows.diagonal()
        dead = [i for i in range(self.robot.na) if abs(own[i]) < 0.15]
        self.obeys = len(dead) < self.robot.na // 2
        known = self._report_order(moves.follows, dead)
        turned = [i for i in known if own[i] < 0.0]
        found = f"reversed: {self._some(turned)}" if turned else "as in the model"
        cause = "axis the other way round than in the model: feedback drives the joint away, at once"
        self.add("joint sign", not turned, found, cause)
        self._report_unit(own, known)
        if dead or not np.isfinite(moves.rates).any():
            self.add("joint velocity", "unknown", "the joints do not follow")
        else:
            self._report_velocity(moves.rates, known)
        found = f"{100 * moves.stuck:.0f} % of moving samples repeat the last one"
        cause = "sensors are read less often than the control period: velocities jump, damping is late"
        self.add("fresh", moves.stuck < 0.25, found, cause)
        delays = moves.delays
        self._report_delay(float(np.nanmedian(delays)) if np.isfinite(delays).any() else float("nan"))

    def move_joints(self) -> Moves:
        """Move each joint by a step and back."""
        robot, excite, na = self.robot, self.excite, self.robot.na
        follows, rates, delays, stuck = np.zeros((na, na)), np.zeros(na), np.zeros(na), 0.0
        answers = np.zeros(na, dtype=bool)
        before = self.rest.settled("position")
        middle = 0.5 * (robot.position_lower + robot.position_upper)
        for i in range(na):
            step = np.zeros(na)
            step[i] = STEP if not np.isfinite(middle[i]) or middle[i] >= excite.reference[i] else -STEP
            there, back = excite.move(step, JOINT_TIME)
            follows[i] = (there.settled("position") - before) / step[i]
            velocity = there.velocity[:, i]
            integral = 0.5 * float((velocity + np.append(0.0, velocity[:-1])).sum()) * excite.period
            travelled = float(there.position[-1, i] - before[i])
            rates[i] = integral / travelled if abs(travelled) > 1e-4 else np.nan
            half = there.position[: len(there.position) // 2]
            same = (np.diff(half, axis=0) == 0.0).all(axis=1)
            stuck = max(stuck, float(same.mean()))
            delays[i] = self._lag(there, i, step[i])
            way, way_back = follows[i] * step[i], there.settled("position") - back.settled("position")
            distance = float(way @ way)
            answers[i] = (
                distance > (0.15 * STEP) ** 2 and 0.5 * distance < float(way @ way_back) < 2.0 * distance
            )
            before = back.settled("position")
        return Moves(follows, answers, rates, delays, stuck)

    def _some(self, joints: Sequence[int]) -> str:
        """Return the names of the first few joints."""
        return ", ".join(self.robot.joint_names[i] for i in joints[:4])

    def _report_order(self, follows: Array, dead: Sequence[int]) -> list[int]:
        """Report joints that move another one, or none; return the others."""
        names, na = self.robot.joint_names, self.robot.na
        lead = np.abs(follows).argmax(axis=1)
        swapped = [
            i
            for i in range(na)
            if lead[i] != i and abs(follows[i, lead[i]]) > max(0.3, 2.0 * abs(follows[i, i]))
        ]
        if swapped:
            found = ", ".join(f"{names[i]} moves {names[lead[i]]}" for i in swapped[:4])
            cause = "joints in another order than `joint_names`: the wrong limb moves, the QP tears the robot apart"
            self.add("joint order", False, found, cause)
        elif dead:
            found = f"{len(dead)} joints do not follow: {self._some(dead)}"
            self.add("joint order", False, found, NOTHING_FOLLOWS)
        else:
            self.add("joint order", True, f"{na} joints follow")
        return [i for i in range(na) if i not in swapped and i not in dead]

    def _report_unit(self, own: Array, known: Sequence[int]) -> None:
        """Report joints that go another way than they should, by the share of their step."""
        size = float(np.median(np.abs(own[known]))) if known else 0.0
        # A joint of a leg that stands goes as far as the rest of the leg lets it.
        held = set(range(self.robot.na)) - set(self._free_joints()) if self.standing else set()
        odd = [i for i in known if abs(own[i]) > 2.5 or (abs(own[i]) < 0.3 and i not in held)]
        unit = "degrees" if abs(size / UNIT - 1.0) < 0.15 else "the motor's side of the gear, or another unit"
        cause = f"positions in {unit}: joints seem to be far away from where they are"
        found = f"{size:.2f} of the step" + (f"; odd: {self._some(odd)}" if odd else "")
        self.add("joint unit", not odd, found, cause)

    def _report_velocity(self, rates: Array, known: Sequence[int]) -> None:
        """Report velocities whose integral is not the way, by their ratio."""
        ratio = float(np.median(rates[np.isfinite(rates)]))
        bad = [i for i in known if np.isfinite(rates[i]) and not 0.6 < rates[i] < 1.4]
        what = (
            "reversed sign"
            if ratio < 0.0
            else "zero or frozen"
            if abs(ratio) < 0.05
            else "degrees per second"
            if abs(ratio / UNIT - 1.0) < 0.4
            else "another unit than the positions"
        )
        few = f": {self._some(bad)}" if len(bad) < self.robot.na // 2 else ""
        cause = f"velocities with {what}{few}: damping is weak, strong or negative, the joints buzz"
        self.add("joint velocity", not bad, f"∫q̇ dt is {ratio:.2f} of the way", cause)

    def _lag(self, there: Record, joint: int, step: float) -> float:
        """Return the lag of a joint's motion behind its reference, s; NaN if it does not follow."""
        shape = self.excite.profile(JOINT_TIME) * step
        moved = there.position[:, joint] - there.position[0, joint]
        end = moved[-1]
        if abs(end) < 0.3 * abs(step) or abs(end) > 3.0 * abs(step):
            return float("nan")
        moved = moved / end * step
        # Areas between a curve and its end: their difference is the lag, whatever the shape.
        lag: float = float((shape - moved).sum() / step) * self.excite.period
        return lag

    def _report_delay(self, lag: float) -> None:
        period, extra = self.excite.period, self._torque_delay()
        if not np.isfinite(lag):
            self.add("delay", "unknown", "the joints do not follow")
            return
        found = f"{1e3 * lag:.1f} ms behind the references"
        if extra is not None:
            found += f", torque acts after {1e3 * extra:.1f} ms"
            cause = (
                f"about {1e3 * extra:.0f} ms of delay that were not stated: oscillations of 5 to 15 Hz, falls"
            )
            self.add("delay", extra <= self.delay + max(1.01 * period, RISE), found, cause)
        else:
            cause = f"about {1e3 * lag:.0f} ms of delay or soft drives: oscillations of 5 to 15 Hz"
            self.add("delay", lag <= self.delay + 0.01, found, cause)

    def _torque_delay(self) -> float | None:
        """Return the time after which a step of torque shows in the velocity, s; None if it does not show."""
        excite = self.excite
        free = self._free_joints()
        if not free:
            return None
        limit = np.minimum(self.robot.torque_limit, 1e3)
        tau = np.zeros(self.robot.na)
        tau[free] = 0.1 * limit[free]
        rests, pulses = [], []
        for _ in range(PULSES):
            rests.append(excite.hold(0.15).velocity[:, free])  # what the last pulse left decays
            pulses.append(excite.hold(0.04, torque=tau).velocity[:, free] - rests[-1][-3:].mean(axis=0))
        # Without sensor noise it is the decay that a response must exceed.
        noise = np.maximum(np.mean([rest.std(axis=0) for rest in rests], axis=0), 1e-4)
        excite.hold(0.1)
        seen = (np.mean(pulses, axis=0) / noise).clip(-20.0, 20.0).mean(axis=1)
        late = np.flatnonzero(seen > max(4.0 / np.sqrt(PULSES * len(free)), 0.2 * float(seen.max())))
        return float(late[0]) * excite.period if late.size else None

    def _free_joints(self) -> list[int]:
        """Return joints that are not in the legs: what acts on them moves them."""
        legs = {name for leg in self.loop.description.legs for name in leg}
        names = self.robot.joint_names
        return [i for i, name in enumerate(names) if name not in legs]

    def check_zeros(self) -> None:
        """Compare the encoders with half-sitting."""
        robot = self.robot
        position = self.rest.settled("position")
        if self.bad("joint order", "joint sign", "joint unit"):
            self.add("joint zero", "unknown", "joints are not measured as they should")
            return
        off = position - self.excite.reference
        worst = int(np.argmax(np.abs(off)))
        outside = (position < robot.position_lower - 0.05) | (position > robot.position_upper + 0.05)
        cause = "zero of an encoder elsewhere than in the model, or a robot that was not at half-sitting: it leans"
        found = f"{robot.joint_names[worst]} {1e3 * off[worst]:+.0f} mrad from half-sitting"
        self.add("joint zero", bool(abs(off[worst]) < 0.05 and not outside.any()), found, cause)

    def check_torques(self) -> None:
        """Feed-forward, velocity reference and gains: kp Δq = τ, and kp Δq = kd q̇_ref, of joints that hang free."""
        free = self._free_joints()
        kp, kd = self.gains
        if not free:
            for name in ("torque", "gains", "velocity reference", "measured torque"):
                self.add(name, "unknown", "no joint beside the legs")
            return
        tau, rate = self._pushes(free)
        pushed, dragged = self._own_answer = self._answer(tau, rate)
        if self.bad("joint order", "joint sign", "joint unit"):
            for name in ("torque", "gains", "velocity reference", "measured torque"):
                self.add(name, "unknown", "joints are not measured as they should")
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            share = float(np.nanmedian((pushed * kp / tau)[free]))
            drag = float(np.nanmedian((dragged * kp / (kd * rate))[free]))
        cause = (
            "feed-forward torque with the reversed sign: it doubles the sag in place of removing it"
            if share < -0.05
            else "feed-forward torque is ignored: position drives sag, torque control does not exist"
        )
        if self.add("torque", share > 0.05, f"τ = kp Δq to {share:.2f}", cause):
            cause = (
                f"the drives have other gains than the description (kp about {1.0 / share:.2g} times as large), or "
                "torque has another unit"
            )
            self.add("gains", 0.5 < share < 2.0, f"kp is {1.0 / share:.2f} of the description's", cause)
        else:
            self.add("gains", "unknown", "no torque acts")
        cause = (
            "velocity reference with the reversed sign"
            if drag < -0.1
            else "velocity references are ignored or damped with another gain: references are followed late"
        )
        self.add("velocity reference", 0.4 < drag < 2.5, f"kd q̇_ref = kp Δq to {drag:.2f}", cause)
        self._measured_torque(free)

    def _pushes(self, free: list[int]) -> tuple[Array, Array]:
        """Return the torque and the velocity reference that move free joints by 20 mrad, each of shape (na,)."""
        kp, kd = self.gains
        limit = np.minimum(self.robot.torque_limit, 1e3)
        tau, rate = np.zeros(self.robot.na), np.zeros(self.robot.na)
        tau[free] = np.clip(0.02 * kp[free], 0.0, 0.15 * limit[free])
        rate[free] = np.clip(0.02 * kp[free] / np.maximum(kd[free], 1e-9), 0.0, 1.0)
        return tau, rate

    def _answer(self, tau: Array, rate: Array, gains: Gains | None = None) -> tuple[Array, Array]:
        """Return how far a torque and a velocity reference move the joints, each of shape (na,), rad (or m)."""
        hold = self.excite.hold
        start = hold(0.1 if gains is None else 0.2, gains=gains).settled("position")
        pushed = hold(0.25, torque=tau, gains=gains).settled("position") - start
        middle = hold(0.2, gains=gains).settled("position")
        dragged = hold(0.25, velocity=rate, gains=gains).settled("position") - middle
        hold(0.2)
        return pushed, dragged

    def check_commanded_gains(self) -> None:
        """Send half the gains: a torque moves a joint twice as far, a velocity reference as far as before.

        Free joints get half of the gains that their servos were found to have, the legs those of the description.
        """
        free = self._free_joints()
        if not free or self.bad("torque", "gains"):
            why = "no joint beside the legs" if not free else "own gains are not as they should"
            self.add("commanded gains", "unknown", why)
            return
        tau, rate = self._pushes(free)
        (kp, kd), (pushed, dragged) = np.copy(self.gains), self._own_answer
        strong = sorted(free, key=lambda i: float(tau[i]))[len(free) // 2 :]  # friction is least there

        def middle(values: Array, divisors: Array) -> float:
            return float(np.median(values[strong] / divisors[strong]))

        own_kp, own_kd, judged = middle(tau, pushed * kp), 1.0, ["kp"]
        if not self.bad("velocity reference"):
            own_kd, judged = own_kp * middle(dragged * kp, kd * rate), ["kp", "kd"]
        kp[free] *= HALF * own_kp
        kd[free] *= HALF * own_kd
        try:
            softly_pushed, softly_dragged = self._answer(tau, rate, (kp, kd))
        except (InputError, NotImplementedError) as error:
            self.add("commanded gains", "unknown", f"the loop takes none: {error}")
            return
        stiffness = middle(pushed, softly_pushed)
        damping = stiffness * middle(softly_dragged, dragged)
        shares = {"kp": stiffness, "kd": damping}
        bad = [name for name in judged if not 0.1 < shares[name] < 0.8]
        found = f"commanded halves: kp acts with {stiffness:.2f}, kd with {damping:.2f} of the machine's own"
        cause = (
            f"{' and '.join(bad)} of a command: without effect, or in another unit; robots fall in hybrid control, "
            "machines are switched on and off with full stiffness"
        )
        self.add("commanded gains", not bad, found, cause)

    def _measured_torque(self, free: list[int]) -> None:
        """Measured torque of joints that hang free at rest: the weight that they carry."""
        torque = self.rest.settled("torque")
        if not np.isfinite(torque).all():
            self.add("measured torque", "unknown", "not measured")
            return
        model, data = self.robot.model, self.robot.data
        weight = pin.computeGeneralizedGravity(model, data, np.array(self.robot.half_sitting))[6:][free]
        if float(np.abs(weight).max()) < 0.3:
            self.add("measured torque", "unknown", "no joint beside the legs carries weight")
            return
        slope = float(weight @ torque[free] / (weight @ weight))
        cause = (
            "measured torque with the reversed sign: it must be the drive's on the joint, not the load's"
            if slope < -0.2
            else "measured torque in another unit: motor side of the gear, current, or fraction of the limit"
        )
        self.add(
            "measured torque", 0.5 < slope < 1.5, f"{slope:.2f} of the weight that the joints carry", cause
        )
