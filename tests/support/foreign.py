"""Scenes of somebody else: a robot among furniture in a MuJoCo model with names and an order of its own."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbc.robots import RobotDescription

KINDS = ("motor", "position", "velocity", "general", "mixed", "none")


def foreign_model(
    description: RobotDescription,
    kind: str = "motor",
    *,
    timestep: float = 0.001,
    integrator: str = "implicitfast",
    imu: bool = True,
    gains: tuple[np.ndarray, np.ndarray] | None = None,
    gear: float = 1.0,
    lag: float = 0.0,
    delay: float = 0.0,
) -> mujoco.MjModel:
    """Return a scene: a ball, a table, a door with a motor, the robot, and its actuators from the last joint on.

    Args:
        description: The robot; boxes of the size of its soles are its feet, a ball its pelvis.
        kind: Kind of the actuators; "mixed" alternates motors and servos with two actuators.
        timestep: s.
        integrator: MuJoCo's name of it.
        imu: With a gyroscope and an accelerometer on a site that is turned against the IMU frame.
        gains: kp and kd of servos; the description's when None.
        gear: Of motors.
        lag: Time constant of the filters of actuators of one kind; none when 0, s.
        delay: Delay of actuators and sensors, s.
    """
    robot = description.robot()
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [0.0, 0.0, -9.80665]
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    world = spec.worldbody
    world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    ball = world.add_body(name="ball", pos=[1.0, 1.0, 0.1])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=1.0)
    table = world.add_body(name="table", pos=[1.5, 0.0, 0.4])
    table.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.3, 0.6, 0.4])
    door = world.add_body(name="door", pos=[0.0, 2.0, 1.0])
    door.add_joint(name="hinge", axis=[0, 0, 1])
    door.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.4, 0.02, 0.9], mass=10.0)
    child = mujoco.MjSpec.from_string(description.urdf_without_geometry())
    child.compiler.fusestatic = False
    base = child.worldbody.first_body()
    base.add_freejoint()
    joints = {joint.name: joint for joint in child.joints if joint.type != mujoco.mjtJoint.mjJNT_FREE}
    for name in description.joint_names:
        joints[name].armature = description.armature[name]
        limit = float(description.torque_limit[description.joint_names.index(name)])
        joints[name].actfrclimited, joints[name].actfrcrange = True, [-limit, limit]
    for sole in robot.soles:
        frame = robot.model.frames[robot.frame_id(sole.frame)]
        body = joints[str(robot.model.names[frame.parentJoint])].parent
        place = frame.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01]))
        x, y, z, w = pin.Quaternion(place.rotation).coeffs()
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[sole.length / 2, sole.width / 2, 0.01],
            pos=place.translation,
            quat=[w, x, y, z],
            mass=0.0,
        )
    base.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=0.0)
    if imu:
        frame = robot.model.frames[robot.frame_id(robot.imu_frame)]
        turned = frame.placement * pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 1.5), np.zeros(3))
        body = base if frame.parentJoint < 2 else joints[str(robot.model.names[frame.parentJoint])].parent
        x, y, z, w = pin.Quaternion(turned.rotation).coeffs()
        body.add_site(name="box", pos=turned.translation, quat=[w, x, y, z])
        for name, sensor in (("gyr", "GYRO"), ("acc", "ACCELEROMETER")):
            child.add_sensor(
                name=name,
                type=getattr(mujoco.mjtSensor, f"mjSENS_{sensor}"),
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname="box",
            )
    spec.attach(child, prefix="mine/", frame=world.add_frame(pos=[0.0, 0.0, 0.0]))
    spec.add_actuator(name="door", target="hinge", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    kp, kd = (description.kp, description.kd) if gains is None else gains
    for i in reversed(range(robot.na)):
        name = "mine/" + description.joint_names[i]
        if kind == "none":
            continue
        which = ("motor" if i % 2 else "position") if kind == "mixed" else kind
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        if lag > 0.0:
            actuator.dyntype, actuator.dynprm[0] = mujoco.mjtDyn.mjDYN_FILTEREXACT, lag
        if which == "motor":
            actuator.gear[0] = gear
            continue
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        stiffness = 0.0 if which == "velocity" else kp[i]
        actuator.gainprm[0] = {"velocity": kd[i], "general": 1.0}.get(which, kp[i])
        damping = 0.0 if kind == "mixed" else kd[i]
        actuator.biasprm[1], actuator.biasprm[2] = -stiffness, -damping
        if kind == "mixed":  # damped by a velocity servo beside it
            second = spec.add_actuator(name=f"{name}_v", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            second.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            second.gainprm[0], second.biasprm[2] = kd[i], -kd[i]
    for late in (*spec.actuators, *spec.sensors) if delay > 0.0 else ():
        late.delay, late.nsample = delay, 1 + round(delay / timestep)
    return spec.compile()
