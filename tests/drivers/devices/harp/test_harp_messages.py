import pytest

from drivers.devices.harp.codec import (
    ERROR,
    EVENT,
    READ,
    S16,
    START,
    STOP,
    U8,
    U16,
    WRITE,
    HarpMessage,
    Register,
    encode,
    encode_read,
    encode_write,
    find_messages,
    find_reply,
    with_active_mode,
)


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        (START, "02 05 20 ff 01 01 28"),
        (STOP, "02 05 20 ff 01 00 27"),
        (encode_read(Register.WHO_AM_I), "01 04 00 ff 02 06"),
        (encode_write(Register.OPERATION, 0xE1), "02 05 0a ff 01 e1 f2"),
        (encode(HarpMessage(READ, 0, b"\xd0\x04"), U16, 31_251), "01 0c 00 ff 12 01 00 00 00 01 00 d0 04 f4"),
    ],
)
def test_messages_as_they_are_written(sent, expected):
    assert sent.hex(" ") == expected


def test_messages_are_found_in_rubbish_with_and_without_their_time():
    reply = encode(HarpMessage(READ, Register.WHO_AM_I, b"\xd0\x04"), U16, 77)
    event = encode(HarpMessage(EVENT, Register.LOAD_CELLS, bytes(16)), S16, 78)
    refused = encode(HarpMessage(WRITE | ERROR, Register.ACQUISITION, b"\x00"), U8)
    data = b"\x00\x01\x02" + reply + event + b"\xff" + refused
    messages, used = find_messages(data + b"\x01\x04\x00")
    assert messages == [
        HarpMessage(READ, 0, b"\xd0\x04"),
        HarpMessage(EVENT, 33, bytes(16)),
        HarpMessage(WRITE | ERROR, 32, b"\x00"),
    ]
    assert messages[0].number == 1232
    assert used == len(data)
    assert find_reply(data, Register.WHO_AM_I) == messages[0]
    assert find_reply(data, Register.ACQUISITION) == messages[2]
    assert find_reply(data, Register.LOAD_CELLS) is None


def test_a_wrong_checksum_makes_it_rubbish():
    assert find_messages(START[:-1] + b"\x00")[0] == []
    assert find_messages(b"")[0] == []


def test_bits_of_registers():
    assert with_active_mode(0xE0) == 0xE1
    assert with_active_mode(0xF3) == 0xE1
