"""Options of `wbc walk`: robot, foot, ground, plan, gait, gains and pushes, and the spec that they make."""

from __future__ import annotations

import math
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from wbc.app.files import read_object
from wbc.core.changes import read_changes
from wbc.core.control import Mode
from wbc.core.errors import InputError, choose, finite_scalar, shown
from wbc.core.files import csv_rows, read_text
from wbc.core.settings import from_json, settings
from wbc.sim.plant.settings import Machine
from wbc.sim.walks import WalkPlan, WalkPush, WalkSpec
from wbc.sim.walks.settings import Law
from wbc.walking.planning.gait import Gait

STONES_AMPLITUDE = 0.02
"""Height of the stones that are the ground when none is named, m."""

DRIVE_TIME = 3600.0
"""Longest time of a drive from the page, s, unless another one is given."""

DRIVE_COLUMNS = ("time", "forward", "left", "turn")
"""Columns of a file of velocities over time: s, m/s, m/s, rad/s."""


@settings(kw_only=True)
class WalkOptions:
    """Robot, ground and gait of a walk.

    Without any options: 3 m over unknown stones, on soles whose stiffness is set from the scan of each swing foot.

    Attributes:
        robot: Robot: a name that `wbc robots` lists, or a file (MJCF, URDF or TOML).
        foot: Foot under both ankles: flat (the robot's own sole), rigid, soft, long_arch (soft, too), variable (its
            stiffness is set while it swings) or paper (variable from 0 to 80 Nm/rad).
        stiffness: Of the sole hinges of a soft or variable foot, Nm/rad; the foot's own when not given.
        foot_param: Further parameters of the foot, each as name=value.
        policy: Policy that sets soles of variable stiffness while they swing: model, fixed or oracle; the model that
            comes with the library when not given.
        policy_param: Parameters of the policy, each as name=value, such as stiffness=5 or path=model.json; of an oracle
            the stiffness of each family, such as stones=5.
        terrain: Family of grounds, one of those that `wbc terrains` lists; stones of 20 mm when not given.
        amplitude: Highest minus lowest point of the ground, m; the family's own when not given, 20 mm if no ground is
            named either.
        param: Parameters of the ground, each as name=value; also length, width, start, strip, resolution, rendering.
        scene: What stands on the ground, one of those that `wbc scenes` lists.
        scene_param: Parameters of the scene, each as name=value, such as distance=0.6.
        seed: Fixes the ground and the errors of the sensors.
        noise: Errors of the sensors, none or realistic.
        noise_seed: Another seed for the errors of the sensors.
        distance: Distance straight on, m; 3 m when no other plan is given.
        velocity: Walk with a velocity instead: forward (m/s), left (m/s), turn (rad/s); steps are quicker at higher
            speed.
        velocity_file: Walk with velocities over time instead: a CSV file with the columns time (s), forward (m/s),
            left (m/s) and turn (rad/s); the last row is a stand.
        drive: Drive the robot from the live page instead, with arrow keys, the stick or a gamepad; shows the view.
        seconds: Longest time of such a drive, s; it ends with a stand.
        steps: Number of steps with a velocity.
        turn: Turn on the spot instead, to the left, degrees.
        stairs: Climb the stairs of the terrain instead: together (both feet on each stair) or alternate.
        first: Side that steps first.
        law: Gait: lipm plans footsteps and holds them with a stabilizer; stepping decides place and time of each step
            as it goes, for ground that carries at points.
        mode: Command of the drives: position and velocity, torque, or both on soft servos (hybrid).
            When not given: torque if the gait is stepping, else position, or hybrid on soft servos.
        servo: Gains of the servos in place of the description's, each as pattern=kp,kd, such as `*knee*=100,2`.
        machine: Delays, friction, payload and which sensors there are; the delays are stated to the observer.
        control_period: Time between two commands, s; 5 ms in position control, 2 ms in torque and hybrid control when
            not given.
        timestep: Physics step, s; 0.002 with a control period of 0.01 is the fast mode.
        gains: Settings to begin with: default, or legacy for mc_rtc's plain law.
        set: Settings that differ, each as name=value, such as dcm_p=5 or walk.phases.lift_off=0.2.
        push: Pushes on the way, each as impulse=0.2,direction=90,step=5,phase=0.5: Ns/kg, degrees (0 forward, 90
            left), number of the step, share of that step.
        gait: Sizes and timings of steps.
        preset: Options by name: frizza for the paper's walk, mc_rtc's plain law with gains, foot and scan of the paper.
            What is given on the command line or in a file comes before it.
        config: File with some of these options, TOML or JSON, such as swing_height = 0.07; names and values are tables,
            such as dcm_p = 5 under [set]. What is given on the command line comes before it.
        spec: File with the whole walk as JSON, such as an earlier output of --json; takes the place of all of these.
        record: File to write everything to that happens, tick by tick (.arrow).
        profile: Divide the time of the walk, from physics to each task.
    """

    robot: str = WalkSpec.robot
    foot: str = "variable"
    stiffness: float | None = None
    foot_param: tuple[str, ...] = ()
    policy: str | None = None
    policy_param: tuple[str, ...] = ()
    terrain: str | None = None
    amplitude: float | None = None
    param: tuple[str, ...] = ()
    scene: str | None = None
    scene_param: tuple[str, ...] = ()
    seed: int = WalkSpec.seed
    noise: str = WalkSpec.noise
    noise_seed: int | None = None
    distance: float | None = None
    velocity: tuple[float, float, float] | None = None
    velocity_file: Path | None = None
    drive: bool = False
    seconds: float | None = None
    steps: int | None = None
    turn: float | None = None
    stairs: Literal["together", "alternate"] | None = None
    first: Literal["left", "right"] | None = None
    law: Annotated[Law, Parameter(name="--gait")] = WalkSpec.law
    mode: Mode | None = WalkSpec.mode
    servo: tuple[str, ...] = ()
    machine: Machine = field(default_factory=Machine)
    control_period: float | None = None
    timestep: float = WalkSpec.timestep
    gains: str = WalkSpec.gains
    set: tuple[str, ...] = ()
    push: tuple[str, ...] = ()
    gait: Annotated[Gait, Parameter(name="*")] = field(default_factory=Gait)
    preset: str | None = None
    config: Path | None = None
    spec: Path | None = None
    record: Path | None = None
    profile: bool = False

    def walk(self) -> WalkSpec:
        """Return the spec of the walk.

        Raises:
            InputError: A walk that cannot be walked.
        """
        if self.spec is not None:
            return read_spec(self.spec)
        terrain = "stones" if self.terrain is None else self.terrain
        return WalkSpec(
            robot=self.robot,
            foot=self.foot,
            stiffness=self.stiffness,
            foot_changes=tuple(read_changes(self.foot_param).items()),
            policy=self.policy,
            policy_params=tuple(read_changes(self.policy_param).items()),
            terrain=terrain,
            amplitude=STONES_AMPLITUDE if self.terrain is None and self.amplitude is None else self.amplitude,
            terrain_params=tuple(read_changes(self.param).items()),
            scene=self.scene,
            scene_params=tuple(read_changes(self.scene_param).items()),
            seed=self.seed,
            noise=self.noise,
            noise_seed=self.noise_seed,
            mode=self.mode,
            servo=self.servo,
            machine=self.machine,
            control_period=self.control_period,
            timestep=self.timestep,
            plan=WalkPlan(
                distance=self.distance,
                velocity=self.velocity,
                drive=self._rows(),
                steps=self.steps,
                turn=None if self.turn is None else math.radians(self.turn),
                stairs=self.stairs,
                first=self.first,
            ),
            gait=self.gait,
            law=self.law,
            gains=self.gains,
            changes=tuple(read_changes(self.set).items()),
            pushes=tuple(read_push(text) for text in self.push),
        )

    def _rows(self) -> tuple[tuple[float, float, float, float], ...] | None:
        """Return the velocities over time; None for another plan."""
        if self.seconds is not None and not self.drive:
            raise InputError("seconds belong to a drive; give --drive as well")
        if self.velocity_file is not None:
            if self.drive:
                raise InputError("give either --drive or --velocity-file")
            return read_drive(self.velocity_file)
        if not self.drive:
            return None
        end = (
            DRIVE_TIME if self.seconds is None else finite_scalar("seconds of a drive", self.seconds, low=0.1)
        )
        return ((end, 0.0, 0.0, 0.0),)


