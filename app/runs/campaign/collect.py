"""Results of many runs from files and folders, with warnings of them together."""

import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from analysis.campaign.campaign import Campaign, Excluded, summarize
from analysis.campaign.series import RunResult
from analysis.quantities import ResultWarning
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import Progress
from app.runs.batch.executors import ExecutorOptions, FailedItem, open_executor
from app.runs.batch.tasks import AnalysisTask, map_runs
from app.runs.campaign.run_result import CollectedRun, RunDetails, collect_run
from app.runs.errors import NoResultError
from app.runs.file_operations import list_trash
from app.runs.journal import unfinished_journals
from app.runs.listing import resolve_run_files
from app.runs.metadata import RunSource
from config.schema import ConfigError, Gauges, Stand
from messages.i18n import N_
from messages.message import Message, message

Shared = TypeVar("Shared", Stand, Gauges, dict[str, Any])


class CollectOptions(msgspec.Struct, frozen=True):
    """How to collect runs."""

    executor: ExecutorOptions = ExecutorOptions()
    save: bool = False
    request: AnalysisRequest = AnalysisRequest(classical=False)
    """How to analyse runs whose result does not stand."""
    excluded: dict[str, str] = {}
    """Why runs do not count, by absolute path, beside the reasons that are kept in the runs."""
    counts_simulated: bool = True
    """Whether simulated runs count beside others. Where there are no others, they do."""


CountedRun = tuple[RunResult, RunDetails]


class FailedRun(msgspec.Struct, frozen=True):
    """A run that gives no result, and why, in one line."""

    run: str
    error: Message

    @property
    def reason(self) -> Message:
        """The error, in which the run is named without its folder."""
        name, values = Path(self.run).name, self.error.values
        shown = {key: name if value == self.run else value for key, value in values.items()}
        return Message(self.error.template, shown, self.error.plural)


@dataclass(frozen=True, eq=False, slots=True)
class CollectedRuns:
    """Runs with their results."""

    runs: tuple[RunResult, ...]  # in the order given, those of a folder by name; `name` is the absolute path
    failures: tuple[FailedRun, ...]
    warnings: tuple[ResultWarning, ...]
    details: dict[str, RunDetails]
    excluded: tuple[Excluded, ...] = ()
    """Runs without a result that are excluded in any case, with reasons."""
    simulated: tuple[str, ...] = ()  # paths of all simulated runs that have a result
    is_mixed: bool = False  # whether there are others beside these
    counts_simulated: bool = True  # whether the simulated ones are among `runs`

    def require_result(self) -> None:
        """Raise NoResultError where no run has a result."""
        if not self.runs:
            fault = self.failures[0].error if self.failures else message("all are left out")
            raise NoResultError("none of the runs gives a result: {fault}", fault=fault)

    @property
    def stands(self) -> dict[str, Stand]:
        """By `RunResult.stand_id`."""
        found: dict[str, Stand] = {}
        for run in self.runs:
            found.setdefault(run.stand_id, self.details[run.name].metadata.stand)
        return found

    @property
    def gauges(self) -> dict[str, Gauges]:
        """By `RunResult.calibration_id`."""
        found: dict[str, Gauges] = {}
        for run in self.runs:
            found.setdefault(run.calibration_id, self.details[run.name].metadata.gauges)
        return found

    def campaign(self) -> Campaign:
        """The campaign; excluded runs are listed, with a result or without."""
        contacts = dict.fromkeys(code for stand in self.stands.values() for code in stand.contacts)
        campaign = summarize(self.runs, known_contacts=tuple(contacts))
        return replace(campaign, excluded=(*campaign.excluded, *self.excluded))


def collect_runs(
    paths: Iterable[Path],
    options: CollectOptions | None = None,
    progress: Progress = lambda _share, _what: None,
) -> CollectedRuns:
    """Collect run files and folders: the newest result of each run that still stands, else a new one.

    `progress` is called with the share done (0 to 1) and what is being done. Raises RunNotFoundError,
    ExtraMissingError, ClusterError.
    """
    options = options or CollectOptions()
    given = [path.expanduser().absolute() for path in paths]
    collection = RunCollection()
    for collected in iter_collected(resolve_run_files(given), options, progress):
        collection.update(collected)
    return collection.collected_runs([path for path in given if path.is_dir()], options)


def iter_collected(
    files: Sequence[Path], options: CollectOptions, progress: Progress = lambda _share, _what: None
) -> Iterator[CollectedRun]:
    """Take what a campaign needs of each run, in the order given. Raises ExtraMissingError, ClusterError."""
    tasks = [AnalysisTask(str(path), options.request, options.save) for path in files]
    with open_executor(options.executor, len(tasks)) as executor:
        for came in map_runs(tasks, collect_run, executor, progress):
            yield CollectedRun(came.item.path, came.message) if isinstance(came, FailedItem) else came


