"""Speed of the environment of gymnasium, with the extra `gymnasium`.

    python benchmarks/costs/environment.py

Steps per second of processor time of one core, the fastest twentieth of 60 steps; the frame skip is the number of
control periods for which an action holds.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium
import numpy as np

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("Walk", {"eyes": "none", "foot": "flat", "terrain": "flat"}),
    ("Walk", {"eyes": "none", "foot": "flat", "terrain": "flat", "period": 0.02}),
    ("Walk", {"eyes": "none", "foot": "soft", "terrain": "stones", "amplitude": 0.02}),
    ("Walk", {"eyes": "none", "foot": "flat", "terrain": "flat", "mode": "torque", "robot": "g1"}),
    ("Stand", {}),
)

STEPS = 60


def main() -> None:
    """Print a table."""
    print("| Environment | Frame skip | Steps/s | × real time |\n|---|---:|---:|---:|")
    for task, fields in CASES:
        env = gymnasium.make(f"wbc.sim.environment:wbc/{task}-v0", seconds=60.0, **fields)
        env.reset(seed=100)
        action, times = np.zeros(env.action_space.shape, np.float32), []
        if task == "Walk":
            action[0] = 0.2
        for _ in range(STEPS):
            begin = time.process_time()
            env.step(action)
            times.append(time.process_time() - begin)
        steps = 1.0 / float(np.quantile(times, 0.05))
        plant, skip = env.unwrapped.trial.plant, env.unwrapped.frame_skip  # type: ignore[attr-defined]
        words = ", ".join(f"{name} {value}" for name, value in fields.items())
        print(f"| {task}, {words} | {skip} | {steps:.0f} | {steps * skip * plant.control_period:.1f} |")


if __name__ == "__main__":
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    main()
