"""Parts that the programs of trials share: ranges of numbers, and the programs of `examples` that they run.

What imports this module can import those of the tour and of hands.
"""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path[:0] = [str(EXAMPLES / folder) for folder in ("tour", "hands")]


def span(text: str) -> range:
    """Return the numbers that an option names: "7", or "0-19", the last one included."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)
