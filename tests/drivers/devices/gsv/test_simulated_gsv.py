"""The simulated GSV answers requests as a GSV does."""

import struct

import numpy as np
import pytest
from device_kit import Wire, ramp_at, run_for

from drivers.devices.gsv.codec import FrameDecoder, FrameLayout, ValueKind
from drivers.devices.gsv.commands import (
    Code,
    encode_request,
    encode_response,
    find_response,
    set_float,
    write_rate,
)
from drivers.devices.gsv.simulated import SimulatedGsv, find_commands
from drivers.devices.gsv.source import GsvSettings
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, SimulatedDevice
from drivers.simulated.protocol import CommandParser


def ask(device: SimulatedDevice, wire: Wire, *said: bytes, now_ns: int = 0) -> bytes:
    """What the device sends after each piece."""
    before = len(wire.sent)
    for piece in said:
        wire.inbox = piece
        device.step(now_ns)
    return bytes(wire.sent[before:])


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def silent(wire):
    """A device that was stopped."""
    device = SimulatedDevice(wire, find_driver("gsv").make_simulated({}), ramp_at, DeviceSetup(1000.0))
    device.step(0)
    ask(device, wire, encode_request(Code.STOP))
    return device


def test_sends_from_power_up_until_it_is_stopped(wire):
    device = SimulatedDevice(wire, find_driver("gsv").make_simulated({}), ramp_at, DeviceSetup(1000.0))
    run_for(device, 0.05)
    blocks = list(FrameDecoder(FrameLayout(2), 1000.0).feed(bytes(wire.sent), 0))
    counts = np.concatenate([block.counts for block in blocks])
    np.testing.assert_array_equal(counts[:, 0], np.arange(len(counts)))
    np.testing.assert_array_equal(counts[:, 1], -np.arange(len(counts)))
    assert len(counts) == device.log.samples - 1 >= 49
    assert ask(device, wire, encode_request(Code.STOP), now_ns=50_000_000).endswith(encode_response(0))
    assert ask(device, wire, b"", now_ns=90_000_000) == b""


def test_answers_in_any_cut_and_after_rubbish(silent, wire):
    said = (
        b"\xaa\x90xx"
        + encode_request(Code.READ_RATE)
        + b"\x85"
        + write_rate(250.0)
        + encode_request(Code.READ_RATE)
    )
    rates = [
        encode_response(0, struct.pack(">f", 1000.0)),
        encode_response(0),
        encode_response(0, struct.pack(">f", 250.0)),
    ]
    assert ask(silent, wire, said) == b"".join(rates)
    assert ask(silent, wire, *(said[k : k + 1] for k in range(len(said)))) == b"".join(
        [rates[2], rates[1], rates[2]]
    )


@pytest.mark.parametrize(
    ("said", "error"),
    [
        (encode_request(Code.START), 0),
        (set_float(), 0),
        (encode_request(Code.SET_FORMAT, bytes([1, 0, 0x20])), 0x52),
        (write_rate(48_000.0), 0),
        (write_rate(0.5), 0x52),
        (encode_request(Code.SET_INPUT, bytes([1, 2])), 0),
        (encode_request(Code.SET_INPUT, bytes([1, 9])), 0x52),
        (encode_request(Code.SET_ZERO, bytes([2])), 0),
        (encode_request(Code.SET_ZERO, bytes([3])), 0x52),
        (bytes.fromhex("aa907f85"), 0x40),
    ],
)
def test_answers_say_what_was_done(silent, wire, said, error):
    found = find_response(ask(silent, wire, said))
    assert found is not None
    assert found.error == error


def test_set_zero_takes_the_last_reading_off(silent, wire):
    ask(silent, wire, encode_request(Code.START))
    run_for(silent, 0.02)
    ask(silent, wire, encode_request(Code.STOP), encode_request(Code.SET_ZERO, bytes([1])), now_ns=20_000_000)
    one = ask(silent, wire, encode_request(Code.GET_VALUE), now_ns=20_000_000)
    (block,) = FrameDecoder(FrameLayout(2), 1000.0).feed(one + one, 0)
    assert block.counts[0, 0] == 0
    assert block.counts[0, 1] < 0


def test_a_device_left_at_whole_numbers_changes_to_floats_when_told(wire):
    packing = SimulatedGsv(GsvSettings(format="device", table=2, relative=1))
    device = SimulatedDevice(wire, packing, ramp_at, DeviceSetup(1000.0))
    run_for(device, 0.02)
    assert wire.sent[:3] == bytes([0xAA, 0x11, 0x80 | ValueKind.INT24 << 4])
    ask(device, wire, encode_request(Code.STOP), set_float(), now_ns=20_000_000)
    one = ask(device, wire, encode_request(Code.GET_VALUE), now_ns=20_000_000)
    assert one[:3] == bytes([0xAA, 0x11, 0x80 | ValueKind.FLOAT32 << 4])


def test_a_reader_keeps_little_of_what_is_no_request():
    reader = CommandParser(find_commands)
    for _ in range(100):
        assert reader.feed(b"\xaa\x9fno request" * 20) == []
        assert len(reader._unfinished) < 20
