"""What became of a walk: a record that the spec decides, and beside it what the clock said."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from wbc.sim.walks.spec import WalkSpec

OUTCOMES = ("completed", "fell", "diverged", "unfinished")
"""How a walk can end. A simulation that diverged says nothing about the robot: it is no fall and no success. An
unfinished one neither ended nor fell within its time."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation of a quantity over the ticks of a walk; None where it was never measured."""

    mean: float | None
    std: float | None


@dataclass(frozen=True, slots=True)
class Touchdowns:
    """How swing feet met the ground.

    Attributes:
        early: Before their time.
        on_time: In time.
        late: Reaching down after their time.
        missed: Not at all; the foot was then taken to stand where it was.
        forced_lift_offs: Feet that lifted though they still carried load.
    """

    early: int
    on_time: int
    late: int
    missed: int
    forced_lift_offs: int


@dataclass(frozen=True, slots=True)
class Fall:
    """How a fall began: at its onset, the last time that the DCM left its reference by 60 mm.

    Attributes:
        reason: Height, tilt, DCM or solver: see `wbc.walking.falls.FallReason`.
        time: When the robot counted as fallen, s.
        onset: When it began, s.
        step: Number of the step that was being taken then, from 1; one more than all when the walk was at its end.
        phase: "single support", "double support" or "standing".
        share: Part of that phase that was over.
        dcm_forward: Excursion of the DCM along the stance foot, m: measured minus reference.
        dcm_outward: Excursion over the stance foot to the outside, m.
        direction: The larger of both: forward, backward, outward or inward.
        sole_roll: Tilt of the stance sole across, rad.
        sole_pitch: Tilt of the stance sole along, toe down positive, rad.
    """

    reason: str
    time: float
    onset: float
    step: int
    phase: str
    share: float
    dcm_forward: float
    dcm_outward: float
    direction: str
    sole_roll: float
    sole_pitch: float


