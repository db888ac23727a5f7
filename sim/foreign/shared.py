"""Several robots in one simulation: each has a loop of its own, and all take a step together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.base.settings import Seed
from wbc.core.frames import yaw_rotation
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.feet import Foot
from wbc.feet import foot as foot_by_name
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description
from wbc.sim.foreign.mujoco_model import MujocoLoop
from wbc.sim.plant.grips import check_clear
from wbc.sim.plant.link_geoms import SHAPE_GROUP, add_stage, add_visuals
from wbc.sim.plant.model import bare_spec, equip, finished, furniture, surround
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.scenes.base import Scene
from wbc.sim.simulation.machine import Machine, Step
from wbc.sim.simulation.sensors import NO_NOISE, SensorNoise
from wbc.sim.simulation.simulation import ANOTHER, reset_together, step_together
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as terrain_by_name

MOST_ROBOTS = 16
"""Most robots of a plant: each has a bit of MuJoCo's masks of contacts."""


def _shared_model(
    descriptions: Mapping[str, RobotDescription],
    foot: Foot,
    ground: Terrain,
    things: mujoco.MjSpec | None,
    timestep: float,
) -> mujoco.MjModel:
    """Return the model of several robots on one ground; with furniture they touch it and each other."""
    spec = mujoco.MjSpec()
    PhysicsSettings(timestep=timestep).apply(spec)
    models = {f"{name}/": description.robot() for name, description in descriptions.items()}
    every = (1 << len(descriptions)) - 1
    for i, (name, description) in enumerate(descriptions.items()):
        description.needs_feet("a shared plant")
        robot, part = models[f"{name}/"], bare_spec(description)
        add_visuals(part, description, robot)
        equip(part, description, robot, foot, Machine(), hands=True, shapes=things is not None)
        for geom in part.geoms:
            if geom.group == SHAPE_GROUP:  # touches things, and the other robots
                geom.contype, geom.conaffinity = 2 << i, 1 | (every & ~(1 << i)) << 1
        spec.attach(part, prefix=f"{name}/", frame=spec.worldbody.add_frame())
    surround(spec, ground, things, models, sole_radius=foot.contact.radius)
    add_stage(spec)
    return finished(spec, " and ".join(descriptions), few_contacts=things is None)


