"""Wrong input to grounds is refused before anything is built, with a message that helps."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from wbc.base.errors import InputError
from wbc.base.settings import settings
from wbc.sim.terrain.families.base import ShapeFamily
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.shapes import Shape, dome
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


@settings
class Single(ShapeFamily):
    """One dome, as high as a share of the amplitude."""

    name = "single"
    x: float = 1.0
    y: float = 0.0
    share: float = 1.0
    stop_level: float = 0.0

    @property
    def smallest_feature(self) -> float:
        return 0.1

    def stop(self, site: Site) -> float:
        return self.stop_level

    def shapes(self, site: Site) -> Iterator[Shape]:
        yield dome(self.x, self.y, 0.1, self.share * site.amplitude)


@pytest.mark.parametrize(("x", "y"), [(0.4, 0.0), (3.2, 0.0), (1.0, 0.4), (1.0, -0.4)])
def test_solids_of_a_family_stay_inside_the_rough_part(x: float, y: float) -> None:
    """A dome of 0.1 m radius touches an edge from inside, and is refused a millimetre further."""
    inwards = np.sign([1.8 - x if y == 0.0 else 0.0, -y])
    for by, fits in ((1e-4, True), (-1e-3, False)):
        place = np.array([x, y]) + by * inwards
        ground = terrain(Single(*place.tolist()), 0.05)
        if fits:
            assert ground.height(*place) == pytest.approx(0.05, abs=0.05)
        else:
            with pytest.raises(InputError):
                ground.height(0.0, 0.0)


def test_a_family_must_be_as_high_as_its_amplitude() -> None:
    assert terrain(Single(), 0.05).height(1.0, 0.0) == pytest.approx(0.05)
    for share in (1.0 + 1e-6, 1.0 - 1e-6):
        with pytest.raises(InputError):
            terrain(Single(share=share), 0.05).height(0.0, 0.0)
    high = terrain(Single(stop_level=0.02), 0.05)
    assert high.height(high.stop + 0.1, 0.0) == pytest.approx(0.02)
    assert high.height(high.stop - 0.01, 0.0) == high.height(high.start - 0.1, 0.0) == 0.0


def test_a_profile_has_a_sample_at_each_step_up_to_its_end() -> None:
    ground = terrain("slope", 0.1, direction="up")
    for x0, x1, step, count in ((0.0, 1.0, 0.1, 11), (0.0, 0.99, 0.1, 10), (-0.2, 0.1, 0.15, 3)):
        x, z = ground.profile(x0, x1, 0.2, step)
        np.testing.assert_allclose(x, x0 + step * np.arange(count), atol=1e-12)
        np.testing.assert_array_equal(z, ground.height(x, 0.2))
    x, _ = ground.profile()
    assert x[0] == ground.start and ground.stop - x[-1] < 0.007
    for bad in ({"x0": 1.0, "x1": 1.0}, {"x0": 0.0, "x1": 1.0, "step": 0.99e-7}, {"step": 0.0}):
        with pytest.raises(InputError):
            ground.profile(**bad)
    slope = np.arctan(0.1 / 3.0)
    np.testing.assert_allclose(ground.normal(1.0, 0.1), [-np.sin(slope), 0.0, np.cos(slope)], atol=1e-6)


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
    first, *others = (terrain("image", 0.03, source=p, metres_per_pixel=0.01) for p in same)
    x, y = np.meshgrid(np.linspace(first.start, first.stop, 301), np.linspace(-0.4, 0.4, 81))
    for other in others:
        np.testing.assert_allclose(other.height(x, y), first.height(x, y), atol=1e-12)


@pytest.mark.parametrize("name", ["stones", "random"])
def test_nowhere_has_no_height_and_does_not_change_that_of_other_places(name: str) -> None:
    ground = terrain(name, amplitude=0.03)
    x, y = np.linspace(0.4, 2.8, 50), np.zeros(50)
    heights = ground.height(x, y)
    assert np.ptp(heights) > 0.01
    with_nan = ground.height(np.append(x, [np.nan, 1.0]), np.append(y, [0.0, np.nan]))
    np.testing.assert_array_equal(with_nan, np.append(heights, [np.nan, np.nan]))
    assert np.isnan(ground.normal(1.0, np.nan)).all()
