"""Grounds from a grey image or an array of one's own."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import hashlib
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from wbc.base.errors import InputError
from wbc.base.files import decoding
from wbc.base.numbers import ROUNDING, Array, finite_array
from wbc.base.settings import Positive
from wbc.sim.terrain.families.base import FieldFamily, family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.ground import HeightField

LARGEST_PICTURE = 50_000_000
"""Largest number of pixels of a picture."""

GREY_MODES = ("1", "L", "I", "F", "I;16", "I;16L", "I;16B", "I;16N")
"""Pillow's names for images with one channel of brightness."""


@dataclass(frozen=True)
class GreyMap:
    """A grey image as bytes, so that it can be compared and hashed.

    The first row is the left edge of the ground (largest y), as if seen from above.
    """

    rows: int
    columns: int  # columns run along x
    data: bytes  # brightness as little-endian doubles, row by row

    @cached_property
    def array(self) -> Array:
        """Brightness, shape (rows, columns)."""
        return np.frombuffer(self.data, dtype="<f8").reshape(self.rows, self.columns)

    def __str__(self) -> str:
        """Return size and hash of the image."""
        return f"{self.rows} x {self.columns} pixels, sha256 {hashlib.sha256(self.data).hexdigest()[:16]}"

    __repr__ = __str__

    @staticmethod
    def of(source: Any) -> GreyMap:
        """Read a grey map from an array, or from the path of an image, a .npy or a .csv file."""
        if isinstance(source, GreyMap):
            return source
        if source is None:
            raise InputError("image: source is missing; give a grey image's path or a 2-D array")
        array = finite_array("image", _read(Path(source)) if isinstance(source, (str, Path)) else source)
        if array.ndim != 2:
            raise InputError(f"image must be grey (a 2-D array), got shape {array.shape}")
        if min(array.shape) < 2:
            raise InputError(
                f"image must have at least 2 x 2 pixels, got {array.shape[0]} x {array.shape[1]}"
            )
        if array.max() == array.min():
            raise InputError(
                f"image has one brightness ({array.max():g}) everywhere: no amplitude can be met"
            )
        rows, columns = array.shape
        return GreyMap(rows, columns, np.ascontiguousarray(array, dtype="<f8").tobytes())


def _read(path: Path) -> Array:
    """Read brightness from a file."""
    if not path.exists():
        raise InputError(f"image: no file {path}")
    with decoding(path, "grey image or array") as file:
        if path.suffix == ".npy":
            return np.asarray(np.load(file, allow_pickle=False), dtype=np.float64)
        if path.suffix in (".csv", ".txt"):
            return np.loadtxt(file, delimiter="," if path.suffix == ".csv" else None, ndmin=2)
        from PIL import Image as Picture  # noqa: PLC0415 - only for pictures

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's own limit is beyond the one below
            picture = Picture.open(file)
        with picture:
            if picture.width * picture.height > LARGEST_PICTURE:
                raise InputError(
                    f"image {path} has {picture.width} x {picture.height} pixels, {LARGEST_PICTURE} at most can be used"
                )
            mode, pixels = picture.mode, np.asarray(picture, dtype=np.float64)
    if mode == "RGB" and (pixels == pixels[:, :, :1]).all():
        return np.asarray(pixels[:, :, 0])
    if mode not in GREY_MODES:
        raise InputError(
            f"image {path} is not grey (mode {mode}); convert it to greyscale without transparency"
        )
    return pixels


@family("image")
class Image(FieldFamily):
    """Heights from the brightness of a grey image or the values of an array, black lowest."""

    source: Any = param(
        None, "Path of an image, .npy or .csv file, or a 2-D array; columns along x, first row left"
    )
    # Three pixels, so that the grid of the image itself is what is needed.
    metres_per_pixel: Annotated[Positive, "m"] | None = param(None, "Scale", feature=3.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "source", GreyMap.of(self.source))
        if self.metres_per_pixel is None:
            raise InputError("image has no scale: give metres_per_pixel (m)")

    @property
    def _pixel(self) -> float:
        assert self.metres_per_pixel is not None
        return self.metres_per_pixel

    @property
    def _size(self) -> tuple[float, float]:
        """Extent between the outer pixel centres along and across the track, m."""
        return (self.source.columns - 1) * self._pixel, (self.source.rows - 1) * self._pixel

    def track(self) -> dict[str, float]:
        return dict(zip(("length", "width"), self._size, strict=True)) | {"ramp": 0.0}

    def check_track(self, length: float, width: float) -> None:
        if length > self._size[0] + ROUNDING or width > self._size[1] + ROUNDING:
            raise InputError(
                f"the image covers {self._size[0]:g} m x {self._size[1]:g} m (length x width) at {self._pixel:g} m per "
                f"pixel; the rough part of {length:g} m x {width:g} m does not fit"
            )

    @property
    def grid(self) -> float:
        return self._pixel

    def level(self, site: Site, x: Array, raw: Array) -> tuple[Array, float]:
        """Put the darkest point at the level of the strips: no other change is made to the user's heights."""
        return raw - raw.min(), 0.0

    def heights(self, site: Site, x: Array, y: Array) -> Array:
        length, width = self._size
        whole = HeightField(0.0, length, -width / 2.0, width / 2.0, self.source.array[::-1])
        bx, by = np.broadcast_arrays(np.clip(x - site.x0, 0.0, length), np.clip(y, -width / 2.0, width / 2.0))
        return whole.top(bx.ravel(), by.ravel()).reshape(bx.shape)
