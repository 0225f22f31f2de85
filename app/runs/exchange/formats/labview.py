"""LabVIEW measurement files (LVM), by lvm_read."""

import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import CsvOptions
from app.runs.exchange.tables import Table, TimeAxis, even_axis


def open_table(path: Path, _layout: CsvOptions, _report: ReportShare) -> Table:
    """Channels of the first segment by their names, with its time column or its `Delta_X`."""
    # Its pickle beside the file may hold any code, and is neither read nor written.
    content: dict[Any, Any] = import_optional("lvm_read", "LVM").read(
        str(path), read_from_pickle=False, dump_file=False
    )
    segment = content.get(0)
    if not segment or not len(segment["data"]):
        raise ImportFileError("{path} holds no rows. Give a file with numbers", path=path)
    data = np.asarray(segment["data"], np.float64)
    has_x = str(content.get("X_Columns", "")).strip() in ("One", "Multi")
    is_multi = str(content.get("X_Columns", "")).strip() == "Multi"
    count = int(segment["Channels"])
    labels = [str(name).strip() for name in segment.get("Channel names", [])]
    labels = [name for name in labels if name not in ("X_Value", "Comment")]
    names = [name or f"channel {at}" for at, name in enumerate(labels[:count])]
    names += [f"channel {at}" for at in range(len(names), count)]
    columns = [2 * at + 1 if is_multi else at + has_x for at in range(count)]
    start = _start(content, segment)

    def column(at: int) -> NDArray[Any]:
        return data[:, columns[at]]

    def axis(at: int) -> TimeAxis | None:
        step_s, first_s = _number(segment, "Delta_X", at), _number(segment, "X0", at)
        if has_x:
            return TimeAxis(data[:, columns[at] - 1 if is_multi else 0].copy(), start)
        return even_axis(len(data), step_s, first_s, start) if step_s > 0.0 else None

    units = [str(unit).strip() for unit in segment.get("Y_Unit_Label", [])]
    return Table(names, column, units=units, axis=axis, has_axis=True)


def _number(segment: dict[str, Any], name: str, at: int) -> float:
    values = np.atleast_1d(segment.get(name, 0.0))
    return float(values[min(at, len(values) - 1)]) if len(values) else 0.0


def _start(content: dict[Any, Any], segment: dict[str, Any]) -> datetime.datetime | None:
    """Date and time of the segment's first channel, else of the file; in the zone of this computer."""
    for told in (segment, content):
        date, time = (np.atleast_1d(told.get(name, ""))[0] for name in ("Date", "Time"))
        text = f"{date} {str(time)[:15].replace(',', '.')}"
        for pattern in ("%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S"):
            try:
                return datetime.datetime.strptime(text, pattern).astimezone()
            except ValueError:
                continue
    return None
