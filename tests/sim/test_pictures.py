"""Pictures of grounds and foot tests: Matplotlib is given what was computed, and all of its text can be read."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from scipy.interpolate import RegularGridInterpolator

from wbc.core.errors import InputError
from wbc.feet import foot
from wbc.sim.rig import plot as rig_plot
from wbc.sim.rig.actions import press
from wbc.sim.rig.results import PitchResult, PressResult, SupportPolygon
from wbc.sim.rig.spec import FootTest
from wbc.sim.terrain import plot as terrain_plot
from wbc.sim.terrain.plot import plot_families, plot_terrain
from wbc.sim.terrain.spec import Terrain, terrain

Drawn = Callable[..., Any]  # as stubs of Matplotlib know little of what it returns


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Call a function that draws, and return its figure, which fits a screen with all of its text."""
    figures: list[Figure] = []

    def saved(figure: Figure, path: str, *, dpi: float) -> None:
        assert path == "picture.png"
        width, height = figure.get_size_inches() * dpi
        assert 800 < width < 2000 and 400 < height < 1500, "pixels"
        figure.draw_without_rendering()
        for ax in figure.axes:
            for text in filter(Text.get_text, (ax.title, ax.xaxis.label, ax.yaxis.label)):
                box = text.get_window_extent()
                assert box.x0 >= 0.0 and box.y0 >= 0.0, text
                assert box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1, text
        figures.append(figure)

    for module in (terrain_plot, rig_plot):
        monkeypatch.setattr(module, "save_figure", saved)

    def draw(function: Callable[..., object], *arguments: object) -> Figure:
        function(*arguments, "picture.png")
        return figures.pop()

    return draw


def check_map(ax: Any, ground: Terrain, box: tuple[float, ...]) -> None:
    """Colours are the heights of the middles of square pixels, shades those of a light from the upper left."""
    colours, shades = ax.images
    z, light = np.asarray(colours.get_array()), np.asarray(shades.get_array())
    left, right, bottom, top = extent = colours.get_extent()
    assert extent == shades.get_extent() == pytest.approx(box)
    assert z.shape == light.shape == (round((top - bottom) / 0.004), round((right - left) / 0.004))
    row, column = np.random.default_rng(0).integers(0, [[n] for n in z.shape], (2, 50))
    x = left + (column + 0.5) * (right - left) / z.shape[1]
    y = bottom + (row + 0.5) * (top - bottom) / z.shape[0]
    np.testing.assert_allclose(z[row, column], 1e3 * ground.height(x, y), atol=1e-9)
    low, high = colours.get_clim()
    assert high == z.max() and low == pytest.approx(z.min() - 0.5 * np.ptp(z) - 1.0)
    assert shades.get_clim() == (0.0, 1.0) and 0.3 < float(shades.get_alpha() or 0.0) < 0.5
    assert {image.origin for image in ax.images} == {"lower"} and ax.get_aspect() == 1.0
    rise, across = (2.0 * slope for slope in np.gradient(z, 4.0))  # heights are doubled
    bright = (0.5 * (across - rise) + math.sqrt(0.5)) / np.sqrt(1.0 + rise**2 + across**2)  # a light 45° high
    np.testing.assert_allclose(light * np.ptp(bright), bright - bright.min() if z.any() else 0.0, atol=1e-9)


def test_a_terrain_is_drawn_from_above_and_from_the_side(drawn: Drawn) -> None:
    ground = terrain("stones", 0.03, 7, width=0.6, length=1.6, strip=0.5)
    figure = drawn(plot_terrain, ground)
    top, below, bar = figure.axes
    check_map(top, ground, (-0.2, 2.4, -0.3, 0.3))
    assert top.get_title() == f"stones: amplitude 30 mm, seed 7 - {type(ground.parameters).summary()}"
    assert (top.get_ylabel(), bar.get_ylabel()) == ("y (m)", "z (mm)")
    np.testing.assert_array_equal(top.lines[0].get_ydata(), 0.0)
    (line,) = below.lines
    xs, zs = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    np.testing.assert_allclose(xs, np.arange(-200, 2401) / 1e3, atol=1e-9)
    np.testing.assert_allclose(zs, 1e3 * ground.height(xs, 0.0), atol=1e-9)
    assert below.collections[0].get_datalim(below.transData).intervaly.tolist() == [zs.min(), zs.max()]
    assert below.get_xlim() == pytest.approx((-0.2, 2.4)) and below.get_xlabel() == "x (m)"
    assert below.get_ylabel() == "z at y = 0 (mm)"
    Sa, Sq, Ssk, Sku, Sv, Sp, Sz, M, P, K = ground.roughness().values
    assert below.get_title() == (
        f"roughness along y = 0:  Sa {1e3 * Sa:.3g} mm   Sq {1e3 * Sq:.3g} mm   Ssk {Ssk:.3g}   Sku {Sku:.3g}   "
        f"Sv {1e3 * Sv:.3g} mm   Sp {1e3 * Sp:.3g} mm   Sz {1e3 * Sz:.3g} mm   M {1e6 * M:.3g} mm²   "
        f"P {P:.3g}   K {K:.3g}"
    )


