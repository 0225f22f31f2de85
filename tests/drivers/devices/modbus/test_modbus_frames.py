"""Frames against bytes of the specification and of devices' manuals, which our code has not written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.devices.modbus.frames import (
    Function,
    Request,
    Response,
    crc16_modbus,
    encode_exception,
    encode_read_response,
    exception_response,
    with_crc,
)

READ_ONE = Request(1, Function.READ_HOLDING, 0x3003)
"""Request of the manual of the Applent AT381x, page 105: 01 03 30 03 00 01 7B 0A."""
ONE = bytes.fromhex("01 03 02 00 01 79 84")
"""Its answer there."""


def test_the_check_value_of_the_checksum():
    assert crc16_modbus(b"123456789") == 0x4B37


@pytest.mark.parametrize(
    ("request_", "wire"),
    [
        (READ_ONE, "01 03 30 03 00 01 7B 0A"),
        # Modbus_Application_Protocol_V1_1b3, 6.3, 6.4, 6.6 and 6.12: the bytes between unit and CRC
        (Request(17, Function.READ_HOLDING, 0x6B, 3), "11 03 00 6B 00 03 76 87"),
        (Request(1, Function.READ_INPUT, 8, 1), "01 04 00 08 00 01 B0 08"),
        (Request(1, Function.WRITE_SINGLE, 1, 1, (3,)), "01 06 00 01 00 03 98 0B"),
        # https://github.com/aje/scale-docs, docs/basic-config.md: a transmitter's new address
        (Request(1, Function.WRITE_MULTIPLE, 0, 1, (2,)), "01 10 00 00 00 01 02 00 02 27 91"),
    ],
)
def test_requests_as_they_are_written(request_, wire):
    assert request_.encode() == bytes.fromhex(wire)


def test_answers_as_they_are_written():
    assert READ_ONE.parse_response(ONE) == Response(b"\x00\x01")
    new_address = Request(1, Function.WRITE_MULTIPLE, 0, 1, (2,))
    assert new_address.parse_response(bytes.fromhex("01 10 00 00 00 01 01 C9")) == Response(b"")
    write = Request(1, Function.WRITE_SINGLE, 1, 1, (3,))
    assert write.parse_response(write.encode()) == Response(b"")
    assert encode_read_response(1, 3, b"\x00\x01") == ONE


@pytest.mark.parametrize(
    ("code", "words"),
    [(1, "illegal function"), (2, "illegal data address"), (6, "device busy"), (99, "unknown reason")],
)
def test_an_exception_is_told_by_its_name(code, words):
    answer = READ_ONE.parse_response(encode_exception(1, 3, code))
    assert answer.is_exception
    assert str(answer.fault) == f"{words} (exception {code})"


def test_the_exception_of_the_specification():
    """Modbus over serial line guide: a request of function 3 that is refused for its address."""
    refused = bytes.fromhex("01 83 02 C0 F1")
    assert READ_ONE.is_complete(refused)
    assert READ_ONE.parse_response(refused) == exception_response(2)


@pytest.mark.parametrize(
    ("received", "why"),
    [
        (b"", "only 0 bytes came"),
        (ONE[:4], "only 4 bytes came"),
        (ONE[:-1], "6 bytes came, 7 with a right CRC"),
        (ONE + b"\x01", "8 bytes came, 7 with a right CRC"),
        (ONE + b"\x00", "answer to another request"),  # a zero behind its CRC leaves a CRC right
        (b"\x00" + ONE, "8 bytes came, 7 with a right CRC"),
        (with_crc(b"\x02" + ONE[1:-2]), "unit 2 answered where unit 1 was asked"),
        (with_crc(b"\x01\x04" + ONE[2:-2]), "answer to another request"),
        (encode_read_response(1, 3, b"\x00\x01\x00\x02"), "answer to another request"),
        (encode_exception(2, 3, 4), "unit 2 answered"),
    ],
)
def test_what_is_no_answer(received, why):
    answer = READ_ONE.parse_response(received)
    assert answer.is_invalid
    assert why in str(answer.fault)


def test_the_echo_of_another_write_is_no_answer():
    write, other = (Request(1, Function.WRITE_SINGLE, 5, 1, (value,)) for value in (7, 8))
    assert write.parse_response(other.encode()).is_invalid


def test_an_answer_is_awaited_to_its_last_byte():
    assert [READ_ONE.is_complete(ONE[:size]) for size in range(8)] == [False] * 7 + [True]
    refused = encode_exception(1, 3, 2)
    assert [READ_ONE.is_complete(refused[:size]) for size in range(6)] == [False] * 5 + [True]


@given(st.integers(0, len(ONE) * 8 - 1))
def test_no_single_wrong_bit_is_believed(bit):
    damaged = bytearray(ONE)
    damaged[bit // 8] ^= 1 << bit % 8
    assert READ_ONE.parse_response(bytes(damaged)).is_invalid


@given(st.binary(max_size=300))
def test_rubbish_is_no_answer_and_raises_nothing(data):
    if data != ONE and not (len(data) > 2 and with_crc(data[:-2]) == data):
        assert READ_ONE.parse_response(data).is_invalid
    READ_ONE.is_complete(data)


def test_a_request_says_what_it_asks_for():
    assert str(READ_ONE.description) == "function 03 for register 12291"
    assert str(Request(1, Function.READ_INPUT, 7, 4).description) == "function 04 for registers 7 to 10"
