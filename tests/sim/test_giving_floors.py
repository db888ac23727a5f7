"""Floors that give: depth, stiffness, damping and friction are those of a bed of springs; areas; walkways."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from properties import by_default

import wbc
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import GRAVITY, SIDES
from wbc.feet import foot
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.rig.rig import GUIDE_STIFFNESS, FootTest, Rig
from wbc.sim.terrain.areas import at_places
from wbc.sim.terrain.giving import point_areas
from wbc.sim.terrain.spec import Terrain, terrain
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.contact import GaitPhase

STIFFNESS = 1e7
"""Stiffness of the floor, N/m³: that of loose sand."""

SAND = terrain("flat", floor_stiffness=STIFFNESS)


def settled(
    name: str = "flat", ground: Terrain = SAND, seconds: float = 0.4, load: float = 200.0, **values: Any
) -> Rig:
    """A foot that has come to rest on the floor."""
    rig = Rig(FootTest(foot=foot(name), ground=ground, load=load, drop=0.0, **values))
    for _ in range(rig.steps(seconds)):
        rig.step()
    return rig


def area_of(sole: Any) -> float:
    return float(sole.length * sole.width)


def height_of(rig: Rig) -> float:
    """Height of the sole's centre, m."""
    return float(rig.data.site(rig.foot.wrench_site).xpos[2])


def depths(rig: Rig) -> tuple[Array, Array]:
    """Area that each point of a sole stands for, m², and its depth in the floor, m."""
    geoms = [rig.model.geom(name).id for name in rig.foot.contact_geoms]
    start = mujoco.MjData(rig.model)
    mujoco.mj_kinematics(rig.model, start)
    sole = start.site(rig.foot.wrench_site)
    points = (start.geom_xpos[geoms] - sole.xpos) @ sole.xmat.reshape(3, 3)
    areas = point_areas(points[:, :2], area_of(rig.foot.fit.sole))
    return areas, np.maximum(rig.model.geom_size[geoms, 0] - rig.data.geom_xpos[geoms, 2], 0.0)


@pytest.mark.parametrize("name", by_default(("flat", "rigid", "soft", "long_arch"), "long_arch"))
@pytest.mark.parametrize("load", by_default((50.0, 500.0), 500.0))
def test_springs_under_the_points_carry_the_weight(name: str, load: float) -> None:
    rig = settled(name, load=load, seconds=1.0)
    areas, depth = depths(rig)
    assert STIFFNESS * float(areas @ depth) == pytest.approx(rig.mass * GRAVITY, rel=0.005)


@pytest.mark.parametrize("load", [10.0, 600.0])
def test_a_level_sole_sinks_by_weight_over_stiffness_and_area(load: float) -> None:
    rig = settled(load=load, seconds=0.7)
    depth = rig.mass * GRAVITY / (STIFFNESS * area_of(rig.foot.fit.sole))
    assert -height_of(rig) == pytest.approx(depth, rel=0.004)


def test_a_sole_tilts_by_the_second_moment_of_its_area() -> None:
    """M = (k I + servo + g h² − m g h) φ with I = L W³/12 about the long axis, L³ W/12 about the short one.

    The ankle at the height h carries the weight, and the springs g of the guide hold it sideways.
    """
    level, moment = settled(load=600.0), 0.5
    size, servo = level.foot.fit.sole, level.test.ankle_stiffness
    for axis, own, other in (("roll", size.width, size.length), ("pitch", size.length, size.width)):
        rig = level.fork()
        joint = rig.model.joint(axis)
        before = float(rig.data.qpos[joint.qposadr[0]])
        rig.data.qfrc_applied[joint.dofadr[0]] = moment
        for _ in range(rig.steps(0.5)):
            rig.step()
        angle = float(rig.data.qpos[joint.qposadr[0]]) - before
        height = float(rig.data.body("carriage").xpos[2])
        ankle = GUIDE_STIFFNESS * height**2 - rig.mass * GRAVITY * height
        assert moment / angle - servo - ankle == pytest.approx(STIFFNESS * other * own**3 / 12.0, rel=0.05)


