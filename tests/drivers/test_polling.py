"""Requests and responses on lines that send back what is written to them, as two-wire adapters do."""

import pytest
from wire_helpers import ScriptedLink

from drivers.devices.csv_lines.source import LineRequest
from drivers.devices.modbus.frames import Function, Request, encode_exception, encode_read_response
from drivers.polling import PollSchedule, ResponseTiming, Transaction, transact
from drivers.port_probe import query_identity
from drivers.registry import find_driver
from drivers.simulated.protocol import CommandParser

READ = Request(1, Function.READ_HOLDING, 0, 2)
READING = encode_read_response(1, 3, bytes(4))
WRITE = Request(1, Function.WRITE_SINGLE, 5, 1, (8,))
REFUSED = encode_exception(1, 6, 3)
LINE = LineRequest(b"SI\r\n")


@pytest.mark.parametrize(
    ("request_", "answer", "is_known", "read"),
    [
        (READ, READING, False, READING),
        (READ, b"", False, b""),
        (READ, READ.encode()[:3], False, READ.encode()[:3]),
        (LINE, b"S S 1.0 g\r\n", False, b"S S 1.0 g\r\n"),
        # the response to it is the request itself: what is known of the line tells both apart
        (WRITE, WRITE.encode(), True, WRITE.encode()),
        (WRITE, REFUSED, True, REFUSED),
        (WRITE, b"", True, b""),
    ],
)
def test_an_echo_is_no_response(request_, answer, is_known, read):
    link = ScriptedLink(lambda sent: sent + answer)
    found = transact(link, request_, 0.01, has_echo=is_known)
    assert (found.data, found.has_echo) == (read, True)
    without = transact(ScriptedLink(lambda _: answer), request_, 0.01)
    assert (without.data, without.has_echo) == (answer, False)


def test_a_poll_that_ends_early_does_not_change_the_skew():
    """Otherwise the first request alone follows late responses, until the second seems to precede it."""
    schedule = PollSchedule(100.0)

    def measured(after_ns: int) -> Transaction:
        return Transaction(b"", schedule.due_ns, schedule.due_ns + 2 * after_ns)

    timing = ResponseTiming([[measured(100_000), measured(300_000)]])
    for _ in range(50):
        timing.update([measured(schedule.tolerance_ns + 200_000)], schedule)
    assert timing.skew_s(0, 1) == pytest.approx(200e-6)


class DeviceLink:
    """A simulated device, or none, on a line that repeats what is sent, or on another one."""

    has_baud = False

    def __init__(self, protocol: str, settings: dict[str, str], *, is_there: bool, has_echo: bool) -> None:
        self._device = find_driver(protocol).make_simulated(settings)
        self._parser = CommandParser(self._device.find_commands)
        self._is_there, self._has_echo = is_there, has_echo
        self._waiting = b""
        self._now_s = 0.0

    def clock(self) -> float:
        self._now_s += 0.02
        return self._now_s

    def read(self) -> bytes:
        data, self._waiting = self._waiting, b""
        return data

    def write(self, data: bytes) -> None:
        self._waiting += data if self._has_echo else b""
        for command in self._parser.feed(data) if self._is_there else ():
            self._waiting += self._device.respond(command, True, 100.0)


@pytest.mark.parametrize("has_echo", [False, True])
@pytest.mark.parametrize(
    ("protocol", "settings", "remark"),
    [
        ("enod4", {}, "an eNod4 with address 1"),
        ("modbus", {}, "unit 1 answers"),
        ("csv", {"format": "mt-sics"}, "AL204 Standard 210.0000 g"),
        ("csv", {"format": "scpi-read"}, "HEWLETT-PACKARD,34401A"),
    ],
    ids=["enod4", "modbus", "mt-sics", "scpi-read"],
)
def test_the_probe_tells_a_device_from_the_echo_of_its_adapter(protocol, settings, remark, has_echo):
    link = DeviceLink(protocol, settings, is_there=True, has_echo=has_echo)
    found = query_identity(link, lambda _: None, clock=link.clock).recognition
    assert (found.protocol, found.settings) == (protocol, settings)
    assert found.channels == find_driver(protocol).make_source(settings, 1.0).channels
    assert str(found.remark).startswith(remark)
    empty = DeviceLink(protocol, settings, is_there=False, has_echo=has_echo)
    assert query_identity(empty, lambda _: None, clock=empty.clock) is None
