"""Threads of the libraries for linear algebra: one, as sums of several depend on their number."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import threadpoolctl  # type: ignore[import-untyped]

_lock = threading.Lock()
_inside = 0
_limits: Any = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Let linear algebra use one thread in the block.

    The number of threads belongs to the whole process. Blocks of several threads of the program overlap: the first one
    sets the limit, and the last one takes it away.
    """
    global _inside, _limits  # noqa: PLW0603 - as global as the number of threads
    with _lock:
        if _inside == 0:
            _any_thread_may_set()
            _limits = threadpoolctl.threadpool_limits(1)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _any_thread_may_set()
                _limits.restore_original_limits()
                _any_thread_may_set()


def _any_thread_may_set() -> None:
    """Let the next thread set the limit: newer versions of threadpoolctl ignore all but the first one."""
    clear = getattr(threadpoolctl.OpenBLASController, "clear_controlling_thread", None)
    if clear is not None:
        clear(force=True)
