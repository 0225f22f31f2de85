"""CRC-16/CCITT-FALSE for a few bytes; in compiled code, `drivers.crc_slice`."""

import binascii

CRC_START = 0xFFFF


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE of `data` (CRC RevEng catalogue: CRC-16/IBM-3740, check value 29B1)."""
    return binascii.crc_hqx(data, CRC_START)
