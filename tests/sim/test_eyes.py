"""Eyes of a plant see its ground, late and with noise; a walk puts its feet by what they see."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from wbc.base.errors import InputError
from wbc.feet.sensing.range_sensor import RangeSensor
from wbc.ground import KnownGround, PointCloud
from wbc.ground.cloud import ElevationMap
from wbc.robots import RobotDescription, load
from wbc.sim import DepthCamera, DepthView, Plant, WalkPlan, WalkSpec, make_terrain
from wbc.sim.plant.eyes import ToeSensors
from wbc.sim.plant.eyes.depth import visible_model
from wbc.sim.plant.link_geoms import SHAPE_GROUP
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.trial import WalkTrial

ROBOT = load("hrp4_class")
EXACT = DepthCamera(noise=0.0, relative_noise=0.0, dropout=0.0)


plant_of = partial(Plant, visuals=False)


def world(cloud: PointCloud, plant: Plant) -> np.ndarray:
    robot = plant.description.robot()
    truth = plant.truth()
    robot.update(truth.q, truth.v)
    frame = robot.placement(cloud.frame)
    return cloud.points @ frame.rotation.T + frame.translation


def after(plant: Plant, seconds: float) -> list[PointCloud]:
    clouds = plant.clouds()
    while plant.time < seconds:
        plant.step(plant.hold())
        clouds += plant.clouds()
    return clouds


@pytest.mark.parametrize("name", ["steps", "stones"])
def test_a_camera_without_errors_sees_the_ground_and_nothing_of_the_robot(name: str) -> None:
    plant = plant_of(ROBOT, terrain=make_terrain(name, 0.05), eyes=[replace(EXACT, latency=0.0)])
    (cloud,) = plant.clouds()
    points = world(cloud, plant)
    assert len(points) > 500
    # At a vertical face the ground has two heights.
    near = np.array([plant.terrain.height(points[:, 0] + d, points[:, 1]) for d in (-1e-3, 0.0, 1e-3)])
    assert (points[:, 2] < near.max(axis=0) + 1e-3).all()
    assert (points[:, 2] > near.min(axis=0) - 1e-3).all()


def test_frames_come_at_their_rate_after_their_latency_with_noise_and_losses() -> None:
    camera = DepthCamera(rate=20.0, latency=0.03, dropout=0.3)
    plant = plant_of(ROBOT, eyes=[camera], seed=3)
    assert not plant.clouds()
    clouds = after(plant, 0.3)
    times = [cloud.time for cloud in clouds]
    assert times == pytest.approx(np.arange(0.0, 0.27, 0.05))
    count = np.array([len(cloud.points) for cloud in clouds])
    assert count.mean() == pytest.approx(0.7 * math.prod(camera.rays), rel=0.05)
    height = world(clouds[-1], plant)[:, 2]
    assert 0.001 < height.std() < 0.012


def test_errors_of_eyes_are_drawn_anew_for_each_seed() -> None:
    camera = DepthCamera(rays=(6, 4), latency=0.0)
    plant = plant_of(ROBOT, eyes=[camera, camera], seed=3)
    found = {}
    for seed in (3, 4, 3):
        plant.reset(seed=seed)
        one, other = (cloud.points for cloud in plant.clouds())
        assert one.shape != other.shape or not np.array_equal(one, other)
        again = found.setdefault(seed, one)
        np.testing.assert_array_equal(one, again)
    assert found[3].shape != found[4].shape or not np.array_equal(found[3], found[4])


def test_a_cloud_is_given_once() -> None:
    camera = DepthCamera(rays=(4, 3), latency=0.0, rate=100.0)
    plant = plant_of(ROBOT, eyes=[camera, camera])
    assert [len(plant.clouds()) for _ in range(2)] == [2, 0]
    for _ in range(2):
        plant.step(plant.hold())
    assert [len(plant.clouds()) for _ in range(2)] == [2, 0]


def test_eyes_leave_the_other_sensors_as_they_are() -> None:
    blind, seeing = (
        plant_of(ROBOT, noise="realistic", eyes=eyes) for eyes in ((), (DepthCamera(), ToeSensors()))
    )
    for _ in range(10):
        blind.step(blind.hold())
        seeing.step(seeing.hold())
    assert np.array_equal(blind.measure().joint_position, seeing.measure().joint_position)
    assert np.array_equal(blind.data.qpos, seeing.data.qpos)


def test_toes_see_the_ground_under_them() -> None:
    plant = plant_of(ROBOT, foot="long_arch", eyes=[ToeSensors(noise=0.0, dropout=0.0)])
    q = plant.on_ground(plant.robot.half_sitting)
    q[2] += 0.07
    plant.reset(q)
    clouds = plant.clouds()
    assert len(clouds) == 2
    for cloud in clouds:
        points = world(cloud, plant)
        assert points.shape == (3, 3)
        assert np.abs(points[:, 2]).max() < 1e-3
        assert np.ptp(points[:, 1]) == pytest.approx(plant.feet[0].fit.sole.width, abs=1e-3)


def test_a_camera_looks_where_it_is_turned_from_where_it_is() -> None:
    """Points of a level floor lie in its field of view by its pin-hole, within range; a misplaced one is off."""
    camera = replace(
        EXACT, latency=0.0, at=(0.1, 0.05, 0.2), turn=(0.0, 0.9, 0.3), view=(0.8, 0.6), rays=(9, 7)
    )
    plant = plant_of(ROBOT, eyes=[camera])
    base = np.array(plant.base_pose[:3])
    (cloud,) = plant.clouds()
    points = world(cloud, plant)
    assert len(points) == 63 and np.abs(points[:, 2]).max() < 1e-6
    heading, pitch = 0.3, 0.9  # of the optical axis, which looks down
    axis = np.array(
        [math.cos(heading) * math.cos(pitch), math.sin(heading) * math.cos(pitch), -math.sin(pitch)]
    )
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    rays = points - (base + [0.1, 0.05, 0.2])
    depth, aside, up = rays @ axis, rays @ left, rays @ np.cross(axis, left)
    np.testing.assert_allclose(
        np.unique(np.round(np.arctan(aside / depth), 6)), np.linspace(-0.4, 0.4, 9), atol=1e-5
    )
    np.testing.assert_allclose(
        np.unique(np.round(np.arctan(up / depth), 6)), np.linspace(-0.3, 0.3, 7), atol=1e-5
    )
    distances = np.sort(np.linalg.norm(rays, axis=1))
    near, far = distances[10] + 1e-6, distances[40] + 1e-6
    (some,) = plant_of(ROBOT, eyes=[replace(camera, nearest=near, furthest=far)]).clouds()
    assert len(some.points) == ((distances > near) & (distances < far)).sum() > 20
    off = np.array([0.02, -0.03, 0.04])
    wrong = plant_of(ROBOT, eyes=[replace(camera, misplaced=tuple(off.tolist()))])
    (shifted,) = wrong.clouds()
    np.testing.assert_allclose(world(shifted, wrong)[:, 2], -off[2], atol=1e-6)


def test_noise_of_a_camera_grows_with_the_distance() -> None:
    """Along its ray a distance d has a deviation of noise + relative_noise · d, which the cloud says."""
    camera = replace(EXACT, latency=0.0, noise=0.002, relative_noise=0.01, rate=200.0)
    view = camera.start(plant_of(ROBOT, seed=1))
    view.reset(1)
    clouds = [view.clouds(0.0)[0] for _ in range(150)]
    heights = np.array([cloud.points for cloud in clouds])
    middle = heights.mean(axis=0)
    spread = np.sqrt(((heights - middle) ** 2).sum(axis=2).mean(axis=0))
    std = np.asarray(clouds[0].std)
    assert spread / std == pytest.approx(np.ones(std.size), abs=0.3)
    assert (spread / std).mean() == pytest.approx(1.0, abs=0.02)
    far = (std - 0.002) / 0.01
    assert far.min() > 0.2 and far.max() < 3.0


def test_readings_of_toes_have_the_noise_losses_and_range_that_they_say() -> None:
    sensors = ToeSensors(noise=0.004, dropout=0.2, nearest=0.03, furthest=0.12)
    plant = plant_of(ROBOT, foot="long_arch", eyes=[sensors])
    assert plant.eyes is not None
    (view,) = plant.eyes._views
    q = plant.on_ground(plant.robot.half_sitting)
    for height, seen in ((0.029, False), (0.05, True), (0.119, True), (0.121, False)):  # of the sole
        lifted = q.copy()
        lifted[2] += height
        plant.reset(lifted)
        clouds = [cloud for _ in range(300) for cloud in view.clouds(0.0)]
        assert bool(clouds) == seen
        if seen:
            each = [
                [cloud for cloud in clouds if cloud.frame == frame] for frame in {c.frame for c in clouds}
            ]
            joined = [
                PointCloud(np.vstack([c.points for c in some]), 0.0, some[0].frame, 1.0) for some in each
            ]
            points = np.vstack([world(cloud, plant) for cloud in joined])
            assert points[:, 2].std() == pytest.approx(0.004, rel=0.1)
            assert points[:, 2].mean() == pytest.approx(0.0, abs=5e-4)
            assert len(points) / (300 * 6) == pytest.approx(0.8, abs=0.04)


def test_the_errors_of_both_toes_are_independent() -> None:
    sensor = RangeSensor(noise=0.005)
    plant = plant_of(ROBOT, foot="variable", range_sensor=sensor)
    readings = []
    for _ in range(100):
        plant.step(plant.hold())
        readings.append(plant.measure().sole_range)
    left, right = (np.diff(each) for each in np.array(readings).T)
    assert np.std(left) == pytest.approx(math.sqrt(2.0) * sensor.noise, rel=0.2)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.3


def test_a_camera_sees_things_before_and_after_the_robot_in_a_model() -> None:
    """Boxes of 0.1 and 0.2 m on the floor, of which one is the first body of all."""
    xml = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")
    box = '<body name="{0}" pos="1 {1} {2}"><geom type="box" size="0.3 0.2 {2}"/></body>'
    first, last = box.format("first", 0.3, 0.05), box.format("last", -0.3, 0.1)
    floor = '<geom type="plane" size="0 0 1"/>'
    whole = xml.replace("<worldbody>", "<worldbody>" + first, 1)
    head, _, tail = whole.rpartition("</worldbody>")
    spec = mujoco.MjSpec.from_string(f"{head}{last}{floor}</worldbody>{tail}")
    model = spec.compile()
    assert model.body("first").id == 1
    description = RobotDescription.from_mjcf(xml)
    robot, data = description.robot(), mujoco.MjData(model)
    places = RobotPlaces(model, robot)
    places.set_configuration(robot.half_sitting, data.qpos)
    mujoco.mj_forward(model, data)
    view = DepthView(replace(EXACT, at=(0.2, 0.0, 0.3), turn=(0.0, 0.8, 0.0)), places, data)
    (cloud,) = view.clouds(0.0)
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    place = robot.placement(cloud.frame)
    points = cloud.points @ place.rotation.T + place.translation
    for y, height in ((0.3, 0.1), (-0.3, 0.2)):
        on = (abs(points[:, 0] - 1.0) < 0.28) & (abs(points[:, 1] - y) < 0.18)
        assert on.sum() > 20 and points[on, 2] == pytest.approx(height, abs=1e-6)
    beside = (points[:, 0] < 0.69) & (points[:, 0] > 0.4)
    assert beside.sum() > 20 and points[beside, 2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", ["hrp4_class", pytest.param("g1", marks=pytest.mark.slow)])
def test_points_on_the_robots_own_body_are_left_out_by_its_pose(name: str) -> None:
    """A sensor before the robot sees its legs and feet and, beside them, the ground."""
    plant = plant_of(load(name))
    model = visible_model(plant)
    data = mujoco.MjData(model)
    data.qpos[:] = plant.data.qpos
    mujoco.mj_forward(model, data)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-0.8, 0.8, 60), np.linspace(-0.8, 0.8, 60)))
    at = np.array([0.5, 0.1, 0.6])
    rays = np.stack([x, y, 0.0 * x], axis=1) - at
    hit, distance = np.zeros(len(rays), np.int32), np.zeros(len(rays))
    mujoco.mj_multiRay(model, data, at, rays.ravel(), None, True, -1, hit, distance, None, len(rays), 9.0)
    points, own = at + distance[:, None] * rays, model.geom_bodyid[hit] > 0
    robot, truth = plant.description.robot(), plant.truth()
    robot.update(truth.q, truth.v)

    def cells(points: np.ndarray, shapes) -> int:
        ground = KnownGround(robot, shapes=shapes)
        ground.add(PointCloud(points, 0.0, "world", 0.002))
        ground.update(robot, 0.0)
        return len(ground.map.known()[0])

    shapes = plant.description.collision_shapes()
    # Capsules leave the corners of the boxes that stand for meshes here.
    assert cells(points[own], shapes) < 0.03 * cells(points[own], None)
    assert cells(points[~own], shapes) > 0.97 * cells(points[~own], None)


def test_a_ghost_is_seen_where_it_is_not() -> None:
    plant = plant_of(ROBOT, eyes=[replace(EXACT, latency=0.0, ghost=(0.8, 0.1, 0.2, 0.05))])
    points = world(plant.clouds()[0], plant)
    inside = (np.abs(points[:, :2] - (0.8, 0.1)) < 0.2).all(axis=1)
    assert inside.sum() > 20
    assert points[:, 2] == pytest.approx(np.where(inside, 0.05, 0.0), abs=1e-6)


def test_a_camera_sees_soles_as_plates_that_stand_on_the_ground() -> None:
    """Of the sole's rectangle, 20 mm high; and nothing of what the robot is drawn with can be looked through."""
    plant = plant_of(ROBOT, foot="rigid")
    model = visible_model(plant)
    data = mujoco.MjData(model)
    data.qpos[:] = plant.data.qpos
    mujoco.mj_forward(model, data)
    plates = []
    for side, foot in enumerate(plant.feet):
        sole = foot.fit.sole
        size = np.array([sole.length, sole.width, 0.02]) / 2.0
        same = [i for i in range(model.ngeom) if np.allclose(model.geom_size[i], size, atol=1e-9)]
        centre, rotation = plant.sole_pose(side)
        middle = centre + 0.01 * rotation[:, 2]
        plates.append([i for i in same if np.allclose(data.geom_xpos[i], middle, atol=1e-6)])
    assert [len(each) for each in plates] == [1, 1]
    shapes = model.geom_group == SHAPE_GROUP
    assert shapes.any() and (model.geom_rgba[shapes, 3] == 1.0).all()


