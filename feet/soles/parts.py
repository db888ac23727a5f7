"""`FootParts`: names of the parts that a foot adds to a MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.feet.soles.sole import FootFit


@dataclass(frozen=True)
class FootParts:
    """Names of a built foot's body, sites, sensors, geoms and joints in its MuJoCo model.

    Attributes:
        side: "left" or "right".
        fit: Rectangle, inertia and height of the foot under its ankle.
        body: Body welded under the ankle link, root of all others of the foot; its frame is the sole frame.
        wrench_site: Site of the force sensor, at the sole centre in sole axes.
        force_sensor: Force of the foot on the ankle link reversed, in sole axes, N: the ground's force has
            its opposite sign.
        torque_sensor: Torque of the foot on the ankle link reversed, about the sole centre in sole axes, Nm.
        range_site: Site under the toe whose z axis is the ray of the range sensor.
        range_height: Height of that site over the sole in the rest shape, m.
        contact_geoms: Spheres that touch the ground, row by row from the toe, each row from right to left.
        sole_joints: Hinges of the sole about the transverse axis, from the toe to the heel; empty for a rigid
            sole.
        variable_joints: Hinges whose stiffness follows the commanded one.
        arch_joint: Hinge of the frontal arch, None without one.
        loop_sites: Sites on the arch and on the sole that the loop closure holds together, None without one.
    """

    side: str
    fit: FootFit
    body: str
    wrench_site: str
    force_sensor: str
    torque_sensor: str
    range_site: str
    range_height: float
    contact_geoms: tuple[str, ...]
    sole_joints: tuple[str, ...] = ()
    variable_joints: tuple[str, ...] = ()
    arch_joint: str | None = None
    loop_sites: tuple[str, str] | None = None
