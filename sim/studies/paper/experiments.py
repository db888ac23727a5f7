"""Experiments of the paper and the questions beside them, as studies: Fig. 5, Table IV, authority of the stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wbc.sim.studies.paper.optimization import PAPER_CHANGES
from wbc.sim.studies.stiffness_studies import QUESTION_GROUNDS, halfway_heights, stored_stiffness
from wbc.sim.studies.study import FRESH_SEED, Cell, Study, cell_name
from wbc.sim.walks.presets import FAST_LANDING, FRIZZA

FIG5_AMPLITUDES = (0.020, 0.025, 0.030, 0.035)
"""Amplitudes of the unidirectional grounds of Fig. 5, m."""

FIG5_CUTOFFS = (0.0002, 0.0007, 0.002, 0.007, 0.02, 0.07, 0.2)
"""Cut-offs of Fig. 5. The paper says seven and prints five (0.0002, 0.0007, 0.002, 0.007 and 0.2); 0.02 and 0.07
complete its series of about a third of a decade."""

TABLE_IV: Mapping[str, tuple[float, ...]] = {
    "stones": (0.055, 0.050, 0.045, 0.040),
    "roof_tiles": (0.055, 0.050, 0.045, 0.040),
    "stone_bricks": (0.055, 0.050, 0.045, 0.040),
    "small_stones": (0.025, 0.020, 0.015, 0.010),
    "large_floor_tiles": (0.025, 0.020, 0.015, 0.010),
}
"""Grounds and heights of Table IV, m. Its last ground is "floor tiles" there and "large floor tiles" in the text."""

AUTHORITY_STIFFNESSES = (1.0, 5.0, 20.0, 80.0, 400.0, 2000.0)
"""Stiffnesses of the study 'authority', Nm/rad: a series over the whole range."""

FIRST_HEIGHTS: Mapping[str, float] = {
    "boards": 0.050,
    "cylinder_obstacles": 0.060,
    "roof_tiles": 0.055,
    "stones": 0.055,
}
"""Families on which a trial of 36 layouts found differences, and its heights (m), at which 19 to 92 % of the walks were
completed. They are walked first, and the oracle's patchwork is of them."""

FIRST_FAMILIES = tuple(FIRST_HEIGHTS)

SECOND_FAMILIES = ("ellipsoids", "metal_sheets", "sticks", "floor_tiles", "cobble_stones", "stone_bricks")
"""Families on which walks of the study 'halfway' fell: walked next."""

DAMPED_STIFFNESSES = (5.0, 80.0, 400.0)
"""Stiffnesses of the study 'damping', Nm/rad."""


def _law(gains: str) -> dict[str, Any]:
    """Return the parts of a spec of a law: the default one, the paper's, or that without bias estimate."""
    if gains == "default":
        return {"gains": gains}
    own = {"changes": dict(PAPER_CHANGES)} if gains == "no_bias" else {}
    return {"gains": gains, "gait": dict(FAST_LANDING), **own}


def _soles() -> dict[str, dict[str, Any]]:
    return {
        "flat": {"foot": "flat"},
        "rigid": {"foot": "rigid"},
        "soft 5": {"foot": "soft", "stiffness": 5.0},
        "variable": {"foot": "variable"},
    }


def _with_tuned(study: Study) -> Study:
    """Return a study with the arm "tuned fixed": on each ground the stiffness that 'tuned_fixed' found best there."""
    best = stored_stiffness("tuned_fixed")
    cells = tuple(
        replace(cell, arm_values={"tuned fixed": {"stiffness": best[cell.name]}}) for cell in study.cells
    )
    return replace(study, cells=cells, arms={**study.arms, "tuned fixed": {"foot": "soft"}})


def _fig5_cells() -> tuple[Cell, ...]:
    return tuple(
        Cell(
            cell_name(f"random {cutoff:g}", amplitude),
            {"terrain": "random", "amplitude": amplitude, "terrain_params": {"cutoff": cutoff}},
        )
        for cutoff in FIG5_CUTOFFS
        for amplitude in FIG5_AMPLITUDES
    )


def _table4_cells() -> tuple[Cell, ...]:
    return tuple(
        Cell(cell_name(name, amplitude), {"terrain": name, "amplitude": amplitude})
        for name, amplitudes in TABLE_IV.items()
        for amplitude in amplitudes
    )


def fig5(seeds: int = 10, gains: str = "default") -> Study:
    """Return the paper's experiment 1: walks over unidirectional grounds of four amplitudes and seven cut-offs.

    `gains` is the law: "default", "frizza" for the paper's, or "no_bias" for the paper's without its bias estimate.
    """
    study = Study(
        name="fig5" if gains == "default" else f"fig5_{gains}",
        about=f"the paper's Fig. 5: unidirectional grounds, amplitudes x cut-offs ({gains} law)",
        base={"noise": "realistic", "plan": {"distance": 3.0}, **_law(gains)},
        cells=_fig5_cells(),
        arms=_soles(),
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="soft 5",
    )
    return _with_tuned(study) if gains == "default" else study


