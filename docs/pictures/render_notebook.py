"""Run the notebook of the examples: `python docs/pictures/render_notebook.py [FILE]` stores tables and pictures in it.

Pages in frames are left out: they lead to a server of the run that made them.
"""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import nbclient
import nbformat
from arguments import target
from PIL import Image

NOTEBOOK = Path(__file__).parents[2] / "examples" / "notebook.ipynb"


def stored(output: Any) -> Any:
    """Return an output as it is stored, without frames and what belongs to one run; None for nothing."""
    data = dict(output.get("data", {}))
    if "<table" not in data.get("text/html", ""):
        data.pop("text/html", None)
    if "image/png" in data:
        data["image/png"] = fewer_colours(data["image/png"])
    if "image/png" in data or "text/html" in data or " at 0x" in data.get("text/plain", ""):
        data.pop("text/plain", None)
    return {**output, "data": data, "metadata": {}} if data else None


def fewer_colours(picture: str) -> str:
    """Return a PNG, base64, with 64 colours: a third of the size, and nobody sees it."""
    small = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(picture))) as image:
        image.convert("RGB").quantize(64, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def main() -> None:
    """Run and store."""
    path = target(__doc__, NOTEBOOK)
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=1200).execute()
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            outputs = map(stored, cell.outputs)
            cell.outputs = [nbformat.from_dict(each) for each in outputs if each is not None]
            cell.execution_count = None
            for output in cell.outputs:
                if "execution_count" in output:
                    output["execution_count"] = None
    nbformat.write(notebook, path)
    print(f"wrote {path}, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
