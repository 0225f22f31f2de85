"""A simulated stand for the tests of the engine."""

import sys

import pytest


@pytest.fixture(scope="module")
def shared():
    """One stand for all tests of a module that leave it as it was."""
    if sys.platform == "win32":
        pytest.skip("Windows has no pseudo-terminals")
    from engine_kit import stand

    with stand() as simulated:
        yield simulated
