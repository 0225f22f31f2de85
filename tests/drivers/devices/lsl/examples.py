"""Chunks of an LSL stream."""

from drivers.devices.lsl.codec import StreamDecoder
from drivers.stream_packets import pack_chunk
from tests.drivers.examples import RATE_HZ, RecordingExample, WireExample, times_s

WIRE = (
    WireExample(
        "lsl",
        lambda: StreamDecoder(0, 1, RATE_HZ),
        lambda first, counts: [
            pack_chunk(times_s(first + k, counts[k : k + 1]), counts[k : k + 1], 0.0, 0)
            for k in range(len(counts))
        ],
        has_checksum=True,
        leap=50_000,
        following=101,
    ),
)
RECORDING = RecordingExample("LSL stream", rates_hz=(1000, 2000, 5000, 10_000, 20_000, 50_000))
