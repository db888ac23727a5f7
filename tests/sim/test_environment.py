"""The environment of gymnasium: its contract, seeds, and bad input."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 - an extra

from wbc.core.estimation.falls import FallReason  # noqa: E402 - after an extra
from wbc.sim.environment import WbcEnv  # noqa: E402 - an extra


@pytest.mark.parametrize("name", ["Walk", "Stand"])
def test_an_environment_is_written_and_made_again(name: str) -> None:
    env = gymnasium.make(f"wbc.sim.environment:wbc/{name}-v0", seconds=1.0, foot="soft")
    spec = gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gymnasium.make(spec)
    assert again.spec.kwargs == env.spec.kwargs and again.observation_space == env.observation_space


def test_an_episode_that_is_stopped_is_cut_short_and_costs_nothing() -> None:
    env = WbcEnv("stand", seconds=1.0)
    env.reset(seed=1)
    assert env.trial is not None
    env.trial.stop()
    _, reward, terminated, truncated, info = env.step(np.zeros(4))
    assert (terminated, truncated, info["fall"]) == (False, True, None) and reward > -0.5


def test_a_fall_costs_one() -> None:
    """Of two episodes from the same state the one that ends with a fall has a reward that is lower by one."""
    rewards = []
    for falls in (False, True):
        env = WbcEnv("stand", seconds=1.0, noise="none")
        env.reset(seed=0)
        assert env.trial is not None
        env.step(np.zeros(4))
        trial = env.trial
        if falls:
            trial.true_fall = lambda: FallReason.TILT
        _, reward, terminated, truncated, info = env.step(np.zeros(4))
        assert (terminated, truncated) == (falls, False) and (info["fall"] is not None) == falls
        over = np.linalg.norm(env._over_feet()[:2])
        rewards.append(reward + over)
    assert rewards == pytest.approx([0.0, -1.0], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Walk", "Stand"])
@pytest.mark.filterwarnings("ignore")
def test_gymnasium_finds_nothing_wrong(name: str) -> None:
    check_env(
        gymnasium.make(f"wbc.sim.environment:wbc/{name}-v0", seconds=1.0, robot="g1").unwrapped,
        skip_render_check=True,
    )


@pytest.mark.slow
def test_a_walk_is_driven_and_the_same_seed_gives_the_same_episode() -> None:
    env = WbcEnv("walk", seconds=1.5, period=0.5)
    first, _ = env.reset(seed=3)
    assert first.shape == env.observation_space.shape
    ends, way, seen = [], 0.0, []
    for _ in range(3):
        observation, reward, terminated, truncated, info = env.step([0.3, 0.0, 0.0])
        way += reward
        seen.append(observation)
        ends.append((terminated, truncated))
        assert env.observation_space.contains(observation) and info["fall"] is None
    assert ends == [(False, False), (False, False), (False, True)] and way > 0.0
    env.reset(seed=3)
    np.testing.assert_array_equal(env.step([0.3, 0.0, 0.0])[0], seen[0])
    assert not np.array_equal(first, env.reset(seed=4)[0])


def test_a_stand_is_pushed_and_takes_postures() -> None:
    env = WbcEnv("stand", seconds=4.0, period=0.5)
    env.reset(seed=0)
    assert env.trial is not None and env.trial.spec.pushes[0].time == 2.0
    *_, truncated, info = [env.step([0.03, 0.0, 0.1, 0.2]) for _ in range(2)][-1]
    assert not truncated and info["fall"] is None
    assert env.trial.walking.body.lean == (0.0, 0.1)
    robot = env.trial.walking.control.observer.robot
    assert env.trial.walking.body.com_height < float(robot.com[2]) + 0.04


def test_an_observation_is_the_same_wherever_the_robot_is_and_heads() -> None:
    env = WbcEnv("stand", robot="g1", noise="none")
    env.reset(seed=0)
    assert env.trial is not None
    observer, rng = env.trial.walking.control.observer, np.random.default_rng(1)
    robot, v = observer.robot, rng.normal(size=observer.robot.nv)
    q = robot.half_sitting.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.2, -0.3, 0.0)).coeffs()
    seen = []
    for place in (
        pin.SE3.Identity(),
        pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.1), np.array([3.0, -4.0, 0.5])),
    ):
        there = q.copy()
        there[:7] = pin.SE3ToXYZQUAT(place * pin.XYZQUATToSE3(q[:7]))
        robot.update(there, v)
        seen.append(env._observation())
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    robot.update(q, v)
    feet = [robot.placement(sole.frame).translation for sole in robot.soles]
    load = observer.load / (robot.mass * 9.80665)
    down = pin.rpy.rpyToMatrix(0.2, -0.3, 0.0).T @ [0.0, 0.0, -1.0]
    parts = (robot.com - 0.5 * (feet[0] + feet[1]), robot.com_velocity, down, v[3:6], load, q[7:], v[6:])
    np.testing.assert_allclose(seen[0], np.concatenate(parts), atol=1e-9)
    assert 0.3 < load.sum() < 1.1
