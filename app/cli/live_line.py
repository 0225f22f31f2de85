"""What is known of a run while it is recorded, in one line on stderr."""

import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from app.cli import output as out

if TYPE_CHECKING:
    from app.acquisition.messages import Event, LiveResult, LiveValue

_EVERY_S = 2.0
"""How often the line is written where it cannot be rewritten in place: into a file or a pipe."""
_REDRAWN_HZ = 8


class LiveLine:
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

    def hear(self, event: "Event") -> None:
        """Take one event of the engine."""
        from app.acquisition.messages import LiveResult

        if not isinstance(event, LiveResult):
            return
        if event.message:
            out.tell(event.message)
        elif text := describe(event):
            self._show(text)

    def redraw(self, text: str) -> None:
        """Show a text in place, on a terminal; elsewhere it is left out."""
        if self._live is not None:
            self._live.update(text)

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def _show(self, text: str) -> None:
        if self._live is not None:
            self._live.update(text)
        elif time.monotonic() - self._told_s > _EVERY_S:
            self._told_s = time.monotonic()
            out.tell(text)


def describe(result: "LiveResult") -> str:
    """Period, damping and friction so far; empty before anything is known."""
    parts = [
        _part("T", result.period, 1e3, "ms"),
        _part("n1", result.damping_n1, 1.0, "1/s"),
        _part("f_d", result.friction_dynamic, 1.0, ""),
    ]
    text = "  ".join(part for part in parts if part)
    return f"{text}  (waiting does not narrow f_d)" if result.may_stop and text else text


def _part(symbol: str, value: "LiveValue | None", scale: float, unit: str) -> str:
    if value is None or not value.is_known:
        return ""
    shown = out.rounded(value.value * scale, value.standard_uncertainty * scale)
    return f"{symbol} = {shown} {unit}".rstrip()
