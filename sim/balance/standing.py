"""Simulated standing: the balance controller against the plant, as a function of a frozen spec."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Positive, settings
from wbc.core.drive.control import DriveControl, Mode
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import HybridControl, TorqueControl
from wbc.core.estimation.falls import FallReason
from wbc.sim.trial.push import PushSchedule, WalkPush
from wbc.sim.trial.spec import TrialResult, TrialSpec
from wbc.sim.trial.trial import AnyTrial, Trial, TrialHook
from wbc.tasks.balance import BalanceGains, balance_controller
from wbc.walking.control import WalkingControl
from wbc.walking.settings import WalkingControlSettings

Feedback = Literal["open", "closed"]

REST_SPEED = 0.1
"""Horizontal speed of the centre of mass below which a robot is at rest, m/s: above the sway of a standing robot with
noisy sensors, below the speed of a fall once it has begun."""


@settings(kw_only=True, eq=False)
class StandSpec(TrialSpec):
    """One simulated stand: the fields of `TrialSpec`, and these.

    Attributes:
        seconds: Simulated time, s.
        feedback: In position control, whether the controller sees the robot as commanded (open) or as estimated
            (closed).
        gains: Weights and gains of the controller.
        steps: Whether the robot may step: none keeps its feet in place with the balance controller, allowed takes free
            steps out of a push; in torque (the default then) or hybrid control.
    """

    kind: ClassVar[str] = "stand"

    seconds: Annotated[Positive, "s"] = 10.0
    feedback: Feedback = "closed"
    gains: BalanceGains = field(default_factory=BalanceGains)
    steps: Literal["none", "allowed"] = "none"

    def __post_init__(self) -> None:
        if self.steps == "allowed" and self.mode == "position":
            raise InputError(
                "a robot that may step stands in torque or hybrid control, got mode 'position' with steps 'allowed'"
            )
        super().__post_init__()
        if self.seconds < 2.0 * self.period:  # the result is about the second half
            raise InputError(
                f"seconds (s) must be at least 2 control periods of {self.period:g} s, got {self.seconds:g}"
            )

    def _usual_mode(self) -> Mode | None:
        """Return the control mode when none is given."""
        return "torque" if self.steps == "allowed" else super()._usual_mode()


@dataclass(frozen=True, kw_only=True)
class StandResult(TrialResult):
    """Result of a stand; all but `clock` follows from the spec.

    Attributes:
        mode: "position", "torque" or "hybrid".
        upright: True if it never fell.
        com_error: Greatest horizontal distance of the true centre of mass from its target in the second half, m.
        zmp_noise: Standard deviation of the true zero-tilting moment point in the second half, both axes together, m.
        steps_taken: Steps that the robot took; 0 where its feet stay in place.
        noise: Errors of the sensors.
        foot: Foot under both ankles.
        control_period: Control period, s.
    """

    mode: Mode
    upright: bool
    com_error: Annotated[float, "m"]
    zmp_noise: Annotated[float, "m"]
    steps_taken: int
    noise: str
    foot: str
    control_period: Annotated[float, "s"]

    RENAMED = {
        "com_error_mm": "com_error (m)",
        "zmp_noise_mm": "zmp_noise (m)",
        "real_time_factor": "clock.real_time_factor",
        "tick_us": "clock.tick_us",
    }


class StandTrial(Trial[WalkingControl | DriveControl, StandResult]):
    """One stand about to begin: plant and controller, connected."""

    @checked
    def __init__(self, spec: StandSpec, scenario: Sequence[TrialHook] = (), *, visuals: bool = True) -> None:
        """Build robot, plant (see it for `visuals`) and controller; `scenario` are hooks that act, such as pushes."""
        self._made = time.perf_counter()
        self.spec = spec
        robot, plant, observer = spec.build(visuals=visuals)
        control: WalkingControl | DriveControl
        if spec.steps == "allowed":
            settings = WalkingControlSettings(mode=spec.chosen)
            control = WalkingControl(robot, None, spec.period, settings, observer=observer)
        else:
            controller = balance_controller(robot, spec.period, spec.gains)
            if spec.chosen == "position":
                control = PositionControl(controller, observer, feedback=spec.feedback)
            else:
                control = (TorqueControl if spec.chosen == "torque" else HybridControl)(controller, observer)
        super().__init__(plant, control, scenario=scenario)
        self.sway = Sway(plant.truth().com)
        self.meters.append(self.sway)

    def find_fall(self) -> FallReason | None:
        """Return why the robot has fallen in truth: a controller that stands may take a slide for a fall."""
        return None if self.plant.diverged else self.true_fall()

    def simulate(self) -> None:
        """See `Trial`."""
        self.advance(self.spec.seconds)

    def result(self) -> StandResult:
        """Return how still it stood in the second half."""
        spec, half = self.spec, len(self.sway.com) // 2
        error = np.linalg.norm((np.array(self.sway.com) - self.sway.origin)[half:, :2], axis=1)
        return StandResult(
            robot=spec.robot,
            mode=spec.chosen,
            upright=not self.fallen,
            com_error=float(error.max()),
            zmp_noise=float(np.sqrt(np.nanvar(np.array(self.sway.zmp)[half:], axis=0).sum())),
            seconds=self.plant.time,
            steps_taken=self.control.steps_done if isinstance(self.control, WalkingControl) else 0,
            failures=self.drives.failures,
            noise=spec.noise,
            foot=spec.foot,
            seed=spec.seed,
            control_period=spec.period,
            clock=self.clock(),
        )


class Sway(TrialHook):
    """True centre of mass, from its `origin`, m, and zero-tilting moment point, m, after each control period."""

    def __init__(self, origin: Array) -> None:
        self.origin = origin.copy()
        self.com: list[Array] = []
        self.zmp: list[Array] = []

    def after(self, trial: AnyTrial) -> None:
        """See `TrialHook`."""
        truth = trial.plant.truth()
        self.com.append(truth.com)
        self.zmp.append(truth.centre_of_pressure[:2])


@checked
def stand(spec: StandSpec | None = None, **values: Any) -> StandResult:
    """Simulate a standing robot, which may be pushed, and return its result.

        result = stand(robot="talos", mode="torque", noise="realistic")

    The values are fields of `StandSpec` that differ from the spec, or without one from the default.
    """
    result: StandResult = StandTrial(replace(spec or StandSpec(), **values), visuals=False).run()
    return result


def recovers(
    spec: StandSpec, push: WalkPush, *, hooks: Sequence[TrialHook] = (), visuals: bool = True
) -> bool:
    """Return True if a standing robot recovers from a push.

    It has never fallen (`TrueFallDetector`) and its centre of mass is at rest in the end, its horizontal speed
    below 0.1 m/s. Feet may have slid, tipped or left the ground meanwhile. `hooks` look on;
    `visuals` are those of a `wbc.Plant`.
    """
    trial = StandTrial(spec, [PushSchedule([push])], visuals=visuals)
    with trial.running(hooks):
        trial.advance(spec.seconds)
    speed = float(np.linalg.norm(trial.plant.truth().com_velocity[:2]))
    return not trial.fallen and speed < REST_SPEED
