import struct

import numpy as np
import pytest
from hypothesis import given
from modbus_kit import answer_of, decoded, decoder_for, poll_for, polled
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.modbus.decoder import wrap_response
from drivers.devices.modbus.frames import encode_exception, encode_read_response
from drivers.envelope import wrap
from drivers.samples import Losses, SampleStatus

RATE_HZ = 100.0
N = 60
COUNTS = np.column_stack([np.arange(N) * 1000 - 30_000, 5 - np.arange(N) * 70])
MISSING, DAMAGED = int(SampleStatus.MISSING), int(SampleStatus.DAMAGED)


def reads(cells=range(1000, 1000 + N)) -> list[bytes]:
    return polled(poll_for(), [tuple(row) for row in COUNTS.tolist()], cells, RATE_HZ)


def check_whole(block) -> None:
    np.testing.assert_array_equal(block.counts, COUNTS)
    assert not block.status.any()
    np.testing.assert_allclose(block.device_time_s, np.arange(N) / RATE_HZ, atol=1e-9)


def test_whole_and_byte_by_byte():
    check_whole(join(decoded(decoder_for(), reads())))
    check_whole(join(decoded(decoder_for(), [b"".join(reads())])))
    decoder = decoder_for()
    block = join(decoded(decoder, single_bytes(b"".join(reads()))))
    check_whole(block)
    assert block.arrival_ns == round((1000 + N - 0.5) * 1e9 / RATE_HZ)
    assert decoder.losses == Losses(samples=N)
    assert decoder.unfinished_bytes == 0


@given(cuts(b"".join(reads())))
def test_any_cut(places):
    check_whole(join(decoded(decoder_for(), cut_at(b"".join(reads()), places))))


def test_a_cell_without_an_answer_is_a_row_that_is_missing():
    cells = [0, 1, 4, 5, 10]
    decoder = decoder_for()
    block = join(decoded(decoder, polled(poll_for(), [(k, -k) for k in cells], cells, RATE_HZ)))
    np.testing.assert_array_equal(np.flatnonzero(block.status == 0), cells)
    assert set(block.status) == {0, MISSING}
    np.testing.assert_array_equal(block.counts[cells, 0], cells)
    np.testing.assert_allclose(block.device_time_s, np.arange(11) / RATE_HZ, atol=1e-9)
    assert decoder.losses == Losses(samples=11, missing=6)


@pytest.mark.parametrize("phase", [0.02, 0.5, 0.98])
def test_polls_that_come_late_in_their_cells_invent_no_rows(phase):
    rng = np.random.default_rng(1)
    measured_ns = np.round((np.arange(N) + phase * rng.random(N)) * 1e9 / RATE_HZ).astype(int)
    (request,) = poll_for().requests
    wire = [wrap_response(0, int(t), answer_of(request, k, k)) for k, t in enumerate(measured_ns)]
    decoder = decoder_for()
    block = join(decoded(decoder, wire))
    assert decoder.losses == Losses(samples=N)
    np.testing.assert_array_equal(block.counts[:, 0], np.arange(N))


def test_damaged_answers_are_rows_and_nothing_is_believed_of_them():
    wire = reads()
    (request,) = poll_for().requests
    whole = answer_of(request, *COUNTS[7].tolist())
    for cell, data in ((7, whole[:-1] + b"\x00"), (8, whole[:6]), (20, b"\x00" + whole)):
        wire[cell] = wrap_response(0, round((1000.5 + cell) * 1e9 / RATE_HZ), data)
    decoder = decoder_for()
    block = join(decoded(decoder, wire))
    expected = np.zeros(N)
    expected[[7, 8, 20]] = DAMAGED
    np.testing.assert_array_equal(block.status, expected)
    good = block.status == 0
    np.testing.assert_array_equal(block.counts[good], COUNTS[good])
    assert decoder.losses == Losses(samples=N, damaged=3, discarded_bytes=13 + 6 + 14)


def test_an_answer_that_does_not_tell_its_time_is_not_believed():
    wire = reads()
    (request,) = poll_for().requests
    late = answer_of(request, *COUNTS[3].tolist())
    wire[3] = wrap_response(0, round(1003.5e9 / RATE_HZ), late, is_late=True)
    decoder = decoder_for()
    block = join(decoded(decoder, wire))
    assert np.flatnonzero(block.status).tolist() == [3]
    assert decoder.losses.damaged == 1


