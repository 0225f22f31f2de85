"""Commands to an AED or FIT and its answers: text that ends with a semicolon, answered by lines.

Source: HBM, AD104 manual ba_aed104_8_e, pages 14, 15, 19, 40 and 51.
"""

import math
import re
from dataclasses import dataclass

STOP = b";STP;"
"""Ends the output; the first semicolon clears what is left of an unfinished command. It is not answered."""
START = b"MSV?0;"
IDENTIFY = b"IDN?;"
READ_DIVIDER = b"ICR?;"
FILTER_OFF = b"ASF0;"
STATUS_IN_VALUES = b"CSM0;"
"""Status, and not a checksum, in the last byte of a value."""
LINE_END = b"\r\n"
DONE, REFUSED = b"0", b"?"
FULL_RATES_HZ = (100.0, 600.0, 1200.0)
"""Values a second at ICR0: AD104 (its manual, page 38), AD101B (page 27), FIT/5 (data sheet)."""
MAX_DIVIDER = 7
_RATE_AGREES = 0.1
_IDENTITY = re.compile(rb'HBM,\s*"([^"\r\n]*)"\s*,\s*"([^"\r\n]*)"\s*,\s*(\w+)\s*\r\n')


@dataclass(frozen=True, slots=True)
class Identity:
    """Answer to `IDENTIFY`."""

    name: str
    serial_number: str
    firmware: str


def set_format(code: int) -> bytes:
    """Command that sets the output format."""
    return b"COF%d;" % code


def set_divider(divider: int) -> bytes:
    """Command that sets the rate to the full one by 2 ** `divider`."""
    return b"ICR%d;" % divider


def select(address: int) -> bytes:
    """Command that selects one device of a bus, 0 to 89; it is not answered."""
    return b"S%02d;" % address


def find_line(received: bytes) -> bytes | None:
    """The first whole line that came; None while there is none."""
    line, end, _ = received.partition(LINE_END)
    return line.strip() if end else None


def find_identity(received: bytes) -> Identity | None:
    """The identity in what came; None while there is none."""
    found = _IDENTITY.search(received)
    if found is None:
        return None
    name, serial_number, firmware = (part.decode("ascii", "replace").strip() for part in found.groups())
    return Identity(name, serial_number, firmware)


def encode_identity(identity: Identity) -> bytes:
    """The answer to `IDENTIFY`, as a device sends it."""
    text = f'HBM,"{identity.name:<15}","{identity.serial_number:<7}",{identity.firmware}'
    return text.encode("ascii") + LINE_END


def full_rate(sent_hz: float, divider: int) -> float | None:
    """Rate at ICR0 of a device that sends `sent_hz` at ICR`divider`; None if no known one does."""
    known = min(FULL_RATES_HZ, key=lambda rate_hz: abs(math.log(sent_hz * 2**divider / rate_hz)))
    return known if abs(sent_hz * 2**divider / known - 1) <= _RATE_AGREES else None


def find_divider(full_hz: float, rate_hz: float) -> int | None:
    """The divider for a rate; None if the device has not that rate."""
    divider = round(math.log2(full_hz / rate_hz))
    is_there = 0 <= divider <= MAX_DIVIDER and math.isclose(full_hz / 2**divider, rate_hz, rel_tol=1e-3)
    return divider if is_there else None
