"""Pack journals for the repository: `python examples/paper/pack.py walks.jsonl` writes walks.jsonl.xz beside it.

Numbers of results get five significant digits, which halves the file. Specs, versions and keys stay as they are.
"""

import argparse
import lzma
from dataclasses import replace
from pathlib import Path
from typing import Any

from wbc.sim.studies import read_journal
from wbc.sim.studies.journal import PACKED


def rounded(value: Any) -> Any:
    """Return plain values with numbers of five significant digits."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, list):
        return [rounded(each) for each in value]
    if isinstance(value, dict):
        return {name: rounded(each) for name, each in value.items()}
    return value


def pack(path: Path) -> Path:
    """Write a journal, packed or not, as a packed one, and return its path."""
    lines = [
        replace(entry, result=rounded(entry.result), clock=None).line()
        for entry in read_journal(path).values()
    ]
    packed = path.with_suffix(PACKED) if path.suffix == PACKED else path.with_name(path.name + PACKED)
    packed.write_bytes(lzma.compress(b"".join(lines), preset=9 | lzma.PRESET_EXTREME))
    return packed


def main() -> None:
    """Pack journals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("journals", nargs="+", type=Path)
    journals = parser.parse_args().journals
    if missing := [str(journal) for journal in journals if not journal.is_file()]:
        parser.error(f"no file: {', '.join(missing)}")
    for journal in journals:
        made = pack(journal)
        print(f"{made}: {made.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