def read_spec(path: Path) -> WalkSpec:
    """Return the walk in a file: a spec, or the output of `wbc walk --json`, which contains it.

    Raises:
        InputError: The file cannot be read, or holds no walk.
    """
    data = read_object("walk", path)
    spec = data.get("spec")
    if spec is not None and not isinstance(spec, dict):
        raise InputError(f"spec in {path} must be an object, got {shown(spec)}")
    return WalkSpec.from_json(data if spec is None else spec)


def read_drive(path: Path) -> tuple[tuple[float, float, float, float], ...]:
    """Return the velocities over time in a CSV file, by the columns of `DRIVE_COLUMNS` in any order.

    Raises:
        InputError: The file cannot be read, a column is unknown or missing, or a value is no finite number.
    """
    lines = csv_rows(read_text(path, "CSV file"), path)
    if not lines:
        raise InputError(f"{path} is empty; it has the columns {', '.join(DRIVE_COLUMNS)}")
    names = [name.strip() for name in lines[0]]
    for name in names:
        choose(f"column of {path}", name, DRIVE_COLUMNS)
    if sorted(names) != sorted(DRIVE_COLUMNS):
        raise InputError(
            f"{path} has each of the columns {', '.join(DRIVE_COLUMNS)} once, got {', '.join(names)}"
        )
    rows = []
    for i, line in enumerate(lines[1:], start=2):
        if len(line) != len(names):
            raise InputError(f"row {i} of {path} has {len(line)} values for {len(names)} columns")
        values = {}
        for name, text in zip(names, line, strict=True):
            try:
                values[name] = finite_scalar(f"{name} in row {i} of {path}", float(text))
            except ValueError:
                raise InputError(
                    f"{name} in row {i} of {path} must be a finite number, got {shown(text)}"
                ) from None
        rows.append((values["time"], values["forward"], values["left"], values["turn"]))
    return tuple(rows)


def read_push(text: str) -> WalkPush:
    """Return the push of a text such as impulse=0.2,direction=90,step=5,phase=0.5; the direction in degrees.

    Raises:
        InputError: Not of that form, or a value out of range.
    """
    values: dict[str, Any] = dict(read_changes(text.split(",")))
    if "direction" in values:
        values["direction"] = math.radians(
            finite_scalar("direction of a push (degrees)", values["direction"])
        )
    return from_json(WalkPush, values)