def test_a_refused_poll_leaves_its_row_missing():
    wire = reads()
    wire[5] = wrap_response(0, round(1005.5e9 / RATE_HZ), encode_exception(1, 3, 6))
    decoder = decoder_for()
    block = join(decoded(decoder, wire))
    assert block.status[5] == MISSING
    assert decoder.losses == Losses(samples=N, missing=1)


def test_flags_of_the_device_become_ours():
    settings = {"status_register": "4", "overload_bits": "3", "fault_bits": "0"}
    (request,) = poll_for(**settings).requests
    held = [struct.pack(">iiH", k, -k, word) for k, word in enumerate([0, 0b1000, 1, 0])]
    wire = [
        wrap_response(0, (k * 10 + 5) * 10**6, encode_read_response(1, request.function, data))
        for k, data in enumerate(held)
    ]
    decoder = decoder_for(**settings)
    block = join(decoded(decoder, wire))
    both = int(SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE)
    np.testing.assert_array_equal(block.status, [0, both, DAMAGED, 0])
    assert decoder.losses == Losses(samples=4, damaged=1, overloaded=1)


def test_two_requests_make_one_row_and_their_lag_is_the_skew():
    poll = poll_for(map="laumas-tlb4")
    wire = []
    for k in range(40):
        for number, request in enumerate(poll.requests):
            data = encode_read_response(
                request.unit, request.function, struct.pack(">Hi", 0, 10 * k + number)
            )
            wire.append(wrap_response(number, (10 * k + 2 + 3 * number) * 10**6, data))
    decoder = decoder_for(map="laumas-tlb4")
    block = join(decoded(decoder, wire))
    np.testing.assert_array_equal(block.counts, 10 * np.arange(40)[:, None] + [0, 1])
    skew = decoder.skew(0, 40)
    assert skew is not None
    assert skew.mean_s == pytest.approx(3e-3)
    without_a_second = wire[:11] + wire[12:]
    block = join(decoded(decoder_for(map="laumas-tlb4"), without_a_second))
    assert np.flatnonzero(block.status).tolist() == [5]
    assert block.status[5] == MISSING
    assert decoder_for().skew(0, 40) is None


def test_one_gauge_leaves_the_other_column_empty():
    poll = poll_for(channel="relative")
    (request,) = poll.requests
    assert (request.register, request.count) == (2, 2)
    wire = [wrap_response(0, k * 10**7, answer_of(request, k)) for k in range(1, 5)]
    block = join(decoded(decoder_for(channel="relative"), wire))
    np.testing.assert_array_equal(block.counts, [[0, 1], [0, 2], [0, 3], [0, 4]])


def test_rubbish_before_between_and_after():
    good = reads()
    rubbish = np.random.default_rng(3).bytes(5000)
    decoder = decoder_for()
    check_whole(join(decoded(decoder, [rubbish, *good[:30], rubbish, *good[30:], rubbish])))
    assert decoder.losses.samples == N
    assert decoder.losses.discarded_bytes >= 14_990
    assert decoder.unfinished_bytes < 100


def test_envelopes_of_nobody_are_left_out():
    good = reads()
    strange = wrap(5, 10**10, b"who is there")
    out_of_turn = wrap_response(1, 10**10, b"second of nothing")
    decoder = decoder_for()
    check_whole(join(decoded(decoder, [strange, out_of_turn, *good])))
    assert decoder.losses.discarded_bytes == len(b"who is there") + len(b"second of nothing")


def test_two_answers_of_one_cell_are_one_row():
    wire = reads()
    decoder = decoder_for()
    check_whole(join(decoded(decoder, [*wire[:4], wire[3], *wire[4:]])))
    assert decoder.losses.repeated == 1


def test_a_time_that_cannot_be_begins_anew():
    """A host that was started again, or a wrong time that got through both checksums."""
    first, second = reads(range(5000, 5000 + N)), reads(range(100, 100 + N))
    decoder = decoder_for()
    block = join(decoded(decoder, [*first, *second]))
    assert decoder.losses == Losses(samples=2 * N, restarts=1)
    assert np.all(np.diff(block.device_time_s) > 0)
    far = polled(poll_for(), [(1, 1), (2, 2)], [0, 100_000_000], RATE_HZ)
    assert len(join(decoded(decoder_for(), far))) == 2


def test_a_broken_link_goes_on_in_its_cells():
    wire = reads([*range(1000, 1030), *range(1130, 1160)])
    decoder = decoder_for()
    blocks = decoded(decoder, wire[:30])
    decoder.expect_restart()
    block = join([*blocks, *decoded(decoder, wire[30:])])
    assert np.count_nonzero(block.status == MISSING) == 100
    assert decoder.losses == Losses(samples=160, missing=100)
