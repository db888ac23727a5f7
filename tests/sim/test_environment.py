"""The environment of gymnasium: its contract, seeds, and bad input."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 - an extra

from wbc.app import Log, Recorder  # noqa: E402 - after an extra
from wbc.app.replay.film import renderer  # noqa: E402 - after an extra
from wbc.base.drawing import RenderError  # noqa: E402 - after an extra
from wbc.base.errors import InputError  # noqa: E402 - after an extra
from wbc.core.estimation.falls import FallReason  # noqa: E402 - after an extra
from wbc.sim.environment import WbcEnv  # noqa: E402 - an extra


def draws() -> bool:
    """Return whether pictures can be drawn here."""
    import mujoco  # noqa: PLC0415

    try:
        renderer(mujoco.MjSpec().compile(), 16, 16).close()
    except RenderError:
        return False
    return True


@pytest.mark.parametrize("name", ["Walk", "Stand"])
def test_an_environment_is_written_and_made_again(name: str) -> None:
    env = gymnasium.make(f"wbc.sim.environment:wbc/{name}-v0", seconds=1.0, foot="soft")
    spec = gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gymnasium.make(spec)
    assert again.spec.kwargs == env.spec.kwargs and again.observation_space == env.observation_space


def test_an_episode_that_is_stopped_is_cut_short_and_costs_nothing() -> None:
    env = WbcEnv("stand", seconds=1.0, period=0.02)
    env.reset(seed=1)
    assert env.trial is not None
    env.trial.stop()
    _, reward, terminated, truncated, info = env.step(np.zeros(4))
    assert (terminated, truncated, info["fall"]) == (False, True, None) and reward > -0.5
    with pytest.raises(InputError, match="reset"):
        env.step(np.zeros(4))
    env.reset(seed=1)
    assert not env.step(np.zeros(4))[3]


def test_a_fall_costs_one() -> None:
    """Of two episodes from the same state the one that ends with a fall has a reward that is lower by one."""
    rewards = []
    for falls in (False, True):
        env = WbcEnv("stand", seconds=1.0, period=0.02, noise="none")
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


def test_a_divergence_ends_one_of_several_episodes_with_its_reason() -> None:
    env = gymnasium.make_vec(
        "wbc.sim.environment:wbc/Stand-v0",
        num_envs=2,
        vectorization_mode="sync",
        seconds=2.0,
        period=0.02,
        noise="none",
    )
    env.reset(seed=0)
    first, _ = env.envs
    plant = first.unwrapped.trial.plant
    plant.data.qvel[plant.places.joint_dof[0]] = np.nan
    for _ in range(3):  # the next step begins anew the one that has ended
        observations, rewards, terminated, truncated, info = env.step(np.zeros((2, 4)))
        assert np.isfinite(observations).all() and np.isfinite(rewards).all() and not truncated.any()
        if terminated.any():
            break
    assert terminated.tolist() == [True, False] and rewards[0] == -1.0
    assert "diverged" in info["diverged"][0] and info["diverged"][1] is None and info["fall"][0] is None
    *_, terminated, truncated, _ = env.step(np.zeros((2, 4)))
    assert not terminated.any() and not truncated.any()


def test_the_same_seed_and_actions_give_the_same_episode() -> None:
    seen = []
    for last in (0.1, 0.1, 0.0):
        env = WbcEnv("walk", seconds=1.0, period=0.05)
        env.reset(seed=3)
        seen.append([env.step(action)[0] for action in ([0.2, 0.0, 0.1], [0.1, last, 0.0], [0.1, last, 0.0])])
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0][-1], seen[2][-1])


@pytest.mark.skipif(not draws(), reason="no offscreen rendering here")
def test_pictures_show_the_robot_and_change_nothing() -> None:
    drawn, plain = (
        WbcEnv("stand", render_mode=mode, period=0.05, noise="none") for mode in ("rgb_array", None)
    )
    with pytest.raises(InputError, match="reset"):
        drawn.render()
    pictures = []
    for env in (drawn, plain):
        env.reset(seed=1)
        pictures = [env.render(), *pictures]
        last = [env.step([0.04, 0.0, 0.15, 0.4])[0] for _ in range(3)][-1]
        pictures = [env.render(), last, *pictures]
    _, plainly, _, after, last, before = pictures
    assert pictures[0] is None and pictures[2] is None
    np.testing.assert_array_equal(plainly, last)
    assert after.shape == (360, 480, 3) and after.dtype == np.uint8
    assert after.std() > 5.0 and np.abs(after.astype(int) - before).max() > 50, "the robot has moved"
    drawn.close()


def test_what_goes_in_and_out_is_float32_within_the_bounds_of_its_space() -> None:
    env = WbcEnv("walk", period=0.02)
    assert env.action_space.dtype == env.observation_space.dtype == np.float32
    observation, _ = env.reset(seed=0)
    robot = env.trial.drives.observer.robot
    robot.update(robot.q, np.full(robot.nv, 1e4))
    for seen in (observation, env.step(env.action_space.high)[0], env._observation()):
        assert seen.dtype == np.float32 and env.observation_space.contains(seen)
    assert env.frame_skip == 4 and env.metadata["render_fps"] == pytest.approx(50.0)


@pytest.mark.slow
def test_episodes_in_processes_of_their_own_are_those_of_this_process() -> None:
    several = gymnasium.make_vec(
        "wbc.sim.environment:wbc/Walk-v0", num_envs=2, vectorization_mode="async", seconds=0.3
    )
    one, (observations, _) = WbcEnv("walk", seconds=0.3), several.reset(seed=5)
    np.testing.assert_array_equal(observations[1], one.reset(seed=6)[0])
    observations, *_ = several.step(np.full((2, 3), 0.1, np.float32))
    np.testing.assert_array_equal(observations[1], one.step(np.full(3, 0.1, np.float32))[0])
    several.close()


def test_an_episode_is_recorded_by_a_hook_to_its_end(tmp_path: Path) -> None:
    env = WbcEnv("stand", seconds=0.1, period=0.05)
    for name in ("one.arrow", "other.arrow"):
        env.reset(seed=0, options={"hooks": [Recorder(tmp_path / name)]})
        env.step(np.zeros(4))
    assert len(Log.open(tmp_path / "one.arrow")) == 11, "the next reset has ended it"
    assert env.step(np.zeros(4))[3]
    assert len(Log.open(tmp_path / "other.arrow")) == 21, "one tick of the reset, and 0.1 s at 5 ms"


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"seconds": -1.0}, r"seconds of WbcEnv \(s\)"),
        ({"period": math.nan}, r"period of WbcEnv \(s\)"),
        ({"task": "run"}, "task 'run' of the environment"),
        ({"render_mode": "human"}, "'rgb_array'.*wbc view"),
        ({"terain": "stones"}, "terrain"),
        ({"seed": 3}, "seed"),
    ],
)
def test_what_an_environment_cannot_be_made_of_is_refused(values: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        WbcEnv(**values)
    if not {"task", "render_mode"} & set(values):  # of these gymnasium says something of its own
        with pytest.raises(InputError, match=named):
            gymnasium.make("wbc.sim.environment:wbc/Walk-v0", **values)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Walk", "Stand"])
def test_gymnasium_finds_nothing_wrong_and_warns_of_nothing(name: str) -> None:
    """A warning is an error in these tests; whether pictures can be drawn depends on the machine."""
    env = gymnasium.make(f"wbc.sim.environment:wbc/{name}-v0", seconds=1.0, robot="g1").unwrapped
    check_env(env, skip_render_check=not draws())


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
    env = WbcEnv("stand", seconds=4.0, period=0.1)
    env.reset(seed=0)
    assert env.trial is not None and env.trial.spec.pushes[0].time == 2.0
    *_, truncated, info = [env.step([0.03, 0.0, 0.1, 0.2]) for _ in range(2)][-1]
    assert not truncated and info["fall"] is None
    assert env.trial.control.body.lean == (0.0, 0.1)
    robot = env.trial.control.drives.observer.robot
    assert env.trial.control.body.com_height < float(robot.com[2]) + 0.04


def test_the_reward_of_a_walk_is_the_way_of_its_feet_and_its_end_is_its_time() -> None:
    """Three actions of 0.05 s: the rewards add up to the displacement of the middle of the soles along x."""
    env = WbcEnv("walk", seconds=0.15, period=0.05, noise="none")
    env.reset(seed=2)
    assert env.trial is not None
    plant = env.trial.plant

    def place() -> float:
        return 0.5 * float(plant.sole_pose(0)[0][0] + plant.sole_pose(1)[0][0])

    begin, before, total, ends = place(), plant.time, 0.0, []
    for _ in range(3):
        *_, reward, terminated, truncated, info = env.step([9.0, -9.0, 0.2])
        assert env.trial.control.velocity == pytest.approx((0.3, -0.15, 0.2))  # the bounds of an action
        assert plant.time - before == pytest.approx(0.05) and info["time"] == plant.time
        before, total = plant.time, total + reward
        ends.append((terminated, truncated))
    assert total == pytest.approx(place() - begin, abs=1e-12)
    assert ends == [(False, False), (False, False), (False, True)]
    assert WbcEnv("walk", seconds=0.2, period=5.0).frame_skip == round(0.2 / plant.control_period)


def test_a_stand_is_pushed_every_two_seconds_in_any_direction_up_to_its_greatest_push() -> None:
    env, every = WbcEnv("stand", seconds=9.0, noise="none"), []
    env._begin = lambda spec, hooks=(): every.append(spec) or np.zeros(env.observation_space.shape)  # type: ignore
    for seed in range(30):  # 120 pushes
        env.reset(seed=seed)
    pushes = [push for spec in every for push in spec.pushes]
    assert [push.time for push in every[0].pushes] == [2.0, 4.0, 6.0, 8.0]
    impulses, directions = (np.array([getattr(p, name) for p in pushes]) for name in ("impulse", "direction"))
    assert 0.0 <= impulses.min() < 0.01 and 0.14 < impulses.max() <= 0.15
    assert impulses.mean() == pytest.approx(0.075, rel=0.15)
    assert -math.pi <= directions.min() < -2.9 and 2.9 < directions.max() <= math.pi
    assert len({spec.seed for spec in every}) == 30


def test_an_observation_is_the_same_wherever_the_robot_is_and_heads() -> None:
    env = WbcEnv("stand", robot="g1", noise="none")
    env.reset(seed=0)
    assert env.trial is not None
    observer, rng = env.trial.control.drives.observer, np.random.default_rng(1)
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
    np.testing.assert_allclose(seen[0], seen[1], rtol=1e-5, atol=1e-6)  # float32
    robot.update(q, v)
    feet = [robot.placement(sole.frame).translation for sole in robot.soles]
    load = observer.load / (robot.mass * 9.80665)
    down = pin.rpy.rpyToMatrix(0.2, -0.3, 0.0).T @ [0.0, 0.0, -1.0]
    parts = (robot.com - 0.5 * (feet[0] + feet[1]), robot.com_velocity, down, v[3:6], load, q[7:], v[6:])
    np.testing.assert_allclose(seen[0], np.concatenate(parts), rtol=1e-5, atol=1e-6)
    assert 0.3 < load.sum() < 1.1
