"""Studies of the sole's stiffness: the walks that a model learns from, and those that show what it is good for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wbc.core.errors import InputError, finite_scalar
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.model import DEFAULT_TABLE
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import FRESH_SEED, Cell, Study, cell_name, found_entries, ground_of
from wbc.sim.terrain import terrain
from wbc.sim.walks.spec import WalkSpec

DATA = Path(__file__).parent / "data"
"""What these studies have found, and others rest on."""

RANDOM_CUTOFFS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Cut-offs of the unidirectional grounds: seven between 0.0001 and 0.1 (the paper, section IV-B)."""

RANDOM_AMPLITUDES = (0.0195, 0.0381)
"""Least and greatest amplitude of the unidirectional grounds, m (the paper, section IV-B)."""

OTHER_GROUNDS = ("cylinder_obstacles", "pyramidal_stones", "floor_tiles", "cobble_stones", "ellipsoids")
"""The other grounds to learn from (the paper, figure 3)."""

OTHER_AMPLITUDES = (0.010, 0.040)
"""Least and greatest amplitude of these, m (the paper, section IV-B)."""

SOFTEST, STIFFEST = 1.0, 80.0
"""Stiffnesses that are tried lie between these, Nm/rad: below the least the sole hangs like a string and nothing
changes any more; the greatest is the paper's upper bound (table I)."""


def training_grounds() -> dict[str, tuple[dict[str, Any], tuple[float, float]]]:
    """The twelve grounds of the paper's training set: name → parts of a spec, least and greatest amplitude (m)."""
    random = {
        f"random {cutoff:g}": ({"terrain": "random", "terrain_params": {"cutoff": cutoff}}, RANDOM_AMPLITUDES)
        for cutoff in RANDOM_CUTOFFS
    }
    return random | {name: ({"terrain": name}, OTHER_AMPLITUDES) for name in OTHER_GROUNDS}


def stiffness_grid(evaluations: int) -> tuple[float, ...]:
    """Stiffnesses to be tried, with a fixed ratio, three digits, Nm/rad: a walk feels the order of magnitude."""
    return tuple(float(f"{k:.3g}") for k in np.geomspace(SOFTEST, STIFFEST, evaluations))


