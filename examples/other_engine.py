"""Another physics engine: the same robot stands, takes a push and steps in DART, in place of MuJoCo.

`DartLoop` has the methods that depend on the engine; sensors, drives, pushes and the true state are those of
`EngineLoop`. DART is an extra: `pip install -e ".[dart]"` in the clone. A whole walk in DART is
`wbc walk --mode torque --loop examples/other_engine.py:DartLoop`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dartpy as dart
import numpy as np
import pinocchio as pin
from _common import parse, report, upright

from wbc.sim import EngineContacts, EngineLoop, EnginePush
from wbc.walking import WalkingControl, WalkingControlSettings

FRICTION, THICKNESS = 0.8, 0.02
"""Coefficient of friction of the soles, and thickness of the boxes that are their shapes, m."""

DURATION = 0.1
"""Duration of the push, s."""


class DartLoop(EngineLoop):
    """A robot in DART on a floor. Its soles touch the floor as boxes, the rest of it touches nothing."""

    def __init__(self, description: Any, **options: Any) -> None:
        """Build the world; options are those of `EngineLoop`."""
        super().__init__(description, **options)
        self.world = world = dart.simulation.World()
        world.setTimeStep(self.timestep)
        world.setGravity([0.0, 0.0, float(self.robot.model.gravity.linear[2])])
        world.getConstraintSolver().setCollisionDetector(dart.collision.OdeCollisionDetector())
        # DART takes a link without inertia for 1 kg, and knows no rotors.
        urdf = self.description.urdf_without_geometry(moving_links=True, rotors=True)
        self.skeleton = dart.utils.DartLoader().parseSkeletonString(urdf, dart.common.Uri(""))
        self.skeleton.disableSelfCollisionCheck()
        self.feet: dict[str, int] = {}  # link → its number
        for number, (sole, (link, place)) in enumerate(zip(self.robot.soles, self.soles, strict=True)):
            middle = place * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5 * THICKNESS]))
            self._add_box(
                self.skeleton.getBodyNode(link), [sole.length, sole.width, THICKNESS], middle.homogeneous
            )
            self.feet[link] = number
        world.addSkeleton(self.skeleton)
        floor = dart.dynamics.Skeleton("floor")
        _, body = floor.createWeldJointAndBodyNodePair()
        self._add_box(body, [100.0, 100.0, 1.0], pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5])).homogeneous)
        world.addSkeleton(floor)
        joints = [self.skeleton.getDof(name) for name in self.robot.joint_names]
        for joint, name in zip(joints, self.robot.joint_names, strict=True):
            joint.setDampingCoefficient(self.description.damping.get(name, 0.0))
            joint.setCoulombFriction(self.description.frictionloss.get(name, 0.0))
        for number in range(self.skeleton.getNumJoints()):  # DART lets joints pass their stops otherwise
            self.skeleton.getJoint(number).setLimitEnforcement(True)
        self._joints = np.array([joint.getIndexInSkeleton() for joint in joints])
        self._torques = np.zeros(self.skeleton.getNumDofs())
        self._base = self.skeleton.getRootBodyNode()
        self.reset()

    @staticmethod
    def _add_box(body: Any, size: list[float], place: np.ndarray) -> None:
        node = body.createShapeNode(dart.dynamics.BoxShape(size))
        node.setRelativeTransform(dart.math.Isometry3(place))
        node.createCollisionAspect()
        node.createDynamicsAspect().setFrictionCoeff(FRICTION)

    def place(self, q: np.ndarray) -> None:
        """See `EngineLoop`."""
        base, positions = pin.XYZQUATToSE3(q[:7]).homogeneous, self.skeleton.getPositions()
        positions[:6] = dart.dynamics.FreeJoint.convertToPositions(dart.math.Isometry3(base))
        positions[self._joints] = q[7:]
        self.skeleton.setPositions(positions)
        self.skeleton.resetVelocities()
        self.skeleton.clearExternalForces()

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """See `EngineLoop`."""
        base = pin.SE3(self._base.getWorldTransform().matrix())
        turn, rates = base.rotation.T, self.skeleton.getVelocities()[self._joints]
        motion = turn @ self._base.getLinearVelocity().ravel(), turn @ self._base.getAngularVelocity().ravel()
        positions = self.skeleton.getPositions()[self._joints]
        return np.concatenate([pin.SE3ToXYZQUAT(base), positions]), np.concatenate([*motion, rates])

    def advance(self, torque: np.ndarray, pushes: Sequence[EnginePush]) -> None:
        """See `EngineLoop`."""
        self._torques[self._joints] = torque
        self.skeleton.setForces(self._torques)
        for link, force, point in pushes:
            self.skeleton.getBodyNode(link).addExtForce(force, point, False, True)  # the point is in the link
        self.world.step(True)

    def contacts(self) -> EngineContacts:
        """See `EngineLoop`."""
        places, forces, soles = [], [], []
        for contact in self.world.getLastCollisionResult().getContacts():
            for thing, sign in ((contact.collisionObject1, 1.0), (contact.collisionObject2, -1.0)):
                link = thing.getShapeFrame().asShapeNode().getBodyNodePtr().getName()
                if link in self.feet:
                    places.append(contact.point)
                    forces.append(sign * contact.force)
                    soles.append(self.feet[link])
        return EngineContacts(places, forces, soles)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=3.0, robot=("g1", "hrp4_class"), impulse=0.5)
    loop = DartLoop(options.robot)
    settings = WalkingControlSettings(mode="torque")
    walking = WalkingControl(loop.robot.clone(), None, loop.control_period, settings)
    force = np.array([options.impulse * loop.robot.mass / DURATION, 0.0, 0.0])
    pushed = False
    with options.watch(loop.description) as view:
        while loop.time < options.seconds and walking.fallen is None:
            if not pushed and loop.time >= 1.0:
                loop.push("torso", force, DURATION)
                pushed = True
            loop.step(walking.command(loop.measure()))
            view.update(walking.drives.observer.robot)
    return report(
        upright=upright(loop) and walking.fallen is None,
        steps=walking.steps_done,
        forward_mm=1e3 * float(loop.truth().com[0]),
    )


if __name__ == "__main__":
    main()
