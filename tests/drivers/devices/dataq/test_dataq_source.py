import numpy as np
import pytest
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.dataq import source as dataq_source
from drivers.devices.dataq.codec import FOLLOWING, WITH_DIGITAL, encode_scans, header, layout_of
from drivers.devices.dataq.commands import (
    MODELS,
    Divisors,
    divisors_for,
    find_reply,
    firmware_version,
    packet_size,
)
from drivers.devices.dataq.simulated import make_protocol
from drivers.devices.dataq.source import DataqSource, make_source
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.samples import ChannelFilter, DeviceIdentity
from drivers.simulated.protocol import CommandKind, CommandParser

COUNTS = np.stack([np.arange(800) * 16, np.arange(800) * -16], axis=1)


class Firmware:
    """Answers as the simulated instrument; sends 800 scans at once when it is started."""

    def __init__(self, model: str = "2108", refused: str = "none") -> None:
        device = make_protocol({"model": model})
        self._device, self._parser = device, CommandParser(device.find_commands)
        self._scans = encode_scans(layout_of(model), COUNTS, MODELS[model].bits).tobytes()
        self._refused = refused.encode()

    def __call__(self, sent: bytes) -> bytes:
        if sent.startswith(self._refused):
            return b""
        (command,) = self._parser.feed(sent)
        scans = self._scans if command.kind is CommandKind.START else b""
        return self._device.respond(command, True, 2000.0) + scans


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(DataqSource, "timeout_s", 0.4)
    monkeypatch.setattr(DataqSource, "answer_timeout_s", 0.05)


def test_the_conversation_of_a_start():
    link = ScriptedLink(Firmware())
    source = make_source({"relative": "3"}, None)
    first = source.start(link)
    assert b"".join(link.sent).decode().split("\r") == [
        "stop", "info 1", "info 2", "info 6", "info 9", "encode 0", "ps 1", "slist 0 0", "slist 1 3",
        "slist 2 8", "filter 0 0", "filter 3 0", "srate 30000", "dec 1", "deca 1", "start 0", "",
    ]  # fmt: skip
    assert source.identity == DeviceIdentity("dataq", "DATAQ DI-2108", "1.35", "5A3C10E2")
    assert source.rate_hz == 2000.0
    assert source.filters == (None, None)
    block = join(block for data in (first, *iter(link.read, b"")) for block in source.decode(data, 0))
    np.testing.assert_array_equal(block.counts, COUNTS[:-FOLLOWING])
    assert source.losses.discarded_bytes == source.losses.damaged == 0
    source.stop(link)
    assert link.sent[-1] == b"stop\r"


def test_the_conversation_with_a_model_without_decimation():
    link = ScriptedLink(Firmware("1100"))
    source = make_source({"filter": "average"}, 1000.0)
    source.start(link)
    sent = b"".join(link.sent)
    assert b"slist 1 1\rfilter 0 1\rfilter 1 1\rsrate 2000\rdeca 30\r" in sent
    assert source.filters[0] == ChannelFilter(1, pytest.approx(443.0))


def test_a_range_is_a_code_of_the_scan_list():
    link = ScriptedLink(Firmware("4108"))
    make_source({"range_v": "0.5"}, None).start(link)
    assert b"slist 0 1024\r" in link.sent
    assert b"slist 1 1025\r" in link.sent


def test_an_instrument_that_overflowed_is_started_again():
    link = ScriptedLink(Firmware())
    source = make_source({}, None)
    data = source.start(link)
    link._answer = lambda _: b""
    data += b"".join(iter(lambda: source.read(link), b""))
    link._waiting = b"stop 01"
    link._answer = Firmware()
    before = len(link.sent)
    told = source.read(link)
    assert (told, link.sent[before:]) == (b"stop 01" + header("2108"), [b"start 0\r"])
    list(source.decode(data, 0))
    list(source.decode(told + b"".join(iter(link.read, b"")), 500_000_000))
    assert source.losses.restarts == 1
    assert source.losses.missing_estimated == pytest.approx(1000 - len(COUNTS), abs=5)
    assert len(source.take_warnings()) == 1


