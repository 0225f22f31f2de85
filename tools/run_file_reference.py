"""Write docs/reference/run-file.md from `app.runs.schema`: `python -m tools.run_file_reference`."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from app.runs import schema
from app.runs.schema import Column, Field

REFERENCE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "run-file.md"
_INTRODUCTION = f"""# Run file

Every group, column and metadata field of a run file, format {schema.SCHEMA}. This page is written from
`app/runs/schema.py` by `python -m tools.run_file_reference`; a test compares both. recordings/README.md says
how to read a run and what holds for it.

Paths are relative to the root. A required field is in every file. The others are left out where nothing is
known, or NaN (a text: empty) where a value is known at the end only. "Since" is the version of the program
that wrote the field first.
"""


_USER_GROUPS = (
    (schema.OTHER_CONDITIONS, "NXcollection", "further conditions, one text each, named by the user"),
    (f"{schema.STAND}/geometry", "NXcollection", "geometry of the stand, one number each"),
    (schema.TRUTH, "NXcollection", "parameters of a simulated run, as attributes"),
    (f"{schema.HISTORY}/change_NNN", "NXnote", "one edit: its new values as JSON in `description`"),
    (f"{schema.ENTRY}/{schema.ANALYSIS_PREFIX}NNN", "NXprocess", "an analysis, as JSON in `document`"),
)
_READINGS = {
    "table_displacement": "gauge 1, calibrated; named by what was measured",
    "relative_displacement": (
        "gauge 2, calibrated; `plate_...` where it measures the plate against the base"
    ),
}
_COLUMNS = (
    schema.TIME_COLUMN,
    *(
        Column(f"{schema.MOTION}/{name}", description, "float64", {"units": "m"})
        for name, description in _READINGS.items()
    ),
    schema.STATUS_COLUMN,
    *(
        Column(
            schema.count_path(gauge), f"gauge {gauge + 1} as received", "int32 or float64", {"units": "count"}
        )
        for gauge in range(len(schema.GAUGES))
    ),
    *schema.WIRE_COLUMNS,
)


def reference() -> str:
    """Text of the page."""
    return "\n".join(
        [
            _INTRODUCTION,
            "## Groups\n",
            *_table(("group", "class"), [(f"`{path}`", kind) for path, kind in schema.GROUPS.items()]),
            "\nOnly where there is something in them:\n",
            *_table(("group", "class", "holds"), [(f"`{path}`", *rest) for path, *rest in _USER_GROUPS]),
            "\n## Columns\n",
            *_table(("dataset", "type", "unit", "is"), map(_column, _COLUMNS)),
            "\n`entry/run/crc32` holds the CRC-32 of each column (uint32), written when the run is closed.\n",
            "## Known at the start\n",
            *_fields(schema.RUN_FIELDS),
            "\n## Each gauge, in `entry/instrument/gauge_table` and `gauge_plate`\n",
            *_fields(schema.GAUGE_FIELDS),
            "\n## Last check of a gauge, in its group `last_check`\n",
            *_fields(schema.CHECK_FIELDS),
            "\n## Known at the end\n",
            *_fields(schema.END_FIELDS),
            "\n## Written by the program\n",
            *_fields(schema.PROGRAM_FIELDS),
            "\n## Each saved analysis, in its group `analysis_NNN`\n",
            *_fields(schema.ANALYSIS_FIELDS),
            "\nThe groups `results`, `model`, `tried`, `budget`, `events` and `warnings` beside them repeat"
            "\nparts of `document` for other programs; this one reads `document`. An analysis whose texts"
            "\ndiffer from their checksum, or whose groups hold anything but what `document` says, is"
            "\nreported as damaged and not used. Files of earlier versions without it are checked by their"
            "\ngroups alone.",
            "",
        ]
    )


def _fields(fields: Sequence[Field]) -> list[str]:
    rows = [
        (
            f"`{field.path}`",
            field.kind.value,
            field.unit.format(unit="unit"),
            "required" if field.required else "",
            field.since,
            field.description,
        )
        for field in fields
    ]
    return _table(("field", "type", "unit", "", "since", "is"), rows)


def _column(column: Column) -> tuple[str, ...]:
    return (f"`{column.path}`", column.dtype, column.attributes.get("units", ""), column.description)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [header, ["---"] * len(header), *rows]
    return [f"| {' | '.join(cells)} |" for cells in lines]


if __name__ == "__main__":
    REFERENCE.write_text(reference(), encoding="utf-8")
