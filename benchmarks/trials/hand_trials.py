"""Tables of hands and loads: presses, carts, doors and carries by the examples, one run after another.

Every run is a line of the journal, and a run of the same code that is there already is not made again.

    python benchmarks/trials/hand_trials.py press --journal runs.jsonl             # 20, 60, 100 N on a table and a wall
    python benchmarks/trials/hand_trials.py cart --journal runs.jsonl --seeds 200-209
    python benchmarks/trials/hand_trials.py press --journal runs.jsonl --table     # the journal may be an .xz
"""

from __future__ import annotations

import argparse
import importlib
import math
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from _programs import EXAMPLES, span
from _runs import Row, make_runs, register_runs, rows

from wbc.sim.trial.trial import StageError

ROBOTS = ("hrp4_class", "talos", "g1")
MODES = ("position", "torque", "hybrid")

KINDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "press": (
        "press",
        tuple(f"--on {on} --force {force}" for on in ("table", "wall") for force in (20, 60, 100)),
    ),
    "cart": ("cart", ("",)),
    "door": ("door", ("",)),
    "load": ("carry", ("--share 0.2 --overs 10 --steps 22",)),
    "chest": ("carry", ("--share 0.3 --hold chest --forward 0.2 --overs 2 --steps 22",)),
}
"""Kind of runs → example of hands, and its options in each of them."""


def run_example(what: str, words: list[str]) -> Row:
    """Run the example of a kind of runs with options, and return its result, or where it ended."""
    try:
        result: Row = importlib.import_module(KINDS[what][0]).main(words)
    except StageError as error:
        return {"stage": str(error)}
    return result


register_runs("hands", run_example, (*EXAMPLES.glob("hands/*.py"), EXAMPLES / "_common.py"))


def table(kind: str, found: list[Row]) -> str:
    """Return the runs of one kind as a table, and below it those in which a stage did not come to its end."""
    cells: dict[tuple[Any, ...], list[Row]] = defaultdict(list)
    ended = []
    for row in found:
        if row["what"] == kind:
            if "failures" not in row:
                ended.append(f"{' '.join(row['words'])}: {row['stage']}")
                continue
            force = row["force_N"] if kind == "press" else None  # of a cart or a door it is a result
            words = row["words"]
            mode = f", {words[words.index('--mode') + 1]}" if "--mode" in words else ""
            cells[f"`{row['robot']}`{mode}", row.get("on"), force].append(row)
    head, line = TABLES[kind]
    width = head.count("|") - 1
    lines = [head, "|" + "---|" * width]
    for (robot, *_), results in cells.items():
        lines.append(f"| {robot} | {line(results)} |")
    return "\n".join([*lines, *ended])


def _most(results: list[Row], name: str, signed: bool = False) -> float:
    """Return the greatest size of a field."""
    values = [row[name] for row in results if row[name] is not None]
    return max((value if signed else abs(value) for value in values), default=math.nan)


def _least(results: list[Row], name: str) -> float:
    return min((row[name] for row in results if row[name] is not None), default=math.nan)


def _seeds(results: list[Row]) -> str:
    seeds = sorted(row["seed"] for row in results)
    spans: list[list[int]] = []
    for seed in seeds:
        if spans and seed == spans[-1][1] + 1:
            spans[-1][1] = seed
        else:
            spans.append([seed, seed])
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in spans)


def _done(results: list[Row]) -> str:
    return f"{sum(row['stage'] == 'done' for row in results)} of {len(results)}"


def _press(results: list[Row]) -> str:
    one = results[0]
    means = sorted({f"{row['mean_N']:.1f}" for row in results}, key=float)
    return (
        f"{one['on']} | {one['force_N']:.0f} N | {_done(results)} | {' to '.join((means[0], *means[1:][-1:]))} N | "
        f"{_least(results, 'least_N'):.1f}, {_most(results, 'greatest_N'):.1f} N | "
        f"{100.0 * _least(results, 'steady'):.0f} % | {_most(results, 'beyond_toes_mm', signed=True):.0f} mm | "
        f"{_seeds(results)}"
    )


def _cart(results: list[Row]) -> str:
    good = sum(
        row["stage"] == "done" and row["place_error_mm"] <= 250.0 and abs(row["heading_error_deg"]) <= 5.0
        for row in results
    )
    return (
        f"{results[0]['resistance_N']:.0f} N | {_done(results)} | {good} of {len(results)} | "
        f"{_most(results, 'place_error_mm'):.0f} mm | {_most(results, 'heading_error_deg'):.1f}° | "
        f"{_most(results, 'cart_tilt_deg'):.1f}°, {_most(results, 'pelvis_tilt_deg'):.1f}° | "
        f"{_most(results, 'force_N'):.0f} N | {_seeds(results)}"
    )


def _door(results: list[Row]) -> str:
    return (
        f"{_done(results)} | {_least(results, 'released_deg'):.0f}° | {_least(results, 'beyond_mm'):.0f} mm | "
        f"{_most(results, 'force_N'):.0f} N | {_most(results, 'touch_N'):.0f} N | {_seeds(results)}"
    )


def _carry(results: list[Row]) -> str:
    return (
        f"{results[0]['load_kg']:.1f} kg | {_done(results)} | {100.0 * _most(results, 'mass_error'):.1f} % | "
        f"{_most(results, 'place_error_mm'):.1f} mm | {min(row['steps'] for row in results)} | "
        f"{_seeds(results)}"
    )


LOAD_HEAD = "| Robot | Load | Done without a fall | Mass within | Place within | Least steps | Seeds |"
TABLES: dict[str, tuple[str, Callable[[list[Row]], str]]] = {
    "press": (
        "| Robot | On | Asked | Held 30 s | Mean | Least, greatest over 0.1 s | Within 10 % of the time | "
        "CoM before the toes | Seeds |",
        _press,
    ),
    "cart": (
        "| Robot | Resistance | Done | Within 0.25 m and 5° | Place | Heading | Tilt of cart, pelvis | "
        "Greatest force of both hands | Seeds |",
        _cart,
    ),
    "door": (
        "| Robot | Walked through | Let go at | Pelvis behind the frame | On the hand | Touch | Seeds |",
        _door,
    ),
    "load": (LOAD_HEAD, _carry),
    "chest": (LOAD_HEAD, _carry),
}


def main() -> None:
    """Run what the journal does not have, or print a table of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=TABLES)
    parser.add_argument("--journal", type=Path, required=True, help="file of the runs")
    parser.add_argument("--robot", action="append", choices=ROBOTS, help="all when none is given")
    parser.add_argument("--mode", default=MODES[0], choices=MODES, help="of the control")
    parser.add_argument("--seeds", type=span, default="200", help="such as 200-219, default %(default)s")
    parser.add_argument("--table", action="store_true", help="run nothing")
    options = parser.parse_args()
    if not options.table:
        mode = [] if options.mode == MODES[0] else ["--mode", options.mode]
        wanted = [
            {"what": options.kind, "words": [*words.split(), "--robot", robot, "--seed", str(seed), *mode]}
            for seed in options.seeds
            for robot in options.robot or ROBOTS
            for words in KINDS[options.kind][1]
        ]
        make_runs(options.journal, "hands", wanted)
    print(table(options.kind, rows(options.journal, "hands")))


if __name__ == "__main__":
    main()
