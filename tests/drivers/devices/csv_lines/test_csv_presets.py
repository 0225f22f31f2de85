"""Presets, and devices that are started, stopped and asked: each over the wire of its simulated device."""

import time

import numpy as np
import pytest
from device_kit import Ramp, Wire, run_for
from serving_kit import serving
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.csv_lines import DRIVER
from drivers.devices.csv_lines.presets import read_preset, shipped_presets
from drivers.devices.csv_lines.source import (
    CsvLinesSource,
    PolledLinesSource,
    make_source,
    read_csv_settings,
    unescape,
)
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.port import open_port
from drivers.recognition import recognise
from drivers.registry import find_driver
from drivers.samples import SampleStatus
from drivers.simulated.device import DeviceSetup, make_device
from drivers.simulated.transport import open_tcp_port
from tests.waiting import PATIENCE_S

POLLED = ("and-balance", "mt-sics", "sartorius-sbi", "scpi-read")
STREAMS = ("dataq-ascii", "loadstar-iload", "mantracourt-dscusb")


def test_the_shipped_presets_are_those_that_are_tested():
    assert shipped_presets() == sorted((*POLLED, *STREAMS))


@pytest.mark.parametrize("name", shipped_presets())
def test_a_preset_says_where_its_numbers_are_from_and_its_baud_rate(name):
    preset = read_preset(name)
    parsed, _ = read_csv_settings({"format": name})
    assert bool(parsed.commands().poll) == (name in POLLED)
    assert DRIVER.default_baud_for({"format": name}) == preset.baud
    source = make_source({"format": name}, 100.0)
    assert source.identity.name == preset.title
    assert source.channels == (2 if name == "dataq-ascii" else 1)


def test_what_is_given_stands_above_the_preset():
    parsed, _ = read_csv_settings({"format": "mt-sics", "unit": "g", "poll": r"SIU\r\n"})
    assert (parsed.unit, parsed.overload_status) == ("g", "+,-")
    assert parsed.commands().poll == b"SIU\r\n"
    assert unescape("start", r"\x1bP\r\n\\") == b"\x1bP\r\n\\"


def test_a_preset_of_your_own(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text('title = "Own"\ncaution = "mind the gap"\nbaud = 38400\ncolumns = "table,relative"\n')
    source = make_source({"format": str(own)}, 10.0)
    assert (source.identity.name, str(source.run_note)) == ("Own", "mind the gap")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (None, "cannot be read (No such file or directory): check its path"),
        ("columns = = 1", "is no TOML"),
        ("baud = 'fast'", "baud = 'fast' is no whole number"),
        (
            "[identity]\nquery = 'I2'",
            "[identity] is incomplete: give query, pattern, answer, or leave it out",
        ),
        ("colour = 'red'", "setting 'colour' is not known to csv: allowed are format, columns"),
    ],
)
def test_a_bad_preset_is_one_clear_line(tmp_path, text, fault):
    path = tmp_path / "bad.toml"
    if text is not None:
        path.write_text(text)
    assert fault in refusal(make_source, {"format": str(path)}, 10.0)


def test_an_unknown_preset_names_the_known_ones():
    with pytest.raises(SettingsError, match="'mtsics' is not known: give one of columns, openscale, and-bal"):
        make_source({"format": "mtsics"}, 10.0)


# --- streams that are started ------------------------------------------------------------------


def test_a_stream_is_started_and_stopped():
    link = ScriptedLink(lambda sent: b"".join(b"%d\r" % k for k in range(99)) if sent == b"\x11" else b"")
    source = make_source({"format": "mantracourt-dscusb"}, 300.0)
    first = source.start(link)
    blocks = [block for data in (first, *iter(link.read, b"")) for block in source.decode(data, 0)]
    source.stop(link)
    assert link.sent == [b"\x11", b"\x13"]
    np.testing.assert_array_equal(join(blocks).counts[:, 0], np.arange(1, 99))


