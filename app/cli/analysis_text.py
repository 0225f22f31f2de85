"""One analysis in lines for people: numbers, verdict, classical figures, Monte Carlo, warnings."""

from collections.abc import Iterable, Iterator
from typing import Any, Final

from analysis.catalogue import CATALOGUE, Place, definition
from analysis.formatting import format_value
from analysis.motion.two_mass import PEAK_RATES
from analysis.verdict_text import EFFECT_TITLES, describe_verdict
from app.cli import output as out
from app.runs.analysis_json import read_model, read_quantity
from app.runs.origin import SIMULATED_RUN, is_simulated, origin_rows

_BODIES: Final = ("table", "plate")
_LARGEST: Final = ("velocity_max_m_per_s", "acceleration_max_m_per_s2")
_SHOWN: Final = 0.01
"""Sources of a smaller share of the largest one are left to the JSON."""

_LISTED: Final = 8  # values of f_d that fill a line


def print_analysis(document: dict[str, Any], reading: str = "m") -> None:
    """Write one analysis, of readings in the unit `reading`, to stdout."""
    quality, results, scale, unit = document["quality"], document["results"], 1.0, reading
    if reading == "m":
        scale, unit = 1e6, "µm"
    origin = document.get("origin", {})  # unknown of results kept by a later version
    out.print_line(f"{document['run']}  {document['series'] or ''}".rstrip())
    if is_simulated(origin):
        out.print_line(f"  {SIMULATED_RUN}")
    out.print_line(
        f"  {quality['samples']} samples, {quality['missing']} missing, "
        f"{quality['damaged']} damaged, {quality['overloaded']} overloaded"
    )
    _print_rows(_result_rows(results, document["events"]))
    if document["model"]:
        _print_model(document, scale, unit)
    if shares := budget_shares(document["budget"]):
        _print_rows([("± of f_d", ", ".join(shares))])
    classical = document.get("classical") or {}
    if classical:
        _print_rows(_classical_rows(classical))
    if drawn := document.get("monte_carlo"):
        _print_rows(_monte_carlo_rows(drawn))
    warned = {warning["message"] for warning in document["warnings"]}
    _print_rows(("note", note) for note in classical.get("notes", ()) if note not in warned)
    of_stand = [warning for warning in document["warnings"] if warning["code"] in EFFECT_TITLES]
    if of_stand:
        out.print_line("  about the stand:")
    for warning in of_stand:
        out.print_line(f"    {warning['code']}: {warning['message']}")
    for warning in document["warnings"]:
        if warning not in of_stand:
            out.print_line(f"  warning {warning['code']}: {warning['message']}")
    if origin:
        out.print_line("  origin:")
        out.print_fields(((f"    {name}", text) for name, text in origin_rows(origin)), 16)


def _print_rows(rows: Iterable[tuple[str, object]]) -> None:
    out.print_fields(((f"  {label}", value) for label, value in rows), 16)


def _value(name: str, result: dict[str, Any]) -> str:
    return str(definition(name).format(read_quantity(result), Place.TERMINAL))


def _result_rows(results: dict[str, Any], events: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Each quantity; bounds of f_s, x_k and largest rates stand together in rows of their own."""
    for row in CATALOGUE:
        together = row.is_minor or row.symbol.relation or row.symbol.index == "k"
        if row.name in results and row.name not in PEAK_RATES and not together:
            yield row.symbol.text, _value(row.name, results[row.name])
    for name, label in (("friction_static_lower", "at least"), ("friction_static_upper", "at most")):
        if name in results:
            yield f"{definition(name).symbol.text} {label}", _value(name, results[name])
    if coulomb := results.get("coulomb_displacement_m"):
        significant = "significant" if results["coulomb_significant"] else "not significant"
        shown = _value("coulomb_displacement_m", coulomb)
        yield definition("coulomb_displacement_m").symbol.text, f"{shown} (Coulomb friction is {significant})"
    for rate in _LARGEST:
        of_bodies = [
            f"{body} {_value(name, results[name])}"
            for body in _BODIES
            if (name := f"{body}_{rate}") in results
        ]
        if of_bodies:
            yield definition(f"table_{rate}").symbol.text, ", ".join(of_bodies)
    if degree := results.get("msk64_degree"):
        yield "MSK-64", f"degree {degree}"
    if events["slip_end_s"] is not None:
        since_s, uncertainty_s = events["slip_end_s"] - events["release_s"], events["slip_end_uncertainty_s"]
        yield "slip ended", f"{format_value(since_s, uncertainty_s)} s after the release"
    if (end_s := events.get("free_decay_end_s")) is not None:
        yield "fitted until", f"{end_s:.3f} s of the record, where the free decay ends"


def _print_model(document: dict[str, Any], scale: float, unit: str) -> None:
    """The verdict on the chosen model, then every law that was tried."""
    model, chosen = document["model"], read_model(document)
    residual, noise = model["residual_rms_m"] * scale, model["noise_rms_m"] * scale
    sizes = f"residual {residual:.3g} {unit}, noise {noise:.3g} {unit}"
    if (share := model.get("residual_share")) is not None and model["adequate"]:
        sizes += f"; {100.0 * share:.2g} % of the swing is left"
    if chosen is not None:
        out.print_line(f"  {describe_verdict(chosen, document['kind'])} ({sizes})")
    if len(model["tried"]) > 1:
        tried = [
            f"{' + '.join([law['name'], *law.get('parts', ())])} (BIC {law['bic']:.1f},"
            f" residual {law['residual_rms_m'] * scale:.3g} {unit})"
            for law in model["tried"]
        ]
        _print_rows(zip(["tried", *[""] * (len(tried) - 1)], tried, strict=True))


def _classical_rows(classical: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The paper's own figures, which are checks and not the result."""
    parts = []
    if (period_s := classical.get("period_s")) is not None:
        parts.append(f"T {period_s * 1e3:.2f} ms")
    if decrement := classical["log_decrement"]:
        cycles = f" over {classical['cycles']} cycles" if "cycles" in classical else ""
        parts.append(f"log decrement {_value('log_decrement', decrement)}{cycles}")
    if (friction := classical.get("friction_of_paper")) is not None:
        parts.append(f"f_d {friction:.3f} by the paper's procedure")
    if parts:
        yield "classical", ", ".join(parts)
    if allowed := classical.get("friction_of_residual"):
        values = f"f_d = {', '.join(f'{friction:.4f}' for friction in allowed)}"
        if len(allowed) > _LISTED:
            values = f"{len(allowed)} values of f_d from {min(allowed):.4f} to {max(allowed):.4f}"
        yield "u_s allows", values


def _monte_carlo_rows(drawn: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Each quantity by both methods."""
    refits = f" and {drawn['refits']} refits" if drawn["refits"] else ""
    yield "Monte Carlo", f"{drawn['draws']} draws{refits}"
    for name, both in drawn["results"].items():
        verdict = "agrees with" if both["agrees"] else "DISAGREES with"
        shown = _value(name, both["refitted"] or both["drawn"])
        yield definition(name).symbol.text, f"{shown}, {verdict} the budget"


def budget_shares(budget: list[dict[str, Any]]) -> list[str]:
    """Sources of the uncertainty of f_d with their shares, the largest first, then those not stated."""
    shares = {
        line["source"]: line["standard_uncertainty"]
        for line in budget
        if line["contribution_to"] == "friction_dynamic"
    }
    stated = sorted(((share, source) for source, share in shares.items() if share), reverse=True)
    parts = [f"{source} {share:.2g}" for share, source in stated if share > _SHOWN * stated[0][0]]
    return parts + [source for source, share in shares.items() if share is None]
