"""The stiffness scheduler, its settings and its records: a sole is set before it lands, from a scan of the ground."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.robot import SIDES, Robot
from wbc.core.signals import Measurement
from wbc.feet.sensing.roughness import LEAST_SAMPLES
from wbc.feet.sensing.scan import GroundScan, Profile, ScanSettings
from wbc.feet.soles.actuator import StiffnessActuator, StiffnessState
from wbc.feet.soles.soft import VariableStiffnessFoot, toe_sensor
from wbc.feet.stiffness.model import StiffnessDecision
from wbc.tasks.scheduling.policies import PolicyLike, SwingScan, as_policy

TOLERANCE = 0.05
"""Largest difference of actual and commanded stiffness that counts as reached, as a share: chosen here."""

HISTORY = 20_000
"""Number of steps that are recorded: those of the longest plan."""


@settings
class StiffnessTiming:
    """Instants and conditions of stiffness scheduling: scan and decision.

    Attributes:
        decide_at: Share of the single support at which the stiffness is decided; the rest is for the actuator.
        deadline: Shortest time before the landing at which a stiffness may still be changed, s.
        early_landing: Longest time by which a foot may land early, s: only a stiffness reached even then is commanded.
        min_length: Shortest profile that a policy is asked about, m.
        min_coverage: Smallest share of a profile's samples that must have been seen.
        scan: Settings of the profile.

    Source: the paper decides at 75 % of the single support (section IV-C). On rough ground a foot lands early, on
    40 mm stones by up to 0.25 s, and the actuator needs 0.2 s for its whole range: hence 55 %, and 0.25 s for an early
    landing. On grounds of 40 and 55 mm 99 % of the soles then reach the commanded stiffness, and one in three is
    commanded less than the policy asked for; with 65 % and 0.15 s these are 94 % and one in six. 0.15 m is half of
    what the toe passes over in a step of 0.145 m; the deadline is chosen here.
    """

    decide_at: Share = 0.55
    deadline: Annotated[NonNegative, "s"] = 0.05
    early_landing: Annotated[NonNegative, "s"] = 0.25
    min_length: Annotated[Positive, "m"] = 0.15
    min_coverage: Share = 0.5
    scan: ScanSettings = field(default_factory=ScanSettings)

    def __post_init__(self) -> None:
        shortest = (LEAST_SAMPLES - 1) * self.scan.step
        if self.min_length < shortest:
            raise InputError(
                f"min_length (m) must be at least {shortest:g}, {LEAST_SAMPLES} samples, got {self.min_length:g}"
            )


@dataclass(frozen=True, eq=False)
class StepStiffness:
    """Record of the stiffness of one swing.

    Attributes:
        requested: Stiffness asked for by the policy, or that of before, Nm/rad; differs from `commanded` if the
            actuator could not have reached it in time. NaN if nothing was decided.
    """

    side: str  # the foot that swung
    step: int  # number of the swing since the start, from 0
    commanded: float  # stiffness at the landing as commanded, Nm/rad
    actual: float = math.nan  # stiffness at the landing as measured, Nm/rad; NaN for a sole without a sensor
    reached: bool = False  # True if the two agree within the tolerance
    requested: float = math.nan
    fallback: str | None = None  # reason why the policy did not decide; None if it did
    decision: StiffnessDecision | None = None  # answer of the policy; None if it was not asked or gave none
    profile: Profile | None = None  # ground as scanned; None if too little was seen
    compliance: float = 0.0  # depth of a foot over its load that was felt before the decision, m/N
    decided_before: float = math.nan  # time from the decision to the landing, s; NaN if nothing was decided
    planned_before: float = math.nan  # the same as planned at the decision, s; NaN if nothing was decided
    computing: float = 0.0  # wall time of profile and policy, s

    def as_dict(self) -> dict[str, Any]:
        """Return the record as JSON values; names carry the units, None stands for unknown values."""
        decision, profile = self.decision, self.profile
        return {
            "side": self.side,
            "step": self.step,
            "commanded_nm_per_rad": self.commanded,
            "actual_at_landing_nm_per_rad": _finite_or_none(self.actual),
            "reached": self.reached,
            "wanted_nm_per_rad": _finite_or_none(self.requested),
            "fallback": self.fallback,
            "cluster": None if decision is None else decision.cluster,
            "familiar": None if decision is None else decision.familiar,
            "distance": None if decision is None else decision.distance,
            "features": None if decision is None else dict(decision.features),
            "compliance_m_per_n": self.compliance,
            "profile_m": None if profile is None else profile.length,
            "coverage": None if profile is None else profile.coverage,
            "seconds_before_landing": _finite_or_none(self.decided_before),
            "decision_us": 1e6 * self.computing,
        }


def as_good_as(one: float, other: float, tolerance: float) -> bool:
    """Return True if two stiffnesses differ by no more than a share of the larger one."""
    return abs(one - other) <= tolerance * max(one, other)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


class StiffnessScheduler:
    """Scheduler of the stiffness of soles: during each swing it scans the ground, decides and commands a stiffness.

        scheduler = StiffnessScheduler(robot, foot, ModelPolicy.load("model.json"))
        ...
        stiffness = scheduler.update("left", progress, time_left, robot, measurement)    # every tick
        plant.step(replace(command, sole_stiffness=stiffness))

    It is the stiffness-scheduling task of the paper. It has no rows in the QP, so it is not a `Task`.

    While a foot swings, its range readings and estimated poses give a profile of the ground. When the share `decide_at`
    of the single support is over, the policy decides. From then on its stiffness is commanded, as far as the actuator
    can change it before the landing. The other foot keeps its stiffness, and so does this one without a usable profile
    or decision.

    Attributes:
        policy: Policy that decides the stiffness.
        timing: Settings.
        actuator: Limits of the sole's actuator.
        steps: Records of the last swings, the latest one last; a record is added when its foot lands.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        foot: VariableStiffnessFoot,
        policy: PolicyLike,
        timing: StiffnessTiming | None = None,
    ) -> None:
        """Prepare the policy, so that the first decision is as fast as all others.

        Args:
            robot: Robot with the soles, left first; only the model is used, not the state.
            foot: Description of the feet, with the place of the range sensor, the actuator and the stiffness at the
                start.
            policy: Policy that decides the stiffness, or a plain function of a `SwingScan`.
            timing: Settings; the defaults when None.
        """
        robot.needs_feet("scheduling of stiffness")
        self.timing = StiffnessTiming() if timing is None else timing
        self.policy = as_policy(policy)
        self.actuator: StiffnessActuator = foot.actuator
        for stands in (False, True):
            if (stiffness := self.policy.standing(stands)) is not None:
                self.actuator.check(stiffness)
        self.policy.prepare(self.timing.scan)
        self._model = robot.model
        self._frames = tuple(robot.frame_id(sole.frame) for sole in robot.soles)
        self._sensor = toe_sensor(foot)
        self._scan = GroundScan(self.timing.scan)
        self._initial = float(foot.stiffness)
        self.steps: deque[StepStiffness] = deque(maxlen=HISTORY)
        self.reset()

    def begin(self, robot: Robot) -> None:
        """Begin a walk with the present command; an `InputError` for a robot of another description than its own."""
        if list(robot.model.names) != list(self._model.names):
            raise InputError(
                f"stiffness must be scheduled for the robot that walks, '{robot.name}', not for '{self._model.name}'"
            )
        self._begin()

    def reset(self, stiffness: float | None = None) -> None:
        """Clear records and scan, and command a stiffness, Nm/rad; when None, that of the foot's description."""
        start = self.actuator.check(self._initial if stiffness is None else stiffness)
        self._command = np.full(len(SIDES), start)
        self._begin()

    def _begin(self) -> None:
        self._side: int | None = None
        self._count = 0
        self._record: StepStiffness | None = None
        self._decided_at = math.nan
        self._progress = 0.0
        self.steps.clear()

    @property
    def command(self) -> Array:
        """Present stiffness command, left first, shape (2,), Nm/rad."""
        return self._command.copy()

    @property
    def decided(self) -> StepStiffness | None:
        """Decision of the present swing; None before the decision."""
        return self._record if self._side is not None else None

    def update(
        self,
        swing: str | None,
        progress: float,
        time_left: float,
        robot: Robot,
        measurement: Measurement,
        landing: Array | None = None,
        compliance: float = 0.0,
    ) -> Array:
        """Run one tick, and return the stiffness to command, left first, shape (2,), Nm/rad.

        Args:
            swing: The foot that swings, "left" or "right"; None while both are on the ground.
            progress: Share of the single support that is over, 0 to 1; ignored without a swing.
            time_left: Time until the planned landing of the swinging foot, s; ignored without a swing.
            robot: Estimated state, updated.
            measurement: Range and stiffness of the soles.
            landing: Planned centre of the swinging sole at its landing in the world, shape (3,), m.
            compliance: Depth of a foot over its load, m/N (`wbc.core.estimation.sinking`).
        """
        side = None if swing is None else SIDES.index(choose("swing foot", swing, SIDES))
        # A swing that starts over on the same side is another step: hopping, or both feet down for less than a tick.
        again = side is not None and side == self._side and progress < self._progress - 0.5
        if side != self._side or again:
            if self._side is not None:
                self._land(measurement)
            if side is not None:
                self._lift_off(side, robot)
            self._side = side
        self._set_standing(side)
        if side is not None:
            if not (math.isfinite(progress) and math.isfinite(time_left)):
                raise InputError(
                    f"progress and time left of a swing must be finite, got {progress}, {time_left} s"
                )
            self._progress = progress
            if self._record is None:
                self._look(side, robot, float(measurement.sole_range[side]))
                if progress >= self.timing.decide_at:
                    self._decide(side, time_left, robot, measurement, landing, compliance)
        return self._command.copy()

    def _set_standing(self, swing: int | None) -> None:
        """Command the stiffness of the feet that stand, where the policy says one."""
        stiffness = self.policy.standing(swing is not None)
        if stiffness is not None:
            within = self.actuator.within(stiffness)
            for side in range(len(SIDES)):
                if side != swing:
                    self._command[side] = within

    def _lift_off(self, side: int, robot: Robot) -> None:
        """Start a scan along the heading of the swinging foot."""
        self._scan.start(robot.placement(self._frames[side]).rotation[:2, 0])
        self._record = None
        self._progress = 0.0

    def _look(self, side: int, robot: Robot, reading: float) -> None:
        """Add the reading of this tick, m."""
        placement = robot.placement(self._frames[side])
        rotation = placement.rotation
        self._scan.add(placement.translation + rotation @ self._sensor, -rotation[:, 2], reading)

    def _decide(
        self,
        side: int,
        time_left: float,
        robot: Robot,
        measurement: Measurement,
        landing: Array | None,
        compliance: float,
    ) -> None:
        """Ask the policy, and command the stiffness that can be reached."""
        started = time.perf_counter()
        (profile, problem), decision = self._profile(), None
        actual, deadline = self._actual(side, measurement), self.timing.deadline
        if time_left < deadline:
            problem = f"late: {time_left:.3f} s before the landing, at least {deadline:g} s are needed"
        elif problem is None or not self.policy.needs_scan:
            here = np.array(robot.placement(self._frames[side]).translation)
            swing = SwingScan(
                side=SIDES[side],
                step=self._count,
                time=measurement.time,
                time_left=time_left,
                position=here,
                landing=here if landing is None else np.array(landing),
                actual=actual,
                profile=profile,
                compliance=compliance,
            )
            decision, problem = self._ask(swing)
        wanted = float(self._command[side])
        if problem is None and decision is not None:
            wanted = decision.stiffness
        self._set(side, wanted, actual, time_left)
        self._decided_at = measurement.time
        self._record = StepStiffness(
            side=SIDES[side],
            step=self._count,
            commanded=float(self._command[side]),
            requested=wanted,
            fallback=problem,
            decision=decision,
            profile=profile,
            compliance=compliance,
            planned_before=time_left,
            computing=time.perf_counter() - started,
        )

    def _actual(self, side: int, measurement: Measurement) -> float:
        """Return the present stiffness of a sole within the range of its actuator; the command without a reading."""
        measured = float(measurement.sole_stiffness[side])
        return self.actuator.within(float(self._command[side]) if math.isnan(measured) else measured)

    def _set(self, side: int, stiffness: float, actual: float, time_left: float) -> None:
        """Command a stiffness, or as near to it as the actuator gets within its range and before the landing."""
        target = self.actuator.within(stiffness)
        if target != self._command[side]:
            sure = max(time_left - self.timing.early_landing, 0.0)
            self._command[side] = reachable(self.actuator, actual, target, sure)

    def _profile(self) -> tuple[Profile | None, str | None]:
        """Return the profile of this swing, and what is wrong with it."""
        try:
            profile = self._scan.profile()
        except InputError as error:
            return None, f"scan too short: {error}"
        if profile.length < self.timing.min_length - ROUNDING:
            return profile, f"scan too short: {profile.length:.3f} m, {self.timing.min_length:g} m are needed"
        if profile.coverage < self.timing.min_coverage:
            return (
                profile,
                f"scan too thin: {profile.coverage:.2f} seen, {self.timing.min_coverage:g} are needed",
            )
        return profile, None

    def _ask(self, swing: SwingScan) -> tuple[StiffnessDecision | None, str | None]:
        """Return the answer of the policy, and the reason why it cannot be used."""
        try:
            answer = self.policy.decide(swing)
            if answer is None:
                return None, "the policy has no opinion"
            decision = answer if isinstance(answer, StiffnessDecision) else StiffnessDecision(answer)
        except Exception as error:  # of a policy of the user
            return None, f"the policy failed: {error}"
        if not decision.familiar:
            far = "" if decision.distance is None else f", {decision.distance:.1f} deviations away"
            return decision, f"unlike any known ground{far}"
        return decision, None

    def _land(self, measurement: Measurement) -> None:
        """Record the stiffness that the sole of the last swing has reached."""
        assert self._side is not None
        record = self._record
        if record is None:
            commanded = float(self._command[self._side])
            record = StepStiffness(
                SIDES[self._side], self._count, commanded, fallback="landed before the decision"
            )
        else:
            record = replace(record, decided_before=measurement.time - self._decided_at)
        actual = float(measurement.sole_stiffness[self._side])
        reached = as_good_as(actual, record.commanded, TOLERANCE)
        self.steps.append(replace(record, actual=actual, reached=reached))
        self._count += 1


def reachable(actuator: StiffnessActuator, actual: float, target: float, duration: float) -> float:
    """Return the stiffness nearest to a target, Nm/rad, that an actuator at rest settles to in time.

    It lies between the present stiffness, `actual`, and the target; `duration` is the time left, s. Within half of
    `TOLERANCE` it has settled. Raises `InputError` outside the range of the actuator.
    """
    state, tolerance = StiffnessState(actual, actual, actual), 0.5 * TOLERANCE

    def settles(command: float) -> bool:
        return as_good_as(actuator.advance(state, command, duration).actual, command, tolerance)

    if settles(target):
        return target
    near, far = actual, target
    while abs(far - near) > 0.1 * tolerance * max(near, far):
        middle = math.sqrt(near * far)
        near, far = (middle, far) if settles(middle) else (near, middle)
    return near
