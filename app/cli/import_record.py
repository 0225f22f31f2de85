"""`slipstand import`: a record made by another program becomes a run."""

import dataclasses
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import ConditionOptions, Force, Json, MassOptions, choice, with_options
from app.runs.exchange.importing import CsvImport, import_csv
from config.files import load_stand


@dataclasses.dataclass(frozen=True)
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

    def plan(self) -> CsvImport:
        """Return how to read the file. Raises CommandError."""
        if self.relative is not None and self.plate is not None:
            raise CommandError("--relative and --plate are both gauge 2. Give one of them")
        if self.offset is not None and self.gain is None:
            raise CommandError(
                f"--offset {self.offset:g} goes with --gain, in whose unit it is. Give --gain too"
            )
        if self.skip < 0:
            raise CommandError(f"--skip {self.skip} lines cannot be left out. Give 0 or more")
        layout = {
            "time": self.time,
            "table": self.table,
            "second": self.plate if self.relative is None else self.relative,
            "delimiter": self.delimiter,
            "decimal": self.decimal,
            "skip": self.skip,
            "header": not self.no_header,
        }
        same = ("unit", "gain", "unit_name", "gain_uncertainty", "quantity", "time_unit", "from_s", "until_s",
                "segment")  # fmt: skip
        fields = {name: getattr(self, name) for name in same} | {
            "layout": layout,
            "measures": "relative" if self.plate is None else "plate",
            "offset": self.offset or 0.0,
        }
        try:
            return msgspec.convert(fields, CsvImport)
        except msgspec.ValidationError:
            raise CommandError("the options do not fit together. See slipstand import --help") from None


@with_options
def import_record(
    *,
    file: Annotated[Path, typer.Argument(help="CSV, .mat, .xlsx or .parquet file.", metavar="FILE")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Run file to write, RUN.h5.")],
    source: FileOptions,
    masses: MassOptions,
    operator: Annotated[str, typer.Option(help="Who recorded.")] = "",
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = "",
    conditions: ConditionOptions,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Make a run of a CSV, .mat, .xlsx or .parquet file.

    Times are kept, uneven ones and gaps included.
    """
    plan = source.plan()
    if output.suffix != ".h5":
        raise CommandError(f"-o {output.name} does not end in .h5, as run files do. Rename it")
    checked = conditions.conditions()
    stored = import_csv(
        file.expanduser(),
        plan,
        out.output_file(output, force),
        load_stand(),
        replace=force,
        series=masses.series,
        plate_mass_kg=masses.plate_mass,
        table_mass_kg=masses.table_mass,
        operator=operator,
        note=note,
        conditions=checked,
    )
    masses.print_overrides()
    if as_json:
        out.print_json({"run": str(stored.path), "samples": stored.samples})
    else:
        out.print_line(f"{stored.path}: {stored.samples} samples")
