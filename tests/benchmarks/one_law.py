"""One law for both walks, a prototype: a QP decides place, time and centre of pressure of a step.

    python tests/benchmarks/one_law.py --journal walks.jsonl      # 17 families of grounds, two soles, 2 m
    python tests/benchmarks/one_law.py --journal walks.jsonl --sole rigid --family stones slats --seed 21000

In the heading's axes, y towards the foot that swings and so mirrored from step to step, about the point of the stance
foot that carries, with the DCM ξ, the contact z and the step time T:

    s0 + b0 = z + (ξ − z) τ + d0 (1 − τ')         τ = e^{ωt},  τ' that of the last solution
    s1 + b1 = d1 + E (b0 − d1)                    E = e^{ωT}
    s2 + b2 = E b1
    min  |s − s*|² + 0.05 (τ/τ* − 1)² + 20 |b0 − b0*|² + 20 |b1 − b1*|² + 100 |b2 − b2*|² + 0.02 |d0|² + 0.5 |d1|²

17 unknowns: three steps s from foot to foot, shifts d of the centre of pressure in this step and the next, the time t
that is left as τ/τ*, offsets b of ξ from the feet that land; s, d and τ are bounded. s* are the steps of the velocity,
b* and τ* those of the stepping law's orbit. d0 stays in the area that is believed to hold: a point at first, it grows
while the foot does not turn, and ends where the foot turns over an edge. Swing, contacts, take-over and torque control
are those of the stepping walk. Walks are blind, on torques, with realistic noise, on grounds as high as in the study
`seeing`. Every walk is a line of the journal; an interrupted program goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import daqp
import numpy as np

from wbc.core.qp.contact import SoleContact
from wbc.core.robot import SIDES
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.studies.seeing import HEIGHTS, SOLES
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.source import Reference
from wbc.walking.stepping import source
from wbc.walking.stepping.gait import BodyState, SteppingGait, _on_sole
from wbc.walking.stepping.law import NEAR, SIDEWAYS, Divergent, Point
from wbc.walking.swing import SwingFoot

# Nominal and longest time of a step, 1/ω, by a few walks of seed 32000; the stepping law's are 1.65 and 2.02.
CHANGES = {"gait.step_time": 2.9, "gait.longest": 3.5}
STEPS, D0, D1, TAU, OFFSETS = slice(0, 6), slice(6, 8), slice(8, 10), 10, slice(11, 17)  # unknowns of the QP
COSTS = np.repeat((1.0, 0.02, 0.5, 0.05, 20.0, 100.0), (6, 2, 2, 1, 4, 2))  # 1/m², of τ/τ* 1; not tuned
PERIOD = 3  # ticks between two QPs: 6 ms are short beside 1/ω
GROWTH = 0.25  # speed of the edges of the area, m/s: whole well within a step
RATE = 1.0  # greatest speed of the commanded CoP, m/s: no jump of the moments
MARGIN = 0.02  # between the greatest area and the edges of the sole, m: a foot turns about an edge
INSIDE = 0.005  # between an area that shrinks and the measured CoP, m: it lies on the edge
STILL, TURNING = 0.25, 0.5  # greatest rate of a foot that stands, least of one that turns over an edge, rad/s
SPIN_LAG = 0.015  # low-pass of these rates, s: they are differences of noisy angles
CARRIES = 0.3  # ratio of the weight from which on the CoP shows where the foot holds
NEXT = 0.3  # ratio of the half sole that the next foot is expected to hold: stones hold less than all
MODEL_ERROR = 0.03  # greatest difference of the measured from the commanded CoP that is believed, m


class OneLawGait(SteppingGait):
    """Gait of the stepping walk with time, place and centre of pressure by one QP."""

    point = False  # keep the area a point, as the stepping law does

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.times: list[float] = []  # of the QPs, s
        self.contacts: Sequence[SoleContact] = ()
        self._box = -1, 0.0, 0.0  # foot that stands, and its cop, in the last tick; -1 on both feet
        self._decisions = 0
        self._forget()
        self._hessian, self._gradient = np.diag(COSTS), np.zeros(17)
        self._rows, self._sense = np.zeros((6, 17)), np.repeat(np.int32((0, 5)), (17, 6))  # 5: an equality
        self._rows[:, STEPS] = self._rows[:, OFFSETS] = np.eye(6)
        self._lower, self._upper = np.full(23, -100.0), np.full(23, 100.0)  # no bounds: 100 m
        self._lower[17:] = self._upper[17:] = 0.0

    def _forget(self) -> None:
        """Stand on a foot of which nothing is known."""
        self.cop = self._wanted_cop = 0.0, 0.0  # shift from the carrying point, along and across the sole, m
        self._area = [0.0, 0.0, 0.0, 0.0]  # back, front, right, left of the carrying point, m
        self._tilt: Any = None  # heights of the ends of the sole's axes
        self._spin = [0.0, 0.0]  # their rates, rad/s
        self._solution: tuple[Point, float] | None = None  # landing, m, and time of the step, s

    def _enter(self, mode: Any) -> None:
        super()._enter(mode)
        self._forget()

    def _step(self, *args: Any) -> Reference:
        """Move the box of the centre of pressure of the foot that stands to where the law wants it."""
        reference, c, last = super()._step(*args), self.constants, self._box
        self._box = box = (self.stance, *self.cop) if reference.phase is GaitPhase.SINGLE else (-1, 0.0, 0.0)
        for side, contact in enumerate(self.contacts):
            if side == self.stance == box[0] and box != last:
                contact.set_box(*c.box, (c.carrying + self.cop[0], self.cop[1]))
            elif side == 1 - box[0] and box[0] != last[0]:
                contact.set_box(*c.box, (c.carrying, 0.0))
        return reference

    def _believe(self, state: BodyState) -> None:
        """Grow the area while the foot is still; shrink it to the measured CoP on the side over which it turns."""
        heights, c, dt, area = state.turns[self.stance][2][:2], self.constants, self._dt, self._area
        if self._tilt is not None:
            for i, (now, last) in enumerate(zip(heights, self._tilt, strict=True)):
                self._spin[i] += min(dt / SPIN_LAG, 1.0) * ((now - last) / dt - self._spin[i])
        self._tilt = heights
        _, _, force, roll, pitch, _ = state.wrenches[self.stance]
        if force < CARRIES * self.scale.weight:
            return
        centre, cop = (c.carrying, 0.0), (-pitch / force - c.carrying, roll / force)
        for i, spin in enumerate(self._spin):
            half, low, high = self.scale.sole[i] - MARGIN, 2 * i, 2 * i + 1
            if abs(spin) < STILL:
                area[high] = min(area[high] + GROWTH * dt, max(half - centre[i], 0.0))
                area[low] = max(area[low] - GROWTH * dt, min(-half - centre[i], 0.0))
            elif spin < -TURNING:  # the far end goes down: it turns over the far edge
                area[high] = max(0.0, min(area[high], cop[i] - INSIDE))
            elif spin > TURNING:
                area[low] = min(0.0, max(area[low], cop[i] + INSIDE))

    def _decide(self, state: BodyState, dcm: Divergent, frames: Any, steps: Any) -> Any:
        """Decide time, place and centre of pressure of the step, and send the swing foot there."""
        s, c, swing = self.settings, self.constants, 1 - self.stance
        nominal = s.step_time if self._since_stand == 0 else self.steering.step_time
        self._decisions += 1
        if self._met is None:
            if not self.point:
                self._believe(state)
            if self._solution is None or self._decisions % PERIOD == 0:
                self._solve(state, dcm, steps, nominal)
        assert self._solution is not None
        (x, y), duration = self._solution
        wanted = min(max(duration, s.shortest), s.longest)
        if self._swing is None:
            self._nominal = min(wanted, c.later * nominal) if self._since_stand else s.step_time
        elif self._met is None:
            self._nominal += self._time_gain * (wanted - self._nominal)
        if self._met is None:
            self._time = min(max(self._nominal, s.shortest), s.longest)
            (a, b), (u, v), most = self.cop, self._wanted_cop, RATE * self._dt
            self.cop = a + min(max(u - a, -most), most), b + min(max(v - b, -most), most)
        turn = self.steering.heading + steps.turn * max(self._time - self._elapsed, 0.0)
        landing, touch = Footstep(SIDES[swing], x, y, self.ground.height, turn), c.touch * self._time
        if self._swing is None:
            self.ground.lift(self.stance, frames[self.stance])
            speed = min(c.landing_speed + c.haste * self.ground.uneven, c.hardest)
            shape, over = self._shape._replace(landing_speed=speed), self.ground.way(frames[swing], landing)
            self._swing = SwingFoot(frames[swing], landing, touch, shape, over)
        elif self._met is None:
            self._swing.retarget(self._elapsed, landing, touch)
        return self._swing, landing

    def _solve(self, state: BodyState, dcm: Divergent, steps: Any, nominal: float) -> None:
        """Solve the QP for landing, time and centre of pressure of this step; keep the last ones if it fails."""
        s, c, side, elapsed = self.settings, self.constants, self._side, self._elapsed
        omega, orbit, (vx, vy) = dcm.omega, self._orbit(dcm, steps), steps.velocity
        low, high, rows = self._lower, self._upper, self._rows
        assert self._contact is not None
        pivot = _on_sole(state, self.stance, c.carrying, 0.0)
        told = _on_sole(state, self.stance, c.carrying + self.cop[0], self.cop[1])
        ahead, aside = self._along(dcm.x - pivot[0], dcm.y - pivot[1])
        error = self._along(self._contact[0] - told[0], self._contact[1] - told[1])
        xi = ahead, side * aside
        z = [min(max(e, -MODEL_ERROR), MODEL_ERROR) for e in (error[0], side * error[1])]
        growth, tau = math.exp(omega * nominal), math.exp(omega * max(nominal - elapsed, 0.0))
        before = math.exp(omega * max(self._solution[1] - elapsed, 0.0)) if self._solution else tau
        width = max(s.width, s.gap + abs(vy) * s.step_time / SIDEWAYS)
        length, drift, inwards = vx * nominal, side * vy * nominal, orbit.inwards
        other = width / (1 + growth) * 2 - inwards
        places = length, width + drift, length, width - drift, length, width + drift
        offsets = orbit.ahead, -inwards, orbit.ahead, -other, orbit.ahead, -inwards
        wanted = np.array((*places, 0.0, 0.0, 0.0, 0.0, 1.0, *offsets))
        np.multiply(COSTS, -wanted, out=self._gradient)
        for i, mirror in enumerate((1.0, -1.0)):
            rows[i, D0.start + i], rows[i, TAU] = before - 1.0, -(xi[i] - z[i]) * tau
            rows[2 + i, D1.start + i], rows[2 + i, OFFSETS.start + i] = growth - 1.0, -growth * mirror
            rows[4 + i, OFFSETS.start + 2 + i] = -growth * mirror
            low[17 + i] = high[17 + i] = z[i]
        low[STEPS], high[STEPS] = 3 * (-s.reach, s.gap), 3 * (s.reach, s.widest)
        back, front, right, left = self._area
        low[D0], high[D0] = (back, right if side > 0.0 else -left), (front, left if side > 0.0 else -right)
        high[D1] = (0.0 if self.point else NEXT) * np.array(self.scale.sole)
        low[D1] = -high[D1]
        # As in the stepping law: a step that would wait for ξ aside ends, and one closes up that is beyond the foot.
        most = max(abs(orbit.forward) + c.stretch, NEAR) / max(abs(xi[0] - z[0]), NEAR)
        shortest, longest = max(s.shortest - elapsed, 0.0), max(s.longest - elapsed, 0.0)
        longest = max(min(longest, max(math.log(most), 0.0) / omega), shortest)
        longest = shortest if xi[1] - z[1] < -c.over else longest
        low[TAU], high[TAU] = math.exp(omega * shortest) / tau, math.exp(omega * longest) / tau
        begin = time.perf_counter()
        x, _, flag, _ = daqp.solve(self._hessian, self._gradient, rows, high, low, self._sense)
        self.times.append(time.perf_counter() - begin)
        if flag < 1 and self._solution is not None:
            return
        x = x if flag >= 1 else wanted
        self._wanted_cop = float(x[6]), side * float(x[7])
        (cos, sin), forward, lateral = self.steering.direction, float(x[0]) - c.carrying, side * float(x[1])
        place = pivot[0] + cos * forward - sin * lateral, pivot[1] + sin * forward + cos * lateral
        self._solution = place, elapsed + math.log(max(float(x[TAU]) * tau, 1.0)) / omega


def walk(sole: str, family: str, seed: int, distance: float, point: bool) -> dict[str, Any]:
    """Return the record of one walk."""
    ground = {"terrain": family, "amplitude": HEIGHTS[family], "seed": seed, **SOLES[sole]}
    plan = WalkPlan(distance=distance)
    spec = WalkSpec(law="stepping", mode="torque", noise="realistic", plan=plan, changes=CHANGES, **ground)
    OneLawGait.point = point
    with patch.object(source, "SteppingGait", OneLawGait):
        trial = WalkTrial(spec)
    gait: Any = trial.walking.source.gait
    gait.contacts = trial.walking.tasks.contacts
    result = trial.run()
    return {
        "sole": sole, "family": family, "seed": seed, "distance": distance, "point": point,
        "outcome": result.outcome, "fall": result.fall_reason, "steps": result.steps_done,
        "walked": result.distance, "qp_us": 1e6 * float(np.median(gait.times)) if gait.times else None,
    }  # fmt: skip


def main() -> None:
    """Walk what the journal does not have, and print a line for each sole."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--journal", type=Path, required=True)
    parser.add_argument("--sole", nargs="+", choices=tuple(SOLES), default=["long arch 5", "rigid"])
    parser.add_argument("--family", nargs="+", choices=tuple(HEIGHTS), default=list(HEIGHTS))
    parser.add_argument("--seed", nargs="+", type=int, default=[21_000])
    parser.add_argument("--distance", type=float, default=2.0, help="m")
    parser.add_argument("--point", action="store_true", help="keep the area a point")
    given = parser.parse_args()
    rows = map(json.loads, given.journal.read_text().splitlines() if given.journal.exists() else ())
    keys = ("sole", "family", "seed", "distance", "point")
    had = {tuple(row[key] for key in keys): row for row in rows}
    asked = list(product(given.sole, given.family, given.seed, [given.distance], [given.point]))
    for walked in asked:
        if walked not in had:
            had[walked] = walk(*walked)
            with given.journal.open("a") as journal:
                journal.write(json.dumps(had[walked]) + "\n")
            print(json.dumps(had[walked]), flush=True)
    for sole in given.sole:
        outcomes = [had[walked]["outcome"] for walked in asked if walked[0] == sole]
        print(f"{sole}: {outcomes.count('completed')} of {len(outcomes)} completed")


if __name__ == "__main__":
    main()
