"""The engine's pipes: whole lines whatever the cuts, and an owner that hangs holds nobody up."""

import contextlib
import os
import time

import pytest

from app.acquisition.channel import CommandReader, EventSender
from app.acquisition.messages import (
    Arm,
    Connect,
    Failed,
    Health,
    PortSettings,
    Quit,
    RunSettings,
    Stop,
    decode_event,
    encode,
)

COMMANDS = [
    Connect(PortSettings("/dev/x", "csv", device={"columns": "table,relative"}), "s", "g"),
    Arm(RunSettings("/runs", note="50 % moist; µ")),
    Stop(),
    Quit(),
]


class Pipe:
    """Both ends of a pipe, each closed once."""

    def __init__(self) -> None:
        self.read, self.write = os.pipe()
        self._open = {self.read, self.write}

    def close(self, *ends: int) -> None:
        for end in self._open & set(ends or self._open):
            self._open.remove(end)
            os.close(end)


@pytest.fixture
def pipe():
    pipe = Pipe()
    yield pipe
    pipe.close()


def wait_until(condition) -> None:
    for _ in range(500):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("nothing happened")


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_commands_come_whole_and_in_order_however_they_are_cut(pipe, size):
    reader = CommandReader(pipe.read)
    line = b"".join(encode(command) for command in COMMANDS)
    for start in range(0, len(line), size):
        os.write(pipe.write, line[start : start + size])
    assert [reader.take(timeout_s=5.0) for _ in COMMANDS] == COMMANDS
    assert reader.take() is None
    assert not reader.is_closed
    pipe.close(pipe.write)
    assert reader.take(timeout_s=5.0) is None
    assert reader.is_closed


def test_what_is_no_command_closes_the_channel(pipe):
    reader = CommandReader(pipe.read)
    os.write(pipe.write, encode(Stop()) + b"{not json\n")
    assert reader.take(timeout_s=5.0) == Stop()
    assert reader.take(timeout_s=5.0) is None
    assert reader.is_closed


def test_events_come_out_as_lines_and_failures_in_one(pipe):
    sender = EventSender(pipe.write)
    sender.send(Health(1000.0, 5, 0, 0, 0, 0, 10))
    sender.fail("a fault\nin two lines")
    sender.close()
    pipe.close(pipe.write)
    with os.fdopen(os.dup(pipe.read), "rb") as stream:
        events = [decode_event(line) for line in stream]
    assert events == [Health(1000.0, 5, 0, 0, 0, 0, 10), Failed("a fault in two lines")]


def test_an_owner_that_does_not_read_holds_nobody_up(pipe):
    sender = EventSender(pipe.write)
    for number in range(20_000):
        sender.send(Health(1000.0, number, 0, 0, 0, 0, 0))
    sender.fail("the last word")
    os.set_blocking(pipe.read, False)
    received = b""

    def has_failed() -> bool:
        nonlocal received
        with contextlib.suppress(BlockingIOError):
            received += os.read(pipe.read, 1 << 20)
        return b"the last word" in received

    wait_until(has_failed)
    sender.close()
    assert received.count(b"\n") < 20_000


def test_an_owner_that_is_gone_is_no_fault(pipe):
    sender = EventSender(pipe.write)
    pipe.close(pipe.read)
    sender.fail("nobody hears")
    sender.close()
