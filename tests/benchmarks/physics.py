"""Speed of the physics of a standing robot, on each sole and ground.

Usage: python tests/benchmarks/physics.py
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np

from wbc.core.errors import InputError
from wbc.core.settings import NonNegative, Positive, Seed, settings
from wbc.feet import Foot, foot
from wbc.robots import load
from wbc.sim.plant.falls import TrueFallDetector
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.settings import steps_per_tick
from wbc.sim.terrain import Terrain, terrain

CONTROL_PERIOD = 0.004
"""Control period of the plant, s: a multiple of both physics steps."""

BEFORE = 1.0
"""Rough ground behind the robot, m, so that it stands on rough ground."""

SPANS = 5
"""Number of spans that are timed; the fastest counts, as other work on the machine only slows down."""


@settings(kw_only=True)
class BenchPhysicsOptions:
    """Robot, feet, grounds and physics steps that are timed.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        foot: Feet, those that `wbc foot` lists.
        terrain: Grounds, families that `wbc terrain` lists.
        amplitude: Highest minus lowest point of grounds that are not flat, m; on higher ones servos alone do not stand.
        seed: Seed of the grounds.
        timestep: Physics steps, s.
        seconds: Simulated time that is timed, s.
        settle: Simulated time before, s.
    """

    robot: str = "hrp4_class"
    foot: tuple[str, ...] = ("flat", "rigid", "soft", "variable")
    terrain: tuple[str, ...] = ("flat", "random", "stones")
    amplitude: Annotated[NonNegative, "m"] = 0.01
    seed: Seed = 1
    timestep: tuple[Annotated[Positive, "s"], ...] = (0.001, 0.002)
    seconds: Annotated[Positive, "s"] = 1.0
    settle: Annotated[NonNegative, "s"] = 1.0

    def __post_init__(self) -> None:
        load(self.robot)
        for name in ("foot", "terrain", "timestep"):
            if not getattr(self, name):
                raise InputError(f"at least one {name} is needed")
        for name in self.foot:
            foot(name)
        self.grounds()
        for timestep in self.timestep:
            steps_per_tick(CONTROL_PERIOD, timestep)

    def grounds(self) -> tuple[Terrain, ...]:
        """Return the grounds; the robot stands in their rough part."""
        return tuple(
            terrain(name, 0.0 if name == "flat" else self.amplitude, self.seed, start=-BEFORE)
            for name in self.terrain
        )


@dataclass(frozen=True)
class PhysicsSpeed:
    """Speed of one robot on one ground.

    Attributes:
        robot: Name of the robot.
        foot: Name of its feet.
        terrain: Family of the ground.
        amplitude: Amplitude of the ground, m.
        timestep: Physics step, s.
        steps_per_s: Physics steps of MuJoCo per second of processor time on one core.
        real_time_factor: Simulated time over processor time, of MuJoCo alone.
        plant_real_time_factor: Simulated time over processor time, of the plant: with servos, sensors and ground truth.
        contacts: Mean number of contacts.
        nv: Degrees of freedom, those of the soles included.
        upright: True if the robot still stood at the end.
    """

    robot: str
    foot: str
    terrain: str
    amplitude: float
    timestep: float
    steps_per_s: float
    real_time_factor: float
    plant_real_time_factor: float
    contacts: float
    nv: int
    upright: bool


def bench_physics(options: BenchPhysicsOptions) -> Iterator[PhysicsSpeed]:
    """Time every foot on every ground at every physics step."""
    for timestep in options.timestep:
        for ground in options.grounds():
            for name in options.foot:
                yield _speed(options, name, foot(name), ground, timestep)


def _speed(
    options: BenchPhysicsOptions, name: str, design: Foot, ground: Terrain, timestep: float
) -> PhysicsSpeed:
    plant = Plant(
        load(options.robot), foot=design, terrain=ground, timestep=timestep, control_period=CONTROL_PERIOD
    )
    command = plant.hold()
    for _ in range(round(options.settle / CONTROL_PERIOD)):
        plant.step(command)
    ticks = max(1, round(options.seconds / CONTROL_PERIOD / SPANS))
    whole, contacts = [], []
    for _ in range(SPANS):
        before = time.process_time()
        for _ in range(ticks):
            plant.step(command)
            plant.measure()
        whole.append(time.process_time() - before)
        contacts.append(plant.data.ncon)
    model, data, count = plant.model, plant.data, ticks * plant.steps
    alone = []
    for _ in range(SPANS):
        before = time.process_time()
        mujoco.mj_step(model, data, count)
        alone.append(time.process_time() - before)
    plant.step(command)  # the truth is that of the plant
    rate = count / min(alone)
    return PhysicsSpeed(
        robot=options.robot,
        foot=name,
        terrain=ground.name,
        amplitude=ground.amplitude,
        timestep=timestep,
        steps_per_s=rate,
        real_time_factor=rate * timestep,
        plant_real_time_factor=ticks * CONTROL_PERIOD / min(whole),
        contacts=float(np.mean(contacts)),
        nv=int(model.nv),
        upright=plant.diverged is None and not TrueFallDetector(plant.robot).fallen(plant.truth().q),
    )


def main() -> None:
    """Print a table in Markdown."""
    print(
        "| step (ms) | ground | foot | dof | contacts | steps/s | x real time | plant, x real time | stood |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for row in bench_physics(BenchPhysicsOptions()):
        print(
            f"| {1e3 * row.timestep:g} | {row.terrain} {1e3 * row.amplitude:g} mm | {row.foot} | {row.nv} "
            f"| {row.contacts:.0f} | {row.steps_per_s:.0f} | {row.real_time_factor:.1f} "
            f"| {row.plant_real_time_factor:.1f} | {'yes' if row.upright else 'NO'} |"
        )


if __name__ == "__main__":
    main()
