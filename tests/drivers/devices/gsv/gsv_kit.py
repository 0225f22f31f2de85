"""Readings and frames of a GSV for its tests."""

import numpy as np
from wire_helpers import join

from drivers.devices.gsv.codec import FrameDecoder, FrameLayout, encode_frames

RATE_HZ = 100.0
TWO = FrameLayout(2)


def readings(samples: int, first: int = 0) -> np.ndarray:
    index = first + np.arange(samples)
    return np.stack([index * 1000 - 5, 1_000_000 - index], axis=1).astype(np.float64)


def frames(samples: int, layout: FrameLayout = TWO, first: int = 0) -> list[bytes]:
    return [row.tobytes() for row in encode_frames(layout, readings(samples, first))]


def decode(pieces, layout: FrameLayout = TWO):
    decoder = FrameDecoder(layout, RATE_HZ)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder
