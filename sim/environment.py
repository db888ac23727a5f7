"""A humanoid under its controller as an environment of gymnasium (extra `gymnasium`); docs/learning.md has a program.

The controller of the library keeps the balance; an action tells it what to do: a velocity in "wbc/Walk-v0", the height
of the centre of mass and the lean and turn of the trunk in "wbc/Stand-v0", in which the robot is pushed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked
from wbc.base.drawing import opening
from wbc.base.errors import InputError, choose, shown
from wbc.base.numbers import ROUNDING, Array, finite_array
from wbc.base.settings import Positive
from wbc.core.estimation.observer import Observer
from wbc.core.frames import heading, yaw_rotation
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription
from wbc.sim.plant.model import aim
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.threads import one_thread
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.arrival import feet_middle
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

Pixels = NDArray[np.uint8]
Seen = NDArray[np.float32]

TASKS = ("walk", "stand")

VELOCITY = (0.3, 0.15, 0.4)
"""Bounds of an action of "walk": forward, m/s, left, m/s, and turn, rad/s."""

POSTURE = (0.04, 0.15, 0.15, 0.4)
"""Bounds of an action of "stand": height of the CoM, which is only lowered, m; lean (roll, pitch) and turn, rad."""

PUSH = 0.15
"""Greatest impulse of the pushes in "stand", Ns/kg; one every two seconds, in any direction."""

LARGEST = ((3, 2.0), (3, 10.0), (3, 1.0), (3, 40.0), (2, 20.0))
"""Numbers of an observation and their bound, in the order of the class; joints: `JOINTS`."""

JOINTS = (10.0, 100.0)
"""Bounds of positions, rad, and velocities, rad/s, of joints in an observation."""

PICTURE = (480, 360)
"""Width and height of a picture, pixels."""


class WbcEnv(gymnasium.Env[Seen, Seen]):  # type: ignore[misc]
    """One robot that walks or stands.

    **Action**, float32, shape (3,) or (4,): velocity of the robot, forward (m/s), left (m/s) and turn (rad/s); or the
    height by which its CoM is lowered (m), roll and pitch of its trunk and its turn against the feet (rad).

    **Observation**, float32, shape (14 + 2 na,), as the controller estimates it, in the heading of the pelvis: CoM from
    the middle of the feet (3, m), its velocity (3, m/s), direction of gravity in the pelvis (3), angular velocity of
    the pelvis (3, rad/s), normal force of left and right foot over the weight (2), positions (na, rad) and velocities
    (na, rad/s) of the joints. Values beyond the bounds of the space (`LARGEST`, `JOINTS`) are clipped.

    **Reward**: "walk": displacement of the feet along the world's x, m; "stand": minus the distance of the CoM from the
    middle of the feet, m. A fall costs 1 and ends the episode, which is truncated after its time, or by `trial.stop()`.
    A simulation that diverges ends the episode as a fall does, with the observation before it: `info["diverged"]` has
    the reason.

    Attributes:
        trial: The present episode; None before `reset`.
        frame_skip: Control periods for which an action holds.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10.0}

    @checked
    def __init__(
        self,
        task: str = "walk",
        *,
        period: Annotated[Positive, "s"] = 0.1,
        seconds: Annotated[Positive, "s"] = 20.0,
        robot: str | RobotDescription = "hrp4_class",
        render_mode: str | None = None,
        **fields: Any,
    ) -> None:
        """Choose robot, ground and feet.

        Args:
            task: "walk" or "stand".
            period: Time for which an action holds, s; rounded to control periods.
            seconds: Length of an episode, s.
            robot: Name of the robot, or its description.
            render_mode: "rgb_array" lets `render` return pictures; None draws nothing.
            **fields: Other fields of `wbc.sim.WalkSpec`, such as foot, terrain, amplitude, mode; not seed,
                plan and pushes, which the environment sets.
        """
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise InputError(
                f"render_mode must be None or 'rgb_array', got {shown(render_mode)}; to watch an episode, record it by "
                "env.reset(options={'hooks': [wbc.app.Recorder('a.arrow')]}), and show it by `wbc view a.arrow`"
            )
        self.render_mode = render_mode
        self._task = choose("task of the environment", task, TASKS)
        for name in ("seed", "plan", "pushes"):
            if name in fields:
                raise InputError(f"{name} is set by the environment; leave it out")
        if task == "stand" and fields.get("trained") is not None:
            raise InputError(
                "a trained policy has no body to set: leave 'trained' out, or take the task 'walk'"
            )
        self._fields = {"robot": robot, **fields}
        first = self._spec(0, ())
        self.frame_skip = max(1, round(min(period, seconds) / first.period))
        self.metadata = {**self.metadata, "render_fps": 1.0 / (self.frame_skip * first.period)}
        self._seconds = seconds
        joints = first.prepare().robot().na
        high = np.array(VELOCITY if task == "walk" else POSTURE)
        self._bounds = (-high if task == "walk" else -high * (0.0, 1.0, 1.0, 1.0), high)
        self.action_space = gymnasium.spaces.Box(*(bound.astype(np.float32) for bound in self._bounds))
        parts = (*LARGEST, *((joints, bound) for bound in JOINTS))
        seen = np.concatenate([np.full(count, bound, np.float32) for count, bound in parts])
        self.observation_space = gymnasium.spaces.Box(-seen, seen)
        self.trial: WalkTrial | None = None
        self._renderer: mujoco.Renderer | None = None
        self._over = False  # the present episode has ended
        self._last: Seen | None = None  # observation
        self._reached = self._height = 0.0  # way so far, and height of the CoM at the start of a stand, m
        self._hooks: Sequence[TrialHook] = ()  # of the present episode, until its end

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode: another ground, other sensor errors and pushes for each seed, or for each call.

        Args:
            seed: Seed; None for the next random draws.
            options: "hooks" may be a list of hooks (`wbc.sim.TrialHook`) of the episode, such as a `wbc.app.Recorder`.
        """
        given = options or {}
        for name in given:
            choose("option of an episode", name, ("hooks",))
        super().reset(seed=seed)
        self.close()
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
        spec = self._spec(int(self.np_random.integers(2**31)), pushes)
        return self._begin(spec, given.get("hooks", ())), {}

    def _begin(self, spec: WalkSpec, hooks: Sequence[TrialHook] = ()) -> Seen:
        """Begin an episode, and return its first observation."""
        visuals = bool(hooks) or self.render_mode is not None
        self.trial, self._hooks = WalkTrial(spec, visuals=visuals), hooks
        self._over = False
        if self._task == "stand":
            self._height = self.trial.control.body.com_height
        with one_thread():  # sums of several threads depend on their number
            self.trial.start(hooks)
            self.trial.step()
        self._reached = self._progress()
        self._last = self._observation()
        return self._last.copy()  # it belongs to the caller

    def close(self) -> None:
        """End the hooks of the present episode, as its end does, and its pictures."""
        renderer, self._renderer = self._renderer, None
        if renderer is not None:
            renderer.close()
        hooks, self._hooks = self._hooks, ()
        for hook in hooks:
            hook.end(None)

    def render(self) -> Pixels | None:
        """Return a picture of the robot as it is, shape (360, 480, 3); None without a `render_mode`.

        Raises:
            RenderError: Pictures cannot be drawn on this machine; the message says what to install.
        """
        if self.render_mode is None:
            return None
        if self.trial is None:
            raise InputError("reset the environment before its first picture")
        plant = self.trial.plant
        if not isinstance(plant, MujocoRobot):
            raise InputError(
                f"pictures are drawn of simulations in MuJoCo, and the loop is a {type(plant).__name__}"
            )
        if self._renderer is None:
            with opening():
                self._renderer = mujoco.Renderer(plant.model, PICTURE[1], PICTURE[0])
        camera = mujoco.MjvCamera()
        aim(camera, float(plant.robot.half_sitting[2]), plant.truth().com)
        self._renderer.update_scene(plant.data, camera)
        pixels: Pixels = self._renderer.render()
        return pixels

    def step(self, action: ArrayLike) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Let an action, shape (3,) or (4,), hold for a period; see the class for actions, observations and rewards.

        Raises:
            InputError: The environment has not been reset since its last episode has ended.
        """
        trial = self.trial
        if trial is None or self._over:
            raise InputError("reset the environment before the first step of each episode")
        action = finite_array("action", action, self.action_space.shape)
        self._order(trial, np.clip(action, *self._bounds))
        with one_thread():
            for _ in range(self.frame_skip):
                if not trial.step():
                    break
        terminated = trial.fallen or trial.diverged is not None
        truncated = not terminated and (trial.stopped or trial.plant.time >= self._seconds - ROUNDING)
        reward = -float(terminated)
        if trial.diverged is None:
            place = self._progress()
            off = float(np.linalg.norm(self._over_feet()[:2]))
            reward += place - self._reached if self._task == "walk" else -off
            self._reached, self._last = place, self._observation()
        self._over = terminated or truncated
        if self._over:
            self.close()
        fall = None if trial.fall is None else trial.fall.value
        info = {"time": trial.plant.time, "fall": fall, "diverged": trial.diverged}
        assert self._last is not None
        return self._last.copy(), reward, terminated, truncated, info

    def _spec(self, seed: int, pushes: tuple[WalkPush, ...]) -> WalkSpec:
        plan = WalkPlan(drive=((3600.0, 0.0, 0.0, 0.0),))  # steered by actions
        return WalkSpec(seed=seed, plan=plan, pushes=pushes, **self._fields)

    def _order(self, trial: WalkTrial, action: Array) -> None:
        if self._task == "walk":
            trial.control.velocity = tuple(action.tolist())
            return
        body = trial.control.body
        body.com_height = self._height - float(action[0])
        body.lean, body.turn = (float(action[1]), float(action[2])), float(action[3])

    def _progress(self) -> float:
        """Return the place of the true feet along x, m."""
        assert self.trial is not None
        return float(feet_middle(self.trial.plant)[0])

    def _over_feet(self) -> Array:
        """Return the estimated CoM from the middle of the feet, shape (3,), m."""
        robot = self._observer().robot
        middle: Array = np.mean([robot.placement(sole.frame).translation for sole in robot.soles], axis=0)
        offset: Array = robot.com - middle
        return offset

    def _observer(self) -> Observer:
        assert self.trial is not None
        return self.trial.drives.observer

    def _observation(self) -> Seen:
        observer = self._observer()
        robot = observer.robot
        base = robot.placement(robot.base_frame).rotation
        turn = yaw_rotation(-heading(base))
        seen = np.concatenate(
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
        space = self.observation_space
        clipped: Seen = np.clip(seen, space.low, space.high).astype(np.float32)
        return clipped


for _task in TASKS:
    gymnasium.register(
        f"wbc/{_task.capitalize()}-v0", entry_point=f"{__name__}:{WbcEnv.__name__}", kwargs={"task": _task}
    )
