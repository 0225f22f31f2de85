import numpy as np
import pytest
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.harp.codec import (
    ERROR,
    START,
    STOP,
    U16,
    HarpMessage,
    Register,
    encode,
    encode_events,
    encode_read,
    encode_write,
)
from drivers.devices.harp.simulated import SimulatedHarp, find_commands
from drivers.devices.harp.source import HarpSettings, HarpSource, make_source
from drivers.errors import NoDataError, ProtocolError
from drivers.recognition import describe_unreadable
from drivers.samples import DeviceIdentity
from drivers.simulated.protocol import CommandKind, CommandParser

EVENTS = 800


def events(rate_hz: float = 1000.0) -> bytes:
    counts = np.arange(2 * EVENTS).reshape(EVENTS, 2)
    return encode_events(50 + np.arange(EVENTS) / rate_hz, counts).tobytes()


class Firmware:
    """Answers with the registers of the simulated device; sends all its events at once."""

    def __init__(self, rate_hz: float = 1000.0) -> None:
        self._device, self._listener, self._rate_hz = (
            SimulatedHarp(HarpSettings()),
            CommandParser(find_commands),
            rate_hz,
        )

    def __call__(self, sent: bytes) -> bytes:
        (command,) = self._listener.feed(sent)
        sends = command.kind is CommandKind.START
        return self._device.respond(command, True, self._rate_hz) + (events(self._rate_hz) if sends else b"")


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(HarpSource, "timeout_s", 0.4)
    monkeypatch.setattr(HarpSource, "answer_timeout_s", 0.05)


def test_the_conversation_of_a_start():
    link = ScriptedLink(Firmware(), waiting=events()[5:2000])
    source = make_source({}, None)
    first = source.start(link)
    assert link.sent == [
        STOP,
        encode_read(Register.WHO_AM_I),
        encode_read(Register.FIRMWARE_HIGH),
        encode_read(Register.FIRMWARE_LOW),
        encode_read(Register.SERIAL_NUMBER),
        encode_read(Register.OPERATION),
        encode_write(Register.OPERATION, 0xE1),
        encode_read(Register.OPERATION),
        encode_read(Register.EVENTS),
        START,
    ]
    assert source.identity == DeviceIdentity("harp", "Harp LoadCells", "1.1", "7")
    assert source.rate_hz == 1000.0
    block = join(block for data in (first, *iter(link.read, b"")) for block in source.decode(data, 0))
    np.testing.assert_array_equal(block.counts, np.arange(2 * EVENTS).reshape(EVENTS, 2))
    source.stop(link)
    assert link.sent[-1] == STOP


def test_another_rate_than_expected_is_said():
    with pytest.raises(ProtocolError, match=r"800\.?\d* Hz where 1000 Hz is expected: ask for --rate 800"):
        make_source({}, None).start(ScriptedLink(Firmware(800.0)))
    source = make_source({}, 800)
    source.start(ScriptedLink(Firmware(800.0)))
    assert source.rate_hz == 800


def test_another_harp_device_is_refused():
    behaviour = encode(HarpMessage(1, Register.WHO_AM_I, (1216).to_bytes(2, "little")), U16, 7)
    with pytest.raises(ProtocolError, match="is Harp 1216, and LoadCells is 1232: choose its port"):
        make_source({}, None).start(ScriptedLink(lambda _: behaviour))


def test_a_device_that_refuses_to_start():
    class Refusing(Firmware):
        def __call__(self, sent: bytes) -> bytes:
            refused = encode(HarpMessage(2 | ERROR, Register.ACQUISITION, b"\x00"), 1, 7)
            return refused if sent == START else super().__call__(sent)

    with pytest.raises(ProtocolError, match="refuses to start"):
        make_source({}, None).start(ScriptedLink(Refusing()))


def test_a_silent_device():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))


def test_a_device_that_sends_and_does_not_listen():
    with pytest.raises(NoDataError, match="sends and does not answer"):
        make_source({}, None).start(ScriptedLink(lambda _: events()[:84]))


def test_a_wrong_protocol_says_what_came():
    with pytest.raises(NoDataError, match=r"lines of text such as .* choose protocol csv"):
        make_source({}, None).start(ScriptedLink(lambda _: b"1000,12,13\r\n2000,14,15\r\n"))


def test_what_an_absent_reader_board_sends_is_explained():
    """The message of a recording that stalls."""
    sent = encode_events(50 + np.arange(200) / 1000, np.zeros((200, 2))).tobytes()
    said = "; ".join(
        f"channels {one} all read exactly 0: plug their reader board in" for one in ("0 to 3", "4 to 7")
    )
    assert str(describe_unreadable(sent, "harp")).endswith(said)
    plugged_in = encode_events(50 + np.arange(200) / 1000, np.zeros((200, 2)), idle_count=1).tobytes()
    assert "plug their" not in str(describe_unreadable(plugged_in, "harp"))


def test_replayed_bytes_need_no_start():
    counts = np.arange(2 * EVENTS).reshape(EVENTS, 2)
    source = make_source({"table": "1", "relative": "0", "overload_count": "1500"}, None)
    block = join(source.decode(events(), 0))
    np.testing.assert_array_equal(block.counts, counts[:, ::-1])
    assert source.losses.overloaded == np.count_nonzero((counts >= 1500).any(axis=1))


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        ({"channel": "1"}, None, "setting 'channel' is not known to harp: allowed are table, relative"),
        ({"table": "8"}, None, "table 8 is no channel: give 0 to 7"),
        ({"table": "1"}, None, "table and relative are both channel 1"),
        ({"overload_count": "0"}, None, "overload_count 0 must be positive"),
        ({}, 0.0, "rate 0 Hz cannot be"),
        ({}, float("nan"), "rate nan Hz cannot be"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)
