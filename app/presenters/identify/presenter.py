"""Presenter of the Identify screen: shows an analysed run, and varies f_d by hand."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.presenters import results
from app.presenters.analysed_run import AUTO_MODEL, AnalysedRun, AnalysisTask
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.events import TaskDone, TaskFailed, TaskProgress, WorkerEvent
from app.presenters.identify import plot_data, result_tables
from app.presenters.identify.cursors import (
    first_cursors,
    move_cursor,
    plotted_quantities,
    read_cursors,
    shift_cursors,
    step_cursor,
)
from app.presenters.identify.state import (
    ClassicalFigures,
    Cursor,
    Cursors,
    EstimateClassical,
    IdentifyState,
    IdentifyTask,
    ManualSimulation,
    PlotTab,
    SimulateFriction,
    Span,
)
from app.presenters.worker import LazyFunction, Worker
from messages.i18n import gettext, translate
from messages.message import Message

RUN_ANALYSIS: Final = LazyFunction("app.presenters.analysis_task", "run_analysis")
SIMULATE_FRICTION: Final = LazyFunction("app.presenters.identify.tasks", "simulate_friction")
ESTIMATE_CLASSICAL: Final = LazyFunction("app.presenters.identify.tasks", "estimate_classical")
_PIXELS = 1000
"""Width of the curves before the view reports it."""


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
    """Shows one run; `poll_worker` passes the events of the worker, which the window shares and closes."""

    def __init__(self, worker: Worker, poll_worker: Callable[[], None]) -> None:
        super().__init__(IdentifyState())
        self._worker = worker
        self._poll_worker = poll_worker
        self._path = ""
        self._shown: _Shown | None = None
        self._span: tuple[float, float, int] | None = None
        self._pending: SimulateFriction | None = None
        self._next_friction: float | None = None
        self._classical: ClassicalFigures | None = None

    def on_opening(self, path: str) -> None:
        self._path = path
        self._shown = self._pending = self._next_friction = self._classical = self._span = None
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
            self._show(_Shown(run, run, AnalysisTask(self._path, kind=run.kind), true_friction))

    def on_event(self, event: WorkerEvent) -> None:
        task = event.argument
        if task.path != self._path:
            return
        if isinstance(task, SimulateFriction):
            if not isinstance(event, TaskProgress):
                self._on_simulated(task, event.answer if isinstance(event, TaskDone) else None)
        elif isinstance(task, EstimateClassical):
            if isinstance(event, TaskDone):
                self._on_classical(task, event.answer)
        elif isinstance(event, TaskProgress):
            self.on_progress(task.path, event.progress)
        elif isinstance(event, TaskFailed):
            self._on_variant_failed(task, translate(event.message))
        else:
            self._on_variant(task, event.answer)

    def cancel(self) -> None:
        if self.state.progress is not None:
            self._worker.cancel()

    def set_tab(self, side: PlotTab) -> None:
        self._update(tab=side, cursors=self._cursors_on_tab(self.state.cursors, side))

    def select_model(self, name: str) -> None:
        shown = self._shown
        if shown is None or self.state.progress is not None or name == _model_of(shown.run):
            return
        if name == _model_of(shown.first_analysis):
            self._show(
                _Shown(
                    shown.first_analysis, shown.first_analysis, AnalysisTask(self._path), shown.true_friction
                )
            )
        else:
            self._update(progress=Progress(gettext("Fitting {law}", law=name)))
            self._submit(RUN_ANALYSIS, AnalysisTask(self._path, name))

    def analyse_as_alternative(self) -> None:
        if self.state.alternative_kind is not None and self.state.progress is None:
            task = AnalysisTask(self._path, kind=self.state.alternative_kind)
            self._update(progress=Progress(gettext("Reading the run")), failure="")
            self._submit(RUN_ANALYSIS, task)

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
        self._pending = SimulateFriction(self._path, friction, self._drawn_span(shown), shown.task.model)
        self._submit(SIMULATE_FRICTION, self._pending)

    def poll(self) -> bool:
        """Process events; True while a simulation is pending."""
        self._poll_worker()
        return self._pending is not None

    def reset_friction(self) -> None:
        self._pending = self._next_friction = None
        self._update(manual_fit=None)

    def toggle_cursors(self, span: tuple[float, float] | None = None) -> None:
        if self._shown is None or self.state.cursors is not None:
            self._update(cursors=None)
        else:
            self._set_cursors(first_cursors(*(span or plot_data.time_span(self._shown.run))))

    def move_cursor(self, cursor: Cursor, at_s: float) -> None:
        if self.state.cursors is not None:
            self._set_cursors(move_cursor(self.state.cursors, cursor, at_s))

    def activate_cursor(self, cursor: Cursor) -> None:
        if self.state.cursors is not None:
            self._set_cursors(move_cursor(self.state.cursors, cursor, self.state.cursors.at(cursor)))

    def step_cursor(self, samples: int) -> None:
        if self.state.cursors is not None and self.state.curves is not None:
            self._set_cursors(step_cursor(self.state.cursors, self.state.curves.time_s, samples))

    def _submit(self, function: LazyFunction, task: IdentifyTask) -> None:
        self._worker.submit(
            function,
            task,
            done=lambda answer: self.on_event(TaskDone(task, answer)),
            failed=lambda failure: self.on_event(TaskFailed(task, failure.message, failure.is_cancelled)),
            progress=lambda progress: self.on_event(TaskProgress(task, progress)),
        )

    def _show(self, shown: _Shown) -> None:
        """Show a variant of a run; cursors keep their moments."""
        run, cursors, before = shown.run, self.state.cursors, self._shown
        self._shown = shown
        self._pending = self._next_friction = None
        self._update(
            title=run.path.name,
            curves=plot_data.curves(run),
            result=results.make_result(run, shown.true_friction),
            rows=results.all_rows(run),
            models=result_tables.model_rows(shown.first_analysis.model, run.model)
            if run.kind == "two-mass"
            else (),
            model_note=_model_note(shown),
            classical=(),
            budget=result_tables.budget_rows(run),
            missing_data=result_tables.missing_data(run),
            no_scan_reason=result_tables.no_scan_reason(run),
            tab=self.state.tab if run.kinematics is not None else PlotTab.DISPLACEMENT,
            motion=plot_data.motion(run),
            scan=plot_data.scan(run.objective),
            manual_fit=None,
            cursors=None,
            alternative_kind="one-mass" if run.kind == "two-mass" else "two-mass",
            progress=None,
            failure="",
        )
        if cursors is not None and before is not None:
            self._set_cursors(shift_cursors(cursors, before.origin_s - shown.origin_s))
        if run.objective is not None:
            self._submit(ESTIMATE_CLASSICAL, EstimateClassical(self._path, shown.task.model))

    def _on_variant(self, task: AnalysisTask, run: AnalysedRun) -> None:
        """Show another law beside those of the first analysis, or another kind of analysis."""
        if self.state.progress is None:
            return
        before = self._shown
        first = before.first_analysis if before is not None and task.model != AUTO_MODEL else run
        self._show(_Shown(first, run, task, before.true_friction if before is not None else None))

    def _on_variant_failed(self, task: AnalysisTask, message: str) -> None:
        if self._shown is None:
            self._update(progress=None, failure=message)
            return
        what = task.model if task.model != AUTO_MODEL else task.kind
        words = Chip(gettext("{what}: {reason}", what=what, reason=message), Tone.WARN)
        self._update(progress=None, model_note=words)

    def _on_simulated(self, task: SimulateFriction, hand: ManualSimulation | None) -> None:
        if task != self._pending or self._shown is None:
            return
        self._pending = None
        objective = self._shown.run.objective
        if hand is not None and objective is not None:
            self._update(manual_fit=plot_data.manual_fit(hand, self._shown.origin_s, objective))
        following, self._next_friction = self._next_friction, None
        if following is not None:
            self.set_friction(following)

    def _on_classical(self, task: EstimateClassical, found: ClassicalFigures) -> None:
        shown = self._shown
        if shown is not None and task.model == shown.task.model and shown.run.kind == "two-mass":
            self._update(classical=result_tables.classical_rows(shown.run, found))

    def _drawn_span(self, shown: _Shown) -> Span:
        """Visible span in times of the record."""
        time_s, origin_s = shown.run.time_s, shown.origin_s
        if self._span is None:
            return Span(float(time_s[0]), float(time_s[-1]), _PIXELS)
        start_s, end_s, pixels = self._span
        return Span(start_s + origin_s, end_s + origin_s, pixels)

    def _set_cursors(self, cursors: Cursors) -> None:
        self._update(cursors=self._cursors_on_tab(cursors, self.state.tab))

    def _cursors_on_tab(self, cursors: Cursors | None, side: PlotTab) -> Cursors | None:
        curves, shown = self.state.curves, self._shown
        if cursors is None or curves is None or shown is None:
            return None
        period = shown.run.results.get("period_s")
        read_here = plotted_quantities(side, curves, self.state.motion)
        return read_cursors(cursors, curves.time_s, read_here, period.value if period else None)


def _model_of(run: AnalysedRun) -> str:
    return "" if run.model is None else run.model.name


def _model_note(shown: _Shown) -> Chip:
    """Note if another law than the likeliest is shown."""
    likeliest = _model_of(shown.first_analysis)
    if shown.run is shown.first_analysis or not likeliest:
        return EMPTY_CHIP
    words = gettext("Shown: {law}. The likeliest law is {best}.", law=_model_of(shown.run), best=likeliest)
    return Chip(words, Tone.WARN)
