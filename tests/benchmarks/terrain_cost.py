"""Cost of each family of grounds in simulation: memory, contacts, steps per second.

Usage: python tests/benchmarks/terrain_cost.py
"""

from __future__ import annotations

import time
from typing import Any

import mujoco
import numpy as np

from wbc.core.errors import InputError
from wbc.feet import foot
from wbc.feet.soles.sole import SoleGeometry
from wbc.sim.plant.settings import PhysicsSettings
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.plot import example_terrain
from wbc.sim.terrain.render import add_to_spec
from wbc.sim.terrain.spec import Terrain

PLACES = (0.2, 0.45, 0.7)
"""Places of the two feet, as shares of the rough part: one place alone may be a smooth one."""

SETTLE = 600
"""Steps before the timing starts."""

LOAD = 20.0
"""Mass on each foot, kg: half of a robot of 40 kg."""

STRIDE = (0.15, 0.14)
"""Distance of the right foot ahead of and beside the left one, m."""


def terrain_cost(ground: Terrain, steps: int = 1500) -> dict[str, Any]:
    """Measure memory and speed of a simulation of two soft feet that stand on a terrain in the middle of a step.

    Args:
        ground: The terrain.
        steps: Physics steps timed, over all places.

    Returns:
        JSON-able: number of geoms, height-field nodes, bytes added to the model, mean contacts, and steps per second
        of processor time on one core (the fastest of three spans, as other work only slows down).

    Raises:
        InputError: Too few steps.
    """
    if steps < 3 * len(PLACES):
        raise InputError(f"steps must be at least {3 * len(PLACES)}, got {steps}")
    bare = _probe(ground, 0.0).compile().nbuffer
    seconds, contacts, count = 0.0, 0.0, steps // (3 * len(PLACES))
    for share in PLACES:
        spec = _probe(ground, ground.start + share * ground.length)
        add_to_spec(spec, ground)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, SETTLE)
        spans = []
        for _ in range(3):
            before = time.process_time()
            mujoco.mj_step(model, data, count)
            spans.append(time.process_time() - before)
        seconds += min(spans) / count
        contacts += float(data.ncon)
    surface = ground.surface
    return {
        "geoms": 1 + len(surface.solids) + (surface.field is not None),
        "nodes": 0 if surface.field is None else int(surface.field.z.size),
        "model_bytes": int(model.nbuffer - bare),
        "contacts": contacts / len(PLACES),
        "steps_per_s": len(PLACES) / max(seconds, 1e-9),  # a coarse clock may have seen no time pass
    }


def _probe(ground: Terrain, x: float) -> mujoco.MjSpec:
    """Make a model of two loaded feet, one ahead of the other, just above the ground at x (m)."""
    spec = mujoco.MjSpec()
    PhysicsSettings().apply(spec)
    design = foot("soft")
    for side, dx, y in (("left", 0.0, STRIDE[1] / 2.0), ("right", STRIDE[0], -STRIDE[1] / 2.0)):
        robot_sole = SoleGeometry.under_ankle(0.09, 0.16, 0.076, ankle_link=f"{side}_ankle")
        sole = design.fit(robot_sole).sole
        along = np.linspace(-sole.length / 2.0, sole.length / 2.0, 65)
        across = np.linspace(-sole.width / 2.0, sole.width / 2.0, 25)
        top = float(ground.height(x + dx + along[None, :], y + across[:, None]).max())
        place = np.array([x + dx, y, top + 0.01]) + sole.ankle
        ankle = spec.worldbody.add_body(name=robot_sole.ankle_link, pos=place, mass=LOAD, inertia=[0.1] * 3)
        ankle.explicitinertial, ankle.ipos = True, np.zeros(3)
        ankle.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        design.build(spec, ankle, side, robot_sole)
    return spec


def main() -> None:
    """Print a table in Markdown."""
    print("| terrain | geoms | nodes | kB | contacts | steps/s |\n|---|---:|---:|---:|---:|---:|")
    for name in terrain_families():
        cost = terrain_cost(example_terrain(name))
        print(
            f"| {name} | {cost['geoms']} | {cost['nodes']:,} | {cost['model_bytes'] / 1e3:.0f} "
            f"| {cost['contacts']:.0f} | {cost['steps_per_s']:,.0f} |"
        )


if __name__ == "__main__":
    main()
