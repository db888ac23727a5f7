"""Standing and being pushed: the balance controller against the plant, and the studies made of them."""

from __future__ import annotations

import copy
import json
import math
import pickle
import re
from array import array
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from still_clips import still

from wbc.base.errors import InputError
from wbc.core.drive.control import Mode
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.robot import Robot
from wbc.feet import foot
from wbc.feet.soles.rigid import RigidFoot
from wbc.motion import write_motion
from wbc.robots import RobotDescription, load, names
from wbc.sim.balance.standing import (
    StandResult,
    StandSpec,
    StandTrial,
    recovers,
    stand,
)
from wbc.sim.plant.eyes import DepthCamera
from wbc.sim.plant.fitting import with_feet
from wbc.sim.plant.plant import Plant
from wbc.sim.studies.kinds import PushLimitSpec, largest_recovered, limit_outcome
from wbc.sim.studies.outcomes import run_trial, trial_from_json
from wbc.sim.trial.falls import LARGEST_TILT, LOWEST_SHARE, TrueFallDetector
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.spec import WallClock
from wbc.sim.trial.trial import Trial
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.tasks.balance import balance_controller
from wbc.walking import FootstepPlan, WalkingControl

BIPED = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()
FEET = {"left_sole": "left_foot", "right_sole": "right_foot"}
ROOT = """<link name="base_footprint"/>
  <joint name="root" type="fixed">
    <parent link="base_footprint"/><child link="trunk"/><origin xyz="0 0 0.72"/>
  </joint>
  <link name="trunk">"""
FOOTPRINT = BIPED.replace('<link name="trunk">', ROOT, 1)
"""The biped with a root that lies on the ground when its knees are nearly straight."""


@pytest.mark.parametrize(
    ("robot", "mode", "foot"),
    [(robot, mode, "flat") for robot in names() for mode in get_args(Mode)[: 3 if robot == "g1" else 1]]
    + [pytest.param("hrp4_class", "position", "soft", marks=pytest.mark.slow)],
)
def test_every_robot_stands_still_and_one_in_every_mode(robot: str, mode: Mode, foot: str) -> None:
    seconds = 0.2 if foot == "flat" else 1.2
    result = stand(StandSpec(robot=robot, mode=mode, foot=foot, seconds=seconds))
    assert result.upright and result.failures == 0 and result.seconds == pytest.approx(seconds)
    assert result.com_error < (0.003 if foot == "flat" else 0.005)
    assert result.zmp_noise < 0.0005 or foot == "soft"


def test_the_figures_of_a_stand_are_those_of_its_second_half() -> None:
    """Greatest way of the CoM from its start, and deviation of the centre of pressure, of both axes together, m."""
    trial = StandTrial(StandSpec(seconds=0.1), visuals=False)
    trial.tick_times = array("d", [1e-3])
    origin, rng = trial.sway.origin, np.random.default_rng(0)
    com, zmp = 0.01 * rng.normal(size=(40, 3)), 0.02 * rng.normal(size=(40, 2))
    zmp[25] = np.nan  # in flight
    trial.sway.com, trial.sway.zmp = list(origin + com), list(zmp)
    result = trial.result()
    late, seen = com[20:, :2], zmp[[*range(20, 25), *range(26, 40)]]
    assert result.com_error == pytest.approx(np.sqrt((late**2).sum(axis=1)).max())
    assert result.zmp_noise == pytest.approx(np.hypot(*seen.std(axis=0)))
    force, place = (
        np.array([[5.0, 0.0, 30.0], [0.0, 1.0, 10.0]]),
        np.array([[0.1, 0.2, 0.0], [0.5, -0.2, 0.3]]),
    )
    truth = replace(trial.plant.truth(), contact_force=force, contact_position=place)
    np.testing.assert_allclose(truth.centre_of_pressure, [0.2, 0.1, 0.075])
    assert np.isnan(replace(truth, contact_force=0.9 / 40.0 * force).centre_of_pressure).all()


