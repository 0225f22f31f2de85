"""Presenter of the Identify screen: shows an analysed run, and varies f_d by hand."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.verdict_text import model_title
from app.presenters import results
from app.presenters.analysed_run import AUTO_MODEL, AnalysedRun, AnalysisTask
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone
from app.presenters.identify import cursors as cursor_values
from app.presenters.identify import plot_data, result_tables
from app.presenters.identify.report import ReportPresenter
from app.presenters.identify.state import (
    ClassicalRow,
    Cursor,
    Cursors,
    IdentifyState,
    ManualFit,
    PlotTab,
    Span,
)
from app.presenters.worker import LazyModule, Worker
from messages.i18n import gettext, translate
from messages.message import Message

if TYPE_CHECKING:
    from app.presenters import analysis_task
    from app.presenters.identify import tasks
else:
    analysis_task = LazyModule("app.presenters.analysis_task")
    tasks = LazyModule("app.presenters.identify.tasks")

_PIXELS = 1000  # width of the curves before the view reports it


@dataclass(frozen=True, eq=False, slots=True)
class _Shown:
    """The run on the screen: its first analysis, and the variant that is shown."""

    first_analysis: AnalysedRun
    run: AnalysedRun
    task: AnalysisTask
    true_friction: float | None

    @property
    def origin_s(self) -> float:
        return plot_data.time_origin_s(self.run)


class IdentifyPresenter(Presenter[IdentifyState]):
    """Shows one run; `worker` has it loaded, and is shared and closed by the window.

    `close` closes that of the `report`.
    """

    def __init__(self, worker: Worker, report: ReportPresenter) -> None:
        super().__init__(IdentifyState())
        self._worker = worker
        self.report = report
        self._path = ""
        self._shown: _Shown | None = None
        self._span: tuple[float, float, int] | None = None
        self._pending: tuple[float, Span] | None = None
        self._next_friction: float | None = None

    def on_opening(self, path: str) -> None:
        self._path = path
        self.report.set_run("")
        self._shown = self._pending = self._next_friction = self._span = None
        self.state = IdentifyState(tab=self.state.tab)
        self._update(title=Path(path).name, progress=Progress(gettext("Reading the run")))

    def on_progress(self, path: str, progress: Progress) -> None:
        if path == self._path and self.state.progress is not None:
            self._update(progress=progress)

    def on_failed(self, path: str, message: Message) -> None:
        if path == self._path:
            self._update(
                progress=None,
                failure=translate(message),
                alternative_kind=None if self._shown else "one-mass",
            )

    def on_analysed(self, run: AnalysedRun, true_friction: float | None = None) -> None:
        if str(run.path) == self._path:
            self.report.set_run(self._path)
            self._show(_Shown(run, run, AnalysisTask(self._path, kind=run.kind), true_friction))

    def tick(self) -> None:
        self.report.tick()

    def close(self) -> None:
        self.report.close()

    def cancel(self) -> None:
        if self.state.progress is not None:
            self._worker.cancel()

    def set_tab(self, tab: PlotTab) -> None:
        self._update(tab=tab, cursors=self._cursors_on_tab(self.state.cursors, tab))

    def select_model(self, name: str) -> None:
        shown = self._shown
        if shown is None or self.state.progress is not None or name == _model_of(shown.run):
            return
        if name == _model_of(shown.first_analysis):
            self._show(replace(shown, run=shown.first_analysis, task=AnalysisTask(self._path)))
        else:
            self._analyse(AnalysisTask(self._path, name), gettext("Fitting {law}", law=name))

    def analyse_as_alternative(self) -> None:
        if self.state.alternative_kind is not None and self.state.progress is None:
            self._update(failure="")
            task = AnalysisTask(self._path, kind=self.state.alternative_kind)
            self._analyse(task, gettext("Reading the run"))

    def set_visible_span(self, start_s: float, end_s: float, pixels: int) -> None:
        self._span = start_s, end_s, pixels
        if self.state.manual_fit is not None:
            self.set_friction(self.state.manual_fit.friction)

    def set_friction(self, friction: float) -> None:
        """Simulate with this f_d; while a simulation runs, only the newest value waits."""
        scan, shown = self.state.scan, self._shown
        if scan is None or shown is None:
            return
        friction = min(max(friction, float(scan.friction[0])), float(scan.friction[-1]))
        if self._pending is not None:
            self._next_friction = friction
            return
        pending = self._pending = (friction, self._drawn_span(shown))
        self._worker.submit(
            tasks.simulate_friction,
            shown.task,
            *pending,
            done=lambda fit: self._on_simulated(pending, fit),
            failed=lambda _failure: self._on_simulated(pending, None),
        )

    def poll(self) -> bool:
        """Process what has come from the worker; True while a simulation is pending."""
        self._worker.poll()
        return self._pending is not None

    def reset_friction(self) -> None:
        self._pending = self._next_friction = None
        self._update(manual_fit=None, manual_fit_text="")

    def toggle_cursors(self, span: tuple[float, float] | None = None) -> None:
        if self._shown is None or self.state.cursors is not None:
            self._update(cursors=None)
        else:
            self._set_cursors(cursor_values.first_cursors(*(span or plot_data.time_span(self._shown.run))))

    def move_cursor(self, cursor: Cursor, at_s: float) -> None:
        if self.state.cursors is not None:
            self._set_cursors(cursor_values.move_cursor(self.state.cursors, cursor, at_s))

    def activate_cursor(self, cursor: Cursor) -> None:
        if self.state.cursors is not None:
            self._set_cursors(replace(self.state.cursors, active=cursor))

    def step_cursor(self, samples: int) -> None:
        cursors, curves = self.state.cursors, self.state.curves
        if cursors is not None and curves is not None:
            self._set_cursors(cursor_values.step_cursor(cursors, curves.time_s, samples))

    def _analyse(self, task: AnalysisTask, text: str) -> None:
        self._update(progress=Progress(text))
        self._worker.submit(
            analysis_task.run_analysis,
            task,
            done=partial(self._on_variant, task),
            failed=partial(self._on_variant_failed, task),
            progress=partial(self.on_progress, task.path),
        )

    def _show(self, shown: _Shown) -> None:
        """Show a variant of a run; cursors keep their moments."""
        run, cursors, before = shown.run, self.state.cursors, self._shown
        self._shown = shown
        self._pending = self._next_friction = None
        state = IdentifyState(
            title=run.path.name,
            curves=plot_data.curves(run),
            result=results.make_result(run, shown.true_friction),
            rows=results.all_rows(run),
            models=result_tables.model_rows(shown.first_analysis, run),
            model_note=_model_note(shown),
            budget=result_tables.budget_rows(run),
            missing_data=result_tables.missing_data(run),
            no_scan_reason=result_tables.no_scan_reason(run),
            tab=self._tab_of(run),
            motion=plot_data.motion(run),
            slip_plots=plot_data.slip_plots(run),
            scan=run.objective,
            alternative_kind="one-mass" if run.kind == "two-mass" else "two-mass",
        )
        self._set_state(state)
        if cursors is not None and before is not None:
            self._set_cursors(cursor_values.shift_cursors(cursors, before.origin_s - shown.origin_s))
        if run.objective is not None:
            self._worker.submit(tasks.estimate_classical, shown.task, done=partial(self._on_classical, shown))

    def _tab_of(self, run: AnalysedRun) -> PlotTab:
        """The tab that is shown, where the run has something to draw there."""
        tab = self.state.tab
        drawn = run.friction_by_slip if tab is PlotTab.FRICTION else run.kinematics
        return tab if drawn is not None else PlotTab.DISPLACEMENT

    def _on_variant(self, task: AnalysisTask, run: AnalysedRun) -> None:
        """Show another law beside those of the first analysis, or another kind of analysis."""
        if task.path != self._path or self.state.progress is None:
            return
        before = self._shown
        first = before.first_analysis if before is not None and task.model != AUTO_MODEL else run
        self._show(_Shown(first, run, task, before.true_friction if before is not None else None))

    def _on_variant_failed(self, task: AnalysisTask, failure: TaskFailure) -> None:
        if self._shown is None:
            self.on_failed(task.path, failure.message)
        elif task.path == self._path:
            what = task.model if task.model != AUTO_MODEL else task.kind
            words = gettext("{what}: {reason}", what=what, reason=translate(failure.message))
            self._update(progress=None, model_note=Chip(words, Tone.WARN))

    def _on_simulated(self, pending: tuple[float, Span], fit: ManualFit | None) -> None:
        if pending is not self._pending:
            return
        self._pending = None
        if fit is not None and self.state.scan is not None:
            text = plot_data.manual_fit_text(fit.friction, self.state.scan)
            self._update(manual_fit=fit, manual_fit_text=text)
        following, self._next_friction = self._next_friction, None
        if following is not None:
            self.set_friction(following)

    def _on_classical(self, shown: _Shown, rows: tuple[ClassicalRow, ...]) -> None:
        if shown is self._shown:
            self._update(classical=rows)

    def _drawn_span(self, shown: _Shown) -> Span:
        start_s, end_s, pixels = self._span or (*plot_data.time_span(shown.run), _PIXELS)
        return Span(start_s, end_s, pixels, shown.origin_s)

    def _set_cursors(self, cursors: Cursors) -> None:
        self._update(cursors=self._cursors_on_tab(cursors, self.state.tab))

    def _cursors_on_tab(self, cursors: Cursors | None, tab: PlotTab) -> Cursors | None:
        curves, shown, motion = self.state.curves, self._shown, self.state.motion
        if cursors is None or curves is None or shown is None:
            return None
        period = shown.run.results.get("period_s")
        lines = motion[tab] if motion is not None and tab in motion else plot_data.measured_lines(curves)
        return cursor_values.read_cursors(cursors, curves.time_s, lines, period.value if period else None)


def _model_of(run: AnalysedRun) -> str:
    return "" if run.model is None else run.model.full_name


def _model_note(shown: _Shown) -> Chip:
    best, model = shown.first_analysis.model, shown.run.model
    if shown.run is shown.first_analysis or best is None or model is None:
        return EMPTY_CHIP
    law, likeliest = (translate(model_title(each.name, each.parts)) for each in (model, best))
    words = gettext("Shown: {law}. The likeliest law is {best}.", law=law, best=likeliest)
    return Chip(words, Tone.WARN)
