"""What each simulated device sends, as bytes, and what a wrong baud rate makes of it."""

from collections.abc import Iterator

import numpy as np

from drivers.devices.harp.codec import encode_events
from drivers.registry import find_driver

RATES_HZ = {
    "slipstand-binary": 2000.0,
    "harp": 1000.0,
    "gsv": 1000.0,
    "gsv-234": 500.0,
    "csv": 500.0,
    "dataq": 2000.0,
    "hbm-aed": 600.0,
    "enod4": 500.0,
}


DURATION_S = 0.7


def wire_of(protocol: str, settings: dict[str, str] | None = None) -> bytes:
    """0.7 s of a stand at rest, as the simulated device sends it, the first frame cut."""
    packing = find_driver(protocol).make_simulated(settings or {})
    if protocol == "dataq":
        packing.find_commands(b"slist 0 0\rslist 1 1\rslist 2 8\r")
    rate_hz = RATES_HZ[protocol]
    per_frame = packing.samples_per_frame(rate_hz)
    rng = np.random.default_rng(4)
    counts = rng.normal([1200, -300], 20, (round(DURATION_S * rate_hz), 2)).round().astype(np.int32)
    times_s = 7 + np.arange(0, len(counts), per_frame) / rate_hz
    status = np.zeros(len(counts), dtype=np.uint8)
    if protocol == "harp":  # the packing stands by until it is woken
        return encode_events(times_s, counts).tobytes()[5:]
    return b"".join(packing.encode(9000, counts, status, times_s))[5:]


def misread(data: bytes, sent_baud: int, read_baud: int, sent_parity: str = "N") -> bytes:
    """`data` sent back to back, as a receiver set to `read_baud`, no parity, takes it.

    It waits for an edge, looks at the middle of each bit, and gives 0 where there is no stop bit, as Linux.
    """
    levels = np.array([level for byte in data for level in _bits(byte, sent_parity)], dtype=np.uint8)
    per_bit = sent_baud / read_baud
    received = bytearray()
    at = 0.0
    while at < len(levels):
        if levels[int(at)]:
            at = float(np.floor(at)) + 1
            continue
        places = at + (np.arange(1, 10) + 0.5) * per_bit
        if places[-1] >= len(levels):
            break
        bits = levels[places.astype(int)]
        received.append(int(np.packbits(bits[:8], bitorder="little")[0]) if bits[8] else 0)
        at = float(places[-1])
        while at < len(levels) and not levels[int(at)]:
            at += 1
    return bytes(received)


def _bits(byte: int, parity: str) -> Iterator[int]:
    data = [byte >> place & 1 for place in range(8)]
    yield 0
    yield from data
    if parity != "N":
        yield sum(data) % 2 if parity == "E" else 1 - sum(data) % 2
    yield 1
