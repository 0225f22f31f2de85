"""A run of two devices, rebuilt from its journal."""

import datetime

import numpy as np
import pytest
from recovery_kit import (
    COUNTS,
    IDENTIFIER,
    RATE_HZ,
    TIME_BASE,
    Desk,
    assert_same,
    datasets,
)
from test_recovery import kept_journal, recorded

from app.acquisition.journal.journal import create_journal
from app.acquisition.journal.records import JournalHeader
from app.acquisition.journal.recovery import recover_folder
from app.acquisition.messages import PortSettings, RunSettings
from app.acquisition.recording import Recording, RecordingContext
from app.acquisition.stream.connection import create_source
from app.runs.metadata import create_metadata
from app.runs.reader import load_counts, open_run
from config.files import load_gauges, load_stand
from drivers.devices.csv_lines.codec import encode_line
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.envelope import wrap
from drivers.samples import SampleStatus

PORT = PortSettings("table port", "csv", relative_url="relative port")
FACTS = {"table.rate_hz": repr(RATE_HZ), "relative.rate_hz": repr(RATE_HZ)}
LINES = LineFormat((Column.TIME_US, Column.VALUE))
LATER_S = 0.0007


class PairDesk(Desk):
    """A desk with two devices."""

    def __init__(self, folder, writer) -> None:
        super().__init__(folder, writer, "csv")
        self.port = PORT
        self._source = create_source(PORT, RATE_HZ, FACTS)

    def arm(self, **settings) -> None:
        run = RunSettings(
            **({"directory": str(self.folder), "series": "1FFM0", "duration_s": 1.0} | settings)
        )
        metadata = create_metadata(
            load_stand(),
            load_gauges(),
            datetime.datetime.now().astimezone(),
            series=run.series,
            rate_hz=self._source.rate_hz,
            device=self._source.identity,
        )
        self._journal = create_journal(self.journal, JournalHeader(PORT, run, metadata, IDENTIFIER, "test"))
        around = RecordingContext(self.intake, self.history, self._writer, self._time_base, lambda _: None)
        self.recording = Recording(run, metadata, RATE_HZ, self._journal, around)

    def _time_base(self, first_index, end_index):
        return TIME_BASE.with_skew(self._source.skew(first_index, end_index))


def reads(lost=()):
    """Reads of both ports joined as the engine takes them; gauge 2's device is read 0.7 ms later."""
    random = np.random.default_rng(3)
    stamped = []
    for gauge, later_s in ((0, 0.0), (1, LATER_S)):
        own_s = np.arange(len(COUNTS)) / RATE_HZ
        arrival_s = np.maximum.accumulate(2.0 + own_s + later_s + random.exponential(2e-4, len(own_s)))
        for row, (at_s, came_s) in enumerate(zip(own_s, arrival_s, strict=True)):
            if not (gauge == 1 and row in lost):
                line = encode_line(LINES, at_s, COUNTS[row, gauge], 0)
                stamped.append((round(came_s * 1e9), wrap(gauge, round(came_s * 1e9), line)))
    stamped.sort()
    for start in range(0, len(stamped), 17):
        part = stamped[start : start + 17]
        yield part[-1][0], b"".join(data for _, data in part)


@pytest.mark.parametrize("lost", [range(0), range(1150, 1250)], ids=["whole", "gauge 2 away"])
def test_a_recovered_run_of_two_devices_is_the_closed_one_to_the_bit(tmp_path, writer, lost):
    desk = PairDesk(tmp_path, writer)
    pending = reads(lost)
    recorded(desk, pending, armed_at=300, until=360)
    copy = kept_journal(desk)
    for read in pending:
        desk.take(read)
    ended = desk.ended()

    (recovered,) = recover_folder(copy.parent)
    assert_same(datasets(recovered.run), datasets(ended.path))
    run = open_run(recovered.run)
    alone = run.status == SampleStatus.RELATIVE_MISSING
    assert np.count_nonzero(alone) == ended.missing_estimated == pytest.approx(len(lost), abs=2)
    assert np.isfinite(run.table_reading).all()
    np.testing.assert_array_equal(np.isnan(run.relative_reading), alone)


def test_the_skew_is_in_the_run_and_in_words(tmp_path, writer):
    desk = PairDesk(tmp_path, writer)
    recorded(desk, reads())
    ended = desk.ended()
    run = open_run(ended.path)
    assert ended.time_base == run.end.time_base
    assert ended.time_base.skew_s == pytest.approx(LATER_S, abs=2e-4)
    assert 4e-4 < ended.time_base.skew_standard_uncertainty_s < 6e-4
    assert "gauge 2 was read 0.7" in str(run.end.message)
    counts = load_counts(run)
    first = next(
        row for row in range(len(COUNTS)) if (COUNTS[row : row + len(counts), 0] == counts[:, 0]).all()
    )
    np.testing.assert_array_equal(counts, COUNTS[first : first + len(counts)])


def test_a_run_of_two_devices_whose_engine_died_has_its_skew(tmp_path, writer):
    desk = PairDesk(tmp_path, writer)
    recorded(desk, reads(), until=2600, duration_s=60.0)
    desk.kill()
    (recovered,) = recover_folder(tmp_path)
    ending = open_run(recovered.run).end
    assert ending.time_base.skew_s == pytest.approx(LATER_S, abs=2e-4)
    assert ending.message.startswith("Slipstand was ended while it recorded")
    assert "gauge 2 was read 0.7" in str(ending.message)
