"""Walks of the paper's studies as tables: one row a walk of a journal."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from wbc.sim.studies import Entry, Estimate, holm, mean_interval, rate_interval, read_journal, sign_flip_p
from wbc.walking import StepGait

PAPER = Path(__file__).parent
JOURNALS, STUDIES, MODELS = (PAPER / name for name in ("journals", "studies", "models"))

LAYOUT = ["terrain", "amplitude", "cutoff", "seed"]
"""Columns that tell a layout: a ground of one seed."""

SIDEWAYS = ("left", "right", "outward", "inward")
"""Causes of a fall, or its directions seen from the stance foot in journals before version 9, which are sideways."""


def sole(spec: Mapping[str, Any]) -> str:
    """Return the name of a sole, with the stiffness of its hinges (Nm/rad) or the policy that sets it."""
    foot, k, given = spec["foot"], spec["stiffness"], spec.get("policy_params", {})
    front = dict(spec["foot_changes"]).get("front_stiffness")
    match spec.get("policy"):
        case "phase":
            return f"phase: {given['landing']:g}, on one foot {given['single']:g}"
        case "edge":
            return f"edge: {given['edge']:g}, else {given['smooth']:g}"
        case "oracle":
            quick = ", quick" if "actuator.rate_limit" in spec["foot_changes"] else ""
            return "oracle " + ", ".join(f"{value:g}" for value in given.values()) + quick
        case "model" if "path" in given:
            return Path(given["path"]).stem
    if front is not None:
        return f"toe {front:g}, arch {k:g}"
    return (
        f"{foot.replace('_', ' ')}, {k:g}"
        if k is not None
        else {"paper": "variable, 75 % at once"}.get(foot, foot)
    )


def _row(entry: Entry) -> dict[str, Any]:
    spec, result = entry.spec, entry.result or {}
    fall = result.get("fall") or {}
    cause = "dropped" if fall.get("reason") == "height" else fall.get("cause") or fall.get("direction")
    return {
        **{
            name: spec[name]
            for name in ("terrain", "amplitude", "seed", "foot", "stiffness", "gains", "changes")
        },
        "cutoff": spec["terrain_params"].get("cutoff", 0.0),
        "ramp": spec["terrain_params"].get("ramp", 0.0),  # before version 9 grounds began with an edge
        "sole": sole(spec),
        "foot_changes": spec["foot_changes"],
        "apex": spec.get("gait", {}).get("apex") or StepGait.apex,  # free steps have no gait
        "status": entry.status,
        "arrived": result.get("outcome") == "completed",
        "steps": result.get("steps_done"),
        "fell": bool(result.get("fell")),
        "cause": "sideways" if cause in SIDEWAYS else cause,
        "phase": fall.get("phase"),
        "impact": result.get("impact"),
        "zmp_error": (result.get("zmp_error") or {}).get("mean"),
        "contact_area": (result.get("contact_area") or {}).get("mean"),
        "commanded": [swing["commanded_nm_per_rad"] for swing in result.get("stiffness") or []],
        **{name: result.get(name) for name in ("J", "distance")},
    }


@cache
def walks(journal: str | Path) -> pd.DataFrame:
    """Return the walks of a journal: a file, or the name of one of the folder of journals."""
    path = Path(journal) if Path(journal).suffix else JOURNALS / f"{journal}.jsonl.xz"
    done = (entry for entry in read_journal(path).values() if entry.status == "done")
    entries = {
        json.dumps(dict(entry.spec), sort_keys=True): entry for entry in done
    }  # the last of equal ones
    if not entries:
        raise SystemExit(f"{path} has no walks")
    return pd.DataFrame([_row(entry) for entry in entries.values()])


def by_sole(table: pd.DataFrame, value: str = "steps", name: str = "sole") -> pd.DataFrame:
    """Return a value of the walks: a row for each layout, a column for each sole."""
    return table.pivot_table(value, LAYOUT, name, aggfunc="first").astype(float)


def gain(
    values: pd.DataFrame, arm: str, other: str, unit: str | None = None
) -> tuple[Estimate, float | None]:
    """Return what one arm does more than another on the same layouts, and the p-value of no difference.

    The unit of chance is the layout, or a level of the index, such as "terrain" for families.
    """
    more = (values[arm] - values[other]).dropna()
    units = None if unit is None else more.index.get_level_values(unit).tolist()
    return mean_interval(more.tolist(), units), sign_flip_p(more.tolist(), units)


def falls(table: pd.DataFrame, arm: str, cause: str | None = None) -> tuple[float, float, float]:
    """Return the falls of a sole per 1,000 steps, of all causes or of one, and the ends of the interval."""
    own = table[table["sole"] == arm]
    count = int((own["fell"] if cause is None else own["cause"] == cause).sum())
    steps = float(own["steps"].sum()) / 1e3
    return count / steps, *rate_interval(count, steps)


def corrected(p_values: Mapping[Any, float | None]) -> dict[Any, float | None]:
    """Return p-values after Holm's correction for their number."""
    return dict(zip(p_values, holm(list(p_values.values())), strict=True))


def shown(found: Estimate, digits: int = 1) -> str:
    """Return a mean with its interval as text."""
    low, high = (found.mean if end is None else end for end in (found.low, found.high))
    text = f"{found.mean:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
    return re.sub(r"−(0\.?0*)(?=[\s,\]])", r"\1", text.replace("-", "−"))


def markdown(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table as Markdown."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
