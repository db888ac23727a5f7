"""Experiments of the paper and the questions beside them, as studies: Fig. 5, Table IV, authority of the stiffness."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wbc.core.errors import InputError
from wbc.sim.studies.stiffness_studies import (
    DATA,
    QUESTION_GROUNDS,
    halfway_heights,
    tuned_fixed_known,
    tuned_fixed_stiffness,
)
from wbc.sim.studies.study import FRESH_SEED, Cell, Study, cell_name
from wbc.sim.studies.study_table import StudyTable
from wbc.sim.walks.presets import FAST_LANDING, FRIZZA, PAPER_GAINS

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

TABLE_IV_STEPS: Mapping[str, tuple[tuple[int, int, int], ...]] = {
    "stones": ((20, 6, 6), (22, 7, 7), (22, 22, 7), (22, 22, 8)),
    "roof_tiles": ((8, 7, 5), (22, 8, 9), (22, 9, 12), (22, 22, 16)),
    "stone_bricks": ((8, 6, 3), (22, 5, 4), (22, 6, 6), (22, 22, 6)),
    "small_stones": ((9, 7, 6), (13, 9, 7), (22, 13, 7), (22, 22, 7)),
    "large_floor_tiles": ((20, 8, 5), (22, 12, 6), (22, 19, 6), (22, 22, 7)),
}
"""Steps of 22 in the paper's Table IV, one walk each: variable, soft, flat, at the heights of `TABLE_IV`."""

AUTHORITY_STIFFNESSES = (1.0, 5.0, 20.0, 80.0, 400.0, 2000.0)
"""Stiffnesses of the study 'authority', Nm/rad: a series over the whole range."""


def _law(gains: str) -> dict[str, Any]:
    """Return the parts of a spec of a law: the default one, or the paper's with its gains."""
    if gains == "default":
        return {"gains": "default"}
    return {"gains": "legacy", "gait": dict(FAST_LANDING), "changes": dict(PAPER_GAINS)}


def _soles() -> dict[str, dict[str, Any]]:
    return {
        "flat": {"foot": "flat"},
        "rigid": {"foot": "rigid"},
        "soft 5": {"foot": "soft", "stiffness": 5.0},
        "variable": {"foot": "variable"},
    }


def _with_tuned(study: Study) -> Study:
    """Return a study with the arm "tuned fixed" in the cells whose best fixed stiffness is known."""
    if not tuned_fixed_known():
        return study
    best = tuned_fixed_stiffness()
    cells = tuple(
        replace(
            cell,
            arms=None if cell.name in best else tuple(study.arms),
            arm_values={"tuned fixed": {"stiffness": best[cell.name]}} if cell.name in best else {},
        )
        for cell in study.cells
    )
    if all(cell.arms is not None for cell in cells):
        return study
    return replace(study, cells=cells, arms={**study.arms, "tuned fixed": {"foot": "soft"}})


def fig5(seeds: int = 10, gains: str = "default") -> Study:
    """Return the paper's experiment 1: walks over unidirectional grounds of four amplitudes and seven cut-offs."""
    return _with_tuned(
        Study(
            name="fig5" if gains == "default" else f"fig5_{gains}",
            about=f"the paper's Fig. 5: unidirectional grounds, amplitudes x cut-offs ({gains} law)",
            base={"noise": "realistic", "plan": {"distance": 3.0}, "terrain": "random", **_law(gains)},
            cells=tuple(
                Cell(
                    cell_name(f"random {cutoff:g}", amplitude),
                    {"amplitude": amplitude, "terrain_params": {"cutoff": cutoff}},
                )
                for cutoff in FIG5_CUTOFFS
                for amplitude in FIG5_AMPLITUDES
            ),
            arms=_soles(),
            seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
            reference="soft 5",
        )
    )


