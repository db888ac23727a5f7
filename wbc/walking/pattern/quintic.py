"""Polynomials that join positions, velocities and accelerations."""

from __future__ import annotations


class Quintic:
    """Polynomial of fifth order with given position, velocity and acceleration at both ends.

    Attributes:
        duration: Time between the ends, s.
    """

    def __init__(
        self,
        start: tuple[float, float, float],
        end: tuple[float, float, float],
        duration: float,
    ) -> None:
        """Fit.

        Args:
            start: Position, velocity and acceleration at time 0.
            end: The same at the end.
            duration: Time between them, s, above zero.
        """
        self.duration = duration
        p0, v0, a0 = start
        p1, v1, a1 = end
        t = duration
        d = p1 - p0 - v0 * t - 0.5 * a0 * t * t
        v = (v1 - v0 - a0 * t) * t
        a = (a1 - a0) * t * t
        self._c = (
            p0,
            v0,
            0.5 * a0,
            (10.0 * d - 4.0 * v + 0.5 * a) / t**3,
            (-15.0 * d + 7.0 * v - a) / t**4,
            (6.0 * d - 3.0 * v + 0.5 * a) / t**5,
        )

    def at(self, time: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at a time between the ends."""
        c0, c1, c2, c3, c4, c5 = self._c
        t = time
        return (
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5))),
            2 * c2 + t * (6 * c3 + t * (12 * c4 + t * 20 * c5)),
        )
