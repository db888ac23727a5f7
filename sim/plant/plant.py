"""The plant: a humanoid on its feet on a ground, simulated by MuJoCo, with drives, sensors and pushes.

`Command` and `Measurement` are those of a real robot; what only a simulation knows is apart, in `truth`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Seed, Triple
from wbc.core.signals import Command
from wbc.feet import Foot, RangeSensor
from wbc.feet import foot as foot_by_name
from wbc.ground import PointCloud
from wbc.robots.description import RobotDescription
from wbc.robots.registry import as_description
from wbc.sim.plant.drives import Drives, Targets
from wbc.sim.plant.eyes import DepthCamera, Eyes, ToeSensors
from wbc.sim.plant.fitting import FootDevices
from wbc.sim.plant.grips import check_clear
from wbc.sim.plant.loads import Loads
from wbc.sim.plant.model import build_model, furniture
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.signals import Imu
from wbc.sim.scenes.base import Scene
from wbc.sim.simulation.machine import Machine, Step, steps_per_tick, whole_steps
from wbc.sim.simulation.sensors import NO_NOISE, SensorNoise
from wbc.sim.terrain.giving import GivingFloor, surfaces
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as terrain_by_name

INITIAL_PRESS = 1e-6
"""Depth of the soles in the ground at the start, m, so that all of their spheres are in contact at once."""


class Plant(MujocoRobot):
    """Robot in MuJoCo: `measure` reads its sensors, `step` advances it by a command, `push` pushes it.

    In position control the servos apply kp (q_ref − q) + kd (q̇_ref − q̇) + τ. This is computed in every physics step
    and integrated implicitly. In hybrid control kp and kd are those of the command. In torque control only τ is
    applied. All torques are limited to the torque limits of the description.

    The force sensor is above the foot, as in real robots. Its reading therefore does not include the weight of the
    foot.

    Attributes:
        foot: The feet.
        feet: Names and sizes of what was built under the ankles, left first.
        sole_sites: MuJoCo site at each sole centre, left first.
        of_robot: True for MuJoCo bodies of the robot and its feet, shape (nbody,).
        terrain: The ground.
        scene: MJCF of the furniture; None without a scene.
        physics: Settings of the physics.
        eyes: Sensors that see the ground; None if there are none.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        *,
        foot: str | Foot = "flat",
        terrain: str | Terrain = "flat",
        timestep: Step | None = None,
        control_period: Step = 0.005,
        noise: str | SensorNoise = NO_NOISE,
        seed: Seed = 0,
        initial_configuration: ArrayLike | None = None,
        range_sensor: RangeSensor | None = None,
        physics: PhysicsSettings | None = None,
        machine: Machine | None = None,
        scene: str | Path | mujoco.MjSpec | Scene | None = None,
        eyes: Sequence[DepthCamera | ToeSensors] = (),
        visuals: bool = True,
    ) -> None:
        """Build the model and put the robot on the ground.

        Args:
            description: The robot, or the name of one (`wbc.robots.names`).
            foot: A foot, or the name of one: "flat" is the robot's own sole.
            terrain: The ground, or the name of a family with its own amplitude and seed 0.
            timestep: Physics step, s; that of `physics`, or 1 ms, when None.
            control_period: Time between two commands, s; a whole multiple of the physics step.
            noise: Sensor errors, or the name of a preset: "none", "realistic".
            seed: Seed of every random draw.
            initial_configuration: Start of the robot, shape (nq,); half-sitting on the ground when None.
            range_sensor: Range sensor under each toe; none when None.
            physics: Further settings of the physics.
            machine: Properties of the machine that the description omits: delays, friction, payload, and which sensors
                exist.
            scene: Furniture around the robot: a scene, the name of one, or MJCF as a path, as XML or as a
                specification. With a scene all bodies of the robot can touch the scene and the ground; without one,
                only the feet can touch the ground.
            eyes: Depth cameras and range sensors at the toes, whose clouds `clouds` returns.
            visuals: Keep the shapes by which the robot is drawn. They touch nothing and change no result. Studies leave
                them out.
        """
        description = as_description(description)
        description.needs_feet("the plant")
        settings = physics or PhysicsSettings()
        self.physics = settings if timestep is None else replace(settings, timestep=timestep)
        steps_per_tick(control_period, self.physics.timestep)
        self.foot = foot_by_name(foot) if isinstance(foot, str) else foot
        machine, robot = machine or Machine(), description.robot()
        things = None if scene is None else furniture(scene)
        self.scene = None if things is None else things.to_xml()
        model, self.feet, self.terrain = build_model(
            description,
            robot,
            foot=self.foot,
            terrain=terrain_by_name(terrain) if isinstance(terrain, str) else terrain,
            physics=self.physics,
            machine=machine,
            scene=things,
            visuals=visuals,
        )
        places = RobotPlaces(model, robot, feet=[built.body for built in self.feet])
        hands = tuple(robot.frames) if machine.hand_sensors or things is not None else ()
        super().__init__(
            description,
            robot,
            places,
            control_period=control_period,
            noise=noise,
            seed=seed,
            machine=machine,
            imu=Imu(places, "gyroscope", "accelerometer"),
            soles=[name for built in self.feet for name in (built.force_sensor, built.torque_sensor)],
            hands=hands,
        )
        self.of_robot = places.of_robot
        self.sole_sites = tuple(int(model.site(built.wrench_site).id) for built in self.feet)
        places_of, turns_of = self.data.site_xpos, self.data.site_xmat  # the soles are live views of these
        self._soles = tuple((places_of[site], turns_of[site].reshape(3, 3)) for site in self.sole_sites)
        for view in (view for sole in self._soles for view in sole):
            view.setflags(write=False)
        self._loads = Loads(model)
        self._devices = FootDevices(model, self.feet, self.foot, range_sensor)
        self._drives = Drives(model, description)
        self._initial = None
        if initial_configuration is not None:
            self._initial = robot.check_configuration("initial_configuration", initial_configuration)
        # Time in each control period, s, before and after the step in which a late command begins to act.
        self._until_due = whole_steps(machine.command_delay, self.timestep) % self.steps * self.timestep
        self._from_due = self.control_period - self._until_due
        age = whole_steps(machine.measurement_delay, self.timestep)
        # Readings of range sensors and stiffness actuators, once a tick: the oldest is the one that counts.
        self._surfaces = surfaces(model, self.feet, self.terrain)
        self._late_feet: deque[tuple[Array, Array]] = deque(
            maxlen=math.ceil(age / self.steps) + 1 if age else 0
        )
        self.eyes: Eyes | None = None
        self.reset()
        if eyes:
            self.eyes = Eyes(self, eyes)
            self.eyes.look(self.time)

    def __repr__(self) -> str:
        ground, foot = f"{self.terrain.name} {self.terrain.amplitude:g} m", type(self.foot).__name__
        return f"{type(self).__name__}('{self.description.name}', {foot}, {ground}, t={self.time:.3f} s)"

    @property
    def start(self) -> Array:
        """Configuration of the last reset, shape (nq,); a copy."""
        return self._start.copy()

    def _usual_start(self) -> Array:
        return super()._usual_start() if self._initial is None else self._initial

    def _place(self, q: Array, v: Array | None) -> None:
        data = self.data
        if self.scene is not None:
            start = mujoco.MjData(self.model)
            self.places.set_configuration(q, start.qpos)
            mujoco.mj_fwdPosition(self.model, start)
            check_clear(self.model, start, self._contacts.geom_robot)
        self._start = q
        self._pushed.clear()  # with the forces in the data
        mujoco.mj_resetData(self.model, data)
        self._set_state(q, v)
        self._loads.clear()
        self._drives.reset(q[7:], data.ctrl)
        for surface in self._surfaces:  # which a run before may have left elsewhere
            surface.reset(self.model)
            mujoco.mj_forward(self.model, data)
            surface.adapt(self.model, data)
        self._late_feet.clear()

    def _begin(self) -> None:
        self._devices.reset(self._seeds()[1:])
        super()._begin()
        self._begun = True
        if self.eyes is not None:
            self.eyes.reset(self.seed)
        self._end_period()

    def _seeds(self) -> list[int]:
        """Return the seed of the sensor errors, and that of the range sensor of each sole."""
        seeds: list[int] = np.random.SeedSequence(self.seed).generate_state(1 + len(self.feet)).tolist()
        return seeds

    def _sensor_seed(self) -> int:
        return self._seeds()[0]

    def on_ground(self, configuration: ArrayLike) -> Array:
        """Return a configuration moved up or down until its soles rest on the ground.

        Args:
            configuration: Shape (nq,).

        Returns:
            Configuration, shape (nq,), in which the robot is pressed into the ground by a micrometre, or into a floor
            that gives as deep as its weight presses soles without hinges. The soles are compared with the ground at
            points some 13 mm apart, so higher peaks of a rough ground between these points are missed.
        """
        q = self.robot.check_configuration("configuration", configuration)
        data = mujoco.MjData(self.model)
        self.places.set_configuration(q, data.qpos)
        mujoco.mj_kinematics(self.model, data)
        lift = -math.inf
        for foot, site in zip(self.feet, self.sole_sites, strict=True):
            x, y = np.meshgrid(
                foot.fit.sole.length * np.linspace(-0.5, 0.5, 21),
                foot.fit.sole.width * np.linspace(-0.5, 0.5, 9),
            )
            local = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)])
            points = data.site_xpos[site][:, None] + data.site_xmat[site].reshape(3, 3) @ local
            lift = max(lift, float(np.max(self.terrain.height(points[0], points[1]) - points[2])))
        q[2] += lift - INITIAL_PRESS
        for surface in self._surfaces:
            if isinstance(surface, GivingFloor):
                self.places.set_configuration(q, data.qpos)
                mujoco.mj_kinematics(self.model, data)
                mass = self.model.body_subtreemass[self.places.root]
                q[2] -= surface.depth(self.model, data, mass * self.physics.gravity)
        return q

    @property
    def sole_poses(self) -> Sequence[tuple[Array, Array]]:
        """See `Simulation`."""
        return self._soles

    def _foot_readings(self) -> tuple[Array, Array]:
        return self._late_feet[0] if self._late_feet else self._feet_now()

    def _feet_now(self) -> tuple[Array, Array]:
        """Return the readings of the range sensors and of the stiffness actuators now, both of shape (soles,)."""
        return self._devices.ranges(self.data), self._devices.stiffness()

    def _read(self, command: Command) -> tuple[Targets, Array | None]:
        self._devices.check(command.sole_stiffness)
        return self._drives.read(command), command.sole_stiffness

    def _take(self, order: tuple[Targets, Array | None]) -> None:
        if self._until_due:
            self._set_soles(None, self._until_due)
        super()._take(order)
        self._loads.advance(self.control_period)

    def clouds(self) -> list[PointCloud]:
        """Return the clouds of points that have arrived from all eyes since the last call; empty without eyes."""
        return [] if self.eyes is None else self.eyes.take(self.time)

    @checked
    def load(
        self,
        body: str,
        mass: Annotated[NonNegative, "kg"],
        *,
        over: Annotated[NonNegative, "s"] = 0.0,
        at: Triple = (0.0, 0.0, 0.0),
    ) -> None:
        """Put a mass on a body that is not in the description; loads at several places add up.

        Args:
            body: Link or frame of the robot; "torso" and "base" are its torso and base frames.
            mass: Mass at that place after the ramp, kg; zero removes it.
            over: Duration of the ramp from the present mass at that place, s; with zero the mass changes at once.
            at: Position of the mass in the frame of that body, shape (3,), m.
        """
        index, place = self.places.carrier(body)
        self._loads.put(index, place.act(np.asarray(at)), mass, over)

    @property
    def load_mass(self) -> float:
        """Present mass of all loads, kg."""
        return self._loads.mass

    def _set_soles(self, stiffness: Array | None, duration: float) -> None:
        """Advance the stiffness actuators by a time, s, under a command, shape (soles,), Nm/rad; the last when None."""
        if self._devices.advance(stiffness, duration):
            self._refresh()  # the springs' forces belong to the half of the coming step that is done already

    def _follow(self, order: tuple[Targets, Array | None]) -> None:
        targets, stiffness = order
        self._set_soles(stiffness, self._from_due)
        self._drives.follow(targets, self.data.ctrl)

    def _integrate(self) -> None:
        # The first half of a step computes positions, velocities and contacts: `_refresh` may have done it.
        (mujoco.mj_step2 if self._begun else mujoco.mj_step)(self.model, self.data)
        if self._begun:  # once a period
            for surface in self._surfaces:
                surface.adapt(self.model, self.data)
        self._begun = False

    def _refresh(self) -> None:
        mujoco.mj_step1(self.model, self.data)
        self.data.efc_force[:] = np.nan  # of the coming step, whose forces nobody knows
        self._begun = True

    def _end_period(self) -> None:
        if self._late_feet.maxlen:
            self._late_feet.append(self._feet_now())
        self._find_divergence()
        if self.eyes is not None:
            self.eyes.look(self.time)
