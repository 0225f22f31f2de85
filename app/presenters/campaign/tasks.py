"""What the worker does for the Campaign screen: gather, sum up, write, simulate. Runs in its process."""

import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from app.presenters.batch_text import batch_progress
from app.presenters.campaign.next_test import TARGET_REPEATS, PlannedTest, plan_next_test
from app.presenters.campaign.state import Product
from app.presenters.worker import ReportProgress
from messages.i18n import N_
from messages.message import Message

if TYPE_CHECKING:
    from analysis.campaign.campaign import Campaign
    from analysis.campaign.contacts import ContactFriction
    from analysis.quantities import Quantity
    from app.runs.campaign.collect import CollectedRuns, RunCollection

FileStamp = tuple[int, int]
"""Of a file: time of its last change (ns) and size (bytes)."""
_READING = N_("Gathering {name}, {number} of {all}")
_RECORDING = N_("Recording {name}, {number} of {all}")


@dataclass(frozen=True, slots=True)
class CollectRuns:
    """Gather a folder of runs, and sum it up; with `save` keep new results in their runs."""

    folder: str
    all_series: tuple[str, ...]
    save: bool = False


@dataclass(frozen=True, slots=True)
class ExcludeRun:
    """Note in a run why it does not count, or "" that it does again, and sum up what was gathered."""

    folder: str
    all_series: tuple[str, ...]
    path: str
    reason: str
    author: str


@dataclass(frozen=True, slots=True)
class UndoExclusion:
    """Take back what was last noted in a run of whether it counts, and sum up what was gathered."""

    folder: str
    all_series: tuple[str, ...]
    path: str
    author: str


@dataclass(frozen=True, slots=True)
class WriteProduct:
    """Write a product of what was gathered to a file or folder."""

    folder: str
    product: Product
    target: str


@dataclass(frozen=True, slots=True)
class SimulateCampaign:
    """Simulate a whole campaign into a folder."""

    folder: str
    repeats: int = TARGET_REPEATS


CampaignTask = CollectRuns | ExcludeRun | UndoExclusion | WriteProduct | SimulateCampaign


@dataclass(frozen=True, eq=False, slots=True)
class CampaignRun:
    """A run, as far as the screen tells of it."""

    path: str
    friction: "Quantity | None"
    adequate: bool | None


@dataclass(frozen=True, eq=False, slots=True)
class CampaignData:
    """A folder of runs, summed up.

    Attributes
    ----------
    campaign : Campaign
    contacts : tuple of ContactFriction
    contact_names : dict of str
        What the codes of contacts stand for.
    runs : dict of FoundRun
        By path.
    failures : tuple of (str, str)
        Path, and why there is no result.
    warnings : tuple of Message
        Of the gathering.
    left_out : frozenset of str
        Paths of runs that say themselves that they do not count, and can be taken in again.
    unsaved : int
        Runs whose result is not kept in them.
    expected : Expected or None
        Of the test to make next.
    """

    campaign: "Campaign"
    contacts: "tuple[ContactFriction, ...]"
    contact_names: dict[str, str]
    runs: dict[str, CampaignRun]
    failures: tuple[tuple[str, str], ...]
    warnings: tuple[Message, ...]
    excluded_by_operator: frozenset[str]
    unsaved_count: int
    next_test: PlannedTest | None


class _Cache:
    """What this process has gathered last: files that are as they were are not read again."""

    folder: ClassVar = ""
    is_whole: ClassVar = False
    """All that follows is of this folder as it was."""
    files: ClassVar[dict[str, FileStamp]] = {}
    accounts: "ClassVar[RunCollection]"
    gathered: "ClassVar[CollectedRuns]"


def execute(task: CampaignTask, report: ReportProgress) -> Any:
    """Do a task. Raises RunError, ConfigError, AnalysisError."""
    match task:
        case CollectRuns(folder, all_series, save):
            _gather(folder, report, save=save)
            return _summed_up(all_series)
        case ExcludeRun() | UndoExclusion():
            _exclude(task, report)
            return _summed_up(task.all_series)
        case WriteProduct(folder):
            if not _is_kept(folder):
                _gather(folder, report, save=False)
            return _write(task, report)
        case SimulateCampaign():
            return _synthesise(task, report)


