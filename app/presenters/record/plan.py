"""The series plan: what is to be measured, what of it is done, and which series comes next."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from app.runs.next_tests import REPEATS_MAX, PlannedSeries
from messages.i18n import gettext

USUAL_REPEATS = 3
_MOST_DOTS = 6
_ENTRY = re.compile(r"([0-9A-Z*?]+)(?:\s*[X×]\s*(\d+))?")

Plan = tuple[PlannedSeries, ...]


@dataclass(frozen=True, slots=True)
class SeriesProgress:
    """How many runs of a series there are, of how many."""

    series: str
    done: int
    planned: int

    @property
    def is_full(self) -> bool:
        """Tell whether nothing is missing."""
        return self.done >= self.planned

    @property
    def dots(self) -> str:
        """`●●○`; figures where there are too many to be counted at a glance."""
        if self.planned > _MOST_DOTS:
            return f"{self.done}/{self.planned}"
        done = min(self.done, self.planned)
        return "●" * done + "○" * (self.planned - done)

    @property
    def description(self) -> str:
        """For who points at it, or listens."""
        return gettext(
            "{series}: {done} of {planned} runs are there",
            series=self.series,
            done=self.done,
            planned=self.planned,
        )


def parse_plan(text: str, all_series: Sequence[str]) -> Plan:
    """Read a plan such as `1FF* x3, 2SSM0 x5`, in the order written; nothing is no plan.

    `*` and `?` stand for any part of a series code; a series without a number is repeated three times.

    Raises
    ------
    ValueError
        In words: what is wrong with which part.
    """
    planned: dict[str, PlannedSeries] = {}
    for part in filter(None, (part.strip().upper() for part in re.split(r"[,;\n]", text))):
        found = _ENTRY.fullmatch(part)
        if found is None:
            raise ValueError(
                gettext(
                    "{part!r} is no part of a plan: write series and repeats, for example 1FFM0 x3", part=part
                )
            )
        pattern, repeats = found[1], int(found[2] or USUAL_REPEATS)
        if not 1 <= repeats <= REPEATS_MAX:
            raise ValueError(
                gettext("{part!r}: repeat a series 1 to {most} times", part=part, most=REPEATS_MAX)
            )
        for series in _matching(pattern, all_series):
            if series in planned and "*" not in pattern and "?" not in pattern:
                raise ValueError(
                    gettext("{series} is planned twice: give it one number of repeats", series=series)
                )
            planned.setdefault(series, PlannedSeries(series, repeats))
    return tuple(planned.values())


def plan_text(plan: Plan) -> str:
    """Write a plan as `parse_plan` reads it."""
    return ", ".join(f"{one.series} x{one.repeats}" for one in plan)


def progress_of(plan: Plan, done: Mapping[str, int]) -> tuple[SeriesProgress, ...]:
    """Hold a plan against the runs that there are, by series."""
    return tuple(SeriesProgress(one.series, done.get(one.series, 0), one.repeats) for one in plan)


def next_series(progress: Sequence[SeriesProgress], current: str) -> str:
    """The series to go on with: the current one unless it is full, else the next that is not."""
    names = [one.series for one in progress]
    start = names.index(current) if current in names else 0
    in_turn = [*progress[start:], *progress[:start]]
    return next((one.series for one in in_turn if not one.is_full), current)


def run_text(progress: Sequence[SeriesProgress], series: str, done: int) -> str:
    """Say which run of a series the next one is: `1FFM0 run 2 of 3`."""
    planned = next((one.planned for one in progress if one.series == series), None)
    if planned is None:
        return gettext("{series} run {number}", series=series, number=done + 1)
    if done >= planned:
        return gettext("{series} full: {done} of {planned}", series=series, done=done, planned=planned)
    return gettext("{series} run {number} of {planned}", series=series, number=done + 1, planned=planned)


def _matching(pattern: str, all_series: Sequence[str]) -> list[str]:
    found = [series for series in all_series if fnmatchcase(series, pattern)]
    if not found:
        raise ValueError(
            gettext(
                "{pattern} is no series of this stand: write one like {example}, or 1FF*",
                pattern=pattern,
                example=all_series[0],
            )
        )
    return found
