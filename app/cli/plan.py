"""`slipstand plan`: what a test will show, before it is made."""

from typing import Any

from analysis.catalogue import ACCELERATION, METRES_PER_SECOND, MILLIMETRE, definition
from analysis.formatting import format_value
from app.cli import output as out
from app.cli.measurement_options import PlanOptions
from app.cli.motion_parameters import check_samples, motion_parameters
from app.runs.plan_json import build_planned_test, plan_document
from config.files import load_gauges, load_stand


def plan(options: PlanOptions) -> None:
    """Predict what a test will show, before it is made."""
    check_samples(options.duration, options.rate)
    parameters = motion_parameters(options.motion)
    gauges = load_gauges(options.calibration.expanduser() if options.calibration else None)
    test = build_planned_test(
        parameters,
        load_stand(),
        gauges,
        rate_hz=options.rate,
        noise_m=options.noise,
        duration_s=options.duration,
    )
    document = {"series": options.motion.series} | plan_document(test)
    if options.as_json:
        out.print_json(document)
    else:
        _print_plan(document)


def _print_plan(document: dict[str, Any]) -> None:
    _print_motion(document)
    _print_gauges(document)
    for name, found in document["results"].items():
        symbol, shown = (
            definition(name).symbol.text,
            format_value(found["value"], found["standard_uncertainty"]),
        )
        out.print_line(f"{symbol} to expect          {shown} (standard uncertainty, law {document['law']})")
    _print_budget(document)
    for way in document["halved_by"]:
        out.print_line(f"  {way['means']:21}{way['message']}")
    for warning in document["warnings"]:
        out.print_line(f"warning {warning['code']}: {warning['message']}")


def _print_motion(document: dict[str, Any]) -> None:
    slip_end = f"{document['slip_end_s']:.2f} s after release, in {document['phases']} phases"
    out.print_line(f"residual displacement  {MILLIMETRE.text(document['residual_displacement_m'], 2)}")
    out.print_line(f"slip ends              {slip_end if document['slip_end_s'] else 'never began'}")
    if (rest_s := document["rest_s"]) is not None:
        out.print_line(f"at rest                {rest_s:.0f} s after release (swing as small as the noise)")
    for body in ("table", "plate"):
        velocity = METRES_PER_SECOND.text(document[f"{body}_velocity_max_m_per_s"], 3)
        acceleration = ACCELERATION.text(document[f"{body}_acceleration_max_m_per_s2"], 2)
        out.print_line(f"{body} at most          {velocity}, {acceleration}")
    out.print_line(f"MSK-64                 degree {document['msk64_degree']}")


def _print_gauges(document: dict[str, Any]) -> None:
    for channel, (name, use) in enumerate(document["gauges"].items(), start=1):
        reach = f"{MILLIMETRE.number(use['lowest_m'], 2)} to {MILLIMETRE.text(use['highest_m'], 2)}"
        share = "" if use["share"] is None else f", {100 * use['share']:.0f} % of its range"
        out.print_line(f"gauge {channel} ({name})".ljust(23) + reach + share)
    tests = document["tests_without_recentring"]
    if tests is not None:
        out.print_line(f"re-centring            {_recentring_text(tests)}")


def _recentring_text(tests: int) -> str:
    if tests == 0:
        return "a centred plate does not fit gauge 2"
    return "after each test" if tests == 1 else f"after every {tests} tests"


def _print_budget(document: dict[str, Any]) -> None:
    if document["noise_part"] is None:
        return
    shares = sorted(
        (
            (line["standard_uncertainty"], line["source"])
            for line in document["budget"]
            if line["contribution_to"] == "friction_dynamic"
        ),
        reverse=True,
    )
    parts = [f"{source} {share:.2g}" for share, source in shares if share > _SHOWN * shares[0][0]]
    out.print_line(f"  of which             {', '.join(parts)}")
    out.print_line("what would halve it")


_SHOWN = 0.01
"""Sources of a smaller share of the largest one are left to the JSON."""
