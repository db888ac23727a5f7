"""Pictures of grounds show the numbers that they are made of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from wbc.sim.terrain import plot as terrain_plot
from wbc.sim.terrain.spec import terrain


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Figure]:
    """Call a function that draws, and return its figure."""
    figures: list[Figure] = []
    monkeypatch.setattr(terrain_plot, "save_figure", lambda figure, path, *, dpi: figures.append(figure))

    def draw(function: Callable[..., object], *arguments: object) -> Figure:
        function(*arguments, "picture.png")
        figures[-1].draw_without_rendering()
        return figures.pop()

    return draw


def test_a_terrain_is_drawn_from_above_and_from_the_side(drawn: Callable[..., Figure]) -> None:
    ground = terrain("stones", 0.03, 7, width=0.6, length=1.6, strip=0.5)
    top, side, _ = drawn(terrain_plot.plot_terrain, ground).axes
    z = np.asarray(top.images[0].get_array())
    left, right, bottom, upper = top.images[0].get_extent()
    x = left + (np.arange(z.shape[1]) + 0.5) * (right - left) / z.shape[1]
    y = bottom + (np.arange(z.shape[0]) + 0.5) * (upper - bottom) / z.shape[0]
    np.testing.assert_allclose(z[::20], 1e3 * ground.height(x, y[::20, None]), atol=1e-9)
    xs, zs = np.array(side.lines[0].get_data())
    np.testing.assert_allclose(zs, 1e3 * ground.height(xs, 0.0), atol=1e-9)
