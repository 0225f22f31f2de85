"""Many runs worked on: one outcome a run, in the order given, whoever does the work."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

from app.runs.batch.crew import Executor, SerialExecutor
from app.runs.batch.in_order import FailedItem, ordered_map
from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask, analyze_one

Progress = Callable[[float, str], None]
Outcome = TypeVar("Outcome", covariant=True)


class _OfRun(Protocol):
    @property
    def path(self) -> str: ...


Task = TypeVar("Task", bound=_OfRun)


def analyze_runs(
    tasks: Sequence[AnalysisTask], executor: Executor, progress: Progress = lambda _share, _what: None
) -> Iterator[AnalysisOutcome]:
    """Analyse runs; one that fails is told by its outcome and does not stop the rest.

    Parameters
    ----------
    tasks, crew
        Stop asking for outcomes to cancel: what is in flight is given up when the crew is closed.
    progress
        Called with the share done (0 to 1) and what is being done.
    """
    for outcome in map_runs(tasks, analyze_one, executor, progress):
        yield (
            AnalysisOutcome(outcome.item.path, error=outcome.message)
            if isinstance(outcome, FailedItem)
            else outcome
        )


def map_runs(
    tasks: Sequence[Task],
    work: Callable[..., Outcome],
    executor: Executor,
    progress: Progress,
) -> Iterator[Outcome | FailedItem[Task]]:
    """Do `work(task)` on runs by a crew; in this process `work(task, progress)`, to tell how far it is."""
    done = 0

    def within(share: float, what: str) -> None:
        progress((done + share) / len(tasks), what)

    at_hand = (lambda task: work(task, within)) if isinstance(executor, SerialExecutor) else work
    for outcome in ordered_map(executor, at_hand, tasks):
        done += 1
        progress(done / len(tasks), f"{done} of {len(tasks)} runs")
        yield outcome
