"""Programs of `examples` that benchmarks run: what imports this module can import those of the tour and of hands."""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
sys.path[:0] = [str(EXAMPLES / folder) for folder in ("tour", "hands")]