def test_each_point_of_a_sole_rests_on_the_stretch_that_it_is_on() -> None:
    """The springs on both sides of a border under a sole carry its weight together."""
    middle, soft = 1.8, STIFFNESS
    areas = (0.0, middle, None, None, "stiffness", soft)
    rig = settled(ground=terrain("flat", floor_stiffness=2.0 * soft, areas=areas))
    geoms = [rig.model.geom(name).id for name in rig.foot.contact_geoms]
    areas, depth = depths(rig)
    x = rig.data.geom_xpos[geoms, 0]
    stiffness = np.where(x < middle, soft, 2.0 * soft)
    assert set(stiffness.tolist()) == {soft, 2.0 * soft}
    assert float((stiffness * areas) @ depth) == pytest.approx(rig.mass * GRAVITY, rel=0.005)


@pytest.mark.parametrize("place", [-0.5, 0.5])
def test_a_rigid_floor_gives_on_its_stretches_alone(place: float) -> None:
    rig = settled(ground=terrain("flat", areas=(1.8, 5.0, None, None, "stiffness", STIFFNESS)), x=place)
    static = rig.mass * GRAVITY / (STIFFNESS * area_of(rig.foot.fit.sole))
    assert -height_of(rig) == pytest.approx(static if place > 0.0 else 0.0, rel=0.004, abs=1e-5)


SPRUNG = 2e6
"""Stiffness of a floor from which a foot bounces, N/m³."""


def bouncing(ratio: float, drop: float = 0.02) -> tuple[Rig, float]:
    """A foot of 10 kg over a floor of a ratio of the critical damping, and the damping of this floor, Ns/m³."""

    def rig(damping: float) -> Rig:
        ground = terrain("flat", floor_stiffness=SPRUNG, floor_damping=damping)
        return Rig(FootTest(foot=foot("flat"), ground=ground, load=10.0 * GRAVITY, drop=drop))

    bare = rig(0.0)
    area, mass = area_of(bare.foot.fit.sole), bare.mass
    damping = 2.0 * ratio * math.sqrt(SPRUNG * area * mass) / area
    return rig(damping), damping


def extremes(rig: Rig, seconds: float) -> tuple[float, float]:
    """Step a rig for a time, s; return the greatest depth of its foot (m) and its greatest speed upwards (m/s)."""
    deepest = fastest = 0.0
    for _ in range(rig.steps(seconds)):
        rig.step()
        deepest, fastest = max(deepest, -height_of(rig)), max(fastest, rig.ankle_speed)
    return deepest, fastest


def bounce(rig: Rig, damping: float) -> tuple[float, float]:
    """Greatest depth, m, and speed of the rebound, m/s, of m z̈ = −m g + max(0, −K z − C ż) below the floor."""
    area, step, height, speed = area_of(rig.foot.fit.sole), 1e-5, rig.test.drop, 0.0
    deepest = fastest = 0.0
    for _ in range(40_000):
        push = -area * (SPRUNG * height + damping * speed) if height < 0.0 else 0.0
        speed += step * (max(push, 0.0) / rig.mass - GRAVITY)
        height += step * speed
        deepest, fastest = max(deepest, -height), max(fastest, speed)
    return deepest, fastest


@pytest.mark.parametrize("ratio", [0.05, 0.6])
def test_a_foot_bounces_from_the_floor_as_from_a_spring_and_a_damper(ratio: float) -> None:
    """The depth, to 1 % and the part of the speed that the damper takes in half of a physics step: the integrator's.

    The restitution, which is the speed of the rebound over that of the fall, to 0.01.
    """
    rig, damping = bouncing(ratio)
    depth, speed = bounce(rig, damping)
    deepest, fastest = extremes(rig, 0.4)
    most = 0.01 + 0.5 * rig.test.physics.timestep * damping * area_of(rig.foot.fit.sole) / rig.mass
    assert deepest == pytest.approx(depth, rel=most)
    fall = math.sqrt(2.0 * GRAVITY * rig.test.drop)
    assert fastest / fall == pytest.approx(speed / fall, abs=0.01)