@pytest.mark.parametrize("name", STREAMS)
def test_a_simulated_stream_waits_for_its_start_and_obeys_its_stop(name):
    wire = Wire()
    device = make_device(
        wire, find_driver("csv").make_simulated({"format": name}), lambda *_: Ramp(), DeviceSetup(100.0)
    )
    commands = read_csv_settings({"format": name})[0].commands()
    end_ns = run_for(device, 0.2)
    assert wire.sent == b""
    wire.inbox = commands.start
    end_ns = run_for(device, 1.0, end_ns)
    source = make_source({"format": name}, 100.0)
    block = join(source.decode(bytes(wire.sent), 0))
    assert len(block) >= 98
    np.testing.assert_array_equal(np.diff(block.counts[:, 0]), 1)
    wire.inbox = commands.stop + b"?"  # a stop may be the beginning of a start until more comes
    end_ns = run_for(device, 0.05, end_ns)
    sent = len(wire.sent)
    run_for(device, 0.5, end_ns)
    assert len(wire.sent) == sent


# --- lines that are asked for ------------------------------------------------------------------


IDENTITIES = {"mt-sics": "AL204 Standard 210.0000 g", "scpi-read": "HEWLETT-PACKARD,34401A"}
"""What the simulated devices answer, as the manuals show it; the others are not asked."""


def test_a_balance_that_does_not_know_the_question_is_read_all_the_same():
    link = ScriptedLink(lambda sent: b"ES\r\n" if sent == b"I2\r\n" else b"S S      1.00 g\r\n")
    source = make_source({"format": "mt-sics"}, None)
    source.start(link)
    assert link.sent.count(b"I2\r\n") == 1
    assert source.identity.name == read_preset("mt-sics").title


def count_good(blocks):
    return sum(int(np.count_nonzero(block.status == 0)) for block in blocks)


@pytest.mark.parametrize("name", POLLED)
def test_a_polled_device_is_read_over_its_wire(name):
    wire = open_tcp_port()
    with serving(wire, "csv", {"format": name}, lambda *_: Ramp(), DeviceSetup(1000.0)):
        source = make_source({"format": name}, None)
        with open_port(wire.url, 9600) as link:
            assert source.start(link) == b""
            blocks, read, end_s = [], b"", time.perf_counter() + PATIENCE_S
            while count_good(blocks) < max(20.0, source.rate_hz) and time.perf_counter() < end_s:
                data = source.read(link)
                read += data
                blocks += source.decode(data, time.monotonic_ns()) if data else []
    assert source.identity.name == IDENTITIES.get(name, read_preset(name).title)
    assert 5 <= source.rate_hz <= 100  # some ten bytes there and back at 9600 baud
    assert source.run_note
    block = join(blocks)
    good = block.status == 0
    index, time_s = block.counts[good, 0], block.device_time_s[good]
    assert len(np.unique(index)) == good.sum()  # nothing repeats
    slope, start = np.polyfit(time_s, index, 1)
    assert slope == pytest.approx(1000.0, rel=0.05)  # the ramp is the simulated device's time in ms
    assert np.std(index - start - slope * time_s) < 10  # ms
    replayed = join(make_source({"format": name}, source.rate_hz).decode(read, 0))
    np.testing.assert_array_equal(replayed.counts, block.counts)
    np.testing.assert_array_equal(replayed.device_time_s, block.device_time_s)


class Asked:
    """A device that answers each request after 20 ms by a clock of its own, or not at all."""

    def __init__(self, monkeypatch, answer=lambda k: b"%d\r\n" % k) -> None:
        self.now_ns, self.answer, self.asked, self.waiting = 10**12, answer, 0, b""
        self.read_s = 0.02
        for name in ("drivers.polling.host_ns", "drivers.polling.time.perf_counter"):
            scale = 1 if name.endswith("host_ns") else 1e-9
            monkeypatch.setattr(name, lambda scale=scale: self.now_ns * scale)
        monkeypatch.setattr("drivers.polling.time.sleep", self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)

    def write(self, data: bytes) -> None:
        assert data == b"?\n"
        self.waiting = self.answer(self.asked)
        self.asked += 1

    def read(self) -> bytes:
        self.now_ns += round(1e9 * (self.read_s if self.waiting else 0.05))
        data, self.waiting = self.waiting, b""
        return data


