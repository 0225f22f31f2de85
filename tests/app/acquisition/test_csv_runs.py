"""Every form of lines, recorded faster than real time into a run file: f_d within 1 %."""

from collections.abc import Iterator

import numpy as np
import pytest
from recovery_kit import COUNTS, RATE_HZ, RELEASED, Desk

from analysis.identify import identify
from app.runs.analysis_input import to_record
from app.runs.reader import load_counts, open_run
from app.simulated_stand.motion import stand_truth
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_stand
from drivers.envelope import wrap
from drivers.pair.source import make_pair
from drivers.registry import find_driver

pytestmark = pytest.mark.usefixtures("no_thread_is_left")

FORMS = {
    "us": {},
    "ms-wraps": {"columns": "time_ms,table,relative", "time_bits": "10"},
    "s-european": {"columns": "time_s,ignore,table,relative", "separator": "semicolon", "decimal": "comma"},
    "sequence-tab-xor": {"columns": "sequence,relative,table,xor", "separator": "tab", "sequence_bits": "8"},
    "space-crc": {"columns": "time_us,sequence,table,relative,crc", "separator": "space"},
    "bare": {"columns": "table,relative"},
}


def test_two_openscales_become_a_run_with_the_true_friction(tmp_path, writer):
    desk = Desk(tmp_path, writer, "csv")
    desk._source = make_pair(find_driver("csv"), {"format": "openscale"}, RATE_HZ)
    desk.arm(duration_s=3.0)
    times_ms = (1000 * np.arange(len(COUNTS)) / RATE_HZ).astype(int)
    devices = [
        [b"Readings:\r\n", *(b"%d,%d.00,kg,24.06,\r\n" % row for row in zip(times_ms, counts, strict=True))]
        for counts in COUNTS.T
    ]
    pieces = [(*piece, port) for port, lines in enumerate(devices) for piece in in_pieces(lines, port)]
    for arrival_ns, data, port in sorted(pieces):
        desk.take((arrival_ns, wrap(port, arrival_ns, data)))
    ended = desk.ended()
    assert (ended.missing, ended.damaged) == (0, 0)
    found = identify(to_record(open_run(ended.path))).results["friction_dynamic"]
    assert found.value == pytest.approx(true_friction(), rel=0.01)


def true_friction() -> float:
    return stand_truth(SimulatedStandOptions(), load_stand()).friction_dynamic


def in_pieces(lines: list[bytes], seed: int = 0) -> Iterator[tuple[int, bytes]]:
    """The lines in pieces cut anywhere, each when its last line was sent."""
    data, random = b"".join(lines), np.random.default_rng(seed)
    ends = np.cumsum([len(line) for line in lines])
    start = 0
    while start < len(data):
        end = start + int(random.integers(1, 400))
        yield round(int(np.searchsorted(ends, end)) / RATE_HZ * 1e9), data[start:end]
        start = end


@pytest.mark.parametrize("form", FORMS)
def test_a_form_of_lines_becomes_a_run_with_the_true_friction(tmp_path, writer, form):
    times_s = 70 + np.arange(len(COUNTS)) / RATE_HZ
    units = (
        find_driver("csv")
        .make_simulated(FORMS[form])
        .encode(900, COUNTS, np.zeros(len(COUNTS), np.uint8), times_s)
    )
    desk = Desk(tmp_path, writer, "csv")
    desk._source = find_driver("csv").make_source(FORMS[form], RATE_HZ)
    desk.arm(duration_s=3.0)
    for read in in_pieces([b"ADC ready\r\n# gain 128\r\n", *units]):
        desk.take(read)
    ended = desk.ended()
    assert (ended.missing, ended.missing_estimated, ended.damaged) == (0, 0, 0)
    run = open_run(ended.path)
    before = RELEASED - round(RATE_HZ)
    np.testing.assert_array_equal(load_counts(run), COUNTS[before:][: len(run)])
    found = identify(to_record(run)).results["friction_dynamic"]
    assert found.value == pytest.approx(true_friction(), rel=0.01)
