"""One analysis in lines for people: numbers, verdict, classical figures, Monte Carlo, warnings."""

from typing import Any

from analysis.catalogue import CATALOGUE, Place, QuantityDefinition, definition
from analysis.formatting import FormattedValue, format_value
from app.cli import output as out
from app.runs.analysis_json import read_quantity

_SINGLE = tuple(
    row
    for row in CATALOGUE
    if not row.is_minor and not row.symbol.relation and "_max_" not in row.name and row.symbol.index != "k"
)
"""Quantities with a line of their own; bounds, x_k and largest rates stand together in theirs."""
_BODIES = ("table", "plate")
_LARGEST = ("velocity_max_m_per_s", "acceleration_max_m_per_s2")
_SHOWN = 0.01
"""Sources of a smaller share of the largest one are left to the JSON."""


def print_analysis(document: dict[str, Any], reading: str = "m") -> None:
    """Write one analysis, of readings in the unit `reading`, to stdout."""
    quality = document["quality"]
    out.print_line(f"{document['run']}  {document['series'] or ''}".rstrip())
    out.print_line(
        f"  {quality['samples']} samples, {quality['missing']} missing, "
        f"{quality['damaged']} damaged, {quality['overloaded']} overloaded"
    )
    for row in _SINGLE:
        if result := document["results"].get(row.name):
            out.print_line(f"  {row.symbol.text:14}{_value(row, result)}")
    _show_bounds(document["results"])
    _show_coulomb(document["results"])
    _show_largest(document["results"])
    _show_slip_end(document["events"])
    _show_model(document["model"], *((1e6, "µm") if reading == "m" else (1.0, reading)))
    _show_budget(document["budget"])
    if classical := document.get("classical"):
        _show_classical(classical)
    if drawn := document.get("monte_carlo"):
        _show_monte_carlo(drawn)
    for note in _notes(document):
        out.print_line(f"  note          {note}")
    for warning in document["warnings"]:
        out.print_line(f"  warning {warning['code']}: {warning['message']}")


def _value(row: QuantityDefinition, result: dict[str, Any]) -> FormattedValue:
    return row.format(read_quantity(result), Place.TERMINAL)


def _show_bounds(results: dict[str, Any]) -> None:
    """Between which values the record holds f_s."""
    for name, label in (("friction_static_lower", "at least"), ("friction_static_upper", "at most")):
        if result := results.get(name):
            row = definition(name)
            out.print_line(f"  {f'{row.symbol.text} {label}':14}{_value(row, result)}")


def _show_coulomb(results: dict[str, Any]) -> None:
    if coulomb := results.get("coulomb_displacement_m"):
        claimed = "significant" if results["coulomb_significant"] else "not significant"
        row = definition("coulomb_displacement_m")
        out.print_line(f"  {row.symbol.text:14}{_value(row, coulomb)} (Coulomb friction is {claimed})")


def _show_largest(results: dict[str, Any]) -> None:
    """The largest rates of the fitted motion, and the MSK-64 degree of the table's."""
    for key in _LARGEST:
        both = [
            f"{body} {_value(definition(name), found)}"
            for body in _BODIES
            if (found := results.get(name := f"{body}_{key}"))
        ]
        if both:
            out.print_line(f"  {definition(f'table_{key}').symbol.text:14}{', '.join(both)}")
    if degree := results.get("msk64_degree"):
        out.print_line(f"  {'MSK-64':14}degree {degree}")


def _show_slip_end(events: dict[str, Any]) -> None:
    if events["slip_end_s"] is not None:
        since_s, uncertainty_s = events["slip_end_s"] - events["release_s"], events["slip_end_uncertainty_s"]
        out.print_line(f"  slip ended    {format_value(since_s, uncertainty_s)} s after the release")


def _show_model(model: dict[str, Any] | None, scale: float, unit: str) -> None:
    """The chosen law and its verdict, then every law that was tried."""
    if not model:
        return
    verdict = "fits" if model["adequate"] else "does not fit: do not trust these numbers"
    residual, noise = model["residual_rms_m"] * scale, model["noise_rms_m"] * scale
    out.print_line(
        f"  the model {model['name']} {verdict} (residual {residual:.3g} {unit}, noise {noise:.3g} {unit})"
    )

    if len(model["tried"]) > 1:
        tried = (
            f"{law['name']} (BIC {law['bic']:.1f}, residual {law['residual_rms_m'] * scale:.3g} {unit})"
            for law in model["tried"]
        )
        out.print_line(f"  tried         {', '.join(tried)}")


def _show_budget(budget: list[dict[str, Any]]) -> None:
    """From what the uncertainty of f_d comes, the largest part first, and what was not stated."""
    shares = {
        line["source"]: line["standard_uncertainty"]
        for line in budget
        if line["contribution_to"] == "friction_dynamic"
    }
    stated = sorted(((share, source) for source, share in shares.items() if share), reverse=True)
    parts = [f"{source} {share:.2g}" for share, source in stated if share > _SHOWN * stated[0][0]]
    parts += [source for source, share in shares.items() if share is None]
    if parts:
        out.print_line(f"  ± of f_d      {', '.join(parts)}")


def _show_classical(classical: dict[str, Any]) -> None:
    """The paper's own figures, which are checks and not the result."""
    parts = []
    if (period_s := classical.get("period_s")) is not None:
        parts.append(f"T {period_s * 1e3:.2f} ms")
    if decrement := classical["log_decrement"]:
        cycles = f" over {classical['cycles']} cycles" if "cycles" in classical else ""
        parts.append(f"log decrement {_value(definition('log_decrement'), decrement)}{cycles}")
    if (friction := classical.get("friction_of_paper")) is not None:
        parts.append(f"f_d {friction:.3f} by the paper's procedure")
    if parts:
        out.print_line(f"  classical     {', '.join(parts)}")
    if allowed := classical.get("friction_of_residual"):
        out.print_line(f"  u_s allows    f_d = {', '.join(f'{friction:.4f}' for friction in allowed)}")


def _notes(document: dict[str, Any]) -> list[str]:
    """What the classical figures are worth, where no warning says the same."""
    warned = {warning["message"] for warning in document["warnings"]}
    return [note for note in (document.get("classical") or {}).get("notes", ()) if note not in warned]


def _show_monte_carlo(drawn: dict[str, Any]) -> None:
    """Each quantity by both methods."""
    refits = f" and {drawn['refits']} refits" if drawn["refits"] else ""
    out.print_line(f"  Monte Carlo   {drawn['draws']} draws{refits}")
    for name, both in drawn["results"].items():
        row = definition(name)
        verdict = "agrees with" if both["agrees"] else "DISAGREES with"
        found = both["refitted"] or both["drawn"]
        out.print_line(f"  {row.symbol.text:14}{_value(row, found)}, {verdict} the budget")
