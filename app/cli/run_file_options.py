"""Options of commands about run files, and of `doctor`."""

from dataclasses import dataclass
from pathlib import Path

from app.cli import shared_options as shared
from app.cli.options import REQUIRED, argument, choice, flag, number, option
from app.cli.shared_options import ConditionOptions, MassOptions

RUN_COLUMNS = (
    "run", "series", "begun", "seconds", "ended", "source", "f_d", "T", "n1", "operator", "plate", "note",
    "conditions", "fault",
)  # fmt: skip
"""Of `slipstand runs`."""


def _completed_columns(incomplete: str) -> list[str]:
    """Complete the last of several names, divided by commas."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in RUN_COLUMNS if name.startswith(last)]


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """How the file is read: the fields of `ImportPlan` and of its layout."""

    time: str | None = option(
        "--time",
        "Time column: its name or number, from 0; found by its name or kind if absent.",
        metavar="COLUMN",
    )
    rate: float | None = option("--rate", "Rows a second, of a file without times; instead of --time.")
    date: str | None = option(
        "--date", "Column of dates, where --time is one of times of day.", metavar="COLUMN"
    )
    date_order: str | None = choice(
        "--date-order", ("dmy", "mdy", "ymd"), "Order of day and month in dates; detected if absent."
    )
    begun: str | None = option(
        "--begun",
        "When the file's first row was recorded: 2019-05-04T14:03:00+02:00; as the file says if absent.",
    )
    table: str = option("--table", "Column of gauge 1, table against base.", REQUIRED, metavar="COLUMN")
    relative: str | None = option("--relative", "Column of gauge 2, plate against table.", metavar="COLUMN")
    plate: str | None = option("--plate", "Column of gauge 2, plate against base.", metavar="COLUMN")
    unit: str | None = choice(
        "--unit", ("m", "mm", "um"), "Length unit of the cells; as the file names it, else m, if absent."
    )
    gain: float | None = option(
        "--gain", "Metres, or --unit-name, that a cell of 1 means; instead of --unit."
    )
    offset: float | None = option("--offset", "Metres, or --unit-name, that a cell of 0 means; with --gain.")
    unit_name: str | None = option("--unit-name", "Unit of the readings, where not metres.", metavar="UNIT")
    gain_uncertainty: float | None = option(
        "--gain-uncertainty", "Relative standard uncertainty of the gain; not stated if absent."
    )
    quantity: str = choice(
        "--quantity", ("displacement", "velocity", "acceleration"), "What was measured.", "displacement"
    )
    time_unit: str | None = choice(
        "--time-unit", ("s", "ms", "us"), "Unit of the times; as the file names it, else s, if absent."
    )
    delimiter: str | None = option(
        "--delimiter", "A character, tab or space; detected if absent.", metavar="SIGN"
    )
    decimal: str | None = choice("--decimal", (".", ","), "Decimal sign; detected if absent.")
    encoding: str | None = option(
        "--encoding", "Of a text: utf-8, cp1251, ...; detected if absent.", metavar="NAME"
    )
    missing: list[str] | None = option(
        "--missing",
        "A cell of an absent reading, besides nan, N/A, - and the like; repeatable.",
        metavar="TEXT",
    )
    skip: int = option("--skip", "Lines left out before the header.", 0)
    no_header: bool = flag("--no-header", "The first line is data.")
    from_s: float | None = option("--from", "First time that is kept (s); the file's first if absent.")
    until_s: float | None = option("--until", "Last time that is kept (s); the file's last if absent.")
    segment: int | None = option("--segment", "Which stretch, from 0, where times go back between stretches.")
    any_size: bool = flag(
        "--any-size", "Take displacements beyond the gauge's range, or a thousand times below a pullback."
    )


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Make runs of files of other programs.

    Text, .mat, .h5, .tdms, .lvm, .uff, .mf4, .wav, catman .bin, .xlsx, .parquet; any of them as .gz.

    Times are kept, uneven ones and gaps included.
    """

    files: list[Path] = argument("Files of other programs, or patterns such as *.csv.", metavar="FILE")
    output: Path = option("-o --output", "Run file to write, RUN.h5; of several files a folder.", REQUIRED)
    source: FileOptions
    masses: MassOptions
    operator: str = option("--operator", "Who recorded.", "")
    note: str = option("--note", "A remark kept with the run.", "")
    conditions: ConditionOptions
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class WatchOptions:
    """Import and identify files of a folder as they arrive.

    A file is taken when it has not changed between two looks. Run files are identified where they are. Table
    and report are written anew after each file. Ctrl-C ends it; the next start goes on where it ended.
    """

    folder: Path = argument("Folder that files arrive in.", metavar="FOLDER")
    output: Path | None = option("-o --output", "Folder of the runs; FOLDER/runs if absent.")
    pattern: list[str] | None = option(
        "--pattern",
        "Names of the files to take, such as *.csv; repeatable; all that can be read if absent.",
        metavar="PATTERN",
    )
    source: FileOptions
    masses: MassOptions
    operator: str = option("--operator", "Who recorded.", "")
    note: str = option("--note", "A remark kept with the run.", "")
    conditions: ConditionOptions
    table_file: Path | None = option(
        "--write-table", "Table of all runs: .txt, .csv, .json, .md, .tex or .xlsx."
    )
    report_file: Path | None = option("--write-report", "Report of all runs: a PDF.")
    every_s: float = number("--every", "Seconds between two looks at the folder.", 2.0, above=0.0)
    once: bool = flag("--once", "Take what is there now, and end.")
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Write samples and coefficients of runs for other programs.

    The newest analysis kept in a run is taken, else it is analysed.
    """

    runs: list[Path] = shared.runs_or_folders()
    format_name: str | None = choice(
        "--format",
        ("csv", "json", "parquet", "mat", "uff58", "xlsx", "latex", "ro-crate"),
        "File format; by the ending of -o if absent.",
    )
    output: Path | None = option(
        "-o --output", "File to write, or a folder with a file a run; csv, json, latex to stdout if absent."
    )
    content: str = choice(
        "--content",
        ("both", "samples", "coefficients"),
        "samples, coefficients (one table of all runs), or both.",
        "both",
    )
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ListRunsOptions:
    """List recorded runs, oldest first.

    Files that cannot be read stand last with their fault. Paths below the present folder are relative to it.
    """

    directory: Path | None = argument("Folder of runs; that of recordings if absent.", None, metavar="FOLDER")
    series: str | None = shared.series()
    since: str | None = option("--since", "Only runs of this day or later: 2026-11-21.")
    until: str | None = option("--until", "Only runs of this day or earlier.", metavar="DATE")
    operator: str | None = option("--operator", "Only runs of this operator.")
    text: str | None = option("--text", "Only runs with this in name, title, note, operator or source.")
    stale: bool = flag("--stale", "Only runs changed since their newest analysis.")
    columns: str | None = option(
        "--columns",
        f"Columns to show, of {', '.join(RUN_COLUMNS)}.",
        metavar="NAME,NAME...",
        autocompletion=_completed_columns,
    )
    sort: str | None = choice("--sort", RUN_COLUMNS, "Column to sort by; oldest first if absent.")
    reverse: bool = flag("--reverse", "In the reverse order; runs without a value stay last.")
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class RecoverOptions:
    """Rebuild runs that a crash cut short, from their journals."""

    directory: Path | None = argument(
        "Folder of runs; if absent, the recordings folder and where journals move to.", None, metavar="FOLDER"
    )
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class EditOptions:
    """Edit metadata of runs, and keep the history.

    Measured data never change; --undo restores old values.
    """

    runs: list[Path] = shared.run_files()
    series: str | None = shared.series()
    table_mass: float | None = shared.table_mass()
    plate_mass: float | None = shared.plate_mass()
    pullback: float | None = number("--pullback", "Nominal pullback (m).", above=0.0)
    operator: str | None = option("--operator", "Who recorded.")
    title: str | None = option("--title", "Title of the run.")
    note: str | None = option("--note", "A remark.")
    calibration: Path | None = option("--calibration", "Calibration file; displacements are computed anew.")
    condition: list[str] | None = option(
        "--condition", "temperature_c=21.5, plate_id=P1, ...; repeatable.", metavar="NAME=VALUE"
    )
    exclude: str | None = option(
        "--exclude", "Leave the run out of tables and reports, and why.", metavar="REASON"
    )
    include: bool = flag("--include", "A run that was left out counts again.")
    author: str | None = option("--author", "Who edits; you, if absent.")
    undo: bool = flag("--undo", "Take the last edit back.")
    history: bool = flag("--history", "Show all edits.")


@dataclass(frozen=True, kw_only=True)
class TrashOptions:
    """Move runs to the trash, and bring them back.

    The trash is the folder .trash beside them.
    """

    runs: list[Path] | None = argument("Run files; with --list, a folder.", None, metavar="RUN")
    bring_back: bool = flag("--restore", "Bring runs back from the trash.")
    show: bool = flag("--list", "Show what is in the trash.")


@dataclass(frozen=True, kw_only=True)
class DoctorOptions:
    """Check installation, settings, gauges, ports and clocks.

    Recordings are checked too. Ends with 1 if something fails.
    """

    bundle: Path | None = option(
        "--bundle",
        "Write findings, versions, ports, settings and log to one file for a bug report.",
        metavar="FILE.zip",
    )
    compile_code: bool = flag(
        "--compile", "Compile all numerical code first, once after an installation: no test waits for it."
    )
    force: bool = shared.force()
    as_json: bool = shared.as_json()
