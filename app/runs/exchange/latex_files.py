"""LaTeX: the coefficients of one or more runs as a table to paste into a paper (needs booktabs)."""

import math
from collections.abc import Iterable
from pathlib import Path

from app.runs.disk import atomic_write
from app.runs.exchange.content import ExportedRun

_COLUMNS = (
    ("period_s", r"$T$, ms", 1e3),
    ("log_decrement", r"$\delta$", 1.0),
    ("damping_n1_per_s", r"$n_1$, s$^{-1}$", 1.0),
    ("damping_n2_per_s", r"$n_2$, s$^{-1}$", 1.0),
    ("stiffness_n_per_m", r"$c$, N/m", 1.0),
    ("residual_displacement_m", r"$u_s$, mm", 1e3),
    ("friction_static", r"$f_s$", 1.0),
    ("friction_dynamic", r"$f_d$", 1.0),
)
_ESCAPES = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%",
    "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\n": " ", "\r": " ",
}  # fmt: skip


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write one table, a row a run: value and standard uncertainty of each coefficient, a dash where absent.

    A run whose model does not fit bears a dagger.

    Raises
    ------
    RunExistsError, DiskFullError, WriteError
    """
    header = " & ".join(("Run", "Series", *(symbol for _, symbol, _ in _COLUMNS)))
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

    Raises
    ------
    RunExistsError, DiskFullError, WriteError
    """
    write_coefficients([exported], path, replace=replace)


def escape(text: str) -> str:
    """Text that LaTeX sets as it is."""
    return "".join(_ESCAPES.get(character, character) for character in text)


def _row(exported: ExportedRun) -> str:
    analysis = exported.analysis or {}
    results, model = analysis.get("results", {}), analysis.get("model") or {}
    cells = [
        _number(results[key]["value"] * scale, (results[key]["standard_uncertainty"] or 0.0) * scale)
        if key in results
        else "--"
        for key, _, scale in _COLUMNS
    ]
    doubt = "" if model.get("adequate", True) else r"$^\dagger$"
    return (
        " & ".join((escape(exported.name) + doubt, escape(exported.run.metadata.series or "--"), *cells))
        + r" \\"
    )


def _number(value: float, uncertainty: float) -> str:
    if not 0.0 < uncertainty < math.inf:
        return f"${value:.6g}$"
    decimals = max(0, 1 - math.floor(math.log10(uncertainty)))
    return rf"${value:.{decimals}f} \pm {uncertainty:.{decimals}f}$"
