"""Says on stderr how a recording goes, and what the operator does next."""

import math
import time
from typing import Self

import numpy as np

from analysis.catalogue import Place, definition
from analysis.formatting import format_value
from analysis.quantities import Quantity
from app.acquisition import messages
from app.acquisition.guidance import PullbackSituation, guidance_for
from app.acquisition.messages import Event, LiveResult, RunEnded, StateChanged, is_known
from app.acquisition.ring import RingRows
from app.cli import output as out

_SHOWN_S = 0.05  # readings are shown as means over so long a time


class ProgressPrinter:
    """Prints events of a recording of `count` runs, and what the operator does next.

    A simulated stand pulls and lets go by itself. `verified` says against what the protocol was tested; "" is
    not printed. Gauge 2 may measure the plate against the base.
    """

    def __init__(
        self,
        line: "StatusLine",
        count: int = 1,
        simulated: bool = False,
        verified: str = "",
        *,
        gauge_2_on_base: bool = False,
    ) -> None:
        self._line = line
        self._count = count
        self._gauge_2_on_base = gauge_2_on_base
        self._simulated = simulated
        self._verified = f" ({verified})" if verified else ""
        self._state: StateChanged | None = None
        self._last_sentence = ""
        self._done = 0
        self._table_m = math.nan
        self._relative_m = math.nan

    def on_event(self, event: Event) -> None:
        match event:
            case messages.Connected(device, firmware, rate_hz):
                named = f"{device} {firmware}".strip()
                out.print_status(f"connected: {named}, {rate_hz:g} Hz{self._verified}")
            case messages.Reconnecting() | messages.Reconnected():
                out.print_status(str(event.message))
            case StateChanged():
                self._on_state(event)
            case RunEnded():
                self._on_run_ended(event)
        self._line.on_event(event)

    def on_rows(self, rows: RingRows) -> None:
        recent = rows.time_s >= rows.time_s[-1] - _SHOWN_S
        present = recent & np.isfinite(rows.table_m) & np.isfinite(rows.relative_m)
        if present.any():
            self._table_m = float(rows.table_m[present].mean())
            self._relative_m = float(rows.relative_m[present].mean())
        if self._state is not None and self._state.state in _WAITING:
            self._line.update(self._sentence(self._state))

    def _on_state(self, event: StateChanged) -> None:
        before, self._state = self._state, event
        if event.state in ("connecting", "idle") or (before is not None and _shown(event) == _shown(before)):
            return
        if event.state in ("recentre", "zero", "recording") and self._count > 1 and not self._last_sentence:
            out.print_status(f"run {self._done + 1} of {self._count}")
        sentence = self._sentence(event)
        if sentence != self._last_sentence:
            out.print_status(sentence)
        self._last_sentence = sentence

    def _on_run_ended(self, event: RunEnded) -> None:
        self._done += 1
        self._state, self._last_sentence = None, ""
        if event.path:
            more = f". {event.message}" if event.message else ""
            out.print_status(f"stored {event.path}: {event.samples} samples, ended: {event.ended}{more}")
        elif event.ended in ("stopped", "interrupted"):
            out.print_status("nothing was recorded: the table was not pulled back")

    def _sentence(self, event: StateChanged) -> str:
        note = str(event.note)
        on_base_m = self._table_m if self._gauge_2_on_base else 0.0
        guidance = guidance_for(
            PullbackSituation(
                state=event.state,
                position=event.position,
                table_m=self._table_m,
                plate_m=self._relative_m + on_base_m,
                simulated=self._simulated,
                note=note[:1].upper() + note[1:],
            )
        )
        detail = str(guidance.detail)
        if detail[1:2].islower():  # it goes on as one sentence
            detail = detail[0].lower() + detail[1:]
        return f"{guidance.instruction}: {detail}" if detail else str(guidance.instruction)


def _shown(event: StateChanged) -> tuple[object, ...]:
    """What a line is printed for: readings and zero are no news."""
    return event.state, event.note, event.position.early_release_m


_WAITING = ("recentre", "pulling", "held", "armed")


_EVERY_S = 2.0  # how often the line is written where it cannot be rewritten in place: into a file or a pipe
_REDRAWN_HZ = 8


class StatusLine:
    """Follows the events of a run; use it with `with`. On a terminal its line is redrawn in place."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(stderr=True)
        self._live = (
            Live(console=console, refresh_per_second=_REDRAWN_HZ, transient=True)
            if console.is_terminal
            else None
        )
        self._told_s = float("-inf")

    def on_event(self, event: Event) -> None:
        if not isinstance(event, LiveResult):
            return
        if event.message:
            out.print_status(str(event.message))
        elif text := result_text(event):
            self._show(text)

    def update(self, text: str) -> None:
        """Show a text in place, on a terminal; elsewhere it is left out."""
        if self._live is not None:
            self._live.update(text)

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def _show(self, text: str) -> None:
        if self._live is not None:
            self._live.update(text)
        elif time.perf_counter() - self._told_s > _EVERY_S:
            self._told_s = time.perf_counter()
            out.print_status(text)


def result_text(result: LiveResult) -> str:
    """Period, damping and friction so far; empty before anything is known."""
    values = (
        ("period_s", result.period),
        ("damping_n1_per_s", result.damping_n1),
        ("friction_dynamic", result.friction_dynamic),
        ("friction_dynamic_plate", result.friction_dynamic_plate),
    )
    text = "  ".join(_value_text(name, value) for name, value in values if value and is_known(value))
    return f"{text}  (waiting does not narrow f_d)" if result.may_stop and text else text


def _value_text(name: str, value: Quantity) -> str:
    row = definition(name)
    unit = row.unit_at(Place.TERMINAL, value.unit)
    shown = format_value(value.value * unit.scale, value.standard_uncertainty * unit.scale, unit.symbol)
    return f"{row.symbol.text} = {shown}"
