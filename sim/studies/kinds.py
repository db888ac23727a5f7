"""Kinds of trials: a walk, a stand, and a clip that is tracked."""

from __future__ import annotations

from wbc.base.settings import units
from wbc.sim.balance.standing import StandResult, StandSpec, StandTrial
from wbc.sim.balance.tracking import MotionSpec, TrackResult, TrackTrial
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TimeoutHook, TrialKind, register_trial
from wbc.sim.trial.spec import TrialResult
from wbc.sim.trial.trial import AnyTrial
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial


def run(trial: AnyTrial, check: TimeoutCheck) -> Outcome:
    """Run a trial of the library: its result, and what the clock said."""
    try:
        result: TrialResult = trial.run([TimeoutHook(check)])
    except DivergedError:
        return Outcome("diverged")
    return Outcome("done" if trial.diverged is None else "diverged", result.record(), result.timings())


def walk_outcome(spec: WalkSpec, check: TimeoutCheck) -> Outcome:
    """Run a walk as a trial."""
    return run(WalkTrial(spec, visuals=False), check)


def stand_outcome(spec: StandSpec, check: TimeoutCheck) -> Outcome:
    """Run a stand as a trial."""
    return run(StandTrial(spec, visuals=False), check)


def track_outcome(spec: MotionSpec, check: TimeoutCheck) -> Outcome:
    """Track the clip in a file as a trial."""
    return run(TrackTrial(spec.clip(), spec, visuals=False), check)


register_trial(
    WalkSpec.kind, TrialKind(WalkSpec.from_json, walk_outcome, units(WalkSpec) | units(WalkResult))
)
register_trial(
    StandSpec.kind,
    TrialKind(StandSpec.from_json, stand_outcome, units(StandSpec) | units(StandResult), "com_error"),
)
register_trial(
    MotionSpec.kind,
    TrialKind(MotionSpec.from_json, track_outcome, units(MotionSpec) | units(TrackResult), "joint_rms"),
)
