"""Shared by the driver tests: a scripted link, refused settings, cuts of bytes, and blocks put together."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pytest
from hypothesis import strategies as st

from drivers.errors import DeviceLostError, SettingsError
from drivers.samples import SampleBlock


class ScriptedLink:
    """A `Link` whose device answers each thing that is sent: (sent, received) pairs, or a function."""

    def __init__(self, answer: Callable[[bytes], bytes], waiting: bytes = b"") -> None:
        self._answer = answer
        self._waiting = waiting
        self.sent: list[bytes] = []
        self.is_lost = False

    def read(self) -> bytes:
        if self.is_lost:
            raise DeviceLostError("the scripted device is gone")
        data, self._waiting = self._waiting[:50], self._waiting[50:]
        return data

    def write(self, data: bytes) -> None:
        if self.is_lost:
            raise DeviceLostError("the scripted device is gone")
        self.sent.append(data)
        self._waiting += self._answer(data)


def refusal(make: Callable[..., object], *given: object) -> str:
    """The one line that refuses settings."""
    with pytest.raises(SettingsError) as error:
        make(*given)
    said = str(error.value)
    assert "\n" not in said
    return said


def cut_at(data: bytes, places: Iterable[int]) -> Iterator[bytes]:
    """`data` in pieces that end at `places`."""
    start = 0
    for place in [*sorted(places), len(data)]:
        yield data[start:place]
        start = place


def single_bytes(data: bytes) -> Iterator[bytes]:
    return cut_at(data, range(1, len(data)))


def cuts(data: bytes) -> st.SearchStrategy[list[int]]:
    return st.lists(
        st.integers(1, max(len(data) - 1, 1)), max_size=12, unique=True
    )  # b"" marks a broken connection


def join(blocks: Iterable[SampleBlock]) -> SampleBlock:
    """One block of all, after checking that they join without a hole."""
    parts = list(blocks)
    expected = 0
    for part in parts:
        assert part.first_index == expected
        assert len(part) == len(part.counts) == len(part.status) > 0
        expected += len(part)
    timed = bool(parts) and parts[0].device_time_s is not None
    return SampleBlock(
        first_index=0,
        counts=np.concatenate([part.counts for part in parts]) if parts else np.zeros((0, 2)),
        status=np.concatenate([part.status for part in parts]) if parts else np.zeros(0, dtype=np.uint8),
        arrival_ns=parts[-1].arrival_ns if parts else 0,
        device_time_s=np.concatenate([part.device_time_s for part in parts]) if timed else None,
    )
