"""Common parts of the examples of hands: options, a robot that stands with its hands ready, grips, and the result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import _common
import numpy as np

import wbc
from wbc.sim import Scene, Trial
from wbc.walking import FootstepPlan, HandSettings, SteppingSettings, WalkingControl, WalkingControlSettings

LENGTH = {"hrp4_class": 0.16, "talos": 0.19}
"""From the frame of a hand to its tip where it is not that of `HandSettings`, m."""

LOW = SteppingSettings(swing_height=0.09)
"""Free steps on a level floor: feet swing low, so that knees do not meet what the hands work on."""

ARMS = {
    "hrp4_class": ((-0.782, 0.132, -0.014, -0.83), (1, -1, -1, 1)),
    "talos": ((-0.532, 0.159, -0.004, -0.888, 0.0, -0.001, 0.039), (-1, -1, -1, 1, -1, -1, 1)),
    "g1": ((-0.93, 0.168, 0.087, 0.837, -0.001, 0.183, -0.018), (1, -1, -1, 1, -1, 1, -1)),
}
"""Left arm with its hand 0.35 m ahead, where a load asks least of it, rad, and the signs of the right one."""


def arms_ahead(robot: wbc.Robot) -> np.ndarray:
    """Return half-sitting with both hands 0.35 m ahead."""
    posture, (angles, signs) = robot.half_sitting.copy(), ARMS[robot.name]
    for frame, sign in zip(robot.frames.values(), (1, signs), strict=True):
        arm = np.array(robot.joints_between(frame, robot.torso_frame))[: len(angles)]
        posture[7 + arm] = np.multiply(sign, angles)
    return posture


def hand_options(doc: str | None, arguments: Sequence[str] | None, **options: Any) -> _common.Options:
    """Read the command line: robot, seed, errors of the sensors, and the options of an example."""
    robots, modes = ("hrp4_class", "talos", "g1"), ("position", "torque", "hybrid")
    common = {"robot": robots, "seed": 0, "noise": ("realistic", "none"), "mode": modes}
    return _common.parse(doc, arguments, **(common | options))


def stand(
    options: _common.Options,
    plan: FootstepPlan | None = None,
    stepping: SteppingSettings | None = None,
    **settings: Any,
) -> WalkingControl:
    """Return the controller of a robot that stands, or follows a plan, with settings of its hands."""
    robot = wbc.load_robot(options.robot).robot()
    length = {"length": LENGTH[options.robot]} if options.robot in LENGTH else {}
    chosen = WalkingControlSettings(
        mode=options.mode, stepping=stepping or SteppingSettings(), hands=HandSettings(**length, **settings)
    )
    return WalkingControl(robot, plan or FootstepPlan.standing(robot), period(options), chosen)


def period(options: _common.Options) -> float:
    """Return the control period, s: free steps are decided more often."""
    return 0.005 if options.mode == "position" else 0.002


def connect(options: _common.Options, walking: WalkingControl, scene: Scene | None, **start: Any) -> Trial:
    """Put the robot of a controller into a scene."""
    sensors = {"noise": options.noise, "seed": options.seed, "control_period": period(options)}
    return Trial(wbc.Plant(wbc.load_robot(options.robot), scene=scene, **sensors, **start), walking)


def grip(trial: Trial, limit: float, **handles: tuple[str, Sequence[float]]) -> None:
    """Go with hands to handles ahead of them and close them; `handles` is hand = (handle of the scene, place in m)."""
    trial.advance(0.5)
    for hand, (_, place) in handles.items():
        trial.control.hands.grip(hand, place, (1.0, 0.0, 0.0), limit)
    trial.until(lambda: bool(trial.control.hands.there), 20.0)
    for hand, (handle, _) in handles.items():
        trial.plant.grip(hand, handle)
    trial.advance(0.5)


def report(trial: Trial, options: _common.Options, **facts: Any) -> dict[str, Any]:
    """Print and return a result."""
    common = {"robot": options.robot, "seed": options.seed, "stage": trial.stage, "upright": not trial.fallen}
    return _common.report(**common, failures=trial.drives.failures, **facts)
