"""Draw steps of a stepping walk, `g1` over stones from above: `python docs/pictures/render_stepping.py [FILE]`.

It takes a few seconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from arguments import IMAGES, target
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

import wbc
from wbc.app.view.marks import DCM_COLOUR as DCM
from wbc.app.view.marks import ZMP_COLOUR as CONTACT
from wbc.base.numbers import Array
from wbc.sim import make_terrain
from wbc.walking import WalkingControl, WalkingControlSettings
from wbc.walking.contact import Event
from wbc.walking.stepping.gait import SteppingWalk

SEED, AMPLITUDE, SPEED = 7, 0.04, 0.4
"""Of the ground, highest stone (m) and commanded velocity (m/s)."""

SHOWN = (9, 18)
"""First and last step that are drawn."""

LANDING, FOOT = "#1565c0", "#90a4ae"
LANDED = (Event.EARLY_TOUCH_DOWN, Event.TOUCH_DOWN, Event.LATE_TOUCH_DOWN)
COLOURS = dict(zip(LANDED, ("#ef6c00", FOOT, "#6a1b9a"), strict=True))


class Step(NamedTuple):
    """One step: DCM, contact point and planned landing at each tick, the foot that landed, and its time.

    Attributes:
        dcm: Shape (ticks, 2), m.
        contact: Shape (ticks, 2), m.
        landing: Shape (ticks, 2), m.
        sole: Corners of the sole that has landed, shape (4, 2), m.
        time: Time from lift-off to the swap of the feet, s.
        planned: Planned time in the middle of the step, s.
        event: Kind of touch-down.
    """

    dcm: Array
    contact: Array
    landing: Array
    sole: Array
    time: float
    planned: float
    event: Event


def steps_of_a_walk(count: int) -> list[Step]:
    """Walk until a number of steps have ended."""
    description = wbc.load_robot("g1")
    ground = make_terrain("stones", amplitude=AMPLITUDE, seed=SEED)
    plant = wbc.Plant(description, terrain=ground, noise="realistic", seed=3, control_period=0.002)
    settings = WalkingControlSettings(mode="torque")
    walking = WalkingControl(description.robot(), None, plant.control_period, settings)
    walking.velocity = (SPEED, 0.0, 0.0)
    robot = walking.drives.observer.robot
    steps: list[Step] = []
    rows: list[tuple[float, ...]] = []
    planned: list[float] = []
    event = Event.TOUCH_DOWN
    while len(steps) < count:
        plant.step(walking.command(plant.measure()))
        now = walking.progress
        assert walking.fallen is None
        event = next((e for e in now.events if e in LANDED), event)
        if Event.LIFT_OFF in now.events and rows:
            sole = robot.soles[now.stance]
            half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (sole.length, sole.width)
            frame = robot.placement(sole.frame)
            corners = frame.translation[:2] + half @ frame.rotation[:2, :2].T
            dcm, contact, landing = np.split(np.array(rows), 3, axis=1)
            middle = planned[len(planned) // 2]
            steps.append(
                Step(dcm, contact, landing, corners, len(rows) * plant.control_period, middle, event)
            )
            rows, planned = [], []
        elif now.landing is not None:
            assert isinstance(walking.source, SteppingWalk)
            gait = walking.source
            rows.append((*gait.felt.dcm[:2], *gait.felt.contact[:2], now.landing.x, now.landing.y))
            planned.append(now.duration)
    return steps


def draw_from_above(axis: Axes, steps: list[Step]) -> None:
    """Draw DCM, contact points and landings over the soles."""
    for number, step in enumerate(steps):
        first = number == 0
        axis.add_patch(Polygon(step.sole, facecolor=FOOT, alpha=0.35, lw=0))
        axis.plot(*step.dcm.T, color=DCM, lw=1.6, label="DCM" if first else None)
        axis.plot(
            *step.contact.T, color=CONTACT, lw=0, marker=".", ms=1.5, label="contact point" if first else None
        )
        axis.plot(
            *step.landing.T,
            color=LANDING,
            lw=0.7,
            alpha=0.7,
            label="landing, at each decision" if first else None,
        )
        axis.plot(
            *step.landing[-1], color=LANDING, marker="x", lw=0, label="at the last one" if first else None
        )
    axis.set(xlabel="forward (m)", ylabel="left (m)", aspect="equal")
    axis.legend(fontsize=7, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)


def draw_times(axis: Axes, steps: list[Step]) -> None:
    """Draw the times of the steps, coloured by the kind of touch-down."""
    numbers = np.arange(SHOWN[0], SHOWN[0] + len(steps))
    for kind, colour in COLOURS.items():
        there = [i for i, step in enumerate(steps) if step.event is kind]
        if there:
            axis.bar(numbers[there], [steps[i].time for i in there], color=colour, label=kind.value)
    axis.plot(numbers, [step.planned for step in steps], "k_", ms=12, label="planned, half way")
    axis.set(xlabel="step", ylabel="time (s)", xticks=numbers)
    axis.legend(fontsize=7, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)


def draw(path: Path) -> None:
    """Draw the figure."""
    steps = steps_of_a_walk(SHOWN[1])[SHOWN[0] - 1 :]
    figure, (above, times) = plt.subplots(
        2, 1, figsize=(7.4, 4.8), layout="constrained", height_ratios=(2.1, 1.0)
    )
    draw_from_above(above, steps)
    draw_times(times, steps)
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    draw(target(__doc__, IMAGES / "stepping.png"))
