"""`slipstand plan`: what a test will show, before it is made."""

from collections.abc import Iterator
from typing import Any

from analysis.catalogue import MILLIMETRE, definition
from analysis.formatting import format_uncertainty, format_value
from app.cli import output as out
from app.cli.analysis_text import budget_shares
from app.cli.measurement_options import PlanOptions
from app.cli.motion_parameters import check_samples, largest_rates, motion_parameters
from app.runs.campaign.last_runs import LastRuns, read_last_runs
from app.runs.listing import check_folder_exists
from app.runs.paths import recordings_directory
from app.runs.plan_json import build_planned_test, plan_document
from config.files import load_gauges, load_stand


def plan(options: PlanOptions) -> None:
    check_samples(options.duration, options.rate)
    parameters = motion_parameters(options.motion)
    gauges = load_gauges(options.calibration.expanduser() if options.calibration else None)
    stand = load_stand()
    test = build_planned_test(
        parameters,
        stand,
        gauges,
        rate_hz=options.rate, noise_m=options.noise, duration_s=options.duration,
    )  # fmt: skip
    document = {"series": options.motion.series} | plan_document(test, _last_runs(options, stand.name))
    if options.as_json:
        out.print_json(document)
    else:
        _print_plan(document)


def _last_runs(options: PlanOptions, stand_name: str) -> LastRuns | None:
    """Last runs of the stand; None where they are left out."""
    if options.ideal_stand:
        return None
    folder = options.last_runs.expanduser().absolute() if options.last_runs else None
    if folder is not None:
        check_folder_exists(folder)
    return read_last_runs(folder or recordings_directory(), stand_name)


def _print_plan(document: dict[str, Any]) -> None:
    slip_end = f"{document['slip_end_s']:.2f} s after release, in {document['phases']} phases"
    rows = [
        ("residual displacement", MILLIMETRE.text(document["residual_displacement_m"], 2)),
        ("slip ends", slip_end if document["slip_end_s"] else "never began"),
    ]
    if (rest_s := document["rest_s"]) is not None:
        rows.append(("at rest", f"{rest_s:.0f} s after release (swing as small as the noise)"))
    rows += largest_rates(document, 3)
    rows.append(("MSK-64", f"degree {document['msk64_degree']}"))
    rows += _gauge_rows(document)
    for name, found in document["results"].items():
        shown = format_value(found["value"], found["standard_uncertainty"])
        law = f"(standard uncertainty, law {document['law']})"
        rows.append((f"{definition(name).symbol.text} to expect", f"{shown} {law}"))
    if document["noise_part"] is not None:
        rows += [("  of which", ", ".join(budget_shares(document["budget"]))), ("what would halve it", "")]
    rows += [(f"  {option['means']}", option["message"]) for option in document["halved_by"]]
    if (last := document["last_runs"]) is not None:
        rows += _last_runs_rows(last)
    out.print_fields(rows, 23)
    for warning in document["warnings"]:
        out.print_line(f"warning {warning['code']}: {warning['message']}")


def _last_runs_rows(last: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What the last runs show of the stand, and what it costs."""
    yield "last runs", f"{len(last['runs'])} kept results in {last['folder']}"
    for effect in last["effects_of_stand"]:
        yield f"  {effect['name']}", effect["message"]
    if not last["effects_of_stand"]:
        yield "  effects", "they show no effects of the stand"
    if (ideal := last["ideal_standard_uncertainty"]) is not None and last["planned_with"]:
        names = " and ".join(last["planned_with"])
        yield "  planned with", f"{names}; without, f_d would be uncertain by {format_uncertainty(ideal)}"
    if (observed := last["friction_dynamic"]) is not None:
        yield "  one of them", observed["message"]


def _gauge_rows(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for channel, (name, use) in enumerate(document["gauges"].items(), start=1):
        reach = f"{MILLIMETRE.number(use['lowest_m'], 2)} to {MILLIMETRE.text(use['highest_m'], 2)}"
        share = "" if use["share"] is None else f", {100 * use['share']:.0f} % of its range"
        yield f"gauge {channel} ({name})", reach + share
    tests = document["tests_without_recentring"]
    if tests is not None:
        yield "re-centring", _recentring_text(tests)


def _recentring_text(tests: int) -> str:
    if tests == 0:
        return "a centred plate does not fit gauge 2"
    return "after each test" if tests == 1 else f"after every {tests} tests"
