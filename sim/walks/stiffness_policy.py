"""Stiffness policy of a simulated walk: by name and parameters, fixed by the spec alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc.base.errors import InputError, choose
from wbc.base.files import file_of, stamped_file
from wbc.base.numbers import finite_scalar
from wbc.base.settings import Changes, as_changes
from wbc.feet import Foot
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.families.patchwork import stretches
from wbc.sim.terrain.spec import Terrain
from wbc.tasks.scheduling.policies import (
    FixedPolicy,
    GroundPolicy,
    StiffnessPolicy,
    stiffness_policy,
    stiffness_policy_names,
)
from wbc.tasks.scheduling.stiffness import StiffnessTiming

ORACLE = "oracle"
"""Policy that knows families and places, for what scheduling can win at most; its parameters are family → Nm/rad."""

DEFAULT_POLICY = "model"
"""Default policy of a sole of variable stiffness: the model that comes with the library."""

FILE = "path"
"""Parameter of a policy for the file that it is read from."""


def checked_policy(
    foot: Foot, name: str | None, parameters: Changes, timing: StiffnessTiming, ground: Terrain
) -> tuple[str | None, Changes]:
    """Return policy and parameters in their normal form: with the default, and with the hash of a file that is read.

    Refused are a foot without a stiffness to set, a policy that cannot work with such scans, and values out of range.
    The `ground` is what an oracle knows.
    """
    if not isinstance(foot, VariableStiffnessFoot):
        if name is not None or parameters:
            raise InputError(
                f"a stiffness policy ('{name or DEFAULT_POLICY}') needs feet of variable stiffness: foot 'variable'"
            )
        return None, ()
    chosen = DEFAULT_POLICY if name is None else name
    # Equal policies are equal specs: whole numbers become numbers, and what is None is left out.
    values: dict[str, Any] = {
        key: float(value) if isinstance(value, int) and not isinstance(value, bool) else value
        for key, value in parameters
        if value is not None
    }
    if FILE in values:
        if not isinstance(values[FILE], str):
            raise InputError(f"{FILE} of a stiffness policy must be the name of a file, got {values[FILE]!r}")
        values[FILE] = stamped_file(values[FILE], "policy")
    policy = make_policy(chosen, as_changes(values), ground)
    policy.prepare(timing.scan)
    known = (
        [finite_scalar(f"stiffness of {n} (Nm/rad)", v) for n, v in values.items()]
        if chosen == ORACLE
        else []
    )
    for stiffness in (policy.stiffness,) if isinstance(policy, FixedPolicy) else known:
        foot.actuator.check(stiffness)
    return chosen, as_changes(values)


def make_policy(name: str, parameters: Changes, ground: Terrain) -> StiffnessPolicy:
    """Return a policy for one walk: one of `stiffness_policy_names()`, or "oracle" with a stiffness, Nm/rad, a family.

    Raises `InputError` for a value out of range, or a file whose content is not the one that was specified.
    """
    values: dict[str, Any] = dict(parameters)
    if FILE in values:
        values[FILE] = file_of(stamped_file(values[FILE], "policy"))
    if choose("stiffness policy", name, (*stiffness_policy_names(), ORACLE)) == ORACLE:
        return _oracle(values, ground)
    return stiffness_policy(name, **values)


def _oracle(stiffness: Mapping[str, Any], ground: Terrain) -> GroundPolicy:
    """Return the policy that knows the family where a foot lands, and the stiffness of each family."""
    for name in stiffness:
        choose("family of an oracle", name, terrain_families())
    parts = stretches(ground)
    for name, _, _ in parts:
        if name not in stiffness:
            raise InputError(f"the oracle has no stiffness for '{name}'; give it as {name}=…, in Nm/rad")
    values = np.array([float(stiffness[name]) for name, _, _ in parts])
    begins = np.array([begin for _, begin, _ in parts])

    def known(x: float, y: float) -> float:
        del y
        return float(values[max(int(np.searchsorted(begins, x, side="right")) - 1, 0)])

    return GroundPolicy(known)
