"""Streams of an eNod4."""

import numpy as np

from drivers.devices.enod4.codec import FrameDecoder, encode_frames, status_words
from tests.drivers.examples import RATE_HZ, Counts, RecordingExample, WireExample


def frames(first: int, counts: Counts) -> list[bytes]:
    return encode_frames(counts[:, 0], status_words(np.zeros(len(counts), dtype=np.uint8)))


WIRE = (WireExample("enod4", lambda: FrameDecoder(RATE_HZ), frames, has_checksum=False, gauges=1),)
RECORDING = RecordingExample(
    "two eNod4, fast SCMBus",
    rates_hz=(100, 200, 400, 800, 1300),
    is_exact=False,
    is_pair=True,
)