def test_a_raised_leg_hides_ground_from_the_camera() -> None:
    plant = plant_of(ROBOT, eyes=[replace(EXACT, latency=0.0)])
    (standing,) = plant.clouds()
    model, q = plant.robot.model, plant.robot.half_sitting.copy()
    for joint, angle in (("left_hip_pitch", -1.4), ("left_knee_pitch", 1.4)):
        q[model.idx_qs[model.getJointId(joint)]] = angle
    plant.reset(plant.on_ground(q))
    (raised,) = plant.clouds()
    assert len(standing.points) > 0.95 * math.prod(EXACT.rays)
    assert len(raised.points) < 0.9 * len(standing.points)
    assert np.abs(world(raised, plant)[:, 2]).max() < 0.01


def test_a_camera_dies() -> None:
    plant = plant_of(ROBOT, eyes=[replace(EXACT, end=0.1)])
    assert max(cloud.time for cloud in after(plant, 0.3)) < 0.1


@pytest.mark.parametrize(
    ("eye", "name"),
    [
        (DepthCamera(link="head_camera"), "head_camera"),
        (DepthCamera(turn=(0.0, -0.9, 0.0)), "sees no ground"),
        (
            DepthCamera(at=(-0.4, 0.0, 0.4), turn=(0.0, 0.0, 0.0), view=(0.2, 0.2)),
            "sees no ground",
        ),  # its back
        ("depth", "DepthCamera"),
    ],
)
def test_eyes_that_cannot_see_are_named(eye: object, name: str) -> None:
    with pytest.raises(InputError, match=name):
        plant_of(ROBOT, eyes=[eye])  # type: ignore[list-item]


