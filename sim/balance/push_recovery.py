"""Push recovery of a standing robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.trial.push import PushSchedule, WalkPush
from wbc.sim.trial.trial import TrialHook

REST_SPEED = 0.1
"""Horizontal speed of the centre of mass below which a robot is at rest, m/s: above the sway of a standing robot with
noisy sensors, below the speed of a fall once it has begun."""


def recovers(
    spec: StandSpec, push: WalkPush, *, hooks: Sequence[TrialHook] = (), visuals: bool = True
) -> bool:
    """Return True if a standing robot recovers from a push.

    It has never fallen (`TrueFallDetector`) and its centre of mass is at rest in the end, its horizontal speed
    below 0.1 m/s. Feet may have slid, tipped or left the ground meanwhile. `hooks` look on;
    `visuals` are those of a `wbc.Plant`.
    """
    trial = StandTrial(spec, [PushSchedule([push])], visuals=visuals)
    with trial.running(hooks):
        trial.advance(spec.seconds)
    speed = float(np.linalg.norm(trial.plant.truth().com_velocity[:2]))
    return not trial.fallen and speed < REST_SPEED
