"""MuJoCo model of a rigid sole."""

from __future__ import annotations

import mujoco

from wbc.feet.soles.common_mjcf import (
    add_bar,
    add_box,
    add_contact_sphere,
    add_foot_body,
    add_range_site,
    part,
    set_inertia,
)
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.model import FootParts
from wbc.feet.soles.sole import FootFit, box_inertia

TOE_TO_RANGE = 0.014
"""Distance of the range sensor from the front edge of a rigid sole, m: where the soft foot has it."""


def build_rigid(
    spec: mujoco.MjSpec,
    ankle_body: mujoco.MjsBody,
    side: str,
    fit: FootFit,
    contact: ContactSpheres,
    *,
    plate: tuple[float, float] | None,
) -> FootParts:
    """Add a rigid sole of spheres under an ankle.

    Args:
        spec: Model under construction.
        ankle_body: Body that carries the foot.
        side: "left" or "right".
        fit: Rectangle of the foot.
        contact: Sphere grid.
        plate: Mass (kg) and thickness (m) of a plate that goes with it; None for a sole that is part of the
            ankle link.
    """
    body = add_foot_body(spec, ankle_body, side, fit)
    length, width = fit.sole.length, fit.sole.width
    if plate is not None:
        mass, thickness = plate
        set_inertia(body, box_inertia(mass, (length, width, thickness), (0.0, 0.0, thickness / 2.0)))
        add_box(body, part(side, "plate"), (0.0, 0.0, thickness / 2.0), (length, width, thickness))
        ankle = fit.sole.ankle
        add_bar(body, part(side, "shank"), (ankle[0], ankle[1], thickness), ankle.tolist(), 0.01)
    geoms = [
        add_contact_sphere(body, part(side, f"sole_{i + 1}_{j + 1}"), (x, y, contact.radius), contact)
        for i, x in enumerate(contact.row_positions(length, contact.rows(length)))
        for j, y in enumerate(contact.column_positions(width))
    ]
    site = add_range_site(body, side, (length / 2.0 - TOE_TO_RANGE, 0.0, contact.radius))
    return FootParts(
        side=side,
        fit=fit,
        body=body.name,
        wrench_site=part(side, "sole"),
        force_sensor=part(side, "force"),
        torque_sensor=part(side, "torque"),
        range_site=site,
        range_height=contact.radius,
        contact_geoms=tuple(geoms),
    )
