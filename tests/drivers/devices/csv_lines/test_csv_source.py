import numpy as np
import pytest
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.csv_lines.source import CsvLinesSource, make_source
from drivers.errors import NoDataError, SettingsError
from drivers.samples import DeviceIdentity

SAMPLES = 200


class TalkingLink(ScriptedLink):
    """A device that talks by itself, after what the opening of its port leaves in the buffer."""

    def __init__(self, talk: bytes, stale: bytes = b"stale") -> None:
        super().__init__(lambda _: b"", waiting=talk)
        self._stale = stale

    def read(self) -> bytes:
        if self._stale:
            stale, self._stale = self._stale, b""
            return stale
        return super().read()


def lines(rate_hz: float = 80.0, layout: LineFormat | None = None) -> bytes:
    counts = np.arange(2 * SAMPLES).reshape(SAMPLES, 2)
    return b"".join(encode_lines(layout or LineFormat(), 3 + np.arange(SAMPLES) / rate_hz, counts))


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(CsvLinesSource, "timeout_s", 0.2)


def started(link: ScriptedLink, settings: dict[str, str], rate_hz: float | None = None):
    source = make_source(settings, rate_hz)
    return source, source.start(link)


def read_out(source: CsvLinesSource, first: bytes, link: ScriptedLink):
    blocks = list(source.decode(first, 0))
    while data := link.read():
        blocks += source.decode(data, 0)
    return join(blocks)


def test_a_device_that_talks_is_listened_to():
    link = TalkingLink(b"lf of one\r\nBooting...\r\n" + lines())
    source, first = started(link, {})
    assert source.rate_hz == pytest.approx(80)
    assert source.identity == DeviceIdentity("csv", "CSV lines")
    block = read_out(source, first, link)
    np.testing.assert_array_equal(block.counts, np.arange(2 * SAMPLES).reshape(SAMPLES, 2))
    np.testing.assert_allclose(block.device_time_s, np.arange(SAMPLES) / 80, atol=2e-6)
    source.stop(link)
    assert link.sent == []


def test_settings_reach_the_decoder():
    settings = {
        "columns": "ignore, sequence, table, relative",
        "separator": "semicolon",
        "decimal": "comma",
        "overload_count": "9",
    }
    source = make_source(settings, 100)
    block = join(source.decode(b"\n0,01;7;1,5;-2,5\n0,02;9;9;3\n0;10;1;-10\n", 0))
    assert block.counts.tolist() == [[1.5, -2.5], [0, 0], [9, 3], [1, -10]]
    assert block.status.tolist() == [0, 1, 4, 8]


def test_lines_without_time_need_a_rate_and_start_with_the_first():
    layout = LineFormat((Column.TABLE, Column.RELATIVE))
    with pytest.raises(SettingsError, match="do not tell their rate: give --rate"):
        make_source({"columns": "table,relative"}, None)
    link = TalkingLink(b"\n" + lines(layout=layout)[:40])
    source, first = started(link, {"columns": "table,relative"}, 80)
    assert source.rate_hz == 80
    assert read_out(source, first, link).device_time_s is None


def test_a_rate_that_is_near_the_devices_own_is_kept_as_nominal():
    link = TalkingLink(b"\n" + lines(80.5))
    source, first = started(link, {}, 80)
    assert source.rate_hz == 80
    assert not read_out(source, first, link).status.any()


def test_a_rate_that_is_not_the_devices_own_is_refused():
    with pytest.raises(SettingsError, match="rate 100 Hz is not that of the device, whose times say 80 Hz"):
        started(TalkingLink(b"\n" + lines()), {}, 100)


def test_a_silent_device():
    with pytest.raises(NoDataError, match=r"no good data in 0\.2 s: nothing came"):
        started(TalkingLink(b""), {})


def test_lines_without_readings_are_shown():
    with pytest.raises(NoDataError, match="lines such as 'a,b,c', set columns, separator and decimal"):
        started(TalkingLink(b"a,b,c\n" * 9), {})


def test_a_wrong_parity_is_suspected():
    garbled = bytes(byte if byte.bit_count() % 2 else 0 for byte in lines())
    with pytest.raises(NoDataError, match="text read with a wrong parity: try --parity N, E or O"):
        started(TalkingLink(garbled), {})


def test_lines_with_other_columns_are_shown():
    with pytest.raises(NoDataError, match="lines such as '1,2,3,4', try --set columns=table,relative,ignore"):
        started(TalkingLink(b"1,2,3,4\n" * 9), {})


def test_binary_frames_are_recognised():
    from drivers.devices.slipstand_binary.codec import encode_frame

    frame = encode_frame(0, 0, np.zeros((2, 2), dtype=np.int32))
    with pytest.raises(NoDataError, match="Slipstand frames, choose protocol slipstand-binary"):
        started(TalkingLink(frame * 9), {})


def test_a_wrong_baud_rate():
    with pytest.raises(NoDataError, match=r"check the baud rate \(usual is 115200\) and the protocol"):
        started(TalkingLink(b"\x00\xff\x80\x1f" * 50), {})


def test_a_device_too_slow_to_tell_its_rate():
    with pytest.raises(NoDataError, match="do not tell a rate"):
        started(TalkingLink(b"\n" + lines()[:60]), {})


def test_a_second_start_goes_on_with_the_same_account():
    source = make_source({}, None)
    for _ in range(2):
        link = TalkingLink(b"\n" + lines())
        reads = [source.start(link), *iter(link.read, b"")]
        assert sum(len(block) for data in reads for block in source.decode(data, 0)) == SAMPLES
        assert list(source.decode(b"", 0)) == []
    assert source.losses.samples == 2 * SAMPLES
    assert source.losses.restarts == 1


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        ({"colums": "table"}, None, "setting 'colums' is not known to csv: allowed are format, columns,"),
        (
            {"columns": "time,table,relative"},
            None,
            "column 'time' is not known: allowed are time_us, time_ms",
        ),
        ({"time_bits": "many"}, None, "settings of csv: Expected `int`, got `str` - at `$.time_bits`"),
        ({"overload_count": "-1"}, None, "overload_count -1 must be positive"),
        ({"comment": "§"}, None, "comment '§' cannot mark comments"),
        ({"comment": "#-"}, None, "comment '#-' cannot mark comments"),
        ({"separator": "comma", "decimal": "comma"}, None, "separator and decimal are both ','"),
        ({}, 0.0, "rate 0 Hz cannot be"),
        ({}, float("nan"), "rate nan Hz cannot be"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)
