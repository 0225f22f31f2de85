"""Options of commands about run files, and of `doctor`."""

from dataclasses import dataclass
from pathlib import Path

from app.cli import options as opt
from app.cli.options import ConditionOptions, MassOptions


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """How the file is read: the fields of `CsvImport` and of its layout."""

    time: str = opt.option("--time", "Time column: its name or number, from 0.", opt.REQUIRED)
    table: str = opt.option("--table", "Column of gauge 1, table against base.", opt.REQUIRED)
    relative: str | None = opt.option("--relative", "Column of gauge 2, plate against table.")
    plate: str | None = opt.option("--plate", "Column of gauge 2, plate against base.")
    unit: str | None = opt.choice("--unit", ("m", "mm", "um"), "Length unit of the cells; m if absent.")
    gain: float | None = opt.option(
        "--gain", "Metres, or --unit-name, that a cell of 1 means; instead of --unit."
    )
    offset: float | None = opt.option(
        "--offset", "Metres, or --unit-name, that a cell of 0 means; with --gain."
    )
    unit_name: str | None = opt.option("--unit-name", "Unit of the readings, where not metres.")
    gain_uncertainty: float | None = opt.option(
        "--gain-uncertainty", "Relative standard uncertainty of the gain; not stated if absent."
    )
    quantity: str = opt.choice(
        "--quantity", ("displacement", "velocity", "acceleration"), "What was measured.", "displacement"
    )
    time_unit: str = opt.choice("--time-unit", ("s", "ms", "us"), "Unit of the times.", "s")
    delimiter: str | None = opt.option("--delimiter", "A character, tab or space; detected if absent.")
    decimal: str = opt.choice("--decimal", (".", ","), "Decimal sign.", ".")
    skip: int = opt.option("--skip", "Lines left out before the header.", 0)
    no_header: bool = opt.flag("--no-header", "The first line is data.")
    from_s: float | None = opt.option(
        "--from", "First time of the file that is kept (s); its beginning if absent."
    )
    until_s: float | None = opt.option(
        "--until", "Last time of the file that is kept (s); its end if absent."
    )
    segment: int | None = opt.option(
        "--segment", "Which stretch, from 0, where times go back between stretches."
    )


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Make a run of a CSV, .mat, .xlsx or .parquet file.

    Times are kept, uneven ones and gaps included.
    """

    file: Path = opt.argument("CSV, .mat, .xlsx or .parquet file.", metavar="FILE")
    output: Path = opt.option("-o --output", "Run file to write, RUN.h5.", opt.REQUIRED)
    source: FileOptions
    masses: MassOptions
    operator: str = opt.option("--operator", "Who recorded.", "")
    note: str = opt.option("--note", "A remark kept with the run.", "")
    conditions: ConditionOptions
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Write samples and coefficients of runs for other programs.

    The newest analysis kept in a run is taken, else it is analysed.
    """

    runs: list[Path] = opt.run_files()
    format_name: str = opt.choice(
        "--format", ("csv", "json", "parquet", "mat", "uff58", "xlsx", "latex"), "File format.", opt.REQUIRED
    )
    output: Path = opt.option(
        "-o --output", "File to write; a folder for the samples of several runs.", opt.REQUIRED
    )
    content: str = opt.choice(
        "--content",
        ("both", "samples", "coefficients"),
        "samples, coefficients (one table of all runs), or both.",
        "both",
    )
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ListRunsOptions:
    """List recorded runs, oldest first.

    Files that cannot be read stand last with their fault.
    """

    directory: Path | None = opt.argument(
        "Folder of runs; the recordings folder if absent.", None, metavar="[DIR]"
    )
    series: str | None = opt.series()
    since: str | None = opt.option("--since", "Only runs of this day or later: 2026-11-21.")
    until: str | None = opt.option("--until", "Only runs of this day or earlier.")
    operator: str | None = opt.option("--operator", "Only runs of this operator.")
    text: str | None = opt.option("--text", "Only runs with this in name, title, note, operator or source.")
    stale: bool = opt.flag("--stale", "Only runs changed since their newest analysis.")
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class RecoverOptions:
    """Rebuild runs that a crash cut short, from their journals."""

    directory: Path | None = opt.argument(
        "Folder of runs; if absent, the recordings folder and where journals move to.", None, metavar="[DIR]"
    )
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class EditOptions:
    """Change what is known of runs, kept as history.

    What was measured is never touched, and --undo gives old values back.
    """

    runs: list[Path] = opt.run_files()
    series: str | None = opt.series()
    table_mass: float | None = opt.table_mass()
    plate_mass: float | None = opt.plate_mass()
    pullback: float | None = opt.number("--pullback", "Nominal pullback (m).", above=0.0)
    operator: str | None = opt.option("--operator", "Who recorded.")
    title: str | None = opt.option("--title", "Title of the run.")
    note: str | None = opt.option("--note", "A remark.")
    calibration: Path | None = opt.option(
        "--calibration", "Calibration file; displacements are computed anew from the counts."
    )
    condition: list[str] | None = opt.option(
        "--condition", "temperature_c=21.5, plate_id=P1, ...; repeatable.", metavar="NAME=VALUE"
    )
    exclude: str | None = opt.option(
        "--exclude", "The run does not count in tables and reports, and why.", metavar="REASON"
    )
    include: bool = opt.flag("--include", "A run that was left out counts again.")
    author: str | None = opt.option("--author", "Who edits; you, if absent.")
    undo: bool = opt.flag("--undo", "Take the last edit back.")
    history: bool = opt.flag("--history", "Show all edits.")


@dataclass(frozen=True, kw_only=True)
class TrashOptions:
    """Move runs to the trash, and bring them back.

    The trash is the folder .trash beside them.
    """

    runs: list[Path] | None = opt.argument("Run files; with --list, a folder.", None, metavar="[RUN...]")
    bring_back: bool = opt.flag("--restore", "Bring runs back from the trash.")
    show: bool = opt.flag("--list", "Show what is in the trash.")


@dataclass(frozen=True, kw_only=True)
class DoctorOptions:
    """Check installation, settings, gauges, ports and clocks.

    Recordings are checked too. Ends with 1 if something fails.
    """

    bundle: Path | None = opt.option(
        "--bundle",
        "Write findings, versions, ports, settings and log to one file for a bug report.",
        metavar="FILE.zip",
    )
    force: bool = opt.force()
    as_json: bool = opt.as_json()
