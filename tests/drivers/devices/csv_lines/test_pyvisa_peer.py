"""PyVISA, the usual client of multimeters, asks the simulated one that `scpi-read` is written for."""

import pytest
from device_kit import Ramp
from serving_kit import serving

from drivers.simulated.device import DeviceSetup
from drivers.simulated.transport import open_tcp_port

pyvisa = pytest.importorskip("pyvisa", reason="PyVISA is not installed")
pytest.importorskip("pyvisa_py", reason="PyVISA-py, its transport, is not installed")


def test_the_peer_reads_the_simulated_multimeter():
    wire = open_tcp_port()
    number = wire.url.rpartition(":")[2]
    settings = {"format": "scpi-read"}
    with serving(wire, "csv", settings, lambda *_: Ramp(1000), DeviceSetup(1000.0)) as device:
        manager = pyvisa.ResourceManager("@py")
        instrument = manager.open_resource(
            f"TCPIP::127.0.0.1::{number}::SOCKET", read_termination="\n", write_termination="\n"
        )
        readings = [float(instrument.query("READ?")) for _ in range(20)]
        taken = device.log.samples
        instrument.close()
        manager.close()
    assert readings == sorted(set(readings))  # the ramp goes on between two requests
    assert 1000 <= readings[0] < readings[-1] < 1000 + taken
