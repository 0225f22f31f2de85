"""`slipstand watch`: files of a folder become runs, results, a table and a report as they arrive."""

import datetime
import hashlib
import os
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analysis.catalogue import Place, definition
from analysis.record import AnalysisError
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.import_record import import_document, import_metadata, import_plan, import_summary
from app.cli.run_file_options import WatchOptions
from app.reports.table.files import write_table
from app.reports.table.formats import FORMAT_OF_ENDING
from app.reports.table.text import TableContent
from app.reports.test_report.build import build_report
from app.reports.test_report.head import read_head
from app.reports.test_report.render import write_report
from app.runs.analysis_json import read_quantity
from app.runs.analysis_request import AnalysisRequest
from app.runs.batch.tasks import AnalysisTask, analyze_one
from app.runs.campaign.collect import CollectedRuns, collect_runs
from app.runs.campaign.origin import campaign_command
from app.runs.edits import edit_run
from app.runs.errors import NotARunError, RunError
from app.runs.exchange.arrivals import READABLE, Arrivals
from app.runs.exchange.import_run import free_path, import_foreign_file
from app.runs.exchange.importing import ImportPlan
from app.runs.metadata import SourceFile
from app.runs.metadata_io import read_metadata
from app.runs.reader import validate_and_read
from app.runs.validator import shared_validator
from config.files import load_gauges, load_stand
from config.schema import ConfigError

_PART = 1 << 20
_REQUEST = AnalysisRequest(classical=False)


@dataclass(eq=False, slots=True)
class FolderWatch:
    """What is done with the files of a folder."""

    folder: Path
    runs: Path
    plan: ImportPlan
    metadata: dict[str, Any]
    table: Path | None
    report: Path | None
    analysed: list[Path] = field(default_factory=list)
    """Run files that count in table and report."""
    imported: dict[SourceFile, Path] = field(default_factory=dict)
    """Runs of the files that were imported."""

    def find_earlier_runs(self) -> None:
        """Take what an earlier start has imported, so that nothing is imported twice."""
        for path in sorted(self.runs.glob("*.h5")):
            try:
                known = validate_and_read(path, read_metadata, validator=shared_validator())
            except RunError as error:
                out.print_status(f"error: {error}")
                continue
            self.analysed.append(path)
            if known.source_file.sha256:
                self.imported[known.source_file] = path

    def take(self, path: Path) -> dict[str, Any] | None:
        """Import and identify one file; None of one of which there is a run.

        Raises RunError, ConfigError.
        """
        if path.suffix.lower() == ".h5" and _is_run(path):
            return self._identify(path, {"file": str(path)})
        sums = _prefix_sums(path, {source.size_bytes for source in self.imported})
        if any(source.sha256 == sums[None] for source in self.imported):
            return None
        with out.progress_bar(f"reading {path.name}", total=1.0) as update:
            run = import_foreign_file(
                path, self.plan, free_path(self.runs, path.name.partition(".")[0]), load_stand(),
                gauges=load_gauges(), report=update, **self.metadata,
            )  # fmt: skip
        out.print_status(f"{path.name}: {', '.join(filter(None, import_summary(run)))}")
        made = Path(run.run)
        for source, earlier in list(self.imported.items()):
            if source.sha256 == sums.get(source.size_bytes):
                self._supersede(earlier, path, made)
                del self.imported[source]
        known = validate_and_read(made, read_metadata, validator=shared_validator())
        self.imported[known.source_file] = made
        return self._identify(made, import_document(run))

    def _supersede(self, earlier: Path, path: Path, made: Path) -> None:
        """Exclude the run of a file that was not complete when it was taken. Raises RunError."""
        reason = f"{path.name} was not complete; {made.name} is of the whole file"
        edit_run(earlier, "watch", excluded=reason)
        out.print_status(f"{earlier.name} does not count any more: {reason}")

    def _identify(self, path: Path, document: dict[str, Any]) -> dict[str, Any]:
        if path not in self.analysed:
            self.analysed.append(path)
        with out.progress_bar(f"identifying {path.name}", total=1.0) as update:
            found = analyze_one(AnalysisTask(str(path), _REQUEST, save=True), update)
        known = document | {"run": str(path)}
        return known | (
            {"error": str(found.error)} if found.document is None else {"analysis": found.document}
        )

    def is_out_of_date(self) -> bool:
        """Tell whether table or report lack a run: an earlier start was stopped between the two."""
        newest = max((path.stat().st_mtime_ns for path in self.analysed), default=0)
        written = [path for path in (self.table, self.report) if path]
        return any(not path.exists() or path.stat().st_mtime_ns < newest for path in written)

    def write(self) -> None:
        """Write table and report of all runs anew. Raises RunError, AnalysisError."""
        if not (self.table or self.report) or not self.analysed:
            return
        runs = collect_runs(self.analysed)
        if self.table:
            content = TableContent.of_runs(runs, campaign_command("table", self.analysed))
            write_table(content, self.table, FORMAT_OF_ENDING[self.table.suffix.lower()], replace=True)
        if self.report and runs.runs:
            self._write_report(self.report, runs)

    def _write_report(self, path: Path, runs: CollectedRuns) -> None:
        today = datetime.datetime.now().astimezone().date()
        words = ["-o", path.name, "--date", today.isoformat()]
        content = TableContent.of_runs(runs, campaign_command("report", self.analysed, words))
        write_report(build_report(runs, content, read_head(today)), path, replace=True)


