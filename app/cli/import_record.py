"""`slipstand import`: a record made by another program becomes a run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from app.cli.errors import CommandError
from app.cli.options import (
    ContactId,
    Force,
    Humidity,
    Json,
    OtherConditions,
    PlateId,
    PlateMass,
    RunIn,
    SeriesCode,
    Surface,
    TableMass,
    Temperature,
    build_conditions,
    positive,
    print_mass_overrides,
)


def import_record(
    file: Annotated[Path, typer.Argument(help="CSV, .mat, .xlsx or .parquet file.", metavar="FILE")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Run file to write, RUN.h5.")],
    time: Annotated[str, typer.Option(help="Time column: its name or number, from 0.")],
    table: Annotated[str, typer.Option(help="Column of gauge 1, table against base.")],
    relative: Annotated[str | None, typer.Option(help="Column of gauge 2, plate against table.")] = None,
    plate: Annotated[str | None, typer.Option(help="Column of gauge 2, plate against base.")] = None,
    unit: Annotated[
        str | None, typer.Option(help="Length unit of the cells: m, mm or um; m if absent.")
    ] = None,
    gain: Annotated[
        float | None,
        typer.Option(help="Metres, or --unit-name, that a cell of 1 stands for; instead of --unit."),
    ] = None,
    offset: Annotated[
        float | None, typer.Option(help="Metres, or --unit-name, that a cell of 0 stands for; with --gain.")
    ] = None,
    unit_name: Annotated[str | None, typer.Option(help="Unit of the readings, where not metres.")] = None,
    gain_uncertainty: Annotated[
        float | None, typer.Option(help="Relative standard uncertainty of the gain; not stated if absent.")
    ] = None,
    quantity: Annotated[str, typer.Option(help="displacement, velocity or acceleration.")] = "displacement",
    time_unit: Annotated[str, typer.Option(help="s, ms or us.")] = "s",
    delimiter: Annotated[
        str | None, typer.Option(help="A character, tab or space; found out if absent.")
    ] = None,
    decimal: Annotated[str, typer.Option(help="Decimal sign: . or ,")] = ".",
    skip: Annotated[int, typer.Option(help="Lines left out before the header.")] = 0,
    no_header: Annotated[bool, typer.Option("--no-header", help="The first line is data.")] = False,
    from_s: Annotated[
        float | None,
        typer.Option("--from", help="First time of the file that is kept (s); its beginning if absent."),
    ] = None,
    until_s: Annotated[
        float | None,
        typer.Option("--until", help="Last time of the file that is kept (s); its end if absent."),
    ] = None,
    segment: Annotated[
        int | None, typer.Option(help="Which stretch, from 0, where times go back between stretches.")
    ] = None,
    series: SeriesCode = None,
    plate_mass: PlateMass = None,
    table_mass: TableMass = None,
    operator: Annotated[str, typer.Option(help="Who recorded.")] = "",
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = "",
    temperature: Temperature = None,
    humidity: Humidity = None,
    plate_id: PlateId = "",
    contact_id: ContactId = "",
    surface: Surface = "",
    run_in: RunIn = None,
    condition: OtherConditions = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Make a run of a CSV, .mat, .xlsx or .parquet file.

    Times are kept, uneven ones and gaps included.
    """
    import msgspec

    from app.cli import output as out
    from app.runs.exchange.importing import CsvImport, import_csv
    from config.files import load_stand

    if relative is not None and plate is not None:
        raise CommandError("--relative and --plate are both gauge 2. Give one of them")
    if offset is not None and gain is None:
        raise CommandError(f"--offset {offset:g} goes with --gain, in whose unit it is. Give --gain too")
    if skip < 0:
        raise CommandError(f"--skip {skip} lines cannot be left out. Give 0 or more")
    if output.suffix != ".h5":
        raise CommandError(f"-o {output.name} does not end in .h5, as run files do. Rename it")
    positive("--plate-mass", plate_mass)
    positive("--table-mass", table_mass)
    wanted = {
        "layout": {"time": time, "table": table, "second": plate if relative is None else relative,
                   "delimiter": delimiter, "decimal": decimal, "skip": skip, "header": not no_header},
        "measures": "relative" if plate is None else "plate", "time_unit": time_unit, "unit": unit,
        "gain": gain, "offset": offset or 0.0, "unit_name": unit_name, "gain_uncertainty": gain_uncertainty,
        "quantity": quantity, "from_s": from_s, "until_s": until_s, "segment": segment,
    }  # fmt: skip
    try:
        plan = msgspec.convert(wanted, CsvImport)
    except msgspec.ValidationError:
        raise CommandError(_not_allowed(wanted | {"decimal": decimal})) from None
    conditions = build_conditions(temperature, humidity, plate_id, contact_id, surface, run_in, condition)
    stored = import_csv(
        file.expanduser(), plan, out.output_file(output, force), load_stand(), replace=force,
        series=series, plate_mass_kg=plate_mass, table_mass_kg=table_mass, operator=operator, note=note,
        conditions=conditions,
    )  # fmt: skip
    print_mass_overrides(series, table_mass, plate_mass)
    document = {"run": str(stored.path), "samples": stored.samples}
    if as_json:
        out.print_json(document)
    else:
        out.print_line(f"{stored.path}: {stored.samples} samples")


_ALLOWED = {
    "time_unit": ("s", "ms", "us"),
    "unit": (None, "m", "mm", "um"),
    "quantity": ("displacement", "velocity", "acceleration"),
    "decimal": (".", ","),
}


def _not_allowed(wanted: Mapping[str, object]) -> str:
    """Name the option whose value is not one of the allowed ones."""
    for name, allowed in _ALLOWED.items():
        if wanted[name] not in allowed:
            words = ", ".join(word for word in allowed if word)
            return f"--{name.replace('_', '-')} {wanted[name]!r} is not known. Use {words}"
    return "the options do not fit together. See slipstand import --help"
