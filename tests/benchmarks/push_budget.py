"""Budget of the room of a walking robot that is pushed: DCM, spin, CoP, lean and joint limits, every few ticks.

All along the push, from the edge of the feet on the ground, in mm, positive inside: the room of the true DCM; the room
that is left when the robot has stopped spinning; the room of the true CoP. The spin is the angular momentum about the
centre of mass, as the shift of the DCM that stopping it costs, H / (m h ω), of the robot and of the leg in the air.
Then the lean of the pelvis, as measured and as commanded, mrad, and the joint that is nearest to the end of its range.

Usage: python tests/benchmarks/push_budget.py [--impulse NS_PER_KG] [--direction DEG] [--phase SHARE] [--seed N]
           [--robot NAME] [--set NAME=VALUE ...] [--every TICKS] [--seconds S]
"""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.sim.walks import WalkHook, WalkPlan, WalkPush, WalkSpec, WalkTick, WalkTrial
from wbc.sim.walks.push import LIFT_OFFS
from wbc.walking.planning.footsteps import SIDES, Footstep
from wbc.walking.planning.schedule import support_area

PUSHED_STEP = 5

Array = np.ndarray[Any, Any]


class Budget(WalkHook):
    """Prints a line every few ticks from the lift-off of the pushed step on."""

    def __init__(self, direction: float, every: int, seconds: float) -> None:
        self.along = np.array([math.cos(direction), math.sin(direction)])
        self.axis = np.array([-self.along[1], self.along[0], 0.0])  # of a lean along the push
        self.every, self.seconds = every, seconds
        self.begin: float | None = None
        self.ticks = 0

    def tick(self, tick: WalkTick) -> None:
        """Print, if it is time to."""
        reference, walk = tick.walking.reference, tick.walking.walk
        if reference is None:
            return
        if self.begin is None:
            if walk.steps_done == PUSHED_STEP - 1 and any(event in LIFT_OFFS for event in reference.events):
                self.begin = tick.plant.time
                print(
                    "   s  phase | room: DCM, at rest, CoP | spin: all, leg | lean: is, commanded | range | load N"
                )
            return
        self.ticks += 1
        since = tick.plant.time - self.begin
        if since > self.seconds or self.ticks % self.every:
            return
        print(f"{since:5.3f} {reference.phase.value:>7.7}", self._line(tick))

    def _line(self, tick: WalkTick) -> str:
        truth, plant, walking = tick.plant.truth(), tick.plant, tick.walking
        reference = walking.reference
        assert reference is not None
        soles = [
            pin.SE3(plant.data.site_xmat[site].reshape(3, 3), np.array(plant.data.site_xpos[site]))
            for site in plant.sole_sites
        ]
        feet = tuple(
            Footstep(side, sole.translation[0], sole.translation[1], 0.0, reference.heading)
            for side, sole, stands in zip(SIDES, soles, reference.contact, strict=True)
            if stands
        )
        normals, offsets = support_area(feet, walking.walk.sole_sizes)
        omega = walking.walk.omega
        dcm = truth.com[:2] + truth.com_velocity[:2] / omega
        # Distance to the edge along the push: the first half-plane that the ray leaves.
        ahead = normals @ self.along

        def room(point: Array) -> float:
            inside = offsets - normals @ point
            return 1e3 * float(min(inside[ahead > 1e-6] / ahead[ahead > 1e-6]))

        robot = plant.robot
        data = robot.model.createData()
        pin.computeCentroidalMomentum(robot.model, data, truth.q, truth.v)
        height = float(truth.com[2] - min(sole.translation[2] for sole in soles))
        scale = 1e3 / (robot.mass * height * omega)
        spin = scale * float(data.hg.angular @ self.axis)
        leg = 0.0
        for side, stands in zip(SIDES, reference.contact, strict=True):
            if not stands:
                leg = scale * self._leg(robot, data, side, truth)
        net = pin.Force.Zero()
        for sole, wrench in zip(soles, truth.sole_wrench, strict=True):
            net += sole.act(pin.Force(wrench))
        fx, fy, fz, mx, my, _ = net.vector
        cop = f"{room(np.array([-my / fz, mx / fz])):4.0f}" if fz > 20.0 else "   -"
        lean = [
            1e3 * float(rotation[:, 2] @ np.array([*self.along, 0.0]))
            for rotation in (
                pin.Quaternion(truth.q[3:7]).toRotationMatrix(),
                walking.controller.robot.placement(walking.controller.robot.base_frame).rotation,
            )
        ]
        q = walking.controller.robot.q[7:]
        left = np.minimum(q - robot.position_lower, robot.position_upper - q)
        legs = [any(part in name for part in ("hip", "knee", "ankle")) for name in robot.joint_names]
        near = int(np.where(legs, left, np.inf).argmin())
        loads = " ".join(f"{force:4.0f}" for force in truth.sole_wrench[:, 2])
        return (
            f"| {room(dcm):4.0f} {room(dcm) - spin:4.0f} {cop} | {spin:4.0f} {leg:4.0f} "
            f"| {lean[0]:4.0f} {lean[1]:4.0f} | {robot.joint_names[near]} {1e3 * left[near]:.0f} | {loads}"
        )

    def _leg(self, robot: Any, data: Any, side: str, truth: Any) -> float:
        """Angular momentum of a leg about the centre of mass of the robot, along the axis of the lean."""
        pin.forwardKinematics(robot.model, data, truth.q, truth.v)
        sole = robot.soles[SIDES.index(side)]
        chain = robot.model.supports[robot.model.frames[robot.frame_id(sole.frame)].parentJoint]
        total = np.zeros(3)
        for joint in [joint for joint in chain if joint > 1]:
            body = robot.model.inertias[joint]
            momentum = data.oMi[joint].act(body * data.v[joint])
            arm = data.oMi[joint].act(body.lever) - truth.com
            total += momentum.angular - np.cross(truth.com, momentum.linear)
            total -= body.mass * np.cross(arm, truth.com_velocity)
        return float(total @ self.axis)


def main() -> None:
    """Walk, push and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--impulse", type=float, default=0.2, help="Ns/kg")
    parser.add_argument("--direction", type=float, default=270.0, help="0 is forward, 90 left")
    parser.add_argument("--phase", type=float, default=0.0, help="of the fifth step, a share of it")
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--robot", default="hrp4_class")
    parser.add_argument(
        "--set", action="append", default=[], help="a setting of the walk: name=value as JSON"
    )
    parser.add_argument("--every", type=int, default=4, help="ticks between lines")
    parser.add_argument("--seconds", type=float, default=1.0, help="after lift-off")
    options = parser.parse_args()
    direction = math.radians(options.direction)
    changes = {name: json.loads(value) for name, _, value in (each.partition("=") for each in options.set)}
    push = WalkPush(impulse=options.impulse, direction=direction, step=PUSHED_STEP, phase=options.phase)
    spec = WalkSpec(
        robot=options.robot,
        terrain="flat",
        noise="realistic",
        plan=WalkPlan(distance=1.45),
        seed=options.seed,
        pushes=(push,),
        changes=changes,
    )
    result = WalkTrial(spec).run([Budget(direction, options.every, options.seconds)])
    print(result.outcome, "after", result.steps_done, "steps")


if __name__ == "__main__":
    main()