@dataclass(frozen=True, slots=True)
class WallClock:
    """What the clock said; it differs from run to run.

    Attributes:
        wall_s: The whole run: building the model, walking, summing up.
        real_time_factor: Simulated time over wall time of the closed loop.
        tick_us: From measurement to command, median and 99th percentile.
        physics_share: Part of the loop's time in the simulator.
        decision_us: From a whole scan to the stiffness that is commanded, median and most; None without a decision.
    """

    wall_s: float
    real_time_factor: float
    tick_us: dict[str, float]
    physics_share: float
    decision_us: dict[str, float] | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class WalkResult:
    """What became of one walk. SI units throughout; all but `clock` follows from the spec, bit for bit.

    Errors are horizontal distances |reference − measured|, both axes together, in every tick until the walk ended,
    fell or diverged; the ZMP is the one that the unfiltered foot sensors give, CoM and DCM are estimated, without
    ground truth. Distance, drift, heading, sole tilt, contact area and torques are true.

    Attributes:
        robot: Name.
        foot: Name.
        sole_stiffness: Of the sole hinges at the start, Nm/rad; None of rigid soles.
        policy: Who set soles of variable stiffness; None of others.
        terrain: Family.
        amplitude: Of the ground, m.
        seed: Of ground and sensors.
        outcome: completed, fell, diverged or unfinished.
        steps_planned: Number of steps.
        steps_done: Single supports that have ended; a foot that found no ground is taken to stand where it is.
        J: What the paper maximises, see `objective`.
        fell: True if it fell.
        fall_reason: height, tilt, dcm or solver; None if it did not fall.
        fall: How the fall began; None if it did not fall.
        diverged: Why the simulation could not go on; None as a rule.
        seconds: Simulated time, s.
        distance: How far the feet came along their first heading, m.
        drift: How far they came to the left, m.
        yaw_error: Heading of the pelvis minus the one that the walk asked for, rad.
        zmp_error: m.
        com_error: m; of the CoM as the stabilizer takes it, less the bias that it has found.
        dcm_error: The same of the DCM, m.
        dcm_error_max: m.
        peak_torque_ratio: Greatest joint torque over its limit, at the ends of the control periods.
        peak_torque_joint: Which joint.
        torque_ratio: Joint torque over its limit, of the joint nearest to its limit in each control period.
        touchdowns: How feet met the ground.
        impact: Greatest normal force on a foot from 0.05 s before its touch-down was noticed until 0.1 s after, over
            the robot's weight; None without a touch-down. Forces are means over a control period.
        sole_roll: |roll| of the stance sole in single support, mean and standard deviation, rad.
        sole_pitch: |pitch| likewise, rad.
        contact_area: Hull of the contacts of the stance sole in the middle of single supports, m².
        stiffness: What happened to the stiffness of the sole in each swing, in order: side, stiffness commanded and
            actual at the landing, decision with its features and how long before the landing it was made, error of
            the scanned profile (`wbc.tasks.StepStiffness`, `wbc.sim.walks.soles`); None of soles without an actuator.
        failures: Ticks without a solution or with an unusable measurement.
        notes: What was changed to make the plan walkable.
        clock: What the clock said; None in a record that was read back without it.
    """

    robot: str
    foot: str
    sole_stiffness: float | None
    policy: str | None
    terrain: str
    amplitude: float
    seed: int
    outcome: str
    steps_planned: int
    steps_done: int
    J: float
    fell: bool
    fall_reason: str | None
    fall: Fall | None
    diverged: str | None
    seconds: float
    distance: float
    drift: float
    yaw_error: float
    zmp_error: Spread
    com_error: Spread
    dcm_error: Spread
    dcm_error_max: float | None
    peak_torque_ratio: float
    peak_torque_joint: str
    torque_ratio: Spread
    touchdowns: Touchdowns
    impact: float | None
    sole_roll: Spread
    sole_pitch: Spread
    contact_area: Spread
    stiffness: tuple[dict[str, Any], ...] | None
    failures: int
    notes: tuple[str, ...]
    clock: WallClock | None = None

    def record(self) -> dict[str, Any]:
        """What the spec decides, as plain values."""
        values = asdict(replace(self, clock=None))
        del values["clock"]
        values["notes"] = list(self.notes)
        values["stiffness"] = None if self.stiffness is None else list(values["stiffness"])
        return values

    def to_json(self) -> dict[str, Any]:
        """Record and clock, as plain values."""
        return self.record() | (self.clock.to_json() if self.clock is not None else {})


def objective(remaining: int, zmp_error: Spread, com_error: Spread) -> float:
    """What the paper's optimisation maximises: steps, and the errors of ZMP and CoM to tell equal numbers apart.

    J = −(10 n + 3 μ_zmp + 9 σ_zmp + 3 μ_com + 9 σ_com) with the n steps that remained to be done, and mean and
    standard deviation of the errors in m. 0 is perfect; a missed step costs more than any error.

    Args:
        remaining: Steps that were planned and not done.
        zmp_error: m.
        com_error: m.

    Source: the paper, section III-B, eq. 6. It prints the steps that were done, which with the minus sign would reward
    falling; the authors' public code counts those that remain. Their errors have a vertical part, ours are horizontal.
    """
    weighted = (3.0, zmp_error.mean), (9.0, zmp_error.std), (3.0, com_error.mean), (9.0, com_error.std)
    return -(10.0 * remaining + sum(weight * (value or 0.0) for weight, value in weighted))


def identity(spec: WalkSpec) -> dict[str, Any]:
    """The fields of a result that say what walked where."""
    stiffness = getattr(spec.foot_design(), "stiffness", None)
    return {
        "robot": spec.robot,
        "foot": spec.foot,
        "sole_stiffness": None if stiffness is None else float(stiffness),
        "policy": spec.policy,
        "terrain": spec.terrain,
        "amplitude": spec.ground().amplitude,
        "seed": spec.seed,
    }
