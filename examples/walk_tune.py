"""Tune the stabilizer: the same walk with other gains, and the tracking errors of both.

Gains are plain values: replace some of the defaults. Everything else is the same in both walks, the errors of the
sensors included. With `--view` the page has a field for each gain and a button to push the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc
from wbc.tasks import StabilizerGains
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings, walk_distance

PUSH_TIME, IMPULSE, DURATION = 2.0, 0.08, 0.1
"""Time, s, impulse, Ns/kg, and duration, s, of a push to the left, which causes errors to be corrected."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example: the walk with the default gains, and with those of the command line."""
    usual = StabilizerGains()
    options = parse(__doc__, arguments, distance=0.5, dcm_p=2.0, cop_admittance=0.01)
    tuned = replace(usual, dcm_p=options.dcm_p, cop_admittance=options.cop_admittance)
    before, after = walk(usual, options), walk(tuned, options)
    return report(
        upright=before["upright"] and after["upright"],
        default_dcm_error_mm=before["dcm_error_mm"],
        tuned_dcm_error_mm=after["dcm_error_mm"],
        default_zmp_error_mm=before["zmp_error_mm"],
        tuned_zmp_error_mm=after["zmp_error_mm"],
    )


def walk(gains: StabilizerGains, options: Any) -> dict[str, Any]:
    """Walk once and return the mean errors after the push."""
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, noise="realistic")
    robot = description.robot()
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period, WalkingControlSettings(gains=gains))

    dcm, zmp, pushed = [], [], False
    with options.watch(plant, walking) as view:
        while not walking.done:
            if not pushed and plant.time >= PUSH_TIME:
                plant.push("torso", [0.0, IMPULSE * robot.mass / DURATION, 0.0], DURATION)
                pushed = True
            plant.step(walking.command(plant.measure()))
            view.update()
            reference, output = walking.reference, walking.output
            if pushed and reference is not None and output is not None:
                dcm.append(np.linalg.norm(output.errors.dcm[:2]))
                zmp.append(np.linalg.norm((reference.pendulum.zmp - output.measured_zmp)[:2]))
    return {
        "upright": upright(plant),
        "dcm_error_mm": 1e3 * float(np.mean(dcm)),
        "zmp_error_mm": 1e3 * float(np.nanmean(zmp)),
    }


if __name__ == "__main__":
    main()
