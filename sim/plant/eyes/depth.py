"""Depth camera on a link: rays against everything in the simulation, with the errors of a real camera."""

from __future__ import annotations

import math
from typing import Annotated, Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Angle, NonNegative, Positive, Share, settings
from wbc.ground import PointCloud
from wbc.robots.mechanism import placement_of
from wbc.sim.plant.link_geoms import PLAIN, SHAPE_GROUP, add_visual
from wbc.sim.plant.model import bare_spec, compiled, equip, surround
from wbc.sim.plant.places import RobotPlaces, body_frame

SOLE_HEIGHT = 0.02
"""Height of a sole as the camera sees it, m: that of the soft soles' phalanges, and a little more."""

LOW = 0.5
"""Height of the base's origin over that of the CoM, in half-sitting, below which it lies on the ground."""

LEAST_STD = 5e-4
"""Least standard deviation that a cloud states, m: that of a camera without errors."""


@settings
class DepthCamera:
    """Depth camera that looks at the ground ahead of the feet.

    Directions are those of the robot in half-sitting, not those of its links: x forward, y to the left, z up.

    Attributes:
        link: Link or frame that carries the camera; the base when None.
        at: Position of the camera relative to the origin of that link, m. If the base is on the ground
            (`base_footprint`), it is relative to the point above the base at the height of the CoM.
        turn: Roll, pitch and yaw of the camera, which looks along its x axis, rad; with a positive pitch it looks down.
        rays: Number of rays, horizontally and vertically.
        view: Field of view, horizontally and vertically, rad.
        nearest: Shortest distance seen, m.
        furthest: Longest distance seen, m.
        rate: Frames per second, Hz.
        latency: Time from a frame until its cloud is delivered, s.
        noise: Standard deviation of a distance, m.
        relative_noise: Part of the standard deviation that grows with the distance, m/m.
        dropout: Share of the rays that return nothing.
        misplaced: Difference of the true position of the camera from `at`, m.
        end: Time at which the camera fails, s; None for never.
        ghost: Block that the camera sees but that does not exist: x and y of its centre in the world, half its side
            length, and its height over the ground, m.
    """

    link: str | None = None
    at: Annotated[tuple[float, float, float], "m"] = (0.075, 0.0, 0.05)
    turn: Annotated[tuple[Angle, Angle, Angle], "rad"] = (0.0, 0.925, 0.0)
    rays: tuple[Annotated[int, Field(ge=2, le=640)], Annotated[int, Field(ge=2, le=480)]] = (40, 28)
    view: Annotated[tuple[Positive, Positive], "rad"] = (1.05, 0.84)
    nearest: Annotated[NonNegative, "m"] = 0.2
    furthest: Annotated[Positive, "m"] = 3.0
    rate: Annotated[Positive, "Hz"] = 12.5
    latency: Annotated[NonNegative, "s"] = 0.05
    noise: Annotated[NonNegative, "m"] = 0.003
    relative_noise: NonNegative = 0.005
    dropout: Share = 0.01
    misplaced: Annotated[tuple[float, float, float], "m"] = (0.0, 0.0, 0.0)
    end: Annotated[NonNegative, "s"] | None = None
    ghost: Annotated[tuple[float, float, NonNegative, float], "m"] | None = None

    def __post_init__(self) -> None:
        if max(self.view) >= math.pi:
            raise InputError(f"view of a camera (rad) must be below {math.pi:.4g}, got {self.view}")
        if self.nearest >= self.furthest:
            raise InputError(f"furthest (m) must exceed nearest, {self.nearest:g}, got {self.furthest:g}")

    def start(self, plant: Any) -> DepthView:
        """Return the camera mounted on the robot of a plant.

        Raises:
            UnknownNameError: No such link.
            InputError: The camera sees no ground from the place where the robot stands.
        """
        model = visible_model(plant)
        places = RobotPlaces(model, plant.robot, feet=[foot.body for foot in plant.feet])
        view = DepthView(self, places, plant.data)
        view.look_out()
        if not view._cast().any():
            raise InputError(
                f"the depth camera on '{view.frame}' sees no ground within {self.furthest:g} m: "
                f"turn it (roll, pitch, yaw {self.turn} rad) or move it ({self.at} m)"
            )
        return view


def visible_model(plant: Any) -> mujoco.MjModel:
    """Return the model of a plant with the shapes of its links and soles, which hide the ground."""
    spec = bare_spec(plant.description)
    plant.physics.apply(spec)
    feet = equip(spec, plant.description, plant.robot, plant.foot, plant.machine, hands=False, shapes=True)
    for foot in feet:
        site, sole = spec.site(foot.wrench_site), foot.fit.sole
        size = [0.5 * sole.length, 0.5 * sole.width, 0.5 * SOLE_HEIGHT]
        place = placement_of(site.pos + [0.0, 0.0, 0.5 * SOLE_HEIGHT], site.quat)
        add_visual(site.parent, mujoco.mjtGeom.mjGEOM_BOX, size, place, PLAIN)
    for geom in spec.geoms:
        if geom.group == SHAPE_GROUP:
            geom.rgba[3] = 1.0  # rays pass through what cannot be seen
    things = None if plant.scene is None else mujoco.MjSpec.from_string(plant.scene)
    surround(spec, plant.terrain, things)
    return compiled(spec, plant.description.name)


