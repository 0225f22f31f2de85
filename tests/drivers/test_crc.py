import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.crc import crc16
from drivers.crc_slice import crc16_slice


def bitwise_crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE by its definition, a bit at a time."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (0x1021 if crc & 0x8000 else 0)
        crc &= 0xFFFF
    return crc


def test_the_published_check_value():
    assert crc16(b"123456789") == 0x29B1
    assert crc16_slice(np.frombuffer(b"123456789", dtype=np.uint8), 0, 9) == 0x29B1


@given(st.binary(max_size=70), st.integers(0, 70))
def test_compiled_and_plain_crc_agree_with_the_definition(data, start):
    buffer = np.frombuffer(data, dtype=np.uint8)
    part = data[start:]
    assert crc16(part) == bitwise_crc16(part)
    assert crc16_slice(buffer, min(start, len(data)), len(data)) == bitwise_crc16(part)
