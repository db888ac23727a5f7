"""Tables in notebooks, from the text tables that programs print."""

from __future__ import annotations

import html
import re

_GAP = re.compile(r"\s{2,}")


def html_table(text: str) -> str:
    """Return a text table as HTML: a line is a row, and two or more blanks end a cell."""
    rows = [
        [html.escape(cell) for cell in _GAP.split(line.strip())] for line in text.splitlines() if line.strip()
    ]
    columns = max(map(len, rows), default=1)
    lines = []
    for row in rows:
        wide = f' colspan="{columns}"' if len(row) == 1 else ""
        lines.append("".join(f'<td{wide} style="text-align: left">{cell}</td>' for cell in row))
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"
