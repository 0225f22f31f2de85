"""Rows of the table of runs: filtered, sorted and formatted."""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from analysis.catalogue import definition
from analysis.quantities import Quantity
from app.presenters import number_text
from app.presenters.base import Tone
from app.presenters.results import ResultRow, sentence
from app.presenters.results import make_row as result_row
from app.presenters.runs.state import Column, MetadataForm, RunFilter, RunRow, StatusFilter
from app.runs.metadata import RunSource
from app.runs.run_filter import RunFilter as ListingFilter
from app.runs.summary import RunSummary
from messages.i18n import N_, gettext
from messages.message import Message

_SOURCES = {
    RunSource.REAL: N_("real"),
    RunSource.SIMULATED: N_("simulated"),
    RunSource.IMPORTED: N_("imported"),
}
_USUAL_NAME = re.compile(r"\d{8}T\d{6}_(?:(?P<series>.+)_)?(?P<number>\d{3,})")
_END_REASONS = {
    "rest": N_("at rest"),
    "enough": N_("enough"),
    "duration": N_("duration"),
    "stopped": N_("stopped"),
    "device-lost": N_("device lost"),
    "stalled": N_("stalled"),
    "trigger-timeout": N_("no release"),
    "disk-full": N_("disk full"),
    "write-error": N_("write error"),
    "interrupted": N_("interrupted"),
}


class RunList:
    """Runs of a folder by path. The row of a run is formatted again only when the run has changed."""

    def __init__(self) -> None:
        self._by_path: dict[str, RunSummary] = {}
        self._rows: dict[str, tuple[RunSummary, RunRow]] = {}

    def set_runs(self, runs: Sequence[RunSummary]) -> None:
        self._by_path = {run.path: run for run in runs}

    def rows(self, run_filter: RunFilter, by: Column, *, descending: bool) -> tuple[RunRow, ...]:
        kept = select_runs(self._by_path.values(), run_filter, by, descending=descending)
        return tuple(self._row(run) for run in kept)

    def paths(self) -> tuple[str, ...]:
        return tuple(self._by_path)

    def metadata(self, paths: Sequence[str]) -> MetadataForm | None:
        return metadata_form([self._by_path[path] for path in paths])

    def readable(self, paths: Sequence[str]) -> tuple[str, ...]:
        return tuple(path for path in paths if not self._by_path[path].fault)

    def fault(self, path: str) -> Message:
        return self._by_path[path].fault

    def _row(self, run: RunSummary) -> RunRow:
        known = self._rows.get(run.path)
        if known is None or known[0] != run:
            known = run, make_row(run)
            self._rows[run.path] = known
        return known[1]


def select_runs(
    runs: Iterable[RunSummary], run_filter: RunFilter, by: Column, *, descending: bool
) -> list[RunSummary]:
    """Runs that match, sorted; those without a value in the column come last in both orders."""
    condition = ListingFilter(series=run_filter.series or None, text=run_filter.text.strip() or None)
    kept = [run for run in runs if condition.matches(run) and _STATUS_CONDITIONS[run_filter.status](run)]
    keyed = [(_SORT_KEYS[by](run), run) for run in kept]
    valued = [pair for pair in keyed if pair[0] is not None]
    valued.sort(key=lambda pair: pair[0], reverse=descending)
    return [run for _, run in valued] + [run for key, run in keyed if key is None]


def make_row(run: RunSummary) -> RunRow:
    if run.fault:
        known = {Column.NAME: Path(run.path).name, Column.VERDICT: "■ " + gettext("unreadable")}
        return RunRow(run.path, _cells(known), tone=Tone.BAD, hint=sentence(run.fault))
    verdict, tone, hint = _verdict(run)
    if run.excluded:
        verdict = gettext("{verdict}, left out", verdict=verdict)
        said = gettext("It does not count on Campaign: {reason}", reason=run.excluded)
        hint = f"{hint}\n{said}".strip()
    start = run.start_time.astimezone() if run.start_time else None
    results, temperature_c = _results(run), run.conditions.temperature_c
    known = {
        **{column: row.value for column, row in results.items()},
        Column.NAME: _short_name(run),
        Column.FILE: Path(run.path).stem,
        Column.DATE: f"{start:%Y-%m-%d %H:%M}" if start else "",
        Column.SERIES: run.series or "–",
        Column.VERDICT: verdict,
        Column.SOURCE: gettext(_SOURCES[run.source]) if run.source else "",
        Column.TEMPERATURE: "" if temperature_c is None else number_text.format_fixed(temperature_c, 1),
        Column.DURATION: number_text.format_fixed(run.duration_s, 1),
        Column.ENDED: gettext(_END_REASONS.get(run.ended, run.ended))
        or (gettext("imported") if run.source is RunSource.IMPORTED else gettext("not closed")),
        Column.OPERATOR: run.operator,
        Column.NOTE: run.note,
    }
    if (friction := results.get(Column.FRICTION)) is not None:
        known[Column.FRICTION] = f"{friction.value} {friction.uncertainty_text}".strip()
    return RunRow(run.path, _cells(known), results, tone, hint)


