"""Settings of a simulated walk: those of the walking controller, the observer, the physics and the range sensor."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Literal

from wbc.base.errors import InputError, choose
from wbc.base.settings import Changes, changed, normal_changes, settings
from wbc.core.drive.control import Mode
from wbc.core.estimation.observer import ObserverSettings
from wbc.feet.sensing.range_sensor import RangeSensor
from wbc.ground.known import GroundSettings
from wbc.sim.plant.eyes import DepthCamera, ToeSensors
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.trial.falls import FallSettings
from wbc.tasks.scheduling.stiffness import StiffnessTiming
from wbc.tasks.stabilizer.bias import BiasSettings
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.walking.lipm.preview import PreviewSettings
from wbc.walking.lipm.settings import PhaseSettings, WalkSettings
from wbc.walking.settings import WalkingControlSettings

PRESETS = ("default", "frizza", "no_bias")
"""Names of presets: the best settings on all soles, the law of the paper, and the same without bias estimate, with the
gains of mc_rtc."""

PAPER_GAINS = {"dcm_p": 3.4, "dcm_i": 0.0, "dcm_d": 2.1}
"""Gains of the paper's stabilizer: kP (1/s) and kD of its data set, tuned on a flat floor, and kI = 0 because a bias
estimator takes its place (sections II-C and IV-B, Table II)."""

Eyes = Literal["none", "depth", "toes"]
"""Eyes of a walk: none, a depth camera, or range sensors at the toes."""

DERIVED = {"mode": "the option 'mode'", "physics.timestep": "the option 'timestep'"}
"""Settings that follow from others: name of the setting → the one to change instead."""


@settings
class WalkTrialSettings(WalkingControlSettings):
    """Settings of a simulated walk: its controller and its surroundings.

    Attributes:
        observer: Settings of the base estimator.
        physics: Settings of the simulator.
        stiffness: Timing of the stiffness policy of variable soles: scan, decision, command.
        range_sensor: Range sensor under each toe of such soles; perfect with the sensor noise "none".
        camera: Depth camera of a walk with eyes="depth".
        toes: Range sensors at the toes of a walk with eyes="toes".
        ground: What is made of what they see.
        falls: Limits beyond which the robot has fallen in truth.
    """

    observer: ObserverSettings = field(default_factory=ObserverSettings)
    physics: PhysicsSettings = field(default_factory=PhysicsSettings)
    stiffness: StiffnessTiming = field(default_factory=StiffnessTiming)
    range_sensor: RangeSensor = field(default_factory=lambda: RangeSensor(noise=0.001, resolution=0.001))
    camera: DepthCamera = field(default_factory=DepthCamera)
    toes: ToeSensors = field(default_factory=ToeSensors)
    ground: GroundSettings = field(default_factory=GroundSettings)
    falls: FallSettings = field(default_factory=FallSettings)

    @staticmethod
    def preset(name: str) -> WalkTrialSettings:
        """Return settings by name.

        "no_bias" is the plain law: planned steps, position servos without feed-forward, gains and costs of mc_rtc, feet
        that lift on time whatever their load, no step adjustment, an upright trunk, no bias estimated. "frizza" is the
        paper's: the same with mc_rtc's estimator of the DCM's bias and the gains of `PAPER_GAINS`. Touch-downs are
        detected as in "default": a walk over unknown ground needs it.
        """
        if choose("gains", name, PRESETS) == "default":
            return WalkTrialSettings()
        paper, plain = name == "frizza", StabilizerGains.mc_rtc()
        return WalkTrialSettings(
            feedforward=False,
            gains=replace(plain, **PAPER_GAINS) if paper else plain,
            distribution=DistributionSettings.mc_rtc(),
            lean=None,
            bias=BiasSettings() if paper else None,
            walk=WalkSettings(
                preview=PreviewSettings(),
                phases=replace(PhaseSettings(), lift_off=1.0, stance=0.0, max_wait=0.0),
                adjustment=None,
            ),
        )


OF_FREE = ("stepping",)
"""Settings that count in free steps alone."""

OF_PLANNED = ("drive", "walk", "gains", "distribution", "lean", "bias", "tasks", "feedforward")
"""Settings that count in planned steps alone."""


def trial_settings(preset: str, changes: Changes, mode: Mode, timestep: float) -> WalkTrialSettings:
    """Return a preset with changes that `checked_changes` returned, but for those of steps that are not taken."""
    if preset != PRESETS[0] and mode != "position":
        raise InputError(
            f"the preset '{preset}' is one of planned steps, which mode='position' takes, got '{mode}'"
        )
    trial = replace(changed(WalkTrialSettings.preset(preset), changes), mode=mode)
    for path, _ in changes:
        if path.partition(".")[0] in (OF_PLANNED if trial.free else OF_FREE):
            steps, other = ("planned", "position") if trial.free else ("free", "torque")
            raise InputError(
                f"'{path}' is a setting of {steps} steps, which mode='{other}' takes, got mode='{mode}'"
            )
    return replace(trial, physics=replace(trial.physics, timestep=timestep))


def checked_changes(preset: str, changes: Changes) -> Changes:
    """Return changes in their normal form; what is a setting of its own elsewhere, or out of range, is refused."""
    normal = normal_changes(WalkTrialSettings.preset(preset), changes)
    for path, _ in normal:
        if path in DERIVED:
            raise InputError(f"'{path}' is not a setting to be changed, it follows from {DERIVED[path]}")
    return normal
