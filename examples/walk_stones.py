"""Walk on stones, on soft feet: a whole simulated walk as one call.

The arguments of `walk` are the fields of a `WalkSpec`, which fixes the result; the same spec gives the same result, bit
for bit, here and in a sweep over thousands of them. Compare soles: `--foot flat` against `--foot soft`, at several
`--seed`s. The robot does not know the stones: it walks as on a floor and measures when its feet land.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from _common import parse, report

from wbc.sim import walk


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(
        __doc__,
        arguments,
        distance=1.0,
        amplitude=0.02,
        seed=7,
        foot=("soft", "flat", "rigid", "variable"),
    )
    result = walk(
        robot="hrp4_class",
        foot=options.foot,
        terrain="stones",
        amplitude=options.amplitude,  # highest stone, m
        seed=options.seed,
        distance=options.distance,
        hooks=options.hooks(),
    )
    landed = result.touchdowns
    return report(
        upright=not result.fell,
        outcome=result.outcome,
        steps=result.steps_done,
        distance_m=result.distance,
        zmp_error_mm=1e3 * (result.zmp_error.mean or 0.0),
        early_landings=landed.early,
        late_landings=landed.late,
        contact_area_cm2=1e4 * (result.contact_area.mean or 0.0),
    )


if __name__ == "__main__":
    main()
