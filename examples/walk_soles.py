"""Set the soles while they swing: a policy of your own, next to the learnt model and a fixed stiffness.

A policy gets the scan of the toe's range sensor during a swing and returns a stiffness. It is a class with one method,
or a function. Compare `--policy own`, `--policy model` and `--policy fixed` on the same `--seed`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report

from wbc.feet import roughness
from wbc.sim import WalkPlan, WalkSpec, WalkTrial
from wbc.tasks import StiffnessPolicy, SwingScan


class SofterWhereItIsRough(StiffnessPolicy):
    """Stiff on level ground, soft from a roughness of 4 mm on, and in between on a straight line."""

    def decide(self, swing: SwingScan) -> float:
        """Return the stiffness of the swinging sole, Nm/rad."""
        assert swing.profile is not None  # called only with a scan that is long enough
        deviation = float(
            roughness(swing.profile.x, swing.profile.z)["Sq"]
        )  # m, after the low-pass of the foot's length
        return max(2.0, 60.0 * (1.0 - deviation / 0.004))


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(
        __doc__, arguments, distance=1.0, amplitude=0.03, seed=7, policy=("own", "model", "fixed")
    )
    spec = WalkSpec(
        foot="variable",
        policy=None if options.policy == "own" else options.policy,
        terrain="stones",
        amplitude=options.amplitude,  # highest stone, m
        seed=options.seed,
        plan=WalkPlan(distance=options.distance),
    )
    trial = WalkTrial(spec, policy=SofterWhereItIsRough() if options.policy == "own" else None)
    result = trial.run(options.hooks())
    assert result.stiffness is not None
    decided = [step["commanded_nm_per_rad"] for step in result.stiffness if step["fallback"] is None]
    return report(
        upright=not result.fell,
        policy=result.policy,
        steps=result.steps_done,
        decided=len(decided),
        softest_nm_per_rad=min(decided, default=None),
        stiffest_nm_per_rad=max(decided, default=None),
        zmp_error_mm=1e3 * (result.zmp_error.mean or 0.0),
        dcm_error_mm=1e3 * (result.dcm_error.mean or 0.0),
    )


if __name__ == "__main__":
    main()
