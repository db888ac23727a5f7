"""Simulated pressing: hands on a table, a wall or a rail, with a force that is to be held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from wbc.core.errors import Array
from wbc.core.robot import Robot
from wbc.core.settings import Positive, settings
from wbc.robots import load
from wbc.sim.hands.trial import SIDES, ArmSpace, HandTrial, HandTrialResult, HandTrialSpec
from wbc.sim.scenes import Scene, make_scene
from wbc.sim.trial.loop import TrialHook
from wbc.walking.hands.hand import HandSettings, HandState

Surface = Literal["table", "wall", "rail"]

WHERE: dict[Surface, tuple[float, float]] = {"table": (0.42, 0.7), "wall": (0.8, 0.42), "rail": (0.8, 0.55)}
"""Point for a hand on each, in front of and below the shoulder, in shares of the arm's reach."""

DIRECTION: dict[Surface, tuple[float, float, float]] = {
    "table": (0.0, 0.0, -1.0),
    "wall": (1.0, 0.0, 0.0),
    "rail": (0.65, 0.0, -0.76),
}
"""Direction of the force on each."""

EDGE = 0.06
"""Distance of the hands from the front edge of the table, m."""

CALM = 1.0
"""Time from the end of the ramp to the first sample, s."""

TOLERANCE = 0.1
"""Part of the force by which a hand may be off."""


@settings(kw_only=True)
class HandPressSpec(HandTrialSpec):
    """Both hands press on a surface that cannot give way.

    Attributes:
        on: Surface, table, wall or rail.
        force: Force of both hands together, N.
        seconds: Time for which the force is held, s.
        distance: Distance of the hands in front of the middle of the feet, m; where the arms are at ease when not
            given.
        height: Height of the hands over the ground, m; likewise.
        hands: Settings of the hands; those that suit the surface when not given: on a wall or a rail hands help to
            balance.
    """

    on: Surface = "table"
    force: Annotated[Positive, "N"] = 20.0
    seconds: Annotated[Positive, "s"] = 30.0
    distance: Annotated[Positive, "m"] | None = None
    height: Annotated[Positive, "m"] | None = None
    hands: HandSettings | None = None

    def point(self, robot: Robot) -> Array:
        """Return the point on which the left hand presses, shape (3,), m."""
        point = ArmSpace.of(robot).point(*WHERE[self.on])
        if self.distance is not None:
            point[0] = self.distance
        if self.height is not None:
            point[2] = self.height
        return point


@dataclass(frozen=True)
class HandPressResult(HandTrialResult):
    """Result of a press; forces are those that the surface gives, by MuJoCo, not those of the sensors.

    Attributes:
        on: Surface.
        force_N: Force asked for, of both hands.
        held_s: Time for which both hands held, from 1 s after the ramp.
        mean_N: Mean force of both hands in that time.
        least_N: Least, over 0.1 s.
        greatest_N: Greatest, over 0.1 s.
        within: Part of the time in which each hand, as measured, is within 10 % of what it should be.
        steady: Part of the time in which the force of both hands, over 0.1 s, is within 10 % of what it should be.
        lost: Hands that have lost their contact.
        bounded: True if an arm had less force than was asked for.
        beyond_toes_mm: Greatest distance of the centre of mass before the toes.
    """

    on: str
    force_N: float
    held_s: float
    mean_N: float
    least_N: float
    greatest_N: float
    within: float
    steady: float
    lost: tuple[str, ...]
    bounded: bool
    beyond_toes_mm: float


class HandPressTrial(HandTrial):
    """One press about to begin.

    Attributes:
        spec: The press.
    """

    def __init__(self, spec: HandPressSpec) -> None:
        """Build robot, surface and controller.

        Raises:
            InputError: A robot that stands in the surface.
        """
        self.spec = spec
        self._point = spec.point(load(spec.robot).robot())
        settings = spec.hands or HandSettings(edge=0.5, help=0.0 if spec.on == "table" else 1.0, ramp=6.0)
        super().__init__(spec, _surface(spec.on, self._point), settings)
        self._along = np.array(DIRECTION[spec.on]) / np.linalg.norm(DIRECTION[spec.on])
        self._rows: list[tuple[float, ...]] = []  # force of the surface, forces as measured, before the toes
        self._bounded = False

    def run(self, hooks: Sequence[TrialHook] = ()) -> HandPressResult:
        """Press and return the result.

        Args:
            hooks: Look on.
        """
        with self.running(hooks):
            self._stages()
        spec, dt = self.spec, self.walking.dt
        rows = np.array(self._rows).reshape(-1, 4)
        each = 0.5 * spec.force
        share = np.abs(rows[:, 1:3] - each) <= TOLERANCE * each
        size = max(1, round(0.1 / dt))
        whole = len(rows) // size * size
        spans = rows[:whole, 0].reshape(-1, size).mean(axis=1) if whole else np.full(1, np.nan)
        common = asdict(self.common())
        return HandPressResult(
            **common,
            on=spec.on,
            force_N=spec.force,
            held_s=round(len(rows) * dt, 3),
            mean_N=_rounded(spans.mean()),
            least_N=_rounded(spans.min()),
            greatest_N=_rounded(spans.max()),
            within=_rounded(share.mean()) if len(rows) else 0.0,
            steady=_rounded(np.mean(np.abs(spans - spec.force) <= TOLERANCE * spec.force)),
            lost=self.hands.lost,
            bounded=self._bounded,
            beyond_toes_mm=_rounded(1e3 * rows[:, 3].max()) if len(rows) else float("nan"),
        )

    def _stages(self) -> None:
        spec, hands = self.spec, self.hands
        if not self.advance(0.5):
            return
        x, y, z = self._point.tolist()
        self.stage = "reach"
        for name, side in SIDES.items():
            hands.press(name, 0.5 * spec.force, self._along, at=(x, side * y, z), firm=True)
        if not self.until(self._holding, 30.0):
            return
        self.stage = "ramp"
        if not self.advance(hands.settings.ramp + CALM):
            return
        self.stage = "hold"
        steady = spec.seconds
        end = self.plant.time + steady
        while self.plant.time < end - 0.5 * self.walking.dt:
            if not self.advance(self.walking.dt, self._look) or hands.lost:
                return
        self.stage = "done"

    def _holding(self) -> bool:
        return all(hand.state is HandState.HOLD for hand in self.hands.all.values())

    def _look(self) -> None:
        truth = self.plant.truth()
        given = -float(truth.contact_force[truth.contact_sole < 0].sum(axis=0) @ self._along)
        toes = max(self.plant.data.site_xpos[list(self.plant.sole_sites), 0])
        before = float(truth.com[0] - toes) - 0.5 * self.robot.soles[0].length
        self._rows.append((given, *(hand.pressed for hand in self.hands.all.values()), before))
        self._bounded = self._bounded or any(hand.bounded for hand in self.hands.all.values())


def press_hands(spec: HandPressSpec | None = None, **values: Any) -> HandPressResult:
    """Simulate a robot that presses with both hands.

        result = press_hands(on="wall", force=60.0)

    Args:
        spec: The press; the default one when None.
        **values: Fields of `HandPressSpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, or a robot without hands.
    """
    return HandPressTrial(replace(spec or HandPressSpec(), **values)).run()


def _surface(on: Surface, point: Array) -> Scene:
    x, _, z = point.tolist()
    if on == "wall":
        return make_scene("wall", distance=x)
    return make_scene(on, distance=x - (EDGE if on == "table" else 0.0), height=z)


def _rounded(value: Any) -> float:
    return float(f"{float(value):.4g}")
