"""The simulated device against the decoder of its protocol, on a simulated wire and clock."""

import math

import numpy as np
import pytest
from device_kit import Ramp, Wire, decoded, ramp_at, run_for, start
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivers.devices.csv_lines.codec import LineDecoder
from drivers.devices.csv_lines.simulated import SimulatedCsv
from drivers.devices.csv_lines.source import CsvSettings
from drivers.devices.slipstand_binary.simulated import SimulatedBinary
from drivers.samples import SampleStatus
from drivers.simulated.device import DeviceSetup, SimulatedDevice
from drivers.simulated.faults import FaultRates, FrameFault


@given(
    rate_hz=st.sampled_from([100.0, 333.0, 500.0, 1000.0, 6400.0, 10_000.0, 100_000.0]),
    clock_ppm=st.floats(-1000, 1000),
    steps_ms=st.lists(st.floats(0.01, 3.0), min_size=1, max_size=60),
)
@example(500.0, 0.0, [1.0] * 9 + [3.0, 3.0, 3.0, 1.0, 1.5, 0.5, 2.0, 1.0, 2.0])
@settings(deadline=None, max_examples=60)
def test_sample_k_is_taken_at_k_over_rate_of_the_devices_own_clock(rate_hz, clock_ppm, steps_ms):
    def samples_by(now_ns: int) -> int:
        return math.floor(now_ns * 1e-9 * rate_hz * (1 + clock_ppm * 1e-6)) + 1

    wire = Wire()
    device = start(wire, DeviceSetup(rate_hz, clock_ppm))
    now_ns = 0
    device.step(now_ns)
    for step_ms in steps_ms:
        now_ns += round(step_ms * 1e6)
        device.step(now_ns)
        assert device.log.samples <= samples_by(now_ns)
    for _ in range(1000):  # what a long step left over is caught up with
        now_ns += 1_000_000
        device.step(now_ns)
    n = SimulatedBinary().samples_per_frame(rate_hz)
    # A frame that is complete in this very step may be sent with the next one.
    assert samples_by(now_ns - 4_000_000) // n * n <= device.log.samples <= samples_by(now_ns) // n * n
    blocks, decoder = decoded(wire, rate_hz)
    counts = np.concatenate([block.counts for block in blocks]) if blocks else np.empty((0, 2))
    np.testing.assert_array_equal(counts[:, 0], np.arange(device.log.samples))
    np.testing.assert_array_equal(counts[:, 1], -np.arange(device.log.samples))
    assert decoder.losses.discarded_bytes == 0


def test_a_stall_is_caught_up_in_pieces_that_a_port_can_hold_and_a_reader_bear():
    wire = Wire()
    device = start(wire, DeviceSetup(100_000.0))
    device.step(0)
    before = len(wire.sent)
    assert device.step(1_000_000_000) == pytest.approx(0.001)
    assert 0 < len(wire.sent) - before < 8192
    before = device.log.samples
    run_for(device, 0.2, 1_000_000_000)
    assert 1.2 * 0.2 * 100_000 < device.log.samples - before < 1.3 * 0.2 * 100_000


def test_a_process_that_gets_its_turn_seldom_keeps_the_rate_of_its_device():
    wire = Wire()
    device = start(wire, DeviceSetup(1000.0))
    for now_ns in range(0, 3_000_000_001, 30_000_000):
        device.step(now_ns)
    assert device.log.samples >= 3000 - 64


def test_obeys_the_commands_of_the_firmware():
    wire = Wire()
    device = SimulatedDevice(wire, SimulatedBinary(), ramp_at, DeviceSetup(2000.0))
    device.step(0)
    assert wire.sent == b""
    for piece in (b"xx", b"I", b"R5", b"00\nI"):
        wire.inbox = piece
        device.step(0)
    assert bytes(wire.sent) == b"slipstand-fw simulated-1 2000 2\nslipstand-fw simulated-1 500 2\n"
    wire.inbox = b"S"
    device.step(0)
    device.step(10_000_000)
    assert device.is_streaming
    assert device.log.rate_hz == 500.0
    wire.inbox = b"R1000\nP"  # the rate of a running stream stays
    device.step(10_000_000)
    assert not device.is_streaming
    sent = len(wire.sent)
    device.step(1_000_000_000)
    assert len(wire.sent) == sent
    wire.inbox = b"I"
    device.step(1_000_000_000)
    assert wire.sent.endswith(b"slipstand-fw simulated-1 500 2\n")


@pytest.mark.parametrize("rate", [b"R0\n", b"R100001\n", b"R99999999\n", b"Rx\n"])
def test_keeps_its_rate_when_asked_for_an_impossible_one(rate):
    wire = Wire()
    device = SimulatedDevice(wire, SimulatedBinary(), ramp_at, DeviceSetup(2000.0))
    wire.inbox = rate + b"I"
    device.step(0)
    assert bytes(wire.sent) == b"slipstand-fw simulated-1 2000 2\n"


def test_a_second_start_goes_on_with_the_stream_and_a_new_one_counts_from_zero():
    wire = Wire()
    device = start(wire, DeviceSetup(1000.0))
    run_for(device, 0.05)
    wire.inbox = b"S"
    run_for(device, 0.05, start_ns=50_000_000)
    assert device.streams == 1
    assert device.log.samples >= 95
    wire.inbox = b"PS"
    device.step(200_000_000)
    assert device.streams == 2
    assert device.log.samples == 0


def test_leaving_the_port_ends_the_stream():
    wire = Wire()
    device = start(wire, DeviceSetup(1000.0))
    run_for(device, 0.02)
    wire.inbox = None
    device.step(30_000_000)
    assert not device.is_streaming
    wire.inbox = b""
    device.step(40_000_000)
    assert not device.is_streaming


