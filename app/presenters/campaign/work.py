"""Tasks of the Campaign screen, executed in its worker process."""

import datetime
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analysis.campaign.campaign import Campaign
from analysis.campaign.contacts import friction_by_contact
from analysis.motion.two_mass import TwoMassParameters
from analysis.plan import plan
from analysis.record import AnalysisError
from app.presenters.base import ReportProgress, batch_progress
from app.presenters.campaign.tasks import (
    TARGET_REPEATS,
    CampaignData,
    CampaignRun,
    CampaignTask,
    CollectRuns,
    ExcludeRun,
    PlannedTest,
    SimulateCampaign,
    UndoExclusion,
    WriteProduct,
)
from app.presenters.results import sentence
from app.presenters.worker import LazyFunction
from app.runs.batch.executors import ExecutorOptions, FailedItem, open_executor
from app.runs.batch.tasks import map_runs
from app.runs.campaign.collect import CollectedRuns, CollectOptions, RunCollection, iter_collected
from app.runs.edits import edit_run, undo_edit
from app.runs.errors import RunError
from app.runs.listing import find_run_files
from app.runs.plan_json import build_planned_test
from app.simulated_stand.synthetic_campaign import CampaignOptions, plan_tests, record_test
from config.files import load_gauges, load_stand, published_row
from config.schema import ConfigError, Stand
from messages.i18n import N_

FileStamp = tuple[int, int]
"""Time of the last change of a file (ns), and its size (bytes)."""
_READING = N_("Gathering {name}, {number} of {all}")
_RECORDING = N_("Recording {name}, {number} of {all}")
# Loaded when a product is written: it loads matplotlib and typst.
_WRITE_PRODUCT = LazyFunction("app.presenters.campaign.products", "write_product")


@dataclass
class _Cache:
    """Last collected folder of this process: unchanged files are not read again."""

    folder: str = ""
    is_whole: bool = False
    files: dict[str, FileStamp] = field(default_factory=dict)
    collection: RunCollection = field(default_factory=RunCollection)
    runs: CollectedRuns = field(default_factory=lambda: RunCollection().collected_runs([], CollectOptions()))

    def holds(self, folder: str) -> bool:
        return self.is_whole and self.folder == folder


_cache = _Cache()


def execute(task: CampaignTask, report: ReportProgress) -> Any:
    """Execute a task. Raises RunError, ConfigError, AnalysisError."""
    match task:
        case CollectRuns(folder, all_series, save):
            _collect(folder, report, save=save)
            return _summarise(all_series)
        case ExcludeRun() | UndoExclusion():
            _exclude(task, report)
            return _summarise(task.all_series)
        case WriteProduct(folder):
            if not _cache.holds(folder):
                _collect(folder, report, save=False)
            return _WRITE_PRODUCT(task.product, Path(task.target), _cache.runs, report)
        case SimulateCampaign():
            return _simulate(task, report)


def _collect(folder: str, report: ReportProgress, *, save: bool) -> None:
    """Collect the files of a folder that are new or changed since the last call."""
    if folder != _cache.folder:
        _cache.folder, _cache.is_whole, _cache.files, _cache.collection = folder, False, {}, RunCollection()
    files_now = _run_files(Path(folder))
    unsaved = _unsaved_runs() if save and _cache.is_whole else set()
    new = [path for path, stamp in files_now.items() if _cache.files.get(path) != stamp or path in unsaved]
    options = CollectOptions(save=save)
    _cache.is_whole = False
    step = batch_progress(report, _READING, new)
    for collected in iter_collected([Path(path) for path in new], options, step):
        _cache.collection.update(collected)
        _cache.files[collected.path] = files_now[collected.path] if not save else _stamp(Path(collected.path))
    _cache.files = {path: _cache.files[path] for path in files_now}
    _cache.collection.keep_only(files_now)
    _cache.runs = _cache.collection.collected_runs(_folders(folder), options)
    _cache.is_whole = True