def test_the_mode_of_a_stand_follows_from_robot_and_steps() -> None:
    assert replace(StandSpec(), robot="g1") == StandSpec(robot="g1")
    assert replace(StandSpec(), steps="allowed").chosen == "torque" and StandSpec().chosen == "position"
    assert replace(StandSpec(steps="allowed"), steps="none") == StandSpec()
    assert stand(steps="allowed", seconds=0.01).mode == "torque"


@pytest.mark.parametrize("name", ["rigid", "soft"])
def test_the_controller_knows_the_feet_that_are_on(name: str) -> None:
    other = foot(name)
    description = with_feet(load("hrp4_class"), other)
    assert with_feet(description, other) == description
    plant = Plant(description, foot=other, visuals=False)
    robot = description.robot()
    robot.update(plant.truth().q, np.zeros(robot.nv))
    for sole, built in zip(robot.soles, plant.feet, strict=True):
        site = plant.data.site(built.wrench_site)
        np.testing.assert_allclose(robot.placement(sole.frame).translation, site.xpos, atol=1e-9)
        np.testing.assert_allclose(robot.placement(sole.frame).rotation.ravel(), site.xmat, atol=1e-9)
        assert (sole.length, sole.width) == (built.fit.sole.length, built.fit.sole.width)


@pytest.mark.parametrize("name", ["rigid", "soft"])
def test_a_controller_may_know_the_masses_of_the_feet(name: str) -> None:
    """Mass, centre of mass and inertia of the robot are those of the plant that builds the feet itself."""
    other, q = foot(name), load("hrp4_class").robot().half_sitting
    description = with_feet(load("hrp4_class"), other, mass=True)
    assert with_feet(description, other, mass=True) == description
    robot, plant = description.robot(), Plant(load("hrp4_class"), foot=other, visuals=False)
    plant.reset(q)
    model, data = plant.model, plant.data
    root = model.body_rootid[model.site_bodyid[plant.sole_sites[0]]]
    assert robot.mass == pytest.approx(model.body_subtreemass[root], rel=1e-6)
    assert robot.mass == pytest.approx(load("hrp4_class").robot().mass + 2.0 * 0.34)
    pin.centerOfMass(robot.model, robot.data, q)
    np.testing.assert_allclose(robot.data.com[0], plant.truth().com, atol=1e-6)
    for turning in ([3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0], [1.0, 2.0, -1.0]):
        v = np.zeros(robot.nv)
        v[3:6] = data.qvel[3:6] = turning
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_energyVel(model, data)
        assert pin.computeKineticEnergy(robot.model, robot.data, q, v) == pytest.approx(
            data.energy[1], rel=1e-6
        )
    for wrong in (RigidFoot(mass=0.5), foot("soft" if name == "rigid" else "rigid")):
        with pytest.raises(InputError, match="wears"):
            with_feet(description, wrong, mass=True)


def turned(q: np.ndarray[Any, Any], angle: float, axis: list[float]) -> np.ndarray[Any, Any]:
    out = np.array(q)
    turn = pin.Quaternion(pin.AngleAxis(angle, np.array(axis) / np.linalg.norm(axis)))
    out[3:7] = (turn * pin.Quaternion(q[3:7])).coeffs()
    return out


def described(robot: str) -> RobotDescription:
    """One of the robots, or a biped whose root lies on the ground."""
    return load(robot) if robot in names() else RobotDescription.from_urdf(FOOTPRINT, **FEET)


def at_height(model: Robot, q: np.ndarray[Any, Any], com: float) -> np.ndarray[Any, Any]:
    """A configuration with the CoM at a height, m."""
    out = np.array(q)
    out[2] += com - float(pin.centerOfMass(model.model, model.model.createData(), out)[2])
    return out


