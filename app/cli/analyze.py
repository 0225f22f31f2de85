"""`slipstand analyze`: identify runs, print or keep the results."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.errors import CommandError
from app.cli.options import Force, Json, PlateMass, TableMass, positive

if TYPE_CHECKING:
    from app.runs.analysing import Analysis, AnalysisRequest
    from app.runs.examiner import Examiner


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
    monte_carlo: Annotated[
        int | None,
        typer.Option(metavar="N", help="Check the uncertainties by 100,000 draws and N full refits."),
    ] = None,
    added_mass: Annotated[
        float | None,
        typer.Option(
            help="With --kind one-mass and two runs: mass (kg) that was added to the table in the second."
        ),
    ] = None,
    added_mass_uncertainty: Annotated[
        float, typer.Option(help="Standard uncertainty of --added-mass (kg).")
    ] = 0.0,
    save: Annotated[bool, typer.Option("--save", help="Keep the result in the run.")] = False,
    figure: Annotated[
        Path | None, typer.Option(help="Draw record against simulation to this PNG, SVG or PDF (one run).")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify friction, stiffness and damping of one or more runs."""
    from app.cli import output as out
    from app.cli.table_mass import check_added_mass, table_mass_of
    from app.runs.examiner import Examiner

    request = _request(model, kind, table_mass, plate_mass, monte_carlo)
    check_added_mass(added_mass, added_mass_uncertainty, request.kind, len(runs))
    if figure and len(runs) > 1:
        raise CommandError(f"--figure {figure} is one file for {len(runs)} runs. Analyse them one by one")
    if figure and figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    target = out.new_file(figure, force) if figure else None
    with Examiner() as examiner:
        documents = [_one(path, request, save, target, as_json, examiner) for path in runs]
    if added_mass is not None and not any("error" in document for document in documents):
        documents.append(table_mass_of(documents, added_mass, added_mass_uncertainty, as_json))
    if as_json:
        out.emit_json(documents)
    if any("error" in document for document in documents):
        raise typer.Exit(1)


def _request(
    model: str, kind: str, table_mass: float | None, plate_mass: float | None, monte_carlo: int | None
) -> "AnalysisRequest":
    """What was asked for, refused before any run is read where it cannot be."""
    from analysis.fitting.models import Model
    from app.runs.analysing import REFITS_MAX, REFITS_MIN, AnalysisRequest

    positive("--table-mass", table_mass)
    positive("--plate-mass", plate_mass)
    models = ("auto", *(law.value for law in Model))
    if model not in models:
        raise CommandError(f"--model {model!r} is not known. Use {', '.join(models)}")
    if kind == "one-mass":
        if model != "auto" or monte_carlo is not None:
            raise CommandError(
                "--model and --monte-carlo are of two masses. Leave them out with --kind one-mass"
            )
        return AnalysisRequest(kind="one-mass", table_mass_kg=table_mass, plate_mass_kg=plate_mass)
    if kind != "two-mass":
        raise CommandError(f"--kind {kind!r} is not known. Use two-mass or one-mass")
    if monte_carlo is not None and monte_carlo != 0 and not REFITS_MIN <= monte_carlo <= REFITS_MAX:
        raise CommandError(
            f"--monte-carlo {monte_carlo} refits give no interval. Give {REFITS_MIN} to {REFITS_MAX}, some"
            " thousand are good, or 0 for the draws alone"
        )
    return AnalysisRequest(model, "two-mass", table_mass, plate_mass, monte_carlo)


def _one(
    path: Path,
    request: "AnalysisRequest",
    save: bool,
    figure: Path | None,
    as_json: bool,
    examiner: "Examiner",
) -> dict[str, Any]:
    """Analyse one run; a run that fails is told of and does not stop the rest."""
    from app.cli import output as out
    from app.cli.analysis_text import show
    from app.cli.errors import explain
    from app.cli.unfinished import tell_cut_short
    from app.runs.analysing import analyze_run

    try:
        with out.progress(path.name, total=1.0) as update:
            analysis = analyze_run(path, request, save=save, progress=update, examiner=examiner)
        if figure:
            draw(analysis, figure)
        tell_cut_short(analysis.run.path, analysis.run.ending.ended if analysis.run.ending else "")
    except Exception as error:
        said = explain(error)
        out.tell(f"error: {path}: {said}" if str(path) not in said else f"error: {said}")
        return {"run": str(path.expanduser().absolute()), "error": said}
    if not as_json:
        show(analysis.document, analysis.run.metadata.unit)
    return analysis.document


def draw(analysis: "Analysis", path: Path) -> None:
    """Write the figure of record against simulation."""
    from app.reports.record_figure import save_record_figure

    save_record_figure(path, analysis.record, analysis.identification, analysis.run.metadata.title)
