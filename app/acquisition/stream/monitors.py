"""Monitors of a stream: its true rate, and whether it has stalled."""

import math
from collections import deque
from itertools import pairwise, starmap

from drivers.clock import ClockEstimate, ClockFit, TimeBase
from drivers.host_time import host_ns
from drivers.recognition import describe_unreadable
from drivers.stream import SampleSource
from messages.i18n import N_
from messages.message import EMPTY, Message, message

RATE_TEMPLATE = N_(
    "the device sends {rate_hz:.6g} samples a second instead of {nominal_hz:g}: check its rate; the analysis"
    " allows for it"
)

_WRONG = 0.01
_WRONG_ERRORS = 5.0  # a rate that is off by more, and by so many standard uncertainties, is reported

_RECENT_S = 1.0
_WINDOW_S = 4.0  # window of the latest rate: a longer one is more certain, and reports a wrong rate later
_HOLE_S = 1.0
_HOLE_SAMPLES = 5.0
"""While nothing was read for so long, the host or the device stood still: the window around it is dropped."""
_HOLES_FRACTION = 0.1  # a stream with more of such holes gives no rate: most of it may have come late
_SETTLING_S = 0.5  # what comes first was held while the device was started: its arrival times are not used
_WINDOWS = 3
"""Successive windows that must agree on a wrong rate; on a busy host, windows differ."""
_QUICK = 1.5
_QUICK_WINDOW_S = 0.1
_QUICK_WINDOW_SAMPLES = 20.0
"""A device is known early to send too quickly where it does so, by the factor, in `_WINDOWS` such windows."""
_LATE_S = 0.05  # standard uncertainty of a span of few reads, which come late
_BEHIND_S = 0.3  # delays of host, port and adapter change by less
_AHEAD_S = 0.1


