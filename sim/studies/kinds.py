"""Kinds of trials: a walk, a stand, and a clip that is tracked."""

from __future__ import annotations

from typing import Any

from wbc.base.settings import to_json, units
from wbc.sim.balance.standing import StandResult, StandSpec, StandTrial
from wbc.sim.balance.tracking import MotionSpec, TrackResult, TrackTrial
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TimeoutHook, TrialKind, register_trial
from wbc.sim.trial.trial import AnyTrial
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

CLOCK = ("real_time_factor", "tick_us")
"""Parts of a result that are wall-clock timings."""


def walk_outcome(spec: WalkSpec, check: TimeoutCheck) -> Outcome:
    """Run a walk as a trial."""
    result = WalkTrial(spec, visuals=False).run([TimeoutHook(check)])
    assert result.clock is not None
    return Outcome(
        "diverged" if result.outcome == "diverged" else "done", result.record(), to_json(result.clock)
    )


def stand_outcome(spec: StandSpec, check: TimeoutCheck) -> Outcome:
    """Run a stand as a trial."""
    return _outcome(StandTrial(spec, visuals=False), check)


def track_outcome(spec: MotionSpec, check: TimeoutCheck) -> Outcome:
    """Track the clip in a file as a trial."""
    return _outcome(TrackTrial(spec.clip(), spec, visuals=False), check)


def _outcome(trial: AnyTrial, check: TimeoutCheck) -> Outcome:
    """Run a trial, and split its result into what follows from the spec and what the clock said."""
    try:
        result: dict[str, Any] = to_json(trial.run([TimeoutHook(check)]))
    except DivergedError:
        return Outcome("diverged")
    clock = {name: result.pop(name) for name in CLOCK if name in result}
    return Outcome("diverged" if trial.plant.diverged else "done", result, clock)


register_trial(
    WalkSpec.kind, TrialKind(WalkSpec.from_json, walk_outcome, units(WalkSpec) | units(WalkResult))
)
register_trial(
    StandSpec.kind,
    TrialKind(StandSpec.from_json, stand_outcome, units(StandSpec) | units(StandResult), "com_error_mm"),
)
register_trial(
    MotionSpec.kind,
    TrialKind(MotionSpec.from_json, track_outcome, units(MotionSpec) | units(TrackResult), "joint_rms_deg"),
)
