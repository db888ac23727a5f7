"""Liveness of processes, for tests of what ends them."""

from __future__ import annotations

import os
from pathlib import Path


def alive(pid: int) -> bool:
    """Return True for a process that runs; an orphan that nobody collects is dead, too."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        if Path("/proc/self").exists():
            return False
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        return True