def table4(seeds: int = 20, gains: str = "default") -> Study:
    """Return the paper's experiment 2: walks over five grounds of four heights, with its decision at 75 %, too.

    `gains` is the law: "default", "frizza" for the paper's, or "no_bias" for the paper's without its bias estimate.
    """
    late = {name: value for name, value in FRIZZA["changes"].items() if name.startswith("stiffness.")}
    study = Study(
        name="table4" if gains == "default" else f"table4_{gains}",
        about=f"the paper's Table IV: five grounds x four heights ({gains} law)",
        base={"noise": "realistic", "plan": {"distance": 3.0}, **_law(gains)},
        cells=_table4_cells(),
        arms={**_soles(), "variable, 75 % at once": {"foot": "paper", "changes": late}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="soft 5",
    )
    return _with_tuned(study) if gains == "default" else study


TUNED_CHOICES = (1.0, 5.0, 30.0, 200.0, 2000.0)
"""Stiffnesses that are tried to tune a fixed one to each ground of the experiments, Nm/rad."""


def tuned_fixed(seeds: int = 2) -> Study:
    """Return walks that tune a fixed stiffness to each ground of both experiments, on other layouts than theirs."""
    return Study(
        name="tuned_fixed",
        about="the best fixed stiffness on each ground of 'fig5' and 'table4', on layouts of its own",
        base={"foot": "soft", "noise": "realistic", "plan": {"distance": 3.0}},
        cells=(*_table4_cells(), *_fig5_cells()),
        arms={f"{k:g}": {"stiffness": k} for k in TUNED_CHOICES},
        seeds=tuple(range(seeds)),
        metric="J",
        reference=f"{TUNED_CHOICES[2]:g}",
    )


def authority_heights() -> dict[str, float]:
    """Return the height of each family in the study 'authority', m: of the study 'halfway', or of `FIRST_HEIGHTS`."""
    return {**halfway_heights(), **FIRST_HEIGHTS}


def authority(seeds: int = 40) -> Study:
    """Return walks that tell which stiffness is best on which family, over the whole range and beside a rigid sole."""
    heights = authority_heights()
    order = dict.fromkeys((*FIRST_FAMILIES, *SECOND_FAMILIES, *QUESTION_GROUNDS))
    return Study(
        name="authority",
        about="which stiffness from 1 to 2,000 is best on which family, at heights that half of the walks survive",
        base={"noise": "realistic", "plan": {"distance": 3.0}},
        cells=tuple(
            Cell(cell_name(name, heights[name]), {"terrain": name, "amplitude": heights[name]})
            for name in order
        ),
        arms={"rigid": {"foot": "rigid"}}
        | {f"{k:g}": {"foot": "soft", "stiffness": k} for k in AUTHORITY_STIFFNESSES},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="80",
    )


def damping(seeds: int = 20) -> Study:
    """Return walks that compare the paper's dampers, b = 2 Nms/rad at any stiffness, with half of the critical damping.

    Those with b = 2 are walks of the study 'authority': in one journal they are walked once.
    """
    heights = authority_heights()
    return Study(
        name="damping",
        about="dampers of 2 Nms/rad at any stiffness against half of the critical damping",
        base={"foot": "soft", "noise": "realistic", "plan": {"distance": 3.0}},
        cells=tuple(
            Cell(f"{name}, k = {k:g}", {"terrain": name, "amplitude": heights[name], "stiffness": k})
            for name in FIRST_FAMILIES
            for k in DAMPED_STIFFNESSES
        ),
        arms={"b = 2": {}, "half critical": {"foot_changes": {"damping_ratio": 0.5}}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="b = 2",
    )


ORACLE_SEED = 1000
"""First seed of the study 'oracle': its stiffnesses come from layouts with smaller seeds."""


ORACLE_STIFFNESS = {"boards": 80.0, "cylinder_obstacles": 80.0, "roof_tiles": 5.0, "stones": 5.0}
"""Stiffness that the oracle sets on each family of its patchwork, Nm/rad: the better one of 5 and 80 on
the first 20 layouts of the study 'authority'."""


def oracle(seeds: int = 40) -> Study:
    """Return walks of the oracle over a patchwork, beside fixed stiffnesses: the most that scheduling can win."""
    fixed = {f"{k:g}": {"foot": "soft", "stiffness": k} for k in AUTHORITY_STIFFNESSES}
    policy: dict[str, Any] = {
        "foot": "variable",
        "policy": "oracle",
        "policy_params": ORACLE_STIFFNESS,
    }
    arms: dict[str, dict[str, Any]] = {"oracle": policy, "model": {"foot": "variable"}, **fixed}
    heights = authority_heights()
    highest = max(heights[name] for name in FIRST_FAMILIES)
    shares = " ".join(f"{name}:{heights[name] / highest:.3g}" for name in FIRST_FAMILIES)
    return Study(
        name="oracle",
        about="an oracle that knows family and place against the best single stiffness and the scan-driven model",
        base={"noise": "realistic", "plan": {"distance": 3.0}},
        cells=(
            Cell(
                "patchwork",
                {"terrain": "patchwork", "amplitude": highest, "terrain_params": {"families": shares}},
            ),
        ),
        arms=arms,
        seeds=tuple(range(ORACLE_SEED, ORACLE_SEED + seeds)),
        reference="80",
    )
