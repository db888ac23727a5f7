"""The test rig: force balance, impact, support polygon, pitch, pictures."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from properties import by_default
from scipy.spatial.transform import Rotation

from wbc.feet import Foot, foot
from wbc.sim import DivergedError
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.rig.press import press
from wbc.sim.rig.rig import MIN_CONTACT_SHARE, FootTest, Rig
from wbc.sim.terrain.spec import Terrain, terrain

FLAT = terrain("flat")
STONES = terrain("stones", amplitude=0.03, seed=1)
RANDOM = terrain("random", 0.03, 1)
SOFT_ON_STONES = FootTest(foot("soft", stiffness=5.0), STONES)
BRIEF = {"settle": 0.7, "hold": 0.1}
"""Times in which a foot on a level floor comes to rest, s."""


# --- press -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("timestep", [0.001, pytest.param(0.002, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "design",
    by_default(
        [foot("flat"), foot("rigid"), *(foot("soft", stiffness=k) for k in (0.0, 5.0, 80.0))],
        foot("rigid"),
        foot("soft", stiffness=5.0),
    ),
)
@pytest.mark.parametrize("ground", by_default([FLAT, STONES, RANDOM], STONES))
def test_a_pressed_foot_carries_its_load_and_is_quiet(design: Foot, ground: Terrain, timestep: float) -> None:
    test = FootTest(design, ground, physics=PhysicsSettings(timestep=timestep))
    result = press(test, support=False)
    hold = result.hold
    assert not result.diverged and hold is not None
    assert hold.weight == pytest.approx(
        200.0 + design.fit(test.robot_sole).added_inertia.mass * test.physics.gravity
    )
    assert abs(hold.balance_error) < (0.02 if timestep == 0.001 else 0.05)
    assert hold.force_std < 5.0  # the medians over many grounds are far lower: see the slow test
    assert hold.loop_gap < 0.001
    assert hold.penetration < 0.0005


@pytest.mark.parametrize(
    ("name", "x", "y", "yaw", "turned"), [("rigid", 0.31, -0.12, 0.7, False), ("soft", -0.4, 0.2, -2.0, True)]
)
def test_a_foot_starts_over_its_place_by_its_drop_and_is_seen_in_its_own_plan(
    name: str, x: float, y: float, yaw: float, turned: bool
) -> None:
    """The place is that of the sole's centre, from the middle of the rough part; heading and drop are the test's."""
    test = FootTest(foot(name), RANDOM, x=x, y=y, yaw=yaw, drop=0.07)
    if turned:  # the axes of the ankle's link do not matter
        axes = Rotation.random(rng=np.random.default_rng(4))
        place = -axes.apply(test.robot_sole.ankle)
        own = replace(test.robot_sole, translation=tuple(place), rotation=tuple(axes.as_quat()))
        test = replace(test, robot_sole=own)
    rig = Rig(test)
    sole = rig.foot.fit.sole
    centre = np.array([0.5 * (test.ground.start + test.ground.stop) + x, y])
    forward, left = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    site = rig.data.site(rig.foot.wrench_site)
    np.testing.assert_allclose(site.xpos[:2], centre, atol=1e-9)
    np.testing.assert_allclose(site.xmat.reshape(3, 3)[:2, :2].T, [forward, left], atol=1e-9)
    np.testing.assert_allclose(rig.ankle[:2], centre + sole.ankle[0] * forward, atol=1e-9)
    assert rig.ankle[2] - site.xpos[2] == pytest.approx(sole.ankle[2])
    u, v = np.meshgrid(
        np.linspace(-0.5, 0.5, 300) * (sole.length + 0.014),
        np.linspace(-0.5, 0.5, 100) * (sole.width + 0.014),
    )
    under = centre + u.reshape(-1, 1) * forward + v.reshape(-1, 1) * left
    highest = test.ground.height(under[:, 0], under[:, 1]).max()
    assert site.xpos[2] == pytest.approx(highest + 0.07, abs=5e-4)  # between the points of either grid
    points = np.array([[*(centre + 0.1 * forward + 0.02 * left), 0.3], [*centre, 0.1]])
    np.testing.assert_allclose(rig.in_plan(points), [[0.1, 0.02], [0.0, 0.0]], atol=1e-9)
    line = rig.sole_line()
    np.testing.assert_allclose(line[:, 2], site.xpos[2], atol=1e-9)
    half = [sole.length / 2.0, sole.width / 2.0]
    np.testing.assert_allclose(np.abs(line[:, :2]).max(axis=0), half, atol=1e-9)
    assert line[0, 0] == pytest.approx(sole.length / 2.0)
    skeleton = rig.skeleton()
    np.testing.assert_allclose(skeleton[1], [*sole.ankle[:2], rig.ankle[2]], atol=1e-9)
    assert len(skeleton) == (3 if name == "soft" else 2)
    if name == "rigid":
        np.testing.assert_allclose(skeleton[0], [0.0, 0.0, site.xpos[2]], atol=1e-9)
    assert rig.weight == pytest.approx(200.0 + 0.34 * test.physics.gravity)
    assert rig.steps(0.25) == 250 and rig.steps(1e-9) == 1
    assert rig.depth == 0.0 and rig.mean_square_rate == 0.0


@pytest.mark.parametrize("across", [False, True])
def test_a_foot_starts_over_an_edge_that_a_sphere_under_its_rim_would_touch(across: bool) -> None:
    """A step in the middle of the track, half a radius or one and a half beside the sole's rectangle."""
    step = terrain("steps", 0.1, riser=0.1, direction="up")
    sole = foot("rigid").fit(FootTest().robot_sole).sole
    half, radius = 0.5 * (sole.width if across else sole.length), foot("rigid").contact.radius
    for share, height in ((0.5, 0.1), (1.5, 0.0)):
        x = -(half + share * radius)
        rig = Rig(FootTest(foot("rigid"), step, x=x, yaw=0.5 * math.pi if across else 0.0, drop=0.02))
        assert rig.data.site(rig.foot.wrench_site).xpos[2] == pytest.approx(height + 0.02, abs=1e-9)