@pytest.mark.parametrize("robot", [*names(), "footprint"])
def test_fallen_means_low_or_tilted_or_lost_wherever_and_whichever_way(robot: str) -> None:
    model = described(robot).robot()
    detector, q, com = TrueFallDetector(model), np.array(model.half_sitting), float(model.com[2])
    for heading in (0.0, 2.0):
        there = turned(q, heading, [0, 0, 1])
        there[:2] += 100.0
        assert not detector.fallen(there)
        for axis in ([1, 0, 0], [0, 1, 0], [1, -1, 0]):
            for share, fallen in ((0.98, False), (1.02, True)):
                tilted = at_height(model, turned(there, share * LARGEST_TILT, list(axis)), com)
                assert detector.fallen(tilted) is fallen
        for height, fallen in ((1.02, False), (0.98, True)):
            assert detector.fallen(at_height(model, there, height * LOWEST_SHARE * com)) is fallen
    for place in (2, 4):
        lost = np.array(q)
        lost[place] = np.nan
        assert detector.fallen(lost)
    with pytest.raises(InputError, match="configuration must have shape"):
        detector.fallen(q[:-1])


def test_a_robot_whose_root_lies_on_the_ground_stands() -> None:
    """The root of many descriptions is a `base_footprint` between the feet."""
    description = described("footprint")
    assert description.robot().half_sitting[2] < 0.0
    plant = Plant(description, visuals=False)
    robot = description.robot()
    trial = Trial(plant, WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period))
    trial.advance(0.1)
    assert trial.fall is None and trial.true_fall() is None


def test_a_camera_on_a_base_that_lies_on_the_ground_is_above_it_at_the_height_of_the_com() -> None:
    """A camera at (0.1, 0, 0.2) m looks from there above the point above the base at the height of the CoM."""
    camera = DepthCamera(
        at=(0.1, 0.0, 0.2), turn=(0.0, 1.2, 0.0), noise=0.0, relative_noise=0.0, dropout=0.0, latency=0.0
    )
    description = described("footprint")
    plant = Plant(description, eyes=[camera], visuals=False)
    (cloud,) = plant.clouds()
    robot, truth = description.robot(), plant.truth()
    robot.update(truth.q, truth.v)
    base = robot.placement(cloud.frame)
    assert abs(base.translation[2]) > 1e-3  # else the height over the base would be that over the ground
    com = float(robot.com[2]) - float(base.translation[2])
    rays = cloud.points @ base.rotation.T - [0.1, 0.0, com + 0.2]
    axis = np.array([math.cos(1.2), 0.0, -math.sin(1.2)])
    aside = np.unique(np.round(np.arctan(rays[:, 1] / (rays @ axis)), 5))
    np.testing.assert_allclose(aside, np.linspace(-0.5, 0.5, camera.rays[0]) * camera.view[0], atol=1e-4)


def test_stands_clips_and_searches_for_pushes_are_trials_of_studies(tmp_path: Path) -> None:
    robot = load("g1").robot()
    write_motion(still(robot, 21), clip := tmp_path / "wave.npz")
    for data in (
        {"kind": "stand", "robot": "g1", "seconds": 0.1},
        {"kind": "stand_push_limit", "seconds": 1.0, "push": {"direction": 1.0}, "highest": 0.4},
        {"kind": "track", "robot": "g1", "motion": str(clip)},
    ):
        spec = trial_from_json(data)
        plain = spec.to_json()
        assert plain["kind"] == data["kind"] and trial_from_json(json.loads(json.dumps(plain))) == spec
        assert trial_from_json(plain | {"seed": 7}).to_json() == plain | {"seed": 7}
    with pytest.raises(InputError, match="must have a time, and end before"):
        trial_from_json({"kind": "stand_push_limit", "seconds": 0.55, "push": {"time": 0.5}})
    clip.write_bytes(b"another")
    with pytest.raises(InputError, match="has changed"):
        trial_from_json(plain)
    outcomes = [run_trial(StandSpec(seconds=0.1)) for _ in range(2)]
    assert outcomes[0].status == "done" and outcomes[0].result == outcomes[1].result
    assert (
        outcomes[0].result is not None
        and outcomes[0].result["upright"]
        and "tick_us" not in outcomes[0].result
    )


