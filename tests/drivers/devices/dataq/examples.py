"""Streams of DATAQ instruments."""

from drivers.devices.dataq.codec import FOLLOWING, WITH_DIGITAL, ScanDecoder, encode_scans
from tests.drivers.examples import RATE_HZ, RecordingExample, WireExample

WIRE = (
    WireExample(
        "dataq",
        lambda: ScanDecoder(WITH_DIGITAL, RATE_HZ),
        lambda _, counts: [scan.tobytes() for scan in encode_scans(WITH_DIGITAL, counts)],
        has_checksum=False,
        count_bits=16,
        following=FOLLOWING,
    ),
)
RECORDING = RecordingExample(
    "DATAQ DI-2108",
    is_exact=False,
    has_16_bits=True,
)
