"""Draw the figures that are computed and not simulated: `python docs/pictures/figures.py [FOLDER]`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pinocchio as pin
from architecture import architecture_svg
from arguments import target
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from tick_picture import tick_svg

import wbc
from wbc.app.view.marks import COM_COLOUR as COM
from wbc.app.view.marks import DCM_COLOUR as DCM
from wbc.app.view.marks import ZMP_COLOUR as ZMP
from wbc.base.numbers import Array
from wbc.feet.sensing.roughness import PARAMETERS, UNITS, RoughnessSettings, low_pass, roughness
from wbc.sim.terrain.plot import _number
from wbc.sim.terrain.spec import terrain
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.lipm.schedule import schedule
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.planners import walk_distance
from wbc.walking.stepping.law import Orbit
from wbc.walking.stepping.program import Bounds, Now, StepProgram, Wish
from wbc.walking.stepping.settings import SteppingSettings

FOOT = "#90a4ae"


def corners(step: Footstep, size: tuple[float, float]) -> Array:
    """Corners of a sole seen from above, shape (4, 2), m."""
    half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * size
    c, s = np.cos(step.yaw), np.sin(step.yaw)
    placed: Array = half @ np.array([[c, s], [-s, c]]) + (step.x, step.y)
    return placed


def draw_pattern(path: Path) -> None:
    """CoM, DCM and ZMP of a short walk as planned: over time, and from above."""
    robot = wbc.load_robot("hrp4_class").robot()
    sole = robot.soles[0]
    size = (sole.length, sole.width)
    plan = walk_distance(FootstepPlan.standing(robot), 0.58)
    supports = schedule(plan)
    planner = LipmWalk(robot, plan, float(robot.com[2]), 0.005).course.preview  # as a walk makes it
    pattern = planner.plan(supports, Pendulum.at_rest(robot.com))
    times = np.arange(0.0, pattern.times[-1] + 0.5, 0.005)
    states = [pattern.at(float(t)) for t in times]
    com, dcm, zmp = (np.array([getattr(s, name)[:2] for s in states]) for name in ("com", "dcm", "zmp"))

    figure, axes = plt.subplot_mosaic(
        "ac;bc", figsize=(9.6, 4.4), layout="constrained", width_ratios=(1.6, 1.0)
    )
    for axis, k, what in ((axes["a"], 0, "forward"), (axes["b"], 1, "left")):
        start = 0.0
        for support in supports:
            edges = np.concatenate([corners(foot, size)[:, k] for foot in support.feet])
            axis.fill_between(
                [start, start + support.duration], edges.min(), edges.max(), color=FOOT, alpha=0.3, lw=0
            )
            start += support.duration
        for values, colour, label in ((com, COM, "CoM"), (dcm, DCM, "DCM"), (zmp, ZMP, "ZMP")):
            axis.plot(times, values[:, k], color=colour, label=label, lw=1.4)
        axis.set_ylabel(f"{what} (m)")
        axis.margins(x=0.0)
    axes["a"].legend(loc="upper left", ncols=3, frameon=False)
    axes["a"].tick_params(labelbottom=False)
    axes["b"].set_xlabel("time (s)")
    draw_from_above(axes["c"], plan, size, {COM: com, DCM: dcm, ZMP: zmp})
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_from_above(
    axis: Axes, plan: FootstepPlan, size: tuple[float, float], ways: dict[str, Array]
) -> None:
    """Footsteps and the paths over them, by their colours."""
    for step in (plan.left, plan.right, *plan.steps):
        axis.add_patch(Polygon(corners(step, size)[:, ::-1], color=FOOT, alpha=0.35, lw=0))
    for colour, values in ways.items():
        axis.plot(values[:, 1], values[:, 0], color=colour, lw=1.4)
    axis.set_aspect("equal")
    axis.invert_xaxis()
    axis.set_xlabel("left (m)")
    axis.set_ylabel("forward (m)")


def draw_roughness(path: Path) -> None:
    """Two grounds of one amplitude, what a foot feels of them, and their roughness."""
    settings = RoughnessSettings()
    assert settings.corner is not None
    figure, axes = plt.subplots(2, 1, figsize=(9.6, 3.6), sharex=True, sharey=True, layout="constrained")
    x = np.arange(-0.7, 0.7, 0.002)
    for axis, cutoff in zip(axes, (0.01, 0.1), strict=True):
        ground = terrain("random", amplitude=0.03, seed=4, cutoff=cutoff)
        z = np.array([float(ground.height(value, 0.0)) for value in x + 0.5 * ground.length])
        found = roughness(x, z, settings)
        axis.plot(x, 1e3 * z, color=FOOT, lw=1.2, label="ground")
        felt = 1e3 * low_pass(z, 0.002, settings.corner)
        axis.plot(x, felt, color=COM, lw=1.6, label="as a long foot feels it")
        each = zip(PARAMETERS, UNITS, found.values, strict=True)
        values = ", ".join(_number(*one) for one in each if one[0] in ("Sq", "Sku", "P", "K"))
        length = ground.describe()["cutoff_wavelength_m"]
        axis.set_title(f"random, cutoff {cutoff:g} ({length:.2g} m): {values}", loc="left", fontsize=10)
        axis.set_ylabel("height (mm)")
        axis.margins(x=0.0)
    axes[0].legend(loc="upper right", ncols=2, frameon=False, fontsize=9)
    axes[1].set_xlabel("along the way (m)")
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_kinematics(path: Path) -> None:
    """An arm by inverse kinematics, seen from the side: its hand goes around a ball."""
    description = wbc.load_robot("panda")
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, dt=0.01)
    ik.add(wbc.JointLimits())
    ik.add(wbc.PostureTask(), level=1)
    hand = ik.add(wbc.PositionTask("panda_hand"))
    start = hand.target.copy()
    middle, radius = start + [0.02, 0.0, -0.2], 0.08
    ball = wbc.Obstacle("ball", wbc.CollisionSphere(radius), pin.SE3(np.eye(3), middle))
    ik.add(wbc.CollisionLimit(obstacles=[ball], shapes=description.collision_shapes()))
    hand.move_to(start + [0.0, 0.0, -0.4], duration=2.0)
    links = [f"panda_link{i}" for i in range(9)] + ["panda_hand"]
    figure, axis = plt.subplots(figsize=(5.2, 4.2), layout="constrained")
    axis.add_patch(Circle(middle[[0, 2]], radius, color=ZMP, alpha=0.35, lw=0))
    trace = []
    for step in range(500):
        if step % 100 == 0 and step < 400:
            arm = np.array([robot.placement(link).translation for link in links])
            axis.plot(arm[:, 0], arm[:, 2], "-o", color=COM, alpha=0.3 + step / 600.0, lw=2.0, ms=3.0)
        ik.step()
        trace.append(robot.placement("panda_hand").translation.copy())
    places = np.array(trace)
    axis.plot(places[:, 0], places[:, 2], color=DCM, lw=1.6, label="way of the hand")
    axis.plot(*hand.target[[0, 2]], "x", color=ZMP, label="target")
    axis.set_aspect("equal")
    axis.set_xlabel("forward (m)")
    axis.set_ylabel("up (m)")
    axis.legend(frameon=False)
    print(f"hand within {1e3 * float(np.linalg.norm(hand.error)):.1f} mm")
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_law(path: Path) -> None:
    """A step of `g1` as the law of free steps decides it: without a push, and after one that moved the DCM aside."""
    settings, omega, height = SteppingSettings(), 4.05, 0.597
    time, width, push, at = settings.step_time / omega, settings.width * height, 0.025, 0.15
    orbit = Orbit.of((0.3, 0.0), 1.0, width, time, time, omega)
    length = 0.3 * time
    offsets = (orbit.ahead, -orbit.inwards) * 3
    wish = Wish((length, width) * 3, offsets, time)
    bounds = Bounds(
        ((-0.6, 0.06), (0.6, 0.75)),
        ((0.0, 0.0), (0.0, 0.0)),
        (0.0, 0.0),
        (settings.shortest / omega - at, time),
    )
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.6), sharey=True, layout="constrained")
    titles = "no push", f"ξ pushed by {1e3 * push:.0f} mm"
    for axis, title, moved in zip(axes, titles, (0.0, push), strict=True):
        start = np.array((orbit.ahead, orbit.inwards))
        before = start * np.exp(omega * np.linspace(0.0, at, 40))[:, None]
        now = before[-1] + (0.0, moved)
        pendulum = Now(tuple(now), (0.0, 0.0), omega, time - at, time - at)
        step = StepProgram(height).solve(pendulum, wish, bounds)
        assert step is not None
        after = now * np.exp(omega * np.linspace(0.0, step.left, 60))[:, None]
        place = np.array(step.place)
        for foot, colour in (((0.0, 0.0), FOOT), (tuple(place), DCM)):
            sole = corners(Footstep("left", foot[0] + 0.02, foot[1], 0.0, 0.0), (0.17, 0.06))
            axis.add_patch(Polygon(sole[:, ::-1], color=colour, alpha=0.35, lw=0))
        axis.plot(0.0, 0.0, "o", color=ZMP, ms=5)
        axis.annotate("p", (0.0, 0.0), (5, -11), textcoords="offset points", color=ZMP)
        axis.plot(before[:, 1], before[:, 0], color=DCM, lw=1.6)
        axis.plot(after[:, 1], after[:, 0], color=DCM, lw=1.6)
        if moved:
            axis.plot([before[-1][1], now[1]], [before[-1][0], now[0]], ":", color=DCM, lw=1.6)
        axis.annotate("ξ", after[30][::-1], (8, -2), textcoords="offset points", color=DCM)
        axis.annotate("", after[-1][::-1], place[::-1], arrowprops={"arrowstyle": "->", "color": COM})
        axis.annotate("b", 0.5 * (after[-1] + place)[::-1], (-8, 4), textcoords="offset points", color=COM)
        axis.set_title(f"{title}: {at + step.left:.2f} s, {1e3 * place[1]:.0f} mm aside", fontsize=10)
        axis.set_aspect("equal")
        axis.set_xlabel("outwards (m)")
        axis.set_xlim(0.34, -0.08)
    axes[0].set_ylabel("ahead (m)")
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_architecture(path: Path) -> None:
    """Rooms of the library, and who imports whom."""
    path.write_text(architecture_svg(Path(__file__).resolve().parents[2]), encoding="utf-8")


def draw_tick(path: Path) -> None:
    """Steps of a tick, in their order."""
    path.write_text(tick_svg(), encoding="utf-8")


def main() -> None:
    """Draw all figures."""
    folder = target(__doc__)
    folder.mkdir(parents=True, exist_ok=True)
    mpl.use("Agg")
    # The same bytes from the same numbers, so that a figure changes only when what it shows does.
    mpl.rcParams |= {
        "svg.hashsalt": "wbc",
        "svg.fonttype": "none",
        "font.family": "sans-serif",
        "path.simplify_threshold": 0.5,
    }
    pictures = {
        "architecture.svg": draw_architecture,
        "kinematics.svg": draw_kinematics,
        "law.svg": draw_law,
        "pattern.svg": draw_pattern,
        "roughness.svg": draw_roughness,
        "tick.svg": draw_tick,
    }
    for name, draw in pictures.items():
        draw(folder / name)
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main()