@given(st.floats(0.0, 1.2), st.floats(0.3, 1.0), st.floats(0.01, 0.3))
@examples(40)
def test_the_largest_impulse_with_a_recovery_is_found_to_the_resolution(
    limit: float, highest: float, resolution: float
) -> None:
    """The impulse that is returned was tried and recovered, and one within the resolution above it was not held."""
    tried: dict[float, bool] = {}

    def recovers_(impulse: float) -> bool:
        assert impulse not in tried and 0.0 < impulse <= highest
        return tried.setdefault(impulse, impulse <= limit)

    found = largest_recovered(recovers_, highest, resolution)
    assert found == 0.0 or tried[found]
    if limit >= highest:
        assert found == highest and len(tried) == 1
        return
    beyond = min(impulse for impulse, held in tried.items() if not held)
    assert found <= limit < beyond and beyond - found <= resolution
    assert len(tried) <= 1 + math.ceil(math.log2(highest / resolution)) + 1


def test_a_search_on_a_walk_has_one_push_whose_impulse_does_not_count() -> None:
    one, other = (WalkPush(impulse=impulse, step=2) for impulse in (0.1, 0.7))
    plan = WalkPlan(distance=0.5)
    walk = WalkSpec(plan=plan)
    spec = PushLimitSpec(trial=walk, push=one)
    assert spec == PushLimitSpec(trial=walk, push=other)
    assert spec.pushed_walk(walk, 0.3).pushes == (replace(one, impulse=0.3),)
    plain = json.loads(json.dumps(spec.to_json()))
    assert PushLimitSpec.from_json(plain) == spec and len(plain["pushes"]) == 1
    assert PushLimitSpec.from_json(plain | {"seed": 5}).trial.seed == 5
    with pytest.raises(InputError, match="no push of its own"):
        PushLimitSpec(trial=replace(walk, pushes=(other,)), push=one)
    with pytest.raises(InputError, match="at step 99"):
        PushLimitSpec(trial=walk, push=replace(one, step=99))
    for pushes in ([], 2 * plain["pushes"], 5, None):
        with pytest.raises(InputError, match="a walk with one push, got"):
            PushLimitSpec.from_json(plain | {"pushes": pushes})
    for bad in (plain | {"pushes": [3]}, {"kind": "stand_push_limit", "push": 3}):
        with pytest.raises(InputError, match="a push must be an object of names and values, got 3"):
            trial_from_json(bad)


def test_a_search_begins_without_a_push_and_adds_up_its_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = trial_from_json({"kind": "stand_push_limit", "seconds": 1.0, "highest": 0.8, "resolution": 0.2})
    for limit, impulses, found in (
        (0.5, [0.0, 0.8, 0.4, 0.6], 0.4),
        (0.9, [0.0, 0.8], 0.8),
        (-1.0, [0.0], None),
    ):

        def tried(_: object, impulse: float, check: object, limit: float = limit) -> Any:
            del check
            return impulse <= limit, 1.5, {"fact": 2.0 * impulse}

        monkeypatch.setattr(PushLimitSpec, "tried", tried)
        outcome = limit_outcome(spec, lambda: None)
        assert outcome.status == "done" and outcome.result is not None
        assert [row["impulse"] for row in outcome.result["tried"]] == pytest.approx(impulses)
        assert [row["fact"] for row in outcome.result["tried"]] == pytest.approx([2.0 * i for i in impulses])
        assert outcome.result["impulse"] == (found if found is None else pytest.approx(found))
        assert (outcome.result["walks"], outcome.result["seconds"]) == (len(impulses), 1.5 * len(impulses))
    for bad in ({"resolution": 1.1}, {"push": {"time": 0.95}}):
        with pytest.raises(InputError):
            trial_from_json({"kind": "stand_push_limit", "seconds": 1.0} | bad)


