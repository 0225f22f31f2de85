"""How often a port is read that brings bytes by itself: seldom enough to cost little, and yet in time."""

import time
from collections.abc import Callable

from drivers.errors import DeviceLostError
from drivers.source import Link

_SAFE_BYTES = 2048
"""No more is left to gather: the smallest buffers of systems and adapters hold 4 kB."""
_HURRIED_BYTES = 512
"""No more is, while this computer is busy: who sleeps then is called late."""
_HURRIED_PAUSE_S = 0.002
_LATE_S = 0.005
_HURRIED_S = 5.0
"""A sleep that lasted so much longer than it should tells of a busy computer, for so long."""
_FULL_BYTES = 4000
"""After so many more may wait that had no room."""
_FIRST_BYTES_PER_S = 1e6
_LONGEST_BYTES = 1 << 20
_WAITED_S = 2e-4
"""A read that took so long waited for what it brought, and was there when it came."""
_PUNCTUAL_S = 0.05
"""How often what comes next is waited for: a fit of a clock takes the most punctual read of each 0.1 s."""


class BatchedReader:
    """Lets bytes gather in a port before it fetches them.

    A read costs the same whatever it brings, so fewer and larger ones cost less. Again and again what
    comes next is waited for too: the time after such a read is that of its arrival, which the fit of the
    device's clock rests upon.
    """

    def __init__(self) -> None:
        self._bytes_per_s = _FIRST_BYTES_PER_S
        self._ended_s = self._waited_s = time.monotonic()
        self._hurried_until_s = 0.0

    def read(self, link: Link, batch_delay_s: float) -> bytes:
        """What came, or within 50 ms comes next; b"" if nothing.

        Parameters
        ----------
        link : Link
        pause_s : float
            How long bytes may gather (s); less where they would be too many for the port.

        Raises
        ------
        DeviceLostError
            If the port is gone. What came before it is returned by the call before.
        """
        parts: list[bytes] = []
        try:
            self._fetch(link, batch_delay_s, parts)
        except DeviceLostError:
            if not parts:
                raise
        self._update_byte_rate(sum(map(len, parts)))
        return b"".join(parts)

    def _fetch(self, link: Link, batch_delay_s: float, parts: list[bytes]) -> None:
        due_s = time.monotonic() + batch_delay_s
        size, is_full = 0, False
        while (left_s := due_s - time.monotonic()) > 0.0 and size < _LONGEST_BYTES:
            safe_s = self._longest_delay_s()
            if not is_full:
                self._sleep(min(left_s, safe_s))
            if is_full or safe_s < left_s:
                parts.append(link.read())
                size += len(parts[-1])
                is_full = len(parts[-1]) >= _FULL_BYTES
        has_waited = self._read_once(link, parts)
        if not has_waited and batch_delay_s and time.monotonic() - self._waited_s > _PUNCTUAL_S:
            self._read_once(link, parts)
            self._waited_s = time.monotonic()

    def _longest_delay_s(self) -> float:
        """How long bytes may gather before they are fetched."""
        if time.monotonic() < self._hurried_until_s:
            return max(_HURRIED_BYTES / self._bytes_per_s, _HURRIED_PAUSE_S)
        return _SAFE_BYTES / self._bytes_per_s

    def _sleep(self, duration_s: float) -> None:
        due_s = time.monotonic() + duration_s
        time.sleep(duration_s)
        now_s = time.monotonic()
        if now_s - due_s > _LATE_S:
            self._hurried_until_s = now_s + _HURRIED_S

    def _read_once(self, link: Link, parts: list[bytes]) -> bool:
        """Read once; tell whether that took as long as only waiting does."""
        began_s = time.monotonic()
        parts.append(link.read())
        has_waited = time.monotonic() - began_s > _WAITED_S
        if has_waited:
            self._waited_s = time.monotonic()
        return has_waited

    def _update_byte_rate(self, size: int) -> None:
        began_s, self._ended_s = self._ended_s, time.monotonic()
        self._bytes_per_s = max(size, 1) / max(self._ended_s - began_s, _WAITED_S)


def read_for(read: Callable[[], bytes], duration_s: float) -> bytes:
    """What comes of reading again and again for so long (s), until nothing does; b"" if nothing at all.

    A device that is asked gives one answer a read, with its own stamp, and others may wait for the next.
    """
    due_s = time.monotonic() + duration_s
    parts = [read()]
    try:
        while parts[-1] and time.monotonic() < due_s:
            parts.append(read())
    except DeviceLostError:  # the next call tells it again
        pass
    return b"".join(parts)
