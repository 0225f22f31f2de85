"""Options of commands about run files, and of `doctor`."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import (
    ConditionOptions,
    Force,
    Json,
    MassOptions,
    PlateMass,
    Runs,
    SeriesCode,
    TableMass,
    choice,
    number,
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class FileOptions:
    """How the file is read: the fields of `CsvImport` and of its layout."""

    time: Annotated[str, typer.Option("--time", help="Time column: its name or number, from 0.")]
    table: Annotated[str, typer.Option("--table", help="Column of gauge 1, table against base.")]
    relative: Annotated[
        str | None, typer.Option("--relative", help="Column of gauge 2, plate against table.")
    ] = None
    plate: Annotated[str | None, typer.Option("--plate", help="Column of gauge 2, plate against base.")] = (
        None
    )
    unit: Annotated[
        str | None, choice("--unit", "m", "mm", "um", help="Length unit of the cells; m if absent.")
    ] = None
    gain: Annotated[
        float | None,
        typer.Option("--gain", help="Metres, or --unit-name, that a cell of 1 means; instead of --unit."),
    ] = None
    offset: Annotated[
        float | None,
        typer.Option("--offset", help="Metres, or --unit-name, that a cell of 0 means; with --gain."),
    ] = None
    unit_name: Annotated[
        str | None, typer.Option("--unit-name", help="Unit of the readings, where not metres.")
    ] = None
    gain_uncertainty: Annotated[
        float | None,
        typer.Option(
            "--gain-uncertainty", help="Relative standard uncertainty of the gain; not stated if absent."
        ),
    ] = None
    quantity: Annotated[
        str, choice("--quantity", "displacement", "velocity", "acceleration", help="What was measured.")
    ] = "displacement"
    time_unit: Annotated[str, choice("--time-unit", "s", "ms", "us", help="Unit of the times.")] = "s"
    delimiter: Annotated[
        str | None, typer.Option("--delimiter", help="A character, tab or space; detected if absent.")
    ] = None
    decimal: Annotated[str, choice("--decimal", ".", ",", help="Decimal sign.")] = "."
    skip: Annotated[int, typer.Option("--skip", help="Lines left out before the header.")] = 0
    no_header: Annotated[bool, typer.Option("--no-header", help="The first line is data.")] = False
    from_s: Annotated[
        float | None,
        typer.Option("--from", help="First time of the file that is kept (s); its beginning if absent."),
    ] = None
    until_s: Annotated[
        float | None,
        typer.Option("--until", help="Last time of the file that is kept (s); its end if absent."),
    ] = None
    segment: Annotated[
        int | None,
        typer.Option("--segment", help="Which stretch, from 0, where times go back between stretches."),
    ] = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Make a run of a CSV, .mat, .xlsx or .parquet file.

    Times are kept, uneven ones and gaps included.
    """

    file: Annotated[Path, typer.Argument(help="CSV, .mat, .xlsx or .parquet file.", metavar="FILE")]
    output: Annotated[Path, typer.Option("-o", "--output", help="Run file to write, RUN.h5.")]
    source: FileOptions
    masses: MassOptions
    operator: Annotated[str, typer.Option(help="Who recorded.")] = ""
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = ""
    conditions: ConditionOptions
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Write samples and coefficients of runs for other programs.

    The newest analysis kept in a run is taken, else it is analysed.
    """

    runs: Runs
    format_name: Annotated[
        str,
        choice("--format", "csv", "json", "parquet", "mat", "uff58", "xlsx", "latex", help="File format."),
    ]
    output: Annotated[
        Path, typer.Option("-o", "--output", help="File to write; a folder for the samples of several runs.")
    ]
    content: Annotated[
        str,
        choice(
            "--content",
            "both",
            "samples",
            "coefficients",
            help="samples, coefficients (one table of all runs), or both.",
        ),
    ] = "both"
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ListRunsOptions:
    """List recorded runs, oldest first.

    Files that cannot be read stand last with their fault.
    """

    directory: Annotated[
        Path | None, typer.Argument(help="Folder of runs; the recordings folder if absent.", metavar="[DIR]")
    ] = None
    series: SeriesCode = None
    since: Annotated[str | None, typer.Option(help="Only runs of this day or later: 2026-11-21.")] = None
    until: Annotated[str | None, typer.Option(help="Only runs of this day or earlier.")] = None
    operator: Annotated[str | None, typer.Option(help="Only runs of this operator.")] = None
    text: Annotated[
        str | None, typer.Option(help="Only runs with this in name, title, note, operator or source.")
    ] = None
    stale: Annotated[bool, typer.Option("--stale", help="Only runs changed since their newest analysis.")] = (
        False
    )
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecoverOptions:
    """Rebuild runs that a crash cut short, from their journals."""

    directory: Annotated[
        Path | None,
        typer.Argument(
            help="Folder of runs; if absent, the recordings folder and where journals move to.",
            metavar="[DIR]",
        ),
    ] = None
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class EditOptions:
    """Change what is known of runs, kept as history.

    What was measured is never touched, and --undo gives old values back.
    """

    runs: Runs
    series: SeriesCode = None
    table_mass: TableMass = None
    plate_mass: PlateMass = None
    pullback: Annotated[float | None, number("--pullback", above=0.0, help="Nominal pullback (m).")] = None
    operator: Annotated[str | None, typer.Option(help="Who recorded.")] = None
    title: Annotated[str | None, typer.Option(help="Title of the run.")] = None
    note: Annotated[str | None, typer.Option(help="A remark.")] = None
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file; displacements are computed anew from the counts.")
    ] = None
    condition: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="temperature_c=21.5, plate_id=P1, ...; repeatable."),
    ] = None
    exclude: Annotated[
        str | None,
        typer.Option(metavar="REASON", help="The run does not count in tables and reports, and why."),
    ] = None
    include: Annotated[bool, typer.Option("--include", help="A run that was left out counts again.")] = False
    author: Annotated[str | None, typer.Option(help="Who edits; you, if absent.")] = None
    undo: Annotated[bool, typer.Option("--undo", help="Take the last edit back.")] = False
    history: Annotated[bool, typer.Option("--history", help="Show all edits.")] = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrashOptions:
    """Move runs to the trash, and bring them back.

    The trash is the folder .trash beside them.
    """

    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run files; with --list, a folder.", metavar="[RUN...]")
    ] = None
    bring_back: Annotated[bool, typer.Option("--restore", help="Bring runs back from the trash.")] = False
    show: Annotated[bool, typer.Option("--list", help="Show what is in the trash.")] = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoctorOptions:
    """Check installation, settings, gauges, ports and clocks.

    Recordings are checked too. Ends with 1 if something fails.
    """

    bundle: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.zip",
            help="Write findings, versions, ports, settings and log to one file for a bug report.",
        ),
    ] = None
    force: Force = False
    as_json: Json = False
