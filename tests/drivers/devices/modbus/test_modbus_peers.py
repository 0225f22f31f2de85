"""Programs that are not ours on the other end: pymodbus as transmitter and master, minimalmodbus too."""

import asyncio
import os
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from serving_kit import serving
from wire_helpers import join

from drivers import port_probe
from drivers.devices.modbus.source import make_source
from drivers.errors import ProtocolError
from drivers.port import open_port, port_info
from drivers.samples import SampleBlock, SampleStatus
from drivers.simulated.device import DeviceSetup
from drivers.simulated.transport import Transport, open_pseudo_terminal, open_tcp_port
from tests.waiting import PATIENCE_S

ORDERS = {"ABCD": "BIG", "CDAB": "LITTLE_SWAP", "BADC": "BIG_SWAP", "DCBA": "LITTLE"}
"""The orders as minimalmodbus names them."""
COUNTS = (7_654_321, -123_456)


class Still:
    """A signal that does not move."""

    def take(self, count: int):
        return np.tile(np.array(COUNTS, dtype=np.int32), (count, 1)), np.zeros(count, dtype=np.uint8)


@contextmanager
def simulated(transport: Transport, settings: dict[str, str]) -> Iterator[str]:
    """The simulated device on a wire, in a thread."""
    with serving(transport, "modbus", settings, lambda *_: Still(), DeviceSetup(1000.0)):
        yield transport.url


# --- pymodbus as transmitter -------------------------------------------------------------


FRAMINGS = ("rtu", "tcp")
"""Pymodbus speaks both over TCP."""


@contextmanager
def pymodbus_server(values: dict[int, list[int]], first: int = 0, framing: str = "rtu") -> Iterator[str]:
    """Units with the registers `values`, on a TCP port; yields what a reader opens."""
    server_module = pytest.importorskip("pymodbus.server", reason="pymodbus is not installed")
    from pymodbus import FramerType
    from pymodbus.simulator import DataType, SimData, SimDevice

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number = free.getsockname()[1]
    units = [
        SimDevice(unit, [SimData(first, values=held, datatype=DataType.REGISTERS)])
        for unit, held in values.items()
    ]
    framer_name = {"rtu": "RTU", "tcp": "SOCKET"}[framing]
    loop = asyncio.new_event_loop()
    is_ready = threading.Event()

    async def serve() -> None:
        server = server_module.ModbusTcpServer(
            units,
            framer=getattr(FramerType, framer_name),
            address=("127.0.0.1", number),
            ignore_missing_devices=True,
        )
        await server.serve_forever(background=True)
        is_ready.set()
        await ended.wait()
        await server.shutdown()

    ended = asyncio.Event()
    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()))
    thread.start()
    assert is_ready.wait(PATIENCE_S)
    try:
        yield f"socket://127.0.0.1:{number}"
    finally:
        loop.call_soon_threadsafe(ended.set)
        thread.join()
        loop.close()


def registers(layout: str, *values: float) -> list[int]:
    data = struct.pack(layout, *values)
    return list(struct.unpack(f">{len(data) // 2}H", data))


def read_some(url: str, settings: dict[str, str], samples: int = 5):
    source = make_source(settings, 50.0)
    blocks: list[SampleBlock] = []
    end_s = time.perf_counter() + PATIENCE_S
    with open_port(url, 115200) as port:
        source.start(port)
        while source.losses.samples < samples and time.perf_counter() < end_s:
            blocks += source.decode(data, 0) if (data := source.read(port)) else []
    return join(blocks), source


@pytest.mark.parametrize(
    ("settings", "held", "expected"),
    [
        ({}, registers(">ii", *COUNTS), COUNTS),
        ({"type": "float32", "scale": "1000"}, registers(">ff", 1.5, -2.25), (1500.0, -2250.0)),
        ({"type": "int16", "relative_register": "1"}, registers(">hh", -32_000, 5), (-32_000, 5)),
        ({"order": "CDAB"}, registers(">HHHH", 0xE240, 0x0001, 0xC07D, 0xFFFF), (123_456, -16_259)),
    ],
    ids=["int32", "float32", "int16", "low word first"],
)
def test_we_read_the_registers_that_pymodbus_serves(settings, held, expected):
    with pymodbus_server({1: held}) as url:
        block, _ = read_some(url, settings)
    good = block.status == 0
    assert np.count_nonzero(good)
    assert np.all(block.counts[good] == expected)


@pytest.mark.parametrize("framing", FRAMINGS)
def test_we_read_two_units_of_pymodbus_with_status_and_sign(framing):
    held = {1: registers(">Hi", 0x80, 70_000), 2: registers(">Hi", 0x08, 123)}
    with pymodbus_server(held, first=6, framing=framing) as url:
        block, source = read_some(url, {"map": "laumas-tlb4", "framing": framing})
    read = (block.status & (SampleStatus.MISSING | SampleStatus.DAMAGED)) == 0
    assert np.all(block.counts[read] == [-70_000, 123])
    assert np.all(block.status[read] == SampleStatus.OVERLOAD_RELATIVE)
    assert source.skew_s > 0


