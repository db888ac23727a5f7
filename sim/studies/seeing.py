"""Studies of walks that see the ground: what sight is worth, on which soles, by which sensor, and with which errors.

Layouts are those of seeds from 30000 on, on which nothing was tuned: the rule of heights was chosen on maps of seeds
32000 and 32001 without a walk, and the walks looked at while sight was written had seeds from 32000 on.
"""

from __future__ import annotations

from typing import Any

from wbc.sim.studies.study import Cell, Study, cell_name

FIRST = 30_000
"""First seed."""

HEIGHTS = {
    "boards": 0.05,
    "cobble_stones": 0.0775,
    "cylinder_obstacles": 0.06,
    "ellipsoids": 0.065,
    "floor_tiles": 0.065,
    "iso8608": 0.09,
    "large_floor_tiles": 0.09,
    "metal_sheets": 0.065,
    "pyramidal_stones": 0.09,
    "random": 0.09,
    "roof_tiles": 0.055,
    "slats": 0.09,
    "small_stones": 0.02,
    "steps": 0.09,
    "sticks": 0.065,
    "stone_bricks": 0.0775,
    "stones": 0.055,
}
"""Heights at which about half of the blind walks on a rigid sole fall, m: those of the study of soles of the paper's
application."""

LESS_HIGH = {"roof_tiles": 1.45, "small_stones": 1.25}
"""Families that cannot be built 1.5 times as high, and the factor with which they can."""

EDGES = (
    "sticks",
    "large_floor_tiles",
    "cylinder_obstacles",
    "pyramidal_stones",
    "steps",
    "slats",
    "boards",
    "floor_tiles",
)
"""Families with edges, on which blind walks fall most often."""

SOLES: dict[str, dict[str, Any]] = {
    "rigid": {"foot": "rigid"},
    "long arch 5": {"foot": "long_arch", "stiffness": 5.0},
    "soft 5": {"foot": "soft", "stiffness": 5.0},
    "soft 80": {"foot": "soft", "stiffness": 80.0},
}
"""Soles of one footprint."""

STIFFNESSES = (1.0, 5.0, 20.0, 80.0, 400.0)
"""Stiffnesses of the long arch among which an oracle of the family chooses, Nm/rad."""

WALK = {"noise": "realistic", "plan": {"distance": 3.0}}


def _cells(factor: float = 1.0, families: tuple[str, ...] = tuple(HEIGHTS)) -> tuple[Cell, ...]:
    heights = {
        name: round(HEIGHTS[name] * (factor if factor == 1.0 else LESS_HIGH.get(name, factor)), 6)
        for name in families
    }
    return tuple(
        Cell(cell_name(name, height), {"terrain": name, "amplitude": height})
        for name, height in heights.items()
    )


def _arms(soles: tuple[str, ...], eyes: tuple[str, ...], **values: Any) -> dict[str, dict[str, Any]]:
    names = {"none": "blind"}
    return {
        f"{sole}, {names.get(eye, eye)}": {**SOLES[sole], "eyes": eye, **values}
        for sole in soles
        for eye in eyes
    }


def _seeds(count: int) -> tuple[int, ...]:
    return tuple(range(FIRST, FIRST + count))


def seeing(seeds: int = 20) -> Study:
    """Return LIPM walks over all families, blind and seeing, on four soles: softness or sight?"""
    return Study(
        name="seeing",
        about="3 m over rough ground by the LIPM walk, blind, with a depth camera and with range sensors at the toes",
        base=WALK,
        cells=_cells(),
        arms=_arms(("rigid", "long arch 5"), ("none", "depth"))
        | _arms(("rigid", "long arch 5"), ("toes",))
        | _arms(("soft 5", "soft 80"), ("none", "depth", "toes")),
        seeds=_seeds(seeds),
        metric="steps_done",
        reference="rigid, depth",
        decision="Softness helps a walk that sees if long arch 5 with depth completes more walks than rigid with "
        "depth: families are the units, 95 % interval of the difference above zero (p by flipping signs of families).",
    )


def seeing_high(seeds: int = 20) -> Study:
    """Return the same 1.5 times as high, where walks that see fall again: has a stiffness by the ground to win?"""
    arms = _arms(("rigid", "long arch 5"), ("depth", "none"))
    arms |= {
        f"long arch {k:g}, depth": {"foot": "long_arch", "stiffness": k, "eyes": "depth"}
        for k in STIFFNESSES
        if k != 5.0
    }
    for name, arm in _arms(("rigid", "long arch 5"), ("depth", "none"), law="stepping").items():
        arms[f"stepping, {name}"] = arm
    return Study(
        name="seeing_high",
        about="3 m over ground 1.5 times as high as in the study seeing",
        base=WALK,
        cells=_cells(1.5),
        arms=arms,
        seeds=_seeds(seeds),
        metric="steps_done",
        reference="long arch 5, depth",
        decision="A stiffness by the ground has something to win if the oracle that knows the family, the best of "
        "five stiffnesses on the first half of the layouts, completes more walks on the second half than the best "
        "fixed one: families are the units, 95 % interval above zero.",
    )