class RateMonitor:
    """Times a stream of nominally `rate_hz` by the host's clock: as a whole, and in its latest window.

    `opened_ns` is the host's time when the port was opened: no sample was taken before. A sample comes late,
    never early, so a stream whose samples come quicker than at its rate catches up, unless they come before
    they could have been taken at that rate.
    """

    def __init__(self, rate_hz: float, opened_ns: int) -> None:
        self._rate_hz = rate_hz
        self._begun: tuple[int, int] | None = (0, opened_ns)
        """A sample, and a time at which it was not taken yet; None after a restart of the device."""
        self._hole_ns = max(_HOLE_S, _HOLE_SAMPLES / rate_hz) * 1e9
        self._known: ClockEstimate | None = None
        self._recent: ClockEstimate | None = None
        self._recent_ns = self._latest_ns = 0
        self._is_wrong = False
        self._quick_window_s = max(_QUICK_WINDOW_S, _QUICK_WINDOW_SAMPLES / rate_hz)
        self._quick: ClockEstimate | None = None
        """Rate of a device that sends so much too quickly that a moment proves it."""
        self._first_ns: int | None = None
        self._begin()

    def restart(self) -> None:
        self.estimate()
        self._begun = None
        self._begin()

    def estimate(self) -> ClockEstimate | None:
        """Clock of the device by the longest stretch without a gap; None if that is too short.

        An estimate stays while a later one, of samples that came late meanwhile, is less certain and agrees.
        """
        present = self._whole.estimate()
        if (
            present is not None
            and self._is_known(present)
            and self._holes_ns * 1e-9 <= _HOLES_FRACTION * present.span_s
            and (self._known is None or _is_better(present, self._known))
        ):
            self._known = present
        self._recent, self._recent_ns = self._known or self._quick, self._latest_ns
        return self._recent

    def recent(self) -> ClockEstimate | None:
        """As `estimate`, but up to a second old, because an estimate costs much."""
        if self._recent is None or self._latest_ns - self._recent_ns > _RECENT_S * 1e9:
            return self.estimate()
        return self._recent

    def add(self, index: int, arrival_ns: int) -> Message:
        """Take the last sample of a read; return a note when the rate has become wrong, else EMPTY."""
        before_ns, self._latest_ns = self._latest_ns, arrival_ns
        self._follow_delay(index, before_ns)
        if self._first_ns is None:
            self._first_ns = self._window_ns = arrival_ns
        if self._quick is None:
            quick = self._quick = self._measure_quickness(index)
            if quick is not None:
                return rate_note(quick.scale, self._rate_hz)
            if arrival_ns - self._first_ns < _SETTLING_S * 1e9:
                return EMPTY
        self._whole.add(index, arrival_ns)
        if arrival_ns - before_ns > self._hole_ns:
            self._holes_ns += arrival_ns - before_ns
            self._windows.clear()
            self._begin_window(arrival_ns)
        self._window.add(index, arrival_ns)
        if arrival_ns - self._window_ns < _WINDOW_S * 1e9:
            return EMPTY
        return self._check_window(arrival_ns)

    def _begin(self) -> None:
        self._whole, self._window = ClockFit(self._rate_hz), ClockFit(self._rate_hz)
        self._windows = deque[ClockEstimate](maxlen=_WINDOWS)
        self._first_ns = None
        self._delay_s, self._least_delay_s = 0.0, math.inf
        self._window_ns = self._holes_ns = 0
        self._quick_windows: deque[tuple[int, int]] = deque(maxlen=_WINDOWS + 1)

    def _begin_window(self, arrival_ns: int) -> None:
        self._window, self._window_ns = ClockFit(self._rate_hz), arrival_ns

    def _check_window(self, arrival_ns: int) -> Message:
        """A wrong rate is as wrong as in the windows before."""
        latest = self._window.estimate()
        self._begin_window(arrival_ns)
        if latest is None:
            self._windows.clear()
            return EMPTY
        self._windows.append(latest)
        was_wrong = self._is_wrong
        is_same = len(self._windows) == _WINDOWS and all(starmap(_agree_on_wrong, pairwise(self._windows)))
        self._is_wrong = is_same and self._is_no_delay(latest)
        is_told = was_wrong or self._quick is not None
        return rate_note(latest.scale, self._rate_hz) if self._is_wrong and not is_told else EMPTY

    def _follow_delay(self, index: int, before_ns: int) -> None:
        """Measure how much later the newest sample came than it was due at the nominal rate."""
        if self._begun is None:
            self._begun = (index, before_ns)
        first, begun_ns = self._begun
        self._delay_s = (self._latest_ns - begun_ns) * 1e-9 - (index - first) / self._rate_hz
        self._least_delay_s = min(self._least_delay_s, self._delay_s)

    def _measure_quickness(self, index: int) -> ClockEstimate | None:
        """Rate of a device that sends much too quickly; None for any other.

        Samples that were held somewhere come quickly too, but within one window, or late.
        """
        begins, latest = self._quick_windows, (index, self._latest_ns)
        if not begins or latest[1] - begins[-1][1] > self._quick_window_s * 1e9:
            begins.append(latest)
        if len(begins) <= _WINDOWS or self._delay_s > -_AHEAD_S:
            return None
        if min(starmap(_rate_hz, pairwise(begins))) <= _QUICK * self._rate_hz:
            return None
        rate_hz = float(f"{_rate_hz(begins[0], begins[-1]):.2g}")
        scale, span_s = self._rate_hz / rate_hz, (begins[-1][1] - begins[0][1]) * 1e-9
        return ClockEstimate(rate_hz, scale, scale * _LATE_S / span_s, span_s)

    def _is_no_delay(self, estimate: ClockEstimate) -> bool:
        """Tell whether a wrong rate is more than samples that come later and later, or catch up."""
        if estimate.scale < 1.0:
            return self._delay_s < -_AHEAD_S
        return self._delay_s - self._least_delay_s > _BEHIND_S

    def _is_known(self, whole: ClockEstimate) -> bool:
        """Tell whether the rate of the whole stretch is that of the device: of a wrong one, throughout it."""
        if abs(whole.scale - 1.0) < _WRONG:
            return True
        halves = self._whole.halves()
        return self._is_no_delay(whole) and halves is not None and _agree(*halves)


