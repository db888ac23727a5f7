"""Wrong input to grounds is refused before anything is built, with a message that helps."""

import copy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from wbc.core.errors import InputError, UnknownNameError, WbcError
from wbc.sim.terrain.families import base
from wbc.sim.terrain.families.base import ShapeFamily, family
from wbc.sim.terrain.families.solids import dome
from wbc.sim.terrain.spec import terrain


def test_unknown_names_get_the_nearest_ones() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'cobble_stones'"):
        terrain("cobblestones")
    with pytest.raises(UnknownNameError, match="did you mean 'density'"):
        terrain("stones", densty=3.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"smallest": 0.2}, r"^stones: smallest \(0.2\) must not exceed largest \(0.15\)$"),
        ({"resolution": 0.005}, "no resolution"),
        ({"length": 1000.0, "rendering": "height_field", "resolution": 1e-5}, "nodes"),
    ],
)
def test_values_out_of_range_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        terrain("stones", **arguments)  # type: ignore[arg-type]


def test_each_family_says_how_high_it_can_be() -> None:
    with pytest.raises(InputError, match=r"at most 0\.025 m"):
        terrain("small_stones", 0.04)
    with pytest.raises(InputError, match="at most 0 m"):
        terrain("flat", 0.01)


def test_too_coarse_a_height_field_names_the_cell_needed() -> None:
    with pytest.raises(InputError, match=r"0\.02 m is too coarse .* at most 0\.00567 m"):
        terrain("floor_tiles", rendering="height_field", resolution=0.02)
    with pytest.raises(InputError, match=r"at most 0\.004 m is needed \(sole spheres of 0\.004 m"):
        terrain("random", resolution=0.007, sole_radius=0.004)
    with pytest.raises(InputError, match=r"at most 0\.00167 m"):
        terrain("sticks", 0.01, rendering="height_field", resolution=0.005)
    assert terrain("random", sole_radius=0.004).cell == pytest.approx(0.0035)
    assert terrain("floor_tiles", rendering="height_field", resolution=0.005).cell == 0.005


def test_families_given_by_heights_have_no_solids() -> None:
    with pytest.raises(InputError, match="not made of solids"):
        terrain("random", rendering="geoms")


def test_tracks_too_small_for_their_family() -> None:
    with pytest.raises(InputError, match="rough part"):
        terrain("large_floor_tiles", width=0.2).height(1.0, 0.0)
    with pytest.raises(InputError, match=r"need a rough part of .* got 3 m"):
        terrain("steps", 0.5, riser=0.02).height(1.0, 0.0)
    with pytest.raises(InputError, match="leaves no ramp"):
        terrain("slope", length=0.5)
    with pytest.raises(InputError, match="no whole wave"):
        terrain("iso8608", low=0.1, high=0.2)
    assert terrain("iso8608", low=0.1, high=0.2, length=5.1, start=0.0).length == 5.1


def test_a_family_that_misses_its_amplitude_or_its_place_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "_FAMILIES", copy.copy(base._FAMILIES))

    @family("test_low")
    class Low(ShapeFamily):
        """A dome that is too low, or too far out."""

        @property
        def smallest_feature(self) -> float:
            return 0.1

        def shapes(self, site):  # type: ignore[no-untyped-def]
            share = 0.9 if site.draws.uniform(0.0, 1.0, 1)[0] < 2.0 and site.width > 0.9 else 1.0
            yield dome(site.x0, 0.0, 0.05, share * site.amplitude)

    with pytest.raises(WbcError, match="built"):
        terrain("test_low").height(0.0, 0.0)
    with pytest.raises(WbcError, match="outside"):
        terrain("test_low", width=0.5).height(0.0, 0.0)
    with pytest.raises(InputError, match="terrain 'stones' is registered already"):
        family("stones")(Low)


def test_ground_higher_than_the_foot_is_lifted_warns() -> None:
    high = terrain("stones", 0.05)
    with pytest.warns(UserWarning, match="by 50 mm, more than the foot clearance of 40 mm"):
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


def test_coarse_images_are_drawn_in_finer_cells_but_stay_the_same() -> None:
    grey = np.random.default_rng(1).uniform(0, 1, (9, 31))
    coarse = terrain("image", 0.03, source=grey, metres_per_pixel=0.05)
    assert coarse.cell <= 0.007
    x, y = coarse.start + 0.05 * np.arange(31), 0.2 - 0.05 * np.arange(9)
    want = 0.03 * (grey - grey.min()) / np.ptp(grey)
    np.testing.assert_allclose(coarse.height(x[1:-1], y[1:-1, None]), want[1:-1, 1:-1], atol=1e-9)
    with pytest.raises(InputError, match="too coarse"):
        terrain("image", 0.03, source=grey, metres_per_pixel=0.05, resolution=0.05)


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


def test_images_that_are_no_height_map_are_refused(tmp_path: Path) -> None:
    colour = np.random.default_rng(3).integers(0, 256, (20, 60, 3)).astype(np.uint8)
    path = tmp_path / "colour.png"
    Picture.fromarray(colour).save(path)
    text = tmp_path / "text.png"
    text.write_text("no picture")
    grey = colour[:, :, 0]
    for source, message in (
        (path, "not grey"),
        (colour, "grey"),
        (text, "cannot be read: cannot identify"),
        (tmp_path / "none.png", "no file"),
        (None, "source is missing"),
        (np.full((5, 5), 7.0), "one brightness"),
        (np.ones((1, 9)), "2 x 2"),
        (np.where(grey > 3, grey, np.nan), "finite"),
    ):
        with pytest.raises(InputError, match=message):
            terrain("image", 0.03, source=source, metres_per_pixel=0.01)
    with pytest.raises(InputError, match="no scale"):
        terrain("image", 0.03, source=grey)
    with pytest.raises(InputError, match="metres_per_pixel"):
        terrain("image", 0.03, source=grey, metres_per_pixel=-0.01)
    with pytest.raises(InputError, match="does not fit"):
        terrain("image", 0.03, source=grey, metres_per_pixel=0.01, length=3.0)


@pytest.mark.parametrize("name", ["stones", "random"])
def test_nowhere_has_no_height_and_does_not_change_that_of_other_places(name: str) -> None:
    ground = terrain(name, amplitude=0.03)
    x, y = np.linspace(0.4, 2.8, 50), np.zeros(50)
    heights = ground.height(x, y)
    assert np.ptp(heights) > 0.01
    with_nan = ground.height(np.append(x, [np.nan, 1.0]), np.append(y, [0.0, np.nan]))
    np.testing.assert_array_equal(with_nan, np.append(heights, [np.nan, np.nan]))
    assert np.isnan(ground.normal(1.0, np.nan)).all()


def test_profiles_must_go_forward() -> None:
    with pytest.raises(InputError, match="profile x1"):
        terrain("flat").profile(1.0, 0.5)
    with pytest.raises(InputError, match="profile step"):
        terrain("flat").profile(step=0.0)
    with pytest.raises(InputError, match=r"profile step \(m\) must be at least 3e-07"):
        terrain("flat").profile(step=1e-300)
    with pytest.raises(InputError, match=r"larger than 1000 m²"):
        terrain("flat", length=100.0, width=12.0)
