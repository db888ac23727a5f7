"""Spec of one simulated walk: everything that decides its result, checked before anything starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

from pydantic import PlainValidator

from wbc.base.errors import InputError, shown
from wbc.base.files import file_of, stamped_file
from wbc.base.settings import Angle, Changes, NonNegative, Number, Seed, as_changes, settings
from wbc.core.drive.control import Mode
from wbc.feet import Foot
from wbc.feet.soles.catalog import changed_foot, foot_changes
from wbc.policy.joints import policy_columns
from wbc.robots import load
from wbc.robots.registry import stamped
from wbc.sim.plant.places import body_frame
from wbc.sim.scenes.base import Scene, make_scene
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as terrain_by_name
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.spec import TrialSpec
from wbc.sim.walks.plan import WalkPlan, fitted
from wbc.sim.walks.prepare import PreparedWalk, prepare
from wbc.sim.walks.settings import Eyes, WalkTrialSettings, checked_changes, trial_settings
from wbc.sim.walks.stiffness_policy import checked_policy
from wbc.sim.walks.trained import described, driven, sees
from wbc.walking.plans.gait import Gait


def _named_values(values: Any) -> Changes:
    """Return a mapping, or pairs in Python, as sorted pairs; JSON has no pairs."""
    if not isinstance(values, (Mapping, tuple)):
        raise ValueError(f"must be an object of names and values, got {shown(values)}")
    return as_changes(values)


NamedValues = Annotated[Changes, PlainValidator(_named_values)]
"""Names and values: a mapping when given, sorted pairs in the spec, an object in JSON."""

TOE_GAIT = Gait(landing_time=0.25, apex=0.45)
"""Gait of a robot that sees with its toes: a foot is over its landing before it sinks, so that it has been seen."""

SEED_LIMIT = 2**63
"""Seeds are below it: they fit into a signed integer of 64 bits, as tables of results have them."""

SOURCE = "source"
"""Parameter of a ground for the file that it is read from."""

RAMP_NAME = "ramp"
"""Parameter of a ground for the length of its ramp: always in a written spec."""


@settings(kw_only=True, eq=False)
class WalkSpec(TrialSpec):
    """Specification of one simulated walk: robot, feet, ground, sensors, steps, pushes and seeds.

    Equal specs give equal records, bit for bit. A spec is small, hashable and readable as JSON. If it names a file (of
    a robot, "path" of a policy, "source" of a ground), the written name ends with "#" and the hash of its content.

    Attributes:
        stiffness: Stiffness of soft or variable soles, Nm/rad; the default of the foot if not given.
        foot_changes: Further parameters of the foot, such as contact.row_spacing.
        policy: Stiffness policy of variable soles, not a trained policy (`trained`): model, fixed, oracle, or a
            registered one. `stiffness` is then the stiffness at the start.
        policy_params: Parameters of the policy, such as stiffness=5 (fixed), path=model.json (model) or stones=5
            (oracle).
        terrain: Family of grounds that `wbc terrain` lists.
        amplitude: Highest minus lowest point of the ground, m.
        terrain_params: Parameters of the family of grounds, and of every ground: length, width, start, strip, ramp,
            floor_stiffness, floor_damping, areas.
        scene: Furniture, or ground that moves: a scene that `wbc terrain` lists.
        scene_params: Parameters of the scene.
        seed: Seed of the ground and of the sensor errors.
        noise_seed: Separate seed for the sensor errors; `seed` if not given.
        mode: Kind of drive commands. If not given: hybrid for soft servos, torque for a velocity that planned steps do
            not reach, else position. Steps are planned in position control, and free in torque and hybrid control.
        machine: Delays, friction, payload, and which sensors exist. The observer knows the delays, unless the settings
            have other ones ("observer.command_delay").
        plan: Distance, velocity, turn, stairs, footsteps or velocities over time.
        gait: Sizes and timings of planned steps.
        eyes: Sensors by which the robot sees the ground: none, depth (a camera) or toes (range sensors).
        gains: Preset of settings: default; frizza, the law of the paper; or no_bias, the law of the paper without the
            estimate of the bias.
        changes: Settings that differ from the preset; see `wbc.sim.walks.settings.WalkTrialSettings`.
        start: Pose of the robot at the start: x (m), y (m) and heading (rad).
        pushes: Pushes during the walk.
        trained: ONNX file of a trained policy that walks in torque control in place of the library's steps, such as
            walk.onnx; its description is in its metadata, or in walk.toml beside it.
        guarded: Put a guard beside the trained policy: the library's steps take over where it fails.
    """

    kind: ClassVar[str] = "walk"

    noise: str = "realistic"
    stiffness: Annotated[NonNegative, "Nm/rad"] | None = None
    foot_changes: NamedValues = ()
    policy: str | None = None
    policy_params: NamedValues = ()
    terrain: str = "flat"
    amplitude: Annotated[NonNegative, "m"] | None = None
    terrain_params: NamedValues = ()
    scene: str | None = None
    scene_params: NamedValues = ()
    noise_seed: Seed | None = None
    plan: WalkPlan = field(default_factory=WalkPlan)
    gait: Gait = field(default_factory=Gait)
    eyes: Eyes = "none"
    gains: str = "default"
    changes: NamedValues = ()
    start: Annotated[tuple[Number, Number, Angle], "m, m, rad"] = (0.0, 0.0, 0.0)
    pushes: tuple[WalkPush, ...] = ()
    trained: str | None = None
    guarded: bool = False

    def __post_init__(self) -> None:
        """Check the fields and put them into the normal form: each part by those before it."""
        self._keep(robot=stamped(self.robot))
        load(self.robot).needs_feet("a walk")
        if self.trained is not None:
            self._keep(trained=self._check_trained(stamped_file(self.trained, "policy", ".toml")))
        elif self.guarded:
            raise InputError("a guard is for a trained policy: give trained, too")
        super().__post_init__()
        if max(self.seed, self.noise_seed or 0) >= SEED_LIMIT:
            raise InputError(
                f"a seed must be below 2**63, got seed {self.seed} and noise_seed {self.noise_seed}"
            )
        self._keep(
            foot_changes=foot_changes(self.foot, self.foot_changes),
            changes=checked_changes(self.gains, self.changes),
        )
        self.settings()
        self._keep(terrain_params=_as_used(self.ground(), self.terrain_params))
        if self.scene is None and self.scene_params:
            raise InputError(f"parameters of a scene need a scene; got {dict(self.scene_params)}")
        self.things()
        _, parameters = self.scheduling
        if self.policy is not None or self.policy_params:
            self._keep(policy_params=parameters)
        self._check_pushes(self.prepare())

    def _keep(self, **normal: Any) -> None:
        """Keep fields in their normal form, in which equal walks are equal specs."""
        for name, value in normal.items():
            object.__setattr__(self, name, value)

    def _check_pushes(self, prepared: PreparedWalk) -> None:
        """Refuse pushes on what the robot has not, and those that come after the walk."""
        steps = len(prepared.plan)
        for push in self.pushes:
            body_frame(push.body, prepared.robot())
            if push.step is not None and push.step > steps > 0 and self.plan.drive is None:
                raise InputError(f"a push at step {push.step} of a walk of {steps} steps")
            if push.time is not None and push.time >= prepared.time_limit:
                raise InputError(
                    f"a push at {push.time:g} s comes after the walk, which ends by {prepared.time_limit:g} s"
                )

    def _check_trained(self, name: str) -> str:
        """Return the name of a policy with its hash; `InputError` for a walk or with a robot that it cannot do."""
        policy_columns(load(self.robot).robot(), described(name).joints)
        driven(self.plan)
        for field_, is_, rule in (
            ("mode", self.mode not in (None, "torque"), "torque: its gains and targets are its own"),
            ("eyes", self.eyes != "none" and not sees(name), "none: it does not see the ground"),
            ("eyes", self.eyes == "none" and sees(name), "depth or toes: it sees the ground"),
            ("gait", bool(self.gait.given), "left out: its gait is its own"),
        ):
            if is_:
                raise InputError(
                    f"{field_} of a walk by a trained policy must be {rule}, got {shown(getattr(self, field_))}"
                )
        return name

    def _usual_mode(self) -> Mode | None:
        """See `TrialSpec`."""
        return None if self.trained is None else "torque"

    @cached_property
    def scheduling(self) -> tuple[str | None, Changes]:
        """Stiffness policy of variable soles with its parameters, by default the library's; None for other soles."""
        timing = self.settings().stiffness
        return checked_policy(self.foot_design(), self.policy, self.policy_params, timing, self.ground())

    def _wanted(self) -> dict[str, object]:
        """See `TrialSpec`."""
        wanted = super()._wanted()
        if self.terrain != "flat":
            wanted["terrain"] = self.terrain
        if self.scene is not None:
            wanted["scene"] = self.scene
        if self.eyes != "none":
            wanted["eyes"] = self.eyes
        if changed_physics := [name for name, _ in self.changes if name.partition(".")[0] == "physics"]:
            wanted["physics"] = changed_physics[0]
        return wanted

    @property
    def free(self) -> bool:
        """True if the steps are decided as the robot goes, in torque and hybrid control; False for planned steps."""
        return self.settings().free

    def foot_design(self) -> Foot:
        """Return the foot."""
        return changed_foot(self.foot, self.stiffness, self.foot_changes)

    def ground(self) -> Terrain:
        """Return the ground; `InputError` where the file that it was read from has changed."""
        if isinstance(source := dict(self.terrain_params).get(SOURCE), str):
            stamped_file(source, "ground")
        return self._ground

    @cached_property
    def _ground(self) -> Terrain:
        params: dict[str, Any] = dict(self.terrain_params)
        if own := [name for name in ("name", "amplitude", "seed") if name in params]:
            raise InputError(f"{own[0]} of a terrain is an option of its own, not one of its parameters")
        if isinstance(source := params.get(SOURCE), str):
            params[SOURCE] = file_of(stamped_file(source, "ground"))
        ground = terrain_by_name(self.terrain, self.amplitude, self.seed, **params)
        if ground.name == "flat" or self.plan.stairs is not None:  # it has no end; stairs are where they are
            return ground
        return fitted(ground, self.plan.way(self.start, self.gait, planned=not self.free), params)

    def things(self) -> Scene | None:
        """Return the scene on the ground."""
        return None if self.scene is None else make_scene(self.scene, **dict(self.scene_params))

    @property
    def extent(self) -> tuple[float, float, float, float] | None:
        """Smallest and largest x, smallest and largest y of the ground, m; None for an endless floor."""
        return None if self.terrain == "flat" else self.ground().extent

    def settings(self) -> WalkTrialSettings:
        """Return preset and changes as settings."""
        return self._settings

    @cached_property
    def _settings(self) -> WalkTrialSettings:
        trial = trial_settings(self.gains, self.changes, self.chosen, self.timestep)
        given = [path.removeprefix("observer.") for path, _ in self.changes]
        trial = replace(trial, observer=self.with_delays(trial.observer, given))
        if trial.free and self.gait.given:
            raise InputError(
                f"free steps have no gait, got {', '.join(self.gait.given)}; their settings are 'stepping.…', and "
                "mode='position' takes planned steps"
            )
        return trial

    def prepare(self) -> PreparedWalk:
        """Return the parts that do not depend on seeds; they are built once for all specs that differ only in seeds."""
        ground = self.ground()
        return prepare(
            robot=load(self.robot),
            servo=self.servo,
            foot=self.foot_design(),
            plan=self.plan if self.trained is None else driven(self.plan),
            gait=TOE_GAIT if self.eyes == "toes" and self.gait == Gait() else self.gait,
            settings=self.settings(),
            period=self.period,
            start=self.start,
            extent=self.extent,
            stairs=ground if self.plan.stairs is not None else None,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the whole spec as plain values, with its kind."""
        data, ground = super().to_json(), self.ground()
        data["policy"], params = self.scheduling
        data |= {"amplitude": ground.amplitude, "policy_params": params}
        for name in ("foot_changes", "policy_params", "terrain_params", "scene_params", "changes"):
            data[name] = dict(data[name])
        data["terrain_params"][RAMP_NAME] = ground.ramp
        data["plan"] = {name: value for name, value in data["plan"].items() if value is not None}
        return data


def _as_used(ground: Terrain, params: Changes) -> Changes:
    """Return parameters as the ground has them, 1 and 1.0 are the same length; of a file its name and its hash."""
    values = {
        name: value if name == SOURCE else getattr(ground.parameters, name, getattr(ground, name, value))
        for name, value in params
        if name != RAMP_NAME or (ground.name != "flat" and ground.ramp != ground.default_ramp)
    }
    if isinstance(source := values.get(SOURCE), str):
        values[SOURCE] = stamped_file(source, "ground")
    return as_changes(values)
