import pytest

from drivers.devices.gsv.commands import (
    Code,
    InputType,
    Response,
    encode_request,
    encode_response,
    find_response,
    firmware_from_response,
    rate_from_response,
    serial_number_from_response,
    set_float,
    set_input,
    write_rate,
)
from drivers.errors import SettingsError


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        (encode_request(Code.STOP), "aa 90 23 85"),
        (encode_request(Code.START), "aa 90 24 85"),
        (encode_request(Code.READ_RATE), "aa 90 8a 85"),
        (encode_request(Code.GET_VALUE), "aa 90 3b 85"),
        (encode_request(Code.SERIAL_NUMBER), "aa 90 1f 85"),
        (encode_request(Code.FIRMWARE), "aa 90 2b 85"),
        (write_rate(1000.0), "aa 94 8b 44 7a 00 00 85"),
        (set_float(), "aa 93 81 01 00 10 85"),
        (encode_request(Code.SET_ZERO, bytes([0])), "aa 91 0c 00 85"),
        (encode_request(Code.SET_ZERO, bytes([3])), "aa 91 0c 03 85"),
        (set_input(2, InputType.BRIDGE_5_V), "aa 92 a3 02 01 85"),
    ],
)
def test_requests_as_they_are_written(sent, expected):
    assert sent.hex(" ") == expected


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, 48_001.0, float("nan"), float("inf")])
def test_rates_that_cannot_be(rate_hz):
    with pytest.raises(SettingsError, match="cannot be set: give 1 to 48000"):
        write_rate(rate_hz)


@pytest.mark.parametrize(
    ("received", "found"),
    [
        ("aa 50 00 85", Response(0)),
        ("aa 54 00 44 7a 00 00 85", Response(0, bytes.fromhex("447a0000"))),
        ("aa 51 00 85 85", Response(0, b"\x85")),
        ("00 85 aa aa 50 40 85 aa", Response(0x40)),
        ("aa 50 00", None),
        ("aa 54 00 44 7a 00 00", None),
        ("aa 90 23 85", None),
        ("", None),
    ],
)
def test_answers_are_found(received, found):
    data = bytes.fromhex(received)
    assert find_response(data) == found
    if found:
        assert encode_response(found.error, found.payload) in data


def test_errors_are_said_in_words():
    assert Response(0).is_ok
    assert Response(1).is_ok
    assert not Response(0x52).is_ok
    assert str(Response(0x52).fault) == "wrong value"
    assert str(Response(0x99).fault) == "error 99"


def test_a_rate_is_read():
    assert rate_from_response(Response(0, bytes.fromhex("447a0000"))) == 1000.0
    for said in (
        Response(0),
        Response(0x40, bytes(4)),
        Response(0, bytes(4)),
        Response(0, bytes.fromhex("7fc00000")),
    ):
        assert rate_from_response(said) is None


def test_the_serial_number_is_one_number_and_the_firmware_two():
    """me-systeme: GSV-6PI example unpacks `>I`; MEGSV86x64.h has the version in bits 31-16 and 15-0."""
    assert serial_number_from_response(Response(0, bytes.fromhex("00e5cc61"))) == "15060065"
    assert serial_number_from_response(Response(0, bytes.fromhex("05f5e0ff"))) == "99999999"
    assert firmware_from_response(Response(0, bytes.fromhex("0001002d"))) == "1.45"
    for read in (serial_number_from_response, firmware_from_response):
        assert read(Response(0x40)) == read(Response(0x40, bytes(4))) == read(Response(0, b"12")) == ""
