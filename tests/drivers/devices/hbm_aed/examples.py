"""Streams of an AED or FIT."""

from drivers.devices.hbm_aed.codec import FORMATS, Format, ValueDecoder, encode_frames
from tests.drivers.examples import RATE_HZ, Counts, RecordingExample, WireExample


def _wire(kind: Format) -> WireExample:
    def frames(_: int, counts: Counts) -> list[bytes]:
        return encode_frames(kind, counts)

    return WireExample(
        f"hbm-aed, {kind}",
        lambda: ValueDecoder(kind, RATE_HZ),
        frames,
        has_checksum=False,
        gauges=1,
        following=FORMATS[kind].marks.confirming,
    )


WIRE = tuple(map(_wire, FORMATS))
RECORDING = RecordingExample(
    "two HBM AED of one gauge",
    rates_hz=(100, 150, 300, 600, 1200),
    is_exact=False,
    unplugged_hz=600.0,
    is_pair=True,
)