def test_a_walk_that_diverges_is_no_result_of_a_trial_nor_of_a_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Any other end of a walk is a result; of a search strayed walks count as held, fallen ones as not."""

    def ended(outcome: str) -> Any:
        clock = WallClock(1.0, 2.0, {"median": 1.0})
        return SimpleNamespace(
            outcome=outcome,
            record=lambda: {"outcome": outcome},
            timings=lambda: asdict(clock),
            steps_done=3,
            seconds=1.5,
            fall_reason=None,
        )

    spec = WalkSpec(plan=WalkPlan(distance=0.1))
    search = PushLimitSpec(trial=spec, push=WalkPush(impulse=0.1, time=0.1), highest=0.4)
    for outcome, status, found in (
        ("completed", "done", 0.4),
        ("strayed", "done", 0.4),
        ("fell", "done", None),
        ("diverged", "diverged", None),
    ):
        made = SimpleNamespace(
            diverged="NaN" if outcome == "diverged" else None, run=lambda hooks, o=outcome: ended(o)
        )
        monkeypatch.setattr("wbc.sim.studies.kinds.WalkTrial", lambda spec, visuals, made=made: made)
        trial = run_trial(spec)
        assert (trial.status, trial.result) == (status, {"outcome": outcome})
        assert trial.clock is not None and trial.clock["wall_s"] == 1.0
        limit = run_trial(search)
        assert limit.status == status and limit.result is not None and limit.result["impulse"] == found
        assert limit.result["walks"] == (2 if found else 1 if outcome == "fell" else 0)


def stood() -> StandResult:
    return StandResult(
        robot="g1",
        mode="torque",
        upright=True,
        com_error=1.23456,
        zmp_noise=0.5,
        clock=WallClock(1.0, 2.0, {"median": 1.0}),
        seconds=3.0,
        steps_taken=2,
        failures=0,
        noise="none",
        foot="flat",
        seed=5,
        control_period=0.002,
    )


def test_a_former_name_of_a_figure_says_the_present_one() -> None:
    result = stood()
    for former, present in StandResult.RENAMED.items():
        with pytest.raises(AttributeError, match=re.escape(f"'{former}'; in its place: {present}")):
            getattr(result, former)
        path, value = present.partition(" ")[0].split("."), result
        for name in path:
            value = getattr(value, name)
    with pytest.raises(AttributeError, match="no attribute 'height'$"):
        result.height  # type: ignore[attr-defined]  # noqa: B018
    assert copy.copy(result) == pickle.loads(pickle.dumps(result)) == result


def test_results_are_shown_with_their_units() -> None:
    """Numbers with four digits; what is no plain value, such as a list, is left out."""
    shown = stood()._repr_html_()
    rows = [re.sub(r"<[^>]+>", " ", row).split() for row in shown.split("<tr")]
    assert ["com_error", "1.235", "m"] in [row[-3:] for row in rows]
    assert ["seconds", "3", "s"] in [row[-3:] for row in rows] and "tick_us" not in shown


@pytest.mark.slow
def test_the_largest_push_of_a_stand_is_found_by_bisection() -> None:
    data = {"kind": "stand_push_limit", "mode": "torque", "seconds": 1.6, "push": {"time": 0.2}}
    outcome = run_trial(trial_from_json(data | {"highest": 0.8, "resolution": 0.4}))
    assert outcome.status == "done" and outcome.result is not None
    assert [row["impulse"] for row in outcome.result["tried"]] == [0.0, 0.8, 0.4]
    assert outcome.result["impulse"] in (0.0, 0.4)


@pytest.mark.parametrize(("impulse", "held"), [(0.05, True), (0.3, False)])
def test_a_robot_that_still_moves_at_the_end_has_not_recovered(impulse: float, held: bool) -> None:
    """A push of 0.3 Ns/kg that has just ended leaves 0.3 m/s, less what the feet take; one of 0.05 stays below 0.1."""
    spec = StandSpec(mode="torque", seconds=0.05)
    assert recovers(spec, WalkPush(time=0.01, impulse=impulse, duration=0.03)) is held


def test_a_robot_that_has_fallen_has_not_recovered_though_it_lies_still(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(StandTrial, "fallen", property(lambda trial: trial.plant.time > 0.029))
    monkeypatch.setattr(StandTrial, "advance", lambda trial, seconds: trial.plant.step(trial.plant.hold()))
    spec, none = StandSpec(mode="torque", seconds=0.03), WalkPush(time=0.0, impulse=0.0)
    assert recovers(spec, none)
    monkeypatch.setattr(StandTrial, "fallen", True)
    assert not recovers(spec, none)


@pytest.mark.slow
def test_a_weak_push_is_recovered_and_a_strong_one_is_not() -> None:
    spec = StandSpec(mode="torque", seconds=1.6)
    assert recovers(spec, WalkPush(time=0.2, impulse=0.2))
    assert not recovers(spec, WalkPush(time=0.2, impulse=0.8))


@pytest.mark.slow
def test_a_robot_that_may_step_takes_a_push_that_its_feet_in_place_do_not() -> None:
    spec, push = StandSpec(robot="g1", mode="torque", seconds=3.6), WalkPush(time=0.5, impulse=0.55)
    assert not recovers(spec, push)
    assert recovers(replace(spec, steps="allowed"), push)


def scaled_biped(share: float, effort: float = 1.0) -> RobotDescription:
    """The example's biped with a share of its masses and, on top, of its torques."""

    def scale(match: re.Match[str]) -> str:
        return f'{match[1]}="{float(match[2]) * share * (effort if match[1] == "effort" else 1.0):g}"'

    text = re.sub(r'(<mass value|ixx|iyy|izz|effort)="([^"]+)"', scale, BIPED)
    return RobotDescription.from_urdf(text, left_sole="left_foot", right_sole="right_foot")