def asking(link: Asked, rate_hz: float | None = 25.0, **settings: str) -> PolledLinesSource:
    source = make_source({"columns": "value", "poll": r"?\n", **settings}, rate_hz)
    assert isinstance(source, PolledLinesSource)
    source.start(link)
    return source


def test_each_line_gets_the_time_of_its_measurement(monkeypatch):
    link = Asked(monkeypatch)
    source = asking(link)
    data = b"".join(source.read(link) for _ in range(40))
    times_us, values = np.array([line.split(b",") for line in data.split()], dtype=float).T
    np.testing.assert_array_equal(np.diff(times_us), 40_000)
    np.testing.assert_array_equal(np.diff(values), 1)
    block = join(source.decode(data, 0))
    assert not block.status.any()
    np.testing.assert_allclose(np.diff(block.device_time_s), 0.04)


def test_lost_late_and_damaged_answers(monkeypatch):
    """The first answer after a lost one may be the lost one: it is not believed."""
    link = Asked(monkeypatch)
    source = asking(link, 10.0)
    first = link.asked
    odd = {first + 10: b"", first + 11: b"%d\r\n" % (first + 10), first + 20: b"1x\r\n"}
    link.answer = lambda k: odd.get(k, b"%d\r\n" % k)
    data = b"".join(source.read(link) for _ in range(120))
    block = join(source.decode(data, 0))
    # 0.5 s, five cells, were waited for the answer to the request of the tenth; a damaged row stands first
    assert np.flatnonzero(block.status == SampleStatus.MISSING).tolist() == [10, 11, 12, 13, 14, 15]
    assert np.flatnonzero(block.status == SampleStatus.DAMAGED).tolist() == [9, 24]
    assert (source.losses.missing_estimated, source.losses.damaged) == (6, 2)
    np.testing.assert_allclose(block.device_time_s, 0.1 * np.arange(len(block)), atol=2e-3)
    good = block.counts[block.status == 0, 0]
    steps = np.where(good[1:] == first + 12, 3, np.where(good[1:] == first + 21, 2, 1))
    np.testing.assert_array_equal(np.diff(good), steps)


def test_an_answer_out_of_its_place_is_damaged(monkeypatch):
    link = Asked(monkeypatch)
    source = asking(link, 10.0)
    data = b"".join(source.read(link) for _ in range(30))
    link.read_s = 0.08
    data += b"".join(source.read(link) for _ in range(3))
    link.read_s = 0.02
    data += b"".join(source.read(link) for _ in range(30))
    block = join(source.decode(data, 0))
    assert 1 <= source.losses.damaged <= 3
    assert not block.counts[block.status != 0].any()


def test_the_rate_is_that_of_the_answers_or_refused(monkeypatch):
    assert asking(Asked(monkeypatch), None).rate_hz == pytest.approx(40.0)
    with pytest.raises(ProtocolError, match="rate 80 Hz cannot be: a poll takes 20 ms, ask for --rate 40"):
        asking(Asked(monkeypatch), 80.0)


def test_a_device_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(CsvLinesSource, "timeout_s", 1.0)
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        asking(Asked(monkeypatch, lambda _: b""))


def test_a_polled_line_has_no_time_of_its_own():
    with pytest.raises(SettingsError, match="columns time_us,value: a line that is polled has the host's"):
        make_source({"columns": "time_us,value", "poll": "?"}, 10.0)


@pytest.mark.parametrize(
    ("name", "line"), [("mt-sics", b"S D   %8.2f g\r\n"), ("and-balance", b"US,%+010.1f  g\r\n")]
)
def test_streams_of_balances_are_recognised(name, line):
    """As a balance sends them that was told to repeat (SIR) or to print by itself."""
    data = b"".join(line % (7.0 + 0.1 * k) for k in range(30))[5:]
    found = recognise(data, 3.0)
    assert found is not None
    assert (found.protocol, found.settings, found.channels) == ("csv", {"format": name}, 1)