class DepthView:
    """Depth camera on a robot; it sees the geometry of a MuJoCo model."""

    @checked
    def __init__(self, camera: DepthCamera, places: RobotPlaces, data: mujoco.MjData) -> None:
        """Mount the camera on the robot of `places`, in their model; positions are those of `data`.

        A link that the robot does not have is an `UnknownNameError`, data of another model are an `InputError`.
        """
        robot = places.robot
        if data.qpos.size != places.model.nq:
            raise InputError(
                f"data of a DepthView must be of the model with nq {places.model.nq}, got nq {data.qpos.size}"
            )
        self.camera, self.frame = camera, body_frame(camera.link or robot.base_frame, robot)
        body, place = places.carrier(self.frame)
        self._body, self._place = body, place
        self._model, self._source, self._data = places.model, data, mujoco.MjData(places.model)
        self._own = places.of_robot[places.model.geom_bodyid]
        half_sitting = robot.model.createData()
        pin.framesForwardKinematics(robot.model, half_sitting, robot.half_sitting)
        axes = half_sitting.oMf[robot.frame_id(self.frame)].rotation.T  # of the robot, in the frame
        (columns, rows), (across, down) = camera.rays, camera.view
        a, b = np.meshgrid(np.linspace(0.5, -0.5, columns) * across, np.linspace(0.5, -0.5, rows) * down)
        rays = np.stack([np.ones(a.size), np.tan(a).ravel(), np.tan(b).ravel()], axis=1)  # a pin-hole
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        self._rays = rays @ (axes @ pin.rpy.rpyToMatrix(*camera.turn)).T
        at = np.array(camera.at)
        if camera.link is None:
            com = float(pin.centerOfMass(robot.model, half_sitting, robot.half_sitting)[2])
            base = float(half_sitting.oMf[robot.frame_id(self.frame)].translation[2])
            at[2] += com - base if base < LOW * com else 0.0
        self._at = axes @ at
        self._true = self._at + axes @ np.array(camera.misplaced)
        self._hit, self._distance = np.zeros(len(rays), np.int32), np.zeros(len(rays))
        self.reset(0)

    def look_out(self) -> None:
        """Make the shapes of the camera's link, and others that contain the camera, transparent.

        This is needed because the bounding box of a mesh is larger than the link, and may contain the camera.
        """
        model, data, (place, _) = self._model, self._data, self._pose()
        turns = data.geom_xmat.reshape(-1, 3, 3)
        inside = np.einsum("nji,nj->ni", turns, place - data.geom_xpos) - model.geom_aabb[:, :3]
        holds = (np.abs(inside) <= model.geom_aabb[:, 3:]).all(axis=1) | (model.geom_bodyid == self._body)
        model.geom_rgba[self._own & holds, 3] = 0.0

    def reset(self, seed: int) -> None:
        """Restart the sensor errors with a seed."""
        self._random = np.random.default_rng(seed)

    def clouds(self, time: float) -> list[PointCloud]:
        """Return the points of one frame at a time, s; empty once the camera has failed."""
        c = self.camera
        if c.end is not None and time >= c.end:
            return []
        seen, distance = self._cast(), self._distance
        std = c.noise + c.relative_noise * distance
        seen &= self._random.random(len(seen)) >= c.dropout
        measured = distance + std * self._random.standard_normal(len(seen))
        points = self._at + self._rays[seen] * measured[seen, None]
        if c.ghost is not None:
            place, rotation = self._pose()
            x, y, half, height = c.ghost
            off = (self._rays[seen] * distance[seen, None] @ rotation.T + place)[:, :2] - (x, y)
            points += np.where((np.abs(off) < half).all(axis=1), height, 0.0)[:, None] * rotation[2]
        return [PointCloud(points, time, self.frame, np.maximum(std[seen], LEAST_STD))]

    def _pose(self) -> tuple[Array, Array]:
        """Return the true place of the camera and the rotation of its frame to the world, as the robot is now."""
        model, data = self._model, self._data
        data.qpos[:] = self._source.qpos
        mujoco.mj_kinematics(model, data)
        link = data.xmat[self._body].reshape(3, 3)
        rotation = link @ self._place.rotation
        return data.xpos[self._body] + link @ self._place.translation + rotation @ self._true, rotation

    def _cast(self) -> NDArray[np.bool_]:
        """Cast all rays from the camera as it is now; True for those that meet the ground within range."""
        model, data, c = self._model, self._data, self.camera
        place, rotation = self._pose()
        rays, hit, distance = (self._rays @ rotation.T).ravel(), self._hit, self._distance
        mujoco.mj_multiRay(
            model, data, place, rays, None, True, -1, hit, distance, None, hit.size, c.furthest
        )
        seen: NDArray[np.bool_] = (
            (hit >= 0) & ~self._own[hit] & (distance > c.nearest) & (distance < c.furthest)
        )
        return seen