def dataset(
    seeds: int = 2,
    amplitudes: int = 5,
    evaluations: int = 16,
    distance: float = 3.0,
    height: float = 1.0,
) -> Study:
    """Walks on soft soles of many stiffnesses: which one is best on which ground, at which amplitude?

    Stiffnesses share grounds and sensor errors, so that each ground compares them with one another. The paper's 6,000
    walks are 100 for each ground and amplitude: 50 stiffnesses on 2 grounds, say.

    Args:
        seeds: Grounds of each kind and amplitude.
        amplitudes: Amplitudes of each kind of ground.
        evaluations: Stiffnesses.
        distance: Length of a walk, m.
        height: Amplitudes over those of the paper: on grounds that every walk survives, steps say nothing.

    Raises:
        InputError: Fewer than one seed, one amplitude or four stiffnesses, or no distance.

    Source: the paper, section IV-B.
    """
    for name, value, least in (
        ("seeds", seeds, 1),
        ("amplitudes", amplitudes, 1),
        ("evaluations", evaluations, 4),
    ):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise InputError(
                f"{name} of the dataset must be a whole number of at least {least}, got {value!r}"
            )
    length = finite_scalar("distance of the dataset's walks (m)", distance, low=0.0, open_low=True)
    factor = finite_scalar("height of the dataset's grounds over the paper's", height, low=0.0, open_low=True)
    cells = tuple(
        Cell(cell_name(name, amplitude), {**values, "amplitude": amplitude})
        for name, (values, (low, high)) in training_grounds().items()
        for amplitude in (factor * np.linspace(low, high, amplitudes)).round(6).tolist()
    )
    return Study(
        name="dataset",
        about="the best stiffness for ground x amplitude: what a stiffness model learns from",
        base={"foot": "soft", "noise": "realistic", "plan": {"distance": length}},
        cells=cells,
        arms={f"{k:g}": {"stiffness": k} for k in stiffness_grid(evaluations)},
        seeds=tuple(range(seeds)),
        metric="J",
        reference=f"{stiffness_grid(evaluations)[evaluations // 2]:g}",
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

QUESTION_DISTANCE = 1.5
"""Length of a walk of the stiffness question, m: twelve steps, the first two of them on flat floor."""


def halfway(seeds: int = 6) -> Study:
    """At which height do half of the walks on a soft sole come to their end? There a sole can show a difference."""
    return Study(
        name="halfway",
        about="how high each ground must be for half of the walks to fall",
        base={
            "foot": "soft",
            "stiffness": 10.0,
            "noise": "realistic",
            "plan": {"distance": QUESTION_DISTANCE},
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


def stiffness_question(seeds: int = 6) -> Study:
    """When does the stiffness of a sole matter?

    A rigid sole of the same footprint, and soft ones from 1 to 100 Nm/rad, two of them with a twentieth of the paper's
    damping, too, on every rough family at the height where half of the walks fall; and all of it once more with a
    higher swing, as a foot that does not touch needs no softness. Gains were fixed before; grounds are fresh.
    """
    heights = halfway_heights()
    arms: dict[str, dict[str, Any]] = {"rigid": {"foot": "rigid"}}
    for k in (1.0, 3.2, 10.0, 32.0, 100.0):
        arms[f"{k:g}"] = {"foot": "soft", "stiffness": k}
    for k in (3.2, 32.0):
        arms[f"{k:g}, b/20"] = {"foot": "soft", "stiffness": k, "foot_changes": {"damping": 0.1}}
    return Study(
        name="stiffness",
        about="when does the stiffness of a sole matter? every rough family, at heights that half of the walks survive",
        base={"noise": "realistic", "plan": {"distance": QUESTION_DISTANCE}},
        cells=tuple(
            Cell(
                f"{cell_name(name, height)}, swing {1e3 * swing:g} mm",
                {"terrain": name, "amplitude": height, "gait": {"swing_height": swing}},
            )
            for swing in SWINGS
            for name, height in heights.items()
        ),
        arms=arms,
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="100",
    )


def arches(seeds: int = 6) -> Study:
    """Is a soft foot whose arch reaches to the toe better than the paper's, where the stiffness question was asked?"""
    arms: dict[str, dict[str, Any]] = {"rigid": {"foot": "rigid"}}
    for k in (3.2, 32.0):
        arms[f"soft, {k:g}"] = {"foot": "soft", "stiffness": k}
        arms[f"long arch, {k:g}"] = {"foot": "long_arch", "stiffness": k}
    question = stiffness_question(seeds)
    return replace(
        question,
        name="arches",
        about="a soft foot whose arch reaches to the toe against the paper's, where the stiffness question was asked",
        cells=tuple(cell for cell in question.cells if cell.values["gait"]["swing_height"] == SWINGS[0]),
        arms=arms,
        reference="soft, 3.2",
    )


SWINGS = (0.06, 0.09)
"""Swing heights, m: the paper's and a higher one."""


def halfway_heights() -> dict[str, float]:
    """Height of each family at which half of the walks of the study 'halfway' fell, m."""
    data = _found("halfway.json", "wbc study heights")
    return {name: float(height) for name, height in data["heights_m"].items()}


def half_heights(study: Study, entries: Mapping[str, Entry], *, any_code: bool = False) -> dict[str, float]:
    """Height of each ground at which half of the walks are completed, m.

    Shares of completed walks are made to fall with the height (isotonic regression) and taken as linear between the
    heights that were tried; if the share is a half over a range, the middle of it is taken. A ground on which fewer
    than half fall everywhere has the greatest of these heights, one on which more than half fall everywhere the least.

    Args:
        study: Such as `halfway()`, with cells that differ in "terrain" and "amplitude".
        entries: Those of a journal.
        any_code: Take walks of other versions of the code, too.

    Raises:
        InputError: A study of another kind than walks, or with several arms.
    """
    if study.kind != WalkSpec.kind or len(study.arms) != 1:
        raise InputError(
            f"half heights come from walks with a single arm; study '{study.name}' is of the kind '{study.kind}' with "
            f"the arms {', '.join(study.arms)}"
        )
    from sklearn.isotonic import IsotonicRegression  # noqa: PLC0415 - takes a second to import

    walks: dict[str, list[tuple[float, bool]]] = {}
    for trial, entry in found_entries(study, entries, any_code=any_code):
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


HEIGHTS = (0.020, 0.030, 0.045, 0.065, 0.090)
"""Heights among which the halfway one is looked for, m."""


UNKNOWN_GROUNDS: dict[str, tuple[float, float]] = {
    "stones": (0.040, 0.055),
    "roof_tiles": (0.040, 0.055),
    "stone_bricks": (0.040, 0.055),
    "small_stones": (0.010, 0.025),
    "large_floor_tiles": (0.010, 0.025),
}
"""Grounds that no model is trained on, at the least and the greatest amplitude of the paper's table IV, m."""

ORACLE_STIFFNESS = (1.0, 3.0, 8.0, 20.0, 45.0, 80.0)
"""Stiffnesses among which the oracle may choose, Nm/rad."""


def _unknown_cells() -> tuple[Cell, ...]:
    return tuple(
        Cell(cell_name(name, amplitude), {"terrain": name, "amplitude": amplitude})
        for name, amplitudes in UNKNOWN_GROUNDS.items()
        for amplitude in amplitudes
    )


def oracle(seeds: int = 4) -> Study:
    """Which fixed stiffness is best on each of the unknown grounds? Asked on other seeds than the table's."""
    return Study(
        name="oracle",
        about="the best fixed stiffness on each ground of 'unknown_ground', on seeds of its own",
        base={"foot": "soft", "noise": "realistic", "plan": {"distance": 3.0}},
        cells=_unknown_cells(),
        arms={f"{k:g}": {"stiffness": k} for k in ORACLE_STIFFNESS},
        seeds=tuple(range(seeds)),
        metric="J",
        reference=f"{ORACLE_STIFFNESS[2]:g}",
    )


def unknown_ground(seeds: int = 20) -> Study:
    """Does a sole whose stiffness follows the ground walk further over ground that it has never seen?

    The arms: the robot's own flat sole; a rigid one of the soft footprint, which tells size from softness; soft ones
    of the paper's 5 Nm/rad and of the median of all best stiffnesses that the model was trained on; the variable one;
    and an oracle that knows the best fixed stiffness of each kind and height of ground, once the study 'oracle' has
    been run.
    """
    median = float(f"{np.median(StiffnessTable.load(DEFAULT_TABLE).stiffness):.3g}")
    arms: dict[str, dict[str, Any]] = {
        "flat": {"foot": "flat"},
        "rigid": {"foot": "rigid"},
        "soft 5": {"foot": "soft", "stiffness": 5.0},
        "soft, median": {"foot": "soft", "stiffness": median},
        "variable": {"foot": "variable"},
    }
    cells = _unknown_cells()
    if oracle_known():
        best = oracle_choice()
        arms["oracle"] = {"foot": "soft"}
        cells = tuple(replace(cell, own={"oracle": {"stiffness": best[cell.name]}}) for cell in cells)
    return Study(
        name="unknown_ground",
        about="3 m over ground that nothing was trained or tuned on, all soles",
        base={"noise": "realistic", "plan": {"distance": 3.0}},
        cells=cells,
        arms=arms,
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="soft 5",
    )


def oracle_known() -> bool:
    """True if the study 'oracle' has been run, and what it found is kept with the library."""
    return (DATA / "oracle.json").is_file()


def oracle_choice() -> dict[str, float]:
    """Best fixed stiffness of each of the unknown grounds, Nm/rad: cell → stiffness, as the study 'oracle' found it."""
    data = _found("oracle.json", "wbc study best oracle")
    return {cell: float(label["stiffness"]) for cell, label in data["labels"].items()}


def _found(file: str, command: str) -> dict[str, Any]:
    """What an earlier study has found, as it is kept with the library.

    Raises:
        InputError: It is not there.
    """
    path = DATA / file
    if not path.is_file():
        raise InputError(f"no {path}: `{command} --journal JOURNAL --json` prints what belongs there")
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return data
