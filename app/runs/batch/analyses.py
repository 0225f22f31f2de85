"""Many runs worked on: one outcome a run, in the order given, whoever does the work."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

from app.runs.batch.crew import Crew, InLine
from app.runs.batch.in_order import Lost, in_order
from app.runs.batch.tasks import RunOutcome, RunTask, analyze_one

Progress = Callable[[float, str], None]
Outcome = TypeVar("Outcome", covariant=True)


class _OfRun(Protocol):
    @property
    def path(self) -> str: ...


Task = TypeVar("Task", bound=_OfRun)


def analyze_runs(
    tasks: Sequence[RunTask], crew: Crew, progress: Progress = lambda _share, _what: None
) -> Iterator[RunOutcome]:
    """Analyse runs; one that fails is told by its outcome and does not stop the rest.

    Parameters
    ----------
    tasks, crew
        Stop asking for outcomes to cancel: what is in flight is given up when the crew is closed.
    progress
        Called with the share done (0 to 1) and what is being done.
    """
    for outcome in each_run(tasks, analyze_one, crew, progress):
        yield RunOutcome(outcome.item.path, error=outcome.message) if isinstance(outcome, Lost) else outcome


def each_run(
    tasks: Sequence[Task],
    work: Callable[..., Outcome],
    crew: Crew,
    progress: Progress,
) -> Iterator[Outcome | Lost[Task]]:
    """Do `work(task)` on runs by a crew; in this process `work(task, progress)`, to tell how far it is."""
    done = 0

    def within(share: float, what: str) -> None:
        progress((done + share) / len(tasks), what)

    at_hand = (lambda task: work(task, within)) if isinstance(crew, InLine) else work
    for outcome in in_order(crew, at_hand, tasks):
        done += 1
        progress(done / len(tasks), f"{done} of {len(tasks)} runs")
        yield outcome
