"""Names that are loaded when they are used are listed for completion."""

from types import ModuleType

import pytest

import wbc
from wbc import app


@pytest.mark.parametrize("package", [wbc, app])
def test_all_listed_names_are_there(package: ModuleType) -> None:
    assert dir(package)
    for name in dir(package):
        assert getattr(package, name) is not None
