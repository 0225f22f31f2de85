"""Tasks of the Campaign screen, executed in its worker process."""

import datetime
from dataclasses import dataclass, field
from pathlib import Path

from app.presenters.base import ReportProgress, batch_progress
from app.presenters.campaign.formatting import TARGET_REPEATS, summarise
from app.presenters.campaign.state import CampaignScope, CampaignSummary
from app.runs.batch.executors import ExecutorOptions
from app.runs.campaign.collect import CollectedRuns, CollectOptions, RunCollection, iter_collected
from app.runs.edits import edit_run, undo_edit
from app.runs.listing import find_run_files
from app.runs.metadata_io import Change
from app.simulated_stand.synthetic_campaign import CampaignOptions, duration, plan_tests, record_tests
from config.files import load_gauges, load_stand
from messages.i18n import N_

FileStamp = tuple[int, int]  # time of the last change of a file (ns), and its size (bytes)
_READING = N_("Gathering {name}, {number} of {all}")
_RECORDING = N_("Recording {name}, {number} of {all}")


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


def collect(scope: CampaignScope, save: bool, report: ReportProgress) -> CampaignSummary:
    """Collect and summarise the runs of a folder; with `save`, save new results in their runs."""
    _collect(scope, report, save=save)
    return summarise(_cache.runs, scope.all_series)


def exclude_run(
    scope: CampaignScope, path: str, reason: str, author: str, report: ReportProgress
) -> CampaignSummary:
    """Record in a run why it is excluded, or with an empty reason that it is not, and summarise again."""
    change = edit_run(Path(path), author, excluded=reason)
    return _summarise_changed(scope, path, change, report)


def undo_exclusion(scope: CampaignScope, path: str, author: str, report: ReportProgress) -> CampaignSummary:
    """Undo the last exclusion or inclusion of a run, and summarise again."""
    change = undo_edit(Path(path), author, ("excluded",))
    return _summarise_changed(scope, path, change, report)


def simulate(folder: str, report: ReportProgress) -> str:
    """Simulate and record all tests of a campaign into a new folder below `folder`; return its path."""
    now = datetime.datetime.now().astimezone()
    place = Path(folder) / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    options = CampaignOptions(repeats=TARGET_REPEATS)
    tests = plan_tests(options, load_stand(), load_gauges(), place, now - duration(options))
    record_tests(tests, ExecutorOptions(), batch_progress(report, _RECORDING, [test.path for test in tests]))
    return str(place)


def collected_runs(scope: CampaignScope, report: ReportProgress) -> CollectedRuns:
    """Runs of a folder, which are collected if they are not those collected last."""
    if not _cache.holds(scope.folder):
        _collect(scope, report, save=False)
    _count(scope)
    return _cache.runs


def _collect(scope: CampaignScope, report: ReportProgress, *, save: bool) -> None:
    """Collect the files of a folder that are new or changed since the last call."""
    folder = scope.folder
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
    _count(scope, save=save)
    _cache.is_whole = True


def _count(scope: CampaignScope, *, save: bool = False) -> None:
    """Take the collected runs that count."""
    options = CollectOptions(save=save, counts_simulated=scope.counts_simulated)
    _cache.runs = _cache.collection.collected_runs(_folders(scope.folder), options)


def _summarise_changed(
    scope: CampaignScope, path: str, change: Change, report: ReportProgress
) -> CampaignSummary:
    """Update the cached run, of which nothing but the exclusion has changed."""
    if _cache.holds(scope.folder) and path in _cache.files:
        _cache.files[path] = _stamp(Path(path))
        _cache.collection.exclude(path, change.fields["excluded"])
        _count(scope)
    else:
        _collect(scope, report, save=False)
    return summarise(_cache.runs, scope.all_series)


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
