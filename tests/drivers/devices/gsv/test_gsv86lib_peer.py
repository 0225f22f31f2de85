"""The vendor's own client, gsv86lib, reads what we encode and talks to our simulated device."""

import sys
import threading
import time
import warnings
from queue import Queue

import numpy as np
import pytest
from gsv_kit import decode, frames, readings

from drivers.devices.gsv.codec import FrameLayout, encode_frames
from drivers.devices.gsv.commands import encode_response
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, SimulatedDevice
from drivers.simulated.transport import open_pseudo_terminal

pytest.importorskip("gsv86lib", reason="the vendor's client is not installed")
from gsv86lib.GSV6_Protocol import GSV_6Protocol
from gsv86lib.GSV6_SeriallLib import GSV6_seriall_lib

RATE_HZ = 500.0


class Counting:
    """Readings that tell which sample they are; table and relative differ."""

    def __init__(self, started: int = 0) -> None:
        self._next = started

    def take(self, count: int):
        index = np.arange(self._next, self._next + count, dtype=np.int32)
        self._next += count
        status = np.where(index % 10 == 7, np.uint8(4), np.uint8(0))
        return np.column_stack([index, 1_000_000 + 3 * index]).astype(np.int32), status


class Stand:
    """The simulated GSV on a pseudo-terminal, stepped by a thread, with all that went through it."""

    def __init__(self) -> None:
        self.terminal = open_pseudo_terminal()
        self.device = SimulatedDevice(
            self.terminal, find_driver("gsv").make_simulated({}), lambda *_: Counting(), DeviceSetup(RATE_HZ)
        )
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "Stand":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self.terminal.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            self.terminal.wait(min(self.device.step(time.monotonic_ns()), 0.02))


def peer_frames(data: bytes) -> list:
    """Frames as the peer takes them from bytes."""
    queue: Queue = Queue()
    parser = GSV_6Protocol(queue, Queue())
    for at in range(0, len(data), 50):
        parser.dataReceived(bytearray(data[at : at + 50]))
    return [queue.get() for _ in range(queue.qsize())]


@pytest.mark.parametrize("layout", [FrameLayout(2), FrameLayout(8, table=3, relative=8)], ids=["2", "8"])
def test_the_peer_decodes_the_same_samples_from_our_bytes(layout):
    flags = np.where(np.arange(300) % 7 == 0, np.uint8(1), np.uint8(0))
    wire = encode_frames(layout, readings(300), flags).tobytes()
    ours, _ = decode([wire], layout)
    library = GSV6_seriall_lib()
    theirs = peer_frames(wire + b"\xaa")[:299]
    values = np.array([library.convertToFloat(frame.getPayload()) for frame in theirs])
    np.testing.assert_array_equal(values[:, [layout.table - 1, layout.relative - 1]], ours.counts)
    assert [frame.isMesswertInputOverload() for frame in theirs] == (ours.status != 0).tolist()
    assert {frame.getMesswertDataTypeAsString() for frame in theirs} == {"float32"}


def test_the_peer_builds_the_same_requests():
    from drivers.devices.gsv.commands import (
        Code,
        InputType,
        encode_request,
        set_float,
        set_input,
        write_rate,
    )

    library = GSV6_seriall_lib()
    assert bytes(library.buildStopTransmission()) == encode_request(Code.STOP)
    assert bytes(library.buildStartTransmission()) == encode_request(Code.START)
    assert bytes(library.buildGetDataRate()) == encode_request(Code.READ_RATE)
    assert bytes(library.buildGetValue()) == encode_request(Code.GET_VALUE)
    assert bytes(library.buildWriteDataRate(library.convertFloatToBytes(1234.5))) == write_rate(1234.5)
    assert bytes(library.buildSetTXModeToFloat()) == set_float()
    assert bytes(library.buildWriteSetZero(2)) == encode_request(Code.SET_ZERO, bytes([2]))
    assert bytes(library.buildSetInputTypeGSV8(2, 1)) == set_input(2, InputType.BRIDGE_5_V)


def test_the_peer_takes_our_answers():
    (frame,) = peer_frames(encode_response(0x52, b"\x01\x02") + b"\xaa")
    assert frame.getAntwortErrorCode() == 0x52
    assert frame.getAntwortErrorText() == "ERR_PAR_DAT"
    assert bytes(frame.getPayload()) == b"\x01\x02"


@pytest.fixture
def stand():
    with Stand() as stand:
        yield stand


@pytest.fixture
def client(stand):
    """The vendor's client on the simulated device's port; its threads are ended with the test."""
    from gsv86lib import gsv86

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # it still calls Thread.setDaemon
        client = gsv86(stand.terminal.url, 115200)
    yield client
    client.serialReadThread.stop()
    client.serialReadThread.join()
    client.router.stop()
    client._frameInBuffer.put(peer_frames(frames(1)[0] + b"\xaa")[0])  # wakes it from its wait
    client.router.join()
    client._gsvSerialPort.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_the_peer_reads_the_simulated_device(stand, client):
    assert client.readDataRate() == RATE_HZ
    assert client.isResultOk(client.writeDataRate(200.0))
    assert client.readDataRate() == 200.0
    assert client.isResultOk(client.setTXmodefloat())
    assert client.isResultOk(client.setInputTypeToBridge_5V(1))
    client.ReadMultiple()
    client.StartTransmission()
    time.sleep(0.5)
    client.StopTransmission()
    time.sleep(0.1)
    got = client.ReadMultiple()
    assert client.isResultOk(client.SetZero(0))
    zeroed = client.ReadValue()
    assert len(got) == stand.device.log.samples > 20
    table = np.array([values["channel0"] for _, values, _, _ in got])
    np.testing.assert_array_equal(table, np.arange(len(got)))
    relative = np.array([values["channel1"] for _, values, _, _ in got])
    np.testing.assert_array_equal(relative, 1_000_000 + 3 * np.arange(len(got)))
    assert [k for k, (_, _, overload, _) in enumerate(got) if overload] == list(range(7, len(got), 10))
    assert (zeroed.getChannel1(), zeroed.getChannel2()) == (0.0, 0.0)
