"""Measurements of joints: order, signs, units, velocities, freshness, delay, torques and gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError
from wbc.machine.conformance.rules import UNIT
from wbc.machine.conformance.session import Record, Session

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


class Joints:
    """Checks of encoders and drives.

    Attributes:
        obey: True if most joints follow their references.
    """

    def __init__(self, session: Session, delay: float) -> None:
        """Move each joint by a step and back.

        Args:
            session: The run.
            delay: Delay that the loop is known to have, s.
        """
        self._session, self._delay, self.obey = session, delay, True
        robot, na = session.robot, session.robot.na
        # Change of each measured position (column) as a share of the step of each joint (row).
        self._follows = np.zeros((na, na))
        # Integral of each joint's velocity over its way, NaN without a way; lag behind its reference, s.
        self._rates, self._delays = np.zeros(na), np.zeros(na)
        self._stuck, answers = 0.0, 0  # share of samples that repeat the last one; joints that come back
        before = session.rest.settled("position")
        middle = 0.5 * (robot.position_lower + robot.position_upper)
        for i in range(na):
            step = np.zeros(na)
            step[i] = STEP if not np.isfinite(middle[i]) or middle[i] >= session.reference[i] else -STEP
            there, back = session.move(step, JOINT_TIME)
            way = there.settled("position") - before
            self._follows[i] = way / step[i]
            velocity = there.velocity[:, i]
            integral = 0.5 * float((velocity + np.append(0.0, velocity[:-1])).sum()) * session.period
            travelled = float(there.position[-1, i] - before[i])
            self._rates[i] = integral / travelled if abs(travelled) > 1e-4 else np.nan
            same = (np.diff(there.position[: len(there.position) // 2], axis=0) == 0.0).all(axis=1)
            self._stuck = max(self._stuck, float(same.mean()))
            self._delays[i] = self._lag(there, i, step[i])
            back_way, distance = there.settled("position") - back.settled("position"), float(way @ way)
            answers += (
                distance > (0.15 * STEP) ** 2 and 0.5 * distance < float(way @ back_way) < 2.0 * distance
            )
            before = back.settled("position")
        self._answer_references = answers > 0.25 * na

    def check_references(self) -> bool:
        """Report drives that no position reference moves; return False then."""
        session, robot = self._session, self._session.robot
        if self._answer_references:
            return True
        chosen = session.free or list(range(robot.na))
        tau, step = np.zeros(robot.na), np.zeros(robot.na)
        tau[chosen], step[chosen] = 0.1 * session.push_limit[chosen], STEP
        if self._sways(lambda sign: session.move(sign * step, JOINT_TIME)[0].position[:, chosen]):
            return True
        torques = self._sways(lambda sign: session.hold(0.04, torque=sign * tau).velocity[:, chosen])
        found = "position references move no joint"
        session.unknown(found, "hold")
        session.judge(
            "joint order",
            state="torque alone" if torques else "dead",
            found=found + (", torques do" if torques else ""),
        )
        return False

    def _sways(self, push: Callable[[float], Array]) -> bool:
        """Return True if a signal of most joints follows the sign of a push, wherever a robot that lies drifts.

        Args:
            push: Makes a push of a sign; returns the signal while it lasts, shape (ticks, joints).
        """
        changes = []
        for sign in (1.0, -1.0, -1.0, 1.0) * (PULSES // 2):
            self._session.hold(0.1)
            signal = push(sign)
            changes.append(sign * (signal[-1] - signal[0]))
        apart = np.array(changes[::2]) + np.array(changes[1::2])
        return bool(max(np.mean(apart > SEEN), np.mean(apart < -SEEN)) > 0.65)

    def check_following(self) -> None:
        """Judge who follows a step of each joint, which way, how far, how fast and how late."""
        session, rates, na = self._session, self._rates, self._session.robot.na
        own = self._follows.diagonal()
        dead = [i for i in range(na) if abs(own[i]) < 0.15]
        self.obey = len(dead) < na // 2
        known = self._check_order(dead)
        turned = [i for i in known if own[i] < 0.0]
        found = f"reversed: {self._some(turned)}" if turned else "as in the model"
        session.judge("joint sign", turned=turned, found=found)
        # A joint of a leg that stands goes as far as the rest of the leg lets it.
        held = set(range(na)) - set(session.free) if session.standing else set()
        odd = [i for i in known if abs(own[i]) > 2.5 or (abs(own[i]) < 0.3 and i not in held)]
        size = float(np.median(np.abs(own[known]))) if known else 0.0
        session.judge("joint unit", size=size, odd=f"; odd: {self._some(odd)}" if odd else "")
        if dead or not np.isfinite(rates).any():
            session.unknown("the joints do not follow", "joint velocity")
        else:
            self._check_velocity(known)
        session.judge("fresh", stuck=100.0 * self._stuck)
        self._check_delay()

    def _some(self, joints: Sequence[int]) -> str:
        """Return the names of the first few joints."""
        return ", ".join(self._session.robot.joint_names[i] for i in joints[:4])

    def _check_order(self, dead: Sequence[int]) -> list[int]:
        """Report joints that move another one, or none; return the others."""
        names, size = self._session.robot.joint_names, np.abs(self._follows)
        na, lead = len(names), size.argmax(axis=1)
        swapped = [i for i in range(na) if lead[i] != i and size[i, lead[i]] > max(0.3, 2.0 * size[i, i])]
        if swapped:
            state, found = "swapped", ", ".join(f"{names[i]} moves {names[lead[i]]}" for i in swapped[:4])
        elif dead:
            state, found = "dead", f"{len(dead)} joints do not follow: {self._some(dead)}"
        else:
            state, found = "ok", f"{na} joints follow"
        self._session.judge("joint order", state=state, found=found)
        return [i for i in range(na) if i not in swapped and i not in dead]

    def _check_velocity(self, known: Sequence[int]) -> None:
        """Report velocities whose integral is not the way, by their ratio."""
        rates = self._rates
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
        few = f": {self._some(bad)}" if len(bad) < self._session.robot.na // 2 else ""
        self._session.judge("joint velocity", bad=bad, ratio=ratio, what=what, few=few)

    def _lag(self, there: Record, joint: int, step: float) -> float:
        """Return the lag of a joint's motion behind its reference, s; NaN if it does not follow."""
        moved = there.position[:, joint] - there.position[0, joint]
        end = moved[-1]
        if abs(end) < 0.3 * abs(step) or abs(end) > 3.0 * abs(step):
            return float("nan")
        # Areas between a curve and its end: their difference is the lag, whatever the shape.
        session = self._session
        return float((session.profile(JOINT_TIME) - moved / end).sum()) * session.period

    def _check_delay(self) -> None:
        """Judge the time after which a torque acts; without one that is seen, the lag behind the references."""
        period, extra, delays = self._session.period, self._torque_delay(), self._delays
        if not np.isfinite(delays).any():
            self._session.unknown("the joints do not follow", "delay")
            return
        lag = float(np.nanmedian(delays))
        time, more, torque = lag, 0.01, ""
        if extra is not None:
            time, more, torque = extra, max(1.01 * period, RISE), f", torque acts after {1e3 * extra:.1f} ms"
        allowed = 1e3 * (self._delay + more)
        self._session.judge("delay", lag=1e3 * lag, torque=torque, time=1e3 * time, allowed=allowed)

    def _torque_delay(self) -> float | None:
        """Return the time after which a step of torque shows in the velocity, s; None if it does not show."""
        session, free = self._session, self._session.free
        if not free:
            return None
        tau = np.zeros(session.robot.na)
        tau[free] = 0.1 * session.push_limit[free]
        rests, pulses = [], []
        for _ in range(PULSES):
            rests.append(session.hold(0.15).velocity[:, free])  # what the last pulse left decays
            pulses.append(session.hold(0.04, torque=tau).velocity[:, free] - rests[-1][-3:].mean(axis=0))
        # Without sensor noise it is the decay that a response must exceed.
        noise = np.maximum(np.mean([rest.std(axis=0) for rest in rests], axis=0), 1e-4)
        session.hold(0.1)
        seen = (np.mean(pulses, axis=0) / noise).clip(-20.0, 20.0).mean(axis=1)
        late = np.flatnonzero(seen > max(4.0 / np.sqrt(PULSES * len(free)), 0.2 * float(seen.max())))
        return float(late[0]) * session.period if late.size else None

    def check_zeros(self) -> None:
        """Compare the encoders with half-sitting."""
        session, robot = self._session, self._session.robot
        if session.confused:
            session.unknown(session.confused, "joint zero")
            return
        position = session.rest.settled("position")
        off = position - session.reference
        worst = int(np.argmax(np.abs(off)))
        outside = (position < robot.position_lower - 0.05) | (position > robot.position_upper + 0.05)
        session.judge(
            "joint zero", joint=robot.joint_names[worst], off=1e3 * off[worst], outside=outside.any()
        )

    def check_torques(self) -> None:
        """Feed-forward, velocity reference and gains: kp Δq = τ, and kp Δq = kd q̇_ref, of joints that hang free."""
        session, free, (kp, kd) = self._session, self._session.free, self._session.gains
        why = "no joint beside the legs"
        if free:
            # Torques and velocity references that move free joints by 20 mrad.
            tau, rate = np.zeros(len(kp)), np.zeros(len(kp))
            tau[free] = np.clip(0.02 * kp[free], 0.0, 0.15 * session.push_limit[free])
            rate[free] = np.clip(0.02 * kp[free] / np.maximum(kd[free], 1e-9), 0.0, 1.0)
            self._push = tau, rate
            pushed, dragged = self._own_answer = self._answer()
            why = session.confused
        if why:
            session.unknown(why, "torque", "gains", "velocity reference", "measured torque")
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            share = float(np.nanmedian((pushed * kp / tau)[free]))
            drag = float(np.nanmedian((dragged * kp / (kd * rate))[free]))
        if session.judge("torque", share=share):
            session.judge("gains", share=share, inverse=1.0 / share)
        else:
            session.unknown("no torque acts", "gains")
        session.judge("velocity reference", drag=drag)
        # At rest, joints that hang free report the weight that they carry.
        robot, torque = session.robot, session.rest.settled("torque")
        weight = pin.computeGeneralizedGravity(robot.model, robot.data, np.array(robot.half_sitting))[6:][
            free
        ]
        if not np.isfinite(torque).all():
            session.unknown("not measured", "measured torque")
        elif float(np.abs(weight).max()) < 0.3:
            session.unknown("no joint beside the legs carries weight", "measured torque")
        else:
            session.judge("measured torque", slope=float(weight @ torque[free] / (weight @ weight)))

    def _answer(self, gains: tuple[Array, Array] | None = None) -> tuple[Array, Array]:
        """Return how far the torque and the velocity reference move the joints, each of shape (na,), rad (or m)."""
        (tau, rate), hold = self._push, self._session.hold
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
        session, free = self._session, self._session.free
        if not free or session.bad("torque", "gains"):
            why = "own gains are not as they should" if free else "no joint beside the legs"
            session.unknown(why, "commanded gains")
            return
        (kp, kd), (tau, rate), (pushed, dragged) = np.copy(session.gains), self._push, self._own_answer
        strong = sorted(free, key=lambda i: float(tau[i]))[len(free) // 2 :]  # friction is least there

        def middle(values: Array, divisors: Array) -> float:
            return float(np.median(values[strong] / divisors[strong]))

        own_kp, own_kd, judged = middle(tau, pushed * kp), 1.0, ["kp"]
        if not session.bad("velocity reference"):
            own_kd, judged = own_kp * middle(dragged * kp, kd * rate), ["kp", "kd"]
        kp[free] *= HALF * own_kp
        kd[free] *= HALF * own_kd
        try:
            softly_pushed, softly_dragged = self._answer((kp, kd))
        except (InputError, NotImplementedError) as error:
            session.unknown(f"the loop takes none: {error}", "commanded gains")
            return
        stiffness = middle(pushed, softly_pushed)
        shares = {"kp": stiffness, "kd": stiffness * middle(softly_dragged, dragged)}
        bad = " and ".join(name for name in judged if not 0.1 < shares[name] < 0.8)
        session.judge("commanded gains", bad=bad, **shares)
