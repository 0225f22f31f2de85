"""`slipstand demo`: one pullback of the simulated stand, from the wire to f_d, found beside true."""

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import typer

from analysis.campaign.campaign import summarize
from analysis.catalogue import Place, definition
from analysis.formatting import format_value
from app.acquisition.messages import EndReason, PortSettings, RunSettings
from app.cli import output as out
from app.cli.analysis_text import print_analysis
from app.cli.analyze import save_figure
from app.cli.errors import CommandError
from app.cli.measurement_options import DemoOptions
from app.cli.option_values import calibration_file, checked, executor_options, key_values, recordings_folder
from app.cli.record import record_with_progress
from app.runs.analysis_json import read_quantity
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from app.runs.campaign.collect import CollectedRuns, CollectOptions, collect_runs
from app.runs.listing import find_run_files
from app.runs.paths import recordings_directory
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.effects import EFFECTS, gauge_values, motion_values, parse_effects
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.synthetic_campaign import (
    CampaignOptions,
    Comparison,
    compare,
    duration,
    plan_tests,
    record_tests,
    series_truths,
)
from config.files import load_gauges, load_stand

_RECORD_S = 8.0  # the demo's run ends this long after release


def demo(options: DemoOptions) -> None:
    if options.campaign:
        _record_campaign(options)
    else:
        _record_test(options)


def _record_test(options: DemoOptions) -> None:
    out.print_status("starting the simulated stand (a first start compiles the solver, up to a minute)")
    series, friction = options.series or "1FFM0", options.friction
    effects = parse_effects(key_values(options.effects, "--effect"))
    stand_options = checked(
        SimulatedStandOptions,
        DemoOptions,
        series=series,
        friction=friction,
        effects=effects,
        decay_s=_RECORD_S + 2.0,
    )
    with SimulatedStand.start(stand_options) as stand:
        port = PortSettings(
            url=stand.port, protocol=stand_options.protocol, rate_hz=stand_options.rate_hz, simulated=True
        )
        run = RunSettings(
            directory=str(recordings_folder(options.directory)),
            series=series,
            duration_s=_RECORD_S,
            operator="demo",
            note="recorded from the simulated stand",
        )
        (ended,) = record_with_progress(port, run, calibration_file(None), simulated=True)
        truth = msgspec.to_builtins(stand.truth().stand)
        truth |= motion_values(effects) | gauge_values(effects)
    if ended.ended == EndReason.INTERRUPTED:
        raise typer.Exit(130)
    if ended.ended != EndReason.DURATION:
        kept = f" (kept in {ended.path})" if ended.path else ""
        raise CommandError(f"the demo's run ended: {ended.ended}. {ended.message}{kept}")
    path = Path(ended.path)
    with out.progress_bar("identifying", total=1.0) as update:
        analysis = analyze_run(path, AnalysisRequest(), save=True, progress=update)
    figure = path.with_suffix(".png")
    save_figure(analysis, figure)
    if options.as_json:
        out.print_json(analysis.document | {"truth": truth, "figure": str(figure)})
    else:
        print_analysis(analysis.document)
        _print_compared(analysis.document["results"], truth)
        out.print_line(f"  figure         {figure}")


_COMPARED = (
    "friction_dynamic", "tilt_rad", "period_s", "damping_n1_per_s", "stiffness_n_per_m", "pullback_m",
)  # fmt: skip


def _print_compared(results: dict[str, Any], truth: dict[str, float]) -> None:
    """Write found beside true, and their difference in per cent and in standard uncertainties."""
    rows = []
    effects = (effect.parameter for effect in EFFECTS.values() if effect.parameter in truth)
    for name in (*_COMPARED, *effects):
        if name not in results:
            continue
        row, found, true = definition(name), read_quantity(results[name]), truth[name]
        off, scale = found.value - true, row.unit_at(Place.TERMINAL).scale
        uncertainty = found.standard_uncertainty or 0.0
        shown = str(format_value(found.value * scale, uncertainty * scale))
        per_cent = f"{100 * off / true:+.3f} %" if true else ""
        spread = f"{off / uncertainty:+.1f} u" if uncertainty else ""
        rows.append((row.heading(Place.TERMINAL), shown, f"{true * scale:.6g}", per_cent, spread))
    out.print_table(("", "found", "true", "off by", ""), rows)


