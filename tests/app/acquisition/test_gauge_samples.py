"""Samples of both gauges at rest."""

import itertools
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from app.acquisition import gauge_samples as module
from app.acquisition.gauge_samples import NoSamplesError, collect_samples, gauge_samples
from app.acquisition.stream.live_stream import DecodedRead
from app.runs.blocks import calibrate
from config.files import load_gauges
from drivers.samples import Losses, SampleBlock, SampleStatus

RATE_HZ = 100.0
STATUS = np.array([0, SampleStatus.MISSING, SampleStatus.OVERLOAD_RELATIVE, 0], np.uint8)


class FakeStream:
    """Four samples a read, as long as there are reads; the table a micrometre on with each."""

    rate_hz = RATE_HZ

    def __init__(self, reads: int) -> None:
        self._reads: Iterator[int] = iter(range(reads))

    def next_read(self, timeout_s: float) -> DecodedRead | None:
        number = next(self._reads, None)
        if number is None:
            return None
        counts = np.full((4, 2), (12_000 + 500 * number, -8000), np.int32)
        return DecodedRead(
            b"", 0, (calibrate(SampleBlock(4 * number, counts, STATUS, 0), load_gauges()),), Losses()
        )


def test_a_stream_is_watched_for_so_many_samples() -> None:
    table, relative = collect_samples(FakeStream(100), 1.0, load_gauges())
    assert len(table.displacement_m) == len(relative.overloaded) == 100
    np.testing.assert_allclose(table.displacement_m[::4], 1e-6 * np.arange(25), atol=1e-15)
    assert np.isnan(table.displacement_m[1::4]).all()
    assert not table.overloaded.any()
    assert relative.overloaded.nonzero()[0].tolist() == list(range(2, 100, 4))
    assert (table.rate_hz, table.range_m, relative.range_m) == (RATE_HZ, 0.0165, 0.033)


def test_samples_that_stay_away_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "TIMEOUT_S", -0.95)
    clock_s = itertools.count(0.0, 0.004)  # looked at before each read
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: next(clock_s)))
    with pytest.raises(NoSamplesError, match=r"only 40 of 100 samples came in 0\.05 s"):
        collect_samples(FakeStream(10), 1.0, load_gauges())


def test_a_gauge_of_the_plate_reads_where_the_plate_is() -> None:
    gauges = load_gauges()
    absolute = gauges.replace(relative=gauges.relative.replace(measures="plate"))
    block = SampleBlock(0, np.full((4, 2), 8000, np.int32), np.zeros(4, np.uint8), 0)
    for mounted in (gauges, absolute):
        _, plate = gauge_samples([calibrate(block, mounted)], RATE_HZ, mounted)
        assert plate.displacement_m.tolist() == gauges.relative.displacement_m(np.full(4, 8000.0)).tolist()
