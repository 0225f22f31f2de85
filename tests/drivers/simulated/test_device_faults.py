"""Each fault of the simulated device: the decoder handles it, and the truth file accounts for it."""

import math

import numpy as np
import pytest
from device_kit import Ramp, Wire, decoded, run_for, start

from drivers.devices.csv_lines.codec import LineDecoder
from drivers.devices.csv_lines.simulated import SimulatedCsv
from drivers.devices.csv_lines.source import CsvSettings
from drivers.devices.gsv.commands import Code, encode_request
from drivers.devices.slipstand_binary.codec import rate_from_frames
from drivers.devices.slipstand_binary.simulated import SimulatedBinary
from drivers.errors import SettingsError
from drivers.registry import find_driver
from drivers.samples import SampleStatus
from drivers.simulated.device import DeviceSetup, SimulatedDevice
from drivers.simulated.faults import FaultRates, FrameFault, parse_disturbance
from drivers.simulated.stream_sender import TransmissionLog

RATE_HZ = 1000.0
CHECKED = CsvSettings(columns="time_us,table,relative,crc").layout()


def planned(*texts: str, **setup) -> DeviceSetup:
    return DeviceSetup(RATE_HZ, disturbances=tuple(parse_disturbance(text) for text in texts), **setup)


def found_absent(blocks) -> set[int]:
    """Absent samples, by the counts that say which sample a row holds."""
    status = np.concatenate([block.status for block in blocks])
    counts = np.concatenate([block.counts for block in blocks])
    good = np.flatnonzero(status & 3 == 0)
    first = counts[good[0], 0] - good[0]
    np.testing.assert_array_equal(counts[good, 0], good + first)
    return {int(first + row) for row in np.flatnonzero(status & 3)}


def told_absent(account: TransmissionLog, before: float = math.inf) -> set[int]:
    return {d.first_index + k for d in account.damage for k in range(d.samples) if d.first_index + k < before}


def test_frames_cut_short_are_damaged_and_nothing_else_is():
    wire = Wire()
    device = start(wire, DeviceSetup(RATE_HZ, faults=FaultRates(truncate=0.05), seed=8))
    run_for(device, 30.0)
    account = device.log
    kinds = [damage.fault for damage in account.damage]
    assert set(kinds) == {FrameFault.TRUNCATE}
    assert abs(len(kinds) - 0.05 * account.frames) < 5 * math.sqrt(0.05 * account.frames)
    blocks, decoder = decoded(wire, RATE_HZ)
    end = sum(len(block) for block in blocks) + int(blocks[0].counts[0, 0])
    assert found_absent(blocks) == {k for k in told_absent(account, end) if k >= blocks[0].counts[0, 0]}
    assert decoder.losses.damaged > 0.9 * (decoder.losses.damaged + decoder.losses.missing)


def test_lines_cut_short_take_the_next_one_along():
    wire = Wire()
    setup = DeviceSetup(RATE_HZ, faults=FaultRates(truncate=0.05), seed=8)
    device = SimulatedDevice(wire, SimulatedCsv(CHECKED), lambda *_: Ramp(), setup)
    run_for(device, 20.0)
    assert {damage.fault for damage in device.log.damage} == {FrameFault.TRUNCATE, FrameFault.MERGED}
    blocks = list(LineDecoder(CHECKED, RATE_HZ).feed(bytes(wire.sent), 0))
    first = blocks[0].counts[0, 0]
    end = first + sum(len(block) for block in blocks)
    assert found_absent(blocks) == {k for k in told_absent(device.log) if first <= k < end}


@pytest.mark.parametrize("packing", [SimulatedBinary(), SimulatedCsv(CHECKED)], ids=["binary", "csv"])
@pytest.mark.parametrize(("word", "fault"), [("stall", FrameFault.STALL), ("rubbish", FrameFault.GARBAGE)])
def test_silence_and_rubbish_take_what_falls_into_their_time_and_the_rest_comes(packing, word, fault):
    wire = Wire()
    device = start(wire, planned(f"{word} 0.5 at 1", seed=3), packing)
    run_for(device, 2.0)
    assert [d.samples for d in device.log.damage if d.fault is fault] == [500]
    n = packing.samples_per_frame(RATE_HZ)
    if n > 1:
        blocks, decoder = decoded(wire, RATE_HZ)
    else:
        decoder = LineDecoder(CHECKED, RATE_HZ)
        blocks = list(decoder.feed(bytes(wire.sent), 0))
    assert found_absent(blocks) == told_absent(device.log) >= set(range(1000, 1500))
    assert len(told_absent(device.log)) <= 501  # rubbish may take the first line after it along
    losses = decoder.losses
    assert losses.damaged + losses.missing + losses.missing_estimated == len(told_absent(device.log))