def _record_campaign(options: DemoOptions) -> None:
    """Simulate, record and identify a campaign; write its table beside the truth."""
    if options.friction is not None:
        raise CommandError("--friction is for one test. In a campaign f_d is that of Table 1")
    codes = tuple(code.strip() for code in (options.series or "").split(",") if code.strip())
    campaign_options = checked(
        CampaignOptions,
        DemoOptions,
        series=codes,
        repeats=options.repeats,
        friction_scatter=options.friction_scatter,
        seed=options.seed,
        effects=parse_effects(key_values(options.effects, "--effect")),
    )
    executor = executor_options(options.jobs)
    stand, gauges, now = load_stand(), load_gauges(), datetime.datetime.now().astimezone()
    folder = _new_folder(options.directory, now)
    begins = now - duration(campaign_options)
    tests = plan_tests(campaign_options, stand, gauges, folder, begins)
    series = len({test.series for test in tests})
    recorded = "1 test is" if len(tests) == 1 else f"{len(tests)} tests of {series} series are"
    out.print_status(f"{recorded} recorded in {folder}")
    with out.progress_bar("recording", total=1.0) as update:
        record_tests(tests, executor, update)
    with out.progress_bar("identifying", total=1.0) as update:
        collect = CollectOptions(executor, save=True)
        collected = collect_runs([Path(test.path) for test in tests], collect, update)
    rows = summarize(collected.runs, known_contacts=tuple(stand.contacts)).rows
    truths = series_truths(campaign_options, stand, gauges, [row.series.code for row in rows])
    compared = list(compare(rows, truths))
    if options.as_json:
        out.print_json(_document(folder, campaign_options, compared, collected))
    else:
        _print_campaign(compared)
    if collected.failures:
        raise CommandError(
            f"{len(collected.failures)} of {len(tests)} runs could not be identified, the first:"
            f" {collected.failures[0].error}"
        )


def _new_folder(directory: Path | None, now: datetime.datetime) -> Path:
    """Where the runs go: no folder that holds runs already, whose truth would be another one."""
    if directory is None:
        return recordings_directory() / f"synthetic-campaign-{now:%Y%m%dT%H%M%S}"
    folder = directory.expanduser().resolve()
    if folder.is_file() or (folder.is_dir() and next(find_run_files(folder), None) is not None):
        raise CommandError(f"--directory {folder} holds runs already, or is a file. Give a new folder")
    return folder


def _document(
    folder: Path, options: CampaignOptions, compared: Sequence[Comparison], collected: CollectedRuns
) -> dict[str, Any]:
    rows: dict[str, dict[str, Any]] = {}
    for one in compared:
        row = rows.setdefault(one.series, {"series": one.series})
        row[one.name] = {
            "value": one.value,
            "standard_uncertainty": one.standard_uncertainty,
            "interval_95": list(one.interval_95),
            "truth": one.truth,
            "inside": one.is_covered,
        }
    return {
        "schema": "slipstand-synthetic-campaign/1",
        "directory": str(folder),
        "options": msgspec.to_builtins(options),
        "runs": [run.name for run in collected.runs],
        "failures": msgspec.to_builtins(collected.failures),
        "inside": sum(one.is_covered for one in compared),
        "compared": len(compared),
        "rows": list(rows.values()),
    }


def _print_campaign(compared: Sequence[Comparison]) -> None:
    """Found, true, and the difference in standard uncertainties; `!` where the 95 % interval misses."""
    rows = [
        (
            one.series,
            f"{definition(one.name).symbol.text} {definition(one.name).unit}".removesuffix(" 1"),
            str(format_value(one.value, one.standard_uncertainty)),
            f"{one.truth:.6g}",
            f"{one.normalized_error:+.1f} u" if one.standard_uncertainty else "",
            "" if one.is_covered else "!",
        )
        for one in compared
    ]
    out.print_table(("series", "", "found", "true", "off by", ""), rows)
    inside = sum(one.is_covered for one in compared)
    out.print_line(
        f"{inside} of {len(compared)} 95 % intervals hold the truth ({inside / len(compared):.1%})"
    )
