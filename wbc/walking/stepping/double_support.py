"""A robot on both feet: it stands, or shifts its weight over one foot before the first step."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wbc.base.vectors import Point, Vector, along
from wbc.core.robot import GRAVITY
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.stepping.course import PhaseReference, shifted
from wbc.walking.stepping.felt import GaitState
from wbc.walking.stepping.law import SIDE, StanceAxes
from wbc.walking.stepping.path import steps_of_plan
from wbc.walking.stepping.settings import GaitValues

SHIFTED = 0.6
"""Part of the standing box to which the weight shifts ahead before footsteps: ξ must not leave the box on the way."""


class DoubleSupport:
    """Both feet of one walk on the ground.

    Attributes:
        duration: Planned time of the shift of the weight, with the rest before the first step, s.
    """

    def __init__(self, values: GaitValues, felt: GaitState) -> None:
        """Stand."""
        self._settings, self._law, self._scale, self._dt = values
        self._felt = felt
        self._from: Point = 0.0, 0.0  # CoM at the start of the shift, less its shift by hands, m
        self.duration = self._shift_time = self._late = 0.0
        self._footsteps: Sequence[Footstep] = ()

    # ---- which foot is to carry ---------------------------------------------------------------------------------

    def pushed(self, direction: Point) -> int | None:
        """Return the foot that is to stand in a step out of a push: the DCM has left both soles; else None.

        The other foot is the one on whose side the DCM is, in a heading given by its cosine and sine.
        """
        state, dcm = self._felt.state, self._felt.dcm
        if self._felt.outside(dcm, 1.0) <= 0.0:
            return None
        left, right = (abs(along(direction, dcm.x - x, dcm.y - y)[1]) for x, y, _ in state.places)
        stance, loads = (0 if left > right else 1), [row[2] for row in state.wrenches]
        if loads[stance] < self._law.touch.least_force < loads[1 - stance]:
            stance = 1 - stance  # a foot that has been kicked away carries nothing
        return stance

    def joined(self, air: Sequence[float], landed: Sequence[float]) -> int | None:
        """Return the foot that carries in the step of a robot that walks, else None; see `SteppingWalk.begin`."""
        least, loads = self._law.touch.least_force, [row[2] for row in self._felt.state.wrenches]
        up = [time > 0.0 for time in air]
        if up[0] == up[1]:
            up = [loads[side] < least < loads[1 - side] for side in (0, 1)]
        if max(loads) < least or not (any(up) or min(landed) < self._law.touch.landed):
            return None
        return up.index(False) if any(up) else int(landed[1] < landed[0])

    # ---- the centre of mass -------------------------------------------------------------------------------------

    def standing(self) -> PhaseReference:
        """Return the references of a stand: the CoM rests over the middle of the feet from its first tick on.

        With the gains of a stand, a reference that goes there from the CoM of the robot would ask for the same
        acceleration: it is that of a feedback of ξ alone, whose place of rest is this middle.
        """
        (left, right), most = self._carrying_points(), self._law.touch.most_force
        x, y, height = (0.5 * (a + b) for a, b in zip(left, right, strict=True))
        return PhaseReference((x, y, 0.0, 0.0, 0.0, 0.0), height, (most, most))

    def shift(self, footsteps: Sequence[Footstep]) -> None:
        """Begin to shift the weight to beside the foot that is to stand.

        Footsteps follow; without them, steps of a velocity. It takes the time of rigid ground; see `delay`.
        """
        (x, y, _), (u, v) = self._felt.state.com, self._felt.offset  # hands shift the CoM by −δ
        self._from = x + u, y + v
        self._footsteps, self._late = footsteps, 0.0
        self._shift_time = self._law.stand.shift_to_plans if footsteps else self._law.stand.shift_time
        self.duration = self._shift_time + self._law.stand.rest

    def delay(self) -> None:
        """Let the shift be slower in a tick, the deeper the feet sink.

        A quick shift is braked by pressure beside the middle of the sole, and on ground that gives the sole would tilt.
        """
        late = self._dt * (1.0 - 1.0 / self._slower)
        self._late += late
        self.duration += late

    @property
    def _slower(self) -> float:
        """Time of the shift over that on rigid ground: 1 + 2 d / w.

        A sole of the width w that bears the whole weight is d deep, and tilts by 12 e d / w² where it carries at e
        beside its middle: by 2 d / w at e = w / 6, where its edge comes free.
        """
        state = self._felt.state
        return 1.0 + state.compliance * state.mass * GRAVITY / self._scale.sole[1]

    def shifting(self, direction: Point, time: float) -> PhaseReference:
        """Return the references of the shift.

        The heading is given by its cosine and sine, and a step along footsteps takes a `time`, s.
        """
        feet, most, stance = self._carrying_points(), self._law.touch.most_force, self._felt.stance
        axes = StanceAxes(SIDE[stance], direction, feet[stance])
        ahead, outwards = self._rest_of_dcm(axes, time)
        goal, slower = axes.point(ahead, outwards), self._slower
        x, y, u, v, a, b = shifted(self._from, goal, self._felt.elapsed - self._late, self._shift_time)
        motion = x, y, u / slower, v / slower, a, b
        return PhaseReference(motion, 0.5 * (feet[0][2] + feet[1][2]), (most, most))

    def _rest_of_dcm(self, axes: StanceAxes, time: float) -> Point:
        """Return where ξ rests when the weight has shifted, ahead and outwards of the foot that is to stand, m."""
        settings, law, omega = self._settings, self._law, self._felt.dcm.omega
        if not self._footsteps:
            return 0.0, law.stand.shift * settings.width / (1.0 + math.exp(omega * settings.step_time))
        wish = steps_of_plan(self._footsteps, law.area.carrying, settings.width, axes, omega, time)
        grown, most = math.exp(omega * time), SHIFTED * 0.5 * law.area.standing_box[0]
        (place_x, place_y, *_), (offset_x, offset_y, *_) = wish.places, wish.offsets
        ahead, outwards = (place_x + offset_x) / grown, (place_y + offset_y) / grown
        return min(max(ahead, -most - law.area.carrying), most - law.area.carrying), outwards

    def _carrying_points(self) -> tuple[Vector, Vector]:
        """Return the points of the left and of the right sole that carry, m."""
        return self._felt.carrying_point(0), self._felt.carrying_point(1)