def metadata_form(runs: list[RunSummary]) -> MetadataForm | None:
    """Editable metadata of runs; None if none of them can be read."""
    readable = [run for run in runs if not run.fault]
    if not readable:
        return None
    texts = [
        {
            "series": run.series or "",
            "plate_mass_kg": "" if run.plate_mass_kg is None else f"{run.plate_mass_kg:g}",
            "operator": run.operator,
            "note": run.note,
        }
        for run in readable
    ]
    mixed = frozenset(name for name in texts[0] if len({text[name] for text in texts}) > 1)
    return MetadataForm(texts[0] | dict.fromkeys(mixed, ""), mixed)


def _cells(known: dict[Column, str]) -> tuple[str, ...]:
    return tuple(known.get(column, "") for column in Column)


def _verdict(run: RunSummary) -> tuple[str, Tone, str]:
    if not run.analyses:
        hint = gettext("Select it and press R to identify it and keep the result.")
        return gettext("not analysed"), Tone.PLAIN, hint
    if run.stale:
        hint = gettext("Calibration, masses or pullback were changed since: press R to identify it anew.")
        return "▲ " + gettext("stale"), Tone.WARN, hint
    if run.adequate is None:
        return "▲ " + gettext("no motion to fit"), Tone.WARN, ""
    if run.adequate:
        return "✓ " + gettext("fits"), Tone.OK, ""
    if run.friction_holds:
        return "▲ " + gettext("does not fit, f_d holds"), Tone.WARN, ""
    return "■ " + gettext("does not fit"), Tone.BAD, ""


def _results(run: RunSummary) -> dict[Column, ResultRow]:
    """Quantities of the newest saved analysis."""
    stored = {
        Column.FRICTION: ("friction_dynamic", run.friction_dynamic, run.friction_dynamic_uncertainty),
        Column.PERIOD: ("period_s", run.period_s, run.period_uncertainty_s),
        Column.DAMPING: ("damping_n1_per_s", run.damping_n1_per_s, run.damping_n1_uncertainty_per_s),
    }
    rows = {column: (definition(name), value, spread) for column, (name, value, spread) in stored.items()}
    return {
        column: result_row(row, Quantity.normal(value, spread or 0.0, row.unit))
        for column, (row, value, spread) in rows.items()
        if value is not None
    }


def _short_name(run: RunSummary) -> str:
    """Number of a run whose file is named by time and series, which stand beside it; else the file's name."""
    stem = Path(run.path).stem
    named = _USUAL_NAME.fullmatch(stem)
    return named["number"] if named and (named["series"] or "") == (run.series or "") else stem


_STATUS_CONDITIONS: dict[StatusFilter, Callable[[RunSummary], bool]] = {
    StatusFilter.ALL: lambda _: True,
    StatusFilter.STALE: lambda run: run.stale,
    StatusFilter.NOT_ANALYSED: lambda run: not run.fault and not run.analyses,
    StatusFilter.NOT_FITTING: lambda run: run.adequate is False,
    StatusFilter.FAULTY: lambda run: bool(run.fault),
}


_SORT_KEYS: dict[Column, Callable[[RunSummary], Any]] = {
    Column.NAME: lambda run: (_short_name(run).casefold(), Path(run.path).name.casefold()),
    Column.FILE: lambda run: Path(run.path).name.casefold(),
    Column.DATE: lambda run: run.start_time,
    Column.SERIES: lambda run: run.series or None,
    Column.FRICTION: lambda run: run.friction_dynamic,
    Column.PERIOD: lambda run: run.period_s,
    Column.DAMPING: lambda run: run.damping_n1_per_s,
    Column.SOURCE: lambda run: run.source and gettext(_SOURCES[run.source]),
    Column.TEMPERATURE: lambda run: run.conditions.temperature_c,
    Column.VERDICT: lambda run: None if run.fault else _verdict(run)[0],
    Column.DURATION: lambda run: None if run.fault else run.duration_s,
    Column.ENDED: lambda run: run.ended or None,
    Column.OPERATOR: lambda run: run.operator.casefold() or None,
    Column.NOTE: lambda run: run.note.casefold() or None,
}
