import numpy as np
import pytest
from modbus_kit import COUNTS, Clock, Transmitter, rows
from wire_helpers import join, refusal

from drivers.devices.modbus.frames import Function, Request, encode_exception, with_crc
from drivers.devices.modbus.simulated import find_commands
from drivers.devices.modbus.source import ModbusSource, make_source
from drivers.errors import DeviceLostError, NoDataError, ProtocolError
from drivers.recognition import describe_unreadable
from drivers.samples import DeviceIdentity, Losses
from drivers.simulated.protocol import CommandParser

READ = Request(1, Function.READ_HOLDING, 0, 4)


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    clock = Clock()
    clock.install(monkeypatch)
    return clock


def polls(source: ModbusSource, link: Transmitter, count: int) -> list[bytes]:
    """What some polls brought, without those calls that found no cell."""
    found: list[bytes] = []
    for _ in range(100 * count):
        data = source.read(link)
        found += [data] if data else []
        if len(found) == count:
            return found
    raise AssertionError(f"only {len(found)} of {count} polls were answered")


def started(link: Transmitter, settings: dict[str, str] | None = None, rate_hz: float | None = 200.0):
    source = make_source(settings or {}, rate_hz)
    assert source.start(link) == b""
    return source


def test_the_conversation(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=None)
    assert set(link.sent) == {READ.encode()}
    assert source.identity == DeviceIdentity("modbus", "Modbus RTU transmitter", settings={"map": "generic"})
    assert source.rate_hz == 320.0  # 1.25 times 2.5 ms
    block = rows(source, polls(source, link, 20))
    np.testing.assert_array_equal(block.counts, np.tile(COUNTS, (20, 1)))
    assert source.losses == Losses(samples=20)
    source.stop(link)
    assert set(link.sent) == {READ.encode()}


def test_polls_follow_the_grid_of_the_rate(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=100.0)
    begin_ns = clock.now_ns
    block = rows(source, polls(source, link, 20))
    assert (clock.now_ns - begin_ns) * 1e-9 == pytest.approx(19.75 / 100, abs=0.01)
    np.testing.assert_allclose(block.device_time_s, np.arange(20) / 100.0, atol=1e-9)
    assert (block.arrival_ns - 1_250_000) % 10_000_000 == 0  # the middle of request and answer


def test_a_poll_that_would_begin_late_is_left_out(clock):
    """A busy computer wakes up 2 ms late: what would be read then belongs to no place of the grid."""
    link = Transmitter(clock)
    source = started(link, rate_hz=100.0)
    reads = polls(source, link, 3)
    asked = len(link.sent)
    sleep, clock.sleep = clock.sleep, lambda seconds: sleep(seconds + 0.002)
    assert source.read(link) == b""
    assert len(link.sent) == asked
    clock.sleep = sleep
    rows(source, reads + polls(source, link, 2))
    assert source.losses == Losses(samples=6, missing=1)


def test_a_computer_that_is_too_busy_is_told_once(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=100.0)
    polls(source, link, 300)
    assert source.take_warnings() == []
    sleep = clock.sleep
    for _ in range(500):  # every second time it wakes up late
        clock.sleep = lambda seconds: sleep(seconds + 0.003)
        source.read(link)
        clock.sleep = sleep
        source.read(link)
    assert list(map(str, source.take_warnings())) == [
        "this computer is too busy to poll at 100 Hz, more than one poll in ten is left out: close other"
        " programs, or ask for a lower rate"
    ]
    assert source.take_warnings() == []


def test_an_answer_that_takes_unusually_long_does_not_tell_when_it_was_measured(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=100.0)
    reads = polls(source, link, 2)
    link.answer_s = 0.006
    reads += polls(source, link, 1)
    link.answer_s = 0.0025
    rows(source, reads + polls(source, link, 2))
    assert source.losses == Losses(samples=5, damaged=1, discarded_bytes=13)


def test_a_device_that_has_become_slower_is_believed_again(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=100.0)
    reads = polls(source, link, 1)
    link.answer_s = 0.008
    rows(source, reads + polls(source, link, 60))
    assert source.losses.samples == 61
    assert 5 < source.losses.damaged < 30


def test_a_rate_is_labelled_as_quasi_static_below_500_hz(clock):
    quick = Transmitter(clock)
    quick.answer_s = 0.0015
    assert str(started(quick, rate_hz=499.0).run_note).startswith("polled at 499 Hz, which is quasi-static")
    assert str(started(quick, rate_hz=500.0).run_note) == ""
    enod4 = started(Transmitter(clock, map="scaime-enod4"), {"map": "scaime-enod4"}, 100.0)
    assert "quasi-static" in str(enod4.run_note)
    assert "gauge 2 is asked" in str(enod4.run_note)


