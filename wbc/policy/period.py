"""Period of a policy: its network chooses one action in it, from what the policy observes."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbc.base.errors import InputError, WbcError
from wbc.base.numbers import ROUNDING
from wbc.policy.description import PolicyDescription
from wbc.policy.network import Network
from wbc.policy.terms import TERMS, Observed


class PolicyError(WbcError):
    """An action that cannot be used: of another shape, with a value that is not finite, or too late."""


class PolicyPeriod:
    """Period of a policy, of a whole number of ticks of the control; its network acts in the first tick.

    Attributes:
        observation: What the network saw last, shape (width,): the terms of its description one after another, bounded
            and scaled, each with those of the periods before.
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
        sizes = [TERMS[term.name](observed).size for term in about.observation]
        for term, size in zip(about.observation, sizes, strict=True):
            if isinstance(term.scale, tuple) and len(term.scale) != size:
                raise InputError(
                    f"scale of the term '{term.name}' must have {size} values, got {len(term.scale)}"
                )
        width = sum(size * term.history for size, term in zip(sizes, about.observation, strict=True))
        if width != network.inputs:  # before room is made: a history may be long
            named = ", ".join(
                f"{term.name} {size}" + (f" x {term.history}" if term.history > 1 else "")
                for term, size in zip(about.observation, sizes, strict=True)
            )
            raise InputError(
                f"the network has observations of {network.inputs} values, and the description of {width}: {named}"
            )
        self.observation, self._terms, stop = np.zeros(width, np.float32), [], 0
        for term, size in zip(about.observation, sizes, strict=True):
            start, stop = stop, stop + size * term.history
            part = self.observation[start:stop].reshape(-1, size)
            self._terms.append((part, TERMS[term.name], np.asarray(term.scale), term.clip))
        self._network, self._observed = network, observed
        self._longest, self._most = longest, about.action_clip
        self.begin()

    def begin(self) -> None:
        """Begin anew with the next tick: nothing has been seen, and the last action is zero."""
        self._ticks, self._fresh = 0, True
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
        self._observe()
        start = perf_counter()
        action = np.asarray(self._network.act(self.observation.copy(), step))
        if self._longest is not None and (took := perf_counter() - start) > self._longest:
            raise PolicyError(f"the policy took {1e3 * took:.1f} ms, longer than {1e3 * self._longest:g} ms")
        if action.shape != (wanted := self._observed.action.shape):
            raise PolicyError(f"the policy's action must have shape {wanted}, got {action.shape}")
        if not np.isfinite(action).all():
            raise PolicyError(f"the policy's action has {action[~np.isfinite(action)][0]}")
        np.clip(action, -self._most, self._most, out=self._observed.action)

    def _observe(self) -> None:
        """Read all terms; the first ones fill their whole history."""
        for part, term, scale, clip in self._terms:
            values = term(self._observed)
            if clip is not None:
                values = np.clip(values, -clip, clip)
            values = values * scale
            part[:-1] = values if self._fresh else part[1:]
            part[-1] = values
        self._fresh = False