class RunCollection:
    """Collected runs by path; stands, calibrations and names that many share are held once."""

    def __init__(self) -> None:
        self._collected: dict[str, CollectedRun] = {}
        self._shared: dict[bytes, Any] = {}

    def update(self, collected: CollectedRun) -> None:
        result, details = collected.result, collected.details
        if result is not None and details is not None:
            budget = tuple(
                replace(line, contribution_to=sys.intern(line.contribution_to)) for line in result.budget
            )
            metadata = details.metadata
            metadata = metadata.replace(
                stand=self._share(metadata.stand), gauges=self._share(metadata.gauges)
            )
            origin = details.origin
            if calibrations := origin.get("calibrations"):
                origin = origin | {"calibrations": self._share(calibrations)}
            collected = msgspec.structs.replace(
                collected,
                result=replace(result, budget=budget),
                details=msgspec.structs.replace(details, metadata=metadata, origin=origin),
            )
        self._collected[collected.path] = collected

    def _share(self, value: Shared) -> Shared:
        """The first value that equals this one."""
        shared: Shared = self._shared.setdefault(msgspec.json.encode(value), value)
        return shared

    def exclude(self, path: str, reason: str) -> None:
        """Note why a run does not count any more; "" for one that does again."""
        collected = self._collected[path]
        if collected.details is not None:
            metadata = collected.details.metadata.replace(excluded=reason)
            details = msgspec.structs.replace(collected.details, metadata=metadata)
            self._collected[path] = msgspec.structs.replace(collected, details=details)

    def keep_only(self, paths: Iterable[str]) -> None:
        self._collected = {path: self._collected[path] for path in paths}

    def collected_runs(self, folders: Sequence[Path], options: CollectOptions) -> CollectedRuns:
        pairs = [(one.result, one.details) for one in self._collected.values() if one.result and one.details]
        simulated = tuple(run.name for run, details in pairs if _is_simulated(details))
        is_mixed = 0 < len(simulated) < len(pairs)
        counts_simulated = options.counts_simulated or not is_mixed
        if not counts_simulated:
            pairs = [(run, details) for run, details in pairs if not _is_simulated(details)]
        runs = tuple(_with_reasons(pairs, options.excluded))
        details = {run.name: its for run, (_, its) in zip(runs, pairs, strict=True)}
        counted = [(run, details[run.name]) for run in runs if not run.excluded]
        failures, excluded = [], []
        for one in self._collected.values():
            kept_reason = one.details.metadata.excluded if one.details else ""
            if one.result is not None:
                continue
            if reason := options.excluded.get(one.path) or kept_reason:
                excluded.append(Excluded(one.path, reason))
            else:
                failures.append(FailedRun(one.path, one.error))
        warnings = tuple(campaign_warnings(counted, folders, saved=options.save))
        found = runs, tuple(failures), warnings, details, tuple(excluded)
        return CollectedRuns(*found, simulated, is_mixed, counts_simulated)


def _is_simulated(details: RunDetails) -> bool:
    return details.metadata.source_type is RunSource.SIMULATED


def _with_reasons(
    pairs: Iterable[tuple[RunResult, RunDetails]], reasons: Mapping[str, str]
) -> Iterator[RunResult]:
    """Runs with why they do not count; of the files of one recording the first that was not left out does."""
    first: dict[str, str] = {}
    for result, details in pairs:
        reason = reasons.get(result.name) or details.metadata.excluded
        if not reason and (other := first.setdefault(details.identifier, result.name)) != result.name:
            reason = f"the same recording as {other}: leave one of the files out"
        yield replace(result, excluded=reason) if reason else result


_NAMED = 3  # so many runs are named, the others counted


def campaign_warnings(
    runs: Sequence[CountedRun], folders: Sequence[Path], *, saved: bool
) -> Iterator[ResultWarning]:
    """Warnings of runs together; `folders` are those that were searched."""
    yield from _simulated_and_real(runs)
    yield from _different_stands(runs)
    yield from _contradictory_masses(runs)
    yield from _stale(runs, saved=saved)
    yield from _damaged(runs)
    yield from _series_without_runs(runs)
    yield from _left_out(folders)


def _simulated_and_real(runs: Sequence[CountedRun]) -> Iterator[ResultWarning]:
    simulated = [run.name for run, details in runs if _is_simulated(details)]
    if simulated and len(simulated) < len(runs):
        template = N_(
            "{count} of these {all} runs are simulated and count beside recorded ones: {listed}. Keep them in"
            " a folder of their own."
        )
        listed = _listed(simulated)
        text = message(template, count=len(simulated), all=len(runs), listed=listed)
        yield ResultWarning("simulated-and-real", text)