def test_figures_of_a_rig_are_those_of_mujocos_state() -> None:
    rig = Rig(replace(SOFT_ON_STONES, ankle_stiffness=50.0))
    rig.set_tilt(0.01, -0.02)
    model, data = rig.model, rig.data
    for _ in range(60):
        rig.step()
    weights = data.efc_force
    assert weights.any() and rig.depth == pytest.approx(-min(contact.dist for contact in data.contact))
    joints = [model.joint(name).dofadr[0] for name in rig.foot.sole_joints]
    assert (
        rig.mean_square_rate == pytest.approx(np.mean(data.qvel[joints] ** 2)) and rig.mean_square_rate > 0.0
    )
    assert rig.tilt == (data.joint("roll").qpos[0], data.joint("pitch").qpos[0])
    (points, forces), share = rig.contacts(), 0.05
    np.testing.assert_allclose(rig.vertical_force, forces[:, 2].sum(), rtol=1e-6)
    assert 0 < len(rig.contacts(share)[1]) <= (forces[:, 2] > 0.0).sum()
    centre = rig.in_plan((forces[:, 2] @ points / forces[:, 2].sum())[None])[0]
    np.testing.assert_allclose(rig.centre_of_pressure(), centre, atol=1e-9)
    lift = np.where(forces[:, 2] >= MIN_CONTACT_SHARE * rig.weight, forces[:, 2], 0.0)
    bears = lift.sum() / rig.weight
    expected = rig.in_plan((lift @ points / lift.sum())[None])[0]
    np.testing.assert_allclose(rig.centre_of_pressure(MIN_CONTACT_SHARE, 0.99 * bears), expected, atol=1e-9)
    assert np.isnan(rig.centre_of_pressure(MIN_CONTACT_SHARE, 1.01 * bears)).all()
    twin = rig.fork()
    rig.step()
    assert twin.data.time == pytest.approx(rig.data.time - rig.test.physics.timestep)


def test_forks_on_a_floor_that_gives_and_moves_leave_each_other_and_their_origin_as_they_are() -> None:
    """A fork that tilts changes contacts of its own floor alone, so that the forces of the next fork are the same."""
    belt = (None, None, None, None, "speed", 0.05)
    rig = Rig(FootTest(foot("flat"), terrain("flat", floor_stiffness=2e4, areas=belt)))
    for _ in range(rig.steps(0.2)):
        rig.step()

    def parameters() -> np.ndarray:
        model = rig.model
        return np.column_stack([model.geom_solref, model.geom_solimp, model.geom_surfacevel])

    def forces(tilt: float) -> list[float]:
        twin = rig.fork()
        twin.set_tilt(0.0, tilt)
        found = []
        for _ in range(40):
            twin.step()
            found.append(twin.vertical_force)
        return found

    before, level = parameters(), forces(0.0)
    assert forces(0.1) != level
    np.testing.assert_array_equal(parameters(), before)
    assert forces(0.0) == level
    rig.step()
    assert (parameters() != before).any()


@pytest.mark.parametrize("value", [np.nan, 1e12])
def test_a_rig_that_diverges_says_so_whether_its_state_is_lost_or_mujoco_has_put_it_back(
    value: float,
) -> None:
    test = FootTest(foot("rigid"), FLAT)
    rig = Rig(test)
    rig.step()
    rig.data.qvel[2] = value
    with pytest.raises(DivergedError):
        for _ in range(3):
            rig.step()
    assert np.isfinite(rig.data.qpos).all() == np.isfinite(value)


