"""Punches on the robot of the tour in free steps, in pairs: one punch on one state, by two variants of the law.

    python benchmarks/trials/punches.py base --punches 0-119                          # the law as it is
    python benchmarks/trials/punches.py patient --punches 0-119 --set patience=2.0    # with another constant
    python benchmarks/trials/punches.py softer --punches 0-119                        # after a change of the package
    python benchmarks/trials/punches.py --compare base softer                         # McNemar's test of the pairs

A state is one of a walk of the tour without punches, drawn by a seed. The walk goes on from it with its own torques for
0.05 s, in which the estimates settle, and then under a control that takes it over in its phase, 0.3 s before the punch,
with the arms held. Two punches of each state hit random joints of arms and ankles in random directions. A trial ends
when the robot is caught or has fallen, and is a line of the journal, with the state; what the journal has of this code
is not walked again. States are walked once, by the law as it is, and kept in a journal of their own, which other
variants and other versions of the package read.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import _programs
import _runs
import model
import numpy as np
import pinocchio as pin
import tour
from _runs import Row
from task import DURATION, MovingArms

import wbc
from wbc.core.robot import SIDES
from wbc.core.signals import Command
from wbc.policy.contacts import FootContacts
from wbc.sim import Machine, MujocoLoop
from wbc.sim.studies.intervals import CONFIDENCE, share_interval
from wbc.walking import WalkingControl, WalkingControlSettings
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import SteppingConstants, SteppingSettings

FIRST_RUN, STATES, PUNCHES = 30000, 16, 2
"""First run of the tour whose walks are punched; states of a run, punches of a state."""

BEGIN, EVERY = 2.0, 0.7
"""Time of the first state of a run, and from state to state, s."""

SETTLING = 25
"""Control periods in which a state goes on with the torques of its walk: observers of forces begin at rest."""

LEAD, SOONEST, QUIET, LATEST = 0.3, 0.8, 0.3, 2.5
"""Time before a punch; after it until a robot counts as caught, for which it must be quiet, and the longest one, s."""

LOW, SPEED, TILT = 0.40, 0.4, 0.2
"""Height of the pelvis below which the robot has fallen, m; speed of the CoM, m/s, and tilt of the pelvis, rad, up to
which it is quiet."""

FORCE = 500.0, 650.0
"""Least and greatest force of a punch, N: 1.1 to 1.5 Ns/kg."""

HIT = (*model.ARMS, *(joint for joint in model.LEGS_AND_WAIST if "ankle" in joint))
"""Joints that are hit."""

STANDS = "foot that stands"
"""In place of a joint: the ankle of that foot."""


def states(run: int) -> Row:
    """Walk a tour without punches, and return the states that are punched."""
    walk = tour.Tour(run, tour.Setup(force_sensors=False, punches=False))
    contacts, found = FootContacts(walk.loop.robot, tour.PERIOD), list[Row]()
    begun: Row | None = None
    while len(found) < STATES and not walk.over:
        walk.step()
        truth = walk.loop.truth()
        contacts.update(truth.sole_wrench[:, 2].tolist())
        if begun is not None:
            begun["torques"].append(truth.joint_torque.round(4).tolist())
            if len(begun["torques"]) == SETTLING:
                now = {"arms": walk.arms.target.tolist(), "velocity": walk.walking.velocity}
                found.append({**begun, **now, "air": [*contacts.air], "landed": [*contacts.landed]})
                begun = None
        elif truth.time > BEGIN + EVERY * len(found):
            begun = {"q": truth.q.tolist(), "v": truth.v.tolist(), "torques": []}
    return {"states": found}


class Harness:
    """The robot, its simulation and the servos of its arms, made once."""

    def __init__(self, settings: SteppingSettings, constants: SteppingConstants) -> None:
        """Load the robot; settings and constants are those of its steps."""
        simulated = model.load()
        self.description = wbc.RobotDescription.from_mjcf(simulated)
        machine = Machine(torque_sensors=True, force_sensors=False)
        self.loop = MujocoLoop(
            self.description, simulated, control_period=tour.PERIOD, noise="none", seed=0, machine=machine
        )
        self.gauge = self.description.robot()
        self.settings, self.constants = WalkingControlSettings(mode="torque", stepping=settings), constants

    def punch(self, state: Row, joint: str, force: np.ndarray) -> Row:
        """Punch the robot in a state, and return what became of it."""
        loop, robot = self.loop, self.description.robot()
        q, v = np.array(state["q"]), np.array(state["v"])
        arms = MovingArms(0, robot, state["arms"][:7])
        loop.reset(q, velocity=v)
        robot.update(q, v)
        gait = SteppingWalk.of(robot, tour.PERIOD, self.settings.stepping, constants=self.constants)
        walking = WalkingControl(robot, gait, tour.PERIOD, self.settings)
        walking.release(model.ARMS)
        for torque in state["torques"]:
            walking.drives.estimate(loop.measure())
            loop.step(Command(np.array(torque)))
        self._believe(walking)
        begin, pushed, quiet, energy = loop.time, False, 0.0, 0.0
        while True:
            time = loop.time - begin - LEAD
            if not pushed and time >= -1e-9:
                pushed = True
                if joint == STANDS:
                    joint = f"{SIDES[walking.progress.stance]}_ankle_roll_joint"
                loop.push(joint, force, DURATION, at=[0.0, 0.0, 0.0])
            measured = walking.drives.estimate(loop.measure())
            if loop.time == begin:
                walking.begin(measured, state["air"], state["landed"])
                walking.velocity = state["velocity"]
            command = walking.act(measured)
            torque = np.array(command.joint_torque)
            torque[arms.columns] = arms.torque(
                loop.joint_position[arms.columns], loop.joint_velocity[arms.columns]
            )
            loop.step(dataclasses.replace(command, joint_torque=torque, released=None))
            energy += float(np.abs(loop.joint_torque * loop.joint_velocity).sum()) * tour.PERIOD
            pose = loop.base_pose
            if pose[2] < LOW or loop.diverged is not None:
                return {"held": False, "time": round(time, 3), "energy": round(energy, 1)}
            i, j = pose[3], pose[4]
            tilt = math.hypot(2.0 * i, 2.0 * j)
            if loop.ticks % 10 == 0:
                speed = float(np.linalg.norm(loop.truth().com_velocity))
                quiet = quiet + 0.02 if speed < SPEED and tilt < TILT else 0.0
            if time > LATEST or (time > SOONEST and quiet > QUIET):
                return {"held": True, "time": round(time, 3), "energy": round(energy, 1)}

    def _believe(self, walking: WalkingControl) -> None:
        """Let the estimate have the true velocity, where contacts that were unknown at first have misled it."""
        truth, gauge = self.loop.truth(), self.gauge
        gauge.update(truth.q, truth.v)
        imu = gauge.frame_id(gauge.imu_frame)
        velocity = pin.getFrameVelocity(gauge.model, gauge.data, imu, pin.LOCAL_WORLD_ALIGNED)
        walking.drives.observer.inertial.reset(gauge.placement(imu).rotation, velocity.linear)


def drawn(number: int, force: tuple[float, float], joint: str | None) -> tuple[str, np.ndarray]:
    """Return joint and force (N) of a punch; direction, size and, where none is given, joint are uniform."""
    random = np.random.default_rng(number)
    direction = random.normal(size=3)
    some = HIT[random.integers(len(HIT))]
    return joint or some, random.uniform(*force) * direction / np.linalg.norm(direction)


def varied(changed: Mapping[str, Any]) -> tuple[SteppingSettings, SteppingConstants]:
    """Return settings and constants of free steps, of which some have other values, in their units."""
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in changed.items()}
    names = {field.name for field in dataclasses.fields(SteppingConstants)}
    return (
        SteppingSettings(**{name: value for name, value in values.items() if name not in names}),
        SteppingConstants(**{name: value for name, value in values.items() if name in names}),
    )


@functools.cache
def harness(changed: str) -> Harness:
    """Return the harness of a variant, by what is changed as JSON."""
    return Harness(*varied(json.loads(changed)))


def punched(variant: str, changed: Row, punch: int, joint: str, force: Sequence[float], state: Row) -> Row:
    """Return what became of a punch, N, by a variant of the law, whatever its name and the number of the punch."""
    del variant, punch
    return harness(json.dumps(changed)).punch(state, joint, np.array(force))


_runs.register_runs("states of the tour", states, (_programs.EXAMPLES / "tour").glob("*.py"))
_runs.register_runs("punch", punched, (_programs.EXAMPLES / "tour").glob("*.py"))


def compared(rows: list[Row], first: str, second: str) -> str:
    """Return McNemar's exact test of the pairs that both variants have, with the interval of the gain."""
    from scipy.stats import binomtest  # noqa: PLC0415 - slow to import

    def of(variant: str) -> dict[str, bool]:
        own = [row for row in rows if row["variant"] == variant]
        if len({json.dumps(row["changed"]) for row in own}) > 1:
            raise SystemExit(f"the journal has runs of '{variant}' by several constants: name them apart")
        return {
            json.dumps([row[k] for k in ("punch", "joint", "force", "state")]): row["held"] for row in own
        }

    a, b = of(first), of(second)
    both = a.keys() & b.keys()
    held = [(a[k], b[k]) for k in both]
    lost, gained = held.count((True, False)), held.count((False, True))
    differ, n = lost + gained, len(both)
    if not differ:
        return f"{len(both)} pairs, {sum(h for h, _ in held)} held by both variants, none by one alone"
    low, high = share_interval(gained, differ)  # of the pairs that differ, given their number
    ends = [100.0 * differ * (2.0 * end - 1.0) / n for end in (low, high)]
    return (
        f"{n} pairs: {first} holds {sum(h for h, _ in held)}, {second} {sum(h for _, h in held)}; {gained} gained, "
        f"{lost} lost, p = {binomtest(gained, differ).pvalue:.3f}; gain {100.0 * (gained - lost) / n:+.1f} "
        f"[{ends[0]:+.1f}, {ends[1]:+.1f}] % ({CONFIDENCE:.0%})"
    )


