"""Result of a walk: the record, which follows from the spec, and the wall-clock timings beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from wbc.sim.trial.spec import TrialResult


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation of a quantity over the ticks of a walk; None if it was never measured."""

    mean: float | None
    std: float | None


@dataclass(frozen=True, slots=True)
class Touchdowns:
    """Numbers of touch-downs of the swing feet."""

    early: int  # before the planned time
    on_time: int
    late: int  # after it, while reaching down
    missed: int  # no ground found; the foot was then taken to stand where it was
    forced_lift_offs: int  # lift-offs of feet that still carried load


@dataclass(frozen=True, slots=True)
class Energy:
    """Mechanical work of groups of joints, ∑ |τ q̇| over control periods."""

    legs: Annotated[float, "J"]  # of the joints between soles and base
    upper_body: Annotated[float, "J"]  # of all others


@dataclass(frozen=True, slots=True)
class Fall:
    """A fall and its onset: the last time that the DCM left its reference by 60 mm.

    Without a stabilizer there is no DCM error, and the onset is the fall itself.

    Attributes:
        cause: "dropped" where the CoM sank; else the direction of the larger excursion, or without them of the
            CoM's true velocity, seen from the stance foot: "forward", "backward", "left" or "right". A simulation
            that diverged is no fall.
    """

    reason: str  # height, tilt, down or solver: see `wbc.core.estimation.falls.FallReason`
    time: Annotated[float, "s"]  # at which the robot counted as fallen
    onset: Annotated[float, "s"]
    step: int  # number of the step at the onset, from 1; one more than the last at the end of the walk
    phase: str  # "single support", "double support" or "standing"
    share: float  # elapsed time over the duration of that phase
    dcm_forward: Annotated[float, "m"] | None  # DCM measured minus reference along the stance foot
    dcm_outward: Annotated[float, "m"] | None  # the same to its outside; both None without a stabilizer
    cause: str
    sole_roll: Annotated[float, "rad"]  # tilt of the stance sole across
    sole_pitch: Annotated[float, "rad"]  # along, toe down positive


