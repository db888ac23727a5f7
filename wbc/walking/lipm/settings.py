"""Settings of planned steps, and the preview and step adjustment that follow from them for one robot."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Annotated

from wbc.base.settings import Ratio, Share, in_units, settings
from wbc.core.robot import Robot
from wbc.walking.lipm.adjustment import AdjustmentSettings, StepAdjuster
from wbc.walking.lipm.preview import PreviewController, PreviewSettings
from wbc.walking.lipm.schedule import ZmpTarget
from wbc.walking.plans.gait import SizeOrZero
from wbc.walking.plans.reach import Reach

CLIMBING_INWARD = 0.01
"""Greatest distance of the planned ZMP to the inner side in a plan with stairs, m: the further inward the ZMP, the more
torque the hips need, and on a stair they have none to spare."""


@settings
class PhaseSettings:
    """Loads and times at which phases change. Loads are over the robot's weight.

    Attributes:
        touch_down: Load at which a swing foot has met the ground; 0.08 is 30 N of 39 kg.
        early: Ratio of the swing before which a load is a stumble, not a touch-down.
        lift_off: Greatest load of the foot that leaves.
        stance: Least load of the foot that stays.
        max_wait: Longest time that lift-off waits for the loads `lift_off` and `stance`, s; then the foot lifts.
        max_late: Longest time that a foot searches for ground, s; then it is taken to stand where it is.
    """

    touch_down: Ratio = 0.08
    early: Share = 0.6
    lift_off: Share = 0.25
    stance: Share = 0.5
    max_wait: Annotated[SizeOrZero, "s"] = 0.3
    max_late: Annotated[SizeOrZero, "s"] = 0.5


@settings
class WalkSettings:
    """Settings of planned steps.

    Attributes:
        preview: Preview control; the ZMP is planned 20 mm to the inner side of a stance foot, because rough ground tips
            robots outward. It stays one margin within the margin of a sole, that of the preview or of the adjustment,
            whichever is greater: 10 mm to the inner side of `g1`, 18 mm of `hrp4_class`.
        phases: Loads and times at which phases change.
        adjustment: Step adjustment; None for none.
        ground_memory: Share of the unexpected height of a landing by which the next landings are moved.
        rise_memory: Share of that height by which the expected rise from step to step changes. Without it feet would
            land too early where the ground keeps rising, or where the estimate drifts (by one or two mm a step).
    """

    preview: PreviewSettings = field(default_factory=lambda: PreviewSettings(target=ZmpTarget(inward=0.02)))
    phases: PhaseSettings = field(default_factory=PhaseSettings)
    adjustment: AdjustmentSettings | None = field(default_factory=AdjustmentSettings)
    ground_memory: Share = 0.5
    rise_memory: Share = 0.1


def law_of(
    settings: WalkSettings, robot: Robot, com_height: float, reach: Reach, *, climbs: bool
) -> tuple[PreviewController, StepAdjuster | None]:
    """Return preview and step adjustment of a robot, for a plan that climbs or not, with the CoM at a height, m."""
    lengths = {"m": robot.length_scale}  # a small robot has its share of each
    preview = in_units(settings.preview, lengths)
    adjustment = settings.adjustment and in_units(settings.adjustment, lengths)
    margin, inward = preview.margin, preview.target.inward
    if climbs:  # as planned: on rough ground, landings make a plan that climbs, too
        inward = min(inward, CLIMBING_INWARD)
    # Step adjustment answers what no ZMP within the sole's margin can. Without room on a side it would answer every
    # error of the DCM to that side, the constant ones of sensors as well, and the walk would leave its line. The room
    # is one margin, or half of what the margin leaves of a sole that is narrower than six margins.
    margin = margin if adjustment is None else max(margin, adjustment.margin)
    left = 0.5 * min(width for _, width in reach.soles) - margin
    most = max(left - margin, 0.5 * left, 0.0)
    target = replace(preview.target, inward=max(-most, min(most, inward)))
    planner = PreviewController(reach.soles, com_height, replace(preview, target=target))
    return planner, None if adjustment is None else StepAdjuster(com_height, reach, target, adjustment)
