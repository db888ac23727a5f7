"""Simulated carrying: a load of unknown mass is handed over to a robot, carried, given back or dropped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.robot import BASE_DOF, GRAVITY, Robot, joints_to
from wbc.core.settings import NonNegative, Positive, Seed, settings
from wbc.robots import load as load_robot
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.sensors import NOISE_PRESETS
from wbc.sim.trial.loop import Trial, TrialHook
from wbc.walking.control import WalkingControl
from wbc.walking.load import LoadSettings, hand_frames
from wbc.walking.planning.footsteps import FootstepPlan
from wbc.walking.planning.reach import Reach
from wbc.walking.settings import WalkingControlSettings

Natural = Annotated[int, Field(ge=0, le=10_000)]
"""A count."""

EMPTY = 2.0
"""Time with empty hands at the start, in which the outside wrench is tared, s."""

IDENTIFIED = 3.0
"""Time from the end of a hand-over until the load must be known, s."""

SPEED = 0.1
"""Commanded forward speed of the steps, m/s."""

HEIGHTS = np.arange(0.0, 0.31, 0.03)
"""Heights of the hands over the CoM that are tried, m."""

PERIOD = 0.005
"""Control period, s."""


@settings(kw_only=True)
class CarrySpec:
    """One simulated carry: hand-overs while standing, steps with the load, and its end.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        load: Mass of the load, as a share of the robot's own; the controller is not told. The controller's estimate
            goes to 0.4.
        hold: hands holds the load in both hands with the arms forward, in equal parts; chest has it on the torso.
        forward: Horizontal distance of the load in front of the middle of the feet, m; hands as far as the arms reach.
        hand_over: Duration of a hand-over, s.
        hand_overs: Number of hand-overs; after each but the last the load is given back.
        steps: Steps with the load, forward, after the last hand-over.
        end: keep leaves the load in the hands, back gives it back, drop lets it fall at once.
        known: Whether the controller looks for a load; without it the load is a disturbance.
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
    """

    robot: str = "hrp4_class"
    load: Annotated[float, Field(ge=0.0, le=0.4)] = 0.2
    hold: Literal["hands", "chest"] = "hands"
    forward: Annotated[NonNegative, "m"] = 0.35
    hand_over: Annotated[Positive, "s"] = 1.0
    hand_overs: Natural = 1
    steps: Natural = 0
    end: Literal["keep", "back", "drop"] = "keep"
    known: bool = True
    noise: str = "realistic"
    seed: Seed = 0

    def __post_init__(self) -> None:
        hand_frames(load_robot(self.robot).robot(), ("torso",) if self.hold == "chest" else ())
        NOISE_PRESETS[self.noise]
        if self.steps and not self.hand_overs:
            raise InputError("steps with a load need at least one hand-over, got hand_overs 0")


@dataclass(frozen=True)
class CarryResult:
    """Result of a carry.

    Attributes:
        robot: Name of the robot.
        upright: True if it never fell.
        stage: Stage of the fall; "done" without one.
        load_kg: Mass of the load.
        forward: Distance of the hands, or of the load on the chest, in front of the middle of the feet, m.
        mass_error: Greatest error of the mass 3 s after a hand-over, as a share of the load.
        place_error_mm: Greatest horizontal error of its place then.
        steps_done: Steps with the load.
        seconds: Simulated time, s.
        failures: Ticks without a solution or with an unusable measurement.
        seed: Seed.
    """

    robot: str
    upright: bool
    stage: str
    load_kg: float
    forward: float
    mass_error: float
    place_error_mm: float
    steps_done: int
    seconds: float
    failures: int
    seed: int


class CarryTrial(Trial):
    """One carry about to begin.

    Attributes:
        spec: The carry.
        plant: The plant.
        walking: The controller.
    """

    def __init__(self, spec: CarrySpec) -> None:
        """Build robot, plant and controller, the arms in front of the robot."""
        self.spec = spec
        description = load_robot(spec.robot)
        robot = description.robot()
        standing = float(robot.com[2])
        chest = spec.hold == "chest"
        q = np.array(robot.half_sitting) if chest else arms_forward(robot, spec.forward, spec.load)
        plant = Plant(
            description,
            control_period=PERIOD,
            noise=spec.noise,
            seed=spec.seed,
            initial_configuration=q,
        )
        robot.update(q, np.zeros(robot.nv))
        self._mass = spec.load * robot.mass
        hands = ("torso",) if chest else ()
        self._frames = hand_frames(robot, hands)
        self._at = np.zeros(3)
        if chest:
            torso = robot.placement(robot.torso_frame)
            self._at = torso.actInv(np.array([spec.forward, 0.0, torso.translation[2] + 0.2]))
        places = [robot.placement(frame).act(self._at) for frame in self._frames]
        self._forward = float(np.mean([place[0] for place in places]))
        settings = WalkingControlSettings(
            com_height=_walkable(robot, standing), load=LoadSettings(hands=hands) if spec.known else None
        )
        super().__init__(plant, WalkingControl(robot, FootstepPlan.standing(robot), PERIOD, settings))
        self._errors = [0.0, 0.0]

    @property
    def walker(self) -> WalkingControl:
        """The controller."""
        walking: WalkingControl = self.walking
        return walking

    def run(self, hooks: Sequence[TrialHook] = ()) -> CarryResult:
        """Carry and return the result.

        Args:
            hooks: Look on.
        """
        spec, plant, walking = self.spec, self.plant, self.walking
        with self.running(hooks):
            stage = self._stages()
        upright = stage == "done"
        return CarryResult(
            robot=spec.robot,
            upright=upright,
            stage=stage,
            load_kg=round(self._mass, 4),
            forward=round(self._forward, 4),
            mass_error=round(self._errors[0], 5),
            place_error_mm=round(1e3 * self._errors[1], 3),
            steps_done=walking.steps_done,
            seconds=round(plant.time, 4),
            failures=walking.control.failures,
            seed=spec.seed,
        )

    def _stages(self) -> str:
        """Go through all stages; return the one of the fall, or "done"."""
        spec, walking = self.spec, self.walking
        if not self.advance(EMPTY):
            return "empty hands"
        for turn in range(spec.hand_overs):
            if turn:
                self._put(0.0, spec.hand_over)
                if not self.advance(spec.hand_over + IDENTIFIED):
                    return f"give-back {turn}"
            self._put(self._mass, spec.hand_over)
            if not self.advance(spec.hand_over + IDENTIFIED):
                return f"hand-over {turn + 1}"
            self._judge()
        if spec.steps:
            walking.velocity = (SPEED, 0.0, 0.0)
            begun = walking.steps_done
            while walking.steps_done - begun < spec.steps - 1:
                if not self.advance(0.1):
                    return "steps"
                if walking.source.reason:
                    return f"steps refused: {walking.source.reason}"
            walking.velocity = None
            if not self.advance(4.0):
                return "steps"
        if spec.end != "keep":
            self._put(0.0, 0.0 if spec.end == "drop" else spec.hand_over)
            if not self.advance(4.0):
                return spec.end
        return "done"

    def _put(self, mass: float, over: float) -> None:
        for frame in self._frames:
            self.plant.load(frame, mass / len(self._frames), over=over, at=self._at)

    def _judge(self) -> None:
        """Compare the estimate with the load that the plant carries."""
        load = self.walking.load
        if load is None or self._mass == 0.0:
            return
        robot = self.plant.robot
        robot.update(self.plant.truth().q, np.zeros(robot.nv))
        true = np.mean([robot.placement(frame).act(self._at) for frame in self._frames], axis=0)
        middle = np.mean([robot.placement(frame).translation for frame in self._frames], axis=0)
        mass, place = self._errors
        mass = max(mass, abs(load.mass / self._mass - 1.0))
        off = (load.place - load.middle) - (true - middle)
        self._errors = [mass, max(place, float(np.hypot(off[0], off[1])))]


def carry(spec: CarrySpec | None = None, **values: Any) -> CarryResult:
    """Simulate a robot that is handed a load of unknown mass.

        result = carry(robot="talos", load=0.2, hand_overs=10, steps=22)

    Args:
        spec: The carry; the default one when None.
        **values: Fields of `CarrySpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, or a robot without hands.
    """
    return CarryTrial(replace(spec or CarrySpec(), **values)).run()


def _walkable(robot: Robot, standing: float) -> float | None:
    """Return the height of the CoM for a walk, m: as the robot stands (None), or that without its arms raised."""
    try:
        Reach.of(robot, float(robot.com[2]))
    except InputError:
        return standing
    return None


@checked
def arms_forward(robot: Robot, forward: float, share: float = 0.2) -> Array:
    """Return half-sitting with both hands in front of the robot, where a load asks least of the arms.

    Args:
        robot: The robot.
        forward: Distance of the hands in front of the middle of the feet, m; as far as the arms reach.
        share: Load of all hands, as a share of the robot's mass.

    Returns:
        Configuration, shape (nq,).
    """
    weight = share * robot.mass * GRAVITY / max(len(robot.frames), 1)
    best, least = np.array(robot.half_sitting), float("inf")
    for height in float(robot.com[2]) + HEIGHTS:
        for apart in (0.0, 0.05):
            q, off = _reach(robot, forward, height, apart)
            cost = max(off - 2e-3, 0.0) * 1e3 + _strain(robot, q, weight)
            if cost < least:
                best, least = q, cost
    return best


def _strain(robot: Robot, q: Array, weight: float) -> float:
    """Return the greatest torque over its limit when each hand bears a weight, N, at rest."""
    model, data = robot.model, robot.model.createData()
    torque = pin.computeGeneralizedGravity(model, data, q)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    joints: set[int] = set()
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        torque += weight * pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[2]
        joints.update(joints_to(model, index))
    places = np.array([model.joints[j].idx_v - BASE_DOF for j in joints])
    return float(np.max(np.abs(torque[BASE_DOF:][places]) / robot.torque_limit[places]))


def _reach(robot: Robot, forward: float, height: float, apart: float) -> tuple[Array, float]:
    """Return a posture with the hands at a place, by damped least squares, and the greatest distance from there, m."""
    model, data = robot.model, robot.model.createData()
    q, worst = np.array(robot.half_sitting), 0.0
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        arm = joints_to(model, index, robot.frame_id(robot.torso_frame))
        columns = np.array([model.joints[j].idx_v for j in arm])
        low, high = (
            robot.position_lower[columns - BASE_DOF] + 0.05,
            robot.position_upper[columns - BASE_DOF] - 0.05,
        )
        pin.framesForwardKinematics(model, data, q)
        side = float(data.oMi[arm[0]].translation[1])
        goal = np.array([forward, side + np.copysign(apart, side), height])
        for _ in range(120):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            error = goal - data.oMf[index].translation
            jacobian = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:3][:, columns]
            inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + 1e-4 * np.eye(3))
            home = robot.half_sitting[columns + 1] - q[columns + 1]
            step = 0.5 * inverse @ error + 0.02 * (home - inverse @ (jacobian @ home))
            q[columns + 1] = np.clip(q[columns + 1] + step, low, high)
        worst = max(worst, float(np.linalg.norm(error)))
    return q, worst
