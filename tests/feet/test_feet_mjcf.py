"""Feet in MuJoCo: constraint parameters, inertia, sensors, contacts, stiffness and range at run time."""

from __future__ import annotations

from typing import Literal

import mujoco
import numpy as np
import pytest
from properties import by_default
from scipy.spatial.transform import Rotation

from wbc.base.errors import InputError
from wbc.feet import Foot, FootParts, StiffnessActuator, foot
from wbc.feet.soles.build_mjcf import RANGE_OFFSET
from wbc.feet.soles.contact import LOOP_CLOSURE, SOLE_GROUND, ConstraintLaw
from wbc.feet.soles.foot import AnkleSole
from wbc.feet.soles.runtime_mjcf import RangeFinder, SoleStiffness
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.terrain.render import TERRAIN_GROUP, add_to_spec
from wbc.sim.terrain.spec import Terrain, terrain

OWN = AnkleSole.under_ankle(0.093, 0.160, 0.076)
LOAD = 200.0  # N
GRAVITY = PhysicsSettings().gravity

DESIGNS: dict[str, Foot] = {
    "flat": foot("flat"),
    "rigid": foot("rigid"),
    "soft": foot("soft"),
    "variable": foot("variable", stiffness=40.0),
    "iit_softfoot": foot("iit_softfoot"),
    "six phalanges": foot("soft", phalanges=6, loop_phalanx=2),
}


