"""A short walk that views show, and marks by their names."""

from __future__ import annotations

from typing import Any

from wbc.sim.walks.trial import WalkTrial


def tick(trial: WalkTrial) -> Any:
    """One control period; returns what was measured before the plant moved on."""
    measurement = trial.plant.measure()
    trial.plant.step(trial.control.command(measurement))
    return measurement
