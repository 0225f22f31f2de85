"""A stream that is interrupted: a device driven by the wall clock, read by the real driver."""

import itertools
import time

import numpy as np
import pytest

from app.acquisition.messages import EndReason, Reconnected, Reconnecting
from app.acquisition.stream.connection import Connection, ReadQueue
from app.acquisition.stream.live_stream import LiveStream, StreamNotice
from config.files import load_gauges
from drivers.devices.slipstand_binary.codec import encode_frames
from drivers.devices.slipstand_binary.source import SlipstandBinarySource, make_source
from drivers.errors import DeviceLostError, PortUnavailableError
from drivers.host_time import host_ns
from drivers.port import PortInfo
from tests.waiting import PATIENCE_S

RATE_HZ = 1000.0
N = 5


class Device:
    """Sends frames by the host's clock; sample k holds the counts (k, -k)."""

    def __init__(self, true_rate_hz: float = RATE_HZ) -> None:
        self.true_rate_hz = true_rate_hz
        self.born_ns = host_ns() - 20_000_000_000
        self.is_there = True
        self.says = "samples"
        self.plugged = 0
        self.opened = 0

    @property
    def frames(self) -> int:
        return int((host_ns() - self.born_ns) * 1e-9 * self.true_rate_hz / N)

    def unplug(self, power: bool = True) -> None:
        self.is_there = False
        if not power:
            self.born_ns = host_ns()

    def plug_in(self) -> None:
        self.plugged += 1
        self.is_there = True

    def open(self) -> "Wire":
        if not self.is_there:
            raise PortUnavailableError("there is no port fake://: plug the device in")
        self.opened += 1
        return Wire(self)


class Wire:
    """The port, as long as it is plugged in."""

    url = "fake://"
    info = PortInfo("fake://")

    def __init__(self, device: Device) -> None:
        self._device = device
        self._plugged = device.plugged
        self._next = device.frames
        self._answer = b""
        self.is_closed = False

    def read(self) -> bytes:
        time.sleep(0.005)
        self._check()
        answer, self._answer = self._answer, b""
        if answer and self._device.says != "nothing":
            return answer
        first, self._next = min(self._next, self._device.frames), self._device.frames
        frames = self._next - first
        if self._device.says == "nothing" or frames <= 0:
            return b""
        if self._device.says == "rubbish":
            return bytes(range(1, 40)) * frames
        index = np.arange(first * N, self._next * N)
        times_us = np.arange(first, self._next) * round(N / RATE_HZ * 1e6)
        return encode_frames(first * N, times_us, np.stack([index, -index], axis=1)).tobytes()

    def write(self, data: bytes) -> None:
        self._check()
        if data == b"I":
            self._answer = b"slipstand-fw 1.0 1000 2\n"

    def close(self) -> None:
        self.is_closed = True

    def _check(self) -> None:
        if self.is_closed or not self._device.is_there or self._plugged != self._device.plugged:
            raise DeviceLostError("port fake:// is gone: plug its cable in again")


@pytest.fixture(autouse=True)
def short_limits(monkeypatch):
    monkeypatch.setattr(SlipstandBinarySource, "timeout_s", 0.3)
    monkeypatch.setattr(SlipstandBinarySource, "answer_timeout_s", 0.05)
    monkeypatch.setattr("drivers.stream._DRAIN_S", 0.02)
    monkeypatch.setattr("drivers.devices.slipstand_binary.source._LISTEN_S", 0.1)
    monkeypatch.setattr("app.acquisition.stream.live_stream.PATIENCE_S", 1.0)
    monkeypatch.setattr("app.acquisition.stream.monitors.STALLED_S", 0.3)
    monkeypatch.setattr("app.acquisition.stream.connection._OFTEN_S", 0.02)


class Listener:
    """Collects what a stream brings."""

    def __init__(self, device: Device) -> None:
        source = make_source({}, RATE_HZ)
        wire, intake = device.open(), ReadQueue()
        connection = Connection(wire, source, source.start(wire), intake, host_ns())
        self.stream = LiveStream(connection, source, intake, load_gauges(), device.open)
        self.chunks = []
        self.news = []

    def listen(self, until) -> None:
        end_s = time.perf_counter() + PATIENCE_S
        while not until():
            assert time.perf_counter() < end_s, self.news
            chunk = self.stream.next_read(0.02)
            if chunk is not None:
                self.chunks.append(chunk)
            self.news += self.stream.take_events()

    def listen_for(self, duration_s: float) -> None:
        end = time.monotonic() + duration_s
        self.listen(lambda: time.monotonic() > end)

    def heard(self, kind) -> bool:
        return any(isinstance(news, kind) for news in self.news)

    def rows(self):
        """Counts (n, 2) and status (n,) of all samples, which must join without a hole."""
        rows = [rows for chunk in self.chunks for rows in chunk.rows]
        for before, after in itertools.pairwise(rows):
            assert after.first_index == before.end_index
        return np.concatenate([r.counts for r in rows]), np.concatenate([r.status for r in rows])


@pytest.fixture
def device():
    return Device()


@pytest.fixture
def listener(device):
    listener = Listener(device)
    with listener.stream:
        listener.listen_for(0.2)
        yield listener


def replug(listener: Listener, device: Device, away_s: float, power: bool) -> None:
    device.unplug(power)
    listener.listen_for(away_s)
    device.plug_in()
    listener.listen(lambda: listener.heard(Reconnected))
    listener.listen_for(0.3)


