"""The simulated stand as a process: its truth file agrees with its bytes, and it ends with its parent."""

import os
import select
import signal
import subprocess
import sys
import time

import msgspec
import numpy as np
import pytest

from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.motion import RepeatedPullback, released_motion
from app.simulated_stand.options import SimulatedStandError, SimulatedStandOptions
from app.simulated_stand.signal import StandSignal
from app.simulated_stand.truth import Truth
from config.files import load_gauges
from config.schema import Gauges
from drivers.devices.slipstand_binary.codec import FrameDecoder
from drivers.errors import DeviceLostError, PortUnavailableError, SettingsError
from drivers.port import Port, open_port
from drivers.samples import SampleBlock
from tests.drills.processes import gone, is_alive

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")

SHORT = {"rest_s": 0.2, "pull_s": 0.2, "hold_s": 0.2, "decay_s": 0.8, "recentre_s": 0.1}

SILENCE_S = 2.0
"""Without a byte, after which a stand that was told to stop has stopped; a busy computer may hold it up."""


def listen(port: str, duration_s: float, rate_hz: float) -> tuple[np.ndarray, FrameDecoder]:
    """Counts of a stream of `duration_s` of the device's time, started and stopped by command."""
    decoder = FrameDecoder(rate_hz)
    blocks = []
    descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(descriptor, b"S")
        while decoder.losses.samples < duration_s * rate_hz:
            blocks += decoder.feed(os.read(descriptor, 65536), 0)
        os.write(descriptor, b"P")
        while select.select([descriptor], [], [], SILENCE_S)[0]:
            blocks += decoder.feed(os.read(descriptor, 65536), 0)
    finally:
        os.close(descriptor)
    return np.concatenate([block.counts for block in blocks]), decoder


def test_what_it_sends_is_its_truth_to_the_sample():
    rate_hz = 2000.0
    with SimulatedStand.start(SimulatedStandOptions(rate_hz=rate_hz, noise_m=0.0, **SHORT)) as stand:
        counts, decoder = listen(stand.port, 1.2, rate_hz)
    truth = stand.truth()
    assert truth.wire.samples == len(counts)
    assert truth.wire.samples_lost == truth.wire.samples_damaged == decoder.losses.discarded_bytes == 0
    assert truth.release_s == pytest.approx([0.6])
    gauge = load_gauges().table
    table_m = (counts[:, 0] - gauge.zero_count) * gauge.gain_m_per_count
    released = round(truth.release_s[0] * rate_hz)
    held_m = truth.stand.pullback_m
    np.testing.assert_allclose(table_m[released - 300 : released + 1], held_m, atol=1.001e-9)
    # From rest, u1'' = (-c u0 + m2 g f_d) / m1 while it slips: the paper's Eq. (1).
    true = truth.stand
    acceleration = -true.stiffness_n_per_m * held_m + true.plate_mass_kg * 9.81 * true.friction_dynamic
    after_s = 0.001
    moved_m = acceleration / true.table_mass_kg * after_s**2 / 2
    assert table_m[released + 2] - held_m == pytest.approx(moved_m, rel=1e-3)


def test_at_100_khz_every_sample_arrives_or_is_counted_as_lost():
    with SimulatedStand.start(SimulatedStandOptions(rate_hz=100_000.0, **SHORT)) as stand:
        _, decoder = listen(stand.port, 1.0, 100_000.0)
    wire, losses = stand.truth().wire, decoder.losses
    assert wire.samples >= 100_000
    assert losses.samples - losses.missing - losses.damaged == wire.samples - wire.samples_lost


def test_two_streams_are_the_same_when_the_seed_is_given():
    with SimulatedStand.start(SimulatedStandOptions(rate_hz=1000.0, seed=3, **SHORT)) as stand:
        first, _ = listen(stand.port, 0.3, 1000.0)
        second, _ = listen(stand.port, 0.3, 1000.0)
    shorter = min(len(first), len(second))
    np.testing.assert_array_equal(first[:shorter], second[:shorter])
    assert stand.truth().streams == 2


def listen_on(port: Port, duration_s: float, rate_hz: float) -> tuple[list[SampleBlock], FrameDecoder]:
    """Blocks of what comes within a time."""
    decoder = FrameDecoder(rate_hz)
    blocks: list[SampleBlock] = []
    end = time.monotonic() + duration_s
    while time.monotonic() < end:
        blocks += decoder.feed(port.read(), time.monotonic_ns())
    return blocks, decoder


