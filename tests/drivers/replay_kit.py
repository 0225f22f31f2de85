"""Captured bytes through the decoder of live bytes."""

from collections.abc import Iterable, Iterator

from drivers.errors import NoDataError
from drivers.recognition import describe_unreadable
from drivers.samples import SampleBlock
from drivers.stream import SampleSource

_SHOWN_BYTES = 4096


def replay(source: SampleSource, reads: Iterable[tuple[int, bytes]]) -> Iterator[SampleBlock]:
    """Blocks of a source that was never started, from what a port once gave.

    Parameters
    ----------
    source : SampleSource
        New, made with the settings and the rate of the recording.
    reads : iterable of (arrival_ns, data)
        Each read with the host's monotonic time after it, in order.

    Raises
    ------
    NoDataError
        If all of it holds no sample.
    """
    first = b""
    for arrival_ns, data in reads:
        if not source.losses.samples:
            first = (first + data)[:_SHOWN_BYTES]
        yield from source.decode(data, arrival_ns)
    if not source.losses.samples:
        raise NoDataError(
            f"the recorded bytes hold no sample: {describe_unreadable(first, source.identity.protocol)}"
        )


def split_reads(data: bytes, ends: Iterable[int], arrivals_ns: Iterable[int]) -> Iterator[tuple[int, bytes]]:
    """Reads again, from bytes stored in one piece.

    Parameters
    ----------
    data : bytes
        All reads, one after the other.
    ends : iterable of int
        Where each read ends in `data`.
    arrivals_ns : iterable of int
        When each came.
    """
    start = 0
    for end, arrival_ns in zip(ends, arrivals_ns, strict=True):
        yield int(arrival_ns), data[start:end]
        start = end