@pytest.mark.parametrize("drive", [PositionControl, TorqueControl])
@pytest.mark.parametrize("share", by_default([0.06, 0.02], 0.02))
def test_a_light_robot_stands_as_a_heavy_one(
    share: float, drive: type[PositionControl | TorqueControl]
) -> None:
    plant = Plant(scaled_biped(share), visuals=False)
    control = drive(balance_controller(plant.description.robot(), 0.005))
    start = plant.truth().com
    while plant.time < 0.5:
        plant.step(control.command(plant.measure()))
    assert control.failures == 0
    np.testing.assert_allclose(plant.truth().com, start, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("distance", "steps"), [(0.1, 4), (0.12, 4), (0.2, 6)])
def test_a_small_light_robot_walks(distance: float, steps: int, tmp_path: Path) -> None:
    """The example's biped of 1.5 kg with its CoM at 0.185 m takes its LIPM steps and stands."""
    size, mass = 0.3, 0.0577
    powers = {
        "xyz": (1, 0),
        "size": (1, 0),
        "radius": (1, 0),
        "length": (1, 0),
        "effort": (1, 1),
        "mass value": (0, 1),
    }

    def change(match: re.Match[str]) -> str:
        a, b = powers.get(match[1], (2, 1))
        return (
            f'{match[1]}="{" ".join(f"{float(each) * size**a * mass**b:.9g}" for each in match[2].split())}"'
        )

    origins = re.sub(r'<axis xyz="([^"]*)"', r'<axis way="\1"', BIPED)
    names = "|".join((*powers, "i[xyz]{2}"))
    text = re.sub(rf'\b({names})="([^"]*)"', change, origins).replace("<axis way=", "<axis xyz=")
    (tmp_path / "small.urdf").write_text(text, encoding="utf-8")
    toml = 'file = "small.urdf"\nleft_sole = "left_foot"\nright_sole = "right_foot"\n'
    (tmp_path / "small.toml").write_text(toml, encoding="utf-8")
    robot = str(tmp_path / "small.toml")
    plan = WalkPlan(distance=distance)
    spec = WalkSpec(robot=robot, plan=plan, terrain="flat", foot="flat", noise="none")
    trial = WalkTrial(spec, visuals=False)
    result = trial.run()
    assert trial.plant.robot.mass == pytest.approx(1.5, abs=0.01)
    assert result.outcome == "completed" and result.steps_done == result.steps_planned == steps
