"""The paper's further policies in a walk: stiff on both feet and soft on one, stiff where the scan shows an edge."""

from __future__ import annotations

import numpy as np
from policies import EdgePolicy, PhasePolicy

from wbc.feet.sensing.scan import Profile
from wbc.tasks import SwingScan
from wbc.tasks.scheduling.policies import stiffness_policy


def scan(z: np.ndarray) -> SwingScan:
    x = 0.007 * np.arange(z.size)
    profile = Profile(x, z, np.zeros(z.size), np.ones(z.size, dtype=bool), np.array([1.0, 0.0]), 0.007)
    return SwingScan("left", 0, 0.0, 0.2, np.zeros(3), np.zeros(3), 5.0, profile)


def test_a_policy_by_phase_is_stiff_on_both_feet_and_soft_on_one() -> None:
    policy = stiffness_policy("phase", landing=300.0, double=400.0, single=5.0)
    assert isinstance(policy, PhasePolicy)
    assert (policy.standing(single=True), policy.standing(single=False)) == (5.0, 400.0)
    assert policy.decide(scan(np.zeros(30))) == 300.0 and not policy.needs_scan


def test_a_policy_by_edges_is_stiff_where_the_scan_rises() -> None:
    policy = EdgePolicy()
    assert policy.decide(scan(np.where(np.arange(30) > 15, 0.05, 0.0))) == 400.0
    assert policy.decide(scan(np.where(np.arange(30) > 15, 0.01, 0.0))) == 5.0
    assert policy.decide(scan(-np.where(np.arange(30) > 15, 0.05, 0.0))) == 5.0, "a step down is no edge"
