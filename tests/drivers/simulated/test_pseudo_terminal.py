"""The pseudo-terminal: raw, non-blocking, and aware of its reader."""

import contextlib
import os
import sys
import time
from pathlib import Path

import pytest

from drivers.errors import PortUnavailableError
from drivers.simulated.transport import open_pseudo_terminal

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")


@pytest.fixture
def terminal():
    terminal = open_pseudo_terminal()
    yield terminal
    terminal.close()


def read_all(descriptor: int, size: int) -> bytes:
    data = b""
    while len(data) < size:
        data += os.read(descriptor, size - len(data))
    return data


def test_a_reader_is_noticed_when_it_comes_and_when_it_goes(terminal):
    assert terminal.receive() is None
    for _ in range(2):
        reader = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
        assert terminal.receive() == b""
        os.close(reader)
        assert terminal.receive() is None


def test_bytes_pass_unchanged_both_ways_and_nothing_is_echoed(terminal):
    every_byte = bytes(range(256))
    reader = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
    try:
        assert terminal.send(every_byte) == 256
        assert read_all(reader, 256) == every_byte
        assert terminal.receive() == b""
        os.write(reader, every_byte)
        terminal.wait(1.0)
        assert terminal.receive() == every_byte
    finally:
        os.close(reader)


def test_a_full_terminal_takes_less_and_does_not_block(terminal):
    reader = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
    try:
        taken = [terminal.send(bytes(4096)) for _ in range(64)]
        assert 0 < sum(taken) < 64 * 4096
        assert taken[-1] == 0
        os.read(reader, 4096)
    finally:
        os.close(reader)


def test_waiting_ends_with_a_command(terminal):
    reader = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
    try:
        terminal.receive()
        os.write(reader, b"S")
        before = time.monotonic()
        terminal.wait(60.0)
        assert time.monotonic() - before < 30.0
        assert terminal.receive() == b"S"
    finally:
        os.close(reader)


def test_unplugged_it_vanishes_and_comes_back_under_the_same_name(terminal):
    reader = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
    try:
        assert terminal.receive() == b""
        terminal.unplug()
        assert not os.path.lexists(terminal.url)
        with contextlib.suppress(OSError):  # EIO, or the end of the file
            assert os.read(reader, 1) == b""
        assert terminal.receive() is None
        assert terminal.send(b"x") == 0
        terminal.plug_in()
        again = os.open(terminal.url, os.O_RDWR | os.O_NOCTTY)
        try:
            assert terminal.receive() == b""
            terminal.send(b"hello")
            assert read_all(again, 5) == b"hello"
        finally:
            os.close(again)
    finally:
        os.close(reader)


def test_closing_leaves_nothing_behind():
    terminal = open_pseudo_terminal()
    folder = Path(terminal.url).parent
    terminal.close()
    assert not folder.exists()


def test_systems_without_pseudo_terminals_are_told_so(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(PortUnavailableError, match="Windows"):
        open_pseudo_terminal()