def _gather(folder: str, report: ReportProgress, *, save: bool) -> None:
    """Gather what is new in a folder, by the crew of the command line; an empty one has no runs."""
    from app.runs.campaign.collect import CollectOptions, RunCollection, iter_collected

    if folder != _Cache.folder:
        _Cache.folder, _Cache.is_whole, _Cache.files, _Cache.accounts = folder, False, {}, RunCollection()
    found = _files(Path(folder))
    unsaved = _unsaved() if save and _Cache.is_whole else set()
    new = [path for path, state in found.items() if _Cache.files.get(path) != state or path in unsaved]
    options = CollectOptions(save=save)
    _Cache.is_whole = False
    tell = batch_progress(report, _READING, new)
    for account in iter_collected([Path(path) for path in new], options, tell):
        _Cache.accounts.update(account)
        _Cache.files[account.path] = found[account.path] if not save else _state(Path(account.path))
    _Cache.files = {path: _Cache.files[path] for path in found}
    _Cache.accounts.keep_only(found)
    _Cache.gathered = _Cache.accounts.collected_runs(_folders(folder), options)
    _Cache.is_whole = True


def _exclude(task: ExcludeRun | UndoExclusion, report: ReportProgress) -> None:
    """Note in a run whether it counts; nothing else of it has changed, so that it is not read again."""
    from app.runs.campaign.collect import CollectOptions
    from app.runs.edits import edit_run, undo_edit

    path = Path(task.path)
    if isinstance(task, ExcludeRun):
        change = edit_run(path, task.author, excluded=task.reason)
    else:
        change = undo_edit(path, task.author, ("excluded",))
    if not _is_kept(task.folder) or task.path not in _Cache.files:
        _gather(task.folder, report, save=False)
        return
    _Cache.files[task.path] = _state(path)
    _Cache.accounts.exclude(task.path, change.fields["excluded"])
    _Cache.gathered = _Cache.accounts.collected_runs(_folders(task.folder), CollectOptions())


def _folders(folder: str) -> list[Path]:
    """The folder where there is one: the recordings folder is made by the first run."""
    return [Path(folder)] if Path(folder).is_dir() else []


def _is_kept(folder: str) -> bool:
    return _Cache.is_whole and _Cache.folder == folder


def _unsaved() -> set[str]:
    """Runs whose result is not kept in them."""
    return {path for path, facts in _Cache.gathered.details.items() if facts.analysis is None}


def _files(folder: Path) -> dict[str, FileStamp]:
    """Run files of a folder, by name, with what changes when they do."""
    from app.runs.listing import find_run_files

    return {str(path): _state(path) for path in sorted(find_run_files(folder))} if folder.is_dir() else {}


def _state(path: Path) -> FileStamp:
    """Time of the last change, and size; 0 of a file that has gone."""
    try:
        stat = path.stat()
    except FileNotFoundError:
        return 0, 0
    return stat.st_mtime_ns, stat.st_size


def _summed_up(all_series: tuple[str, ...]) -> CampaignData:
    from analysis.campaign.contacts import friction_by_contact

    gathered = _Cache.gathered
    campaign = gathered.campaign()
    return CampaignData(
        campaign,
        friction_by_contact(campaign.rows),
        {code: named.name for stand in gathered.stands.values() for code, named in stand.contacts.items()},
        {
            run.name: CampaignRun(run.name, run.results.get("friction_dynamic"), run.adequate)
            for run in gathered.runs
        },
        tuple((failure.run, failure.error) for failure in gathered.failures),
        tuple(caution.message for caution in gathered.warnings),
        frozenset(path for path, facts in gathered.details.items() if facts.excluded)
        | {one.run for one in gathered.excluded},
        len(_unsaved()),
        plan_next_test(campaign, all_series),
    )


def _write(task: WriteProduct, report: ReportProgress) -> tuple[str, ...]:
    from app.presenters.campaign.products import write_product

    return write_product(task.product, Path(task.target), _Cache.gathered, _Cache.gathered.campaign(), report)


def _synthesise(task: SimulateCampaign, report: ReportProgress) -> str:
    """Record all tests of a synthetic campaign into a new folder; returns its path."""
    from app.runs.batch.executors import ExecutorOptions, open_executor
    from app.runs.batch.ordered_map import FailedItem
    from app.runs.batch.tasks import map_runs
    from app.runs.errors import RunError
    from app.simulated_stand.synthetic_campaign import CampaignOptions, plan_tests, record_test
    from config.files import load_gauges, load_stand

    now = datetime.datetime.now().astimezone()
    folder = Path(task.folder) / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    tests = plan_tests(CampaignOptions(repeats=task.repeats), load_stand(), load_gauges(), folder, now)
    folder.mkdir(parents=True)
    tell = batch_progress(report, _RECORDING, [test.path for test in tests])
    with open_executor(ExecutorOptions(), len(tests)) as crew:
        for came in map_runs(tests, record_test, crew, tell):
            if error := came.message if isinstance(came, FailedItem) else came.error:
                raise RunError(error)
    return str(folder)
