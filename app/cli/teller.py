"""Says on stderr how a recording goes, and what the operator does next."""

import math
from typing import TYPE_CHECKING

from app.cli import output as out
from app.cli.live_line import LiveLine

if TYPE_CHECKING:
    from app.acquisition.messages import Event, RunEnded, StateChanged
    from app.acquisition.ring import RingRows

_SHOWN_S = 0.05
"""Readings are shown as means over so long a time."""


class Teller:
    """Follows events and samples of a recording.

    Parameters
    ----------
    line : LiveLine
        Where figures are kept up to date, on a terminal.
    count : int
        How many runs there will be.
    gauge_2_on_base : bool
        Gauge 2 measures the plate against the base.
    simulated : bool
        The stand pulls and lets go by itself.
    verified : str
        Against what the device's protocol was tested; "" if that is not to be said.
    """

    def __init__(
        self,
        line: LiveLine,
        count: int = 1,
        *,
        gauge_2_on_base: bool = False,
        simulated: bool = False,
        verified: str = "",
    ) -> None:
        self._line = line
        self._count = count
        self._gauge_2_on_base = gauge_2_on_base
        self._simulated = simulated
        self._verified = f" ({verified})" if verified else ""
        self._state: StateChanged | None = None
        self._said = ""
        self._done = 0
        self._table_m = math.nan
        self._relative_m = math.nan

    def hear(self, event: "Event") -> None:
        """Take one event of the engine."""
        from app.acquisition.messages import Connected, Reconnected, Reconnecting, RunEnded, StateChanged

        match event:
            case Connected(device, firmware, rate_hz):
                out.tell(f"connected: {device} {firmware}, {rate_hz:g} Hz{self._verified}")
            case Reconnecting() | Reconnected():
                out.tell(event.message)
            case StateChanged():
                self._came_to(event)
            case RunEnded():
                self._ended(event)
        self._line.hear(event)

    def see(self, rows: "RingRows") -> None:
        """Take the latest samples."""
        import numpy as np

        recent = rows.time_s >= rows.time_s[-1] - _SHOWN_S
        present = recent & np.isfinite(rows.table_m) & np.isfinite(rows.relative_m)
        if present.any():
            self._table_m = float(rows.table_m[present].mean())
            self._relative_m = float(rows.relative_m[present].mean())
        if self._state is not None and self._state.state in _WAITING:
            self._line.redraw(self._sentence(self._state))

    def _came_to(self, event: "StateChanged") -> None:
        self._state = event
        if event.state in ("connecting", "idle"):
            return
        if event.state in ("recentre", "zero", "recording") and self._count > 1 and not self._said:
            out.tell(f"run {self._done + 1} of {self._count}")
        sentence = self._sentence(event)
        if sentence != self._said:
            out.tell(sentence)
        self._said = sentence

    def _ended(self, event: "RunEnded") -> None:
        self._done += 1
        self._said = ""
        if event.path:
            more = f". {event.message}" if event.message else ""
            out.tell(f"stored {event.path}: {event.samples} samples, ended: {event.ended}{more}")

    def _sentence(self, event: "StateChanged") -> str:
        from app.presenters.record.guidance import Situation, guide

        on_base_m = self._table_m if self._gauge_2_on_base else 0.0
        guidance = guide(
            Situation(
                where=event.state,
                standing=event.position,
                table_m=self._table_m,
                plate_m=self._relative_m + on_base_m,
                simulated=self._simulated,
                note=event.note,
            )
        )
        detail = guidance.detail
        if detail[1:2].islower():  # it goes on as one sentence
            detail = detail[0].lower() + detail[1:]
        return f"{guidance.instruction}: {detail}" if detail else guidance.instruction


_WAITING = ("recentre", "pulling", "held", "armed")
