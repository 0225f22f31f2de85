"""A run that was decided about, as it was in sight before: what it takes to decide about it again."""

from dataclasses import dataclass, replace

from app.presenters.record.guidance import ScreenStage
from app.presenters.record.pullback_session import PullbackSession
from app.presenters.record.state import Traces
from app.presenters.results import Result


@dataclass(frozen=True, eq=False, slots=True)
class UndoSnapshot:
    """What was shown of a run, and which series was to follow."""

    result: Result
    traces: Traces
    series: str
    course: PullbackSession

    @classmethod
    def of(cls, result: Result, traces: Traces, series: str, course: PullbackSession) -> "UndoSnapshot":
        """Keep what is in sight now."""
        return cls(result, traces, series, replace(course))

    def at(self, path: str) -> "UndoSnapshot":
        """The same run, which lies at `path` now."""
        return replace(self, result=replace(self.result, path=path))

    def return_to(self, course: PullbackSession) -> None:
        """Stand at the end of this run again, wherever the engine stands."""
        left = self.course
        course.after_run, course.ended = ScreenStage.DONE, left.ended
        course.series, course.name, course.run_note = left.series, left.name, left.run_note
