"""The simulated transmitter answers a master's requests, on a simulated clock."""

import numpy as np
import pytest
from device_kit import Wire, ramp_at

from drivers.devices.modbus.frames import (
    Function,
    Request,
    Response,
    encode_exception,
    exception_response,
    with_crc,
)
from drivers.devices.modbus.simulated import find_commands
from drivers.errors import SettingsError
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, PolledDevice, SimulatedDevice, make_device
from drivers.simulated.faults import FaultRates, parse_disturbance
from drivers.simulated.protocol import CommandParser

READ = Request(1, Function.READ_HOLDING, 0, 4)
RATE_HZ = 1000.0


def device_on(wire: Wire, settings: dict[str, str] | None = None, **setup) -> SimulatedDevice:
    device = make_device(
        wire, find_driver("modbus").make_simulated(settings or {}), ramp_at, DeviceSetup(RATE_HZ, **setup)
    )
    assert isinstance(device, PolledDevice)
    device.step(0)
    return device


def ask(device: SimulatedDevice, wire: Wire, data: bytes, now_ns: int = 0, for_ns: int = 20_000_000) -> bytes:
    before = len(wire.sent)
    wire.inbox = data
    end_ns = now_ns + for_ns
    while now_ns <= end_ns:
        now_ns += max(1, round(device.step(now_ns) * 1e9))
    return bytes(wire.sent[before:])


def test_nothing_is_sent_that_was_not_asked_for():
    wire = Wire()
    assert ask(device_on(wire), wire, b"", for_ns=500_000_000) == b""


def test_an_answer_comes_when_wire_and_device_had_their_time():
    """At 115200 baud 8 bytes take 694 us and 13 take 1128 us; between them the registers are read."""
    wire = Wire()
    device = device_on(wire)
    assert ask(device, wire, READ.encode(), 10_000_000, 2_000_000) == b""
    (counts,) = [np.frombuffer(_data(ask(device, wire, b"", 12_100_000, 500_000)), dtype=">i4")]
    np.testing.assert_array_equal(counts, [10, -10])  # the ramp is its time in ms


def _data(answer: bytes) -> bytes:
    found = READ.parse_response(answer)
    assert not found.fault
    return found.data


def test_requests_in_any_cut_and_behind_rubbish():
    wire = Wire()
    device = device_on(wire)
    for cut in range(1, 8):
        data = b"\x01\x03\xff" + READ.encode()
        ask(device, wire, data[:cut], for_ns=0)
        assert _data(ask(device, wire, data[cut:]))


def test_what_a_listener_keeps_is_bounded():
    listener = CommandParser(find_commands)
    assert listener.feed(bytes(100_000)) == []
    assert len(listener._unfinished) <= 256
    assert len(listener.feed(READ.encode())) == 1


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (Request(1, Function.READ_HOLDING, 3, 2), 2),
        (Request(1, Function.READ_HOLDING, 0, 126), 3),
        (Request(1, Function.READ_INPUT, 0, 4), 1),
        (Request(1, Function.WRITE_SINGLE, 77, 1, (1,)), 2),
        (Request(1, Function.WRITE_SINGLE, 5, 1, (9,)), 3),
    ],
)
def test_what_cannot_be_is_an_exception(request_, code):
    wire = Wire()
    device = device_on(wire, {"zero_register": "5", "zero_value": "8"})
    answer = ask(device, wire, request_.encode())
    assert answer == encode_exception(1, request_.function, code)
    assert request_.parse_response(answer) == exception_response(code)


def test_a_function_of_nobody_is_an_exception():
    wire = Wire()
    assert ask(device_on(wire), wire, with_crc(b"\x01\x11\x00\x00\x00\x00")) == encode_exception(1, 0x11, 1)


def test_other_units_are_silent():
    wire = Wire()
    assert ask(device_on(wire), wire, Request(2, Function.READ_HOLDING, 0, 4).encode()) == b""


def test_one_gauge_is_there_alone():
    wire = Wire()
    device = device_on(wire, {"channel": "relative"})
    assert ask(device, wire, READ.encode()) == encode_exception(1, 3, 2)
    half = Request(1, Function.READ_HOLDING, 2, 2)
    assert not half.parse_response(ask(device, wire, half.encode())).fault


@pytest.mark.parametrize("function", [Function.WRITE_SINGLE, Function.WRITE_MULTIPLE])
def test_the_zero_command(function):
    wire = Wire()
    device = device_on(wire, {"zero_register": "5", "zero_value": "8"})
    zero = Request(1, function, 5, 1, (8,))
    assert zero.parse_response(ask(device, wire, zero.encode(), 1_000_000_000)) == Response(b"")
    (reading,) = [np.frombuffer(_data(ask(device, wire, READ.encode(), 1_100_000_000)), dtype=">i4")]
    assert abs(reading[0]) < 150  # the ramp went on for some 0.1 s since


def test_faults_befall_answers():
    wire = Wire()
    device = device_on(wire, faults=FaultRates(flip=1.0), seed=1)
    answer = ask(device, wire, READ.encode())
    assert len(answer) == 13
    assert READ.parse_response(answer).fault
    assert (device.log.frames, device.log.frames_damaged) == (1, 1)


@pytest.mark.parametrize(("what", "size"), [("stall 5", 0), ("rubbish 5", 13)])
def test_disturbances_befall_answers(what, size):
    wire = Wire()
    device = device_on(wire, disturbances=(parse_disturbance(what),), seed=1)
    answer = ask(device, wire, READ.encode())
    assert len(answer) == size
    assert READ.parse_response(answer).fault
    assert not READ.parse_response(ask(device, wire, READ.encode(), 6_000_000_000)).fault


def test_what_was_asked_before_the_cable_was_pulled_is_not_answered():
    wire = Wire()
    device = device_on(wire, disturbances=(parse_disturbance("unplug 1 at 0.0005"),))
    assert ask(device, wire, READ.encode(), for_ns=1_500_000_000) == b""
    assert _data(ask(device, wire, READ.encode(), 1_500_000_000))


def test_two_stands_that_began_together_show_one_motion():
    """The same begin, though one of them was opened 2 s later: the ramp is the stand's own time."""
    readings = []
    for opened_ns in (10_000_000_000, 12_000_000_000):
        wire = Wire()
        packing = find_driver("modbus").make_simulated({})
        device = make_device(wire, packing, ramp_at, DeviceSetup(RATE_HZ, began_ns=9_000_000_000))
        device.step(opened_ns)
        answer = ask(device, wire, READ.encode(), 13_000_000_000)
        readings.append(np.frombuffer(_data(answer), dtype=">i4").tolist())
    assert readings[0] == readings[1] == [4000, -4000]


def test_settings_are_checked():
    with pytest.raises(SettingsError, match="map 'x' is not known"):
        find_driver("modbus").make_simulated({"map": "x"})
