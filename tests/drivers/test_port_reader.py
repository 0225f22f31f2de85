"""Reads of a port: complete, in order, in time, with the last bytes of a lost device."""

import time

import pytest

from drivers.errors import DeviceLostError
from drivers.source import CollectLimit
from drivers.stream import BatchedReader, read_for


class Wire:
    """A link whose reads are told beforehand; a number is a time to wait before the next one."""

    def __init__(self, *reads) -> None:
        self._reads = list(reads)
        self.count = 0

    def read(self) -> bytes:
        self.count += 1
        read = self._reads.pop(0) if self._reads else b""
        if isinstance(read, Exception):
            raise read
        data, waits_s = read if isinstance(read, tuple) else (read, 0.0)
        if waits_s:  # even a sleep of 0 s gives the processor away, and looks like waiting then
            time.sleep(waits_s)
        return data

    def write(self, data: bytes) -> None:
        raise NotImplementedError(data)


def late(gathering: BatchedReader) -> None:
    """Let the time pass after which a read is to be punctual."""
    gathering._waited_s -= 1.0


def patched_naps(gathering: BatchedReader, wire: Wire) -> list[int]:
    """How many reads there were before each sleep."""
    naps: list[int] = []
    gathering._sleep = lambda _: naps.append(wire.count)
    return naps


def test_without_a_pause_it_reads_once():
    wire, gathering = Wire(b"a", b"b"), BatchedReader()
    late(gathering)
    assert [gathering.read(wire, 0.0) for _ in range(3)] == [b"a", b"b", b""]
    assert wire.count == 3


def test_after_a_pause_it_fetches_what_there_is():
    wire, gathering = Wire(*[b"ab"] * 100), BatchedReader()
    began = time.perf_counter()
    data = gathering.read(wire, 0.02)
    assert time.perf_counter() - began >= 0.02
    assert data == b"ab" * wire.count


def test_now_and_then_it_waits_for_what_comes_next_so_that_its_time_is_that_of_its_arrival():
    gathering = BatchedReader()
    gathering.read(Wire(b"x" * 10, b"y"), 0.001)
    late(gathering)
    wire = Wire(b"gathered", (b"next", 0.02), b"later")
    assert gathering.read(wire, 0.001) == b"gatherednext"
    assert gathering.read(wire, 0.001) == b"later", "not again at once"


def test_a_quick_stream_is_fetched_before_a_small_buffer_is_full():
    gathering = BatchedReader()
    gathering.read(Wire(b"x" * 60_000), 0.001)  # some tens of megabytes a second
    wire = Wire(*[b"x" * 1000] * 1000)
    assert len(gathering.read(wire, 0.02)) > 3000
    assert wire.count > 3


def test_after_a_read_that_filled_a_small_buffer_it_reads_again_at_once():
    gathering = BatchedReader()
    gathering.read(Wire(b"x" * 60_000), 0.01)  # some megabytes a second
    wire = Wire(b"x" * 4095, b"x" * 4095, *[b"x" * 1000] * 1000)
    naps = patched_naps(gathering, wire)
    gathering.read(wire, 0.01)
    assert naps[:3] == [0, 3, 4]


def test_a_computer_that_wakes_late_lets_less_gather(monkeypatch):
    gathering = BatchedReader()
    gathering._bytes_per_s = 100_000.0
    assert gathering._longest_delay_s() == pytest.approx(0.02, rel=0.1)
    real = time.sleep
    monkeypatch.setattr("drivers.stream.time.sleep", lambda span_s: real(span_s + 0.01))
    gathering.read(Wire(*[b"ab"] * 10), 0.001)
    gathering._bytes_per_s = 100_000.0
    assert gathering._longest_delay_s() == pytest.approx(0.005, rel=0.1)
    gathering._busy_until_s = time.perf_counter() - 0.1
    assert gathering._longest_delay_s() == pytest.approx(0.02, rel=0.1), "and as much as before after a while"


def test_a_port_that_holds_more_lets_more_gather(monkeypatch):
    monkeypatch.setattr("drivers.stream.time", WindowsClock())
    gathering, wire = BatchedReader(), Wire(*[b"ab"] * 10)
    gathering.read(wire, 0.001, CollectLimit(8192, 4096))
    gathering._bytes_per_s = 100_000.0
    assert gathering._longest_delay_s() == pytest.approx(0.08, rel=0.1)
    gathering._busy_until_s = time.perf_counter() + 10.0
    assert gathering._longest_delay_s() == pytest.approx(0.04, rel=0.1)


def test_a_lost_device_is_told_after_its_last_bytes():
    gathering = BatchedReader()
    late(gathering)
    wire = Wire(b"last", DeviceLostError("gone"), DeviceLostError("gone"))
    assert gathering.read(wire, 0.001) == b"last"
    with pytest.raises(DeviceLostError):
        gathering.read(wire, 0.001)


def test_answers_of_an_asked_device_are_handed_on_together():
    wire = Wire(*[(b"a", 0.004)] * 100)
    assert read_for(wire.read, 0.02) == b"a" * wire.count
    assert wire.count > 1
    assert read_for(Wire(b"a", b"", b"b").read, 0.02) == b"a", "nothing came: nobody waits"
    assert read_for(Wire(b"a", b"b").read, 0.0) == b"a"
    assert read_for(Wire(b"a", DeviceLostError("gone")).read, 0.02) == b"a"
    with pytest.raises(DeviceLostError):
        read_for(Wire(DeviceLostError("gone")).read, 0.02)


# --- the clock of Windows ----------------------------------------------------------------------

COARSE_S = 1 / 64
"""Step of `time.monotonic` on Windows before Python 3.13."""


class WindowsClock:
    """Stands for the module `time`; it goes on by what is slept and by what a device lets wait."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def perf_counter(self) -> float:
        return self.now_s

    def monotonic(self) -> float:
        return self.now_s // COARSE_S * COARSE_S

    def sleep(self, duration_s: float) -> None:
        self.now_s += max(0.0, duration_s)


class Stream:
    """A link whose device sends one byte in each `PERIOD_S`; a read without any waits for the next."""

    PERIOD_S = 0.0005
    READ_S = 5e-5

    def __init__(self, clock: WindowsClock) -> None:
        self._clock, self._due_s = clock, clock.now_s + self.PERIOD_S

    def read(self) -> bytes:
        self._clock.now_s = max(self._clock.now_s + self.READ_S, self._due_s)
        count = int((self._clock.now_s - self._due_s) / self.PERIOD_S) + 1
        self._due_s += count * self.PERIOD_S
        return b"x" * count


def test_reads_are_as_frequent_as_asked_beside_a_coarse_clock(monkeypatch):
    clock = WindowsClock()
    monkeypatch.setattr("drivers.stream.time", clock)
    gathering, link, reads = BatchedReader(), Stream(clock), 0
    while clock.now_s < 1001.0:
        gathering.read(link, 0.003)
        reads += 1
    assert reads > 250
    assert gathering._busy_until_s == 0.0, "no computer is taken for a busy one"
