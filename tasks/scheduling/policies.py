"""Stiffness policies: decide the stiffness of a sole from the ground that the swing foot has scanned."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np

from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.registry import Registry, call_checked
from wbc.base.settings import NonNegative, settings
from wbc.feet.sensing.roughness import LEAST_SAMPLES, roughness
from wbc.feet.sensing.scan import Profile, ScanSettings
from wbc.feet.stiffness.model import StiffnessDecision, StiffnessModel, default_model


@dataclass(frozen=True, eq=False)
class SwingScan:
    """Input of a stiffness policy: data of one swing at the time of the decision.

    Attributes:
        side: The foot that swings, "left" or "right".
        step: Number of this swing since the start, from 0.
        time: Time of the decision, s.
        time_left: Time until the planned landing of the foot, s.
        position: Estimated centre of the swinging sole in the world, shape (3,), m.
        landing: Planned centre of the sole at the landing in the world, shape (3,), m; equal to `position` without a
            plan.
        actual: Present stiffness of the sole, Nm/rad.
        profile: Profile of the ground under the path of the toe; None if too little of it was seen.
        compliance: Depth by which a foot sinks in the last steps over its load, of ground and sole together, m/N; 0 on
            rigid ground, and where nothing is known.
    """

    side: str
    step: int
    time: float
    time_left: float
    position: Array
    landing: Array
    actual: float
    profile: Profile | None
    compliance: float = 0.0


class StiffnessPolicy(ABC):
    """Base of stiffness policies; a scheduler also accepts a plain function of a `SwingScan`.

        class SofterWhereItIsRough(StiffnessPolicy):
            def decide(self, swing):
                return 40.0 if np.ptp(swing.profile.z) < 0.01 else 5.0

    Attributes:
        needs_scan: True if `decide` needs a long enough profile; without one the sole keeps its stiffness.
    """

    needs_scan: ClassVar[bool] = True

    def prepare(self, scan: ScanSettings) -> None:  # noqa: B027 - optional
        """Do slow work in advance; raise an `InputError` if the policy cannot use profiles of this kind."""

    def standing(self, single: bool) -> float | None:
        """Return the stiffness of a standing foot, Nm/rad; None keeps that of its landing.

        `single` is True if the other foot is in the air.
        """
        del single
        return None

    @abstractmethod
    def decide(self, swing: SwingScan) -> StiffnessDecision | float | None:
        """Return the stiffness, Nm/rad, or a whole decision; None if the policy cannot decide.

        It runs inside a control tick, so it must be quick.
        """


PolicyLike: TypeAlias = StiffnessPolicy | Callable[[SwingScan], StiffnessDecision | float | None]
"""A policy, or a plain function."""


@settings
class FixedPolicy(StiffnessPolicy):
    """Always the same stiffness.

    Attributes:
        stiffness: Nm/rad.
    """

    stiffness: Annotated[NonNegative, "Nm/rad"] = 5.0
    needs_scan: ClassVar[bool] = False

    def decide(self, swing: SwingScan) -> float:
        """Return the fixed stiffness."""
        return self.stiffness


@dataclass(frozen=True)
class GroundPolicy(StiffnessPolicy):
    """Stiffness as a function of the place, for an oracle that knows the ground; no scan is used.

    Attributes:
        function: World x and y of the planned centre of the sole (m) → stiffness, Nm/rad.
    """

    function: Callable[[float, float], float]
    needs_scan: ClassVar[bool] = False

    def decide(self, swing: SwingScan) -> float:
        """Return the stiffness for the planned place of the landing."""
        return float(self.function(float(swing.landing[0]), float(swing.landing[1])))


@dataclass(frozen=True)
class FunctionPolicy(StiffnessPolicy):
    """A plain function as a policy, called as `StiffnessPolicy.decide`."""

    function: Callable[[SwingScan], StiffnessDecision | float | None]

    def decide(self, swing: SwingScan) -> StiffnessDecision | float | None:
        """Return the answer of the function."""
        return self.function(swing)


@dataclass(frozen=True, eq=False)
class ModelPolicy(StiffnessPolicy):
    """Prediction of a stiffness model for the end of the profile, cut to the length that it was trained on."""

    model: StiffnessModel

    @classmethod
    def load(cls, path: str | Path | None = None) -> ModelPolicy:
        """Read the model from a file; the one that comes with the library when None. See `StiffnessModel.load`."""
        return cls(default_model() if path is None else StiffnessModel.load(path))

    def prepare(self, scan: ScanSettings) -> None:
        """See `StiffnessPolicy.prepare`."""
        trained = self.model.recipe.step
        if abs(scan.step - trained) > 1e-6 * trained:
            raise InputError(
                f"the stiffness model was trained on profiles with a step of {trained:g} m, "
                f"the scan has {scan.step:g} m"
            )
        x = scan.step * np.arange(4 * LEAST_SAMPLES)
        self.model.predict(roughness(x, 0.01 * np.sin(100.0 * x), self.model.recipe.roughness).values)

    def decide(self, swing: SwingScan) -> StiffnessDecision | None:
        """See `StiffnessPolicy.decide`."""
        if swing.profile is None:
            return None
        recipe = self.model.recipe
        profile = swing.profile if recipe.window is None else swing.profile.last(recipe.window)
        seen = roughness(profile.x, profile.z, recipe.roughness).values
        return self.model.predict(np.append(seen, swing.compliance))


def _check(make: object) -> None:
    if not callable(make):
        raise InputError(f"a stiffness policy is registered by its class or a function, got {shown(make)}")


_POLICIES: Registry[Callable[..., StiffnessPolicy]] = Registry(
    "stiffness policy", {"fixed": FixedPolicy, "model": ModelPolicy.load}, group="wbc.policies", check=_check
)


def stiffness_policy_names() -> tuple[str, ...]:
    """Return the names that `stiffness_policy` accepts."""
    return _POLICIES.names()


def stiffness_policy(name: str, **parameters: Any) -> StiffnessPolicy:
    """Make a policy: `stiffness_policy("fixed", stiffness=5.0)`, `stiffness_policy("model", path="model.json")`."""
    return call_checked(f"stiffness policy '{name}'", _POLICIES[name], parameters)


def register_stiffness_policy(name: str, make: Callable[..., StiffnessPolicy]) -> None:
    """Make a policy available by a name that is free; see `Registry.add`.

    The policy is given as its class, or as a function of named parameters.

    A sweep runs walks in other processes, so register the policy in a module that these processes import as well. The
    keys of a journal contain only the name of the policy.
    """
    _POLICIES.add(name, make)


def as_policy(policy: PolicyLike) -> StiffnessPolicy:
    """Return a policy as it is, a function as a `FunctionPolicy`."""
    if isinstance(policy, StiffnessPolicy):
        return policy
    if not callable(policy) or inspect.isclass(policy):
        raise InputError(
            f"a stiffness policy is a StiffnessPolicy or a function of a SwingScan, got {shown(policy)}"
        )
    return FunctionPolicy(policy)
