"""Common parts of the examples of hands: robot, scene and controller, connected; where an arm is at ease."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from wbc.sim import Scene, Trial
from wbc.walking import Footstep, FootstepPlan, HandSettings, WalkingControl, WalkingControlSettings

sys.path.insert(0, str(Path(__file__).parents[1]))
from _common import Options, parse, report  # noqa: E402

__all__ = ["HANDS", "HandTrial", "at_ease", "hand_options"]

HANDS = {"left_hand": 1.0, "right_hand": -1.0}
"""Hands, and the sign of their y."""

TIP = {"talos": 0.19}
"""From the frame of a hand to its tip where it is not that of `HandSettings`, m."""

Look = Callable[[], None]


class Ended(Exception):  # noqa: N818 - leaves the stages, is no error
    """The robot fell, or did not come to the end of a stage in time."""


def hand_options(doc: str | None, arguments: Sequence[str] | None, **options: Any) -> Options:
    """Read the command line: robot, seed, errors of the sensors, and the options of an example."""
    robots = options.pop("robot", ("hrp4_class", "talos", "g1"))
    return parse(doc, arguments, robot=robots, seed=0, noise=("realistic", "none"), **options)


def at_ease(robot: wbc.Robot, forward: float, below: float, outward: float = 0.09) -> np.ndarray:
    """Return a point for the left hand, m, by its way from the shoulder in shares of the arm's reach."""
    model, frame = robot.model, robot.frames["left_hand"]
    arm = robot.joints_between(frame, robot.torso_frame)
    links = [model.jointPlacements[joint + 2] for joint in arm[1:]]
    links.append(model.frames[robot.frame_id(frame)].placement)
    reach = sum(float(np.linalg.norm(link.translation)) for link in links)
    reach += TIP.get(robot.name, HandSettings().length)
    return robot.data.oMi[arm[0] + 2].translation + reach * np.array([forward, outward, -below])


class HandTrial(Trial):
    """Robot, scene and controller; the stages of a trial end where the robot falls."""

    def __init__(
        self, options: Options, scene: Scene | None = None, start: FootstepPlan | None = None, **settings: Any
    ) -> None:
        """Build a plant and a controller with settings of its own, which stands or follows a plan."""
        description = wbc.load_robot(options.robot)
        self.robot, self.options, self.stage = description.robot(), options, "start"
        posture = settings.pop("posture", None)
        sensors = {"noise": options.noise, "seed": options.seed}
        plant = wbc.Plant(description, scene=scene, initial_configuration=posture, **sensors)
        if posture is not None:
            self.robot.update(posture, np.zeros(self.robot.nv))
        start = start or FootstepPlan.standing(self.robot)
        chosen = WalkingControlSettings(**settings)
        if chosen.hands is not None and options.robot in TIP:
            chosen = replace(chosen, hands=replace(chosen.hands, length=TIP[options.robot]))
        super().__init__(plant, WalkingControl(self.robot, start, plant.control_period, chosen))
        self.hands = self.walking.hands

    @property
    def walker(self) -> WalkingControl:
        """The controller, for the page."""
        return self.walking

    @contextmanager
    def stages(self, stage: str) -> Iterator[None]:
        """Go through the stages that are named by `stage`, which is "done" in the end, live with `--view`."""
        self.stage = stage
        with self.running(self.options.hooks()), suppress(Ended):
            yield
            self.stage = "done"

    def go(self, seconds: float, look: Look | None = None) -> None:
        """Simulate for a time, s, with a look at every tick."""
        if not self.advance(seconds, look):
            raise Ended

    def wait(self, what: Callable[[], bool], most: float, look: Look | None = None) -> None:
        """Simulate until something is true."""
        if not self.until(what, most, look):
            raise Ended

    def stand(self) -> FootstepPlan:
        """Return the stand of the robot as it is, the start of a plan."""
        left, right = (
            replace(Footstep.of(side, pin.SE3(self.robot.placement(sole.frame))), roll=0.0, pitch=0.0)
            for side, sole in zip(("left", "right"), self.robot.soles, strict=True)
        )
        return replace(FootstepPlan.standing(self.robot), left=left, right=right)

    def follow(self, plan: FootstepPlan, rest: float, look: Look | None = None) -> None:
        """Walk along a plan and rest for a time, s."""
        self.walking.follow(plan)
        self.go(1.0, look)
        self.wait(lambda: self.walking.finished, 3.0 * (len(plan) + 4), look)
        if self.walking.source.reason:  # a step is refused
            raise Ended
        self.go(rest, look)

    def report(self, **facts: Any) -> dict[str, Any]:
        """Print and return a result."""
        o, failures = self.options, self.walking.control.failures
        return report(
            robot=o.robot, seed=o.seed, stage=self.stage, upright=not self.fallen, failures=failures, **facts
        )