def test_the_cycles_of_a_foot_are_as_long_and_lose_as_much_as_those_of_an_oscillator() -> None:
    """The period is 2 π/(ω √(1 − ζ²)), the logarithm of the ratio of two depths that follow 2 π ζ/√(1 − ζ²)."""
    ratio = 0.1
    rig, _ = bouncing(ratio, drop=0.0)
    stiffness, step = SPRUNG * area_of(rig.foot.fit.sole), rig.test.physics.timestep
    heights = []
    for _ in range(rig.steps(0.6)):
        rig.step()
        heights.append(height_of(rig) + rig.mass * GRAVITY / stiffness)
    inner = np.array(heights[1:-1])
    lowest = np.flatnonzero((inner < heights[:-2]) & (inner <= heights[2:]))[1:4]
    damped = math.sqrt(1.0 - ratio**2)
    period = 2.0 * math.pi / damped * math.sqrt(rig.mass / stiffness)
    assert np.diff(lowest).mean() * step == pytest.approx(period, abs=0.01 * period + 0.5 * step), (
        "and half a sample"
    )
    decrements = np.log(inner[lowest[:-1]] / inner[lowest[1:]])
    np.testing.assert_allclose(decrements, 2.0 * math.pi * ratio / damped, rtol=0.02)


def test_a_loaded_sole_does_not_creep_under_half_of_its_friction() -> None:
    rig = settled(load=400.0)
    joint = rig.model.joint("forward")
    rig.model.jnt_stiffness[joint.id] = 0.0
    rig.data.qfrc_applied[joint.dofadr[0]] = 0.5 * rig.test.foot.contact.friction * rig.mass * GRAVITY
    for _ in range(rig.steps(0.5)):
        rig.step()
    assert abs(rig.data.qvel[joint.dofadr[0]]) < 5e-4  # m/s


@pytest.mark.parametrize("mode", by_default(["position", "torque"], "torque"))
def test_a_standing_robot_sinks_by_its_weight_whatever_its_drives_do(mode: str) -> None:
    """Servos change the metric in which the contacts are solved, and not the floor."""
    description = wbc.load_robot("g1")
    plant = wbc.Plant(
        description, terrain=terrain("flat", floor_stiffness=STIFFNESS), control_period=0.005, visuals=False
    )
    kind = wbc.PositionControl if mode == "position" else wbc.TorqueControl
    control = kind(wbc.balance_controller(description.robot(), plant.control_period))
    while plant.time < 0.6:
        plant.step(control.command(plant.measure()))
    heights = [plant.sole_pose(side)[0][2] for side in (0, 1)]
    area = sum(area_of(built.fit.sole) for built in plant.feet)
    weight = float(plant.model.body_mass.sum()) * GRAVITY
    assert -np.mean(heights) == pytest.approx(weight / (STIFFNESS * area), rel=0.01)


def test_a_robot_sinks_into_stairs_as_into_a_floor_of_their_stiffness() -> None:
    """On a step of 0.09 m a contact is one of a sole and a solid of the ground: the depth is weight over k A."""
    stairs = terrain("steps", 0.09, direction="down", start=0.5, strip=2.0, floor_stiffness=STIFFNESS)
    plant = wbc.Plant("hrp4_class", terrain=stairs, visuals=False)
    while plant.time < 0.5:
        plant.step(plant.hold())
    depth = -np.mean([plant.sole_pose(side)[0][2] for side in (0, 1)])
    area = sum(area_of(built.fit.sole) for built in plant.feet)
    weight = float(plant.model.body_subtreemass[plant.places.root]) * GRAVITY
    assert depth == pytest.approx(weight / (STIFFNESS * area), rel=0.01)


@pytest.mark.parametrize("name", by_default(("flat", "rigid"), "rigid"))
@pytest.mark.parametrize("stiffness", by_default((1e6, 1e7), 1e6))
def test_a_robot_starts_as_deep_as_it_rests(name: str, stiffness: float) -> None:
    """Its weight over stiffness and area of both soles; it then sinks as little as on a rigid floor, by its servos."""
    moved = {}
    for floor in (None, stiffness):
        plant = wbc.Plant("g1", foot=name, terrain=terrain("flat", floor_stiffness=floor), visuals=False)
        start, height = float(plant.sole_pose(0)[0][2]), plant.base_pose[2]
        while plant.time < 0.3:
            plant.step(plant.hold())
        moved[floor] = plant.base_pose[2] - height
    area = sum(area_of(built.fit.sole) for built in plant.feet)
    depth = float(plant.model.body_mass.sum()) * GRAVITY / (stiffness * area)
    assert -start == pytest.approx(depth, rel=1e-3)
    assert moved[stiffness] == pytest.approx(moved[None], abs=0.03 * depth + 1e-4)


