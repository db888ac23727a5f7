"""MuJoCo model of the soft foot."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.feet.soles.common_mjcf import (
    CONTACT_GROUP,
    add_bar,
    add_box,
    add_contact_sphere,
    add_foot_body,
    add_range_site,
    part,
    set_inertia,
)
from wbc.feet.soles.contact import LOOP_CLOSURE, solver_parameters
from wbc.feet.soles.foot import FootParts
from wbc.feet.soles.soft_design import ARCH_THICKNESS, ROWS, SoftDesign
from wbc.feet.soles.sole import FootFit, box_inertia

_LATERAL = (0.0, 1.0, 0.0)
_VISUAL_GAP = 0.001  # m between the drawn phalanges


class SoftFootBuilder:
    """Builder of one soft foot under an ankle.

    The tree runs ankle → foot body (backward arch, force sensor) → heel phalanx → … → toe, and foot body →
    frontal arch; a `connect` equality closes the arch onto the sole.
    """

    def __init__(
        self, spec: mujoco.MjSpec, ankle_body: mujoco.MjsBody, side: str, foot: SoftDesign, fit: FootFit
    ) -> None:
        """Add the body of a design, as it fits under this ankle, to a model under construction."""
        self.spec, self.side, self.foot, self.fit = spec, side, foot, fit
        self.layout = foot.layout(fit.sole)
        self.body = add_foot_body(spec, ankle_body, side, fit)
        set_inertia(self.body, self.layout.backward_arch)
        add_bar(
            self.body,
            part(side, "backward_arch"),
            self.layout.ankle,
            self.layout.hinges[-1],
            ARCH_THICKNESS / 2.0,
        )
        self._phalanges: list[tuple[mujoco.MjsBody, Array]] = []  # body and its origin, from the toe
        self._hinges: list[str] = []  # of the sole, from the toe

    def build(self) -> FootParts:
        """Add all other parts; return their names."""
        parent, parent_origin = self.body, np.zeros(3)
        for i in reversed(range(self.foot.phalanges)):
            parent, parent_origin = self._add_phalanx(i, parent, parent_origin)
        geoms = self._add_spheres()
        toe, toe_origin = self._phalanges[0]
        sensor_place = np.array([self.layout.centres[0], 0.0, self.foot.hinge_height])
        site = add_range_site(toe, self.side, sensor_place - toe_origin)
        arch_joint, loop_sites = self._add_frontal_arch()
        hinges = tuple(self._hinges)
        return FootParts(
            fit=self.fit,
            body=self.body.name,
            wrench_site=part(self.side, "sole"),
            force_sensor=part(self.side, "force"),
            torque_sensor=part(self.side, "torque"),
            range_site=site,
            contact_geoms=geoms,
            sole_joints=hinges,
            variable_joints=hinges[self.foot.front_hinges :],
            arch_joint=arch_joint,
            loop_sites=loop_sites,
        )

    def _add_phalanx(
        self, i: int, parent: mujoco.MjsBody, parent_origin: Array
    ) -> tuple[mujoco.MjsBody, Array]:
        """Add phalanx i (0 is the toe) with its hinge on the heel side; return its body and the origin of it."""
        foot, name = self.foot, part(self.side, f"phalanx_{i + 1}")
        origin = np.array(self.layout.hinges[i])
        stiffness = foot.stiffness
        if i < foot.front_hinges:
            assert foot.front_stiffness is not None
            stiffness = foot.front_stiffness
        body = parent.add_body(name=name, pos=origin - parent_origin)
        damping = foot.damping_at(stiffness)
        self._hinges.insert(0, _add_hinge(body, f"{name}_pitch", stiffness, damping))
        centre = np.array([self.layout.centres[i], 0.0, foot.thickness / 2.0]) - origin
        size = (self.layout.pitch, foot.width, foot.thickness)
        set_inertia(body, box_inertia(foot.phalanx_mass, size, centre))
        drawn = (self.layout.pitch - _VISUAL_GAP, foot.width - _VISUAL_GAP, foot.thickness)
        add_box(body, f"{name}_box", centre, drawn)
        self._phalanges.insert(0, (body, origin))
        return body, origin

    def _add_spheres(self) -> tuple[str, ...]:
        """Add the grid of contact spheres, each to its phalanx; return their names."""
        foot, contact = self.foot, self.foot.contact
        names = []
        for row, x in enumerate(foot.contact_rows()):
            body, origin = self._phalanges[row // ROWS]
            for column, y in enumerate(contact.column_positions(foot.width)):
                position = np.array([x, y, contact.radius]) - origin
                name = part(self.side, f"sole_{row + 1}_{column + 1}")
                names.append(add_contact_sphere(body, name, position, contact))
        return tuple(names)

    def _add_frontal_arch(self) -> tuple[str, tuple[str, str]]:
        foot, side = self.foot, self.side
        origin, loop_point = np.array(self.layout.ankle), np.array(self.layout.loop_point)
        arch = self.body.add_body(name=part(side, "frontal_arch"), pos=origin)
        joint = _add_hinge(arch, part(side, "arch_pitch"), foot.arch_stiffness, foot.arch_damping)
        set_inertia(arch, pin.SE3(np.eye(3), -origin).act(self.layout.frontal_arch))
        tip = loop_point - origin
        add_bar(arch, part(side, "frontal_arch_bar"), (0.0, 0.0, 0.0), tip, ARCH_THICKNESS / 2.0)
        held, held_origin = self._phalanges[foot.loop_phalanx - 1]
        sites = (part(side, "loop_arch"), part(side, "loop_sole"))
        arch.add_site(name=sites[0], pos=tip, size=[0.004] * 3, group=CONTACT_GROUP)
        held.add_site(name=sites[1], pos=loop_point - held_origin, size=[0.004] * 3, group=CONTACT_GROUP)
        parameters = solver_parameters(LOOP_CLOSURE)
        self.spec.add_equality(
            name=part(side, "loop"),
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=sites[0],
            name2=sites[1],
            solref=parameters.solref,
            solimp=parameters.solimp,
        )
        return joint, sites


def _add_hinge(body: mujoco.MjsBody, name: str, stiffness: float, damping: float) -> str:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=_LATERAL)
    joint.stiffness[0] = stiffness  # the other entries are coefficients of higher powers of the angle
    joint.damping[0] = damping
    return name
