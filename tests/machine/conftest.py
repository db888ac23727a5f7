"""For tests of machines: no memory is locked by those that come in one process with all others."""

import pytest


@pytest.fixture(autouse=True)
def _no_locked_memory(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that has run many tests has gigabytes of pages to lock, in each run of a machine."""
    if request.node.get_closest_marker("slow") is None:
        monkeypatch.setattr("wbc.machine.clock.LOCK_ALL", 0)
