"""Streams of Slipstand binary."""

import numpy as np

from drivers.devices.slipstand_binary.codec import FrameDecoder, encode_frames
from tests.drivers.examples import RATE_HZ, Counts, RecordingExample, WireExample, times_s


def frames(first: int, counts: Counts) -> list[bytes]:
    times_us = np.rint(times_s(first, counts) * 1e6).astype(np.int64)
    return [frame.tobytes() for frame in encode_frames(first, times_us, counts)]


WIRE = (WireExample("slipstand-binary", lambda: FrameDecoder(RATE_HZ), frames, has_checksum=True),)
RECORDING = RecordingExample("Slipstand binary")
