"""`slipstand demo --campaign`: all of Table 1 simulated, recorded, identified, held against its truth."""

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.errors import CommandError

if TYPE_CHECKING:
    from app.runs.batch.choice import CrewOptions
    from app.runs.campaign.gathering import Gathered
    from app.simulated_stand.campaign.comparison import Compared
    from app.simulated_stand.campaign.tests import CampaignOptions, SyntheticTest


def demo_campaign(
    options: "CampaignOptions", directory: Path | None, crew: "CrewOptions", *, as_json: bool
) -> None:
    """Simulate, record and identify a campaign; write its table beside the truth. Raises CommandError."""
    from analysis.campaign.campaign import summarize
    from app.cli import output as out
    from app.simulated_stand.campaign.comparison import compare, truths_of
    from app.simulated_stand.campaign.tests import plan_tests
    from config.files import load_gauges, load_stand

    stand, gauges, now = load_stand(), load_gauges(), datetime.datetime.now().astimezone()
    folder = _new_folder(directory, now)
    tests = plan_tests(options, stand, gauges, folder, now)
    folder.mkdir(parents=True, exist_ok=True)
    out.tell(f"{len(tests)} tests of {len({test.series for test in tests})} series are recorded in {folder}")
    _record(tests, crew)
    gathered = _gather(tests, crew)
    campaign = summarize(gathered.runs, known_contacts=tuple(stand.contacts))
    codes = [row.series.code for row in campaign.rows]
    compared = list(compare(campaign.rows, truths_of(options, stand, gauges, codes)))
    if as_json:
        out.emit_json(_document(folder, options, compared, gathered))
    else:
        _show(compared)
    if gathered.failures:
        raise CommandError(
            f"{len(gathered.failures)} of {len(tests)} runs could not be identified, the first:"
            f" {gathered.failures[0].error}"
        )


def _new_folder(directory: Path | None, now: datetime.datetime) -> Path:
    """Where the runs go: no folder that holds runs already, whose truth would be another one."""
    from app.runs.listing import find_runs
    from app.runs.places import recordings_directory

    if directory is None:
        return recordings_directory() / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    folder = directory.expanduser().resolve()
    if folder.is_file() or (folder.is_dir() and next(find_runs(folder), None) is not None):
        raise CommandError(f"--directory {folder} holds runs already, or is a file. Give a new folder")
    return folder


def _record(tests: "Sequence[SyntheticTest]", crew: "CrewOptions") -> None:
    from app.cli import output as out
    from app.runs.batch.analyses import each_run
    from app.runs.batch.choice import crew_of
    from app.runs.batch.in_order import Lost
    from app.simulated_stand.campaign.writing import record_test

    with out.progress("recording", total=1.0) as update, crew_of(crew, len(tests)) as workers:
        for came in each_run(tests, record_test, workers, update):
            error = came.message if isinstance(came, Lost) else came.error
            if error:
                raise CommandError(error)


def _gather(tests: "Sequence[SyntheticTest]", crew: "CrewOptions") -> "Gathered":
    from app.cli import output as out
    from app.runs.campaign.gathering import GatherOptions, gather

    with out.progress("identifying", total=1.0) as update:
        return gather([Path(test.path) for test in tests], GatherOptions(crew, save=True), update)


def _document(
    folder: Path, options: "CampaignOptions", compared: "Sequence[Compared]", gathered: "Gathered"
) -> dict[str, Any]:
    import msgspec

    rows: dict[str, dict[str, Any]] = {}
    for one in compared:
        row = rows.setdefault(one.series, {"series": one.series})
        row[one.name] = {
            "value": one.value,
            "standard_uncertainty": one.standard_uncertainty,
            "interval_95": list(one.interval_95),
            "truth": one.truth,
            "inside": one.inside,
        }
    return {
        "schema": "slipstand-synthetic-campaign/1",
        "directory": str(folder),
        "options": msgspec.to_builtins(options),
        "runs": [run.name for run in gathered.runs],
        "failures": msgspec.to_builtins(gathered.failures),
        "inside": sum(one.inside for one in compared),
        "compared": len(compared),
        "rows": list(rows.values()),
    }


def _show(compared: "Sequence[Compared]") -> None:
    """Found, true, and the difference in standard uncertainties; `!` where the 95 % interval misses."""
    from analysis.campaign.columns import COLUMNS
    from app.cli import output as out

    symbols = {column.name: f"{column.symbol} {column.unit}".removesuffix(" 1") for column in COLUMNS}
    rows = [
        (
            one.series,
            symbols[one.name],
            out.rounded(one.value, one.standard_uncertainty),
            f"{one.truth:.6g}",
            f"{one.off:+.1f} u" if one.standard_uncertainty else "",
            "" if one.inside else "!",
        )
        for one in compared
    ]
    out.table(("series", "", "found", "true", "off by", ""), rows)
    inside = sum(one.inside for one in compared)
    out.say(f"{inside} of {len(compared)} 95 % intervals hold the truth ({inside / len(compared):.1%})")