def seeing_stepping(seeds: int = 20) -> Study:
    """Return stepping walks over all families, blind and seeing."""
    return Study(
        name="seeing_stepping",
        about="3 m over rough ground by the stepping walk, blind and with a depth camera",
        base={**WALK, "law": "stepping"},
        cells=_cells(),
        arms=_arms(("rigid", "long arch 5"), ("none", "depth"))
        | {
            f"{sole}, depth, without place": {
                **SOLES[sole],
                "eyes": "depth",
                "changes": {"ground.footprint.choice": False},
            }
            for sole in ("rigid", "long arch 5")
        },
        seeds=_seeds(seeds),
        metric="distance",
        reference="rigid, blind",
    )


def seeing_feet(seeds: int = 24) -> Study:
    """Return stepping walks of g1 on its own flat feet, blind and seeing."""
    cells = {"stones": 0.08, "boards": 0.04, "stone_bricks": 0.06}
    return Study(
        name="seeing_feet",
        about="3 m of g1 on its own flat feet by the stepping walk; the ground begins with a sharp edge",
        base={**WALK, "law": "stepping", "robot": "g1", "foot": "flat", "terrain_params": {"ramp": 0.0}},
        cells=tuple(
            Cell(cell_name(name, height), {"terrain": name, "amplitude": height})
            for name, height in cells.items()
        ),
        arms={
            "blind": {"eyes": "none"},
            "depth": {"eyes": "depth"},
            "depth, without place": {"eyes": "depth", "changes": {"ground.footprint.choice": False}},
        },
        seeds=_seeds(seeds),
        metric="distance",
    )


def seeing_stairs(seeds: int = 10) -> Study:
    """Return LIPM walks of three robots over stairs up and down that no plan tells them of."""
    stairs = {"terrain": "steps", "amplitude": 0.2, "terrain_params": {"riser": 0.1, "tread": 0.3}}
    # The pelvis of a robot that climbs 0.20 m is 0.18 m, elsewhere a fall, below where it stands upright.
    high = {**stairs, "terrain_params": {"riser": 0.2, "tread": 0.3}, "changes": {"falls.drop": 0.3}}
    return Study(
        name="seeing_stairs",
        about="3 m over two stairs of 0.10 m, or one of 0.20 m, up and down, not told, on the robots' own feet",
        base={**WALK, "foot": "flat"},
        cells=tuple(Cell(robot, {"robot": robot, **stairs}) for robot in ("hrp4_class", "talos", "g1"))
        + tuple(Cell(f"{robot}, 0.20 m", {"robot": robot, **high}) for robot in ("talos", "g1")),
        arms={"depth": {"eyes": "depth"}, "blind": {"eyes": "none"}},
        seeds=_seeds(seeds),
        metric="steps_done",
    )


def seeing_errors(seeds: int = 4) -> Study:
    """Return LIPM walks over families with edges, with errors of the camera, and with parts of sight left out.

    Blind is the floor: an error is stood if no fewer walks are completed than blind.
    """
    errors: dict[str, dict[str, Any]] = {
        "depth": {},
        "place off by 20 mm": {"camera.misplaced": (0.02, 0.0, 0.0)},
        "place off by 40 mm": {"camera.misplaced": (0.04, 0.0, 0.0)},
        "10 mm too high": {"camera.misplaced": (0.0, 0.0, -0.01)},
        "10 mm too low": {"camera.misplaced": (0.0, 0.0, 0.01)},
        "20 mm too high": {"camera.misplaced": (0.0, 0.0, -0.02)},
        "20 mm too low": {"camera.misplaced": (0.0, 0.0, 0.02)},
        "late by 0.2 s": {"camera.latency": 0.2},
        "5 Hz": {"camera.rate": 5.0},
        "20 % lost": {"camera.dropout": 0.2},
        "dies after 8 s": {"camera.end": 8.0},
        "a step of 60 mm that is not there": {"camera.ghost": (1.5, 0.0, 0.3, 0.06)},
        "without shift to the frame": {"ground.map.follow": 0.0},
        "without way": {"ground.footprint.way": False},
        "without place": {"ground.footprint.choice": False},
        "with slope": {"ground.footprint.tilt": 0.15},
        "highest alone": {"ground.footprint.trust": 0.0},
    }
    arms = {name: {"eyes": "depth", "changes": changes} for name, changes in errors.items()}
    return Study(
        name="seeing_errors",
        about="3 m over families with edges on the default sole: errors that sight stands, and what its parts win",
        base={**WALK, **SOLES["long arch 5"]},
        cells=_cells(families=EDGES),
        arms={"blind": {"eyes": "none"}, **arms},
        seeds=_seeds(seeds),
        metric="steps_done",
        reference="depth",
    )
