"""The source of a robot in the format in which its XML is written."""

from __future__ import annotations

from wbc.base.files import first_tag, parse_xml
from wbc.robots import urdf
from wbc.robots.source import Source
from wbc.robots.source_urdf import Urdf


def source_of(text: str) -> Source:
    """Return the source of a robot whose XML was written by a `Source`."""
    if first_tag(text) == "mujoco":
        from wbc.robots.readers.source_mjcf import Mjcf  # noqa: PLC0415  MuJoCo is imported with it

        return Mjcf(parse_xml(text))
    return Urdf(urdf.read(text))
