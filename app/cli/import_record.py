"""`slipstand import`: a record made by another program becomes a run."""

import msgspec

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.option_values import checked_conditions, print_mass_overrides
from app.cli.run_file_options import FileOptions, ImportOptions
from app.runs.exchange.importing import CsvImport, import_csv
from config.files import load_stand


def import_record(options: ImportOptions) -> None:
    plan = _plan(options.source)
    if options.output.suffix != ".h5":
        raise CommandError(f"-o {options.output.name} does not end in .h5, as run files do. Rename it")
    checked = checked_conditions(options.conditions)
    stored = import_csv(
        options.file.expanduser(),
        plan,
        out.output_file(options.output, options.force),
        load_stand(),
        replace=options.force,
        series=options.masses.series,
        plate_mass_kg=options.masses.plate_mass,
        table_mass_kg=options.masses.table_mass,
        operator=options.operator,
        note=options.note,
        conditions=checked,
    )
    print_mass_overrides(options.masses)
    if options.as_json:
        out.print_json({"run": str(stored.path), "samples": stored.samples})
    else:
        out.print_line(f"{stored.path}: {stored.samples} samples")


def _plan(source: FileOptions) -> CsvImport:
    if source.relative is not None and source.plate is not None:
        raise CommandError("--relative and --plate are both gauge 2. Give one of them")
    if source.offset is not None and source.gain is None:
        raise CommandError(
            f"--offset {source.offset:g} goes with --gain, in whose unit it is. Give --gain too"
        )
    if source.skip < 0:
        raise CommandError(f"--skip {source.skip} lines cannot be left out. Give 0 or more")
    layout = {
        "time": source.time,
        "table": source.table,
        "second": source.plate if source.relative is None else source.relative,
        "delimiter": source.delimiter,
        "decimal": source.decimal,
        "skip": source.skip,
        "header": not source.no_header,
    }
    same = ("unit", "gain", "unit_name", "gain_uncertainty", "quantity", "time_unit", "from_s", "until_s",
            "segment")  # fmt: skip
    fields = {name: getattr(source, name) for name in same} | {
        "layout": layout,
        "measures": "relative" if source.plate is None else "plate",
        "offset": source.offset or 0.0,
    }
    try:
        return msgspec.convert(fields, CsvImport)
    except msgspec.ValidationError:
        raise CommandError("the options do not fit together. See slipstand import --help") from None