@pytest.mark.parametrize(
    "values", [{"nearest": 3.0}, {"view": (3.2, 1.0)}, {"rays": (1, 5)}, {"rate": 0.0}, {"dropout": 2.0}]
)
def test_bad_cameras_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(values))):
        DepthCamera(**values)  # type: ignore[arg-type]


class Sent(TrialHook):
    """All commands of a trial, and what was done to its ground."""

    def __init__(self, change=None) -> None:
        self.commands: list[np.ndarray] = []
        self._change = change

    def before(self, trial: WalkTrial) -> None:
        if self._change is not None:
            self._change(trial)

    def tick(self, tick) -> None:
        self.commands.append(tick.command.joint_torque.copy())


def walked(change=None, **values) -> tuple[object, Sent, WalkTrial]:
    spec = WalkSpec(
        **{"noise": "realistic", "terrain": "steps", "amplitude": 0.03, "plan": WalkPlan(distance=0.6)}
        | values
    )
    trial = WalkTrial(spec)
    sent = Sent(change)
    if change is not None:
        trial.scenario.append(sent)
    return trial.run([] if change is not None else [sent]), sent, trial


@pytest.fixture(scope="module")
def blind() -> Sent:
    return walked()[1]


@pytest.mark.slow
def test_a_walk_that_knows_nothing_walks_as_a_blind_one_to_the_bit(blind: Sent) -> None:
    _, sent, trial = walked(eyes="depth", changes={"camera.end": 0.0})
    assert trial.control.ground is not None
    assert all(np.array_equal(a, b) for a, b in zip(blind.commands, sent.commands, strict=True))


