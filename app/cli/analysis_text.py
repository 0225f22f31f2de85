"""One analysis in lines for people: numbers, verdict, classical figures, Monte Carlo, warnings."""

from typing import Any

from app.cli import output as out

_LINES = (
    ("friction_dynamic", "f_d", 1.0, ""),
    ("friction_static", "f_s", 1.0, ""),
    ("stribeck_velocity_m_per_s", "v_s", 1e3, "mm/s"),
    ("tilt_rad", "tilt", 1e3, "mrad"),
    ("period_s", "T", 1e3, "ms"),
    ("log_decrement", "log decrement", 1.0, ""),
    ("damping_n1_per_s", "n1", 1.0, "1/s"),
    ("damping_n2_per_s", "n2", 1.0, "1/s"),
    ("damping_n_per_s", "n", 1.0, "1/s"),
    ("stiffness_n_per_m", "c", 1.0, "N/m"),
    ("damping_coefficient_kg_per_s", "mu", 1.0, "kg/s"),
    ("pullback_m", "u0", 1e3, "mm"),
    ("residual_displacement_m", "u_s", 1e3, "mm"),
)
_SYMBOLS = {key: (symbol, scale, unit) for key, symbol, scale, unit in _LINES}

_BODIES = ("table", "plate")
_LARGEST = (
    ("v_max", "velocity_max_m_per_s", 1e3, "mm/s"),
    ("a_max", "acceleration_max_m_per_s2", 1.0, "m/s2"),
)
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
    for key, symbol, scale, unit in _LINES:
        if result := document["results"].get(key):
            out.print_line(f"  {symbol:14}{_value(result, scale)} {unit}".rstrip())
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


def _value(result: dict[str, Any], scale: float = 1.0) -> str:
    return out.format_uncertain(result["value"] * scale, (result["standard_uncertainty"] or 0.0) * scale)


def _show_bounds(results: dict[str, Any]) -> None:
    """Between which values the record holds f_s."""
    lower, upper = results.get("friction_static_lower"), results.get("friction_static_upper")
    if lower:
        out.print_line(f"  {'f_s at least':14}{_value(lower)}")
    if upper:
        out.print_line(f"  {'f_s at most':14}{_value(upper)}")


def _show_coulomb(results: dict[str, Any]) -> None:
    if coulomb := results.get("coulomb_displacement_m"):
        claimed = "significant" if results["coulomb_significant"] else "not significant"
        scale, unit = (1e3, "mm") if coulomb["unit"] == "m" else (1.0, coulomb["unit"])
        out.print_line(f"  {'x_k':14}{_value(coulomb, scale)} {unit} (Coulomb friction is {claimed})")


def _show_largest(results: dict[str, Any]) -> None:
    """The largest rates of the fitted motion, and the MSK-64 degree of the table's."""
    for symbol, key, scale, unit in _LARGEST:
        both = [
            f"{body} {_value(found, scale)}" for body in _BODIES if (found := results.get(f"{body}_{key}"))
        ]
        if both:
            out.print_line(f"  {symbol:14}{', '.join(both)} {unit}")
    if degree := results.get("msk64_degree"):
        out.print_line(f"  {'MSK-64':14}degree {degree}")


def _show_slip_end(events: dict[str, Any]) -> None:
    if events["slip_end_s"] is not None:
        since_s, uncertainty_s = events["slip_end_s"] - events["release_s"], events["slip_end_uncertainty_s"]
        out.print_line(
            f"  slip ended    {out.format_uncertain(since_s, uncertainty_s or 0.0)} s after the release"
        )


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
        parts.append(f"log decrement {_value(decrement)}{cycles}")
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
        symbol, scale, unit = _SYMBOLS[name]
        verdict = "agrees with" if both["agrees"] else "DISAGREES with"
        found = both["refitted"] or both["drawn"]
        out.print_line(f"  {symbol:14}{_value(found, scale)} {unit}".rstrip() + f", {verdict} the budget")
