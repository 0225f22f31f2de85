"""How fast a device really sends, and what is to be said of it."""

import math

from drivers.clock import ClockEstimate, ClockFit, TimeBase
from drivers.host_time import host_ns
from drivers.recognition import describe_unreadable
from drivers.source import SampleSource
from messages.i18n import N_
from messages.message import EMPTY, Message, message

RATE_TEMPLATE = N_(
    "the device sends {rate_hz:.6g} samples a second instead of {nominal_hz:g}: check its rate; the analysis"
    " allows for it"
)

_SAID = 0.01
_SURE = 5.0
"""A rate that is off by more, and by so many standard uncertainties, is mentioned in words."""

_RECENT_S = 1.0
_WINDOW_S = 4.0
_HOLE_S = 1.0
_HOLE_SAMPLES = 5.0
"""While nothing was read for so long, somebody stood still: what came then tells no rate in its window."""
_HOLES_SHARE = 0.1
"""A stream with more of such holes tells no rate at all: most of it may have come late."""
_SETTLING_S = 0.5
"""What comes first was held while the device was started: it says nothing of the clock."""


class RateMonitor:
    """Times a stream by the host's clock: as a whole, and lately.

    Parameters
    ----------
    rate_hz : float
        What the device says that it sends.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._hole_ns = max(_HOLE_S, _HOLE_SAMPLES / rate_hz) * 1e9
        self._longest: ClockEstimate | None = None
        self._recent: ClockEstimate | None = None
        self._recent_ns = self._latest_ns = 0
        self._is_wrong = False
        self._before: ClockEstimate | None = None
        self._first_ns: int | None = None
        self._begin()

    def restart(self) -> None:
        """Rows that stand for lost time are only estimated: what comes next is timed by itself."""
        self._longest = self.estimate()
        self._begin()

    def estimate(self) -> ClockEstimate | None:
        """How the device's clock goes, by the longest stretch without an estimated gap.

        None if that is too short, or if somebody stood still for much of it.
        """
        present = self._whole.estimate()
        if (
            present is None
            or self._holes_ns * 1e-9 > _HOLES_SHARE * present.span_s
            or (self._longest is not None and self._longest.span_s > present.span_s)
        ):
            return self._longest
        return present

    def recent(self) -> ClockEstimate | None:
        """As `estimate`, or as it was up to a second of the stream ago: it costs a good deal."""
        if self._recent is None or self._latest_ns - self._recent_ns > _RECENT_S * 1e9:
            self._recent, self._recent_ns = self.estimate(), self._latest_ns
        return self._recent

    def add(self, index: int, arrival_ns: int) -> Message:
        """Take the sample that came last, and say when the rate has become wrong; else "".

        Parameters
        ----------
        index : int
            From the first sample of the stream, gaps included.
        arrival_ns : int
            Host's time of its arrival (ns).
        """
        before_ns, self._latest_ns = self._latest_ns, arrival_ns
        if self._first_ns is None:
            self._first_ns = self._window_ns = arrival_ns
        if arrival_ns - self._first_ns < _SETTLING_S * 1e9:
            return EMPTY
        self._whole.add(index, arrival_ns)
        if arrival_ns - before_ns > self._hole_ns:
            self._holes_ns += arrival_ns - before_ns
            self._before = None
            self._begin_window(arrival_ns)
        self._lately.add(index, arrival_ns)
        if arrival_ns - self._window_ns < _WINDOW_S * 1e9:
            return EMPTY
        return self._look(arrival_ns)

    def _begin(self) -> None:
        self._whole, self._lately = ClockFit(self._rate_hz), ClockFit(self._rate_hz)
        self._before = None
        self._first_ns = None
        self._window_ns = self._holes_ns = 0

    def _begin_window(self, arrival_ns: int) -> None:
        self._lately, self._window_ns = ClockFit(self._rate_hz), arrival_ns

    def _look(self, arrival_ns: int) -> Message:
        """At the end of a window: a wrong rate is off by as much as in the window before.

        Where a busy host takes the bytes late, each window shows another rate.
        """
        lately, before = self._lately.estimate(), self._before
        self._before = lately
        self._begin_window(arrival_ns)
        was_wrong = self._is_wrong
        self._is_wrong = lately is not None and before is not None and _agree_on_wrong(lately, before)
        return (
            rate_note(lately.scale, self._rate_hz) if lately and self._is_wrong and not was_wrong else EMPTY
        )


def is_rate_wrong(estimate: ClockEstimate | TimeBase) -> bool:
    """Tell whether a rate is so far from the nominal one that it must be said."""
    return abs(estimate.scale - 1.0) >= max(_SAID, _SURE * estimate.scale_standard_uncertainty)


def _agree_on_wrong(one: ClockEstimate, other: ClockEstimate) -> bool:
    uncertainty = math.hypot(one.scale_standard_uncertainty, other.scale_standard_uncertainty)
    return (
        is_rate_wrong(one)
        and is_rate_wrong(other)
        and abs(one.scale - other.scale) <= max(_SAID, 2.0 * uncertainty)
    )


def rate_note(scale: float, nominal_hz: float) -> Message:
    """Report a wrong rate; `scale` as in `TimeBase`."""
    return message(RATE_TEMPLATE, rate_hz=nominal_hz / scale, nominal_hz=nominal_hz)


STALLED_S = 3.0
"""A device that says nothing intelligible for so long has stalled; a slow one has longer."""

_STALLED_SAMPLES = 5.0
_SHOWN_BYTES = 4096
_UNWATCHED_S = 1.0
_UNREAD_S = 2.0
"""Who has not looked, or not read, for so long got no processor; one read of a device that is asked may take
a second."""


class StallDetector:
    """Time since the last good sample. Bytes that no sample comes of are silence too.

    Parameters
    ----------
    url : str
        Of the port, for words.
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
        is_looked_at = now_ns - self._looked_ns < _UNWATCHED_S * 1e9
        if not is_looked_at or now_ns - read_ns > _UNREAD_S * 1e9:  # what nobody listens to proves nothing
            self._quiet_ns = now_ns
        self._looked_ns = now_ns
        return now_ns - self._quiet_ns > self._limit_s * 1e9

    def message(self) -> Message:
        """Report the stall."""
        if not self._rubbish:
            return message(
                "port {port} is open but silent for {limit_s:g} s: check the device, reset it and record"
                " again",
                port=self._url,
                limit_s=self._limit_s,
            )
        return message(
            "port {port} has brought no sample for {limit_s:g} s: {cause}",
            port=self._url,
            limit_s=self._limit_s,
            cause=describe_unreadable(self._rubbish, self._protocol),
        )