def landed(**values) -> tuple[Any, Sent, list[float]]:
    """Result and commands of a walk, and by how much each landing came otherwise than expected, m."""
    landings: list[float] = []

    def listen(trial: WalkTrial) -> None:
        ground = trial.control.source.ground
        if trial.control.time == 0.0:
            land = ground.land
            ground.land = lambda e, *rest: (landings.append(abs(e)), land(e, *rest))[0]

    result, sent, _ = walked(listen, terrain_params={"ramp": 0.0}, **values)
    return result, sent, landings


@pytest.mark.slow
def test_a_stepping_walk_lands_on_what_it_sees_and_is_blind_where_it_sees_nothing() -> None:
    """Steps of 30 mm come as expected, in the mean of some walks; a dead camera changes nothing, to the bit."""
    errors: dict[str, list[float]] = {"blind": [], "depth": [], "dead": []}
    sent: dict[str, list[np.ndarray]] = {}
    for name, values, seeds in (
        ("blind", {}, (0, 11, 12, 13)),
        ("depth", {"eyes": "depth"}, (0, 11, 12, 13)),
        ("dead", {"eyes": "depth", "changes": {"camera.end": 0.0}}, (0,)),
    ):
        for seed in seeds:
            plan = WalkPlan(distance=1.2)
            result, hook, landings = landed(mode="torque", foot="rigid", plan=plan, seed=seed, **values)
            assert result.failures == 0
            errors[name] += landings
            sent.setdefault(name, hook.commands)
    assert all(np.array_equal(a, b) for a, b in zip(sent["blind"], sent["dead"], strict=True))
    assert np.mean(errors["depth"]) < np.mean(errors["blind"])