class SharedPlant:
    """Plant with several robots on one ground.

        plant = SharedPlant({"one": hrp4, "two": talos}, places={"two": (1.5, 0.0, np.pi)})
        while plant.time < 5.0:
            plant.step({name: controls[name].command(m) for name, m in plant.measure().items()})

    Each robot has its own loop, controller and world frame. The world frame of a robot is between its feet at the
    start, with x forward, because a controller does not know where its robot stands. `in_world` converts to the world
    frame of the plant. With a scene the robots touch objects and each other; without a scene they touch only the
    ground.

    Attributes:
        loops: Name → loop of the robot, with its true state in the world frame of the plant, pushes, grips and sensors.
        model: MuJoCo's model; all names of a robot begin with the name of the robot and a slash.
        data: MuJoCo's state.
        control_period: Time that `step` advances, s.
    """

    control_period: float = fixed(ANOTHER)

    @checked
    def __init__(
        self,
        robots: Mapping[str, RobotDescription | str],
        *,
        places: Mapping[str, Sequence[float]] | None = None,
        foot: str | Foot = "flat",
        terrain: str | Terrain = "flat",
        scene: str | Path | mujoco.MjSpec | Scene | None = None,
        timestep: Step = 0.001,
        control_period: Step = 0.005,
        noise: str | SensorNoise = NO_NOISE,
        seed: Seed = 0,
    ) -> None:
        """Build the model and put the robots on the ground, in half-sitting.

        Args:
            robots: Name → description, or the name of one.
            places: Name → x, y (m) and heading (rad) in the world; the origin when not given.
            foot: Foot under all ankles. This argument and the next ones, and their errors, are those of `wbc.Plant`.
            terrain: The ground, rigid and without areas; it must be level where the robots start.
            scene: Furniture around the robots.
            timestep: Physics step, s.
            control_period: Time between two commands, s.
            noise: Sensor errors of every robot.
            seed: Seed of the sensor errors; each robot has its own errors.
        """
        if not 0 < len(robots) <= MOST_ROBOTS or any(not name or "/" in name for name in robots):
            raise InputError(
                f"a shared plant needs 1 to {MOST_ROBOTS} robots with names without '/', got {list(robots)}"
            )
        descriptions = {name: as_description(robot) for name, robot in robots.items()}
        self._places = dict.fromkeys(robots, pin.SE3.Identity())
        for name, place in (places or {}).items():
            x, y, heading = finite_array(f"place of robot '{name}' (m, m, rad)", place, (3,)).tolist()
            finite_scalar(f"heading of robot '{name}' (rad)", heading, low=-math.tau, high=math.tau)
            turn = yaw_rotation(heading)
            self._places[choose("robot", name, robots)] = pin.SE3(turn, np.array([x, y, 0.0]))
        ground = terrain_by_name(terrain) if isinstance(terrain, str) else terrain
        if ground.gives or ground.areas:
            raise InputError(
                "a ground of a shared plant must be rigid and without areas, which `wbc.Plant` takes: leave out "
                "floor_stiffness and areas"
            )
        foot = foot_by_name(foot) if isinstance(foot, str) else foot
        things = None if scene is None else furniture(scene)
        self.model = _shared_model(descriptions, foot, ground, things, timestep)
        self.data = mujoco.MjData(self.model)
        # A loop notes what its robot begins inside of, and in a new state all robots stand in one place.
        for name, description in descriptions.items():
            robot, locked = description.robot(), description.locked
            places_in_model = RobotPlaces(self.model, robot, None, f"{name}/", locked=locked)
            places_in_model.set_configuration(self._start(name, robot), self.data.qpos)
        mujoco.mj_forward(self.model, self.data)
        self.control_period = float(control_period)
        drawn = [np.random.SeedSequence(seed, spawn_key=(i,)) for i in range(1, len(descriptions))]
        seeds = [seed, *(int(each.generate_state(1, np.uint64)[0]) for each in drawn)]
        self.loops = {
            name: MujocoLoop(
                description,
                self.model,
                self.data,
                control_period=control_period,
                prefix=f"{name}/",
                noise=noise,
                seed=own,
            )
            for own, (name, description) in zip(seeds, descriptions.items(), strict=True)
        }
        for loop in self.loops.values():
            loop._shared = True
        self.reset()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return float(self.data.time)

    def reset(self) -> None:
        """Put all robots into half-sitting at their places, and all objects to their initial places."""
        for loop in self.loops.values():
            loop._release_pushes()
        mujoco.mj_resetData(self.model, self.data)
        starts = [self._start(name, loop.robot) for name, loop in self.loops.items()]
        reset_together(tuple(self.loops.values()), starts)
        for loop in self.loops.values():
            check_clear(
                self.model, self.data, self.model.body_rootid[self.model.geom_bodyid] == loop.places.root
            )

    def _start(self, name: str, robot: Robot) -> Array:
        """Return half-sitting at the place of a robot, shape (nq,)."""
        q = robot.half_sitting.copy()
        q[:7] = pin.SE3ToXYZQUAT(self._places[name] * pin.XYZQUATToSE3(q[:7]))
        return q

    def measure(self) -> dict[str, Measurement]:
        """Return name → present readings of the sensors; raise a `MeasurementError` if the simulation has diverged."""
        return {name: loop.measure() for name, loop in self.loops.items()}

    def step(self, commands: Mapping[str, Command]) -> None:
        """Advance by one control period, with a command for every robot: name → command.

        Raises:
            InputError: A robot is unknown, has no command, or cannot follow its command. The simulation has not
                advanced.
        """
        for name in commands:
            choose("robot", name, self.loops)
        if lacking := [name for name in self.loops if name not in commands]:
            raise InputError(f"every robot needs a command, {', '.join(lacking)} got none")
        step_together(tuple(self.loops.values()), [commands[name] for name in self.loops])

    def in_world(self, robot: str, point: Sequence[float] | Array) -> Array:
        """Return a point in the world frame of a robot, shape (3,), m, in the world frame of the plant."""
        place: Array = self._places[choose("robot", robot, self._places)].act(
            finite_array("point (m)", point, (3,))
        )
        return place