def _exclude(task: ExcludeRun | UndoExclusion, report: ReportProgress) -> None:
    """Record the exclusion in the run and in the cache: nothing else of the run has changed."""
    path = Path(task.path)
    if isinstance(task, ExcludeRun):
        change = edit_run(path, task.author, excluded=task.reason)
    else:
        change = undo_edit(path, task.author, ("excluded",))
    if not _cache.holds(task.folder) or task.path not in _cache.files:
        _collect(task.folder, report, save=False)
        return
    _cache.files[task.path] = _stamp(path)
    _cache.collection.exclude(task.path, change.fields["excluded"])
    _cache.runs = _cache.collection.collected_runs(_folders(task.folder), CollectOptions())


def _folders(folder: str) -> list[Path]:
    """The folder, if it exists: the first recording creates the recordings folder."""
    return [Path(folder)] if Path(folder).is_dir() else []


def _unsaved_runs() -> set[str]:
    """Paths of runs whose result is not saved in them."""
    return {path for path, details in _cache.runs.details.items() if details.analysis is None}


def _run_files(folder: Path) -> dict[str, FileStamp]:
    """Run files of a folder, and the stamp of each."""
    return {str(path): _stamp(path) for path in sorted(find_run_files(folder))} if folder.is_dir() else {}


def _stamp(path: Path) -> FileStamp:
    """Stamp of a file; zeros if it is gone."""
    try:
        stat = path.stat()
    except FileNotFoundError:
        return 0, 0
    return stat.st_mtime_ns, stat.st_size


def _summarise(all_series: tuple[str, ...]) -> CampaignData:
    runs = _cache.runs
    campaign = runs.campaign()
    return CampaignData(
        campaign,
        friction_by_contact(campaign.rows),
        {code: named.name for stand in runs.stands.values() for code, named in stand.contacts.items()},
        {
            run.name: CampaignRun(run.name, run.results.get("friction_dynamic"), run.adequate)
            for run in runs.runs
        },
        tuple((failure.run, failure.error) for failure in runs.failures),
        tuple(warning.message for warning in runs.warnings),
        frozenset(path for path, details in runs.details.items() if details.excluded)
        | {one.run for one in runs.excluded},
        len(_unsaved_runs()),
        plan_next_test(campaign, all_series),
    )


def _simulate(task: SimulateCampaign, report: ReportProgress) -> str:
    """Simulate and record all tests of a campaign into a new folder; return its path."""
    now = datetime.datetime.now().astimezone()
    folder = Path(task.folder) / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    tests = plan_tests(CampaignOptions(repeats=task.repeats), load_stand(), load_gauges(), folder, now)
    folder.mkdir(parents=True)
    step = batch_progress(report, _RECORDING, [test.path for test in tests])
    with open_executor(ExecutorOptions(), len(tests)) as executor:
        for result in map_runs(tests, record_test, executor, step):
            if error := result.message if isinstance(result, FailedItem) else result.error:
                raise RunError(error)
    return str(folder)


def plan_next_test(campaign: Campaign, all_series: tuple[str, ...]) -> PlannedTest | None:
    """Plan a test of the series with the fewest runs; None if every series has enough."""
    counts = dict.fromkeys(all_series, 0)
    for row in campaign.rows:
        if row.series.code in counts:
            counts[row.series.code] += len(row.runs)
    series = min(counts, key=lambda code: counts[code], default=None)
    if series is None or counts[series] >= TARGET_REPEATS:
        return None
    try:
        return _planned(series, counts[series], campaign, load_stand())
    except (AnalysisError, ConfigError):  # the stand of the series is not configured here
        return PlannedTest(series, counts[series], None, None, float("nan"), ())


def _planned(code: str, runs: int, campaign: Campaign, stand: Stand) -> PlannedTest:
    """Plan a test with T, n1 and f_d of its series, else of the published table."""
    series, published = stand.series(code), published_row(code)
    own = next((row.quantities for row in campaign.rows if row.series.code == code), {})
    pooled = {name: own[name].quantity for name in own}
    values = {
        name: pooled[name].value if name in pooled else getattr(published, name)
        for name in ("period_s", "damping_n1_per_s", "friction_dynamic")
    }
    parameters = TwoMassParameters.from_free_decay(
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
        pullback_m=series.pullback_m,
        **values,
    )
    planned = plan(build_planned_test(parameters, stand, load_gauges()))
    return PlannedTest(
        code,
        runs,
        planned.results.get("friction_dynamic"),
        pooled.get("friction_dynamic"),
        planned.motion.residual_displacement_m,
        tuple(sentence(warning.message) for warning in planned.warnings),
    )