@pytest.mark.parametrize("name", by_default(["rigid", "soft"], "soft"))
def test_a_robot_on_stones_under_a_soft_layer_starts_with_its_weight_on_them(name: str) -> None:
    """Its points touch at different heights: the sum of their springs is the weight."""
    ground = terrain("stones", amplitude=0.02, seed=3, ramp=0.0, start=-1.0, floor_stiffness=3e6)
    plant = wbc.Plant("g1", foot=name, terrain=ground, visuals=False)
    force = 0.0
    for built in plant.feet:
        geoms = np.array([plant.model.geom(point).id for point in built.contact_geoms])
        places, sole = plant.data.geom_xpos[geoms], plant.data.site(built.wrench_site)
        areas = point_areas(((places - sole.xpos) @ sole.xmat.reshape(3, 3))[:, :2], area_of(built.fit.sole))
        depth = ground.height(places[:, 0], places[:, 1]) + plant.model.geom_size[geoms, 0] - places[:, 2]
        force += 3e6 * float(areas @ np.maximum(depth, 0.0))
    assert force == pytest.approx(float(plant.model.body_mass.sum()) * GRAVITY, rel=1e-6)


def test_a_robot_with_one_point_on_rigid_ground_starts_on_it() -> None:
    beside = (None, None, 0.0, None, "stiffness", 1e6)  # under the left foot alone
    plant = wbc.Plant("g1", terrain=terrain("flat", areas=beside), visuals=False)
    assert plant.sole_pose(0)[0][2] == pytest.approx(0.0, abs=2e-6)


@pytest.mark.parametrize(
    "area", [("speed", 0.1), ("friction", 0.1), ("stiffness", 3e6)], ids=lambda area: area[0]
)
def test_a_plant_begins_anew_as_at_first_on_any_area(area: tuple[str, float]) -> None:
    areas, runs = (0.05, None, None, None, *area), []
    plant = wbc.Plant("g1", terrain=terrain("flat", areas=areas), visuals=False)
    for run in range(2):
        while plant.time < 0.05:
            plant.step(plant.hold())
        runs.append(plant.data.qpos.copy())
        if run == 0:
            plant.push("torso", [400.0, 0.0, 0.0], 0.1)  # which lifts the heels
            while plant.time < 0.25:
                plant.step(plant.hold())
        plant.reset()
    np.testing.assert_array_equal(runs[1], runs[0])


def test_areas_of_points_are_those_of_rules_of_integration() -> None:
    x, y = np.meshgrid([0.0, 0.1, 0.2], [-0.03, 0.03], indexing="ij")
    grid = np.column_stack([x.ravel(), y.ravel()])
    np.testing.assert_allclose(point_areas(grid, 1.2), 1.2 / 6.0 * np.repeat([1.0, 4.0, 1.0], 2) / 2.0)
    four = np.column_stack([[0.0, 0.1, 0.2, 0.4], np.zeros(4)])
    np.testing.assert_allclose(point_areas(four, 0.8), [0.1, 0.2, 0.3, 0.2])  # trapezoidal rule
    odd = np.array([(0.0, 0.0), (0.1, 0.0), (0.0, 0.05)])
    np.testing.assert_allclose(point_areas(odd, 0.3), 0.1)


def test_a_floor_that_is_too_stiff_for_the_step_names_the_step_that_could() -> None:
    with pytest.raises(InputError, match="s at most") as refused:
        Rig(FootTest(foot=foot("flat"), ground=terrain("flat", floor_stiffness=1e13)))
    step = float(str(refused.value).partition("step of ")[2].split()[0])
    assert 0.0 < step < 0.001
    rig = settled(seconds=0.01)
    assert rig.model.opt.impratio == 1000.0
    assert Rig(FootTest(foot=foot("flat"))).model.opt.impratio == 10.0