def _map(height: float):
    def change(trial: WalkTrial) -> None:
        if trial.control.time == 0.0:
            trial.control.see(ElevationMap(np.full((400, 200), height), 0.02, (-2.0, -2.0, 0.0)))

    return change


@pytest.mark.slow
def test_a_map_that_contradicts_the_soles_is_not_used(blind: Sent) -> None:
    result, sent, trial = walked(_map(40.0), eyes="depth", changes={"camera.end": 0.0})
    assert "sole" in trial.control.ground.status
    assert all(np.array_equal(a, b) for a, b in zip(blind.commands, sent.commands, strict=True))
    assert result.failures == 0


@pytest.mark.slow
def test_wrong_clouds_never_fail_a_tick() -> None:
    random = np.random.default_rng(0)

    def change(trial: WalkTrial) -> None:
        if random.random() < 0.05:
            points = random.normal(0.0, 1.0, (300, 3)) * 10.0 ** random.integers(-3, 5)
            points[::7] = np.nan
            trial.control.see(PointCloud(points, trial.plant.time - random.random(), "world", 0.01))

    result, _, _ = walked(change, eyes="depth")
    assert result.failures == 0


@pytest.mark.slow
def test_feet_land_where_the_ground_is() -> None:
    """Over steps of 30 mm a walk that sees expects the height at which it lands, and comes to its goal."""
    (_, _, blind), (result, _, seeing) = (
        landed(eyes=eyes, plan=WalkPlan(distance=1.5)) for eyes in ("none", "depth")
    )
    assert result.outcome == "completed" and result.goal_error < 0.1
    assert np.mean(seeing) < 0.5 * np.mean(blind)
