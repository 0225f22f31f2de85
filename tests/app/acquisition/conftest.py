"""A simulated stand for the tests of the engine."""

import sys
import threading

import pytest

from app.runs.writer_client import WriterClient
from tests.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def shared():
    """One stand for all tests of a module that leave it as it was."""
    if sys.platform == "win32":
        pytest.skip("Windows has no pseudo-terminals")
    from engine_kit import stand

    with stand() as simulated:
        yield simulated


@pytest.fixture
def writer():
    """A writer process."""
    with WriterClient.start() as client:
        yield client


@pytest.fixture
def no_thread_is_left():
    """What feeds a journal or closes a run has ended by the end of the test that began it."""
    before = set(threading.enumerate())
    yield
    for thread in set(threading.enumerate()) - before:
        if thread.name in ("journal", "closing"):
            thread.join(PATIENCE_S)
            assert not thread.is_alive()
