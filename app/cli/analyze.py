"""`slipstand analyze`: identify runs, print or keep the results."""

import math
from collections.abc import Generator, Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import msgspec
import typer

from analysis.formatting import format_value
from analysis.laws.catalogue import LAWS
from analysis.one_mass.identify import mass_from_added_mass
from analysis.quantities import Quantity, SharedBy
from app.cli import output as out
from app.cli.analysis_text import print_analysis
from app.cli.errors import CommandError, alternatives, error_text
from app.cli.option_values import executor_options, figure_file
from app.cli.recover import print_interrupted_run
from app.cli.result_options import AddedMassOptions, AnalyzeOptions
from app.runs.analysis_json import quantity_document, read_budget_line
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import REFITS_MAX, REFITS_MIN, Analysis, analyze_run
from app.runs.batch.executors import ExecutorOptions, open_executor
from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask, analyze_runs, build_outcome
from app.runs.listing import list_runs, resolve_run_files
from messages.message import message

MODELS = ("auto", *(law.name for law in LAWS))


def analyze(options: AnalyzeOptions) -> None:
    request, executor = _request(options), executor_options(options.jobs)
    paths = resolve_run_files(options.runs)
    options.added.check(request.kind, len(paths))
    if options.only_new:
        paths = _without_analysed(paths, request, options)
        if not paths:
            if options.as_json:
                out.print_json([])
            return
    if options.figure and len(paths) > 1:
        raise CommandError(
            f"--figure {options.figure} is one file for {len(paths)} runs. Analyse them one by one"
        )
    figure = figure_file(options.figure, force=options.force)
    requests = [request] * (len(paths) - 1) + [_loaded(request, options.added)]
    tasks = [
        AnalysisTask(str(path), one, options.save, options.anew)
        for path, one in zip(paths, requests, strict=True)
    ]
    outcomes = _analyze_with_figure(tasks[0], figure) if figure else _analyze_runs(tasks, executor)
    failed = False
    with out.print_json_list() if options.as_json else nullcontext(None) as add, closing(outcomes):
        documents: Iterator[dict[str, Any]] = (_report_run(outcome, options.as_json) for outcome in outcomes)
        if (
            options.added.added_mass is not None and len(paths) == 2
        ):  # computed from both analyses, or not at all
            documents = iter(_with_table_mass(list(documents), options.added, options.as_json))
        for document in documents:
            failed |= "error" in document
            if add:
                add(document)
    if failed:
        raise typer.Exit(1)


def _without_analysed(paths: list[Path], request: AnalysisRequest, options: AnalyzeOptions) -> list[Path]:
    """Leave out runs of folders whose result is valid by the index of their folder. Raises CommandError."""
    if options.anew or options.added.added_mass is not None:
        other = "--anew" if options.anew else "--added-mass"
        raise CommandError(f"--only-new leaves out runs that {other} needs. Give one of the two")
    analysed: set[str] = set()
    for folder in map(Path.expanduser, options.runs):
        if folder.is_dir():
            with out.progress_bar("looking at new files", total=1.0) as update:
                found = list_runs(folder, progress=lambda done, count: update(done / count))
            analysed.update(run.path for run in found if request.key in run.valid_requests)
    new = [path for path in paths if str(path) not in analysed]
    out.print_status(f"{len(paths) - len(new)} of {len(paths)} runs are up to date")
    return new


def _with_table_mass(
    documents: list[dict[str, Any]], options: AddedMassOptions, as_json: bool
) -> list[dict[str, Any]]:
    """Append the mass of the table to the analyses of both runs, unless one failed."""
    if any("error" in document for document in documents):
        return documents
    added = Quantity.normal(options.added_mass or 0.0, options.added_mass_uncertainty, "kg")
    alone, loaded = (_quantity(document, "period_s") for document in documents)
    damping = (_quantity(document, "damping_n_per_s") for document in documents)
    mass = mass_from_added_mass(alone, loaded, added, *damping)
    if not as_json:
        out.print_line(f"table mass {format_value(mass.value, mass.standard_uncertainty)} kg, from both runs")
    results = {"table_mass_kg": quantity_document(mass), "added_mass_kg": quantity_document(added)}
    runs = [document["run"] for document in documents]
    return [*documents, {"kind": "table-mass", "runs": runs, "results": results}]