@dataclass(frozen=True, kw_only=True)
class WalkResult(TrialResult):
    """Result of one walk. SI units throughout; all but `clock` follows from the spec, bit for bit.

    Errors are horizontal distances |reference − measured|, both axes together, in every tick until the walk ended,
    fell or diverged; the ZMP is the one that the unfiltered foot sensors give, CoM and DCM are estimated, without
    ground truth. Distance, drift, heading, errors of goal and track, sole tilt, contact area, torques and the ways that
    soles slip are true.

    Attributes:
        foot: Name of the foot.
        sole_stiffness: Stiffness of the sole hinges at the start, Nm/rad; None for rigid soles.
        policy: Stiffness policy of variable soles; None for others.
        terrain: Family of the ground.
        amplitude: Amplitude of the ground, m.
        outcome: completed, strayed, stopped, fell, diverged or unfinished. A walk is completed by a robot that has
            done all its steps, stands at its goal and has kept to its track (`wbc.sim.walks.arrival`); one that has
            done them and is elsewhere has strayed. A simulation that diverged is no fall and no
            success; an unfinished walk neither ended nor fell within its time limit; a stopped one was told to stand
            (`WalkingControl.stop`), or its trial was ended (`Trial.stop`). A driven walk has no goal and cannot stray.
        steps_planned: Number of steps of the plan.
        steps_done: Single supports that have ended; a foot that found no ground is taken to stand where it is.
        J: Objective of the paper's optimisation, see `wbc.sim.walks.result.objective`.
        fell: True if the robot fell.
        fall_reason: height, tilt, down or solver; None if it did not fall.
        fall: Time, place and cause of the fall; None if it did not fall.
        diverged: Reason why the simulation has diverged; None while it has not.
        distance: Displacement of the feet along their first heading, m.
        drift: Displacement of the feet to the left, m.
        speed: Mean speed of the base over the middle half of its distance from the start; None for less than 0.05 m.
        yaw_error: Heading of the pelvis minus that of the reference, rad.
        goal_error: Distance of the middle of the feet from that of the plan's last stand, m; None for a driven walk.
        track_error: Greatest distance of that middle from the planned track, m; None for a driven walk.
        zmp_error: Error of the ZMP, m.
        com_error: Error of the stabilizer's CoM, less the bias that it has estimated, m.
        dcm_error: Error of the DCM, less its bias, m.
        dcm_error_max: Largest error of the DCM, m.
        peak_torque_ratio: Greatest joint torque over its limit in its direction, at the ends of the control periods.
        peak_torque_joint: Joint of the greatest ratio.
        cost_of_transport: Mechanical work of the joints, ∑ |τ q̇| over control periods, over weight and distance
            between start and end; None for a robot that is less than 0.05 m from its start.
        energy: Mechanical work of the joints, of which the cost of transport is made.
        vibration: Sum of |a − a of the last sample| over joints and samples, rad/s². Samples are 0.02 s apart, and the
            acceleration a of a joint is the difference of its velocities in two samples over 0.02 s.
        slip: Way that the soles slip along the ground, both together: that of the point of a sole at its centre of
            pressure. It counts while the force sensor, or the estimate without one, shows 5 % of the weight, and the
            point moves by 0.05 m/s or more.
        torque_ratio: Joint torque over its limit, of the joint nearest to its limit in each control period.
        touchdowns: Numbers of touch-downs.
        impact: Greatest normal force on a foot from 0.05 s before its touch-down was detected until 0.1 s after, over
            the robot's weight; None without a touch-down. Forces are means over a control period.
        sole_roll: |roll| of the stance sole in single support, mean and standard deviation, rad.
        sole_pitch: |pitch| of the stance sole in single support, rad.
        contact_area: Hull of the contacts of the stance sole in the middle of single supports, m².
        stiffness: Record of each swing, in order: side, stiffness commanded and actual at the landing, decision with
            its features and its time before the landing, error of the scanned profile (`StepStiffness`,
            `wbc.sim.walks.meter`); None for soles without an actuator.
        notes: Changes that made the plan walkable, and pushes that did not begin before the end.
    """

    foot: str
    sole_stiffness: Annotated[float, "Nm/rad"] | None
    policy: str | None
    terrain: str
    amplitude: Annotated[float, "m"]
    outcome: str
    steps_planned: int
    steps_done: int
    J: float
    fell: bool
    fall_reason: str | None
    fall: Fall | None
    diverged: str | None
    distance: Annotated[float, "m"]
    drift: Annotated[float, "m"]
    speed: Annotated[float, "m/s"] | None
    yaw_error: Annotated[float, "rad"]
    goal_error: Annotated[float, "m"] | None
    track_error: Annotated[float, "m"] | None
    zmp_error: Annotated[Spread, "m"]
    com_error: Annotated[Spread, "m"]
    dcm_error: Annotated[Spread, "m"]
    dcm_error_max: Annotated[float, "m"] | None
    peak_torque_ratio: float
    peak_torque_joint: str
    cost_of_transport: float | None
    energy: Energy
    vibration: Annotated[float, "rad/s²"]
    slip: Annotated[float, "m"]
    torque_ratio: Spread
    touchdowns: Touchdowns
    impact: float | None
    sole_roll: Annotated[Spread, "rad"]
    sole_pitch: Annotated[Spread, "rad"]
    contact_area: Annotated[Spread, "m²"]
    stiffness: tuple[dict[str, Any], ...] | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        steps = f"{self.steps_done} of {self.steps_planned} steps"
        return f"WalkResult({self.robot} on {self.terrain}: {self.outcome}, {steps})"


def objective(remaining: int, zmp_error: Spread, com_error: Spread) -> float:
    """Return the objective of the paper's optimisation: remaining steps, and the errors of ZMP and CoM, m.

    J = −(10 n + 3 μ_zmp + 9 σ_zmp + 3 μ_com + 9 σ_com) with n remaining steps, and mean and standard deviation of the
    errors in m. 0 is perfect; a missed step costs more than any error.

    Source: the paper, section III-B, eq. 6. It prints the steps that were done, which with the minus sign would reward
    falling; the authors' public code counts those that remain. Their errors have a vertical part, ours are horizontal.
    """
    weighted = (3.0, zmp_error.mean), (9.0, zmp_error.std), (3.0, com_error.mean), (9.0, com_error.std)
    return -(10.0 * remaining + sum(weight * (value or 0.0) for weight, value in weighted))
