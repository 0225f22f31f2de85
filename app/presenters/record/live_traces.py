"""The live traces of Record: which span of time is shown, how high the axes are, what is marked."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange
from app.acquisition.ring import RingRows
from app.presenters.decimated_history import DecimatedHistory, Polyline
from app.presenters.record.state import Span, TraceMarks, Traces
from messages.i18n import gettext

ROLLING_S = 10.0
BEFORE_RELEASE_S = 1.0
_TARE_S, _TARE_PARTS = 1.0, 10
_STILL_M = 50e-6
"""Means over a tenth of a second may differ by so much in a stand that is left alone."""
_SPANS_S = (2.0, 4.0, 8.0, 12.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0)
_LIMITS_MM = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 100.0)
_MOVING = (PullbackState.SLIPPING, PullbackState.NO_SLIP, PullbackState.TAIL)
_BEGINNING = (PullbackState.RECENTRE, PullbackState.ZERO, PullbackState.RECORDING)
_HELD_BACK = (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED)


class LiveTraces:
    """Samples as they come, cut to what the screen shows.

    Before release the last ten seconds roll by; from release on, the axis begins shortly before it and
    grows in steps; after the end it stands still until `restart`.

    Parameters
    ----------
    table_range_m, relative_range_m : float or None
        Ranges of the gauges, drawn in.
    """

    def __init__(self, table_range_m: float | None = None, relative_range_m: float | None = None) -> None:
        self.history = DecimatedHistory()
        self.tare_m = np.zeros(2)
        """What both gauges are shown from (2,); nothing of it is stored."""
        self._ranges_m = (table_range_m, relative_range_m)
        self._tolerance_m = 0.0
        self._state: PullbackState | None = None
        self.restart()

    def restart(self) -> None:
        """Roll again, for the next run, from the tare."""
        self.zero_m = self.tare_m.copy()
        self._release_s: float | None = None
        self._slip_s: Span | None = None
        self._end_s: float | None = None
        self._pulled = False
        self._is_held = False

    def append(self, rows: RingRows) -> None:
        """Take new rows in."""
        self.history.append(rows.time_s, np.column_stack((rows.table_m, rows.relative_m)))

    def on_state_changed(
        self, state: PullbackState, since_s: float, standing: StandPosition | None = None
    ) -> None:
        """Note that the pullback came to `state` at `since_s` on the ring's time axis.

        One that it is in already is told again when there is something to say, and marks nothing.
        """
        if state is not self._state:
            self._state = state
            self._turn(state, since_s)
        if standing is None:
            return
        self._tolerance_m = standing.tolerance_m
        if standing.table_zero_m is not None:
            self.zero_m = np.array([standing.table_zero_m, standing.relative_zero_m or 0.0])

    def stop(self) -> None:
        """The run has ended: nothing that comes now belongs to it."""
        if self._end_s is None:
            self._end_s = self.history.end_s

    def hold(self) -> None:
        """Something else is looked at, until `restart`."""
        self._is_held = True

    def tare(self) -> bool:
        """Show both gauges from where they stand now; False where they have not stood still for a second."""
        end_s = self.history.end_s
        edges_s = end_s + _TARE_S * np.linspace(-1.0, 0.0, _TARE_PARTS + 1)
        parts_m = np.array([self.history.mean(start_s, to_s) for start_s, to_s in pairwise(edges_s)])
        if not np.ptp(parts_m, axis=0).max() < _STILL_M:  # nor where readings are missing: NaN
            return False
        self._show_from(parts_m.mean(axis=0))
        return True

    def untare(self) -> None:
        """Show both gauges by the calibration."""
        self._show_from(np.zeros(2))

    @property
    def is_settled(self) -> bool:
        """Tell whether the run has ended and all of it has come, so that nothing will look different."""
        return self._is_held or (self._end_s is not None and self.history.end_s >= self._end_s)

    def newest_m(self) -> np.ndarray:
        """Mean of both channels over the last 50 ms, from the zero (2,); NaN without samples."""
        end_s = self.history.end_s
        return self.history.mean(end_s - 0.05, end_s + 1e-9) - self.zero_m

    def render(self, pixels: int, pullback_m: float | None, room: AllowedPlateRange | None = None) -> Traces:
        """What to show on `pixels` pixels of width; `room` where the plate has to be put back."""
        origin_s, shown = self._axis()
        last_s = min(origin_s + shown[1], np.inf if self._end_s is None else self._end_s)
        lines = self.history.lines(origin_s + shown[0], last_s + 1e-9, pixels)
        table, relative = (
            Polyline(line.time_s - origin_s, 1e3 * (line.value - zero_m))
            for line, zero_m in zip(lines, self.zero_m, strict=True)
        )
        return Traces(
            table=table,
            relative=relative,
            span=shown,
            time_title=gettext("time from now, s")
            if self._release_s is None
            else gettext("time from release, s"),
            table_limit_mm=_limit_mm(table, pullback_m, self._range_mm(0)),
            relative_limit_mm=_limit_mm(relative, pullback_m, self._range_mm(1)),
            marks=self._marks(origin_s, shown, table, pullback_m, room),
        )

    def _turn(self, state: PullbackState, since_s: float) -> None:
        if state in _BEGINNING:
            self.restart()
        elif state is PullbackState.PULLING:
            self._release_s = self._slip_s = None  # let down, not released
        elif state is PullbackState.RELEASED or (state in _MOVING and self._release_s is None):
            self._release_s = since_s
        elif state is PullbackState.CLOSING:
            self._end_s = since_s
        self._pulled = state in _HELD_BACK
        self._note_slip(state, since_s)

    def _show_from(self, tare_m: np.ndarray) -> None:
        self.tare_m = tare_m
        self.zero_m = tare_m.copy()

    def _note_slip(self, state: PullbackState, since_s: float) -> None:
        if state is PullbackState.SLIPPING:
            self._slip_s = (since_s, np.inf)
        elif self._slip_s is not None and self._slip_s[1] == np.inf:
            self._slip_s = (self._slip_s[0], since_s)

    def _axis(self) -> tuple[float, Span]:
        """Time of the shown axis' zero on the ring's axis, and the span shown."""
        now_s = self.history.end_s if self._end_s is None else self._end_s
        if not np.isfinite(now_s):
            return 0.0, (-ROLLING_S, 0.0)
        if self._release_s is None:
            return now_s, (-ROLLING_S, 0.0)
        elapsed_s = now_s - self._release_s
        return self._release_s, (-BEFORE_RELEASE_S, _step_up(elapsed_s, _SPANS_S))

    def _marks(
        self,
        origin_s: float,
        shown: Span,
        table: Polyline,
        pullback_m: float | None,
        room: AllowedPlateRange | None,
    ) -> TraceMarks:
        released = self._release_s is not None
        return TraceMarks(
            before_release=(-BEFORE_RELEASE_S, 0.0) if released else None,
            release_s=0.0 if released else None,
            slip=self._slip_span(origin_s, shown),
            target_mm=self._target_mm(table, pullback_m) if self._pulled else None,
            table_range_mm=self._range_mm(0),
            relative_range_mm=self._range_mm(1),
            plate_room_mm=self._room_mm(room),
        )

    def _target_mm(self, table: Polyline, pullback_m: float | None) -> Span | None:
        """Where the pull may end, on the side to which the table is being pulled."""
        if pullback_m is None or len(table.value) == 0:
            return None
        middle_m = -pullback_m if table.value[-1] < 0.0 else pullback_m
        return 1e3 * (middle_m - self._tolerance_m), 1e3 * (middle_m + self._tolerance_m)

    def _range_mm(self, channel: int) -> Span | None:
        """Between what a gauge reads, from where it is shown."""
        range_m = self._ranges_m[channel]
        return None if range_m is None else self._shown_mm(channel, -range_m, range_m)

    def _room_mm(self, room: AllowedPlateRange | None) -> Span | None:
        return None if room is None else self._shown_mm(1, room.low_m, room.high_m)

    def _shown_mm(self, channel: int, low_m: float, high_m: float) -> Span:
        zero_m = float(self.zero_m[channel])
        return 1e3 * (low_m - zero_m), 1e3 * (high_m - zero_m)

    def _slip_span(self, origin_s: float, shown: Span) -> Span | None:
        if self._slip_s is None:
            return None
        start_s, end_s = (t - origin_s for t in self._slip_s)
        return max(start_s, shown[0]), min(end_s, self.history.end_s - origin_s)


def _limit_mm(line: Polyline, pullback_m: float | None, ends_mm: Span | None) -> float:
    """Half height of an axis: room for the pullback, for all that is shown, in steps that seldom change."""
    present = line.value[np.isfinite(line.value)]
    largest = float(np.abs(present).max(initial=0.0))
    wanted = 1.1 * max(largest, 1e3 * (pullback_m or 0.0), 0.4)
    limit = _step_up(wanted, _LIMITS_MM)
    if ends_mm is None:
        return limit
    range_mm = max(abs(end) for end in ends_mm)
    return 1.12 * range_mm if 0.8 * range_mm <= limit and largest <= range_mm else limit


def _step_up(wanted: float, steps: Iterable[float]) -> float:
    return next((step for step in steps if step >= wanted), wanted)
