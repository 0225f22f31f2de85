"""The simulated Harp LoadCells answers requests as the board does."""

import numpy as np
import pytest
from device_kit import Wire, ramp_at, run_for

from drivers.devices.harp.codec import (
    ERROR,
    START,
    STOP,
    EventDecoder,
    HarpMessage,
    Register,
    encode_read,
    encode_write,
    find_messages,
)
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, SimulatedDevice


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def device(wire):
    device = SimulatedDevice(
        wire, find_driver("harp").make_simulated({}), ramp_at, DeviceSetup(1000.0, first_time_s=7.0)
    )
    device.step(0)
    return device


def ask(device: SimulatedDevice, wire: Wire, *said: bytes, now_ns: int = 0) -> list[HarpMessage]:
    before = len(wire.sent)
    for piece in said:
        wire.inbox = piece
        device.step(now_ns)
    return find_messages(bytes(wire.sent[before:]))[0]


def test_is_silent_until_it_is_active_and_started(device, wire):
    run_for(device, 0.05)
    assert wire.sent == b""
    ask(device, wire, START)
    run_for(device, 0.05)
    assert all(message.address != Register.LOAD_CELLS for message in find_messages(bytes(wire.sent))[0])
    ask(device, wire, STOP, encode_write(Register.OPERATION, 0xE1), START)
    wire.sent.clear()
    end_ns = run_for(device, 0.05)
    (block,) = EventDecoder(1000.0).feed(bytes(wire.sent), 0)
    np.testing.assert_array_equal(np.diff(block.counts[:, 0]), 1)
    assert len(block) >= 49
    assert ask(device, wire, STOP, now_ns=end_ns)[-1] == HarpMessage(2, Register.ACQUISITION, b"\x00")
    sent = len(wire.sent)
    run_for(device, 0.05, end_ns)
    assert len(wire.sent) == sent


def test_registers_are_read_and_written_in_any_cut(device, wire):
    said = (
        encode_read(Register.WHO_AM_I)
        + encode_write(Register.EVENTS, 0x01)
        + b"\x01\x02"
        + encode_read(Register.EVENTS)
    )
    expected = [HarpMessage(1, 0, b"\xd0\x04"), HarpMessage(2, 90, b"\x01"), HarpMessage(1, 90, b"\x01")]
    assert ask(device, wire, said) == expected
    assert ask(device, wire, *(said[k : k + 1] for k in range(len(said)))) == expected


def test_what_cannot_be_is_an_error(device, wire):
    unknown = bytes.fromhex("010463ff01") + bytes([0x68])
    assert ask(device, wire, unknown) == [HarpMessage(1 | ERROR, 0x63)]
    assert ask(device, wire, encode_write(Register.WHO_AM_I, 5)) == [HarpMessage(2 | ERROR, 0, b"\xd0\x04")]
