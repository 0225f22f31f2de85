"""Next runs of the Record screen: series plan, chosen series, form of operator and conditions."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from analysis.formatting import with_unit
from app.acquisition.messages import RunSettings
from app.presenters.base import Chip, Tone
from app.presenters.conditions import CONDITION_FIELDS, parse_conditions
from app.presenters.record.state import LoadedPlan, PlanState, RunChoices, RunForm, SavePlan, SeriesProgress
from app.presenters.results import sentence
from app.runs.errors import ConditionError, MetadataError
from app.runs.next_tests import REPEATS_MAX, NextTests, PlannedSeries
from messages.i18n import N_, gettext
from messages.message import MessageError, message

REPEATS_DEFAULT = 3  # repeats of a planned series without a number: the fewest that show an outlier
_PLAN_PART = re.compile(r"([0-9A-Z*?]+)(?:\s*[X×]\s*(\d+))?")
_CONDITION_NAMES = {
    "temperature_c": message("temperature in °C"),
    "humidity_percent": message("humidity in %"),
    "plate_id": message("plate"),
    "contact_id": message("contact"),
    "surface_preparation": message("surfaces"),
    "run_in_number": message("run-in number"),
}

Plan = tuple[PlannedSeries, ...]
CompletedRuns = tuple[tuple[str, str], ...]
"""Path and series of each completed run."""


@dataclass(frozen=True, slots=True)
class NextRuns:
    choices: RunChoices
    plan: PlanState = field(default_factory=PlanState)
    tests: NextTests = field(default_factory=NextTests)
    """Plan, series, operator and conditions, as they are stored in the folder of runs."""
    saved: NextTests = field(default_factory=NextTests)
    is_requested: bool = False
    is_loaded: bool = False
    """The stored plan was requested; was read."""
    plans_before: tuple[Plan, ...] = ()
    """Plans that undo brings back, the last one at the end."""
    is_edited: bool = False  # the operator has changed form or plan before the stored ones were read
    completed: CompletedRuns = ()
    undecided_path: str = ""
    """Run that waits for a decision, and does not count until then; empty without one."""
    suggested_operator: str = ""
    counts_simulated: bool = False
    """Whether simulated runs are among the completed ones."""

    @classmethod
    def of_series(cls, all_series: tuple[str, ...]) -> "NextRuns":
        return cls(RunChoices(series=all_series[0], all_series=all_series))

    @property
    def series(self) -> str:
        return self.choices.series

    @property
    def can_choose_series(self) -> bool:
        return self.choices.editable and not self.choices.series_fixed

    def with_choices(self, **changes: Any) -> "NextRuns":
        choices = replace(self.choices, **changes)
        return replace(self, choices=replace(choices, summary=form_summary(choices.form)))

    def with_all_series(self, all_series: tuple[str, ...]) -> "NextRuns":
        """Offer other series; the chosen one stays while it is among them. The plan stays as it is."""
        series = self.series if self.series in all_series else all_series[0]
        return self.with_choices(all_series=all_series, series=series)

    def with_form(self, form: RunForm) -> "NextRuns":
        """Take an edited form; its error is in `choices.form_error`."""
        return replace(self, is_edited=True).with_choices(form=form, form_error=_form_error(form))

    def with_fixed_series(self, series: str, hint: str) -> "NextRuns":
        """Allow one series only, for the reason in `hint`; an empty hint allows all."""
        return self.with_choices(series=series or self.series, series_fixed=bool(hint), series_hint=hint)

    def with_suggested_operator(self, name: str) -> "NextRuns":
        """Fill in an operator, unless somebody else was typed."""
        changed = replace(self, suggested_operator=name)
        if self.choices.form.operator not in ("", self.suggested_operator):
            return changed
        return changed.with_choices(form=replace(self.choices.form, operator=name))

    def after_recording(self) -> "NextRuns":
        """Clear the note, which was of one run, and count the run-in number up."""
        form = self.choices.form
        number = form.run_in_number
        number = str(int(number) + 1) if number.strip().isdecimal() else number
        return self.with_choices(form=replace(form, note="", run_in_number=number))

    def with_plan(self, text: str) -> "NextRuns":
        """Take an edited plan; text that is no plan is in `plan.text`, the reason in `plan.error`."""
        try:
            plan = parse_plan(text, self.choices.all_series)
        except PlanError as error:
            return replace(self, plan=replace(self.plan, text=text, error=sentence(error.message)))
        before = self.plans_before if plan == self.tests.plan else (*self.plans_before, self.tests.plan)
        return self._with_plan(plan, before)

    def with_plan_undone(self) -> "NextRuns":
        """Take back the last change of the plan."""
        if not self.plans_before:
            return self
        return self._with_plan(self.plans_before[-1], self.plans_before[:-1])

    def with_loaded_plan(self, loaded: LoadedPlan) -> "NextRuns":
        """Take what is stored in the folder; what was edited before stays."""
        changed = replace(self, is_loaded=True, saved=loaded.tests)
        undecided = tuple(dict.fromkeys((*loaded.tests.undecided, *self.tests.undecided)))
        if not self.is_edited:
            stored = loaded.tests
            is_possible = stored.series in self.choices.all_series and not self.choices.series_fixed
            series = stored.series if is_possible else self.series
            texts = {name: _text(getattr(stored.conditions, name)) for name in CONDITION_FIELDS}
            operator = stored.operator or self.choices.form.operator
            form = replace(self.choices.form, **texts, operator=operator)
            changed = replace(changed, tests=stored).with_choices(series=series, form=form)
        changed = replace(changed, tests=changed.tests.replace(undecided=undecided))
        return changed.with_completed(loaded.completed).with_next_series()

    def with_completed(self, completed: CompletedRuns) -> "NextRuns":
        return replace(self, completed=completed)._counted()

    def with_run(self, path: str, series: str = "") -> "NextRuns":
        """Count a run that is being kept, or with no series not one that is being moved to the trash."""
        others = tuple(run for run in self.completed if run[0] != path)
        return self.with_completed((*others, (path, series)) if series else others)

    def with_undecided(self, path: str) -> "NextRuns":
        """Do not count the run at `path` until it is decided about."""
        names = dict.fromkeys((*self.tests.undecided, Path(path).name))
        tests = self.tests.replace(undecided=tuple(names))
        return replace(self, undecided_path=path, tests=tests)._counted()

    def with_decision(self) -> "NextRuns":
        """The run that waited for a decision, if there is one, has been decided about."""
        decided = Path(self.undecided_path).name
        tests = self.tests.replace(undecided=tuple(one for one in self.tests.undecided if one != decided))
        return replace(self, undecided_path="", tests=tests)._counted()

    def with_next_series(self) -> "NextRuns":
        """Choose the next series of the plan if the current one is complete."""
        if not (self.plan.progress and self.can_choose_series):
            return self
        return self.with_choices(series=next_series(self.plan.progress, self.series))

    def run_text(self, series: str) -> str:
        return run_text(self.plan.progress, series, self._counts()[series])

    def to_save(self, folder: str) -> tuple["NextRuns", SavePlan | None]:
        """Prepare storing the choices; nothing is stored unless the stored plan could be read."""
        if not self.is_loaded or self.choices.form_error:
            return self, None
        form = self.choices.form
        conditions = parse_conditions(asdict(form), self.tests.conditions.other)
        operator = form.operator.strip()
        tests = self.tests.replace(series=self.series, operator=operator, conditions=conditions)
        if tests == self.saved:
            return replace(self, tests=tests), None
        return replace(self, tests=tests, saved=tests), SavePlan(folder, tests)

    def run_settings(self, directory: Path) -> RunSettings:
        """Settings of the next run. Raises MetadataError for conditions that cannot be."""
        form = self.choices.form
        return RunSettings(
            directory=str(directory),
            series=self.series,
            operator=form.operator.strip(),
            note=form.note.strip(),
            conditions=parse_conditions(asdict(form), self.tests.conditions.other),
        )

    @property
    def run_count(self) -> int:
        return _parse_count(self.choices.form)

    def why_not_armed(self, series: str) -> Chip:
        """Reason not to arm a run that was asked for while `series` was shown; empty without one."""
        if self.choices.form_error:
            return Chip(self.choices.form_error, Tone.BAD)
        if self.series == series:
            return Chip("")
        text = gettext("{series} is full: arm again for {next}", series=series, next=self.series)
        return Chip(text, Tone.WARN)

    def _with_plan(self, plan: Plan, before: tuple[Plan, ...]) -> "NextRuns":
        tests = self.tests.replace(plan=plan)
        changed = replace(self, is_edited=True, tests=tests, plans_before=before)
        return changed._counted().with_next_series()

    def _counts(self) -> Counter[str]:
        return Counter(series for path, series in self.completed if path != self.undecided_path)

    def _counted(self) -> "NextRuns":
        plan = self.tests.plan
        shown = PlanState(
            plan_progress(plan, self._counts()),
            format_plan(plan),
            can_undo=bool(self.plans_before),
            counts_simulated=self.counts_simulated,
        )
        return replace(self, plan=shown)


class PlanError(MessageError, ValueError):
    """A text is no series plan."""


def parse_plan(text: str, all_series: Sequence[str]) -> Plan:
    """Parse a plan such as `1FF* x3, 2SSM0 x5`; empty text is an empty plan. Raises PlanError.

    `*` and `?` match any part of a series code. A series without a number is repeated `REPEATS_DEFAULT`
    times.
    """
    planned: dict[str, PlannedSeries] = {}
    for part in filter(None, (part.strip().upper() for part in re.split(r"[,;\n]", text))):
        found = _PLAN_PART.fullmatch(part)
        if found is None:
            raise PlanError(
                "{part!r} is no part of a plan: write series and repeats, for example 1FFM0 x3", part=part
            )
        pattern, repeats = found[1], int(found[2] or REPEATS_DEFAULT)
        if not 1 <= repeats <= REPEATS_MAX:
            raise PlanError("{part!r}: repeat a series 1 to {most} times", part=part, most=REPEATS_MAX)
        matching = [series for series in all_series if fnmatchcase(series, pattern)]
        if not matching:
            template = N_("{pattern} is no series of this stand: write one like {example}, or 1FF*")
            raise PlanError(template, pattern=pattern, example=all_series[0])
        for series in matching:
            if series in planned and "*" not in pattern and "?" not in pattern:
                raise PlanError("{series} is planned twice: give it one number of repeats", series=series)
            planned.setdefault(series, PlannedSeries(series, repeats))
    return tuple(planned.values())


def format_plan(plan: Plan) -> str:
    return ", ".join(f"{one.series} x{one.repeats}" for one in plan)


def plan_with_repeats(progress: Sequence[SeriesProgress], row: int, repeats: str) -> str:
    """Text of a plan with other repeats of a series, as typed."""
    parts = _parts(progress)
    parts[row] = f"{progress[row].series} x{repeats.strip()}"
    return _joined(parts)


def plan_with_added(progress: Sequence[SeriesProgress], text: str) -> str:
    """Text of a plan with the series of `text`, as typed, behind the others."""
    return _joined([*_parts(progress), text.strip()])


def plan_with_moved(progress: Sequence[SeriesProgress], row: int, by: int) -> str:
    """Text of a plan with a series moved by some rows."""
    parts = _parts(progress)
    parts.insert(row + by, parts.pop(row))
    return _joined(parts)


def plan_without(progress: Sequence[SeriesProgress], rows: Collection[int]) -> str:
    """Text of a plan without the series of some rows."""
    return _joined([part for row, part in enumerate(_parts(progress)) if row not in rows])


def _parts(progress: Sequence[SeriesProgress]) -> list[str]:
    return [f"{one.series} x{one.planned}" for one in progress]


def _joined(parts: Sequence[str]) -> str:
    return ", ".join(filter(None, parts))


def plan_progress(plan: Plan, completed: Mapping[str, int]) -> tuple[SeriesProgress, ...]:
    return tuple(SeriesProgress(one.series, completed.get(one.series, 0), one.repeats) for one in plan)


def next_series(progress: Sequence[SeriesProgress], current: str) -> str:
    """Choose the current series unless it is complete, else the next that is not."""
    names = [one.series for one in progress]
    start = names.index(current) if current in names else 0
    in_turn = [*progress[start:], *progress[:start]]
    return next((one.series for one in in_turn if not one.is_full), current)


def run_text(progress: Sequence[SeriesProgress], series: str, done: int) -> str:
    planned = next((one.planned for one in progress if one.series == series), None)
    if planned is None:
        return gettext("{series} run {number}", series=series, number=done + 1)
    if done >= planned:
        return gettext("{series} full: {done} of {planned}", series=series, done=done, planned=planned)
    return gettext("{series} run {number} of {planned}", series=series, number=done + 1, planned=planned)


def form_summary(form: RunForm) -> str:
    count = form.count.strip()
    parts = (
        form.operator.strip(),
        _labelled("", form.temperature_c, "°C"),
        _labelled("", form.humidity_percent, "%"),
        _labelled(gettext("plate "), form.plate_id),
        _labelled(gettext("contact "), form.contact_id),
        form.surface_preparation.strip(),
        _labelled(gettext("run-in "), form.run_in_number),
        "" if count in ("", "1") else gettext("{count} runs in a row", count=count),
        _labelled(gettext("note: "), form.note),
    )
    return " · ".join(filter(None, parts))


def _labelled(name: str, text: str, unit: str = "") -> str:
    return name + with_unit(text.strip(), unit) if text.strip() else ""


def _form_error(form: RunForm) -> str:
    """What is wrong with a form, as a sentence; empty if nothing is."""
    try:
        parse_conditions(asdict(form), {})
        _parse_count(form)
    except ConditionError as error:
        return sentence(
            message("{label} = {reason}", label=_CONDITION_NAMES[error.name], reason=error.reason)
        )
    except MetadataError as error:
        return sentence(error.message)
    return ""


def _parse_count(form: RunForm) -> int:
    text = form.count.strip() or "1"
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= REPEATS_MAX):
        raise MetadataError(
            "runs in a row = {text!r} is no whole number from 1 to {most}", text=text, most=REPEATS_MAX
        )
    return int(text)


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)