def test_the_servo_of_the_ankle_is_a_spring_with_critical_damping() -> None:
    test = FootTest(foot("rigid"), FLAT, ankle_stiffness=300.0)
    model = Rig(test).model
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], 300.0)
    inertia = model.body_inertia[model.body("carriage").id, 0]
    np.testing.assert_allclose(
        model.actuator_biasprm[:, :3], [[0.0, -300.0, -2.0 * math.sqrt(300.0 * inertia)]] * 2
    )
    guides = [model.joint(name) for name in ("forward", "left")]
    mass = model.body("carriage").mass[0]
    assert mass == pytest.approx(200.0 / test.physics.gravity)
    for guide in guides:
        assert guide.damping[0] == pytest.approx(2.0 * math.sqrt(guide.stiffness[0] * mass))


# --- impact ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rigid", "soft"])
def test_a_dropped_foot_obeys_free_fall_and_loses_no_energy_to_nowhere(name: str) -> None:
    height = 0.05
    test = FootTest(foot(name), FLAT, drop=height, **BRIEF)
    impact = press(test, support=False).impact
    assert impact is not None
    weight = test.load + 0.34 * test.physics.gravity
    # The rig sees the speed at the step before the touch, 1 ms or 10 mm/s early at most.
    assert impact.speed == pytest.approx(math.sqrt(2.0 * test.physics.gravity * height), abs=0.011)
    assert impact.drop_energy == pytest.approx(weight * height, rel=0.01)
    accounted = impact.sole_energy + impact.arch_energy + impact.spring_energy
    assert 0.0 <= accounted <= impact.drop_energy
    assert impact.absorbed == pytest.approx(1.0 - impact.rebound_energy / impact.drop_energy)
    assert 0.0 < impact.absorbed <= 1.0
    assert (name == "rigid") == (accounted == 0.0)


def test_a_soft_sole_lands_softer_on_stones_than_a_rigid_one() -> None:
    soft, rigid = (
        press(FootTest(foot(name), STONES, drop=0.05, **BRIEF), support=False).impact
        for name in ("soft", "rigid")
    )
    assert soft is not None and rigid is not None
    assert soft.peak_force < 0.5 * rigid.peak_force
    assert soft.sole_energy > 0.1 * soft.drop_energy


def test_energy_and_heat_of_a_foot_are_those_of_mujoco() -> None:
    """The frontal arch bends, too: its spring and damper count beside those of the sole."""
    rig = Rig(SOFT_ON_STONES)
    model, data = rig.model, rig.data
    model.opt.gravity[:] = 0.0
    rng = np.random.default_rng(0)
    joints = [model.joint(name).id for name in (*rig.foot.sole_joints, rig.foot.arch_joint)]
    assert (model.jnt_stiffness[joints] > 0.0).all() and len(joints) == 11
    data.qpos[model.jnt_qposadr[joints]] = rng.normal(0.0, 0.1, 11)
    data.qvel[model.jnt_dofadr[joints]] = rng.normal(0.0, 2.0, 11)
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    assert rig.spring_energy == pytest.approx(data.energy[0], rel=1e-9)
    power = -data.qfrc_damper * data.qvel
    dofs = model.jnt_dofadr[joints]
    assert rig.powers.tolist() == pytest.approx([power[dofs[:-1]].sum(), power[dofs[-1]]], rel=1e-9)
    bare = Rig(FootTest(foot("rigid"), FLAT))
    assert not bare.powers.any() and bare.spring_energy == 0.0