def test_we_read_a_dad141_of_pymodbus_and_the_probe_finds_it(monkeypatch):
    """Gross weight, net weight and qualifier, of which the net weight is not needed."""
    monkeypatch.setattr(port_probe, "FIRST_WAIT_S", 0.1)
    with pymodbus_server({1: registers(">iiH", -70_000, 5, 0x0002)}, 0x3300, "tcp") as url:
        block, source = read_some(url, {"map": "flintec-dad141", "channel": "table"})
        report = port_probe.probe_port(port_info(url), True, lambda _: None)
    read = (block.status & (SampleStatus.MISSING | SampleStatus.DAMAGED)) == 0
    assert np.all(block.counts[read] == [-70_000, 0])
    assert np.all(block.status[read] == SampleStatus.OVERLOAD_TABLE)
    assert source.skew_s == 0.0
    found = report.recognition  # the register asked for is not there, and pymodbus says so
    assert (found.protocol, found.settings) == ("modbus", {"framing": "tcp"})


@pytest.mark.parametrize("framing", FRAMINGS)
def test_an_exception_of_pymodbus_is_told(monkeypatch, framing):
    monkeypatch.setattr("drivers.devices.modbus.source.ModbusSource.timeout_s", 0.1)
    said = "refuses function 03 for registers 2 to 5: illegal data address"
    server = pymodbus_server({1: [0, 1, 2, 3]}, framing=framing)
    with server as url, pytest.raises(ProtocolError, match=said):
        read_some(url, {"table_register": "2", "relative_register": "4", "framing": framing})


def test_our_zero_command_is_taken_by_pymodbus():
    for function in ("6", "16"):
        settings = {"zero": "true", "zero_register": "3", "zero_value": "99", "zero_function": function}
        for framing in FRAMINGS:
            with pymodbus_server({1: [0, 1, 0, 0]}, framing=framing) as url:
                block, _ = read_some(url, settings | {"framing": framing})
            assert block.counts[0].tolist() == [1.0, 99.0]


# --- masters that read the simulated device ----------------------------------------------


@pytest.fixture
def master_for():
    minimalmodbus = pytest.importorskip("minimalmodbus", reason="minimalmodbus is not installed")
    if os.name != "posix":
        pytest.skip("minimalmodbus needs a serial port, and so a pseudo-terminal")
    opened = []

    def make(url: str, unit: int = 1):
        master = minimalmodbus.Instrument(url, unit)
        master.serial.baudrate, master.serial.timeout = 115200, 0.3
        opened.append(master)
        return master

    yield make
    for master in opened:
        master.serial.close()


@pytest.mark.parametrize("order", ORDERS)
def test_minimalmodbus_reads_our_whole_numbers(master_for, order):
    import minimalmodbus

    named = getattr(minimalmodbus, f"BYTEORDER_{ORDERS[order]}")
    with simulated(open_pseudo_terminal(), {"order": order}) as url:
        master = master_for(url)
        found = [master.read_long(register, signed=True, byteorder=named) for register in (0, 2)]
    assert tuple(found) == COUNTS


def test_minimalmodbus_reads_our_floats_and_input_registers(master_for):
    with simulated(open_pseudo_terminal(), {"type": "float32", "function": "4", "scale": "0.5"}) as url:
        master = master_for(url)
        found = [master.read_float(register, functioncode=4) for register in (0, 2)]
    assert found == [2.0 * count for count in COUNTS]


def test_minimalmodbus_is_refused_and_heard_as_a_transmitter_does(master_for):
    import minimalmodbus

    zero = {"zero_register": "5", "zero_value": "8"}
    with simulated(open_pseudo_terminal(), zero) as url:
        master = master_for(url)
        with pytest.raises(minimalmodbus.IllegalRequestError, match="illegal data address"):
            master.read_register(77)
        with pytest.raises(minimalmodbus.IllegalRequestError, match="illegal function"):
            master.read_register(0, functioncode=4)
        with pytest.raises(minimalmodbus.IllegalRequestError, match="illegal data value"):
            master.write_register(5, 7)
        for function in (6, 16):
            master.write_register(5, 8, functioncode=function)
        assert master.read_registers(0, 4) == [0, 0, 0, 0]
        master.address = 2
        with pytest.raises(minimalmodbus.NoResponseError):
            master.read_register(0)


@pytest.mark.parametrize("framing", FRAMINGS)
def test_pymodbus_reads_our_units(framing):
    client_module = pytest.importorskip("pymodbus.client", reason="pymodbus is not installed")
    from pymodbus import FramerType

    framer = {"rtu": FramerType.RTU, "tcp": FramerType.SOCKET}[framing]
    with simulated(open_tcp_port(), {"map": "laumas-tlb4", "framing": framing}) as url:
        number = int(url.rpartition(":")[2])
        client = client_module.ModbusTcpClient("127.0.0.1", port=number, framer=framer)
        assert client.connect()
        found = [client.read_holding_registers(6, count=3, device_id=unit).registers for unit in (1, 2)]
        refused = client.read_holding_registers(60, count=3, device_id=1)
        client.close()
    high, low = divmod(123_456, 1 << 16)
    assert found == [[0, *divmod(COUNTS[0], 1 << 16)], [0x80, high, low]]  # the sign is a bit
    assert refused.isError()
    assert refused.exception_code == 2
