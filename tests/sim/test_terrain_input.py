"""Wrong input to grounds is refused before anything is built, with a message that helps."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from wbc.base.errors import InputError
from wbc.sim.terrain.spec import terrain


def test_ground_higher_than_the_foot_is_lifted_warns() -> None:
    high = terrain("stones", 0.05)
    with pytest.warns(UserWarning, match="clearance"):
        assert not high.clears(0.04)
    assert high.clears(0.05)
    # Of a climb only one riser has to be stepped over, and nothing of a ramp.
    assert terrain("steps", 0.09, riser=0.03).clears(0.03)
    assert terrain("slope", 0.3).clears(0.01)
    with pytest.warns(UserWarning, match="by 45 mm"):
        assert not terrain("steps", 0.09, riser=0.05).clears(0.04)
    with pytest.raises(InputError, match="clearance"):
        high.clears(-0.1)


def _picture(path: Path, mode: str, array: np.ndarray) -> Path:
    Picture.fromarray(array).convert(mode).save(path) if mode != "I;16" else Picture.fromarray(array).save(
        path
    )
    return path


def test_an_array_becomes_the_ground() -> None:
    rng = np.random.default_rng(0)
    grey = rng.uniform(0, 255, (41, 101))
    t = terrain("image", 0.03, source=grey, metres_per_pixel=0.006)
    assert (t.length, t.width) == pytest.approx((0.6, 0.24))
    x, y = t.start + 0.006 * np.arange(101), 0.12 - 0.006 * np.arange(41)
    # Pixel centres, off the edges, where the strips begin.
    want = 0.03 * (grey - grey.min()) / np.ptp(grey)
    np.testing.assert_allclose(t.height(x[1:-1], y[1:-1, None]), want[1:-1, 1:-1], atol=1e-9)
    assert t == terrain("image", 0.03, source=grey.copy(), metres_per_pixel=0.006)
    assert t != terrain("image", 0.03, source=grey[::-1].copy(), metres_per_pixel=0.006)


def test_an_image_is_used_up_to_its_edges_along_and_across() -> None:
    grey = np.random.default_rng(0).uniform(0, 1, (21, 51))
    whole = terrain("image", 0.03, source=grey, metres_per_pixel=0.02)
    assert (whole.length, whole.width, whole.ramp) == pytest.approx((1.0, 0.4, 0.0))
    part = terrain("image", 0.03, source=grey, metres_per_pixel=0.02, length=0.5, width=0.4)
    assert part.height(0.55, 0.1) > 0.0
    for beyond in ({"length": 1.001}, {"width": 0.401}):
        with pytest.raises(InputError):
            terrain("image", 0.03, source=grey, metres_per_pixel=0.02, **beyond)


def test_coarse_images_are_drawn_in_finer_cells_but_stay_the_same() -> None:
    grey = np.random.default_rng(1).uniform(0, 1, (9, 31))
    coarse = terrain("image", 0.03, source=grey, metres_per_pixel=0.05)
    assert coarse.surface.field is not None and max(coarse.surface.field.step) <= 0.007
    x, y = coarse.start + 0.05 * np.arange(31), 0.2 - 0.05 * np.arange(9)
    want = 0.03 * (grey - grey.min()) / np.ptp(grey)
    np.testing.assert_allclose(coarse.height(x[1:-1], y[1:-1, None]), want[1:-1, 1:-1], atol=1e-9)


def test_images_are_read_from_files(tmp_path: Path) -> None:
    eight = np.random.default_rng(2).integers(0, 256, (20, 60)).astype(np.uint8)
    sixteen = eight.astype(np.uint16) * 257
    same = [
        _picture(tmp_path / "grey.png", "L", eight),
        _picture(tmp_path / "deep.png", "I;16", sixteen),
        _picture(tmp_path / "equal.png", "RGB", eight),
        tmp_path / "map.npy",
        tmp_path / "map.csv",
    ]
    np.save(same[3], eight)
    np.savetxt(same[4], eight, delimiter=",")
    prints = {terrain("image", 0.03, source=p, metres_per_pixel=0.01).fingerprint() for p in same}
    assert len(prints) == 1


@pytest.mark.parametrize("name", ["stones", "random"])
def test_nowhere_has_no_height_and_does_not_change_that_of_other_places(name: str) -> None:
    ground = terrain(name, amplitude=0.03)
    x, y = np.linspace(0.4, 2.8, 50), np.zeros(50)
    heights = ground.height(x, y)
    assert np.ptp(heights) > 0.01
    with_nan = ground.height(np.append(x, [np.nan, 1.0]), np.append(y, [0.0, np.nan]))
    np.testing.assert_array_equal(with_nan, np.append(heights, [np.nan, np.nan]))
    assert np.isnan(ground.normal(1.0, np.nan)).all()
