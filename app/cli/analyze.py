"""`slipstand analyze`: identify runs, print or keep the results."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.errors import CommandError
from app.cli.options import Force, Json, PlateMass, TableMass, positive

if TYPE_CHECKING:
    from app.runs.analysing import Analysis, AnalysisRequest


def analyze(
    runs: Annotated[list[Path], typer.Argument(help="Run files.", metavar="RUN...")],
    model: Annotated[
        str, typer.Option(help="auto, coulomb, coulomb+tilt, static, static+tilt or stribeck+tilt.")
    ] = "auto",
    kind: Annotated[
        str, typer.Option(help="two-mass, or one-mass for a bare table or any free decay.")
    ] = "two-mass",
    table_mass: TableMass = None,
    plate_mass: PlateMass = None,
    save: Annotated[bool, typer.Option("--save", help="Keep the result in the run.")] = False,
    figure: Annotated[
        Path | None, typer.Option(help="Draw record against simulation to this PNG, SVG or PDF (one run).")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify friction, stiffness and damping of one or more runs."""
    import msgspec

    from app.cli import output as out
    from app.runs.analysing import AnalysisRequest

    positive("--table-mass", table_mass)
    positive("--plate-mass", plate_mass)
    if figure and len(runs) > 1:
        raise CommandError(f"--figure {figure} is one file for {len(runs)} runs. Analyse them one by one")
    if figure and figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    target = out.new_file(figure, force) if figure else None
    masses = {"table_mass_kg": table_mass, "plate_mass_kg": plate_mass}
    try:
        request = msgspec.convert({"model": model, "kind": kind} | masses, AnalysisRequest)
    except msgspec.ValidationError:
        raise CommandError(f"--kind {kind!r} is not known. Use two-mass or one-mass") from None
    documents = [_one(path, request, save, target, as_json) for path in runs]
    if as_json:
        out.emit_json(documents)
    if any("error" in document for document in documents):
        raise typer.Exit(1)


def _one(
    path: Path, request: "AnalysisRequest", save: bool, figure: Path | None, as_json: bool
) -> dict[str, Any]:
    """Analyse one run; a run that fails is told of and does not stop the rest."""
    from app.cli import output as out
    from app.cli.errors import explain
    from app.runs.analysing import analyze_run

    try:
        with out.progress(path.name, total=1.0) as update:
            analysis = analyze_run(path, request, save=save, progress=update)
        if figure:
            draw(analysis, figure)
    except Exception as error:
        said = explain(error)
        out.tell(f"error: {path}: {said}" if str(path) not in said else f"error: {said}")
        return {"run": str(path.expanduser().absolute()), "error": said}
    if not as_json:
        show(analysis.document)
    return analysis.document


def draw(analysis: "Analysis", path: Path) -> None:
    """Write the figure of record against simulation."""
    from app.reports.record_figure import save_record_figure

    save_record_figure(path, analysis.record, analysis.identification, analysis.run.metadata.title)


_LINES = (
    ("friction_dynamic", "f_d", 1.0, ""),
    ("friction_static", "f_s", 1.0, ""),
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


def show(document: dict[str, Any]) -> None:
    """Write one analysis for people: numbers, verdict, warnings."""
    from app.cli import output as out

    quality = document["quality"]
    out.say(f"{document['run']}  {document['series'] or ''}".rstrip())
    out.say(
        f"  {quality['samples']} samples, {quality['missing']} missing, "
        f"{quality['damaged']} damaged, {quality['overloaded']} overloaded"
    )
    for key, symbol, scale, unit in _LINES:
        result = document["results"].get(key)
        if result:
            uncertainty = (result["standard_uncertainty"] or 0.0) * scale
            out.say(f"  {symbol:14}{out.rounded(result['value'] * scale, uncertainty)} {unit}".rstrip())
    if coulomb := document["results"].get("coulomb_displacement_m"):
        claimed = "significant" if document["results"]["coulomb_significant"] else "not significant"
        shown = out.rounded(coulomb["value"], coulomb["standard_uncertainty"] or 0.0)
        out.say(f"  {'x_k':14}{shown} {coulomb['unit']} (Coulomb friction is {claimed})")
    if model := document["model"]:
        verdict = "fits" if model["adequate"] else "does not fit: do not trust these numbers"
        out.say(
            f"  the model {model['name']} {verdict} "
            f"(residual {model['residual_rms_m'] * 1e6:.1f} µm, noise {model['noise_rms_m'] * 1e6:.1f} µm)"
        )
    for warning in document["warnings"]:
        out.say(f"  warning {warning['code']}: {warning['message']}")
