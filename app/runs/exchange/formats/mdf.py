"""ASAM MDF files, by asammdf."""

import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import Table, TimeAxis


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Channels by their names, with the times of their master."""
    file = import_optional("asammdf", "MDF").MDF(path)
    start: datetime.datetime | None = file.header.start_time
    if start is not None and start.tzinfo is None:
        start = start.astimezone()
    masters = set(file.masters_db.items())
    places = [
        (group, index)
        for group, content in enumerate(file.groups)
        for index, _ in enumerate(content.channels)
        if (group, index) not in masters
    ]
    names = [str(file.groups[group].channels[index].name) for group, index in places]

    def signal(at: int) -> Any:
        group, index = places[at]
        return file.get(group=group, index=index)

    def column(at: int) -> NDArray[Any]:
        return np.asarray(signal(at).samples)

    def axis(at: int) -> TimeAxis | None:
        return TimeAxis(np.array(signal(at).timestamps, np.float64), start)

    units = [str(file.get_channel_unit(group=group, index=index)) for group, index in places]
    lengths = [int(file.groups[group].channel_group.cycles_nr) for group, _ in places]
    return Table(names, column, units=units, axis=axis, has_axis=True, lengths=lengths)
