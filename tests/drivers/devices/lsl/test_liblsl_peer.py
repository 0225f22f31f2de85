"""An outlet of liblsl in another process, as a laboratory's own feeder is, read by our driver."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from drivers import lsl_link
from drivers.devices.lsl.source import make_source
from drivers.errors import DeviceLostError, PortUnavailableError
from drivers.port import list_streams, open_port
from drivers.samples import SampleStatus

try:
    lsl_link.load_pylsl()
except PortUnavailableError as error:
    pytest.skip(str(error), allow_module_level=True)

SOURCE_ID = f"slipstand-test-{os.getpid()}"
FEEDER = f"""
import sys, time, pylsl
info = pylsl.StreamInfo("My rig", "Force", 3, 1000, "float32", "{SOURCE_ID}")
outlet = pylsl.StreamOutlet(info)
while not outlet.wait_for_consumers(1):
    pass
start = pylsl.local_clock()
for first in range(0, 1000, 20):
    time.sleep(0.005)
    if first not in (500, 520):
        samples = [[k, -k, k / 4] for k in range(first, first + 20)]
        outlet.push_chunk(samples, start + (first + 19) / 1000)
sys.stdin.read()
"""
SAMPLES = 1000


@pytest.fixture
def feeder():
    process = subprocess.Popen(
        [sys.executable, "-c", FEEDER], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    yield process
    process.kill()
    process.wait()


def read_until(port, deadline_s: float) -> None:
    while time.monotonic() < deadline_s:
        port.read()


def test_every_sample_of_a_feeder_is_read_and_what_it_left_out_is_missing(feeder, monkeypatch):
    monkeypatch.setattr(lsl_link, "RESOLVE_S", 20.0)
    monkeypatch.setattr(lsl_link, "_LIST_S", 0.3)
    source = make_source({"table": "2", "relative": "0"}, None)
    with open_port(f"lsl://{SOURCE_ID}", 0) as port:
        blocks = list(source.decode(source.start(port), 0))
        deadline_s = time.monotonic() + 20
        while sum(map(len, blocks)) < SAMPLES and time.monotonic() < deadline_s:
            blocks += source.decode(source.read(port), 0)
        assert (f"lsl://{SOURCE_ID}", "LSL stream My rig of") in [
            (one.device, one.description[:20]) for one in list_streams()
        ]
        feeder.stdin.close()
        with pytest.raises(DeviceLostError, match="has ended: start the program that sends it again"):
            read_until(port, deadline_s)
    status = np.concatenate([block.status for block in blocks])
    counts = np.concatenate([block.counts for block in blocks])
    times_s = np.concatenate([block.device_time_s for block in blocks])
    index = np.arange(SAMPLES)
    was_left_out = (index >= 500) & (index < 540)
    np.testing.assert_array_equal((status & SampleStatus.MISSING) != 0, was_left_out)
    expected = np.where(was_left_out[:, None], 0, np.column_stack([index / 4, index]))
    np.testing.assert_array_equal(counts, expected)
    np.testing.assert_allclose(times_s, index / 1000, atol=2e-4)
    assert (source.identity.name, source.identity.serial_number) == ("My rig", SOURCE_ID)
    monkeypatch.setattr(lsl_link, "RESOLVE_S", 0.2)
    with pytest.raises(PortUnavailableError, match="there is no stream lsl://slipstand-test"):
        open_port(f"lsl://{SOURCE_ID}", 0)
