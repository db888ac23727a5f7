"""Ground as one robot knows it: clouds and maps placed by its estimate, with the doubts about them.

    ground.add(cloud)                    whenever one comes
    ground.update(robot, time)           in every tick: the pose is remembered, what has come is fused
    ground.stand(stance, placement)      at every lift-off: what is known is compared with the sole that stands
    ground.support(swing, x, y, yaw)     None where nothing is known, or what is known is doubted

Knowledge that is old, of another frame, or that contradicts the sole that stands is not used, and `status` says so: a
walk is then as blind as without it.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.frames import heading
from wbc.core.limits.obstacles import RoundShape
from wbc.core.robot import Robot
from wbc.ground.body import OwnBody
from wbc.ground.cloud import SEEN, WORLD, ElevationMap, PointCloud, spread
from wbc.ground.footprint import Cost, Footprint, FootprintSettings, Support
from wbc.ground.height_map import HeightMap, HeightMapSettings, Places

logger = logging.getLogger(__name__)

POSES = 512
"""Number of poses that are remembered, over the greatest age of a cloud: every tick down to 1 ms for 0.5 s, and every
second one at 0.5 ms."""

AHEAD = 0.02
"""Time by which a cloud, or a map that grows old, may be ahead of the measurement, s: two clocks that nearly agree."""

FUSED = 0.02
"""Least time between two changes of what is known, s: readings that come faster are fused together."""

WAITING = 64
"""Number of clouds that may wait for a tick; with more the oldest are dropped."""

MOST = 2000
"""Number of points near the robot that one tick fuses, in up to 2 ms. Of more a part is taken, another one from each
cloud. The map has as many cells on 0.8 m²."""

WAY = np.array([0.2, 0.4, 0.6, 0.8])
"""Shares of the way of a swing at which the ground under the sole is looked at."""


@settings
class GroundSettings:
    """Settings of the known ground.

    Attributes:
        map: Heights on cells.
        footprint: Choice of a landing on known ground.
        max_age: Age of a cloud from which on it is not used, s.
        contradiction: Difference between the sole that stands and the known ground below it from which on nothing of
            that ground is used, m.
        stance: Share of the difference between the sole that stands and the known ground below it by which the known
            heights are shifted, if the difference is below `contradiction` and no frame of points has shifted them.
        stance_step: Greatest shift by the sole that stands, m.
        own_margin: Distance from the robot's own shapes up to which a point is one of its body, m.
    """

    map: HeightMapSettings = field(default_factory=HeightMapSettings)
    footprint: FootprintSettings = field(default_factory=FootprintSettings)
    max_age: Annotated[Positive, "s"] = 0.5
    contradiction: Annotated[Positive, "m"] = 0.06
    stance: Share = 0.7
    stance_step: Annotated[NonNegative, "m"] = 0.02
    own_margin: Annotated[NonNegative, "m"] = 0.03


class KnownGround:
    """Knowledge of one robot about the ground.

    Attributes:
        settings: Its `GroundSettings`.
        map: Heights around the robot, from clouds of points.
        elevation: Map given by the user, for places that the robot has not seen; None without a map.
        doubts: Kind of knowledge that is not used ("cloud", "map" or "stance") → reason.
        version: Number of changes so far of the knowledge.
        difference: Known height of the ground under the stance foot minus the height of its sole, at the last lift-off,
            m; NaN if unknown.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        settings: GroundSettings | None = None,
        shapes: Mapping[str, Sequence[RoundShape]] | None = None,
    ) -> None:
        """Start without knowledge; the robot stands where the walk begins, and gives the names and soles.

        Shapes are link → spheres and capsules of the robot's body, as returned by `RobotDescription.collision_shapes`.
        Points on them and on the feet are left out. None if the clouds contain no points on the robot.
        """
        if not robot.soles:
            raise InputError(f"a KnownGround needs a robot with soles, '{robot.name}' has none")
        self.settings = s = settings or GroundSettings()
        base = robot.placement(robot.base_frame)
        yaw = heading(base.rotation)
        self.map = HeightMap(s.map, (float(base.translation[0]), float(base.translation[1]), yaw))
        self.elevation: ElevationMap | None = None
        self.doubts: dict[str, str] = {}
        self.difference = math.nan
        self.version = 0
        self._footprints = [Footprint(sole.length, sole.width, s.footprint) for sole in robot.soles]
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._names = tuple(sole.name for sole in robot.soles)
        self._longest = max(sole.length for sole in robot.soles)
        low = min(float(robot.placement(sole.frame).translation[2]) for sole in robot.soles)
        self._leg = float(robot.com[2]) - low  # no foot steps higher or lower
        self._model, self._data = robot.model, robot.model.createData()
        self._times, self._poses = np.full(POSES, -np.inf), np.zeros((POSES, robot.nq))
        self._newest, self._spacing = 0, s.max_age / (POSES - 2)  # least time between poses, s
        self._waiting: list[PointCloud] = []
        self._clouds = 0  # so far
        self._raised = 0.0  # of the user's map, m
        self._moved = False  # by a frame, since the last lift-off
        self._time = self._fused = -math.inf
        self._body = None if shapes is None else OwnBody(robot, shapes, s.own_margin)
        self._placed_at = math.nan  # time of the pose of which `_data` is up to date, s

    @property
    def status(self) -> str:
        """Reasons why knowledge is not used; empty if all of it is used."""
        return "; ".join(self.doubts.values())

    def check_robot(self, robot: Robot) -> None:
        """Raise an `InputError` for a robot that is not of the description with whose robot the knowledge was made."""
        if list(robot.model.names) != list(self._model.names):
            raise InputError(
                f"a KnownGround must be made with the robot that walks by it, '{robot.name}', not with "
                f"'{self._model.name}'"
            )

    def add(self, seen: PointCloud | ElevationMap) -> None:
        """Take a cloud, which is fused in the next tick, or a map, which replaces the last map unless it is the same.

        Args:
            seen: Cloud, or map that is larger than a sole. It is not used if it is too old or in an unknown frame;
                `status` then has the reason.
        """
        if isinstance(seen, PointCloud):
            self._clouds += 1
            self._waiting.append(seen)
            del self._waiting[:-WAITING]
        elif seen is self.elevation:
            return
        elif isinstance(seen, ElevationMap):
            size = min(seen.heights.shape) * seen.cell
            if size < self._longest:
                raise InputError(
                    f"a map of the ground must be larger than a sole, {self._longest:g} m, got one of {size:g} m"
                )
            self.elevation, self._raised = seen, 0.0
            self._doubt("map", self._why_not(seen))
            self.version += 1
        else:
            raise InputError(f"a KnownGround takes a PointCloud or an ElevationMap, got {shown(seen)}")

    def update(self, robot: Robot, time: float) -> None:
        """Store the pose of the estimated robot at a time of its measurements, s, and fuse the new clouds."""
        self._remember(robot.q, time)
        if self._waiting and time >= self._fused + FUSED - ROUNDING:
            self._fused = time
            waiting, self._waiting = self._waiting, []
            self._fuse(waiting)
            self.version += 1
        if self.elevation is not None:
            self._doubt("map", self._why_not(self.elevation))

    def stand(self, side: int, placement: pin.SE3) -> None:
        """Compare the known ground with the stance sole (0 left, 1 right) at its placement in the world.

        If they contradict each other, the knowledge is not used until the next comparison. Otherwise it is shifted by a
        share of the difference, unless a frame of points has shifted it since the last comparison.
        """
        s = self.settings
        over, most, inside = self._footprints[side].over(self.at, placement.translation, placement.rotation)
        self.difference = over
        off = max(inside, 0.0) + min(most, 0.0)  # depth of the sole in the ground, or height over it
        if abs(off) > s.contradiction:
            name = self._names[side]
            self._doubt("stance", f"the ground known under the {name} sole is {off:+.3f} m from it")
            return
        self._doubt("stance", "")
        if not self._moved and math.isfinite(over):
            shift = -s.stance * min(max(over, -s.stance_step), s.stance_step)
            self.map.shift(shift)
            self._raised += shift
            self.version += 1
        self._moved = False

    def support(self, side: int, x: float, y: float, yaw: float) -> Support | None:
        """Return the ground under a sole (0 left, 1 right) at a place in the world, m and rad; None if unknown."""
        if "stance" in self.doubts:
            return None
        return self._footprints[side].support(self.at, x, y, yaw)

    def best(
        self,
        side: int,
        x: float,
        y: float,
        yaw: float,
        allowed: Callable[[float, float], bool],
        cost: Cost | None = None,
    ) -> Support | None:
        """Return the ground at the best place near a given one; None if it is unknown.

        Only places (x, y) that are `allowed` are tried. The `cost` of a move is added to that of its distance.
        """
        if "stance" in self.doubts:
            return None
        return self._footprints[side].best(self.at, x, y, yaw, allowed, cost)

    def highest(self, side: int, start: Array, end: Array, yaw: float) -> float:
        """Return the largest height of the ground, m, under a sole on its way between two places; −inf if unknown.

        Places in the world have shape (2,) or (3,), m; the sole, 0 left, 1 right, has a heading, rad.
        """
        if "stance" in self.doubts:
            return -math.inf
        a, b = complex(start[0], start[1]), complex(end[0], end[1])
        return self._footprints[side].highest(self.at, a + (b - a) * WAY, yaw)

    def _remember(self, q: Array, time: float) -> None:
        """Remember the pose of a tick: in place of the last one, if that is too near to the one before it."""
        if time < self._time:  # the clock has started anew
            self._times[:], self._fused = -np.inf, -math.inf
            self.map.rewind(time)
        self._time = time
        if self._times[self._newest] >= self._times[self._newest - 1] + self._spacing - ROUNDING:
            self._newest = (self._newest + 1) % POSES
        self._times[self._newest], self._poses[self._newest] = time, q
        self._placed_at = math.nan

    def _pose(self, time: float) -> Array:
        """Return the configuration at a time, s: between the two poses about it, or the first or the last one."""
        since, known = self._times - time, self._times > -np.inf
        before = int(np.argmax(np.where(known & (since <= 0.0), since, -np.inf)))
        after = int(np.argmin(np.where(known & (since >= 0.0), since, np.inf)))
        if not (known[before] and since[before] <= 0.0):
            before = after
        if not (known[after] and since[after] >= 0.0):
            after = before
        way = self._times[after] - self._times[before]
        if way <= 0.0:
            return np.asarray(self._poses[before])
        share = -since[before] / way
        return np.asarray(pin.interpolate(self._model, self._poses[before], self._poses[after], share))

    def at(self, places: Places) -> tuple[Array, Array]:
        """Return heights, NaN where unknown, and standard deviations, m, in the shape of the places x + iy, m."""
        z, std = self.map.at(places)
        unknown = np.isnan(z)
        std[unknown] = 0.0
        if self.elevation is not None and "map" not in self.doubts:
            z[unknown] = self.elevation.heights_at(places[unknown]) + self._raised
        return z, std

    def _doubt(self, what: str, why: str) -> None:
        if why:
            if what not in self.doubts:
                logger.warning("not used: %s", why)
            self.doubts[what] = why
        else:
            self.doubts.pop(what, None)

    def _fuse(self, clouds: list[PointCloud]) -> None:
        """Fuse clouds, without those that cannot be used: the newest as one frame, after those that came late."""
        newest, why = max(cloud.time for cloud in clouds), ""
        total = sum(len(cloud.points) for cloud in clouds)
        frames: dict[bool, list[tuple[float, Array]]] = {True: [], False: []}  # late, and not
        for cloud in clouds:
            points, doubt = self._placed(cloud, len(cloud.points) / max(total, 1))
            why = doubt or why
            if len(points):
                frames[cloud.time < newest - FUSED].append((cloud.time, points))
        self._doubt("cloud", why)
        for frame in frames.values():
            if not frame:
                continue
            points = np.concatenate([part for _, part in frame])
            shift = self.map.add(points[:, :3], points[:, 3], max(time for time, _ in frame))
            if shift is not None:
                self._moved = True
                self._raised += shift

    def _placed(self, cloud: PointCloud, share: float) -> tuple[Array, str]:
        """Return the points of a cloud near the robot, with their standard deviations, in the world, shape (n, 4), m.

        There are at most a share of `MOST`. The text is the reason for which there are none.
        """
        none = np.empty((0, 4))
        age = self._time - cloud.time
        if not -AHEAD <= age <= self.settings.max_age:
            return none, f"a cloud in {shown(cloud.frame)} is {_age(age)}"
        if cloud.time != self._placed_at:
            self._placed_at = cloud.time
            pin.framesForwardKinematics(self._model, self._data, self._pose(cloud.time))
        looked, most = math.ceil(share * SEEN), math.ceil(share * MOST)
        chosen = spread(len(cloud.points), looked, self._clouds)
        points, std = cloud.points[chosen], np.asarray(cloud.std)[chosen]
        if cloud.frame != WORLD:
            if not self._model.existFrame(cloud.frame):
                return none, f"a cloud is in {shown(cloud.frame)}, which is no frame of the robot"
            sensor = self._data.oMf[self._model.getFrameId(cloud.frame)]
            points = points @ sensor.rotation.T + sensor.translation
        if not len(points):
            return none, ""
        middle = np.mean([self._data.oMf[sole].translation for sole in self._soles], axis=0)
        near = self.map.holds(points[:, 0] + 1j * points[:, 1], complex(middle[0], middle[1]))
        near &= np.abs(points[:, 2] - middle[2]) < self._leg
        if not near.any():
            far = float(np.median(np.abs(points - middle).max(axis=1)))
            cloud_is = f"a cloud in {shown(cloud.frame)} is"
            why = f"{cloud_is} beyond the legs' reach, {far:.4g} m away (are its units metres?)"
            return none, why
        kept = np.flatnonzero(near)
        kept = kept[spread(len(kept), most, self._clouds)]
        points, std = points[kept], std[kept]
        if self._body is not None:
            off = self._body.off(self._data, points)
            points, std = points[off], std[off]
        return np.column_stack([points, std]), ""

    def _why_not(self, elevation: ElevationMap) -> str:
        """Return the reason for which the user's map is not used; empty for one that is."""
        age = self._time - elevation.time if math.isfinite(self._time) else 0.0  # before the first pose
        if elevation.frame != WORLD:
            return f"the map of the ground is in {shown(elevation.frame)}, not in that of the estimate, '{WORLD}'"
        if age > elevation.max_age or (-math.inf < age < -AHEAD and math.isfinite(elevation.max_age)):
            return f"the map of the ground is {_age(age)}"
        if elevation.unknown:
            return "the map of the ground has no heights"
        return ""


def _age(age: float) -> str:
    """Return an age, s, as text; a negative one comes from another clock."""
    return f"{age:.4g} s old" if age >= 0.0 else f"{-age:.4g} s ahead of the measurements: another clock?"