def sliding(ground: Terrain, **place: float) -> tuple[Rig, int]:
    """A foot of 200 N at rest on a ground, that nothing but friction holds along it, and the index of its way ahead."""
    rig = settled(ground=ground, seconds=0.0, **place)
    for name in ("forward", "left"):
        joint = rig.model.joint(name)
        rig.model.jnt_stiffness[joint.id] = rig.model.dof_damping[joint.dofadr[0]] = 0.0
    for _ in range(rig.steps(0.3)):
        rig.step()
    return rig, int(rig.model.joint("forward").dofadr[0])


@pytest.mark.parametrize("stiffness", [None, 1e8])
def test_a_block_slides_on_a_stretch_by_its_friction(stiffness: float | None) -> None:
    """On μ = 0.1 a pushed sole accelerates by (F − μ m g)/m; before the stretch it stands."""
    middle = 1.8  # of the ground, where the rig stands
    ice = (middle - 0.5, middle + 0.5, None, None, "friction", 0.1)
    for place, gain in ((0.0, 0.2 * GRAVITY), (1.0, 0.0)):
        rig, dof = sliding(terrain("flat", floor_stiffness=stiffness, areas=ice), x=place)
        rig.data.qfrc_applied[dof] = 0.3 * rig.mass * GRAVITY
        before = float(rig.data.qvel[dof])
        for _ in range(rig.steps(0.2)):
            rig.step()
        assert (rig.data.qvel[dof] - before) / 0.2 == pytest.approx(gain, rel=0.03, abs=0.03)


def way_of(rig: Rig, dof: int, speed: float, seconds: float) -> float:
    """Way along x, m, of a foot that is given a speed, m/s, until it rests."""
    rig.data.qvel[dof], start = speed, float(rig.ankle[0])
    for _ in range(rig.steps(seconds)):
        rig.step()
    assert abs(rig.data.qvel[dof]) < 1e-3
    return float(rig.ankle[0]) - start


def test_a_block_that_slides_into_an_area_loses_its_energy_to_both_frictions() -> None:
    """v²/(2 g) = μ₁ a + μ₂ (way − a), with the way a of the centre of pressure to the border, on sand."""
    border, speed, before, behind = 2.0, 1.0, 0.1, 0.25
    wet = (None, border, None, None, "friction", before, border, None, None, None, "friction", behind)
    rig, dof = sliding(terrain("flat", floor_stiffness=3e6, areas=wet))
    size, to_border = rig.foot.fit.sole, border - rig.ankle[0] - float(rig.centre_of_pressure()[0])
    assert 0.5 * size.length < to_border, "the whole sole is before the border"
    way = way_of(rig, dof, speed, 1.0)
    assert way > to_border + 0.5 * size.length, "and has left it behind"
    rest = (speed**2 / (2.0 * GRAVITY) - before * to_border) / behind
    assert way == pytest.approx(to_border + rest, rel=0.03)


def test_a_block_half_on_an_area_is_slowed_by_the_frictions_under_its_points() -> None:
    """The border runs along the way, between the rows of points: each row has its share of the weight."""
    speed, wet = 0.6, (None, None, 0.02, None, "friction", 0.1, None, None, None, 0.02, "friction", 0.3)
    rig, dof = sliding(terrain("flat", floor_stiffness=3e6, areas=wet))
    points, forces = rig.contacts()
    left = points[:, 1] > 0.02
    assert 0 < left.sum() < len(left)
    share = float(forces[left, 2].sum() / forces[:, 2].sum())
    friction = 0.1 * share + 0.3 * (1.0 - share)
    assert way_of(rig, dof, speed, 0.6) == pytest.approx(speed**2 / (2.0 * friction * GRAVITY), rel=0.03)


