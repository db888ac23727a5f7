"""Writer of figures to files."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.text import Text

from wbc.app.files import PICTURES
from wbc.base.errors import printable
from wbc.base.files import check_target, replacing, save_figure

DPI = 130


def save(figures: Mapping[str, Figure], path: str | Path) -> list[Path]:
    """Write figures: several into the pages of one PDF, or into files whose names end in theirs.

    Args:
        figures: Figures by name.
        path: File to write; its ending selects the format.

    Returns:
        The written files.

    Raises:
        FileError: The disk is full, for example.
    """
    target = check_target("a picture", path, PICTURES)
    for text in (text for figure in figures.values() for text in figure.findobj(Text)):
        if (shown := printable(text.get_text())) != text.get_text():  # of a file of somebody else
            text.set_text(shown)
    if target.suffix.lower() == ".pdf":
        document = io.BytesIO()
        with PdfPages(document) as pages:
            for figure in figures.values():
                pages.savefig(figure)
        with replacing(target) as new:
            new.write_bytes(document.getvalue())
        return [target]
    written = []
    for name, figure in figures.items():
        place = target if len(figures) == 1 else target.with_name(f"{target.stem}-{name}{target.suffix}")
        save_figure(figure, place, dpi=DPI)
        written.append(place)
    return written
