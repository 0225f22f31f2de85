"""Notices that a device says nothing, or nothing that makes sense."""

from drivers.diagnosis import describe
from drivers.host_time import host_ns
from drivers.source import SampleSource

STALLED_S = 3.0
"""A device that says nothing intelligible for so long has stalled; a slow one has longer."""

_STALLED_SAMPLES = 5.0
_SHOWN_BYTES = 4096
_ABSENT_S = 1.0
_UNREAD_S = 2.0
"""Who has not looked, or not read, for so long got no processor; one read of a device that is asked may take
a second."""


class StallDetector:
    """Time since the last good sample. Bytes that no sample comes of are silence too.

    Parameters
    ----------
    url : str
        Of the port, for words.
    source : SampleSource
    began_ns : int
        Host's time at which the connection began.
    """

    def __init__(self, url: str, source: SampleSource, began_ns: int) -> None:
        self._url = url
        self._protocol = source.identity.protocol
        self._limit_s = max(STALLED_S, _STALLED_SAMPLES / source.rate_hz)
        self._heard_ns = began_ns
        self.restart(began_ns)

    def restart(self, now_ns: int) -> None:
        """A connection began."""
        self._quiet_ns = self._looked_ns = now_ns
        self._rubbish = b""

    def add_read(self, arrival_ns: int, data: bytes, *, is_sense: bool) -> None:
        """Something came, which held samples or not."""
        if is_sense:
            self._heard_ns = self._quiet_ns = arrival_ns
            self._rubbish = b""
        elif len(self._rubbish) < _SHOWN_BYTES:
            self._rubbish += data[:_SHOWN_BYTES]

    def silent_s(self) -> float:
        """Seconds since the last good sample."""
        return (host_ns() - self._heard_ns) * 1e-9

    def is_stalled(self, read_ns: int) -> bool:
        """Tell whether to give the connection up. Ask often.

        Parameters
        ----------
        read_ns : int
            Host's time when the port was read the last time, by a thread that may be kept waiting alone.
        """
        now_ns = host_ns()
        is_looked_at = now_ns - self._looked_ns < _ABSENT_S * 1e9
        if not is_looked_at or now_ns - read_ns > _UNREAD_S * 1e9:  # what nobody listens to proves nothing
            self._quiet_ns = now_ns
        self._looked_ns = now_ns
        return now_ns - self._quiet_ns > self._limit_s * 1e9

    def message(self) -> str:
        """What to say then."""
        if not self._rubbish:
            return (
                f"port {self._url} is open but silent for {self._limit_s:g} s: check the device, "
                "reset it and record again"
            )
        said = describe(self._rubbish, self._protocol)
        return f"port {self._url} has brought no sample for {self._limit_s:g} s: {said}"