@pytest.mark.parametrize(
    ("settings", "model", "fault"),
    [
        ({"model": "1110"}, "2108", "DI-2108, and 1110 can be read: choose its port"),
        ({"table": "5"}, "1100", "DI-1100 has channels 0 to 3, and a gauge is to be on 5"),
        ({"range_v": "5"}, "2108", "DI-2108 has no range of 5 V: set range_v to one of 10"),
    ],
)
def test_what_the_model_cannot_is_said(settings, model, fault):
    with pytest.raises(ProtocolError, match=fault):
        make_source(settings, None).start(ScriptedLink(Firmware(model)))


def test_a_model_that_is_not_read_is_named():
    link = ScriptedLink(lambda sent: b"info 1 2008\r" if sent == b"info 1\r" else sent)
    with pytest.raises(ProtocolError, match="DI-2008, and 1100, 1110, 1120, 2108, 4108, 4208 can be read"):
        make_source({}, None).start(link)


def test_a_command_that_is_refused_is_named():
    with pytest.raises(ProtocolError, match="does not take deca 1: update its firmware"):
        make_source({}, None).start(ScriptedLink(Firmware(refused="deca")))


def test_a_silent_instrument_and_one_that_sends_nothing():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))
    with pytest.raises(NoDataError, match="nothing came"):
        make_source({}, None).start(ScriptedLink(Firmware(refused="start")))


@pytest.mark.parametrize("settings", [{}, {"model": "2108"}])
def test_replayed_bytes_need_neither_start_nor_header(settings):
    source = make_source(settings, None)
    block = join(source.decode(encode_scans(WITH_DIGITAL, COUNTS).tobytes(), 0))
    np.testing.assert_array_equal(block.counts, COUNTS[:-FOLLOWING])


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        ({"channel": "1"}, None, "setting 'channel' is not known to dataq: allowed are table, relative"),
        ({"table": "8"}, None, "table 8 is no channel: give 0 to 7"),
        ({"table": "1"}, None, "table and relative are both channel 1"),
        ({}, 0.0, "rate 0 Hz cannot be"),
        ({}, float("nan"), "rate nan Hz cannot be"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)


@pytest.mark.parametrize(
    ("model", "rate_hz", "averages", "expected"),
    [  # rate = 60 MHz / (srate dec deca), limits of page 48
        ("2108", 1000.0, False, Divisors(60_000)),
        ("2108", 1000.0, True, Divisors(375, 160)),
        ("2108", 10.0, False, Divisors(65_217, 92)),
        ("2108", 10.0, True, Divisors(378, 512, 31)),
        ("1110", 500.0, False, Divisors(60_000, 1, 2)),
        ("1100", 30_000.0, False, Divisors(2000)),
    ],
)
def test_divisors_make_the_rate(model, rate_hz, averages, expected):
    found = divisors_for(MODELS[model], rate_hz, averages=averages, dividend_hz=60e6)
    assert found == expected
    assert found.rate_hz() == pytest.approx(rate_hz, rel=0.003)


def test_a_rate_beyond_the_model_is_refused():
    with pytest.raises(SettingsError, match="rate 40000 Hz is too high for DI-1100: give 30000 at most"):
        divisors_for(MODELS["1100"], 40_000.0, averages=False, dividend_hz=60e6)
    with pytest.raises(SettingsError, match="too low for DI-1110"):
        divisors_for(MODELS["1110"], 0.01, averages=False, dividend_hz=60e6)


def test_replies_of_the_manual():
    assert find_reply(b"info 1 2008\r", "info 1") == "2008"  # page 21
    assert find_reply(b"\0ps 1\r\0", "ps 1") == ""
    assert find_reply(b"ps 32\r", "ps") == "32"
    assert find_reply(b"info 1 20", "info 1") is None
    assert firmware_version("65") == "1.01"  # page 20
    assert [packet_size(rate * 6) for rate in (10, 1000, 5000, 160_000)] == [0, 0, 3, 7]


def test_the_usual_rate_is_that_of_the_simulated_device():
    assert dataq_source.DRIVER.simulated_rate_hz == dataq_source.RATE_HZ
