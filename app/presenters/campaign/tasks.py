"""What the worker does for the Campaign screen: gather, sum up, write, simulate. Runs in its process."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from app.presenters.campaign.state import Product
from app.presenters.results import sentence
from app.presenters.screen import Progress
from app.presenters.words import tr
from app.presenters.worker import Report

if TYPE_CHECKING:
    from analysis.campaign.campaign import Campaign
    from analysis.campaign.contacts import ContactFriction
    from analysis.campaign.runs import RunResult
    from analysis.quantities import Quantity
    from app.runs.campaign.gathering import Gathered
    from config.schema import Stand

REPEATS = 3
"""Tests of each series that a campaign should have."""


@dataclass(frozen=True, slots=True)
class Exclusion:
    """A run that the operator has left out, and why."""

    path: str
    reason: str


@dataclass(frozen=True, slots=True)
class Gather:
    """Gather a folder of runs, and sum it up; with `save` keep new results in their runs."""

    folder: str
    all_series: tuple[str, ...]
    exclusions: tuple[Exclusion, ...] = ()
    save: bool = False


@dataclass(frozen=True, slots=True)
class SumUp:
    """Sum up again what was gathered, with other runs left out."""

    folder: str
    all_series: tuple[str, ...]
    exclusions: tuple[Exclusion, ...]


@dataclass(frozen=True, slots=True)
class Write:
    """Write a product of what was gathered to a file or folder."""

    folder: str
    exclusions: tuple[Exclusion, ...]
    product: Product
    target: str


@dataclass(frozen=True, slots=True)
class Synthesise:
    """Simulate a whole campaign into a folder."""

    folder: str
    repeats: int = REPEATS


CampaignTask = Gather | SumUp | Write | Synthesise


@dataclass(frozen=True, eq=False, slots=True)
class FoundRun:
    """A run, as far as the screen tells of it."""

    path: str
    friction: "Quantity | None"
    adequate: bool | None
    excluded: str


@dataclass(frozen=True, eq=False, slots=True)
class Expected:
    """What a test would show.

    Attributes
    ----------
    series : str
    runs : int
        That there are.
    friction : Quantity
        With the uncertainty of a single test.
    known : Quantity or None
        As the runs of the series have it now.
    residual_displacement_m : float
    cautions : tuple of str
    """

    series: str
    runs: int
    friction: "Quantity | None"
    known: "Quantity | None"
    residual_displacement_m: float
    cautions: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class FoundCampaign:
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
    cautions : tuple of str
        Of the gathering.
    unsaved : int
        Runs whose result is not kept in them.
    expected : Expected or None
        Of the test to make next.
    """

    campaign: "Campaign"
    contacts: "tuple[ContactFriction, ...]"
    contact_names: dict[str, str]
    runs: dict[str, FoundRun]
    failures: tuple[tuple[str, str], ...]
    cautions: tuple[str, ...]
    unsaved: int
    expected: Expected | None


class _Kept:
    """What this process has gathered last: a folder that is as it was is not read again."""

    folder: ClassVar = ""
    files: ClassVar[tuple[tuple[str, int, int], ...]] = ()
    gathered: "ClassVar[Gathered | None]" = None


def do(task: CampaignTask, report: Report) -> Any:
    """Do a task. Raises RunError, ConfigError, AnalysisError."""
    match task:
        case Gather(folder, save=save):
            _gather(folder, report, save=save)
            return _summed_up(task)
        case SumUp(folder):
            if _Kept.folder != folder:
                _gather(folder, report, save=False)
            return _summed_up(task)
        case Write(folder):
            if _Kept.folder != folder:
                _gather(folder, report, save=False)
            return _write(task, report)
        case Synthesise():
            return _synthesise(task, report)


def _gather(folder: str, report: Report, *, save: bool) -> None:
    """Gather a folder unless it is as it was; an empty one holds a campaign without runs."""
    from app.runs.batch.choice import CrewOptions
    from app.runs.campaign.gathering import Gathered, GatherOptions, gather

    files = _files(Path(folder))
    if (folder, files) == (_Kept.folder, _Kept.files) and not save:
        return
    _Kept.folder = ""
    options = GatherOptions(CrewOptions(jobs=1), save=save)  # this process may have no children of its own
    if files:
        _Kept.gathered = gather([Path(folder)], options, _reporting(report))
    else:
        _Kept.gathered = Gathered((), (), (), {}, {}, {})
    _Kept.folder, _Kept.files = folder, _files(Path(folder)) if save else files


