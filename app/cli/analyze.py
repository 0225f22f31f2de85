"""`slipstand analyze`: identify runs, print or keep the results."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from analysis.formatting import format_value
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import (
    Dask,
    Force,
    Jobs,
    Json,
    PlateMass,
    RunsOrFolders,
    TableMass,
    executor_options,
    positive,
)

if TYPE_CHECKING:
    from app.runs.analyze import Analysis, AnalysisRequest
    from app.runs.batch.executors import ExecutorOptions
    from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask


def analyze(
    runs: RunsOrFolders,
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
    save: Annotated[
        bool, typer.Option("--save", help="Keep the result in the run, unless the same is kept and stands.")
    ] = False,
    anew: Annotated[
        bool, typer.Option("--anew", help="With --save: analyse and keep it in any case.")
    ] = False,
    figure: Annotated[
        Path | None, typer.Option(help="Draw record against simulation to this PNG, SVG or PDF (one run).")
    ] = None,
    jobs: Jobs = None,
    dask: Dask = "",
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify friction, stiffness and damping of one or more runs."""
    from app.cli import output as out
    from app.runs.batch.tasks import AnalysisTask
    from app.runs.listing import resolve_run_files

    request = _request(model, kind, table_mass, plate_mass, monte_carlo)
    crew = executor_options(jobs, dask)
    paths = resolve_run_files(runs)
    check_added_mass(added_mass, added_mass_uncertainty, request.kind, len(paths))
    target = _figure_file(figure, len(paths), force)
    tasks = [AnalysisTask(str(path), request, save, anew) for path in paths]
    failed = False
    with (
        out.print_json_list() if as_json else nullcontext(_discard) as add,
        closing(_analyze_with_figure(tasks[0], target) if target else _analyze_runs(tasks, crew)) as outcomes,
    ):
        documents: Iterator[dict[str, Any]] = (_report_run(outcome, as_json) for outcome in outcomes)
        if added_mass is not None:  # the mass comes of both, or nothing is said
            documents = _with_mass(list(documents), added_mass, added_mass_uncertainty, as_json)
        for document in documents:
            failed |= "error" in document
            add(document)
    if failed:
        raise typer.Exit(1)


def _discard(_document: object) -> None:
    """Take what nobody asked for in JSON."""


def _with_mass(
    documents: list[dict[str, Any]], added_kg: float, uncertainty_kg: float, as_json: bool
) -> Iterator[dict[str, Any]]:
    """Add the mass of the table to the analyses of both runs, unless one failed."""
    if not any("error" in document for document in documents):
        documents.append(compute_table_mass(documents, added_kg, uncertainty_kg, as_json))
    return iter(documents)


def _figure_file(figure: Path | None, runs: int, force: bool) -> Path | None:
    from app.cli import output as out

    if figure is None:
        return None
    if runs > 1:
        raise CommandError(f"--figure {figure} is one file for {runs} runs. Analyse them one by one")
    if figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    return out.output_file(figure, force)


def _request(
    model: str, kind: str, table_mass: float | None, plate_mass: float | None, monte_carlo: int | None
) -> "AnalysisRequest":
    """What was asked for, refused before any run is read where it cannot be."""
    from analysis.laws.catalogue import LAWS
    from app.runs.analyze import REFITS_MAX, REFITS_MIN, AnalysisRequest

    positive("--table-mass", table_mass)
    positive("--plate-mass", plate_mass)
    models = ("auto", *(law.name for law in LAWS))
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


def _analyze_runs(tasks: "list[AnalysisTask]", options: "ExecutorOptions") -> "Generator[AnalysisOutcome]":
    from app.cli import output as out
    from app.runs.batch.executors import open_executor
    from app.runs.batch.tasks import analyze_runs

    description = Path(tasks[0].path).name if len(tasks) == 1 else f"{len(tasks)} runs"
    with out.progress_bar(description, total=1.0) as update, open_executor(options, len(tasks)) as crew:
        yield from analyze_runs(tasks, crew, update)


