"""Sizes and places in a Slipstand binary frame."""

SYNC = b"\xaa\x55"
VERSION = 1
HEADER_BYTES = 13
"""Bytes before the first sample: sync, version, flags, seq, t_us, n."""
SAMPLE_BYTES = 8
"""Bytes of one sample: two int32."""
MAX_SAMPLES = 32


def frame_length(samples: int) -> int:
    """Bytes of a frame that carries `samples` samples."""
    return HEADER_BYTES + SAMPLE_BYTES * samples + 2
