"""Runs gathered from files and folders, with what must be known of them together."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from analysis.campaign.runs import RunResult
from analysis.quantities import BudgetLine, Caution
from app.runs.analysing import AnalysisRequest
from app.runs.batch.analyses import each_run
from app.runs.batch.choice import CrewOptions, crew_of
from app.runs.batch.in_order import Lost
from app.runs.campaign.cautions import cautions_of
from app.runs.campaign.one_run import GatherTask, RunAccount, RunFacts, account_of
from app.runs.listing import run_files
from config.schema import Gauges, Stand

Progress = Callable[[float, str], None]


class GatherOptions(msgspec.Struct, frozen=True):
    """How to gather.

    Attributes
    ----------
    crew : CrewOptions
        Who does it.
    save : bool
        Keep new results in their runs.
    request : AnalysisRequest
        How to analyse runs whose result does not stand.
    excluded : dict of str
        Why runs do not count, by their absolute paths: reasons of whoever asks.
    """

    crew: CrewOptions = CrewOptions()
    save: bool = False
    request: AnalysisRequest = AnalysisRequest(classical=False)
    excluded: dict[str, str] = {}


class Failure(msgspec.Struct, frozen=True):
    """A run that gives no result, and why, in one line."""

    run: str
    error: str

    @property
    def reason(self) -> str:
        """The error without the path that it begins with."""
        return self.error.removeprefix(self.run).lstrip(": ")


@dataclass(frozen=True, eq=False, slots=True)
class Gathered:
    """Runs with their results.

    Attributes
    ----------
    runs : tuple of RunResult
        In the order given, those of a folder by name; `name` is the absolute path.
    failures : tuple of Failure
    cautions : tuple of Caution
        What must be known of the runs together, and what to do.
    facts : dict of RunFacts
        By the names of the runs.
    stands : dict of Stand
        By `RunFacts.stand`.
    gauges : dict of Gauges
        By `RunFacts.calibration`.
    """

    runs: tuple[RunResult, ...]
    failures: tuple[Failure, ...]
    cautions: tuple[Caution, ...]
    facts: dict[str, RunFacts]
    stands: dict[str, Stand]
    gauges: dict[str, Gauges]


def gather(
    paths: Iterable[Path],
    options: GatherOptions | None = None,
    progress: Progress = lambda _share, _what: None,
) -> Gathered:
    """Gather runs: the newest result of each that still stands, else a new one.

    Parameters
    ----------
    paths
        Run files, and folders with runs in them and below; what is in the trash is left out.
    options
        By default as many processes as there are processors, and nothing is kept.
    progress
        Called with the share done (0 to 1) and what is being done.

    Raises
    ------
    RunNotFoundError
        There are no runs there.
    ExtraMissingError, ClusterError
        The cluster that was asked for cannot do it.
    """
    options = options or GatherOptions()
    given = [path.expanduser().absolute() for path in paths]
    tasks = [GatherTask(str(path), options.request, options.save) for path in run_files(given)]
    with crew_of(options.crew, len(tasks)) as crew:
        accounts = _Accounts(options.excluded)
        for came in each_run(tasks, account_of, crew, progress):
            accounts.take(RunAccount(came.item.path, came.message) if isinstance(came, Lost) else came)
    return accounts.gathered([path for path in given if path.is_dir()], saved=options.save)


class _Accounts:
    """What has come so far, with what many runs have in common held once."""

    def __init__(self, excluded: Mapping[str, str]) -> None:
        self._excluded = excluded
        self._runs: list[RunResult] = []
        self._failures: list[Failure] = []
        self._facts: dict[str, RunFacts] = {}
        self._stands: dict[str, Stand] = {}
        self._gauges: dict[str, Gauges] = {}
        self._first: dict[str, str] = {}

    def take(self, account: RunAccount) -> None:
        """Add what came of one run."""
        result, facts = account.result, account.facts
        if result is None or facts is None or account.stand is None or account.gauges is None:
            self._failures.append(Failure(account.path, account.error))
            return
        self._stands.setdefault(facts.stand, account.stand)
        self._gauges.setdefault(facts.calibration, account.gauges)
        self._facts[result.name] = facts
        first = self._first.setdefault(facts.identifier, result.name)
        if first != result.name:
            result = replace(result, excluded=f"the same recording as {first}: leave one of the files out")
        if reason := self._excluded.get(result.name):
            result = replace(result, excluded=reason)
        self._runs.append(replace(result, budget=tuple(map(_shared, result.budget))))

    def gathered(self, folders: Sequence[Path], *, saved: bool) -> Gathered:
        """Everything, with what is to be said of it."""
        counted = [run for run in self._runs if not run.excluded]
        cautions = cautions_of(counted, self._facts, self._stands, folders, saved=saved)
        return Gathered(
            tuple(self._runs), tuple(self._failures), cautions, self._facts, self._stands, self._gauges
        )


def _shared(line: BudgetLine) -> BudgetLine:
    """A line whose names are held once for all runs."""
    return BudgetLine(sys.intern(line.source), sys.intern(line.contribution_to), line.standard_uncertainty)
