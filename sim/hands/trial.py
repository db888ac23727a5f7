"""A robot with hands before a scene, about to begin: what all trials of hands have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.control import Mode
from wbc.core.errors import Array
from wbc.core.robot import SIDES as FEET
from wbc.core.robot import Robot
from wbc.core.settings import Seed, settings
from wbc.robots import load
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.sensors import NOISE_PRESETS
from wbc.sim.scenes import Scene
from wbc.sim.trial.loop import Trial
from wbc.sim.trial.spec import CONTROL_PERIOD, chosen_mode
from wbc.walking.control import WalkingControl
from wbc.walking.hands.arm import HandArm
from wbc.walking.hands.hand import HandSettings
from wbc.walking.hands.hands import Hands
from wbc.walking.load import hand_frames
from wbc.walking.planning.footsteps import Footstep, FootstepPlan
from wbc.walking.settings import WalkingControlSettings

HAND_LENGTH = {"talos": 0.19}
"""From the frame of a hand to its tip where it is not that of `HandSettings`, m."""

SIDES = {"left_hand": 1.0, "right_hand": -1.0}
"""Hands, and the sign of their y."""


@settings(kw_only=True)
class HandTrialSpec:
    """Robot, drives and sensors of a trial of hands.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        mode: Command of the drives, position, torque or hybrid; position when not given, hybrid on soft servos.
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
    """

    robot: str = "hrp4_class"
    mode: Mode | None = None
    noise: str = "realistic"
    seed: Seed = 0

    def __post_init__(self) -> None:
        description = load(self.robot)
        description.needs_feet("a trial of hands")
        hand_frames(description.robot())
        object.__setattr__(self, "mode", chosen_mode(description, self.mode))
        NOISE_PRESETS[self.noise]


@dataclass(frozen=True)
class HandTrialResult:
    """Outcome of a trial of hands, which the result of each kind extends.

    Attributes:
        robot: Name of the robot.
        upright: True if it never fell.
        stage: Stage in which the trial ended; "done" when it came to its end.
        seconds: Simulated time, s.
        failures: Ticks without a solution or with an unusable measurement.
        seed: Seed.
    """

    robot: str
    upright: bool
    stage: str
    seconds: float
    failures: int
    seed: int


class ArmSpace(NamedTuple):
    """Space in which the left hand of a robot that stands can be used.

    Attributes:
        shoulder: First joint of the left arm, shape (3,), m.
        reach: Greatest distance of the tip of the hand from there, as the sum of all links, m.
    """

    shoulder: Array
    reach: float

    @staticmethod
    def of(robot: Robot) -> ArmSpace:
        """Measure the left arm of a robot that stands."""
        arm = HandArm(robot, robot.frames["left_hand"])
        return ArmSpace(np.array(arm.shoulder), arm.reach + hand_length(robot.name))

    def point(self, forward: float, below: float, outward: float = 0.09) -> Array:
        """Return a point for the left hand, in shares of the reach, from the shoulder, shape (3,), m."""
        return self.shoulder + self.reach * np.array((forward, outward, -below))


def hand_length(robot: str) -> float:
    """Return the distance from the frame of a robot's hand to its tip, m."""
    return HAND_LENGTH.get(robot, HandSettings().length)


class HandTrial(Trial):
    """Robot, scene and controller, connected.

    Attributes:
        robot: Robot that the controller moves.
        hands: Its hands.
        stage: Stage in which the trial is; "done" when it has come to its end.
    """

    def __init__(
        self,
        spec: HandTrialSpec,
        scene: Scene,
        hands: HandSettings | None = None,
        plan: Callable[[Robot], FootstepPlan] = FootstepPlan.standing,
    ) -> None:
        """Build robot, plant and controller.

        Args:
            spec: Robot and sensors.
            scene: What it stands before.
            hands: Settings of the hands; the defaults when None.
            plan: Returns the plan that the robot begins with.

        Raises:
            InputError: A robot that stands in the scene.
        """
        description = load(spec.robot)
        assert spec.mode is not None
        period = CONTROL_PERIOD[spec.mode]
        plant = Plant(description, scene=scene, noise=spec.noise, seed=spec.seed, control_period=period)
        self.robot = description.robot()
        hands = hands or HandSettings()
        if hands.length == HandSettings().length:
            hands = replace(hands, length=hand_length(spec.robot))
        settings = WalkingControlSettings(mode=spec.mode, hands=hands)
        super().__init__(plant, WalkingControl(self.robot, plan(self.robot), period, settings))
        assert self.walking.hands is not None
        self.hands: Hands = self.walking.hands
        self.stage = "start"
        self._spec = spec

    @property
    def walker(self) -> WalkingControl:
        """The controller."""
        walking: WalkingControl = self.walking
        return walking

    def stand(self) -> FootstepPlan:
        """Return the robot's stand as the start of a plan."""
        left, right = (
            replace(Footstep.of(side, pin.SE3(self.robot.placement(sole.frame))), roll=0.0, pitch=0.0)
            for side, sole in zip(FEET, self.robot.soles, strict=True)
        )
        return replace(FootstepPlan.standing(self.robot), left=left, right=right)

    def follow(self, plan: FootstepPlan, rest: float, look: Callable[[], None] | None = None) -> bool:
        """Walk along a plan and come to rest; False if the robot falls, or cannot take a step.

        Args:
            plan: The plan, from `stand`.
            rest: Time at rest after the last step, s.
            look: Called after each control period.
        """
        walking = self.walking
        walking.follow(plan)
        if not self.advance(1.0, look):
            return False
        if not self.until(lambda: walking.finished, 3.0 * (len(plan) + 4), look):
            return False
        return not walking.source.reason and self.advance(rest, look)

    def common(self) -> HandTrialResult:
        """Return what all results have in common, as it is now."""
        return HandTrialResult(
            robot=self._spec.robot,
            upright=not self.fallen,
            stage=self.stage,
            seconds=round(self.plant.time, 4),
            failures=self.walking.control.failures,
            seed=self._spec.seed,
        )
