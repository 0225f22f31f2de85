"""harp-device, the client of the Harp project, talks to the simulated LoadCells over pyserial."""

import sys
import threading
import time

import numpy as np
import pytest
import serial
from device_kit import ramp_at
from serving_kit import serving

from drivers.devices.harp import simulated
from drivers.devices.harp.codec import TICKS_PER_S
from drivers.simulated.device import DeviceSetup
from drivers.simulated.transport import open_pseudo_terminal

client = pytest.importorskip("harp.device.client", reason="harp-device is not installed")
core = pytest.importorskip("harp.device.core")
protocol = pytest.importorskip("harp.protocol")

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
RATE_HZ = 1000.0


class PlainTransport:
    """As `harp.serial.SerialTransport`, less the DTR line, which a pseudo-terminal has not."""

    def __init__(self, url: str) -> None:
        self._url = url

    def open(self) -> None:
        self._serial = serial.Serial(self._url, 1_000_000, timeout=0.1)

    def write(self, data: bytes) -> None:
        self._serial.write(data)

    def read(self) -> bytes:
        return self._serial.read(self._serial.in_waiting or 1)

    def close(self) -> None:
        self._serial.close()


class AcquisitionState(protocol.RegisterU8):
    """Register 32 (device.loadcells, device.yml)."""

    address = 32


class Unknown(protocol.RegisterU8):
    """A register that LoadCells has not."""

    address = 99


LOAD_CELL_DATA = protocol.RegisterS16Array(33, length=8)


@pytest.fixture
def device():
    wire = open_pseudo_terminal()
    with (
        serving(wire, "harp", {"table": "2", "relative": "5"}, ramp_at, DeviceSetup(RATE_HZ)) as stand,
        client.Device(PlainTransport(wire.url)) as peer,
    ):
        yield stand, peer


def test_the_peer_identifies_the_simulated_device(device):
    _, peer = device
    assert int(peer.read(core.WhoAmI).payload) == 1232
    firmware = [int(peer.read(one).payload) for one in (core.FirmwareVersionHigh, core.FirmwareVersionLow)]
    assert tuple(firmware) == simulated.FIRMWARE
    assert int(peer.read(core.SerialNumber).payload) == simulated.SERIAL_NUMBER
    with pytest.raises(client.DeviceError, match="error for register address 99"):
        peer.read(Unknown)


def test_the_peer_reads_every_sample_of_the_simulated_device(device):
    stand, peer = device
    assert peer.read(core.OperationControl).payload.operation_mode == core.OperationMode.STANDBY
    active = core.OperationControlPayload(operation_mode=core.OperationMode.ACTIVE)
    assert peer.write(core.OperationControl, active).payload.operation_mode == core.OperationMode.ACTIVE
    got, enough = [], threading.Event()

    def take(event) -> None:
        got.append((event.timestamp, *event.payload.tolist()))
        if len(got) >= 1000:
            enough.set()

    with peer.subscribe(LOAD_CELL_DATA, take):
        peer.write(AcquisitionState, 1)
        assert enough.wait(30)
        peer.write(AcquisitionState, 0)
        time.sleep(0.2)
    assert len(got) == stand.log.samples - stand.log.samples_lost
    times_s, values = np.array(got)[:, 0], np.array(got)[:, 1:]
    indices = np.rint(values[:, 2]).astype(int)
    np.testing.assert_array_equal(values[:, 5], -indices)
    apart = np.diff(indices)
    assert apart.min() == 1
    assert (apart - 1).sum() <= stand.log.samples_lost  # those that this computer sent too late
    np.testing.assert_allclose(np.diff(times_s), apart / RATE_HZ, atol=1.5 / TICKS_PER_S)
    steps = np.rint(np.diff(times_s) * TICKS_PER_S).astype(int)
    assert set(steps[apart == 1]) == {31, 32}