def _analyze_with_figure(task: "AnalysisTask", figure: Path) -> "Generator[AnalysisOutcome]":
    """Analyse a run here, and draw it."""
    from app.cli import output as out
    from app.cli.errors import error_text
    from app.runs.analyze import analyze_run
    from app.runs.batch.tasks import AnalysisOutcome, build_outcome

    path = Path(task.path)
    try:
        with out.progress_bar(path.name, total=1.0) as update:
            analysis = analyze_run(path, task.request, save=task.save, progress=update)
        save_figure(analysis, figure)
    except Exception as error:
        yield AnalysisOutcome(task.path, error=error_text(error))
    else:
        yield build_outcome(analysis)


def _report_run(outcome: "AnalysisOutcome", as_json: bool) -> dict[str, Any]:
    """Tell of one run in words, as far as that is wanted, and return the JSON object of it."""
    from app.cli import output as out
    from app.cli.analysis_text import print_analysis
    from app.cli.recover import print_interrupted_run

    if outcome.document is None:
        said = outcome.error if outcome.run in outcome.error else f"{outcome.run}: {outcome.error}"
        out.print_status(f"error: {said}")
        return {"run": outcome.run, "error": outcome.error}
    print_interrupted_run(Path(outcome.run), outcome.ended)
    if not as_json:
        print_analysis(outcome.document, outcome.unit)
        if outcome.up_to_date:
            out.print_line("  up to date    as kept in the run; --anew analyses it again")
    return outcome.document


def save_figure(analysis: "Analysis", path: Path) -> None:
    """Write the figure of record against simulation."""
    from app.reports.figures.record_figure import save_record_figure

    save_record_figure(path, analysis.record, analysis.identification, analysis.run.metadata.title)


def check_added_mass(added_kg: float | None, uncertainty_kg: float, kind: str, runs: int) -> None:
    """Refuse an added mass that cannot be, or does not go with what else was asked. Raises CommandError."""
    positive("--added-mass", added_kg)
    if not 0.0 <= uncertainty_kg < float("inf"):
        raise CommandError(f"--added-mass-uncertainty {uncertainty_kg:g} must be a finite number, 0 or above")
    if added_kg is not None and (kind != "one-mass" or runs != 2):
        raise CommandError(
            "--added-mass needs --kind one-mass and two runs: the bare table first, then the same with the"
            " added mass"
        )
    if added_kg is None and uncertainty_kg:
        raise CommandError("--added-mass-uncertainty goes with --added-mass. Give that too")


def compute_table_mass(
    documents: Sequence[dict[str, Any]], added_kg: float, uncertainty_kg: float, as_json: bool
) -> dict[str, Any]:
    """JSON object of the mass of the table from the analyses of two runs, the second with the added mass.

    The time base is common to both runs and cancels, so that the periods count with their noise alone.
    """
    from analysis.one_mass.identify import mass_from_added_mass
    from analysis.quantities import Quantity
    from app.runs.analysis_json import quantity_document

    alone, loaded = documents
    added = Quantity.normal(added_kg, uncertainty_kg, "kg")
    mass = mass_from_added_mass(
        _quantity(alone, "period_s"),
        _quantity(loaded, "period_s"),
        added,
        _quantity(alone, "damping_n_per_s"),
        _quantity(loaded, "damping_n_per_s"),
    )
    if not as_json:
        out.print_line(f"table mass {format_value(mass.value, mass.standard_uncertainty)} kg, from both runs")
    return {
        "kind": "table-mass",
        "runs": [document["run"] for document in documents],
        "results": {"table_mass_kg": quantity_document(mass), "added_mass_kg": quantity_document(added)},
    }


def _quantity(document: dict[str, Any], name: str) -> Any:
    """A result with its type A uncertainty."""
    from analysis.quantities import BudgetSource, Quantity

    result = document["results"][name]
    noise = [
        line["standard_uncertainty"]
        for line in document["budget"]
        if line["contribution_to"] == name and line["source"] == str(BudgetSource.NOISE)
    ]
    return Quantity.normal(result["value"], noise[0] if noise else 0.0, result["unit"])
