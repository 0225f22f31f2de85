"""Commands to a GSV-4, GSV-3 and GSV-2: one byte and its parameters, without a frame. Most are not answered.

Sources: me-systeme, GSV4_python_testScripts and GSV-3-test-scripts; GSV-4 manual, pages 38 and 43; GSV-2AS
manual, pages 18 and 29.
"""

from enum import IntEnum

from drivers.devices.gsv_234.codec import GSV_2, GSV_3, GSV_4
from drivers.errors import SettingsError
from messages.i18n import N_


class Code(IntEnum):
    """Commands."""

    SET_ZERO = 0x0C
    READ_FREQUENCY = 0x16
    SERIAL_NUMBER = 0x1F
    STOP = 0x23
    START = 0x24
    LOCK = 0x26
    FIRMWARE = 0x2B
    GET_VALUE = 0x3B
    WRITE_RATE = 0x8A
    READ_RATE = 0x8B


ANSWER = 0x3B
"""First byte of an answer."""
UNLOCK = bytes([Code.LOCK, 1]) + b"berlin"
LOCK = bytes([Code.LOCK, 0]) + b"berlin"
STOP, START = bytes([Code.STOP]), bytes([Code.START])

GSV_4_RATES_HZ = {
    0xA0: 0.625, 0xA1: 1.25, 0xA2: 2.5, 0xA3: 3.75, 0xA4: 6.25, 0xA5: 7.5, 0xA6: 12.4, 0xA7: 14.7, 0xA8: 24.4,
    0xA9: 125.0, 0xAA: 250.0, 0xAB: 500.0, 0xAC: 937.5,
}  # fmt: skip
"""Each code is also the command that sets this rate."""
GSV_3_RATES_HZ = {
    b"\x08\xb3\xb4": 1.0, b"\x08\xf8\x5f": 10.0, b"\x07\xfc\xf3": 50.0, b"\x06\xfc\xf3": 100.0,
    b"\x04\xfd\x8f": 500.0, b"\x03\xfd\x8f": 1000.0,
}  # fmt: skip
"""Parameters of `WRITE_RATE`."""
_CLOCK_HZ = 5e6
"""Of the counter whose register `READ_FREQUENCY` returns (GSV-2AS manual, page 29)."""
_MOST_AVERAGED = 16  # more bits than its counter has are no rate
_ANSWER_BYTES = {Code.FIRMWARE: 2, Code.SERIAL_NUMBER: 8, Code.READ_FREQUENCY: 3, Code.READ_RATE: 3}
"""Data bytes of a GSV-3's and GSV-2's answers (GSV-2AS manual, page 18); one byte comes before them."""
_HEAD = 8
_TAIL = b"\r\n"
_LENGTH_AT = 3
"""A GSV-4 answers 3B, code, 01, length (2 bytes), 3 characters, data, 0D 0A."""


def read_rate(model: str) -> Code:
    """Command that asks a model for its rate."""
    return Code.READ_RATE if model == GSV_3 else Code.READ_FREQUENCY


def write_rate(model: str, rate_hz: float) -> list[bytes]:
    """Ways to set the rate, the next one where the first was not obeyed.

    Raises SettingsError for a rate that the model cannot be set to from here.
    """
    if model == GSV_2:
        template = N_("the rate of a GSV-2 is set with the vendor's program alone: leave --rate out")
        raise SettingsError(template)
    rates = _rates(model)
    for code, own_hz in rates.items():
        if own_hz == rate_hz:
            return [code, UNLOCK + code + LOCK] if model == GSV_4 else [bytes([Code.WRITE_RATE]) + code]
    template = N_("a {model} cannot send {rate_hz:g} Hz: give one of {rates}")
    given = [f"{own_hz:g}" for own_hz in rates.values()]
    raise SettingsError(template, model=model.upper(), rate_hz=rate_hz, rates=given)


def encode_answer(model: str, code: Code, data: bytes) -> bytes:
    """An answer, as a device sends it."""
    if model == GSV_4:
        return bytes([ANSWER, code, 1]) + len(data).to_bytes(2, "big") + b"050" + data + _TAIL
    return bytes([ANSWER]) + data


def find_answer(model: str, code: Code, received: bytes) -> bytes | None:
    """Data of the answer to `code` in `received`; None while it is not whole."""
    if model != GSV_4:
        end = 1 + _ANSWER_BYTES[code]
        return received[1:end] if len(received) >= end else None
    start = received.find(bytes([ANSWER, code]))
    if start < 0 or len(received) < start + _HEAD:
        return None
    end = start + _HEAD + int.from_bytes(received[start + _LENGTH_AT : start + _LENGTH_AT + 2], "big")
    return received[start + _HEAD : end] if received[end : end + len(_TAIL)] == _TAIL else None


def rate_from_answer(model: str, data: bytes) -> float | None:
    """Samples a second from the answer to `read_rate`; None if it holds no rate."""
    if model == GSV_4:
        return GSV_4_RATES_HZ.get(data[0]) if data else None
    if model == GSV_3 and data in GSV_3_RATES_HZ:
        return GSV_3_RATES_HZ[data]
    if model == GSV_3:
        # The vendor's six rates are those of 2 ** first byte conversions, timed by a counter of 16 bits.
        periods = (1 << 16) - int.from_bytes(data[1:], "big")
        return _CLOCK_HZ / (periods << data[0]) if data[0] <= _MOST_AVERAGED else None
    return _CLOCK_HZ / ((1 << 24) - int.from_bytes(data, "big"))


def encode_rate(model: str, rate_hz: float) -> bytes:
    """Data of the answer to `read_rate` of a device at this rate, or at the nearest one that it can do."""
    if model == GSV_2:
        return ((1 << 24) - round(_CLOCK_HZ / rate_hz)).to_bytes(3, "big")
    rates = _rates(model)
    return min(rates, key=lambda code: abs(rates[code] - rate_hz))


def _rates(model: str) -> dict[bytes, float]:
    if model == GSV_3:
        return GSV_3_RATES_HZ
    return {bytes([code]): rate_hz for code, rate_hz in GSV_4_RATES_HZ.items()}


def firmware_from_answer(data: bytes) -> str:
    """Firmware version, its bytes as numbers."""
    return ".".join(map(str, data))


def serial_number_from_answer(data: bytes) -> str:
    """Serial number, eight digits; "" for something else."""
    text = data.decode("ascii", "replace")
    return text if text.isdigit() else ""