@pytest.mark.parametrize("stiffness", by_default([None, 1e8], 1e8))
def test_a_block_on_a_walkway_slides_until_it_has_its_speed(stiffness: float | None) -> None:
    """It is as fast after v/(μ g), has slid by v²/(2 μ g) over the walkway, and stays as fast."""
    friction, speed = 0.2, 0.5
    areas = ("friction", friction, 1.5, 2.5, -0.3, 0.3, "speed", speed)
    ground = terrain("flat", floor_stiffness=stiffness, areas=(None, None, None, None, *areas))
    rig, dof = sliding(ground, x=-1.0)  # before the walkway
    assert abs(rig.data.qvel[dof]) < 1e-6
    rig.data.qpos[dof] += 1.0
    time, start, speeds = speed / (friction * GRAVITY), float(rig.data.qpos[dof]), []
    for _ in range(rig.steps(2.0 * time)):
        rig.step()
        speeds.append(float(rig.data.qvel[dof]))
    way = float(rig.data.qpos[dof]) - start
    assert speeds[len(speeds) // 4] == pytest.approx(0.5 * speed, rel=0.05)
    assert speeds[-1] == pytest.approx(speed, rel=0.001)
    assert 2.0 * time * speed - way == pytest.approx(speed**2 / (2.0 * friction * GRAVITY), rel=0.03)


def test_a_walkway_carries_a_turned_sole_the_same_way_and_ends_at_its_border() -> None:
    turn, ground = 1.0, terrain("flat", areas=(None, 1.9, None, None, "speed", 0.3))
    rig, dof = sliding(ground, yaw=turn, x=-0.4)
    ahead, aside = rig.data.qvel[dof : dof + 2]
    assert ahead == pytest.approx(0.3 * math.cos(turn), abs=3e-4)
    assert aside == pytest.approx(-0.3 * math.sin(turn), abs=3e-4)
    for _ in range(rig.steps(2.2)):
        rig.step()
    assert np.abs(rig.data.qvel[dof : dof + 2]).max() < 1e-3 and 1.7 < rig.ankle[0] < 2.1


AREA = (1.0, 2.0, -0.2, 0.2)


def test_areas_beyond_the_end_of_a_ground_are_refused_and_a_level_floor_has_no_end() -> None:
    wet = (3.8, 5.0, None, None, "friction", 0.3)
    with pytest.raises(InputError, match="from x -0.7 to 4.3 m"):
        terrain("stones", areas=wet)
    terrain("stones", areas=wet, length=4.0)
    terrain("stones", areas=(3.8, *wet[2:3], *wet[2:]))
    terrain("flat", areas=wet)


def test_areas_of_several_properties_and_of_one_value_may_overlap_and_damping_is_theirs() -> None:
    """The damping of an area is a hundredth of a second times its stiffness, or that of an area of damping."""
    inner = (1.2, 1.8, -0.1, 0.1)
    soft = (*AREA, "stiffness", 1e7, *inner, "damping", 3e4)
    ground = terrain("flat", areas=(*soft, *AREA, "friction", 0.4, *inner, "friction", 0.4))
    assert ground.gives and [str(area) for area in ground.surface_areas][1] == "damping 30000 Ns/m³"
    places = np.array([(1.1, 0.0), (1.5, 0.0), (2.5, 0.0), (1.5, 0.15)])
    areas = ground.surface_areas
    np.testing.assert_allclose(at_places(areas, "stiffness", places, 0.0), [1e7, 1e7, 0.0, 1e7])
    own = [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(at_places(areas, "damping", places, own), [1.0, 3e4, 3.0, 4.0])
    np.testing.assert_allclose(at_places(areas, "friction", places, 0.8), [0.4, 0.4, 0.8, 0.4])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_narrow_sole_stays_level_while_the_weight_shifts_over_it(seed: int) -> None:
    """On 1e6 N/m³ g1 lifts the foot that it is to lift, and the other sole is within the range of its ankle."""
    spec = WalkSpec(
        robot="g1",
        foot="flat",
        mode="torque",
        noise="realistic",
        seed=seed,
        terrain_params={"floor_stiffness": 1e6},  # type: ignore[arg-type]
        plan=WalkPlan(distance=1.0),
    )
    trial, tilt, stance = WalkTrial(spec, visuals=False), 0.0, 0
    with trial.running():
        while trial.step() and trial.control.progress.phase is not GaitPhase.SINGLE:
            stance = trial.control.progress.stance
            tilt = math.asin(float(trial.plant.sole_pose(stance)[1][2, 1]))
    assert trial.fall is None and trial.control.progress.stance == stance
    robot = trial.plant.robot
    ankle = robot.joint_names.index(f"{SIDES[stance]}_ankle_roll_joint")
    assert abs(tilt) < robot.position_upper[ankle]
