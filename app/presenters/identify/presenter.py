"""What the Identify screen does: an analysed run in, curves and rows out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from app.presenters import results
from app.presenters.analysed_run import AnalysedRun
from app.presenters.analysis_task import AUTO_MODEL, AnalysisTask, run_analysis
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.identify import drawn, rows
from app.presenters.identify.cursors import Cursor, Cursors, first_cursors, moved, read, shifted, stepped
from app.presenters.identify.readings import quantities
from app.presenters.identify.state import IdentifyState, Side
from app.presenters.identify.tasks import (
    Classical,
    ClassicalOf,
    Hand,
    Span,
    WithFriction,
    classical_of,
    with_friction,
)
from app.presenters.worker import Task, TaskDone, TaskFailed, TaskProgress, WorkerEvent
from messages.i18n import gettext

IdentifyTask = WithFriction | ClassicalOf | AnalysisTask
_PIXELS = 1000
"""Width of the curves until the view has told it."""


class Work(Protocol):
    """The worker, as far as this screen needs it."""

    def submit(self, task: Task, argument: Any) -> None:
        """Have something done elsewhere; the answer comes to `IdentifyPresenter.hear`."""

    def cancel(self) -> None:
        """Give up all that is being done."""


@dataclass(frozen=True, eq=False, slots=True)
class _Shown:
    """The run on the screen: as it was first analysed, and in the shape that is drawn now."""

    first: AnalysedRun
    run: AnalysedRun
    asked: AnalysisTask
    true_friction: float | None

    @property
    def origin_s(self) -> float:
        """Time of the record that is drawn as 0."""
        return drawn.origin_of(self.run)


class IdentifyPresenter(Presenter[IdentifyState]):
    """Shows one run.

    Parameters
    ----------
    work : Work
        Simulates and analyses elsewhere.
    listen : callable
        Has the answers that have come handed out.
    """

    def __init__(self, work: Work, listen: Callable[[], None]) -> None:
        super().__init__(IdentifyState())
        self._work = work
        self._listen = listen
        self._path = ""
        self._shown: _Shown | None = None
        self._span: tuple[float, float, int] | None = None
        self._awaited: WithFriction | None = None
        self._next: float | None = None
        self._classical: Classical | None = None

    # --- a run comes ---

    def opening(self, path: str) -> None:
        """A run is being read and identified; what was shown before goes."""
        self._path = path
        self._shown = self._awaited = self._next = self._classical = self._span = None
        self.state = IdentifyState(side=self.state.side)
        self._update(title=Path(path).name, progress=Progress(gettext("Reading the run")))

    def working(self, path: str, progress: Progress) -> None:
        """The identification goes on."""
        if path == self._path and self.state.progress is not None:
            self._update(progress=progress)

    def show_failure(self, path: str, message: str) -> None:
        """The run could not be read or identified; as one mass it may be."""
        if path == self._path:
            self._update(progress=None, failure=message, other_kind=None if self._shown else "one-mass")

    def show_run(self, run: AnalysedRun, true_friction: float | None = None) -> None:
        """Show an analysed run, unless another is awaited."""
        if str(run.path) == self._path:
            self._show(_Shown(run, run, AnalysisTask(self._path, kind=run.kind), true_friction))

    def hear(self, news: WorkerEvent) -> None:
        """Take in what came of a task of this screen."""
        asked = news.argument
        if asked.path != self._path:
            return
        if isinstance(asked, WithFriction):
            if not isinstance(news, TaskProgress):
                self._take_hand(asked, news.answer if isinstance(news, TaskDone) else None)
        elif isinstance(asked, ClassicalOf):
            if isinstance(news, TaskDone):
                self._take_classical(asked, news.answer)
        elif isinstance(news, TaskProgress):
            self.working(asked.path, news.progress)
        elif isinstance(news, TaskFailed):
            self._could_not(asked, news.message)
        else:
            self._take_variant(asked, news.answer)

    # --- what the operator does ---

    def cancel(self) -> None:
        """Give up the analysis that is going on."""
        if self.state.progress is not None:
            self._work.cancel()

    def show_side(self, side: Side) -> None:
        """Show displacements, velocities, accelerations or the phase plane; cursors keep their times."""
        self._update(side=side, cursors=self._as_read(self.state.cursors, side))

    def show_model(self, name: str) -> None:
        """Show curves and results of one of the laws that were tried."""
        shown = self._shown
        if shown is None or self.state.progress is not None or name == _model_of(shown.run):
            return
        if name == _model_of(shown.first):
            self._show(_Shown(shown.first, shown.first, AnalysisTask(self._path), shown.true_friction))
        else:
            self._update(progress=Progress(gettext("Fitting {law}", law=name)))
            self._work.submit(run_analysis, AnalysisTask(self._path, name))

    def analyse_as_other_kind(self) -> None:
        """Analyse as one mass what was analysed as two, or the other way round."""
        if self.state.other_kind is not None and self.state.progress is None:
            asked = AnalysisTask(self._path, kind=self.state.other_kind)
            self._update(progress=Progress(gettext("Reading the run")), failure="")
            self._work.submit(run_analysis, asked)

    def show_span(self, start_s: float, end_s: float, pixels: int) -> None:
        """The curves are drawn from here to there, so wide: a simulation by hand is made anew for that."""
        self._span = start_s, end_s, pixels
        if self.state.hand is not None:
            self.set_friction(self.state.hand.friction)

    def set_friction(self, friction: float) -> None:
        """The handle was drawn to this f_d: simulate it, the newest one alone where several wait."""
        scan, shown = self.state.scan, self._shown
        if scan is None or shown is None:
            return
        friction = min(max(friction, float(scan.friction[0])), float(scan.friction[-1]))
        if self._awaited is not None:
            self._next = friction
            return
        self._awaited = WithFriction(self._path, friction, self._drawn_span(shown), shown.asked.model)
        self._work.submit(with_friction, self._awaited)

    def look(self) -> bool:
        """Take in what has been simulated; tells whether more is awaited."""
        self._listen()
        return self._awaited is not None

    def fit_again(self) -> None:
        """Take the handle back to the fitted f_d."""
        self._awaited = self._next = None
        self._update(hand=None)

    def toggle_cursors(self, span: tuple[float, float] | None = None) -> None:
        """Show two cursors within the times that are in sight, or take them away."""
        if self._shown is None or self.state.cursors is not None:
            self._update(cursors=None)
        else:
            self._read(first_cursors(*(span or drawn.span(self._shown.run))))

    def place_cursor(self, cursor: Cursor, at_s: float) -> None:
        """A cursor was drawn to this time."""
        if self.state.cursors is not None:
            self._read(moved(self.state.cursors, cursor, at_s))

    def choose_cursor(self, cursor: Cursor) -> None:
        """The keys move this cursor from now on."""
        if self.state.cursors is not None:
            self._read(moved(self.state.cursors, cursor, self.state.cursors.at(cursor)))

    def step_cursor(self, readings: int) -> None:
        """Move the cursor that was moved last by so many readings."""
        if self.state.cursors is not None and self.state.curves is not None:
            self._read(stepped(self.state.cursors, self.state.curves.time_s, readings))

    # --- inside ---

    def _show(self, shown: _Shown) -> None:
        """Draw a run in one of its shapes; cursors stay at their moments."""
        run, cursors, before = shown.run, self.state.cursors, self._shown
        self._shown = shown
        self._awaited = self._next = None
        self._update(
            title=run.path.name,
            curves=drawn.curves(run),
            result=results.make_result(run, shown.true_friction),
            rows=results.all_rows(run),
            models=rows.models(shown.first.model, run.model) if run.kind == "two-mass" else (),
            model_note=_model_note(shown),
            checks=(),
            budget=rows.budget(run),
            gaps=rows.gaps(run),
            no_scan=rows.no_scan(run),
            side=self.state.side if run.kinematics is not None else Side.DISPLACEMENT,
            motion=drawn.motion(run),
            scan=drawn.scan(run.objective),
            hand=None,
            cursors=None,
            other_kind="one-mass" if run.kind == "two-mass" else "two-mass",
            progress=None,
            failure="",
        )
        if cursors is not None and before is not None:
            self._read(shifted(cursors, before.origin_s - shown.origin_s))
        if run.objective is not None:
            self._work.submit(classical_of, ClassicalOf(self._path, shown.asked.model))

    def _take_variant(self, asked: AnalysisTask, run: AnalysedRun) -> None:
        """Another law, or another kind: beside the laws of the first analysis if that was of two masses."""
        if self.state.progress is None:
            return
        before = self._shown
        first = before.first if before is not None and asked.model != AUTO_MODEL else run
        self._show(_Shown(first, run, asked, before.true_friction if before is not None else None))

    def _could_not(self, asked: AnalysisTask, message: str) -> None:
        """What was shown stays, with the reason; without anything shown the reason is all there is."""
        if self._shown is None:
            self._update(progress=None, failure=message)
            return
        what = asked.model if asked.model != AUTO_MODEL else asked.kind
        words = Chip(gettext("{what}: {reason}", what=what, reason=message), Tone.WARN)
        self._update(progress=None, model_note=words)

    def _take_hand(self, asked: WithFriction, hand: Hand | None) -> None:
        if asked != self._awaited or self._shown is None:
            return
        self._awaited = None
        objective = self._shown.run.objective
        if hand is not None and objective is not None:
            self._update(hand=drawn.hand(hand, self._shown.origin_s, objective))
        following, self._next = self._next, None
        if following is not None:
            self.set_friction(following)

    def _take_classical(self, asked: ClassicalOf, found: Classical) -> None:
        shown = self._shown
        if shown is not None and asked.model == shown.asked.model and shown.run.kind == "two-mass":
            self._update(checks=rows.checks(shown.run, found))

    def _drawn_span(self, shown: _Shown) -> Span:
        """What is drawn, in the time of the record."""
        time_s, origin_s = shown.run.time_s, shown.origin_s
        if self._span is None:
            return Span(float(time_s[0]), float(time_s[-1]), _PIXELS)
        start_s, end_s, pixels = self._span
        return Span(start_s + origin_s, end_s + origin_s, pixels)

    def _read(self, cursors: Cursors) -> None:
        self._update(cursors=self._as_read(cursors, self.state.side))

    def _as_read(self, cursors: Cursors | None, side: Side) -> Cursors | None:
        """The same with what a tab draws at them."""
        curves, shown = self.state.curves, self._shown
        if cursors is None or curves is None or shown is None:
            return None
        period = shown.run.results.get("period_s")
        read_here = quantities(side, curves, self.state.motion)
        return read(cursors, curves.time_s, read_here, period.value if period else None)


def _model_of(run: AnalysedRun) -> str:
    return "" if run.model is None else run.model.name


def _model_note(shown: _Shown) -> Chip:
    """Say so where another law than the likeliest is drawn."""
    likeliest = _model_of(shown.first)
    if shown.run is shown.first or not likeliest:
        return EMPTY_CHIP
    words = gettext("Shown: {law}. The likeliest law is {best}.", law=_model_of(shown.run), best=likeliest)
    return Chip(words, Tone.WARN)
