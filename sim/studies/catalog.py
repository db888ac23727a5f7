"""The project's own studies, by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from wbc.core.registry import Registry
from wbc.sim.studies.seeing import (
    FIRST,
    HEIGHTS,
    SOLES,
    WALK,
    seeing,
    seeing_errors,
    seeing_feet,
    seeing_high,
    seeing_stairs,
    seeing_stepping,
)
from wbc.sim.studies.study import FRESH_SEED, Cell, Study, cell_name


def soles() -> dict[str, dict[str, Any]]:
    """Return the soles that are compared: the robot's own, a rigid one of the soft footprint, soft ones by stiffness.

    Stiffnesses in Nm/rad: from 0.5 to 80, which the paper takes for very compliant and for rigid (Frizza et al., 2022,
    table I), with the 5 of its fixed sole and the 42 of its figure 4 between.
    """
    fixed: dict[str, dict[str, Any]] = {"flat": {"foot": "flat"}, "rigid": {"foot": "rigid"}}
    soft = {f"soft {k:g}": {"foot": "soft", "stiffness": k} for k in (0.5, 5.0, 20.0, 42.0, 80.0)}
    return fixed | soft


def flat_floor(seeds: int = 10) -> Study:
    """Return walks of 3 m on a flat floor with every sole: completed walks and tracking errors."""
    return Study(
        name="flat_floor",
        about="3 m on a flat floor with sensor noise: completed walks and errors",
        base={"terrain": "flat", "noise": "realistic", "plan": {"distance": 3.0}},
        cells=(
            Cell("hrp4_class", {"robot": "hrp4_class"}),
            Cell("talos", {"robot": "talos"}, ("flat", "soft 5")),
        ),
        arms=soles(),
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="flat",
    )


ROUGH: dict[str, dict[str, Any]] = {
    "stones": {"terrain": "stones"},
    "cylinder obstacles": {"terrain": "cylinder_obstacles"},
    "cobble stones": {"terrain": "cobble_stones"},
    **{f"random w = {w:g}": {"terrain": "random", "terrain_params": {"cutoff": w}} for w in (0.01, 0.1)},
}
"""Rough grounds of the main table."""


def rough_ground(seeds: int = 20) -> Study:
    """Return walks of 3 m over rough ground, every sole with the same gait and gains: how many of 22 steps?"""
    return Study(
        name="rough_ground",
        about="3 m over rough ground, the same gait and gains for all soles",
        base={"noise": "realistic", "plan": {"distance": 3.0}},
        cells=tuple(
            Cell(cell_name(name, amplitude), {**values, "amplitude": amplitude})
            for name, values in ROUGH.items()
            for amplitude in (0.01, 0.02, 0.03, 0.04)
        ),
        arms=soles(),
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="flat",
    )


PUSHED_STEP = 7
"""Step that is pushed: the walk is steady by then."""


def push_recovery(seeds: int = 3) -> Study:
    """Return push limits of both laws of the steps, standing and walking: eight directions, three phases of a step.

    The pushed step is one of the left foot where the right one stands first, so that 90° pushes towards its side.
    """
    stand, walk = [[8.0, 0.0, 0.0, 0.0]], [[0.0, 0.3, 0.0, 0.0], [8.0, 0.0, 0.0, 0.0]]
    cells = []
    for eighth in range(8):
        direction = {"direction": round(math.pi / 4.0 * eighth, 12)}
        standing = {"plan": {"drive": stand}, "pushes": [{"time": 2.0, **direction}]}
        cells.append(Cell(f"standing, {45 * eighth}°", standing))
        for phase in (0.1, 0.4, 0.7):
            push = {"step": PUSHED_STEP, "phase": phase, **direction}
            cells.append(
                Cell(f"phase {phase:.1f}, {45 * eighth}°", {"plan": {"drive": walk}, "pushes": [push]})
            )
    return Study(
        name="push_recovery",
        about="largest impulse per kg from which a robot that stands, or walks at 0.3 m/s, recovers; 0° is forward, "
        "90° left",
        kind="push_limit",
        base={"robot": "g1", "terrain": "flat", "noise": "realistic", "highest": 1.0, "resolution": 0.05},
        cells=tuple(cells),
        arms={"lipm": {}, "stepping": {"law": "stepping"}},
        seeds=tuple(range(STEPPING_SEED, STEPPING_SEED + seeds)),
        reference="lipm",
    )


STEPPING_SEED = 8000
"""First seed of the tables of the stepping walk, which was tuned on others."""

LEGS = {"g1": 1.0, "hrp4_class": 1.06, "talos": 1.08}
"""Length of a robot's legs over that of `g1`, by which heights of grounds are scaled."""


