"""Pictures of feet on the rig show the numbers that they are made of."""

from __future__ import annotations

import numpy as np
from foot import press_figure
from matplotlib.collections import PathCollection

from wbc.feet import foot
from wbc.sim import FootTest, make_terrain, press

STONES = make_terrain("stones", 0.03, 1)


def test_contacts_of_a_press_are_drawn_where_they_are() -> None:
    test = FootTest(foot("soft"), STONES, yaw=0.8, load=300.0)
    result = press(test, support=False)
    assert result.hold is not None and result.hold.contacts > 3
    _, top, _ = press_figure(test, result).axes
    (spots,) = (each for each in top.collections if isinstance(each, PathCollection))
    np.testing.assert_allclose(spots.get_offsets(), 1e3 * np.array(result.hold.contact_points)[:, :2])
    np.testing.assert_allclose(top.lines[1].get_xydata(), [1e3 * np.array(result.hold.centre_of_pressure)])
