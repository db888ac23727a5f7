"""Error of the estimate while a robot walks, with each foot anchored at its CoP or as a whole.

The observer knows encoders, IMU and foot wrenches. What it estimates is compared with the simulator: CoM and DCM as
seen from the stance sole, which is what the stabilizer and the step adjustment act on, the tilt of the pelvis, and the
drift of the whole over a step.

Usage: python tests/benchmarks/estimation_error.py [--json] [--distance M] [--seeds N] [--noise NAME]
           [--foot NAME[:STIFFNESS] ...]
"""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

GROUNDS: dict[str, dict[str, Any]] = {
    "flat floor": {"terrain": "flat"},
    "stones of 20 mm": {"terrain": "stones", "amplitude": 0.02},
}
ANCHORS = {"at the CoP": True, "whole sole": False}
FIGURES = ("com_mm", "com_max_mm", "dcm_mm", "tilt_mrad", "forward_mm_per_step", "up_mm_per_step")


class Errors(TrialHook):
    """Collects estimate minus truth."""

    def __init__(self) -> None:
        self.com: list[float] = []
        self.dcm: list[float] = []
        self.tilt: list[float] = []
        self.base: list[np.ndarray[Any, Any]] = []
        self.completed = False

    def start(self, trial: WalkTrial) -> None:
        self._sites = [trial.plant.model.site(foot.wrench_site).id for foot in trial.plant.feet]

    def tick(self, tick: TrialTick) -> None:
        plant, walking = tick.plant, tick.walking
        if walking.reference is None:
            return
        truth, estimate = plant.truth(), walking.control.observer.robot
        self.base.append(estimate.q[:3] - truth.q[:3])
        up = estimate.placement(estimate.base_frame).rotation[2]
        true_up = pin.XYZQUATToSE3(truth.q[:7]).rotation[2]
        self.tilt.append(math.acos(min(1.0, float(up @ true_up))))
        omega = walking.walk.omega
        for side, stands in enumerate(walking.reference.contact):
            if stands and not all(walking.reference.contact):
                sole = estimate.placement(estimate.soles[side].frame).translation
                off = (estimate.com - sole) - (truth.com - plant.data.site_xpos[self._sites[side]])
                self.com.append(float(np.hypot(*off[:2])))
                self.dcm.append(
                    float(np.hypot(*(off + (estimate.com_velocity - truth.com_velocity) / omega)[:2]))
                )

    def end(self, result: WalkResult) -> None:
        self.completed = result.outcome == "completed"
        self.steps = max(1, result.steps_done)


def measure(
    foot: str, ground: dict[str, Any], at_cop: bool, distance: float, seeds: int, noise: str
) -> dict[str, Any]:
    """Errors of some walks with one sole on one ground; means over walks that were completed."""
    name, _, stiffness = foot.partition(":")
    rows = []
    for seed in range(100, 100 + seeds):
        errors = Errors()
        spec = WalkSpec(
            foot=name,
            stiffness=float(stiffness) if stiffness else None,
            seed=seed,
            noise=noise,
            plan=WalkPlan(distance=distance),
            changes={"observer.anchor_at_cop": at_cop},
            **ground,
        )
        WalkTrial(spec).run([errors])
        if errors.completed:
            drift = 1e3 * (errors.base[-1] - errors.base[0]) / errors.steps
            com, dcm, tilt = (1e3 * np.array(values) for values in (errors.com, errors.dcm, errors.tilt))
            rows.append((com.mean(), com.max(), dcm.mean(), tilt.mean(), drift[0], drift[2]))
    means = np.mean(rows, axis=0) if rows else np.full(len(FIGURES), np.nan)
    return {"completed": len(rows), "walks": seeds} | {
        figure: round(float(value), 2) for figure, value in zip(FIGURES, means, strict=True)
    }


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument("--distance", type=float, default=1.45, help="of the walks, m; default %(default)s")
    parser.add_argument("--seeds", type=int, default=5, help="walks of each kind; default %(default)s")
    parser.add_argument(
        "--foot",
        nargs="+",
        default=["flat", "rigid", "soft:1", "soft:5", "soft:80"],
        help="default %(default)s",
    )
    parser.add_argument("--noise", default="realistic", help="of the sensors, or none; default %(default)s")
    options = parser.parse_args()
    rows = []
    for foot in options.foot:
        for ground, values in GROUNDS.items():
            for anchor, at_cop in ANCHORS.items():
                facts = measure(foot, values, at_cop, options.distance, options.seeds, options.noise)
                rows.append({"foot": foot, "ground": ground, "anchor": anchor} | facts)
    if options.json:
        print(json.dumps({"rows": rows}))
        return
    names = list(rows[0])
    print("| " + " | ".join(names) + " |\n|" + "---|" * len(names))
    for row in rows:
        print("| " + " | ".join(str(value) for value in row.values()) + " |")


if __name__ == "__main__":
    main()
