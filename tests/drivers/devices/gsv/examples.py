"""Streams of a GSV."""

from drivers.devices.gsv.codec import FrameDecoder, FrameLayout, encode_frames
from tests.drivers.examples import RATE_HZ, RecordingExample, WireExample

LAYOUT = FrameLayout(2)
WIRE = (
    WireExample(
        "gsv",
        lambda: FrameDecoder(LAYOUT, RATE_HZ),
        lambda _, counts: [frame.tobytes() for frame in encode_frames(LAYOUT, counts)],
        has_checksum=False,
    ),
)
RECORDING = RecordingExample(
    "GSV, float32", rates_hz=(1000, 2000, 5000, 10_000, 20_000, 48_000), is_exact=False
)