def test_figures_of_a_press_are_those_of_its_steps() -> None:
    """A landing of 30 steps and a hold of 20, done once more step by step: forces, energies, peaks, jitter."""
    test = replace(SOFT_ON_STONES, drop=0.002, settle=0.03, hold=0.02)
    result, rig = press(test, support=False), Rig(test)
    impact, hold = result.impact, result.hold
    assert impact is not None and hold is not None
    start, steps = rig.ankle[2], []
    for step in range(50):
        rig.step()
        figures = (
            rig.ankle_speed,
            rig.vertical_force,
            rig.loop_gap,
            rig.depth,
            rig.mean_square_rate,
            *rig.powers,
        )
        steps.append(figures)
        if step == 29:
            energy, spring = rig.weight * (start - rig.ankle[2]), rig.spring_energy
    speeds, force, gaps, depths, rates = np.array(steps).T[:5]
    heat, speeds = 0.001 * np.array(steps)[:30, 5:].sum(axis=0), np.append(0.0, speeds)
    first = int(np.argmax(force > 0.0))
    assert 0 < first < 25 and impact.speed == -speeds[first]
    assert impact.peak_force == max(force[:30]) and impact.drop_energy == pytest.approx(energy)
    assert (impact.sole_energy, impact.arch_energy) == pytest.approx(tuple(heat))
    assert impact.spring_energy == pytest.approx(spring)
    upward = max(0.0, *speeds[first + 1 : 31])
    assert impact.rebound_energy == pytest.approx(0.5 * rig.mass * upward**2)
    assert impact.absorbed == pytest.approx(1.0 - impact.rebound_energy / energy)
    assert hold.force_mean == pytest.approx(np.mean(force[30:]))
    assert hold.force_std == pytest.approx(np.std(force[30:]))
    assert hold.balance_error == pytest.approx(hold.force_mean / rig.weight - 1.0)
    assert hold.jitter == pytest.approx(math.sqrt(np.mean(rates[30:]))) and hold.jitter > 0.0
    assert (hold.loop_gap, hold.penetration) == pytest.approx((max(gaps[30:]), max(depths[30:])))
    assert hold.ankle_height == rig.ankle[2] and hold.ankle_place == tuple(rig.ankle[:2])
    assert hold.ankle_tilt == rig.tilt and hold.contacts == len(hold.contact_forces) > 0
    assert len(hold.sole_angles) == len(rig.foot.sole_joints)


# --- support ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", by_default(["flat", "rigid"], "rigid"))
def test_a_rigid_sole_on_flat_ground_is_supported_by_its_rectangle(name: str) -> None:
    test = FootTest(foot(name), FLAT, **BRIEF)
    sole = test.foot.fit(test.robot_sole).sole
    result = press(test)
    assert result.support is not None and result.hold is not None
    assert result.hold.contact_area == pytest.approx(sole.length * sole.width, rel=1e-3)
    assert result.support.area == pytest.approx(sole.length * sole.width, rel=0.02)
    assert result.support.forward == pytest.approx(sole.length / 2.0, abs=0.001)
    assert result.support.right == pytest.approx(-sole.width / 2.0, abs=0.001)


def test_a_soft_sole_on_flat_ground_is_a_truss_between_heel_hinge_and_loop() -> None:
    test = FootTest(foot("soft", stiffness=0.5), FLAT, **BRIEF)
    design = foot("soft")
    layout = design.layout(design.fit(test.robot_sole).sole)  # type: ignore[attr-defined]
    support = press(test).support
    assert support is not None
    half = layout.pitch / 2.0
    assert support.backward == pytest.approx(layout.hinges[-1][0], abs=half)
    assert support.forward == pytest.approx(layout.loop_point[0], abs=half)


@pytest.mark.parametrize("seed", by_default([5, 6, 7], 5))
def test_a_support_lies_within_the_sole_also_on_the_flanks_of_stones(seed: int) -> None:
    """Contacts on flanks push sideways and down, and a foot that tips off a stone has no load for a moment."""
    test = FootTest(foot("rigid"), terrain("pyramidal_stones", 0.06, seed, density=12.0), load=390.0)
    sole = test.foot.fit(test.robot_sole).sole
    support = press(test).support
    assert support is not None
    reach = 0.5 * np.hypot(sole.length, sole.width) + 0.02  # a tipped sole turns, and touches with its edge
    for x, y in support.polygon:
        assert np.hypot(x, y) < reach
    assert support.area < 1.05 * sole.length * sole.width


# --- pitch -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ground", ["plane", "field", "boxes"])
def test_the_ground_presses_upwards_whatever_it_is_made_of(ground: str) -> None:
    """MuJoCo orders the geoms of a contact by their kinds: a plane or a field comes before a sphere, a box after."""
    made = {"plane": terrain("flat"), "field": terrain("random", 0.001), "boxes": terrain("boards", 0.01)}[
        ground
    ]
    rig = Rig(FootTest(foot=foot("rigid"), ground=made, drop=0.0))
    for _ in range(rig.steps(0.3)):
        rig.step()
    points, forces = rig.contacts()
    own = {rig.model.geom(name).id for name in rig.foot.contact_geoms}
    assert (ground == "boxes") in {int(contact.geom[0]) in own for contact in rig.data.contact}
    assert len(points) == len(forces) > 0 and (forces[:, 2] > 0.0).all()
    assert forces[:, 2].sum() == pytest.approx(rig.weight, rel=0.01)
    heavy = np.linalg.norm(forces, axis=1) / rig.weight
    assert len(rig.contacts(float(np.median(heavy)))[1]) == (heavy > np.median(heavy)).sum() > 0
    assert rig.contacts(50.0)[0].shape == (0, 3)