def _different_stands(runs: Sequence[CountedRun]) -> Iterator[ResultWarning]:
    by_name: dict[str, list[str]] = defaultdict(list)
    for run, details in runs:
        by_name[details.metadata.stand.name].append(run.name)
    if len(by_name) > 1:
        listed = "; ".join(f"{name!r}: {_listed(of_it)}" for name, of_it in by_name.items())
        yield ResultWarning(
            "different-stands",
            message(
                "these runs are of {count} stands ({said}). Give the runs of one stand at a time,"
                " each in a folder of its own.",
                count=len(by_name),
                said=listed,
            ),
        )


def _contradictory_masses(runs: Sequence[CountedRun]) -> Iterator[ResultWarning]:
    """Series whose runs say different masses, and runs whose plate has not the mass of their series."""
    by_series: dict[str, dict[tuple[float, float], list[str]]] = defaultdict(lambda: defaultdict(list))
    stands: dict[str, Stand] = {}
    for run, details in runs:
        key = run.series
        if key.code:
            by_series[key.code][key.table_mass_kg, key.plate_mass_kg].append(run.name)
            stands.setdefault(key.code, details.metadata.stand)
    remedy = message("Correct the wrong ones: slipstand edit RUN --plate-mass KG --table-mass KG.")
    for code, masses in by_series.items():
        if len(masses) > 1:
            listed = "; ".join(
                f"m1 = {table_kg:g} kg and m2 = {plate_kg:g} kg: {_listed(of_them)}"
                for (table_kg, plate_kg), of_them in masses.items()
            )
            yield ResultWarning(
                "contradictory-masses",
                message(
                    "the runs of {code} say different masses ({said}). {remedy}",
                    code=code,
                    said=listed,
                    remedy=remedy,
                ),
            )
        elif (nominal_kg := _nominal_mass_kg(stands[code], code)) not in (None, *(m2 for _, m2 in masses)):
            ((_, plate_kg), of_them) = next(iter(masses.items()))
            yield ResultWarning(
                "mass-not-of-series",
                message(
                    "the plate of {code} has {plate_kg:g} kg in {listed}, but {nominal_kg:g} kg by"
                    " its series. {remedy}",
                    code=code,
                    plate_kg=plate_kg,
                    listed=_listed(of_them),
                    nominal_kg=nominal_kg,
                    remedy=remedy,
                ),
            )


def _nominal_mass_kg(stand: Stand, code: str) -> float | None:
    try:
        return stand.series(code).plate_mass_kg
    except ConfigError:
        return None


def _stale(runs: Sequence[CountedRun], *, saved: bool) -> Iterator[ResultWarning]:
    stale = [run.name for run, details in runs if details.stale]
    if stale:
        kept = message("the new results are kept") if saved else message("keep the new results with --save")
        yield ResultWarning(
            "results-stale",
            message(
                "masses, pullback or calibration were changed after the analysis of {listed}: what"
                " is taken agrees with them now, {kept}.",
                listed=_listed(stale),
                kept=kept,
            ),
        )


def _damaged(runs: Sequence[CountedRun]) -> Iterator[ResultWarning]:
    damaged = [run.name for run, details in runs if details.damaged]
    if damaged:
        yield ResultWarning(
            "result-damaged",
            message(
                "results kept in {listed} are not what was kept: they are not taken. Restore a good copy.",
                listed=_listed(damaged),
            ),
        )


def _series_without_runs(runs: Sequence[CountedRun]) -> Iterator[ResultWarning]:
    """Series between those that have runs; a single series is no campaign that could lack any."""
    codes = {run.series.code for run, _ in runs if run.series.code}
    stands = {run.stand_id: details.metadata.stand for run, details in runs}
    if len(codes) < 2 or len(stands) != 1:
        return
    (stand,) = stands.values()
    wanted = [
        f"{pullback}{contact}{mass}"
        for contact in stand.contacts
        for pullback in stand.pullbacks_m
        for mass in stand.added_masses_kg
    ]
    missing = [code for code in wanted if code not in codes]
    if missing:
        yield ResultWarning(
            "series-without-runs",
            message(
                "{count} of the stand's {count_2} series have no run: {listed}. Record them, or"
                " look for their runs in another folder.",
                count=len(missing),
                count_2=len(wanted),
                listed=_listed(missing, 12),
            ),
        )


def _left_out(folders: Sequence[Path]) -> Iterator[ResultWarning]:
    for folder in folders:
        if thrown := list_trash(folder):
            yield ResultWarning(
                "runs-in-trash",
                message(
                    "{count} runs in the trash of {folder} are left out. Bring one back: slipstand"
                    " trash --restore RUN.",
                    count=len(thrown),
                    folder=folder,
                ),
            )
        if cut_short := unfinished_journals(folder):
            yield ResultWarning(
                "runs-cut-short",
                message(
                    "{count} recordings in {folder} were cut short and may hold more than is seen"
                    " here. Rebuild them: slipstand recover {folder}.",
                    count=len(cut_short),
                    folder=folder,
                ),
            )


def _listed(names: Sequence[str], most: int = _NAMED) -> str:
    shown = ", ".join(Path(name).name for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