def _loaded(request: AnalysisRequest, options: AddedMassOptions) -> AnalysisRequest:
    """The request for the run in which the table carries the added mass."""
    if options.added_mass is None:
        return request
    uncertainty_kg = options.added_mass_uncertainty
    return msgspec.structs.replace(
        request, added_mass_kg=options.added_mass, added_mass_uncertainty_kg=uncertainty_kg
    )


def _request(options: AnalyzeOptions) -> AnalysisRequest:
    """Build the request. Raises CommandError for options that do not fit together."""
    span = options.span
    span.check(options.kind)
    model, refits = options.model, options.monte_carlo
    if model not in MODELS:
        laws = [f"{law.name} ({law.description})" for law in LAWS]
        raise CommandError(f"--model {model!r} is not known. Use {alternatives(['auto', *laws])}")
    table_kg, plate_kg = options.table_mass, options.plate_mass
    if options.kind == "one-mass":
        if model != "auto" or refits is not None:
            raise CommandError(
                "--model and --monte-carlo are for two masses. Leave them out with --kind one-mass"
            )
        return AnalysisRequest(
            kind="one-mass",
            table_mass_kg=table_kg,
            plate_mass_kg=plate_kg,
            from_s=span.from_s,
            until_s=span.until_s,
        )
    if refits is not None and refits != 0 and not REFITS_MIN <= refits <= REFITS_MAX:
        raise CommandError(
            f"--monte-carlo {refits} refits give no interval. Give {REFITS_MIN} to {REFITS_MAX}, some"
            " thousand are good, or 0 for the draws alone"
        )
    return AnalysisRequest(
        model,
        "two-mass",
        table_kg,
        plate_kg,
        refits,
        from_s=span.from_s,
        until_s=span.until_s,
        release=span.release,
    )


def _analyze_runs(tasks: list[AnalysisTask], options: ExecutorOptions) -> Generator[AnalysisOutcome]:
    description = Path(tasks[0].path).name if len(tasks) == 1 else f"{len(tasks)} runs"
    with out.progress_bar(description, total=1.0) as update, open_executor(options, len(tasks)) as executor:
        yield from analyze_runs(tasks, executor, update)


def _analyze_with_figure(task: AnalysisTask, figure: Path) -> Generator[AnalysisOutcome]:
    path = Path(task.path)
    try:
        with out.progress_bar(path.name, total=1.0) as update:
            analysis = analyze_run(path, task.request, save=task.save, progress=update)
        save_figure(analysis, figure)
    except Exception as error:
        yield AnalysisOutcome(task.path, error=message("{error}", error=error_text(error)))
    else:
        yield build_outcome(analysis)


def _report_run(outcome: AnalysisOutcome, as_json: bool) -> dict[str, Any]:
    """Print the result of one run, unless JSON is wanted; return its JSON object."""
    if outcome.document is None:
        fault = str(outcome.error)
        out.print_status(f"error: {fault if outcome.run in fault else f'{outcome.run}: {fault}'}")
        return {"run": outcome.run, "error": fault}
    print_interrupted_run(Path(outcome.run), outcome.ended)
    if not as_json:
        print_analysis(outcome.document, outcome.unit)
        if outcome.up_to_date:
            out.print_line("  up to date    as kept in the run; --anew analyses it again")
    return outcome.document


def save_figure(analysis: Analysis, path: Path) -> None:
    from app.reports.figures.record_figure import save_record_figure

    metadata = analysis.run.metadata
    save_record_figure(path, analysis.record, analysis.identification, metadata.title, metadata.unit)


def _quantity(document: dict[str, Any], name: str) -> Quantity:
    """A result with the uncertainty that its run does not share with others."""
    result, lines = document["results"][name], map(read_budget_line, document["budget"])
    own = [
        line.standard_uncertainty
        for line in lines
        if line.contribution_to == name and line.source.shared_by in (SharedBy.NONE, SharedBy.RUN)
    ]
    return Quantity.normal(result["value"], math.hypot(*own), result["unit"])