def _rate_hz(begin: tuple[int, int], end: tuple[int, int]) -> float:
    """Samples a second from one index and arrival (ns) to another."""
    return (end[0] - begin[0]) / (end[1] - begin[1]) * 1e9


def is_rate_wrong(estimate: ClockEstimate | TimeBase) -> bool:
    """Tell whether a rate is so far from the nominal one that it must be reported."""
    return abs(estimate.scale - 1.0) >= max(_WRONG, _WRONG_ERRORS * estimate.scale_standard_uncertainty)


def _is_better(present: ClockEstimate, known: ClockEstimate) -> bool:
    is_as_certain = present.scale_standard_uncertainty <= known.scale_standard_uncertainty
    uncertainty = math.hypot(present.scale_standard_uncertainty, known.scale_standard_uncertainty)
    contradicts = abs(present.scale - known.scale) > 2.0 * uncertainty
    return present.span_s >= known.span_s and (is_as_certain or contradicts)


def _agree_on_wrong(one: ClockEstimate, other: ClockEstimate) -> bool:
    return is_rate_wrong(one) and is_rate_wrong(other) and _agree(one, other)


def _agree(one: ClockEstimate, other: ClockEstimate) -> bool:
    uncertainty = math.hypot(one.scale_standard_uncertainty, other.scale_standard_uncertainty)
    return abs(one.scale - other.scale) <= max(_WRONG, 2.0 * uncertainty)


def rate_note(scale: float, nominal_hz: float) -> Message:
    """Note on a wrong rate; `scale` as in `TimeBase`."""
    return message(RATE_TEMPLATE, rate_hz=nominal_hz / scale, nominal_hz=nominal_hz)


STALLED_S = 3.0  # a device that sends nothing intelligible for so long has stalled; a slow one has longer

_STALLED_SAMPLES = 5.0
_KEPT_BYTES = 4096  # part of unintelligible data that is kept for the message
_UNWATCHED_S = 1.0
_UNREAD_S = 2.0
"""A thread that has not checked, or not read, for so long got no processor time; one read of a polled device
may take a second."""


class StallDetector:
    """Measures the time since the last good sample. Bytes without a sample do not count."""

    def __init__(self, port: str, source: SampleSource, start_ns: int) -> None:
        self._port = port
        self._protocol = source.identity.protocol
        self._limit_s = max(STALLED_S, _STALLED_SAMPLES / source.rate_hz)
        self._last_sample_ns = start_ns
        self.restart(start_ns)

    def restart(self, now_ns: int) -> None:
        self._quiet_ns = self._checked_ns = now_ns
        self._garbage = b""

    def add_read(self, arrival_ns: int, data: bytes, *, has_samples: bool) -> None:
        if has_samples:
            self._last_sample_ns = self._quiet_ns = arrival_ns
            self._garbage = b""
        elif len(self._garbage) < _KEPT_BYTES:
            self._garbage += data[:_KEPT_BYTES]

    def silent_s(self) -> float:
        return (host_ns() - self._last_sample_ns) * 1e-9

    def is_stalled(self, read_ns: int) -> bool:
        """Tell whether to give the connection up; `read_ns` is the time of the last read. Ask often."""
        now_ns = host_ns()
        is_watched = now_ns - self._checked_ns < _UNWATCHED_S * 1e9
        if not is_watched or now_ns - read_ns > _UNREAD_S * 1e9:  # without a reader, silence proves nothing
            self._quiet_ns = now_ns
        self._checked_ns = now_ns
        return now_ns - self._quiet_ns > self._limit_s * 1e9

    def message(self) -> Message:
        if not self._garbage:
            template = N_(
                "port {port} is open but silent for {limit_s:g} s: check the device, reset it and record"
                " again"
            )
            return message(template, port=self._port, limit_s=self._limit_s)
        return message(
            "port {port} has brought no sample for {limit_s:g} s: {cause}",
            port=self._port,
            limit_s=self._limit_s,
            cause=describe_unreadable(self._garbage, self._protocol),
        )
