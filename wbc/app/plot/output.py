"""Writer of figures to files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from wbc.app.files import check_target

FORMATS = (".png", ".svg", ".pdf")
DPI = 130


def check_output(path: str | Path) -> Path:
    """Return the path of figures to be written.

    Raises:
        InputError: Another file type, no such folder, or not writable.
    """
    return check_target("a figure", path, FORMATS)


def save(figures: Mapping[str, Figure], path: str | Path) -> list[Path]:
    """Write figures: several into the pages of one PDF, or into files whose names end in theirs.

    Args:
        figures: Figures by name.
        path: File to write; its ending selects the format.

    Returns:
        The written files.

    Raises:
        InputError: A path that cannot be written.
    """
    target = check_output(path)
    if target.suffix.lower() == ".pdf":
        with PdfPages(target) as pages:
            for figure in figures.values():
                pages.savefig(figure)
        return [target]
    written = []
    for name, figure in figures.items():
        place = target if len(figures) == 1 else target.with_name(f"{target.stem}-{name}{target.suffix}")
        figure.savefig(place, dpi=DPI)
        written.append(place)
    return written