def test_csv_lines_begin_anew_with_each_opening_of_the_port():
    wire = Wire()
    device = SimulatedDevice(wire, SimulatedCsv(), ramp_at, DeviceSetup(500.0))
    run_for(device, 0.01)
    assert bytes(wire.sent).splitlines()[:3] == [b"0,0,0", b"2000,1,-1", b"4000,2,-2"]
    wire.inbox = None
    device.step(20_000_000)
    wire.sent.clear()
    wire.inbox = b"P"  # an Arduino that only prints hears nothing
    run_for(device, 0.01, start_ns=30_000_000)
    assert bytes(wire.sent).splitlines()[:2] == [b"0,0,0", b"2000,1,-1"]


def test_overload_is_flagged_on_the_frame_that_holds_it():
    class Overloaded(Ramp):
        def take(self, count: int):
            counts, status = super().take(count)
            status[(counts[:, 0] >= 10) & (counts[:, 0] < 12)] = SampleStatus.OVERLOAD_RELATIVE
            status[counts[:, 0] == 25] = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
            return counts, status

    wire = Wire()
    wire.inbox = b"S"
    device = SimulatedDevice(wire, SimulatedBinary(), lambda *_: Overloaded(), DeviceSetup(1000.0))
    run_for(device, 0.04)
    blocks, _ = decoded(wire, 1000.0)
    status = np.concatenate([block.status for block in blocks])
    assert set(np.flatnonzero(status & SampleStatus.OVERLOAD_RELATIVE)) == {*range(10, 15), *range(25, 30)}
    assert set(np.flatnonzero(status & SampleStatus.OVERLOAD_TABLE)) == set(range(25, 30))


def test_what_the_reader_does_not_fetch_is_lost_and_counted():
    wire = Wire(room=500)
    device = start(wire, DeviceSetup(1000.0))
    run_for(device, 0.5)  # 55 bytes each 5 ms: full after 9 frames
    wire.empty()
    run_for(device, 0.02, start_ns=500_000_000)
    blocks, decoder = decoded(wire, 1000.0)
    status = np.concatenate([block.status for block in blocks])
    counts = np.concatenate([block.counts for block in blocks])
    good = status == SampleStatus.GOOD
    np.testing.assert_array_equal(counts[good, 0], np.flatnonzero(good))
    assert device.log.samples_lost > 400
    assert device.log.samples_lost == decoder.losses.missing + decoder.losses.damaged
    assert {damage.fault for damage in device.log.damage} == {FrameFault.CUT}
    assert device.log.bytes_sent == len(wire.sent)


def test_damage_is_as_frequent_as_asked_and_found_whole_by_the_decoder():
    wire = Wire()
    device = start(wire, DeviceSetup(1000.0, faults=FaultRates(drop=0.03, flip=0.05), seed=4))
    run_for(device, 60.0)
    account = device.log
    kinds = [damage.fault for damage in account.damage]
    # 12,000 frames: five standard deviations of a binomial count either way.
    assert abs(kinds.count(FrameFault.DROP) - 0.03 * account.frames) < 5 * math.sqrt(0.03 * account.frames)
    assert abs(kinds.count(FrameFault.FLIP) - 0.05 * account.frames) < 5 * math.sqrt(0.05 * account.frames)
    assert account.frames_damaged == len(kinds)
    assert account.samples_damaged == sum(damage.samples for damage in account.damage)
    blocks, decoder = decoded(wire, 1000.0)
    status = np.concatenate([block.status for block in blocks])
    first = np.concatenate([block.counts for block in blocks])[0, 0]
    absent = {first + row for row in np.flatnonzero(status & 3)}
    expected = {d.first_index + k for d in account.damage for k in range(d.samples)}
    assert absent == {index for index in expected if first <= index < first + len(status)}
    assert decoder.losses.damaged + decoder.losses.missing == len(absent)


def test_a_line_without_its_end_takes_the_next_one_along():
    wire = Wire()
    device = SimulatedDevice(
        wire, SimulatedCsv(), ramp_at, DeviceSetup(1000.0, faults=FaultRates(drop=0.2), seed=1)
    )
    run_for(device, 5.0)
    damaged = {damage.first_index for damage in device.log.damage}
    merged = [damage for damage in device.log.damage if damage.fault is FrameFault.MERGED]
    lines = set(bytes(wire.sent).split(b"\r\n"))
    arrived = {k for k in range(device.log.samples) if b"%d,%d,%d" % (1000 * k, k, -k) in lines}
    assert len(merged) > 20
    assert arrived == set(range(device.log.samples)) - damaged


def test_damaged_lines_with_a_checksum_are_all_found_by_the_decoder():
    layout = CsvSettings(columns="time_us,table,relative,crc").layout()
    wire = Wire()
    faults = DeviceSetup(1000.0, faults=FaultRates(0.02, 0.02), seed=2)
    device = SimulatedDevice(wire, SimulatedCsv(layout), ramp_at, faults)
    run_for(device, 20.0)
    blocks = list(LineDecoder(layout, 1000.0).feed(bytes(wire.sent), 0))
    status = np.concatenate([block.status for block in blocks])
    counts = np.concatenate([block.counts for block in blocks])
    first = counts[0, 0]
    absent = {first + row for row in np.flatnonzero(status & 3)}
    assert len(absent) > 500
    damaged = {damage.first_index for damage in device.log.damage}
    assert absent == {index for index in damaged if first <= index < first + len(status)}


@pytest.mark.parametrize(("drop", "flip"), [(-0.1, 0.0), (0.0, math.nan), (0.6, 0.6)])
def test_fractions_that_cannot_be_are_refused(drop, flip):
    with pytest.raises(ValueError, match="give"):
        FaultRates(drop, flip)
