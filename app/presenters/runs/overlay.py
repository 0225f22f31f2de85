"""Runs drawn over one another from their releases, read in the worker's process."""

from typing import TYPE_CHECKING

from app.presenters.runs.state import Overlay, Trace
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.runs.decimation import DecimatedRun

MAX_OVERLAID_RUNS = 8
"""More curves over one another can not be told apart."""
_DRAWN_SPANS = 1500
_BEFORE_RELEASE_S = 1.0


def load_overlay(paths: tuple[str, ...]) -> Overlay:
    """Read runs, condensed for drawing; what cannot be read is said instead."""
    from app.runs.decimation import open_decimated
    from app.runs.errors import RunError
    from app.runs.validator import shared_validator

    drawn, words = [], []
    for path in paths[:MAX_OVERLAID_RUNS]:
        try:
            drawn.append(
                open_decimated(
                    path, _DRAWN_SPANS, before_release_s=_BEFORE_RELEASE_S, validator=shared_validator()
                )
            )
        except RunError as error:
            words.append(str(error))
    if len(paths) > MAX_OVERLAID_RUNS:
        words.append(
            gettext(
                "The first {shown} of {all} selected runs are drawn", shown=MAX_OVERLAID_RUNS, all=len(paths)
            )
        )
    units = {overview.unit for overview in drawn}
    unit = units.pop() if len(units) == 1 else gettext("mixed units")
    aligned = all(overview.release_s is not None for overview in drawn)
    return Overlay(
        traces=tuple(_trace(overview) for overview in drawn),
        time_label=gettext("time from release, s") if aligned else gettext("time, s"),
        unit="mm" if unit == "m" else unit,
        message=". ".join(words),
    )


def _trace(overview: "DecimatedRun") -> Trace:
    scale = 1e3 if overview.unit == "m" else 1.0
    table, *others = (scale * readings for readings in overview.readings)
    time_s = overview.time_s - (overview.release_s or 0.0)
    return Trace(overview.path.stem, time_s, table, others[0] if others else None)
