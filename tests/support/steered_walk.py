"""Steps of a robot that is steered, with the settings of a control where a test gives none."""

from __future__ import annotations

from wbc.walking.lipm.steered_steps import PLANNED_NEAR, SteeredSteps
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import AT_REST, DriveSettings, Velocity
from wbc.walking.steering import Steering


def steered_steps(
    reach: Reach, settings: DriveSettings | None = None, granted: Velocity = AT_REST, pace: float = 0.0
) -> SteeredSteps:
    settings = settings or DriveSettings()
    return SteeredSteps(reach, settings, Steering(settings.limits, PLANNED_NEAR), granted, pace)
