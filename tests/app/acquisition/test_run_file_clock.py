"""Times of day of a run when the clock of the computer is changed."""

import datetime
from concurrent.futures import Future
from pathlib import Path

import pytest

from app.acquisition import run_file
from app.acquisition.journal.journal import JournalTap
from app.acquisition.run_file import RunFile
from app.runs.blocks import BlockLayout
from app.runs.journal import JournalSpan
from app.runs.metadata import create_metadata
from app.runs.writer_client import OpenRun
from config.files import load_gauges, load_stand


class Writer:
    def open(self, request):
        future: Future[Path] = Future()
        future.set_result(Path("/runs/run.h5"))
        return future


class Journal:
    def append_metadata(self, note):
        pass


class Clock(datetime.datetime):
    """A wall clock under the test's hand."""

    wall = datetime.datetime(2026, 3, 29, 1, 59, 0, tzinfo=datetime.UTC)

    @classmethod
    def now(cls):
        return cls.wall


@pytest.mark.parametrize("set_by_s", [0, 3600, -7200])
def test_the_end_fits_the_beginning_though_the_clock_was_set_between(monkeypatch, set_by_s):
    host_ns = 10_000_000_000
    monkeypatch.setattr(run_file, "host_ns", lambda: host_ns)
    monkeypatch.setattr(run_file.datetime, "datetime", Clock)
    metadata = create_metadata(load_stand(), load_gauges(), Clock.wall, series="1FFM0", rate_hz=1000.0)
    request = OpenRun("/runs", metadata, BlockLayout(counts="int32"), JournalSpan("/runs/a.journal", 0))
    file = RunFile(Writer(), request, Journal(), 0, 1000.0, JournalTap(Journal()))
    began = file.current_time()
    host_ns += 12_500_000_000
    monkeypatch.setattr(Clock, "wall", Clock.wall + datetime.timedelta(seconds=12.5 + set_by_s))
    assert file.current_time() - began == datetime.timedelta(seconds=12.5)