def test_a_rate_that_the_device_cannot_keep(clock):
    with pytest.raises(ProtocolError) as error:
        started(Transmitter(clock), rate_hz=900.0)
    said = "rate 900 Hz cannot be: a poll takes 2.5 ms, ask for --rate 320 or leave it out"
    assert str(error.value) == said


def test_a_device_that_answers_at_once_is_asked_a_thousand_times_a_second(clock):
    link = Transmitter(clock)
    link.answer_s = 0.0002
    source = started(link, rate_hz=None)
    assert (source.rate_hz, str(source.run_note)) == (1000.0, "")


def test_the_zero_command_is_sent_only_when_asked_for(clock):
    zero = {"zero_register": "5", "zero_value": "8"}
    link = Transmitter(clock, **zero)
    started(link, zero)
    assert set(link.sent) == {READ.encode()}
    source = started(link, zero | {"zero": "true"})
    assert Request(1, Function.WRITE_SINGLE, 5, 1, (8,)).encode() in link.sent
    link.registers.store_sample(COUNTS + 3, 0)
    block = rows(source, polls(source, link, 1))
    np.testing.assert_array_equal(block.counts, [[3, 3]])


def test_a_tlb4_is_zeroed_by_function_16(clock):
    link = Transmitter(clock, map="laumas-tlb4")
    source = started(link, {"map": "laumas-tlb4", "zero": "true"}, 100.0)
    written = [data for data in link.sent if data[1] == 16]
    assert [data[:-2].hex(" ") for data in written] == [
        "01 10 00 05 00 01 02 00 08", "02 10 00 05 00 01 02 00 08"
    ]  # fmt: skip
    link.registers.store_sample(COUNTS + 3, 0)
    block = rows(source, polls(source, link, 1))
    np.testing.assert_array_equal(block.counts, [[3, 3]])


