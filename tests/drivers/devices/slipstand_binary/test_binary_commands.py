import pytest

from drivers.devices.slipstand_binary.codec import (
    IDENTIFY,
    START,
    STOP,
    FirmwareIdentity,
    encode_identity,
    encode_rate,
    find_identity,
)
from drivers.errors import ProtocolError, SettingsError


def test_commands_are_the_bytes_of_the_protocol():
    assert (START, STOP, IDENTIFY, encode_rate(2000)) == (b"S", b"P", b"I", b"R2000\n")


@pytest.mark.parametrize("rate_hz", [0, -1, 0.5, 1000.5, 2e6, float("nan"), float("inf")])
def test_a_rate_that_cannot_be_said_is_refused(rate_hz):
    with pytest.raises(SettingsError, match="whole hertz from 1 to 1000000"):
        encode_rate(rate_hz)


def test_the_identify_line_there_and_back():
    identity = FirmwareIdentity("1.4.0-rc2", 500.0, 2)
    assert encode_identity(identity) == b"slipstand-fw 1.4.0-rc2 500 2\n"
    assert find_identity(b"\xaa\x55\x01rest of a frame" + encode_identity(identity) + b"more") == identity


@pytest.mark.parametrize(
    "received", [b"", b"slipstand-fw 1.0 500 2", b"slipstand-fw 1.0 many 2\n", b"hello\n"]
)
def test_what_is_not_a_whole_identify_line_is_none(received):
    assert find_identity(received) is None


def test_a_device_with_another_number_of_channels_is_refused():
    with pytest.raises(ProtocolError, match="4 channels and 2 are needed"):
        find_identity(b"slipstand-fw 1.0 500 4\r\n")


def test_a_version_without_end_is_refused_in_one_short_line():
    with pytest.raises(ProtocolError, match="more than 100 characters") as error:
        find_identity(b"slipstand-fw " + b"A" * 1_000_000 + b" 500 2\n")
    assert len(str(error.value)) < 200