def test_over_tcp_a_reader_may_go_and_come_back_and_finds_what_it_missed_counted():
    rate_hz = 2000.0
    with SimulatedStand.start(SimulatedStandOptions(tcp_port=0, seed=2, **SHORT)) as stand:
        assert stand.port.startswith("socket://127.0.0.1:")
        with open_port(stand.port, 115200) as port:
            port.write(b"S")
            before, _ = listen_on(port, 0.4, rate_hz)
        time.sleep(0.3)
        with open_port(stand.port, 115200) as port:
            after, decoder = listen_on(port, 0.4, rate_hz)
            port.write(b"P")
            after += listen_on(port, 0.2, rate_hz)[0]
    truth = stand.truth()
    signal = StandSignal(*motion_and_gauges(truth), truth.options, rate_hz)
    sent, _ = signal.take(truth.wire.samples)
    first = np.concatenate([block.counts for block in before])
    second = np.concatenate([block.counts for block in after])
    np.testing.assert_array_equal(first, sent[: len(first)])
    np.testing.assert_array_equal(second, sent[-len(second) :])
    assert decoder.losses.missing == decoder.losses.damaged == 0
    assert truth.wire.samples_lost > 0.25 * rate_hz
    # What was under way when the reader left is lost to it, too: at most what a connection holds.
    unaccounted = truth.wire.samples - len(first) - len(second) - truth.wire.samples_lost
    assert 0 <= unaccounted < 0.2 * rate_hz


def motion_and_gauges(truth: Truth) -> tuple[RepeatedPullback, Gauges]:
    released = released_motion(truth.stand, truth.timetable)
    return RepeatedPullback(truth.stand.pullback_m, released, truth.timetable), load_gauges()


@pytest.mark.parametrize("where", [{}, {"tcp_port": 0}], ids=["pty", "tcp"])
def test_a_cable_pulled_on_demand_comes_back_under_the_same_address(where):
    with SimulatedStand.start(SimulatedStandOptions(**where, **SHORT)) as stand:
        with open_port(stand.port, 115200) as port:
            port.write(b"S")
            listen_on(port, 0.2, 2000.0)
            stand.disturb("unplug 1")
            with pytest.raises(DeviceLostError):
                listen_on(port, 5.0, 2000.0)
        with pytest.raises(PortUnavailableError):  # pyserial takes 0.3 s to close a socket
            open_port(stand.port, 115200)
        while stand.truth().disturbances == []:
            time.sleep(0.01)
        time.sleep(1.1)
        with open_port(stand.port, 115200) as port:
            _, decoder = listen_on(port, 0.3, 2000.0)
            port.write(b"P")
            listen_on(port, 0.1, 2000.0)
    truth = stand.truth()
    assert truth.streams == 1
    assert [(d.kind, d.seconds) for d in truth.disturbances] == [("unplug", 1.0)]
    assert {d.fault for d in truth.wire.damage} == {"unheard"}
    assert truth.wire.samples_lost > 0.9 * 2000.0
    assert decoder.losses.samples > 200
    assert decoder.losses.missing == 0


def test_what_is_no_fault_or_comes_too_late_is_refused():
    with (
        SimulatedStand.start(SimulatedStandOptions(**SHORT)) as stand,
        pytest.raises(SettingsError, match="explode"),
    ):
        stand.disturb("explode")
    with pytest.raises(SimulatedStandError, match="ended"):
        stand.disturb("stall 1")


def test_the_truth_can_be_read_where_it_was_wanted(tmp_path):
    path = tmp_path / "truth.json"
    options = SimulatedStandOptions(truth_file=str(path), friction=0.15, **SHORT)
    with SimulatedStand.start(options) as stand:
        assert stand.truth().stand.friction_dynamic == 0.15
        listen(stand.port, 0.8, 2000.0)
    truth = msgspec.json.decode(path.read_bytes(), type=Truth)
    assert truth == stand.truth()
    assert truth.port == stand.port
    assert truth.options == options.completed()
    assert [entry.name for entry in tmp_path.iterdir()] == ["truth.json"]


def test_a_stand_that_cannot_be_is_refused_with_its_reason():
    with pytest.raises(SimulatedStandError, match="1XXM0"):
        SimulatedStand.start(SimulatedStandOptions(series="1XXM0"))
    with pytest.raises(SimulatedStandError, match="scale-line"):
        SimulatedStand.start(SimulatedStandOptions(protocol="scale-line"))
    with pytest.raises(SimulatedStandError, match="friction_static"):
        SimulatedStand.start(SimulatedStandOptions(friction=0.2, static_friction=0.1))


def test_stopping_ends_the_process_and_may_be_repeated():
    stand = SimulatedStand.start(SimulatedStandOptions(**SHORT))
    assert stand.is_running
    stand.stop()
    stand.stop()
    assert gone(stand.process_id)
    assert not stand.is_running


def test_it_ends_when_its_owner_is_killed():
    owner = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from app.simulated_stand.options import SimulatedStandOptions\n"
            "from app.simulated_stand.client import SimulatedStand\n"
            "import time\n"
            "stand = SimulatedStand.start(SimulatedStandOptions())\n"
            "print(stand.process_id, flush=True)\n"
            "time.sleep(600)\n",
        ],
        stdout=subprocess.PIPE,
    )
    with owner:
        process_id = int(owner.stdout.readline())
        assert is_alive(process_id)
        owner.send_signal(signal.SIGKILL)
    assert gone(process_id)
