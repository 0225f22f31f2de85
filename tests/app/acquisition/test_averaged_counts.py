"""Counts averaged at rest, over a scripted stream."""

import threading
from collections.abc import Callable

import numpy as np
import pytest

from app.acquisition.averaged_counts import CountAverager, NoAverageError, compute_average
from app.acquisition.errors import StreamEndedError
from app.acquisition.messages import EndReason
from app.acquisition.stream.live_stream import DecodedRead
from app.runs.blocks import calibrate
from config.files import load_gauges
from drivers.samples import Losses, SampleBlock, SampleStatus

ROWS = 50


class MadeUp:
    """A stream without end: `counts_at(index)` of both gauges, `status` for all."""

    rate_hz = 1000.0

    def __init__(self, counts_at: Callable[[np.ndarray], np.ndarray], status: int = 0) -> None:
        self._counts_at = counts_at
        self._status = status
        self._index = 0
        self._pause = threading.Event()

    def next_read(self, timeout_s: float) -> DecodedRead | None:
        self._pause.wait(0.001)
        index = np.arange(self._index, self._index + ROWS)
        self._index += ROWS
        counts = np.stack((np.full(ROWS, 7.0), self._counts_at(index)), axis=1)
        block = SampleBlock(int(index[0]), counts, np.full(ROWS, self._status, np.uint8), 0)
        return DecodedRead(b"", 0, (calibrate(block, load_gauges()),), Losses())


class Broken(MadeUp):
    def next_read(self, timeout_s: float) -> DecodedRead | None:
        raise StreamEndedError(EndReason.DEVICE_LOST, "port gone")


def noise(index: np.ndarray) -> np.ndarray:
    return 1000.0 + np.random.default_rng(int(index[0])).normal(0.0, 4.0, len(index))


def test_noise_is_averaged() -> None:
    with CountAverager(MadeUp(noise), 1) as still:
        average = still.steady_average(1.0)
    assert average.samples >= 1000
    assert average.counts == pytest.approx(1000.0, abs=0.6)
    assert average.noise_counts == pytest.approx(4.0, rel=0.15)
    assert average.is_steady


def test_a_moving_gauge_is_waited_for() -> None:
    heard = []
    creeping = MadeUp(lambda index: 0.1 * np.minimum(index, 3000.0) + noise(index))
    with CountAverager(creeping, 1) as still:
        average = still.steady_average(0.5, 20, heard.append)
    assert heard
    assert not any(moving.is_steady for moving in heard)
    assert average.counts == pytest.approx(1300.0, abs=1.0)


def test_an_overloaded_gauge_gives_no_average() -> None:
    status = int(SampleStatus.OVERLOAD_RELATIVE)
    with (
        CountAverager(MadeUp(noise, status), 1) as still,
        pytest.raises(NoAverageError, match="gauge 2 is over"),
    ):
        still.steady_average(0.1)
    with CountAverager(MadeUp(noise, status), 0) as still:
        assert still.steady_average(0.1).counts == 7.0


def test_the_end_of_the_stream_is_heard_of() -> None:
    with CountAverager(Broken(noise), 1) as still, pytest.raises(StreamEndedError, match="port gone"):
        still.steady_average(0.1)


def test_noise_alone_is_hardly_ever_taken_for_motion() -> None:
    random = np.random.default_rng(3)
    steady = [compute_average(random.normal(0.0, 1.0, 200)).is_steady for _ in range(2000)]
    assert sum(steady) >= 1999