def watch(options: WatchOptions) -> None:
    watched = _folder_watch(options)
    arrivals = Arrivals(watched.folder, tuple(options.pattern or READABLE))
    watched.find_earlier_runs()
    if watched.is_out_of_date():
        _write(watched)
    out.print_status(f"watching {watched.folder}; runs go to {watched.runs}; Ctrl-C ends it")
    with out.print_json_list() if options.as_json else nullcontext(None) as add:
        while True:
            _take_all(watched, arrivals, options, add)
            if options.once:
                return
            time.sleep(options.every_s)


def _take_all(
    watched: FolderWatch, arrivals: Arrivals, options: WatchOptions, add: Callable[[object], None] | None
) -> None:
    """Take what has arrived; one file that fails does not stop the rest."""
    documents = list(_documents(watched, arrivals, at_once=options.once))
    for document in documents:
        if add:
            add(document)
        elif "analysis" in document:
            out.print_line(_line(document))
        if "error" in document:
            out.print_status(f"error: {document['error']}")
    if any("run" in document for document in documents):
        _write(watched)


def _write(watched: FolderWatch) -> None:
    try:
        watched.write()
    except (RunError, AnalysisError) as error:
        out.print_status(f"error: {error}")


def _documents(watched: FolderWatch, arrivals: Arrivals, *, at_once: bool) -> Iterator[dict[str, Any]]:
    try:
        ready = arrivals.look(at_once=at_once)
    except OSError as error:
        raise CommandError(f"{watched.folder} cannot be listed ({error.strerror}). Watch it again") from None
    for path in ready:
        if arrivals.take(path):
            out.print_status(f"{path.name} has changed since it was taken, and is taken again")
        try:
            document = watched.take(path)
        except (RunError, ConfigError) as error:
            document = {"file": str(path), "error": str(error)}
        if document is not None:
            yield document


def _folder_watch(options: WatchOptions) -> FolderWatch:
    folder = options.folder.expanduser().absolute()
    if not folder.is_dir():
        raise CommandError(f"{options.folder} is no folder. Give the one that files arrive in")
    runs = (options.output.expanduser() if options.output else folder / "runs").absolute()
    runs.mkdir(parents=True, exist_ok=True)
    table, report = options.table_file, options.report_file
    return FolderWatch(
        folder,
        runs,
        import_plan(options.source),
        import_metadata(options),
        table and out.output_file(table, force=True, endings=tuple(FORMAT_OF_ENDING), option="--write-table"),
        report and out.output_file(report, force=True, endings=(".pdf",), option="--write-report"),
    )


def _line(document: dict[str, Any]) -> str:
    """Name and f_d, or what stands first, of an identified run."""
    results = document["analysis"]["results"]
    shown = [
        f"{row.symbol.text} {row.format(read_quantity(results[row.name]), Place.TERMINAL)}"
        for row in map(definition, ("friction_dynamic", "period_s"))
        if row.name in results
    ]
    model = document["analysis"]["model"]
    degree = [f"model {model['degree']}"] if model else []
    return f"{Path(document['run']).name}: {', '.join([*shown, *degree])}"


def _is_run(path: Path) -> bool:
    """Whether an HDF5 file is a run, and not a file of another program. Raises RunError."""
    try:
        validate_and_read(path, read_metadata, validator=shared_validator())
    except NotARunError:
        return False
    return True


def _prefix_sums(path: Path, sizes: Collection[int | None]) -> dict[int | None, str]:
    """SHA-256 of the first bytes of a file, by their number; None for all of it. Raises RunError."""
    sums: dict[int | None, str] = {}
    digest, place = hashlib.sha256(), 0
    try:
        with path.open("rb") as file:
            size_bytes = os.fstat(file.fileno()).st_size
            for end in sorted(one for one in sizes if one and one < size_bytes):
                while place < end and (part := file.read(min(_PART, end - place))):
                    digest.update(part)
                    place += len(part)
                sums[end] = digest.copy().hexdigest()
            while part := file.read(_PART):
                digest.update(part)
            return sums | {None: digest.hexdigest()}
    except OSError as error:
        raise RunError("{path} cannot be read ({fault})", path=path, fault=error.strerror) from None
