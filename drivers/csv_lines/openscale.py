r"""Lines of a SparkFun OpenScale: which of its columns are switched on shows in the lines themselves.

Firmware 1.2 sends `[ms,]value,lbs|kg,[raw,][t,][t,]` and firmware 1.0 `[ms,][t,][t,]value,lbs|kg`, each ended
by `\r\n`, after a banner; at 9600 baud and two lines a second unless set otherwise (sparkfun/OpenScale,
firmware/OpenScale/OpenScale/OpenScale.ino, `loop`, and System.ino, `set_default_settings`).
"""

from itertools import pairwise

from drivers.csv_lines.columns import Column, LineFormat

UNITS = ("kg", "lbs")
DEFAULT_FORMAT = LineFormat((Column.TIME_MS, Column.VALUE, Column.UNIT, Column.EMPTY), unit="kg")
"""With a time and no temperatures, in kg."""
_LINES_NEEDED = 3


def find_layout(data: bytes) -> LineFormat | None:
    """Layout of the first three lines of `data`, one after the other, that agree; None without such.

    A first field is a time only where it grows from line to line in whole numbers: a temperature without a
    sensor is a whole 0.
    """
    lines = [line for line in data[: data.rfind(b"\n") + 1].splitlines() if line]
    rows = [line.decode("ascii", "replace").split(",") for line in lines]
    shapes = [_shape(row) for row in rows]
    for end in range(_LINES_NEEDED, len(rows) + 1):
        start = end - _LINES_NEEDED
        if shapes[start] is not None and len(set(shapes[start:end])) == 1:
            return _layout_of(rows[start:end])
    return None


def _layout_of(rows: list[list[str]]) -> LineFormat:
    unit_at = next(at for at, field in enumerate(rows[0]) if field in UNITS)
    columns = [Column.IGNORE if field else Column.EMPTY for field in rows[0]]
    columns[unit_at - 1 : unit_at + 1] = Column.VALUE, Column.UNIT
    if unit_at > 1 and _is_clock([row[0] for row in rows]):
        columns[0] = Column.TIME_MS
    return LineFormat(tuple(columns), unit=rows[0][unit_at])


def _shape(fields: list[str]) -> tuple[str, ...] | None:
    """What sort of thing each field holds; None if these are not the fields of such a line."""
    units = [at for at, field in enumerate(fields) if field in UNITS]
    numbers = [field for field in fields if field and field not in UNITS]
    if len(units) != 1 or units[0] == 0 or "" in fields[:-1] or not all(map(_is_number, numbers)):
        return None
    return tuple(field if field in UNITS else "number" if field else "" for field in fields)


def _is_number(field: str) -> bool:
    return field.removeprefix("-").replace(".", "", 1).isdigit()


def _is_clock(fields: list[str]) -> bool:
    if not all(field.removeprefix("-").isdigit() for field in fields):
        return False
    times = [int(field) for field in fields]
    return all(before < after for before, after in pairwise(times))
