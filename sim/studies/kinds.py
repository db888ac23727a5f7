"""Kinds of trials: a walk, a stand, and a clip that is tracked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wbc.base.settings import units
from wbc.sim.balance.standing import StandResult, StandSpec, StandTrial
from wbc.sim.balance.tracking import MotionSpec, TrackResult, TrackTrial
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TimeoutHook, TrialKind, register_trial
from wbc.sim.trial.spec import TrialResult, TrialSpec
from wbc.sim.trial.trial import AnyTrial
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial


def _register(
    spec: type[TrialSpec], result: type[TrialResult], build: Callable[[Any], AnyTrial], metric: str
) -> None:
    """Register a kind of trial of the library by the classes of its specs and results."""

    def run(given: Any, check: TimeoutCheck) -> Outcome:
        try:
            found: TrialResult = (trial := build(given)).run([TimeoutHook(check)])
        except DivergedError:
            return Outcome("diverged")
        return Outcome("done" if trial.diverged is None else "diverged", found.record(), found.timings())

    register_trial(spec.kind, TrialKind(spec.from_json, run, units(spec) | units(result), metric))


_register(WalkSpec, WalkResult, lambda spec: WalkTrial(spec, visuals=False), "steps_done")
_register(StandSpec, StandResult, lambda spec: StandTrial(spec, visuals=False), "com_error")
_register(MotionSpec, TrackResult, lambda spec: TrackTrial(spec.clip(), spec, visuals=False), "joint_rms")
