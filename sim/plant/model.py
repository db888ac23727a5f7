"""MuJoCo model of a robot on its feet on a terrain."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError
from wbc.base.hull import convex_hull
from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import SIDES, Robot
from wbc.feet import Foot, FootParts
from wbc.robots.description import RobotDescription
from wbc.robots.frames import carrier
from wbc.robots.mechanism import FARTHEST, WORLD_LINK, Mechanism, placed, principal
from wbc.robots.readers.compile_mjcf import read_spec
from wbc.sim.plant.fitting import ankle_soles
from wbc.sim.plant.grips import SCENE_PREFIX, add_grips, add_hand_sensors
from wbc.sim.plant.link_geoms import add_body_shapes, add_stage, add_visuals, drop_meshes
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.scenes.base import Scene, make_scene
from wbc.sim.simulation.machine import Machine
from wbc.sim.terrain.render import TERRAIN_GROUP, add_to_spec
from wbc.sim.terrain.spec import Terrain

_log = logging.getLogger(__name__)

MANY_THINGS = 50
"""Bodies that move freely above which those at rest sleep until something touches them (MuJoCo's islands).

A second of physics under `g1`, s of a core, awake and asleep: 0.4 and 0.3 with 40 flat stones, 1.2 and 0.6 with 200
pebbles, 2.7 and 1.0 with 400.
"""

COUPLING_SOLREF, COUPLING_SOLIMP = (0.004, 1.0), (0.99, 0.999, 0.001)
"""Time constant (s) and damping ratio of the coupling of joints, and its impedance: as stiff as gears are at a step of
2 ms."""


def build_model(
    description: RobotDescription,
    robot: Robot,
    *,
    foot: Foot,
    terrain: Terrain,
    physics: PhysicsSettings,
    machine: Machine,
    scene: mujoco.MjSpec | None = None,
    visuals: bool = True,
) -> tuple[mujoco.MjModel, tuple[FootParts, ...], Terrain]:
    """Compile the MuJoCo model of a robot on its feet on a terrain, with furniture made by `furniture`.

    Without `visuals` the links of the robot cannot be seen. Returns the model, one foot per sole, left first, and the
    terrain as drawn; raises as `bare_spec` and `equip` do.
    """
    spec = bare_spec(description)
    physics.apply(spec)
    sensors = scene is not None or machine.hand_sensors
    feet = equip(spec, description, robot, foot, machine, hands=sensors, shapes=scene is not None)
    ground = surround(spec, terrain, scene, {"": robot}, sole_radius=foot.contact.radius)
    if visuals:
        add_visuals(spec, description, robot)
        add_stage(spec)
    few = physics.few_contacts and not terrain.gives and scene is None
    return finished(spec, robot.name, few_contacts=few), feet, ground


def finished(spec: mujoco.MjSpec, name: str, *, few_contacts: bool) -> mujoco.MjModel:
    """Compile a model whose robots and surroundings are complete, and spare it what changes nothing.

    With `few_contacts` soles on planes alone touch them at few points. Of many bodies those at rest sleep.
    """
    model = compiled(spec, name)
    if few_contacts and (model.geom_type[model.geom_contype != 0] == mujoco.mjtGeom.mjGEOM_PLANE).all():
        _thin_flat_soles(model)
    if np.count_nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE) > MANY_THINGS:
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    # A clamp in one place alone would make the reported torque differ from the one applied.
    clamps = model.jnt_actfrcrange[model.actuator_trnid[:, 0]]
    assert (clamps == model.actuator_forcerange).all(), "joint and actuator are clamped differently"
    return model


def surround(
    spec: mujoco.MjSpec,
    terrain: Terrain,
    scene: mujoco.MjSpec | None = None,
    robots: Mapping[str, Robot] | None = None,
    *,
    sole_radius: float | None = None,
) -> Terrain:
    """Put all that is no robot into a model: the ground, and the bodies that stand or move on it.

    This is the one place where surroundings enter the model of one robot, of several, and of a picture. How a ground
    gives and how slippery it is are the contact parameters of its geoms, `wbc.sim.terrain.render.CONTACT`. Bodies that
    can move have names that begin with `SCENE_PREFIX`, by which logs, replays and eyes find their poses.

    Args:
        spec: Model with the robots in it.
        terrain: The ground.
        scene: Furniture, made by `furniture`.
        robots: Beginning of all names of a robot → robot; their hands can grip the handles of the scene.
        sole_radius: Radius of the spheres under the soles, m; that of the terrain when None.

    Returns:
        The terrain as drawn.
    """
    ground = add_to_spec(spec, terrain, sole_radius=sole_radius)
    if scene is not None:
        spec.attach(scene, prefix=SCENE_PREFIX, frame=spec.worldbody.add_frame())
        for owner, robot in (robots or {}).items():
            add_grips(spec, robot, owner)
    return ground


def bare_spec(description: RobotDescription) -> mujoco.MjSpec:
    """Return the links and joints of a robot with a free base, without drives, feet and sensors."""
    robot = description.mechanism
    model, spec = robot.model, mujoco.MjSpec()
    spec.modelname, spec.compiler.degree = description.name, False
    bodies = {0: spec.worldbody}
    for i, frame in enumerate(model.frames):
        if frame.type != pin.FrameType.BODY:
            continue
        if frame.name == WORLD_LINK and frame.name not in robot.inertias:
            bodies[i] = spec.worldbody
            continue
        above, inside, moving = frame.parentFrame, frame.placement, list[tuple[int, pin.SE3]]()
        while above not in bodies:  # joints between the link and the one that it hangs on, the last one first
            if model.frames[above].type == pin.FrameType.JOINT:
                joint = model.frames[above].parentJoint
                moving.append((joint, inside.inverse()))
                inside = model.jointPlacements[joint] * inside
            above = model.frames[above].parentFrame
        parent = model.frames[above]
        place = parent.placement.inverse() * inside if above else inside
        body = bodies[i] = bodies[above].add_body(name=frame.name, **placed(place))
        for joint, anchor in reversed(moving):
            _add_joint(body, robot, joint, anchor)
        if inertia := robot.inertias.get(frame.name):
            body.explicitinertial, body.mass = True, inertia.mass
            body.inertia, axes = principal(inertia.inertia)
            body.ipos, body.iquat = placed(pin.SE3(axes, inertia.lever)).values()
    for follower, coupling in robot.couplings.items():
        tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=follower, name2=coupling.leader)
        tie.objtype = mujoco.mjtObj.mjOBJ_JOINT
        tie.data[:2] = coupling.offset, coupling.ratio
        tie.solref[:2], tie.solimp[:3] = COUPLING_SOLREF, COUPLING_SOLIMP
    if not (base := spec.worldbody.first_body()).joints:
        base.add_freejoint()
    return spec


def _add_joint(body: mujoco.MjsBody, robot: Mechanism, joint: int, place: pin.SE3) -> None:
    """Add a joint at a place in a body, with its limits."""
    model, kinds = robot.model, mujoco.mjtJoint
    kind = model.joints[joint]
    if kind.nq > 1:
        body.add_freejoint()
        return
    slides, axis = robot.axis(joint)
    made = body.add_joint(name=model.names[joint], type=kinds.mjJNT_SLIDE if slides else kinds.mjJNT_HINGE)
    made.pos, made.axis = place.translation, place.rotation @ axis
    limits = model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]
    if np.isfinite(limits).any():
        made.range = np.clip(limits, -FARTHEST, FARTHEST)
    if torque := model.upperEffortLimit[kind.idx_v]:
        made.actfrcrange = [-torque, torque]


def equip(
    spec: mujoco.MjSpec,
    description: RobotDescription,
    robot: Robot,
    foot: Foot,
    machine: Machine,
    *,
    hands: bool,
    shapes: bool,
) -> tuple[FootParts, ...]:
    """Add drives, feet, sensors and flaws to what `bare_spec` made; return one foot per sole, left first.

    With `hands` wrists have force sensors, with `shapes` all links touch things.
    """
    _add_servos(spec, description)
    soles = ankle_soles(robot)
    if len(soles) > len(SIDES):
        raise ModelError(f"the plant has feet for {len(SIDES)} soles, '{robot.name}' has {len(soles)}")
    feet = tuple(
        foot.build(spec, spec.body(sole.ankle_link), side, sole)
        for side, sole in zip(SIDES[: len(soles)], soles, strict=True)
    )
    link, place = carrier(robot.model, robot.imu_frame)
    spec.body(link).add_site(name="imu_site", size=[0.005] * 3, **placed(place))
    kinds = {
        "gyroscope": mujoco.mjtSensor.mjSENS_GYRO,
        "accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER,
    }
    for name, kind in kinds.items():
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu_site")
    _add_flaws(spec, description, robot, machine)
    if hands:
        add_hand_sensors(spec, robot)
    if shapes:
        add_body_shapes(spec, description, robot)
    return feet


def drawing_model(description: RobotDescription, robot: Robot, terrain: Terrain) -> mujoco.MjModel:
    """Return a model of a robot's links on a terrain that is drawn and never stepped."""
    spec = bare_spec(description)
    surround(spec, terrain)
    add_visuals(spec, description, robot)
    add_stage(spec)
    return compiled(spec, robot.name)


def aim(camera: mujoco.MjvCamera, height: float, target: Sequence[float] | Array) -> None:
    """Let a camera look at a target, (3,), m, from the side and ahead of a robot whose hip or CoM is at a height, m."""
    camera.distance, camera.azimuth, camera.elevation = 3.2 * height, 130.0, -12.0
    camera.lookat[:] = target


def compiled(spec: mujoco.MjSpec, name: str) -> mujoco.MjModel:
    """Return the compiled model of a robot of that name; `ModelError` if MuJoCo cannot compile it.

    Meshes that MuJoCo refuses are not drawn.
    """
    try:
        return spec.compile()
    except ValueError as error:
        if drop_meshes(spec):
            _log.warning("the meshes of '%s' are not drawn: %s", name, str(error).splitlines()[0])
            return compiled(spec, name)
        raise ModelError(f"MuJoCo cannot compile the model of '{name}': {error}") from error


def furniture(source: str | Path | mujoco.MjSpec | Scene) -> mujoco.MjSpec:
    """Return the furniture of a scene, as a copy: a scene, its name, or MJCF as path, XML or specification."""
    if isinstance(source, str) and source.replace("_", "").isalnum():
        source = make_scene(source)
    try:
        if isinstance(source, Scene):
            scene = source.spec()
        elif isinstance(source, mujoco.MjSpec):
            scene = source.copy()
        else:
            scene = read_spec(source)
        scene.copy().compile()
    except (ValueError, OSError) as error:
        raise InputError(f"scene cannot be read: {str(error).splitlines()[0]}") from error
    if list(scene.actuators):
        raise InputError(
            f"a scene must be furniture without actuators, it has {len(list(scene.actuators))}; "
            "`wbc.sim.MujocoLoop` takes a scene with drives of its own"
        )
    for key in list(scene.keys):
        scene.delete(key)
    seen = isinstance(source, Scene) and source.seen
    for geom in scene.geoms:
        if seen or geom.group == TERRAIN_GROUP:  # which cameras and range sensors see
            geom.group = TERRAIN_GROUP if seen else 0
    return scene


def _add_servos(spec: mujoco.MjSpec, robot: RobotDescription) -> None:
    """Add rotor inertia, torque clamp and servo of each joint, actuators in the order of the robot's joints."""
    if robot.closures:
        names = ", ".join(closure.name for closure in robot.closures)
        raise ModelError(
            f"'{robot.name}' has closed chains ({names}), which a plant made of its links would leave open: "
            "wbc.sim.MujocoLoop takes its own MuJoCo model"
        )
    for i, name in enumerate(robot.joint_names):
        joint = spec.joint(name)
        joint.armature = robot.armature_array[i]
        # Force = ctrl − kp q − kd q̇ with ctrl = kp q_ref + kd q̇_ref + τ: servo and feed-forward in one actuator
        # that the integrator sees, and a pure torque when the two gains are zero.
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        actuator.gainprm[0] = 1.0
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[1], actuator.biasprm[2] = -robot.kp[i], -robot.kd[i]
        actuator.ctrllimited = False
        # Joints of the links are clamped as well. Both clamps are set to one value, so that what the actuator reports
        # is what the joint gets.
        limit = float(robot.torque_limit[i])
        least, most = robot.torque_ranges.get(name, (-limit, limit))
        joint.actfrclimited, actuator.forcelimited = True, True
        joint.actfrcrange, actuator.forcerange = [least, most], [least, most]


def _thin_flat_soles(model: mujoco.MjModel) -> None:
    """Let a flat rigid sole touch a plane with the corners of its grid of spheres and as many next to its centre.

    The corners alone would give the same support, as one of them is always lowest, but more friction about the
    vertical: the spheres of a sole of 160 × 76 mm lie at 55 mm from its centre in the mean, its corners at 89 mm, the
    eight at 52 mm.
    """
    spheres = np.flatnonzero((model.geom_contype == 0) & (model.geom_conaffinity != 0))
    for body in np.unique(model.geom_bodyid[spheres]):
        mine = spheres[model.geom_bodyid[spheres] == body]
        places, sizes = model.geom_pos[mine], model.geom_size[mine, 0]
        corners = convex_hull(places[:, :2])
        if np.ptp(places[:, 2]) > ROUNDING or np.ptp(sizes) > 0.0 or len(corners) < 3:
            continue
        outside = np.linalg.norm(places[:, None, :2] - corners, axis=2).min(axis=1) > 0.0
        distance = np.linalg.norm(places[:, :2] - corners.mean(axis=0), axis=1)
        # All of the distance of the last corner are kept.
        furthest = np.sort(distance)[min(len(corners), len(mine)) - 1] + ROUNDING
        model.geom_conaffinity[mine[outside & (distance > furthest)]] = 0


def _add_flaws(spec: mujoco.MjSpec, description: RobotDescription, robot: Robot, machine: Machine) -> None:
    """Add damping, dry friction and springs to the joints, and a point mass at the torso's centre of mass."""
    for name in robot.joint_names:
        friction = machine.friction + description.frictionloss.get(name, 0.0)
        damping = description.damping.get(name, 0.0)
        if friction > 0.0:
            spec.joint(name).frictionloss = friction
        if damping > 0.0:
            spec.joint(name).damping[0] = damping
        if name in description.springs:
            spec.joint(name).stiffness[0], spec.joint(name).springref = description.springs[name]
    if machine.payload > 0.0:
        spec.body(robot.torso_frame).mass += machine.payload