def test_a_stall_for_ever_is_silent_even_when_asked_who_it_is():
    wire = Wire()
    device = start(wire, planned("stall at 0.1"))
    end_ns = run_for(device, 0.2)
    sent = len(wire.sent)
    wire.inbox = b"I"
    run_for(device, 5.0, end_ns)
    assert len(wire.sent) == sent
    assert device.log.samples_lost == device.log.samples - 100


def test_a_leap_of_the_clock_changes_times_alone():
    wire = Wire()
    device = start(wire, planned("jump -0.25 at 1", "jump 2 at 1.5"))
    run_for(device, 2.0)
    blocks, decoder = decoded(wire, RATE_HZ)
    assert decoder.losses.missing == decoder.losses.damaged == 0
    times_s = np.concatenate([block.device_time_s for block in blocks])
    steps_s = np.diff(times_s)
    leaps = np.flatnonzero(np.abs(steps_s - 1e-3) > 1e-6)
    np.testing.assert_array_equal(leaps, [999, 1499])
    np.testing.assert_allclose(steps_s[leaps], [1e-3 - 0.25, 1e-3 + 2.0], atol=1e-6)


def test_counter_and_clock_wrap_without_a_gap():
    wire = Wire()
    device = start(wire, DeviceSetup(RATE_HZ, first_sequence=2**32 - 500, first_time_s=2**32 * 1e-6 - 1.0))
    run_for(device, 2.0)
    blocks, decoder = decoded(wire, RATE_HZ)
    assert decoder.losses.samples == device.log.samples
    assert decoder.losses.restarts == decoder.losses.missing == 0
    times_s = np.concatenate([block.device_time_s for block in blocks])
    np.testing.assert_allclose(times_s, np.arange(len(times_s)) / RATE_HZ, atol=1.1e-6)


def test_a_wrong_rate_is_seen_in_the_times_that_the_device_sends():
    wire = Wire()
    device = start(wire, DeviceSetup(RATE_HZ, rate_error=0.05))
    run_for(device, 2.0)
    assert device.log.rate_hz == RATE_HZ
    assert device.log.true_rate_hz == pytest.approx(1050.0)
    assert abs(device.log.samples - 2100) <= 5
    assert rate_from_frames(bytes(wire.sent)) == pytest.approx(1050.0, rel=1e-5)


def test_a_wrong_clock_is_not():
    wire = Wire()
    device = start(wire, DeviceSetup(RATE_HZ, clock_ppm=50_000.0))
    run_for(device, 2.0)
    assert abs(device.log.samples - 2100) <= 5
    assert rate_from_frames(bytes(wire.sent)) == pytest.approx(1000.0, rel=1e-5)


def test_clipped_readings_are_counted_and_so_are_those_under_a_flag():
    class Clipped(Ramp):
        def take(self, count: int):
            counts, status = super().take(count)
            status[(counts[:, 0] >= 100) & (counts[:, 0] < 112)] = SampleStatus.OVERLOAD_TABLE
            return counts, status

    for packing, flagged in ((SimulatedBinary(), 15), (SimulatedCsv(), 0)):
        wire = Wire()
        wire.inbox = b"S"
        device = SimulatedDevice(wire, packing, lambda *_: Clipped(), DeviceSetup(RATE_HZ))
        run_for(device, 0.3)
        assert device.log.samples_clipped == 12
        assert device.log.samples_flagged == flagged
        if flagged:
            assert decoded(wire, RATE_HZ)[1].losses.overloaded == flagged


def test_a_device_with_power_of_its_own_goes_on_while_its_cable_is_out():
    wire = Wire()
    device = start(wire, planned("unplug 0.5 at 1"))
    now_ns = run_for(device, 1.2)
    assert not wire.is_plugged_in
    assert not device.is_plugged_in
    run_for(device, 0.8, now_ns)
    assert wire.is_plugged_in
    assert device.streams == 1
    assert [(d.fault, d.samples) for d in device.log.damage] == [
        (FrameFault.NO_READER, pytest.approx(500, abs=25))
    ]
    blocks, decoder = decoded(wire, RATE_HZ)
    assert found_absent(blocks) == told_absent(device.log)
    assert decoder.losses.missing == device.log.samples_lost


