"""What a terrain costs a simulation: memory, contacts, steps per second."""

from __future__ import annotations

import time
from typing import Any

import mujoco
import numpy as np

from wbc.core.errors import InputError
from wbc.sim.settings import PhysicsSettings
from wbc.sim.terrain.render import add_to_spec
from wbc.sim.terrain.spec import Terrain

PLACES = (0.2, 0.45, 0.7)
"""Where the probe lies, as shares of the rough part: one place alone may be a smooth one."""

SETTLE = 600
"""Steps before the clock starts."""

_T = mujoco.mjtGeom


def terrain_cost(
    ground: Terrain, steps: int = 1500, physics: PhysicsSettings | None = None
) -> dict[str, Any]:
    """Measure what a terrain costs two hinged soles of 60 spheres each that lie on it.

    Args:
        ground: The terrain.
        steps: Physics steps timed, over all places.
        physics: Integrator settings; the usual ones when None.

    Returns:
        JSON-able: number of geoms, height-field nodes, bytes added to the model, mean contacts, and steps per second
        of one core in this process (the fastest of three spans, as other work only slows down).

    Raises:
        InputError: Too few steps.
    """
    if steps < 3 * len(PLACES):
        raise InputError(f"steps must be at least {3 * len(PLACES)}, got {steps}")
    settings = physics or PhysicsSettings()
    bare = _probe(ground, 0.0, settings).compile().nbuffer
    seconds, contacts, count = 0.0, 0.0, max(1, steps // (3 * len(PLACES)))
    for share in PLACES:
        spec = _probe(ground, ground.start + share * ground.length, settings)
        added = add_to_spec(spec, ground)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, SETTLE)
        spans = []
        for _ in range(3):
            before = time.perf_counter()
            mujoco.mj_step(model, data, count)
            spans.append(time.perf_counter() - before)
        seconds += min(spans) / count
        contacts += float(data.ncon)
    return {
        "geoms": len(added.geoms),
        "nodes": added.nodes,
        "model_bytes": int(model.nbuffer - bare),
        "contacts": contacts / len(PLACES),
        "steps_per_s": len(PLACES) / seconds,
    }


def _probe(ground: Terrain, x: float, physics: PhysicsSettings) -> mujoco.MjSpec:
    """Make a model of two loaded soles, one step apart, just above the ground at x (m)."""
    spec = mujoco.MjSpec()
    physics.apply(spec)
    half = np.linspace(-0.16, 0.16, 65)
    for name, dx, y in (("left", 0.0, 0.07), ("right", 0.15, -0.07)):
        top = float(ground.height(x + dx + half[None, :], y + np.linspace(-0.06, 0.06, 25)[:, None]).max())
        _sole(spec, name, np.array([x + dx, y, top + 0.01]))
    return spec


def _sole(spec: mujoco.MjSpec, name: str, place: np.ndarray[Any, Any]) -> None:
    """Hang ten hinged phalanges of 2 x 3 spheres under 20 kg that slide up and down (sizes of the soft foot, m)."""
    load = spec.worldbody.add_body(name=name, pos=place)
    load.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    load.add_geom(
        type=_T.mjGEOM_BOX, size=[0.05, 0.03, 0.02], mass=20.0, pos=[0, 0, 0.1], contype=0, conaffinity=0
    )
    for heading in (1.0, -1.0):
        body = load
        for i in range(5):
            body = body.add_body(pos=[heading * 0.0278 * (i > 0), 0, 0])
            body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], stiffness=20.0, damping=2.0)
            for dx in (0.0069, 0.0209):
                for dy in (-0.045, 0.0, 0.045):
                    body.add_geom(
                        type=_T.mjGEOM_SPHERE,
                        size=[0.007, 0, 0],
                        pos=[heading * dx, dy, 0.007],
                        mass=0.0033,
                        priority=1,
                        solref=[1e-4, 1.0],
                        solimp=[0.99, 0.99, 0.001, 0.5, 2.0],
                    )
