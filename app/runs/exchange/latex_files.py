"""LaTeX: the coefficients of one or more runs as a table to paste into a paper (needs booktabs)."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from analysis.catalogue import Place, QuantityDefinition, definition
from analysis.formatting import format_value
from app.runs.disk import atomic_write
from app.runs.exchange.content import ExportedRun

_COLUMNS = tuple(
    definition(name)
    for name in (
        "period_s", "log_decrement", "damping_n1_per_s", "damping_n2_per_s", "stiffness_n_per_m",
        "residual_displacement_m", "friction_static", "friction_dynamic",
    )
)  # fmt: skip
_ESCAPES = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%",
    "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\n": " ", "\r": " ",
}  # fmt: skip


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write one table, a row a run: value and standard uncertainty of each coefficient, a dash where absent.

    A run whose model does not fit bears a dagger. Raises RunExistsError, DiskFullError, WriteError.
    """
    header = " & ".join(("Run", "Series", *(column.latex_heading(Place.TERMINAL) for column in _COLUMNS)))
    lines = [
        "% by slipstand, for \\usepackage{booktabs}; standard uncertainties; dagger: the model does not fit",
        rf"\begin{{tabular}}{{ll{'r' * len(_COLUMNS)}}}",
        r"\toprule",
        header + r" \\",
        r"\midrule",
        *(_row(exported) for exported in runs),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    with atomic_write(path.absolute(), replace=replace) as made:
        made.write_text("\n".join(lines) + "\n", "utf-8")


def write_run(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    """Write the coefficients of one run; a record of samples is nothing to print.

    Raises RunExistsError, DiskFullError, WriteError.
    """
    write_coefficients([exported], path, replace=replace)


def escape(text: str) -> str:
    """Text that LaTeX sets as it is."""
    return "".join(_ESCAPES.get(character, character) for character in text)


def _row(exported: ExportedRun) -> str:
    analysis = exported.analysis or {}
    results, model = analysis.get("results", {}), analysis.get("model") or {}
    cells = [_cell(column, results.get(column.name)) for column in _COLUMNS]
    doubt = "" if model.get("adequate", True) else r"$^\dagger$"
    return (
        " & ".join((escape(exported.name) + doubt, escape(exported.run.metadata.series or "--"), *cells))
        + r" \\"
    )


def _cell(column: QuantityDefinition, result: dict[str, Any] | None) -> str:
    if result is None:
        return "--"
    scale = column.unit_at(Place.TERMINAL).scale
    return format_value(result["value"] * scale, (result["standard_uncertainty"] or 0.0) * scale).latex
