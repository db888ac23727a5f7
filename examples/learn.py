"""Learn a residual on top of the walk: the walk keeps the balance, PPO corrects the velocity that it is asked for.

An action of zero is the plain walk, straight ahead over stones. The policy adds to its velocity what pays: the reward
is the way ahead, and a fall costs one. It needs `pip install -e ".[gymnasium]"` in the clone, and
`pip install stable-baselines3`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from _common import parse, report
from gymnasium.wrappers import TransformAction, TransformObservation

VELOCITY, REACH = np.array([0.2, 0.0, 0.0]), np.array([0.1, 0.03, 0.05])
"""Velocity of the plain walk, and what a residual of one adds to it: ahead, m/s, to the left, m/s, and turn, rad/s."""

BODY = 14
"""Numbers of an observation before those of the joints."""

SEEDS = range(200, 204)
"""Episodes on which both are compared; none of them was learnt on."""


def walk(seconds: float, **fields: Any) -> gymnasium.Env[Any, Any]:
    """Return the environment, whose actions from -1 to 1 are residuals."""
    env = gymnasium.make(
        "wbc.sim.environment:wbc/Walk-v0",
        period=1.0,  # s, about a step: a shorter action ends before its reward has come
        seconds=seconds,
        terrain="stones",
        amplitude=0.02,
        terrain_params={"width": 4.0},  # m: a walk that leaves its ground comes to a stand
        eyes="none",
        **fields,
    )
    seen, residuals = env.observation_space, gymnasium.spaces.Box(-1.0, 1.0, VELOCITY.shape)
    body = gymnasium.spaces.Box(seen.low[:BODY], seen.high[:BODY])
    env = TransformObservation(env, lambda observation: observation[:BODY], body)
    return TransformAction(env, lambda action: (VELOCITY + REACH * action).astype(np.float32), residuals)


def rewards(env: gymnasium.Env[Any, Any], policy: Callable[[Any], Any], hooks: Sequence[Any] = ()) -> float:
    """Return the mean sum of rewards over the episodes of comparison; the first one is shown by the hooks."""
    total = 0.0
    for seed in SEEDS:
        observation, _ = env.reset(seed=seed, options={"hooks": hooks if seed == SEEDS[0] else ()})
        over = False
        while not over:
            observation, reward, fell, ended, _ = env.step(policy(observation))
            total, over = total + float(reward), fell or ended
    return total / len(SEEDS)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=6.0, steps=4800)
    from stable_baselines3 import PPO  # noqa: PLC0415 - help needs none

    env = walk(options.seconds)
    linear: dict[str, Any] = {"net_arch": [], "log_std_init": -0.7}
    ppo: dict[str, Any] = {"n_steps": 48, "batch_size": 48, "learning_rate": 1e-2, "gamma": 0.5}
    learner = PPO("MlpPolicy", env, **ppo, policy_kwargs=linear, seed=0, device="cpu")
    learner.learn(options.steps)
    return report(
        plain_m=rewards(env, lambda observation: np.zeros(3, np.float32)),
        learnt_m=rewards(env, lambda seen: learner.predict(seen, deterministic=True)[0], options.hooks()),
    )


if __name__ == "__main__":
    main()
