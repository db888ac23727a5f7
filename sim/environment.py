"""A humanoid under its controller as an environment of gymnasium (extra `gymnasium`).

    env = gymnasium.make("wbc.sim.environment:wbc/Walk-v0", terrain="stones", amplitude=0.02)
    observation, info = env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step([0.2, 0.0, 0.1])

The controller of the library keeps the balance; an action tells it what to do: a velocity in "wbc/Walk-v0", the height
of the centre of mass and the lean and turn of the trunk in "wbc/Stand-v0", in which the robot is pushed.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.errors import InputError, choose
from wbc.base.numbers import ROUNDING, Array, finite_array
from wbc.base.settings import Positive
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription
from wbc.sim.plant.robot import DivergedError
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.threads import one_thread
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.plans.footsteps import heading

TASKS = ("walk", "stand")

VELOCITY = (0.3, 0.15, 0.4)
"""Bounds of an action of "walk": forward, m/s, left, m/s, and turn, rad/s."""

POSTURE = (0.04, 0.15, 0.15, 0.4)
"""Bounds of an action of "stand": height of the CoM, which is only lowered, m; lean (roll, pitch) and turn, rad."""

PUSH = 0.15
"""Greatest impulse of the pushes in "stand", Ns/kg; one every two seconds, in any direction."""


class WbcEnv(gymnasium.Env[Array, Array]):  # type: ignore[misc]
    """One robot that walks or stands.

    **Action**, shape (3,) or (4,): velocity of the robot, forward (m/s), left (m/s) and turn (rad/s); or the height by
    which its CoM is lowered (m), roll and pitch of its trunk and its turn against the feet (rad).

    **Observation**, shape (14 + 2 na,), as the controller estimates it, in the heading of the pelvis: CoM from the
    middle of the feet (3, m), its velocity (3, m/s), direction of gravity in the pelvis (3), angular velocity of the
    pelvis (3, rad/s), normal force of left and right foot over the weight (2), positions (na, rad) and velocities (na,
    rad/s) of the joints.

    **Reward**: "walk": displacement of the feet along the world's x, m; "stand": minus the distance of the CoM from the
    middle of the feet, m. A fall costs 1 and ends the episode, which is truncated after its time, or by `trial.stop()`.

    Attributes:
        trial: The present episode; None before `reset`.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        task: str = "walk",
        *,
        period: Positive = 0.1,
        seconds: Positive = 20.0,
        robot: str | RobotDescription = "hrp4_class",
        **fields: Any,
    ) -> None:
        """Choose robot, ground and feet.

        Args:
            task: "walk" or "stand".
            period: Time for which an action holds, s; rounded to control periods.
            seconds: Length of an episode, s.
            robot: Name of the robot, or its description.
            **fields: Other fields of `wbc.sim.WalkSpec`, such as foot, terrain, amplitude, mode.
        """
        self._task = choose("task of the environment", task, TASKS)
        for name in ("seed", "plan", "pushes"):
            if name in fields:
                raise InputError(f"{name} is set by the environment; leave it out")
        self._fields = {"robot": robot, **fields}
        first = self._spec(0, ())
        self._ticks = max(1, round(period / first.period))
        self._seconds = seconds
        joints = first.prepare().robot().na
        bounds = np.array(VELOCITY if task == "walk" else POSTURE)
        low = -bounds if task == "walk" else -bounds * (0.0, 1.0, 1.0, 1.0)
        self.action_space = gymnasium.spaces.Box(low, bounds, dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (14 + 2 * joints,), dtype=np.float64)
        self.trial: WalkTrial | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode: another ground, other sensor errors and pushes for each seed, or for each call."""
        super().reset(seed=seed)
        pushes: tuple[WalkPush, ...] = ()
        if self._task == "stand":
            pushes = tuple(
                WalkPush(
                    impulse=float(self.np_random.uniform(0.0, PUSH)),
                    direction=float(self.np_random.uniform(-np.pi, np.pi)),
                    time=float(time),
                )
                for time in np.arange(2.0, self._seconds, 2.0)
            )
        self.trial = WalkTrial(self._spec(int(self.np_random.integers(2**31)), pushes), visuals=False)
        self._height = self.trial.walking.body.com_height
        with one_thread():  # sums of several threads depend on their number
            self.trial.start()
            self.trial.step()
        self._reached = self._progress()
        return self._observation(), {}

    def step(self, action: ArrayLike) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Let an action hold for a period; see the class for actions, observations and rewards.

        Raises:
            DivergedError: The simulation has diverged.
        """
        trial = self.trial
        if trial is None:
            raise InputError("reset the environment before its first step")
        self._order(trial, np.clip(finite_array("action", action, self.action_space.shape), *self._bounds))
        alive = True
        with one_thread():
            for _ in range(self._ticks):
                alive = trial.step()
                if not alive:
                    break
        if trial.diverged is not None:
            raise DivergedError(trial.diverged)
        place = self._progress()
        reward = (
            place - self._reached if self._task == "walk" else -float(np.linalg.norm(self._over_feet()[:2]))
        )
        self._reached = place
        info = {"time": trial.plant.time, "fall": None if trial.fall is None else trial.fall.value}
        over = trial.stopped or trial.plant.time >= self._seconds - ROUNDING
        return (
            self._observation(),
            float(reward) - trial.fallen,
            trial.fallen,
            over and not trial.fallen,
            info,
        )

    @property
    def _bounds(self) -> tuple[Array, Array]:
        return self.action_space.low, self.action_space.high

    def _spec(self, seed: int, pushes: tuple[WalkPush, ...]) -> WalkSpec:
        plan = WalkPlan(drive=((3600.0, 0.0, 0.0, 0.0),))  # steered by actions
        return WalkSpec(seed=seed, plan=plan, pushes=pushes, **self._fields)

    def _order(self, trial: WalkTrial, action: Array) -> None:
        if self._task == "walk":
            trial.walking.velocity = tuple(action.tolist())
            return
        body = trial.walking.body
        body.com_height = self._height - float(action[0])
        body.lean, body.turn = (float(action[1]), float(action[2])), float(action[3])

    def _progress(self) -> float:
        """Return the place of the true feet along x, m."""
        assert self.trial is not None
        return float(np.mean([self.trial.plant.sole_pose(side)[0][0] for side in (0, 1)]))

    def _over_feet(self) -> Array:
        """Return the estimated CoM from the middle of the feet, shape (3,), m."""
        robot = self._observer().robot
        middle: Array = np.mean([robot.placement(sole.frame).translation for sole in robot.soles], axis=0)
        offset: Array = robot.com - middle
        return offset

    def _observer(self) -> Observer:
        assert self.trial is not None
        observer: Observer = self.trial.walking.control.observer
        return observer

    def _observation(self) -> Array:
        observer = self._observer()
        robot = observer.robot
        base = robot.placement(robot.base_frame).rotation
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, -heading(base))
        return np.concatenate(
            [
                turn @ self._over_feet(),
                turn @ robot.com_velocity,
                -base[2],
                robot.v[3:6],
                observer.load / (robot.mass * GRAVITY),
                robot.q[7:],
                robot.v[6:],
            ]
        )


for _task in TASKS:
    gymnasium.register(
        f"wbc/{_task.capitalize()}-v0", entry_point=f"{__name__}:{WbcEnv.__name__}", kwargs={"task": _task}
    )
