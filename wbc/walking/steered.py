"""Protocol of controls of a robot that walks as it is steered."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from wbc.core.drive.control import Control
from wbc.ground import KnownGround, PointCloud
from wbc.ground.cloud import ElevationMap
from wbc.walking.plans.sources import Velocity, VelocityLimits
from wbc.walking.source import Progress


class SteeredControl(Control, ABC):
    """Control of a robot that walks: `WalkingControl`, `wbc.policy.PolicyControl`, its guard, or one of your own.

    Simulated walks and pages ask for nothing but what is here and in `wbc.Control`.

    Attributes:
        ground: Known ground, to which clouds of points are added; None for a robot that walks blind.
    """

    __slots__ = ()

    ground: KnownGround | None = None

    @property
    @abstractmethod
    def velocity(self) -> Velocity | None:
        """Velocity that is asked for: ahead, aside (m/s) and turn (rad/s); None for a stand. Assign it at any tick."""

    @velocity.setter
    @abstractmethod
    def velocity(self, value: Sequence[float] | None) -> None: ...

    @property
    @abstractmethod
    def velocity_limits(self) -> VelocityLimits:
        """Largest velocities that can be asked for."""

    @property
    def steered(self) -> bool:
        """True if the robot can be steered by its velocity."""
        return True

    @property
    @abstractmethod
    def progress(self) -> Progress:
        """Record of the step in the last tick: phase of the feet, events, and number of steps."""

    @property
    def steps_done(self) -> int:
        """Number of steps that have ended."""
        return self.progress.steps_done

    @property
    @abstractmethod
    def done(self) -> bool:
        """True once the robot stands and nothing else is asked of it, and after a fall."""

    def stop(self) -> None:
        """Come to a stand safely."""
        self.velocity = None

    def see(self, seen: PointCloud | ElevationMap) -> None:
        """Take a cloud of points or a map of the ground; a blind control ignores it."""
        if self.ground is not None:
            self.ground.add(seen)
