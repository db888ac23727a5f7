"""Data file of the paper's authors: a row for each trajectory, its six features and the cluster of its stiffness.

Such a file has no header: Sp, P, P², Sku³, P³, Sp³, cluster. Rows come in blocks of six trajectories for each ground
and amplitude, and blocks of five amplitudes for each ground (`scripts/tot.csv` of the authors' walking controller, 360
rows).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wbc.core.errors import InputError
from wbc.core.files import csv_rows, read_text
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES
from wbc.feet.stiffness.roughness import PARAMETERS, RoughnessSettings

TRAJECTORIES, AMPLITUDES = 6, 5
"""Rows for each ground and amplitude, and amplitudes of each ground."""

RECIPE = ProfileRecipe(PROFILE_STEP, None, RoughnessSettings.authors())
"""Settings of the authors' roughness: whole tracks, their filter and formulas."""

FORMAT = "file of the paper's authors"


def is_authors_file(path: str | Path) -> bool:
    """Return True if the first line of a file is seven numbers, as in the authors' file."""
    target = Path(path)
    if not target.is_file():
        return False
    words = read_text(target, FORMAT).partition("\n")[0].split(",")
    return len(words) == len(PAPER_FEATURES) + 1 and all(_is_number(word) for word in words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def read_authors(path: str | Path) -> StiffnessTable:
    """Return the table of a file in the authors' columns.

    Grounds are numbered, amplitudes too (the file has neither), a trajectory is a layout, and the stiffness is the
    middle of its cluster of 4 Nm/rad. Of the parameters only Sp, P and Sku are known; the others are 0.

    Raises:
        InputError: Another number of columns, no numbers, no whole grounds, or clusters that are not 1 to 20.
    """
    target = Path(path)
    rows = csv_rows(read_text(target, FORMAT), target, FORMAT)
    try:
        numbers = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{target} is no {FORMAT}: {error}") from error
    whole = TRAJECTORIES * AMPLITUDES
    if numbers.ndim != 2 or numbers.shape[1] != len(PAPER_FEATURES) + 1 or len(numbers) % whole:
        raise InputError(
            f"{target} is no {FORMAT}: it needs seven columns and {whole} rows for each ground, got {numbers.shape}"
        )
    cluster = numbers[:, -1].astype(np.intp)
    clusters = Clusters.linear()
    if (cluster != numbers[:, -1]).any() or cluster.min() < 1 or cluster.max() > len(clusters):
        raise InputError(f"{target}: clusters must be whole numbers from 1 to {len(clusters)}")
    known = {"Sp": numbers[:, 0], "P": numbers[:, 1], "Sku": np.cbrt(numbers[:, 3])}
    index = np.arange(len(numbers))
    ground = [f"ground {1 + i // whole}" for i in index]
    columns: dict[str, Any] = {
        "ground": ground,
        "family": ground,
        "amplitude": 1.0 + index % whole // TRAJECTORIES,
        "seed": index % TRAJECTORIES,
        "window": np.zeros_like(index),
        **{name: known.get(name, np.zeros(len(numbers))) for name in PARAMETERS},
        "stiffness": clusters.centres[cluster - 1],
    }
    return StiffnessTable.from_columns(columns, recipe=RECIPE, made={"file": target.name})


def load_table(path: str | Path) -> StiffnessTable:
    """Return a table that `StiffnessTable.save` wrote, or one in the authors' columns.

    Raises:
        InputError: Neither.
    """
    return read_authors(path) if is_authors_file(path) else StiffnessTable.load(path)
