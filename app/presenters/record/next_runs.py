"""What the next tests are: series by the plan, conditions and operator, kept between starts; how many."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.acquisition.messages import RunSettings
from app.presenters import number_text
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.conditions import CONDITION_FIELDS, parse_conditions
from app.presenters.record.plan import next_series, parse_plan, plan_text, progress_of, run_text
from app.presenters.record.state import PlanState, RunChoices, RunForm
from app.presenters.record.tasks import LoadedPlan, LoadPlan, SavePlan, Submit
from app.presenters.results import sentence
from app.runs.errors import MetadataError
from app.runs.next_tests import REPEATS_MAX, NextTests
from messages.i18n import gettext

_CONDITION_NAMES = {
    "temperature_c": "temperature in °C",
    "humidity_percent": "humidity in %",
    "plate_id": "plate",
    "contact_id": "contact",
    "surface_preparation": "surfaces",
    "run_in_number": "run-in number",
}


class NextRuns:
    """Holds what was chosen and planned, and counts what is done.

    Parameters
    ----------
    all_series : tuple of str
        Series codes of the stand.
    directory : Path
        Where runs go.
    submit : callable
        Has a task done in another process.
    show : callable
        Takes choices and plan whenever they have changed.
    """

    def __init__(
        self,
        all_series: tuple[str, ...],
        directory: Path,
        submit: Submit,
        show: Callable[[RunChoices, PlanState], None],
    ) -> None:
        self.choices = RunChoices(series=all_series[0], all_series=all_series)
        self.plan = PlanState()
        self._directory = directory
        self._submit = submit
        self._show = show
        self._tests = self._saved = NextTests()
        self._asked = self._known = self._touched = False
        self._done: tuple[tuple[str, str], ...] = ()
        self._counts: Counter[str] = Counter()
        self._undecided = ""
        self._suggested = ""

    # --- what the operator does ---

    def choose_series(self, code: str) -> None:
        """Series of the next run."""
        if self.choices.editable and not self.choices.series_fixed:
            self._update_choices(series=code)
            self._save()

    def set_form(self, form: RunForm) -> None:
        """Take what was filled in; what cannot be is said, and kept from being recorded."""
        if not self.choices.editable:
            return
        self._touched = True
        self._update_choices(form=form, form_error=_fault(form))
        if not self.choices.form_error:
            self._save()

    def set_plan(self, text: str) -> bool:
        """Plan anew; False, with words in `plan`, where the text is no plan."""
        try:
            plan = parse_plan(text, self.choices.all_series)
        except ValueError as error:
            self._take_plan(replace(self.plan, text=text, error=sentence(str(error))))
            return False
        self._touched = True
        self._tests = self._tests.replace(plan=plan)
        self._count()
        self.select_next_series()
        self._save()
        return True

    # --- what happens elsewhere ---

    def load_plan(self) -> None:
        """Ask what was planned here and what is there, once."""
        if not self._asked:
            self._asked = True
            self._submit(LoadPlan(str(self._directory)))

    def on_plan_loaded(self, found: LoadedPlan) -> None:
        """Take what was kept; what was typed meanwhile stays."""
        self._known = True
        tests = self._saved = found.tests
        if not self._touched:
            self._tests = tests
            series = tests.series if tests.series in self.choices.all_series else self.choices.series
            if self.choices.series_fixed:
                series = self.choices.series
            self._update_choices(series=series, form=_form_of(tests, self.choices.form))
        self.count_done(found.done)
        self.select_next_series()
        self._save()

    def count_done(self, done: tuple[tuple[str, str], ...]) -> None:
        """These runs, path and series each, count as done."""
        self._done = done
        self._count()

    def count_kept(self, path: str, series: str) -> None:
        """A run is being kept, so it counts before it is seen in the folder."""
        self.count_done((*(one for one in self._done if one[0] != path), (path, series)))

    def count_removed(self, path: str) -> None:
        """A run is being moved to the trash, so it no longer counts."""
        self.count_done(tuple(one for one in self._done if one[0] != path))

    def select_next_series(self) -> None:
        """Go on to the next series of the plan if this one is full."""
        if self.plan.progress and self.choices.editable and not self.choices.series_fixed:
            self._update_choices(series=next_series(self.plan.progress, self.choices.series))

    def fix_series(self, series: str, hint: str) -> None:
        """Only this series can be recorded; an empty hint lets go of it."""
        self._update_choices(series=series or self.choices.series, series_fixed=bool(hint), series_hint=hint)

    def set_editable(self, editable: bool) -> None:
        """Nothing of a run that is being recorded can be chosen otherwise."""
        self._update_choices(editable=editable)

    def set_undecided(self, path: str) -> None:
        """The run at `path` is not decided about yet, so it does not count; none if empty."""
        self._undecided = path
        self._count()

    def next_run(self) -> None:
        """A run was recorded: its note was its own, and the surfaces have been run in once more."""
        form = replace(self.choices.form, note="", run_in_number=_one_more(self.choices.form.run_in_number))
        self._update_choices(form=form)
        self._save()

    def suggest_operator(self, name: str) -> None:
        """Who records, as long as nobody has said otherwise."""
        if self.choices.form.operator in ("", self._suggested):
            self._update_choices(form=replace(self.choices.form, operator=name))
        self._suggested = name

    # --- what is known ---

    def run_text(self, series: str) -> str:
        """Which run of a series comes next, or is waited for."""
        return run_text(self.plan.progress, series, self._counts[series])

    def form_chip(self) -> Chip:
        """What is wrong with what was filled in; empty if nothing is."""
        return Chip(self.choices.form_error, Tone.BAD)

    def moved_on_from(self, series: str) -> Chip:
        """Say that the series is full and another one comes next; empty if it is still this one."""
        now = self.choices.series
        return (
            EMPTY_CHIP
            if now == series
            else Chip(gettext("{series} is full: arm again for {next}", series=series, next=now), Tone.WARN)
        )

    def settings(self, count: int | None = None) -> tuple[RunSettings, int]:
        """The next run, and how many of it. Raises MetadataError, ValueError for what cannot be."""
        choices, form = self.choices, self.choices.form
        run = RunSettings(
            directory=str(self._directory),
            series=choices.series,
            operator=form.operator.strip(),
            note=form.note.strip(),
            conditions=parse_conditions(form, self._tests.conditions.other),
        )
        return run, count or _count_of(form)

    # --- inside ---

    def _count(self) -> None:
        self._counts = Counter(series for path, series in self._done if path != self._undecided)
        plan = self._tests.plan
        self._take_plan(PlanState(progress_of(plan, self._counts), plan_text(plan)))

    def _save(self) -> None:
        """Save what is known now, unless what was kept before could not be read."""
        if not self._known or self.choices.form_error:
            return
        run, _ = self.settings()
        self._tests = self._tests.replace(
            series=self.choices.series, operator=run.operator, conditions=run.conditions
        )
        if self._tests != self._saved:
            self._saved = self._tests
            self._submit(SavePlan(str(self._directory), self._tests))

    def _take_plan(self, plan: PlanState) -> None:
        if plan != self.plan:
            self.plan = plan
            self._show(self.choices, self.plan)

    def _update_choices(self, **changes: object) -> None:
        choices = replace(self.choices, **changes)  # type: ignore[arg-type]
        choices = replace(choices, summary=summary_of(choices.form))
        if choices != self.choices:
            self.choices = choices
            self._show(self.choices, self.plan)


def summary_of(form: RunForm) -> str:
    """The form in a line, as far as it is filled in."""
    parts = (
        form.operator.strip(),
        _with("", form.temperature_c, "°C"),
        _with("", form.humidity_percent, "%"),
        _with(gettext("plate "), form.plate_id),
        _with(gettext("contact "), form.contact_id),
        form.surface_preparation.strip(),
        _with(gettext("run-in "), form.run_in_number),
        "" if form.count.strip() in ("", "1") else gettext("{count} runs in a row", count=form.count.strip()),
        _with(gettext("note: "), form.note),
    )
    return " · ".join(filter(None, parts))


def _with(name: str, text: str, unit: str = "") -> str:
    return name + number_text.with_unit(text.strip(), unit) if text.strip() else ""


def _fault(form: RunForm) -> str:
    """What is wrong with a form, in words; empty if nothing is."""
    try:
        parse_conditions(form, {})
        _count_of(form)
    except ValueError as error:
        words = str(error)
        for name, title in _CONDITION_NAMES.items():
            words = words.replace(f"condition {name}", title)
        return sentence(words)
    return ""


def _count_of(form: RunForm) -> int:
    text = form.count.strip() or "1"
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= REPEATS_MAX):
        raise MetadataError(f"runs in a row = {text!r} is no whole number from 1 to {REPEATS_MAX}")
    return int(text)


def _form_of(tests: NextTests, form: RunForm) -> RunForm:
    kept = {name: _text(getattr(tests.conditions, name)) for name in CONDITION_FIELDS}
    operator = tests.operator or form.operator
    return replace(form, **kept, operator=operator)


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _one_more(text: str) -> str:
    return str(int(text) + 1) if text.strip().isdecimal() else text
