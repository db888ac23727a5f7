"""The balance task that every library of the comparison solves, stated once.

Talos stands on two soles and its centre of mass sways at 1 kHz. The comparison writes the task to a file; each
program reads it in an environment of its own. So this module uses the standard library alone and runs
wherever any of the libraries does.
"""

from __future__ import annotations

import json
import math
import resource
from dataclasses import asdict, dataclass
from pathlib import Path

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class BalanceTask:
    """Everything that must be equal for all libraries.

    Gains and weights cannot be made exactly equal (each library regularises forces in its own way), but they do
    not change what is computed in a tick. They are chosen so that the sway is followed to a tenth of a millimetre and
    no joint limit is active.
    """

    urdf: str
    """Robot description without any geometry, as XML text."""
    robot: str
    """Name of the robot."""
    posture: dict[str, float]
    """Half-sitting angle of every actuated joint, rad; start and target of the posture task."""
    base_height: float
    """Height of the base at the start, m; the soles stay wherever this puts them."""
    soles: tuple[str, str]
    """Frames of the two soles, z upwards, at the centre of the rectangle."""
    sole_length: float = 0.2
    """Along x of the sole frame, m."""
    sole_width: float = 0.13
    """Along y of the sole frame, m."""
    friction: float = 0.7
    """Friction coefficient."""
    lateral_amplitude: float = 0.020
    """Of the sway along y, m."""
    lateral_frequency: float = 0.5
    """Of the sway along y, Hz."""
    sagittal_amplitude: float = 0.010
    """Of the sway along x, m."""
    sagittal_frequency: float = 1.0
    """Of the sway along x, Hz."""
    com_stiffness: float = 100.0
    """Of the centre-of-mass task, 1/s²; damping is twice the root of the stiffness, as everywhere here."""
    posture_stiffness: float = 25.0
    """Of the posture task, 1/s²."""
    contact_stiffness: float = 100.0
    """Pulling each sole back to where it started, 1/s²."""
    com_weight: float = 1000.0
    """Cost per (m/s²)²."""
    posture_weight: float = 0.1
    """Cost per (rad/s²)²."""
    braking: float = 20.0
    """Deceleration that the joint-position limits may count on, rad/s²."""
    period: float = 0.001
    """Control period, s."""
    warm_up: int = 1000
    """Ticks before the measured ones: a second, in which the velocity jump of the start dies out."""
    ticks: int = 4000
    """Ticks measured."""

    def save(self, path: Path) -> None:
        """Write the task as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> BalanceTask:
        """Read a task written by `save`."""
        fields = json.loads(path.read_text(encoding="utf-8"))
        fields["soles"] = tuple(fields["soles"])
        return cls(**fields)

    def sway(self, time: float) -> tuple[Vector, Vector, Vector]:
        """Offset of the centre of mass from its start (m), its velocity (m/s) and its acceleration (m/s²)."""
        wx, wy = 2 * math.pi * self.sagittal_frequency, 2 * math.pi * self.lateral_frequency
        ax, ay = self.sagittal_amplitude, self.lateral_amplitude
        sx, cx, sy, cy = math.sin(wx * time), math.cos(wx * time), math.sin(wy * time), math.cos(wy * time)
        return (
            (ax * sx, ay * sy, 0.0),
            (ax * wx * cx, ay * wy * cy, 0.0),
            (-ax * wx * wx * sx, -ay * wy * wy * sy, 0.0),
        )


def damping(stiffness: float) -> float:
    """Critical damping of a stiffness, 1/s."""
    return 2 * math.sqrt(stiffness)


def percentile(values: list[int], percent: float) -> float:
    """Least value that at least `percent` per cent of the values do not exceed (nearest rank)."""
    ordered = sorted(values)
    return float(ordered[max(0, math.ceil(percent / 100 * len(ordered)) - 1)])


def preemptions() -> int:
    """Return how often the system has preempted this process: a measure of the noise."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw


def record(
    task: BalanceTask,
    library: str,
    version: str,
    *,
    nv: int,
    durations: list[int],
    failures: int,
    com_error: float,
    torque_use: float,
    preempted: int,
) -> str:
    """One run as one line of JSON.

    Args:
        task: The task that was run.
        library: Which library ran it.
        version: Its version.
        nv: Degrees of freedom of its model.
        durations: Of the measured ticks, ns.
        failures: Ticks without a solution.
        com_error: Largest distance between the centre of mass and its target in the measured ticks, m.
        torque_use: Largest ratio of a joint torque to its limit in the measured ticks.
        preempted: Times that the process lost the processor while it ran.
    """
    return json.dumps(
        {
            "library": library,
            "version": version,
            "robot": task.robot,
            "nv": nv,
            "median_us": round(percentile(durations, 50) / 1e3, 2),
            "p99_us": round(percentile(durations, 99) / 1e3, 2),
            "ticks": len(durations),
            "failures": failures,
            "com_error_mm": round(com_error * 1e3, 3),
            "torque_use": round(torque_use, 3),
            "preempted": preempted,
        }
    )