def table4(seeds: int = 20, gains: str = "default") -> Study:
    """Return the paper's experiment 2: walks over five grounds of four heights, with its decision at 75 %, too."""
    late = {name: value for name, value in FRIZZA["changes"].items() if name.startswith("stiffness.")}
    arms = {**_soles(), "variable, 75 % at once": {"foot": "paper", "changes": late}}
    return _with_tuned(
        Study(
            name="table4" if gains == "default" else f"table4_{gains}",
            about=f"the paper's Table IV: five grounds x four heights ({gains} law)",
            base={"noise": "realistic", "plan": {"distance": 3.0}, **_law(gains)},
            cells=tuple(
                Cell(cell_name(name, amplitude), {"terrain": name, "amplitude": amplitude})
                for name, amplitudes in TABLE_IV.items()
                for amplitude in amplitudes
            ),
            arms=arms,
            seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
            reference="soft 5",
        )
    )


def authority(seeds: int = 40) -> Study:
    """Return walks that tell which stiffness is best on which family, over the whole range and beside a rigid sole.

    The damping is the paper's, and at three stiffnesses also a ratio of the critical one.
    """
    arms: dict[str, dict[str, Any]] = {"rigid": {"foot": "rigid"}}
    for k in AUTHORITY_STIFFNESSES:
        arms[f"{k:g}"] = {"foot": "soft", "stiffness": k}
    for k in (5.0, 80.0, 400.0):
        arms[f"{k:g}, ratio 0.5"] = {"foot": "soft", "stiffness": k, "foot_changes": {"damping_ratio": 0.5}}
    heights = halfway_heights()
    return Study(
        name="authority",
        about="which stiffness from 1 to 2,000 is best on which family, at heights that half of the walks survive",
        base={"noise": "realistic", "plan": {"distance": 3.0}},
        cells=tuple(
            Cell(cell_name(name, heights[name]), {"terrain": name, "amplitude": heights[name]})
            for name in QUESTION_GROUNDS
        ),
        arms=arms,
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="80",
    )


ORACLE_FAMILIES = ("boards", "cylinder_obstacles", "roof_tiles", "stones")
"""Families of the patchwork that the oracle walks over."""

ORACLE_SEED = 1000
"""First seed of the study 'oracle': its stiffnesses come from layouts with smaller seeds."""


def oracle(seeds: int = 40) -> Study:
    """Return walks of the oracle over a patchwork, beside fixed stiffnesses: the most that scheduling can win.

    The oracle knows the best stiffness of each family from a result of the study 'authority'; until there is one, 5
    Nm/rad where tiles are round and 80 elsewhere.
    """
    path = DATA / "authority.json"
    best = {"boards": 80.0, "cylinder_obstacles": 80.0, "roof_tiles": 5.0, "stones": 5.0}
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))["best"]
        try:
            best = {name: float(found[name]) for name in ORACLE_FAMILIES}
        except KeyError as error:
            raise InputError(f"{path} has no best stiffness of {error}") from error
    fixed = {f"{k:g}": {"foot": "soft", "stiffness": k} for k in AUTHORITY_STIFFNESSES}
    known: dict[str, Any] = {"foot": "variable", "policy": "oracle", "policy_params": best}
    arms: dict[str, dict[str, Any]] = {"oracle": known, "model": {"foot": "variable"}, **fixed}
    heights = halfway_heights()
    highest = max(heights[name] for name in ORACLE_FAMILIES)
    shares = " ".join(f"{name}:{heights[name] / highest:.3g}" for name in ORACLE_FAMILIES)
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


def table_four(table: StudyTable) -> str:
    """Return the table of the study 'table4' beside the paper's Table IV, as Markdown: steps of 22 in the mean."""
    cells, arms = table.by_name, list(table.study.arms)
    lines = [
        f"| | {' | '.join(arms)} | variable, soft, flat of the paper |",
        "|---|" + "---:|" * (len(arms) + 1),
    ]
    for name, amplitudes in TABLE_IV.items():
        for amplitude, paper in zip(amplitudes, TABLE_IV_STEPS[name], strict=True):
            row = cell_name(name, amplitude)
            if row in table.rows:
                ours = [cells[row, arm].estimate.text() if (row, arm) in cells else "" for arm in arms]
                lines.append(f"| {row} | {' | '.join(ours)} | {', '.join(map(str, paper))} |")
    return "\n".join(lines)