class Stand:
    """One foot under a weight that is free to move up and down and, if asked, to tilt."""

    def __init__(
        self,
        design: Foot,
        ground: Terrain | Literal["flat field", "nothing"],
        *,
        tilting: bool = True,
        x: float = 0.0,
        own: AnkleSole = OWN,
        drop: float = 0.001,
    ) -> None:
        spec = mujoco.MjSpec()
        PhysicsSettings().apply(spec)
        if isinstance(ground, Terrain):
            add_to_spec(spec, ground)
        elif ground == "flat field":
            spec.add_hfield(
                name="field", nrow=101, ncol=101, size=[0.35, 0.35, 0.05, 0.05], userdata=np.zeros(101 * 101)
            )
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="field", contype=1, conaffinity=1
            )
        fit = design.fit(own)
        turned = own.rotation_matrix.T  # the ankle link stands so that the sole is level
        height = float(fit.sole.ankle[2]) + drop
        carriage = spec.worldbody.add_body(
            name="carriage", pos=[x, 0.0, height], mass=LOAD / GRAVITY, ipos=[0, 0, 0], inertia=[0.1] * 3
        )
        carriage.explicitinertial = True
        for name, axis in (("forward", [1, 0, 0]), ("left", [0, 1, 0])):
            # Free, because a rigid guide would press the foot sideways against its own friction.
            carriage.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis).damping[0] = 100.0
        carriage.add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        if tilting:
            for name, axis in (("roll", [1, 0, 0]), ("pitch", [0, 1, 0])):
                carriage.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis).damping[0] = 10.0
        quat = Rotation.from_matrix(turned).as_quat()[[3, 0, 1, 2]]
        ankle = carriage.add_body(name=own.ankle_link, quat=quat)
        self.foot: FootParts = design.build(spec, ankle, "left", own)
        self.model: mujoco.MjModel = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def contacts(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of the contacts that bear load, m, and forces of the ground on the foot, N, shape (n, 3)."""
        own, wrench = {self.model.geom(name).id for name in self.foot.contact_geoms}, np.zeros(6)
        points, forces = [], []
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            if wrench[0] > 0.0:
                sign = (
                    1.0 if contact.geom[1] in own else -1.0
                )  # the frame's first row is the normal to the second
                points.append(contact.pos.copy())
                forces.append(sign * (contact.frame.reshape(3, 3).T @ wrench[:3]))
        return np.array(points).reshape(-1, 3), np.array(forces).reshape(-1, 3)

    def loop_gap(self) -> float:
        assert self.foot.loop_sites is not None
        arch, sole = (self.data.site(name).xpos for name in self.foot.loop_sites)
        return float(np.linalg.norm(arch - sole))

    def settle(self, seconds: float = 1.0) -> None:
        mujoco.mj_step(self.model, self.data, nstep=round(seconds / self.model.opt.timestep))


# --- constraints -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "law", [LOOP_CLOSURE, SOLE_GROUND, ConstraintLaw(0.0001), ConstraintLaw(0.0015, 0.7, (0.5, 0.9), 0.002)]
)
def test_mujoco_uses_the_papers_equations(law: ConstraintLaw) -> None:
    """Beyond the width d is d_max; of the contact, t is raised to what the step of 1 ms can follow."""
    timestep, violation = 0.001, 0.003
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    constraint = {"solref": law.solref, "solimp": law.solimp}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    ball = spec.worldbody.add_body(pos=[0, 0, 0.1 - violation])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], priority=1, **constraint)
    sites = []
    for x in (0.0, violation):
        body = spec.worldbody.add_body(pos=[1.0 + x, 0, 1])
        body.add_freejoint()
        body.add_geom(size=[0.1, 0, 0], contype=0, conaffinity=0)
        sites.append(body.add_site(name=f"site{len(sites)}").name)
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=sites[0],
        name2=sites[1],
        **constraint,
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    first = {
        "equality": int(np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)[0]),
        "normal": int(np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)[0]),
    }
    # Contact rows share the violation of the normal; friction rows have damping alone.
    rows = {"equality": first["equality"], "normal": first["normal"], "friction": first["normal"] + 1}
    for kind, row in rows.items():
        d, t, zeta = law.impedance[1], law.time_constant, law.damping_ratio
        if kind == "normal":
            t = max(t, timestep / (np.sqrt(d) * zeta))
        b, k = 2.0 / (d * t), 1.0 / (d * t * zeta) ** 2
        stiffness, damping, impedance, _ = data.efc_KBIP[row]
        assert impedance == pytest.approx(d, rel=1e-6), kind
        assert damping == pytest.approx(b, rel=1e-6), kind
        assert stiffness == pytest.approx(0.0 if kind == "friction" else k, rel=1e-6), kind


# --- bodies ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DESIGNS)
def test_mujoco_and_the_fit_agree_on_the_inertia_of_the_foot(name: str) -> None:
    rotation = Rotation.random(rng=np.random.default_rng(1))
    own = AnkleSole("link", tuple(-rotation.apply([0.01, 0.004, 0.09])), tuple(rotation.as_quat()), 0.2, 0.1)
    stand = Stand(DESIGNS[name], "nothing", own=own)
    model, data = stand.model, stand.data
    link = data.body("link")
    to_link = link.xmat.reshape(3, 3).T
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for i in range(model.body("link").id, model.nbody):
        place = to_link @ (data.xipos[i] - link.xpos)
        axes = to_link @ data.ximat[i].reshape(3, 3)
        mass += model.body_mass[i]
        moment += model.body_mass[i] * place
        inertia += axes @ np.diag(model.body_inertia[i]) @ axes.T
        inertia += model.body_mass[i] * (place @ place * np.eye(3) - np.outer(place, place))
    added = stand.foot.fit.added_inertia
    assert mass == pytest.approx(added.mass, abs=1e-12)
    np.testing.assert_allclose(moment, added.mass * added.lever, atol=1e-9)
    lever = added.lever
    about_link = added.inertia + added.mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    np.testing.assert_allclose(inertia, about_link, atol=1e-9)


@pytest.mark.parametrize("name", ["flat", "rigid", "soft"])
def test_lowest_points_of_the_spheres_span_the_rectangle(name: str) -> None:
    stand = Stand(DESIGNS[name], "nothing", drop=0.0)
    sole = stand.foot.fit.sole
    ids = [stand.model.geom(g).id for g in stand.foot.contact_geoms]
    lowest = stand.data.geom_xpos[ids] - [0.0, 0.0, DESIGNS[name].contact.radius]
    centre = stand.data.body(stand.foot.body).xpos
    np.testing.assert_allclose(lowest[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(centre, [sole.translation[0], 0.0, 0.0], atol=1e-9)
    extent = lowest[:, :2] - centre[:2]
    np.testing.assert_allclose(extent.max(axis=0), [sole.length / 2, sole.width / 2], atol=1e-9)
    np.testing.assert_allclose(extent.min(axis=0), [-sole.length / 2, -sole.width / 2], atol=1e-9)


@pytest.mark.parametrize("name", ["soft", "six phalanges"])
def test_arches_join_the_ankle_the_heel_and_the_phalanx_that_they_hold(name: str) -> None:
    """Ends of the bars that are drawn, and the gap of the loop after the arch has turned: 2 r sin(angle / 2)."""
    design = DESIGNS[name]
    stand = Stand(design, "nothing", drop=0.0)
    model, data, fit = stand.model, stand.data, stand.foot.fit
    pitch = fit.sole.length / design.phalanges  # type: ignore[attr-defined]
    held = fit.sole.length / 2.0 - (design.loop_phalanx - 0.5) * pitch  # type: ignore[attr-defined]
    middle = data.body(stand.foot.body).xpos
    ankle = middle + fit.sole.ankle
    tip, heel = middle + [held, 0.0, 0.014], middle + [(pitch - fit.sole.length) / 2.0, 0.0, 0.007]
    bars = [i for i in range(model.ngeom) if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    lengths = {round(2.0 * model.geom_size[i, 1], 6): data.geom_xpos[i] for i in bars}
    for end in (tip, heel):
        np.testing.assert_allclose(
            lengths[round(float(np.linalg.norm(end - ankle)), 6)], (end + ankle) / 2.0, atol=1e-6
        )
    assert stand.loop_gap() == pytest.approx(0.0, abs=1e-9)
    assert stand.foot.arch_joint is not None
    data.joint(stand.foot.arch_joint).qpos[0] = 0.3
    mujoco.mj_forward(model, data)
    expected = 2.0 * np.linalg.norm(tip - ankle) * np.sin(0.15)
    assert stand.loop_gap() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", ["flat", "rigid"])
def test_the_range_sensor_of_a_rigid_sole_is_14_mm_behind_its_front_edge(name: str) -> None:
    """At the height of the centres of the spheres; a reading is that height over the sole and the one over ground."""
    stand = Stand(DESIGNS[name], terrain("flat"), drop=0.05)
    fit, site = stand.foot.fit, stand.data.site(stand.foot.range_site)
    edge = stand.data.body(stand.foot.body).xpos[0] + fit.sole.length / 2.0
    assert edge - site.xpos[0] == pytest.approx(0.014, abs=2e-6)
    finder = RangeFinder(stand.model, stand.foot, ground_group=TERRAIN_GROUP)
    height = DESIGNS[name].contact.radius
    assert finder.read(stand.model, stand.data) == pytest.approx(0.05 + height, abs=1e-6)


def test_a_range_sensor_that_sees_nothing_reads_nothing() -> None:
    stand = Stand(DESIGNS["soft"], "nothing")
    finder = RangeFinder(stand.model, stand.foot, ground_group=TERRAIN_GROUP)
    assert finder.distance(stand.model, stand.data) == np.inf and np.isnan(
        finder.read(stand.model, stand.data)
    )


# --- standing --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "case",
    by_default(
        [*((name, "plane") for name in DESIGNS), ("flat", "field"), ("soft", "field")],
        ("flat", "plane"),
        ("iit_softfoot", "plane"),
        ("soft", "field"),
    ),
)
def test_under_a_free_ankle_the_centre_of_pressure_is_under_the_ankle(case: tuple[str, str]) -> None:
    name, ground = case
    stand = Stand(DESIGNS[name], terrain("flat") if ground == "plane" else "flat field")
    stand.settle(1.5)
    points, forces = stand.contacts()
    weight = float(stand.model.body_mass.sum()) * GRAVITY
    assert forces[:, 2].sum() == pytest.approx(weight, rel=0.001)
    # The moment of gravity about the ankle is that of the foot's own mass alone.
    own = stand.foot.fit.added_inertia
    expected = [own.lever[0] * own.mass * GRAVITY / weight, 0.0]
    ankle = stand.data.body("ankle").xpos
    centre = forces[:, 2] @ points / forces[:, 2].sum()
    np.testing.assert_allclose(centre[:2] - ankle[:2], expected, atol=0.001)


@pytest.mark.parametrize("name", by_default(["flat", "rigid", "soft"], "soft"))
def test_the_force_sensor_reads_what_the_ground_does_about_the_sole_centre(name: str) -> None:
    stand = Stand(DESIGNS[name], terrain("slope", 0.1), x=1.0, drop=0.1)
    stand.settle(2.0)
    points, forces = stand.contacts()
    body = stand.data.body(stand.foot.body)
    axes = body.xmat.reshape(3, 3)
    force, load = forces.sum(axis=0), forces[:, 2].sum()
    moment = np.cross(points - body.xpos, forces).sum(axis=0)
    # The sensor sees the weight of the foot below it as well.
    for i in range(stand.model.body(stand.foot.body).id, stand.model.nbody):
        pull = np.array([0.0, 0.0, -GRAVITY * stand.model.body_mass[i]])
        force += pull
        moment += np.cross(stand.data.xipos[i] - body.xpos, pull)
    # MuJoCo's sensor says what the foot does to the ankle: the opposite sign.
    sensors = (stand.foot.force_sensor, stand.foot.torque_sensor)
    reading = -np.concatenate([stand.data.sensor(name).data for name in sensors])
    assert load > 0.9 * LOAD
    np.testing.assert_allclose(reading[:3], axes.T @ force, atol=0.05)
    np.testing.assert_allclose(reading[3:], axes.T @ moment, atol=0.02)


# --- stiffness at run time -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", by_default([0.0, 42.0], 42.0))
def test_a_stiffness_set_at_run_time_equals_one_compiled_in(after: float) -> None:
    before = 42.0 - after
    ground = terrain("stones", 0.03, 2)
    compiled = Stand(foot("soft", stiffness=after), ground, x=1.5, drop=0.1)
    changed = Stand(foot("soft", stiffness=before), ground, x=1.5, drop=0.1)
    SoleStiffness(changed.model, changed.foot).step(after, 0.0)
    for stand in (compiled, changed):
        stand.settle(0.5)
    assert max(abs(compiled.data.joint(name).qpos[0]) for name in compiled.foot.sole_joints) > 0.01
    np.testing.assert_array_equal(compiled.data.qpos, changed.data.qpos)
    np.testing.assert_array_equal(compiled.data.qvel, changed.data.qvel)


def test_the_damping_of_all_hinges_goes_with_the_stiffness() -> None:
    stand = Stand(foot("variable", stiffness=10.0), "nothing")
    dofs = [stand.model.joint(name).dofadr[0] for name in stand.foot.sole_joints]
    own = stand.model.dof_damping[dofs].copy()
    fixed = SoleStiffness(stand.model, stand.foot)
    fixed.step(40.0, 0.0)
    np.testing.assert_array_equal(stand.model.dof_damping[dofs], own)  # without a law it stays
    sole = SoleStiffness(stand.model, stand.foot, damping=lambda stiffness: 0.02 * stiffness)
    for stiffness in (20.0, 80.0):
        sole.step(stiffness, 0.0)
        np.testing.assert_allclose(stand.model.dof_damping[dofs], 0.02 * stiffness)
    sole.reset()
    np.testing.assert_allclose(stand.model.dof_damping[dofs], 0.02 * sole.actual)


def test_springs_and_dampers_of_a_soft_foot_are_those_of_the_paper() -> None:
    """Ten hinges of k and 2 Nms/rad, about the transverse axis; the frontal arch of 100 Nm/rad and 80 Nms/rad."""
    stand = Stand(foot("soft", stiffness=7.0), "nothing")
    hinges = [stand.model.joint(name) for name in stand.foot.sole_joints]
    assert [float(joint.stiffness[0]) for joint in hinges] == [7.0] * 10
    assert [float(joint.damping[0]) for joint in hinges] == [2.0] * 10
    np.testing.assert_array_equal([joint.axis for joint in hinges], [[0.0, 1.0, 0.0]] * 10)
    arch = stand.model.joint(stand.foot.arch_joint)
    assert (arch.stiffness[0], arch.damping[0]) == (100.0, 80.0)


def test_stiffness_follows_its_actuator_and_is_reported() -> None:
    stand = Stand(foot("variable", stiffness=10.0), "nothing")
    actuator = StiffnessActuator(rate_limit=4.0, time_constant=0.05)
    sole = SoleStiffness(stand.model, stand.foot, actuator)
    assert sole.actual == 10.0
    state = actuator.at_rest(10.0)
    for _ in range(50):
        state = actuator.advance(state, 70.0, 0.005)
        assert sole.step(70.0, 0.005) == state.actual == sole.actual
    assert 10.0 < sole.actual < 10.0 * 10.0 ** (4.0 * 0.25)
    ids = [stand.model.joint(name).id for name in stand.foot.sole_joints]
    np.testing.assert_array_equal(stand.model.jnt_stiffness[ids], sole.actual)
    assert stand.model.joint(stand.foot.arch_joint).stiffness[0] == 100.0
    sole.reset()
    assert sole.actual == 10.0
    with pytest.raises(InputError, match=r"1 and .* 2000, got 2001"):
        sole.step(2001.0, 0.005)


def test_the_hinges_of_the_toe_have_a_stiffness_of_their_own() -> None:
    """Also while that of the others is set: those of phalanges 1 and 2, in front of the third, which the arch holds."""
    stand = Stand(foot("variable", stiffness=10.0, front_stiffness=300.0), "nothing")
    sole = SoleStiffness(stand.model, stand.foot, StiffnessActuator.instantaneous(high=100.0))
    for stiffness in (10.0, 70.0):
        sole.step(stiffness, 0.005)
        k = [float(stand.model.joint(name).stiffness[0]) for name in stand.foot.sole_joints]
        assert k == [300.0, 300.0, *[stiffness] * 8]
    with pytest.raises(InputError, match="front_stiffness"):
        foot("long_arch", front_stiffness=300.0)


# --- range -----------------------------------------------------------------------------------------------------------


def hit_point(stand: Stand, reading: float) -> np.ndarray:
    """Return the point of the ground that a reading (m) stands for, in the world, shape (3,), m."""
    site = stand.data.site(stand.foot.range_site)
    return site.xpos + reading * site.xmat[2::3]


@pytest.mark.parametrize("family", ["stones", "random", "large_floor_tiles", "metal_sheets"])
def test_range_readings_follow_the_ground_and_none_is_lost(family: str) -> None:
    ground = terrain(family, 0.02, seed=3)
    stand = Stand(foot("soft"), ground)
    finder = RangeFinder(stand.model, stand.foot, ground_group=TERRAIN_GROUP)
    random = np.random.default_rng(0)
    carriage = stand.model.body("carriage").id
    offset = stand.data.site(stand.foot.range_site).xpos - stand.model.body_pos[carriage] - RANGE_OFFSET
    field = ground.surface.field
    around = 5e-5 * np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0])).reshape(2, -1)
    overhangs = family == "large_floor_tiles"  # the sides of tilted tiles, which no height can describe
    for i in range(250):
        x, y = random.uniform(ground.start + 0.3, ground.stop - 0.3), random.uniform(-0.3, 0.3)
        tilted = bool(i % 2) and not overhangs
        if tilted:  # the other half is tilted, as a foot in its swing is
            stand.data.joint("pitch").qpos[0], stand.data.joint("roll").qpos[0] = random.uniform(-0.4, 0.4, 2)
        else:
            stand.data.joint("pitch").qpos[0] = stand.data.joint("roll").qpos[0] = 0.0
        if field is not None and i % 4 == 0:
            # Exactly on a grid line, where rays are lost: only the site's own offset keeps it away.
            x = field.x0 + random.integers(1, field.z.shape[1] - 1) * field.step[0]
            y = field.y0 + random.integers(1, field.z.shape[0] - 1) * field.step[1] if i % 8 else y
        stand.model.body_pos[carriage] = [x - offset[0], y - offset[1], random.uniform(0.2, 0.5)]
        mujoco.mj_kinematics(stand.model, stand.data)
        hit = hit_point(stand, finder.distance(stand.model, stand.data))
        # On the side of a stone the height jumps: the ray has hit between what is left and right of it.
        near = ground.height(hit[0] + around[0], hit[1] + around[1])
        assert near.min() - 1e-4 < hit[2] < near.max() + 1e-4
        if not tilted:
            assert hit[2] == pytest.approx(float(ground.height(hit[0], hit[1])), abs=1e-4)
