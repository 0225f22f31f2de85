"""Streams of a GSV-4, GSV-3 and GSV-2."""

from drivers.devices.gsv_234.codec import FORMATS, FrameDecoder, encode_frames
from tests.drivers.examples import RATE_HZ, RecordingExample, WireExample


def _wire(model: str) -> WireExample:
    layout = FORMATS[model]
    return WireExample(
        model,
        lambda: FrameDecoder(layout, RATE_HZ),
        lambda _, counts: [frame.tobytes() for frame in encode_frames(layout, counts)],
        has_checksum=False,
        count_bits=8 * layout.size,
        gauges=min(2, len(layout.places)),
        following=layout.marks.confirming,
    )


WIRE = tuple(map(_wire, FORMATS))
RECORDING = RecordingExample(
    "GSV-4", rates_hz=(125, 250, 500, 937.5), is_exact=False, has_16_bits=True, unplugged_hz=500.0
)