def test_a_stream_started_after_a_torn_one_goes_on_with_the_session():
    wire = Wire()
    device = start(wire, planned("unplug 0.5 at 1"))
    now_ns = run_for(device, 1.6)
    before = device.log
    sent = len(wire.sent)
    wire.inbox = b"PS"
    run_for(device, 0.4, now_ns)
    assert device.streams == 2
    assert device.earlier_logs == [before]
    assert device.log.started_s == pytest.approx(1.6, abs=0.03)
    again = Wire()
    again.sent = wire.sent[sent:]
    blocks, _ = decoded(again, RATE_HZ)
    assert blocks[0].counts[0, 0] == round(RATE_HZ * device.log.started_s)  # the stand has not waited
    assert [d.at_s for d in device.disturbances] == [1.0]
    wire.inbox = b"PS"
    run_for(device, 0.1, 2_100_000_000)
    assert device.earlier_logs == []
    assert device.log.started_s == 0.0


def test_a_stream_that_began_by_itself_when_power_came_back_may_be_stopped_and_started_once():
    wire = Wire()
    device = start(wire, planned("power 0.5 at 1"), find_driver("gsv").make_simulated({}))
    now_ns = run_for(device, 2.0)
    assert [one.started_s for one in (*device.earlier_logs, device.log)] == pytest.approx(
        [0.0, 1.5], abs=0.03
    )
    wire.inbox = encode_request(Code.STOP) + encode_request(Code.START)
    now_ns = run_for(device, 0.5, now_ns)
    starts_s = [one.started_s for one in (*device.earlier_logs, device.log)]
    assert starts_s == pytest.approx([0.0, 1.5, 2.0], abs=0.03)
    wire.inbox = encode_request(Code.STOP) + encode_request(Code.START)
    run_for(device, 0.1, now_ns)
    assert (device.earlier_logs, device.log.started_s) == ([], 0.0)


def test_a_device_without_power_forgets_that_it_was_started():
    wire = Wire()
    device = start(wire, planned("power 0.5 at 1"))
    now_ns = run_for(device, 2.0)
    assert not device.is_streaming
    assert device.log.samples == pytest.approx(1000, abs=25)
    assert wire.is_plugged_in
    wire.inbox = b"S"
    run_for(device, 0.2, now_ns)
    assert device.log.started_s == pytest.approx(2.0, abs=0.03)
    assert len(device.earlier_logs) == 1


def test_behind_a_converter_the_device_goes_on_when_its_reader_has_left():
    wire = Wire(resets_device=False)
    device = start(wire, DeviceSetup(RATE_HZ))
    now_ns = run_for(device, 0.5)
    wire.inbox = None
    now_ns = run_for(device, 0.5, now_ns)
    assert device.is_streaming
    wire.inbox = b""
    run_for(device, 0.5, now_ns)
    blocks, decoder = decoded(wire, RATE_HZ)
    assert found_absent(blocks) == told_absent(device.log)
    assert decoder.losses.missing == device.log.samples_lost == pytest.approx(500, abs=25)


def test_what_is_asked_for_while_it_runs_happens_at_once():
    wire = Wire()
    device = start(wire, DeviceSetup(RATE_HZ))
    now_ns = run_for(device, 0.5)
    device.disturb(parse_disturbance("stall 0.2"), now_ns)
    run_for(device, 0.5, now_ns)
    (stall,) = device.disturbances
    assert stall.at_s == pytest.approx(now_ns * 1e-9)
    assert [(d.fault, d.samples) for d in device.log.damage] == [(FrameFault.STALL, 200)]


def test_a_line_that_the_port_took_a_part_of_takes_the_next_one_along():
    wire = Wire(room=333)
    device = SimulatedDevice(wire, SimulatedCsv(CHECKED), lambda *_: Ramp(), DeviceSetup(RATE_HZ))
    now_ns = run_for(device, 0.1)
    wire.empty()
    run_for(device, 0.01, now_ns)
    assert not bytes(wire.sent[:333]).endswith(b"\r\n")
    blocks = list(LineDecoder(CHECKED, RATE_HZ).feed(bytes(wire.sent), 0))
    assert found_absent(blocks) == told_absent(device.log)
    assert [d.fault for d in device.log.damage][-1] is FrameFault.MERGED


def test_a_counter_that_cannot_be_is_refused():
    with pytest.raises(SettingsError, match="first_sequence"):
        DeviceSetup(RATE_HZ, first_sequence=2**32)


def test_what_is_unplugged_before_its_motion_begins_comes_back():
    wire = Wire()
    setup = DeviceSetup(RATE_HZ, began_ns=20_000_000_000)
    device = SimulatedDevice(wire, SimulatedCsv(CHECKED), lambda *_: Ramp(), setup)
    now_ns = run_for(device, 1.0)
    device.disturb(parse_disturbance("unplug 0.5"), now_ns)
    now_ns = run_for(device, 0.3, now_ns)
    assert not wire.is_plugged_in
    run_for(device, 0.4, now_ns)
    assert wire.is_plugged_in
