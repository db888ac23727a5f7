"""Who decides the stiffness of a sole: a policy looks at what the swing foot has seen and says a number."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from wbc.core.errors import Array, InputError, choose, finite_scalar, non_negative
from wbc.feet.sensing.scan import Profile, ScanSettings
from wbc.feet.stiffness.model import StiffnessModel, default_model
from wbc.feet.stiffness.roughness import LEAST_SAMPLES, profile_roughness, roughness


@dataclass(frozen=True, eq=False)
class SwingScan:
    """What is known when a stiffness has to be decided.

    Attributes:
        side: The foot that swings, "left" or "right".
        step: Number of this swing since the start, from 0.
        time: Now, s.
        time_left: Until the foot lands as planned, s.
        position: Estimated centre of the swinging sole in the world, shape (3,), m.
        landing: Where that is planned to be at the landing, shape (3,), m; `position` if nobody said.
        actual: Stiffness that the sole has now, Nm/rad.
        profile: Ground that the toe has passed over; None if too little was seen for one.
    """

    side: str
    step: int
    time: float
    time_left: float
    position: Array
    landing: Array
    actual: float
    profile: Profile | None


@dataclass(frozen=True)
class StiffnessDecision:
    """A policy's answer.

    Attributes:
        stiffness: Wanted, Nm/rad.
        cluster: Cluster that it stands for, from 1; None without clusters.
        familiar: False if the ground is unlike anything that the policy knows: the task then falls back.
        distance: To the nearest known ground, in deviations of the features; None without such a thing.
        features: What the decision rests on, name → value.
    """

    stiffness: float
    cluster: int | None = None
    familiar: bool = True
    distance: float | None = None
    features: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        finite_scalar("stiffness that a policy wants (Nm/rad)", self.stiffness)


class StiffnessPolicy(ABC):
    """A way to decide the stiffness; derive from it, or give a plain function of a `SwingScan` to the task.

        class SofterWhereItIsRough(StiffnessPolicy):
            def decide(self, swing):
                return 40.0 if np.ptp(swing.profile.z) < 0.01 else 5.0

    Attributes:
        needs_scan: True if `decide` must only be asked with a profile that is long enough; otherwise the task falls
            back.
    """

    needs_scan: ClassVar[bool] = True

    def prepare(self, scan: ScanSettings) -> None:  # noqa: B027 - optional
        """Check that it can work with such profiles, and do whatever is slow the first time.

        Raises:
            InputError: It cannot.
        """

    @abstractmethod
    def decide(self, swing: SwingScan) -> StiffnessDecision | float | None:
        """Decide, in a small part of a control period.

        Args:
            swing: What is known.

        Returns:
            Stiffness, Nm/rad, alone or with what it rests on; None if the policy has no opinion.
        """


PolicyLike: TypeAlias = StiffnessPolicy | Callable[[SwingScan], StiffnessDecision | float | None]
"""What can decide: a policy, or a plain function."""


@dataclass(frozen=True)
class FixedPolicy(StiffnessPolicy):
    """Always the same stiffness.

    Attributes:
        stiffness: Nm/rad.
    """

    stiffness: float = 5.0
    needs_scan: ClassVar[bool] = False

    def __post_init__(self) -> None:
        non_negative("fixed stiffness (Nm/rad)", self.stiffness)

    def decide(self, swing: SwingScan) -> float:
        """The same stiffness as ever."""
        return self.stiffness


@dataclass(frozen=True)
class GroundPolicy(StiffnessPolicy):
    """An oracle: stiffness as a function of the place, for one who knows the ground. No scan is used.

    Attributes:
        function: World x and y of the planned centre of the sole (m) → stiffness, Nm/rad.
    """

    function: Callable[[float, float], float]
    needs_scan: ClassVar[bool] = False

    def decide(self, swing: SwingScan) -> float:
        """The stiffness for the place where the sole should land."""
        return float(self.function(float(swing.landing[0]), float(swing.landing[1])))


@dataclass(frozen=True)
class FunctionPolicy(StiffnessPolicy):
    """A plain function as a policy.

    Attributes:
        function: What `StiffnessPolicy.decide` is.
    """

    function: Callable[[SwingScan], StiffnessDecision | float | None]

    def decide(self, swing: SwingScan) -> StiffnessDecision | float | None:
        """What the function says."""
        return self.function(swing)


@dataclass(frozen=True, eq=False)
class ModelPolicy(StiffnessPolicy):
    """Ask a stiffness model about the end of the profile, as far as it is longer than those that it was trained on.

    Attributes:
        model: The model.
    """

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
        said = self.model.predict(profile_roughness(profile, recipe.roughness).values)
        return StiffnessDecision(
            stiffness=said.stiffness,
            cluster=said.cluster,
            familiar=said.familiar,
            distance=said.distance,
            features=dict(zip(self.model.settings.features, said.features.tolist(), strict=True)),
        )


_POLICIES: dict[str, Callable[..., StiffnessPolicy]] = {"fixed": FixedPolicy, "model": ModelPolicy.load}


def stiffness_policy_names() -> tuple[str, ...]:
    """Names that `stiffness_policy` accepts."""
    return tuple(_POLICIES)


def stiffness_policy(name: str, **parameters: Any) -> StiffnessPolicy:
    """A policy by name: `stiffness_policy("fixed", stiffness=5.0)`, `stiffness_policy("model", path="model.json")`.

    Args:
        name: One of `stiffness_policy_names()`.
        **parameters: Of that policy.

    Raises:
        UnknownNameError: No such policy, or no such parameter of it.
        InputError: A parameter is missing or out of range.
    """
    make = _POLICIES[choose("stiffness policy", name, _POLICIES)]
    known = inspect.signature(make).parameters
    for parameter in parameters:
        choose(f"parameter of the stiffness policy '{name}'", parameter, known)
    for needed in known.values():
        if needed.default is needed.empty and needed.name not in parameters:
            raise InputError(f"the stiffness policy '{name}' needs a value for '{needed.name}'")
    return make(**parameters)


def register_stiffness_policy(name: str, make: Callable[..., StiffnessPolicy]) -> None:
    """Make a policy of your own available by name, replacing one of the same name.

    Args:
        name: Name for `stiffness_policy`, and for walks. A sweep runs them in processes of their own: register it in a
            module that these import, too. What a name stands for is no part of a journal's keys.
        make: Its class, or a function of named parameters that returns one.
    """
    _POLICIES[name] = make


def as_policy(policy: PolicyLike) -> StiffnessPolicy:
    """Return a policy as it is, a function as a `FunctionPolicy`.

    Raises:
        InputError: Neither.
    """
    if isinstance(policy, StiffnessPolicy):
        return policy
    if not callable(policy) or inspect.isclass(policy):
        raise InputError(
            f"a stiffness policy is a StiffnessPolicy or a function of a SwingScan, got {policy!r}"
        )
    return FunctionPolicy(policy)
