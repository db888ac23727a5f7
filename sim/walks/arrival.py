"""Arrival of a walk: whether the robot has come to its goal, and has kept to its track on the way.

All places are true ones, of the simulation: a robot whose estimate has drifted does all its steps and is elsewhere.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.numbers import Array, finite_array
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.trial.trial import AnyTrial, TrialHook
from wbc.sim.walks.meter import AT_ONCE

GOAL_DISTANCE = 0.5
"""Greatest distance of the middle of the feet from the goal, and from the track on the way, m: beyond, the robot stands
or walks beside the place that it was sent to, by more than two widths of its feet."""

GOAL_TURN = math.radians(45.0)
"""Greatest error of the pelvis' heading at the goal, rad."""


class Arrival(TrialHook):
    """Comparison of a walk with its goal, x, y (m) and yaw (rad) of the middle of the feet, and with its track.

    The track has the middles of the feet in order, joined by straight lines, shape (n, 2), m.
    """

    def __init__(self, goal: tuple[float, float, float], track: ArrayLike) -> None:
        self.goal = goal
        self.track = places = finite_array("track (m)", track)
        self.middles: list[Array] = []  # of the feet, not compared yet
        self._away = 0.0  # m
        if len(places) == 1:
            places = np.repeat(places, 2, axis=0)  # a line of no length
        self._x, self._y = places[:-1].T.copy()
        self._along, self._aside = np.diff(places, axis=0).T.copy()
        self._squares = np.maximum(self._along**2 + self._aside**2, 1e-12)

    def after(self, trial: AnyTrial) -> None:
        """See `TrialHook`."""
        if trial.diverged is None:
            self.middles.append(feet_middle(trial.plant))
            if len(self.middles) == AT_ONCE:
                self._compare()

    @property
    def track_error(self) -> float:
        """Greatest distance from the track so far, m."""
        self._compare()
        return self._away

    def _compare(self) -> None:
        x, y = np.reshape(self.middles, (-1, 2)).T[:, :, None]
        x, y = x - self._x, y - self._y
        share = np.minimum(np.maximum((x * self._along + y * self._aside) / self._squares, 0.0), 1.0)
        x -= share * self._along
        y -= share * self._aside
        self._away = max(self._away, math.sqrt((x * x + y * y).min(axis=1).max(initial=0.0)))
        self.middles.clear()

    def error(self, middle: Array) -> float:
        """Return the distance of the middle of the feet, shape (2,), from the goal, m."""
        return math.hypot(middle[0] - self.goal[0], middle[1] - self.goal[1])

    def arrived(self, middle: Array, heading: float) -> bool:
        """Return true if a robot that stands there (m, rad) is at its goal and has kept to its track."""
        turned = abs(math.remainder(heading - self.goal[2], math.tau))
        return max(self.error(middle), self.track_error) <= GOAL_DISTANCE and turned <= GOAL_TURN


def feet_middle(plant: Simulation) -> Array:
    """Return the middle between the true soles, shape (2,), m."""
    (left, _), (right, _) = plant.sole_poses
    return np.asarray(0.5 * (left[:2] + right[:2]))
