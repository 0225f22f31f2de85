"""NI TDMS files, by npTDMS."""

import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.stamps import to_datetime
from app.runs.exchange.tables import Table, TimeAxis, even_axis


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Channels as `group/channel`, by the channel alone where one group has it; times of their waveform."""
    module = import_optional("nptdms", "TDMS")
    with module.TdmsFile.open(path) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        properties = [dict(channel.properties) for channel in channels]
        places = [(channel.group_name, channel.name) for channel in channels]
        lengths = [len(channel) for channel in channels]
    plain = [name for _, name in places]
    names = [name if plain.count(name) == 1 else f"{group}/{name}" for group, name in places]

    def column(at: int) -> NDArray[Any]:
        group, name = places[at]
        with module.TdmsFile.open(path) as file:
            return np.asarray(file[group][name][:])

    def axis(at: int) -> TimeAxis | None:
        told = properties[at]
        if not float(told.get("wf_increment", 0.0)) > 0.0:
            return None
        offset_s = float(told.get("wf_start_offset", 0.0))
        return even_axis(
            lengths[at], float(told["wf_increment"]), offset_s, _start(told.get("wf_start_time"))
        )

    units = [str(told.get("unit_string", "")) for told in properties]
    has_axis = any("wf_increment" in one for one in properties)
    return Table(names, column, units=units, axis=axis, has_axis=has_axis, has_zone=True, lengths=lengths)


def _start(value: Any) -> datetime.datetime | None:
    """TDMS keeps times in UTC; the year 1904 is that of a channel without one."""
    if not isinstance(value, np.datetime64) or value < np.datetime64("1970-01-01"):
        return None
    return to_datetime(int(value.astype("M8[ns]").astype(np.int64)), has_zone=True)
