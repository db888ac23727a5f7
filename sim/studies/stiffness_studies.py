"""Studies of the sole's stiffness: walks that a stiffness model learns from, and walks that show its use."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wbc.core.errors import InputError
from wbc.core.settings import Count, Positive, settings
from wbc.feet.soles.actuator import SOFTEST, STIFFEST
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import Cell, Study, cell_name, ground_of, study_entries
from wbc.sim.terrain.spec import terrain
from wbc.sim.walks.spec import WalkSpec

DATA = Path(__file__).parent / "data"
"""Folder of results of these studies that other studies depend on."""

RANDOM_CUTOFFS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Cut-offs of the unidirectional grounds: seven between 0.0001 and 0.1 (the paper, section IV-B)."""

RANDOM_AMPLITUDES = (0.0195, 0.0381)
"""Least and greatest amplitude of the unidirectional grounds, m (the paper, section IV-B)."""

OTHER_GROUNDS = ("cylinder_obstacles", "pyramidal_stones", "floor_tiles", "cobble_stones", "ellipsoids")
"""The other grounds to learn from (the paper, figure 3)."""

OTHER_AMPLITUDES = (0.010, 0.040)
"""Least and greatest amplitude of these, m (the paper, section IV-B)."""


def training_grounds() -> dict[str, tuple[dict[str, Any], tuple[float, float]]]:
    """Return the twelve grounds of the paper's training set: name → parts of a spec, range of amplitudes (m)."""
    random = {
        f"random {cutoff:g}": ({"terrain": "random", "terrain_params": {"cutoff": cutoff}}, RANDOM_AMPLITUDES)
        for cutoff in RANDOM_CUTOFFS
    }
    return random | {name: ({"terrain": name}, OTHER_AMPLITUDES) for name in OTHER_GROUNDS}


def stiffness_grid(evaluations: int) -> tuple[float, ...]:
    """Return the stiffnesses that are tried, a geometric series of three digits, Nm/rad."""
    return tuple(float(f"{k:.3g}") for k in np.geomspace(SOFTEST, STIFFEST, evaluations))


@settings(kw_only=True)
class DatasetSize:
    """Number and size of the walks of the study 'dataset'.

    Attributes:
        seeds: Grounds of each kind and amplitude.
        amplitudes: Amplitudes of each of the twelve kinds of ground.
        evaluations: Stiffnesses that are tried on each ground.
        distance: Length of a walk, m.
        height: Amplitudes over those of the paper; higher grounds tell more where every walk is survived.
    """

    seeds: Count = 2
    amplitudes: Count = 5
    evaluations: Annotated[int, Field(ge=4)] = 16
    distance: Annotated[Positive, "m"] = 3.0
    height: Positive = 1.0


def dataset(size: DatasetSize | None = None) -> Study:
    """Return walks on soft soles of many stiffnesses: which is best on which ground, at which amplitude?

    Stiffnesses share grounds and sensor errors, so that each ground compares them with one another. The paper's 6,000
    walks (section IV-B) are 100 for each ground and amplitude: 50 stiffnesses on 2 grounds, say.
    """
    size = DatasetSize() if size is None else size
    grid = stiffness_grid(size.evaluations)
    cells = tuple(
        Cell(cell_name(name, amplitude), {**values, "amplitude": amplitude})
        for name, (values, (low, high)) in training_grounds().items()
        for amplitude in (size.height * np.linspace(low, high, size.amplitudes)).round(6).tolist()
    )
    return Study(
        name="dataset",
        about="the best stiffness for ground x amplitude: what a stiffness model learns from",
        base={"foot": "soft", "noise": "realistic", "plan": {"distance": size.distance}},
        cells=cells,
        arms={f"{k:g}": {"stiffness": k} for k in grid},
        seeds=tuple(range(size.seeds)),
        metric="J",
        reference=f"{grid[size.evaluations // 2]:g}",
    )


QUESTION_GROUNDS = (
    "boards",
    "cobble_stones",
    "cylinder_obstacles",
    "ellipsoids",
    "floor_tiles",
    "iso8608",
    "large_floor_tiles",
    "metal_sheets",
    "pyramidal_stones",
    "random",
    "roof_tiles",
    "slats",
    "small_stones",
    "steps",
    "sticks",
    "stone_bricks",
    "stones",
)
"""Every family that is rough: all but flat floor, slopes and pictures."""

HEIGHTS = (0.020, 0.030, 0.045, 0.065, 0.090)
"""Heights of the study 'halfway', m."""


def halfway(seeds: int = 3) -> Study:
    """Return walks that tell at which height of the ground half of them fall, where a sole can make a difference."""
    return Study(
        name="halfway",
        about="how high each ground must be for half of the walks to fall",
        base={
            "foot": "soft",
            "stiffness": 10.0,
            "noise": "realistic",
            "plan": {"distance": 3.0},
        },
        cells=tuple(
            Cell(cell_name(name, amplitude), {"terrain": name, "amplitude": amplitude})
            for name in QUESTION_GROUNDS
            for amplitude in HEIGHTS
            if amplitude <= terrain(name).parameters.largest_amplitude
        ),
        arms={"10": {}},
        seeds=tuple(range(seeds)),
        metric="steps_done",
    )


def halfway_heights() -> dict[str, float]:
    """Return the height of each family at which half of the walks of the study 'halfway' fell, m."""
    data = _result("halfway.json", "wbc study table halfway --of heights")
    return {name: float(height) for name, height in data["heights_m"].items()}


def half_heights(study: Study, entries: Mapping[str, Entry]) -> dict[str, float]:
    """Return the height of each ground at which half of the walks are completed, m; the study has a single arm.

    The share of completed walks is fitted by a decreasing function of the height (isotonic regression), linear between
    the heights that were tried; if it is a half over a range, the middle of the range is taken. A ground on which fewer
    than half fall at every height gets the greatest height, one on which more than half fall at every height the least.
    """
    if study.kind != WalkSpec.kind or len(study.arms) != 1:
        raise InputError(
            f"half heights come from walks with a single arm; study '{study.name}' is of the kind '{study.kind}' with "
            f"the arms {', '.join(study.arms)}"
        )
    from sklearn.isotonic import IsotonicRegression  # noqa: PLC0415 - takes a second to import

    walks: dict[str, list[tuple[float, bool]]] = {}
    for trial, entry in study_entries(study, entries):
        if entry is not None and entry.status == "done" and entry.result is not None:
            spec = trial.spec.to_json()
            done = entry.result["outcome"] == "completed"
            walks.setdefault(ground_of(trial.cell), []).append((spec["amplitude"], done))
    result = {}
    for name, rows in walks.items():
        height, done = np.array(rows, dtype=np.float64).T
        tried = np.unique(height)
        share = IsotonicRegression(increasing=False).fit(height, done).predict(tried).round(9)
        # At a plateau of a half the two directions find its two ends.
        ends = np.interp(-0.5, -share, tried), np.interp(0.5, share[::-1], tried[::-1])
        result[name] = float(np.round(np.mean(ends), 4))
    return result


def stored_stiffness(study: str) -> dict[str, float]:
    """Return the best stiffnesses of a study that the library holds: cell → Nm/rad; `InputError` without a result."""
    data = _result(f"{study}.json", f"wbc study table {study} --of best")
    return {cell: float(label["stiffness"]) for cell, label in data["labels"].items()}


def _result(file: str, command: str) -> dict[str, Any]:
    """Return the result of a study that the library holds; `InputError` if there is none."""
    path = DATA / file
    if not path.is_file():
        raise InputError(f"no {path}: `{command} --journal JOURNAL --json` prints its content")
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return data
