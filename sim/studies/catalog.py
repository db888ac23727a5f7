"""The project's own studies, by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from wbc.core.arguments import checked
from wbc.core.registry import Registry
from wbc.sim.studies.paper.experiments import (
    authority,
    damping,
    fig5,
    oracle,
    table4,
    tuned_fixed,
)
from wbc.sim.studies.stiffness_studies import (
    arches,
    dataset,
    halfway,
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
    "random w = 0.01": {"terrain": "random", "terrain_params": {"cutoff": 0.01}},
    "random w = 0.1": {"terrain": "random", "terrain_params": {"cutoff": 0.1}},
}
"""Rough grounds of the main table."""


def rough_ground(seeds: int = 20, gains: str = "default") -> Study:
    """Return walks of 3 m over rough ground, every sole with the same gait and gains: how many of 22 steps?"""
    return Study(
        name="rough_ground" if gains == "default" else f"rough_ground_{gains}",
        about="3 m over rough ground, the same gait and gains for all soles"
        + ("" if gains == "default" else f" ({gains} gains)"),
        base={"noise": "realistic", "plan": {"distance": 3.0}, "gains": gains},
        cells=tuple(
            Cell(cell_name(name, amplitude), {**values, "amplitude": amplitude})
            for name, values in ROUGH.items()
            for amplitude in (0.01, 0.02, 0.03, 0.04)
        ),
        arms=soles(),
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="flat",
    )


PUSHED_STEP = 5
"""Step that is pushed: the walk is steady by then, and as many steps follow, in which the push can show."""


def push_recovery(seeds: int = 1) -> Study:
    """Return push limits while walking: four phases of a step, eight directions, with and without step adjustment.

    A third arm adds a catch on one foot. The pushed step is one of the left foot, so that 90° pushes towards the swing
    foot's side.
    """
    cells = []
    for phase in (0.0, 0.25, 0.5, 0.75):
        for eighth in range(8):
            push = {"step": PUSHED_STEP, "phase": phase, "direction": round(math.pi / 4.0 * eighth, 12)}
            cells.append(Cell(f"phase {phase:.2f}, {45 * eighth}°", {"pushes": [push]}))
    return Study(
        name="push_recovery",
        about="largest impulse per kg that a walk on flat soles recovers from; 0° is forward, 90° left",
        kind="push_limit",
        base={
            "terrain": "flat",
            "noise": "realistic",
            "plan": {"distance": 1.45},
            "highest": 0.8,
            "resolution": 0.02,
        },
        cells=tuple(cells),
        arms={
            "with step adjustment": {},
            "without": {"changes": {"walk.adjustment": None}},
            "with a catch": {"changes": {"walk.catch.enabled": True}},
        },
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="without",
    )


QUICK = {"drive.pace_limit": 0.6}
"""Settings of a drive with the quick steps that high speeds need."""


def speed(seeds: int = 4) -> Study:
    """Return the highest speeds of a robot that is steered: three robots, four directions, two modes."""
    highest = {"forward": 0.8, "back": 0.8, "left": 0.4, "turn": 1.2}
    return Study(
        name="speed",
        about="highest speed walked by a robot that is steered, m/s, turning rad/s; the median over seeds is that at "
        "which half of the walks fail",
        kind="speed_limit",
        metric="fastest",
        base={"terrain": "flat", "noise": "realistic", "changes": dict(QUICK)},
        cells=tuple(
            Cell(
                f"{robot}, {heading}",
                {"robot": robot, "heading": heading, "highest": most, "resolution": most / 16},
            )
            for robot in ("hrp4_class", "talos", "g1")
            for heading, most in highest.items()
        ),
        arms={"position": {}, "torque": {"mode": "torque"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="position",
    )


def steered(seeds: int = 10) -> Study:
    """Return drives at one speed in each direction: three robots, two modes. A walk without a fall has that speed."""
    asked = {"forward": 0.4, "forward 0.5": 0.5, "back": 0.3, "left": 0.2, "turn": 0.5}
    # g1 is granted 0.18 m/s to the side with three quarters of its reach.
    wide = {**QUICK, "drive.reach": 0.85}
    cells = []
    for robot in ("hrp4_class", "talos", "g1"):
        for name, speed in asked.items():
            values = {"robot": robot, "heading": name.split()[0], "highest": speed, "resolution": speed}
            changes = wide if (robot, name) == ("g1", "left") else QUICK
            cells.append(Cell(f"{robot}, {name}", {**values, "changes": dict(changes)}))
    return Study(
        name="steered",
        about="robots that are steered at 0.4 and 0.5 m/s forward, 0.3 back, 0.2 to the left and 0.5 rad/s: the speed, "
        "or 0 where the walk falls or is slower than nine tenths of it",
        kind="speed_limit",
        base={"terrain": "flat", "noise": "realistic"},
        cells=tuple(cells),
        arms={"position": {}, "torque": {"mode": "torque"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="position",
    )


def driving(seeds: int = 6) -> Study:
    """Return drives of five minutes with random velocities and pushes: falls per hour, drift of the estimate."""
    return Study(
        name="driving",
        about="falls per hour of a robot that is driven at random and pushed, in drives of 5 minutes",
        kind="driving",
        base={"terrain": "flat", "noise": "realistic", "minutes": 5.0},
        cells=tuple(Cell(robot, {"robot": robot}) for robot in ("hrp4_class", "talos", "g1")),
        arms={"position": {"mode": "position"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
    )


STUDIES: Registry[Callable[[], Study]] = Registry(
    "study",
    {
        "flat_floor": flat_floor,
        "rough_ground": rough_ground,
        "rough_ground_legacy": lambda: rough_ground(gains="legacy"),
        "push_recovery": push_recovery,
        "speed": speed,
        "steered": steered,
        "driving": driving,
        "dataset": dataset,
        "halfway": halfway,
        "arches": arches,
        "tuned_fixed": tuned_fixed,
        "authority": authority,
        "damping": damping,
        "oracle": oracle,
        "fig5": fig5,
        "fig5_legacy": lambda: fig5(5, gains="legacy"),
        "table4": table4,
        "table4_legacy": lambda: table4(10, gains="legacy"),
    },
)
"""Studies by name."""


@checked
def study_by_name(name: str) -> Study:
    """Return one of `STUDIES`.

    Raises:
        UnknownNameError: No such study.
    """
    return STUDIES[name]()
