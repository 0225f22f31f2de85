"""How often a port is read that brings bytes by itself: seldom enough to cost little, and yet in time."""

import time

from drivers.errors import DeviceLostError
from drivers.source import Link

_SAFE_BYTES = 2048
"""No more is left to gather: the smallest buffers of systems and adapters hold 4 kB."""
_FIRST_BYTES_PER_S = 1e6
_LONGEST_BYTES = 1 << 20
_WAITED_S = 2e-4
"""A read that took so long waited for what it brought, and was there when it came."""


class Gathering:
    """Lets bytes gather in a port, then fetches them and what comes next.

    A read costs the same whatever it brings, so fewer and larger ones cost less. The last bytes of each
    were waited for: the time after it is that of their arrival, as the fit of the device's clock wants it.
    """

    def __init__(self) -> None:
        self._bytes_per_s = _FIRST_BYTES_PER_S
        self._ended_s = time.monotonic()

    def read(self, link: Link, pause_s: float) -> bytes:
        """What came, and within 50 ms comes next; b"" if nothing.

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
            self._fetch(link, pause_s, parts)
        except DeviceLostError:
            if not parts:
                raise
        self._measure(sum(map(len, parts)))
        return b"".join(parts)

    def _fetch(self, link: Link, pause_s: float, parts: list[bytes]) -> None:
        due_s = time.monotonic() + pause_s
        size = 0
        while (left_s := due_s - time.monotonic()) > 0.0 and size < _LONGEST_BYTES:
            safe_s = _SAFE_BYTES / self._bytes_per_s
            time.sleep(min(left_s, safe_s))
            if safe_s < left_s:
                parts.append(link.read())
                size += len(parts[-1])
        began_s = time.monotonic()
        parts.append(link.read())
        if pause_s and parts[-1] and time.monotonic() - began_s < _WAITED_S:
            parts.append(link.read())

    def _measure(self, size: int) -> None:
        began_s, self._ended_s = self._ended_s, time.monotonic()
        self._bytes_per_s = max(size, 1) / max(self._ended_s - began_s, _WAITED_S)
