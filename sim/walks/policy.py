"""Who sets the soles of a simulated walk: a policy by name, decided by the spec alone."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from wbc.core.errors import InputError
from wbc.feet import Foot, VariableStiffnessFoot
from wbc.sim.changes import Changes, as_changes
from wbc.tasks.stiffness_policy import StiffnessPolicy, stiffness_policy
from wbc.tasks.stiffness_record import StiffnessTiming

DEFAULT_POLICY = "model"
"""Policy of a sole of variable stiffness when none is named: the model that comes with the library."""

FILE, CONTENT = "path", "sha256"
"""Parameters of a policy that name a file, and say what is in it: a spec stands for one walk, whatever happens to the
file."""


def checked_policy(
    foot: Foot, name: str | None, parameters: Changes, timing: StiffnessTiming
) -> tuple[str | None, Changes]:
    """Policy and parameters in their normal form: with a default, and with the hash of a file that is read.

    Args:
        foot: Foot of the walk.
        name: Policy; the default when None.
        parameters: Of the policy.
        timing: When the policy is asked, and what is done without an answer.

    Raises:
        UnknownNameError: No such policy or parameter.
        InputError: A foot without a stiffness to set, a policy that cannot work with such scans, a fallback that the
            actuator cannot set, or a value out of range.
    """
    if not isinstance(foot, VariableStiffnessFoot):
        if name is not None or parameters:
            raise InputError(
                f"a stiffness policy ('{name or DEFAULT_POLICY}') needs feet of variable stiffness: foot 'variable'"
            )
        return None, ()
    chosen = DEFAULT_POLICY if name is None else name
    values = dict(parameters)
    make_policy(chosen, parameters).prepare(timing.scan)
    if timing.fallback is not None:
        foot.actuator.check(timing.fallback)
    file = values.get(FILE)
    if isinstance(file, str):
        values[CONTENT] = file_hash(file)
    return chosen, as_changes(values)


def make_policy(name: str, parameters: Changes) -> StiffnessPolicy:
    """The policy, for one walk.

    Raises:
        UnknownNameError: No such policy or parameter.
        InputError: A value out of range, or a file whose content is not the one that was specified.
    """
    values: dict[str, Any] = dict(parameters)
    content = values.pop(CONTENT, None)
    if content is not None and isinstance(values.get(FILE), str):
        found = file_hash(values[FILE])
        if found != content:
            raise InputError(
                f"{values[FILE]} has changed: its hash is {found}, the walk was specified with {content}"
            )
    return stiffness_policy(name, **values)


def file_hash(path: str) -> str:
    """Hash of a file's content, 16 hex digits.

    Raises:
        InputError: It cannot be read.
    """
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
