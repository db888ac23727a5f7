"""Period of a policy: its network chooses one action in it, from what the policy observes."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbc.base.errors import InputError, WbcError
from wbc.base.numbers import ROUNDING
from wbc.policy.description import PolicyDescription
from wbc.policy.network import Network
from wbc.policy.observation import Observation
from wbc.policy.terms import Observed


class PolicyError(WbcError):
    """An action that cannot be used: of another shape, with a value that is not finite, or too late."""


class PolicyPeriod:
    """Period of a policy, of a whole number of ticks of the control; its network acts in the first tick.

    Attributes:
        observation: Observation of the policy.
    """

    def __init__(
        self, network: Network, about: PolicyDescription, observed: Observed, dt: float, longest: float | None
    ) -> None:
        """Check that a network fits its description, and a control period, s.

        Its actions are written into what is observed; `longest` is the longest time that it may take, s.
        """
        if network.outputs != observed.action.size:
            raise InputError(
                f"the network has actions of {network.outputs} values for {observed.action.size} joints"
            )
        self._every = round(about.period / dt)
        if self._every < 1 or abs(self._every * dt - about.period) > ROUNDING:
            raise InputError(
                f"the period of the policy, {about.period:g} s, must be a multiple of the control period, "
                f"{dt:g} s"
            )
        self.observation = Observation(about.observation, observed, network.inputs)
        self._network, self._observed = network, observed
        self._longest, self._most = longest, about.action_clip
        self.begin()

    def begin(self) -> None:
        """Begin anew with the next tick: nothing has been seen, and the last action is zero."""
        self._ticks = 0
        self.observation.reset()
        self._observed.action[:] = 0.0
        if self._observed.motion is not None:
            self._observed.motion.begin()

    def tick(self) -> bool:
        """Count a tick of the control; return True in the first one of a period."""
        self._ticks += 1
        return self._ticks % self._every == 1 % self._every

    def act(self) -> None:
        """Let the network choose the action of this period.

        Raises:
            PolicyError: The action cannot be used.
            Exception: Whatever a network of the user's own raises.
        """
        step, motion = 0, self._observed.motion
        if motion is not None:
            step = motion.step
            motion.tick()
        observation, start = self.observation.take(), perf_counter()
        action = np.asarray(self._network.act(observation, step))
        if self._longest is not None and (took := perf_counter() - start) > self._longest:
            raise PolicyError(f"the policy took {1e3 * took:.1f} ms, longer than {1e3 * self._longest:g} ms")
        if action.shape != (wanted := self._observed.action.shape):
            raise PolicyError(f"the policy's action must have shape {wanted}, got {action.shape}")
        if not np.isfinite(action).all():
            raise PolicyError(f"the policy's action has {action[~np.isfinite(action)][0]}")
        np.clip(action, -self._most, self._most, out=self._observed.action)