def test_a_caution_of_the_map_is_in_every_run(clock, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text('caution = "mind the gap"\nunit = 1\n[table]\nregister = 0\n[relative]\nregister = 2\n')
    source = started(Transmitter(clock), {"map": str(own)}, 100.0)
    assert str(source.run_note).endswith("; mind the gap")


def test_a_refused_zero_command(clock):
    link = Transmitter(clock, zero_register="5", zero_value="8")
    settings = {"zero": "true", "zero_register": "5", "zero_value": "7"}
    with pytest.raises(
        ProtocolError, match=r"table gauge was not set to zero: illegal data value \(exception 3\)"
    ):
        started(link, settings)


def test_behind_an_adapter_that_repeats_what_is_sent_nothing_is_taken_for_an_answer(clock):
    zero = {"zero_register": "5", "zero_value": "8", "zero": "true"}
    link = Transmitter(clock, **zero)
    link.has_echo = True
    source = started(link, zero)
    link.registers.store_sample(COUNTS + 3, 0)
    block = rows(source, polls(source, link, 5))
    np.testing.assert_array_equal(block.counts, np.tile([3, 3], (5, 1)))
    assert source.losses == Losses(samples=5)
    with pytest.raises(ProtocolError, match="not set to zero: illegal data value"):
        started(link, zero | {"zero_value": "7"})


def test_a_damaged_answer_costs_its_own_row_only(clock):
    link = Transmitter(clock)
    source = started(link)
    reads = polls(source, link, 3)
    link.on_wire = lambda answer: answer[:-1] + b"\x00"
    reads += polls(source, link, 1)
    link.on_wire = lambda answer: answer
    block = rows(source, reads + polls(source, link, 3))
    assert source.losses.damaged == 1
    assert np.count_nonzero(block.status == 0) == 6


@pytest.mark.parametrize(
    "on_wire",
    [
        lambda answer: answer[:6],
        lambda answer: with_crc(b"\x02" + answer[1:-2]),
        lambda answer: b"\x55" + answer,
        lambda answer: answer + answer,
    ],
    ids=["cut", "wrong unit", "shifted", "twice"],
)
def test_answers_that_are_none_are_never_believed_and_the_next_is(clock, on_wire):
    link = Transmitter(clock)
    source = started(link)
    reads = polls(source, link, 1)
    link.on_wire = on_wire
    reads += polls(source, link, 3)
    link.on_wire = lambda answer: answer
    block = rows(source, reads + polls(source, link, 2))
    assert np.count_nonzero(block.status == 0) == 3
    assert source.losses.damaged == 3
    assert link.waiting == b""


def test_a_late_answer_is_not_that_of_the_next_request(clock):
    """The device says nothing in time, and what it then says comes with the answer to the next request."""
    link = Transmitter(clock)
    source = started(link)
    reads = polls(source, link, 1)
    link.on_wire = lambda _: b""
    assert all(source.read(link) == b"" for _ in range(3))
    link.registers.store_sample(COUNTS - 999, 0)
    link.on_wire = lambda _: b""
    source.read(link)
    old = link.registers.respond(*_asked(READ))
    link.registers.store_sample(COUNTS, 0)
    link.on_wire = lambda _: old  # instead of its own, which follows
    reads += polls(source, link, 1)
    link.on_wire = lambda answer: answer
    reads += polls(source, link, 2)
    block = rows(source, reads)
    good = block.status == 0
    np.testing.assert_array_equal(block.counts[good], np.tile(COUNTS, (3, 1)))
    assert source.losses.damaged == 1


def _asked(request: Request):

    (command,) = CommandParser(find_commands).feed(request.encode())
    return command, True, 0.0


def test_an_answer_quicker_than_the_wire_is_that_of_an_earlier_request(clock):
    link = Transmitter(clock)
    source = started(link)
    reads = polls(source, link, 2)
    link.answer_s = 0.0
    reads += polls(source, link, 1)
    link.answer_s = 0.0025
    rows(source, reads + polls(source, link, 2))
    assert source.losses.damaged == 1


def test_an_exception_in_the_stream_is_a_row_that_is_missing(clock):
    link = Transmitter(clock)
    source = started(link)
    reads = polls(source, link, 1)
    link.on_wire = lambda _: encode_exception(1, 3, 6)
    reads += polls(source, link, 1)
    link.on_wire = lambda answer: answer
    rows(source, reads + polls(source, link, 1))
    assert source.losses == Losses(samples=3, missing=1)


def test_a_long_wait_for_the_next_cell_is_no_long_read(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=0.01)
    asked, begin_ns = len(link.sent), clock.now_ns
    assert source.read(link) == b""
    assert clock.now_ns - begin_ns == 50_000_000
    assert len(link.sent) == asked


def test_the_rate_is_kept_when_the_device_is_found_again(clock):
    link = Transmitter(clock)
    source = started(link, rate_hz=None)
    rows(source, polls(source, link, 2))
    assert list(source.decode(b"", 0)) == []
    clock.sleep(1.0)
    link.answer_s = 0.003
    assert source.resume(link) == b""
    assert source.rate_hz == 320.0
    for data in polls(source, link, 2):
        list(source.decode(data, 0))
    assert source.losses.missing == pytest.approx(1.05 * 320, abs=3)


def test_what_was_read_replays_bit_for_bit(clock):
    link = Transmitter(clock, map="laumas-tlb4")
    source = started(link, {"map": "laumas-tlb4"}, None)
    reads = polls(source, link, 20)
    live = rows(source, reads)
    again = make_source({"map": "laumas-tlb4"}, source.rate_hz)
    replayed = join(again.decode(b"".join(reads), 0))
    np.testing.assert_array_equal(replayed.counts, live.counts)
    np.testing.assert_array_equal(replayed.status, live.status)
    np.testing.assert_array_equal(replayed.device_time_s, live.device_time_s)
    assert again.losses == source.losses
    skew = source.skew(0, len(live))
    assert skew is not None
    assert skew == again.skew(0, len(live))
    assert skew.mean_s == pytest.approx(0.0025)


def test_bytes_without_a_rate_are_not_decoded(clock):
    link = Transmitter(clock)
    reads = polls(started(link), link, 1)
    with pytest.raises(ProtocolError, match="the rate is not known"):
        list(make_source({}, None).decode(reads[0], 0))


def test_what_a_stream_says_when_the_device_only_refuses(clock):
    """The engine describes what it took for rubbish: wrapped answers."""
    link = Transmitter(clock)
    source = started(link)
    link.on_wire = lambda _: encode_exception(1, 3, 6)
    said = str(describe_unreadable(b"".join(polls(source, link, 5)), "modbus"))
    assert said == (
        "received 25 bytes, first 01 83 06 c1 32 01 83 06, nothing that modbus knows:"
        " the device refuses, device busy (exception 6): hold its registers against its manual"
    )
    link.on_wire = lambda answer: bytes(byte ^ 0x5A for byte in answer)
    assert "check the baud rate" in str(describe_unreadable(b"".join(polls(source, link, 5)), "modbus"))


@pytest.mark.parametrize(
    ("on_wire", "kind", "said"),
    [
        (lambda _: b"", NoDataError, "unit 1 does not answer function 03 for registers 0 to 3: check"
         " baud rate, parity and unit, cable and power, and whether A and B are swapped"),
        (lambda _: encode_exception(1, 3, 2), ProtocolError,
         "unit 1 refuses function 03 for registers 0 to 3:"
         " illegal data address (exception 2). Hold register map generic against the device's manual"),
        (lambda answer: with_crc(b"\x05" + answer[1:-2]), NoDataError, "unit 5 answered where unit 1 was"),
        (lambda answer: bytes(byte ^ 0x5A for byte in answer), NoDataError, "check the baud rate"),
        (lambda answer: answer[:7], NoDataError, "7 bytes came, 13 with a right CRC are expected"),
        (lambda _: b"1000,12,13\r\n2000,14,15\r\n", NoDataError, "choose protocol csv"),
    ],
    ids=["silent", "exception", "wrong unit", "wrong baud rate", "cut", "text"],
)  # fmt: skip
def test_what_is_wrong_at_the_start_is_said_in_one_line(clock, on_wire, kind, said):
    link = Transmitter(clock)
    link.on_wire = on_wire
    with pytest.raises(kind) as error:
        started(link)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_the_second_unit_is_missed_too(clock):
    link = Transmitter(clock, map="laumas-tlb4", channel="table")
    with pytest.raises(NoDataError, match="unit 2 does not answer function 03 for registers 6 to 8"):
        started(link, {"map": "laumas-tlb4"})


def test_a_device_that_sends_without_end_is_none_that_is_asked(clock):
    link = Transmitter(clock)
    link.read = lambda: clock.sleep(0.01) or b"\x00\xff" * 20
    with pytest.raises(NoDataError, match="check the baud rate"):
        started(link)


def test_a_lost_device_is_lost(clock):
    link = Transmitter(clock)
    source = started(link)
    link.is_lost = True
    with pytest.raises(DeviceLostError):
        polls(source, link, 1)
    with pytest.raises(DeviceLostError):
        make_source({}, None).start(link)
    source.stop(link)


@pytest.mark.parametrize(
    ("settings", "rate_hz", "said"),
    [
        ({"baud": "9600"}, None, "setting 'baud' is not known to modbus: allowed are channel, framing, map"),
        ({"channel": "gauge"}, None, "settings of modbus: Invalid enum value 'gauge'"),
        ({"timeout_s": "3"}, None, "timeout_s 3 is out of range: give 0.005 to 1"),
        ({"zero": "true"}, None, "zero is asked for, but map generic has no zero command"),
        (
            {"table_unit": "256"},
            None,
            "--set table_unit = '256' cannot be: give a whole number from 1 to 247",
        ),
        ({"table_unit": "0"}, None, "table_unit = 0 is no unit of a serial line: give 1 to 247"),
        ({"framing": "udp"}, None, "settings of modbus: Invalid enum value 'udp'"),
        (
            {"map": "laumas-ethernet"},
            None,
            "both gauges would be read from register 7 of unit 1: give the unit or the register of one",
        ),
        ({"type": "double"}, None, "--set type = 'double' cannot be: give one of int16"),
        ({"map": "kern"}, None, "map 'kern' is not known"),
        ({}, 1001.0, "rate 1001 Hz cannot be polled: give one up to 1000, or leave it out"),
        ({}, float("nan"), "rate nan Hz cannot be polled"),
    ],
)
def test_settings_are_checked(settings, rate_hz, said):
    assert said in refusal(make_source, settings, rate_hz)


def test_settings_survive_a_round_trip(clock):
    """As text, as they stand in gauges.toml and in a run, they make the same requests."""
    given = {
        "map": "laumas-tlb4",
        "channel": "relative",
        "relative_unit": "7",
        "register": "9",
        "order": "CDAB",
    }
    link = Transmitter(clock, **given)
    started(link, given)
    assert set(link.sent) == {
        Request(7, Function.READ_HOLDING, 6, 1).encode(), Request(7, Function.READ_HOLDING, 9, 2).encode()
    }  # fmt: skip
    answer = link.registers.respond(*_asked(Request(7, Function.READ_HOLDING, 9, 2)))
    assert Request(7, Function.READ_HOLDING, 9, 2).parse_response(answer)