def _files(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """Run files of a folder with what changes when they do: time of the last change, and size."""
    from app.runs.listing import find_runs

    found = [(path, path.stat()) for path in find_runs(folder)] if folder.is_dir() else []
    return tuple((str(path), stat.st_mtime_ns, stat.st_size) for path, stat in found)


def _reporting(report: Report) -> Callable[[float, str], None]:
    return lambda share, what: report(Progress(sentence(what), share))


def _campaign(exclusions: tuple[Exclusion, ...]) -> "tuple[Gathered, tuple[RunResult, ...], Campaign]":
    """What was gathered, its runs with those marked that are left out, and all of it summed up."""
    from analysis.campaign.campaign import summarize

    gathered = _Kept.gathered
    if gathered is None:
        raise RuntimeError("nothing was gathered that could be summed up")
    reasons = {exclusion.path: exclusion.reason for exclusion in exclusions}
    runs = tuple(
        replace(run, excluded=reasons[run.name]) if run.name in reasons else run for run in gathered.runs
    )
    contacts = dict.fromkeys(code for stand in gathered.stands.values() for code in stand.contacts)
    return gathered, runs, summarize(runs, known_contacts=tuple(contacts))


def _summed_up(task: Gather | SumUp) -> FoundCampaign:
    from analysis.campaign.contacts import friction_by_contact

    gathered, runs, campaign = _campaign(task.exclusions)
    return FoundCampaign(
        campaign,
        friction_by_contact(campaign.rows),
        {code: named.name for stand in gathered.stands.values() for code, named in stand.contacts.items()},
        {
            run.name: FoundRun(run.name, run.results.get("friction_dynamic"), run.adequate, run.excluded)
            for run in runs
        },
        tuple((failure.run, failure.error) for failure in gathered.failures),
        tuple(caution.message for caution in gathered.cautions),
        sum(facts.analysis is None for facts in gathered.facts.values()),
        _expected(campaign, task.all_series),
    )


def _expected(campaign: "Campaign", all_series: tuple[str, ...]) -> Expected | None:
    """The test of the series with the fewest runs; None where every series has enough."""
    from analysis.record import AnalysisError
    from config.files import load_stand
    from config.schema import ConfigError

    counts = dict.fromkeys(all_series, 0)
    for row in campaign.rows:
        if row.series.code in counts:
            counts[row.series.code] += len(row.runs)
    series = min(counts, key=lambda code: counts[code], default=None)
    if series is None or counts[series] >= REPEATS:
        return None
    try:
        return _planned(series, counts[series], campaign, load_stand())
    except (AnalysisError, ConfigError):  # a series of a stand that is not described here
        return Expected(series, counts[series], None, None, float("nan"), ())


def _planned(code: str, runs: int, campaign: "Campaign", stand: "Stand") -> Expected:
    """Plan a test by what its series, or else the published table, says of T, n1 and f_d."""
    from analysis.motion.two_mass import TwoMassParameters
    from analysis.plan import plan
    from app.runs.planned import planned_test
    from config.files import load_gauges, published_row

    series, printed = stand.series(code), published_row(code)
    own = next((row.quantities for row in campaign.rows if row.series.code == code), {})
    found = {name: own[name].quantity for name in own}
    values = {
        name: found[name].value if name in found else getattr(printed, name)
        for name in ("period_s", "damping_n1_per_s", "friction_dynamic")
    }
    parameters = TwoMassParameters.from_free_decay(
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
        pullback_m=series.pullback_m,
        **values,
    )
    planned = plan(planned_test(parameters, stand, load_gauges()))
    return Expected(
        code,
        runs,
        planned.results.get("friction_dynamic"),
        found.get("friction_dynamic"),
        planned.motion.residual_displacement_m,
        tuple(sentence(caution.message) for caution in planned.cautions),
    )


def _write(task: Write, report: Report) -> tuple[str, ...]:
    from app.presenters.campaign.products import write

    gathered, runs, campaign = _campaign(task.exclusions)
    return write(task.product, Path(task.target), replace(gathered, runs=runs), campaign, report)


def _synthesise(task: Synthesise, report: Report) -> str:
    """Record all tests of a synthetic campaign into a new folder; returns its path."""
    from app.simulated_stand.campaign.tests import CampaignOptions, plan_tests
    from app.simulated_stand.campaign.writing import write_test
    from config.files import load_gauges, load_stand

    now = datetime.datetime.now().astimezone()
    folder = Path(task.folder) / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    tests = plan_tests(CampaignOptions(repeats=task.repeats), load_stand(), load_gauges(), folder, now)
    folder.mkdir(parents=True)
    for done, test in enumerate(tests):
        report(Progress(tr("Recording {run}", run=Path(test.path).name), done / len(tests)))
        write_test(test)
    return str(folder)
