"""HTML that notebooks show for an object in place of its `repr`: `_repr_html_` of IPython."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


def html_table(title: str, rows: Mapping[str, object]) -> str:
    """Return a table of names and values under a title."""
    lines = [
        f"<tr><th style='text-align:left'>{escape(str(a))}</th><td>{escape(str(b))}</td></tr>"
        for a, b in rows.items()
    ]
    return f"<b>{escape(title)}</b><table>{''.join(lines)}</table>"


def html_text(text: str) -> str:
    """Return a text with its columns kept."""
    return f"<pre>{escape(text)}</pre>"


def html_frame(address: str) -> str:
    """Return a page in a frame."""
    return f'<iframe src="{escape(address)}" width="100%" height="480"></iframe>'
