"""What the Identify screen does: an analysed run in, curves and rows out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from app.presenters import results
from app.presenters.analysed_run import AnalysedRun
from app.presenters.analysis_task import AUTO_MODEL, AnalysisTask, run_analysis
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.identify import plot_data, result_tables
from app.presenters.identify.cursor_quantities import plotted_quantities
from app.presenters.identify.cursors import (
    Cursor,
    Cursors,
    first_cursors,
    move_cursor,
    read_cursors,
    shift_cursors,
    step_cursor,
)
from app.presenters.identify.state import IdentifyState, PlotTab
from app.presenters.identify.tasks import (
    ClassicalFigures,
    EstimateClassical,
    ManualSimulation,
    SimulateFriction,
    Span,
    estimate_classical,
    simulate_friction,
)
from app.presenters.worker import Task, TaskDone, TaskFailed, TaskProgress, WorkerEvent
from messages.i18n import gettext

IdentifyTask = SimulateFriction | EstimateClassical | AnalysisTask
_PIXELS = 1000
"""Width of the curves until the view has told it."""


class TaskQueue(Protocol):
    """The worker, as far as this screen needs it."""

    def submit(self, task: Task, argument: Any) -> None:
        """Have something done elsewhere; the answer comes to `IdentifyPresenter.hear`."""

    def cancel(self) -> None:
        """Give up all that is being done."""


@dataclass(frozen=True, eq=False, slots=True)
class _Shown:
    """The run on the screen: as it was first analysed, and in the shape that is drawn now."""

    first_analysis: AnalysedRun
    run: AnalysedRun
    task: AnalysisTask
    true_friction: float | None

    @property
    def origin_s(self) -> float:
        """Time of the record that is drawn as 0."""
        return plot_data.time_origin_s(self.run)


class IdentifyPresenter(Presenter[IdentifyState]):
    """Shows one run.

    Parameters
    ----------
    work : Work
        Simulates and analyses elsewhere.
    listen : callable
        Has the answers that have come handed out.
    """

    def __init__(self, work: TaskQueue, listen: Callable[[], None]) -> None:
        super().__init__(IdentifyState())
        self._work = work
        self._listen = listen
        self._path = ""
        self._shown: _Shown | None = None
        self._span: tuple[float, float, int] | None = None
        self._pending: SimulateFriction | None = None
        self._next_friction: float | None = None
        self._classical: ClassicalFigures | None = None

    # --- a run comes ---

    def on_opening(self, path: str) -> None:
        """A run is being read and identified; what was shown before goes."""
        self._path = path
        self._shown = self._pending = self._next_friction = self._classical = self._span = None
        self.state = IdentifyState(tab=self.state.tab)
        self._update(title=Path(path).name, progress=Progress(gettext("Reading the run")))

    def on_progress(self, path: str, progress: Progress) -> None:
        """The identification goes on."""
        if path == self._path and self.state.progress is not None:
            self._update(progress=progress)

    def on_failed(self, path: str, message: str) -> None:
        """The run could not be read or identified; as one mass it may be."""
        if path == self._path:
            self._update(progress=None, failure=message, alternative_kind=None if self._shown else "one-mass")

    def on_analysed(self, run: AnalysedRun, true_friction: float | None = None) -> None:
        """Show an analysed run, unless another is awaited."""
        if str(run.path) == self._path:
            self._show(_Shown(run, run, AnalysisTask(self._path, kind=run.kind), true_friction))

    def on_event(self, news: WorkerEvent) -> None:
        """Take in what came of a task of this screen."""
        asked = news.argument
        if asked.path != self._path:
            return
        if isinstance(asked, SimulateFriction):
            if not isinstance(news, TaskProgress):
                self._on_simulated(asked, news.answer if isinstance(news, TaskDone) else None)
        elif isinstance(asked, EstimateClassical):
            if isinstance(news, TaskDone):
                self._on_classical(asked, news.answer)
        elif isinstance(news, TaskProgress):
            self.on_progress(asked.path, news.progress)
        elif isinstance(news, TaskFailed):
            self._on_variant_failed(asked, news.message)
        else:
            self._on_variant(asked, news.answer)

    # --- what the operator does ---

    def cancel(self) -> None:
        """Give up the analysis that is going on."""
        if self.state.progress is not None:
            self._work.cancel()

    def set_tab(self, side: PlotTab) -> None:
        """Show displacements, velocities, accelerations or the phase plane; cursors keep their times."""
        self._update(tab=side, cursors=self._cursors_on_tab(self.state.cursors, side))

    def select_model(self, name: str) -> None:
        """Show curves and results of one of the laws that were tried."""
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
            self._work.submit(run_analysis, AnalysisTask(self._path, name))

    def analyse_as_alternative(self) -> None:
        """Analyse as one mass what was analysed as two, or the other way round."""
        if self.state.alternative_kind is not None and self.state.progress is None:
            asked = AnalysisTask(self._path, kind=self.state.alternative_kind)
            self._update(progress=Progress(gettext("Reading the run")), failure="")
            self._work.submit(run_analysis, asked)

    def set_visible_span(self, start_s: float, end_s: float, pixels: int) -> None:
        """The curves are drawn from here to there, so wide: a simulation by hand is made anew for that."""
        self._span = start_s, end_s, pixels
        if self.state.manual_fit is not None:
            self.set_friction(self.state.manual_fit.friction)

    def set_friction(self, friction: float) -> None:
        """The handle was drawn to this f_d: simulate it, the newest one alone where several wait."""
        scan, shown = self.state.scan, self._shown
        if scan is None or shown is None:
            return
        friction = min(max(friction, float(scan.friction[0])), float(scan.friction[-1]))
        if self._pending is not None:
            self._next_friction = friction
            return
        self._pending = SimulateFriction(self._path, friction, self._drawn_span(shown), shown.task.model)
        self._work.submit(simulate_friction, self._pending)

    def poll(self) -> bool:
        """Take in what has been simulated; tells whether more is awaited."""
        self._listen()
        return self._pending is not None

    def reset_friction(self) -> None:
        """Take the handle back to the fitted f_d."""
        self._pending = self._next_friction = None
        self._update(manual_fit=None)

    def toggle_cursors(self, span: tuple[float, float] | None = None) -> None:
        """Show two cursors within the times that are in sight, or take them away."""
        if self._shown is None or self.state.cursors is not None:
            self._update(cursors=None)
        else:
            self._set_cursors(first_cursors(*(span or plot_data.time_span(self._shown.run))))

    def move_cursor(self, cursor: Cursor, at_s: float) -> None:
        """A cursor was drawn to this time."""
        if self.state.cursors is not None:
            self._set_cursors(move_cursor(self.state.cursors, cursor, at_s))

    def activate_cursor(self, cursor: Cursor) -> None:
        """The keys move this cursor from now on."""
        if self.state.cursors is not None:
            self._set_cursors(move_cursor(self.state.cursors, cursor, self.state.cursors.at(cursor)))

    def step_cursor(self, readings: int) -> None:
        """Move the cursor that was moved last by so many readings."""
        if self.state.cursors is not None and self.state.curves is not None:
            self._set_cursors(step_cursor(self.state.cursors, self.state.curves.time_s, readings))

    # --- inside ---

    def _show(self, shown: _Shown) -> None:
        """Draw a run in one of its shapes; cursors stay at their moments."""
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
            self._work.submit(estimate_classical, EstimateClassical(self._path, shown.task.model))

    def _on_variant(self, asked: AnalysisTask, run: AnalysedRun) -> None:
        """Another law, or another kind: beside the laws of the first analysis if that was of two masses."""
        if self.state.progress is None:
            return
        before = self._shown
        first = before.first_analysis if before is not None and asked.model != AUTO_MODEL else run
        self._show(_Shown(first, run, asked, before.true_friction if before is not None else None))

    def _on_variant_failed(self, asked: AnalysisTask, message: str) -> None:
        """What was shown stays, with the reason; without anything shown the reason is all there is."""
        if self._shown is None:
            self._update(progress=None, failure=message)
            return
        what = asked.model if asked.model != AUTO_MODEL else asked.kind
        words = Chip(gettext("{what}: {reason}", what=what, reason=message), Tone.WARN)
        self._update(progress=None, model_note=words)

    def _on_simulated(self, asked: SimulateFriction, hand: ManualSimulation | None) -> None:
        if asked != self._pending or self._shown is None:
            return
        self._pending = None
        objective = self._shown.run.objective
        if hand is not None and objective is not None:
            self._update(manual_fit=plot_data.manual_fit(hand, self._shown.origin_s, objective))
        following, self._next_friction = self._next_friction, None
        if following is not None:
            self.set_friction(following)

    def _on_classical(self, asked: EstimateClassical, found: ClassicalFigures) -> None:
        shown = self._shown
        if shown is not None and asked.model == shown.task.model and shown.run.kind == "two-mass":
            self._update(classical=result_tables.classical_rows(shown.run, found))

    def _drawn_span(self, shown: _Shown) -> Span:
        """What is drawn, in the time of the record."""
        time_s, origin_s = shown.run.time_s, shown.origin_s
        if self._span is None:
            return Span(float(time_s[0]), float(time_s[-1]), _PIXELS)
        start_s, end_s, pixels = self._span
        return Span(start_s + origin_s, end_s + origin_s, pixels)

    def _set_cursors(self, cursors: Cursors) -> None:
        self._update(cursors=self._cursors_on_tab(cursors, self.state.tab))

    def _cursors_on_tab(self, cursors: Cursors | None, side: PlotTab) -> Cursors | None:
        """The same with what a tab draws at them."""
        curves, shown = self.state.curves, self._shown
        if cursors is None or curves is None or shown is None:
            return None
        period = shown.run.results.get("period_s")
        read_here = plotted_quantities(side, curves, self.state.motion)
        return read_cursors(cursors, curves.time_s, read_here, period.value if period else None)


def _model_of(run: AnalysedRun) -> str:
    return "" if run.model is None else run.model.name


def _model_note(shown: _Shown) -> Chip:
    """Say so where another law than the likeliest is drawn."""
    likeliest = _model_of(shown.first_analysis)
    if shown.run is shown.first_analysis or not likeliest:
        return EMPTY_CHIP
    words = gettext("Shown: {law}. The likeliest law is {best}.", law=_model_of(shown.run), best=likeliest)
    return Chip(words, Tone.WARN)