def main() -> None:
    """Punch, or compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("variant", nargs="?", help="name of the variant in the journal")
    parser.add_argument(
        "--punches", type=_programs.span, default="0-119", help="their numbers, default %(default)s"
    )
    parser.add_argument(
        "--set", nargs="*", default=[], help="constants and settings of free steps, name=value"
    )
    parser.add_argument("--force", type=float, nargs=2, default=FORCE, help="least and greatest force (N)")
    parser.add_argument("--joint", choices=(*HIT, STANDS), help="joint that is hit; default a random one")
    parser.add_argument("--compare", nargs=2, metavar="VARIANT", help="compare two variants")
    parser.add_argument("--journal", type=Path, default=Path("punches.jsonl"))
    parser.add_argument("--states", type=Path, default=Path("punches.states.jsonl"))
    given = parser.parse_args()
    if given.compare:
        print(compared(_runs.rows(given.journal, "punch"), *given.compare))
        return
    numbers = given.punches
    try:
        changed = {name: json.loads(value) for name, _, value in (each.partition("=") for each in given.set)}
        varied(changed)
    except ValueError as error:  # of words, and of settings and constants that are none
        parser.error(str(error))
    runs = [{"run": run} for run in sorted({_run(number) for number in numbers})]
    walked = _runs.make_runs(given.states, "states of the tour", runs, any_code=True)
    of_run, wanted = {row["run"]: row["states"] for row in walked}, list[Row]()
    for number in numbers:
        state = of_run[_run(number)][number // PUNCHES % STATES]
        joint, force = drawn(number, tuple(given.force), given.joint)
        hit = {"punch": number, "joint": joint, "force": force.tolist()}
        wanted.append({"variant": given.variant, "changed": changed, **hit, "state": state})
    found = _runs.make_runs(given.journal, "punch", wanted)
    print(f"{given.variant}: {sum(row['held'] for row in found)} of {len(found)} held")


def _run(number: int) -> int:
    return FIRST_RUN + number // (PUNCHES * STATES)


if __name__ == "__main__":
    main()
