"""A run that has ended, while it is in sight: its result awaited, the decision about it, and its undo."""

from app.acquisition.messages import RunEnded
from app.presenters import results
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import Progress
from app.presenters.record.guidance import ScreenStage
from app.presenters.record.live_display import LiveDisplay
from app.presenters.record.next_runs import NextRuns
from app.presenters.record.pullback_session import PullbackSession
from app.presenters.record.run_decisions import RunDecisions
from app.presenters.record.state import LiveEstimate
from app.presenters.record.undo_snapshot import UndoSnapshot
from app.presenters.results import Result
from messages.i18n import gettext


class EndedRun:
    """Leads one run after another from its end until there is room for the next.

    Parameters
    ----------
    course : Course
        Told what has become of the run.
    desk : Desk
        Counts it as done or not.
    verdicts : Verdicts
        Stores what is decided.
    display : LiveDisplay
        Stands still meanwhile.
    """

    def __init__(
        self, course: PullbackSession, desk: NextRuns, verdicts: RunDecisions, display: LiveDisplay
    ) -> None:
        self.result: Result | None = None
        self.progress: Progress | None = None
        """How far its identification is."""
        self._course = course
        self._desk = desk
        self._verdicts = verdicts
        self._display = display
        self._left: UndoSnapshot | None = None

    # --- what happens elsewhere ---

    def end(self, event: RunEnded) -> None:
        """A run has ended: its result is awaited if it left a file."""
        self._course.on_run_ended(event)
        self._display.live.stop()
        self._verdicts.clear_last()
        if event.path:
            self._desk.set_undecided(event.path)
            self._desk.next_run()
            self.progress = Progress(gettext("Identifying"))
        else:
            self._finish(
                results.failed_result(event.message or gettext("nothing was recorded"), "", event.ended)
            )

    def identifying(self, path: str, progress: Progress) -> None:
        """It is being identified."""
        if self._course.is_awaiting_result(path):
            self.progress = progress

    def identified(self, run: AnalysedRun) -> None:
        """Show what was found; a run that was passed by is kept now."""
        if self._course.is_awaiting_result(str(run.path)):
            self._verdicts.set_run(run)
            self._finish(results.make_result(run, self._course.true_friction))
        else:
            self._verdicts.on_late_result(run)

    def not_identified(self, path: str, message: str) -> None:
        """Show why nothing was found."""
        course = self._course
        self._verdicts.on_late_failure(path)
        if course.is_awaiting_result(path) and course.ended is not None:
            self._verdicts.set_failed_run(path, course.run_note)
            self._finish(results.failed_result(message, path, course.ended.ended))

    def show_again(self, path: str) -> None:
        """Show the run that was left last, at `path` by now, to be decided about again."""
        if self._left is None:
            return
        left = self._left.at(path)
        left.return_to(self._course)
        self._display.hold(left.traces)
        self._desk.choose_series(left.series)
        self._desk.set_undecided(path)
        self.result = left.result

    # --- what the operator does ---

    def close(self) -> None:
        """Make room for the next run: this one is kept unless it was decided about."""
        course = self._course
        if course.after_run is None:
            return
        if course.after_run is ScreenStage.FINDING and course.ended is not None:
            self._verdicts.keep_when_identified(course.ended.path)
        if self.result is not None and self.result.path:
            self._left = UndoSnapshot.of(self.result, self._display.traces, self._desk.choices.series, course)
        kept = self._verdicts.keep()
        course.after_run = None
        self._desk.set_undecided("")
        if kept:
            self._desk.count_kept(kept, course.series)
            self._desk.select_next_series()
        self._display.live.restart()
        self.clear()

    def move_to_trash(self) -> None:
        """Move it to the trash; it stays in sight until it is left."""
        self._verdicts.move_to_trash()
        if self.result is not None:
            self._desk.count_removed(self.result.path)

    def undo(self) -> None:
        """Take the last decision back: the run is asked about again, as soon as it is where it was."""
        if self._verdicts.undo() and self._left is not None:
            self.show_again(self._left.result.path)

    def clear(self) -> None:
        """Nothing is shown of any run."""
        self.result = self.progress = None
        self._course.live_estimate = LiveEstimate()

    def _finish(self, result: Result) -> None:
        self._course.after_run = ScreenStage.DONE
        self.result, self.progress = result, None
