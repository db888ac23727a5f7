"""Speed of the physics of a standing robot, on each sole and ground.

Usage: python tests/benchmarks/physics.py
"""

from __future__ import annotations

import itertools
import time

import mujoco
import numpy as np

from wbc.feet import foot
from wbc.robots import load
from wbc.sim.plant.falls import TrueFallDetector
from wbc.sim.plant.plant import Plant
from wbc.sim.terrain.spec import Terrain, terrain

ROBOT = load("hrp4_class")
FEET = ("flat", "rigid", "soft", "variable")
GROUNDS = tuple(
    terrain(name, amplitude, 1, start=-1.0)  # 1 m of it behind the robot, so that it stands on rough ground
    for name, amplitude in (("flat", 0.0), ("random", 0.01), ("stones", 0.01))  # on higher ones it falls
)
TIMESTEPS = (0.001, 0.002)
"""Physics steps, s."""

CONTROL_PERIOD = 0.004
"""Control period of the plant, s: a multiple of both physics steps."""

SECONDS, SETTLE = 1.0, 1.0
"""Simulated time that is timed, and that before, s."""

SPANS = 5
"""Number of spans that are timed; the fastest counts, as other work on the machine only slows down."""


def row(timestep: float, ground: Terrain, name: str) -> str:
    """Time a plant, and MuJoCo alone: steps per second of processor time on one core."""
    plant = Plant(ROBOT, foot=foot(name), terrain=ground, timestep=timestep, control_period=CONTROL_PERIOD)
    command = plant.hold()
    for _ in range(round(SETTLE / CONTROL_PERIOD)):
        plant.step(command)
    ticks = max(1, round(SECONDS / CONTROL_PERIOD / SPANS))
    whole, alone, contacts = [], [], []
    for _ in range(SPANS):
        before = time.process_time()
        for _ in range(ticks):
            plant.step(command)
            plant.measure()
        whole.append(time.process_time() - before)
        contacts.append(plant.data.ncon)
    for _ in range(SPANS):
        before = time.process_time()
        mujoco.mj_step(plant.model, plant.data, ticks * plant.steps)
        alone.append(time.process_time() - before)
    plant.step(command)  # the truth is that of the plant
    rate = ticks * plant.steps / min(alone)
    stood = plant.diverged is None and not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    return (
        f"| {1e3 * timestep:g} | {ground.name} {1e3 * ground.amplitude:g} mm | {name} | {plant.model.nv} "
        f"| {np.mean(contacts):.0f} | {rate:.0f} | {rate * timestep:.1f} "
        f"| {ticks * CONTROL_PERIOD / min(whole):.1f} | {'yes' if stood else 'NO'} |"
    )


if __name__ == "__main__":
    print(
        "| step (ms) | ground | foot | dof | contacts | steps/s | x real time | plant, x real time | stood |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for case in itertools.product(TIMESTEPS, GROUNDS, FEET):
        print(row(*case), flush=True)