def test_a_device_with_its_own_power_tells_exactly_what_is_missing(device, listener):
    replug(listener, device, 0.5, power=True)
    counts, status = listener.rows()
    missing = int(np.count_nonzero(status))
    np.testing.assert_array_equal(counts[status == 0, 0], counts[0, 0] + np.flatnonzero(status == 0))
    losses = listener.stream.losses
    assert (losses.missing, losses.missing_estimated, losses.restarts) == (missing, 0, 0)
    assert missing >= 500
    lost, *_, found = listener.news
    assert isinstance(lost, Reconnecting)
    assert isinstance(found, Reconnected)
    assert found.gap_s == pytest.approx(missing / RATE_HZ)
    assert listener.stream.fault is None


def test_a_device_that_lost_its_power_is_missing_as_long_as_the_host_says(device, listener):
    begin_ns = host_ns()
    replug(listener, device, 0.5, power=False)
    counts, status = listener.rows()
    losses = listener.stream.losses
    assert losses.restarts == 1
    assert losses.missing_estimated == np.count_nonzero(status) >= 500
    assert losses.missing == 0
    after = counts[np.flatnonzero(status)[-1] + 1 :, 0]
    np.testing.assert_array_equal(np.diff(after), 1)
    elapsed_s = (listener.chunks[-1].arrival_ns - begin_ns) * 1e-9
    assert len(counts) / RATE_HZ == pytest.approx(elapsed_s + 0.2, abs=0.15)


@pytest.mark.parametrize("power", [True, False])
def test_what_was_read_makes_the_same_samples_again(device, listener, power):
    replug(listener, device, 0.3, power)
    counts, status = listener.rows()
    source = make_source({}, RATE_HZ)
    blocks = [block for chunk in listener.chunks for block in source.decode(chunk.data, chunk.arrival_ns)]
    np.testing.assert_array_equal(np.concatenate([block.counts for block in blocks]), counts)
    np.testing.assert_array_equal(np.concatenate([block.status for block in blocks]), status)
    assert source.losses == listener.stream.losses


def test_a_run_waits_for_a_lost_device_only_so_long_and_the_search_goes_on(device, listener):
    device.unplug()
    listener.listen(lambda: listener.stream.fault is not None)
    fault = listener.stream.fault
    assert fault.reason is EndReason.DEVICE_LOST
    assert "plug its cable in again; it was not back within 1 s, and the last 1." in str(fault.message)
    assert sum(isinstance(news, Reconnecting) for news in listener.news) == 2, "lost, and not found"
    device.plug_in()
    listener.listen(lambda: listener.heard(Reconnected))
    assert listener.stream.fault is None


@pytest.mark.parametrize(
    ("says", "words"),
    [("nothing", "open but silent for 0.3 s"), ("rubbish", "brought no sample for 0.3 s: received")],
)
def test_a_stall_is_met_with_one_attempt_to_begin_anew(device, listener, says, words):
    device.says = says
    listener.listen(lambda: listener.stream.fault is not None)
    fault = listener.stream.fault
    assert fault.reason is EndReason.STALLED
    assert words in str(fault.message)
    assert device.opened >= 2
    device.says = "samples"
    listener.listen(lambda: listener.heard(Reconnected))
    listener.listen_for(0.1)
    assert listener.stream.fault is None
    assert listener.stream.losses.missing >= 300, "1 kHz, silent for 0.3 s at least"


def test_a_device_that_answers_the_attempt_goes_on(device, listener):
    device.says = "nothing"
    listener.listen(lambda: listener.heard(Reconnecting))
    device.says = "samples"
    listener.listen(lambda: listener.heard(Reconnected))
    listener.listen_for(0.1)
    assert sum(isinstance(news, Reconnecting) for news in listener.news) == 1, "lost, and found at once"
    assert listener.stream.losses.missing >= 300, "1 kHz, silent for 0.3 s at least"


def test_nobody_listening_is_no_silence(device, listener):
    time.sleep(0.5)
    device.says = "nothing"
    listener.listen_for(0.1)
    assert not listener.heard(Reconnecting)


def test_a_wrong_rate_is_said_while_it_lasts():
    device = Device(true_rate_hz=1050.0)
    listener = Listener(device)
    with listener.stream:
        listener.listen(lambda: listener.heard(StreamNotice))
        listener.listen_for(0.5)
    (noticed,) = [news for news in listener.news if isinstance(news, StreamNotice)]
    assert "instead of 1000: check its rate" in str(noticed.message)
    assert listener.stream.recent_clock().rate_hz == pytest.approx(1050.0, rel=0.01)


def test_a_device_that_restarts_while_it_is_read_is_told_of(device, listener):
    device.born_ns = host_ns()
    listener.listen(lambda: listener.heard(StreamNotice))
    (noticed,) = [news for news in listener.news if isinstance(news, StreamNotice)]
    assert "started anew" in str(noticed.message)
    assert listener.stream.losses.restarts == 1


def test_a_stream_that_is_closed_while_its_device_is_away_leaves_nothing(device, listener):
    device.unplug()
    listener.listen(lambda: listener.heard(Reconnecting))
    listener.stream.close()
    device.plug_in()
    opened = device.opened
    time.sleep(0.1)
    assert device.opened == opened