def stepping(seeds: int = 24) -> Study:
    """Return stepping walks of 3 m on the robots' own flat feet over ground that carries at points: completed walks."""
    heights = {"stones": (0.02, 0.04, 0.06, 0.08), "stone_bricks": (0.04, 0.06)}
    heights |= dict.fromkeys(("roof_tiles", "boards", "sticks", "cylinder_obstacles"), (0.02, 0.04))
    return Study(
        name="stepping",
        about="3 m on flat feet over rough ground, blind, the steps decided as they go: completed walks; the ground "
        "begins with a sharp edge; heights are those of g1, scaled by the length of the legs",
        base={"law": "stepping", "foot": "flat", "noise": "realistic", "plan": {"distance": 3.0}},
        cells=tuple(
            Cell(
                cell_name(name, height),
                {"terrain": name, "terrain_params": {"ramp": 0.0}},
                arm_values={robot: {"amplitude": round(height * leg, 6)} for robot, leg in LEGS.items()},
            )
            for name, of in heights.items()
            for height in of
        ),
        arms={robot: {"robot": robot} for robot in LEGS},
        seeds=tuple(range(STEPPING_SEED, STEPPING_SEED + seeds)),
        metric="distance",
    )


def auto(seeds: int = 2) -> Study:
    """Return walks by each law and by the one that changes its law: does it walk as well as the better one?"""
    own = {"robot": "g1", "foot": "flat", "terrain_params": {"ramp": 0.0}}
    own_heights = {"stones": (0.02, 0.04, 0.08), "boards": (0.04,), "stone_bricks": (0.06,)}
    cells = [
        Cell(cell_name(name, height), {**SOLES["long arch 5"], "terrain": name, "amplitude": height})
        for name, height in HEIGHTS.items()
    ]
    cells += [
        Cell(f"g1, {cell_name(name, height)}", {**own, "terrain": name, "amplitude": height})
        for name, heights in own_heights.items()
        for height in heights
    ]
    return Study(
        name="auto",
        about="3 m, blind, in torque control: hrp4_class on its default sole over all families, and g1 on its own flat "
        "feet over ground that begins with a sharp edge",
        base={**WALK, "mode": "torque"},
        cells=tuple(cells),
        arms={law: {"law": law} for law in ("lipm", "stepping", "auto")},
        seeds=tuple(range(FIRST, FIRST + seeds)),
        metric="distance",
        reference="auto",
        decision="The law that changes is as good as the better one if it completes no fewer walks than either law on "
        "the default sole, and on the feet of g1: 95 % interval of the difference not below zero.",
    )


STUDIES: Registry[Callable[[], Study]] = Registry(
    "study",
    {
        "flat_floor": flat_floor,
        "rough_ground": rough_ground,
        "push_recovery": push_recovery,
        "stepping": stepping,
        "auto": auto,
        "seeing": seeing,
        "seeing_high": seeing_high,
        "seeing_stepping": seeing_stepping,
        "seeing_feet": seeing_feet,
        "seeing_stairs": seeing_stairs,
        "seeing_errors": seeing_errors,
    },
)
"""Studies by name."""


def study_by_name(name: str) -> Study:
    """Return one of `STUDIES`; `UnknownNameError` if there is none of the name."""
    return STUDIES[name]()
