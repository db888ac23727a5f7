"""Full disks for tests: files that cannot grow beyond a size, without a disk of their own."""

from __future__ import annotations

import contextlib
import os
import resource
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def limited_file_size(size: int) -> Iterator[None]:
    """Let no file of this process and of those that it starts grow beyond a size, bytes; writing fails with EFBIG.

    Python writes no bytecode meanwhile: it would leave a truncated `.pyc`, which every later import trips over.
    """
    bytecode, name = sys.dont_write_bytecode, "PYTHONDONTWRITEBYTECODE"
    variable = os.environ.get(name)
    sys.dont_write_bytecode, os.environ[name] = True, "1"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = bytecode
        if variable is None:
            del os.environ[name]
        else:
            os.environ[name] = variable