def test_all_families_are_on_the_sheet_with_the_begin_of_their_rough_part(
    drawn: Drawn, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ["flat", "image", "random", "steps", "stones"]
    monkeypatch.setattr(terrain_plot, "terrain_families", lambda: names)
    axes = drawn(plot_families).axes
    assert len(axes) == 8 and [ax.axison for ax in axes] == [True] * 5 + [False] * 3
    for name, ax in zip(names, axes, strict=False):
        ground = terrain_plot.example_terrain(name)
        assert ax.get_title() == f"{name}  {1e3 * ground.amplitude:g} mm"
        check_map(ax, ground, (0.2, 2.3, -0.5, 0.5))
    assert [ax.get_subplotspec().colspan.start for ax in axes[:5]] == [0, 1, 2, 3, 0]


def test_the_example_of_an_image_is_of_rings() -> None:
    ground = terrain_plot.example_terrain("image")
    middle, angle = 0.5 * (ground.start + ground.stop), np.linspace(0.0, 2.0 * math.pi, 9)
    crest = 2.0 * math.pi / 30.0
    for radius, height in ((0.0, 1.0), (0.5 * crest, 0.0), (crest, 1.0), (1.5 * crest, 0.0)):
        z = ground.height(middle + radius * np.cos(angle), radius * np.sin(angle))
        np.testing.assert_allclose(z, height * ground.amplitude, atol=1e-3)


# Foot tests

STONES = terrain("stones", amplitude=0.03, seed=1)


def test_a_press_is_drawn_over_the_ground_that_the_foot_touches(drawn: Drawn) -> None:
    """The foot is turned: where ground and foot are drawn in one frame, contacts lie on the ground."""
    test = FootTest(foot("soft"), STONES, yaw=0.8, load=300.0)
    result = press(test, support=False)
    support = SupportPolygon(
        0.1, ((-0.05, -0.04), (0.07, -0.04), (0.03, 0.05)), 0.0054, 0.07, -0.05, 0.05, -0.04
    )
    hold, sole = result.hold, test.foot.fit(test.robot_sole).sole
    assert hold is not None and hold.contacts > 3
    figure = drawn(rig_plot.plot_press, test, replace(result, support=support))
    side, top, bar = figure.axes
    points, forces = 1e3 * np.array(hold.contact_points), np.array(hold.contact_forces)
    half = 500.0 * np.array([sole.length, sole.width])
    assert side.get_title() == (
        f"SoftFoot on stones (30 mm, seed 1), {hold.force_mean:.0f} N on {hold.contacts} contacts, contact area "
        f"{1e4 * hold.contact_area:.0f} cm², support 54 cm²"
    )
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert labels == {
        "ground across",
        "ground, middle",
        "sole",
        "equivalent support",
        "contacts",
        "centre of pressure",
    }
    # From above.
    (mesh,) = (each for each in top.collections if isinstance(each, QuadMesh))
    z, nodes = np.asarray(mesh.get_array()), mesh.get_coordinates()
    x, y = (0.5 * (nodes[1:, 1:, i] + nodes[:-1, :-1, i]) for i in range(2))
    assert x[0, 0] == pytest.approx(-half[0] - 30.0) and y[0, 0] == pytest.approx(-half[1] - 30.0)
    assert x[-1, -1] == pytest.approx(half[0] + 30.0, abs=2.0) and np.diff(x[0]).max() == pytest.approx(2.0)
    height = RegularGridInterpolator((y[:, 0], x[0]), z)
    np.testing.assert_allclose(height(points[:, 1::-1]), points[:, 2], atol=1.0)
    assert mesh.get_clim()[0] == pytest.approx(z.min() - 2.0 * np.ptp(z) - 1.0)
    assert bar.get_ylim() == pytest.approx((z.min() - 0.5, z.max()))
    outline, centre = (np.column_stack(line.get_data()) for line in top.lines)
    np.testing.assert_allclose(outline, np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * half)
    np.testing.assert_allclose(centre, [1e3 * np.array(hold.centre_of_pressure)])
    ring = [*support.polygon, support.polygon[0]]
    np.testing.assert_allclose(top.patches[0].get_path().vertices[:4], 1e3 * np.array(ring))
    (spots,) = (each for each in top.collections if isinstance(each, PathCollection))
    np.testing.assert_allclose(spots.get_offsets(), points[:, :2])
    np.testing.assert_allclose(spots.get_sizes(), 120.0 * forces / forces.max())
    # From the side, through the same ground and over the same x.
    assert side.get_xlim() == top.get_xlim() and side.bbox.x0 == pytest.approx(top.bbox.x0)
    middle, *soles, skeleton, pressure = side.lines
    xs, zs = np.array(middle.get_data())
    np.testing.assert_allclose(xs, x[0])
    assert np.median(abs(zs - height((0.0, xs)))) < 0.1
    under = height((np.linspace(-half[1], half[1], 99)[:, None], xs))
    band = side.collections[0].get_paths()[0].vertices
    low, high = band[1 : xs.size + 1], band[-2 : -xs.size - 2 : -1]
    for edge, wanted in ((low, under.min(axis=0)), (high, under.max(axis=0))):
        np.testing.assert_allclose(edge[:, 0], xs)
        assert np.median(abs(edge[:, 1] - wanted)) < 0.1
    line = 1e3 * np.array(hold.sole_line)
    dots = np.array([each.get_xydata() for each in soles])
    assert len(soles) == 3 and (np.diff(dots[:, :, 0]) < 0.0).all(), "from toe to heel"
    np.testing.assert_allclose(np.sort(dots.reshape(-1, 2), axis=0), np.sort(line[:, ::2], axis=0))
    assert np.ptp(line[:, 1].reshape(-1, 3), axis=0).max() < 10.0 < np.ptp(line[:3, 1]), "a row lies across"
    assert [each.get_alpha() == 1.0 for each in soles] == [False, True, False]
    np.testing.assert_allclose(skeleton.get_xydata(), 1e3 * np.array(hold.skeleton)[:, ::2])
    assert pressure.get_xdata() == pytest.approx([1e3 * hold.centre_of_pressure[0]] * 2)
    arrows = np.array([[each.xy, each.xyann] for each in side.texts if isinstance(each, Annotation)])
    np.testing.assert_allclose(arrows[:, 1], points[:, ::2])
    np.testing.assert_allclose(
        arrows[:, 0] - arrows[:, 1], np.outer(30.0 * forces / forces.max(), [0.0, 1.0])
    )
    assert drawn(rig_plot.plot_press, test, result).axes[1].patches[:] == [], "no support was measured"


def test_a_pitched_foot_is_drawn_over_its_angle(drawn: Drawn) -> None:
    test = FootTest(foot("rigid"), STONES, load=250.0)
    result = PitchResult(False, (0.1, -0.2, 0.3), (0.05, -0.06, 0.07), (8.0, -9.0, 11.0), (0.1, 0.12, 0.09))
    figure = drawn(rig_plot.plot_pitch, test, result)
    assert figure.get_suptitle() == "RigidFoot on stones (30 mm, seed 1), pitched with 250 N on the ankle"
    values = {
        "centre of pressure, x (mm)": (50.0, -60.0, 70.0),
        "ankle moment (Nm)": (8.0, -9.0, 11.0),
        "ankle height (mm)": (100.0, 120.0, 90.0),
    }
    for ax, (label, wanted) in zip(figure.axes, values.items(), strict=True):
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("pitch, toe down (°)", label)
        np.testing.assert_allclose(ax.lines[0].get_data(), (np.degrees(result.pitch), wanted))


def test_a_foot_that_diverged_is_not_drawn(drawn: Drawn) -> None:
    for draw, nothing in ((rig_plot.plot_press, PressResult(True)), (rig_plot.plot_pitch, PitchResult(True))):
        with pytest.raises(InputError, match="nothing to draw: the simulation diverged"):
            drawn(draw, FootTest(), nothing)
