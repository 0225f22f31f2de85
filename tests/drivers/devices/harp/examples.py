"""Streams of Harp LoadCells."""

from drivers.devices.harp.codec import EventDecoder, encode_events
from tests.drivers.examples import RATE_HZ, RecordingExample, WireExample, times_s

WIRE = (
    WireExample(
        "harp",  # the sum of its bytes modulo 256 is too weak to count as a checksum
        lambda: EventDecoder(RATE_HZ),
        lambda first, counts: [frame.tobytes() for frame in encode_events(times_s(first, counts), counts)],
        has_checksum=False,
        count_bits=16,
    ),
)
RECORDING = RecordingExample(
    "Harp LoadCells (1000 Hz by itself)", rates_hz=(1000, 2000, 5000, 10_000), has_16_bits=True
)
